//! The house plan holds: who imports whom, where unsafe code, threads, files and printing live.

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms every room but `simd` may use.
const EVERYWHERE: [&str; 7] = ["error", "scalar", "rng", "par", "aside", "Error", "Result"];

/// Room → rooms it may import. Arrows only point down.
const PLAN: [(&str, &[&str]); 22] = [
    ("arrays", &["model", "access", "geom"]),
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
    ("model", &["nn", "octree", "cutter", "geom"]),
    ("nn", &["octree", "simd"]),
    ("gradcheck", &["nn", "loss"]),
    ("optim", &["simd"]),
    ("loss", &[]),
    ("metrics", &[]),
    ("access", &["geom", "cutter", "directions", "simd"]),
    ("octree", &["simd"]),
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
const FILE_ROOMS: [&str; 13] = [
    "aside.rs",
    "geom/formats",
    "data/npz",
    "data/dataset",
    "data/files",
    "model/weights",
    "parity/",
    "train/checkpoint",
    "train/history",
    "train/run_folder",
    "train/settings_file",
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

/// Modules below `src`, as paths of names, and the code of each: `nn/conv_plan/dense.rs` is
/// `nn::conv_plan::dense`, `nn/mod.rs` is `nn`.
fn modules() -> Vec<(Vec<String>, String)> {
    let module = |(path, lines): (String, Vec<String>)| {
        let names = path.trim_end_matches(".rs").trim_end_matches("/mod").split('/');
        (names.map(str::to_owned).collect(), lines.join("\n"))
    };
    files().into_iter().map(module).collect()
}

/// Paths that the `use` items of some code name, braces written out, over any number of lines.
fn used_paths(code: &str) -> Vec<String> {
    let mut found = Vec::new();
    for item in code.split("use ").skip(1).filter_map(|rest| rest.split(';').next()) {
        expand("", item, &mut found);
    }
    found
}

/// Writes out one level of braces after another.
fn expand(prefix: &str, item: &str, found: &mut Vec<String>) {
    let item = item.trim();
    let Some((path, rest)) = item.split_once('{') else {
        return found.push(format!("{prefix}{item}"));
    };
    let list = &rest[..rest.rfind('}').unwrap_or(rest.len())];
    let (mut depth, mut start) = (0, 0);
    for (i, c) in list.char_indices().chain([(list.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let part = &list[start..i];
                if !part.trim().is_empty() {
                    expand(&format!("{prefix}{path}"), part, found);
                }
                start = i + 1;
            }
            _ => {}
        }
    }
}

/// The module that `path` leads to from `own`: the longest beginning that is one.
fn resolve(own: &[String], path: &str, known: &[&[String]]) -> Option<Vec<String>> {
    let mut at: Vec<String> = own.to_vec();
    for (i, name) in path.split("::").map(str::trim).enumerate() {
        match name {
            "crate" => at.clear(),
            "super" => drop(at.pop()),
            "self" => {}
            _ => {
                at.push(name.split_whitespace().next()?.to_owned());
                if i == 0 && !known.contains(&&at[..]) {
                    return None; // another crate
                }
            }
        }
    }
    while !at.is_empty() && !known.contains(&&at[..]) {
        at.pop();
    }
    (!at.is_empty() && at != own).then_some(at)
}

/// Rooms in which no module imports, by any way round, one that imports it. `mod.rs` files only list their
/// modules and stay out.
const ROOMS_WITHOUT_CIRCLES: [&str; 2] = ["nn", "model"];

#[test]
fn modules_of_a_room_import_in_no_circle() {
    let modules = modules();
    for room in ROOMS_WITHOUT_CIRCLES {
        let inside: Vec<_> = modules.iter().filter(|(m, _)| m[0] == room && m.len() > 1).collect();
        let known: Vec<&[String]> = inside.iter().map(|(module, _)| &module[..]).collect();
        let children = |code: &str| -> Vec<String> {
            let names = code.lines().filter_map(|line| line.trim().split_once("mod "));
            names.filter_map(|(_, name)| Some(name.strip_suffix(';')?.to_owned())).collect()
        };
        let imports = |(own, code): &(Vec<String>, String)| -> Vec<Vec<String>> {
            let child = |name: String| [&own[..], &[name]].concat();
            let used = used_paths(code).into_iter().filter_map(|p| resolve(own, &p, &known));
            used.chain(children(code).into_iter().map(child)).collect()
        };
        let mut left: Vec<_> = inside.iter().map(|m| (m.0.clone(), imports(m))).collect();
        assert!(left.iter().any(|(_, imports)| imports.len() > 3), "imports of {room} are read");
        // Whatever imports nothing that is left is no part of a circle.
        loop {
            let names: Vec<_> = left.iter().map(|(module, _)| module.clone()).collect();
            let before = left.len();
            left.retain(|(_, imports)| imports.iter().any(|import| names.contains(import)));
            if left.len() == before {
                break;
            }
        }
        assert!(left.is_empty(), "a circle among {left:#?}");
    }
}

#[test]
fn imports_over_several_lines_and_levels_are_read() {
    let code = "use crate::{\n    nn::{arena::Arena, rows},\n    par,\n};\nuse super::pass;";
    let expected = ["crate::nn::arena::Arena", "crate::nn::rows", "crate::par", "super::pass"];
    assert_eq!(used_paths(code), expected);
    let known = [["nn", "rows"], ["nn", "pass"]].map(|m| m.map(str::to_owned).to_vec());
    let known: Vec<&[String]> = known.iter().map(Vec::as_slice).collect();
    let own = ["nn", "conv"].map(str::to_owned);
    let resolved = |path| resolve(&own, path, &known).map(|m| m.join("::"));
    assert_eq!(resolved("crate::nn::rows::add").as_deref(), Some("nn::rows"));
    assert_eq!(resolved("super::pass::Context").as_deref(), Some("nn::pass"));
    assert_eq!(resolved("std::fmt"), None);
}
