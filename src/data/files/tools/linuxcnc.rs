//! LinuxCNC tool tables: number, diameter and a remark for each tool.
//!
//! Such a table does not say what a tool looks like. Its remark may: `ball`, `flat` or `bull` with `r` and the corner's radius.

use super::described::{Described, Form};
use super::place::{Place, decimal, shown};
use super::{ToolTable, Unsaid};
use crate::{Error, Result};
use std::path::Path;

/// Whether the first line that is not a remark begins with `T` and a number.
pub(super) fn is_table(text: &str) -> bool {
    let first = text.lines().map(str::trim).find(|l| !l.is_empty() && !l.starts_with(';'));
    let mut chars = first.unwrap_or("").chars();
    matches!(chars.next(), Some('T' | 't')) && chars.next().is_some_and(|c| c.is_ascii_digit())
}

pub(super) fn read(text: &str, path: &Path, unsaid: &Unsaid) -> Result<ToolTable> {
    let mut table = ToolTable::default();
    for (line, row) in (1..).zip(text.lines()) {
        let (words, remark) = row.split_once(';').unwrap_or((row, ""));
        let (words, remark) = (words.trim(), remark.trim());
        if words.is_empty() {
            continue;
        }
        let Row { number, diameter } = row_of(words, line, path)?;
        let name = format!("T{number} {remark}");
        let name = name.trim();
        let label = format!("line {line}, tool {}", shown(name));
        let place = Place { path, name: &label };
        let unit = unsaid.unit_mm.ok_or_else(|| {
            let found = "the file does not say the unit";
            place.error(found, "give that of the machine with --tool-unit mm or in")
        })?;
        let form = match (form(remark, unit), diameter) {
            (Ok(_), None) => Err("without a diameter D".to_string()),
            (Ok(form), Some(diameter)) => Ok((form, diameter)),
            (Err(why), _) => Err(why),
        };
        match form {
            Err(why) => table.refused.push(place.sentence(format!("{why}; it is left out"))),
            Ok((form, diameter)) => {
                let diameter = place.not_negative("D", diameter)? * unit;
                let tool = Described {
                    name: name.to_string(),
                    form,
                    diameter,
                    flutes: None,
                    neck_end: None,
                    neck: None,
                    shank: None,
                    overall: None,
                    stick_out: None,
                    holder: None,
                };
                let (tool, notices) = tool.tool(unsaid, &place)?;
                table.tools.push(tool);
                table.notices.extend(notices);
            }
        }
    }
    Ok(table)
}

struct Row {
    number: u64,
    diameter: Option<f64>,
}

fn row_of(words: &str, line: usize, path: &Path) -> Result<Row> {
    let bad = |found: String| {
        let remedy = "write for example T1 P1 D6.0 Z+52.3 ;6 mm ball end";
        Error::file(path, format!("line {line}"), found, remedy)
    };
    let (mut number, mut diameter) = (None, None);
    for word in words.split_whitespace() {
        let mut chars = word.chars();
        let letter = chars.next().map(|c| c.to_ascii_uppercase());
        let value = decimal(chars.as_str());
        let known = letter.is_some_and(|c| "TPDXYZABCUVWIJQ".contains(c));
        let (true, Some(value)) = (known, value) else {
            return Err(bad(format!("{} is no word of a tool table", shown(word))));
        };
        match letter {
            Some('T') => number = Some(value),
            Some('D') => diameter = Some(value).filter(|d| *d != 0.0),
            _ => {}
        }
    }
    let number = number.filter(|n| *n >= 0.0 && *n <= 1e9 && n.fract() == 0.0);
    let number =
        number.ok_or_else(|| bad("the tool number T is missing or no whole number".into()))?;
    Ok(Row { number: number as u64, diameter })
}

/// Words of remarks that name what cannot be represented.
const OTHERS: [&str; 17] = [
    "probe",
    "drill",
    "tap",
    "v-bit",
    "vbit",
    "chamfer",
    "spot",
    "engrav",
    "reamer",
    "lollipop",
    "dovetail",
    "thread",
    "saw",
    "face mill",
    "facemill",
    "t-slot",
    "taper",
];

/// The form that a remark names, or why there is none.
fn form(remark: &str, unit: f64) -> std::result::Result<Form, String> {
    let remark = remark.to_lowercase();
    if let Some(other) = OTHERS.into_iter().find(|other| remark.contains(other)) {
        return Err(format!(
            "the remark names a {other}, only ball, bull-nose and flat end mills can be read from a tool table"
        ));
    }
    let has = |word: &str| remark.contains(word);
    match [has("ball"), has("bull"), has("flat") || has("square")] {
        [true, false, false] => Ok(Form::Ball),
        [false, false, true] => Ok(Form::Flat),
        [false, true, false] => corner(&remark, unit)
            .map(|corner| Form::Bull { corner })
            .ok_or_else(|| "the remark names a bull nose without its corner (r1)".into()),
        _ => {
            Err("the remark does not say the form: ball, flat, or bull and its corner (r1)".into())
        }
    }
}

/// `r1`, `R0.5`: a word of the letter and a number.
fn corner(remark: &str, unit: f64) -> Option<f64> {
    let words = remark.split_whitespace().filter_map(|word| word.strip_prefix('r'));
    let value = words.filter_map(|rest| decimal(rest.trim_end_matches([',', ')', ';']))).next();
    value.filter(|r| *r > 0.0).map(|r| r * unit)
}
