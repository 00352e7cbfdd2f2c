//! Labels against triangles: time, effect of more directions, and equality with the drop heights.
//!
//! ```text
//! cargo bench --bench part_itself -- cost      N_SITES N_DIRECTIONS PART.stl…   labels, counts, β, search: 6 cutters
//! cargo bench --bench part_itself -- tips      N_SITES N_DIRECTIONS PART.stl…   labels and search with other ends: 6 cutters
//! cargo bench --bench part_itself -- triangles N_SITES N_DIRECTIONS PART.stl…   labels by number of triangles, 1 k to 1 M; wide tools
//! cargo bench --bench part_itself -- plain     N_SITES N_DIRECTIONS PART.stl…   ratio to the plain loops of the law
//! cargo bench --bench part_itself -- curve     N_SITES PART.stl…                share found by uniform sets and by searches
//! cargo bench --bench part_itself -- equal     N_SITES N_DIRECTIONS PART.stl…   equality with the law
//! ```
//!
//! What the guide states of costs, each for the same parts:
//!
//! ```text
//! cost 7000 150 PARTS…       7,000 sites, 150 directions; ends with the median and the worst of all parts and cutters
//! cost 100000 150 PARTS…     100,000 sites
//! cost 7000 2400 PARTS…      2,400 directions
//! triangles 7000 150 PART    one part, subdivided until it has a million triangles
//! plain 200 150 PARTS…       few sites, since the plain loops take so long
//! ```
//!
//! Parts with an edge of the bounding box below 80 mm are scaled up to 80 mm. Times are processor time of all threads
//! (Linux; elsewhere 0) and, after a slash, the time that passed: means of the runs in 0.3 s.
#![allow(clippy::print_stdout)]

use deepmill::access::Labels;
use deepmill::access::surface::{
    ContactTolerance, Reached, RefinementOptions, SurfaceOptions, TriangleObstacles,
};
use deepmill::answers::SiteAnswer;
use deepmill::cutter::{Assembly, Cutter, CutterParams, Section, TipShape};
use deepmill::directions::Directions;
use deepmill::geom::formats::{ReadOptions, read_mesh};
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Mesh, Sites};
use std::collections::HashMap;
use std::path::Path;
use std::time::Instant;

/// CR, CH, FR, FH, mm.
const CUTTERS: [[f64; 4]; 6] = [
    [1.0, 20.0, 5.0, 20.0],
    [1.5, 6.0, 40.0, 5.0],
    [2.0, 2.0, 90.0, 20.0],
    [1.5, 5.0, 20.0, 20.0],
    [2.0, 0.2, 5.0, 20.0],
    [1.5, 10.0, 10.0, 10.0],
];
/// A wide tool, with a ball, a bull nose or flat.
const WIDE: [f64; 4] = [6.0, 20.0, 25.0, 20.0];
const UNIFORM: [usize; 7] = [75, 150, 300, 600, 1200, 2400, 9600];
/// Cells kept per level, and levels.
const SEARCHED: [[usize; 2]; 6] = [[32, 4], [16, 5], [24, 5], [32, 5], [64, 5], [48, 6]];
/// Triangles up to which a part is subdivided.
const MOST_TRIANGLES: usize = 1_000_000;
const RESOLUTION_MM: f64 = 1e-3;
/// Poses that are free by less may be missed, mm.
const MISSED_MM: f64 = 3e-3;
const EPSILON_MM: f64 = 1e-6;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let number = |k: usize| args[k].parse::<usize>().expect("a number");
    match args.first().map(String::as_str) {
        Some("cost") => costs(&args[3..], number(1), number(2)),
        Some("tips") => tips(&args[3..], number(1), number(2)),
        Some("triangles") => {
            args[3..].iter().for_each(|part| by_triangles(part, number(1), number(2)));
        }
        Some("plain") => args[3..].iter().for_each(|part| plain(part, number(1), number(2))),
        Some("curve") => curves(&args[2..], number(1)),
        Some("equal") => args[3..].iter().for_each(|part| equal(part, number(1), number(2))),
        _ => println!(
            "cost, tips, triangles, plain, curve or equal; see the first lines of benches/part_itself.rs"
        ),
    }
}

fn read(path: &str, n_sites: usize) -> (Mesh, Sites) {
    let options = ReadOptions::default();
    let mut mesh = read_mesh(Path::new(path), &options).expect("a mesh");
    let (low, high) = mesh.bounds().expect("a mesh with vertices");
    let factor = (80.0 / (high - low).min_element()).max(1.0);
    mesh.vertices.iter_mut().for_each(|v| *v *= factor);
    let sites = sample(&mesh, &SiteOptions::default().with_n_sites(n_sites)).expect("sites");
    (mesh, sites)
}

fn ball(lengths: [f64; 4]) -> Cutter {
    Cutter::ball_end(CutterParams::from_array(lengths)).expect("a cutter")
}

/// Processor time of this process so far, seconds.
fn processor_time() -> f64 {
    let Ok(stat) = std::fs::read_to_string("/proc/self/stat") else { return 0.0 };
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |k: usize| fields.get(k).and_then(|f| f.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / 100.0
}

/// Mean times of a run, seconds.
#[derive(Debug, Clone, Copy)]
struct Times {
    processor: f64,
    passed: f64,
}

impl std::fmt::Display for Times {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.4}/{:.4} s", self.processor, self.passed)
    }
}

/// The result, and the times of a run; the first run does not count if there are others.
fn timed<R>(work: impl Fn() -> R) -> (R, Times) {
    let (mut start, mut before, mut n) = (Instant::now(), processor_time(), 0.0);
    let first = work();
    if start.elapsed().as_secs_f64() < 0.3 {
        (start, before) = (Instant::now(), processor_time());
    } else {
        n = 1.0;
    }
    let mut result = first;
    while start.elapsed().as_secs_f64() < 0.3 || n == 0.0 {
        result = work();
        n += 1.0;
    }
    let passed = start.elapsed().as_secs_f64() / n;
    (result, Times { processor: (processor_time() - before) / n, passed })
}

/// What `cost` measures, in this order.
const COSTS: [&str; 4] = ["labels, no search", "labels and search", "with counts", "counts and β"];

fn costs(paths: &[String], n_sites: usize, n_directions: usize) {
    let mut all: [Vec<Times>; 4] = Default::default();
    paths.iter().for_each(|path| cost(path, n_sites, n_directions, &mut all));
    for (name, mut times) in COSTS.iter().zip(all) {
        times.sort_by(|a, b| a.passed.total_cmp(&b.passed));
        let (Some(worst), median) = (times.last(), times.len() / 2) else { continue };
        println!("{name}: median {}, worst {worst}", times[median]);
    }
}

/// Labels with the lengths of every cutter and a ball, a bull nose or a flat end.
fn tips(paths: &[String], n_sites: usize, n_directions: usize) {
    let directions = Directions::fibonacci_hemisphere(n_directions).expect("directions");
    let mut all: [[Vec<Times>; 2]; 3] = Default::default();
    for path in paths {
        let (mesh, sites) = read(path, n_sites);
        let obstacles = TriangleObstacles::new(&mesh, &[]).expect("triangles");
        for lengths in CUTTERS {
            let params = CutterParams::from_array(lengths);
            let cutters = [
                Ok(ball(lengths)),
                Cutter::bull_nose(params, 0.25 * params.cr_mm),
                Cutter::flat_end(params),
            ];
            for (cutter, all) in cutters.into_iter().zip(&mut all) {
                let cutter = cutter.expect("a cutter");
                let quick = SurfaceOptions::default()
                    .with_occlusion(false)
                    .with_counts(false)
                    .with_refinement(None);
                let search = quick.with_refinement(Some(RefinementOptions::default()));
                for (options, all) in [quick, search].iter().zip(all) {
                    let label = || obstacles.label(&sites, &cutter, &directions, options);
                    all.push(timed(|| label().expect("labels")).1);
                }
            }
        }
    }
    for (end, all) in ["ball", "bull nose, a quarter of CR", "flat"].iter().zip(&mut all) {
        for (name, times) in COSTS.iter().zip(all) {
            times.sort_by(|a, b| a.passed.total_cmp(&b.passed));
            let (Some(worst), median) = (times.last(), times.len() / 2) else { continue };
            println!("{end}, {name}: median {}, worst {worst}", times[median]);
        }
    }
}

fn cost(path: &str, n_sites: usize, n_directions: usize, all: &mut [Vec<Times>; 4]) {
    let (mesh, sites) = read(path, n_sites);
    let (obstacles, index) = timed(|| TriangleObstacles::new(&mesh, &[]).expect("triangles"));
    println!("{path}: {} triangles, tree {index}", mesh.triangles.len());
    let directions = Directions::fibonacci_hemisphere(n_directions).expect("directions");
    for lengths in CUTTERS {
        let cutter = ball(lengths);
        let base = SurfaceOptions::default().with_occlusion(false).with_refinement(None);
        let quick = base.with_counts(false);
        let search = quick.with_refinement(Some(RefinementOptions::default()));
        let label = |options: &SurfaceOptions| {
            timed(|| obstacles.label(&sites, &cutter, &directions, options).expect("labels"))
        };
        let [labels, searched, counts] = [&quick, &search, &base].map(label);
        let with_beta = base.with_occlusion(true);
        let (_, beta) = timed(|| obstacles.label(&sites, &cutter, &directions, &with_beta));
        let times = [labels.1, searched.1, counts.1, beta];
        all.iter_mut().zip(times).for_each(|(all, times)| all.push(times));
        println!(
            "  {lengths:?}: labels {} ({}), searched {} ({}), counts {} ({}), with β {}; inaccessible {:.3} → {:.3}",
            times[0],
            work(&labels.0),
            times[1],
            work(&searched.0),
            times[2],
            work(&counts.0),
            times[3],
            labels.0.answers.share(SiteAnswer::Inaccessible),
            searched.0.answers.share(SiteAnswer::Inaccessible),
        );
    }
}

/// Every triangle in four.
fn subdivided(mesh: &Mesh) -> Mesh {
    let mut vertices = mesh.vertices.clone();
    let mut middles = HashMap::new();
    let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
    for &[a, b, c] in &mesh.triangles {
        let mut middle = |p: u32, q: u32| {
            *middles.entry([p.min(q), p.max(q)]).or_insert_with(|| {
                vertices.push(0.5 * (mesh.vertices[p as usize] + mesh.vertices[q as usize]));
                vertices.len() as u32 - 1
            })
        };
        let [d, e, f] = [middle(a, b), middle(b, c), middle(c, a)];
        triangles.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
    }
    Mesh { vertices, triangles }
}

fn by_triangles(path: &str, n_sites: usize, n_directions: usize) {
    let (mut mesh, sites) = read(path, n_sites);
    let directions = Directions::fibonacci_hemisphere(n_directions).expect("directions");
    println!("{path}");
    while mesh.triangles.len() <= MOST_TRIANGLES {
        let (obstacles, index) = timed(|| TriangleObstacles::new(&mesh, &[]).expect("triangles"));
        print!("  {} triangles: tree {index}", mesh.triangles.len());
        for lengths in [CUTTERS[0], CUTTERS[1], CUTTERS[5]] {
            let base = SurfaceOptions::default().with_occlusion(false).with_refinement(None);
            let options = base.with_counts(false);
            let label = || obstacles.label(&sites, &ball(lengths), &directions, &options);
            let (_, times) = timed(|| label().expect("labels"));
            print!(", {lengths:?} {times}");
        }
        println!();
        for corner_mm in [6.0, 1.0, 0.0] {
            let (labels, advice) = wide(&obstacles, (&sites, &directions), corner_mm);
            println!("    {WIDE:?} corner {corner_mm}: as by default {labels}, advice {advice}");
        }
        mesh = subdivided(&mesh);
    }
}

/// Labels as a user gets them, and the change of the tool for all that it does not reach, with a wide tool.
fn wide(
    obstacles: &TriangleObstacles,
    (sites, directions): (&Sites, &Directions),
    corner_mm: f64,
) -> (Times, Times) {
    let [radius_mm, height, holder, length] = WIDE;
    let tip = TipShape::Straight { radius_mm, corner_mm };
    let body = [Section::cylinder(200.0, radius_mm)];
    let stick_out = corner_mm + height;
    let holder = [Section::cylinder(length, holder)];
    let tool = Assembly::new(tip, &body, &holder, stick_out).expect("a tool");
    let cutter = tool.cutter().expect("a cutter");
    let options = SurfaceOptions::default().with_occlusion(false);
    let (labels, times) =
        timed(|| obstacles.label(sites, &cutter, directions, &options).expect("labels"));
    let rest = |&i: &u32| labels.answers.of(i as usize) != SiteAnswer::Accessible;
    let members: Vec<u32> = (0..sites.len() as u32).filter(rest).collect();
    let remedies = Default::default();
    let of = (sites, &members[..]);
    let advise = || obstacles.change_for(of, (&tool, 0.0), directions, &options, &remedies);
    (times, timed(|| advise().expect("advice")).1)
}

fn plain(path: &str, n_sites: usize, n_directions: usize) {
    let (mesh, sites) = read(path, n_sites);
    let obstacles = TriangleObstacles::new(&mesh, &[]).expect("triangles");
    let directions = Directions::fibonacci_hemisphere(n_directions).expect("directions");
    let options = SurfaceOptions::default().with_occlusion(false).with_refinement(None);
    println!("{path}: {} triangles", mesh.triangles.len());
    for lengths in [CUTTERS[0], CUTTERS[1], CUTTERS[5]] {
        let cutter = ball(lengths);
        let (_, fast) = timed(|| obstacles.label(&sites, &cutter, &directions, &options));
        let law = || {
            let resolution = RESOLUTION_MM;
            obstacles.label_by_drop_heights(&sites, &cutter, &directions, &options, resolution)
        };
        let (_, law) = timed(|| law().expect("labels"));
        let ratio = law.processor / fast.processor;
        println!("  {lengths:?}: with counts {fast}, plain loops {law}, {ratio:.0} times");
    }
}

fn work(labels: &Labels) -> String {
    let n = labels.answers.len() as f64;
    let stats = labels.surface.as_ref().expect("by the mesh").stats;
    let tools = stats.tools_tested as f64;
    let triangles = stats.triangles_tested as f64;
    format!("{:.2} tools per site, {:.1} triangles per tool", tools / n, triangles / tools.max(1.0))
}

/// Of a search: its cost over that of 150 directions, and the share of what 9,600 directions find.
type Found = [f64; 2];

fn curves(paths: &[String], n_sites: usize) {
    let mut all: [Vec<Found>; SEARCHED.len()] = Default::default();
    paths.iter().for_each(|path| curve(path, n_sites, &mut all));
    for ([n_kept, n_levels], found) in SEARCHED.iter().zip(all) {
        let n = found.len() as f64;
        let mut costs: Vec<f64> = found.iter().map(|f| f[0]).collect();
        costs.sort_by(f64::total_cmp);
        let (Some(worst), median) = (costs.last(), costs.len() / 2) else { continue };
        println!(
            "{n_kept} cells, {n_levels} levels: {:.2} times 150 (median; worst {worst:.2}),              {:.2} % found (mean; worst {:.2})",
            costs[median],
            100.0 * found.iter().map(|f| f[1]).sum::<f64>() / n,
            100.0 * found.iter().map(|f| f[1]).fold(1.0, f64::min),
        );
    }
}

fn curve(path: &str, n_sites: usize, all: &mut [Vec<Found>; SEARCHED.len()]) {
    let (mesh, sites) = read(path, n_sites);
    let obstacles = TriangleObstacles::new(&mesh, &[]).expect("triangles");
    for lengths in [CUTTERS[0], CUTTERS[1], CUTTERS[5]] {
        let cutter = ball(lengths);
        let label = |n_directions: usize, refinement: Option<RefinementOptions>| {
            let base = SurfaceOptions::default().with_occlusion(false).with_refinement(refinement);
            let options = base.with_counts(false);
            let directions = Directions::fibonacci_hemisphere(n_directions).expect("directions");
            timed(|| obstacles.label(&sites, &cutter, &directions, &options).expect("labels"))
        };
        println!("{path} {lengths:?}");
        let (mut truth, mut unit) = (Vec::new(), 0.0);
        for n_directions in UNIFORM {
            let (labels, t) = label(n_directions, None);
            truth = accessible(&labels);
            if n_directions == 150 {
                unit = t.processor;
            }
            let share = labels.answers.share(SiteAnswer::Accessible);
            println!("  {n_directions} directions: accessible {share:.4}, {t}");
        }
        for ([n_kept, n_levels], all) in SEARCHED.into_iter().zip(all.iter_mut()) {
            let refinement = RefinementOptions::default();
            let refinement =
                refinement.with_n_kept(n_kept).with_n_levels(n_levels).with_prove(false);
            let (labels, t) = label(150, Some(refinement));
            let found = accessible(&labels);
            let both = found.iter().zip(&truth).filter(|(a, b)| **a && **b).count();
            let n_truth = truth.iter().filter(|a| **a).count();
            let n_found = found.iter().filter(|a| **a).count();
            let rest = found.len() - n_found;
            let evidence = labels.surface.expect("by the mesh");
            let open = evidence.open_directions.iter().zip(&found);
            let proven = open.filter(|(open, found)| !**found && **open == 0.0).count();
            let [cost, share] = [t.processor / unit, both as f64 / n_truth.max(1) as f64];
            all.push([cost, share]);
            println!(
                "  150, {n_kept} cells, {n_levels} levels: accessible {:.4}, {t}, {cost:.2} times 150, {:.2} % of the last                  set's and {} more; {:.1} % of the rest proven",
                n_found as f64 / found.len() as f64,
                100.0 * share,
                n_found - both,
                100.0 * proven as f64 / rest.max(1) as f64,
            );
        }
    }
}

fn accessible(labels: &Labels) -> Vec<bool> {
    labels.answers.accessible()
}

fn equal(path: &str, n_sites: usize, n_directions: usize) {
    let (mesh, sites) = read(path, n_sites);
    let obstacles = TriangleObstacles::new(&mesh, &[]).expect("triangles");
    let directions = Directions::fibonacci_hemisphere(n_directions).expect("directions");
    let params = CutterParams::from_array;
    let cutters = [
        Ok(ball(CUTTERS[0])),
        Ok(ball(CUTTERS[1])),
        Cutter::bull_nose(params(CUTTERS[5]), 0.5),
        Cutter::flat_end(params(CUTTERS[3])),
        Ok(ball(CUTTERS[4])),
        Cutter::tapered(params([1.0, 12.0, 8.0, 10.0]), 0.08, 6),
        Cutter::flat_end(params([3.0, 20.0, 20.0, 30.0])),
        Cutter::bull_nose(params([3.0, 20.0, 20.0, 30.0]), 1.0),
    ];
    let (mut n_pairs, mut n_edges, mut n_wrong, mut n_missed) = (0, 0, 0, 0);
    for cutter in cutters {
        let cutter = cutter.expect("a cutter");
        let options = |tolerance: f64| {
            SurfaceOptions::default()
                .with_tolerance(ContactTolerance::Millimeters(tolerance))
                .with_occlusion(false)
                .with_refinement(None)
        };
        let expected = |tolerance: f64| {
            let options = options(tolerance);
            obstacles
                .reached_by_drop_heights(&sites, &cutter, &directions, &options, RESOLUTION_MM)
                .expect("answers")
        };
        let fast = obstacles.accessible_directions(&sites, &cutter, &directions, &options(0.01));
        let fast = fast.expect("answers");
        let (less, more) = (expected(0.01 - MISSED_MM), expected(0.01 + EPSILON_MM));
        for i in 0..sites.len() {
            for d in 0..directions.len() {
                let (found, k) = (fast.is_accessible(d, i), i * directions.len() + d);
                n_pairs += 1;
                n_edges += usize::from((less[k] == Reached::Yes) != (more[k] == Reached::Yes));
                let wrong = found && more[k] == Reached::No;
                let missed = !found && less[k] == Reached::Yes;
                (n_wrong, n_missed) =
                    (n_wrong + usize::from(wrong), n_missed + usize::from(missed));
                if wrong || missed {
                    let (site, normal) = (sites.points[i], sites.normals[i]);
                    let direction = directions.vectors()[d];
                    println!(
                        "  {}: site {i} at {site}, normal {normal}, direction {d} {direction}, tool {cutter}",
                        if wrong { "wrong" } else { "missed" }
                    );
                }
            }
        }
        println!("  {cutter}: {n_wrong} wrong, {n_missed} missed of {n_pairs} so far");
    }
    println!(
        "{path}: {} triangles, {n_pairs} answers, {n_edges} turn within {MISSED_MM} mm of tolerance, {n_wrong} wrong, {n_missed} missed",
        mesh.triangles.len()
    );
}
