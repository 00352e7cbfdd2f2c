//! What `deepmill train` promises: settings, resuming, logs and files.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, deepmill, failure, json, text};
use std::path::Path;

/// A data set of two small parts.
fn data(folder: &Folder) -> String {
    let data = folder.path("my data");
    let args = ["dataset", "build", "--generated", "2", "--sites", "80", "--directions", "10"];
    assert!(deepmill(&[&args[..], &["--out", &data]].concat()).status.success());
    data
}

fn settings(run: &str) -> String {
    std::fs::read_to_string(Path::new(run).join("settings.toml")).unwrap()
}

#[test]
fn a_resumed_run_refuses_other_settings_and_says_why() {
    let folder = Folder::new();
    let (data, run) = (data(&folder), folder.path("run"));
    let begin = ["train", "--data", &data, "--out", &run, "--preset", "tiny", "--epochs", "2"];
    assert!(deepmill(&begin).status.success());
    let resume = ["train", "--data", &data, "--out", &run, "--resume"];
    let with = |more: &[&str]| deepmill(&[&resume[..], more].concat());
    for (more, expected) in [
        (&["--epochs", "60", "--lr", "5"][..], "lr 5.0, n_epochs 60, expected lr 0.1, n_epochs 2"),
        (&["--seed", "7"], "seed 7, expected seed 0"),
        (&["--batch-size", "1"], "batch_size 1, expected batch_size 4"),
        (&["--preset", "small"], "network."),
        (&["--online"], "online."),
    ] {
        let message = failure(&with(more), 2);
        assert!(message.contains(expected) && message.contains("--start-from"), "{message}");
    }
    for same in [&[][..], &["--epochs", "2"], &["--preset", "tiny", "--epochs", "2"]] {
        assert!(with(same).status.success(), "{same:?}");
    }
    let message = failure(&deepmill(&begin), 1);
    assert!(message.contains("holds a run already"), "{message}");
}

#[test]
fn a_partial_file_of_settings_changes_the_preset() {
    let folder = Folder::new();
    let (data, run) = (data(&folder), folder.path("run"));
    let config = folder.file("lr.toml", "lr = 0.02\nn_epochs = 1\n[network.input]\ndepth = 4\n");
    let args = ["train", "--data", &data, "--out", &run, "--preset", "tiny", "--config", &config];
    let output = deepmill(&args);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let settings = settings(&run);
    for line in ["lr = 0.02", "n_epochs = 1", "depth = 4", "batch_size = 4"] {
        assert!(settings.lines().any(|l| l == line), "{line}: {settings}");
    }
    let bad = folder.file("bad.toml", "seed = 1\nlearning_rate = 1\n");
    let args = ["train", "--data", &data, "--out", &folder.path("other"), "--config", &bad];
    let message = failure(&deepmill(&args), 1);
    assert!(message.contains("bad.toml: line 2: unknown field `learning_rate`"), "{message}");
}

#[test]
fn a_log_that_is_no_terminal_has_a_line_for_each_epoch() {
    let folder = Folder::new();
    let (data, run) = (data(&folder), folder.path("run"));
    let args = ["train", "--data", &data, "--out", &run, "--preset", "tiny", "--epochs", "3"];
    let output = deepmill(&args);
    let lines = text(&output.stdout);
    for epoch in 1..=3 {
        let starts = format!("epoch {epoch}: loss ");
        assert_eq!(lines.lines().filter(|l| l.starts_with(&starts)).count(), 1, "{lines}");
    }
}

#[test]
fn every_preset_leaves_a_best_network() {
    let folder = Folder::new();
    let (data, run) = (data(&folder), folder.path("run"));
    let args = ["train", "--data", &data, "--out", &run, "--preset", "tiny", "--epochs", "1"];
    let best = json(&deepmill(&[&args[..], &["--json"]].concat()))["best"].clone();
    let eval = ["eval", "--model", best.as_str().unwrap(), "--data", &data];
    assert!(deepmill(&eval).status.success());
}

/// The words are those of the shell: paths with spaces are quoted.
#[cfg(unix)]
#[test]
fn the_hint_after_an_interruption_is_the_command_that_goes_on() {
    use std::process::{Command, Stdio};
    let folder = Folder::new();
    let (data, run) = (data(&folder), folder.path("run"));
    let args = ["train", "--data", &data, "--out", &run, "--preset", "tiny", "--epochs", "100000"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_deepmill"));
    let child = command.args(args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    while !Path::new(&run).join("checkpoint.safetensors").exists() {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let message = failure(&child.wait_with_output().unwrap(), 1);
    let hint = format!("go on with `deepmill train --data '{data}' --out {run} --resume`");
    assert!(message.contains(&hint), "{message}");
    assert!(settings(&run).contains("n_epochs = 100000"));
}

#[test]
fn a_data_set_by_the_mesh_definition_is_told_apart_from_a_published_one() {
    let folder = Folder::new();
    let (of_sites, of_part) = (data(&folder), folder.path("of part"));
    let build = ["dataset", "build", "--generated", "2", "--sites", "80", "--directions", "10"];
    let part = [&build[..], &["--out", &of_part, "--obstacles", "part"]].concat();
    assert!(deepmill(&part).status.success());
    let labels = |folder: &str| {
        let set = deepmill::data::dataset::Dataset::open(Path::new(folder)).unwrap();
        let of_sample = |s: deepmill::data::Sample| s.answers.inaccessible();
        (
            set.manifest.settings.part_itself,
            set.samples(None).unwrap().into_iter().map(of_sample).collect::<Vec<_>>(),
        )
    };
    let (of_sites_labels, of_part_labels) = (labels(&of_sites), labels(&of_part));
    assert_eq!((of_sites_labels.0, of_part_labels.0), (false, true));
    assert_ne!(of_sites_labels.1, of_part_labels.1);
    let sized = folder.path("sized");
    let sizes = [&build[..], &["--out", &sized, "--sizes", "15,600"]].concat();
    assert!(deepmill(&sizes).status.success());
    let manifest = deepmill::data::dataset::Dataset::open(Path::new(&sized)).unwrap().manifest;
    for part in &manifest.parts {
        let largest = part.content.as_ref().unwrap().box_mm.into_iter().fold(0.0, f64::max);
        assert!((15.0..=600.0).contains(&largest), "{largest}");
    }
    let none = folder.path("none");
    let wrong = [&build[..], &["--out", &none, "--sizes", "600,15"]].concat();
    assert!(failure(&deepmill(&wrong), 2).contains("sizes is [600.0, 15.0]"));
    let run = folder.path("run");
    let train = ["train", "--out", &run, "--preset", "tiny", "--epochs", "1", "--data"];
    let message = failure(&deepmill(&[&train[..], &[&of_sites, &of_part]].concat()), 1);
    assert!(message.contains("another kind of obstacles"), "{message}");
    let model = folder.path("of part.safetensors");
    let run = folder.path("run of part");
    let train_part =
        ["train", "--out", &run, "--preset", "tiny", "--epochs", "3", "--data", &of_part];
    assert!(deepmill(&train_part).status.success());
    let best = Path::new(&run).join("best.safetensors").display().to_string();
    let weights = ["weights", &best, "--bf16", &model, "--calibrate", &of_part, "--json"];
    let weights = json(&deepmill(&weights));
    assert_eq!(weights["definition"], "part");
    for head in weights["calibration"].as_array().unwrap() {
        assert!(head["slope"].as_f64().unwrap() > 0.0 && head["offset"] != 0.0, "{head}");
    }
    let eval = |set: &str| deepmill(&["eval", "--model", &model, "--data", set, "--json"]);
    let scores = eval(&of_part);
    assert!(!text(&scores.stderr).contains("learned"), "{}", text(&scores.stderr));
    assert!(json(&scores)["pooled"][0]["calibration_error_i"].is_f64());
    let learned = "network learned the mesh definition; the labels of";
    assert!(text(&eval(&of_sites).stderr).contains(learned));
    let run = folder.path("other run");
    let train = ["train", "--out", &run, "--preset", "tiny", "--epochs", "1", "--data", &of_part];
    let message = failure(&deepmill(&[&train[..], &["--online"]].concat()), 2);
    assert!(message.contains("whose triangles it does not hold"), "{message}");
    let no = folder.path("no");
    let both = [&build[..], &["--out", &no, "--obstacles", "most"]].concat();
    assert!(failure(&deepmill(&both), 2).contains("published, part or a number"));
}

#[test]
fn a_graph_network_is_trained_scored_and_asked_as_the_octree_network_is() {
    let folder = Folder::new();
    let (data, run) = (data(&folder), folder.path("run"));
    let config = folder.file("graph.toml", "[network]\nkind = \"graph_sage\"\nwidths = [8, 8]\n");
    let args = ["train", "--data", &data, "--out", &run, "--preset", "tiny", "--epochs", "2"];
    let output = deepmill(&[&args[..], &["--config", &config]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(settings(&run).contains("kind = \"graph_sage\""), "{}", settings(&run));
    let resume = ["train", "--data", &data, "--out", &run, "--resume"];
    assert!(deepmill(&resume).status.success());
    let model = Path::new(&run).join("best.safetensors").display().to_string();
    assert!(text(&deepmill(&["weights", &model]).stdout).contains("graph_sage"));
    let scores = json(&deepmill(&["eval", "--json", "--model", &model, "--data", &data]));
    assert_eq!(scores["n_samples"], 2);
    let (part, out) = (folder.block(), folder.path("out"));
    let args = ["predict", &part, "--cutter", command::CUTTER, "--out", &out, "--model", &model];
    let more = ["--sites", "100", "--far", "--no-picture", "--json"];
    assert_eq!(json(&deepmill(&[&args[..], &more].concat()))["n_sites"], 100);
    let wrong = folder.file("wrong.toml", "[network]\nkind = \"graph_sage\"\ndepth = 3\n");
    let args = ["train", "--data", &data, "--out", &folder.path("no"), "--config", &wrong];
    let message = failure(&deepmill(&args), 1);
    assert!(message.contains("wrong.toml") && message.contains("`depth`"), "{message}");
}

#[test]
fn the_space_around_parts_is_learned_with_the_surface_and_without() {
    let folder = Folder::new();
    let (surface, run) = (data(&folder), folder.path("run"));
    let build = ["dataset", "build", "--generated", "2", "--sites", "80", "--directions", "10"];
    let [by_sites, by_part] = ["sites", "part"].map(|obstacles| {
        let set = folder.path(obstacles);
        let more = ["--volume", "--obstacles", obstacles, "--out", &set];
        assert!(deepmill(&[&build[..], &more].concat()).status.success());
        set
    });
    let samples = |folder: &str| {
        let set = deepmill::data::dataset::Dataset::open(Path::new(folder)).unwrap();
        set.samples(None).unwrap()
    };
    let (first, second) = (samples(&by_sites), samples(&by_part));
    for (a, b) in first.iter().zip(&second) {
        assert!(a.is_volume() && a.sites == b.sites && a.sites.len().abs_diff(80) < 40);
        assert_eq!(a.surface(), b.surface());
        assert_eq!(a.surface().unwrap().len(), 80);
    }
    let config = folder.file("space.toml", "[network.input]\nfeatures = \"P\"\n");
    let args = ["train", "--preset", "tiny", "--epochs", "2", "--data", &by_part, "--out"];
    let train = |out: &str, more: &[&str]| deepmill(&[&args[..], &[out], more].concat());
    let output = train(&run, &["--config", &config]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let model = Path::new(&run).join("best.safetensors").display().to_string();
    let eval = ["eval", "--json", "--model", &model, "--data", &by_part];
    assert_eq!(json(&deepmill(&eval))["per_sample"].as_array().unwrap().len(), 2);
    let refused = |args: &[&str], code, expected: &str| {
        let message = failure(&deepmill(args), code);
        assert!(message.contains(expected), "{message}");
    };
    let message = failure(&train(&folder.path("b"), &["--online"]), 2);
    assert!(message.contains("whose triangles it does not hold"), "{message}");
    let with_surface = folder.path("a");
    let online = ["--preset", "tiny", "--epochs", "2", "--online", "--data", &by_sites];
    let output = deepmill(&[&["train", "--out", &with_surface], &online[..]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let read_both = Path::new(&with_surface).join("model.safetensors").display().to_string();
    let score = json(&deepmill(&["eval", "--json", "--model", &read_both, "--data", &by_sites]));
    // The network and the majority class: none of them ranks occlusion points.
    assert_eq!(score["per_sample"].as_array().unwrap().len(), 2);
    refused(&[&eval[..], &["--exact"]].concat(), 1, "labels are about space");
    refused(&["dataset", "export", &by_part, "--out", &folder.path("c")], 1, "no normals");
    let (part, out) = (folder.block(), folder.path("out"));
    let predict = ["predict", &part, "--cutter", command::CUTTER, "--out", &out, "--model", &model];
    refused(&predict, 2, "learned the mesh definition, in space");
    let both = ["train", "--preset", "tiny", "--out", &folder.path("d"), "--data", &surface];
    refused(&[&both[..], &[&by_sites]].concat(), 1, "another kind of obstacles");
}
