//! Claims about findings.

use super::*;
use crate::geom::sites::{SiteOptions, sample};
use crate::geom::solids::cuboid;
use crate::geom::units::Unit;
use glam::{Vec3, dvec3};

/// A block 40 × 20 × 10 mm with sites about 1.2 mm apart.
fn block() -> (Mesh, Sites) {
    let mesh = cuboid(dvec3(40.0, 20.0, 10.0));
    let sites = sample(&mesh, &SiteOptions { n_sites: 2000, ..SiteOptions::default() }).unwrap();
    (mesh, sites)
}

fn answers(sites: &Sites, inaccessible: impl Fn(&Vec3, &Vec3) -> bool) -> SiteAnswers {
    let at = sites.points.iter().zip(&sites.normals);
    SiteAnswers::new(at.map(|(p, n)| inaccessible(p, n)).collect(), vec![])
}

#[test]
fn areas_are_those_of_the_faces_and_nothing_is_lost() {
    let (mesh, sites) = block();
    let mut answers = answers(&sites, |p, n| n.z < -0.5 || (n.x > 0.5 && p.z > 5.0));
    let is_dot = |p: &Vec3, n: &Vec3| n.z > 0.5 && p.distance(Vec3::new(20.0, 10.0, 10.0)) < 1.0;
    let at = answers.of_sites.iter_mut().zip(sites.points.iter().zip(&sites.normals));
    for (answer, _) in at.filter(|(_, (p, n))| is_dot(p, n)) {
        *answer = SiteAnswer::TipDoesNotFit;
    }
    answers.tests_tip = true;
    answers.clearance_mm = (0..sites.len()).map(|i| -(i as f32)).collect();
    let n_dots = answers.tip_does_not_fit().iter().filter(|tip| **tip).count();
    assert!((1..MIN_SITES).contains(&n_dots), "{n_dots}");
    for mesh in [Some(&mesh), None] {
        let found = Findings::of(&sites, mesh, &answers, &[]).unwrap();
        assert_eq!(found.list.len(), 2);
        let [bottom, side] = &found.list[..] else { unreachable!() };
        assert!((bottom.area_mm2 - 800.0).abs() < 40.0, "{}", bottom.area_mm2);
        assert!((side.area_mm2 - 100.0).abs() < 15.0, "{}", side.area_mm2);
        assert!(bottom.normal.distance(DVec3::NEG_Z) < 1e-6 && bottom.at_mm.z == 0.0);
        assert!(bottom.at_mm.distance(dvec3(20.0, 10.0, 0.0)) < 2.0);
        assert!(side.low_mm.z > 5.0 && side.high_mm.x == 40.0);
        assert_eq!(found.scattered.n_sites, n_dots);
        let listed: f64 = found.list.iter().map(|finding| finding.area_mm2).sum();
        let share = answers.accessible().iter().filter(|a| !**a).count() as f64 / 2000.0;
        let total = listed + found.scattered.area_mm2;
        assert!((total / found.surface_mm2 - share).abs() < 0.03);
        assert_eq!(found.largest_mm2, bottom.area_mm2);
        let counted = found.of_site.iter().filter(|number| **number == 1).count();
        assert_eq!(counted, bottom.n_sites);
        let last = (0..2000).rev().find(|&i| found.of_site[i] == 1).unwrap();
        assert_eq!(bottom.worst_clearance_mm, Some(-(last as f32)));
    }
}

#[test]
fn the_tool_that_reaches_most_of_a_region_helps() {
    let (mesh, sites) = block();
    let own = answers(&sites, |_, n| n.z < -0.5);
    let half: Vec<bool> = sites.points.iter().map(|p| p.x < 10.0).collect();
    let most: Vec<bool> = sites.points.iter().map(|p| p.x < 30.0).collect();
    let none = vec![false; sites.len()];
    let others = [("a", &none[..]), ("b", &half[..]), ("c", &most[..])];
    let found = Findings::of(&sites, Some(&mesh), &own, &others).unwrap();
    let help = found.list[0].helps.as_ref().unwrap();
    assert!(help.tool == "c" && (help.share - 0.75).abs() < 0.03, "{help:?}");
    let found = Findings::of(&sites, Some(&mesh), &own, &others[..1]).unwrap();
    assert_eq!(found.list[0].helps, None);
    let both = for_all_tools([&own, &answers(&sites, |_, n| n.x > 0.5)].into_iter());
    assert!(both.of_sites.iter().all(|answer| *answer == SiteAnswer::Accessible));
}

#[test]
fn files_hold_every_finding_and_numbers_of_wrong_length_are_refused() {
    let (mesh, sites) = block();
    let answers = answers(&sites, |p, n| n.z < -0.5 || p.distance(Vec3::new(0.0, 0.0, 10.0)) < 1.2);
    let mut found = Findings::of(&sites, Some(&mesh), &answers, &[]).unwrap();
    add_proofs(&mut found, &vec![0.0; sites.len()]);
    let folder = tempfile::tempdir().unwrap();
    let paths = found.write(folder.path(), ("a,\"b\"", "ball-end"), Unit::Millimeter).unwrap();
    let json: Value = serde_json::from_slice(&std::fs::read(&paths[0]).unwrap()).unwrap();
    assert_eq!(json["format"], "deepmill findings");
    assert_eq!(json["findings"][0]["finding"], 1);
    assert_eq!(json["findings"][0]["cause"], "inaccessible");
    assert_eq!(json["findings"][0]["proven"], 1.0);
    assert_eq!(json["largest_mm2"], found.largest_mm2);
    let csv = std::fs::read_to_string(&paths[1]).unwrap();
    let rows = found.list.len() + usize::from(found.scattered.n_regions > 0);
    assert_eq!(csv.lines().count(), 1 + rows);
    assert!(csv.starts_with("finding,id,status,reason,cause,area_mm2,"));
    let short = SiteAnswers::new(vec![true], vec![]);
    assert!(Findings::of(&sites, None, &short, &[]).is_err());
}

#[test]
fn the_part_that_blocks_most_of_a_region_is_named() {
    let (mesh, sites) = block();
    let answers = answers(&sites, |p, n| n.z < -0.5 || (n.x > 0.5 && p.z > 5.0));
    let mut found = Findings::of(&sites, Some(&mesh), &answers, &[]).unwrap();
    add_blocking_parts(&mut found, &[]);
    assert_eq!(found.list[0].blocked_by, None);
    let of = |i: usize| match (found.of_site[i], sites.points[i].x < 30.0) {
        (1, true) => Some(ToolPart::Holder),
        (1, false) => Some(ToolPart::Cutter),
        (2, _) => Some(ToolPart::Spindle),
        _ => None,
    };
    let parts: Vec<Option<ToolPart>> = (0..sites.len()).map(of).collect();
    add_blocking_parts(&mut found, &parts);
    let share = found.list[0].blocked_share.unwrap();
    assert!(found.list[0].blocked_by == Some(ToolPart::Holder) && (share - 0.75).abs() < 0.03);
    assert_eq!(found.list[1].blocked_share, Some(1.0));
    found.list[0].change = Some(ToolChange::new("holder thinner".into(), 0.5));
    let csv = String::from_utf8(found.table().csv()).unwrap();
    assert!(csv.lines().next().unwrap().ends_with("blocked_by,blocked_share,change,change_share"));
    assert!(csv.contains(",holder,") && csv.contains(",holder thinner,0.5"), "{csv}");
    assert_eq!(found.json()["findings"][0]["change"]["share"], 0.5);
    assert_eq!(found.json()["findings"][1]["blocked_by"], "spindle");
}

#[test]
fn what_is_all_accessible_has_no_findings() {
    let (mesh, sites) = block();
    let found = Findings::of(&sites, Some(&mesh), &answers(&sites, |_, _| false), &[]).unwrap();
    assert!(found.list.is_empty() && found.largest_mm2 == 0.0);
    assert_eq!(found.scattered, Scattered::default());
    let none = Findings::of(&Sites::default(), None, &SiteAnswers::default(), &[]).unwrap();
    assert!(none.list.is_empty());
}

#[test]
fn findings_beyond_every_memory_are_refused() {
    for refused in
        [require_for_findings(usize::MAX / 2), require_for_findings_files(usize::MAX / 2)]
    {
        if cfg!(target_os = "linux") {
            let message = refused.unwrap_err().to_string();
            assert!(message.contains(" bytes, the limit is "), "{message}");
        }
    }
    require_for_findings(100).and_then(|()| require_for_findings_files(100)).unwrap();
}
