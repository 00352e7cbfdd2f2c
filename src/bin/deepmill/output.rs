//! Output of a command: text for people, or one JSON object for programs.

use crate::args;
use deepmill::analysis::Files;
use deepmill::answers::SiteAnswers;
use deepmill::findings::gate::{Limit, SiteAreas};
use deepmill::findings::{Findings, for_all_tools};
use deepmill::geom::units::Unit;
use deepmill::geom::{Mesh, Sites};
use deepmill::{Error, Result};
use serde_json::{Value, json};
use std::collections::HashSet;
use std::fmt::Display;
use std::io::{ErrorKind, Write, stderr, stdout};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// The program's standard streams. A reader that goes away is no failure; a disk that is full is one, told at the end.
pub struct Output {
    json: bool,
    /// Of lengths and areas in text, tables and pages.
    unit: Unit,
    /// Whether another process prints results.
    silent: bool,
    /// The result of one part of several, which is not printed by itself.
    collected: Option<Mutex<Value>>,
    /// Whether the result is printed.
    done: AtomicBool,
    /// Warnings that were given: each is given once.
    warned: Mutex<HashSet<String>>,
    /// Limits that the result breaks.
    broken: Mutex<Vec<String>>,
    /// Why standard output was not written.
    lost: Mutex<Option<std::io::Error>>,
}

impl Output {
    pub fn new(json: bool, unit: Unit) -> Self {
        Output {
            json,
            unit,
            silent: false,
            collected: None,
            done: AtomicBool::new(false),
            warned: Mutex::default(),
            broken: Mutex::default(),
            lost: Mutex::default(),
        }
    }

    /// That of one of several processes: only the first prints results.
    pub fn of_process(&self, rank: usize) -> Self {
        Output { silent: rank != 0, ..Output::new(self.json, self.unit) }
    }

    /// That of a repetition: warnings alone, each once.
    pub fn of_repetition(&self) -> Self {
        Output { silent: true, ..Output::new(self.json, self.unit) }
    }

    /// That of one part of several: its result is kept.
    pub fn of_part(&self) -> Self {
        Output { collected: Some(Mutex::default()), ..Output::new(self.json, self.unit) }
    }

    /// The result that was kept.
    pub fn collected(&self) -> Value {
        let kept = self
            .collected
            .as_ref()
            .map(|kept| std::mem::take(&mut *kept.lock().unwrap_or_else(PoisonError::into_inner)));
        kept.filter(Value::is_object).unwrap_or_else(|| json!({}))
    }

    /// Adds the limits that a part of several breaks.
    pub fn take_limits(&self, of_part: &Output, part: &str) {
        let broken = of_part.broken.lock().unwrap_or_else(PoisonError::into_inner);
        broken.iter().for_each(|why| self.break_limit(format!("{part}: {why}")));
    }

    /// Of lengths and areas in text, tables and pages.
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// A line for people: standard output, or standard error when that carries JSON.
    pub fn say(&self, line: impl Display) {
        match self.json {
            _ if self.silent => {}
            true => tell(line),
            false => self.print(line),
        }
    }

    fn print(&self, line: impl Display) {
        match writeln!(stdout(), "{line}") {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                *self.lost.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            }
            _ => {}
        }
    }

    /// Why standard output lacks something.
    pub fn lost(&self) -> Option<Error> {
        let lost = self.lost.lock().unwrap_or_else(PoisonError::into_inner).take();
        lost.map(|error| Error::write("standard output", error))
    }

    /// A warning, on standard error; the same one again is not repeated.
    pub fn warn(&self, line: impl Display) {
        let line = line.to_string();
        let mut warned = self.warned.lock().unwrap_or_else(PoisonError::into_inner);
        if warned.insert(line.clone()) {
            tell(format_args!("warning: {line}"));
        }
    }

    /// The failure that ends the program, on standard error, and under `--json` as the result. That of another process
    /// is its own to print.
    pub fn error(&self, error: &Error) {
        if matches!(error, Error::OtherProcess { .. }) {
            return;
        }
        tell(format_args!("error: {error}"));
        self.result(&json!({ "error": error.to_string() }));
    }

    /// A line on standard error that is neither warning nor error.
    pub fn note(&self, line: impl Display) {
        tell(line);
    }

    /// As [`Output::error`], of arguments that cannot be read.
    pub fn error_of_arguments(&self, words: &str) {
        tell(format_args!("error: {words}"));
        self.result(&json!({ "error": words }));
    }

    /// The machine-readable result; printed only under `--json`, and only the first of a run: a
    /// failure after it is told by the exit code.
    pub fn result(&self, value: &Value) {
        if let Some(kept) = &self.collected {
            *kept.lock().unwrap_or_else(PoisonError::into_inner) = value.clone();
            return;
        }
        if self.json && !self.silent && !self.done.swap(true, Ordering::Relaxed) {
            self.print(value);
        }
    }

    /// Holds answers against limits; what they break is told at the end of the program. As JSON for the result.
    /// `held` are findings that were held against a baseline, with the name of their tool: limits on findings are then
    /// about these.
    pub fn check_limits<'a>(
        &self,
        limits: &[Limit],
        part: (&Sites, Option<&Mesh>),
        answers: impl Iterator<Item = (&'a str, &'a SiteAnswers)>,
        held: Option<(&str, &Findings)>,
    ) -> Result<Value> {
        if limits.is_empty() {
            return Ok(Value::Null);
        }
        let found = limits_broken(limits, part, answers, held)?;
        let mut broken = self.broken.lock().unwrap_or_else(PoisonError::into_inner);
        broken.extend(found);
        Ok(json!(*broken))
    }

    /// A limit is broken.
    pub fn break_limit(&self, why: String) {
        self.broken.lock().unwrap_or_else(PoisonError::into_inner).push(why);
    }

    /// Whether a result broke a limit; the last lines on standard error then say which.
    pub fn tell_broken_limits(&self) -> bool {
        let broken = self.broken.lock().unwrap_or_else(PoisonError::into_inner);
        for why in &*broken {
            tell(format_args!("limit broken: {why}"));
        }
        !broken.is_empty()
    }

    /// Which files an outcome gets: `also` names further forms, tables are in the unit of the text.
    pub fn forms(&self, pictures: bool, report: bool, also: &[String]) -> Result<Files> {
        let mut files = Files::shown(report);
        files.pictures = pictures;
        files.also = also.iter().map(|name| name.parse()).collect::<Result<_>>()?;
        files.unit = self.unit;
        Ok(files)
    }

    /// Names the files written.
    pub fn files(&self, paths: &[PathBuf]) {
        paths.iter().for_each(|path| self.say(format!("written {}", path.display())));
    }

    /// [`Output::result`] with the files written.
    pub fn result_with_files(&self, mut value: Value, paths: &[PathBuf]) {
        value["unit"] = json!("mm");
        value["files"] = json!(paths);
        self.result(&value);
    }
}

/// The limits that answers break; as [`Output::check_limits`].
pub fn limits_broken<'a>(
    limits: &[Limit],
    (sites, mesh): (&Sites, Option<&Mesh>),
    answers: impl Iterator<Item = (&'a str, &'a SiteAnswers)>,
    held: Option<(&str, &Findings)>,
) -> Result<Vec<String>> {
    if limits.is_empty() {
        return Ok(Vec::new());
    }
    let (about_findings, others): (Vec<&Limit>, Vec<&Limit>) =
        limits.iter().partition(|limit| limit.is_about_findings());
    let (of_all, others): (Vec<&Limit>, Vec<&Limit>) =
        others.into_iter().partition(|limit| limit.is_about_all_tools());
    let areas = SiteAreas::of(sites, mesh)?;
    let answers: Vec<(&str, &SiteAnswers)> = answers.collect();
    let mut broken = Vec::new();
    if !of_all.is_empty() && !answers.is_empty() {
        let all = for_all_tools(answers.iter().map(|(_, answers)| *answers));
        for limit in of_all {
            broken.extend(limit.broken_by(&all, &areas).map_err(args::limit)?);
        }
    }
    if let Some((tool, findings)) = held {
        let why = about_findings.iter().filter_map(|l| l.broken_by_findings(findings));
        broken.extend(why.map(|why| format!("{tool}: {why}")));
    }
    for (tool, answers) in answers {
        for limit in &others {
            if let Some(why) = limit.broken_by(answers, &areas).map_err(args::limit)? {
                broken.push(format!("{tool}: {why}"));
            }
        }
        if !about_findings.is_empty() && held.is_none() {
            let findings = Findings::of(sites, mesh, answers, &[])?;
            let why = about_findings.iter().filter_map(|l| l.broken_by_findings(&findings));
            broken.extend(why.map(|why| format!("{tool}: {why}")));
        }
    }
    Ok(broken)
}

/// A line on standard error, in one piece: other processes write there too.
fn tell(line: impl Display) {
    let _ = stderr().write_all(format!("{line}\n").as_bytes());
}
