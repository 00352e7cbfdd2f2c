//! Depth of the octree against number of sites, and the share of occlusion points.

use super::page::Page;
use super::samples::{Draw, labeled};
use super::scores;
use super::study::Study;
use super::trainings::{Data, N_CUTTERS, N_TEST_CUTTERS, Trained, Trainings};
use deepmill::Result;
use deepmill::access::{LabelOptions, Labeler};
use deepmill::cutter::CutterSet;
use deepmill::data::Sample;
use deepmill::directions::Directions;
use deepmill::report::curves::{Chart, Series, write_curves};
use deepmill::tables::{Cell, Table};
use deepmill::train::Settings;
use serde_json::Value;

const DEPTHS: [usize; 3] = [4, 5, 6];
const SHARES: [f64; 3] = [0.05, 0.1, 0.2];

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let mut columns = vec![
        ("depth", "octree depth"),
        ("sites", "sites"),
        ("share", "occlusion share"),
        ("seconds", "training"),
    ];
    columns.extend(scores::COLUMNS);
    let mut table = Table::new(&columns);
    let mut curves = DEPTHS.map(|depth| [0; 2].map(|_| series(depth)));
    let usual = LabelOptions::default().share;
    let usual_depth = trainings.settings().network.octree().map_or(0, |net| net.input.depth);
    for n_sites in sizes(study) {
        let [data, test] = samples(study, n_sites, usual)?;
        for (depth, curves) in DEPTHS.into_iter().zip(&mut curves) {
            let name = format!("depth {depth}, {n_sites} sites");
            let trained =
                trainings.network_of(&name, &Data::of_sites(&data, &test), |settings| {
                    if let Some(octree) = settings.network.octree_mut() {
                        octree.input.depth = depth;
                    }
                    score_once(settings);
                })?;
            row(&mut table, depth, n_sites, usual, &trained);
            let [i, o] = scores::last(&trained).1;
            curves[0].points.push((n_sites as f64, 100.0 * i.accuracy));
            curves[1].points.push((n_sites as f64, 100.0 * o.f1));
        }
    }
    let n_sites = study.args.sites;
    for share in SHARES {
        let [data, test] = samples(study, n_sites, share)?;
        let name = format!("occlusion share {share}");
        let trained = trainings.network_of(&name, &Data::of_sites(&data, &test), score_once)?;
        row(&mut table, usual_depth, n_sites, share, &trained);
    }
    let titles = ["Acc_i on the test parts, %", "F1_o on the test parts, %"];
    let charts = [0, 1].map(|k| {
        let series = curves.iter().map(|curves| curves[k].clone()).collect();
        Chart { title: titles[k].into(), series }
    });
    write_curves(&study.file("depth.svg"), "sites", &charts)?;
    let page = Page {
        name: "depth",
        title: "Octree depth, number of sites, occlusion share",
        text: vec![format!(
            "Networks (preset `{}`) that differ only in the depth of the octree, with as many stages. Each saw {} samples of {} parts \
             with {N_CUTTERS} cutters each and was scored, once, on {} other parts with {N_TEST_CUTTERS} cutters, with as many sites \
             and the same share of occlusion points. *Training*: the time of its steps. The last rows are of the preset's depth.",
            study.args.preset,
            trainings.n_samples(),
            study.training_parts().len(),
            study.test_parts().len(),
        )],
        table,
        pictures: vec![("depth.svg".into(), "Scores over the number of sites".into())],
    };
    page.write(study)
}

/// 3,500, 7,000 and 15,000, or in proportion to `--sites`.
fn sizes(study: &Study) -> [usize; 3] {
    [7, 14, 30].map(|of| (study.args.sites * of / 14).max(2))
}

/// Training and test samples.
fn samples(study: &Study, n_sites: usize, share: f64) -> Result<[Vec<Sample>; 2]> {
    let options = LabelOptions::published().with_share(share);
    let labeler = Labeler::of_sites(Directions::published(), options);
    let draw = |n_cutters| Draw { sets: &[CutterSet::Uniform], n_cutters };
    let training = labeled(study, study.training_parts(), &draw(N_CUTTERS), &labeler, n_sites)?;
    let test = labeled(study, study.test_parts(), &draw(N_TEST_CUTTERS), &labeler, n_sites)?;
    Ok([training, test])
}

/// At the end: predictions at depth 6 cost more than steps.
fn score_once(settings: &mut Settings) {
    settings.evaluate_every = settings.n_epochs;
}

fn row(table: &mut Table, depth: usize, n_sites: usize, share: f64, trained: &Trained) {
    let mut row = vec![Cell::count(depth), Cell::count(n_sites), Cell::Share(share)];
    row.push(Cell::Seconds(trained.seconds()));
    row.extend(scores::cells(scores::last(trained).1));
    table.row(row);
}

fn series(depth: usize) -> Series {
    Series { name: format!("depth {depth}"), points: vec![] }
}
