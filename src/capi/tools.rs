//! Lists of tools.

use super::mesh::unit_of;
use super::status::{Answer, Failure, called, refused};
use crate::Result;
use crate::data::files::tools::{self, MissingParameters, Tool};
use crate::tool::cutter::CutterParams;
use std::path::Path;

/// Tools in order, and what was left out of their files.
#[derive(Clone, Default)]
pub struct ToolList {
    pub tools: Vec<Tool>,
    n_of_files: usize,
    /// A sentence each.
    pub notices: Vec<String>,
}

impl ToolList {
    /// Adds a tool of four lengths, a ball end unless a corner is given.
    pub fn add(&mut self, lengths: [f64; 4], corner: Option<f64>, clearance: f64) -> Answer<()> {
        let params = CutterParams::from_array(lengths);
        self.tools.push(Tool::new(params, corner, clearance)?);
        Ok(())
    }

    /// Adds a ball end in words: `CR,CH,FR,FH`.
    pub fn add_text(&mut self, lengths: &str) -> Answer<()> {
        let params: Result<CutterParams> = lengths.parse();
        let params = params.map_err(|error| called("lengths", error))?;
        self.tools.push(Tool::new(params, None, 0.0)?);
        Ok(())
    }

    /// Adds the tools that were read of a file.
    pub fn add_read(&mut self, read: ToolList) {
        let ToolList { tools, n_of_files, notices } = read;
        self.tools.extend(tools);
        self.n_of_files += n_of_files;
        self.notices.extend(notices);
    }

    /// The tools of a file or folder; a stick-out of 0 is not stated.
    pub fn read(path: &str, unit: Option<&str>, stick_out_mm: f64) -> Answer<Self> {
        let is_stated = stick_out_mm != 0.0;
        if is_stated && !(1e-4..=1e4).contains(&stick_out_mm) {
            let expected = "0, or 0.0001 mm to 10 m";
            return Err(refused("stick_out_mm", stick_out_mm, expected, "0 is not stated"));
        }
        let defaults = MissingParameters {
            stick_out_mm: is_stated.then_some(stick_out_mm),
            unit_mm: unit.map(|unit| unit_of(Some(unit))).transpose()?.map(|u| u.millimeters()),
            ..MissingParameters::default()
        };
        let table = tools::read(Path::new(path), &defaults)?;
        let unused = table.unused.iter().map(|column| format!("column not used: {column}"));
        let notices = unused.chain(table.refused).chain(table.notices).collect();
        Ok(ToolList { n_of_files: table.tools.len(), tools: table.tools, notices })
    }

    /// A tool of the list.
    pub fn tool(&self, tool: u32) -> Answer<&Tool> {
        self.tools.get(tool as usize).ok_or_else(|| no_tool(tool, self.tools.len()))
    }

    /// Replaces a tool of the list.
    pub fn replace(&mut self, tool: u32, by: impl FnOnce(Tool) -> Result<Tool>) -> Answer<()> {
        let replaced = by(self.tool(tool)?.clone())?;
        self.tools[tool as usize] = replaced;
        Ok(())
    }

    /// Whether files name all of them.
    pub fn are_of_files(&self) -> bool {
        self.n_of_files == self.tools.len()
    }

    /// Whether results go to a folder for each.
    pub fn have_folders(&self) -> bool {
        self.tools.len() > 1 || self.n_of_files > 0
    }
}

/// A number that is not one of `n` tools.
pub fn no_tool(tool: u32, n: usize) -> Failure {
    refused("tool", tool, format!("less than {n}, the number of tools"), "count tools from 0")
}
