//! Reliability: how often predictions of each probability are right, and how far that is from the probability.

use std::ops::AddAssign;

/// Bins of probability, all of the same width.
pub const N_BINS: usize = 20;

/// Predictions by their probability, and how often they were right.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct Reliability {
    /// From probability 0 to 1.
    pub bins: [Bin; N_BINS],
}

/// Predictions of similar probability.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
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
    /// If the lists differ in length, or a probability is not from 0 to 1.
    pub fn of(probabilities: &[f32], truth: &[bool]) -> Self {
        assert_eq!(probabilities.len(), truth.len(), "a truth for each probability");
        let mut found = Reliability::default();
        for (p, positive) in probabilities.iter().zip(truth) {
            assert!((0.0..=1.0).contains(p), "probability {p}, expected 0 to 1");
            let bin = &mut found.bins[((p * N_BINS as f32) as usize).min(N_BINS - 1)];
            bin.n += 1;
            bin.n_positive += u64::from(*positive);
            bin.probability_sum += f64::from(*p);
        }
        found
    }

    /// Expected calibration error: the mean over all predictions of the distance between the mean probability of their
    /// bin and its share of positives; `None` if there are none.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    /// Margins, and labels drawn with their probabilities.
    fn drawn() -> Vec<(f64, bool)> {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        let mut draw = |_| {
            let margin = 4.0 * stream.normal();
            (margin, stream.chance(1.0 / (1.0 + libm::exp(-margin))))
        };
        (0..40_000).map(&mut draw).collect()
    }

    #[test]
    fn the_error_of_right_probabilities_vanishes_and_that_of_wrong_ones_is_the_distance() {
        let margins = drawn();
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
