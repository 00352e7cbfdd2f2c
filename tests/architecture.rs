//! The house plan holds: who imports whom, where unsafe code, threads, files and printing live.

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms every room but `simd` may use.
const EVERYWHERE: [&str; 7] = ["error", "scalar", "rng", "par", "aside", "Error", "Result"];

/// Room → rooms it may import. Arrows only point down.
const PLAN: [(&str, &[&str]); 21] = [
    ("report", &["train", "data", "metrics", "access", "geom", "cutter"]),
    ("parity", &["model", "nn", "octree", "optim", "loss", "cutter"]),
    (
        "train",
        &[
            "model",
            "data",
            "access",
            "geom",
            "optim",
            "loss",
            "metrics",
            "cutter",
            "directions",
            "simd",
        ],
    ),
    ("data", &["access", "geom", "octree", "cutter", "directions"]),
    ("model", &["nn", "octree", "cutter"]),
    ("nn", &["octree", "simd"]),
    ("gradcheck", &["nn", "loss"]),
    ("optim", &["simd"]),
    ("loss", &[]),
    ("metrics", &[]),
    ("access", &["geom", "cutter", "directions", "simd"]),
    ("octree", &[]),
    ("geom", &[]),
    ("cutter", &[]),
    ("directions", &[]),
    ("scalar", &["simd"]),
    ("par", &[]),
    ("aside", &[]),
    ("rng", &[]),
    ("error", &[]),
    ("simd", &[]),
];

/// Where files may be opened or written.
const FILE_ROOMS: [&str; 11] = [
    "aside.rs",
    "geom/formats",
    "data/npz",
    "data/dataset",
    "data/files",
    "model/weights",
    "parity/",
    "train/checkpoint",
    "train/history",
    "report/",
    "bin/",
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// (path below `src`, its lines without tests and comments)
fn files() -> Vec<(String, Vec<String>)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    sources(&root, &mut paths);
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).unwrap();
        let lines = text.lines().take_while(|l| !is_test_start(l));
        let code = lines.filter(|l| !l.trim_start().starts_with("//")).map(str::to_owned);
        (path.strip_prefix(&root).unwrap().to_str().unwrap().replace('\\', "/"), code.collect())
    };
    paths.into_iter().map(read).collect()
}

fn is_test_start(line: &str) -> bool {
    line.trim_start().starts_with("#[cfg(") && line.contains("test") && !line.contains("not(test")
}

fn room(path: &str) -> &str {
    path.split('/').next().unwrap().trim_end_matches(".rs")
}

/// Rooms named as `crate::room` or inside `crate::{…}` on one line.
fn imports(line: &str) -> Vec<String> {
    let mut found = Vec::new();
    for rest in line.split("crate::").skip(1) {
        let names: Vec<&str> = match rest.strip_prefix('{') {
            Some(list) => list.split(['}', ',']).collect(),
            None => vec![rest],
        };
        let word = |name: &str| {
            name.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()
        };
        found.extend(names.into_iter().map(word).filter(|w| !w.is_empty()));
    }
    found
}

#[test]
fn imports_only_point_down_the_plan() {
    let mut breaches = Vec::new();
    for (path, lines) in files().iter().filter(|(p, _)| p != "lib.rs" && !p.starts_with("bin/")) {
        let own = room(path);
        let Some((_, allowed)) = PLAN.iter().find(|(name, _)| *name == own) else {
            breaches.push(format!("{path}: a room the plan does not know"));
            continue;
        };
        for name in lines.iter().flat_map(|line| imports(line)) {
            let everywhere = own != "simd" && EVERYWHERE.contains(&name.as_str());
            if name != own && !everywhere && !allowed.contains(&name.as_str()) {
                breaches.push(format!("{path} imports {name}"));
            }
        }
    }
    assert!(breaches.is_empty(), "{breaches:#?}");
}

#[test]
fn unsafe_threads_files_and_printing_stay_in_their_rooms() {
    let mut breaches = Vec::new();
    for (path, lines) in files() {
        for line in lines {
            let word =
                |w: &str| line.split(|c: char| !c.is_alphanumeric() && c != '_').any(|x| x == w);
            let rules = [
                ("unsafe", word("unsafe") && !line.contains("deny("), path.starts_with("simd/")),
                ("rayon", word("rayon"), path == "par.rs"),
                (
                    "files",
                    line.contains("std::fs") || line.contains("File::"),
                    FILE_ROOMS.iter().any(|r| path.starts_with(r)),
                ),
                (
                    "printing",
                    line.contains("println!") || line.contains("print!("),
                    path.starts_with("bin/"),
                ),
            ];
            for (what, present, allowed) in rules {
                if present && !allowed {
                    breaches.push(format!("{path}: {what}: {}", line.trim()));
                }
            }
        }
    }
    assert!(breaches.is_empty(), "{breaches:#?}");
}
