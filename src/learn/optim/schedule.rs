//! Learning-rate schedules: the rate as a function of the epoch.

use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A learning-rate schedule. Epochs count from 1; the rate is constant within one.
///
/// ```
/// use deepmill::optim::Schedule;
///
/// let cosine = Schedule::Cosine { min_lr: 0.0 };
/// let rates = [1, 51, 100].map(|epoch| cosine.lr(0.1, epoch, 100)); // of 100 epochs
/// assert!(rates[0] == 0.1 && (rates[1] - 0.05).abs() < 1e-12 && rates[2] < 1e-4);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
#[non_exhaustive]
pub enum Schedule {
    /// Always the base rate.
    Constant,
    /// `min + (base − min)·(1 + cos(π·(e−1)/n))/2` (Loshchilov and Hutter 2017, without restarts).
    Cosine {
        /// Absolute rate at the end.
        min_lr: f64,
    },
    /// The base rate times `factor` for each milestone epoch that is over.
    Step {
        /// Last epochs at the old rate.
        milestones: Vec<u64>,
        /// Multiplier at each.
        factor: f64,
    },
    /// A factor on the base rate: linear from `start` to 1 over `warmup_epochs`, then cosine from 1 to
    /// `min_ratio` over the rest.
    CosineWarmup {
        /// Epochs of the linear rise.
        warmup_epochs: u64,
        /// Factor in the first epoch.
        start: f64,
        /// Factor at the end.
        min_ratio: f64,
    },
    /// `base·(1 − (e−1)/n)^power`.
    Poly {
        /// The exponent; the reference code has 0.9.
        power: f64,
    },
}

impl Schedule {
    /// Whether every number is in its domain: finite, rates and factors not negative, shares at most 1.
    pub fn is_sound(&self) -> bool {
        let share = |x: f64| (0.0..=1.0).contains(&x);
        match self {
            Schedule::Constant => true,
            Schedule::Cosine { min_lr } => *min_lr >= 0.0 && min_lr.is_finite(),
            Schedule::Step { factor, .. } => *factor > 0.0 && factor.is_finite(),
            Schedule::CosineWarmup { start, min_ratio, .. } => share(*start) && share(*min_ratio),
            Schedule::Poly { power } => *power > 0.0 && power.is_finite(),
        }
    }

    /// Rate of `epoch` (from 1) out of `n_epochs`.
    ///
    /// # Panics
    /// If the base rate is negative or not finite, or the schedule is not [sound](Schedule::is_sound).
    pub fn lr(&self, base: f64, epoch: u64, n_epochs: u64) -> f64 {
        assert!(base >= 0.0 && base.is_finite(), "the base rate is {base}");
        assert!(self.is_sound(), "a number of {self:?} is out of its domain");
        let done = epoch.saturating_sub(1) as f64;
        let n = n_epochs.max(1) as f64;
        match self {
            Schedule::Constant => base,
            Schedule::Cosine { min_lr } => min_lr + (base - min_lr) * fall(done / n),
            Schedule::Step { milestones, factor } => {
                let passed = milestones.iter().filter(|m| epoch > **m).count();
                (0..passed).fold(base, |lr, _| lr * factor)
            }
            Schedule::CosineWarmup { warmup_epochs, start, min_ratio } => {
                let warmup = *warmup_epochs as f64;
                if done < warmup {
                    base * (start + (1.0 - start) * done / warmup)
                } else {
                    let share = (done - warmup) / (n - warmup).max(1.0);
                    base * (min_ratio + (1.0 - min_ratio) * fall(share))
                }
            }
            Schedule::Poly { power } => base * libm::pow((1.0 - done / n).max(0.0), *power),
        }
    }
}

/// From 1 to 0 along half a cosine.
fn fall(share: f64) -> f64 {
    (1.0 + libm::cos(PI * share.min(1.0))) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn rates_at_the_ends_and_in_the_middle() {
        let cosine = Schedule::Cosine { min_lr: 1e-4 };
        assert_relative_eq!(cosine.lr(0.1, 1, 100), 0.1);
        assert_relative_eq!(cosine.lr(0.1, 51, 100), 0.05005, epsilon = 1e-12);
        assert!(cosine.lr(0.1, 100, 100) > 1e-4);
        let step = Schedule::Step { milestones: vec![375, 750], factor: 0.1 };
        for (epoch, lr) in [(1, 0.1), (375, 0.1), (376, 0.01), (750, 0.01), (751, 0.001)] {
            assert_relative_eq!(step.lr(0.1, epoch, 1500), lr);
        }
        let warm = Schedule::CosineWarmup { warmup_epochs: 20, start: 0.001, min_ratio: 0.01 };
        assert_relative_eq!(warm.lr(0.1, 1, 100), 0.0001);
        assert_relative_eq!(warm.lr(0.1, 11, 100), 0.1 * 0.5005);
        assert_relative_eq!(warm.lr(0.1, 21, 100), 0.1);
        assert_relative_eq!(warm.lr(0.1, 61, 100), 0.1 * 0.505, epsilon = 1e-12);
        let poly = Schedule::Poly { power: 0.9 };
        assert_relative_eq!(poly.lr(0.1, 51, 100), 0.1 * 0.5f64.powf(0.9));
        assert_eq!(Schedule::Constant.lr(0.1, 7, 10), 0.1);
    }
}
