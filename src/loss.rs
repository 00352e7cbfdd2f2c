//! The losses: cross-entropy of two classes, with weights and label smoothing, and against a share; with their gradients.

use crate::par;
use crate::scalar::Scalar;

/// Rows per block of the sum: a constant, so that the sum does not depend on the number of threads.
const BLOCK: usize = 4096;

/// Mean cross-entropy of logits `[n, n_classes]` against class numbers.
///
/// With `p` the softmax of a row's logits, class weights `w`, smoothing `ε` and target `t`, a row costs
/// `w_t·(1−ε)·(−ln p_t) + ε/C · Σ_c w_c·(−ln p_c)`, and the loss is `Σ rows / Σ w_t`: as PyTorch's
/// `cross_entropy`.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossEntropy {
    /// Weight of each class; their number is the number of classes.
    pub class_weights: Vec<f64>,
    /// Share `ε` of each target that is spread evenly over all classes, in `[0, 1)`.
    pub label_smoothing: f64,
}

impl CrossEntropy {
    /// Two classes of equal weight, no smoothing.
    pub fn binary() -> Self {
        CrossEntropy { class_weights: vec![1.0; 2], label_smoothing: 0.0 }
    }

    /// The loss; 0 for no rows. `dlogits` is overwritten with `scale` times its gradient.
    ///
    /// Logits that are not finite give a loss that is not a number.
    ///
    /// # Panics
    /// If `logits` and `targets` disagree in length, a target is not a class, a weight is not positive and finite, or the
    /// smoothing is not in `[0, 1)`.
    pub fn loss<T: Scalar>(
        &self,
        logits: &[T],
        targets: &[u8],
        scale: f64,
        dlogits: &mut Vec<T>,
    ) -> f64 {
        self.assert_sound(targets);
        let n_classes = self.class_weights.len();
        assert_eq!(logits.len(), targets.len() * n_classes, "logits for another number of targets");
        let total = self.total_weight(targets);
        let spread = self.label_smoothing / n_classes as f64;
        mean_of_rows(logits, n_classes, (total, scale), dlogits, |row, class| {
            let is_target = class == targets[row] as usize;
            let hit = if is_target { 1.0 - self.label_smoothing } else { 0.0 };
            self.class_weights[class] * (hit + spread)
        })
    }

    fn assert_sound(&self, targets: &[u8]) {
        let CrossEntropy { class_weights, label_smoothing } = self;
        let sound = |weight: &f64| *weight > 0.0 && weight.is_finite();
        assert!(
            class_weights.iter().all(sound),
            "class weights {class_weights:?}, expected above 0"
        );
        let smoothing = (0.0..1.0).contains(label_smoothing);
        assert!(smoothing, "label smoothing {label_smoothing}, expected 0 to below 1");
        let n_classes = class_weights.len();
        if let Some(target) = targets.iter().find(|target| usize::from(**target) >= n_classes) {
            panic!("target {target} of {n_classes} classes");
        }
    }

    /// `Σ w_t`, by which [`CrossEntropy::loss`] divides: the share of some rows in the mean over all.
    pub fn total_weight(&self, targets: &[u8]) -> f64 {
        targets.iter().map(|t| self.class_weights[*t as usize]).sum()
    }
}

/// Mean cross-entropy of two logits per row, `[n, 2]`, against the share `y` of the second: `−y·ln p − (1 − y)·ln(1 − p)`,
/// with the softmax `p` of the second logit; 0 for no rows. `dlogits` is overwritten with `scale` times its gradient.
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
    use crate::rng::{Purpose, Stream};

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
