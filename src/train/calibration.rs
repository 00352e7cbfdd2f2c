//! Calibration: whether predicted probabilities are frequencies, and the slope and offset that make them so.
//!
//! A network that says 0.8 of many sites is calibrated if 80 % of them are positive. A slope of the margin between its logits
//! repairs what is too sure or not sure enough (temperature scaling: Guo, Pleiss, Sun and Weinberger, *On calibration of modern
//! neural networks*, 2017), an offset what is said too often or too seldom (Platt, *Probabilistic outputs for support vector
//! machines*, 1999). The offset moves decisions, too.

use super::evaluate::predict;
use crate::data::Sample;
use crate::model::heads::N_HEADS;
use crate::model::{Calibration, Model, SiteNetwork};
use crate::{Error, Result};

/// The calibration of each head at which the labels of `samples` are most likely; sets [`Model::calibration`] to it.
///
/// The samples should be a validation set: on what the network learned from it is too sure for good reason.
///
/// # Errors
/// If there are no samples, one is inconsistent, a head has labels of one class alone, or its margins are no better than chance
/// or never wrong.
pub fn fit<N: SiteNetwork<f32>>(
    model: &mut Model<f32, N>,
    samples: &[Sample],
) -> Result<[Calibration; N_HEADS]> {
    model.calibration = [Calibration::IDENTITY; N_HEADS];
    let mut margins: [Vec<(f64, bool)>; N_HEADS] = Default::default();
    for sample in samples {
        sample.check()?;
        let found = predict(model, sample)?;
        let truth = [&sample.answers.inaccessible, &sample.answers.occlusion];
        let logits = [&found.logits_inaccessible, &found.logits_occlusion];
        for (head, margins) in margins.iter_mut().enumerate() {
            let margin = |[no, yes]: &[f32; 2]| f64::from(*yes) - f64::from(*no);
            margins.extend(logits[head].iter().map(margin).zip(truth[head].iter().copied()));
        }
    }
    let mut calibration = [Calibration::IDENTITY; N_HEADS];
    for (found, margins) in calibration.iter_mut().zip(&margins) {
        *found = most_likely(margins).ok_or_else(|| {
            let found =
                "labels of one class alone, or a network that is no better than chance or never errs";
            let expected = "labels of both classes and predictions that are mostly right";
            let remedy = "take a validation set of several parts, and train longer";
            Error::argument("calibration", found, expected, remedy)
        })?;
    }
    model.calibration = calibration;
    Ok(calibration)
}

/// Newton steps: more than ever needed.
const N_STEPS: usize = 100;

/// The calibration that minimizes the mean of `log(1 + exp(-s (slope m + offset)))`, where `s` is 1 for a positive and -1 for a
/// negative, by Newton's method with halved steps: it is convex. `None` if there is no minimum of positive slope.
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
    (at.is_sound() && at.slope < 1e3).then_some(at)
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
    use crate::rng::{Purpose, Stream};

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
}
