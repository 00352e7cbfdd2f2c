//! The losses: cross-entropy of any number of classes, with weights and label smoothing, and of two against a share;
//! with their gradients.

use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Rows per block of the sum: a constant, so that the sum does not depend on the number of threads.
const BLOCK: usize = 4096;

/// Mean cross-entropy of logits `[n, n_classes]` against class numbers.
///
/// With `p` the softmax of a row's logits, class weights `w`, smoothing `ε` and target `t`, a row costs
/// `w_t·(1−ε)·(−ln p_t) + ε/C · Σ_c w_c·(−ln p_c)`, and the loss is `Σ rows / Σ w_t`: as PyTorch's
/// `cross_entropy`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct CrossEntropy {
    /// Weight of each class; their number is the number of classes.
    pub class_weights: Vec<f64>,
    /// Share `ε` of each target that is spread evenly over all classes, in `[0, 1)`.
    pub label_smoothing: f64,
}

setters!(CrossEntropy {
    with_class_weights(class_weights: Vec<f64>),
    with_label_smoothing(label_smoothing: f64),
});

impl CrossEntropy {
    /// Two classes of equal weight, no smoothing.
    pub fn binary() -> Self {
        CrossEntropy { class_weights: vec![1.0; 2], label_smoothing: 0.0 }
    }

    /// So many classes of equal weight, no smoothing.
    pub fn equal(n_classes: usize) -> Self {
        CrossEntropy { class_weights: vec![1.0; n_classes], label_smoothing: 0.0 }
    }

    /// The loss; 0 for no rows. `dlogits` is overwritten with `scale` times its gradient, `[n, n_classes]`.
    ///
    /// Logits that are not finite give a loss that is not finite.
    ///
    /// # Panics
    /// Where [`CrossEntropy::try_loss`] is an error.
    pub fn loss<T: Scalar>(
        &self,
        logits: &[T],
        targets: &[u8],
        scale: f64,
        dlogits: &mut Vec<T>,
    ) -> f64 {
        match self.try_loss(logits, targets, scale, dlogits) {
            Ok(loss) => loss,
            Err(error) => panic!("{error}"),
        }
    }

    /// [`CrossEntropy::loss`] of numbers that may be wrong, such as the labels of a file; classes are `u8`, `u16` or
    /// `usize`.
    ///
    /// ```
    /// use deepmill::loss::CrossEntropy;
    /// let (criterion, mut dlogits) = (CrossEntropy::equal(5), Vec::new());
    /// let loss = criterion.try_loss(&[0.0; 10], &[3_u8, 0], 1.0, &mut dlogits)?;
    /// assert!((loss - 5_f64.ln()).abs() < 1e-12);
    /// assert!(criterion.try_loss(&[0.0; 10], &[3_u8, 5], 1.0, &mut dlogits).is_err());
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    ///
    /// # Errors
    /// If `logits` and `targets` disagree in length, a target is not a class, there is no class, a weight is not
    /// positive and finite, the smoothing is not in `[0, 1)`, or `scale` is not finite. `dlogits` stays as it is.
    pub fn try_loss<T: Scalar, C: Copy + Into<usize> + Sync>(
        &self,
        logits: &[T],
        targets: &[C],
        scale: f64,
        dlogits: &mut Vec<T>,
    ) -> Result<f64> {
        self.check()?;
        if !scale.is_finite() {
            return Err(Error::argument(
                "scale",
                scale,
                "finite",
                "1 leaves the gradient as it is",
            ));
        }
        let n_classes = self.class_weights.len();
        check_targets(targets, n_classes)?;
        check_logits(logits.len(), targets.len(), n_classes)?;
        let total = self.sum_of_weights(targets);
        let spread = self.label_smoothing / n_classes as f64;
        Ok(mean_of_rows(logits, n_classes, (total, scale), dlogits, |row, class| {
            let is_target = class == targets[row].into();
            let hit = if is_target { 1.0 - self.label_smoothing } else { 0.0 };
            self.class_weights[class] * (hit + spread)
        }))
    }

    fn check(&self) -> Result<()> {
        let CrossEntropy { class_weights, label_smoothing } = self;
        let sound = |weight: &f64| *weight > 0.0 && weight.is_finite();
        if class_weights.is_empty() || !class_weights.iter().all(sound) {
            let (found, expected) = (format!("{class_weights:?}"), "one above 0 for each class");
            return Err(Error::argument("class_weights", found, expected, "1 weighs all alike"));
        }
        if !(0.0..1.0).contains(label_smoothing) {
            let (found, expected) = (label_smoothing, "0 to below 1");
            return Err(Error::argument("label_smoothing", found, expected, "0 turns it off"));
        }
        Ok(())
    }

    /// `Σ w_t`, by which [`CrossEntropy::loss`] divides: the share of some rows in the mean over all.
    ///
    /// # Panics
    /// If a target is not a class.
    pub fn total_weight(&self, targets: &[u8]) -> f64 {
        self.sum_of_weights(targets)
    }

    fn sum_of_weights<C: Copy + Into<usize>>(&self, targets: &[C]) -> f64 {
        targets.iter().map(|&t| self.class_weights[t.into()]).sum()
    }
}

/// Demands that each target is one of `n_classes` classes.
pub(crate) fn check_targets<C: Copy + Into<usize>>(targets: &[C], n_classes: usize) -> Result<()> {
    let Some(row) = targets.iter().position(|&t| t.into() >= n_classes) else { return Ok(()) };
    let found = format!("{} in row {row}", targets[row].into());
    let expected = format!("below {n_classes}, the number of classes");
    Err(Error::argument("target", found, expected, "correct the label, or add classes"))
}

/// Demands `n_classes` logits for each target.
pub(crate) fn check_logits(n_logits: usize, n_targets: usize, n_classes: usize) -> Result<()> {
    if n_targets.checked_mul(n_classes) == Some(n_logits) {
        return Ok(());
    }
    let expected = format!("{n_classes} for each of {n_targets} targets");
    let remedy = "give one target for each row of logits, and a logit for each class";
    Err(Error::argument("number of logits", n_logits, expected, remedy))
}

/// Mean cross-entropy of two logits per row, `[n, 2]`, against the share `y` of the second:
/// `−y·ln p − (1 − y)·ln(1 − p)`, with the softmax `p` of the second logit; 0 for no rows. `dlogits` is overwritten
/// with `scale` times its gradient.
///
/// # Panics
/// If `logits` and `shares` disagree in length.
pub(crate) fn share_loss<T: Scalar>(
    logits: &[T],
    shares: &[f32],
    scale: f64,
    dlogits: &mut Vec<T>,
) -> f64 {
    assert_eq!(logits.len(), 2 * shares.len(), "logits for another number of shares");
    mean_of_rows(logits, 2, (shares.len() as f64, scale), dlogits, |row, class| {
        let share = f64::from(shares[row]);
        if class == 1 { share } else { 1.0 - share }
    })
}

/// `Σ rows Σ_c weight(row, c)·(−ln p_c) / total`; `dlogits` is overwritten with `scale` times its gradient.
fn mean_of_rows<T: Scalar>(
    logits: &[T],
    n_classes: usize,
    (total, scale): (f64, f64),
    dlogits: &mut Vec<T>,
    weight: impl Fn(usize, usize) -> f64 + Sync,
) -> f64 {
    if logits.is_empty() {
        dlogits.clear();
        return 0.0;
    }
    dlogits.resize(logits.len(), T::ZERO);
    let factor = scale / total;
    let rows = |first: usize, block: &mut [T]| {
        let mut sum = 0.0;
        for (i, d) in block.chunks_exact_mut(n_classes).enumerate() {
            let row = first + i;
            sum += cost(&logits[row * n_classes..][..n_classes], |c| weight(row, c), factor, d);
        }
        sum
    };
    let sums = par::map_chunks(dlogits, BLOCK * n_classes, |i, block| rows(i * BLOCK, block));
    sums.into_iter().sum::<f64>() / total
}

/// Cost of one row; `d` is overwritten with `factor` times its gradient.
fn cost<T: Scalar>(logits: &[T], weight: impl Fn(usize) -> f64, factor: f64, d: &mut [T]) -> f64 {
    let greatest = logits.iter().copied().fold(logits[0], T::max);
    let exponentials = logits.iter().map(|&x| (x - greatest).exp());
    let sum: T = exponentials.clone().sum();
    let log_sum = greatest + sum.ln();
    let all: f64 = (0..logits.len()).map(&weight).sum();
    for (c, (d, e)) in d.iter_mut().zip(exponentials).enumerate() {
        let p = (e / sum).to_f64();
        *d = T::from_f64(factor * (all * p - weight(c)));
    }
    (0..logits.len()).map(|c| weight(c) * (log_sum - logits[c]).to_f64()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::gradcheck::{self, GradcheckSettings};
    use crate::numeric::rng::{Purpose, Stream};

    fn case(n: usize) -> (Vec<f64>, Vec<u8>) {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        let logits = (0..3 * n).map(|_| 2.0 * stream.normal()).collect();
        (logits, (0..n).map(|_| stream.below(3) as u8).collect())
    }

    #[test]
    fn uniform_logits_cost_the_logarithm_of_the_number_of_classes() {
        let mut d = Vec::new();
        let loss = CrossEntropy::binary().loss(&[0.5f32, 0.5, -3.0, -3.0], &[0, 1], 1.0, &mut d);
        assert!((loss - 2f64.ln()).abs() < 1e-7);
        assert_eq!(d, [-0.25, 0.25, 0.25, -0.25]);
        assert_eq!(CrossEntropy::binary().loss::<f32>(&[], &[], 1.0, &mut d), 0.0);
    }

    /// Softmax of the first row: 1, 2, 3, 4 and 10 of 20; of the second: a fifth each.
    #[test]
    fn five_classes_have_the_loss_and_gradient_computed_by_hand() {
        let first = [1f64, 2.0, 3.0, 4.0, 10.0].map(f64::ln);
        let logits = [first, [7.0; 5]].concat();
        let mut d = Vec::new();
        // ln(20/4) and ln 5.
        let loss = CrossEntropy::equal(5).try_loss(&logits, &[3u16, 1], 1.0, &mut d).unwrap();
        assert!((loss - 5f64.ln()).abs() < 1e-14, "{loss}");
        let expected = [0.05, 0.1, 0.15, -0.8, 0.5, 0.2, -0.8, 0.2, 0.2, 0.2].map(|d| d / 2.0);
        assert!(d.iter().zip(expected).all(|(d, e)| (d - e).abs() < 1e-15), "{d:?}");
        // (1·ln 5 + 4·ln 5) / 5; the second row counts four times.
        let class_weights = vec![1.0, 4.0, 1.0, 1.0, 1.0];
        let weighted = CrossEntropy { class_weights, label_smoothing: 0.0 };
        let loss = weighted.try_loss(&logits, &[3usize, 1], 10.0, &mut d).unwrap();
        assert!((loss - 5f64.ln()).abs() < 1e-14, "{loss}");
        let expected = [0.1, 0.2, 0.3, -1.6, 1.0, 1.6, -6.4, 1.6, 1.6, 1.6];
        assert!(d.iter().zip(expected).all(|(d, e)| (d - e).abs() < 1e-14), "{d:?}");
    }

    #[test]
    fn wrong_labels_and_lengths_are_errors_that_change_nothing() {
        let (criterion, mut d) = (CrossEntropy::equal(5), vec![7.0f32]);
        let mut refused = |logits: &[f32], targets: &[u8], words: &str| {
            let error = criterion.try_loss(logits, targets, 1.0, &mut d).unwrap_err().to_string();
            assert!(error.starts_with(words), "{error}");
            assert_eq!(d, [7.0]);
        };
        refused(&[0.0; 10], &[4, 5], "target is 5 in row 1, expected below 5, the number of");
        refused(&[0.0; 11], &[4, 0], "number of logits is 11, expected 5 for each of 2 targets; ");
        let none = CrossEntropy::equal(0).try_loss::<f32, u8>(&[], &[], 1.0, &mut d);
        assert!(none.unwrap_err().to_string().starts_with("class_weights is []"));
    }

    #[test]
    fn gradients_of_any_number_of_classes_are_right() {
        for n_classes in [1, 2, 5, 300] {
            let mut stream = Stream::new(1, 0, n_classes as u64, Purpose::Probe);
            let targets: Vec<usize> = (0..7).map(|_| stream.below(n_classes)).collect();
            let class_weights = (0..n_classes).map(|c| 1.0 + (c % 3) as f64).collect();
            let criterion = CrossEntropy { class_weights, label_smoothing: 0.1 };
            let run = |v: &[Vec<f64>], scale| {
                let mut d = Vec::new();
                (criterion.try_loss(&v[0], &targets, scale, &mut d).unwrap(), d)
            };
            let logits = gradcheck::probe(7 * n_classes, 3);
            let settings = GradcheckSettings { max_elements: 200, ..Default::default() };
            let forward = |v: &[Vec<f64>]| vec![run(v, 1.0).0];
            let backward = |v: &[Vec<f64>], dy: &[f64]| vec![run(v, dy[0]).1];
            let inputs = [("logits", &logits[..])];
            let report = gradcheck::function(&inputs, forward, backward, &settings).unwrap();
            report.require(1e-7).unwrap();
        }
    }

    #[test]
    fn huge_logits_stay_finite() {
        let mut d = Vec::new();
        let loss = CrossEntropy::binary().loss(&[1e30f32, -1e30], &[0], 1.0, &mut d);
        assert_eq!((loss, d.as_slice()), (0.0, [0.0, 0.0].as_slice()));
        assert!(CrossEntropy::binary().loss(&[1e30f32, -1e30], &[1], 1.0, &mut d) > 1e30);
    }

    #[test]
    fn the_gradient_is_the_difference_quotient() {
        let (logits, targets) = case(40);
        let weighted = CrossEntropy { class_weights: vec![1.0, 3.0, 0.2], label_smoothing: 0.1 };
        let plain = CrossEntropy { class_weights: vec![1.0; 3], label_smoothing: 0.0 };
        for criterion in [plain, weighted] {
            let (mut d, mut unused) = (Vec::new(), Vec::new());
            criterion.loss(&logits, &targets, 1.0, &mut d);
            for i in 0..logits.len() {
                let mut at = |shift: f64| {
                    let mut moved = logits.clone();
                    moved[i] += shift;
                    criterion.loss(&moved, &targets, 1.0, &mut unused)
                };
                let numeric = (at(1e-5) - at(-1e-5)) / 2e-5;
                assert!(
                    (numeric - d[i]).abs() <= 1e-7 * d[i].abs().max(1e-2),
                    "{numeric} {}",
                    d[i]
                );
            }
        }
    }

    #[test]
    fn the_loss_against_a_share_is_least_at_it_and_its_gradient_is_the_difference_quotient() {
        let shares = [0.0, 0.25, 1.0, 0.5];
        let logits = [0.3f64, -0.2, 1.0, 0.5, -0.7, 2.0, 0.1, 0.1];
        let (mut d, mut unused) = (Vec::new(), Vec::new());
        share_loss(&logits, &shares, 1.0, &mut d);
        for i in 0..logits.len() {
            let mut at = |shift: f64| {
                let mut moved = logits;
                moved[i] += shift;
                share_loss(&moved, &shares, 1.0, &mut unused)
            };
            let numeric = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((numeric - d[i]).abs() <= 1e-7 * d[i].abs().max(1e-2), "{numeric} {}", d[i]);
        }
        // A softmax of a quarter.
        let loss = share_loss(&[3f64.ln(), 0.0], &[0.25], 1.0, &mut d);
        assert!(d.iter().all(|d| d.abs() < 1e-15));
        assert!((loss - (4f64.ln() - 0.75 * 3f64.ln())).abs() < 1e-7);
        // Shares of 0 and 1 are the two classes.
        let mut classes = Vec::new();
        let expected = CrossEntropy::binary().loss(&logits[..4], &[0, 1], 0.5, &mut classes);
        assert_eq!(share_loss(&logits[..4], &[0.0, 1.0], 0.5, &mut d), expected);
        assert_eq!(d, classes);
        assert_eq!(share_loss::<f32>(&[], &[], 1.0, &mut vec![1.0]), 0.0);
    }

    #[test]
    fn many_rows_are_summed_alike_on_any_number_of_threads() {
        let (logits, targets) = case(20_000);
        let criterion = CrossEntropy { class_weights: vec![1.0; 3], label_smoothing: 0.0 };
        let on = |n| {
            let mut d = Vec::new();
            let loss = par::with_threads(n, || criterion.loss(&logits, &targets, 0.5, &mut d));
            (loss.unwrap().to_bits(), d)
        };
        assert_eq!(on(1), on(4));
    }
}
