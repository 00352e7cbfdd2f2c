//! Explanations by hand: what of a profile blocks, and the least change of it.

use super::drilling::{blind_bore, drill};
use super::*;
use crate::access::surface::explain::{
    Change, ChangeKind, Explanation, Query, Remedies, explain_among_points,
};
use crate::access::surface::profile::{Frame, Ladder, PartHeights, ProfileTool};
use crate::tool::cutter::ToolPart;

fn held(profile: Profile, holder: f64, stick_out: f64) -> Assembly {
    Assembly::from_profile(profile, &[Section::cylinder(30.0, holder)], stick_out).unwrap()
}

fn t_slot_cutter(height: f64, neck: f64) -> Profile {
    Profile::t_slot(10.5, height, 0.0, neck).unwrap()
}

fn explain(mesh: &Mesh, tool: &Assembly, (site, normal): ([f32; 3], Vec3)) -> Explanation {
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let (site, up) = (Vec3::from_array(site), Directions::up());
    let options = SurfaceOptions::default();
    let query = Query {
        site,
        normal,
        tool,
        clearance_mm: 0.0,
        directions: &up,
        options: &options,
        witness: None,
        remedies: Remedies::default(),
    };
    let why = obstacles.explain(&query).unwrap();
    let sites = Sites { points: vec![site], normals: vec![normal], ..Sites::default() };
    let reached = |tool: &Assembly| {
        let labels =
            obstacles.surface_labels(&sites, &tool.cutter().unwrap(), &up, &options).unwrap();
        assert_eq!(
            labels.evidence.retreat_unproven[0],
            labels.answers[0] == SiteAnswer::Inaccessible && {
                tool != query.tool || why.retreat_unproven()
            }
        );
        labels.answers[0]
    };
    assert_eq!(why.answer, reached(tool));
    for change in &why.changes {
        assert_eq!(reached(&change.tool), SiteAnswer::Accessible, "{change:?}");
    }
    why
}

fn change(why: &Explanation, kind: ChangeKind) -> &Change {
    let found = why.changes.iter().find(|change| change.kind == kind);
    found.unwrap_or_else(|| panic!("{kind:?} is none of {:?}", why.changes))
}

/// Of the T-slot, on the floor below the mouth, and on the wall below a lip.
const FLOOR: ([f32; 3], Vec3) = ([0.0, -20.0, 19.0], Vec3::Z);
const WALL: ([f32; 3], Vec3) = ([10.6, -20.0, 23.5], Vec3::NEG_X);

#[test]
fn a_neck_too_wide_for_the_lips_blocks_and_a_thinner_one_helps() {
    let why = explain(&t_slot(), &held(t_slot_cutter(8.9, 5.6), 20.0, 60.0), WALL);
    assert_eq!((why.answer, why.blocked_by()), (SiteAnswer::Inaccessible, Some(ToolPart::Shank)));
    // The axis is 10.6 − 10.51 beside the middle, the lip 5.5; less the tolerance of 0.01.
    let blocked = why.nearest().unwrap().blocked.unwrap();
    assert!((blocked.penetration_mm - 0.18).abs() < 2e-3, "{blocked:?}");
    assert!((blocked.at_mm.x - 5.5).abs() < 0.01 && blocked.at_mm.z > 27.9, "{blocked:?}");
    let thinner = change(&why, ChangeKind::Narrow(ToolPart::Shank));
    assert!((thinner.by_mm - 0.18).abs() < 0.011, "{thinner:?}");
    let neck = thinner.tool.profile().unwrap().radius_at(20.0);
    assert!((neck - (5.6 - thinner.by_mm)).abs() < 1e-9);
    assert_eq!(why.changes.len(), 1, "{:?}", why.changes);
    let nearest = why.nearest_pose.unwrap();
    assert!((nearest.pose.tip_mm.x - 0.09).abs() < 1e-3, "{nearest:?}");
    assert!((nearest.shrink_mm - 0.18).abs() < 2e-3, "{nearest:?}");
}

#[test]
fn a_holder_that_is_too_low_needs_the_missing_stick_out_or_a_thinner_holder() {
    // The block is 40 high; the tool is 0.01 above the floor at 19, and may be 0.01 in the block.
    let why = explain(&t_slot(), &held(t_slot_cutter(8.9, 4.0), 20.0, 15.0), FLOOR);
    assert_eq!((why.answer, why.blocked_by()), (SiteAnswer::Inaccessible, Some(ToolPart::Holder)));
    let blocked = why.nearest().unwrap().blocked.unwrap();
    assert!((blocked.penetration_mm - 5.98).abs() < 2e-3, "{blocked:?}");
    let longer = change(&why, ChangeKind::Raise(ToolPart::Holder));
    assert!((longer.by_mm - 5.98).abs() < 0.011 && longer.is_least, "{longer:?}");
    // No holder is thinner than what cuts, and the mouth is.
    assert_eq!(why.changes.len(), 1, "{:?}", why.changes);
    // Between walls that are 30 apart it helps.
    let half = [[40.0, 0.0], [40.0, 40.0], [15.0, 40.0], [15.0, 10.0]];
    let other = half.iter().rev().map(|[x, z]| [-x, *z]);
    let outline: Vec<[f64; 2]> = half.iter().copied().chain(other).collect();
    let slot = drawn_along_y(&outline, 40.0);
    let tool = held("6:0 6:3 3:3 | 3:20 6:20".parse().unwrap(), 20.0, 22.0);
    let why = explain(&slot, &tool, ([0.0, -20.0, 10.0], Vec3::Z));
    let blocked = why.nearest().unwrap().blocked.unwrap();
    assert_eq!(blocked.part, ToolPart::Holder);
    // Any place of the disc touches: the axis is up to 6 from the middle, or in it.
    let thinner = change(&why, ChangeKind::Narrow(ToolPart::Holder));
    assert!((4.9..=5.1).contains(&thinner.by_mm), "{thinner:?}");
    let longer = change(&why, ChangeKind::Raise(ToolPart::Holder));
    assert!((longer.by_mm - 7.98).abs() < 0.011, "{longer:?}");
}

#[test]
fn a_cutter_that_is_too_high_is_blocked_by_its_tip_and_a_smaller_one_fits() {
    let why = explain(&t_slot(), &held(t_slot_cutter(9.2, 5.0), 20.0, 60.0), FLOOR);
    assert_eq!((why.answer, why.blocked_by()), (SiteAnswer::TipDoesNotFit, Some(ToolPart::Tip)));
    let blocked = why.nearest().unwrap().blocked.unwrap();
    assert!((blocked.penetration_mm - 0.2).abs() < 2e-3, "{blocked:?}");
    assert!((blocked.at_mm.z - 28.0).abs() < 0.25, "{blocked:?}");
    // 21 · 9/9.2 = 20.54, of which 20 is sold.
    let smaller = change(&why, ChangeKind::Diameter);
    assert_eq!((smaller.by_mm, why.changes.len()), (1.0, 1), "{smaller:?}");
    let words = smaller.words(&held(t_slot_cutter(9.2, 5.0), 20.0, 60.0));
    assert!(words.contains("20 instead of 21 mm"), "{words}");
}

#[test]
fn a_closed_slot_is_free_without_a_way_out() {
    let mesh = closed_t_slot();
    let tool = held(t_slot_cutter(8.9, 5.0), 20.0, 60.0);
    let why = explain(&mesh, &tool, WALL);
    assert_eq!((why.answer, why.blocked_by()), (SiteAnswer::Inaccessible, None));
    assert!(why.retreat_unproven());
    let nearest = why.nearest().unwrap();
    assert_eq!((nearest.reason(), nearest.blocked), (Some("no proven way out"), None));
    assert_eq!((nearest.is_free(), nearest.clearance_mm), (false, 0.0));
    assert_eq!(why.nearest_pose.unwrap().shrink_mm, 0.0);
    assert!(why.changes.iter().all(|change| change.kind == ChangeKind::Diameter));
    // Open at its ends it is left through them.
    let why = explain(&t_slot(), &tool, WALL);
    assert_eq!((why.answer, why.nearest(), why.nearest_pose), (SiteAnswer::Accessible, None, None));
    let witness = why.witness.unwrap();
    // It is lowered until its lower face is on the floor, 0.01 mm in it.
    let expected = witness.tip_mm.unwrap().z - 18.99;
    assert!((witness.margin_mm - expected).abs() < 1e-3, "{witness:?}");
}

#[test]
fn a_drill_needs_its_stick_out_and_the_diameter_of_the_bore() {
    let mesh = blind_bore();
    let (sin, cos) = (std::f64::consts::PI / 64.0).sin_cos();
    // In the middle of a facet.
    let at = |z: f64| [2.5 * cos * cos, 2.5 * cos * sin, z].map(|x| x as f32);
    let normal = -dvec3(cos, sin, 0.0).as_vec3();
    let why = explain(&mesh, &held(drill(2.5, 118.0), 20.0, 8.0), (at(16.0), normal));
    assert_eq!((why.answer, why.blocked_by()), (SiteAnswer::Inaccessible, Some(ToolPart::Holder)));
    // Its cone is 1.502 high: with the edge of that at the site it is deep enough.
    let longer = change(&why, ChangeKind::Raise(ToolPart::Holder));
    let expected = 30.0 - 0.01 - (16.0 - 2.5 / 59f64.to_radians().tan()) - 8.0;
    assert!((longer.by_mm - expected).abs() < 0.02, "{expected} {longer:?}");

    let thin = held(drill(2.3, 118.0), 20.0, 50.0);
    let why = explain(&mesh, &thin, (at(20.0), normal));
    assert_eq!((why.answer, why.blocked_by()), (SiteAnswer::TipDoesNotFit, Some(ToolPart::Tip)));
    assert_eq!(why.nearest().unwrap().reason(), Some("no bore of its own diameter"));
    let wider = change(&why, ChangeKind::Diameter);
    assert!((wider.by_mm - 0.4).abs() < 1e-9, "{wider:?}");

    let wide = held(drill(2.6, 118.0), 20.0, 50.0);
    let why = explain(&mesh, &wide, (at(20.0), normal));
    let blocked = why.nearest().unwrap().blocked.unwrap();
    assert!(blocked.part == ToolPart::Tip && blocked.penetration_mm > 0.08, "{blocked:?}");
    let thinner = change(&why, ChangeKind::Diameter);
    assert!((thinner.by_mm - 0.2).abs() < 1e-9, "{thinner:?}");
}

#[test]
fn points_as_obstacles_are_refused() {
    let tool = held(t_slot_cutter(8.9, 5.0), 20.0, 60.0);
    let query = Query {
        site: Vec3::ZERO,
        normal: Vec3::Z,
        tool: &tool,
        clearance_mm: 0.0,
        directions: &Directions::up(),
        options: &SurfaceOptions::default(),
        witness: None,
        remedies: Remedies::default(),
    };
    let refused = explain_among_points(&[Vec3::ZERO], Some(0), &query).unwrap_err().to_string();
    assert!(refused.contains("profile") && refused.contains("label against a mesh"), "{refused}");
}

#[test]
fn answers_are_those_of_labels_over_a_set_and_what_the_part_suggests() {
    let mesh = t_slot();
    let sites = sites_on(&mesh, 3, |p, _| p.z > 18.0);
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let directions = Directions::new(DirectionSet::FibonacciHemisphere { n_dirs: 12 }).unwrap();
    let options = SurfaceOptions::default();
    let tool = held("6:0 6:3 3:3 | 3:20 6:20".parse().unwrap(), 20.0, 24.0);
    let cutter = tool.cutter().unwrap();
    let labels = obstacles.surface_labels(&sites, &cutter, &directions, &options).unwrap();
    let mut counts = [0; 3];
    for i in (0..sites.len()).step_by(5) {
        let query = Query {
            site: sites.points[i],
            normal: sites.normals[i],
            tool: &tool,
            clearance_mm: 0.0,
            directions: &directions,
            options: &options,
            witness: None,
            remedies: Remedies { only_this_tool: true, ..Remedies::default() },
        };
        let why = obstacles.explain(&query).unwrap();
        assert_eq!(
            (why.answer, why.retreat_unproven()),
            (labels.answers[i], labels.evidence.retreat_unproven[i])
        );
        let witness = why.witness.map(|witness| (witness.direction, witness.tip_mm.unwrap()));
        assert_eq!(witness, labels.evidence.witness[i].map(|pose| (pose.direction, pose.tip_mm)));
        assert_eq!(why.directions.iter().any(|state| state.is_free()), witness.is_some());
        counts[why.answer as usize] += 1;
        for state in why.directions.iter().filter(|state| state.blocked.is_some()) {
            let blocked = state.blocked.unwrap();
            assert!(blocked.penetration_mm > 0.0 && state.clearance_mm <= -blocked.penetration_mm);
        }
    }
    assert!(counts.iter().filter(|n| **n > 0).count() > 1, "{counts:?}");
}

#[test]
fn the_greatest_depth_is_that_of_the_deepest_of_many_points() {
    let mut stream = Stream::new(7, 0, 0, Purpose::Probe);
    let frame = Frame::along(Vec3::Z);
    let parts = PartHeights { holder: 25.0, spindle: 55.0 };
    let mut n = 0;
    for profile in families() {
        let tool = held(profile, 12.0, 25.0);
        let cutter = tool.cutter().unwrap();
        let profile = cutter.profile().unwrap();
        let outline = Outline::new(profile);
        for size in [2.0, 2.0, 5.0, 12.0, 12.0, 25.0, 60.0, 60.0] {
            let corners = random_triangle(&mut stream, size);
            let mesh = Mesh { vertices: corners.to_vec(), triangles: vec![[0, 1, 2]] };
            let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
            let site =
                Sites { points: vec![Vec3::ZERO], normals: vec![Vec3::Z], ..Sites::default() };
            let options = SurfaceOptions::default();
            let problem = obstacles.problem(Queries::Sites(&site), &cutter, &options).unwrap();
            let tool = ProfileTool::new(&obstacles.bvh, &problem.tolerances, profile, 0.01);
            let ladder = Ladder::new(&tool, profile, parts);
            let found = ladder.exactly(&tool, &frame, DVec3::ZERO);
            let rough = ladder.depth_within(&tool, &frame, DVec3::ZERO, f64::INFINITY);
            let (mut most, n_cells) = (-1.0f64, 200);
            for i in 0..=n_cells {
                for j in 0..=n_cells - i {
                    let [u, v] = [i, j].map(|k| f64::from(k) / f64::from(n_cells));
                    let p =
                        corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
                    most = most.max(outline.depth(p).mm - 0.01);
                }
            }
            let spacing = corners.iter().map(|p| p.distance(corners[0])).fold(0.0, f64::max)
                / f64::from(n_cells);
            assert_eq!(found.is_some(), rough.is_some());
            let Some((_, deepest, depth)) = found else {
                assert!(most < 1e-3, "{profile} {corners:?}: {most}");
                continue;
            };
            n += 1;
            assert!(
                (most - 1e-3..most + spacing + 1e-3).contains(&depth),
                "{profile}: {depth} {most}"
            );
            let rough = rough.unwrap();
            let near = rough <= depth + 1e-3 && depth <= 1.06 * (rough + 0.01);
            assert!(near, "{profile} {corners:?}: {rough} {depth}");
            assert!(deepest.mm <= depth && outline.depth(deepest.point).mm >= deepest.mm);
        }
    }
    assert!(n > 20, "{n}");
}

fn blocking(mesh: &Mesh, tool: &Assembly, sites: &Sites, clearance: f64) -> Vec<Option<ToolPart>> {
    let (obstacles, up) = (TriangleObstacles::new(mesh, &[]).unwrap(), Directions::up());
    let options = SurfaceOptions::default();
    let cutter = tool.with_clearance(clearance).unwrap().cutter().unwrap();
    let labels = obstacles.surface_labels(sites, &cutter, &up, &options).unwrap();
    let (held, answers) = ((tool, clearance), &labels.answers[..]);
    let found = obstacles.blocking_parts(sites, held, &up, (&options, answers)).unwrap();
    // Labels that know where no way out is proven give the same.
    let known = (&options, answers, &labels.evidence.retreat_unproven[..]);
    assert_eq!(obstacles.blocking_parts_of(sites, held, &up, known).unwrap(), found);
    for (i, part) in found.iter().enumerate() {
        let expected = match answers[i] {
            SiteAnswer::Accessible => part.is_none(),
            SiteAnswer::TipDoesNotFit => *part == Some(ToolPart::Tip),
            SiteAnswer::Inaccessible => part.is_none() == labels.evidence.retreat_unproven[i],
        };
        assert!(expected, "{part:?} {:?}", answers[i]);
    }
    found
}

#[test]
fn every_site_has_the_part_without_which_the_tool_fits() {
    let mesh = t_slot();
    let of = |(site, normal): ([f32; 3], Vec3), tool: &Assembly, clearance: f64| {
        let points = vec![Vec3::from_array(site)];
        let sites = Sites { points, normals: vec![normal], ..Sites::default() };
        blocking(&mesh, tool, &sites, clearance)[0]
    };
    let neck = held(t_slot_cutter(8.9, 5.6), 20.0, 60.0);
    assert_eq!(of(WALL, &neck, 0.0), Some(ToolPart::Shank));
    // A margin alone widens the neck beyond the mouth.
    let slim = held(t_slot_cutter(8.9, 5.0), 20.0, 60.0);
    assert_eq!([0.0, 0.7].map(|by| of(WALL, &slim, by)), [None, Some(ToolPart::Shank)]);
    let holder = held(t_slot_cutter(8.9, 4.0), 20.0, 15.0);
    assert_eq!(of(FLOOR, &holder, 0.0), Some(ToolPart::Holder));
    // A holder that passes the mouth, 5 high: the spindle begins 20 above the tip, the mouth ends 21 above the floor.
    let short = [Section::cylinder(5.0, 5.2)];
    let spindle = Assembly::from_profile(t_slot_cutter(8.9, 4.0), &short, 15.0).unwrap();
    assert_eq!(of(FLOOR, &spindle, 0.0), Some(ToolPart::Spindle));
    // Neck and holder both: without the holder the neck still blocks.
    let both = held(t_slot_cutter(8.9, 5.6), 20.0, 15.0);
    assert_eq!(of(WALL, &both, 0.0), Some(ToolPart::Shank));
    assert_eq!(of(FLOOR, &held(t_slot_cutter(9.2, 5.0), 20.0, 60.0), 0.0), Some(ToolPart::Tip));
    // All of the undercut, but where the tip may be so high that the holder is above the block.
    let sites = sites_on(&mesh, 8, |p, n| undercut(p, n) && (p.z < 24.9 || n.z < -0.9));
    for (tool, part) in [(&neck, ToolPart::Shank), (&holder, ToolPart::Holder)] {
        let found = blocking(&mesh, tool, &sites, 0.0);
        assert!(found.len() > 20);
        let others = found.iter().filter(|found| **found != Some(part)).count();
        assert_eq!(others, 0, "{part} {found:?}");
    }
}

#[test]
fn what_has_no_way_out_is_blocked_by_no_part_and_a_drill_by_its_holder() {
    // A cave as wide as the ball and its neck, closed above but for a chimney that the neck passes.
    let inner = [[2.0, 40.0], [2.0, 20.0], [6.0, 20.0], [6.0, 5.0], [0.0, 5.0]];
    let cave = revolved(&[&[[0.0, 0.0], [20.0, 0.0], [20.0, 40.0]][..], &inner].concat(), 48);
    // The tip is at the site, and the chimney 0.5 wider than the neck.
    let is_below = |p: DVec3, n: DVec3| n.z > 0.9 && p.z < 6.0 && p.truncate().length() < 0.4;
    let sites = sites_on(&cave, 40, is_below);
    let ball = Profile::lollipop(4.0, 1.5).unwrap().with_shank(&[[1.5, 90.0]]).unwrap();
    let found = blocking(&cave, &held(ball, 20.0, 80.0), &sites, 0.0);
    assert!(!found.is_empty() && found.iter().all(Option::is_none), "{found:?}");
    let mesh = blind_bore();
    let walls = sites_on(&mesh, 4, |p, n| p.truncate().length() < 2.6 && n.z.abs() < 0.1);
    let low: Vec<usize> = (0..walls.len()).filter(|&i| walls.points[i].z < 20.0).collect();
    let found = blocking(&mesh, &held(drill(2.5, 118.0), 20.0, 8.0), &walls.subset(&low), 0.0);
    assert!(!found.is_empty() && found.iter().all(|part| *part == Some(ToolPart::Holder)));
}
