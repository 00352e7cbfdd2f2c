//! Many tools in one pass: the answers of each alone, and stick-outs that trial confirms.

use super::*;
use crate::access::surface::ToolReach;
use crate::tool::cutter::{Assembly, Section, TipShape};

fn tool(radius_mm: f64, corner_mm: f64, shank: f64, holder: f64, stick_out: f64) -> Assembly {
    let tip = TipShape::Straight { radius_mm, corner_mm };
    let body = [Section::cylinder(4.0 * radius_mm, radius_mm), Section::cylinder(50.0, shank)];
    let holder = [
        Section { length_mm: 6.0, lower_radius_mm: 0.6 * holder, upper_radius_mm: holder },
        Section::cylinder(10.0, holder),
    ];
    Assembly::new(tip, &body, &holder, stick_out).unwrap()
}

/// Balls, a bull nose and flat ends; bodies and holders are shared, in no order.
fn tools() -> Vec<Assembly> {
    vec![
        tool(1.5, 1.5, 3.0, 9.0, 14.0),
        tool(1.5, 1.5, 1.5, 9.0, 22.0),
        tool(2.0, 0.5, 2.0, 12.0, 12.0),
        tool(1.5, 1.5, 1.5, 9.0, 8.0),
        tool(1.5, 1.5, 1.5, 15.0, 18.0),
        tool(2.0, 0.0, 3.0, 12.0, 25.0),
        tool(2.0, 0.5, 2.0, 12.0, 19.0),
    ]
}

fn part() -> Mesh {
    slotted(7.0, 14.0)
}

fn reach(sites: &Sites, directions: &Directions, options: &SurfaceOptions) -> Vec<ToolReach> {
    let obstacles = TriangleObstacles::new(&part(), &[]).unwrap();
    obstacles.reach_many(sites, &tools(), directions, options).unwrap()
}

#[test]
fn every_tool_has_the_answers_that_it_has_alone() {
    let (sites, directions) = (everywhere(&part(), 12), hemisphere(60));
    let options = exactly(0.01);
    for (tool, reach) in tools().iter().zip(reach(&sites, &directions, &options)) {
        let alone = label(&part(), &sites, &tool.cutter().unwrap(), &directions, &options);
        assert_eq!(reach.answers, alone.answers, "{tool:?}");
        for (i, answer) in reach.answers.iter().enumerate() {
            let is_reached = *answer == SiteAnswer::Accessible;
            assert_eq!(reach.witness[i].is_some(), is_reached);
            assert_eq!(reach.least_stick_out_mm[i] <= tool.stick_out_mm(), is_reached, "{i}");
            assert_eq!(reach.least_stick_out_mm[i].is_finite(), reach.body_reaches[i]);
        }
        assert!(n_of(SiteAnswer::Accessible, &reach.answers) > 20);
        assert!(n_of(SiteAnswer::Inaccessible, &reach.answers) > 20);
    }
}

#[test]
fn the_least_stick_out_is_where_trial_turns() {
    let (sites, directions) = (everywhere(&part(), 10), hemisphere(40));
    let options = exactly(0.01);
    let (mut n_turns, mut n_less, mut n_trials) = (0, 0, 0);
    for (tool, reach) in tools().iter().zip(reach(&sites, &directions, &options)) {
        let least = 2.0 * (tool.tip()[0] + tool.tip()[1]);
        assert!(reach.least_stick_out_mm.iter().all(|length| *length >= least));
        for stick_out in [least + 0.3, 7.5, 11.0, 15.5, 21.0, 60.0] {
            let cutter = tool.at_stick_out(stick_out).unwrap();
            let trial = answers(&part(), &sites, &cutter, &directions, &options);
            for (length, answer) in reach.least_stick_out_mm.iter().zip(&trial) {
                let is_reached = *answer == SiteAnswer::Accessible;
                // Another pose may do with less.
                if (length - stick_out).abs() > 1e-5 {
                    assert!(*length > stick_out || is_reached, "{length} {stick_out}");
                    n_less += usize::from(*length > stick_out && is_reached);
                    n_trials += 1;
                }
            }
        }
        let lengths = &reach.least_stick_out_mm;
        n_turns += lengths.iter().filter(|l| l.is_finite() && **l > least).count();
        // A hair above the least stick-out it is reached.
        for (i, length) in
            lengths.iter().enumerate().filter(|(_, l)| l.is_finite() && **l > least).take(8)
        {
            let one = Sites {
                points: vec![sites.points[i]],
                normals: vec![sites.normals[i]],
                faces: vec![],
            };
            let cutter = tool.at_stick_out(length + 1e-5).unwrap();
            let found = answers(&part(), &one, &cutter, &directions, &options)[0];
            assert_eq!(found, SiteAnswer::Accessible, "{length}");
        }
    }
    assert!(n_turns > 200 && n_less * 50 < n_trials, "{n_turns} {n_less} {n_trials}");
}

#[test]
fn the_least_stick_out_is_that_of_the_pose_farthest_from_a_wall() {
    // A floor between walls at x = ±15 that are 15 high; a flat end of 6 mm in a holder of radius 8.
    let mesh = slotted(30.0, 15.0);
    let tip = TipShape::Straight { radius_mm: 3.0, corner_mm: 0.0 };
    let body = [Section::cylinder(60.0, 3.0)];
    let tool = Assembly::new(tip, &body, &[Section::cylinder(40.0, 8.0)], 40.0).unwrap();
    let points = [6.0, 9.0, 9.6, 10.4, 13.0].map(|x| Vec3::new(x, 0.0, 5.0)).to_vec();
    let sites = Sites { normals: vec![Vec3::Z; points.len()], points, faces: vec![] };
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let reach = obstacles.reach_many(&sites, &[tool], &up(), &exactly(0.01)).unwrap();
    // The axis may be 3 mm farther from the wall than the site: beside it the holder needs 8 mm.
    for (length, expected) in reach[0].least_stick_out_mm.iter().zip([6.0, 6.0, 6.0, 14.99, 14.99])
    {
        assert!((length - expected).abs() < 0.02, "{:?}", reach[0].least_stick_out_mm);
    }
}

#[test]
fn the_search_between_the_directions_finds_what_it_finds_alone() {
    let (sites, directions) = (everywhere(&part(), 10), hemisphere(20));
    let options =
        SurfaceOptions { refinement: Some(RefinementOptions::default()), ..exactly(0.01) };
    for (tool, reach) in tools().iter().zip(reach(&sites, &directions, &options)) {
        let alone = label(&part(), &sites, &tool.cutter().unwrap(), &directions, &options);
        let n = |answers: &[SiteAnswer]| n_of(SiteAnswer::Accessible, answers);
        let coarse = label(&part(), &sites, &tool.cutter().unwrap(), &directions, &exactly(0.01));
        assert!(n(&reach.answers) >= n(&coarse.answers));
        // Both search; what one of them misses is rare.
        let differ = reach.answers.iter().zip(&alone.answers).filter(|(a, b)| a != b).count();
        assert!(differ * 50 <= sites.points.len(), "{differ} of {}", sites.points.len());
        for (i, witness) in reach.witness.iter().enumerate() {
            let Some(pose) = witness else { continue };
            let cutter = tool.cutter().unwrap();
            let axis = pose.direction.as_dvec3().normalize();
            let reference = pose.tip_mm + axis * cutter.corner_mm();
            let found = raise(&part(), &cutter, 0.01, reference, pose.direction).unwrap();
            assert!(found.steps <= 1e-6 && found.tip <= 1e-4, "{i} {found:?}");
        }
    }
}

#[test]
fn the_pass_does_not_depend_on_threads() {
    let sites = everywhere(&part(), 6);
    let options =
        SurfaceOptions { refinement: Some(RefinementOptions::default()), ..exactly(0.01) };
    let run = |n| par::with_threads(n, || reach(&sites, &hemisphere(30), &options)).unwrap();
    assert_eq!(run(1), run(3));
}
