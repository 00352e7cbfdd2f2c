//! Bores by hand: what a drill and a reamer reach.

use super::*;
use std::f64::consts::PI;

/// How deep the cone of a drill is, of its radius.
fn cone(degrees: f64) -> f64 {
    1.0 / (0.5 * degrees.to_radians()).tan()
}

/// A round block, 30 high, with a bore of radius 2.5 from above, 15 deep and then a cone of 118°.
pub(super) fn blind_bore() -> Mesh {
    let tip = 15.0 - 2.5 * cone(118.0);
    revolved(&[[0.0, 0.0], [20.0, 0.0], [20.0, 30.0], [2.5, 30.0], [2.5, 15.0], [0.0, tip]], 64)
}

pub(super) fn drill(radius: f64, degrees: f64) -> Profile {
    let drill = Profile::drill(radius, degrees.to_radians(), 40.0).unwrap();
    drill.with_shank(&[[radius, 60.0]]).unwrap()
}

fn is_in_bore(p: DVec3) -> bool {
    p.truncate().length() < 2.6 && p.z < 29.9
}

fn is_wall(p: DVec3, n: DVec3) -> bool {
    is_in_bore(p) && n.z.abs() < 0.1
}

#[test]
fn a_bore_is_drilled_by_the_drill_of_its_own_diameter() {
    let mesh = blind_bore();
    let walls = sites_on(&mesh, 6, is_wall);
    let bottom =
        sites_on(&mesh, 8, |p, n| is_in_bore(p) && n.z > 0.1 && p.truncate().length() > 0.3);
    assert!(walls.len() > 500 && bottom.len() > 500);
    let of = |sites: &Sites, profile: Profile| share(&label(&mesh, sites, profile, 50.0));
    assert_eq!(of(&walls, drill(2.5, 118.0)), 1.0);
    assert_eq!(of(&bottom, drill(2.5, 118.0)), 1.0);
    // Wider by 0.03 mm a bore is the drill's own, by 0.1 mm it is another's.
    assert_eq!(of(&walls, drill(2.485, 118.0)), 1.0);
    assert_eq!(of(&walls, drill(2.45, 118.0)), 0.0);
    // Of another diameter.
    for radius in [2.3, 2.44] {
        let narrow = label(&mesh, &walls, drill(radius, 118.0), 50.0);
        assert_eq!(narrow.share(SiteAnswer::TipDoesNotFit), 1.0, "{radius}");
    }
    let wide = label(&mesh, &walls, drill(2.6, 118.0), 50.0);
    assert_eq!(share(&wide), 0.0);
    // A longer cone does not get as deep.
    let deeper = 2.5 * (cone(90.0) - cone(118.0));
    let expected = |p: &Vec3| f64::from(p.z) > 15.0 + deeper;
    let labels = label(&mesh, &walls, drill(2.5, 90.0), 50.0);
    for (point, answer) in walls.points.iter().zip(&labels.answers) {
        let is_near = (f64::from(point.z) - 15.0 - deeper).abs() < 0.1;
        assert!(is_near || (*answer == SiteAnswer::Accessible) == expected(point), "{point}");
    }
    assert_eq!(of(&bottom, drill(2.5, 90.0)), 0.0);
    // Its holder is in the way.
    let short = label(&mesh, &walls, drill(2.5, 118.0), 8.0);
    let lowest = |p: &Vec3| p.z < 20.0;
    for (point, answer) in walls.points.iter().zip(&short.answers).filter(|(p, _)| lowest(p)) {
        assert_eq!(*answer, SiteAnswer::Inaccessible, "{point}");
    }
}

#[test]
fn a_reamer_reaches_walls_and_no_bottom() {
    let mesh = revolved(&[[3.0, 0.0], [20.0, 0.0], [20.0, 30.0], [3.0, 30.0]], 64);
    let walls = sites_on(&mesh, 6, |p, n| p.truncate().length() < 3.1 && n.z.abs() < 0.1);
    let of = |sites: &Sites, radius: f64| {
        let reamer = Profile::reamer(radius, 0.3, 45.0).unwrap();
        share(&label(&mesh, sites, reamer.with_shank(&[[radius - 0.2, 70.0]]).unwrap(), 60.0))
    };
    assert_eq!(of(&walls, 3.0), 1.0);
    assert_eq!((of(&walls, 2.9), of(&walls, 3.1)), (0.0, 0.0));
    let others = sites_on(&mesh, 4, |p, n| p.truncate().length() > 3.1 || n.z.abs() > 0.9);
    assert_eq!(of(&others, 3.0), 0.0);
}

#[test]
fn a_drill_is_no_end_mill() {
    // Walls of a slot and of a square pocket as wide as the drill, and the outside.
    let half = [[20.0, 0.0], [20.0, 30.0], [2.5, 30.0], [2.5, 10.0]];
    let other = half.iter().rev().map(|[x, z]| [-x, *z]);
    let outline: Vec<[f64; 2]> = half.iter().copied().chain(other).collect();
    let slot = drawn_along_y(&outline, 40.0);
    let square = revolved(
        &[[2.5 * 2f64.sqrt(), 0.0], [20.0, 0.0], [20.0, 30.0], [2.5 * 2f64.sqrt(), 30.0]],
        4,
    );
    // Seen along a wall of a step, the part is cut in a rectangle whose corners are on a circle.
    let step = [[-20.0, 0.0], [20.0, 0.0], [20.0, 3.0], [0.0, 3.0], [0.0, 7.0], [-20.0, 7.0]];
    let step = drawn_along_y(&step, 3.0);
    for mesh in [slot, square, step, solids::cuboid(DVec3::splat(20.0))] {
        let sites = sites_on(&mesh, 9, |_, _| true);
        let labels = label(&mesh, &sites, drill(2.5, 118.0), 50.0);
        assert_eq!(share(&labels), 0.0);
        assert!(labels.retreat_unproven.iter().all(|unproven| !unproven));
    }
}

#[test]
fn a_bore_across_no_direction_of_the_set_is_drilled_along_its_axis() {
    let turn = glam::DQuat::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), 17.3 * PI / 180.0);
    let mut mesh = blind_bore();
    let straight = sites_on(&mesh, 3, is_wall);
    mesh.vertices.iter_mut().for_each(|v| *v = turn * *v);
    let turned = |v: &Vec3| (turn * v.as_dvec3()).as_vec3();
    let sites = Sites {
        points: straight.points.iter().map(turned).collect(),
        normals: straight.normals.iter().map(turned).collect(),
        ..Sites::default()
    };
    let holder = [Section::cylinder(30.0, 20.0)];
    let tool = Assembly::from_profile(drill(2.5, 118.0), &holder, 50.0).unwrap();
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let hemisphere = Directions::new(DirectionSet::FibonacciHemisphere { n_dirs: 60 }).unwrap();
    let of = |directions: &Directions, options: &SurfaceOptions| {
        obstacles.label(&sites, &tool.cutter().unwrap(), directions, options).unwrap()
    };
    let labels = of(&hemisphere, &SurfaceOptions::default());
    assert_eq!(share(&labels), 1.0);
    let axis = (turn * DVec3::Z).as_vec3();
    let witness = labels.witness[0].unwrap();
    assert!(witness.direction.dot(axis) > 1.0 - 1e-6);
    // By the directions of a set alone it is not.
    let alone = SurfaceOptions { refinement: None, ..SurfaceOptions::default() };
    assert_eq!(share(&of(&hemisphere, &alone)), 0.0);
    assert_eq!(share(&of(&Directions::up(), &SurfaceOptions::default())), 0.0);
}
