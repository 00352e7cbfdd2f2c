//! Where in the decoder the cutter modules are.

use super::page::Page;
use super::study::{N_DIRECTIONS, Study};
use super::trainings::{Trainings, training_samples};
use deepmill::Result;
use deepmill::cutter::CutterSet;
use deepmill::directions::Directions;
use deepmill::model::config::CutterPlacement;
use deepmill::report::curves::{Chart, Series, write_curves};
use deepmill::report::tables::{Cell, Table};
use deepmill::train::{EpochRow, HeadScore};
use serde_json::Value;

const PLACEMENTS: [(CutterPlacement, &str); 4] = [
    (CutterPlacement::None, "none"),
    (CutterPlacement::First, "first stage"),
    (CutterPlacement::Last, "last stage"),
    (CutterPlacement::All, "every stage"),
];

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let directions = Directions::fibonacci_hemisphere(N_DIRECTIONS)?;
    let data = training_samples(study, &[CutterSet::Uniform], &directions)?;
    let mut table = Table::new(&[
        ("modules", "cutter modules"),
        ("parameters", "parameters"),
        ("loss", "training loss"),
        ("acc_i", "Acc_i"),
        ("f1_i", "F1_i"),
        ("acc_o", "Acc_o"),
        ("f1_o", "F1_o"),
    ]);
    let mut histories = Vec::new();
    for (placement, name) in PLACEMENTS {
        let trained = trainings.network(name, &data, |s| s.network.cutter.placement = placement)?;
        let n_parameters = trained.model.params.len();
        let last = trained.history.last().copied().unwrap_or_default();
        let [i, o] = last.validation.unwrap_or_default();
        let mut row = vec![Cell::text(name), Cell::count(n_parameters), Cell::Number(last.loss)];
        row.extend([i.accuracy, i.f1, o.accuracy, o.f1].map(Cell::Share));
        table.row(row);
        histories.push((name, trained.history));
    }
    let chart = |title: &str, value: &dyn Fn(&EpochRow) -> Option<f64>| {
        let point = |r: &EpochRow| Some((trainings.seen(r.epoch), value(r)?));
        let curve = |(name, rows): &(&str, Vec<EpochRow>)| Series {
            name: (*name).into(),
            points: rows.iter().filter_map(point).collect(),
        };
        Chart { title: title.into(), series: histories.iter().map(curve).collect() }
    };
    let tested = |value: fn(&[HeadScore; 2]) -> f64| {
        move |r: &EpochRow| r.validation.as_ref().map(|scores| 100.0 * value(scores))
    };
    let charts = [
        chart("training loss", &|r| Some(r.loss)),
        chart("Acc_i on the test parts, %", &tested(|s| s[0].accuracy)),
        chart("F1_o on the test parts, %", &tested(|s| s[1].f1)),
    ];
    write_curves(&study.file("placement.svg"), "samples", &charts)?;
    let page = Page {
        name: "placement",
        title: "Placement of the cutter modules",
        text: vec![
            "Networks that differ only in the stages of the decoder which see the cutter; cutters of the set Uniform.".into(),
            trainings.words(),
        ],
        table,
        pictures: vec![("placement.svg".into(), "Loss and scores over the samples seen".into())],
    };
    page.write(study)
}
