//! Tool libraries: files that say which cutters a shop has. `docs/tools.md` says what becomes what.
//!
//! | file | recognised by |
//! |---|---|
//! | Fusion 360 export | JSON with `data` or `geometry` |
//! | FreeCAD tool bit, one tool | JSON with `parameter`; a folder stands for its `.fctb` files |
//! | LinuxCNC tool table | `.tbl`, or a first line that begins with `T` and a number |
//! | table of lengths | anything else: CSV |
//!
//! What a file does not say comes from [`Unsaid`], never assumed: an error names what is missing. What is no ball, bull-nose, flat or tapered end
//! mill is refused by name, and the rest is read.

mod described;
mod freecad;
mod fusion;
mod holder;
mod linuxcnc;
mod place;
mod table;

use super::ball_end_words;
use crate::cutter::{Assembly, Cutter, CutterParams, Step};
use crate::{Error, Result, input_file};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

pub use holder::{Holder, holder_from_bytes, read_holder};
pub use table::{steps_of_words, steps_words};

/// A checked cutter and the numbers it was ordered with.
#[derive(Debug, Clone, PartialEq)]
pub struct Tool {
    /// Name, fit for a folder.
    pub name: String,
    /// CR, CH, FR, FH; of a tool with more steps a summary: radius of the tip, height from `2·CR` above it to the holder, greatest radius
    /// and height of the holder.
    pub params: CutterParams,
    /// Radius of the tip's corner, mm: 0 for a flat end, CR for a ball end.
    pub corner_mm: f64,
    /// Safety margin all around, mm.
    pub clearance_mm: f64,
    /// The cutter, margin included.
    pub cutter: Cutter,
    /// Body, holder and stick-out, without the margin.
    pub assembly: Assembly,
    /// In words, where four lengths do not say it.
    pub description: Option<String>,
}

impl Tool {
    /// A tool named after its lengths; without a corner it is a ball end.
    ///
    /// # Errors
    /// As [`Cutter::bull_nose`]; or if the clearance leaves nothing of the cutter, or is 2·CR or more:
    /// a margin that thick lies on every site that the cutter touches.
    pub fn new(params: CutterParams, corner_mm: Option<f64>, clearance_mm: f64) -> Result<Self> {
        let corner_mm = corner_mm.unwrap_or(params.cr_mm);
        let cutter = Cutter::bull_nose(params, corner_mm)?;
        check_clearance(clearance_mm, params.cr_mm)?;
        let cutter = cutter.with_clearance(clearance_mm)?;
        let mut name = params.to_array().map(|length| length.to_string()).join("-");
        if corner_mm != params.cr_mm {
            name += &format!("-corner{corner_mm}");
        }
        if clearance_mm != 0.0 {
            name += &format!("-clearance{clearance_mm}");
        }
        let CutterParams { cr_mm, ch_mm, fr_mm, fh_mm } = params;
        let step = |height_mm, radius_mm| Step { height_mm, radius_mm };
        let assembly = Assembly::from_steps(
            [corner_mm, cr_mm - corner_mm],
            vec![step(2.0 * cr_mm, cr_mm)],
            vec![step(0.0, fr_mm), step(fh_mm, f64::INFINITY)],
            2.0 * cr_mm + ch_mm,
        )?;
        Ok(Tool { name, params, corner_mm, clearance_mm, cutter, assembly, description: None })
    }

    /// A tool of a library: its name is made fit for a folder.
    ///
    /// # Errors
    /// As [`Assembly::cutter`], or as [`Tool::new`] for the clearance.
    pub fn of_assembly(
        name: &str,
        assembly: Assembly,
        clearance_mm: f64,
        description: String,
    ) -> Result<Self> {
        let [corner_mm, side_mm] = assembly.tip();
        let cr_mm = corner_mm + side_mm;
        check_clearance(clearance_mm, cr_mm)?;
        let whole = assembly.cutter()?;
        let summary = || {
            let finite = assembly.holder().iter().filter(|step| step.radius_mm.is_finite());
            CutterParams {
                cr_mm,
                ch_mm: (assembly.stick_out_mm() - 2.0 * cr_mm).max(0.0),
                fr_mm: finite.map(|step| step.radius_mm).fold(cr_mm, f64::max),
                fh_mm: assembly.holder().last().map_or(0.0, |step| step.height_mm),
            }
        };
        let params = whole.as_ball_end().unwrap_or_else(summary);
        let cutter = whole.with_clearance(clearance_mm)?;
        let (name, description) = (folder_name(name), Some(description));
        Ok(Tool { name, params, corner_mm, clearance_mm, cutter, assembly, description })
    }

    /// Body, holder and stick-out with the margin.
    ///
    /// # Errors
    /// As [`Assembly::with_clearance`].
    pub fn held(&self) -> Result<Assembly> {
        self.assembly.with_clearance(self.clearance_mm)
    }

    /// The same tool, of which the overall length is stated.
    ///
    /// # Errors
    /// As [`Assembly::with_overall`].
    pub fn of_overall_length(self, overall_mm: f64) -> Result<Self> {
        let assembly = self.assembly.with_overall(overall_mm)?;
        Ok(Tool { assembly, ..self })
    }

    /// The same tool by another name.
    ///
    /// # Errors
    /// If some system would not let a folder have the name, or it is that of a file beside the folders.
    pub fn named(self, name: &str) -> Result<Self> {
        let refuse = |remedy: &str| {
            let found = place::shown(name);
            Err(Error::argument("name", found, "a name that a folder can have", remedy))
        };
        if name.contains(is_forbidden) {
            return refuse(r#"leave out / \ : * ? " < > | and control characters"#);
        }
        if name.is_empty() || name.starts_with(['.', '-', ' ']) || name.ends_with(['.', ' ']) {
            return refuse("begin it with a letter or a digit, end it without a dot");
        }
        if name.len() > 100 {
            return refuse("use at most 100 bytes");
        }
        if is_taken(name) {
            return refuse("part.stl, tools.… and others are files of the results: choose another");
        }
        Ok(Tool { name: name.into(), ..self })
    }

    /// The same for two tools that would have the same folder, on systems too that ignore case.
    pub fn folder_key(&self) -> String {
        self.name.to_lowercase()
    }

    /// The tool in words, without its name.
    pub fn words(&self) -> String {
        let mut words = self.description.clone().unwrap_or_else(|| self.lengths_in_words());
        if self.clearance_mm != 0.0 {
            words += &format!(", clearance {} mm", self.clearance_mm);
        }
        words
    }

    fn lengths_in_words(&self) -> String {
        let words = ball_end_words(self.params);
        if self.corner_mm == 0.0 {
            return words.replacen("ball-end", "flat-end", 1);
        }
        if self.corner_mm != self.params.cr_mm {
            return words.replacen("ball-end", &format!("bull-nose {} mm,", self.corner_mm), 1);
        }
        words
    }

    /// What the four lengths do not say, for [`Provenance::settings`](super::Provenance::settings).
    pub fn settings(&self) -> Value {
        let mut settings =
            json!({ "corner_mm": self.corner_mm, "clearance_mm": self.clearance_mm });
        if self.description.is_some() {
            settings["side_mm"] = json!(self.assembly.tip()[1]);
            settings["body"] = json!(steps_words(self.assembly.body()));
            settings["holder"] = json!(steps_words(self.assembly.holder()));
            settings["stick_out_mm"] = json!(self.assembly.stick_out_mm());
            settings["excess_mm"] = json!(self.assembly.excess_mm());
        }
        if let Some(overall) = self.assembly.overall_mm() {
            settings["overall_mm"] = json!(overall);
        }
        settings
    }
}

fn is_forbidden(c: char) -> bool {
    c.is_control() || r#"/\:*?"<>|"#.contains(c)
}

fn is_taken(name: &str) -> bool {
    let files = ["part.stl", "fixtures.stl", "report.html"];
    let starts = ["tools.", "findings.", "stick-out."];
    files.iter().any(|file| name.eq_ignore_ascii_case(file))
        || starts.iter().any(|start| starts_with_ignoring_case(name, start))
}

/// A name that [`Tool::named`] accepts, as near to the one given as can be.
fn folder_name(name: &str) -> String {
    let allowed = name.chars().map(|c| if is_forbidden(c) { ' ' } else { c });
    let spaced: String = allowed.collect();
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut name = words.join(" ");
    while name.len() > 80 {
        name.pop();
    }
    let name = name.trim_start_matches(['.', '-', ' ']).trim_end_matches(['.', ' ']);
    if name.is_empty() || is_taken(name) {
        format!("tool {name}").trim_end().into()
    } else {
        name.into()
    }
}

fn check_clearance(clearance_mm: f64, cr_mm: f64) -> Result<()> {
    if clearance_mm > -cr_mm && clearance_mm < 2.0 * cr_mm {
        return Ok(());
    }
    let expected = format!("between -CR = {} and 2 CR = {} mm", -cr_mm, 2.0 * cr_mm);
    let remedy = match clearance_mm < 0.0 {
        true => "nothing would be left of the cutter: take a thinner margin",
        false => "the margin would reach below the tip: widen the holder instead",
    };
    Err(Error::argument("clearance", clearance_mm, expected, remedy))
}

fn starts_with_ignoring_case(text: &str, start: &str) -> bool {
    text.get(..start.len()).is_some_and(|head| head.eq_ignore_ascii_case(start))
}

/// What tools are given where their file does not say it. An error names what is missing in both.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Unsaid {
    /// Height of the holder's nose above the tip, mm.
    pub stick_out_mm: Option<f64>,
    /// The holder.
    pub holder: Option<Holder>,
    /// Diameter of the shank, mm.
    pub shank_mm: Option<f64>,
    /// Length of the flutes, mm.
    pub flutes_mm: Option<f64>,
    /// Millimeters that the file's unit has.
    pub unit_mm: Option<f64>,
}

/// What a file of tools holds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ToolTable {
    /// The tools in the order of the file; no two have the same name.
    pub tools: Vec<Tool>,
    /// Headings of columns that mean nothing here.
    pub unused: Vec<String>,
    /// Tools that cannot be represented, one sentence each.
    pub refused: Vec<String>,
    /// What was changed to the safe side, one sentence each.
    pub notices: Vec<String>,
}

/// Reads a file of tools, or all `.fctb` files of a folder in the order of their names.
///
/// # Errors
/// If a file is not what its format demands, says what cannot be, or does not say what `unsaid` does not say either; if no tool is left; if
/// two rows of a table have the same name.
pub fn read(path: &Path, unsaid: &Unsaid) -> Result<ToolTable> {
    if !path.is_dir() {
        let bytes = input_file::read(path, input_file::LIBRARY)?;
        let table = from_bytes(&bytes, path, unsaid)?;
        return some_left(table, path);
    }
    let mut all = ToolTable::default();
    let files = tool_bits(path)?;
    if files.is_empty() {
        let remedy = "name a file, or a folder of FreeCAD tool bits";
        return Err(Error::file(path, "folder", "there is no .fctb file in it", remedy));
    }
    for file in files {
        let bytes = input_file::read(&file, input_file::LIBRARY)?;
        let table = from_bytes(&bytes, &file, unsaid)?;
        all.tools.extend(table.tools);
        all.refused.extend(table.refused);
        all.notices.extend(table.notices);
    }
    number_repeated(&mut all.tools);
    some_left(all, path)
}

fn some_left(table: ToolTable, path: &Path) -> Result<ToolTable> {
    match (table.tools.is_empty(), table.refused.first()) {
        (false, _) => Ok(table),
        (true, first) => {
            let first = first.map_or(String::new(), |first| format!(": {first}"));
            let found = format!("no tool can be used{first}");
            let remedy = "add a ball, bull-nose, flat or tapered end mill";
            Err(Error::file(path, "tools", found, remedy))
        }
    }
}

fn tool_bits(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::read(folder, e))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| Error::read(folder, e))?.path();
        if has_extension(&path, "fctb") && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Reads tools from the content of a file; `path` is for its extension and for messages.
///
/// # Errors
/// As [`read`].
pub fn from_bytes(bytes: &[u8], path: &Path, unsaid: &Unsaid) -> Result<ToolTable> {
    let text = place::utf8(bytes, path)?;
    let mut table = match first_char(text) {
        Some('{' | '[') => {
            let value = place::json(text, path)?;
            if value.get("parameter").is_some() {
                freecad::read(&value, path, unsaid)
            } else if fusion::is_library(&value) {
                fusion::read(&value, path, unsaid)
            } else {
                let found = "neither `data` (Fusion 360) nor `parameter` (FreeCAD) is there";
                let remedy = "name a tool library exported as JSON, or a tool bit";
                Err(Error::file(path, "top level", found, remedy))
            }
        }
        _ if has_extension(path, "fctb") || has_extension(path, "json") => {
            let remedy = "export the tools again";
            Err(Error::file(path, "line 1", "the file is not JSON", remedy))
        }
        _ if has_extension(path, "tbl") || linuxcnc::is_table(text) => {
            linuxcnc::read(text, path, unsaid)
        }
        _ => table::read(text, path),
    }?;
    number_repeated(&mut table.tools);
    Ok(table)
}

fn first_char(text: &str) -> Option<char> {
    text.trim_start().chars().next()
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

/// Tells tools of libraries that have the same name apart: `D6`, `D6 (2)`, …
pub fn number_repeated(tools: &mut [Tool]) {
    let mut seen: HashMap<String, usize> = HashMap::new();
    for tool in tools {
        let n = *seen.entry(tool.folder_key()).and_modify(|n| *n += 1).or_insert(1);
        if n == 1 || tool.description.is_none() {
            continue;
        }
        let base = tool.name.clone();
        for n in n.. {
            tool.name = format!("{base} ({n})");
            if !seen.contains_key(&tool.folder_key()) {
                break;
            }
        }
        seen.insert(tool.folder_key(), 1);
    }
}

/// The places of tools in the order in which a shop prefers them: by diameter of the lower end, the greatest first,
/// then by stick-out, the least first, then as given.
pub fn thick_and_short_first(tools: &[Tool]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..tools.len()).collect();
    let stick_out = |k: usize| tools[k].assembly.stick_out_mm();
    order.sort_by(|&a, &b| {
        let by_diameter = tools[b].params.cr_mm.total_cmp(&tools[a].params.cr_mm);
        by_diameter.then(stick_out(a).total_cmp(&stick_out(b))).then(a.cmp(&b))
    });
    order
}

#[cfg(test)]
mod tests;
