//! Table 1: scores and times on CAD, freeform and complex parts.

use super::page::Page;
use super::parts::Part;
use super::samples::{Draw, labeled};
use super::scores;
use super::sets::{self, Set};
use super::study::Study;
use super::trainings::{Data, N_CUTTERS, N_TEST_CUTTERS, Trained, Trainings};
use deepmill::Result;
use deepmill::access::{LabelOptions, Labeler};
use deepmill::cutter::{Cutter, CutterSet};
use deepmill::data::Sample;
use deepmill::directions::Directions;
use deepmill::model::AnyModel;
use deepmill::tables::{Cell, Table};
use deepmill::train::{Evaluation, HeadScore};
use serde_json::Value;
use std::sync::Arc;
use std::time::Instant;

/// Acc_i, F1_i, Acc_o, F1_o in the paper, all that this project knows of its table.
const PUBLISHED: [(Set, [f64; 4]); 2] =
    [(Set::Cad, [0.963, 0.972, 0.983, 0.894]), (Set::Freeform, [0.928, 0.937, 0.975, 0.865])];

/// Sites on CAD and freeform parts, on the same parts again, and on complex ones: 7,000, 15,000 and 100,000, or in
/// proportion to `--sites`.
pub fn sizes(study: &Study) -> [usize; 3] {
    [7, 15, 100].map(|thousands| study.args.sites * thousands / 7)
}

/// The network that is trained on CAD parts with `n_sites` sites; no score is taken before its end.
pub fn network(study: &Study, trainings: &Trainings, n_sites: usize) -> Result<Trained> {
    let labeler = labeler(true);
    let draw = Draw { sets: &[CutterSet::Uniform], n_cutters: N_CUTTERS };
    let data = labeled(study, &sets::training_parts(study), &draw, &labeler, n_sites)?;
    let name = format!("CAD parts, {n_sites} sites");
    trainings.network_of(&name, &Data::of_sites(&data, &[]), |_| ())
}

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let [few, more, many] = sizes(study);
    let small = network(study, &trainings, few)?;
    let large = network(study, &trainings, more)?;
    let mut columns = vec![("set", "parts"), ("sites", "sites"), ("source", "source")];
    columns.extend(scores::COLUMNS);
    columns.extend([("t_i", "T_i"), ("t_o", "T_o"), ("t", "T"), ("avg", "Avg")]);
    let mut table = Table::new(&columns);
    for set in [Set::Cad, Set::Freeform] {
        let parts = set.parts(study);
        for (n_sites, trained) in [(few, &small), (more, &large)] {
            let tested = test(study, &trained.model, &parts, n_sites)?;
            row(&mut table, set, n_sites, "here", &tested);
        }
        for (_, published) in PUBLISHED.iter().filter(|(of, _)| *of == set) {
            published_row(&mut table, set, published);
        }
    }
    let tested = test(study, &large.model, &Set::Complex.parts(study), many)?;
    row(&mut table, Set::Complex, many, "here", &tested);
    let page = Page {
        name: "table1",
        title: "Scores and times on CAD, freeform and complex parts",
        text: vec![
            format!(
                "Networks (preset `{}`) that saw {} samples of {} CAD parts with {N_CUTTERS} cutters each, at {few} sites and at \
                 {more}; the latter answers for the complex parts. Freeform parts are of families that no network saw; complex \
                 ones (lattice, bladed disc, engraved plate, impeller, heat sink, of each the one with most triangles of eight) \
                 are of another series than the training parts. {N_TEST_CUTTERS} cutters for each test part; the networks \
                 are scored once, at the end, so that the test parts choose nothing.",
                study.args.preset,
                trainings.n_samples(),
                sets::training_parts(study).len(),
            ),
            "Averages over samples; positive classes *inaccessible* and *occlusion*. *Avg*: mean of the four scores. *T_i*: exact \
             labels of the first head; *T_o*: what the occlusion labels cost on top; *T*: the network's answer for both; per \
             sample, without the sampling of the sites. The published rows have what is known here of the paper's table, and \
             their mean; whether its F1_i counts *inaccessible* or *accessible* as positive, and which sites they stand for, is \
             not. The paper gives 29 s for the labels of a part with 7,000 sites and 225 s with 15,000, and no occlusion labels \
             at 100,000."
                .into(),
        ],
        table,
        pictures: vec![],
    };
    page.write(study)
}

/// What one network answered for one set.
struct Tested {
    evaluation: Evaluation,
    /// Both labels less the first, and the network: seconds per sample.
    seconds: [f64; 3],
}

/// Exact labels and predictions of every part with its cutters, one after the other.
fn test(study: &Study, model: &AnyModel<f32>, parts: &[Part], n_sites: usize) -> Result<Tested> {
    let [first, both] = [labeler(false), labeler(true)];
    let draw = Draw { sets: &[CutterSet::Uniform], n_cutters: N_TEST_CUTTERS };
    let mut tested = Tested { evaluation: Evaluation::default(), seconds: [0.0; 3] };
    let share = 1.0 / (parts.len() * draw.n_cutters).max(1) as f64;
    let bar = study.bar(parts.len(), "parts tested");
    for (index, part) in parts.iter().enumerate() {
        let sites = Arc::new(part.sites(n_sites)?);
        for k in 0..draw.n_cutters {
            study.go_on()?;
            let params = draw.cutter(index, k);
            let cutter = Cutter::ball_end(params)?;
            let (_, first) = timed(|| first.answer(&sites, &cutter))?;
            let (answers, both) = timed(|| both.answer(&sites, &cutter))?;
            let predict = || model.predict(&sites.points, &sites.normals, params.to_array());
            let (predicted, network) = timed(predict)?;
            for (sum, seconds) in tested.seconds.iter_mut().zip([first, both - first, network]) {
                *sum += share * seconds;
            }
            let (name, sites) = (part.name.clone(), Arc::clone(&sites));
            let sample = Sample::new(name, sites, params, answers);
            tested.evaluation.add(&sample, &predicted.answers())?;
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(tested)
}

/// The published definition, with or without the labels of the second head.
fn labeler(occlusion: bool) -> Labeler {
    let options = LabelOptions::published().with_occlusion(occlusion);
    Labeler::of_sites(Directions::published(), options)
}

fn timed<T>(work: impl FnOnce() -> Result<T>) -> Result<(T, f64)> {
    let start = Instant::now();
    work().map(|result| (result, start.elapsed().as_secs_f64()))
}

fn row(table: &mut Table, set: Set, n_sites: usize, source: &str, tested: &Tested) {
    let mean = tested.evaluation.mean();
    let mut row = vec![Cell::text(set.name()), Cell::count(n_sites), Cell::text(source)];
    row.extend(scores::cells(mean));
    row.extend(tested.seconds.map(Cell::Seconds));
    row.push(Cell::Share(average(mean)));
    table.row(row);
}

fn published_row(table: &mut Table, set: Set, &[acc_i, f1_i, acc_o, f1_o]: &[f64; 4]) {
    let published =
        [(acc_i, f1_i), (acc_o, f1_o)].map(|(accuracy, f1)| HeadScore::new(accuracy, f1));
    let mut row = vec![Cell::text(set.name()), Cell::Missing, Cell::text("published")];
    row.extend(scores::cells(published));
    row.extend([Cell::Missing, Cell::Missing, Cell::Missing]);
    row.push(Cell::Share(average(published)));
    table.row(row);
}

fn average(heads: [HeadScore; 2]) -> f64 {
    heads.iter().map(|head| 0.25 * (head.accuracy + head.f1)).sum()
}
