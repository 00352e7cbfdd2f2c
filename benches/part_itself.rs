//! Labels against triangles: time, effect of more directions, and equality with the drop heights.
//!
//! ```text
//! cargo bench --bench part_itself -- cost   N_SITES N_DIRECTIONS PART.stl…
//! cargo bench --bench part_itself -- curve  N_SITES PART.stl…
//! cargo bench --bench part_itself -- equal  N_SITES N_DIRECTIONS PART.stl…
//! ```
//!
//! Parts with an edge of the bounding box below 80 mm are scaled up to 80 mm. Times are processor time of all threads
//! (Linux; elsewhere 0), the mean of the runs in 0.3 s.
#![allow(clippy::print_stdout)]

use deepmill::access::surface::{
    ContactTolerance, RefinementOptions, SiteAnswer, SurfaceLabels, SurfaceOptions,
    TriangleObstacles,
};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::directions::Directions;
use deepmill::geom::formats::{ReadOptions, read_mesh};
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::weld::DEFAULT_TOLERANCE;
use deepmill::geom::{Mesh, Sites};
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
const UNIFORM: [usize; 7] = [75, 150, 300, 600, 1200, 2400, 9600];
const SEARCHED: [usize; 4] = [64, 128, 256, 1024];
const EPSILON_MM: f64 = 1e-6;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let number = |k: usize| args[k].parse::<usize>().expect("a number");
    match args.first().map(String::as_str) {
        Some("cost") => args[3..].iter().for_each(|part| cost(part, number(1), number(2))),
        Some("curve") => args[2..].iter().for_each(|part| curve(part, number(1))),
        Some("equal") => args[3..].iter().for_each(|part| equal(part, number(1), number(2))),
        _ => println!("cost, curve or equal; see the first lines of benches/part_itself.rs"),
    }
}

fn read(path: &str, n_sites: usize) -> (Mesh, Sites) {
    let options = ReadOptions { scale: 1.0, weld: DEFAULT_TOLERANCE };
    let mut mesh = read_mesh(Path::new(path), &options).expect("a mesh");
    let (low, high) = mesh.bounds().expect("a mesh with vertices");
    let factor = (80.0 / (high - low).min_element()).max(1.0);
    mesh.vertices.iter_mut().for_each(|v| *v *= factor);
    let sites = sample(&mesh, &SiteOptions { n_sites, ..SiteOptions::default() }).expect("sites");
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

/// The result, and the mean processor time of a run.
fn timed<R>(work: impl Fn() -> R) -> (R, f64) {
    let (start, before) = (Instant::now(), processor_time());
    let mut n = 0.0;
    loop {
        let result = work();
        n += 1.0;
        if start.elapsed().as_secs_f64() > 0.3 {
            return (result, (processor_time() - before) / n);
        }
    }
}

fn cost(path: &str, n_sites: usize, n_directions: usize) {
    let (mesh, sites) = read(path, n_sites);
    let (obstacles, index) = timed(|| TriangleObstacles::new(&mesh, &[]).expect("triangles"));
    println!("{path}: {} triangles, tree {index:.3} s", mesh.triangles.len());
    let directions = Directions::fibonacci_hemisphere(n_directions).expect("directions");
    for lengths in CUTTERS {
        let cutter = ball(lengths);
        let base = SurfaceOptions { occlusion: false, refinement: None, ..Default::default() };
        let quick = SurfaceOptions { counts: false, ..base };
        let search = SurfaceOptions { refinement: Some(RefinementOptions::default()), ..quick };
        let label = |options: &SurfaceOptions| {
            timed(|| obstacles.label(&sites, &cutter, &directions, options).expect("labels"))
        };
        let ((labels, t), (counts, t_counts)) = (label(&quick), label(&base));
        let (searched, t_search) = label(&search);
        let with_beta = SurfaceOptions { occlusion: true, ..base };
        let beta = || obstacles.label_sites(&sites, &cutter, &directions, &with_beta);
        let (_, t_beta) = timed(beta);
        println!(
            "  {lengths:?}: labels {t:.3} s ({}), counts {t_counts:.3} s ({}), with β {t_beta:.3} s, searched {t_search:.3} s ({}); \
             inaccessible {:.3} → {:.3}",
            work(&labels),
            work(&counts),
            work(&searched),
            labels.share(SiteAnswer::Inaccessible),
            searched.share(SiteAnswer::Inaccessible),
        );
    }
}

fn work(labels: &SurfaceLabels) -> String {
    let n = labels.answers.len() as f64;
    let tools = labels.stats.tools_tested as f64;
    let triangles = labels.stats.triangles_tested as f64;
    format!("{:.2} tools per site, {:.1} triangles per tool", tools / n, triangles / tools.max(1.0))
}

fn curve(path: &str, n_sites: usize) {
    let (mesh, sites) = read(path, n_sites);
    let obstacles = TriangleObstacles::new(&mesh, &[]).expect("triangles");
    for lengths in [CUTTERS[0], CUTTERS[1], CUTTERS[5]] {
        let cutter = ball(lengths);
        let label = |n_directions: usize, n_tests: usize| {
            let refinement = RefinementOptions { n_tests, ..RefinementOptions::default() };
            let options = SurfaceOptions {
                counts: false,
                occlusion: false,
                refinement: (n_tests > 0).then_some(refinement),
                ..SurfaceOptions::default()
            };
            let directions = Directions::fibonacci_hemisphere(n_directions).expect("directions");
            timed(|| obstacles.label(&sites, &cutter, &directions, &options).expect("labels"))
        };
        println!("{path} {lengths:?}");
        let mut truth = Vec::new();
        for n_directions in UNIFORM {
            let (labels, t) = label(n_directions, 0);
            truth = accessible(&labels);
            let share = labels.share(SiteAnswer::Accessible);
            println!("  {n_directions} directions: accessible {share:.4}, {t:.3} s");
        }
        for n_tests in SEARCHED {
            let (labels, t) = label(150, n_tests);
            let found = accessible(&labels);
            let both = found.iter().zip(&truth).filter(|(a, b)| **a && **b).count();
            let n_truth = truth.iter().filter(|a| **a).count();
            let n_found = found.iter().filter(|a| **a).count();
            let rest = found.len() - n_found;
            let open = labels.open_directions.iter().zip(&found);
            let proven = open.filter(|(open, found)| !**found && **open == 0.0).count();
            println!(
                "  150 and {n_tests} cells: accessible {:.4}, {t:.3} s, {:.2} % of the last set's and {} more; \
                 {:.1} % of the rest proven",
                n_found as f64 / found.len() as f64,
                100.0 * both as f64 / n_truth.max(1) as f64,
                n_found - both,
                100.0 * proven as f64 / rest.max(1) as f64,
            );
        }
    }
}

fn accessible(labels: &SurfaceLabels) -> Vec<bool> {
    labels.answers.iter().map(|answer| *answer == SiteAnswer::Accessible).collect()
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
    ];
    let (mut n_pairs, mut n_edges, mut n_wrong) = (0, 0, 0);
    for cutter in cutters {
        let cutter = cutter.expect("a cutter");
        let options = |tolerance: f64| SurfaceOptions {
            tolerance: ContactTolerance::Millimeters(tolerance),
            occlusion: false,
            refinement: None,
            ..SurfaceOptions::default()
        };
        let expected = |tolerance: f64| {
            let options = options(tolerance);
            obstacles.label_by_drop_heights(&sites, &cutter, &directions, &options).expect("labels")
        };
        let fast = obstacles.label(&sites, &cutter, &directions, &options(0.01)).expect("labels");
        let (less, more) = (expected(0.01 - EPSILON_MM), expected(0.01 + EPSILON_MM));
        for counts in [
            [
                &less.collision_free_directions,
                &fast.collision_free_directions,
                &more.collision_free_directions,
            ],
            [&less.accessible_directions, &fast.accessible_directions, &more.accessible_directions],
        ] {
            for i in 0..sites.len() {
                let [least, found, greatest] = counts.map(|counts| counts[i]);
                n_pairs += fast.n_directions;
                n_edges += (greatest - least) as usize;
                n_wrong += usize::from(!(least..=greatest).contains(&found));
            }
        }
    }
    println!(
        "{path}: {} triangles, {n_pairs} answers, {n_edges} within {EPSILON_MM} mm of the knife edge, {n_wrong} counts wrong",
        mesh.triangles.len()
    );
}
