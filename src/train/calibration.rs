//! Calibration: whether predicted probabilities are frequencies, and the slope and offset that make them so.
//!
//! A network that says 0.8 of many sites is calibrated if 80 % of them are positive. A slope of the margin between its
//! logits repairs what is too sure or not sure enough (temperature scaling: Guo, Pleiss, Sun and Weinberger, *On
//! calibration of modern neural networks*, 2017), an offset what is said too often or too seldom (Platt, *Probabilistic
//! outputs for support vector machines*, 1999). The offset moves decisions, too. Heads of more than two classes have a
//! slope alone, of all their logits.

use super::evaluate::predict;
use crate::data::Sample;
use crate::learn::loss::{check_logits, check_targets};
use crate::model::heads::N_HEADS;
use crate::model::{Calibration, Model, SiteNetwork};
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};

/// The calibration of each head at which the labels of `samples` are most likely; sets [`Model::calibration`] to it.
///
/// The samples should be a validation set: on what the network learned from it is too sure for good reason.
///
/// # Errors
/// If there are no samples, one is inconsistent, a head has labels of one class alone, or its margins are no better
/// than chance or never wrong.
pub fn fit<N: SiteNetwork<f32>>(
    model: &mut Model<f32, N>,
    samples: &[Sample],
) -> Result<[Calibration; N_HEADS]> {
    model.calibration = [Calibration::IDENTITY; N_HEADS];
    let mut margins: [Vec<(f64, bool)>; N_HEADS] = Default::default();
    for sample in samples {
        sample.check()?;
        let found = predict(model, sample)?;
        let truth = [&sample.answers.inaccessible(), &sample.answers.occlusion];
        let logits = [&found.logits_inaccessible, &found.logits_occlusion];
        for (head, margins) in margins.iter_mut().enumerate() {
            let margin = |[no, yes]: &[f32; 2]| f64::from(*yes) - f64::from(*no);
            margins.extend(logits[head].iter().map(margin).zip(truth[head].iter().copied()));
        }
    }
    let mut calibration = [Calibration::IDENTITY; N_HEADS];
    for (found, margins) in calibration.iter_mut().zip(&margins) {
        *found = most_likely(margins).ok_or_else(no_calibration)?;
    }
    model.calibration = calibration;
    Ok(calibration)
}

impl Calibration {
    /// The calibration of one head of any network at which `classes` are most likely by its logits,
    /// `[n, n_classes]` row-major: of two classes slope and offset, of more the slope alone (temperature scaling).
    ///
    /// ```
    /// use deepmill::model::Calibration;
    ///
    /// // Ten rows with the same logits; eight are of class 2, one is of each other class.
    /// let logits = [0.0, 0.0, 4.0].repeat(10);
    /// let found = Calibration::fit(&logits, &[2_u8, 2, 2, 2, 0, 2, 2, 2, 2, 1], 3)?;
    /// assert!((found.slope - 8_f64.ln() / 4.0).abs() < 1e-9); // e^(4 · slope) is 8
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    ///
    /// Its samples should be a validation set. [`Calibration::calibrate`] applies it; serde writes it beside a model.
    ///
    /// # Errors
    /// If there are fewer than two classes, a class is none of them, the number of logits is not that of rows times
    /// classes, or a logit is not finite; if the network is no better than chance or never errs, or of two classes
    /// there is one alone.
    pub fn fit<T: Scalar, C: Copy + Into<usize>>(
        logits: &[T],
        classes: &[C],
        n_classes: usize,
    ) -> Result<Self> {
        if n_classes < 2 {
            let remedy = "a network that knows one class has no probabilities";
            return Err(Error::argument("n_classes", n_classes, "2 or more", remedy));
        }
        check_targets(classes, n_classes)?;
        check_logits(logits.len(), classes.len(), n_classes)?;
        if let Some(i) = logits.iter().position(|logit| !logit.to_f64().is_finite()) {
            return Err(Error::NotFinite {
                place: format!("row {}, class {}", i / n_classes, i % n_classes),
                found: format!("the logit is {}", logits[i].to_f64()),
                remedy: "train again with a lower learning rate".into(),
            });
        }
        let rows = logits.chunks_exact(n_classes).zip(classes.iter().map(|&class| class.into()));
        let found = match n_classes {
            2 => {
                let margin =
                    |(row, class): (&[T], _)| (row[1].to_f64() - row[0].to_f64(), class == 1);
                most_likely(&rows.map(margin).collect::<Vec<_>>())
            }
            _ => most_likely_slope(&rows.collect::<Vec<_>>()),
        };
        found.ok_or_else(no_calibration)
    }
}

fn no_calibration() -> Error {
    let found =
        "labels of one class alone, or a network that is no better than chance or never errs";
    let expected = "labels of both classes and predictions that are mostly right";
    let remedy = "take a validation set of several parts, and train longer";
    Error::argument("calibration", found, expected, remedy)
}

/// No network is so unsure.
const MOST_SLOPE: f64 = 1e3;
/// Newton steps: more than ever needed.
const N_STEPS: usize = 100;

/// The calibration that minimizes the mean of `log(1 + exp(-s (slope m + offset)))`, where `s` is 1 for a positive and
/// -1 for a negative, by Newton's method with halved steps: it is convex. `None` if there is no minimum of positive
/// slope.
fn most_likely(margins: &[(f64, bool)]) -> Option<Calibration> {
    let mut at = Calibration::IDENTITY;
    let mut here = Loss::of(margins, at);
    for _ in 0..N_STEPS {
        let [slope, offset] = here.newton_step()?;
        let mut share = 1.0;
        let (next, there) = loop {
            let next =
                Calibration { slope: at.slope - share * slope, offset: at.offset - share * offset };
            let there = Loss::of(margins, next);
            if there.value <= here.value || share < 1e-9 {
                break (next, there);
            }
            share *= 0.5;
        };
        let moved = (next.slope - at.slope).abs() + (next.offset - at.offset).abs();
        (at, here) = (next, there);
        if moved < 1e-10 {
            break;
        }
    }
    (at.is_sound() && at.slope < MOST_SLOPE).then_some(at)
}

/// The slope that minimizes the sum of `log Σ exp(slope z) − slope z_y` over rows `z` of class `y`, which is convex:
/// where its derivative changes the sign. `None` if that is at 0 or less, or beyond every sensible slope.
fn most_likely_slope<T: Scalar>(rows: &[(&[T], usize)]) -> Option<Calibration> {
    // Σ softmax(slope z) · z − z_y over all rows.
    let derivative = |slope: f64| -> f64 {
        let of_row = |&(row, class): &(&[T], usize)| {
            let greatest = row.iter().fold(f64::NEG_INFINITY, |most, z| most.max(z.to_f64()));
            let (mut sum, mut weighted) = (0.0, 0.0);
            for z in row.iter().map(|z| z.to_f64() - greatest) {
                let weight = libm::exp(slope * z);
                sum += weight;
                weighted += weight * z;
            }
            weighted / sum - (row[class].to_f64() - greatest)
        };
        rows.iter().map(of_row).sum()
    };
    let (mut low, mut high) = (0.0, MOST_SLOPE);
    let crosses = derivative(low) < 0.0 && derivative(high) > 0.0;
    while crosses && high - low > 1e-12 * high {
        let middle = 0.5 * (low + high);
        if derivative(middle) < 0.0 { low = middle } else { high = middle }
    }
    crosses.then_some(Calibration { slope: 0.5 * (low + high), offset: 0.0 })
}

/// Sum of the losses of all margins, with its derivatives by slope and offset.
struct Loss {
    value: f64,
    first: [f64; 2],
    /// By slope twice, by both, by offset twice.
    second: [f64; 3],
}

impl Loss {
    fn of(margins: &[(f64, bool)], at: Calibration) -> Self {
        let mut sum = Loss { value: 0.0, first: [0.0; 2], second: [0.0; 3] };
        for &(margin, positive) in margins {
            let z = at.slope * margin + at.offset;
            // log(1 + exp(-|z|)) never overflows.
            let tail = libm::exp(-z.abs());
            let probability = if z > 0.0 { 1.0 / (1.0 + tail) } else { tail / (1.0 + tail) };
            let signed = if positive { -z } else { z };
            sum.value += libm::log1p(tail) + signed.max(0.0);
            let error = probability - f64::from(u8::from(positive));
            let weight = probability * (1.0 - probability);
            sum.first[0] += error * margin;
            sum.first[1] += error;
            sum.second[0] += weight * margin * margin;
            sum.second[1] += weight * margin;
            sum.second[2] += weight;
        }
        sum
    }

    /// Second derivatives' inverse times the first; `None` where they are singular.
    fn newton_step(&self) -> Option<[f64; 2]> {
        let ([a, b], [aa, ab, bb]) = (self.first, self.second);
        let determinant = aa * bb - ab * ab;
        let singular = determinant.is_nan() || determinant <= 1e-12 * aa * bb;
        (!singular).then(|| [(bb * a - ab * b) / determinant, (aa * b - ab * a) / determinant])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    /// Labels drawn with the probabilities of calibrated margins.
    fn drawn(slope: f64, offset: f64) -> Vec<(f64, bool)> {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        let mut draw = |_| {
            let margin = 4.0 * stream.normal();
            (margin, stream.chance(1.0 / (1.0 + libm::exp(-slope * margin - offset))))
        };
        (0..40_000).map(&mut draw).collect()
    }

    #[test]
    fn the_calibration_that_labels_were_drawn_with_is_found() {
        for (slope, offset) in [(0.5, 0.0), (1.0, -1.5), (2.5, 0.7), (0.05, 3.0)] {
            let found = most_likely(&drawn(slope, offset)).unwrap();
            assert!((found.slope / slope - 1.0).abs() < 0.08, "{found:?} for {slope}, {offset}");
            assert!((found.offset - offset).abs() < 0.08, "{found:?} for {slope}, {offset}");
        }
        let never = [
            vec![],
            vec![(1.0, true), (2.0, true)],
            vec![(-1.0, false), (2.0, true)],
            drawn(-1.0, 0.0),
            vec![(f64::NAN, true), (1.0, false)],
        ];
        assert!(never.iter().all(|margins| most_likely(margins).is_none()));
    }

    #[test]
    fn heads_of_any_number_of_classes_are_calibrated() {
        for (n_classes, slope) in [(3, 0.5), (5, 2.0), (40, 0.3), (2, 1.4)] {
            let mut stream = Stream::new(2, n_classes as u64, 0, Purpose::Probe);
            let (mut logits, mut classes) = (Vec::<f32>::new(), Vec::<u16>::new());
            for _ in 0..20_000 {
                let row: Vec<f64> = (0..n_classes).map(|_| 2.0 * stream.normal()).collect();
                let weights: Vec<f64> = row.iter().map(|z| libm::exp(slope * z)).collect();
                let mut left = stream.unit() * weights.iter().sum::<f64>();
                let passed = |weight: &f64| {
                    left -= weight;
                    left < 0.0
                };
                classes.push(weights.iter().position(passed).unwrap_or(n_classes - 1) as u16);
                logits.extend(row.iter().map(|z| *z as f32));
            }
            let found = Calibration::fit(&logits, &classes, n_classes).unwrap();
            assert!((found.slope / slope - 1.0).abs() < 0.05, "{found:?} for {slope}");
            assert!(found.offset.abs() < 0.1 && (n_classes == 2 || found.offset == 0.0));
            found.calibrate(&mut logits, n_classes).unwrap();
            let again = Calibration::fit(&logits, &classes, n_classes).unwrap();
            assert!((again.slope - 1.0).abs() < 1e-5 && again.offset.abs() < 1e-5, "{again:?}");
        }
    }

    #[test]
    fn heads_that_cannot_be_calibrated_are_named() {
        let fit = |logits: &[f64], classes: &[u8], n| {
            Calibration::fit(logits, classes, n).unwrap_err().to_string()
        };
        for (found, words) in [
            (fit(&[0.0; 3], &[0; 3], 1), "n_classes is 1"),
            (fit(&[0.0; 6], &[0, 3], 3), "target is 3 in row 1"),
            (fit(&[0.0; 5], &[0, 1], 3), "number of logits is 5"),
            (fit(&[0.0, 1.0, 2.0, f64::NAN, 1.0, 0.0], &[2, 0], 3), "row 1, class 0: "),
            (fit(&[0.0, 0.0, 4.0], &[2], 3), "calibration is "),
            (fit(&[0.0, 0.0, 4.0], &[0], 3), "calibration is "),
            (fit(&[], &[], 3), "calibration is "),
            (fit(&[0.0; 9], &[0, 1, 2], 3), "calibration is "),
        ] {
            assert!(found.starts_with(words), "{found}");
        }
        let mut logits = [1.0; 6];
        for (slope, n_classes) in [(f64::NAN, 3), (0.0, 3), (1.0, 0), (1.0, 4)] {
            let calibration = Calibration { slope, offset: 0.0 };
            assert!(calibration.calibrate(&mut logits, n_classes).is_err());
        }
        assert_eq!(logits, [1.0; 6]);
    }
}
