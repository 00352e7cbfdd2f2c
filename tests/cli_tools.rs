//! What the commands promise about tools: tables, libraries, limits.
#![cfg(feature = "cli")]

mod command;

use command::{CUTTER, Folder, deepmill, failure, grooved, json, label_tools, text};
use deepmill::data::files::LabelFile;
use deepmill::findings::gate::SiteAreas;
use serde_json::Value;
use std::path::Path;

#[test]
fn several_cutters_give_the_files_of_each_alone() {
    let folder = Folder::new();
    let lengths = ["1.5,6,40,5", "1,20,5,20"];
    let tip = ["--corner", "0.5", "--clearance", "0.1"];
    let both = ["--cutter", lengths[0], "--cutter", lengths[1]];
    let result = label_tools(&folder, "both", &[&both[..], &tip].concat());
    for (k, lengths) in lengths.iter().enumerate() {
        let name = format!("{}-corner0.5-clearance0.1", lengths.replace(',', "-"));
        let one = label_tools(&folder, "one", &[&["--cutter", lengths][..], &tip].concat());
        for file in ["labels.npz", "labels.ply"] {
            let bytes = |path: String| std::fs::read(folder.path(&path)).unwrap();
            assert!(
                bytes(format!("both/{name}/{file}")) == bytes(format!("one/{file}")),
                "{name}/{file} differs"
            );
        }
        let row = &result["tools"][k];
        assert_eq!(row["name"], name.as_str());
        for fact in ["accessible", "inaccessible", "tip_does_not_fit", "free_directions"] {
            assert_eq!(row[fact], one[fact], "{name}: {fact}");
        }
    }
    let names = result["files"].as_array().unwrap().iter().map(|f| {
        let path = Path::new(f.as_str().unwrap());
        assert!(path.is_file());
        path.strip_prefix(folder.path("both")).unwrap().components().count()
    });
    // Numbers, points and two files of findings for each; table, points, findings, part and outcome for both.
    assert_eq!(names.collect::<Vec<_>>(), [[2; 8].as_slice(), &[1; 6]].concat());
}

#[test]
fn a_tool_table_says_what_each_tool_adds_and_what_none_reaches() {
    let folder = Folder::new();
    let table = "# shop\nT;name;CR;CH;FR;FH;corner\n1;stub;1,5;0,2;90;0,2;\n\n2;long;1;12;30;5;0\n";
    let tools = folder.file("shop.csv", table);
    let args = ["--tools", &tools, "--cutter", CUTTER, "--directions", "cone:45:60"];
    let result = label_tools(&folder, "out", &args);
    let labels = |name: &str| {
        LabelFile::read(folder.path(&format!("out/{name}/labels.npz")).as_ref()).unwrap().labels
    };
    let names = ["1.5-6-40-5", "stub", "long"];
    let all = names.map(|name| labels(name).answers.accessible());
    // Of the surface: a site counts by the area that it stands for.
    let mesh = deepmill::geom::formats::read_mesh(
        folder.path("out/part.stl").as_ref(),
        &Default::default(),
    );
    let file = LabelFile::read(folder.path("out/long/labels.npz").as_ref()).unwrap();
    let areas = SiteAreas::of(&file.sites, Some(&mesh.unwrap())).unwrap();
    let mut adds = [0.0; 4];
    let first = |i: usize| all.iter().position(|l| l[i]).unwrap_or(3);
    (0..400).for_each(|i| adds[first(i)] += areas.shares()[i]);
    let close = |value: &Value, x: f64| (value.as_f64().unwrap() - x).abs() < 1e-12;
    for (k, name) in names.iter().enumerate() {
        let row = &result["tools"][k];
        assert!(row["name"] == *name && close(&row["adds"], adds[k]), "{row} {adds:?}");
    }
    assert!(close(&result["inaccessible_to_all"], adds[3]), "{result} {adds:?}");
    assert!(adds[0] > 0.1 && adds[2] > 0.1 && adds[3] > 0.1, "{adds:?}");
    let written = folder.path("out/tools.csv");
    let again =
        deepmill::data::files::tools::read(written.as_ref(), &Default::default()).unwrap().tools;
    assert_eq!(again[2].words(), "flat-end CR 1, CH 12, FR 30, FH 5 mm");
    assert_eq!(again.iter().map(|tool| tool.name.as_str()).collect::<Vec<_>>(), names);

    let out = folder.path("out/long");
    let drawn = deepmill(&["report", &out]);
    assert!(drawn.status.success(), "{}", text(&drawn.stderr));
    let on_mesh = std::fs::read(folder.path("out/long/labels.png")).unwrap();
    std::fs::remove_file(folder.path("out/tools.ply")).unwrap();
    assert!(deepmill(&["report", &out]).status.success());
    let discs = std::fs::read(folder.path("out/long/labels.png")).unwrap();
    assert!(on_mesh != discs, "drawn on the mesh that the tools share");
}

/// The ball of 8 mm is hardly more inaccessible than that of 2 mm, and its tip does not fit into the groove.
#[test]
fn a_tool_whose_tip_does_not_fit_reaches_less_in_every_table() {
    let folder = Folder::new();
    let part = grooved(&folder, 4.0, 6.0);
    let tools = folder.file("shop.csv", "name,CR,CH,FR,FH\nD8,4,40,10,20\nD2,1,40,10,20\n");
    let run = |command: &str, option: &str| {
        let out = folder.path(command);
        let args = [command, &part, option, &tools, "--out", &out, "--sites", "1500"];
        let more = ["--directions", "up", "--no-picture", "--json"];
        json(&deepmill(&[&args[..], &more].concat()))
    };
    let (labels, library) = (run("label", "--tools"), run("tools", "--library"));
    let number = |row: &Value, key: &str| row[key].as_f64().unwrap();
    let (wide, thin) = (&labels["tools"][0], &labels["tools"][1]);
    assert!(number(wide, "inaccessible") < number(thin, "inaccessible") + 0.01, "{wide} {thin}");
    assert!(number(wide, "tip_does_not_fit") > number(thin, "tip_does_not_fit") + 0.05);
    assert!(number(wide, "accessible") < number(thin, "accessible") - 0.05, "{wide} {thin}");
    for (row, other) in [wide, thin].iter().zip(library["tools"].as_array().unwrap()) {
        for (key, same) in [
            ("accessible", "reached"),
            ("inaccessible", "inaccessible"),
            ("tip_does_not_fit", "tip_does_not_fit"),
        ] {
            assert!((number(row, key) - number(other, same)).abs() < 1e-3, "{key}: {row} {other}");
        }
        let sum = ["accessible", "inaccessible", "tip_does_not_fit"].map(|key| number(row, key));
        assert!((sum.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{row}");
    }
    // Both reach 95 % of what the thin one does where that share is asked for; then the thick one is taken.
    let names = |set: &Value| {
        set.as_array().unwrap().iter().map(|row| row["name"].clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(&library["smallest_set"]), ["D2"], "{library}");
    let out = folder.path("share");
    let args = ["tools", &part, "--library", &tools, "--out", &out, "--sites", "1500"];
    let more = ["--directions", "up", "--no-picture", "--json", "--share", "85%"];
    let shared = json(&deepmill(&[&args[..], &more].concat()));
    assert_eq!(names(&shared["smallest_set"]), ["D8"], "{shared}");
    assert_eq!(
        (&shared["smallest_set_is_proven"], &shared["n_needed_at_least"]),
        (&true.into(), &1.into())
    );
    // What no tool reaches is what none of the two reaches, for whatever cause.
    let none = labels["inaccessible_to_all"].as_f64().unwrap();
    assert!((none - library["unreached"].as_f64().unwrap()).abs() < 1e-3, "{none}");
}

#[test]
fn a_table_of_one_tool_has_a_folder_for_it() {
    let folder = Folder::new();
    let tools = folder.file("shop.csv", "CR,CH,FR,FH,name\n1.5,6,40,5,D3\n");
    let result = label_tools(&folder, "out", &["--tools", &tools]);
    assert_eq!(result["tools"][0]["name"], "D3");
    assert!(Path::new(&folder.path("out/D3/labels.npz")).is_file());
    assert!(!Path::new(&folder.path("out/labels.npz")).exists());
}

#[test]
fn bad_sets_of_tools_are_refused_before_anything_is_written() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let tools = folder.file("shop.csv", "name,CR,CH,FR,FH\n,1.5,6,40,5\nlong,1,20,5,20\n");
    let bad = folder.file("bad.csv", "CR,CH,FR,FH\n1.5,6,40,5\n1.5,6,1,5\n");
    for (args, code, expected) in [
        (&["--cutter", CUTTER, "--cutter", CUTTER][..], 2, "`1.5-6-40-5` twice"),
        (&["--cutter", CUTTER, "--tools", &tools], 2, "`1.5-6-40-5` twice"),
        (&["--corner", "0", "--tools", &tools], 2, "--corner"),
        (&["--clearance", "0.1", "--tools", &tools], 2, "--clearance"),
        (&["--tools", &bad, "--strict"], 1, "bad.csv: line 3: holder radius FR is 1"),
        (&["--tools", &folder.path("none.csv")], 1, "none.csv"),
    ] {
        let output = deepmill(&[&["label", &part, "--out", &out], args].concat());
        let message = failure(&output, code);
        assert!(message.contains(expected), "{args:?}: {message}");
        assert!(!Path::new(&out).exists(), "{args:?} left files behind");
    }
    let two = ["predict", &part, "--cutter", CUTTER, "--cutter", "1,2,3,4", "--out", &out];
    assert_eq!(deepmill(&two).status.code(), Some(2), "a network predicts for one cutter");
}

const LIBRARY: &str = r#"{"data": [
 {"description": "3 mm ball, held", "type": "ball end mill", "unit": "millimeters",
  "geometry": {"DC": 3, "RE": 1.5, "LCF": 9, "LB": 12, "OAL": 60, "SFDM": 3},
  "holder": {"description": "C", "unit": "millimeters", "segments": [{"height": 20, "lower-diameter": 30, "upper-diameter": 30}]}},
 {"description": "1/8 flat", "type": "flat end mill", "unit": "inches",
  "geometry": {"DC": 0.125, "LCF": 0.5, "LB": 0.8, "OAL": 1.6, "SFDM": 0.25}},
 {"description": "tap", "type": "tap right hand", "unit": "millimeters", "geometry": {"DC": 5}}]}"#;

const HOLDER: &str = "height,lower,upper\n10,28,34\n30,34,50\n";

#[test]
fn libraries_are_read_asked_for_what_they_lack_and_say_what_is_left_out() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let library = folder.file("shop.json", LIBRARY);
    let holder = folder.file("er.csv", HOLDER);
    let args =
        ["label", &part, "--out", &out, "--sites", "300", "--no-picture", "--tools", &library];
    // The tool that has its holder is not lost with the one that has none, unless that is wanted.
    let message = failure(&deepmill(&[&args[..], &["--strict"]].concat()), 1);
    for words in ["2 of its tools would be left out", "tool \"1/8 flat\"", "--holder FILE"] {
        assert!(message.contains(words), "{words}: {message}");
    }
    assert!(!Path::new(&out).exists());
    let output = deepmill(&[&args[..], &["--json"]].concat());
    let words = text(&output.stderr);
    assert!(words.contains("--holder FILE; the tool is left out"), "{words}");
    assert!(words.contains("shop.json: 2 of 3 tools left out"), "{words}");
    assert_eq!(json(&output)["tools"].as_array().unwrap().len(), 1);
    let output = deepmill(&[&args[..], &["--holder", &holder, "--json"]].concat());
    let words = text(&output.stderr);
    assert!(words.contains("\"tap\": a tap right hand cannot be represented"), "{words}");
    let result = json(&output);
    assert_eq!(
        (&result["tools"][0]["name"], &result["tools"][1]["name"]),
        (&"3 mm ball, held".into(), &"1/8 flat".into())
    );
    assert_eq!(result["tools"][1]["folder"], "1 8 flat");
    let file = LabelFile::read(folder.path("out/1 8 flat/labels.npz").as_ref()).unwrap();
    assert_eq!(file.provenance.tool, "flat end 3.175 mm, 20.32 mm out of er");
    assert_eq!(file.provenance.settings.json()["tool"]["body"], "3.175:1.5875 12.7:3.175");
    // A network knows the first of them.
    let predicted = folder.path("predicted");
    let args = [
        "predict",
        &part,
        "--out",
        &predicted,
        "--sites",
        "300",
        "--no-picture",
        "--far",
        "--json",
    ];
    let output = deepmill(&[&args[..], &["--tools", &library, "--holder", &holder]].concat());
    assert!(text(&output.stderr).contains("1/8 flat (flat end"), "{}", text(&output.stderr));
    let result = json(&output);
    assert_eq!(result["tools"].as_array().unwrap().len(), 1);
    assert!(Path::new(&folder.path("predicted/3 mm ball, held/predictions.npz")).is_file());
}

#[test]
fn a_library_on_a_part_has_a_table_a_smallest_set_and_stick_outs() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let (library, holder) = (folder.file("shop.json", LIBRARY), folder.file("er.csv", HOLDER));
    let table = folder.file("more.csv", "name,CR,CH,FR,FH\nstub,1.5,0.2,90,0.2\n");
    let args =
        ["tools", &part, "--library", &library, &table, "--holder", &holder, "--sites", "400"];
    let more = ["--out", &out, "--json", "--share", "90%"];
    let result = json(&deepmill(&[&args[..], &more].concat()));
    let rows = result["tools"].as_array().unwrap();
    assert_eq!(rows.len(), 3);
    let number = |row: usize, key: &str| rows[row][key].as_f64().unwrap();
    for k in 0..3 {
        assert!(number(k, "reached") <= number(k, "body_reaches") && number(k, "reached") > 0.0);
        let area = number(k, "reached") * result["area_mm2"].as_f64().unwrap();
        assert!((number(k, "reached_mm2") - area).abs() < 1e-6 * area);
        assert!(number(k, "least_stick_out") >= 3.0 - 1e-9);
    }
    let needed = rows.iter().filter(|row| row["in_smallest_set"] == "yes").count();
    assert_eq!((needed, result["smallest_set"].as_array().unwrap().len()), (needed, needed));
    assert_eq!(result["smallest_set_is_proven"], true);
    for file in
        ["tools.csv", "stick-out.csv", "stick-out.svg", "tools.ply", "tools.png", "part.stl"]
    {
        assert!(Path::new(&folder.path(&format!("out/{file}"))).is_file(), "{file}");
    }
    // The table gives the same tools again; files of tools have the name that they have for `label`, too.
    let again = folder.path("again");
    let csv = folder.path("out/tools.csv");
    let args = ["tools", &part, "--tools", &csv, "--sites", "400", "--no-picture"];
    let twice =
        json(&deepmill(&[&args[..], &["--out", &again, "--json", "--share", "90"]].concat()));
    for (a, b) in rows.iter().zip(twice["tools"].as_array().unwrap()) {
        assert_eq!(
            (&a["name"], &a["reached"], &a["least_stick_out"]),
            (&b["name"], &b["reached"], &b["least_stick_out"])
        );
    }
    for (args, code, expected) in [
        (&["--share", "0"][..], 2, "--share is `0`"),
        (&["--fail-if", "holes>5%"], 2, "--fail-if is `holes>5%`"),
        (&["--stick-out", "-3"], 2, "--stick-out is -3"),
        (&["--holder", &part], 1, "block.stl"),
    ] {
        let output =
            deepmill(&[&["tools", &part, "--library", &library, "--out", &out], args].concat());
        let message = failure(&output, code);
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn a_broken_limit_is_exit_code_3_after_everything_is_written() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let csv = folder.file("shop.csv", "name,CR,CH,FR,FH\nD3,1.5,6,40,5\n");
    for (command, tools, file) in [
        ("label", ["--cutter", CUTTER], "labels.npz"),
        ("tools", ["--library", &csv], "tools.csv"),
        ("predict", ["--cutter", CUTTER], "predictions.npz"),
    ] {
        let run = |limits: &[&str]| {
            let args = [
                command,
                &part,
                tools[0],
                tools[1],
                "--out",
                &out,
                "--sites",
                "300",
                "--no-picture",
            ];
            let mut args = args.to_vec();
            limits.iter().for_each(|limit| args.extend(["--fail-if", *limit]));
            if command == "predict" {
                args.push("--far");
            }
            deepmill(&args)
        };
        let kept = run(&["inaccessible>100%", "unreachable<0%"]);
        assert_eq!(kept.status.code(), Some(0), "{}", text(&kept.stderr));
        std::fs::remove_file(folder.path(&format!("out/{file}"))).unwrap();
        let broken = run(&["inaccessible<100%", "unreachable<1e9mm2", "inaccessible>100%"]);
        assert_eq!(broken.status.code(), Some(3), "{}", text(&broken.stderr));
        let words = text(&broken.stderr);
        let told: Vec<&str> = words.lines().filter(|l| l.starts_with("limit broken: ")).collect();
        assert_eq!(told.len(), 2, "{words}");
        assert!(
            told[0].contains("inaccessible is ") && told[0].ends_with("inaccessible<100%"),
            "{words}"
        );
        assert!(words.trim_end().ends_with("unreachable<1000000000mm2"), "{words}");
        assert!(Path::new(&folder.path(&format!("out/{file}"))).is_file(), "{file} is written");
    }
}

#[test]
fn a_t_slot_cutter_of_a_table_reaches_what_no_end_mill_does_and_comes_back_from_its_files() {
    let folder = Folder::new();
    // A block of 60 x 40 x 30 with a slot along y, 12 wide at its mouth and 22 below.
    let outline = [[30, 0], [30, 30], [6, 30], [6, 20], [11, 20], [11, 12]];
    let half = outline.map(|[x, z]| glam::DVec2::new(f64::from(x), f64::from(z)));
    let other = half.iter().rev().map(|p| glam::DVec2::new(-p.x, p.y));
    let outline: Vec<_> = half.iter().copied().chain(other).collect();
    let right = [[0, 1, 4], [1, 2, 3], [1, 3, 4], [0, 4, 5], [0, 5, 6]];
    let left = [[0, 6, 11], [11, 7, 10], [10, 8, 9], [10, 7, 8], [11, 6, 7]];
    let cap: Vec<[u32; 3]> = right.into_iter().chain(left).collect();
    let mut mesh = deepmill::geom::solids::prism(&outline, &cap, 40.0);
    mesh.vertices.iter_mut().for_each(|p| *p = glam::DVec3::new(p.x, -p.z, p.y));
    let part = folder.path("slot.stl");
    deepmill::geom::formats::write_stl(part.as_ref(), &mesh).unwrap();
    let holder = folder.file("holder.csv", "height,lower,upper\n30,40,40\n");
    let reached = |name: &str, profile: &str| {
        let table = format!("name,profile,stick_out\n{name},{profile},60\n");
        let tools = folder.file(&format!("{name}.csv"), &table);
        let out = folder.path(name);
        let args = ["--tools", &tools, "--holder", &holder, "--directions", "up", "--out", &out];
        let label = ["label", &part, "--sites", "800", "--json"];
        let result = json(&deepmill(&[&label[..], &args].concat()));
        let file = folder.path(&format!("{name}/{name}/labels.npz"));
        let labels = LabelFile::read(file.as_ref()).unwrap();
        let accessible = labels.labels.answers.accessible();
        let below: Vec<bool> = (0..labels.sites.len())
            .filter(|&i| {
                let (p, n) = (labels.sites.points[i], labels.sites.normals[i]);
                // Walls of the slot and undersides of its lips.
                let is_lip = n.z < -0.5 && p.z > 19.9;
                p.x.abs() < 11.1
                    && (11.9..20.1).contains(&p.z)
                    && (is_lip || p.x.abs().min(11.0 * n.x.abs()) > 10.9)
                    && n.y.abs() < 0.5
            })
            .map(|i| accessible[i])
            .collect();
        assert!(below.len() > 20, "{}", below.len());
        assert!(result.to_string().contains("given by its profile"), "{result}");
        (below.iter().filter(|reached| **reached).count(), below.len(), file)
    };
    let (n, all, file) = reached("slot", "10.9:0 10.9:7.9 5:7.9 | 5:100");
    assert_eq!(n, all);
    let (n, ..) = reached("mill", "5:0 5:40 | 5:100");
    assert_eq!(n, 0);
    let why = json(&deepmill(&["explain", &file, "--site", "0", "--no-picture", "--json"]));
    assert_eq!(why["answer"], why["in_file"], "{why}");
}
