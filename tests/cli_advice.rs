//! What the commands say about lengths of the part: corners, slots, thin walls.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, block, deepmill, failure, grooved, json, stl, text};
use serde_json::Value;

fn label(folder: &Folder, part: &str, tool: &[&str], more: &[&str]) -> std::process::Output {
    let out = folder.path("out");
    let args = ["label", part, "--out", &out, "--directions", "up", "--sites", "2500"];
    deepmill(&[&args[..], &["--no-picture"], tool, more].concat())
}

/// The advice of a finding about the groove.
fn advice(result: &Value) -> Vec<Value> {
    let findings = result["findings"]["findings"].as_array().unwrap();
    findings.iter().flat_map(|finding| finding["advice"].as_array().unwrap().clone()).collect()
}

#[test]
fn sharp_corners_of_a_pocket_need_the_radius_of_the_ball_in_every_form() {
    let folder = Folder::new();
    let part = grooved(&folder, 20.0, 8.0);
    let tool = ["--cutter", "3,20,30,20"];
    let result = json(&label(&folder, &part, &tool, &["--json", "--report"]));
    let all = advice(&result);
    assert!(!all.is_empty(), "{result}");
    let close = |value: &Value, x: f64, by: f64| (value.as_f64().unwrap() - x).abs() <= by;
    let mut freed = 0.0;
    for one in &all {
        assert_eq!((&one["kind"], &one["unit"]), (&"corner-radius".into(), &"mm".into()), "{one}");
        assert!(close(&one["from"], 0.0, 1e-9) && close(&one["to"], 3.0, 1e-9), "{one}");
        let words = one["words"].as_str().unwrap();
        assert!(words.starts_with("corner radius 0 → 3 mm frees "), "{words}");
        freed += one["frees_mm2"].as_f64().unwrap();
    }
    // Two corners, 30 mm long, with 3 mm of floor and of wall at each; near the ends of these the tolerances decide.
    assert!((264.0..=360.0).contains(&freed), "{freed}");
    let file = std::fs::read_to_string(folder.path("out/findings.json")).unwrap();
    let file: Value = serde_json::from_str(&file).unwrap();
    assert_eq!(file["findings"], result["findings"]["findings"], "the file holds the same");
    let page = std::fs::read_to_string(folder.path("out/report.html")).unwrap();
    assert!(page.contains("of the part: corner radius 0 → 3 mm frees "));
    let said = text(&label(&folder, &part, &tool, &[]).stdout);
    assert!(said.contains(": of the part, corner radius 0 → 3 mm frees "), "{said}");

    let out = folder.path("out");
    let explain = ["explain", &out, "--at", "13,15,12", "--no-picture"];
    let why = json(&deepmill(&[&explain[..], &["--json"]].concat()));
    assert_eq!(why["advice"][0]["words"], "corner radius 0 → 3 mm", "{why}");
    let said = text(&deepmill(&explain).stdout);
    assert!(said.contains("Of the part would help: corner radius 0 → 3 mm."), "{said}");
    let why = json(&deepmill(&["explain", &out, "--at", "22,15,12", "--no-picture", "--json"]));
    assert_eq!((&why["answer"], &why["advice"]), (&"accessible".into(), &Value::Array(vec![])));
}

#[test]
fn a_slot_too_narrow_is_named_with_its_depth_and_the_width_that_the_tool_needs() {
    let folder = Folder::new();
    let part = grooved(&folder, 4.0, 6.0);
    let tool = ["--cutter", "3,20,30,20", "--corner", "0"];
    let all = advice(&json(&label(&folder, &part, &tool, &["--json"])));
    let slot = all.iter().find(|one| one["kind"] == "slot-width").unwrap();
    assert_eq!((&slot["from"], &slot["to"]), (&4.0.into(), &6.02.into()), "{slot}");
    assert_eq!(slot["depth_mm"], 6.0);
    let area = slot["frees_mm2"].as_f64().unwrap();
    assert!((area - 30.0 * (6.0 + 4.0 + 6.0)).abs() < 40.0, "{area}");
    // At one place of the floor.
    let explain = ["explain", &folder.path("out"), "--at", "22,15,14", "--no-picture", "--json"];
    let why = json(&deepmill(&explain));
    let words = "slot width 4 → 6.02 mm (6 mm deep, depth/width 1.5)";
    assert_eq!(why["advice"][0]["words"], words, "{why}");
}

#[test]
fn where_no_tool_reaches_the_tool_that_needs_the_least_change_of_the_part_is_named() {
    let folder = Folder::new();
    let part = grooved(&folder, 20.0, 8.0);
    // A wide ball, a thinner one, and one whose holder meets the part.
    let table = "name,CR,CH,FR,FH\nD10,5,20,30,20\nD6,3,20,30,20\nD2,1,0.5,30,20\n";
    let tools = folder.file("tools.csv", table);
    let tool = ["--tools", &tools];
    let result = json(&label(&folder, &part, &tool, &["--json", "--report"]));
    let all = advice(&result);
    let corners: Vec<_> = all.iter().filter(|one| one["kind"] == "corner-radius").collect();
    assert!(!corners.is_empty(), "{result}");
    for one in corners {
        assert_eq!((&one["tool"], &one["to"]), (&"D6".into(), &3.0.into()), "{one}");
        let words = one["words"].as_str().unwrap();
        assert!(words.starts_with("corner radius 0 → 3 mm frees "), "{words}");
        assert!(words.ends_with(" for D6"), "{words}");
    }
    // The change of a tool is one of those that are there.
    let findings = result["findings"]["findings"].as_array().unwrap();
    let changes = findings.iter().filter_map(|finding| finding["change"]["words"].as_str());
    let changes: Vec<&str> = changes.collect();
    assert!(!changes.is_empty(), "{result}");
    for words in changes {
        assert!(["D10: ", "D6: ", "D2: "].iter().any(|name| words.starts_with(name)), "{words}");
    }
    // `report` says the same of what it reads.
    let out = folder.path("out");
    let again = json(&deepmill(&["report", &out, "--json"]));
    assert_eq!(again["findings"]["findings"], result["findings"]["findings"]);
}

#[test]
fn a_report_names_axes_that_were_not_tested_as_the_labels_do() {
    let folder = Folder::new();
    let part = folder.block();
    let out = folder.path("out");
    let args = ["label", &part, "--out", &out, "--directions", "up", "--sites", "1500", "--json"];
    let result =
        json(&deepmill(&[&args[..], &["--cutter", "3,20,30,20", "--no-picture"]].concat()));
    let opens = result["findings"]["findings"][0]["opens"].clone();
    assert_eq!(opens[0]["axis"], "-z", "{result}");
    deepmill(&["report", &out]);
    let page = std::fs::read_to_string(folder.path("out/report.html")).unwrap();
    assert!(page.contains("which was not tested: -z"), "the page");
}

#[test]
fn a_block_that_is_reached_has_no_advice() {
    let folder = Folder::new();
    let part = folder.block();
    let tool = ["--cutter", "3,20,30,20", "--except", "normal:0,0,-1"];
    let result = json(&label(&folder, &part, &tool, &["--json"]));
    assert!(advice(&result).is_empty(), "{result}");
}

#[test]
fn thin_walls_are_found_below_a_limit_and_can_fail_a_check() {
    let folder = Folder::new();
    let web = folder.file("web.stl", stl(&block([0.0; 3], [40.0, 1.5, 20.0])));
    let check = |more: &[&str]| deepmill(&[&["check", &web], more].concat());
    let thin = json(&check(&["--thin-wall", "2", "--json"]))["thin_walls"].clone();
    assert!((thin["area_mm2"].as_f64().unwrap() - 1600.0).abs() < 40.0, "{thin}");
    assert!((thin["least_mm"].as_f64().unwrap() - 1.5).abs() < 1e-5, "{thin}");
    let said = text(&check(&["--thin-wall", "2"]).stdout);
    assert!(said.contains("the thinnest wall is 1.5 mm thick"), "{said}");
    let thin =
        json(&check(&["--thin-wall", "1", "--json", "--fail-if-thin"]))["thin_walls"].clone();
    assert_eq!(thin["walls"], Value::Array(vec![]), "{thin}");
    let failed = check(&["--thin-wall", "2", "--fail-if-thin"]);
    assert_eq!(failed.status.code(), Some(3));
    let said = text(&failed.stderr);
    assert!(said.contains("walls thinner than 2 mm"), "{said}");
    let said = failure(&check(&["--thin-wall", "0"]), 2);
    assert!(said.contains("--thin-wall"), "{said}");
    assert_eq!(json(&check(&["--json"]))["thin_walls"], Value::Null);
}

#[test]
fn an_undercut_names_the_axes_that_reach_it() {
    let folder = Folder::new();
    // A groove along y that opens to +z, looked at from +x alone.
    let part = grooved(&folder, 12.0, 8.0);
    let out = folder.path("out");
    let args = ["label", &part, "--out", &out, "--sites", "3000", "--no-picture", "--report"];
    let result = json(&deepmill(
        &[&args[..], &["--cutter", "2,60,4,30", "--directions", "list:1,0,0", "--json"]].concat(),
    ));
    let findings = result["findings"]["findings"].as_array().unwrap();
    let opens = |finding: &Value| -> Vec<(String, f64)> {
        let list = finding["opens"].as_array().unwrap();
        let of = |o: &Value| (o["axis"].as_str().unwrap().into(), o["share"].as_f64().unwrap());
        list.iter().map(of).collect()
    };
    let facing = |finding: &&Value, normal: [f64; 3]| {
        let n = finding["normal"].as_array().unwrap();
        (0..3).all(|k| (n[k].as_f64().unwrap() - normal[k]).abs() < 0.1)
    };
    // The face at x = 0 looks away from the tool. From -x all of it is reached, as by the side of the tool.
    let away = findings.iter().find(|f| facing(f, [-1.0, 0.0, 0.0])).unwrap();
    let found = opens(away);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found.iter().all(|(axis, share)| axis != "+x" && *share > 0.85), "{found:?}");
    assert!(found[0].1 > 0.99, "{found:?}");
    // Of the groove, walls and floor but for the corners, from above and along it.
    let groove = findings.iter().find(|f| {
        let (low, high) = (&f["low_mm"], &f["high_mm"]);
        low[2].as_f64().unwrap() > 11.0 && high[0].as_f64().unwrap() < 29.0 && f != &away
    });
    let found = opens(groove.unwrap());
    assert!(["+y", "-y", "+z"].contains(&&*found[0].0), "{found:?}");
    // Floor of 12 of which 2 at each wall are left, walls of 8 of which 2 above the floor are: 20 of 28.
    assert!((found[0].1 - 20.0 / 28.0).abs() < 0.08, "{found:?}");
    let page = std::fs::read_to_string(folder.path("out/report.html")).unwrap();
    assert!(page.contains("which was not tested: "));
    // A set of the whole sphere leaves no axis out.
    let whole = &["--cutter", "2,60,4,30", "--directions", "sphere:500", "--json"][..];
    let result = json(&deepmill(&[&args[..], whole].concat()));
    let findings = result["findings"]["findings"].as_array().unwrap();
    assert!(findings.iter().all(|finding| opens(finding).is_empty()));
}

#[test]
fn a_page_that_is_drawn_again_is_that_of_the_labels() {
    let folder = Folder::new();
    let (part, out) = (grooved(&folder, 20.0, 8.0), folder.path("out"));
    let tools = folder.file("two.csv", "name,CR,CH,FR,FH\nD6,3,14,20,30\nD2,1,12,20,30\n");
    let label = ["label", &part, "--out", &out, "--sites", "800", "--no-picture", "--report"];
    let page = || std::fs::read(folder.path("out/report.html")).unwrap();
    for more in [
        &["--cutter", "3,14,20,30", "--table", "-1"][..],
        &["--cutter", "3,14,20,30", "--rest", "--only", "box:0,0,0,20,30,20"],
        &["--tools", &tools, "--directions", "up"],
    ] {
        assert!(deepmill(&[&label[..], more].concat()).status.success());
        let written = page();
        std::fs::remove_file(folder.path("out/report.html")).unwrap();
        let again = deepmill(&["report", &out]);
        assert!(again.status.success(), "{}", text(&again.stderr));
        assert!(page() == written, "{more:?}");
    }
}
