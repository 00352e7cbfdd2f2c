//! The fast engine for the part itself gives the answers of the drop heights on any triangles over lattice points, but where a change of
//! the tolerance by 1e-6 mm turns the answer.
#![no_main]

mod scene;

use deepmill::access::surface::{
    ContactTolerance, SurfaceLabels, SurfaceOptions, TriangleObstacles,
};
use deepmill::geom::{Mesh, Sites};
use glam::{DVec3, Vec3};
use libfuzzer_sys::fuzz_target;

const TOLERANCE_MM: f64 = 0.01;
const EDGE_MM: f64 = 1e-6;

fuzz_target!(|bytes: &[u8]| {
    let Some((head, rest)) = bytes.split_first_chunk() else { return };
    let (cutter, directions) = scene::tool(head);
    let lattice = |b: u8| DVec3::new(f64::from(b % 8), f64::from(b / 8 % 8), f64::from(b / 64));
    let corners: Vec<DVec3> = rest.iter().take(60).map(|b| 2.0 * lattice(*b)).collect();
    let triangles = (0..corners.len() as u32 / 3).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let mesh = Mesh { vertices: corners, triangles };
    let mut sites = Sites::default();
    for (face, [a, b, c]) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = [a, b, c].map(|v| mesh.vertices[*v as usize]);
        let normal = (b - a).cross(c - a).as_vec3().normalize_or(Vec3::Z);
        for at in [(a + b + c) / 3.0, 0.5 * (a + b), a] {
            sites.points.push(at.as_vec3());
            sites.normals.push(normal);
            sites.faces.push(face as u32);
        }
    }
    let Ok(obstacles) = TriangleObstacles::new(&mesh, &[]) else { return };
    let options = |tolerance| SurfaceOptions {
        tolerance: ContactTolerance::Millimeters(tolerance),
        refinement: None,
        occlusion: false,
        ..SurfaceOptions::default()
    };
    let law = |tolerance| {
        obstacles.label_by_drop_heights(&sites, &cutter, &directions, &options(tolerance))
    };
    let fast = obstacles.label(&sites, &cutter, &directions, &options(TOLERANCE_MM));
    let (Ok(low), Ok(high)) = (law(TOLERANCE_MM - EDGE_MM), law(TOLERANCE_MM + EDGE_MM)) else {
        return assert!(fast.is_err());
    };
    let fast = fast.expect("what the drop heights can answer");
    for i in 0..sites.len() {
        let counts =
            |l: &SurfaceLabels| (l.collision_free_directions[i], l.accessible_directions[i]);
        let ((a, b), (least, fewest), (most, greatest)) =
            (counts(&fast), counts(&low), counts(&high));
        assert!((least..=most).contains(&a) && (fewest..=greatest).contains(&b), "site {i}");
    }
});
