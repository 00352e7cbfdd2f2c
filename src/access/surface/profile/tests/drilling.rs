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
        assert!(labels.evidence.retreat_unproven.iter().all(|unproven| !unproven));
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
        obstacles.surface_labels(&sites, &tool.cutter().unwrap(), directions, options).unwrap()
    };
    let labels = of(&hemisphere, &SurfaceOptions::default());
    assert_eq!(share(&labels), 1.0);
    let axis = (turn * DVec3::Z).as_vec3();
    let witness = labels.evidence.witness[0].unwrap();
    assert!(witness.direction.dot(axis) > 1.0 - 1e-6);
    // By the directions of a set alone it is not.
    let alone = SurfaceOptions { refinement: None, ..SurfaceOptions::default() };
    assert_eq!(share(&of(&hemisphere, &alone)), 0.0);
    assert_eq!(share(&of(&Directions::up(), &SurfaceOptions::default())), 0.0);
}

/// A pilot of radius 1 and its length below a countersink of this angle up to radius 3, on a shank.
fn center_drill(pilot: f64, countersink: f64) -> Profile {
    let angles = [118.0, countersink].map(f64::to_radians);
    let drill = Profile::center_drill([1.0, 3.0], pilot, angles).unwrap();
    drill.with_shank(&[[3.0, 40.0]]).unwrap()
}

/// A round block with a center hole from above: a countersink of 60° down from radius 2, and a pilot of radius 1, 2
/// long with its point. Heights of the lower ends of countersink and wall.
fn center_hole() -> (Mesh, [f64; 2]) {
    let sink = 30.0 - cone(60.0);
    let wall = sink - (2.0 - cone(118.0));
    let tip = wall - cone(118.0);
    let outline =
        [[0.0, 0.0], [20.0, 0.0], [20.0, 30.0], [2.0, 30.0], [1.0, sink], [1.0, wall], [0.0, tip]];
    (revolved(&outline, 64), [sink, wall])
}

#[test]
fn a_center_drill_reaches_pilot_point_and_countersink_of_its_own_hole() {
    let (mesh, [sink, wall]) = center_hole();
    let in_hole = |p: DVec3| p.truncate().length() < 2.1 && p.z < 29.99 && p.z > 1.0;
    let countersink = sites_on(&mesh, 6, |p, n| in_hole(p) && n.z > 0.1 && p.z > sink);
    let walls = sites_on(&mesh, 6, |p, n| in_hole(p) && n.z.abs() < 0.1);
    let point = sites_on(&mesh, 8, |p, n| {
        in_hole(p) && n.z > 0.1 && p.z < wall && p.truncate().length() > 0.2
    });
    assert!(countersink.len() > 500 && walls.len() > 500 && point.len() > 500);
    for sites in [&countersink, &walls, &point] {
        assert_eq!(share(&label(&mesh, sites, center_drill(2.0, 60.0), 50.0)), 1.0);
    }
    // Of another angle it reaches no countersink, and of the wall what it touches before that is in the way: raised by
    // h, its flank of 45° is within the hole to the top iff 1.732 - h <= h·tan 30°/(1 - tan 30°).
    assert_eq!(share(&label(&mesh, &countersink, center_drill(2.0, 90.0), 50.0)), 0.0);
    assert_eq!(share(&label(&mesh, &point, center_drill(2.0, 90.0), 50.0)), 0.0);
    let slope = 30f64.to_radians().tan();
    let least = cone(60.0) / (1.0 + slope / (1.0 - slope));
    check_above(&walls, &label(&mesh, &walls, center_drill(2.0, 90.0), 50.0), wall + least);
    // A pilot shorter by 1 mm is stopped by its countersink 1 mm higher.
    check_above(&walls, &label(&mesh, &walls, center_drill(1.0, 60.0), 50.0), wall + 1.0);
    assert_eq!(share(&label(&mesh, &point, center_drill(1.0, 60.0), 50.0)), 0.0);
    // Its body does not cut: a bore of the body's radius is none of its own.
    let bore = revolved(&[[3.0, 0.0], [20.0, 0.0], [20.0, 30.0], [3.0, 30.0]], 64);
    let sites = sites_on(&bore, 6, |p, n| p.truncate().length() < 3.1 && n.z.abs() < 0.1);
    assert_eq!(share(&label(&bore, &sites, center_drill(2.0, 60.0), 50.0)), 0.0);
}

/// Sites are reached above a height, and not below it.
fn check_above(sites: &Sites, labels: &SurfaceLabels, height: f64) {
    let mut n = [0, 0];
    for (point, answer) in sites.points.iter().zip(&labels.answers) {
        let above = f64::from(point.z) - height;
        if above.abs() > 0.05 {
            assert_eq!(*answer == SiteAnswer::Accessible, above > 0.0, "{point} {height}");
            n[usize::from(above > 0.0)] += 1;
        }
    }
    assert!(n[0] > 20 && n[1] > 20, "{n:?}");
}

#[test]
fn a_step_drill_reaches_the_walls_of_both_its_diameters() {
    let wall = 15.0 - 2.5 * cone(118.0);
    let outline =
        [[0.0, 0.0], [20.0, 0.0], [20.0, 30.0], [4.0, 30.0], [4.0, 24.0], [2.5, 22.5], [2.5, 15.0]];
    let mesh = revolved(&[&outline[..], &[[0.0, wall]]].concat(), 64);
    let sites = sites_on(&mesh, 6, |p, n| {
        let radius = p.truncate().length();
        radius < 4.1 && p.z < 29.9 && n.z.abs() < 0.1 && radius > 0.5
    });
    let top = 2.5 * cone(118.0) + 7.5;
    let text = format!("drill 0:0 2.5:{} 2.5:{top} 4:{} 4:40 | 4:60", 2.5 * cone(118.0), top + 1.5);
    assert!(sites.len() > 1000);
    assert_eq!(share(&label(&mesh, &sites, text.parse().unwrap(), 50.0)), 1.0);
    // Without its step it reaches the upper bore alone, and without its point the lower one alone.
    let is_upper = |p: &Vec3| p.truncate().length() > 3.0;
    for (radius, upper) in [(4.0, true), (2.5, false)] {
        let profile = drill(radius, 118.0);
        let labels = label(&mesh, &sites, profile, 50.0);
        for (point, answer) in sites.points.iter().zip(&labels.answers) {
            let reached = *answer == SiteAnswer::Accessible;
            assert!(!reached || is_upper(point) == upper, "{radius} {point}");
        }
    }
}
