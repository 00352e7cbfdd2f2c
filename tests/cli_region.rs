//! A region of interest: areas, shares, findings and limits are of the faces that are asked about.
#![cfg(feature = "cli")]

mod command;

use command::{Corner, Folder, block, deepmill, failure, json, stl, text};
use serde_json::Value;
use std::path::Path;

/// A block 60 × 40 × 20 with a pocket 20 × 20, 10 deep, and a slot 3 wide, 5 deep.
fn part(folder: &Folder) -> String {
    let lines: [&[f32]; 3] =
        [&[0., 10., 30., 45., 48., 60.], &[0., 10., 30., 40.], &[0., 10., 15., 20.]];
    let is_filled = |x: f32, y: f32, z: f32| {
        let pocket = (10.0..30.0).contains(&x) && (10.0..30.0).contains(&y) && z > 10.0;
        let slot = (45.0..48.0).contains(&x) && z > 15.0;
        !pocket && !slot
    };
    let n = lines.map(|l| l.len() as i32 - 1);
    let filled = |c: [i32; 3]| {
        let middle = |k: usize| 0.5 * (lines[k][c[k] as usize] + lines[k][c[k] as usize + 1]);
        (0..3).all(|k| c[k] >= 0 && c[k] < n[k]) && is_filled(middle(0), middle(1), middle(2))
    };
    let mut all: Vec<[Corner; 3]> = Vec::new();
    for i in 0..n[0] * n[1] * n[2] {
        let cell = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
        let at = |side: i32| [0, 1, 2].map(|k| lines[k][(cell[k] + side) as usize]);
        if !filled(cell) {
            continue;
        }
        // The sides of a block come in pairs of triangles: -z, +z, -y, +y, -x, +x.
        let sides = block(at(0), at(1));
        for (k, (axis, step)) in
            [(2, -1), (2, 1), (1, -1), (1, 1), (0, -1), (0, 1)].into_iter().enumerate()
        {
            let mut next = cell;
            next[axis] += step;
            if !filled(next) {
                all.extend(&sides[2 * k..2 * k + 2]);
            }
        }
    }
    folder.file("part.stl", stl(&all))
}

const POCKET: &str = "box:10,10,10,30,30,19.999";
const UP: [&str; 2] = ["--directions", "up"];

fn run(folder: &Folder, command: &[&str], more: &[&str]) -> Value {
    let out = folder.path("out");
    let usual = ["--sites", "1200", "--no-picture", "--out", &out, "--json"];
    json(&deepmill(&[command, &usual, &UP, more].concat()))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

#[test]
fn areas_shares_and_findings_are_of_the_region_and_all_of_the_part_blocks() {
    let folder = Folder::new();
    let part = part(&folder);
    let label =
        |cutter: &str, more: &[&str]| run(&folder, &["label", &part, "--cutter", cutter], more);
    // Floor 20 × 20 and four walls 20 × 10; of the floor a ball R3 leaves 3 mm along the walls, and as much of these.
    let pocket = label("3,30,20,30", &["--only", POCKET]);
    let area = 400.0 + 800.0;
    assert!((number(&pocket["region"], "area_mm2") - area).abs() < 0.1, "{pocket}");
    assert!((number(&pocket["findings"], "surface_mm2") - area).abs() < 0.1);
    // Walls: the ball's equator touches them from 3 mm above the floor on, up to 3 mm from each corner. Within 0.01 mm
    // of finish and tolerance each, the ball is there some tenths of a millimeter earlier.
    let e = 0.3;
    let reached = (14.0 + 2.0 * e) * (14.0 + 2.0 * e) + 4.0 * (14.0 + 2.0 * e) * (7.0 + e);
    assert!((number(&pocket, "accessible") - reached / area).abs() < 0.02, "{pocket}");
    // A holder that stands on the rim keeps a short tool off the floor.
    let short = label("3,3,20,30", &["--only", "box:11,11,10,29,29,10"]);
    assert!(
        (number(&short["region"], "area_mm2") - 324.0).abs() < 1e-6
            && number(&short, "accessible") == 0.0
    );
    let up = label("3,30,20,30", &["--only", "normal:0,0,1"]);
    assert!((number(&up["region"], "area_mm2") - 2400.0).abs() < 1e-6, "{up}");
    let but = label("3,30,20,30", &["--only", "normal:0,0,1:5", "--except", POCKET]);
    assert!((number(&but["region"], "area_mm2") - 2000.0).abs() < 1e-6, "{but}");
    let [whole, lower] =
        [label("3,30,20,30", &[]), label("3,30,20,30", &["--except", "normal:0,0,-1"])];
    assert!(whole["region"].is_null() && pocket["warnings"][0].as_array().unwrap().is_empty());
    let part_mm2 = number(&but["region"], "part_area_mm2");
    assert!((number(&lower["region"], "area_mm2") - (part_mm2 - 2400.0)).abs() < 1e-6);
    let [all, without] = [&whole, &lower].map(|r| number(r, "accessible"));
    // 20,000 sites give 0.861 and 0.862; with 1200 the whole part is off by 0.007 of its own area.
    assert!((all * part_mm2 / (part_mm2 - 2400.0) - without).abs() < 0.015, "{all} {without}");

    let out = folder.path("out");
    let output = deepmill(
        &[
            &[
                "label",
                &part,
                "--cutter",
                "3,30,20,30",
                "--only",
                POCKET,
                "--out",
                &out,
                "--sites",
                "300",
                "--no-picture",
                "--report",
            ],
            &UP[..],
        ]
        .concat(),
    );
    let said = text(&output.stdout);
    let lines: Vec<&str> = said.lines().take(3).collect();
    assert!(
        lines[1].starts_with("tool axes") && lines[2].starts_with("region: only box:10"),
        "{said}"
    );
    let again = json(&deepmill(&["report", &out, "--json"]));
    let share = said.lines().find(|line| line.trim_start().starts_with("accessible ")).unwrap();
    let shown = format!("{:.1} %", 100.0 * number(&again["answers"][0], "accessible"));
    assert!(share.contains(&shown), "{share}, not {shown}");
    assert!(Path::new(&out).join("region.stl").is_file());
}

#[test]
fn the_smallest_ball_for_a_cavity_and_limits_of_a_region() {
    let folder = Folder::new();
    let part = part(&folder);
    let balls = "name,CR,CH,FR,FH\nR1,1,30,20,30\nR3,3,30,20,30\nR6,6,30,20,30\nR12,12,30,20,30\n";
    let balls = folder.file("balls.csv", balls);
    let needed = |more: &[&str]| {
        let result = run(&folder, &["tools", &part, "--library", &balls], more);
        let set = result["smallest_set"].as_array().unwrap().iter();
        (set.map(|row| row["name"].as_str().unwrap().to_string()).collect::<Vec<_>>(), result)
    };
    // The middle of the floor, 6 mm off the walls, is reached by the balls up to R6; the slot's floor by R1 alone.
    let (floor, result) = needed(&["--only", "box:16.1,16.1,10,23.9,23.9,10"]);
    assert_eq!(floor, ["R6"], "{result}");
    assert!((number(&result["region"], "area_mm2") - 7.8 * 7.8).abs() < 1e-6);
    assert!((number(&result["tools"][2], "reached_mm2") - 7.8 * 7.8).abs() < 1e-6);
    assert_eq!(number(&result["tools"][3], "reached"), 0.0);
    assert_eq!(needed(&["--only", "box:46.1,1,15,46.9,39,15"]).0, ["R1"]);
    assert_eq!(needed(&["--only", "normal:0,0,1", "--except", "box:0,0,0,60,40,19"]).0, ["R12"]);

    let out = folder.path("out");
    let limited = |region: &str, limit: &str| {
        let args =
            ["tools", &part, "--library", &balls, "--out", &out, "--no-picture", "--sites", "500"];
        let output = deepmill(&[&args[..], &UP, &["--only", region, "--fail-if", limit]].concat());
        (output.status.code(), text(&output.stderr))
    };
    assert_eq!(limited("box:16,16,10,24,24,10", "no-tool-reaches>0.5%").0, Some(0));
    let (code, why) = limited("normal:0,0,-1", "no-tool-reaches>1000mm2");
    assert!(
        code == Some(3) && why.contains("limit broken: no-tool-reaches is 100.00 % (2400.0 mm2)"),
        "{why}"
    );
    assert_eq!(limited("normal:0,0,-1", "no-tool-reaches>2401mm2").0, Some(0));
    let upright = ["setups", &part, "--tools", &balls, "--machine", "3-axis", "--setup", "+z"];
    let shown = ["--only", POCKET, "--sites", "500", "--no-picture", "--out", &out, "--json"];
    let setups = json(&deepmill(&[&upright[..], &shown].concat()));
    assert!((number(&setups, "area_mm2") - 1200.0).abs() < 0.1 && number(&setups, "reached") > 0.8);
}

#[test]
fn selected_faces_of_a_file_and_earlier_findings_are_a_region() {
    let folder = Folder::new();
    let part = part(&folder);
    let floor = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
                 property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
                 10 10 10\n30 10 10\n30 30 10\n10 30 10\n3 0 1 2\n3 0 2 3\n";
    let floor = format!("faces:{}", folder.file("floor.ply", floor));
    let label = |more: &[&str]| run(&folder, &["label", &part, "--cutter", "3,30,20,30"], more);
    let found = label(&["--only", &floor]);
    assert!((number(&found["region"], "area_mm2") - 400.0).abs() < 1e-6, "{found}");

    let earlier = folder.path("earlier");
    let args =
        ["label", &part, "--cutter", "3,30,20,30", "--out", &earlier, "--no-picture", "--json"];
    let first = json(&deepmill(&[&args[..], &UP, &["--sites", "4000"]].concat()));
    let list = first["findings"]["findings"].as_array().unwrap();
    // The underside is the largest.
    assert!((number(&list[0], "area_mm2") - 2400.0).abs() < 60.0, "{first}");
    let below = label(&["--only", &format!("findings:{earlier}:1")]);
    assert!(
        (number(&below["region"], "area_mm2") - number(&list[0], "area_mm2")).abs() < 100.0,
        "{below}"
    );
    assert_eq!(number(&below, "accessible"), 0.0);
    let all: f64 = list.iter().map(|finding| number(finding, "area_mm2")).sum();
    let any = label(&["--only", &format!("findings:{earlier}")]);
    assert!((number(&any["region"], "area_mm2") - all).abs() < 0.06 * all, "{all}: {any}");
    assert!(number(&any, "accessible") < 0.06, "{any}");
    // A thin ball reaches some of what the thicker one did not.
    let thin = run(
        &folder,
        &["label", &part, "--cutter", "1,30,20,30"],
        &["--only", &format!("findings:{earlier}"), "--except", "normal:0,0,-1"],
    );
    assert!(number(&thin, "accessible") > 0.4, "{thin}");

    // So are findings of a region.
    let not_below = ["--except", "normal:0,0,-1", "--sites", "4000"];
    let of_region = json(&deepmill(&[&args[..], &UP, &not_below].concat()));
    let list = of_region["findings"]["findings"].as_array().unwrap();
    let left = label(&["--only", &format!("findings:{earlier}:1")]);
    let areas = [number(&left["region"], "area_mm2"), number(&list[0], "area_mm2")];
    assert!((areas[0] - areas[1]).abs() < 0.1 * areas[1], "{areas:?}");

    // Another command writes its findings into the folder: they are none of the labels.
    let setups =
        ["setups", &part, "--cutter", "3,30,20,30", "--machine", "3-axis", "--setup", "+x"];
    let shown = ["--sites", "4000", "--no-picture", "--out", &earlier, "--json"];
    json(&deepmill(&[&setups[..], &shown].concat()));
    let only = ["--only", &format!("findings:{earlier}"), "--sites", "400"];
    let message = failure(&deepmill(&[&args[..], &only].concat()), 1);
    assert!(
        message.contains("findings.json: findings: finding 1 is none of the labels"),
        "{message}"
    );
}

#[test]
fn what_is_no_region_is_refused_with_an_example() {
    let folder = Folder::new();
    let part = part(&folder);
    let out = folder.path("out");
    for (faces, more, code, expected) in [
        ("box:1,2,3", &[][..], 2, "box:0,0,10,40,30,20"),
        ("top", &[], 2, "box:0,0,10,40,30,20"),
        ("normal:0,0,0", &[], 2, "a direction"),
        ("normal:0,0,1:181", &[], 2, "normal:0,0,1:10"),
        ("box:70,0,0,80,1,1", &[], 2, "the part reaches from 0, 0, 0 to 60, 40, 20 mm"),
        ("findings:nowhere:1", &[], 1, "nowhere"),
        ("box:0,0,0,9,9,9", &["--obstacles", "sites"], 2, "points as obstacles"),
        ("box:0,0,0,9,9,9", &["--volume", "2"], 2, "--volume"),
    ] {
        let args = ["label", &part, "--cutter", "3,30,20,30", "--out", &out, "--only", faces];
        let message = failure(&deepmill(&[&args[..], more].concat()), code);
        assert!(message.contains(expected), "{faces}: {message}");
    }
}
