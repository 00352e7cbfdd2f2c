//! What `explain`, findings and limits on findings promise.
#![cfg(feature = "cli")]

mod command;

use command::{Corner, Folder, block, deepmill, failure, json, stl, text};
use deepmill::answers::Definition;
use deepmill::data::files::{AnalysisSettings, LabelFile};
use deepmill::directions::DirectionSet;
use serde_json::Value;
use std::path::Path;

/// A block 40 × 40 × 20 mm with a slot along y, 10 mm wide and 18 mm deep.
fn slotted() -> Vec<u8> {
    let outline = [
        [-20.0, 0.0],
        [20.0, 0.0],
        [20.0, 20.0],
        [5.0, 20.0],
        [5.0, 2.0],
        [-5.0, 2.0],
        [-5.0, 20.0],
        [-20.0, 20.0],
    ];
    let at = |i: usize, y: f32| -> Corner { [outline[i][0], y, outline[i][1]] };
    let caps = [[0, 5, 6], [0, 6, 7], [0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4]];
    let mut triangles = Vec::new();
    for [a, b, c] in caps {
        triangles.push([at(a, 0.0), at(b, 0.0), at(c, 0.0)]);
        triangles.push([at(a, 40.0), at(c, 40.0), at(b, 40.0)]);
    }
    for i in 0..8 {
        let j = (i + 1) % 8;
        triangles.push([at(i, 0.0), at(i, 40.0), at(j, 40.0)]);
        triangles.push([at(i, 0.0), at(j, 40.0), at(j, 0.0)]);
    }
    stl(&triangles)
}

fn label(folder: &Folder, out: &str, cutter: &str, more: &[&str]) -> Value {
    let part = folder.file("slot.stl", slotted());
    let out = folder.path(out);
    let args = ["label", &part, "--cutter", cutter, "--out", &out, "--sites", "600"];
    json(&deepmill(&[&args[..], &["--no-picture", "--json"], more].concat()))
}

fn explain(folder: &Folder, result: &str, more: &[&str]) -> Value {
    let result = folder.path(result);
    json(&deepmill(&[&["explain", &result, "--json", "--no-picture"], more].concat()))
}

#[test]
fn a_holder_too_wide_for_a_slot_is_named_and_the_stated_length_makes_the_site_accessible() {
    let folder = Folder::new();
    label(&folder, "out", "1.5,6,40,5", &["--directions", "up"]);
    let why = explain(&folder, "out", &["--at", "0,20,2"]);
    let site = why["site"].as_u64().unwrap().to_string();
    assert_eq!((&why["answer"], &why["in_file"]), (&"inaccessible".into(), &why["answer"]));
    assert_eq!((&why["blocked_by"], &why["counts"]["holder"]), (&"holder".into(), &1.into()));
    let nearest = &why["nearest"];
    assert!((nearest["penetration_mm"].as_f64().unwrap() - 8.99).abs() < 1e-6, "{nearest}");
    let (x, z) = (nearest["at_mm"][0].as_f64().unwrap(), nearest["at_mm"][2].as_f64().unwrap());
    assert!((x.abs() - 5.0).abs() < 1e-4 && (z - 20.0).abs() < 1e-4, "{nearest}");
    let change = &why["changes"][0];
    assert_eq!((&change["kind"], &change["part"]), (&"longer".into(), &"holder".into()));
    assert!(change["words"].as_str().unwrap().starts_with("stick-out longer by 8.99"));
    let by = change["by_mm"].as_f64().unwrap();
    let tolerance = why["tolerance_mm"].as_f64().unwrap();
    for (by, expected) in [(by, "accessible"), (by - 2.0 * tolerance, "inaccessible")] {
        let cutter = format!("1.5,{},40,5", 6.0 + by);
        label(&folder, "changed", &cutter, &["--directions", "up"]);
        let why = explain(&folder, "changed", &["--site", &site]);
        assert_eq!((&why["answer"], &why["in_file"]), (&expected.into(), &expected.into()));
        assert_eq!(why["witness"].is_null(), expected == "inaccessible");
    }
}

#[test]
fn an_accessible_site_has_a_witness_and_every_answer_a_picture() {
    let folder = Folder::new();
    label(&folder, "out", "1.5,20,3,20", &["--directions", "up"]);
    let out = folder.path("out");
    let shown = deepmill(&["explain", &out, "--at", "0,20,2"]);
    let words = text(&shown.stdout);
    assert!(shown.status.success() && words.contains("by the reference engine"), "{words}");
    let picture = words.lines().find_map(|line| line.strip_prefix("written ")).unwrap();
    let bytes = std::fs::read(picture).unwrap();
    assert!(bytes.starts_with(b"\x89PNG") && picture.starts_with(&out), "{picture}");
    let named = folder.path("shots/slot.png");
    let why = json(&deepmill(&["explain", &out, "--at", "0,20,0", "--json", "--picture", &named]));
    assert_eq!(why["files"][0], named);
    assert!(Path::new(&named).is_file() && why["distance_mm"].as_f64().unwrap() < 3.0);
    assert!(why["other_direction"][2].as_f64().unwrap() < 0.0, "from below: {why}");
}

#[test]
fn the_published_definition_fixtures_and_tools_of_a_table_are_asked_again() {
    let folder = Folder::new();
    for obstacles in ["published", "500", "centroids"] {
        let more = ["--obstacles", obstacles, "--bottom", "none", "--directions", "150"];
        label(&folder, "points", "1.5,6,40,5", &more);
        for site in ["0", "150", "399", "599"] {
            let why = explain(&folder, "points", &["--site", site]);
            assert_eq!(why["answer"], why["in_file"], "{obstacles} {site}");
            assert_eq!(why["witness"].is_null(), why["answer"] == "inaccessible");
        }
    }
    label(&folder, "ruled", "1.5,6,40,5", &["--obstacles", "published"]);
    let why = explain(&folder, "ruled", &["--at", "0,20,0"]);
    let answers = ["answer", "in_file", "at_bottom"].map(|key| why[key].clone());
    assert_eq!(answers, ["inaccessible".into(), "accessible".into(), Value::Bool(true)], "{why}");
    let clamp = folder.file("clamp.stl", stl(&block([-4.0, 10.0, 12.0], [4.0, 30.0, 19.0])));
    let more = ["--fixture", &clamp, "--table", "-5", "--directions", "up"];
    label(&folder, "fixed", "1.5,30,3,20", &more);
    std::fs::remove_file(&clamp).unwrap();
    let why = explain(&folder, "fixed", &["--at", "0,20,2"]);
    assert_eq!((&why["answer"], &why["in_file"]), (&"inaccessible".into(), &"inaccessible".into()));
    let what = why["nearest"]["what"].as_str().unwrap();
    assert!(what.ends_with("of the fixtures"), "{what}");

    let table =
        folder.file("shop.csv", "name,CR,CH,FR,FH,corner\nwide,1.5,6,40,5,\nflat,1,20,3,20,0\n");
    let (part, out) = (folder.file("slot.stl", slotted()), folder.path("shop"));
    let args = ["label", &part, "--tools", &table, "--out", &out, "--sites", "300", "--no-picture"];
    assert!(deepmill(&args).status.success());
    for tool in ["wide", "flat"] {
        let why = explain(&folder, &format!("shop/{tool}"), &["--at", "0,20,2"]);
        assert_eq!(why["answer"], why["in_file"], "{tool}");
    }
    let message = failure(&deepmill(&["explain", &out, "--site", "1"]), 1);
    assert!(message.contains("one of its tools: wide, flat"), "{message}");
}

#[test]
fn findings_name_the_part_that_blocks_and_a_change_that_helps() {
    let folder = Folder::new();
    let (part, out) = (folder.file("slot.stl", slotted()), folder.path("out"));
    let args = ["label", &part, "--cutter", "1.5,6,40,5", "--out", &out, "--sites", "2000"];
    let result = json(&deepmill(&[&args[..], &["--no-picture", "--json"]].concat()));
    let list = result["findings"]["findings"].as_array().unwrap();
    let floor = list.iter().find(|found| found["normal"][2].as_f64().unwrap() > 0.9).unwrap();
    assert_eq!((&floor["cause"], &floor["blocked_by"]), (&"inaccessible".into(), &"holder".into()));
    let change = &floor["change"];
    assert!(change["words"].as_str().unwrap().starts_with("stick-out longer by 9 mm"), "{change}");
    assert!(change["share"].as_f64().unwrap() > 0.6, "{change}");
    let below = list.iter().find(|found| found["normal"][2].as_f64().unwrap() < -0.9).unwrap();
    assert_eq!((&below["blocked_by"], &below["change"]), (&"cutter".into(), &Value::Null));
    let csv = std::fs::read_to_string(folder.path("out/findings.csv")).unwrap();
    assert!(csv.contains(",holder,") && csv.contains("stick-out longer by"), "{csv}");
    let drawn = deepmill(&["report", &folder.path("out")]);
    assert!(drawn.status.success(), "{}", text(&drawn.stderr));
    let page = std::fs::read_to_string(folder.path("out/report.html")).unwrap();
    assert!(page.contains("inaccessible, by the holder") && page.contains("stick-out longer by"));
}

/// The slot is 10 mm wide and 18 mm deep: the cutter of 16 mm does not fit.
#[test]
fn proposals_are_tools_that_someone_sells_or_has() {
    let folder = Folder::new();
    label(&folder, "out", "8,20,20,30", &["--directions", "up"]);
    let at = ["--at", "0,20,2"];
    let why = explain(&folder, "out", &at);
    let change = &why["changes"][0];
    assert_eq!(change["kind"], "diameter", "{why}");
    let words = change["words"].as_str().unwrap();
    // The widest that has room beside the nearer wall, rounded down to what is sold. A ball of radius 4 reaches the
    // site within the tolerances from 0.4 mm beside it.
    let room = |shift: f64| 2.0 * (5.0 - why["at_mm"][0].as_f64().unwrap().abs() + 0.01 + shift);
    let [least, most] =
        [0.0, 0.4].map(|shift| deepmill::access::surface::explain::sold_diameter(room(shift)));
    let is_sold = |k: u32| {
        let diameter = least + 0.5 * f64::from(k);
        let expected = format!("cutter of diameter {diameter} instead of 16 mm");
        diameter <= most && words.starts_with(&expected)
    };
    assert!((0..3).any(is_sold), "{words}, {least} to {most}");
    let thin = explain(&folder, "out", &[&at[..], &["--least-diameter", "12"]].concat());
    assert_eq!(thin["changes"], serde_json::json!([]), "{thin}");
    // Of a library: the tools that reach, thick ones first; nothing that is not in it.
    let table = "name,CR,CH,FR,FH\nD2,1,40,20,30\nD6,3,30,20,30\nD12,6,30,20,30\n";
    let table = folder.file("shop.csv", table);
    let why = explain(&folder, "out", &[&at[..], &["--library", &table]].concat());
    assert_eq!(why["changes"], serde_json::json!([]), "{why}");
    let names = why["library"].as_array().unwrap().iter().map(|tool| tool["name"].clone());
    assert_eq!(names.collect::<Vec<_>>(), ["D6", "D2"]);
}

/// The holder of a tool 26 mm long stands 9 mm above the tip; 18 mm would do, which leaves too little of a tool of 16
/// mm.
#[test]
fn a_stick_out_beyond_the_overall_length_is_said_and_not_proposed() {
    let folder = Folder::new();
    let part = folder.file("slot.stl", slotted());
    let reach = |overall: &str| {
        let csv = format!("name,CR,CH,FR,FH,overall\nD3,1.5,6,40,5,{overall}\n");
        let (tools, out) = (folder.file("shop.csv", csv), folder.path("out"));
        let args = ["label", &part, "--tools", &tools, "--out", &out, "--sites", "2000"];
        let more = ["--no-picture", "--json"];
        let result = json(&deepmill(&[&args[..], &more].concat()));
        let list = result["findings"]["findings"].as_array().unwrap().clone();
        (list, explain(&folder, "out/D3", &["--at", "0,20,2"]))
    };
    let (list, why) = reach("26");
    let longer = "stick-out longer by ";
    let words = |found: &Value| found["change"]["words"].as_str().map(str::to_owned);
    assert!(list.iter().filter_map(words).any(|words| words.starts_with(longer)), "{list:?}");
    assert!(why["changes"][0]["words"].as_str().unwrap().starts_with(longer), "{why}");
    assert_eq!(why["stopped"], Value::Null);
    let (list, why) = reach("16");
    assert_eq!(why["changes"], serde_json::json!([]), "{why}");
    assert!(list.iter().all(|found| !words(found).is_some_and(|w| w.starts_with("holder"))));
    let words = "overall length of 16 mm";
    let is_said = |found: &Value| found["stopped"].as_str().is_some_and(|w| w.contains(words));
    assert!(list.iter().any(is_said), "{list:?}");
    assert!(why["stopped"]["words"].as_str().unwrap().contains(words), "{why}");
    assert_eq!(why["stopped"]["by_overall_length"], true);
}

#[test]
fn a_finding_that_is_too_large_is_exit_code_3_with_its_place() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let csv = folder.file("shop.csv", "name,CR,CH,FR,FH\nD3,1.5,6,40,5\n");
    for (command, tools) in [
        ("label", ["--cutter", command::CUTTER]),
        ("tools", ["--library", &csv]),
        ("predict", ["--cutter", command::CUTTER]),
    ] {
        let run = |limit: &str| {
            let args = [command, &part, tools[0], tools[1], "--out", &out, "--sites", "300"];
            let mut args = [&args[..], &["--no-picture", "--fail-if", limit]].concat();
            if command == "predict" {
                args.push("--far");
            }
            deepmill(&args)
        };
        let kept = run("finding>1e9mm2");
        assert_eq!(kept.status.code(), Some(0), "{}", text(&kept.stderr));
        let broken = run("finding<1e9 mm2");
        let words = text(&broken.stderr);
        assert_eq!(broken.status.code(), Some(3), "{words}");
        assert!(words.trim_end().ends_with("finding<1000000000mm2"), "{words}");
    }
    // On the underside.
    let args = ["label", &part, "--cutter", command::CUTTER, "--out", &out, "--sites", "300"];
    let broken = deepmill(&[&args[..], &["--no-picture", "--fail-if", "finding>50mm2"]].concat());
    let words = text(&broken.stderr);
    let last = words.lines().last().unwrap();
    assert!(broken.status.code() == Some(3) && last.starts_with("limit broken: "), "{words}");
    assert!(last.contains("the largest of ") && last.contains(", 0, is "), "{last}");
}

#[test]
fn folders_that_do_not_hold_the_query_are_refused_with_a_remedy() {
    let folder = Folder::new();
    label(&folder, "out", "1.5,6,40,5", &["--directions", "up"]);
    let out = folder.path("out");
    let refused = |args: &[&str], code: i32, expected: &str| {
        let message = failure(&deepmill(&[&["explain"], args].concat()), code);
        assert!(message.contains(expected), "{args:?}: {message}");
    };
    refused(&[&out, "--site", "600"], 2, "below 600");
    refused(&[&out, "--at", "1,2"], 2, "12.5,30,4");
    refused(&[&out, "--at", "1,2,nan"], 2, "12.5,30,4");
    refused(&[&folder.path(""), "--site", "0"], 1, "holds no labels.npz");
    refused(&[&folder.path("none"), "--site", "0"], 1, "cannot be read");
    refused(&[&folder.path("slot.stl"), "--site", "0"], 1, "slot.stl");
    assert_eq!(deepmill(&["explain", &out]).status.code(), Some(2), "which site");

    let surface = folder.path("out/part.stl");
    let whole = std::fs::read(&surface).unwrap();
    std::fs::write(&surface, stl(&block([0.0; 3], [1.0; 3]))).unwrap();
    refused(&[&out, "--site", "0"], 1, "SHA-256");
    std::fs::remove_file(&surface).unwrap();
    refused(&[&out, "--site", "0"], 1, "--part FILE");
    let part = folder.path("slot.stl");
    let again = explain(&folder, "out", &["--site", "0", "--part", &part]);
    assert_eq!(again["answer"], again["in_file"]);
    refused(&[&out, "--site", "0", "--part", &folder.block()], 1, "another one");
    std::fs::write(&surface, &whole).unwrap();

    let labels = folder.path("out/labels.npz");
    let bytes = std::fs::read(&labels).unwrap();
    for cut in [0, 30, bytes.len() / 2] {
        std::fs::write(&labels, &bytes[..cut]).unwrap();
        refused(&[&out, "--site", "0"], 1, "labels.npz");
    }
}

/// A file of labels with other settings.
fn with_settings(path: &str, change: impl Fn(&mut AnalysisSettings)) {
    let mut file = LabelFile::read(path.as_ref()).unwrap();
    change(&mut file.provenance.settings);
    file.write(path.as_ref()).unwrap();
}

#[test]
fn settings_that_are_missing_or_wrong_are_named() {
    let folder = Folder::new();
    label(&folder, "out", "1.5,6,40,5", &["--directions", "up"]);
    let (out, labels) = (folder.path("out"), folder.path("out/labels.npz"));
    let bytes = std::fs::read(&labels).unwrap();
    let huge = DirectionSet::FibonacciSphere { n_dirs: 1_000_000_000_000_000 };
    let huge = &huge;
    type Change<'a> = &'a dyn Fn(&mut AnalysisSettings);
    let cases: [(Change, &str); 7] = [
        (&|s| s.surface = None, "--part FILE"),
        (&|s| s.definition = Some(Definition::PartInSpace), "label the part again"),
        (&|s| s.directions = None, "settings.directions"),
        (&|s| s.directions = Some(huge.clone()), "1000000"),
        (&|s| s.tool = None, "settings.tool.corner_mm"),
        (&|s| s.tool.as_mut().unwrap().corner_mm = Some(-3.0), "corner"),
        (&|s| s.part_itself = None, "settings.part_itself"),
    ];
    for (change, expected) in cases {
        std::fs::write(&labels, &bytes).unwrap();
        with_settings(&labels, change);
        let message = failure(&deepmill(&["explain", &out, "--site", "0"]), 1);
        assert!(message.contains("labels.npz") && message.contains(expected), "{message}");
    }
    // Fixtures whose triangles an older version did not keep.
    std::fs::write(&labels, &bytes).unwrap();
    with_settings(&labels, |s| s.part_itself.as_mut().unwrap().table_z_mm = Some(-5.0));
    let message = failure(&deepmill(&["explain", &out, "--site", "0"]), 1);
    assert!(message.contains("their triangles are not kept"), "{message}");
}
