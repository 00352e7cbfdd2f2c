//! How far labels are from those by the mesh definition, over the number of directions, and networks that learned them.

use super::page::Page;
use super::pictures::Sheet;
use super::samples::{Draw, samples_of_part_itself};
use super::study::{N_DIRECTIONS, Study};
use super::trainings::{
    Data, N_TEST_CUTTERS, Trainings, training_samples, training_samples_of_part_itself,
};
use deepmill::Result;
use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
use deepmill::access::{LabelOptions, Labeler, Obstacles, label};
use deepmill::answers::Definition;
use deepmill::cutter::{Cutter, CutterSet};
use deepmill::directions::Directions;
use deepmill::geom::Sites;
use deepmill::model::AnyModel;
use deepmill::report::Coloring;
use deepmill::tables::{Cell, Table};
use serde_json::Value;
use std::time::Instant;

const N_PARTS: usize = 6;
const SETS: [usize; 3] = [N_DIRECTIONS, 600, 2400];
/// A network is called faster than the exact answer from this factor on.
const MUCH_FASTER: f64 = 10.0;
/// CR, CH, FR, FH in mm: a wide holder, and a slender tool.
const CUTTERS: [[f64; 4]; 2] = [[1.5, 6.0, 40.0, 5.0], [1.5, 20.0, 5.0, 20.0]];

/// A way to answer.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    /// Sites as obstacles, without the bottom rule: only directions and obstacles differ from the other ways.
    Sites,
    /// Triangles, only the directions of the set.
    Part,
    /// Triangles, and the search between the directions.
    Search,
}

impl Way {
    const ALL: [Way; 3] = [Way::Sites, Way::Part, Way::Search];

    fn words(self) -> &'static str {
        match self {
            Way::Sites => "sites",
            Way::Part => "mesh definition",
            Way::Search => "mesh definition, search between the directions",
        }
    }

    /// Whether each site is inaccessible; the tip is not tested.
    fn inaccessible(
        self,
        (sites, triangles): (&Sites, &TriangleObstacles),
        cutter: &Cutter,
        directions: &Directions,
    ) -> Result<Vec<bool>> {
        let surface = SurfaceOptions::default().with_occlusion(false).with_counts(false);
        let surface = match self {
            Way::Sites => {
                let options = LabelOptions::default().with_occlusion(false);
                let labels = label(sites, Obstacles::Queries, cutter, directions, &options)?;
                return Ok(labels.answers.inaccessible());
            }
            Way::Part => surface.with_refinement(None),
            Way::Search => surface,
        };
        Ok(triangles.label(sites, cutter, directions, &surface)?.answers.inaccessible())
    }
}

/// What one way, or one network, answered on all parts with one cutter.
#[derive(Default, Clone)]
struct Sums {
    n_sites: usize,
    inaccessible: usize,
    missed: usize,
    false_alarms: usize,
    /// Other answers than in the labels that a network learned from.
    unlike_learned: usize,
    seconds: f64,
}

/// A network, and the way of [`ways`] whose labels it learned.
struct Learner {
    words: &'static str,
    model: AnyModel<f32>,
    way: usize,
}

/// Every way with every number of directions; the last is the truth.
fn ways() -> Vec<(Way, usize)> {
    Way::ALL.iter().flat_map(|way| (0..SETS.len()).map(|k| (*way, k))).collect()
}

/// Networks trained on labels against sites, by the earlier rule so that only the obstacles differ, and on labels about
/// the mesh definition with the search.
fn learners(study: &Study, trainings: &Trainings) -> Result<[Learner; 2]> {
    let cutters = [CutterSet::Uniform, CutterSet::Extreme];
    let directions = Directions::fibonacci_hemisphere(N_DIRECTIONS)?;
    let labeler = Labeler::of_sites(directions.clone(), LabelOptions::default());
    let published = training_samples(study, &cutters, &labeler)?;
    let published = trainings.network("published labels", &published, |_| ())?;
    let training = training_samples_of_part_itself(study, &cutters, &directions)?;
    let draw = Draw { sets: &[CutterSet::Uniform], n_cutters: N_TEST_CUTTERS };
    let test = samples_of_part_itself(study, study.test_parts(), &draw, &directions)?;
    let data = Data { definition: Definition::Part, training: &training, test: &test };
    let itself = trainings.network_of("labels by the mesh definition", &data, |_| ())?;
    let place = |wanted: Way| ways().iter().position(|way| *way == (wanted, 0)).unwrap_or(0);
    let (sites, search) = (place(Way::Sites), place(Way::Search));
    Ok([
        Learner { words: "network, learned sites", model: published.model, way: sites },
        Learner { words: "network, learned mesh definition", model: itself.model, way: search },
    ])
}

pub fn run(study: &Study) -> Result<Value> {
    let trainings = Trainings::new(study)?;
    let learners = learners(study, &trainings)?;
    let parts = &study.test_parts()[..N_PARTS.min(study.test_parts().len())];
    let sets = SETS.map(Directions::fibonacci_hemisphere);
    let sets = sets.into_iter().collect::<Result<Vec<_>>>()?;
    let ways = ways();
    let mut table = Table::new(&[
        ("cutter", "cutter"),
        ("obstacles", "obstacles"),
        ("directions", "directions"),
        ("inaccessible", "inaccessible"),
        ("missed", "missed"),
        ("false_alarms", "false alarms"),
        ("wrong", "wrong labels"),
        ("unlike_learned", "unlike what it learned"),
        ("seconds", "time per part"),
    ]);
    let (mut sheet, mut factors) = (Sheet::default(), Vec::new());
    let bar = study.bar(CUTTERS.len() * parts.len(), "parts labeled");
    for lengths in CUTTERS {
        let cutter = Cutter::ball_end(lengths.into())?;
        let mut sums = vec![Sums::default(); ways.len() + learners.len()];
        let (exact, predicted) = sums.split_at_mut(ways.len());
        for (index, part) in parts.iter().enumerate() {
            let sites = part.sites(study.args.sites)?;
            let triangles = TriangleObstacles::new(&part.mesh, &[])?;
            let mut answers = Vec::new();
            for ((way, set), sums) in ways.iter().zip(&mut *exact) {
                study.go_on()?;
                let start = Instant::now();
                answers.push(way.inaccessible((&sites, &triangles), &cutter, &sets[*set])?);
                sums.seconds += start.elapsed().as_secs_f64();
            }
            let truth = &answers[answers.len() - 1];
            answers.iter().zip(&mut *exact).for_each(|(found, sums)| sums.add(found, truth));
            for (learner, sums) in learners.iter().zip(&mut *predicted) {
                let found = learner.answer(&sites, lengths, sums)?;
                sums.add(&found, truth);
                sums.unlike_learned += n_unlike(&found, &answers[learner.way]);
            }
            if index == 0 {
                for k in [0, 2, 3] {
                    let (way, set) = ways[k];
                    let coloring = Coloring::Difference {
                        positive: "inaccessible",
                        truth,
                        predicted: &answers[k],
                    };
                    let (words, n_directions) = (way.words(), sets[set].len());
                    let tool = words_of(lengths);
                    let caption = format!("{words}, {n_directions} directions, cutter {tool}");
                    sheet.add(&part.mesh, &sites, &coloring, caption);
                }
            }
            bar.inc(1);
        }
        let of_learners = learners.iter().map(|l| (l.words, SETS[0], true));
        let rows = ways.iter().map(|(way, set)| (way.words(), SETS[*set], false));
        for ((words, n_directions, learned), sums) in rows.chain(of_learners).zip(&sums) {
            let share = |n: usize| Cell::Share(n as f64 / sums.n_sites.max(1) as f64);
            table.row([
                Cell::text(words_of(lengths)),
                Cell::text(words),
                Cell::count(n_directions),
                share(sums.inaccessible),
                share(sums.missed),
                share(sums.false_alarms),
                share(sums.missed + sums.false_alarms),
                if learned { share(sums.unlike_learned) } else { Cell::Missing },
                Cell::Seconds(sums.seconds / parts.len() as f64),
            ]);
        }
        for (k, learner) in learners.iter().enumerate() {
            let factor = sums[learner.way].seconds / sums[ways.len() + k].seconds.max(1e-9);
            factors.push((factor, format!("`{}`, cutter {}", learner.words, words_of(lengths))));
        }
    }
    bar.finish_and_clear();
    sheet.image().write_png(&study.file("directions.png"))?;
    let page = Page {
        name: "directions",
        title: "Number of directions, the mesh definition, and networks",
        text: vec![
            format!(
                "{} parts, {} sites on each; cutters as CR, CH, FR, FH in mm. The truth is the last exact row of each cutter: the \
                 triangles of the part, 2,400 directions over the upper half and the search between them. *Missed*: share of all \
                 sites that are inaccessible in truth and labeled accessible; *false alarms*: the reverse. Labels of the first head \
                 alone, without β; the search tree of the triangles is built beforehand. Whether the tip fits is not tested.",
                parts.len(),
                study.args.sites
            ),
            format!(
                "The networks are trained on labels of 150 directions, against sites without the bottom rule and by the mesh definition with the search \
                 between them; every other training cutter was from the set Extreme. {}",
                words_of_factors(&factors)
            ),
            trainings.words(),
        ],
        table,
        pictures: vec![(
            "directions.png".into(),
            "The first part, both cutters: labels against the truth".into(),
        )],
    };
    page.write(study)
}

/// Which network answers much faster than the exact labels that it learned are made.
fn words_of_factors(factors: &[(f64, String)]) -> String {
    let of = |(factor, row): &(f64, String)| format!("{row}: {factor:.1} times as fast");
    let much: Vec<String> =
        factors.iter().filter(|(factor, _)| *factor >= MUCH_FASTER).map(of).collect();
    match much.is_empty() {
        false => format!(
            "Rows in which a network is at least {MUCH_FASTER} times as fast as the exact labels that it learned: {}.",
            much.join("; ")
        ),
        true => {
            let greatest = factors.iter().max_by(|a, b| a.0.total_cmp(&b.0));
            format!(
                "There is no row in which a network is {MUCH_FASTER} times as fast as the exact labels that it learned; the nearest is {}.",
                greatest.map(of).unwrap_or_default()
            )
        }
    }
}

/// CR, CH, FR, FH in mm.
fn words_of(lengths: [f64; 4]) -> String {
    lengths.map(|x| x.to_string()).join(", ")
}

fn n_unlike(found: &[bool], expected: &[bool]) -> usize {
    found.iter().zip(expected).filter(|(a, b)| a != b).count()
}

impl Learner {
    /// Whether each site is inaccessible. The first prediction of all is made twice, and only the second is timed.
    fn answer(&self, sites: &Sites, lengths: [f64; 4], sums: &mut Sums) -> Result<Vec<bool>> {
        let predict = || self.model.predict(&sites.points, &sites.normals, lengths);
        if sums.n_sites == 0 {
            predict()?;
        }
        let start = Instant::now();
        let answers = predict()?.answers();
        sums.seconds += start.elapsed().as_secs_f64();
        Ok(answers.inaccessible())
    }
}

impl Sums {
    fn add(&mut self, found: &[bool], truth: &[bool]) {
        let count = |found_as: bool, is: bool| {
            found.iter().zip(truth).filter(|pair| *pair == (&found_as, &is)).count()
        };
        self.n_sites += truth.len();
        self.inaccessible += found.iter().filter(|f| **f).count();
        self.missed += count(false, true);
        self.false_alarms += count(true, false);
    }
}
