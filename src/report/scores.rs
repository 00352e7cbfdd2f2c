//! A table of scores of predictions against labels that names the positive class.

use crate::learn::metrics::Confusion;
use crate::tables::{Cell, Table};

/// A table of scores; each row is named after its positive class.
///
/// Rows for both heads come from [`heads`]; callers add baselines.
pub fn table(rows: &[(&str, &Confusion)]) -> Table {
    let mut table = Table::new(&[
        ("positive_class", "positive class"),
        ("accuracy", "accuracy"),
        ("f1", "F1"),
        ("precision", "precision"),
        ("recall", "recall"),
        ("iou", "IoU"),
        ("share_exact", "exact share"),
        ("share_predicted", "predicted share"),
    ]);
    for (name, counts) in rows {
        let n = counts.n().max(1) as f64;
        table.row([
            Cell::text(*name),
            Cell::Share(counts.accuracy()),
            Cell::Share(counts.f1()),
            Cell::Share(counts.precision()),
            Cell::Share(counts.recall()),
            Cell::Share(counts.iou()),
            Cell::Share((counts.true_positive + counts.false_negative) as f64 / n),
            Cell::Share((counts.true_positive + counts.false_positive) as f64 / n),
        ]);
    }
    table
}

/// The rows of both heads: "inaccessible", the same head with the reference implementation's positive
/// class "accessible", and "occlusion".
pub fn heads(inaccessible: &Confusion, occlusion: &Confusion) -> [(&'static str, Confusion); 3] {
    [
        ("inaccessible", *inaccessible),
        ("accessible (reference F1)", inaccessible.swapped()),
        ("occlusion", *occlusion),
    ]
}
