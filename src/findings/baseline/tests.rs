//! Claims about baselines.

use super::*;
use crate::answers::{SiteAnswer, SiteAnswers};
use crate::findings::bounds_of;
use crate::findings::gate::Limit;
use crate::geom::Mesh;
use crate::geom::sites::{SiteOptions, sample};
use crate::geom::solids::cuboid;
use glam::{Vec3, dvec3};

const DAY: &str = "2026-01-31";

/// A block 40 × 30 × 20 mm, 5200 mm², at `low`.
struct Part {
    mesh: Mesh,
    sites: Sites,
}

impl Part {
    fn at(low: DVec3, n_sites: usize) -> Self {
        let mut mesh = cuboid(dvec3(40.0, 30.0, 20.0));
        mesh.vertices.iter_mut().for_each(|vertex| *vertex += low);
        let options = SiteOptions { n_sites, ..SiteOptions::default() };
        let sites = sample(&mesh, &options).unwrap();
        Part { mesh, sites }
    }

    fn new() -> Self {
        Part::at(DVec3::ZERO, 6000)
    }

    fn about(&self) -> FindingsAbout<'_> {
        let bounds = bounds_of(Some(&self.mesh), &self.sites);
        FindingsAbout { part: "a.stl", tool: "D6", bounds, sites: &self.sites }
    }

    /// The sites that are out of reach.
    fn found(&self, is_out: impl Fn(&Vec3, &Vec3) -> bool) -> Findings {
        let at = self.sites.points.iter().zip(&self.sites.normals);
        let answers = SiteAnswers::new(at.map(|(p, n)| is_out(p, n)).collect(), vec![]);
        self.of(&answers)
    }

    fn of(&self, answers: &SiteAnswers) -> Findings {
        let mut found = Findings::of(&self.sites, Some(&self.mesh), answers, &[]).unwrap();
        found.identify("D6", self.about().bounds);
        found
    }

    fn baseline(&self, is_out: impl Fn(&Vec3, &Vec3) -> bool) -> Baseline {
        Baseline::of(&self.found(is_out), self.about(), DAY).unwrap()
    }
}

/// Whether it is on top within a rectangle.
fn top(p: &Vec3, n: &Vec3, x: [f32; 2], y: [f32; 2]) -> bool {
    n.z > 0.5 && (x[0]..x[1]).contains(&p.x) && (y[0]..y[1]).contains(&p.y)
}

/// 10 × 10 mm on top.
fn square(p: &Vec3, n: &Vec3) -> bool {
    top(p, n, [5.0, 15.0], [5.0, 15.0])
}

/// 6 × 20 mm on top, 11 mm beside the square.
fn strip(p: &Vec3, n: &Vec3) -> bool {
    top(p, n, [26.0, 32.0], [5.0, 25.0])
}

fn ids(findings: &Findings) -> Vec<&str> {
    findings.list.iter().map(|finding| &*finding.id).collect()
}

#[test]
fn findings_keep_their_names_over_other_sites_moves_and_another_order() {
    let part = Part::new();
    let mut baseline = part.baseline(|p, n| square(p, n) || strip(p, n));
    // The strip, 120 mm², is the first.
    let names = ["wide".to_string(), "square".to_string()];
    for (known, name) in baseline.known.iter_mut().zip(&names) {
        known.id.clone_from(name);
        known.reason = format!("the {name} is for the broach");
    }
    let held = |part: &Part, is_out: &dyn Fn(&Vec3, &Vec3) -> bool| {
        let mut found = part.found(is_out);
        let check = baseline.hold(&mut found, part.about());
        (found, check)
    };
    for n_sites in [3000, 6000, 9000] {
        let part = Part::at(DVec3::ZERO, n_sites);
        let (found, check) = held(&part, &|p, n| square(p, n) || strip(p, n));
        assert_eq!((ids(&found), check.is_broken()), (vec!["wide", "square"], false), "{n_sites}");
        assert_eq!(found.list[1].reason.as_deref(), Some("the square is for the broach"));
        assert_eq!(found.list[1].since.as_deref(), Some(DAY));
        assert!(check.gone.is_empty() && check.warnings.is_empty(), "{check:?}");
    }
    // The square goes by most of its edge: it keeps its name, and is not where it was. A third finding, the underside,
    // is larger than both.
    let moved = |p: &Vec3, n: &Vec3| top(p, n, [5.0, 15.0], [13.0, 23.0]) || strip(p, n);
    let (found, check) = held(&part, &|p, n| moved(p, n) || n.z < -0.5);
    assert_eq!((&ids(&found)[1..], &check.new[..]), (&["wide", "square"][..], &[0][..]));
    assert_eq!((check.grown.len(), check.grown[0].0), (1, 2));
    let (mm2, at) = check.grown[0].1.patch.unwrap();
    assert!((30.0..90.0).contains(&mm2) && at.y > 15.0, "{mm2} at {at}");
    // The strip shrinks to 3 × 20 mm and is behind the square.
    let thin = |p: &Vec3, n: &Vec3| top(p, n, [26.0, 29.0], [5.0, 25.0]) || square(p, n);
    let (found, check) = held(&part, &thin);
    assert_eq!((ids(&found), check.is_broken()), (vec!["square", "wide"], false));
    // All of the part is elsewhere.
    let far = Part::at(dvec3(300.0, -100.0, 7.0), 6000);
    let back = |p: &Vec3| *p - Vec3::new(300.0, -100.0, 7.0);
    let (found, check) = held(&far, &|p, n| square(&back(p), n) || strip(&back(p), n));
    assert_eq!((ids(&found), check.is_broken()), (vec!["wide", "square"], false));
    assert_eq!(check.warnings, Vec::<String>::new());
}

#[test]
fn what_is_larger_by_more_than_a_tenth_is_grown_and_what_is_elsewhere_is_new() {
    let part = Part::new();
    let baseline = part.baseline(square);
    // 10 × 10.4, 10 × 14 mm.
    for (to, expected) in [(15.4, FindingStatus::Known), (19.0, FindingStatus::Grown)] {
        let mut found = part.found(|p, n| top(p, n, [5.0, 15.0], [5.0, to]));
        let check = baseline.hold(&mut found, part.about());
        assert_eq!(found.list[0].status, Some(expected), "{to}");
        assert_eq!(check.is_broken(), expected == FindingStatus::Grown);
        assert_eq!(found.list[0].id, baseline.known[0].id);
    }
    let mut found = part.found(strip);
    let check = baseline.hold(&mut found, part.about());
    assert_eq!(
        (found.list[0].status, found.list[0].reason.clone()),
        (Some(FindingStatus::New), None)
    );
    assert_eq!((check.new, check.gone), (vec![0], baseline.known.clone()));
    // Below, across the block: its mean normal is the other.
    let mut found = part.found(|p, n| n.z < -0.5 && (5.0..15.0).contains(&p.x));
    assert_eq!(baseline.hold(&mut found, part.about()).new, [0]);
    // Of another tool.
    let mut found = part.found(square);
    let other = FindingsAbout { tool: "D8", ..part.about() };
    let check = baseline.hold(&mut found, other);
    assert_eq!(check.new, [0]);
    assert!(check.warnings[0].contains("findings of D6, none of D8"), "{:?}", check.warnings);
    let at = part.sites.points.iter().zip(&part.sites.normals);
    let answer =
        |is_in: bool| if is_in { SiteAnswer::TipDoesNotFit } else { SiteAnswer::Accessible };
    let tip = SiteAnswers::by_mesh(at.map(|(p, n)| answer(square(p, n))).collect());
    // Of another cause: the tool mills it no more than before.
    let mut found = part.of(&tip);
    let check = baseline.hold(&mut found, part.about());
    assert_eq!((check.known, &found.list[0].id), (vec![0], &baseline.known[0].id));
}

#[test]
fn the_pieces_of_a_finding_are_known_and_the_larger_one_keeps_the_name() {
    let part = Part::new();
    let whole = |p: &Vec3, n: &Vec3| top(p, n, [5.0, 35.0], [5.0, 15.0]);
    let parted = |p: &Vec3, n: &Vec3| whole(p, n) && !(22.0..26.0).contains(&p.x);
    let mut baseline = part.baseline(whole);
    baseline.known[0].reason = "for the broach".into();
    let mut found = part.found(parted);
    let check = baseline.hold(&mut found, part.about());
    assert_eq!((&found.list[0].id, &check.known[..]), (&baseline.known[0].id, &[0, 1][..]));
    assert!(check.new.is_empty() && check.gone.is_empty() && !check.is_broken(), "{check:?}");
    assert_ne!(found.list[1].id, found.list[0].id);
    assert!(found.list.iter().all(|f| f.reason.as_deref() == Some("for the broach")));
    // A third piece beside them is not known.
    let more = |p: &Vec3, n: &Vec3| parted(p, n) || top(p, n, [5.0, 35.0], [22.0, 28.0]);
    assert_eq!(baseline.hold(&mut part.found(more), part.about()).new.len(), 1);
}

#[test]
fn known_findings_that_join_over_a_gap_of_few_sites_are_known_with_both_reasons() {
    let part = Part::new();
    let whole = |p: &Vec3, n: &Vec3| top(p, n, [5.0, 35.0], [5.0, 15.0]);
    // Sites are 0.93 mm apart: 2.5 mm part, and a known one covers some 1 mm around it.
    let parted = |p: &Vec3, n: &Vec3| whole(p, n) && !(22.0..24.5).contains(&p.x);
    let mut baseline = part.baseline(parted);
    baseline.known[0].reason = "left".into();
    baseline.known[1].reason = "right".into();
    let mut found = part.found(whole);
    let check = baseline.hold(&mut found, part.about());
    assert!(!check.is_broken() && check.gone.is_empty() && check.known == [0], "{check:?}");
    assert_eq!(found.list[0].id, baseline.known[0].id);
    assert_eq!(found.list[0].reason.as_deref(), Some("left; right"));
    // Over 12 mm, a third of the whole: one name goes, nothing is gone, and what is between is not known.
    let baseline = part.baseline(|p, n| whole(p, n) && !(14.0..26.0).contains(&p.x));
    let check = baseline.hold(&mut part.found(whole), part.about());
    assert_eq!((check.grown.len(), check.new.len(), check.gone.len()), (1, 0, 0));
    let grown = check.grown[0].1;
    assert!((150.0..200.0).contains(&grown.was_mm2) && grown.is_mm2 > 280.0, "{grown:?}");
    assert!((14.0..26.0).contains(&grown.patch.unwrap().1.x), "{grown:?}");
}

#[test]
fn a_patch_beside_a_large_finding_is_grown_however_small_its_share() {
    let part = Part::new();
    let under = |_: &Vec3, n: &Vec3| n.z < -0.5;
    let baseline = part.baseline(under);
    // 6 × 8 mm of a wall above the underside, 1200 mm²: 4 %, but 55 sites.
    let wall =
        |p: &Vec3, n: &Vec3| n.x > 0.5 && p.z < 8.0 && (10.0..16.0).contains(&p.y) || n.z < -0.5;
    let mut found = part.found(wall);
    let check = baseline.hold(&mut found, part.about());
    assert_eq!((found.list.len(), check.grown.len()), (1, 1), "{check:?}");
    let (mm2, at) = check.grown[0].1.patch.unwrap();
    assert!((20.0..48.0).contains(&mm2) && at.x == 40.0, "{mm2} at {at}");
}

#[test]
fn the_other_side_of_a_thin_wall_is_not_known() {
    // A plate of 0.5 mm, less than the spacing of the sites.
    let mesh = cuboid(dvec3(40.0, 30.0, 0.5));
    let sites = sample(&mesh, &SiteOptions { n_sites: 3000, ..SiteOptions::default() }).unwrap();
    let plate = Part { mesh, sites };
    let baseline = plate.baseline(square);
    let is_in = |p: &Vec3| (5.0..15.0).contains(&p.x) && (5.0..15.0).contains(&p.y);
    let mut found = plate.found(|p, n| n.z < -0.5 && is_in(p));
    let check = baseline.hold(&mut found, plate.about());
    assert_eq!((check.new, check.gone.len()), (vec![0], 1));
}

#[test]
fn what_is_not_known_and_has_fewer_than_8_sites_is_small() {
    let part = Part::new();
    let baseline = part.baseline(strip);
    // 0.87 mm² to a site.
    for (edge, expected) in [(2.0, FindingStatus::Small), (4.0, FindingStatus::New)] {
        let mut found =
            part.found(|p, n| strip(p, n) || top(p, n, [5.0, 5.0 + edge], [5.0, 5.0 + edge]));
        let check = baseline.hold(&mut found, part.about());
        assert_eq!(found.list.len(), 2, "{edge}");
        let is_small = expected == FindingStatus::Small;
        assert_eq!(found.list[1].status, Some(expected), "{edge}: {}", found.list[1].n_sites);
        assert_eq!((check.small.len(), check.is_broken()), (usize::from(is_small), !is_small));
        assert_eq!((found.list[1].n_sites < 8, found.list[1].n_sites < 4), (is_small, false));
    }
}

#[test]
fn sites_that_were_scattered_are_not_new_when_they_join() {
    let part = Part::new();
    // A line of sites, of which a gap every 4 mm leaves pieces of a few.
    let line = |p: &Vec3, n: &Vec3| top(p, n, [2.0, 38.0], [20.0, 20.9]);
    let dotted = |p: &Vec3, n: &Vec3| line(p, n) && (p.x % 4.0) < 2.0;
    let baseline = part.baseline(|p, n| dotted(p, n) || top(p, n, [5.0, 15.0], [2.0, 12.0]));
    assert!(!baseline.scattered.is_empty() && baseline.known.len() < 5, "{}", baseline.known.len());
    let now = |p: &Vec3, n: &Vec3| line(p, n) || top(p, n, [5.0, 15.0], [2.0, 12.0]);
    let check = baseline.hold(&mut part.found(now), part.about());
    assert!(!check.is_broken() && check.gone.is_empty(), "{check:?}");
    let without = Baseline { scattered: Vec::new(), ..baseline };
    assert!(without.hold(&mut part.found(now), part.about()).is_broken());
}

#[test]
fn names_without_a_baseline_are_of_tool_cause_and_place() {
    let of = |n_sites: usize, tool: &str| {
        let part = Part::at(dvec3(-3.0, 50.0, 1.0), n_sites);
        let mut found = part.found(|p, n| {
            let p = *p - Vec3::new(-3.0, 50.0, 1.0);
            n.z < -0.5
                || top(&p, n, [0.0, 10.0], [0.0, 30.0])
                || top(&p, n, [34.0, 40.0], [0.0, 30.0])
        });
        found.identify(tool, part.about().bounds);
        ids(&found).into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let names = of(6000, "D6");
    assert_eq!(names.len(), 3);
    assert!(names.iter().all(|name| name.len() == 8 && name.starts_with("F-")), "{names:?}");
    for n_sites in [3000, 5000, 9000] {
        assert_eq!(of(n_sites, "D6"), names, "{n_sites}");
    }
    assert!(of(6000, "D8").iter().all(|name| !names.contains(name)));
    // Two in one cell of 5 mm, and in one of 2.5.
    let part = Part::at(DVec3::ZERO, 20_000);
    let two = part.found(|p, n| {
        top(p, n, [19.0, 19.9], [14.0, 16.0]) || top(p, n, [20.8, 21.5], [14.0, 16.0])
    });
    assert_eq!(two.list.len(), 2);
    assert_ne!(two.list[0].id, two.list[1].id);
}

#[test]
fn a_new_finding_takes_no_name_of_the_baseline() {
    let part = Part::new();
    let mut baseline = part.baseline(square);
    let elsewhere = part.found(strip);
    baseline.known[0].id.clone_from(&elsewhere.list[0].id);
    let mut found = part.found(|p, n| square(p, n) || strip(p, n));
    baseline.hold(&mut found, part.about());
    let taken = &baseline.known[0].id;
    assert_eq!(ids(&found), [&format!("{taken}-2"), taken]);
}

#[test]
fn a_baseline_of_another_part_is_named() {
    let part = Part::new();
    let mut baseline = part.baseline(square);
    let inches = baseline.bounds.map(|corner| corner / 25.4);
    baseline.bounds = inches;
    let check = baseline.hold(&mut part.found(square), part.about());
    let [warning] = &check.warnings[..] else { panic!("{:?}", check.warnings) };
    assert!(warning.contains("a.stl") && warning.contains("40 x 30 x 20 mm"), "{warning}");
    // An edge that is a third longer is an edit.
    baseline.bounds = [DVec3::ZERO, dvec3(30.0, 30.0, 20.0)];
    let check = baseline.hold(&mut part.found(square), part.about());
    assert!(check.warnings.is_empty() && !check.is_broken(), "{check:?}");
}

#[test]
fn limits_on_findings_count_what_is_not_known() {
    let part = Part::new();
    let baseline = part.baseline(strip);
    let mut found = part.found(|p, n| square(p, n) || strip(p, n));
    let limit = |text: &str| text.parse::<Limit>().unwrap();
    assert!(limit("finding>110mm2").broken_by_findings(&found).is_some());
    baseline.hold(&mut found, part.about());
    assert_eq!(limit("finding>110mm2").broken_by_findings(&found), None);
    let why = limit("finding>90mm2").broken_by_findings(&found).unwrap();
    assert!(why.starts_with("the largest of 1 findings that are not known, inaccessible"), "{why}");
    let mut found = part.found(strip);
    baseline.hold(&mut found, part.about());
    assert_eq!(limit("finding>0mm2").broken_by_findings(&found), None);
}

fn written(text: &str) -> Result<Baseline> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("known.toml");
    std::fs::write(&path, text).unwrap();
    Baseline::read(&path)
}

#[test]
fn a_file_reads_back_as_it_was_and_reasons_are_any_text() {
    let part = Part::new();
    let mut baseline = part.baseline(|p, n| square(p, n) || strip(p, n));
    baseline.part = "a \"part\" = [1]\n'''.stl".into();
    baseline.known[0].reason = "tab\t, line\r\n, \\ \u{1} and “ä”".into();
    baseline.known[1].date = String::new();
    baseline.known[1].normal = DVec3::ZERO;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("known.toml");
    baseline.write(&path).unwrap();
    assert_eq!(Baseline::read(&path).unwrap(), baseline);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.lines().all(|line| line.len() < 600) && text.lines().count() < 60, "{text}");
    let error = Baseline::of(&part.found(square), part.about(), "31.1.2026").unwrap_err();
    assert!(error.to_string().contains("2026-01-31"), "{error}");
}

/// What a person would write, without the places.
const BY_HAND: &str = "\
version = 1
part = \"a.stl\"
unit = \"mm\"
box = [[0, 0, 0], [40, 30, 20]]
site_mm2 = 0.9

[[finding]]
id = \"pocket\"
tool = \"D6\"
cause = \"inaccessible\"
area_mm2 = 100
at = [10, 10, 20]
box = [[5, 5, 20], [15, 15, 20]]
";

#[test]
fn an_entry_written_by_hand_fills_its_box() {
    let part = Part::new();
    let baseline = written(BY_HAND).unwrap();
    let mut found = part.found(|p, n| square(p, n) || strip(p, n));
    let check = baseline.hold(&mut found, part.about());
    assert_eq!((&*found.list[1].id, check.known, check.new), ("pocket", vec![1], vec![0]));
}

#[test]
fn what_is_no_baseline_is_refused_with_its_line() {
    for (from, to, expected) in [
        ("version = 1", "", "version: it is missing, not 1"),
        ("version = 1", "version = 2\nmore = 1", "version: it is 2, not 1"),
        ("version = 1", "version = \"1\"", "version: it is \"1\", not 1"),
        ("site_mm2 = 0.9", "site_mm = 0.9", "line 5: unknown field `site_mm`"),
        ("site_mm2 = 0.9", "", "missing field `site_mm2`"),
        ("site_mm2 = 0.9", "site_mm2 = -1", "line 5: site_mm2 is -1"),
        ("\"mm\"", "\"in\"", "line 3: unit is `in`"),
        ("[40, 30, 20]]\nsite", "[40, 30, -20]]\nsite", "line 4: box has a first corner above"),
        ("[40, 30, 20]]", "[40, 30]]", "line 4"),
        ("box = [[0, 0, 0]", "box = [[0, 0, -inf]", "line 4: box has -inf"),
        ("\"pocket\"", "\" \"", "line 8: id is empty"),
        ("\"pocket\"", "7", "line 8: invalid type: integer `7`"),
        ("tool = \"D6\"\n", "", "missing field `tool`"),
        ("tool = ", "tols = ", "line 9: unknown field `tols`"),
        ("\"inaccessible\"", "\"accessible\"", "line 10: cause is `accessible`"),
        ("area_mm2 = 100", "area_mm2 = -100", "line 11: area_mm2 is -100"),
        ("area_mm2 = 100", "area_mm2 = nan", "line 11: area_mm2 is NaN"),
        ("area_mm2 = 100", "area_mm2 = inf", "line 11: area_mm2 is inf"),
        ("area_mm2 = 100", "area_mm2 = \"100\"", "line 11: invalid type: string"),
        ("at = [10, 10, 20]", "at = [10, nan, 20]", "line 12: at has NaN"),
        ("at = [10, 10, 20]", "at = [10, 1e300, 20]", "line 12: at has 1"),
        ("[15, 15, 20]]", "[15, 4, 20]]", "line 13: box has a first corner above"),
        ("[15, 15, 20]]", "[15, 15, 20]]\ndate = \"31.1.26\"", "line 14: date is `31.1.26`"),
        ("[15, 15, 20]]", "[15, 15, 20]]\ndate = \"2026-13-01\"", "line 14: date is"),
        ("[15, 15, 20]]", "[15, 15, 20]]\nreach_mm = 1", "line 14: unknown field `reach_mm`"),
        ("[15, 15, 20]]", "[15, 15, 20]]\ncells = [[1, 2]]", "line 14"),
        ("[15, 15, 20]]", "[15, 15, 20]]\ncells = [[1, 2, 3, 4, 4]]", "line 14: cells are given w"),
        ("mm2 = 0.9", "mm2 = 0.9\ncell_mm = 0", "line 6: cell_mm is 0"),
        ("mm2 = 0.9", "mm2 = 0.9\ncell_mm = nan", "line 6: cell_mm is NaN"),
        ("mm2 = 0.9", "mm2 = 0.9\nscattered = 3", "line 6: invalid type"),
        ("mm2 = 0.9", "mm2 = 0.9\nscattered = [{cells = []}]", "missing field `tool`"),
        ("[15, 15, 20]]", "[15, 15, 20]]\nreason = false", "line 14: invalid type: boolean"),
        ("id = ", "id == ", "line 8"),
        ("[[finding]]", "[finding]", "line 7"),
    ] {
        assert!(BY_HAND.contains(from), "{from}");
        let message = written(&BY_HAND.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(message.contains("known.toml: ") && message.contains(expected), "{to}: {message}");
        assert!(message.contains("; ") && !message.contains('\n'), "{message}");
    }
    let (_, entry) = BY_HAND.split_once("\n\n").unwrap();
    let message = written(&format!("{BY_HAND}\n{entry}")).unwrap_err().to_string();
    assert!(message.contains("line 16: id `pocket` is that of line 8 too"), "{message}");
    let with_cells = BY_HAND.replace("mm2 = 0.9", "mm2 = 0.9\ncell_mm = 2");
    for (run, expected) in [
        ("[6, 2, 3, 4, 4]", "line 15: cells has the facing 6"),
        ("[1, 2, 3, 5, 4]", "line 15: cells has a run from 5 to 4"),
        ("[1, 2, 9000000, 4, 4]", "line 15: cells has 9000000"),
        ("[1, 2, 3, 4, 0.5]", "line 15: invalid type: float"),
    ] {
        let message = written(&format!("{with_cells}cells = [{run}]\n")).unwrap_err().to_string();
        assert!(message.contains(expected), "{run}: {message}");
    }
    let missing = Baseline::read(std::path::Path::new("nowhere.toml")).unwrap_err();
    assert!(missing.to_string().contains("nowhere.toml: cannot be read"), "{missing}");
}
