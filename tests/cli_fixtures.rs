//! Fixtures: what is wrong with them is said with its number, and what they keep out of reach by their name.
#![cfg(feature = "cli")]

mod command;

use command::{Corner, Folder, block, deepmill, json, stl, text};
use serde_json::Value;

/// Labels of a block 40 × 30 × 20 with fixtures, from above with a flat end; what was warned.
fn label(folder: &Folder, fixtures: &[(&str, Vec<[Corner; 3]>)], more: &[&str]) -> (Value, String) {
    let (part, out) = (folder.block(), folder.path("out"));
    let files: Vec<String> = fixtures
        .iter()
        .flat_map(|(name, mesh)| ["--fixture".into(), folder.file(name, stl(mesh))])
        .collect();
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let args = ["label", &part, "--cutter", "2,40,5,30", "--corner", "0", "--directions", "up"];
    let shown = ["--sites", "3000", "--no-picture", "--out", &out, "--json"];
    let output = deepmill(&[&args[..], &shown, &files, more].concat());
    let warned = text(&output.stderr);
    let warned: Vec<&str> = warned.lines().filter(|line| line.starts_with("warning:")).collect();
    (json(&output), warned.join("\n"))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

#[test]
fn what_fixtures_keep_out_of_reach_has_their_names() {
    let folder = Folder::new();
    // It covers 10 × 30 of the top, which has 5200 mm² around it; the underside is out of reach without it.
    let clamp = block([0.0, 0.0, 20.0], [10.0, 30.0, 30.0]);
    let (one, warned) = label(&folder, &[("clamp.stl", clamp.clone())], &[]);
    assert_eq!(warned, "", "a clamp that lies on the part is no fault");
    let kept = |result: &Value, k: usize| number(&result["fixtures"][k], "keeps_out");
    assert!((kept(&one, 0) - 300.0 / 5200.0).abs() < 0.004, "{one}");
    assert_eq!(one["fixtures"][0]["fixture"], "clamp.stl");
    let list = &one["findings"]["findings"];
    assert!((number(&list[0], "area_mm2") - 1200.0).abs() < 40.0 && list[0]["fixture"].is_null());
    assert!((number(&list[1], "area_mm2") - 300.0).abs() < 25.0, "{list}");
    assert_eq!(
        (&list[1]["fixture"]["fixture"], number(&list[1]["fixture"], "share")),
        (&"clamp.stl".into(), 1.0)
    );
    let csv = std::fs::read_to_string(format!("{}/findings.csv", folder.path("out"))).unwrap();
    assert!(csv.lines().nth(2).unwrap().contains(",clamp.stl,1.0,"), "{csv}");

    // Two clamps, one on the other over half of the top: there each alone is enough to keep the tool off.
    let [left, both] =
        [block([0.0, 0.0, 20.0], [10.0, 30.0, 30.0]), block([0.0, 0.0, 31.0], [20.0, 30.0, 40.0])];
    let (two, _) = label(&folder, &[("left.stl", left), ("top.stl", both)], &["--table", "-1"]);
    let names: Vec<&str> =
        (0..4).map(|k| two["fixtures"][k]["fixture"].as_str().unwrap()).collect();
    assert_eq!(names, ["left.stl", "top.stl", "table", "several fixtures"]);
    let shares = [0, 1, 2, 3].map(|k| kept(&two, k));
    for (share, mm2) in shares.into_iter().zip([0.0, 300.0, 0.0, 300.0]) {
        assert!((share - mm2 / 5200.0).abs() < 0.006, "{shares:?}");
    }
}

#[test]
fn a_fixture_that_overlaps_encloses_or_is_open_warns_with_the_number() {
    let folder = Folder::new();
    let jaw = block([-10.0, 5.0, 0.0], [2.0, 25.0, 10.0]);
    let (_, warned) = label(&folder, &[("jaw.stl", jaw)], &[]);
    assert!(warned.contains("jaw.stl overlaps the part by 400.00 mm³ (1.667 % of it)"), "{warned}");
    let box_ = block([-5.0; 3], [45.0, 35.0, 25.0]);
    let (result, warned) = label(&folder, &[("box.stl", box_.clone())], &[]);
    assert!(
        warned.contains("box.stl encloses the part") && warned.contains("100.000 % of it"),
        "{warned}"
    );
    assert_eq!(number(&result, "accessible"), 0.0);
    let inner = block([-1.0; 3], [41.0, 31.0, 21.0]).into_iter().map(|[a, b, c]| [a, c, b]);
    let shell: Vec<[Corner; 3]> = box_.iter().copied().chain(inner).collect();
    let (_, warned) = label(&folder, &[("shell.stl", shell)], &[]);
    assert!(
        warned.contains("shell.stl encloses the part") && !warned.contains("overlaps"),
        "{warned}"
    );
    let open = block([50.0; 3], [60.0; 3])[1..].to_vec();
    let (_, warned) = label(&folder, &[("open.stl", open)], &[]);
    assert!(warned.contains("open.stl is open (3 edges"), "{warned}");
}

#[test]
fn pictures_and_the_page_show_where_fixtures_are_and_report_draws_them_again() {
    let folder = Folder::new();
    let clamp = block([0.0, 0.0, 20.0], [10.0, 30.0, 30.0]);
    let page = |name: &str| std::fs::read_to_string(folder.path(&format!("{name}/report.html")));
    let (_, _) = label(&folder, &[], &["--report"]);
    let shown = "<svg id=\"outlines\"";
    assert!(!page("out").unwrap().contains(shown));
    let (_, _) = label(&folder, &[("clamp.stl", clamp.clone())], &["--report"]);
    assert!(page("out").unwrap().contains(shown));
    let again = ["report", &folder.path("out"), "--out", &folder.path("again")];
    assert!(deepmill(&again).status.success());
    assert!(page("again").unwrap().contains(shown));
    // Of several tools, the fixtures are in the folder above.
    let more = ["--cutter", "3,40,5,30", "--report"];
    let (_, _) = label(&folder, &[("clamp.stl", clamp)], &more);
    let mut entries = std::fs::read_dir(folder.path("out")).unwrap();
    let one = entries.find_map(|entry| entry.ok().map(|e| e.path()).filter(|p| p.is_dir()));
    let one = one.unwrap().display().to_string();
    let output = deepmill(&["report", &one, "--out", &folder.path("one")]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(page("one").unwrap().contains(shown) && page("out").unwrap().contains(shown));
}
