//! The history of a training run: one row per epoch, written as CSV.

use serde::{Deserialize, Serialize};
use std::fmt;

/// One head's scores, each in `[0, 1]`; F1 of class "yes" (inaccessible, or occlusion).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct HeadScore {
    /// Share of sites labeled right.
    pub accuracy: f64,
    /// F1 of the positive class.
    pub f1: f64,
}

impl HeadScore {
    /// Of these.
    pub fn new(accuracy: f64, f1: f64) -> Self {
        HeadScore { accuracy, f1 }
    }
}

/// What one epoch did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct EpochRow {
    /// Epoch, from 1.
    pub epoch: u64,
    /// Learning rate used.
    pub lr: f64,
    /// Mean training loss over its batches.
    pub loss: f64,
    /// Training scores of head 1, measured on the fly.
    pub inaccessible: HeadScore,
    /// Training scores of head 2, measured on the fly.
    pub occlusion: HeadScore,
    /// Scores of both heads on the validation set, where it was evaluated.
    pub validation: Option<[HeadScore; 2]>,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// One line for people: loss and F1 of both heads.
impl fmt::Display for EpochRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let EpochRow { epoch, loss, inaccessible, occlusion, .. } = self;
        let [first, second] = [inaccessible.f1, occlusion.f1];
        write!(f, "epoch {epoch}: loss {loss:.4}, F1 inaccessible {first:.3}, ")?;
        write!(f, "F1 occlusion {second:.3}")?;
        match self.validation {
            Some([a, b]) => write!(f, "; validation {:.3} and {:.3}", a.f1, b.f1),
            None => Ok(()),
        }
    }
}

/// The columns of a history file.
pub const CSV_HEADER: &str = "epoch,lr,loss,acc_inaccessible,f1_inaccessible,acc_occlusion,f1_occlusion,\
val_acc_inaccessible,val_f1_inaccessible,val_acc_occlusion,val_f1_occlusion,seconds";

/// Writes all rows to `path` as a whole or not at all.
///
/// # Errors
/// If the file cannot be written.
#[cfg(feature = "formats")]
pub fn write_csv(path: &std::path::Path, rows: &[EpochRow]) -> crate::Result<()> {
    crate::storage::atomic_file::write_atomic(path, |file| {
        writeln!(file, "{CSV_HEADER}")?;
        rows.iter().try_for_each(|row| writeln!(file, "{}", row.csv()))
    })
}

#[cfg(feature = "formats")]
impl EpochRow {
    fn csv(&self) -> String {
        let head = |h: &HeadScore| format!("{:.6},{:.6}", h.accuracy, h.f1);
        let validation = match &self.validation {
            Some([a, b]) => format!("{},{}", head(a), head(b)),
            None => ",,,".into(),
        };
        format!(
            "{},{:e},{:.6},{},{},{validation},{:.3}",
            self.epoch,
            self.lr,
            self.loss,
            head(&self.inaccessible),
            head(&self.occlusion),
            self.seconds
        )
    }
}

#[cfg(all(test, feature = "formats"))]
mod tests {
    use super::*;

    #[test]
    fn every_row_has_as_many_columns_as_the_header() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        let scored =
            EpochRow { validation: Some([HeadScore::default(); 2]), ..EpochRow::default() };
        write_csv(&path, &[EpochRow::default(), scored]).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let columns = |line: &str| line.split(',').count();
        assert_eq!(text.lines().count(), 3);
        assert!(text.lines().all(|line| columns(line) == columns(CSV_HEADER)));
    }
}
