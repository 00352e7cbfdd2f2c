//! What `deepmill reproduce` promises: files, rows, and that nothing is trained twice.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, deepmill, failure, json};
use std::path::Path;

/// Four parts with few sites.
const SMALL: [&str; 6] = ["--parts-count", "4", "--sites", "80", "--preset", "tiny"];

fn reproduce<'a>(experiment: &'a str, out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["reproduce", experiment, "--out", out, "--json"][..], &SMALL, more].concat()
}

#[test]
fn every_experiment_writes_its_table_and_a_second_run_trains_nothing() {
    let folder = Folder::new();
    let out = folder.path("out");
    let args = reproduce("all", &out, &["--samples", "8"]);
    let first = json(&deepmill(&args));
    // Without modules: two tables. As the preset has it: three, and a fourth with labels of the earlier rule. At 80
    // sites on CAD parts: two.
    assert_eq!(first["trained"], 32);
    for (name, n_rows, files) in [
        ("table1", 7, &[".md", ".csv"][..]),
        ("length", 18, &[".md", ".csv", ".svg", ".png"]),
        ("symmetry", 7, &[".md", ".csv", ".png"]),
        ("directions", 22, &[".md", ".csv", ".png"]),
        ("cutters", 12, &[".md", ".csv", ".png"]),
        ("placement", 4, &[".md", ".csv", ".svg"]),
        ("loss", 7, &[".md", ".csv", ".svg"]),
        ("paper", 1, &[".md", ".csv", ".svg"]),
        ("depth", 12, &[".md", ".csv", ".svg"]),
        ("gallery", 18, &[".md", ".csv", "-inaccessible.png", "-occlusion.png", "-cutters.png"]),
        ("graph", 2, &[".md", ".csv", ".png"]),
        ("volume", 2, &[".md", ".csv", ".png"]),
    ] {
        assert_eq!(first[name]["table"].as_array().unwrap().len(), n_rows, "{name}");
        let path = |ending: &str| Path::new(&out).join(format!("{name}{ending}"));
        assert_eq!(first[name]["files"].as_array().unwrap().len(), files.len());
        assert!(files.iter().all(|ending| path(ending).is_file()), "{name}");
        let page = std::fs::read_to_string(path(".md")).unwrap();
        let n_lines = page.lines().filter(|line| line.starts_with('|')).count();
        assert_eq!(n_lines, n_rows + 2, "{page}");
    }
    for name in ["placement", "loss", "paper"] {
        let second = json(&deepmill(&reproduce(name, &out, &["--samples", "8"])));
        assert_eq!(second["trained"], 0);
        assert_eq!(second[name], first[name]);
    }
}

#[test]
fn a_budget_becomes_a_number_of_samples_that_the_folder_keeps() {
    let folder = Folder::new();
    let out = folder.path("out");
    let args = reproduce("placement", &out, &["--budget", "0.001"]);
    assert_eq!(json(&deepmill(&args))["trained"], 4);
    assert_eq!(json(&deepmill(&args))["trained"], 0);
    let page = std::fs::read_to_string(Path::new(&out).join("placement.md")).unwrap();
    assert!(page.contains(" samples of 3 parts with 4 cutters each"), "{page}");
}

#[test]
fn impossible_arguments_are_named() {
    let folder = Folder::new();
    let out = folder.path("out");
    for more in [&["--budget", "0"][..], &["--budget", "1", "--samples", "9"], &["--sites", "1"]] {
        assert_eq!(deepmill(&reproduce("length", &out, more)).status.code(), Some(2), "{more:?}");
    }
    let cube = command::stl(&command::block([0.0; 3], [30.0, 20.0, 10.0]));
    std::fs::create_dir(folder.path("parts")).unwrap();
    std::fs::write(Path::new(&folder.path("parts")).join("cube.stl"), cube).unwrap();
    let parts = folder.path("parts");
    let message = failure(&deepmill(&reproduce("length", &out, &["--parts", &parts])), 2);
    assert!(message.contains("--parts is 1, expected two meshes or more"), "{message}");
}
