//! What `deepmill setups` promises.
#![cfg(feature = "cli")]

mod command;

use command::{Corner, Folder, deepmill, failure, json, stl, text};
use serde_json::Value;
use std::path::Path;

/// Long enough for every wall of the parts below.
const LONG: &str = "1.5,30,20,30";

/// The boundary of the cells of a grid that are filled, as a closed mesh.
fn cells(lines: [&[f32]; 3], is_filled: impl Fn([f32; 3]) -> bool) -> Vec<[Corner; 3]> {
    let n = lines.map(|l| l.len() as i32 - 1);
    let filled = |c: [i32; 3]| {
        let middle = |k: usize| 0.5 * (lines[k][c[k] as usize] + lines[k][c[k] as usize + 1]);
        (0..3).all(|k| c[k] >= 0 && c[k] < n[k]) && is_filled([0, 1, 2].map(middle))
    };
    let mut triangles = Vec::new();
    let all =
        (0..n[0]).flat_map(|x| (0..n[1]).flat_map(move |y| (0..n[2]).map(move |z| [x, y, z])));
    for cell in all.filter(|c| filled(*c)) {
        for axis in 0..3 {
            for side in [0, 1] {
                let mut next = cell;
                next[axis] += 2 * side - 1;
                if filled(next) {
                    continue;
                }
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let corner = |a: i32, b: i32| {
                    let mut c = cell;
                    (c[axis], c[u], c[v]) = (c[axis] + side, c[u] + a, c[v] + b);
                    [0, 1, 2].map(|k| lines[k][c[k] as usize])
                };
                let mut quad = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                if side == 0 {
                    quad.reverse();
                }
                triangles.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
            }
        }
    }
    triangles
}

/// A block 40 × 30 × 20 mm with a pocket 6 mm deep in its upper and its lower side.
fn two_pockets(folder: &Folder) -> String {
    let lines: [&[f32]; 3] =
        [&[0.0, 10.0, 30.0, 40.0], &[0.0, 8.0, 22.0, 30.0], &[0.0, 6.0, 14.0, 20.0]];
    let part = cells(lines, |[x, y, z]| {
        !((10.0..30.0).contains(&x) && (8.0..22.0).contains(&y) && !(6.0..14.0).contains(&z))
    });
    folder.file("pockets.stl", stl(&part))
}

fn setups(part: &str, out: &str, machine: &str, share: &str) -> Value {
    let directions = if machine.starts_with("4-axis") { "24" } else { "40" };
    let args = ["setups", part, "--cutter", LONG, "--machine", machine, "--sites", "1500"];
    let more =
        ["--directions", directions, "--share", share, "--no-picture", "--out", out, "--json"];
    json(&deepmill(&[&args[..], &more].concat()))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

fn names(result: &Value) -> Vec<&str> {
    result["setups"].as_array().unwrap().iter().map(|row| row["setup"].as_str().unwrap()).collect()
}

#[test]
fn pockets_on_two_sides_need_two_setups_upright_and_one_about_an_axis_across() {
    let folder = Folder::new();
    let (part, out) = (two_pockets(&folder), folder.path("out"));
    let upright = setups(&part, &out, "3-axis", "100%");
    assert_eq!(names(&upright), ["1: +z up", "2: -z up"]);
    assert_eq!(
        (&upright["n_setups_at_least"], &upright["fewest_is_proven"]),
        (&2.into(), &true.into())
    );
    // Only where the ball does not fit between walls and floors is nothing reached.
    assert_eq!(upright["reached"], upright["can_be_reached"]);
    assert!((0.75..0.99).contains(&number(&upright, "reached")), "{upright}");
    // Upright, the flank is in the wall there; slanted, the tip alone.
    assert_eq!(upright["findings"]["findings"][0]["cause"], "inaccessible");
    let args = ["setups", &part, "--cutter", LONG, "--machine", "3-axis", "--sites", "1500"];
    let more = ["--directions", "40", "--share", "100%", "--no-picture", "--out", &out, "--json"];
    let any = json(&deepmill(&[&args[..], &more, &["--clampings", "any"]].concat()));
    assert_eq!(any["findings"]["findings"][0]["cause"], "tip-does-not-fit");

    let tilted = setups(&part, &out, "5-axis:30", "100%");
    assert_eq!((names(&tilted).len(), tilted["n_positions"].is_null()), (2, true));

    let about_x = setups(&part, &out, "4-axis:x", "100%");
    assert_eq!(names(&about_x), ["1: about x"]);
    assert!((number(&about_x, "reached") - number(&upright, "reached")).abs() < 1e-9);
    let positions = about_x["setups"][0]["positions"].as_array().unwrap();
    let axes: Vec<&str> = positions.iter().map(|p| p["axis"].as_str().unwrap()).collect();
    assert_eq!(axes.len(), 2, "{axes:?}");
    assert!(axes.contains(&"+z") && axes.contains(&"-z"));
    assert_eq!(about_x["n_positions"], 2);
    // About z the floors of both pockets are out of reach.
    let about_z = setups(&part, &out, "4-axis:z", "100%");
    assert!(number(&about_z, "reached") < number(&about_x, "reached") - 0.05, "{about_z}");
    // Left free, the right axis is found.
    assert_eq!(names(&setups(&part, &out, "4-axis", "100%")), ["1: about x"]);
}

#[test]
fn a_plain_box_needs_two_setups_since_it_lies_on_something() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    for machine in ["3-axis", "3+2:90", "5-axis:90"] {
        let result = setups(&part, &out, machine, "100%");
        assert_eq!(result["n_setups"], 2, "{machine}: {result}");
        assert_eq!((number(&result, "reached"), &result["fewest_is_proven"]), (1.0, &true.into()));
        assert_eq!(result["findings"]["findings"].as_array().unwrap().len(), 0);
        let rows = result["setups"].as_array().unwrap();
        let adds: f64 = rows.iter().map(|row| number(row, "adds")).sum();
        assert!((adds - 1.0).abs() < 1e-9 && (number(&rows[1], "so_far") - 1.0).abs() < 1e-9);
        for row in rows {
            let rows = row["turn"].as_array().unwrap();
            let up: Vec<f64> =
                rows[2].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
            assert_eq!(up, ["x", "y", "z"].map(|k| number(row, k)));
        }
    }
    // All but the underside is most of the way.
    let one = setups(&part, &out, "3-axis", "50%");
    assert_eq!((&one["n_setups"], &one["n_setups_for_all"]), (&1.into(), &2.into()));
}

#[test]
fn given_and_limited_setups_are_taken_and_the_first_line_says_what_the_part_stands_on() {
    let folder = Folder::new();
    let (part, out) = (two_pockets(&folder), folder.path("out"));
    let run = |machine: &str, more: &[&str]| {
        let args = ["setups", &part, "--cutter", LONG, "--machine", machine, "--sites", "800"];
        let usual = ["--directions", "24", "--no-picture", "--out", &out, "--json"];
        json(&deepmill(&[&args[..], &usual, more].concat()))
    };
    let premise = |result: &Value| result["premise"].as_str().unwrap().to_string();
    let free = run("3-axis", &[]);
    assert_eq!((free["n_setups"].as_u64(), free["n_candidates"].as_u64()), (Some(2), Some(6)));
    assert!(premise(&free).contains("standing on a flat face"), "{}", premise(&free));
    let one = run("3-axis", &["--setups", "1"]);
    assert_eq!((names(&one).len(), one["n_setups_at_least"].as_u64()), (1, Some(2)));
    assert!(number(&one, "reached") < number(&free, "reached"));
    let given = run("3-axis", &["--setup", "-x", "--setup", "+z"]);
    assert_eq!(names(&given), ["1: -x up", "2: +z up"]);
    assert!(number(&given, "reached") < number(&free, "reached"), "the lower pocket is left");
    let turned = run("4-axis:x:0,90", &[]);
    let whole = run("4-axis:x", &[]);
    assert!(number(&turned, "reached") < number(&whole, "reached") - 0.05, "{turned}");
    assert!(premise(&turned).contains("4-axis:1,0,0:0,90"), "{}", premise(&turned));
    let any = run("3-axis", &["--clampings", "any"]);
    assert!(any["n_candidates"].as_u64() > Some(20));
    let label = |more: &[&str]| {
        let output = folder.label(&part, &[&["--sites", "300", "--no-picture"], more].concat());
        text(&output.stdout).lines().find(|l| l.starts_with("tool axes")).unwrap().to_string()
    };
    assert!(label(&[]).contains("the upper half") && label(&[]).contains("stands on nothing"));
    assert!(label(&["--table", "-1"]).ends_with("stands on a table at z = -1 mm"));
    let limited = label(&["--directions", "4-axis:x:-30,90"]);
    assert!(limited.contains("the 25 given"), "{limited}");
}

#[test]
fn files_tabs_and_tools_of_every_setup_are_written_the_same_for_any_number_of_threads() {
    let folder = Folder::new();
    let part = two_pockets(&folder);
    // The thick one is first; only the slender one reaches the corners of the pockets.
    let table = "name,CR,CH,FR,FH\nD12,6,30,25,30\nD3,1.5,30,20,30\n";
    let tools = folder.file("shop.csv", table);
    let run = |out: &str, threads: &str, pictures: &[&str]| {
        let args = ["setups", &part, "--tools", &tools, "--machine", "3+2:30", "--sites", "1000"];
        let more = ["--directions", "60", "--report", "--out", out, "--json", "--threads", threads];
        json(&deepmill(&[&args[..], &more, pictures].concat()))
    };
    let (one, two) = (folder.path("one"), folder.path("two"));
    let (result, again) = (run(&one, "1", &[]), run(&two, "2", &["--no-picture"]));
    assert_eq!(result["setups"], again["setups"]);
    let files: Vec<String> =
        result["files"].as_array().unwrap().iter().map(|f| f.as_str().unwrap().into()).collect();
    let names = files.iter().map(|f| Path::new(f).file_name().unwrap().to_str().unwrap());
    assert_eq!(
        names.collect::<Vec<_>>(),
        [
            "setups.csv",
            "setup-tools.csv",
            "positions.csv",
            "setups.ply",
            "setups.png",
            "setup-1.ply",
            "setup-1.png",
            "setup-1.stl",
            "setup-2.ply",
            "setup-2.png",
            "setup-2.stl",
            "findings.json",
            "findings.csv",
            "report.html",
            "part.stl",
            "setups.npz"
        ]
    );
    for file in files.iter().filter(|file| !file.ends_with(".png")) {
        let other = file.replacen(&one, &two, 1);
        assert!(std::fs::read(file).unwrap() == std::fs::read(other).unwrap(), "{file} differs");
    }
    // Drawn again from the folder alone.
    let three = folder.path("three");
    let report = ["report", &two, "--out", &three, "--json"];
    assert_eq!(json(&deepmill(&report))["findings"], result["findings"]);
    for file in &files {
        let other = file.replacen(&one, &three, 1);
        assert!(std::fs::read(file).unwrap() == std::fs::read(other).unwrap(), "{file} differs");
    }
    let message = failure(&deepmill(&[&report[..], &["--part", &part]].concat()), 2);
    assert!(message.contains("the folder of setups holds the part"), "{message}");
    let tools = result["setups"][0]["tools"].as_array().unwrap();
    assert_eq!((&tools[0]["tool"], &tools[1]["tool"]), (&"D12".into(), &"D3".into()));
    assert!(number(&tools[0], "reached") < number(&tools[1], "reached"));
    assert_eq!((&tools[0]["needed"], &tools[1]["needed"]), (&"".into(), &"yes".into()));
    let page = std::fs::read_to_string(folder.path("one/report.html")).unwrap();
    for words in
        ["all setups", "1: +z up", "2: -z up", "added by this setup", "Positions", "3+2:30"]
    {
        assert!(page.contains(words), "{words}");
    }
}

#[test]
fn limits_and_bad_arguments_are_told() {
    let folder = Folder::new();
    let (part, out) = (two_pockets(&folder), folder.path("out"));
    let run = |more: &[&str]| {
        let args =
            ["setups", &part, "--cutter", LONG, "--sites", "300", "--no-picture", "--out", &out];
        let usual: &[&str] =
            if more.contains(&"--directions") { &[] } else { &["--directions", "20"] };
        deepmill(&[&args[..], usual, more].concat())
    };
    let broken = run(&[
        "--machine",
        "3-axis",
        "--fail-if",
        "unreachable>0.5%",
        "--fail-if",
        "unreachable>99%",
    ]);
    assert_eq!(broken.status.code(), Some(3), "{}", text(&broken.stderr));
    let words = text(&broken.stderr);
    assert!(
        words.contains("limit broken: setups: unreachable is ")
            && words.matches("limit broken").count() == 1,
        "{words}"
    );
    for (args, code, expected) in [
        (
            &["--machine", "3-axis", "--fail-if", "occlusion>5%"][..],
            2,
            "--fail-if is `occlusion>5%`",
        ),
        (&["--machine", "3-axis", "--share", "0"], 2, "--share is `0`"),
        (&["--machine", "3-axis", "--directions", "0"], 2, "directions is 0"),
    ] {
        let message = failure(&run(args), code);
        assert!(message.contains(expected), "{message}");
    }
    for args in [&["--machine", "3+2"][..], &["--machine", "lathe"], &[]] {
        let refused = run(args);
        assert_eq!(refused.status.code(), Some(2));
        assert!(text(&refused.stderr).contains("--machine"), "{}", text(&refused.stderr));
    }
    let cloud = folder.file("cloud.ply", "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n0 0 0 0 0 1\n1 0 0 0 0 1\n");
    let args = ["setups", &cloud, "--cutter", LONG, "--machine", "3-axis", "--out", &out];
    assert!(failure(&deepmill(&args), 2).contains("a cloud has no triangles"));
}

/// The example of `docs/machines`.
fn example(name: &str) -> String {
    format!("{}/docs/machines/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn machine_files_give_positions_as_angles_that_turn_the_tool_axis_upright() {
    let folder = Folder::new();
    let (part, out) = (two_pockets(&folder), folder.path("out"));
    let trunnion = setups(&part, &out, &example("trunnion-ac.toml"), "100%");
    assert_eq!(trunnion["machine"], "Trunnion A/C (table C, table A -120..30)");
    // It lies on something in the first.
    assert_eq!(names(&trunnion).len(), 2);
    let mut n_positions = 0;
    for setup in trunnion["setups"].as_array().unwrap() {
        let turn: Vec<Vec<f64>> = serde_json::from_value(setup["turn"].clone()).unwrap();
        for position in setup["positions"].as_array().unwrap() {
            let axis = ["x", "y", "z"].map(|key| number(position, key));
            let [x, y, z] = [0, 1, 2].map(|r| (0..3).map(|k| turn[r][k] * axis[k]).sum::<f64>());
            for [a, c] in [["a_deg", "c_deg"], ["a2_deg", "c2_deg"]] {
                let (Some(a), Some(c)) = (position[a].as_f64(), position[c].as_f64()) else {
                    assert!(a == "a2_deg" && position[c].is_null(), "{position}");
                    continue;
                };
                assert!((-120.0..=30.0).contains(&a), "{position}");
                // C turns the part about z, then A about x.
                let ((sin_c, cos_c), (sin_a, cos_a)) =
                    (c.to_radians().sin_cos(), a.to_radians().sin_cos());
                let (x, y) = (cos_c * x - sin_c * y, sin_c * x + cos_c * y);
                let (y, z) = (cos_a * y - sin_a * z, sin_a * y + cos_a * z);
                assert!(x.abs() < 3e-7 && y.abs() < 3e-7 && z > 0.999, "{position}");
                n_positions += 1;
            }
        }
    }
    assert!(n_positions >= 2);
    let table = std::fs::read_to_string(format!("{out}/positions.csv")).unwrap();
    let heading = table.lines().next().unwrap();
    assert!(heading.ends_with("adds_mm2,c_deg,a_deg,c2_deg,a2_deg"), "{heading}");

    // Chucked along x: both pockets in one setup, by 0 and half a turn.
    let chucked = setups(&part, &out, &example("rotary-table.toml"), "100%");
    let about_x = setups(&part, &out, "4-axis:x", "100%");
    assert_eq!(chucked["n_setups"], 1);
    assert!((number(&chucked, "reached") - number(&about_x, "reached")).abs() < 1e-9);
    assert!(chucked["premise"].as_str().unwrap().contains("held along the rotary axis"));
    let mut angles: Vec<f64> = chucked["setups"][0]["positions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|position| number(position, "a_deg"))
        .collect();
    angles.sort_by(f64::total_cmp);
    assert_eq!(angles, [0.0, 180.0]);

    let upright = setups(&part, &out, &example("three-axis.toml"), "100%");
    let plain = setups(&part, &out, "3-axis", "100%");
    assert_eq!(upright["reached"], plain["reached"]);
    assert!(upright["n_positions"].is_null() && upright["machine"] == "Three-axis mill");

    // z'' of a plane by Euler angles is (sin Z sin X', -cos Z sin X', cos X').
    let indexed = setups(&part, &out, "3+2:60", "100%");
    for setup in indexed["setups"].as_array().unwrap() {
        for position in setup["positions"].as_array().unwrap() {
            assert!((number(position, "nutation_deg") - number(position, "degrees")).abs() < 1e-3);
            assert_eq!(number(position, "rotation_deg"), 0.0);
            let (sin_z, cos_z) = number(position, "precession_deg").to_radians().sin_cos();
            let (sin_x, cos_x) = number(position, "nutation_deg").to_radians().sin_cos();
            let plane = [sin_z * sin_x, -cos_z * sin_x, cos_x];
            let axis = ["x", "y", "z"].map(|key| number(position, key));
            for (row, expected) in setup["turn"].as_array().unwrap().iter().zip(plane) {
                let along: f64 = (0..3).map(|k| row[k].as_f64().unwrap() * axis[k]).sum();
                assert!((along - expected).abs() < 3e-7, "{position}");
            }
        }
    }
}

#[test]
fn what_is_beyond_the_strokes_of_the_machine_is_not_reached() {
    let folder = Folder::new();
    // 120 x 40 x 20 mm: 16,000 mm², of which the underside has 4,800.
    let lines: [&[f32]; 3] = [&[0.0, 120.0], &[0.0, 40.0], &[0.0, 20.0]];
    let (part, out) = (folder.file("plate.stl", stl(&cells(lines, |_| true))), folder.path("out"));
    let on = |x: u32, y: u32, more: &[&str]| {
        let strokes = format!("x = [0, {x}]\ny = [-{y}, 0]\nz = [0, 100]\n");
        let machine =
            folder.file("mill.toml", format!("name = \"small\"\n[strokes_mm]\n{strokes}"));
        let args = ["setups", &part, "--cutter", LONG, "--machine", &machine, "--sites", "4000"];
        let output =
            deepmill(&[&args[..], &["--no-picture", "--out", &out, "--json"], more].concat());
        (text(&output.stderr), json(&output))
    };
    let is_share = |value: &Value, key: &str, by_hand: f64| {
        assert!((number(value, key) - by_hand).abs() < 0.004, "{key}, {by_hand} by hand: {value}");
    };
    // Ends of 10 mm are beyond: 800 mm² of the top, as much of the long sides, and 1,600 of both ends.
    let (said, short) = on(100, 60, &["--setup", "+z", "--setup", "-z"]);
    for setup in short["setups"].as_array().unwrap() {
        is_share(setup, "beyond_strokes", 0.2);
        is_share(setup, "reached", 0.5);
    }
    is_share(&short, "reached", 0.75);
    assert!(
        said.contains("beyond the strokes of the machine (x 100 mm, y 60 mm, z 100 mm)"),
        "{said}"
    );
    assert!(
        text(&std::fs::read(folder.path("out/setups.csv")).unwrap()).contains("beyond_strokes")
    );
    // On end it is higher than z goes, on its side or flat it is turned by a quarter.
    let (said, chosen) = on(100, 130, &[]);
    is_share(&chosen, "reached", 1.0);
    assert!(!said.contains("beyond the"), "{said}");
    assert_eq!(names(&chosen), ["1: +z up, +y along x'", "2: -z up, -y along x'"]);
    let (_, turned) = on(100, 130, &["--setup", "+z"]);
    assert!(names(&turned)[0].ends_with("y along x'"), "{turned}");
    is_share(&turned["setups"][0], "beyond_strokes", 0.0);
}

#[test]
fn bad_machine_files_are_one_line_of_error() {
    let folder = Folder::new();
    let (part, out) = (two_pockets(&folder), folder.path("out"));
    let axis = "[[axis]]\nletter = \"A\"\non = \"table\"\naxis = [1, 0, 0]\n";
    let reversed = format!("name = \"m\"\n{axis}limits = [30, -120]\n");
    let reversed = folder.file("reversed.toml", reversed);
    let text = folder.file("text.toml", [0xff, 0xfe, 0x00]);
    let (missing, folder_path) = (folder.path("no.toml"), folder.path("folder.toml"));
    std::fs::create_dir(&folder_path).unwrap();
    for (machine, expected) in [
        (&reversed, "line 6: limits 30, -120; give the least"),
        (&text, "it is no text in UTF-8"),
        (&missing, "cannot be read"),
        (&folder_path, "cannot be read"),
    ] {
        let args = ["setups", &part, "--cutter", LONG, "--machine", machine, "--out", &out];
        let message = failure(&deepmill(&args), 1);
        assert!(message.contains(expected) && message.contains(&**machine), "{message}");
    }
}
