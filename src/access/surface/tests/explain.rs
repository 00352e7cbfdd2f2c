//! Explanations: what blocks, and the least change that helps, against labels and known bodies.

use super::*;
use crate::access::surface::explain::{
    Change, ChangeKind, Explanation, Query, Remedies, blocking_parts_among_points,
    explain_among_points,
};
use crate::access::{LabelOptions, Obstacles, label as label_points};
use crate::tool::cutter::{Assembly, Step, ToolPart};

/// The tool of four lengths.
fn held([cr, ch, fr, fh]: [f64; 4]) -> Assembly {
    let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
    let holder = vec![step(0.0, fr), step(fh, f64::INFINITY)];
    Assembly::from_steps([cr, 0.0], vec![step(2.0 * cr, cr)], holder, 2.0 * cr + ch).unwrap()
}

/// A tool with a shank wider than its flutes.
fn stepped() -> Assembly {
    let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
    let body = vec![step(2.0, 1.0), step(6.0, 2.0)];
    let holder = vec![step(0.0, 6.0), step(4.0, 9.0), step(12.0, f64::INFINITY)];
    Assembly::from_steps([1.0, 0.0], body, holder, 10.0).unwrap()
}

#[test]
fn the_pose_nearest_to_being_free_is_named() {
    // A slot 6 wide, its floor at 5; ball and flat end are 0.1 mm too wide on either side.
    let obstacles = TriangleObstacles::new(&slotted(6.0, 15.0), &[]).unwrap();
    for (corner, x) in [(3.1, 0.0f32), (0.0, 0.0), (0.0, 1.0)] {
        let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
        let holder = vec![step(0.0, 20.0), step(20.0, f64::INFINITY)];
        let end = [corner, 3.1 - corner];
        let tool = Assembly::from_steps(end, vec![step(6.2, 3.1)], holder, 60.0).unwrap();
        let (directions, options) = (up(), exactly(0.01));
        let site = (Vec3::new(x, 0.5, 5.0), Vec3::Z);
        let why = obstacles.explain(&query(site, &tool, &directions, &options)).unwrap();
        assert!(why.answer != SiteAnswer::Accessible);
        let nearest = why.nearest_pose.unwrap();
        // In the middle of the slot, wherever in it the flat end touches; within the finish tolerance of the floor.
        let tip = nearest.pose.tip_mm;
        assert!((nearest.shrink_mm - 0.09).abs() < 0.02, "{corner} {x} {nearest:?}");
        assert!(tip.x.abs() < 0.02 && (tip.z - 5.0).abs() < 0.03, "{corner} {x} {nearest:?}");
        assert_eq!(nearest.pose.direction, Vec3::Z);
    }
    let tool = held([2.0, 60.0, 20.0, 20.0]);
    let (directions, options) = (up(), exactly(0.01));
    let free = query(floor_site(5.0), &tool, &directions, &options);
    assert_eq!(obstacles.explain(&free).unwrap().nearest_pose, None);
}

fn floor_site(z: f32) -> (Vec3, Vec3) {
    (Vec3::new(0.0, 0.5, z), Vec3::Z)
}

fn query<'a>(
    (site, normal): (Vec3, Vec3),
    tool: &'a Assembly,
    directions: &'a Directions,
    options: &'a SurfaceOptions,
) -> Query<'a> {
    let remedies = Remedies::default();
    Query { site, normal, tool, clearance_mm: 0.0, directions, options, witness: None, remedies }
}

fn change(why: &Explanation, kind: ChangeKind) -> &Change {
    let found = why.changes.iter().find(|change| change.kind == kind);
    found
        .unwrap_or_else(|| panic!("{kind:?} {:?} {:?} {:?}", why.answer, why.counts(), why.changes))
}

fn one((point, normal): (Vec3, Vec3)) -> Sites {
    Sites { points: vec![point], normals: vec![normal], faces: vec![] }
}

#[test]
fn a_holder_too_wide_for_a_slot_is_named_and_the_stated_amount_helps_but_no_less() {
    let (mesh, site) = (slotted(10.0, 18.0), floor_site(2.0));
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let (up, options) = (up(), exactly(0.01));
    let tool = held([1.5, 6.0, 40.0, 5.0]);
    let why = obstacles.explain(&query(site, &tool, &up, &options)).unwrap();
    assert_eq!((why.answer, why.witness), (SiteAnswer::Inaccessible, None));
    assert_eq!((why.blocked_by(), why.counts()), (Some(ToolPart::Holder), [0, 0, 0, 1, 0]));
    let blocked = why.nearest().unwrap().blocked.unwrap();
    // Walls of 18 mm, the nose 9 mm above the tip.
    assert!((blocked.penetration_mm - 8.99).abs() < 1e-9, "{blocked:?}");
    assert!((blocked.at_mm.z - 20.0).abs() < 1e-9 && blocked.at_mm.x.abs() >= 5.0 - 1e-9);
    assert!(mesh.corners(blocked.face as usize).iter().any(|p| p.z == 20.0));
    let longer = change(&why, ChangeKind::Raise(ToolPart::Holder));
    assert!((longer.by_mm - 8.99).abs() < 2e-4 && longer.is_least, "{longer:?}");
    // The spindle is in the way too: no holder is thin enough.
    assert!(!why.changes.iter().any(|c| matches!(c.kind, ChangeKind::Narrow(_))));
    let reaches = |tool: &Assembly| {
        let labels =
            obstacles.surface_labels(&one(site), &tool.cutter().unwrap(), &up, &options).unwrap();
        labels.answers[0] == SiteAnswer::Accessible
    };
    assert!(
        reaches(&longer.tool) && reaches(&tool.raised(ToolPart::Holder, longer.by_mm).unwrap())
    );
    assert!(!reaches(&tool.raised(ToolPart::Holder, longer.by_mm - 0.02).unwrap()));

    let tool = held([1.5, 6.0, 40.0, 20.0]);
    let why = obstacles.explain(&query(site, &tool, &up, &options)).unwrap();
    let thinner = change(&why, ChangeKind::Narrow(ToolPart::Holder));
    assert!((thinner.by_mm - 34.99).abs() < 2e-4 && thinner.is_least, "{thinner:?}");
    assert!(reaches(&thinner.tool));
    assert!(!reaches(&tool.narrowed(ToolPart::Holder, thinner.by_mm - 0.02).unwrap()));
    assert_eq!(why.changes[0].kind, ChangeKind::Raise(ToolPart::Holder), "the least first");
}

#[test]
fn every_part_is_named_with_what_helps() {
    let (up, options) = (up(), exactly(0.01));
    let ask = |width, depth, tool: &Assembly| {
        let obstacles = TriangleObstacles::new(&slotted(width, depth), &[]).unwrap();
        let site = floor_site(20.0 - depth as f32);
        obstacles.explain(&query(site, tool, &up, &options)).unwrap()
    };
    // Below the flutes' contact only the ball meets the walls.
    let why = ask(2.0, 2.0, &held([1.5, 6.0, 4.0, 30.0]));
    assert_eq!((why.answer, why.blocked_by()), (SiteAnswer::TipDoesNotFit, Some(ToolPart::Tip)));
    let [smaller] = &why.changes[..] else { panic!("{:?}", why.changes) };
    assert_eq!((smaller.kind, smaller.longer_mm), (ChangeKind::Diameter, 0.0));
    let end = 2.0 * smaller.tool.tip()[0];
    assert!((2.0..=2.02 + 1e-9).contains(&end), "a ball of 2 mm and twice the tolerance: {end}");

    let why = ask(2.0, 12.0, &held([1.5, 2.0, 10.0, 30.0]));
    assert_eq!(why.blocked_by(), Some(ToolPart::Cutter));
    let [smaller] = &why.changes[..] else { panic!("{:?}", why.changes) };
    assert!((smaller.longer_mm - 6.99).abs() < 1e-3, "{smaller:?}");
    assert_eq!(smaller.words(&held([1.5, 2.0, 10.0, 30.0])).split(' ').next(), Some("cutter"));

    let why = ask(3.0, 8.0, &stepped());
    assert_eq!(why.blocked_by(), Some(ToolPart::Shank));
    // The shank begins 6 mm above the tip and is 2 mm wide; the slot has 1.5.
    let thinner = change(&why, ChangeKind::Narrow(ToolPart::Shank));
    assert!((thinner.by_mm - 0.49).abs() < 2e-4, "{thinner:?}");
    let longer = change(&why, ChangeKind::Raise(ToolPart::Shank));
    assert!((longer.by_mm - 1.99).abs() < 2e-4, "{longer:?}");

    let why = ask(16.0, 18.0, &held([1.5, 6.0, 7.0, 5.0]));
    assert_eq!(why.blocked_by(), Some(ToolPart::Spindle));
    let longer = change(&why, ChangeKind::Raise(ToolPart::Spindle));
    assert!((longer.by_mm - 3.99).abs() < 2e-4, "{longer:?}");
}

#[test]
fn directions_agree_with_the_plain_loops() {
    let directions = hemisphere(40);
    for (mesh, tolerance) in [(slotted(10.0, 12.0), 0.01), (tube(6.0, 20.0, 30.0, 24), 0.2)] {
        let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
        let sites = everywhere(&mesh, 1);
        let options = exactly(tolerance);
        for tool in [held([1.5, 6.0, 12.0, 5.0]), held([2.0, 20.0, 5.0, 20.0]), stepped()] {
            for i in (0..sites.len()).step_by(7) {
                let site = (sites.points[i], sites.normals[i]);
                let why = obstacles.explain(&query(site, &tool, &directions, &options)).unwrap();
                for state in &why.directions {
                    let reference =
                        site.0.as_dvec3() + site.1.as_dvec3().normalize() * tool.tip()[0];
                    let cutter = tool.cutter().unwrap();
                    let raise =
                        raise(&mesh, &cutter, tolerance, reference, state.direction).unwrap();
                    if raise.steps.abs() < 1e-6 || raise.tip.abs() < 1e-6 {
                        continue;
                    }
                    let blocked = state.blocked.map(|blocked| blocked.part == ToolPart::Tip);
                    let expected = match (raise.steps > 0.0, raise.tip > 0.0) {
                        (true, _) => Some(false),
                        (false, tip) => tip.then_some(true),
                    };
                    assert_eq!(blocked, expected, "site {i} {raise:?} {state:?}");
                    if let Some(blocked) = state.blocked {
                        let most = if expected == Some(true) { raise.tip } else { raise.steps };
                        assert!(
                            blocked.penetration_mm > 0.0 && blocked.penetration_mm <= most + 1e-9
                        );
                    }
                    assert_eq!(state.clearance_mm < 0.0, raise.steps > 0.0, "{raise:?} {state:?}");
                }
                for change in &why.changes {
                    let cutter = change.tool.cutter().unwrap();
                    let one = Sites { points: vec![site.0], normals: vec![site.1], faces: vec![] };
                    let along = list(&[change.direction]);
                    let reached = obstacles.reached_by_drop_heights(
                        &one,
                        &cutter,
                        &along,
                        &options,
                        RESOLUTION_MM,
                    );
                    assert_ne!(reached.unwrap(), [Reached::No], "{change:?}");
                }
            }
        }
    }
}

#[test]
fn the_search_between_directions_lessens_changes() {
    let (mesh, site) = (slotted(10.0, 18.0), floor_site(2.0));
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let tool = held([1.5, 6.0, 40.0, 5.0]);
    let searched =
        SurfaceOptions { refinement: Some(RefinementOptions::default()), ..exactly(0.01) };
    let directions = hemisphere(20);
    let by = |options: &SurfaceOptions| {
        let why = obstacles.explain(&query(site, &tool, &directions, options)).unwrap();
        let longer = change(&why, ChangeKind::Raise(ToolPart::Holder)).clone();
        assert!(longer.is_least);
        longer.by_mm
    };
    assert!(by(&searched) <= by(&exactly(0.01)));
}

#[test]
fn parts_that_block_are_those_of_each_explanation() {
    let directions = hemisphere(30);
    let options = exactly(0.01);
    for (mesh, tool) in [
        (slotted(10.0, 12.0), held([1.5, 6.0, 12.0, 5.0])),
        (slotted(2.5, 9.0), stepped()),
        (slotted(2.5, 2.0), held([1.5, 6.0, 12.0, 5.0])),
    ] {
        let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
        let sites = everywhere(&mesh, 2);
        let cutter = tool.cutter().unwrap();
        let answers =
            obstacles.surface_labels(&sites, &cutter, &directions, &options).unwrap().answers;
        let found = obstacles
            .blocking_parts(&sites, (&tool, 0.0), &directions, (&options, &answers))
            .unwrap();
        for (i, found) in found.iter().enumerate() {
            let site = (sites.points[i], sites.normals[i]);
            let why = obstacles.explain(&query(site, &tool, &directions, &options)).unwrap();
            assert_eq!((why.answer, why.blocked_by()), (answers[i], *found), "site {i}");
        }
        let few = obstacles.blocking_parts(&sites, (&tool, 0.0), &directions, (&options, &[]));
        assert!(few.is_err());
    }
}

#[test]
fn a_witness_is_proved_and_another_side_is_named() {
    let mesh = slotted(10.0, 6.0);
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let (directions, options) = (hemisphere(50), exactly(0.01));
    let tool = held([1.5, 20.0, 3.0, 20.0]);
    let why = obstacles.explain(&query(floor_site(14.0), &tool, &directions, &options)).unwrap();
    let witness = why.witness.unwrap();
    assert!(why.answer == SiteAnswer::Accessible && witness.margin_mm >= 0.0);
    assert!(why.changes.is_empty() && why.blocked_by().is_none() && why.other_direction.is_none());
    let below = (Vec3::new(1.0, 0.5, 0.0), Vec3::NEG_Z);
    let why = obstacles.explain(&query(below, &tool, &directions, &options)).unwrap();
    assert!(why.witness.is_none() && why.other_direction.is_some_and(|d| d.z < 0.0), "{why:?}");
    // A direction that is no witness proves nothing.
    let mut of_site = query(below, &tool, &directions, &options);
    of_site.witness = Some(Vec3::Z);
    assert_eq!(obstacles.explain(&of_site).unwrap().answer, SiteAnswer::Inaccessible);
    of_site.witness = Some(Vec3::NEG_Z);
    assert_eq!(obstacles.explain(&of_site).unwrap().answer, SiteAnswer::Accessible);
}

#[test]
fn points_as_obstacles_are_explained_by_the_published_definition() {
    let mesh = slotted(10.0, 18.0);
    let mut sites = everywhere(&mesh, 40);
    let (point, normal) = floor_site(2.0);
    sites.points.push(point);
    sites.normals.push(normal);
    let own = sites.points.len() - 1;
    let (directions, options) = (hemisphere(40), exactly(0.01));
    let tool = held([1.5, 6.0, 40.0, 5.0]);
    let labels = |tool: &Assembly| {
        let (cutter, options) = (tool.cutter().unwrap(), LabelOptions::default());
        label_points(&sites, Obstacles::Queries, &cutter, &directions, &options).unwrap()
    };
    let found = labels(&tool).answers.inaccessible();
    let parts =
        blocking_parts_among_points(&sites, Obstacles::Queries, (&tool, 0.0), &directions, &found)
            .unwrap();
    for i in (0..sites.points.len()).step_by(29).chain([own]) {
        let of_site = query((sites.points[i], sites.normals[i]), &tool, &directions, &options);
        let why = explain_among_points(&sites.points, Some(i), &of_site).unwrap();
        assert_eq!(why.answer == SiteAnswer::Inaccessible, found[i], "site {i}");
        assert_eq!((why.witness.is_some(), why.blocked_by()), (!found[i], parts[i]), "site {i}");
        for state in why.directions.iter().filter(|state| state.clearance_mm.abs() > 1e-4) {
            assert_eq!(state.blocked.is_some(), state.clearance_mm < 0.0, "{state:?}");
        }
        for change in &why.changes {
            assert!(!labels(&change.tool).answers.inaccessible()[i], "{change:?}");
        }
        if i == own {
            let longer = change(&why, ChangeKind::Raise(ToolPart::Holder));
            let shorter = tool.raised(ToolPart::Holder, longer.by_mm - 1e-3).unwrap();
            assert!(labels(&shorter).answers.inaccessible()[i] && longer.is_least);
        }
    }
}
