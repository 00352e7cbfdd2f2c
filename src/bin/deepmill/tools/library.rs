//! A library by itself: written as it was understood, and drawn.

use crate::out_folder::check_out_of;
use crate::output::Output;
use clap::ValueEnum;
use deepmill::data::files::tools::{Tool, to_csv, to_json};
use deepmill::report::tool_drawing;
use deepmill::tables::{Cell, Table};
use deepmill::{Result, atomic_file};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// What is written of a library without a part.
#[derive(clap::Args)]
pub struct LibraryArgs {
    /// Write the tools as they were understood, in mm: DIR/library.csv or DIR/library.json, which are read again with
    /// --library.
    #[arg(long, value_name = "FORMAT")]
    export: Option<Format>,
    /// Draw every tool in section, with its dimensions in its own unit: DIR/pictures, an SVG per tool.
    #[arg(long)]
    show: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Csv,
    Json,
}

impl LibraryArgs {
    /// The files that were asked for.
    pub fn write(&self, tools: &[Tool], folder: &Path, output: &Output) -> Result<Vec<PathBuf>> {
        let mut written = Vec::new();
        if self.export.is_none() && !self.show {
            return Ok(written);
        }
        check_out_of(folder, &["library.csv", "library.json"])?;
        if let Some(format) = self.export {
            let (name, bytes) = match format {
                Format::Csv => ("library.csv", to_csv(tools)),
                Format::Json => ("library.json", to_json(tools)?),
            };
            let path = folder.join(name);
            atomic_file::write_atomic(&path, |file| file.write_all(&bytes))?;
            written.push(path);
        }
        if self.show {
            for tool in tools {
                let path = folder.join("pictures").join(format!("{}.svg", tool.folder()));
                let svg = tool_drawing::draw(tool);
                atomic_file::write_atomic(&path, |file| file.write_all(svg.as_bytes()))?;
                written.push(path);
            }
            output.say(format!(
                "{} drawings in {}",
                tools.len(),
                folder.join("pictures").display()
            ));
        }
        Ok(written)
    }
}

/// The tools in words, for people and as the result.
pub fn say(tools: &[Tool], written: &[PathBuf], output: &Output) {
    let mut table = Table::new(&[("T", "T"), ("name", "tool"), ("words", "understood as")]);
    for tool in tools {
        let number = tool.number.map_or(Cell::Missing, |number| Cell::count(number as usize));
        table.row([number, Cell::text(&tool.name), Cell::text(tool.words())]);
    }
    output.say(table.text());
    let is_picture = |path: &&PathBuf| path.extension().is_some_and(|e| e == "svg");
    let tables: Vec<PathBuf> = written.iter().filter(|path| !is_picture(path)).cloned().collect();
    output.files(&tables);
    let result: Value = json!({ "n_tools": tools.len(), "tools": table.json() });
    output.result_with_files(result, written);
}
