//! Sites on a curved, a flat and a thin-walled body: time for each count, after the quality is asserted.

mod timing;

use deepmill::geom::Mesh;
use deepmill::geom::cells::VoronoiCells;
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::solids::{cuboid, torus};
use deepmill::geom::spacing::Spacing;
use glam::dvec3;
use std::hint::black_box;

/// From the paper's count to fifteen times as many: the time per site should not grow.
const COUNTS: [usize; 3] = [7_000, 30_000, 100_000];

fn bodies() -> [(&'static str, Mesh); 3] {
    [
        ("torus", torus(40.0, 15.0, 150, 60)),
        ("block", cuboid(dvec3(100.0, 80.0, 40.0))),
        ("plate", cuboid(dvec3(100.0, 80.0, 0.5))),
    ]
}

fn sampling() {
    for (name, mesh) in bodies() {
        for n_sites in COUNTS {
            let options = SiteOptions::default().with_n_sites(n_sites);
            let sites = sample(&mesh, &options).expect("a sound body");
            let spacing = Spacing::measure_on_sheet(&sites).expect("more than one site");
            assert!(spacing.cv <= 0.12, "{name} {n_sites}: {spacing:?}");
            let name = format!("sample: {name}, {n_sites}");
            timing::time(name, n_sites, || sample(black_box(&mesh), &options));
        }
    }
}

fn measuring() {
    let mesh = torus(40.0, 15.0, 150, 60);
    let sites = sample(&mesh, &SiteOptions::default()).expect("a sound body");
    timing::time("spacing of 7000", 0, || Spacing::measure(black_box(&sites)));
    timing::time("cells of 7000", 0, || {
        VoronoiCells::build(black_box(&sites)).unwrap().spread(&mesh, 16, 1)
    });
}

fn main() {
    sampling();
    measuring();
}
