//! How labels change with the density of obstacles and the number of directions, and how good two baselines are.
//! `docs/benchmarks.md` has the table.
//!
//! ```text
//! cargo bench --bench label_choices -- PART…
//! ```
#![allow(clippy::print_stdout)]

use deepmill::access::baselines::{best_facing, facing_away, highest};
use deepmill::access::{LabelOptions, Labels, Obstacles, label};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::directions::Directions;
use deepmill::geom::Sites;
use deepmill::geom::formats::{ReadOptions, read_mesh};
use deepmill::geom::sites::{SiteOptions, sample};

/// CR, CH, FR, FH, mm.
const CUTTERS: [[f64; 4]; 4] =
    [[0.5, 6.0, 40.0, 5.0], [1.5, 6.0, 40.0, 5.0], [1.0, 20.0, 5.0, 20.0], [1.5, 0.2, 90.0, 0.2]];
const N_SITES: usize = 7000;
const N_DENSE: usize = 100_000;

fn main() {
    println!(
        "{:<22} {:<14} {:>6} {:>7} {:>10} {:>10} {:>9} {:>9}",
        "part", "cutter", "inacc", "missed", "2400 dirs", "flipped", "F1 high", "F1 facing"
    );
    for path in std::env::args().skip(1).filter(|a| a != "--bench") {
        let mut mesh = read_mesh(std::path::Path::new(&path), &ReadOptions::default()).unwrap();
        let (lo, hi) = mesh.bounds().unwrap();
        let scale = (80.0 / (hi - lo).min_element()).max(1.0);
        mesh.vertices.iter_mut().for_each(|v| *v *= scale);
        let draw = |n_sites| sample(&mesh, &SiteOptions::default().with_n_sites(n_sites)).unwrap();
        let (sites, dense) = (draw(N_SITES), draw(N_DENSE).points);
        for lengths in CUTTERS {
            row(&path, &sites, &dense, lengths);
        }
    }
}

fn row(path: &str, sites: &Sites, dense: &[glam::Vec3], lengths: [f64; 4]) {
    let cutter = Cutter::ball_end(CutterParams::from_array(lengths)).unwrap();
    let run = |obstacles, n_dirs, occlusion| {
        let directions = Directions::fibonacci_hemisphere(n_dirs).unwrap();
        let options = LabelOptions::default().with_occlusion(occlusion);
        label(sites, obstacles, &cutter, &directions, &options).unwrap()
    };
    let base = run(Obstacles::Queries, 150, true);
    let faithful = run(Obstacles::QueriesAnd(dense), 150, false);
    let many = run(Obstacles::Queries, 2400, false);
    let missed = differing(&base, &faithful);
    let share = |count: usize, of: usize| 100.0 * count as f64 / of.max(1) as f64;
    let facing =
        facing_away(&sites.normals, best_facing(&sites.normals, &base.answers.inaccessible()));
    println!(
        "{:<22} {:<14} {:>5.1}% {:>6.2}% {:>9.1}% {:>9.2}% {:>9.3} {:>9.3}",
        std::path::Path::new(path).file_stem().unwrap().to_string_lossy(),
        lengths.map(|l| l.to_string()).join(","),
        share(base.answers.n_inaccessible(), sites.len()),
        share(missed, faithful.answers.n_inaccessible()),
        share(many.answers.n_inaccessible(), sites.len()),
        share(differing(&base, &many), sites.len()),
        f1(&highest(&sites.points, 0.1), base.answers.occlusion()),
        f1(&facing, &base.answers.inaccessible()),
    );
}

fn differing(a: &Labels, b: &Labels) -> usize {
    a.answers.inaccessible().iter().zip(&b.answers.inaccessible()).filter(|(a, b)| a != b).count()
}

fn f1(guess: &[bool], truth: &[bool]) -> f64 {
    let both = guess.iter().zip(truth).filter(|&(&g, &t)| g && t).count();
    let marked = guess.iter().chain(truth).filter(|&&m| m).count();
    2.0 * both as f64 / marked.max(1) as f64
}
