//! What a network says about the sites of one part and one cutter, and the calibration of its logits.

use super::config::N_COARSE;
use super::heads::N_CLASSES;
use crate::answers::{NetworkEvidence, SiteAnswers, is_positive, mark_top_share};
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Class of head 1 that means "inaccessible"; class 1 means "accessible".
pub const INACCESSIBLE_CLASS: usize = 0;
/// Class of head 2 that means "occlusion point"; class 0 means "none".
pub const OCCLUSION_CLASS: usize = 1;

/// Turns the margin `m` between the logits of "yes" and "no" into `slope · m + offset` (Platt 1999, *Probabilistic
/// outputs for support vector machines*). An offset of 0 is the scaling by a temperature of `1 / slope` (Guo et al.
/// 2017).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Factor of both logits, positive.
    pub slope: f64,
    /// What is added to the logit of "yes" then.
    pub offset: f64,
}

impl Calibration {
    /// Leaves logits as they are.
    pub const IDENTITY: Self = Calibration { slope: 1.0, offset: 0.0 };

    /// Whether both numbers are in their domain.
    pub fn is_sound(&self) -> bool {
        self.slope > 0.0 && self.slope.is_finite() && self.offset.is_finite()
    }

    /// Checks that both numbers are in their domain.
    ///
    /// # Errors
    /// If they are not.
    pub fn check(&self) -> Result<()> {
        if self.is_sound() {
            return Ok(());
        }
        let found = format!("{self:?}");
        let remedy = "fit it to a validation set, or take Calibration::IDENTITY";
        Err(Error::argument("calibration", found, "a positive slope and finite numbers", remedy))
    }

    /// Calibrates the logits of any head, `[n, n_classes]`: each is multiplied by the slope, and to those of the last
    /// class the offset is added. What is most likely of more than two classes stays most likely if the offset is 0.
    ///
    /// ```
    /// use deepmill::model::Calibration;
    ///
    /// let mut logits = [0.0, 3.0, 1.0, 2.0, 0.0, 0.0]; // of three classes
    /// Calibration { slope: 0.5, offset: 0.0 }.calibrate(&mut logits, 3)?;
    /// assert_eq!(logits, [0.0, 1.5, 0.5, 1.0, 0.0, 0.0]);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    ///
    /// # Errors
    /// If a number is out of its domain, there are no classes, or the number of logits is not a multiple of theirs. The
    /// logits are as they were.
    pub fn calibrate<T: Scalar>(&self, logits: &mut [T], n_classes: usize) -> Result<()> {
        self.check()?;
        if n_classes == 0 || !logits.len().is_multiple_of(n_classes) {
            let expected = format!("a multiple of {n_classes} classes");
            let remedy = "give rows of as many logits as there are classes";
            return Err(Error::argument("number of logits", logits.len(), expected, remedy));
        }
        logits.chunks_exact_mut(n_classes).for_each(|row| self.calibrate_row(row));
        Ok(())
    }

    fn calibrate_row<T: Scalar>(self, row: &mut [T]) {
        let slope = T::from_f64(self.slope);
        row.iter_mut().for_each(|logit| *logit *= slope);
        if let Some(last) = row.last_mut().filter(|_| self.offset != 0.0) {
            *last += T::from_f64(self.offset);
        }
    }

    /// The logits of "no" and "yes".
    pub(super) fn apply<T: Scalar>(self, no: T, yes: T) -> [T; N_CLASSES] {
        let mut row = [no, yes];
        self.calibrate_row(&mut row);
        row
    }
}

/// What a network says about the sites of one part and one cutter, as numbers.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Prediction<T> {
    /// Two logits per site of head 1: accessible, inaccessible.
    pub logits_inaccessible: Vec<[T; N_CLASSES]>,
    /// Two logits per site of head 2: no occlusion point, occlusion point.
    pub logits_occlusion: Vec<[T; N_CLASSES]>,
    /// Share of the directions in which the cutter has a free pose at the site, in [0, 1]; empty for a network
    /// without such a head.
    pub accessible_share: Vec<f32>,
    /// What a network with [`coarse_directions`](super::config::InputConfig::coarse_directions) has read of each site
    /// beside the shape: three numbers in [0, 1] and one in [−1, 1]; empty for others.
    #[doc(hidden)] // of the program
    pub coarse_answers: Vec<[f32; N_COARSE]>,
}

impl<T: Scalar> Prediction<T> {
    /// Keeps the first `n` sites.
    pub(super) fn truncate(&mut self, n: usize) {
        self.logits_inaccessible.truncate(n);
        self.logits_occlusion.truncate(n);
        self.accessible_share.truncate(n);
        self.coarse_answers.truncate(n);
    }

    /// Puts what `group` has about its sites at their `rows` among `n`.
    pub(super) fn place(&mut self, group: Prediction<T>, rows: &[usize], n: usize) {
        fn put<V: Copy>(to: &mut Vec<V>, from: &[V], rows: &[usize], n: usize) {
            let Some(&any) = from.first() else { return };
            to.resize(n, any);
            rows.iter().zip(from).for_each(|(&row, value)| to[row] = *value);
        }
        put(&mut self.logits_inaccessible, &group.logits_inaccessible, rows, n);
        put(&mut self.logits_occlusion, &group.logits_occlusion, rows, n);
        put(&mut self.accessible_share, &group.accessible_share, rows, n);
        put(&mut self.coarse_answers, &group.coarse_answers, rows, n);
    }

    /// Decisions and probabilities of both heads, and the shares of accessible directions.
    pub fn answers(&self) -> SiteAnswers {
        let decide = |logits: &[[T; N_CLASSES]]| logits.iter().copied().map(is_positive).collect();
        let evidence = NetworkEvidence::new(
            probabilities(&self.logits_inaccessible),
            probabilities(&self.logits_occlusion),
        );
        SiteAnswers {
            network: Some(evidence),
            accessible_share: self.accessible_share.clone(),
            ..SiteAnswers::new(decide(&self.logits_inaccessible), decide(&self.logits_occlusion))
        }
    }

    /// As [`Prediction::answers`], but the `share` of sites that look most like occlusion points are marked:
    /// as many as the labels' definition marks, where a decision site by site leaves their number open.
    pub fn answers_ranked(&self, share: f64) -> SiteAnswers {
        let margin = |[no, yes]: &[T; N_CLASSES]| (*yes - *no).to_f64();
        let margins: Vec<f64> = self.logits_occlusion.iter().map(margin).collect();
        SiteAnswers { occlusion: mark_top_share(&margins, share, f64::total_cmp), ..self.answers() }
    }
}

/// Softmax of two logits, of the second.
pub(super) fn probabilities<T: Scalar>(logits: &[[T; N_CLASSES]]) -> Vec<f32> {
    let softmax = |[no, yes]: &[T; N_CLASSES]| T::ONE / (T::ONE + (*no - *yes).exp());
    logits.iter().map(|logits| softmax(logits).to_f64() as f32).collect()
}
