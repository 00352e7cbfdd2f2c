//! Where in the decoder the cutter modules are.

use super::page::Page;
use super::scores;
use super::study::Study;
use super::trainings::{Trainings, training_samples};
use deepmill::Result;
use deepmill::access::Labeler;
use deepmill::cutter::CutterSet;
use deepmill::model::config::CutterPlacement;
use deepmill::report::curves::write_curves;
use deepmill::tables::{Cell, Table};
use serde_json::Value;

const PLACEMENTS: [(CutterPlacement, &str); 4] = [
    (CutterPlacement::None, "none"),
    (CutterPlacement::First, "first stage"),
    (CutterPlacement::Last, "last stage"),
    (CutterPlacement::All, "every stage"),
];

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let labeler = Labeler::published();
    let data = training_samples(study, &[CutterSet::Uniform], &labeler)?;
    let mut columns = vec![
        ("modules", "cutter modules"),
        ("parameters", "parameters"),
        ("loss", "training loss"),
    ];
    columns.extend(scores::COLUMNS);
    let mut table = Table::new(&columns);
    let mut networks = Vec::new();
    for (placement, name) in PLACEMENTS {
        let trained =
            trainings.network(name, &data, |s| s.network.cutter_mut().placement = placement)?;
        let (loss, tested) = scores::last(&trained);
        let n_parameters = trained.model.params.len();
        let mut row = vec![Cell::text(name), Cell::count(n_parameters), Cell::Number(loss)];
        row.extend(scores::cells(tested));
        table.row(row);
        networks.push((name, trained));
    }
    let charts = scores::charts(&trainings, &networks);
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
