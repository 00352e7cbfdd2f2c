//! `deepmill parity`: compares this build with tensors recorded from the reference implementation.

use crate::output::Output;
use deepmill::parity::{self, GateRow};
use deepmill::{Error, Result, atomic_file};
use std::path::PathBuf;

/// Compare this build with tensors recorded from the reference implementation.
///
/// Rebuilds octree, features, stage outputs, logits, loss, gradients, three SGD steps and single
/// layers, in f32 and in f64, and holds each against its gate.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill parity tests/fixtures/parity --out actual.safetensors")]
pub struct Args {
    /// Folder with config.json, weights, input, expected and perhaps ops.safetensors.
    folder: PathBuf,
    /// Write this build's own tensors under the same names, whole.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    args.out.iter().try_for_each(|path| atomic_file::check_writable_file(path))?;
    let outcome = parity::run(&args.folder)?;
    if let Some(path) = &args.out {
        outcome.actual.write(path)?;
    }
    let width = outcome.rows.iter().map(|row| row.name.len()).max().unwrap_or(0);
    let heading = ["tensor", "error", "gate", "result", "kind"];
    output.say(line(width, heading.map(String::from)));
    outcome.rows.iter().for_each(|row| output.say(line(width, cells(row))));
    output.say("\nworst of each kind");
    outcome.worst().iter().for_each(|row| output.say(line(width, cells(row))));
    let missed: Vec<&GateRow> = outcome.rows.iter().filter(|row| !row.passed()).collect();
    output.say(format!("\n{} comparisons, {} gates missed", outcome.rows.len(), missed.len()));
    let mut result = serde_json::json!({
        "passed": outcome.passed(),
        "rows": outcome.rows.iter().map(json).collect::<Vec<_>>(),
        "worst": outcome.worst().into_iter().map(json).collect::<Vec<_>>(),
    });
    if let Some(path) = &args.out {
        output.files(std::slice::from_ref(path));
        result["files"] = serde_json::json!([path]);
    }
    output.result(&result);
    match missed.first() {
        None => Ok(()),
        Some(row) => Err(Error::file(
            &args.folder,
            format!("tensor {}", row.name),
            format!(
                "error {:e} exceeds its gate {:e} ({} missed)",
                row.error,
                row.gate,
                missed.len()
            ),
            "report it with the table above",
        )),
    }
}

fn cells(row: &GateRow) -> [String; 5] {
    let result = if row.passed() { "pass" } else { "FAIL" };
    let numbers =
        [row.error, row.gate].map(|x| if x == 0.0 { "0".into() } else { format!("{x:.1e}") });
    let [error, gate] = numbers;
    [row.name.clone(), error, gate, result.into(), row.group.clone()]
}

fn line(width: usize, [name, error, gate, result, kind]: [String; 5]) -> String {
    format!("{name:width$} {error:>8} {gate:>8} {result:6} {kind}")
}

fn json(row: &GateRow) -> serde_json::Value {
    let GateRow { name, group, error, gate } = row;
    serde_json::json!({
        "tensor": name, "kind": group, "error": error, "gate": gate, "passed": row.passed(),
    })
}
