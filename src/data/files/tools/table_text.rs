//! The text of a table of tools: rows with their lines, and errors that name these.

use super::place::shown;
use crate::{Error, Result};
use csv::{Position, ReaderBuilder, StringRecord, Trim};
use std::path::Path;

/// The text of a table, and where it is from.
pub(super) struct TableText<'a> {
    pub path: &'a Path,
    text: &'a str,
    pub separator: char,
}

impl<'a> TableText<'a> {
    pub fn new(path: &'a Path, text: &'a str) -> Self {
        TableText { path, text, separator: separator(text) }
    }

    /// The rows that are not empty, with their lines.
    pub fn rows(&self) -> Result<Vec<(usize, StringRecord)>> {
        let mut reader = ReaderBuilder::new()
            .delimiter(self.separator as u8)
            .comment(Some(b'#'))
            .has_headers(false)
            .flexible(true)
            .trim(Trim::All)
            .from_reader(self.text.as_bytes());
        let mut rows = Vec::new();
        for row in reader.records() {
            let row = row.map_err(|e| self.at(1, e.to_string(), "save the table as CSV"))?;
            let is_of_no_row = rows.is_empty() && row.get(0).is_some_and(is_separator_line);
            if !is_of_no_row && row.iter().any(|field| !field.is_empty()) {
                let line = row.position().map_or(1, |start| self.line_of_row(start));
                rows.push((line, row));
            }
        }
        Ok(rows)
    }

    /// Line of the row that the reader found from `start` on, comments and empty lines before it.
    fn line_of_row(&self, start: &Position) -> usize {
        let rest = self.text.get(start.byte() as usize..).unwrap_or("");
        start.line() as usize + rest.lines().take_while(|l| is_passed_over(l)).count()
    }

    /// Fails if there are more fields than headings.
    pub fn check_width(&self, line: usize, row: &StringRecord, n: usize) -> Result<()> {
        if row.iter().skip(n).any(|field| !field.is_empty()) {
            let found = format!("{} fields under {n} headings", row.len());
            let remedy = "write decimals with a point, or separate columns by semicolons";
            return Err(self.at(line, found, remedy));
        }
        Ok(())
    }

    /// A tool number: `7`, `T7`.
    pub fn number(&self, line: usize, field: &str, notices: &mut Vec<String>) -> Option<u32> {
        let digits = field.trim_start_matches(['T', 't']).trim_start();
        let number = digits.parse().ok();
        if number.is_none() && !field.is_empty() {
            let path = self.path.display();
            let found = format!("{path}: line {line}: T is {}, not a whole number", shown(field));
            notices.push(format!("{found}; the tool has no number"));
        }
        number
    }

    pub fn at(&self, line: usize, found: impl Into<String>, remedy: impl Into<String>) -> Error {
        Error::file(self.path, format!("line {line}"), found, remedy)
    }

    pub fn in_line(&self, line: usize, error: Error) -> Error {
        match error {
            Error::Argument { name, found, expected, remedy } => {
                self.at(line, format!("{name} is {found}, expected {expected}"), remedy)
            }
            other => other,
        }
    }
}

fn is_passed_over(line: &str) -> bool {
    line.trim().is_empty() || line.starts_with('#') || is_separator_line(line)
}

/// `sep=;`, a first line that says how columns are separated.
fn is_separator_line(line: &str) -> bool {
    let line = line.trim().trim_matches('"');
    line.len() <= 5 && line.get(..4).is_some_and(|sep| sep.eq_ignore_ascii_case("sep="))
}

fn separator(text: &str) -> char {
    let header = text.lines().find(|line| !is_passed_over(line)).unwrap_or("");
    let candidates = ['\t', ';', ','];
    candidates.into_iter().max_by_key(|c| header.matches(*c).count()).unwrap_or(',')
}
