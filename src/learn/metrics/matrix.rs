//! Predicted against true classes, for any number of classes.

use super::{Confusion, ratio};
use crate::exec::memory;
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};
use std::ops::AddAssign;

/// How often each class was predicted for each true class; counts add up over samples, so pooled scores are exact.
///
/// Scores of one class are those of [`ConfusionMatrix::class`]. Classes are `u8`, `u16` or `usize`.
///
/// ```
/// use deepmill::metrics::ConfusionMatrix;
/// let mut counts = ConfusionMatrix::new(3)?;
/// counts.add_classes(&[0_u8, 1, 2, 2], &[0_u8, 1, 1, 2])?;
/// assert_eq!((counts.accuracy(), counts.class(2).precision()), (0.75, 0.5));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfusionMatrix {
    n_classes: usize,
    /// `[n_classes, n_classes]`: one row for each true class.
    counts: Vec<u64>,
}

impl ConfusionMatrix {
    /// Without predictions.
    ///
    /// # Errors
    /// If there is no class, or the counts do not fit into the memory.
    pub fn new(n_classes: usize) -> Result<Self> {
        if n_classes == 0 {
            let remedy = "give the number of logits in a row";
            return Err(Error::argument("number of classes", 0, "1 or more", remedy));
        }
        let needed = memory::product([n_classes, n_classes, size_of::<u64>()]);
        memory::require("a confusion matrix", needed, "take fewer classes")?;
        Ok(ConfusionMatrix { n_classes, counts: vec![0; n_classes * n_classes] })
    }

    /// Adds rows of `logits`, `[n, n_classes]`: each predicts the class of its greatest one, the first of equal ones.
    ///
    /// # Errors
    /// If there are not `n_classes` logits for each target, a target is not a class, or a logit is not a number;
    /// nothing is added then.
    pub fn add_logits<T: Scalar, C: Copy + Into<usize>>(
        &mut self,
        logits: &[T],
        targets: &[C],
    ) -> Result<()> {
        let n_classes = self.n_classes;
        check_lengths("number of logits", logits.len(), (targets.len(), n_classes))?;
        if let Some(i) = logits.iter().position(|x| x.to_f64().is_nan()) {
            return Err(Error::NotFinite {
                place: format!("logit {} of row {}", i % n_classes, i / n_classes),
                found: "not a number".into(),
                remedy: "lower the learning rate, or use an earlier checkpoint".into(),
            });
        }
        let greatest =
            |row: &[T]| (1..n_classes).fold(0, |g, c| if row[c] > row[g] { c } else { g });
        let predicted: Vec<usize> = logits.chunks_exact(n_classes).map(greatest).collect();
        self.add_classes(&predicted, targets)
    }

    /// Adds predicted against true classes.
    ///
    /// # Errors
    /// If the lists differ in length or hold what is not a class; nothing is added then.
    pub fn add_classes<P: Copy + Into<usize>, C: Copy + Into<usize>>(
        &mut self,
        predicted: &[P],
        truth: &[C],
    ) -> Result<()> {
        check_lengths("number of predicted classes", predicted.len(), (truth.len(), 1))?;
        self.check_classes("predicted class", predicted)?;
        self.check_classes("true class", truth)?;
        for (&predicted, &truth) in predicted.iter().zip(truth) {
            self.counts[truth.into() * self.n_classes + predicted.into()] += 1;
        }
        Ok(())
    }

    fn check_classes<C: Copy + Into<usize>>(
        &self,
        name: &'static str,
        classes: &[C],
    ) -> Result<()> {
        let n_classes = self.n_classes;
        let Some(i) = classes.iter().position(|&c| c.into() >= n_classes) else { return Ok(()) };
        let found = format!("{} in row {i}", classes[i].into());
        let expected = format!("below {n_classes}, the number of classes");
        Err(Error::argument(name, found, expected, "correct the label, or add classes"))
    }

    /// Number of classes.
    pub fn n_classes(&self) -> usize {
        self.n_classes
    }

    /// How often `predicted` was the answer where `truth` is right.
    ///
    /// # Panics
    /// If there is no such class.
    pub fn count(&self, truth: usize, predicted: usize) -> u64 {
        assert!(predicted < self.n_classes, "class {predicted} of {} classes", self.n_classes);
        self.counts[truth * self.n_classes..][..self.n_classes][predicted]
    }

    /// Number of predictions.
    pub fn n(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// One class against all others: its precision, recall, F1 and IoU.
    ///
    /// # Panics
    /// If there is no such class.
    pub fn class(&self, class: usize) -> Confusion {
        let hits = self.count(class, class);
        let of = |counts: &mut dyn Iterator<Item = &u64>| counts.sum::<u64>() - hits;
        let misses = of(&mut self.counts[class * self.n_classes..][..self.n_classes].iter());
        let wrong = of(&mut self.counts[class..].iter().step_by(self.n_classes));
        Confusion::from_array([hits, wrong, misses, self.n() - hits - wrong - misses])
    }

    /// Share of right predictions; 1 if there are none.
    pub fn accuracy(&self) -> f64 {
        let right = self.counts.iter().step_by(self.n_classes + 1).sum();
        ratio(right, self.n())
    }

    /// Mean F1 over the classes that occur in truth or prediction; 1 if none does.
    pub fn mean_f1(&self) -> f64 {
        self.mean(Confusion::f1)
    }

    /// Mean intersection over union over the classes that occur in truth or prediction; 1 if none does.
    pub fn mean_iou(&self) -> f64 {
        self.mean(Confusion::iou)
    }

    fn mean(&self, score: impl Fn(&Confusion) -> f64) -> f64 {
        let classes = (0..self.n_classes).map(|class| self.class(class));
        let occurring = classes.filter(|c| c.true_negative < c.n()).map(|c| score(&c));
        let scores: Vec<f64> = occurring.collect();
        if scores.is_empty() { 1.0 } else { scores.iter().sum::<f64>() / scores.len() as f64 }
    }
}

fn check_lengths(name: &'static str, found: usize, (n, each): (usize, usize)) -> Result<()> {
    if n.checked_mul(each) == Some(found) {
        return Ok(());
    }
    let expected = format!("{each} for each of {n} true classes");
    Err(Error::argument(name, found, expected, "give predictions and truth of the same rows"))
}

/// # Panics
/// If the numbers of classes differ.
impl AddAssign<&ConfusionMatrix> for ConfusionMatrix {
    fn add_assign(&mut self, other: &Self) {
        assert_eq!(self.n_classes, other.n_classes, "numbers of classes differ");
        self.counts.iter_mut().zip(&other.counts).for_each(|(sum, n)| *sum += n);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows: true classes; columns: predicted ones.
    const TABLE: [[u64; 3]; 3] = [[2, 1, 0], [1, 2, 1], [0, 0, 3]];

    fn matrix() -> ConfusionMatrix {
        let (mut predicted, mut truth) = (Vec::<u8>::new(), Vec::<u16>::new());
        for (t, row) in TABLE.iter().enumerate() {
            for (p, n) in row.iter().enumerate() {
                predicted.extend((0..*n).map(|_| p as u8));
                truth.extend((0..*n).map(|_| t as u16));
            }
        }
        let mut matrix = ConfusionMatrix::new(3).unwrap();
        matrix.add_classes(&predicted, &truth).unwrap();
        matrix
    }

    #[test]
    fn scores_of_three_classes_are_those_computed_by_hand() {
        let m = matrix();
        assert_eq!([0, 1, 2].map(|t| [0, 1, 2].map(|p| m.count(t, p))), TABLE);
        assert_eq!((m.n_classes(), m.n(), m.accuracy()), (3, 10, 0.7));
        let of = |c: Confusion| [c.precision(), c.recall(), c.f1(), c.iou()];
        assert_eq!(of(m.class(0)), [2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 0.5]);
        assert_eq!(of(m.class(1)), [2.0 / 3.0, 0.5, 4.0 / 7.0, 0.4]);
        assert_eq!(of(m.class(2)), [0.75, 1.0, 6.0 / 7.0, 0.75]);
        assert_eq!(m.class(1).to_array(), [2, 1, 2, 5]);
        assert!((m.mean_iou() - 0.55).abs() < 1e-15 && (m.mean_f1() - 44.0 / 63.0).abs() < 1e-15);
        let mut twice = m.clone();
        twice += &m;
        assert_eq!((twice.n(), twice.mean_iou()), (20, m.mean_iou()));
    }

    #[test]
    fn classes_that_do_not_occur_count_in_no_mean() {
        let mut m = ConfusionMatrix::new(5).unwrap();
        assert_eq!((m.accuracy(), m.mean_iou(), m.mean_f1()), (1.0, 1.0, 1.0));
        m.add_classes(&[1usize, 1, 3], &[1usize, 1, 1]).unwrap();
        // Class 1: 2 of 3; class 3 was predicted, and is never right.
        assert!((m.mean_iou() - (2.0 / 3.0 + 0.0) / 2.0).abs() < 1e-15);
    }

    #[test]
    fn two_classes_have_the_scores_of_yes_and_no() {
        let (logits, targets) = ([0.1f32, 0.2, 0.4, 0.3, 0.9, -0.9, 0.0, 1.0], [1u8, 0, 1, 0]);
        let mut m = ConfusionMatrix::new(2).unwrap();
        m.add_logits(&logits, &targets).unwrap();
        for class in [0, 1] {
            assert_eq!(m.class(class), Confusion::of_logits(&logits, &targets, class as u8));
        }
    }

    #[test]
    fn equal_logits_predict_the_first_class() {
        let mut m = ConfusionMatrix::new(3).unwrap();
        m.add_logits(&[0.0, 1.0, 1.0], &[2u8]).unwrap();
        assert_eq!(m.count(2, 1), 1);
    }

    #[test]
    fn what_is_no_class_or_no_number_is_an_error_and_adds_nothing() {
        let mut m = ConfusionMatrix::new(3).unwrap();
        let mut refused = |logits: &[f64], targets: &[u8], words: &str| {
            let error = m.add_logits(logits, targets).unwrap_err().to_string();
            assert!(error.starts_with(words), "{error}");
        };
        refused(&[0.0; 6], &[0, 3], "true class is 3 in row 1, expected below 3");
        refused(&[0.0; 5], &[0, 1], "number of logits is 5, expected 3 for each of 2 true");
        refused(&[0.0, 0.0, 0.0, 0.0, f64::NAN, 0.0], &[0, 1], "logit 1 of row 1: not a number");
        let error = m.add_classes(&[0u8, 9], &[0u8, 0]).unwrap_err().to_string();
        assert!(error.starts_with("predicted class is 9 in row 1"), "{error}");
        let error = m.add_classes(&[0u8], &[0u8, 0]).unwrap_err().to_string();
        assert!(error.starts_with("number of predicted classes is 1, expected 1 for"), "{error}");
        assert_eq!(m.n(), 0);
        let error = ConfusionMatrix::new(0).unwrap_err().to_string();
        assert!(error.starts_with("number of classes is 0, expected 1 or more"), "{error}");
    }
}
