//! What the commands promise about how much is left: `label --rest` and `machined`.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, block, deepmill, failure, json, stl, t_slot, text};
use deepmill::data::files::LabelFile;
use deepmill::geom::{check, formats};
use std::f64::consts::PI;

/// A floor with a wall on it: two blocks that overlap. A ball of radius 3 from above leaves a fillet along the edge.
fn angle(folder: &Folder) -> String {
    let floor = block([0.0; 3], [40.0, 30.0, 10.0]);
    let wall = block([0.0; 3], [10.0, 30.0, 30.0]);
    folder.file("angle.stl", stl(&[floor, wall].concat()))
}

const UP: [&str; 5] = ["--cutter", "3,30,20,40", "--directions", "up", "--json"];

#[test]
fn the_rest_of_every_site_is_in_the_files_and_can_be_limited() {
    let folder = Folder::new();
    let (part, out) = (angle(&folder), folder.path("out"));
    let run = |more: &[&str]| {
        let args = ["label", &part, "--out", &out, "--sites", "3000"];
        deepmill(&[&args[..], &UP, more].concat())
    };
    let result = json(&run(&["--rest", "--no-picture"]));
    let file = LabelFile::read(folder.path("out/labels.npz").as_ref()).unwrap();
    let answers = &file.labels.answers;
    let (accessible, mut most, mut n_corner) = (answers.accessible(), 0f32, 0);
    for (i, rest) in answers.rest_mm().iter().enumerate() {
        let (p, n) = (file.sites.points[i], file.sites.normals[i]);
        assert!(!accessible[i] || *rest == 0.0);
        most = most.max(*rest);
        let from_wall = f64::from(p.x) - 10.0;
        // At the ends the ball reaches around the wall.
        let is_inner = (5.0..25.0).contains(&p.y) && p.z < 11.0;
        if is_inner && n.z > 0.9 && (0.0..3.0).contains(&from_wall) {
            let by_hand = 3.0 - (9.0 - (3.0 - from_wall).powi(2)).max(0.0).sqrt();
            // Near the wall a shift by the gouge tolerance is more along the normal.
            let most = if from_wall > 0.2 { 0.03 } else { 0.2 };
            assert!((f64::from(*rest) - by_hand).abs() < most, "{p}: {rest} {by_hand}");
            n_corner += 1;
        }
    }
    assert!(n_corner > 20 && most > 1.0, "{n_corner} {most}");
    let stated = result["greatest_rest_mm"].as_f64().unwrap();
    assert!((stated - f64::from(most)).abs() < 1e-3);
    let greatest = |f: &serde_json::Value| f["greatest_rest_mm"].as_f64().unwrap();
    let findings = result["findings"]["findings"].as_array().unwrap();
    assert!(findings.iter().any(|f| greatest(f) > 1.0));
    assert!(std::fs::metadata(folder.path("out/rest.ply")).is_ok());
    let broken = run(&["--no-picture", "--fail-if", "rest>0.5mm"]);
    assert_eq!(broken.status.code(), Some(3));
    assert!(text(&broken.stderr).contains("limit broken: the greatest rest is"));
    assert!(run(&["--no-picture", "--fail-if", "rest>5mm"]).status.success());
    let volume = |f: &serde_json::Value| f["left_mm3"].as_f64().unwrap();
    let of_all: f64 = findings.iter().map(volume).sum();
    let of_sites: f64 = answers.rest_volume_mm3().iter().map(|v| f64::from(*v)).sum();
    assert!(of_all > 0.0 && of_all < 1.001 * of_sites, "{of_all} {of_sites}");
    let most = result["findings"]["most_left_mm3"].as_f64().unwrap();
    let gate = |mm3: f64| run(&["--no-picture", "--fail-if", &format!("finding>{mm3}mm3")]);
    let broken = gate(0.9 * most);
    assert_eq!(broken.status.code(), Some(3));
    assert!(text(&broken.stderr).contains("is most left,"), "{}", text(&broken.stderr));
    assert!(gate(1.1 * most).status.success());
    let args = ["setups", &part, "--machine", "3-axis", "--out", &out];
    let error =
        failure(&deepmill(&[&args[..], &UP[..2], &["--fail-if", "finding>1mm3"]].concat()), 2);
    assert!(error.contains("a quantity that this command answers"), "{error}");
    let error = failure(&run(&["--fail-if", "rest>5%"]), 2);
    assert!(error.contains("rest>NUMBERmm"), "{error}");
}

#[test]
fn the_rest_of_several_tools_is_the_least_that_one_of_them_leaves() {
    let folder = Folder::new();
    let (part, out) = (angle(&folder), folder.path("out"));
    let args = ["label", &part, "--out", &out, "--sites", "800", "--no-picture", "--rest"];
    let both = ["--cutter", "1,30,20,40", "--fail-if", "rest>1.1mm"];
    let ran = deepmill(&[&args[..], &UP, &both].concat());
    // The fillet of the smaller one alone, but for the underside, which lies on the stock's own face.
    assert!(ran.status.success(), "{}", text(&ran.stderr));
}

/// The neck of radius 4 stops at lips 5.5 from the middle; the disc of radius 8 ends 1.1 before the walls behind them.
#[test]
fn a_t_slot_cutter_leaves_what_its_neck_keeps_it_from() {
    let folder = Folder::new();
    let part = folder.file("slot.stl", t_slot());
    let table = "T, name, profile, stick_out\n8, cutter, 8:0 8:4 4:4 | 4:50, 60\n";
    let tools = folder.file("tools.csv", table);
    let holder = folder.file("holder.csv", "height,lower,upper\n30,40,40\n");
    let args = ["label", &part, "--tools", &tools, "--holder", &holder, "--rest"];
    let out = folder.path("out");
    let more = ["--sites", "1500", "--directions", "up", "--no-picture", "--json", "--out", &out];
    json(&deepmill(&[&args[..], &more].concat()));
    let file = LabelFile::read(folder.path("out/cutter/labels.npz").as_ref()).unwrap();
    let mut n_walls = 0;
    for (i, rest) in file.labels.answers.rest_mm().iter().enumerate() {
        let (p, n) = (file.sites.points[i], file.sites.normals[i]);
        // At the ends the cutter reaches around the lips.
        let is_inner = (-30.0..-10.0).contains(&p.y);
        if is_inner
            && n.x.abs() > 0.9
            && (19.0..28.0).contains(&p.z)
            && (10.0..11.0).contains(&p.x.abs())
        {
            assert!((rest - 1.1).abs() < 0.03, "{p}: {rest}");
            n_walls += 1;
        }
    }
    assert!(n_walls > 10, "{n_walls}");
}

#[test]
fn nothing_left_is_zero_and_machining_twice_adds_nothing() {
    let folder = Folder::new();
    let (part, once) = (angle(&folder), folder.path("once"));
    let of = |part: &str, out: &str| {
        let output =
            deepmill(&[&["machined", part, "--out", out, "--accuracy", "0.3"], &UP[..]].concat());
        (text(&output.stdout), json(&output)["left_mm3"].as_f64().unwrap())
    };
    let (_, left) = of(&part, &once);
    let (_, again) = of(&folder.path("once/machined.stl"), &folder.path("twice"));
    assert!(again < 0.01 * left, "{again} of {left}");
    let block = folder.file("block.stl", stl(&block([0.0; 3], [20.0; 3])));
    let (words, left) = of(&block, &folder.path("block"));
    assert!(left == 0.0 && !words.contains("-0.0"), "{words}");
}

#[test]
fn tools_of_any_profile_machine_and_drills_are_left_out_by_name() {
    let folder = Folder::new();
    let part = angle(&folder);
    let holder = folder.file("holder.csv", "height,lower,upper\n30,40,40\n");
    let held =
        ["--holder", &holder, "--stick-out", "40", "--directions", "up", "--accuracy", "0.3"];
    let run = |tools: &str, out: &str| {
        let tools = folder.file("tools.csv", format!("name,profile\n{tools}"));
        let args = ["machined", &part, "--tools", &tools, "--out", &folder.path(out)];
        deepmill(&[&args[..], &held, &["--json"]].concat())
    };
    let output = run("ball,0:0 3:3@0:3 3:30 | 3:60\nhole 6,drill 0:0 3:2 3:40 | 3:60\n", "both");
    let by_hand = (1.0 - PI / 4.0) * 9.0 * 30.0;
    let left = json(&output)["left_mm3"].as_f64().unwrap();
    assert!((left - by_hand).abs() < 0.3 * 0.3 * 6.0 * 30.0, "{left} {by_hand}");
    let said = text(&output.stderr);
    assert!(said.contains("left out: hole 6: what drills and reamers remove"), "{said}");
    let alone = failure(&run("hole 6,drill 0:0 3:2 3:40 | 3:60\n", "alone"), 2);
    assert!(alone.contains("hole 6") && alone.contains("a tool that mills"), "{alone}");
}

#[test]
fn the_machined_part_is_closed_and_holds_the_fillet() {
    let folder = Folder::new();
    let (part, out) = (angle(&folder), folder.path("out"));
    let args = ["machined", &part, "--out", &out, "--accuracy", "0.3"];
    let result = json(&deepmill(&[&args[..], &UP].concat()));
    let by_hand = (1.0 - PI / 4.0) * 9.0 * 30.0;
    let left = result["left_mm3"].as_f64().unwrap();
    assert!((left - by_hand).abs() < 0.3 * 0.3 * 6.0 * 30.0, "{left} {by_hand}");
    let to_remove = result["to_remove_mm3"].as_f64().unwrap();
    assert!((to_remove - 30.0 * 30.0 * 20.0).abs() < 1e-6);
    let read =
        |name: &str| formats::read_part(folder.path(name).as_ref(), &Default::default()).unwrap();
    for name in ["out/machined.stl", "out/rest.stl"] {
        let deepmill::geom::formats::MeshOrCloud::Mesh(mesh) = read(name) else { panic!() };
        check::require_labelable(&mesh).unwrap();
        if name == "out/machined.stl" {
            let whole = 40.0 * 30.0 * 10.0 + 10.0 * 30.0 * 20.0;
            assert!((mesh.volume() - whole - by_hand).abs() < 20.0, "{}", mesh.volume());
        }
    }
    for name in ["machined.csv", "rest.csv", "machined.png"] {
        assert!(std::fs::metadata(folder.path(&format!("out/{name}"))).unwrap().len() > 0);
    }
    // The same tool reaches what it has left.
    let machined = folder.path("out/machined.stl");
    let label = [
        "label",
        &machined,
        "--out",
        &out,
        "--no-picture",
        "--tolerance",
        "0.3",
        "--finish",
        "0.3",
    ];
    let again = json(&deepmill(&[&label[..], &UP, &["--rest", "--sites", "3000"]].concat()));
    let before = json(&deepmill(
        &[&["label", &part, "--out", &out, "--no-picture", "--sites", "3000"][..], &UP].concat(),
    ));
    let share = |of: &serde_json::Value| of["accessible"].as_f64().unwrap();
    assert!(share(&again) > share(&before) + 0.02, "{} {}", share(&again), share(&before));
    assert!(again["greatest_rest_mm"].as_f64().unwrap() <= 0.3);
}

#[test]
fn machined_parts_with_round_faces_are_solids_when_they_are_read_again() {
    let folder = Folder::new();
    for family in ["bearing_housing", "pocket_block", "flange"] {
        let parts = folder.path(family);
        let made = ["generate", "--family", family, "--count", "1", "--seed", "3", "--out", &parts];
        assert!(deepmill(&made).status.success());
        let part = std::fs::read_dir(&parts).unwrap().map(|entry| entry.unwrap().path());
        let part = part.into_iter().find(|path| path.extension().is_some_and(|e| e == "stl"));
        let (part, out) = (part.unwrap().display().to_string(), folder.path("out"));
        for accuracy in ["1.5", "1.1", "0.8"] {
            let args = ["machined", &part, "--accuracy", accuracy, "--no-picture", "--json"];
            let tool = ["--cutter", "5,40,20,40", "--directions", "sphere:20", "--out", &out];
            let result = json(&deepmill(&[&args[..], &tool].concat()));
            assert!(result["n_bodies"].as_u64().unwrap() > 0, "{family}");
            let machined = folder.path("out/machined.stl");
            let checked = deepmill(&["check", &machined]);
            assert!(checked.status.success(), "{family} {accuracy}: {}", text(&checked.stdout));
        }
    }
}

#[test]
fn setups_of_a_machine_go_one_after_the_other() {
    let folder = Folder::new();
    let (part, out) = (angle(&folder), folder.path("out"));
    let args = ["machined", &part, "--out", &out, "--accuracy", "0.5", "--stock", "box:1"];
    let machined = |more: &[&str]| {
        deepmill(&[&args[..], &["--no-picture", "--json", "--cutter", "3,30,20,40"], more].concat())
    };
    let result = json(&machined(&["--machine", "3-axis", "--setup", "+z", "--setup", "-z"]));
    let rows = result["tools"].as_array().unwrap();
    assert_eq!(rows.len(), 2);
    let after: Vec<f64> = rows.iter().map(|row| row["after_mm3"].as_f64().unwrap()).collect();
    // From above the underside keeps its millimeter, from below that goes.
    assert!(after[0] - after[1] > 0.8 * 42.0 * 32.0 && after[1] > 0.0, "{after:?}");
    assert!(rows[0]["setup"].as_str().unwrap().starts_with("1: +z"), "{}", rows[0]);
    assert_eq!(result["n_setups"], 2);
    let csv = std::fs::read_to_string(folder.path("out/machined.csv")).unwrap();
    assert!(csv.starts_with("setup,tool,after_mm3\n"), "{csv}");
    let planned = json(&machined(&["--machine", "3-axis"]));
    assert!(planned["n_setups"].as_u64().unwrap() >= 2);
    for (more, words) in [
        (&["--setup", "+z"][..], "--machine"),
        (&["--machine", "3-axis", "--directions", "up"], "--directions"),
        (&["--machine", "3-axis", "--table", "0"], "--table"),
        (&["--machine", "6-axis"], "3-axis"),
        (&["--machine", "3-axis", "--setup", "0,0,0"], "--setup"),
    ] {
        let error = failure(&machined(more), 2);
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn stocks_accuracies_and_tools_that_cannot_be_are_named_with_a_remedy() {
    let folder = Folder::new();
    let (part, out) = (angle(&folder), folder.path("out"));
    let run = |more: &[&str]| {
        failure(&deepmill(&[&["machined", &part, "--out", &out][..], &UP, more].concat()), 2)
    };
    let small = folder.file("small.stl", stl(&block([0.0; 3], [40.0, 30.0, 20.0])));
    let error = run(&["--stock", &small]);
    assert!(
        error.contains("--stock") && error.contains("outside of it, up to 10.000 mm"),
        "{error}"
    );
    assert!(run(&["--stock", "box:-1"]).contains("how much more"));
    assert!(run(&["--stock", "box:wide"]).contains("box:2"));
    assert!(run(&["--accuracy", "-1"]).contains("positive length"));
    assert!(run(&["--accuracy", "5"]).contains("accuracy"));
    let huge =
        deepmill(&[&["machined", &part, "--out", &out, "--accuracy", "0.0001"][..], &UP].concat());
    let error = failure(&huge, 1);
    assert!(error.contains("coarser accuracy"), "{error}");
    let points = ["label", &part, "--out", &out, "--rest", "--obstacles", "published"];
    let error = failure(&deepmill(&[&points[..], &UP].concat()), 2);
    assert!(error.contains("--rest"), "{error}");
}
