//! Four sets of cutters, with and without cutter modules, and with extreme cutters in the training.

use super::page::Page;
use super::pictures::Sheet;
use super::samples::inaccessible_share;
use super::scores;
use super::study::Study;
use super::trainings::{Trainings, test_samples, training_samples};
use deepmill::Result;
use deepmill::access::Labeler;
use deepmill::cutter::CutterSet;
use deepmill::data::Sample;
use deepmill::model::config::CutterPlacement;
use deepmill::tables::{Cell, Table};
use deepmill::train::evaluate;
use serde_json::Value;

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let labeler = Labeler::published();
    let uniform = training_samples(study, &[CutterSet::Uniform], &labeler)?;
    let sets = [CutterSet::Uniform, CutterSet::Extreme];
    let with_extreme = training_samples(study, &sets, &labeler)?;
    let train = |name, data: &[Sample], placement| {
        let network =
            trainings.network(name, data, |s| s.network.cutter_mut().placement = placement);
        network.map(|trained| (name, trained))
    };
    let networks = [
        train("without modules", &uniform, CutterPlacement::None)?,
        train("with modules", &uniform, CutterPlacement::All)?,
        train(
            "with modules, every other training cutter extreme",
            &with_extreme,
            CutterPlacement::All,
        )?,
    ];
    let mut columns = vec![("set", "test cutters"), ("network", "network")];
    columns.extend(scores::COLUMNS);
    columns.push(("inaccessible", "inaccessible, exact"));
    let mut table = Table::new(&columns);
    let mut sheet = Sheet::default();
    for set in CutterSet::PUBLISHED {
        let samples = test_samples(study, set)?;
        for (name, trained) in &networks {
            study.go_on()?;
            let mut row = vec![Cell::text(set.name()), Cell::text(*name)];
            row.extend(scores::cells(evaluate(&trained.model, &samples)?.mean()));
            row.push(Cell::Share(inaccessible_share(&samples)));
            table.row(row);
        }
        if [CutterSet::Short, CutterSet::Extreme].contains(&set) {
            let (mesh, about) =
                (&study.test_parts()[0].mesh, format!("{}, {set}", samples[0].name));
            sheet.add_answers(mesh, &samples[0], &networks[..2], &about)?;
        }
    }
    sheet.image().write_png(&study.file("cutters.png"))?;
    let page = Page {
        name: "cutters",
        title: "Sets of cutters",
        text: vec![
            "Networks with and without cutter modules, trained with cutters of the set Uniform, and with modules and half of the \
             training cutters from the set Extreme; scored with cutters of four sets. The training set of the third network is \
             as large as that of the others."
                .into(),
            trainings.words(),
        ],
        table,
        pictures: vec![(
            "cutters.png".into(),
            "One test part, a short cutter above, an extreme one below: exact labels, the network without modules, the network with modules".into(),
        )],
    };
    page.write(study)
}
