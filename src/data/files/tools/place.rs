//! Where in a file something stands, for messages; and texts and numbers of any origin.

use crate::{Error, Result};
use serde_json::Value;
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

/// The text without a byte order mark.
pub(super) fn utf8<'a>(bytes: &'a [u8], path: &Path) -> Result<&'a str> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        let remedy = "save it in UTF-8, a table as CSV";
        Error::file(path, format!("line {line}"), "the text is not UTF-8", remedy)
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

pub(super) fn json(text: &str, path: &Path) -> Result<Value> {
    serde_json::from_str(text).map_err(|e| {
        let place = format!("line {}, column {}", e.line(), e.column());
        let found = format!("the JSON cannot be read ({})", e.to_string().replace('\n', " "));
        Error::file(path, place, found, "export the tools again")
    })
}

/// Millimeters of a unit by its name.
pub(super) fn unit_mm(name: &str) -> Option<f64> {
    match name.trim().to_ascii_lowercase().as_str() {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Some(1.0),
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => Some(10.0),
        "m" | "meter" | "meters" | "metre" | "metres" => Some(1000.0),
        "in" | "inch" | "inches" | "\"" | "″" => Some(25.4),
        "um" | "µm" | "μm" => Some(1e-3),
        "thou" | "mil" => Some(0.0254),
        "ft" | "'" | "′" => Some(304.8),
        _ => None,
    }
}

/// A decimal number with a point or a comma; of both, the last is the decimal one.
pub(super) fn decimal(text: &str) -> Option<f64> {
    let digits: String =
        text.chars().filter(|c| !matches!(c, ' ' | '\u{a0}' | '\u{202f}' | '\'')).collect();
    let plain = match (digits.rfind(','), digits.rfind('.')) {
        (Some(comma), Some(point)) if comma > point => digits.replace('.', "").replace(',', "."),
        (Some(_), Some(_)) => digits.replace(',', ""),
        _ => digits.replace(',', "."),
    };
    let allowed = plain.chars().all(|c| c.is_ascii_digit() || "+-.eE".contains(c));
    plain.parse().ok().filter(|x: &f64| allowed && x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_have_a_point_or_a_comma() {
        for (text, x) in [
            ("6.0000", 6.0),
            ("1,5", 1.5),
            ("1.250,5", 1250.5),
            ("1,250.5", 1250.5),
            ("1 250,5", 1250.5),
            ("-2", -2.0),
        ] {
            assert_eq!(decimal(text), Some(x), "{text}");
        }
        for text in ["", "x", "NaN", "inf", "1,2,3", "1e999", "6 mm"] {
            assert_eq!(decimal(text), None, "{text}");
        }
        assert_eq!(
            (unit_mm("Inches"), unit_mm("\""), unit_mm("furlong")),
            (Some(25.4), Some(25.4), None)
        );
    }
}
