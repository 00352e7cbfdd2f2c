//! Sites on any triangles over lattice points: refused in one line, or as many as asked for, on the faces that they
//! name.
#![no_main]

mod scratch;

use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Mesh, weld};
use glam::DVec3;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: &[u8]| {
    let Some((n, input)) = input.split_first() else { return };
    let lattice = |b: u8| DVec3::new(f64::from(b % 4), f64::from(b / 4 % 4), f64::from(b / 16));
    let corners: Vec<DVec3> = input.iter().take(300).map(|b| lattice(*b)).collect();
    let triangles = (0..corners.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let mesh = weld::weld(&Mesh { vertices: corners, triangles }, 1e-6).unwrap();
    let options = SiteOptions::default().with_n_sites(usize::from(*n) + 2).with_seed(1);
    let Some(sites) = scratch::assert_one_line(sample(&mesh, &options)) else { return };
    assert!(sites.len() == options.n_sites && sites.check().is_ok());
    for (point, face) in sites.points.iter().zip(&sites.faces) {
        let [a, b, c] = mesh.triangles[*face as usize].map(|v| mesh.vertices[v as usize]);
        let normal = (b - a).cross(c - a).normalize();
        assert!((point.as_dvec3() - a).dot(normal).abs() < 1e-4, "{point} on face {face}");
    }
});
