//! What `explain` says of a tool given by its profile.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, deepmill, json, t_slot, text};
use serde_json::Value;

fn labeled(folder: &Folder, profile: &str, stick_out: &str) -> String {
    labeled_with(folder, profile, stick_out, &[])
}

fn labeled_with(folder: &Folder, profile: &str, stick_out: &str, options: &[&str]) -> String {
    let part = folder.file("slot.stl", t_slot());
    let table = format!("T, name, profile, stick_out\n8, cutter, {profile}, {stick_out}\n");
    let tools = folder.file("tools.csv", table);
    let holder = folder.file("holder.csv", "height,lower,upper\n30,40,40\n");
    let out = folder.path("out");
    let args = ["label", &part, "--tools", &tools, "--holder", &holder, "--out", &out];
    let more = ["--sites", "1500", "--directions", "up", "--no-picture", "--json"];
    json(&deepmill(&[&args[..], &more, options].concat()));
    folder.path("out/cutter")
}

fn explain(result: &str, at: &str, more: &[&str]) -> Value {
    let args = ["explain", result, "--at", at, "--nearest", "--json"];
    json(&deepmill(&[&args[..], more].concat()))
}

#[test]
fn a_neck_that_is_too_wide_is_named_and_drawn_and_a_thinner_one_proposed_if_any_tool_may_be() {
    let folder = Folder::new();
    let result = labeled(&folder, "10.5:0 10.5:8.9 5.6:8.9 | 5.6:50 8:50", "60");
    let why = explain(&result, "10.6,-20,23.5", &["--any-tool"]);
    assert_eq!((&why["answer"], &why["blocked_by"]), (&"inaccessible".into(), &"shank".into()));
    assert_eq!((&why["answer"], &why["retreat_unproven"]), (&why["in_file"], &false.into()));
    // So do labels and findings of all sites.
    let table = std::fs::read_to_string(format!("{result}/findings.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    let at = rows[0].iter().position(|heading| *heading == "blocked_by").unwrap();
    assert!(rows[1..].iter().any(|row| row[at] == "shank"), "{table}");
    let nearest = &why["nearest"];
    assert_eq!(nearest["state"], "blocked");
    assert!((nearest["penetration_mm"].as_f64().unwrap() - 0.18).abs() < 0.01, "{nearest}");
    let change = &why["changes"][0];
    assert_eq!((&change["kind"], &change["part"]), (&"thinner".into(), &"shank".into()));
    assert!(change["words"].as_str().unwrap().starts_with("neck thinner by 0.1"), "{change}");
    let profile = change["tool"]["profile"].as_str().unwrap();
    assert!(profile.starts_with("10.5:0 10.5:8.9 5.4"), "{profile}");
    let picture = why["files"][0].as_str().unwrap();
    assert!(std::fs::read(picture).unwrap().starts_with(b"\x89PNG"));
    // A tool of a file: what there is.
    let why = explain(&result, "10.6,-20,23.5", &["--no-picture"]);
    assert_eq!(why["changes"], serde_json::json!([]));
    let said = deepmill(&["explain", &result, "--at", "10.6,-20,23.5", "--nearest", "--any-tool"]);
    let said = text(&said.stdout);
    for words in ["the shank penetrates by 0.1", "Would help: neck thinner by", "less by 0.01 mm"] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn a_holder_that_is_too_low_needs_a_longer_stick_out_and_a_free_tool_may_be_lowered() {
    let folder = Folder::new();
    let result = labeled(&folder, "10.5:0 10.5:8.9 4:8.9 | 4:100", "15");
    let why = explain(&result, "0,-20,19", &["--no-picture"]);
    assert_eq!((&why["blocked_by"], &why["counts"]["holder"]), (&"holder".into(), &1.into()));
    let change = &why["changes"][0];
    assert_eq!(change["kind"], "longer");
    assert!((change["by_mm"].as_f64().unwrap() - 5.98).abs() < 0.03, "{change}");
    let result = labeled(&folder, "10.5:0 10.5:8.9 4:8.9 | 4:100", "60");
    let why = explain(&result, "10.6,-20,23.5", &["--no-picture"]);
    assert_eq!((&why["answer"], &why["nearest"]), (&"accessible".into(), &Value::Null));
    let tip = why["witness"]["tip_mm"][2].as_f64().unwrap();
    let margin = why["witness"]["margin_mm"].as_f64().unwrap();
    assert!((tip - margin - 18.99).abs() < 1e-2, "{tip} {margin}");
}

#[test]
fn stock_to_leave_is_part_of_labels_and_explanations_of_a_profile() {
    // A disc 8 high leaves 0.4 on both faces of a slot 9 high, and not 0.6.
    for (allowance, answer) in [("0.4", "accessible"), ("0.6", "tip-does-not-fit")] {
        let folder = Folder::new();
        let disc = "10:0 10:8 4.5:8 | 4.5:50 8:50";
        let result = labeled_with(&folder, disc, "60", &["--allowance", allowance]);
        let why = explain(&result, "10.6,-20,23.5", &[]);
        assert_eq!((&why["answer"], &why["in_file"]), (&answer.into(), &answer.into()));
        // Without stock it fits.
        let why = explain(&result, "10.6,-20,23.5", &["--allowance", "0", "--no-picture"]);
        assert_eq!(why["answer"], "accessible");
    }
}
