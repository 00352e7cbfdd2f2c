//! Several parts in one call, a folder each.

use super::{Args, run_one};
use crate::args::{OutArgs, name_of};
use crate::output::Output;
use deepmill::{Error, Result};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::path::PathBuf;

/// Labels one part after the other. What is wrong with one is a warning, and an error at the end.
pub fn run(args: &Args, parts: &[PathBuf], output: &Output) -> Result<()> {
    // What is wrong with the arguments is wrong for every part.
    args.surface.tolerances.with_allowance(args.tools.tools(output)?)?;
    args.surface.tolerances.options()?;
    args.gate.limits(&[])?;
    args.directions.given()?;
    args.sites.spread()?;
    args.per_direction()?;
    args.baseline
        .refuse("several parts", "a baseline is of one part: label it in a call of its own")?;
    output.forms(!args.no_picture, args.report, &args.also)?;
    args.out.check()?;
    let folders = folders(parts)?;
    let (mut results, mut failed): (Vec<Value>, Vec<String>) = Default::default();
    for (part, folder) in parts.iter().zip(folders) {
        let name = name_of(part);
        output.say(format!("{name}:"));
        let out = OutArgs::of(args.out.folder().join(&folder));
        let one = Args { part: part.clone(), out, ..args.clone() };
        let of_part = output.of_part();
        let done = run_one(&one, &of_part);
        output.take_limits(&of_part, &name);
        if let Some(error) = of_part.lost() {
            return Err(error);
        }
        let mut result = of_part.collected();
        if let Err(error) = done {
            output.warn(format!("{name} is not labeled: {error}"));
            result = json!({ "error": error.to_string() });
            failed.push(name.clone());
        }
        result["part"] = json!(name);
        result["folder"] = json!(folder);
        results.push(result);
    }
    output.result(&json!({ "parts": results, "n_failed": failed.len() }));
    if failed.is_empty() {
        output.say(format!("{} parts labeled", parts.len()));
        return Ok(());
    }
    let found =
        format!("{} of {} are not labeled: {}", failed.len(), parts.len(), failed.join(", "));
    Err(Error::geometry("parts", found, "the warnings have the reasons; the others are labeled"))
}

/// The folder of every part: the name of its file without the ending.
fn folders(parts: &[PathBuf]) -> Result<Vec<String>> {
    let mut taken: HashMap<String, &PathBuf> = HashMap::new();
    let mut folders = Vec::new();
    for part in parts {
        let stem = part.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let folder = stem.unwrap_or_else(|| "part".into());
        if let Some(other) = taken.insert(folder.to_lowercase(), part) {
            let found = format!("{} and {}", other.display(), part.display());
            let expected = "files of different names, each of which is a folder of the results";
            return Err(Error::argument(
                "PART",
                found,
                expected,
                "rename one, or label it by itself",
            ));
        }
        folders.push(folder);
    }
    Ok(folders)
}
