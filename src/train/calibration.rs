//! Calibration: whether predicted probabilities are frequencies, and the temperature that makes them so.
//!
//! A network that says 0.8 of many sites is calibrated if 80 % of them are positive. Dividing the logits by one number,
//! the temperature, changes no decision and repairs most of what training leaves (Guo, Pleiss, Sun and Weinberger,
//! *On calibration of modern neural networks*, 2017).

use super::evaluate::predict;
use crate::data::Sample;
use crate::model::Model;
use crate::model::unet::N_HEADS;
use crate::{Error, Result};
use std::ops::AddAssign;

/// Bins of probability, all of the same width.
pub const N_BINS: usize = 20;

/// Predictions by their probability, and how often they were right.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Reliability {
    /// From probability 0 to 1.
    pub bins: [Bin; N_BINS],
}

/// Predictions of similar probability.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Bin {
    /// Their number.
    pub n: u64,
    /// How many were truly positive.
    pub n_positive: u64,
    /// Sum of their probabilities.
    pub probability_sum: f64,
}

impl Bin {
    /// Mean probability and share of positives; `None` if it is empty.
    pub fn means(&self) -> Option<[f64; 2]> {
        let n = self.n as f64;
        (self.n > 0).then(|| [self.probability_sum / n, self.n_positive as f64 / n])
    }
}

impl Reliability {
    /// Counts probabilities of the positive class against the truth.
    ///
    /// # Panics
    /// If the lists differ in length.
    pub fn of(probabilities: &[f32], truth: &[bool]) -> Self {
        assert_eq!(probabilities.len(), truth.len(), "a truth for each probability");
        let mut found = Reliability::default();
        for (p, positive) in probabilities.iter().zip(truth) {
            let bin = &mut found.bins[((p * N_BINS as f32) as usize).min(N_BINS - 1)];
            bin.n += 1;
            bin.n_positive += u64::from(*positive);
            bin.probability_sum += f64::from(*p);
        }
        found
    }

    /// Expected calibration error: the mean over all predictions of the distance between the mean probability of their bin and
    /// its share of positives; `None` if there are none.
    pub fn expected_error(&self) -> Option<f64> {
        let n: u64 = self.bins.iter().map(|bin| bin.n).sum();
        let of = |bin: &Bin| (bin.probability_sum - bin.n_positive as f64).abs();
        (n > 0).then(|| self.bins.iter().map(of).sum::<f64>() / n as f64)
    }
}

impl AddAssign for Reliability {
    fn add_assign(&mut self, other: Self) {
        for (bin, other) in self.bins.iter_mut().zip(other.bins) {
            bin.n += other.n;
            bin.n_positive += other.n_positive;
            bin.probability_sum += other.probability_sum;
        }
    }
}

/// The temperature of each head at which the labels of `samples` are most likely; sets [`Model::temperature`] to them.
///
/// The samples should be a validation set: on what the network learned from it is too sure for good reason.
///
/// # Errors
/// If there are no samples, one is inconsistent, or all labels of a head are the same.
pub fn fit(model: &mut Model<f32>, samples: &[Sample]) -> Result<[f64; N_HEADS]> {
    model.temperature = [1.0; N_HEADS];
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
    let mut temperature = [1.0; N_HEADS];
    for (t, margins) in temperature.iter_mut().zip(&margins) {
        *t = most_likely(margins).ok_or_else(|| {
            let expected = "labels of both classes in both heads";
            let remedy = "take a validation set of several parts";
            Error::argument("calibration set", "one class alone", expected, remedy)
        })?;
    }
    model.temperature = temperature;
    Ok(temperature)
}

/// Bisections of the inverse temperature: as exact as `f64` is worth here.
const N_BISECTIONS: usize = 60;
/// Least and greatest inverse temperature.
const RANGE: [f64; 2] = [1e-3, 1e3];

/// The temperature that minimizes the mean of `log(1 + exp(-s m / t))`, where `s` is 1 for a positive and -1 for a negative: it
/// is convex in `1 / t`. `None` if there is one class alone.
fn most_likely(margins: &[(f64, bool)]) -> Option<f64> {
    let n_positive = margins.iter().filter(|(_, positive)| *positive).count();
    if n_positive == 0 || n_positive == margins.len() {
        return None;
    }
    let slope = |inverse: f64| {
        let of = |(margin, positive): &(f64, bool)| {
            let signed = if *positive { *margin } else { -margin };
            -signed / (1.0 + libm::exp((signed * inverse).min(700.0)))
        };
        margins.iter().map(of).sum::<f64>()
    };
    let [mut low, mut high] = RANGE;
    for _ in 0..N_BISECTIONS {
        let middle = (low * high).sqrt();
        if slope(middle) < 0.0 { low = middle } else { high = middle }
    }
    Some(1.0 / (low * high).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};

    /// Labels drawn with the probabilities of margins that were divided by `t`.
    fn drawn(t: f64) -> Vec<(f64, bool)> {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        let mut draw = |_| {
            let margin = 4.0 * stream.normal();
            (margin, stream.chance(1.0 / (1.0 + libm::exp(-margin / t))))
        };
        (0..40_000).map(&mut draw).collect()
    }

    #[test]
    fn the_temperature_that_labels_were_drawn_with_is_found() {
        for t in [0.5, 1.0, 2.5] {
            let found = most_likely(&drawn(t)).unwrap();
            assert!((found / t - 1.0).abs() < 0.05, "{found} for {t}");
        }
        assert_eq!(most_likely(&[(1.0, true), (2.0, true)]), None);
        assert_eq!(most_likely(&[]), None);
    }

    #[test]
    fn the_error_of_right_probabilities_vanishes_and_that_of_wrong_ones_is_the_distance() {
        let margins = drawn(1.0);
        let truth: Vec<bool> = margins.iter().map(|(_, positive)| *positive).collect();
        let probabilities = |t: f64| -> Vec<f32> {
            margins.iter().map(|(m, _)| (1.0 / (1.0 + libm::exp(-m / t))) as f32).collect()
        };
        let error = |t: f64| Reliability::of(&probabilities(t), &truth).expected_error().unwrap();
        assert!(error(1.0) < 0.01 && error(0.3) > 0.04, "{} {}", error(1.0), error(0.3));
        let sure = Reliability::of(&[1.0; 10], &[true, true, true, true, false].repeat(2));
        assert!((sure.expected_error().unwrap() - 0.2).abs() < 1e-12);
        assert_eq!(sure.bins[N_BINS - 1].means(), Some([1.0, 0.8]));
        let mut all = sure;
        all += Reliability::of(&[0.0; 10], &[false; 10]);
        assert!((all.expected_error().unwrap() - 0.1).abs() < 1e-12);
        assert_eq!(Reliability::default().expected_error(), None);
    }
}
