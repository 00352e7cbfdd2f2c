//! What the program promises at its command line: exit codes, one-line errors, JSON, files.
#![cfg(feature = "cli")]

mod command;

use command::{CUTTER, Folder, block, deepmill, failure, json, label_tools, stl, text};
use deepmill::answers::SiteAnswer;
use deepmill::data::files::volume::{PointAnswer, VolumeFile};
use deepmill::data::files::{LabelFile, PredictionFile};
use deepmill::findings::gate::SiteAreas;
use deepmill::model::Prediction;
use serde_json::Value;
use std::path::{Path, PathBuf};

#[test]
fn bad_files_fail_with_code_1_and_say_where_and_what_to_do() {
    let folder = Folder::new();
    let whole = stl(&block([0.0; 3], [40.0, 30.0, 20.0]));
    let edited = |at: usize, bytes: &[u8]| {
        let mut stl = whole.clone();
        stl[at..at + bytes.len()].copy_from_slice(bytes);
        stl
    };
    let two = [block([0.0; 3], [9.0; 3]), block([20.0; 3], [29.0; 3])].concat();
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
                 property float z\nend_header\n0 0 0\n";
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("empty.stl", vec![], "empty"),
        ("truncated.stl", whole[..whole.len() - 30].to_vec(), "byte"),
        ("count.stl", edited(80, &13u32.to_le_bytes()), "13"),
        ("boast.stl", edited(80, &u32::MAX.to_le_bytes()), "4294967295"),
        ("nan.stl", edited(96, &f32::NAN.to_le_bytes()), "NaN"),
        ("infinite.stl", edited(96, &f32::INFINITY.to_le_bytes()), "inf"),
        ("index.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n".to_vec(), "line 4"),
        ("open.stl", stl(&block([0.0; 3], [9.0; 3])[1..]), "edge"),
        ("normals.ply", cloud.into(), "normal"),
        ("garbage.npz", b"garbage".to_vec(), "garbage.npz"),
        ("drawing.step", b"ISO-10303-21;".to_vec(), "STL"),
        ("part.xyz", b"1 2 3".to_vec(), ".stl"),
    ];
    for (name, content, expected) in cases {
        let part = folder.file(name, content);
        let message = failure(&folder.label(&part, &[]), 1);
        assert!(message.contains(expected), "{name}: {message}");
        assert!(!Path::new(&folder.path("out")).exists(), "{name} left files behind");
    }
    // Several bodies are labeled, each against all.
    let two = folder.file("two.stl", stl(&two));
    let shown = ["--obstacles", "sites", "--sites", "100", "--no-picture", "--json"];
    assert_eq!(json(&folder.label(&two, &shown))["n_sites"], 100);
    std::fs::remove_dir_all(folder.path("out")).unwrap();
    let missing = failure(&folder.label(&folder.path("nowhere.stl"), &[]), 1);
    assert!(missing.contains("nowhere.stl"), "{missing}");
    failure(&folder.label(&folder.path(""), &[]), 1);
}

#[test]
fn bad_arguments_fail_with_code_2_and_name_the_argument() {
    let folder = Folder::new();
    let part = folder.block();
    let out = folder.path("out");
    for (cutter, expected) in [
        ("1.5,6,40", "--cutter"),
        ("1.5,6,40,x", "--cutter"),
        ("NaN,6,40,5", "CR"),
        ("0,6,40,5", "CR"),
        ("1.5,-6,40,5", "CH"),
        ("1.5,6,inf,5", "FR"),
        ("40,6,1.5,5", "FR"),
    ] {
        let output = deepmill(&["label", &part, "--cutter", cutter, "--out", &out]);
        let message = failure(&output, 2);
        assert!(message.contains(expected), "{cutter}: {message}");
    }
    for more in [
        ["--sites", "0"],
        ["--sites", "many"],
        ["--directions", "0"],
        ["--directions", "ring:5"],
        ["--engine", "magic"],
        ["--occlusion-share", "0"],
        ["--clearance", "NaN"],
        ["--corner", "2"],
        ["--scale", "0"],
        ["--scale", "NaN"],
    ] {
        let message = failure(&folder.label(&part, &more), 2);
        let name = more[0].trim_start_matches('-').replace('-', " ");
        assert!(message.contains(&name) || message.contains("corner"), "{more:?}: {message}");
    }
    for args in [&["label"][..], &["nonsense"], &["label", &part, "--unit", "furlong"]] {
        assert_eq!(deepmill(args).status.code(), Some(2), "{args:?}");
    }
}

#[test]
fn failures_under_json_are_json() {
    let output = deepmill(&["--json", "check", "nowhere.stl"]);
    assert_eq!(output.status.code(), Some(1));
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(result["error"].as_str().unwrap().contains("nowhere.stl"));
}

#[test]
fn label_writes_files_that_read_back_and_do_not_depend_on_threads() {
    let folder = Folder::new();
    let part = folder.block();
    let run = |threads: &str| {
        let out = folder.path(&format!("out{threads}"));
        let result = json(&deepmill(&[
            "label",
            &part,
            "--cutter",
            CUTTER,
            "--out",
            &out,
            "--sites",
            "600",
            "--json",
            "--occlusion",
            "--threads",
            threads,
        ]));
        (PathBuf::from(out), result)
    };
    let (out, result) = run("1");
    let file = LabelFile::read(&out.join("labels.npz")).unwrap();
    let count = |flags: &[bool]| flags.iter().filter(|f| **f).count();
    let share = |flags: &[bool]| count(flags) as f64 / 600.0;
    assert_eq!(result["n_sites"], 600);
    // The parser of this test may round a number's last bit. Shares are of the surface, as limits and tables of `tools`
    // have them.
    let mesh = deepmill::geom::formats::read_mesh(part.as_ref(), &Default::default()).unwrap();
    let areas = SiteAreas::of(&file.sites, Some(&mesh)).unwrap();
    let close = |name: &str, flags: &[bool]| {
        (result[name].as_f64().unwrap() - areas.share(|i| flags[i])).abs() < 1e-15
    };
    assert!(close("inaccessible", &file.labels.answers.inaccessible()), "{result}");
    assert!(close("accessible", &file.labels.answers.accessible()), "{result}");
    assert!(close("occlusion", file.labels.answers.occlusion()), "{result}");
    // All but a rim as wide as the cutter is long, which a horizontal tool reaches: 25 × 15 of 5,200 mm².
    let underside = share(&file.labels.answers.inaccessible());
    assert!((0.05..0.09).contains(&underside), "the middle of the underside is out of reach");
    let mut top = (0..file.sites.len()).filter(|&i| file.sites.normals[i].z > 0.5);
    let is_in_reach = |i| file.labels.answers.of(i) != SiteAnswer::Inaccessible;
    assert!(top.all(is_in_reach), "the top is in reach");
    assert_eq!(file.provenance.cutter.to_array(), [1.5, 6.0, 40.0, 5.0]);
    assert_eq!(file.provenance.part, "block.stl");
    let (other, _) = run("3");
    for path in result["files"].as_array().unwrap() {
        let name = Path::new(path.as_str().unwrap()).file_name().unwrap();
        let bytes = std::fs::read(out.join(name)).unwrap();
        assert!(bytes.len() > 300);
        assert!(bytes == std::fs::read(other.join(name)).unwrap(), "{name:?} differs");
    }
}

#[test]
fn label_answers_by_the_mesh_definition_and_says_so() {
    let folder = Folder::new();
    let part = folder.file("block.stl", stl(&block([0.0; 3], [40.0, 30.0, 20.0])));
    let clamp = folder.file("clamp.stl", stl(&block([0.0, 0.0, 20.5], [15.0, 30.0, 30.0])));
    let out = folder.path("out");
    let run = |more: &[&str]| {
        let args = ["label", &part, "--cutter", "1.5,30,10,5", "--out", &out, "--directions", "up"];
        let shown = ["--sites", "300", "--no-picture", "--json"];
        let output = deepmill(&[&args[..], &shown, more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let result: Value = serde_json::from_slice(&output.stdout).unwrap();
        (result, LabelFile::read(&Path::new(&out).join("labels.npz")).unwrap())
    };
    let (result, file) = run(&[]);
    assert_eq!(result["definition"], "mesh definition");
    let surface = file.labels.surface.as_ref().unwrap();
    for (i, normal) in file.sites.normals.iter().enumerate() {
        assert_eq!(
            file.labels.answers.of(i) == SiteAnswer::Inaccessible,
            normal.z < -0.5,
            "only the underside"
        );
        assert_eq!(surface.collision_free_directions[i], u32::from(normal.z > -0.5));
        assert_eq!(surface.witness[i].is_some(), normal.z > -0.5);
        assert_eq!(surface.tolerance_mm[i], 0.01);
    }
    assert_eq!(file.labels.answers.tip_does_not_fit(), vec![false; 300]);
    let (_, clamped) = run(&["--fixture", &clamp, "--table", "0", "--tolerance", "0.05"]);
    // At the rim a site is as near to the wall as the tolerance.
    let is_inside =
        |p: deepmill::glam::Vec3| (0.1..14.0).contains(&p.x) && (0.1..29.9).contains(&p.y);
    let under_clamp = |i: usize| file.sites.normals[i].z > 0.5 && is_inside(file.sites.points[i]);
    for i in 0..300 {
        let accessible = clamped.labels.answers.accessible()[i];
        assert!(!(accessible && under_clamp(i)), "{}", file.sites.points[i]);
    }
    let (result, clear) = run(&["--clearance-limit", "2"]);
    assert_eq!(clear.labels.answers.inaccessible(), file.labels.answers.inaccessible());
    for (i, clearance) in clear.labels.answers.clearance_mm().iter().enumerate() {
        assert!(clearance.abs() <= 2.0 && (*clearance > 0.0) == (file.sites.normals[i].z > -0.5));
    }
    assert!(result["clearance_median_mm"].as_f64().is_some_and(|c| c > 0.0));
    let (result, published) = run(&["--obstacles", "sites"]);
    assert_eq!(result["definition"], "published definition, points as obstacles");
    assert_eq!(published.labels.surface, None);
    assert_eq!(published.labels.witness.len(), 300);
}

#[test]
fn label_warns_with_numbers_where_an_answer_may_mislead() {
    let folder = Folder::new();
    let part = folder.file("inch.stl", stl(&block([0.0; 3], [2.0, 1.0, 0.5])));
    let out = folder.path("out");
    let args = ["label", &part, "--cutter", "1.5,30,10,5", "--out", &out, "--directions", "up"];
    let output = deepmill(&[&args[..], &["--sites", "50", "--no-picture", "--json"]].concat());
    let warnings = text(&output.stderr);
    assert!(warnings.contains("--unit in makes it 50.8 mm"), "{warnings}");
    assert!(warnings.contains("the cutter 3 mm wide"), "{warnings}");
    let result = json(&output);
    assert_eq!(result["warnings"][0][0]["warning"], "smaller-than-tool");
    assert_eq!(result["warnings"][0][0]["longest_mm"], 2.0);
    assert!(result["borderline"].is_number());
    let file = LabelFile::read(&Path::new(&out).join("labels.npz")).unwrap();
    assert_eq!(file.provenance.settings.json()["warnings"][1]["warning"], "tiny");
}

#[test]
fn several_bodies_are_labeled_each_against_all() {
    let folder = Folder::new();
    let mut bodies = block([0.0; 3], [40.0, 30.0, 20.0]);
    bodies.extend(block([0.0, 0.0, 20.5], [15.0, 30.0, 40.0]));
    let part = folder.file("bodies.stl", stl(&bodies));
    let out = folder.path("out");
    let args = ["label", &part, "--cutter", "1.5,30,10,5", "--out", &out, "--directions", "up"];
    let shown = ["--sites", "400", "--no-picture", "--json"];
    let result = json(&deepmill(&[&args[..], &shown].concat()));
    assert_eq!(result["bodies"].as_array().unwrap().len(), 2);
    let file = LabelFile::read(&Path::new(&out).join("labels.npz")).unwrap();
    for (i, p) in file.sites.points.iter().enumerate() {
        if (p.z - 20.0).abs() < 1e-3 && p.x < 14.0 {
            assert!(!file.labels.answers.accessible()[i], "under the other body: {p}");
        }
    }
    let published = [&args[..], &shown, &["--obstacles", "sites"]].concat();
    assert_eq!(json(&deepmill(&published))["n_sites"], 400);
    let checked = json(&deepmill(&["check", &part, "--json"]));
    assert_eq!((&checked["labelable"], &checked["n_components"]), (&true.into(), &2.into()));
}

#[test]
fn the_space_around_a_part_is_labeled_and_drawn() {
    let folder = Folder::new();
    // A block under half a roof.
    let mut bodies = block([0.0; 3], [20.0, 20.0, 10.0]);
    bodies.extend(block([0.0, 0.0, 15.0], [10.0, 20.0, 20.0]));
    let part = folder.file("roof.stl", stl(&bodies));
    let out = folder.path("out");
    let args = ["label", &part, "--cutter", "1,20,1,20", "--volume", "1", "--out", &out];
    let result = json(&deepmill(&[&args[..], &["--directions", "up", "--json"]].concat()));
    assert_eq!(result["n_points"], 20 * 20 * 20 - 20 * 20 * 10 - 10 * 20 * 5);
    let file = VolumeFile::read(&Path::new(&out).join("volume.npz")).unwrap();
    for n in 0..file.lattice.len() {
        let p = file.lattice.point(n);
        let expected = match (p.z, p.x) {
            (z, _) if z < 10.0 => PointAnswer::Inside,
            (z, x) if z > 15.0 && x < 10.0 => PointAnswer::Inside,
            (z, x) if z < 15.0 && x < 10.5 => PointAnswer::Inaccessible,
            (_, x) if x < 10.99 => continue,
            _ => PointAnswer::Accessible,
        };
        assert_eq!(file.answers[n], expected, "{p}");
    }
    assert!(Path::new(&out).join("volume.png").is_file());
    let two = [&args[..], &["--cutter", "1,2,3,4"]].concat();
    assert!(failure(&deepmill(&two), 2).contains("one tool"));
    let none = ["label", &part, "--cutter", CUTTER, "--volume", "0", "--out", &out];
    assert!(failure(&deepmill(&none), 2).contains("a positive length in mm"));
}

#[test]
fn sample_writes_clouds_that_can_be_labeled() {
    let folder = Folder::new();
    let part = folder.block();
    for name in ["sites.ply", "sites.npz"] {
        let cloud = folder.path(name);
        let result =
            json(&deepmill(&["sample", &part, "--sites", "200", "--out", &cloud, "--json"]));
        assert_eq!(result["n_sites"], 200);
        assert_eq!(deepmill::geom::formats::read_cloud(cloud.as_ref()).unwrap().len(), 200);
        assert!(folder.label(&cloud, &["--no-picture"]).status.success());
    }
    let corners = folder.path("corners.npz");
    let args = ["sample", &part, "--sites", "vertices", "--out", &corners, "--json"];
    assert_eq!(json(&deepmill(&args))["n_sites"], 8);
    let wrong = deepmill(&["sample", &part, "--out", &folder.path("sites.txt")]);
    assert!(failure(&wrong, 1).contains(".ply or .npz"));
}

#[test]
fn sample_says_how_even_the_sites_are_and_how_many_would_do() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("sites.ply"));
    let with = |more: &[&str]| {
        deepmill(&[&["sample", &part, "--sites", "400", "--out", &out, "--json"], more].concat())
    };
    let few = with(&["--cr", "1"]);
    let result = json(&few);
    for name in ["spacing_cv", "spacing_straight_cv", "cell_area_cv"] {
        assert!((0.0..0.12).contains(&result[name].as_f64().unwrap()), "{name}: {result}");
    }
    let enough = result["n_sites_enough"].to_string();
    assert!(text(&few.stderr).contains(&format!("{enough} sites would be enough")));
    let more = ["sample", &part, "--sites", &enough, "--cr", "1", "--smooth=20", "--out", &out];
    assert!(!text(&deepmill(&more).stderr).contains("warning"), "{enough}");
    assert!(failure(&with(&["--cr", "0"]), 2).contains("--cr"));
    assert!(failure(&with(&["--smooth=181"]), 2).contains("--smooth"));
}

#[test]
fn sample_tells_inside_from_outside() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("volume.npz"));
    let args = ["sample", &part, "--volume", "24000", "--out", &out, "--json"];
    let result = json(&deepmill(&args));
    // One point in each cubic millimeter of the bounding box, which the block fills.
    assert_eq!((&result["n_points"], &result["inside"]), (&24000.into(), &1.0.into()));
    let read = deepmill::data::npz::NpzReader::open(&out).unwrap();
    assert!(read.has("points") && read.has("inside"));
    assert!(failure(&deepmill(&[&args[..5], &["sites.ply"]].concat()), 1).contains("use .npz"));
}

#[test]
fn findings_pages_and_other_formats_are_written_on_request() {
    let folder = Folder::new();
    let tools =
        folder.file("shop.csv", "name,CR,CH,FR,FH\nlong & thin,1,30,5,20\nstub,1.5,0.2,90,0.2\n");
    let more = ["--report", "--also", "glb,csv"];
    let result = label_tools(&folder, "out", &[&["--tools", &tools][..], &more].concat());
    let read = |name: &str| std::fs::read(folder.path(&format!("out/{name}"))).unwrap();
    for name in
        ["findings.csv", "report.html", "stub/labels.glb", "stub/labels.csv", "stub/findings.json"]
    {
        assert!(read(name).len() > 100, "{name}");
    }
    let stub: Value = serde_json::from_slice(&read("stub/findings.json")).unwrap();
    let first = &stub["findings"][0];
    assert!(first["area_mm2"].as_f64() == stub["largest_mm2"].as_f64());
    assert_eq!(first["helps"]["tool"], "long & thin", "{stub}");
    assert_eq!(result["findings"]["surface_mm2"], stub["surface_mm2"]);
    let page = text(&read("report.html"));
    assert!(page.contains(">long &amp; thin</button>") && page.contains(">all tools</button>"));
    // From the folder alone: the same findings, a tab for each tool.
    std::fs::remove_file(folder.path("out/report.html")).unwrap();
    let again = json(&deepmill(&["report", &folder.path("out"), "--json"]));
    assert_eq!(again["findings"], result["findings"]);
    assert_eq!(text(&read("report.html")).matches("role=\"tab\"").count(), 3);
    let args = ["label", &folder.block(), "--cutter", CUTTER, "--out", "x", "--also", "obj"];
    assert!(failure(&deepmill(&args), 2).contains("glb or csv"));
}

/// The shares of the first tab's legend by their names, percent.
fn legend(page: &str) -> Vec<(String, String)> {
    let table = page.split("<table class=\"legend\">").nth(1).unwrap();
    let rows = table.split("</table>").next().unwrap().split("<tr ").skip(1);
    let cells = |row: &str| {
        let mut cells = row.split("<td").skip(2).map(|cell| {
            let mut words = String::new();
            let mut in_tag = true;
            for c in cell.chars() {
                match c {
                    '<' => in_tag = true,
                    '>' => in_tag = false,
                    c if !in_tag => words.push(c),
                    _ => {}
                }
            }
            words.trim().to_string()
        });
        (cells.next().unwrap(), cells.next().unwrap())
    };
    rows.map(cells).collect()
}

#[test]
fn accessible_is_one_number_whether_occlusion_is_shown_or_not() {
    let folder = Folder::new();
    let part = folder.block();
    for (more, names, checked) in [
        (&[][..], &["accessible", "inaccessible"][..], None),
        (&["--occlusion"], &["accessible", "inaccessible", "occlusion"], Some(true)),
        (
            &["--obstacles", "published", "--bottom", "none"],
            &["accessible", "inaccessible", "occlusion"],
            Some(true),
        ),
    ] {
        let shared = ["--sites", "400", "--no-picture", "--report", "--json"];
        let output = folder.label(&part, &[&shared[..], more].concat());
        let result = json(&output);
        let page = std::fs::read_to_string(folder.path("out/report.html")).unwrap();
        let legend = legend(&page);
        assert_eq!(legend.iter().map(|(name, _)| &name[..]).collect::<Vec<_>>(), names, "{more:?}");
        for (name, shown) in &legend {
            let stated = 100.0 * result[name].as_f64().unwrap();
            assert_eq!(shown, &format!("{stated:.1} %"), "{more:?}: {name}");
        }
        let has_box = page.contains("type=\"checkbox\" data-layer");
        assert_eq!(has_box, checked.is_some(), "{more:?}");
        assert_eq!(page.contains("data-layer checked"), checked == Some(true), "{more:?}");
        let file = LabelFile::read(folder.path("out/labels.npz").as_ref()).unwrap();
        assert_eq!(file.labels.answers.occlusion().is_empty(), checked.is_none(), "{more:?}");
        assert_eq!(result.get("occlusion").is_some(), checked.is_some(), "{more:?}");
    }
    // Who limits occlusion asks for it.
    let limit = ["--sites", "400", "--no-picture", "--json", "--fail-if", "occlusion>50%"];
    assert!(json(&folder.label(&part, &limit))["occlusion"].is_number());
}

#[test]
fn report_draws_again_and_compares() {
    let folder = Folder::new();
    let part = folder.block();
    let marked = ["--sites", "200", "--no-picture", "--occlusion"];
    assert!(folder.label(&part, &marked).status.success());
    let out = folder.path("out");
    let file = LabelFile::read(&Path::new(&out).join("labels.npz")).unwrap();
    let logits = |flags: &[bool], flip: usize| -> Vec<[f32; 2]> {
        let yes = |(i, f): (usize, &bool)| f32::from(u8::from(*f != (i == flip)));
        flags.iter().enumerate().map(|f| [0.5, yes(f)]).collect()
    };
    let mut prediction = Prediction::default();
    prediction.logits_inaccessible = logits(&file.labels.answers.inaccessible(), 0);
    prediction.logits_occlusion = logits(file.labels.answers.occlusion(), 200);
    let predictions = PredictionFile::new(file.provenance.clone(), file.sites.clone(), prediction);
    let guess = folder.path("guess.npz");
    predictions.write(guess.as_ref()).unwrap();
    let result = json(&deepmill(&["report", &out, "--compare", &guess, "--json"]));
    let scores = result["scores"].as_array().unwrap();
    assert_eq!(scores[0]["positive_class"], "inaccessible");
    assert_eq!(scores[0]["accuracy"], 199.0 / 200.0);
    assert_eq!(scores[2]["f1"], 1.0);
    // Labels that do not mark occlusion points are compared in what they say.
    assert!(folder.label(&part, &marked[..3]).status.success());
    let bare = json(&deepmill(&["report", &out, "--compare", &guess, "--json"]));
    assert_eq!(bare["scores"].as_array().unwrap()[..], scores[..2]);
    assert!(folder.label(&part, &marked).status.success());
    json(&deepmill(&["report", &out, "--compare", &guess, "--json"]));
    let page = std::fs::read_to_string(Path::new(&out).join("report.html")).unwrap();
    assert_eq!(
        page.matches("role=\"tab\"").count(),
        4,
        "exact, predicted, and a difference for each head"
    );
    for name in ["labels.png", "predictions.png", "difference-inaccessible.png"] {
        assert!(Path::new(&out).join(name).is_file(), "{name}");
    }
    let mut other = predictions;
    other.sites.points.reverse();
    other.write(guess.as_ref()).unwrap();
    let output = deepmill(&["report", &out, "--compare", &guess]);
    assert!(failure(&output, 1).contains("not the sites of the labels"));
    assert!(failure(&deepmill(&["report", &folder.path("")]), 1).contains("labels.npz"));
}

#[test]
fn every_command_has_help_with_an_example() {
    let help = text(&deepmill(&["--help"]).stdout);
    let listed = help.split("On a part:").nth(1).unwrap().split("Options:").next().unwrap();
    let named = listed.lines().filter_map(|l| l.strip_prefix("  "));
    let commands: Vec<&str> =
        named.filter(|l| !l.starts_with(' ')).filter_map(|l| l.split_whitespace().next()).collect();
    assert!(commands.contains(&"label") && commands.contains(&"reproduce"), "{commands:?}");
    assert_eq!(commands.len(), 20, "{commands:?}");
    for command in commands.into_iter().filter(|c| *c != "help") {
        let help = text(&deepmill(&[command, "--help"]).stdout);
        let verbs = help.contains("Commands:");
        assert!(help.contains("Example: deepmill ") || verbs, "{command}: {help}");
    }
}
