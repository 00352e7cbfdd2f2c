//! Any triangles over a few lattice points: examined, joined, repaired and classified without a panic, and what
//! passes as a solid has an inside. Lattice points make every kind of degeneracy likely.
#![no_main]

use deepmill::geom::{Mesh, bodies, check, inside, intersect, repair, weld};
use glam::DVec3;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|input: &[u8]| {
    let lattice = |b: u8| DVec3::new(f64::from(b % 4), f64::from(b / 4 % 4), f64::from(b / 16));
    let corners: Vec<DVec3> = input.iter().map(|b| lattice(*b)).collect();
    let triangles = (0..corners.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let mut mesh = weld::weld(&Mesh { vertices: corners, triangles }, 1e-6).unwrap();
    let report = check::check(&mesh);
    let _ = intersect::finding(&mesh);
    let probes = [DVec3::splat(0.5), DVec3::ONE, DVec3::new(1.0, 2.0, 3.5)];
    let windings = inside::windings(&mesh, &probes);
    assert!(windings.is_ok() || report.blocking().is_some());
    let balanced = windings.is_ok();
    let mut joined = mesh.clone();
    match bodies::join(&mut joined) {
        Ok(_) => assert!(joined.check().is_ok()),
        Err(_) => assert!(joined == mesh),
    }
    repair::repair(&mut mesh).unwrap();
    assert!(!balanced || inside::windings(&mesh, &probes).is_ok());
});
