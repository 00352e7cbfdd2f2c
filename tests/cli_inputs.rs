//! The command line refuses impossible options and unwritable outputs before it begins work.
#![cfg(feature = "cli")]

mod command;

use command::{CUTTER, Folder, block, deepmill, failure, json, stl, text};
use deepmill::data::files::LabelFile;
use std::path::Path;
use std::time::{Duration, Instant};

#[test]
fn a_hundred_thousand_threads_are_capped_with_a_word() {
    let folder = Folder::new();
    let part = folder.block();
    let start = Instant::now();
    let output = folder.label(&part, &["--sites", "50", "--no-picture", "--threads", "100000"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("warning: --threads 100000: "));
    assert!(start.elapsed() < Duration::from_secs(60));
}

#[test]
fn a_part_that_is_not_there_or_a_folder_is_said_to_be_so() {
    let folder = Folder::new();
    let (here, nowhere, out) = (folder.path("."), folder.path("nowhere"), folder.path("out"));
    for command in [&["check"][..], &["label", "--cutter", CUTTER, "--out", &out]] {
        let of = |path: &str| failure(&deepmill(&[command, &[path]].concat()), 1);
        assert!(of(&nowhere).contains("nowhere: cannot be read: No such file"), "{}", of(&nowhere));
        assert!(of(&here).contains("a folder, where a file is expected"), "{}", of(&here));
    }
    // Nor is a data set without a sample one.
    let build = ["dataset", "build", &nowhere, "--out", &out];
    let message = failure(&deepmill(&build), 1);
    assert!(message.contains("no sample; 1 of 1 parts were skipped"), "{message}");
    let manifest = std::fs::read_to_string(folder.path("out/manifest.json")).unwrap();
    assert!(manifest.contains("No such file"), "{manifest}");
}

#[test]
fn cutters_that_cannot_be_are_refused_as_typed() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    for command in ["label", "predict"] {
        for (cutter, expected) in [
            ("-1,6,40,5", "cutter radius CR is -1"),
            ("1e-30,6,40,5", "0.0001 mm to 10 m"),
            ("1.5,1e-30,40,5", "cutter height CH"),
        ] {
            let output = deepmill(&[command, &part, "--cutter", cutter, "--out", &out]);
            let message = failure(&output, 2);
            assert!(message.contains(expected), "{cutter}: {message}");
        }
        let output = deepmill(&[command, &part, "--cutter", CUTTER, "--out", &out, "--sites", "1"]);
        assert!(failure(&output, 2).contains("--sites is `1`, expected 2 or more"));
    }
    for (clearance, expected) in [("-1.5", "nothing would be left"), ("2e4", "within 10 m")] {
        let message = failure(&folder.label(&part, &["--clearance", clearance]), 2);
        assert!(message.contains(expected), "{message}");
    }
    for corner in ["-1", "1.6"] {
        let message = failure(&folder.label(&part, &["--corner", corner]), 2);
        assert!(message.contains("corner radius is"), "{message}");
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn tolerances_and_margins_are_echoed_and_kept_for_explanations() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let few = ["--sites", "200", "--directions", "up", "--no-picture", "--json"];
    let label = |cutter: &str, more: &[&str]| {
        let args = ["label", &part, "--cutter", cutter, "--out", &out];
        deepmill(&[&args[..], &few, more].concat())
    };
    let plain = json(&label("3,60,25,40", &[]));
    let more = ["--finish", "0.02", "--allowance", "0.3", "--clearance", "1"];
    let result = json(&label("3,60,25,40", &more));
    assert_eq!(result["finish_mm"], 0.02);
    assert_eq!(
        (&result["tolerance_least_mm"], &result["tolerance_mm"]),
        (&0.01.into(), &0.01.into())
    );
    assert_eq!(result["rests_on_tolerance"], 0);
    assert_eq!(result["accessible"], plain["accessible"], "walls of a block stay reached");
    assert!(result["cutter"].as_str().unwrap().ends_with("clearance 1 mm, allowance 0.3 mm"));
    let explain = |more: &[&str]| {
        json(&deepmill(
            &[&["explain", &out, "--site", "0", "--no-picture", "--json"], more].concat(),
        ))
    };
    let why = explain(&[]);
    assert_eq!((&why["finish_mm"], &why["allowance_mm"]), (&0.02.into(), &0.3.into()));
    let why = explain(&["--finish", "0.05", "--allowance", "0.1"]);
    assert_eq!((&why["finish_mm"], &why["allowance_mm"]), (&0.05.into(), &0.1.into()));
    // A holder that would be below the tip.
    let closed = json(&label("3,60,25,40", &["--clearance", "80"]));
    assert_eq!(closed["accessible"], 0.0);
    let warning = &closed["warnings"][0][0];
    assert_eq!(
        (&warning["warning"], &warning["clearance_mm"]),
        (&"clearance-closes".into(), &80.0.into())
    );
    assert!(warning["words"].as_str().unwrap().contains("closes every pose"), "{warning}");
    for (option, value) in [("--finish", "0"), ("--finish", "-1"), ("--allowance", "-1")] {
        let message = failure(&label("3,60,25,40", &[&format!("{option}={value}")]), 2);
        assert!(message.contains(option), "{message}");
    }
}

#[test]
fn triangles_without_area_change_no_answer_and_are_said() {
    let folder = Folder::new();
    let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| [i & 1, i >> 1 & 1, i >> 2]);
    let vertices =
        corners.map(|[x, y, z]| format!("v {} {} {}\n", 40 * x, 30 * y, 20 * z)).concat();
    let faces = "f 1 3 4\nf 1 4 2\nf 5 6 8\nf 5 8 7\nf 1 2 6\nf 1 6 5\nf 3 7 8\nf 3 8 4\n\
                 f 1 5 7\nf 1 7 3\nf 2 4 8\nf 2 8 6\n";
    let label = |part: &str| {
        let out = folder.path("out");
        let args = ["label", part, "--cutter", "3,10,20,30", "--directions", "up", "--out", &out];
        let output = deepmill(&[&args[..], &["--no-picture", "--json"]].concat());
        (json(&output), text(&output.stderr))
    };
    let (plain, _) = label(&folder.file("block.obj", format!("{vertices}{faces}")));
    let reached = plain["accessible"].as_f64().unwrap();
    // By hand 2180 of 5200 mm²; the ball also reaches as far below its equator as it comes within the finish tolerance.
    assert!((1.0 - reached - 2180.0 / 5200.0).abs() < 0.015, "{plain}");
    for (name, more, face) in [
        ("point", "v 20 15 60\nv 20 15 60\nv 20 15 60\n", "f 9 10 11\n"),
        ("same", "v 20 15 60\n", "f 9 9 9\n"),
        ("seg", "v 20 15 60\nv 20 15 60\nv 20 15 61\n", "f 9 10 11\n"),
        ("line", "v 0 15 60\nv 20 15 60\nv 40 15 60\n", "f 9 10 11\n"),
        ("slanted", "v 0.1 15.3 60.1\nv 10.3 20.4 63.5\nv 30.7 30.6 70.3\n", "f 9 10 11\n"),
    ] {
        let part = folder.file(&format!("{name}.obj"), format!("{vertices}{more}{faces}{face}"));
        let (found, words) = label(&part);
        assert_eq!(found["accessible"], plain["accessible"], "{name}");
        assert!(words.contains("left out 1 triangle without area"), "{name}: {words}");
        let checked = json(&deepmill(&["check", &part, "--json"]));
        assert_eq!(checked["bounds_mm"][1][2], 20.0, "{name}: {checked}");
        assert!(checked["changes"][0].as_str().unwrap().contains("without area"), "{checked}");
    }
    // A corner in the middle of an edge, the gap closed by a triangle without area.
    let split = faces.replace("f 1 2 6\n", "f 1 9 6\nf 9 2 6\nf 1 2 9\n");
    let within = folder.file("within.obj", format!("{vertices}v 20 0 0\n{split}"));
    let (found, words) = label(&within);
    assert!((found["accessible"].as_f64().unwrap() - reached).abs() < 0.01, "{found}");
    assert!(words.contains("1 triangle without area is no obstacle"), "{words}");
}

#[test]
fn every_length_takes_a_unit_and_is_never_taken_for_another() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let table = folder.file("mill.tbl", "T1 P1 D0.25 ;ball end\n");
    let holder = folder.file("er.csv", "height,lower,upper\n1in,28,1.5in\n");
    let few = ["--sites", "50", "--directions", "up", "--no-picture", "--json"];
    let stick_out = |more: &[&str]| {
        let args = ["tools", &part, "--library", &table, "--holder", &holder, "--out", &out];
        let output = deepmill(&[&args[..], &few, more].concat());
        json(&output)["tools"][0]["stick_out"].as_f64().unwrap()
    };
    for [stick, shank] in [["1.1", "0.25"], ["1.1in", "1/4 in"], ["27.94mm", "6.35 mm"]] {
        let lengths = ["--stick-out", stick, "--shank", shank, "--flute-length", "0.5in"];
        assert_eq!(stick_out(&[&lengths[..], &["--tool-unit", "in"]].concat()), 27.94, "{stick}");
    }
    let label = |more: &[&str]| {
        json(&deepmill(&[&["label", &part, "--out", &out], &few[..], more].concat()))
    };
    let inch = label(&[
        "--cutter",
        "1/16in,0.25in,40,5mm",
        "--corner",
        "1/32in",
        "--clearance",
        "0.01in",
        "--tolerance",
        "0.001in",
        "--table",
        "-1in",
        "--clearance-limit",
        "0.1in",
    ]);
    let mm = label(&[
        "--cutter",
        "1.5875,6.35,40,5",
        "--corner",
        "0.79375",
        "--clearance",
        "0.254",
        "--tolerance",
        "0.0254",
        "--table",
        "-25.4",
        "--clearance-limit",
        "2.54",
    ]);
    assert_eq!(inch["cutter"], mm["cutter"]);
    assert_eq!(inch["accessible"], mm["accessible"]);
    for (option, value) in [("--tolerance", "1 ell"), ("--corner", "x"), ("--table", "1/0in")] {
        let args = ["label", &part, "--cutter", CUTTER, "--out", &out, option, value];
        let output = deepmill(&args);
        assert_eq!(output.status.code(), Some(2), "{option}");
        assert!(text(&output.stderr).contains("not a length"), "{}", text(&output.stderr));
    }
}

#[test]
fn a_part_in_inches_is_warned_about_before_any_work() {
    let folder = Folder::new();
    let part = folder.file("inch.stl", stl(&block([0.0; 3], [3.0, 2.0, 1.0])));
    let (out, few) = (folder.path("out"), ["--sites", "50", "--no-picture"]);
    let tools = folder.file("shop.csv", "name,CR,CH,FR,FH\nD12,6,20,25,30\nD1,0.5,20,25,30\n");
    let commands = [
        &["check", &part][..],
        &["label", &part, "--tools", &tools, "--out", &out, "--directions", "up"],
        &["tools", &part, "--library", &tools, "--out", &out, "--directions", "up"],
        &["setups", &part, "--tools", &tools, "--machine", "3-axis", "--out", &out],
        &["sample", &part, "--out", &folder.path("a.ply")],
        &["machined", &part, "--tools", &tools, "--out", &out, "--directions", "up"],
        &["explain", &format!("{out}/D1"), "--site", "1", "--part", &part],
    ];
    for (k, command) in commands.into_iter().enumerate() {
        let few = if (1..=3).contains(&k) { &few[..] } else { &[] };
        let words = text(&deepmill(&[command, few].concat()).stderr);
        let inch = "3.000 mm long at most; if the file is in inches, --unit in makes it 76.2 mm";
        assert_eq!(words.matches(inch).count(), 1, "{command:?}: {words}");
        if ["label", "tools", "setups", "machined"].contains(&command[0]) {
            let wide = "1 of 2 tools are wider than the part is long (3.000 mm), D12 with 12 mm";
            assert!(words.contains(wide), "{command:?}: {words}");
        }
    }
    let output = deepmill(&["check", &part, "--unit", "in"]);
    assert!(!text(&output.stderr).contains("warning"), "{}", text(&output.stderr));
}

/// A block with decimals, `by` from the origin, as OBJ.
fn obj(low: [f64; 3], high: [f64; 3], by: [f64; 3]) -> String {
    let at = |i: usize, k: usize| by[k] + if i >> k & 1 == 1 { high[k] } else { low[k] };
    let corners = (0..8).map(|i| format!("v {:.6} {:.6} {:.6}\n", at(i, 0), at(i, 1), at(i, 2)));
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    corners.collect::<String>() + faces
}

#[test]
fn a_part_far_from_the_origin_has_the_answers_of_the_same_part_near_it() {
    let folder = Folder::new();
    let answers = |name: &str, by: [f64; 3], table: &str| {
        let part = folder.file(&format!("{name}.obj"), obj([0.0; 3], [40.1, 30.2, 20.3], by));
        let vise = obj([-30.0, -5.0, -3.0], [-0.5, 35.0, 25.7], by);
        let vise = folder.file(&format!("vise-{name}.obj"), vise);
        let out = folder.path(name);
        let args = ["label", &part, "--fixture", &vise, "--table", table, "--cutter", CUTTER];
        let few = ["--sites", "300", "--directions", "20", "--no-picture", "--json", "--out", &out];
        let output = deepmill(&[&args[..], &few].concat());
        let said = text(&output.stderr);
        (
            json(&output),
            deepmill::data::files::LabelFile::read(out_file(&out).as_ref()).unwrap(),
            said,
        )
    };
    let (near, near_file, said) = answers("near", [0.0; 3], "-3");
    assert!(near["origin_mm"].is_null() && !said.contains("warning"), "{said}");
    let by = [400_000.37, 800_000.21, -5000.5];
    let (far, far_file, said) = answers("far", by, "-5003.5");
    assert_eq!(far["origin_mm"], serde_json::json!(by));
    assert!(said.contains("relative to (400000.37, 800000.21, -5000.5) mm"), "{said}");
    assert_eq!((&near_file.sites, &near_file.labels), (&far_file.sites, &far_file.labels));
    assert_eq!(near["inaccessible"], far["inaccessible"]);
    assert_eq!(far_file.provenance.settings.origin_mm, Some(by));
    for file in ["part.stl", "fixtures.stl", "findings.csv"] {
        let bytes = |name| std::fs::read(folder.path(&format!("{name}/{file}"))).unwrap();
        assert!(bytes("near") == bytes("far"), "{file} differs");
    }
    let report = deepmill(&[
        "explain",
        &folder.path("far"),
        "--part",
        &folder.path("far.obj"),
        "--site",
        "3",
        "--no-picture",
    ]);
    assert!(report.status.success(), "{}", text(&report.stderr));
    let mended = folder.path("mended.stl");
    let checked = json(&deepmill(&["check", &folder.path("far.obj"), "--out", &mended, "--json"]));
    assert!(
        (checked["volume_mm3"].as_f64().unwrap() - 40.1 * 30.2 * 20.3).abs()
            < 1e-9 * 40.1 * 30.2 * 20.3
    );
    let cloud = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\n\
        property double z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n\
        400000.1 0 0 0 0 1\n400001 0 0 0 0 1\n";
    let message = failure(&folder.label(&folder.file("far.ply", cloud), &[]), 1);
    assert!(
        message.contains("x is 400000.09375 mm") && message.contains("0.03125 mm apart"),
        "{message}"
    );
}

fn out_file(out: &str) -> String {
    format!("{out}/labels.npz")
}

#[test]
fn negative_numbers_are_refused_for_what_they_are() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("sites.ply"));
    for option in ["--scale", "--weld", "--sites", "--occlusion-share"] {
        let message = failure(&folder.label(&part, &[option, "-1"]), 2);
        assert!(!message.contains("-- -1"), "{option}: {message}");
        assert!(message.contains("-1"), "{option}: {message}");
    }
    let data = folder.path("data");
    for option in ["--validation", "--min-edge"] {
        let build = ["dataset", "build", &part, "--out", &data, option, "-1"];
        assert!(failure(&deepmill(&build), 2).contains("-1, expected"), "{option}");
    }
    let message = failure(&deepmill(&["sample", &part, "--out", &out, "--cr", "-1"]), 2);
    assert!(message.contains("--cr is -1"), "{message}");
}

#[test]
fn cones_are_refused_in_the_degrees_they_were_typed_in() {
    let folder = Folder::new();
    let part = folder.block();
    for set in ["cone:200:5", "cone:-30:5"] {
        let message = failure(&folder.label(&part, &["--directions", set]), 2);
        assert!(message.contains(&format!("--directions is `{set}`")), "{message}");
        assert!(message.contains("180 degrees") && !message.contains("radians"), "{message}");
    }
}

#[test]
fn places_that_cannot_be_written_are_told_before_the_work() {
    let folder = Folder::new();
    // Not even the input has to be right: the output is looked at first.
    let (bad, file) = (folder.file("bad.stl", "x"), folder.file("file", "x"));
    let (below, here) = (folder.path("file/below"), folder.path(""));
    let cutter = ["--cutter", CUTTER];
    for out in [&file, &below] {
        for args in [
            &["label", &bad, cutter[0], cutter[1], "--out", out][..],
            &["predict", &bad, cutter[0], cutter[1], "--out", out],
            &["train", "--data", &bad, "--out", out],
            &["dataset", "build", &bad, "--out", out],
            &["dataset", "export", &bad, "--out", out],
            &["dataset", "import", &bad, "--out", out],
            &["generate", "--count", "1", "--out", out],
        ] {
            let message = failure(&deepmill(args), 1);
            assert!(message.contains("folder: it is a file; name another"), "{args:?}: {message}");
        }
    }
    let ply = folder.path("file/a.ply");
    for args in [
        &["sample", &bad, "--out", &ply][..],
        &["check", &bad, "--out", &ply],
        &["parity", &bad, "--out", &ply],
        &["weights", &bad, "--bf16", &ply],
        &["generate", "--count", "1", "--sheet", &ply],
    ] {
        let message = failure(&deepmill(args), 1);
        assert!(message.contains("file: folder: it is a file"), "{args:?}: {message}");
    }
    let message = failure(&deepmill(&["check", &bad, "--out", &here]), 1);
    assert!(message.contains("it is a folder; name a file"), "{message}");
}

#[test]
fn a_published_set_keeps_its_split_and_its_millimeters_or_says_that_it_cannot() {
    let folder = Folder::new();
    let [data, published, again] = ["data", "published", "again"].map(|name| folder.path(name));
    let build = ["--generated", "4", "--sites", "60", "--directions", "10", "--validation", "0.5"];
    let all = ["dataset", "build", "--out", &data, "--seed", "3"];
    let built = json(&deepmill(&[&all[..], &build, &["--json"]].concat()));
    let counts = |value: &serde_json::Value| {
        ["n_train_parts", "n_validation_parts"].map(|key| value[key].as_u64().unwrap())
    };
    let [train, validation] = counts(&built);
    assert!(train > 0 && validation > 0, "{built}");
    assert!(deepmill(&["dataset", "export", &data, "--out", &published]).status.success());

    let import = ["dataset", "import", &published, "--out", &again, "--json"];
    let output = deepmill(&import);
    assert_eq!(counts(&json(&output)), [train, validation]);
    assert!(!text(&output.stderr).contains("warning"), "{}", text(&output.stderr));
    let points = |folder: &str| {
        let set = deepmill::data::dataset::Dataset::open(Path::new(folder)).unwrap();
        let mut samples = set.samples(None).unwrap();
        samples.sort_by(|a, b| a.name.cmp(&b.name));
        samples.into_iter().map(|s| s.sites.points.clone()).collect::<Vec<_>>()
    };
    assert_eq!(points(&data), points(&again));

    std::fs::remove_dir_all(&again).unwrap();
    let output = deepmill(&[&import[..], &["--lists"]].concat());
    assert_eq!(counts(&json(&output)), [train, validation]);
    assert!(text(&output.stderr).contains("warning: the points of these lists are normalized"));

    std::fs::remove_dir_all(&again).unwrap();
    std::fs::remove_dir_all(Path::new(&published).join("filelist")).unwrap();
    let output = deepmill(&import);
    assert_eq!(counts(&json(&output)), [train + validation, 0]);
    assert!(text(&output.stderr).contains("4 samples are not in the lists"));
}

#[test]
fn unusable_fixtures_and_tables_are_named_with_a_remedy() {
    let folder = Folder::new();
    let part = folder.block();
    let out = folder.path("out");
    let fails = |more: &[&str], expected: &[&str]| {
        let args = ["label", &part, "--cutter", CUTTER, "--out", &out, "--sites", "50"];
        let output = deepmill(&[&args[..], more].concat());
        assert!(!output.status.success());
        let message = text(&output.stderr).to_string();
        for words in expected {
            assert!(message.contains(words), "{more:?}: {message}");
        }
    };
    let missing = folder.path("none.stl");
    fails(&["--fixture", &missing], &["none.stl"]);
    let garbage = folder.file("garbage.stl", "not a mesh");
    fails(&["--fixture", &garbage], &["garbage.stl"]);
    let empty = folder.file("empty.obj", "v 0 0 0\nv 1 0 0\n");
    fails(&["--fixture", &empty], &["empty.obj", "export the part again"]);
    let far = folder.file("far.obj", "v 0 0 0\nv 1 0 0\nv 0 5e7 0\nf 1 2 3\n");
    fails(&["--fixture", &far], &["far.obj", "vertex", "50000000", "--unit"]);
    let cloud = folder.path("sites.ply");
    json(&deepmill(&["sample", &part, "--sites", "100", "--out", &cloud, "--json"]));
    fails(&["--fixture", &cloud], &["sites.ply"]);
    for z in ["nan", "inf", "1e9"] {
        fails(&["--table", z], &["--table", "within 1 km"]);
    }
    fails(&["--table", "high"], &["--table"]);
}

#[test]
fn units_and_clouds_give_the_same_labels() {
    let folder = Folder::new();
    let inches = [40.0, 30.0, 20.0].map(|x: f32| x / 25.4);
    let part = folder.file("inch.stl", stl(&block([0.0; 3], inches)));
    let out = folder.path("out");
    let args = ["--unit", "in", "--sites", "300", "--no-picture", "--obstacles", "sites"];
    let output = folder.label(&part, &args);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("40 × 30 × 20 mm"), "{}", text(&output.stdout));
    let first = LabelFile::read(&Path::new(&out).join("labels.npz")).unwrap();
    for cloud in ["labels.npz", "labels.ply"] {
        let cloud = folder.path(&format!("out/{cloud}"));
        let again = folder.path("again");
        let output = deepmill(&["label", &cloud, "--cutter", CUTTER, "--out", &again]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let second = LabelFile::read(&Path::new(&again).join("labels.npz")).unwrap();
        assert_eq!(second.sites.points, first.sites.points);
        assert_eq!(second.labels.answers.inaccessible(), first.labels.answers.inaccessible());
        assert_eq!(second.labels.beta, first.labels.beta);
        assert!(Path::new(&again).join("labels.png").is_file());
        assert!(!Path::new(&again).join("part.stl").exists());
    }
}
