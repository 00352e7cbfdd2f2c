//! The structure of the source holds: imports, unsafe code, threads, files and printing stay where they belong. Prose
//! is at most 120 columns wide.

use std::fs;
use std::path::{Path, PathBuf};

/// What all rooms above these may use.
const EVERYWHERE: [&str; 6] = ["error", "numeric", "exec", "storage", "Error", "Result"];

/// Room → rooms it may import. Arrows only point down.
const PLAN: [(&str, &[&str]); 28] = [
    (
        "capi",
        &["analysis", "report", "findings", "tables", "data", "access", "answers", "geom", "tool"],
    ),
    (
        "python",
        &[
            "analysis", "report", "findings", "train", "data", "model", "planning", "octree",
            "access", "answers", "geom", "tool",
        ],
    ),
    ("arrays", &["access", "answers", "model", "geom"]),
    (
        "analysis",
        &[
            "report", "findings", "render", "tables", "data", "model", "planning", "access",
            "answers", "geom", "tool",
        ],
    ),
    (
        "report",
        &[
            "findings", "render", "tables", "train", "data", "model", "learn", "planning",
            "access", "answers", "geom", "spatial", "tool",
        ],
    ),
    ("findings", &["tables", "data", "access", "answers", "geom", "tool"]),
    ("render", &["data", "access", "answers", "geom", "spatial"]),
    ("tables", &["geom"]),
    ("conformance", &["model", "nn", "octree", "learn", "tool"]),
    ("train", &["model", "nn", "data", "access", "answers", "geom", "learn", "tool", "simd"]),
    ("data", &["model", "planning", "access", "answers", "geom", "octree", "tool"]),
    ("model", &["nn", "octree", "access", "answers", "tool", "geom", "spatial"]),
    ("nn", &["octree", "simd"]),
    ("learn", &["answers", "simd"]),
    ("planning", &["access", "geom", "tool"]),
    ("access", &["answers", "geom", "spatial", "tool", "simd"]),
    ("answers", &["geom"]),
    ("octree", &["spatial", "simd"]),
    ("geom", &["spatial"]),
    ("spatial", &["simd"]),
    ("tool", &[]),
    ("numeric", &["simd", "Error", "Result"]),
    ("storage", &["exec", "Error", "Result"]),
    ("exec", &["simd", "Error", "Result"]),
    ("setters", &[]),
    ("guide", &[]),
    ("error", &[]),
    ("simd", &[]),
];

/// Where files may be opened or written.
const FILE_MODULES: [&str; 20] = [
    "storage/atomic_file.rs",
    "storage/folder_lock.rs",
    "storage/input_file.rs",
    "exec/memory.rs",
    "geom/formats",
    "data/npz",
    "conformance/gradcheck/fixture",
    "data/dataset",
    "data/files",
    "model/weights",
    "conformance/parity/",
    "train/checkpoint",
    "train/history",
    "train/run_folder",
    "train/settings_file",
    "report/",
    "findings/",
    "render/",
    "tables",
    "bin/",
];

/// Files below a folder with this extension.
fn below(folder: &Path, extension: &str, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            below(&path, extension, found);
        } else if path.extension().is_some_and(|e| e == extension) {
            found.push(path);
        }
    }
}

/// (path below `src`, its lines without tests and comments)
fn files() -> Vec<(String, Vec<String>)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    below(&root, "rs", &mut paths);
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

fn top_module(path: &str) -> &str {
    path.split('/').next().unwrap().trim_end_matches(".rs")
}

/// Top modules named as `crate::module` or in a list `crate::{…}`, which may be nested and go over lines.
fn imports(code: &str) -> Vec<String> {
    code.split("crate::").skip(1).flat_map(heads).collect()
}

/// The first name of a path, or of each path of the list that begins here.
fn heads(path: &str) -> Vec<String> {
    let word = |name: &str| {
        name.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()
    };
    let Some(list) = path.strip_prefix('{') else { return vec![word(path)] };
    let (mut depth, mut names, mut from) = (0, Vec::new(), 0);
    for (at, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            ',' | '}' if depth == 0 => {
                names.push(word(&list[from..at]));
                from = at + 1;
                if c == '}' {
                    break;
                }
            }
            '}' => depth -= 1,
            _ => {}
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

#[test]
fn imports_are_read_over_lines_and_in_nested_lists() {
    let code = "use crate::{\n    access::{label, Labels},\n    geom,\n};\nlet x = crate::par::map(crate::Error);";
    assert_eq!(imports(code), ["access", "geom", "par", "Error"]);
    assert_eq!(
        imports("use crate::simd::{Kernel, Isa};\nuse crate::{Error, Result, par};"),
        ["simd", "Error", "Result", "par"]
    );
}

#[test]
fn imports_only_point_down_the_plan() {
    let mut breaches = Vec::new();
    for (path, lines) in files().iter().filter(|(p, _)| p != "lib.rs" && !p.starts_with("bin/")) {
        let own = top_module(path);
        let Some((_, allowed)) = PLAN.iter().find(|(name, _)| *name == own) else {
            breaches.push(format!("{path}: a module the plan does not know"));
            continue;
        };
        for name in imports(&lines.join("\n")) {
            let is_above = own != "simd" && !EVERYWHERE.contains(&own);
            let everywhere = is_above && EVERYWHERE.contains(&name.as_str());
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
                (
                    "unsafe",
                    word("unsafe") && !line.contains("deny("),
                    path.starts_with("simd/")
                        || path.starts_with("capi/border/")
                        || path == "python/output.rs",
                ),
                ("rayon", word("rayon"), path == "exec/par.rs"),
                (
                    "files",
                    line.contains("std::fs") || (word("File") && line.contains("File::")),
                    FILE_MODULES.iter().any(|r| path.starts_with(r)),
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

/// The module of a file: `access/points/mod.rs` is `access/points`.
fn module(path: &str) -> &str {
    let path = path.strip_suffix(".rs").unwrap();
    path.strip_suffix("/mod").unwrap_or(path)
}

/// Every path that code names from `super` or `crate` on, lists written out: `super::a::{b, c::d}` gives two.
fn paths(code: &str) -> Vec<String> {
    let mut found = Vec::new();
    for start in ["super::", "crate::"] {
        for (at, _) in code.match_indices(start) {
            let before = code[..at].chars().next_back();
            if !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
                spell_out("", &code[at..], &mut found);
            }
        }
    }
    found
}

fn spell_out(prefix: &str, rest: &str, found: &mut Vec<String>) {
    let end =
        rest.find(|c: char| !c.is_alphanumeric() && c != '_' && c != ':').unwrap_or(rest.len());
    let path = format!("{prefix}{}", &rest[..end]);
    let Some(list) = rest[end..].strip_prefix('{') else { return found.push(path) };
    let (mut depth, mut from) = (0, 0);
    for (at, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            ',' | '}' if depth == 0 => {
                spell_out(&path, list[from..at].trim(), found);
                from = at + 1;
                if c == '}' {
                    return;
                }
            }
            '}' => depth -= 1,
            _ => {}
        }
    }
}

/// The module among `modules` that a path named in module `own` leads to.
fn target<'a>(own: &str, path: &str, modules: &'a [String]) -> Option<&'a String> {
    let mut at: Vec<&str> = own.split('/').collect();
    for name in path.split("::") {
        match name {
            "crate" => at.clear(),
            "super" => {
                at.pop();
            }
            name => at.push(name),
        }
    }
    (1..=at.len()).rev().find_map(|n| modules.iter().find(|module| **module == at[..n].join("/")))
}

/// A module that reaches itself by `edges`, and the way there.
fn circle(edges: &[(String, Vec<String>)]) -> Option<Vec<String>> {
    fn visit(
        at: &str,
        way: &mut Vec<String>,
        done: &mut Vec<String>,
        edges: &[(String, Vec<String>)],
    ) -> bool {
        if way.iter().any(|module| module == at) {
            way.push(at.into());
            return true;
        }
        if done.iter().any(|module| module == at) {
            return false;
        }
        way.push(at.into());
        let next = edges.iter().filter(|(from, _)| from == at).flat_map(|(_, to)| to);
        for to in next {
            if visit(to, way, done, edges) {
                return true;
            }
        }
        done.extend(way.pop());
        false
    }
    let mut done = Vec::new();
    edges.iter().find_map(|(from, _)| {
        let mut way = Vec::new();
        visit(from, &mut way, &mut done, edges).then_some(way)
    })
}

/// What a module declares or hands on of its children is no import; what children take from their parent is.
#[test]
fn submodules_of_every_room_do_not_import_each_other_in_circles() {
    let files = files();
    for (room, _) in PLAN {
        let own: Vec<_> = files.iter().filter(|(path, _)| top_module(path) == room).collect();
        let modules: Vec<String> = own.iter().map(|(path, _)| module(path).to_string()).collect();
        let edges = own.iter().map(|(path, lines)| {
            let from = module(path);
            let to = paths(&lines.join("\n"))
                .into_iter()
                .filter_map(|path| target(from, &path, &modules));
            (from.to_string(), to.filter(|to| *to != from).cloned().collect())
        });
        let found = circle(&edges.collect::<Vec<_>>());
        assert!(found.is_none(), "{found:?}");
    }
}

#[test]
fn circles_of_imports_are_found() {
    let modules = ["a", "a/b", "a/c", "a/c/d"].map(String::from);
    assert_eq!(target("a/c/d", "super::super::b::Thing", &modules).unwrap(), "a/b");
    assert_eq!(target("a/b", "crate::a::c::d::Thing", &modules).unwrap(), "a/c/d");
    assert_eq!(target("a/b", "crate::other::Thing", &modules), None);
    let listed = paths("use super::{b, c::{d::X, Y}};\nuse crate::a::b::Z;");
    assert_eq!(listed, ["super::b", "super::c::d::X", "super::c::Y", "crate::a::b::Z"]);
    let edge =
        |from: &str, to: &[&str]| (from.to_string(), to.iter().map(|to| to.to_string()).collect());
    assert_eq!(circle(&[edge("a", &["b", "c"]), edge("b", &["c"]), edge("c", &[])]), None);
    let found = circle(&[edge("a", &["b"]), edge("b", &["c"]), edge("c", &["b"])]).unwrap();
    assert_eq!(found, ["a", "b", "c", "b"]);
}

/// Texts in quotes, without those of raw strings; of a text that goes over lines all of it.
fn texts(code: &str) -> Vec<String> {
    let (mut found, mut rest) = (Vec::new(), code);
    while let Some(start) = rest.find('"') {
        let is_char = rest[..start].ends_with('\'') || rest[..start].ends_with("'\\");
        let mut text = String::new();
        let mut end = start + 1;
        if !is_char {
            let mut escaped = false;
            for c in rest[start + 1..].chars() {
                end += c.len_utf8();
                match c {
                    '"' if !escaped => break,
                    '\\' if !escaped => escaped = true,
                    c => {
                        text.push(c);
                        escaped = false;
                    }
                }
            }
            found.push(text);
        }
        rest = &rest[end..];
    }
    found
}

/// Texts of the program that the library holds: units are doubted where files are read for a command.
const TEXTS_OF_THE_PROGRAM: [&str; 1] = ["geom/units.rs"];

#[test]
fn messages_of_the_library_name_its_own_arguments() {
    let names_flag = |text: &str| {
        let mut words = text.split([' ', '`', '(', '\n']);
        words
            .any(|word| word.strip_prefix("--").is_some_and(|w| w.starts_with(char::is_alphabetic)))
    };
    let explains = |text: &str| {
        ["command line", "in a program", "`deepmill "].iter().any(|words| text.contains(words))
    };
    let mut faults = Vec::new();
    for (path, lines) in files() {
        if path.starts_with("bin/")
            || path.contains("tests")
            || TEXTS_OF_THE_PROGRAM.contains(&&*path)
        {
            continue;
        }
        let found = texts(&lines.join("\n")).into_iter().filter(|t| names_flag(t) && !explains(t));
        faults.extend(found.map(|text| format!("{path}: {text:?}")));
    }
    assert!(faults.is_empty(), "a flag of the program is no argument of the library: {faults:#?}");
}

#[test]
fn texts_are_read_over_lines_and_past_escapes() {
    let code = r#"let a = "one \"two\""; let b = '"'; let c = "three \
        four";"#;
    let found = texts(code);
    assert_eq!((found.len(), &*found[0]), (2, "one \"two\""));
    assert!(found[1].starts_with("three") && found[1].ends_with("four"));
}

/// Lines of prose of more than 120 columns, in a page or in the comments of a source file: by number, without code,
/// tables and pictures with their captions.
fn wide_lines(text: &str, is_page: bool) -> Vec<usize> {
    let mut in_code = false;
    let mut found = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim_end();
        let prose = if is_page { Some(line) } else { comment(line) };
        let Some(prose) = prose else {
            in_code = false;
            continue;
        };
        if prose.trim_start().starts_with("```") {
            in_code = !in_code;
            continue;
        }
        let is_laid_out =
            in_code || ["    ", "|", "!["].iter().any(|start| prose.starts_with(start));
        if !is_laid_out && line.chars().count() > 120 && prose.contains(' ') {
            found.push(number + 1);
        }
    }
    found
}

/// What a line that is a comment says, without its marker.
fn comment(line: &str) -> Option<&str> {
    let line = line.trim_start().strip_prefix("//")?;
    let line = line.strip_prefix(['/', '!']).unwrap_or(line);
    Some(line.strip_prefix(' ').unwrap_or(line))
}

#[test]
fn prose_is_at_most_120_columns_wide() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths: Vec<_> = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md"]
        .iter()
        .map(|page| root.join(page))
        .collect();
    for folder in ["docs", "src", "tests", "benches", "examples", "fuzz/fuzz_targets"] {
        let folder = root.join(folder);
        // The package has no fuzz targets.
        if folder.exists() {
            ["md", "rs"].iter().for_each(|extension| below(&folder, extension, &mut paths));
        }
    }
    let mut faults = Vec::new();
    for path in paths {
        let text = fs::read_to_string(&path).unwrap();
        let is_page = path.extension().is_some_and(|e| e == "md");
        let lines = wide_lines(&text, is_page);
        faults.extend(lines.iter().map(|line| format!("{}:{line}", path.display())));
    }
    assert!(faults.is_empty(), "wrap at 120 columns: {faults:#?}");
}

#[test]
fn wide_lines_are_found_beside_code_and_tables() {
    let wide = "word ".repeat(25);
    let page = format!(
        "{wide}\n\n```text\n{wide}\n```\n\n    {wide}\n| {wide} |\n- {wide}\n{}",
        "x".repeat(130)
    );
    assert_eq!(wide_lines(&page, true), [1, 9]);
    let source =
        format!("//! {wide}\nlet a = \"{wide}\";\n/// ```\n/// {wide}\n/// ```\n// {wide}\n");
    assert_eq!(wide_lines(&source, false), [1, 6]);
}
