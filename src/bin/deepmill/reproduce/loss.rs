//! Sum against mean of the losses, and augmentation with labels kept and made anew.

use super::page::Page;
use super::scores;
use super::study::Study;
use super::trainings::{Trainings, training_samples};
use deepmill::Result;
use deepmill::access::Labeler;
use deepmill::cutter::CutterSet;
use deepmill::data::augment::{Augment, Turn};
use deepmill::data::online::OnlineSettings;
use deepmill::report::curves::write_curves;
use deepmill::tables::{Cell, Table};
use deepmill::train::{Reduction, Settings};
use serde_json::Value;

/// Where the labels of a changed part come from.
#[derive(Clone, Copy, PartialEq)]
enum Labels {
    /// Those of the part as it was, as in the published training.
    Kept,
    /// Made anew for the part as it is then, with a new cutter.
    Anew,
}

/// Loss, whether mirrored, whether deformed, labels.
type Way = (Reduction, bool, bool, Labels);

const WAYS: [(&str, Way); 7] = [
    ("sum, unchanged parts", (Reduction::Sum, false, false, Labels::Kept)),
    ("mean, unchanged parts", (Reduction::Mean, false, false, Labels::Kept)),
    ("sum, both, labels kept", (Reduction::Sum, true, true, Labels::Kept)),
    ("sum, fresh cutters", (Reduction::Sum, false, false, Labels::Anew)),
    ("sum, mirrored, anew", (Reduction::Sum, true, false, Labels::Anew)),
    ("sum, elastic, anew", (Reduction::Sum, false, true, Labels::Anew)),
    ("sum, both, anew", (Reduction::Sum, true, true, Labels::Anew)),
];

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let labeler = Labeler::published();
    let data = training_samples(study, &[CutterSet::Uniform], &labeler)?;
    let mut columns = vec![
        ("loss", "loss"),
        ("mirrored", "mirrored"),
        ("elastic", "elastic"),
        ("labels", "labels"),
        ("training_loss", "training loss"),
    ];
    columns.extend(scores::COLUMNS);
    let mut table = Table::new(&columns);
    let mut networks = Vec::new();
    for (name, way) in WAYS {
        let trained = trainings.network(name, &data, |settings| change(settings, way))?;
        let (loss, tested) = scores::last(&trained);
        let mut row = words(way).map(Cell::text).to_vec();
        row.push(Cell::Number(loss));
        row.extend(scores::cells(tested));
        table.row(row);
        networks.push((name, trained));
    }
    write_curves(&study.file("loss.svg"), "samples", &scores::charts(&trainings, &networks))?;
    let page = Page {
        name: "loss",
        title: "Loss and augmentation",
        text: vec![
            "Networks that differ only in how the losses of the heads are joined and how the training parts are changed. \
             *Kept*: a part keeps its labels when it is mirrored in x or y and deformed, as in the published training. *Anew*: \
             each sample gets a new cutter, and its labels after it was mirrored in x or deformed; so the row that changes no \
             part is the one to compare with. The mean of the losses is half of their sum: so is its training loss."
                .into(),
            trainings.words(),
        ],
        table,
        pictures: vec![("loss.svg".into(), "Loss and scores over the samples seen".into())],
    };
    page.write(study)
}

fn change(settings: &mut Settings, (reduction, mirror, elastic, labels): Way) {
    settings.loss.reduction = reduction;
    let elastic = Settings::paper().augment.elastic.filter(|_| elastic);
    match labels {
        Labels::Kept => {
            settings.augment =
                Augment::default().with_mirror(mirror).with_elastic(elastic).with_turn(Turn::None)
        }
        Labels::Anew => {
            let (cutter_set, turn) = (CutterSet::Uniform, Turn::None);
            let rigid = OnlineSettings::default().with_sides(0.0).with_tilt(0.0);
            settings.online = Some(
                rigid
                    .with_cutter_set(cutter_set)
                    .with_mirror(mirror)
                    .with_turn(turn)
                    .with_elastic(elastic),
            );
        }
    }
}

fn words((reduction, mirror, elastic, labels): Way) -> [&'static str; 4] {
    let yes = |yes| if yes { "yes" } else { "no" };
    let loss = if reduction == Reduction::Sum { "sum" } else { "mean" };
    let labels = match labels {
        Labels::Kept if mirror || elastic => "kept",
        Labels::Kept => "of the data set",
        Labels::Anew => "anew",
    };
    [loss, yes(mirror), yes(elastic), labels]
}
