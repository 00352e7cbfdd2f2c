//! Baselines as TOML.

use super::cells::{N_FACINGS, Run};
use super::{Baseline, KnownFinding, ScatteredCells, is_date};
use crate::answers::SiteAnswer;
use crate::findings::Bounds;
use crate::storage::{atomic_file, input_file};
use crate::{Error, Result};
use glam::DVec3;
use serde::Deserialize;
use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;
use toml::{Spanned, Table, Value};

/// The version that is written.
const VERSION: i64 = 1;
/// No length of a part is greater, mm.
const MOST_MM: f64 = 1e9;
/// No number of a cell is greater.
const MOST_CELLS: i64 = 1_000_000;
/// Runs of cells on a line.
const RUNS_A_LINE: usize = 6;
const REMEDY: &str = "compare with a baseline that deepmill writes";

const HEAD: &str = "\
# Findings that are known. A reason is for you to fill in; writing the baseline again keeps reasons and dates.
# An entry that is taken out is a new finding of the next run.
";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "version")]
    _version: i64,
    part: String,
    unit: Spanned<String>,
    #[serde(rename = "box")]
    bounds: Spanned<[[f64; 3]; 2]>,
    site_mm2: Spanned<f64>,
    cell_mm: Option<Spanned<f64>>,
    #[serde(default)]
    finding: Vec<Entry>,
    #[serde(default)]
    scattered: Vec<ScatteredEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScatteredEntry {
    tool: String,
    cells: Vec<Spanned<[i64; 5]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    id: Spanned<String>,
    tool: String,
    cause: Spanned<String>,
    area_mm2: Spanned<f64>,
    at: Spanned<[f64; 3]>,
    #[serde(rename = "box")]
    bounds: Spanned<[[f64; 3]; 2]>,
    #[serde(default)]
    reason: String,
    date: Option<Spanned<String>>,
    normal: Option<Spanned<[f64; 3]>>,
    #[serde(default)]
    cells: Vec<Spanned<[i64; 5]>>,
}

impl Baseline {
    /// Reads a baseline.
    ///
    /// # Errors
    /// If the file cannot be read, is no TOML, is of another version, or holds a key or a value that baselines do not
    /// have; the message names the line.
    pub fn read(path: &Path) -> Result<Self> {
        let text = input_file::read_text(path, input_file::BASELINE)?;
        Text { path, text: &text }.baseline()
    }

    /// Writes the baseline; [`Baseline::read`] reads the same.
    ///
    /// # Errors
    /// If the system refuses the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = self.text();
        atomic_file::write_atomic(path, |file| file.write_all(text.as_bytes()))
    }

    fn text(&self) -> String {
        let mut out = HEAD.to_string();
        let _ = write!(
            out,
            "version = {VERSION}\npart = {}\nunit = \"mm\"\nbox = {}\nsite_mm2 = {}\n",
            quoted(&self.part),
            corners(self.bounds),
            number(self.site_mm2)
        );
        if let Some(cell_mm) = self.cell_mm {
            let _ = writeln!(out, "cell_mm = {}", number(cell_mm));
        }
        for known in &self.known {
            let _ = write!(
                out,
                "\n[[finding]]\nid = {}\ntool = {}\ncause = {}\narea_mm2 = {}\nat = {}\nbox = {}\nreason = {}\n",
                quoted(&known.id),
                quoted(&known.tool),
                quoted(cause_name(known.cause)),
                number(known.area_mm2),
                vector(known.at_mm),
                corners(known.bounds),
                quoted(&known.reason),
            );
            if !known.date.is_empty() {
                let _ = writeln!(out, "date = {}", quoted(&known.date));
            }
            if known.normal != DVec3::ZERO {
                let _ = writeln!(out, "normal = {}", vector(known.normal));
            }
            if !known.cells.is_empty() {
                let _ = writeln!(out, "cells = [\n{}]", rows(&known.cells));
            }
        }
        for ScatteredCells { tool, cells } in &self.scattered {
            let (tool, rows) = (quoted(tool), rows(cells));
            let _ = write!(out, "\n[[scattered]]\ntool = {tool}\ncells = [\n{rows}]\n");
        }
        out
    }
}

fn quoted(text: &str) -> String {
    // On one line, whatever is in it.
    match text.contains(['\n', '\r']) {
        true => serde_json::Value::String(text.to_owned()).to_string(),
        false => Value::String(text.to_owned()).to_string(),
    }
}

/// With a point: TOML has another type for whole numbers, which readers of other languages may keep apart.
fn number(x: f64) -> String {
    Value::Float(x).to_string()
}

fn vector(v: DVec3) -> String {
    format!("[{}]", v.to_array().map(number).join(", "))
}

fn corners(bounds: Bounds) -> String {
    format!("[{}]", bounds.map(vector).join(", "))
}

/// Runs of cells, several a line.
fn rows(cells: &[Run]) -> String {
    let words = |run: &Run| {
        let [facing, z, y, from, to] = run;
        format!("[{facing}, {z}, {y}, {from}, {to}],")
    };
    let line = |runs: &[Run]| format!("  {}\n", runs.iter().map(words).collect::<String>());
    cells.chunks(RUNS_A_LINE).map(line).collect()
}

/// As `findings.json` has it.
fn cause_name(cause: SiteAnswer) -> &'static str {
    match cause {
        SiteAnswer::TipDoesNotFit => "tip-does-not-fit",
        _ => "inaccessible",
    }
}

/// The text of a file.
struct Text<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Text<'_> {
    fn baseline(&self) -> Result<Baseline> {
        let table: Table = toml::from_str(self.text).map_err(|e| self.of_toml(&e))?;
        match table.get("version") {
            Some(Value::Integer(VERSION)) => {}
            found => {
                let found = found.map_or("it is missing".into(), |found| format!("it is {found}"));
                let found = format!("{found}, not {VERSION}");
                let remedy = "write the baseline anew with this version of deepmill";
                return Err(Error::file(self.path, "version", found, remedy));
            }
        }
        let file: File = toml::from_str(self.text).map_err(|e| self.of_toml(&e))?;
        if file.unit.get_ref() != "mm" {
            let found = format!("unit is `{}`", file.unit.get_ref());
            return Err(self.bad(&file.unit, found, "lengths of a baseline are in mm"));
        }
        let cell_mm = file.cell_mm.as_ref().map(|mm| self.length("cell_mm", mm)).transpose()?;
        let mut lines: HashMap<String, usize> = HashMap::new();
        let mut known = Vec::with_capacity(file.finding.len());
        for entry in file.finding {
            let (id, line) = (entry.id.get_ref().trim().to_owned(), self.line(&entry.id));
            if id.is_empty() {
                return Err(self.bad(&entry.id, "id is empty".into(), "give the finding a name"));
            }
            if let Some(first) = lines.insert(id.clone(), line) {
                let found = format!("id `{id}` is that of line {first} too");
                return Err(self.bad(&entry.id, found, "give each finding a name of its own"));
            }
            known.push(self.known(id, &entry, cell_mm)?);
        }
        let scattered = file.scattered.into_iter().map(|of| {
            let cells = of.cells.iter().map(|run| self.run(run, cell_mm)).collect::<Result<_>>()?;
            Ok(ScatteredCells { tool: of.tool, cells })
        });
        Ok(Baseline {
            scattered: scattered.collect::<Result<_>>()?,
            part: file.part,
            bounds: self.bounds("box", &file.bounds)?,
            site_mm2: self.not_negative("site_mm2", &file.site_mm2)?,
            cell_mm,
            known,
        })
    }

    fn known(&self, id: String, entry: &Entry, cell_mm: Option<f64>) -> Result<KnownFinding> {
        let cause = match &**entry.cause.get_ref() {
            "inaccessible" => SiteAnswer::Inaccessible,
            "tip-does-not-fit" => SiteAnswer::TipDoesNotFit,
            other => {
                let found = format!("cause is `{other}`");
                let remedy = "it is inaccessible or tip-does-not-fit";
                return Err(self.bad(&entry.cause, found, remedy));
            }
        };
        let date = entry.date.as_ref().filter(|date| !date.get_ref().is_empty());
        if let Some(date) = date.filter(|date| !is_date(date.get_ref())) {
            let found = format!("date is `{}`", date.get_ref());
            return Err(self.bad(date, found, "write year-month-day, for example \"2026-01-31\""));
        }
        let vector = |key: &str, v: &Spanned<[f64; 3]>| self.vector(key, v);
        let normal = entry.normal.as_ref().map(|normal| vector("normal", normal)).transpose()?;
        let cells = entry.cells.iter().map(|run| self.run(run, cell_mm));
        Ok(KnownFinding {
            id,
            tool: entry.tool.clone(),
            cause,
            area_mm2: self.not_negative("area_mm2", &entry.area_mm2)?,
            at_mm: vector("at", &entry.at)?,
            bounds: self.bounds("box", &entry.bounds)?,
            reason: entry.reason.clone(),
            date: date.map(|date| date.get_ref().clone()).unwrap_or_default(),
            normal: normal.unwrap_or_default(),
            cells: cells.collect::<Result<_>>()?,
        })
    }

    fn not_negative(&self, key: &str, x: &Spanned<f64>) -> Result<f64> {
        match *x.get_ref() {
            value if (0.0..f64::INFINITY).contains(&value) => Ok(value),
            value => Err(self.bad(x, format!("{key} is {value}"), "it is 0 or more")),
        }
    }

    fn length(&self, key: &str, x: &Spanned<f64>) -> Result<f64> {
        match *x.get_ref() {
            value if value > 0.0 && value <= MOST_MM => Ok(value),
            value => Err(self.bad(x, format!("{key} is {value}"), "it is more than 0")),
        }
    }

    fn run(&self, run: &Spanned<[i64; 5]>, cell_mm: Option<f64>) -> Result<Run> {
        if cell_mm.is_none() {
            let found = "cells are given without cell_mm".into();
            return Err(self.bad(run, found, "give cell_mm, or leave the cells out"));
        }
        let numbers @ [facing, _, _, from, to] = *run.get_ref();
        let most = numbers.into_iter().find(|n| !(-MOST_CELLS..=MOST_CELLS).contains(n));
        let found = match most {
            Some(n) => format!("cells has {n}"),
            None if !(0..N_FACINGS as i64).contains(&facing) => {
                format!("cells has the facing {facing}")
            }
            None if from > to => format!("cells has a run from {from} to {to}"),
            None => return Ok(numbers.map(|n| n as i32)),
        };
        let remedy = "a run is [facing from 0 to 5, z, y, first x, last x]";
        Err(self.bad(run, found, remedy))
    }

    fn vector(&self, key: &str, v: &Spanned<[f64; 3]>) -> Result<DVec3> {
        self.lengths(key, v.get_ref(), v)
    }

    fn lengths<T>(&self, key: &str, v: &[f64; 3], of: &Spanned<T>) -> Result<DVec3> {
        match v.iter().find(|x| !(-MOST_MM..=MOST_MM).contains(*x)) {
            Some(x) => Err(self.bad(of, format!("{key} has {x}"), "it has numbers in mm")),
            None => Ok(DVec3::from_array(*v)),
        }
    }

    fn bounds(&self, key: &str, corners: &Spanned<[[f64; 3]; 2]>) -> Result<Bounds> {
        let [low, high] = corners.get_ref();
        let bounds = [self.lengths(key, low, corners)?, self.lengths(key, high, corners)?];
        if bounds[0].cmpgt(bounds[1]).any() {
            let found = format!("{key} has a first corner above its second");
            return Err(self.bad(corners, found, "give the least corner, then the greatest"));
        }
        Ok(bounds)
    }

    fn line<T>(&self, at: &Spanned<T>) -> usize {
        self.line_of(at.span().start)
    }

    fn line_of(&self, byte: usize) -> usize {
        input_file::line_of(self.text.as_bytes(), byte)
    }

    fn bad<T>(&self, at: &Spanned<T>, found: String, remedy: &str) -> Error {
        Error::file(self.path, format!("line {}", self.line(at)), found, remedy)
    }

    fn of_toml(&self, error: &toml::de::Error) -> Error {
        let line = error.span().map(|span| format!("line {}", self.line_of(span.start)));
        let found = error.message().trim().replace('\n', ", ");
        Error::file(self.path, line.unwrap_or_else(|| "text".into()), found, REMEDY)
    }
}
