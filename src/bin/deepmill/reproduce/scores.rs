//! Scores of both heads as columns, and as curves over the samples seen.

use super::trainings::{Trained, Trainings};
use deepmill::report::curves::{Chart, Series};
use deepmill::tables::Cell;
use deepmill::train::{EpochRow, HeadScore};

/// Headings of [`cells`], with their keys.
pub const COLUMNS: [(&str, &str); 4] =
    [("acc_i", "Acc_i"), ("f1_i", "F1_i"), ("acc_o", "Acc_o"), ("f1_o", "F1_o")];

/// Accuracy and F1 of head 1, then of head 2.
pub fn cells([i, o]: [HeadScore; 2]) -> [Cell; 4] {
    [i.accuracy, i.f1, o.accuracy, o.f1].map(Cell::Share)
}

/// The last training loss, and the last scores on the test samples.
pub fn last(trained: &Trained) -> (f64, [HeadScore; 2]) {
    let row = trained.history.last().copied().unwrap_or_default();
    (row.loss, row.validation.unwrap_or_default())
}

/// Training loss, Acc_i and F1_o over the samples seen, one curve for each network.
pub fn charts(trainings: &Trainings, networks: &[(&str, Trained)]) -> [Chart; 3] {
    let chart = |title: &str, value: &dyn Fn(&EpochRow) -> Option<f64>| {
        let point = |r: &EpochRow| Some((trainings.seen(r.epoch), value(r)?));
        let curve = |(name, trained): &(&str, Trained)| Series {
            name: (*name).into(),
            points: trained.history.iter().filter_map(point).collect(),
        };
        Chart { title: title.into(), series: networks.iter().map(curve).collect() }
    };
    let tested = |value: fn(&[HeadScore; 2]) -> f64| {
        move |r: &EpochRow| r.validation.as_ref().map(|scores| 100.0 * value(scores))
    };
    [
        chart("training loss", &|r| Some(r.loss)),
        chart("Acc_i on the test parts, %", &tested(|s| s[0].accuracy)),
        chart("F1_o on the test parts, %", &tested(|s| s[1].f1)),
    ]
}
