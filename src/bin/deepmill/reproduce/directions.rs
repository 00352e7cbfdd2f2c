//! How far labels are from the part itself, over the number of directions.

use super::page::Page;
use super::pictures::Sheet;
use super::study::Study;
use deepmill::Result;
use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
use deepmill::access::{LabelOptions, Obstacles, label};
use deepmill::cutter::Cutter;
use deepmill::directions::Directions;
use deepmill::geom::Sites;
use deepmill::report::Coloring;
use deepmill::report::tables::{Cell, Table};
use serde_json::Value;
use std::time::Instant;

const N_PARTS: usize = 6;
const N_DIRECTIONS: [usize; 3] = [150, 600, 2400];
/// CR, CH, FR, FH in mm: a wide holder, and a slender tool.
const CUTTERS: [[f64; 4]; 2] = [[1.5, 6.0, 40.0, 5.0], [1.5, 20.0, 5.0, 20.0]];

/// A way to answer.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    /// The published definition.
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
            Way::Part => "part itself",
            Way::Search => "part itself, search between the directions",
        }
    }

    /// Whether each site is inaccessible; the tip is not tested.
    fn inaccessible(
        self,
        (sites, triangles): (&Sites, &TriangleObstacles),
        cutter: &Cutter,
        directions: &Directions,
    ) -> Result<Vec<bool>> {
        let surface =
            SurfaceOptions { occlusion: false, counts: false, ..SurfaceOptions::default() };
        let surface = match self {
            Way::Sites => {
                let options = LabelOptions { occlusion: false, ..LabelOptions::default() };
                let labels = label(sites, Obstacles::Queries, cutter, directions, &options)?;
                return Ok(labels.answers.inaccessible);
            }
            Way::Part => SurfaceOptions { refinement: None, ..surface },
            Way::Search => surface,
        };
        Ok(triangles.label(sites, cutter, directions, &surface)?.inaccessible())
    }
}

/// What one way answered on all parts with one cutter.
#[derive(Default, Clone)]
struct Sums {
    n_sites: usize,
    inaccessible: usize,
    missed: usize,
    false_alarms: usize,
    seconds: f64,
}

pub fn run(study: &Study) -> Result<Value> {
    let parts = &study.test_parts()[..N_PARTS.min(study.test_parts().len())];
    let sets = N_DIRECTIONS.map(Directions::fibonacci_hemisphere);
    let sets = sets.into_iter().collect::<Result<Vec<_>>>()?;
    let ways: Vec<(Way, usize)> =
        Way::ALL.iter().flat_map(|way| (0..sets.len()).map(|k| (*way, k))).collect();
    let mut table = Table::new(&[
        ("cutter", "cutter"),
        ("obstacles", "obstacles"),
        ("directions", "directions"),
        ("inaccessible", "inaccessible"),
        ("missed", "missed"),
        ("false_alarms", "false alarms"),
        ("wrong", "wrong labels"),
        ("seconds", "time per part"),
    ]);
    let mut sheet = Sheet::default();
    let bar = study.bar(CUTTERS.len() * parts.len(), "parts labeled");
    for lengths in CUTTERS {
        let cutter = Cutter::ball_end(lengths.into())?;
        let mut sums = vec![Sums::default(); ways.len()];
        for (index, part) in parts.iter().enumerate() {
            let sites = part.sites(study.args.sites)?;
            let triangles = TriangleObstacles::new(&part.mesh, &[])?;
            let mut answers = Vec::new();
            for ((way, set), sums) in ways.iter().zip(&mut sums) {
                study.go_on()?;
                let start = Instant::now();
                answers.push(way.inaccessible((&sites, &triangles), &cutter, &sets[*set])?);
                sums.seconds += start.elapsed().as_secs_f64();
            }
            // The last way has most directions and the search.
            let truth = &answers[answers.len() - 1];
            answers.iter().zip(&mut sums).for_each(|(found, sums)| sums.add(found, truth));
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
        for ((way, set), sums) in ways.iter().zip(&sums) {
            let share = |n: usize| Cell::Share(n as f64 / sums.n_sites.max(1) as f64);
            table.row([
                Cell::text(words_of(lengths)),
                Cell::text(way.words()),
                Cell::count(sets[*set].len()),
                share(sums.inaccessible),
                share(sums.missed),
                share(sums.false_alarms),
                share(sums.missed + sums.false_alarms),
                Cell::Seconds(sums.seconds / parts.len() as f64),
            ]);
        }
    }
    bar.finish_and_clear();
    sheet.image().write_png(&study.file("directions.png"))?;
    let page = Page {
        name: "directions",
        title: "Number of directions and the part itself",
        text: vec![format!(
            "{} parts, {} sites on each; cutters as CR, CH, FR, FH in mm. The truth is the last row of each cutter: the triangles \
             of the part, 2,400 directions over the upper half and the search between them. *Missed*: share of all sites that are \
             inaccessible in truth and labeled accessible; *false alarms*: the reverse. Labels of the first head alone, without \
             β; the search tree of the triangles is built beforehand. Whether the tip fits is not tested.",
            parts.len(),
            study.args.sites
        )],
        table,
        pictures: vec![(
            "directions.png".into(),
            "The first part, both cutters: labels against the truth".into(),
        )],
    };
    page.write(study)
}

/// CR, CH, FR, FH in mm.
fn words_of(lengths: [f64; 4]) -> String {
    lengths.map(|x| x.to_string()).join(", ")
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
