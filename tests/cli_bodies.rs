//! Several bodies in one file: every command answers about their union.
#![cfg(feature = "cli")]

mod command;

use command::{Corner, Folder, block, deepmill, failure, json, stl, text};
use deepmill::data::dataset::Dataset;
use deepmill::glam::Vec3;
use serde_json::Value;

const TOOL: &str = "2,30,20,30";

/// The L of two blocks that overlap or lie on each other, 40 × 20 × 10 and 10 × 20 up to 30, as one body.
fn union() -> Vec<[Corner; 3]> {
    let profile = [[0.0, 0.0], [40.0, 0.0], [40.0, 10.0], [10.0, 10.0], [10.0, 30.0], [0.0, 30.0]];
    let at = |k: usize, y: f32| [profile[k % 6][0], y, profile[k % 6][1]];
    let mut triangles: Vec<[Corner; 3]> = Vec::new();
    for [a, b, c] in [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]] {
        triangles.push([at(a, 0.0), at(b, 0.0), at(c, 0.0)]);
        triangles.push([at(a, 20.0), at(c, 20.0), at(b, 20.0)]);
    }
    for k in 0..6 {
        let [a, b, c, d] = [at(k, 0.0), at(k, 20.0), at(k + 1, 20.0), at(k + 1, 0.0)];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    triangles
}

/// Files of the same solid: as one body, of two that overlap, of two with a wall in common (welded and not), and of
/// three.
fn files(folder: &Folder) -> Vec<String> {
    let foot = block([0.0; 3], [40.0, 20.0, 10.0]);
    let of = |name: &str, more: &[Vec<[Corner; 3]>]| {
        folder.file(name, stl(&[&foot[..], &more.concat()].concat()))
    };
    vec![
        folder.file("union.stl", stl(&union())),
        of("overlap.stl", &[block([0.0; 3], [10.0, 20.0, 30.0])]),
        of("inside.stl", &[block([0.0, 0.0, 5.0], [10.0, 20.0, 30.0])]),
        of("touch.stl", &[block([0.0, 0.0, 10.0], [10.0, 20.0, 30.0])]),
        of(
            "three.stl",
            &[
                block([0.0, 0.0, 2.0], [10.0, 20.0, 18.0]),
                block([0.0, 0.0, 18.0], [10.0, 20.0, 30.0]),
            ],
        ),
    ]
}

fn run(folder: &Folder, command: &[&str], more: &[&str]) -> Value {
    let out = folder.path("out");
    let usual = ["--sites", "1500", "--no-picture", "--out", &out, "--json"];
    json(&deepmill(&[command, &usual, more].concat()))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

#[test]
fn bodies_that_overlap_or_touch_have_the_answers_of_their_union() {
    let folder = Folder::new();
    let up = ["--directions", "up"];
    let shares = |part: &str| {
        let label = run(&folder, &["label", part, "--cutter", TOOL], &up);
        assert_eq!(label["bodies"], Value::Null, "one body: {label}");
        let table = folder.file("tools.csv", "name,CR,CH,FR,FH\nlong,2,30,20,30\n");
        let tools = run(&folder, &["tools", part, "--library", &table], &up);
        assert!((number(&tools, "area_mm2") - 4000.0).abs() < 1e-6, "{tools}");
        let upright = ["setups", part, "--cutter", TOOL, "--machine", "3-axis"];
        let setups = run(&folder, &upright, &[]);
        let names = setups["setups"].as_array().unwrap().iter();
        let names: Vec<String> = names.map(|row| row["setup"].to_string()).collect();
        let volume = run(&folder, &["label", part, "--cutter", TOOL, "--volume", "2"], &up);
        assert_eq!(volume["n_points"].as_u64(), Some(20 * 10 * 15 - 20 * 10 * 5 - 5 * 10 * 10));
        let shares = [
            number(&label, "accessible"),
            number(&label, "tip_does_not_fit"),
            1.0 - number(&tools, "unreached"),
            number(&setups, "reached"),
            number(&volume, "accessible"),
        ];
        (shares, names, number(&volume, "accessible"))
    };
    let files = files(&folder);
    let one = shares(&files[0]);
    // Not reached from above: the underside, 800 mm², and in the corner of the step 2 mm of floor and wall over 20 mm.
    assert!((one.0[0] - (1.0 - (800.0 + 2.0 * 2.0 * 20.0) / 4000.0)).abs() < 0.01, "{one:?}");
    for part in &files[1..] {
        let found = shares(part);
        assert_eq!((&found.1, found.2), (&one.1, one.2), "{part}");
        for (a, b) in found.0.iter().zip(&one.0) {
            assert!((a - b).abs() < 0.004, "{part}: {found:?}, not {one:?}");
        }
    }
}

#[test]
fn check_says_what_is_joined_and_what_is_then_labeled_does_not_block() {
    let folder = Folder::new();
    for part in &files(&folder)[1..] {
        let output = deepmill(&["check", part]);
        let (said, warned) = (text(&output.stdout), text(&output.stderr));
        assert!(output.status.success() && !said.contains("BLOCKS"), "{said}{warned}");
        assert!(said.contains("can be labeled") && said.contains("1 component"), "{said}");
        assert!(warned.contains("are joined into 1"), "{warned}");
        let checked = json(&deepmill(&["check", part, "--json"]));
        assert!((number(&checked, "volume_mm3") - 12000.0).abs() < 1e-6, "{checked}");
        let mended = folder.path("mended.stl");
        assert!(deepmill(&["check", part, "--out", &mended]).status.success());
        let again = json(&deepmill(&["check", &mended, "--json"]));
        assert_eq!((&again["n_components"], &again["changes"]), (&1.into(), &Value::Array(vec![])));
    }
}

#[test]
fn explain_and_predict_take_bodies_that_overlap() {
    let folder = Folder::new();
    let part = &files(&folder)[2];
    run(&folder, &["label", part, "--cutter", TOOL], &["--directions", "up"]);
    let out = folder.path("out");
    let why = ["explain", &out, "--at", "9,10,0", "--no-picture", "--json"];
    assert_eq!(json(&deepmill(&why))["answer"], "inaccessible");
    let predict = ["predict", part, "--cutter", "1.5,6,40,5", "--no-picture", "--json"];
    let predicted = deepmill(&[&predict[..], &["--out", &folder.path("predicted")]].concat());
    assert_eq!(json(&predicted)["n_sites"], 7000);
}

#[test]
fn a_shell_within_a_body_stays_surface_and_an_inward_body_that_overlaps_is_refused() {
    let folder = Folder::new();
    let outer = block([0.0; 3], [40.0, 30.0, 20.0]);
    let hollow = [&outer[..], &block([10.0, 10.0, 5.0], [20.0, 20.0, 15.0])].concat();
    let hollow = folder.file("hollow.stl", stl(&hollow));
    let output = deepmill(&["check", &hollow, "--json"]);
    assert!(text(&output.stderr).contains("taken for a cavity"), "{}", text(&output.stderr));
    let checked = json(&output);
    assert_eq!((number(&checked, "area_mm2"), number(&checked, "volume_mm3")), (5800.0, 23000.0));
    let label = run(&folder, &["label", &hollow, "--cutter", TOOL], &["--directions", "sphere:40"]);
    assert!((number(&label, "accessible") - 5200.0 / 5800.0).abs() < 0.01, "{label}");

    let inward =
        block([30.0, 10.0, 5.0], [50.0, 20.0, 15.0]).into_iter().map(|[a, b, c]| [a, c, b]);
    let inward =
        folder.file("inward.stl", stl(&outer.iter().copied().chain(inward).collect::<Vec<_>>()));
    let message = failure(&deepmill(&["check", &inward]), 1);
    assert!(message.contains("overlaps another, and it faces inward"), "{message}");
    assert!(message.contains(&inward), "{message} names the file");
    let checked = deepmill(&["check", &inward]);
    let said = text(&checked.stdout);
    assert!(said.contains("2 components") && !said.contains("can be labeled"), "{said}");
    let forced = ["label", &inward, "--cutter", TOOL];
    assert!(run(&folder, &forced, &["--directions", "up", "--force"])["accessible"].is_number());
    let mended = json(&deepmill(&["check", &inward, "--repair", "--json"]));
    assert!((number(&mended, "volume_mm3") - 25000.0).abs() < 1e-6, "{mended}");
}

#[test]
fn data_sets_take_parts_of_several_bodies_and_parts_that_face_inward() {
    let folder = Folder::new();
    let part = |name: &str, triangles: &[[Corner; 3]]| {
        std::fs::create_dir_all(folder.path("parts")).unwrap();
        folder.file(&format!("parts/{name}.stl"), stl(triangles));
    };
    let low = block([0.0; 3], [40.0, 20.0, 10.0]);
    part("overlap", &[&low[..], &block([0.0; 3], [10.0, 20.0, 30.0])].concat());
    part("apart", &[&low[..], &block([0.0, 0.0, 12.0], [10.0, 20.0, 30.0])].concat());
    part("inward", &low.iter().map(|[a, b, c]| [*a, *c, *b]).collect::<Vec<_>>());
    part("open", &low[1..]);
    let build = |out: &str| {
        let parts = folder.path("parts");
        let options =
            ["--sites", "600", "--directions", "10", "--cutters", "1", "--validation", "0"];
        let out = folder.path(out);
        let all = ["dataset", "build", &parts, "--out", &out, "--json"];
        deepmill(&[&all[..], &options].concat())
    };
    let output = build("set");
    let built = json(&output);
    assert_eq!(built["n_train_parts"], 3, "{built}");
    // Of blocks of 40 × 20 × 10 and 10 × 20 × 30 mm that overlap, the wall at z = 10 below the second is no surface.
    let set = Dataset::open(folder.path("set").as_ref()).unwrap();
    let samples = set.samples(None).unwrap();
    let of = |name: &str| &samples.iter().find(|sample| sample.name.contains(name)).unwrap().sites;
    let height = |name: &str| of(name).points.iter().map(|p| p.z).fold(0.0, f32::max);
    let mm = |p: &Vec3, name: &str| *p * (30.0 / height(name));
    let on_wall = |name: &str| {
        let is_on = |p: Vec3| (p.z - 10.0).abs() < 0.1 && p.x < 9.0 && p.y > 1.0 && p.y < 19.0;
        of(name).points.iter().filter(|p| is_on(mm(p, name))).count()
    };
    assert_eq!(on_wall("overlap"), 0);
    // Bodies apart keep it: the second begins 2 mm higher.
    assert!(on_wall("apart") > 0);
    // A block that faced inward: normals point away from its middle.
    let inward = of("inward");
    let middle = 0.5 * inward.points.iter().fold(Vec3::ZERO, |most, p| most.max(*p));
    let outward = |(p, n): (&Vec3, &Vec3)| (*p - middle).dot(*n) > 0.0;
    assert!(inward.points.iter().zip(&inward.normals).all(outward));
    let notes = text(&output.stderr);
    assert!(notes.contains("open.stl") || notes.contains("open:"), "it is named: {notes}");
}
