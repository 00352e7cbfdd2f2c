//! Clearance is about what does not cut, allowance about what does: answers by hand.

use super::*;
use crate::tool::cutter::Step;

fn step(height_mm: f64, radius_mm: f64) -> Step {
    Step { height_mm, radius_mm }
}

/// A ball of radius 3 with a neck or shank from `flutes` above the tip, then a holder of radius 20 from 60 on.
fn long_tool(flutes: f64, shank: f64) -> Cutter {
    let upper = vec![step(flutes - 3.0, shank), step(57.0, 20.0), step(97.0, f64::INFINITY)];
    Cutter::from_parts([3.0, 0.0], vec![step(3.0, 3.0)], upper).unwrap()
}

fn is_reached(labels: &SurfaceLabels) -> Vec<bool> {
    labels.answers.iter().map(|answer| *answer == SiteAnswer::Accessible).collect()
}

#[test]
fn walls_of_a_plain_block_stay_reached_whatever_the_clearance() {
    let block = solids::cuboid(dvec3(40.0, 30.0, 20.0));
    let sites = everywhere(&block, 40);
    for clearance in [0.0, 0.1, 0.5, 1.0, 4.0] {
        for corner in [0.0, 1.0, 3.0] {
            let cutter = bull([3.0, 40.0, 25.0, 40.0], corner).with_clearance(clearance).unwrap();
            let labels = label(&block, &sites, &cutter, &up(), &exactly(0.01));
            for (normal, is_reached) in sites.normals.iter().zip(is_reached(&labels)) {
                assert_eq!(is_reached, normal.z > -0.5, "{clearance} {corner} {normal}");
            }
        }
    }
}

#[test]
fn a_shank_as_wide_as_the_flutes_rubs_above_them_and_a_relieved_neck_does_not() {
    // A slot 10 wide and 15 deep; the flutes are 9 long.
    let mesh = slotted(10.0, 15.0);
    let walls = sites_on(&mesh, 60, |p, n| n.x.abs() > 0.9 && p.x.abs() < 6.0);
    let reached =
        |cutter: &Cutter| is_reached(&label(&mesh, &walls, cutter, &up(), &exactly(0.01)));
    assert!(reached(&long_tool(9.0, 3.0)).iter().zip(&walls.points).all(|(r, p)| *r || p.z < 8.5));
    for clearance in [0.1, 0.5, 1.0] {
        let rubs = reached(&long_tool(9.0, 3.0).with_clearance(clearance).unwrap());
        let relieved = reached(&long_tool(9.0, 1.9).with_clearance(clearance).unwrap());
        for (i, p) in walls.points.iter().enumerate() {
            // The ball's middle is beside the site, the shank begins 6 - c above it, the wall ends at 20.
            let wall_above = 20.0 - f64::from(p.z);
            if p.z > 8.5 {
                assert!(relieved[i], "{clearance} {p}");
                // The ball may be a little beside and higher.
                if (wall_above - (6.0 - clearance)).abs() > 0.5 {
                    assert_eq!(rubs[i], wall_above < 6.0 - clearance, "{clearance} {p}");
                }
            }
        }
        assert!(rubs.contains(&true) && rubs.contains(&false));
    }
}

#[test]
fn a_holder_keeps_its_clearance_from_a_step() {
    // A floor at 5 beside walls at x = ±15 that end at 20; the holder, 8 in radius, begins 15.5 above the tip.
    let mesh = slotted(30.0, 15.0);
    let floor = sites_on(&mesh, 80, |p, n| n.z > 0.5 && p.z < 19.0);
    let cutter = ball([3.0, 9.5, 8.0, 40.0]);
    for (clearance, nearest) in [(0.0, 3.0), (0.4, 3.0), (1.0, 9.0), (2.0, 10.0)] {
        let cutter = cutter.with_clearance(clearance).unwrap();
        let reached = is_reached(&label(&mesh, &floor, &cutter, &up(), &exactly(0.01)));
        for (p, is_reached) in floor.points.iter().zip(reached) {
            let from_wall = 15.0 - f64::from(p.x.abs());
            if (from_wall - nearest).abs() > 0.4 {
                assert_eq!(is_reached, from_wall > nearest, "{clearance} {p}");
            }
        }
    }
}

#[test]
fn a_pose_that_is_free_with_clearance_is_free_with_less() {
    let mesh = solids::torus(9.0, 4.0, 30, 16);
    let sites = everywhere(&mesh, 1);
    for tool in [long_tool(4.0, 3.0), long_tool(8.0, 2.5), ball([1.0, 6.0, 4.0, 3.0])] {
        let margins = [0.0, 0.05, 0.3, 1.0, 3.0].map(|c| tool.with_clearance(c).unwrap());
        for (k, cutter) in margins.iter().enumerate() {
            let labels = label(&mesh, &sites, cutter, &hemisphere(60), &exactly(0.01));
            for pose in labels.evidence.witness.iter().flatten() {
                let axis = pose.direction.as_dvec3().normalize();
                let reference = pose.tip_mm + axis * cutter.corner_mm();
                for less in &margins[..=k] {
                    let found = raise(&mesh, less, 0.01, reference, pose.direction).unwrap();
                    assert!(found.steps.max(found.tip) <= 1e-9, "{k} {found:?}");
                }
            }
        }
    }
}

#[test]
fn an_allowance_keeps_what_cuts_off_the_surface() {
    // Ball and flat end of radius 3 in slots: both need 2·(3 + 0.5) mm.
    for corner in [0.0, 1.0, 3.0] {
        let plain = bull([3.0, 40.0, 25.0, 40.0], corner);
        let cutter = plain.with_allowance(0.5).unwrap();
        for (width, fits) in [(6.9, false), (7.1, true), (9.0, true)] {
            let mesh = slotted(width, 15.0);
            let floor = sites_on(&mesh, 20, |p, n| n.z > 0.5 && p.z < 19.0);
            let mut floor = floor;
            // From beyond the ends of the slot the rim reaches in.
            floor.points.iter_mut().for_each(|p| (p.x, p.y) = (0.0, 0.5 * p.y));
            let labels = label(&mesh, &floor, &cutter, &up(), &exactly(0.01));
            assert!(is_reached(&labels).iter().all(|r| *r == fits), "{corner} {width}");
            for (p, pose) in floor.points.iter().zip(&labels.evidence.witness) {
                // The tip of the tool itself stays off the floor.
                let Some(pose) = pose else { continue };
                let off = pose.tip_mm.z - f64::from(p.z);
                assert!((0.49..0.52).contains(&off), "{corner} {width} {off}");
            }
            let without = label(&mesh, &floor, &plain, &up(), &exactly(0.01));
            assert!(is_reached(&without).iter().all(|r| *r));
        }
    }
}
