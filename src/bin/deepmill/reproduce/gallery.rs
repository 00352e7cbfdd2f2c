//! Pictures of the best, the median and the worst predictions of each set, and of several cutters on one part.

use super::page::Page;
use super::parts::Part;
use super::pictures::Sheet;
use super::samples::{Draw, labeled};
use super::scores;
use super::sets::Set;
use super::study::Study;
use super::table1;
use super::trainings::{N_TEST_CUTTERS, Trainings};
use deepmill::Result;
use deepmill::access::Labeler;
use deepmill::answers::SiteAnswers;
use deepmill::cutter::CutterSet;
use deepmill::data::Sample;
use deepmill::metrics::Confusion;
use deepmill::model::AnyModel;
use deepmill::report::{Coloring, DARK_AND_LIGHT};
use deepmill::tables::{Cell, Table};
use deepmill::train::HeadScore;
use serde_json::Value;

/// The heads, in words.
const HEADS: [&str; 2] = ["inaccessible", "occlusion"];
const RANKS: [&str; 3] = ["best", "median", "worst"];

/// A sample, what the network says about it, and the scores of both heads.
struct Answered {
    sample: Sample,
    predicted: SiteAnswers,
    scores: [HeadScore; 2],
}

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let model = table1::network(study, &trainings, study.args.sites)?.model;
    let mut columns = vec![
        ("head", "head"),
        ("set", "parts"),
        ("rank", "rank"),
        ("part", "part"),
        ("cutter", "cutter"),
    ];
    columns.extend(scores::COLUMNS);
    let mut table = Table::new(&columns);
    let mut sheets = [Sheet::default(), Sheet::default()];
    for set in Set::ALL {
        let parts = set.parts(study);
        let mut answered = answers(study, &model, &parts, sites_of(study, set))?;
        for (head, sheet) in sheets.iter_mut().enumerate() {
            answered.sort_by(|a, b| b.scores[head].accuracy.total_cmp(&a.scores[head].accuracy));
            let places = [0, answered.len() / 2, answered.len() - 1];
            for (rank, place) in RANKS.into_iter().zip(places) {
                let one = &answered[place];
                let part = parts.iter().find(|part| part.name == one.sample.name);
                let accuracy = 100.0 * one.scores[head].accuracy;
                let caption =
                    format!("{}, {rank}: {}, {accuracy:.1} %", set.name(), one.sample.name);
                if let Some(part) = part {
                    difference(sheet, part, one, head, caption);
                }
                let words = [HEADS[head], set.name(), rank, &one.sample.name];
                let mut row = words.map(Cell::text).to_vec();
                row.push(Cell::text(cutter_words(&one.sample)));
                row.extend(scores::cells(one.scores));
                table.row(row);
            }
        }
    }
    let files = HEADS.map(|head| format!("gallery-{head}.png"));
    for (sheet, file) in sheets.iter().zip(&files) {
        sheet.image().write_png(&study.file(file))?;
    }
    cutters(study, &model)?.image().write_png(&study.file("gallery-cutters.png"))?;
    let [inaccessible, occlusion] = files;
    let words = "Best, median and worst prediction of each set by accuracy, head";
    let page = Page {
        name: "gallery",
        title: "Best, median and worst predictions",
        text: vec![format!(
            "The network of Table 1 (preset `{}`, {} samples of CAD parts with {} sites). Dark is over-predicted (a false \
             alarm), light is under-predicted (missed), the shade between is agreed; whether the paper means its dark and light \
             colors the same way round is not known here. Cutters as CR, CH, FR, FH in mm.",
            study.args.preset,
            trainings.n_samples(),
            study.args.sites
        )],
        table,
        pictures: vec![
            (inaccessible, format!("{words} {}", HEADS[0])),
            (occlusion, format!("{words} {}", HEADS[1])),
            (
                "gallery-cutters.png".into(),
                "One test part, a cutter of each set: exact labels, the network's, and where the first head differs".into(),
            ),
        ],
    };
    page.write(study)
}

/// As many as Table 1 has.
fn sites_of(study: &Study, set: Set) -> usize {
    let [few, _, many] = table1::sizes(study);
    if set == Set::Complex { many } else { few }
}

fn answers(
    study: &Study,
    model: &AnyModel<f32>,
    parts: &[Part],
    n_sites: usize,
) -> Result<Vec<Answered>> {
    let labeler = Labeler::published();
    let draw = Draw { sets: &[CutterSet::Uniform], n_cutters: N_TEST_CUTTERS };
    let samples = labeled(study, parts, &draw, &labeler, n_sites)?;
    samples.into_iter().map(|sample| answer(model, sample)).collect()
}

fn answer(model: &AnyModel<f32>, sample: Sample) -> Result<Answered> {
    let sites = &sample.sites;
    let predicted =
        model.predict(&sites.points, &sites.normals, sample.cutter.to_array())?.answers();
    let truth = &sample.answers;
    let heads = [
        Confusion::of_labels(&predicted.inaccessible(), &truth.inaccessible()),
        Confusion::of_labels(predicted.occlusion(), truth.occlusion()),
    ];
    let scores = heads.map(|c| HeadScore::new(c.accuracy(), c.f1()));
    Ok(Answered { sample, predicted, scores })
}

/// Adds where a head differs, in dark and light colors.
fn difference(sheet: &mut Sheet, part: &Part, answered: &Answered, head: usize, caption: String) {
    let of = |answers: &SiteAnswers| match head {
        0 => answers.inaccessible(),
        _ => answers.occlusion().to_vec(),
    };
    let (truth, predicted) = (of(&answered.sample.answers), of(&answered.predicted));
    let difference =
        Coloring::Difference { positive: HEADS[head], truth: &truth, predicted: &predicted };
    let of: Vec<usize> = (0..truth.len()).map(|i| difference.class(i)).collect();
    let coloring = Coloring::Groups { classes: &DARK_AND_LIGHT[head], of: &of, areas: &[] };
    sheet.add(&part.mesh, &answered.sample.sites, &coloring, caption);
}

/// The first test part with one cutter of each set: a row for each cutter.
fn cutters(study: &Study, model: &AnyModel<f32>) -> Result<Sheet> {
    let part = &study.test_parts()[..1];
    let mut sheet = Sheet::default();
    for set in CutterSet::PUBLISHED {
        let draw = Draw { sets: &[set], n_cutters: 1 };
        for sample in labeled(study, part, &draw, &Labeler::published(), study.args.sites)? {
            let answered = answer(model, sample)?;
            let words = format!("{set}: {}", cutter_words(&answered.sample));
            for (answers, by) in
                [(&answered.sample.answers, "exact"), (&answered.predicted, "network")]
            {
                let coloring = Coloring::Labels {
                    inaccessible: &answers.inaccessible(),
                    occlusion: answers.occlusion(),
                };
                let sites = &answered.sample.sites;
                sheet.add(&part[0].mesh, sites, &coloring, format!("{words}, {by}"));
            }
            let accuracy = 100.0 * answered.scores[0].accuracy;
            let caption = format!("{words}, Acc_i {accuracy:.1} %");
            difference(&mut sheet, &part[0], &answered, 0, caption);
        }
    }
    Ok(sheet)
}

/// CR, CH, FR, FH in mm.
fn cutter_words(sample: &Sample) -> String {
    sample.cutter.to_array().map(|x| format!("{x:.1}")).join(", ")
}
