//! Names of tools as their files have them, and names of folders that every system allows.

use super::{Tool, starts_with_ignoring_case};
#[cfg(any(feature = "python", feature = "capi"))]
use crate::{Error, Result};
use std::collections::HashSet;

/// Longest name of a folder, bytes.
const LONGEST: usize = 80;

fn is_forbidden(c: char) -> bool {
    c.is_control() || r#"/\:*?"<>|"#.contains(c)
}

/// Files beside the folders, and names that Windows keeps for devices.
fn is_taken(name: &str) -> bool {
    let files = ["part.stl", "fixtures.stl", "report.html"];
    let starts = ["tools.", "findings.", "stick-out."];
    let stem = name.split('.').next().unwrap_or_default().trim_end();
    let numbered = |device: &str| {
        starts_with_ignoring_case(stem, device)
            && matches!(&stem.as_bytes()[device.len()..], [b'0'..=b'9'])
    };
    let is_device = ["con", "prn", "aux", "nul"].iter().any(|d| stem.eq_ignore_ascii_case(d));
    files.iter().any(|file| name.eq_ignore_ascii_case(file))
        || starts.iter().any(|start| starts_with_ignoring_case(name, start))
        || is_device
        || numbered("com")
        || numbered("lpt")
}

/// A name for a folder on every system, as near to the one given as can be.
pub(super) fn folder_name(name: &str) -> String {
    let allowed = name.chars().map(|c| if is_forbidden(c) { ' ' } else { c });
    let spaced: String = allowed.collect();
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut name = words.join(" ");
    while name.len() > LONGEST {
        name.pop();
    }
    let name = name.trim_start_matches(['.', '-', ' ']).trim_end_matches(['.', ' ']);
    if name.is_empty() || is_taken(name) {
        format!("tool {name}").trim_end().into()
    } else {
        name.into()
    }
}

/// Whether it may be one folder's name, wherever it comes from.
pub(super) fn is_folder(name: &str) -> bool {
    !name.is_empty() && !name.starts_with('.') && !name.chars().any(is_forbidden)
}

/// A name in one line; quotes, slashes and blanks within it stay.
pub(super) fn in_one_line(name: &str) -> String {
    let shown = |c: char| if c.is_control() { ' ' } else { c };
    name.trim().chars().map(shown).collect::<String>().trim().into()
}

/// Tells tools of libraries that have the same name apart: `D6`, `D6 (2)`, …; and their folders, of all tools.
pub fn number_repeated(tools: &mut [Tool]) {
    let mut names: HashSet<String> = HashSet::new();
    for tool in tools.iter_mut() {
        if !names.insert(tool.name_key()) && tool.description.is_some() {
            let base = tool.name.clone();
            let free = |n: &u64| !names.contains(&format!("{base} ({n})").to_lowercase());
            let n = (2..).find(free).unwrap_or_default();
            let name = format!("{base} ({n})");
            names.insert(name.to_lowercase());
            tool.rename(&name);
        }
    }
    let mut folders: HashSet<String> = HashSet::new();
    for tool in tools {
        let base = folder_name(&tool.name);
        let free = |name: &String| !folders.contains(&name.to_lowercase());
        let numbered = (2u64..).map(|n| format!("{base} ({n})"));
        let folder = std::iter::once(base.clone()).chain(numbered).find(free).unwrap_or_default();
        folders.insert(folder.to_lowercase());
        tool.folder = folder;
    }
}

/// Tools of files that have one name get numbers; other names given twice are refused.
#[cfg(any(feature = "python", feature = "capi"))]
pub(crate) fn named_apart(mut tools: Vec<Tool>) -> Result<Vec<Tool>> {
    number_repeated(&mut tools);
    let mut keys = HashSet::new();
    match tools.iter().find(|tool| !keys.insert(tool.name_key())) {
        None => Ok(tools),
        Some(tool) => {
            let found = format!("`{}` twice", tool.name);
            let remedy = "leave one out, or give names by `name`";
            Err(Error::argument("tools", found, "a name for one tool only", remedy))
        }
    }
}
