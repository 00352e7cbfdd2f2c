//! What `--json` prints and `findings.json` holds is what docs/schema/deepmill.json promises.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, deepmill, grooved, text};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

/// The schema, and the definition that a value is held against.
struct Schema(Value);

impl Schema {
    fn read() -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/schema/deepmill.json");
        Schema(serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap())
    }

    fn errors(&self, name: &str, value: &Value) -> Vec<String> {
        let mut errors = Vec::new();
        self.check(&json!({ "$ref": format!("#/$defs/{name}") }), value, "", &mut errors);
        errors
    }

    /// The keywords that the schema uses; another is a mistake of the schema.
    fn check(&self, schema: &Value, value: &Value, at: &str, errors: &mut Vec<String>) {
        let keywords = schema.as_object().unwrap_or_else(|| panic!("no schema: {schema}"));
        for (keyword, of) in keywords {
            match &**keyword {
                "description" => {}
                "$ref" => {
                    let name = of.as_str().unwrap().strip_prefix("#").unwrap();
                    let target =
                        self.0.pointer(name).unwrap_or_else(|| panic!("{name} is missing"));
                    self.check(target, value, at, errors);
                }
                "type" => {
                    let is = |name: &Value| is_of_type(value, name.as_str().unwrap());
                    if !of.as_array().map_or_else(|| is(of), |all| all.iter().any(is)) {
                        errors.push(format!("{at}: {value} is no {of}"));
                    }
                }
                "enum" => {
                    if !of.as_array().unwrap().contains(value) {
                        errors.push(format!("{at}: {value} is not of {of}"));
                    }
                }
                "minimum" => {
                    if value.as_f64().is_some_and(|x| x < of.as_f64().unwrap()) {
                        errors.push(format!("{at}: {value} is below {of}"));
                    }
                }
                "minItems" | "maxItems" => {
                    let (n, limit) =
                        (value.as_array().map(Vec::len), of.as_u64().unwrap() as usize);
                    let is_bad =
                        |n: usize| if keyword == "minItems" { n < limit } else { n > limit };
                    if n.is_some_and(is_bad) {
                        errors.push(format!("{at}: {keyword} {limit}"));
                    }
                }
                "items" => {
                    for (k, item) in value.as_array().into_iter().flatten().enumerate() {
                        self.check(of, item, &format!("{at}/{k}"), errors);
                    }
                }
                "required" => {
                    let missing = |key: &&Value| value.get(key.as_str().unwrap()).is_none();
                    let all = of.as_array().unwrap().iter();
                    if let (true, Some(key)) = (value.is_object(), all.into_iter().find(missing)) {
                        errors.push(format!("{at}: {key} is missing"));
                    }
                }
                "properties" => {
                    for (key, of) in of.as_object().unwrap() {
                        if let Some(value) = value.get(key) {
                            self.check(of, value, &format!("{at}/{key}"), errors);
                        }
                    }
                }
                "additionalProperties" => {
                    let known = |key: &str| schema["properties"].get(key).is_some();
                    for (key, more) in value.as_object().into_iter().flatten() {
                        match of {
                            _ if known(key) => {}
                            Value::Bool(false) => errors.push(format!("{at}: {key} is unknown")),
                            of => self.check(of, more, &format!("{at}/{key}"), errors),
                        }
                    }
                }
                "anyOf" => {
                    let tried = of.as_array().unwrap().iter().map(|one| {
                        let mut errors = Vec::new();
                        self.check(one, value, at, &mut errors);
                        errors
                    });
                    let tried: Vec<_> = tried.collect();
                    if tried.iter().all(|errors| !errors.is_empty()) {
                        errors.push(format!("{at}: none of {tried:?}"));
                    }
                }
                other => panic!("{at}: the schema has {other}, which this test does not know"),
            }
        }
    }
}

fn is_of_type(value: &Value, name: &str) -> bool {
    match name {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        other => panic!("the schema has the type {other}"),
    }
}

/// Holds a value against a definition, which has to refuse it with a key more or, for any required key, a key less.
fn require(schema: &Schema, name: &str, value: &Value) {
    let errors = schema.errors(name, value);
    assert!(errors.is_empty(), "{name}: {errors:#?}");
    let mut more = value.clone();
    more["unheard_of"] = json!(1);
    assert!(!schema.errors(name, &more).is_empty(), "{name} takes any key");
    let required = schema.0["$defs"][name]["required"].as_array().unwrap();
    assert!(!required.is_empty(), "{name} requires nothing");
    for key in required {
        let mut less = value.clone();
        less.as_object_mut().unwrap().remove(key.as_str().unwrap());
        assert!(!schema.errors(name, &less).is_empty(), "{name} takes no {key}");
    }
}

fn run(args: &[&str]) -> Value {
    let output = deepmill(&[args, &["--json"]].concat());
    let code = output.status.code();
    assert!(code == Some(0) || code == Some(3), "{args:?}: {}", text(&output.stderr));
    let stdout = text(&output.stdout);
    assert_eq!(stdout.lines().count(), 1, "one object: {stdout}");
    serde_json::from_str(&stdout).unwrap()
}

#[test]
fn every_label_and_every_file_of_findings_is_of_the_schema() {
    let (schema, folder) = (Schema::read(), Folder::new());
    let (part, out, known) =
        (grooved(&folder, 20.0, 8.0), folder.path("out"), folder.path("k.toml"));
    let tools = folder.file("mill.csv", "name,CR,CH,FR,FH\nD6,3,14,20,30\nshort,3,1,20,30\n");
    let label = ["label", &part, "--out", &out, "--no-picture"];
    let cutter = ["--cutter", "3,14,20,30"];
    for more in [
        &[][..],
        &["--directions", "up", "--write-baseline", &known],
        &["--directions", "up", "--baseline", &known, "--fail-if", "inaccessible>1%", "--rest"],
        &["--table", "-1", "--clearance-limit", "1", "--occlusion", "--prove"],
        &["--only", "normal:0,0,1", "--allowance", "0.5"],
        &["--obstacles", "published"],
        &["--sites", "vertices", "--matrix", "npz,txt", "--safety-status"],
    ] {
        let sites = if more.contains(&"--sites") { &[][..] } else { &["--sites", "400"] };
        let result = run(&[&label[..], &cutter, sites, more].concat());
        require(&schema, "label", &result);
        require(&schema, "findings", &result["findings"]);
        let file = std::fs::read(folder.path("out/findings.json")).unwrap();
        require(&schema, "findings_file", &serde_json::from_slice(&file).unwrap());
        for finding in result["findings"]["findings"].as_array().unwrap() {
            require(&schema, "finding", finding);
        }
    }
    let label = [&label[..], &["--sites", "400"]].concat();
    let result = run(&[&label[..], &["--tools", &tools, "--baseline", &known]].concat());
    require(&schema, "label", &result);
    require(&schema, "baseline", &result["baseline"]);
    let profile = folder.file("profile.csv", "name,profile\nT,3:0 3:2 1:2 | 1:20\n");
    let held = folder.file("held.csv", "height,lower,upper\n30,20,20\n");
    let profile = ["--tools", &profile, "--holder", &held, "--stick-out", "20"];
    for tool in [&cutter[..], &profile] {
        let volume = run(&[&label[..], tool, &["--volume", "4"]].concat());
        require(&schema, "label_volume", &volume);
    }
    // A change of the finding that no schema may take.
    let mut wrong = result["findings"]["findings"][0].clone();
    for (key, value) in [
        ("cause", json!("accessible")),
        ("area_mm2", json!(-1)),
        ("at_mm", json!([1, 2])),
        ("status", json!("gone")),
        ("n_sites", json!(1.5)),
        ("id", Value::Null),
    ] {
        let right = std::mem::replace(&mut wrong[key], value);
        assert_eq!(schema.errors("finding", &wrong).len(), 1, "{key}: {wrong}");
        wrong[key] = right;
    }
}

#[test]
fn other_commands_about_a_part_print_what_the_schema_promises() {
    let (schema, folder) = (Schema::read(), Folder::new());
    let (part, out) = (grooved(&folder, 20.0, 8.0), folder.path("out"));
    let tools = folder.file("mill.csv", "name,CR,CH,FR,FH\nD6,3,14,20,30\nshort,3,1,20,30\n");
    let of_part = |command: &str, more: &[&str]| {
        run(&[&[command, &part, "--out", &out, "--no-picture"], more].concat())
    };
    let few =
        |command: &str, more: &[&str]| of_part(command, &[&["--sites", "400"], more].concat());
    let require = |name: &str, value: &Value| require(&schema, name, value);
    require("tools", &few("tools", &["--library", &tools]));
    require(
        "tools",
        &few(
            "tools",
            &["--library", &tools, "--only", "normal:0,0,1", "--fail-if", "inaccessible>1%"],
        ),
    );
    require("tools_alone", &run(&["tools", "--library", &tools, "--show", "--out", &out]));
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/machines/trunnion-ac.toml");
    let strokes = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/machines/three-axis.toml");
    for machine in ["3-axis", "3+2:60", "4-axis:x", file, strokes] {
        require("setups", &few("setups", &["--tools", &tools, "--machine", machine]));
    }
    let held = ["--machine", "3-axis", "--vise", "60,60,6", "--table", "10,300"];
    require("setups", &few("setups", &[&["--tools", &tools][..], &held].concat()));
    require("machined", &of_part("machined", &["--cutter", "3,14,20,30", "--accuracy", "1"]));
    let setups = ["--cutter", "3,14,20,30", "--accuracy", "1", "--machine", "3-axis", "--setup"];
    require("machined", &of_part("machined", &[&setups[..], &["+z", "--setup", "-z"]].concat()));
    require("check", &run(&["check", &part]));
    require("check", &run(&["check", &part, "--thin-wall", "13"]));
    let sites = folder.path("sites.npz");
    require("sample", &run(&["sample", &part, "--sites", "300", "--cr", "3", "--out", &sites]));
    require("sample_volume", &run(&["sample", &part, "--volume", "500", "--out", &sites]));
    require("generate", &run(&["generate", "--count", "1", "--out", &out]));
    require("generate_list", &run(&["generate", "--list"]));
    let out = folder.path("labels");
    let label = ["label", &part, "--out", &out, "--sites", "400", "--directions", "up"];
    run(&[&label[..], &["--cutter", "3,14,20,30", "--no-picture"]].concat());
    for site in ["0", "100", "200", "300"] {
        require("explain", &run(&["explain", &out, "--site", site, "--no-picture"]));
    }
    let at = ["explain", &out, "--at", "22,15,0", "--nearest", "--library", &tools, "--no-picture"];
    require("explain", &run(&at));
    require("report", &run(&["report", &out]));
    let vertices = ["--sites", "vertices", "--cutter", "3,14,20,30", "--no-picture"];
    let matrix = ["--matrix", "txt", "--safety-status", "--out", &out];
    run(&[&["label", &part], &vertices[..], &matrix].concat());
    for name in ["safety_status.txt", "visibility_matrix.txt"] {
        let other = folder.path(&format!("labels/{name}"));
        require("report", &run(&["report", &out, "--compare", &other]));
    }
    let broken = folder.file("broken.stl", "solid no\n");
    let all = folder.path("all");
    let parts = ["label", &part, &broken, "--out", &all, "--json"];
    let labeled = deepmill(&[&parts[..], &vertices].concat());
    assert_eq!(labeled.status.code(), Some(1));
    require("label_parts", &serde_json::from_slice(&labeled.stdout).unwrap());
    let predicted = folder.path("predicted");
    let predict =
        ["predict", &part, "--out", &predicted, "--sites", "400", "--no-picture", "--far"];
    require("predict", &run(&[&predict[..], &["--tools", &tools]].concat()));
    require(
        "predict",
        &run(&[&predict[..], &["--cutter", "1.5,6,40,5", "--verify", "0.2"]].concat()),
    );
    require("report", &run(&["report", &predicted]));
    let failed = deepmill(&["check", "nowhere.stl", "--json"]);
    require("error", &serde_json::from_slice(&failed.stdout).unwrap());
}

#[test]
fn commands_about_data_sets_and_networks_print_what_the_schema_promises() {
    let (schema, folder) = (Schema::read(), Folder::new());
    let require = |name: &str, value: &Value| require(&schema, name, value);
    let build = |out: &str, more: &[&str]| {
        let args = ["dataset", "build", "--generated", "2", "--sites", "80", "--out", out];
        run(&[&args[..], more].concat())
    };
    let [data, kept, space, shards] =
        ["data", "kept", "space", "shards"].map(|name| folder.path(name));
    require("dataset", &build(&data, &["--directions", "10"]));
    let kept_back = ["--directions", "10", "--validation", "0.5", "--seed", "3", "--cutters", "2"];
    require("dataset", &build(&kept, &kept_back));
    require("dataset", &build(&space, &["--volume", "--obstacles", "part"]));
    require("dataset_unfinished", &build(&shards, &["--shard", "0/2"]));
    require("dataset", &build(&shards, &["--shard", "1/2"]));
    let sized = ["--sizes", "15,600", "--obstacles", "50", "--bottom", "none"];
    for (k, directions) in
        ["deepmill++", "sphere:9", "latlong:2x4", "cone:30:9", "4-axis:x", "up"].iter().enumerate()
    {
        let more = [&sized[..], &["--occlusion-rounding", "ceil", "--directions", directions]];
        require("dataset", &build(&folder.path(&k.to_string()), &more.concat()));
    }
    require("dataset", &run(&["dataset", "show", &data]));
    let (published, imported) = (folder.path("published"), folder.path("imported"));
    require("dataset_export", &run(&["dataset", "export", &data, "--out", &published]));
    require("dataset", &run(&["dataset", "import", &published, "--out", &imported]));

    let train = |data: &str, name: &str, config: &str| {
        let (out, config) = (folder.path(name), folder.file(&format!("{name}.toml"), config));
        let args = ["train", "--data", data, "--out", &out, "--config", &config];
        let trained = run(&[&args[..], &["--preset", "tiny", "--epochs", "1"]].concat());
        require("train", &trained);
        (trained["best"].as_str().unwrap().to_owned(), trained)
    };
    let (octree, of_octree) = train(&kept, "octree", "");
    assert!(of_octree["last"]["validation"].is_array() && of_octree["best_epoch"] == 1);
    let graph = "[network]\nkind = \"graph_sage\"\nwidths = [8]\n";
    let (graph, of_graph) = train(&data, "graph", graph);
    assert!(of_graph["last"]["validation"].is_null() && of_graph["best_epoch"].is_null());
    let share = "[network]\nshare_head = true\n[network.attention]\ndepths = [3]\n";
    let coarse = format!("{share}[network.input]\ncoarse_directions = 10\n");
    let (share, _) = train(&data, "share", &coarse);
    let (in_space, _) = train(&space, "points", "[network.input]\nfeatures = \"P\"\n");

    for model in [&octree, &graph, &share, &in_space] {
        require("weights", &run(&["weights", model]));
    }
    require("weights", &run(&["weights"]));
    let recorded = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/parity");
    let weights = run(&["weights", &format!("{recorded}/weights.safetensors")]);
    assert!(weights["definition"].is_null() && weights["domain"].is_null());
    require("weights", &weights);
    let copy = folder.path("copy.safetensors");
    require("weights", &run(&["weights", &octree, "--bf16", &copy, "--calibrate", &data]));

    let drawn = folder.path("reliability.svg");
    let scores = run(&["eval", "--data", &data, "--reliability", &drawn]);
    assert_eq!(scores["files"], json!([drawn]));
    require("eval", &scores);
    require("eval", &run(&["eval", "--model", &in_space, "--data", &space]));
    let eval = ["eval", "--model", &share, "--against", &graph, "--data", &data, &kept];
    let scores = run(&[&eval[..], &["--exact", "--verify", "0.1,0.2"]].concat());
    assert!(scores["verified"].as_array().unwrap().len() == 4);
    assert!(scores["pooled"][0]["share_error"].is_number());
    require("eval", &scores);
    // Changes of a row that no schema may take.
    for (key, value) in [("f1_i", Value::Null), ("acc_o", json!(-0.5)), ("more", json!(1))] {
        let mut wrong = scores.clone();
        wrong["by_area"][0][key] = value;
        assert_eq!(schema.errors("eval", &wrong).len(), 1, "{key}");
    }
}

#[test]
fn checks_times_and_the_demo_print_what_the_schema_promises() {
    let (schema, folder) = (Schema::read(), Folder::new());
    let require = |name: &str, value: &Value| require(&schema, name, value);
    let fixtures = folder.path("fixtures");
    let layers = ["gradcheck", "--layer", "linear", "--layer", "graph_sage"];
    require("gradcheck", &run(&[&layers[..], &["--out", &fixtures]].concat()));
    let failed = deepmill(&["gradcheck", "--layer", "linear", "--limit", "1e-30", "--json"]);
    assert_eq!(failed.status.code(), Some(1));
    let failed: Value = serde_json::from_slice(&failed.stdout).unwrap();
    assert_eq!(failed["passed"], false);
    require("gradcheck", &failed);
    let recorded = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/parity");
    require("parity", &run(&["parity", recorded]));
    let actual = folder.path("actual.safetensors");
    let written = run(&["parity", recorded, "--out", &actual]);
    assert_eq!(written["files"], json!([actual]));
    require("parity", &written);
    let small = ["--preset", "tiny", "--batch", "1", "--sites", "100", "--seconds", "0.01"];
    require("bench_layers", &run(&[&["bench", "layers"], &small[..]].concat()));
    for work in ["octree", "forward", "step"] {
        let network = ["bench", "network", "--work", work];
        require("bench_network", &run(&[&network[..], &small].concat()));
    }
    // It writes to the folder that it is started in.
    let mut demo = Command::new(env!("CARGO_BIN_EXE_deepmill"));
    let demo = demo.args(["demo", "--json"]).current_dir(folder.path("")).output().unwrap();
    require("demo", &command::json(&demo));
}

#[test]
fn a_part_that_is_watched_is_told_as_the_schema_promises() {
    let (schema, folder) = (Schema::read(), Folder::new());
    let part = grooved(&folder, 20.0, 8.0);
    let tools = folder.file("mill.csv", "name,CR,CH,FR,FH\nD6,3,14,20,30\n");
    for args in [
        &["watch", &part, "--cutter", "3,14,20,30"][..],
        &["watch", "tools", &part, "--library", &tools],
        &["watch", "setups", &part, "--tools", &tools, "--machine", "3-axis"],
    ] {
        let mut program = Command::new(env!("CARGO_BIN_EXE_deepmill"));
        program.args(args).args(["--sites", "400", "--json"]);
        let mut program =
            program.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("a program");
        let line = BufReader::new(program.stdout.take().unwrap()).lines().next();
        program.kill().unwrap();
        program.wait().unwrap();
        require(&schema, "watch", &serde_json::from_str(&line.unwrap().unwrap()).unwrap());
    }
}

#[test]
fn every_experiment_prints_what_the_schema_promises() {
    let (schema, folder) = (Schema::read(), Folder::new());
    let small = ["--parts-count", "4", "--sites", "80", "--preset", "tiny", "--samples", "8"];
    let args = ["reproduce", "all", "--out", &folder.path("out")];
    let all = run(&[&args[..], &small].concat());
    require(&schema, "reproduce", &all);
    for (name, page) in all.as_object().unwrap().iter().filter(|(name, _)| *name != "trained") {
        require(&schema, &format!("reproduce_{name}"), page);
    }
}

#[test]
fn every_command_has_a_definition_and_every_object_is_closed() {
    let schema = Schema::read().0;
    let definitions = schema["$defs"].as_object().unwrap();
    let help = text(&deepmill(&["--help"]).stdout);
    let listed = help.split("On a part:").nth(1).unwrap().split("Options:").next().unwrap();
    let is_row = |line: &&str| line.starts_with("  ") && !line.starts_with("   ");
    let commands: Vec<&str> = listed.lines().filter(is_row).collect();
    assert!(commands.len() > 15, "{listed}");
    for command in commands.iter().map(|line| line.split_whitespace().next().unwrap()) {
        let of_verb = format!("{command}_");
        let is_its = |name: &String| name == command || name.starts_with(&of_verb);
        assert!(definitions.keys().any(is_its), "{command} has no definition");
    }
    let mut left: Vec<&Value> = definitions.values().collect();
    while let Some(value) = left.pop() {
        if value["properties"].is_object() {
            assert!(value.get("additionalProperties").is_some(), "open: {value}");
        }
        let target = value["$ref"].as_str().map(|name| name.strip_prefix("#").unwrap());
        assert!(target.is_none_or(|name| schema.pointer(name).is_some()), "{target:?}");
        left.extend(value.as_object().into_iter().flat_map(|object| object.values()));
        left.extend(value.as_array().into_iter().flatten());
    }
}
