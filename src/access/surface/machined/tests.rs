use super::super::{SurfaceOptions, TriangleObstacles};
use super::*;
use crate::cutter::Cutter;
use crate::directions::Directions;
use crate::geom::{Mesh, Sites, solids};
use glam::DVec3;

/// A block 40 × 30 × 20 with a pocket 20 × 14, 10 deep, from above: its floor is about (20, 15, 10).
fn pocket() -> Mesh {
    let mut mesh = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
    let mut hole = solids::cuboid(DVec3::new(20.0, 14.0, 10.0));
    hole.vertices.iter_mut().for_each(|v| *v += DVec3::new(10.0, 8.0, 10.0));
    // Corners 4 to 7 of each are the upper ones; between the two squares is a frame of eight triangles.
    let is_top = |t: &[u32; 3]| t.iter().all(|v| *v >= 4);
    mesh.triangles.retain(|t| !is_top(t));
    mesh.vertices.extend(&hole.vertices);
    let inward =
        hole.triangles.iter().filter(|t| !is_top(t)).map(|t| [t[0] + 8, t[2] + 8, t[1] + 8]);
    mesh.triangles.extend(inward);
    for k in 0..4 {
        let ([a, b], [c, d]) = ([4 + k, 4 + (k + 1) % 4], [12 + k, 12 + (k + 1) % 4]);
        mesh.triangles.extend([[a, b, d], [a, d, c]]);
    }
    mesh
}

fn sites(at: &[(DVec3, DVec3)]) -> Sites {
    Sites {
        points: at.iter().map(|(p, _)| p.as_vec3()).collect(),
        normals: at.iter().map(|(_, n)| n.as_vec3()).collect(),
        ..Sites::default()
    }
}

fn rests(mesh: &Mesh, at: &[(DVec3, DVec3)], cutter: &Cutter, directions: &Directions) -> Vec<f64> {
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let which: Vec<usize> = (0..at.len()).collect();
    let options = (&SurfaceOptions::default(), RestOptions::default());
    let found = obstacles.rests((&sites(at), &which), cutter, directions, options).unwrap();
    found.iter().map(|rest| rest.mm).collect()
}

#[test]
fn the_pocket_is_a_closed_solid() {
    let mesh = pocket();
    crate::geom::check::require_labelable(&mesh).unwrap();
    assert!((mesh.volume() - (24000.0 - 2800.0)).abs() < 1e-9);
}

/// A ball of radius R leaves in a corner of two walls what its circle does not reach.
#[test]
fn a_ball_leaves_in_corners_what_its_circle_does_not_reach() {
    let mesh = pocket();
    let up = Directions::up();
    for radius in [1.0, 2.0, 3.0, 5.0] {
        let cutter: Cutter = format!("{radius},20,20,40").parse().unwrap();
        let mut at = Vec::new();
        let mut expected = Vec::new();
        for x in [0.01, 0.1, 0.3, 0.5, 0.8, 1.0, 1.5, 2.0, 2.9, 4.0, 6.0] {
            // The floor, near the wall at y = 8: the ball's center is R from floor and wall.
            at.push((DVec3::new(20.0, 8.0 + x, 10.0), DVec3::Z));
            let beyond = (radius - x).max(0.0);
            expected.push(radius - (radius * radius - beyond * beyond).sqrt());
            // The wall, near the floor.
            at.push((DVec3::new(20.0, 8.0, 10.0 + x), DVec3::Y));
            let beyond: f64 = (radius - x).max(0.0);
            expected.push(radius - (radius * radius - beyond * beyond).sqrt());
        }
        let found = rests(&mesh, &at, &cutter, &up);
        for ((found, expected), at) in found.iter().zip(&expected).zip(&at) {
            println!("R {radius} {at:?}: {found:.4} by hand {expected:.4}");
            // Near the wall a shift by the gouge tolerance is more along the normal.
            let most = 0.02
                + 0.015
                    * (radius
                        / 0.01f64.max((radius * radius - (radius - expected).powi(2)).sqrt()));
            let most = most.min(0.1);
            assert!((found - expected).abs() < most, "R {radius} at {at:?}: {found} {expected}");
        }
    }
}

fn machine(mesh: &Mesh, cutters: &[&Cutter], directions: &Directions, accuracy: f64) -> Vec<f64> {
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let (low, high) = mesh.bounds().unwrap();
    let job = Job { part: mesh, stock_box: [low, high], stock: None, accuracy_mm: accuracy };
    let options = SurfaceOptions::default();
    let start = std::time::Instant::now();
    let found = obstacles.machine(&job, cutters, directions, &options, &mut |_, _| Ok(())).unwrap();
    println!("{:?} alone {:?} after {:?}", start.elapsed(), found.alone_mm3, found.after_mm3);
    for body in &found.bodies {
        let report = crate::geom::check::check(&body.mesh);
        println!(
            "body {} mm3, mesh {} mm3, {:?} at {}, {:?}",
            body.volume_mm3,
            body.mesh.volume(),
            body.mesh.triangles.len(),
            body.at_mm,
            report.findings
        );
    }
    found.after_mm3
}

#[test]
fn a_ball_leaves_the_volume_of_its_fillets_in_a_pocket() {
    let mesh = pocket();
    let cutter: Cutter = "3,20,20,40".parse().unwrap();
    for accuracy in [0.5, 0.25, 0.125] {
        machine(&mesh, &[&cutter], &Directions::up(), accuracy);
    }
}
