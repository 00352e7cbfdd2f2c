//! Where in a file something stands, for messages; and texts and numbers of any origin.

use crate::geom::units::length::converted;
use crate::storage::input_file;
use crate::{Error, Result};
use serde_json::Value;
use std::borrow::Cow;
use std::path::Path;

/// A tool or holder of a file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place<'a> {
    pub path: &'a Path,
    /// `tool "6 mm ball"`.
    pub name: &'a str,
}

impl Place<'_> {
    pub fn error(&self, found: impl Into<String>, remedy: impl Into<String>) -> Error {
        Error::file(self.path, self.name, found, remedy)
    }

    /// The error, of an argument as one of this place.
    pub fn within(&self, error: Error) -> Error {
        match error {
            Error::Argument { name, found, expected, remedy } => {
                self.error(format!("{name} is {found}, expected {expected}"), remedy)
            }
            other => other,
        }
    }

    /// The error, of a part of this place as one of it.
    pub fn about_part(&self, error: Error) -> Error {
        match error {
            Error::File { place, found, remedy, .. } => {
                self.error(format!("its {place}: {found}"), remedy)
            }
            other => other,
        }
    }

    /// A sentence about this place.
    pub fn sentence(&self, words: impl std::fmt::Display) -> String {
        format!("{}: {}: {words}", self.path.display(), self.name)
    }

    /// A number of a JSON object; `None` if it is missing or null.
    pub fn number(&self, object: &Value, key: &str) -> Result<Option<f64>> {
        match object.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(value) => match value.as_f64().filter(|x| x.is_finite()) {
                Some(x) => self.not_negative(key, x).map(Some),
                None => {
                    let found = format!("{key} is {}, not a number", shown_value(value));
                    Err(self.error(found, "correct it where the tool was made, and export again"))
                }
            },
        }
    }

    /// As [`Place::number`], of either sign.
    pub fn signed(&self, object: &Value, key: &str) -> Result<Option<f64>> {
        match object.get(key).and_then(Value::as_f64).filter(|x| (-MOST..0.0).contains(x)) {
            Some(x) => Ok(Some(x)),
            None => self.number(object, key),
        }
    }

    /// A length of a JSON object in units of `unit_mm`, in mm.
    pub fn length(&self, object: &Value, key: &str, unit_mm: f64) -> Result<Option<f64>> {
        Ok(self.number(object, key)?.map(|x| converted(x, unit_mm)))
    }

    pub fn not_negative(&self, key: &str, x: f64) -> Result<f64> {
        if (0.0..=MOST).contains(&x) {
            return Ok(x);
        }
        let found = format!("{key} is {x}, not a length or angle of a tool");
        Err(self.error(found, "give it from 0 to 10 m, and check the unit"))
    }
}

/// Beyond this no number is a length or an angle of a tool in any unit.
const MOST: f64 = 1e6;

/// A text in a message: in one line, not too long.
pub(super) fn shown(text: &str) -> String {
    let short: String = text.chars().take(40).collect();
    let more = if short.len() < text.len() { "…" } else { "" };
    format!("{:?}", short + more)
}

/// A value of a JSON file in a message, as [`shown`].
pub(super) fn shown_value(value: &Value) -> String {
    value.as_str().map_or_else(|| shown(&value.to_string()), shown)
}

/// The text without a byte order mark, its lines ending in line feeds.
pub(super) fn text<'a>(bytes: &'a [u8], path: &Path) -> Result<Cow<'a, str>> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = input_file::line_of(bytes, e.valid_up_to());
        let remedy = "save it in UTF-8, a table as CSV";
        Error::file(path, format!("line {line}"), "the text is not UTF-8", remedy)
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    Ok(match text.contains('\r') {
        true => text.replace("\r\n", "\n").replace('\r', "\n").into(),
        false => text.into(),
    })
}

pub(super) fn json(text: &str, path: &Path) -> Result<Value> {
    serde_json::from_str(text).map_err(|e| {
        let place = format!("line {}, column {}", e.line(), e.column());
        let found = format!("the JSON cannot be read ({})", e.to_string().replace('\n', " "));
        Error::file(path, place, found, "export the tools again")
    })
}
