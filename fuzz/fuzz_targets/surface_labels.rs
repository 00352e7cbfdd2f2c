//! By the drop heights on any triangles over lattice points: where the fast engine finds a pose, the tool is free in
//! it; a ball that is free where it touches with a site's normal reaches the site. A change of the tolerance by 1e-6 mm
//! may turn either.
#![no_main]

mod scene;

use deepmill::access::surface::{ContactTolerance, SurfaceOptions, TriangleObstacles, raise};
use deepmill::answers::SiteAnswer;
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
    let options = |tolerance| {
        SurfaceOptions::default()
            .with_tolerance(ContactTolerance::Millimeters(tolerance))
            .with_refinement(None)
            .with_occlusion(false)
    };
    let fast = obstacles.label(&sites, &cutter, &directions, &options(TOLERANCE_MM));
    let Ok(fast) = fast else { return };
    let evidence = fast.surface.expect("by the mesh");
    let raised = |tolerance: f64, center: DVec3, direction: Vec3| {
        raise(&mesh, &cutter, tolerance, center, direction)
            .is_ok_and(|raise| raise.steps <= 0.0 && raise.tip <= 0.0)
    };
    for i in 0..sites.len() {
        if let Some(pose) = evidence.witness[i] {
            let axis = pose.direction.as_dvec3().normalize();
            let center = pose.tip_mm + cutter.corner_mm() * axis;
            assert!(raised(TOLERANCE_MM + EDGE_MM, center, pose.direction), "site {i}: {pose:?}");
        } else if cutter.side_mm() == 0.0 {
            let normal = sites.normals[i].as_dvec3().normalize();
            let center = sites.points[i].as_dvec3() + cutter.corner_mm() * normal;
            let free = |d: &Vec3| raised(TOLERANCE_MM - EDGE_MM, center, *d);
            assert!(!directions.vectors().iter().any(free), "site {i}");
        }
        assert_eq!(evidence.witness[i].is_some(), fast.answers.of(i) == SiteAnswer::Accessible);
    }
});
