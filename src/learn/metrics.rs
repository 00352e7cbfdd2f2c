//! Scores of predictions: accuracy, precision, recall, F1 and IoU, of yes and no and of any number of classes.

mod matrix;

pub use matrix::ConfusionMatrix;

use crate::answers::is_positive;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// Counts of right and wrong predictions; they add up over samples, so pooled scores are exact.
///
/// ```
/// use deepmill::metrics::Confusion;
///
/// let mut counts = Confusion::of_labels(&[true, true, true, false], &[true, true, false, true]);
/// assert_eq!(counts.to_array(), [2, 1, 1, 0]); // right yes, wrong yes, missed, right no
/// assert_eq!((counts.precision(), counts.recall(), counts.iou()), (2.0 / 3.0, 2.0 / 3.0, 0.5));
/// counts += Confusion::of_labels(&[true; 6], &[true; 6]);
/// assert_eq!(counts.f1(), 16.0 / 18.0); // of all ten, not the mean of 2/3 and 1
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Confusion {
    /// Predicted yes, truly yes.
    pub(crate) true_positive: u64,
    /// Predicted yes, truly no.
    pub(crate) false_positive: u64,
    /// Predicted no, truly yes.
    pub(crate) false_negative: u64,
    /// Predicted no, truly no.
    pub(crate) true_negative: u64,
}

impl Confusion {
    /// Counts of predicted against true labels.
    ///
    /// # Panics
    /// If the lists differ in length.
    pub fn of_labels(predicted: &[bool], truth: &[bool]) -> Self {
        check_lengths("true labels", truth.len(), predicted.len());
        let mut counts = Confusion::default();
        for (p, t) in predicted.iter().zip(truth) {
            counts.add(*p, *t);
        }
        counts
    }

    /// As [`Confusion::of_labels`], each entry counted `weight` times.
    ///
    /// # Panics
    /// If the lists differ in length.
    pub fn weighted(predicted: &[bool], truth: &[bool], weights: &[u64]) -> Self {
        check_lengths("true labels", truth.len(), predicted.len());
        check_lengths("weights", weights.len(), predicted.len());
        let mut counts = Confusion::default();
        for ((p, t), weight) in predicted.iter().zip(truth).zip(weights) {
            counts.count(*p, *t, *weight);
        }
        counts
    }

    /// Counts of two logits a row (`[n, 2]`) against classes; "yes" is class `positive`, predicted where its logit is
    /// the greater one; a logit that is not a number is not the greater one.
    ///
    /// # Panics
    /// If there are not two logits for each target, or a target or `positive` is not 0 or 1.
    pub fn of_logits<T: PartialOrd + Copy>(logits: &[T], targets: &[u8], positive: u8) -> Self {
        assert_eq!(logits.len(), 2 * targets.len(), "two logits for each target");
        if let Some(class) = targets.iter().chain([&positive]).find(|class| **class > 1) {
            panic!("class {class} of 2 classes");
        }
        let mut counts = Confusion::default();
        for (row, target) in logits.as_chunks::<2>().0.iter().zip(targets) {
            let [no, yes] = if positive == 0 { [row[1], row[0]] } else { *row };
            counts.add(is_positive([no, yes]), *target == positive);
        }
        counts
    }

    /// The counts in the order of the fields.
    pub fn to_array(&self) -> [u64; 4] {
        [self.true_positive, self.false_positive, self.false_negative, self.true_negative]
    }

    /// From [`Confusion::to_array`].
    pub fn from_array(counts: [u64; 4]) -> Self {
        let [true_positive, false_positive, false_negative, true_negative] = counts;
        Confusion { true_positive, false_positive, false_negative, true_negative }
    }

    fn add(&mut self, predicted: bool, truth: bool) {
        self.count(predicted, truth, 1);
    }

    fn count(&mut self, predicted: bool, truth: bool, times: u64) {
        *match (predicted, truth) {
            (true, true) => &mut self.true_positive,
            (true, false) => &mut self.false_positive,
            (false, true) => &mut self.false_negative,
            (false, false) => &mut self.true_negative,
        } += times;
    }

    /// The counts with "no" as the positive class.
    pub fn swapped(&self) -> Self {
        Confusion {
            true_positive: self.true_negative,
            false_positive: self.false_negative,
            false_negative: self.false_positive,
            true_negative: self.true_positive,
        }
    }

    /// Number of predictions.
    pub fn n(&self) -> u64 {
        self.true_positive + self.false_positive + self.false_negative + self.true_negative
    }

    /// Share of right predictions; 1 if there are none.
    pub fn accuracy(&self) -> f64 {
        ratio(self.true_positive + self.true_negative, self.n())
    }

    /// Share of true ones among those predicted "yes"; 1 if none is.
    pub fn precision(&self) -> f64 {
        ratio(self.true_positive, self.true_positive + self.false_positive)
    }

    /// Share of those truly "yes" that are predicted so; 1 if there are none.
    pub fn recall(&self) -> f64 {
        ratio(self.true_positive, self.true_positive + self.false_negative)
    }

    /// Harmonic mean of precision and recall, `2·TP / (2·TP + FP + FN)`; 1 if nothing is "yes" in truth
    /// or prediction.
    pub fn f1(&self) -> f64 {
        let twice = 2 * self.true_positive;
        ratio(twice, twice + self.false_positive + self.false_negative)
    }

    /// Intersection over union, `TP / (TP + FP + FN)`; 1 if nothing is "yes" in truth or prediction.
    pub fn iou(&self) -> f64 {
        let union = self.true_positive + self.false_positive + self.false_negative;
        ratio(self.true_positive, union)
    }
}

fn check_lengths(what: &str, found: usize, predicted: usize) {
    assert_eq!(found, predicted, "{found} {what} for {predicted} predictions");
}

fn ratio(a: u64, b: u64) -> f64 {
    if b == 0 { 1.0 } else { a as f64 / b as f64 }
}

impl AddAssign for Confusion {
    fn add_assign(&mut self, other: Self) {
        self.true_positive += other.true_positive;
        self.false_positive += other.false_positive;
        self.false_negative += other.false_negative;
        self.true_negative += other.true_negative;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_of_a_hand_made_table() {
        let counts = Confusion::of_labels(
            &[true, true, true, false, false, false, false, false],
            &[true, true, false, true, false, false, false, false],
        );
        let [tp, fp, fneg, tn] = [2, 1, 1, 4];
        assert_eq!(
            counts,
            Confusion {
                true_positive: tp,
                false_positive: fp,
                false_negative: fneg,
                true_negative: tn
            }
        );
        assert_eq!(counts.accuracy(), 0.75);
        assert_eq!((counts.precision(), counts.recall()), (2.0 / 3.0, 2.0 / 3.0));
        assert_eq!((counts.f1(), counts.iou()), (2.0 / 3.0, 0.5));
        assert_eq!(counts.swapped().f1(), 0.8);
        let mut twice = counts;
        twice += counts;
        assert_eq!((twice.n(), twice.f1()), (16, counts.f1()));
    }

    #[test]
    fn logits_and_labels_agree_and_equal_logits_mean_no_for_either_class() {
        let logits = [0.1f32, 0.2, 0.3, 0.3, 0.9, -0.9, 0.0, 1.0];
        let by_logits = |positive| Confusion::of_logits(&logits, &[1, 0, 1, 0], positive);
        let by_labels =
            Confusion::of_labels(&[false, false, true, false], &[false, true, false, true]);
        assert_eq!(by_logits(0), by_labels);
        let by_labels =
            Confusion::of_labels(&[true, false, false, true], &[true, false, true, false]);
        assert_eq!(by_logits(1), by_labels);
    }

    #[test]
    fn nothing_to_find_and_nothing_claimed_is_perfect() {
        let none = Confusion::of_labels(&[false; 5], &[false; 5]);
        assert_eq!((none.f1(), none.iou(), none.accuracy()), (1.0, 1.0, 1.0));
        assert_eq!(Confusion::default().accuracy(), 1.0);
    }

    #[test]
    #[should_panic(expected = "2 true labels for 3 predictions")]
    fn labels_of_another_number_of_sites_are_refused() {
        Confusion::of_labels(&[true; 3], &[true; 2]);
    }

    #[test]
    #[should_panic(expected = "4 weights for 3 predictions")]
    fn weights_of_another_number_of_sites_are_refused() {
        Confusion::weighted(&[true; 3], &[true; 3], &[1; 4]);
    }

    #[test]
    #[should_panic(expected = "two logits for each target")]
    fn logits_of_another_number_of_targets_are_refused() {
        Confusion::of_logits(&[0.0; 5], &[1, 0], 0);
    }
}
