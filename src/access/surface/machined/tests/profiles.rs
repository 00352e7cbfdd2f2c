//! What tools of any profile leave, by hand.

use super::super::profile::AnyTool;
use super::*;
use crate::access::surface::profile::ProfileTool;
use crate::tool::cutter::{Assembly, Profile, Section, TipShape};

/// In a holder far above.
fn held(profile: Profile) -> Cutter {
    let holder = [Section { length_mm: 30.0, lower_radius_mm: 20.0, upper_radius_mm: 20.0 }];
    Assembly::from_profile(profile, &holder, 50.0).unwrap().cutter().unwrap()
}

/// A section in x and z, counter-clockwise, extruded along y.
fn extruded(section: &[[f64; 2]], cap: &[[u32; 3]], length: f64) -> Mesh {
    let section: Vec<DVec2> = section.iter().map(|p| DVec2::from_array(*p)).collect();
    let mut mesh = solids::prism(&section, cap, length);
    mesh.vertices.iter_mut().for_each(|v| *v = DVec3::new(v.x, length - v.z, v.y));
    mesh
}

/// A block 40 × 60 × 30 with a slot 10 wide from above, and below it one 20 wide from z = 10 to 18.
fn t_slotted() -> Mesh {
    let section = [
        [0.0, 0.0],
        [40.0, 0.0],
        [40.0, 30.0],
        [25.0, 30.0],
        [25.0, 18.0],
        [30.0, 18.0],
        [30.0, 10.0],
        [10.0, 10.0],
        [10.0, 18.0],
        [15.0, 18.0],
        [15.0, 30.0],
        [0.0, 30.0],
    ];
    let cap = [
        [0, 1, 6],
        [0, 6, 7],
        [1, 2, 6],
        [2, 5, 6],
        [2, 3, 4],
        [2, 4, 5],
        [0, 7, 11],
        [7, 8, 11],
        [8, 9, 11],
        [9, 10, 11],
    ];
    extruded(&section, &cap, 60.0)
}

/// The neck stops at the lips: of a wall 5 mm behind them, the cutter reaches 3 mm.
#[test]
fn a_t_slot_cutter_leaves_behind_the_lips_what_its_neck_keeps_it_from() {
    let mesh = t_slotted();
    check::require_labelable(&mesh).unwrap();
    let cutter = held(Profile::t_slot(6.0, 4.0, 0.0, 3.0).unwrap());
    let up = Directions::up();
    let mut at = Vec::new();
    for z in [10.004, 10.1, 11.0, 14.0, 16.5, 17.9, 17.996] {
        at.push((DVec3::new(10.0, 31.0, z), DVec3::X));
        at.push((DVec3::new(30.0, 13.883, z), -DVec3::X));
    }
    for (k, rest) in rests(&mesh, &at, &cutter, &up).into_iter().enumerate() {
        assert!((rest - 2.0).abs() < 0.03, "{}: {rest}", at[k].0);
    }
    // Floor and ceiling behind that stay full, those before it are reached.
    let mut at = Vec::new();
    for x in [10.3, 11.0, 11.9, 12.1, 13.0, 14.5] {
        at.push((DVec3::new(x, 25.0, 10.0), DVec3::Z));
        at.push((DVec3::new(x, 25.0, 18.0), -DVec3::Z));
    }
    for (k, rest) in rests(&mesh, &at, &cutter, &up).into_iter().enumerate() {
        let expected = if at[k].0.x < 12.0 { 8.0 } else { 0.0 };
        assert!((rest - expected).abs() < 0.03, "{}: {rest}", at[k].0);
    }
}

/// In a groove of a wall that is narrower than the ball, it enters by what its circle is over the groove's height.
#[test]
fn a_lollipop_leaves_in_a_narrow_groove_what_its_circle_does_not_reach() {
    let section = [
        [0.0, 0.0],
        [40.0, 0.0],
        [40.0, 30.0],
        [28.0, 30.0],
        [28.0, 5.0],
        [12.0, 5.0],
        [12.0, 15.0],
        [9.0, 15.0],
        [9.0, 19.0],
        [12.0, 19.0],
        [12.0, 30.0],
        [0.0, 30.0],
    ];
    let cap = [
        [0, 1, 4],
        [1, 2, 4],
        [2, 3, 4],
        [0, 4, 5],
        [0, 5, 7],
        [5, 6, 7],
        [0, 7, 8],
        [0, 8, 11],
        [8, 9, 11],
        [9, 10, 11],
    ];
    let mesh = extruded(&section, &cap, 60.0);
    check::require_labelable(&mesh).unwrap();
    for radius in [2.5, 3.0, 5.0] {
        let cutter = held(Profile::lollipop(radius, 1.5).unwrap());
        let entered = |height: f64| {
            (radius * radius - height * height).sqrt() - (radius * radius - 4.0).sqrt()
        };
        let heights = [-1.9, -1.0, 0.0, 0.7, 1.6];
        let at = heights.map(|height| (DVec3::new(9.0, 30.0, 17.0 + height), DVec3::X));
        let found = rests(&mesh, &at, &cutter, &Directions::up());
        for (height, rest) in heights.into_iter().zip(found) {
            let expected = 3.0 - entered(height);
            assert!((rest - expected).abs() < 0.04, "R {radius}, {height}: {rest} {expected}");
        }
    }
}

/// The same tools, given by lengths and by their profile, leave the same.
#[test]
fn tools_given_by_their_profile_leave_what_those_of_the_same_lengths_do() {
    let mesh = pocket();
    let profiles = ["0:0 3:3@0:3 3:20 | 3:40", "3:0 3:20 | 3:40", "2:0 3:1@2:1 3:20 | 3:40"];
    let mut at = Vec::new();
    for x in [0.05, 0.4, 1.0, 1.7, 2.5, 3.5] {
        at.push((DVec3::new(20.0, 8.0 + x, 10.0), DVec3::Z));
        at.push((DVec3::new(10.0 + x, 8.0 + x, 10.0), DVec3::Z));
        at.push((DVec3::new(20.0, 8.0, 10.0 + x), DVec3::Y));
        at.push((DVec3::new(10.0 + x, 8.0, 13.0), DVec3::Y));
    }
    for directions in [Directions::up(), "cone:50:6".parse().unwrap()] {
        for (profile, corner) in profiles.iter().zip([3.0, 0.0, 1.0]) {
            let lengths = CutterParams::from_array([3.0, 20.0, 20.0, 40.0]);
            let by_lengths = Cutter::bull_nose(lengths, corner).unwrap();
            let by_profile = held(profile.parse().unwrap());
            let of = [&by_lengths, &by_profile].map(|tool| rests(&mesh, &at, tool, &directions));
            for (k, (a, b)) in of[0].iter().zip(&of[1]).enumerate() {
                assert!((a - b).abs() < 0.01, "{profile} {}: {a} {b}", at[k].0);
            }
        }
    }
}

/// A cone stands on a floor with its point, and beside a wall with its rim.
#[test]
fn a_chamfer_mill_leaves_what_its_cone_does_not_reach() {
    let cutter = held(Profile::chamfer(0.0, 59f64.to_radians(), 4.0).unwrap());
    let slope = 59f64.to_radians().tan();
    for x in [0.1, 1.0, 2.0, 3.0, 3.9, 5.0] {
        let at = [(DVec3::new(20.0, 8.0 + x, 10.0), DVec3::Z)];
        let found = rests(&pocket(), &at, &cutter, &Directions::up());
        let expected = (4.0f64 - x).max(0.0) / slope;
        assert!((found[0] - expected).abs() < 0.03, "{x}: {} {expected}", found[0]);
    }
}

/// Poses of a grid that would leave less by more than a step: none is free with a way out, but at few sites.
#[test]
fn few_sites_are_left_more_than_a_dense_search_leaves() {
    const STEP: f64 = 0.3;
    const LESS: f64 = 0.05;
    let profiles = [
        Profile::t_slot(6.0, 4.0, 0.0, 3.0),
        Profile::lollipop(4.5, 3.0),
        Profile::dovetail(7.0, 30f64.to_radians(), 5.0, 3.0),
        "0:0 3:3@0:3 3:6 | 2:6 2:30 4:34 4:40".parse(),
    ];
    let mesh = t_slotted();
    let bounds = mesh.bounds().unwrap();
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let options = SurfaceOptions { refinement: None, ..SurfaceOptions::default() };
    let sites = sample(&mesh, &SiteOptions { n_sites: 200, ..SiteOptions::default() }).unwrap();
    let directions = Directions::up();
    let (mut n_sites, mut n_worse) = (0, 0);
    for profile in profiles {
        let cutter = held(profile.unwrap());
        let profile = cutter.profile().unwrap();
        let labels = obstacles.surface_labels(&sites, &cutter, &directions, &options).unwrap();
        let reached = |i: &usize| labels.answers[*i] == SiteAnswer::Accessible;
        let inside = |i: &usize| sites.points[*i].z > 9.0;
        let which: Vec<usize> = (0..sites.len()).filter(|i| !reached(i) && inside(i)).collect();
        let of = (&sites, &which[..]);
        let (found, poses) = obstacles.rests(of, &cutter, &directions, &options).unwrap();
        let outline = Outline::new(&cutter, options.finish_mm);
        let tolerances =
            options.tolerance.of_triangles(&outline, &obstacles.chords, &obstacles.bvh).unwrap();
        let tool = ProfileTool::new(&obstacles.bvh, &tolerances, profile, options.finish_mm);
        let any = AnyTool::new(&tool, profile, 0.9 * tolerances.least);
        let frame = Frame::along(Vec3::Z);
        for &i in &which {
            let (from, along) = (sites.points[i].as_dvec3(), sites.normals[i].as_dvec3());
            let line = Line { from, along, length: obstacles.length(from, along, bounds.into()) };
            let rest = f64::from(found[i]);
            if let Some(pose) = &poses[i] {
                assert!(tool.is_free_with_retreat(pose), "{from}: {pose:?}");
            } else {
                assert_eq!(rest as f32, line.length as f32);
            }
            n_sites += 1;
            n_worse += usize::from(dense_of_any(&any, &line, &frame, (rest - LESS, STEP)));
        }
    }
    assert!(n_sites > 100 && n_worse * 20 <= n_sites, "{n_worse} of {n_sites}");
}

/// Whether some pose of a grid leaves less than this.
fn dense_of_any(any: &AnyTool, line: &Line, frame: &Frame, (below, step): (f64, f64)) -> bool {
    let middle = line.from + line.along * (0.5 * below.max(0.0));
    let n = ((7.0 + 0.5 * line.length.min(10.0)) / step).ceil() as i32;
    let of = |k: i32| f64::from(k) * step;
    (-n..=n).any(|z| {
        (-n..=n).any(|y| {
            (-n..=n).any(|x| {
                let tip = middle + DVec3::new(of(x), of(y), of(z) - 2.0);
                any.leaves_less(line, frame, tip, below)
            })
        })
    })
}

/// From above: an end mill makes the slot and the middle of what is below. Behind each lip 5 mm are left, of which a
/// cutter of radius 6 on a neck of radius 3 reaches 3.
#[test]
fn a_t_slot_cutter_machines_below_the_lips_what_an_end_mill_leaves() {
    let mesh = t_slotted();
    let up = Directions::up();
    let end_mill = held("4:0 4:40 | 4:60".parse().unwrap());
    let t_slot = held(Profile::t_slot(6.0, 4.0, 0.0, 3.0).unwrap());
    let [below, reached] = [5.0, 3.0].map(|wide| 2.0 * wide * 8.0 * 60.0);
    for accuracy in [0.5, 0.3] {
        let near =
            |found: f64, expected: f64| (found - expected).abs() < 0.15 * accuracy * expected;
        let found = machine(&mesh, &[&end_mill], &up, accuracy);
        assert!(near(left(&found), below), "{}", left(&found));
        let found = machine(&mesh, &[&end_mill, &t_slot], &up, accuracy);
        assert!(near(left(&found), below - reached), "{}", left(&found));
        // The order of tools does not matter for what is left in the end.
        let other = machine(&mesh, &[&t_slot, &end_mill], &up, accuracy);
        assert!((left(&other) - left(&found)).abs() < 1e-6 * left(&found));
        // Too high, or with a neck that does not fit.
        for wrong in [Profile::t_slot(6.0, 8.2, 0.0, 3.0), Profile::t_slot(6.0, 4.0, 0.0, 5.2)] {
            let found = machine(&mesh, &[&end_mill, &held(wrong.unwrap())], &up, accuracy);
            assert!(left(&found) > below - 0.2 * reached, "{}", left(&found));
        }
    }
}

#[test]
fn a_neck_does_not_pass_through_what_is_left_of_the_slot() {
    // Alone, the cutter is as wide as the slot is not: what is above stays, and its neck would be in that.
    let (mesh, up) = (t_slotted(), Directions::up());
    let t_slot = held(Profile::t_slot(6.0, 4.0, 0.0, 3.0).unwrap());
    let found = machine(&mesh, &[&t_slot], &up, 0.5);
    let [slot, below] = [10.0 * 12.0 * 60.0, 20.0 * 8.0 * 60.0];
    // Removed in the first round, but for the walls: not so with the slot in the way.
    assert!(found.alone_mm3[0] < slot + 0.3 * below, "{}", found.alone_mm3[0]);
    assert!(found.n_rounds > 1 && left(&found) > 0.85 * (slot + below), "{}", left(&found));
}

#[test]
fn a_profile_that_only_widens_machines_what_its_lengths_do() {
    let mesh = pocket();
    let directions = Directions::fibonacci_hemisphere(20).unwrap();
    for (profile, tip) in [
        ("0:0 2:2@0:2 2:9 | 2:60", [2.0, 0.0]),
        ("3:0 3:9 | 3:60", [0.0, 3.0]),
        ("2:0 3:1@2:1 3:9 | 3:60", [1.0, 2.0]),
    ] {
        let [corner_mm, side] = tip;
        let radius = corner_mm + side;
        let holder = [Section { length_mm: 30.0, lower_radius_mm: 20.0, upper_radius_mm: 20.0 }];
        let tip = TipShape::Straight { radius_mm: radius, corner_mm };
        let body = [Section::cylinder(9.0, radius), Section::cylinder(60.0, radius)];
        let lengths = Assembly::new(tip, &body, &holder, 50.0).unwrap().with_flutes(9.0).unwrap();
        let cutters = [held(profile.parse().unwrap()), lengths.cutter().unwrap()];
        let [found, expected] =
            cutters.map(|cutter| left(&machine(&mesh, &[&cutter], &directions, 0.5)));
        assert!((found - expected).abs() <= 0.01 * expected + 0.5, "{profile}: {found} {expected}");
    }
}

#[test]
fn a_saw_leaves_what_is_below_its_disc_beside_an_end_mill() {
    // The slot below is from z = 10 to 18; the cap keeps the disc 2 mm off its floor.
    let (mesh, up) = (t_slotted(), Directions::up());
    let end_mill = held("4:0 4:40 | 4:60".parse().unwrap());
    let saw = held(Profile::saw(6.0, 4.0, [2.0, 2.0], 3.0).unwrap());
    let found = left(&machine(&mesh, &[&end_mill, &saw], &up, 0.5));
    // Behind each lip 5 mm are left by the end mill, of which the disc reaches 3, from z = 12 on.
    let by_hand = 2.0 * 60.0 * (5.0 * 8.0 - 3.0 * 6.0);
    assert!((found - by_hand).abs() < 0.05 * by_hand, "{found} {by_hand}");
}

#[test]
fn what_profiles_leave_does_not_depend_on_threads() {
    let (mesh, up) = (t_slotted(), Directions::up());
    let tools = ["4:0 4:40 | 4:60", "6:0 6:4 3:4 | 3:60"].map(|text| held(text.parse().unwrap()));
    let run = |n: usize| {
        par::with_threads(n, || {
            let machined = machine(&mesh, &[&tools[1], &tools[0]], &up, 0.7);
            machined.bodies.into_iter().map(|body| body.mesh).collect::<Vec<Mesh>>()
        })
        .unwrap()
    };
    let one = run(1);
    assert!(!one.is_empty() && one == run(3));
}
