//! LinuxCNC tool tables: number, diameter and a remark for each tool.
//!
//! Such a table does not say what a tool looks like. Its remark may: `ball`, `flat` or `bull` with `r` and the corner's
//! radius; `V-bit` with its angle (`60°`, `60 deg`), and other cones alike. Tables of versions up to 2.3 have columns
//! in place of words with letters: [`pockets`].

mod pockets;

use super::described::{Described, Form};
use super::place::{Place, shown};
use super::reading::Reading;
use super::words::{Remark, remark};
use super::{MissingParameters, Tool};
use crate::geom::units::length::{converted, decimal};
use crate::{Error, Result};
use std::path::Path;

/// Whether the first line that is not a remark begins with `T` and a number, or names the columns of an old table.
pub(super) fn is_table(text: &str) -> bool {
    let first = first_line(text);
    let mut chars = first.chars();
    let is_letter = matches!(chars.next(), Some('T' | 't'));
    is_letter && chars.next().is_some_and(|c| c.is_ascii_digit()) || pockets::is_header(first)
}

/// That is not empty and no remark.
fn first_line(text: &str) -> &str {
    let mut lines = text.lines().map(str::trim);
    lines.find(|line| !line.is_empty() && !line.starts_with(';')).unwrap_or("")
}

pub(super) fn read(text: &str, path: &Path, defaults: &MissingParameters) -> Reading {
    let first = first_line(text);
    let is_old = |line: &str| pockets::is_header(line) || pockets::is_row(line);
    if is_old(first) || text.lines().any(pockets::is_header) {
        return read_old(text, path, defaults);
    }
    let mut reading = Reading::default();
    for (line, row) in (1..).zip(text.lines()) {
        let (words, remark) = row.split_once(';').unwrap_or((row, ""));
        let (words, remark) = (words.trim(), remark.trim());
        if words.is_empty() {
            continue;
        }
        match row_of(words, line, path) {
            Ok(row) => add(&row, remark, (line, path), defaults, &mut reading),
            Err(why) => reading.add(Err(why)),
        }
    }
    reading
}

/// A table of version 2.3 or older.
fn read_old(text: &str, path: &Path, defaults: &MissingParameters) -> Reading {
    let (mut reading, mut above) = (Reading::default(), pockets::Above::default());
    for (line, row) in (1..).zip(text.lines()) {
        let row = row.trim();
        if row.is_empty() || row.starts_with([';', '#']) {
            continue;
        }
        match above.line(row, line, path) {
            Ok(pockets::Line::Above) => {}
            Ok(pockets::Line::Row(row, remark)) => {
                add(&row, remark, (line, path), defaults, &mut reading);
            }
            // What the columns mean is not known.
            Err(why) if pockets::is_header(row) => {
                reading = Reading::default();
                reading.add(Err(why));
                return reading;
            }
            Err(why) => reading.add(Err(why)),
        }
    }
    reading
}

fn add(
    row: &Row,
    text: &str,
    (line, path): (usize, &Path),
    defaults: &MissingParameters,
    reading: &mut Reading,
) {
    let name = format!("T{} {text}", row.number);
    let name = name.trim();
    let label = format!("line {line}, tool {}", shown(name));
    let place = Place { path, name: &label };
    if row.is_lathe {
        let found = "it has a front angle, a back angle or an orientation: a turning tool";
        return reading.leave_out_kind(place.error(found, "it is left out"));
    }
    let Some(unit) = defaults.unit_mm else {
        let found = "the file does not say the unit";
        let remedy =
            "give that of the machine with `unit_mm` in a program, or --tool-unit mm or in";
        return reading.add(Err(place.error(found, remedy)));
    };
    let form = form_of(remark(text, unit), text);
    let (form, diameter) = match form.and_then(|form| Ok((form, row.diameter.ok_or(NO_DIAMETER)?)))
    {
        Ok(found) => found,
        Err(why) => return reading.leave_out_kind(place.error(why, "it is left out")),
    };
    let plain = match form {
        _ if remark(text, unit) == Remark::EndMill => Some(place.sentence(PLAIN)),
        Form::Family(_) => Some(place.sentence(POINTED)),
        _ => None,
    };
    let tool = || -> Result<(Tool, Vec<String>)> {
        let diameter = converted(place.not_negative("D", diameter)?, unit);
        let number = u32::try_from(row.number).ok();
        let tool = Described { number, unit_mm: unit, ..Described::new(name, form, diameter) };
        let (tool, mut notices) = tool.tool(defaults, &place)?;
        notices.extend(plain);
        let other = row.other_number.filter(|other| *other != row.number);
        notices.extend(other.map(|other| {
            place.sentence(format!("its pocket {} counts as T, not FMS {other}", row.number))
        }));
        Ok((tool, notices))
    };
    reading.add(tool());
}

const NO_DIAMETER: &str = "without a diameter";
const POINTED: &str = "the remark does not say how wide its tip is: it counts as a point";
const PLAIN: &str = "the remark says an end mill and no more: it counts as a flat end";

/// The form that a remark names, or why there is none.
fn form_of(remark: Remark, text: &str) -> std::result::Result<Form, String> {
    let text = shown(text);
    match remark {
        Remark::Form(form) => Ok(form),
        Remark::EndMill => Ok(Form::Flat),
        Remark::Other(other) => Err(format!(
            "the remark {text} names a {other}, only ball, bull-nose and flat end mills, and cones \
             and drills with their angle (drill 118 deg), can be read from a tool table"
        )),
        Remark::Bull => Err(format!("the remark {text} names a bull nose without its corner (r1)")),
        Remark::Nothing => Err(format!(
            "the remark {text} does not say the form: ball, flat, or bull and its corner (r1)"
        )),
    }
}

#[derive(Debug, Default)]
struct Row {
    number: u64,
    /// Of an old table, its FMS.
    other_number: Option<u64>,
    diameter: Option<f64>,
    /// Whether angles or orientation are those of a turning tool.
    is_lathe: bool,
}

fn row_of(words: &str, line: usize, path: &Path) -> Result<Row> {
    let bad = |found: String| {
        let remedy = "write for example T1 P1 D6.0 Z+52.3 ;6 mm ball end";
        Error::file(path, format!("line {line}"), found, remedy)
    };
    let (mut number, mut diameter, mut is_lathe) = (None, None, false);
    for word in words.split_whitespace().flat_map(glued) {
        let mut chars = word.chars();
        let letter = chars.next().map(|c| c.to_ascii_uppercase());
        let value = decimal(chars.as_str());
        let is_known = letter.is_some_and(|c| LETTERS.contains(c));
        // Some programs leave the pocket empty: `P`.
        let is_empty = word.len() == 1 && letter == Some('P');
        if !is_known || value.is_none() && !is_empty {
            return Err(bad(format!("{} is no word of a tool table", shown(word))));
        }
        match letter {
            Some('T') => number = value,
            Some('D') => diameter = value.filter(|d| *d != 0.0),
            Some('I' | 'J' | 'Q') => is_lathe |= value.is_some_and(|x| x != 0.0),
            _ => {}
        }
    }
    let found = number.map_or("missing".into(), |number| number.to_string());
    let number = number.filter(|n| *n >= 0.0 && *n <= 1e9 && n.fract() == 0.0);
    let number =
        number.ok_or_else(|| bad(format!("the tool number T is {found}, no whole number")))?;
    Ok(Row { number: number as u64, other_number: None, diameter, is_lathe })
}

/// The letters that begin a word.
const LETTERS: &str = "TPDXYZABCUVWIJQ";

/// `T1P1D6` without blanks is three words.
fn glued(word: &str) -> Vec<&str> {
    let begins = |(_, c): &(usize, char)| LETTERS.contains(c.to_ascii_uppercase());
    let mut starts: Vec<usize> = word.char_indices().filter(begins).map(|(at, _)| at).collect();
    starts.retain(|at| *at > 0);
    let mut words = Vec::new();
    let mut from = 0;
    for at in starts.into_iter().chain([word.len()]) {
        words.push(&word[from..at]);
        from = at;
    }
    words
}
