//! Lengths as people write them: `6 mm`, `0,25 in`, `1/4"`, `1 1/2 in`, `1' 2"`.
//!
//! ```text
//! length = [number "'"] [number unit]        unit: mm, cm, m, µm, in, ", thou, ft, '
//! number = decimal | fraction | whole fraction   (a point or a comma; of both, the last is the decimal one)
//! ```

use super::Unit;
use std::fmt;

/// A length with the unit it was written in, or without one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Length {
    value: f64,
    unit_mm: Option<f64>,
}

impl Length {
    /// Reads a length; `None` if the text is none. Negative ones are read as well.
    ///
    /// ```
    /// use deepmill::geom::units::{Length, Unit};
    /// assert_eq!(Length::read("1/4\"").unwrap().mm(Unit::Millimeter), 6.35);
    /// assert_eq!(Length::read("0.875").unwrap().mm(Unit::Inch), 22.225);
    /// assert!(Length::read("6 furlong").is_none());
    /// ```
    pub fn read(text: &str) -> Option<Self> {
        let (number, unit) = split(text)?;
        Self::of(&number, &unit)
    }

    fn of(number: &str, unit: &str) -> Option<Self> {
        if let Some((feet, inches)) = feet_and_inches(number, unit) {
            let feet = number_of(&feet)?;
            let inches = if inches.is_empty() { 0.0 } else { number_of(&inches)? };
            let value = 12.0 * feet + if feet < 0.0 { -inches } else { inches };
            return Some(Length { value, unit_mm: Some(Unit::Inch.millimeters()) });
        }
        let unit_mm = match unit {
            "" => None,
            unit => Some(unit_mm(unit)?),
        };
        Some(Length { value: number_of(number)?, unit_mm })
    }

    /// Whether a unit was written.
    pub fn has_unit(self) -> bool {
        self.unit_mm.is_some()
    }

    /// In millimeters; `bare` is the unit of a number without one.
    pub fn mm(self, bare: Unit) -> f64 {
        self.mm_of(bare.millimeters())
    }

    /// Millimeters of its unit.
    #[cfg(feature = "formats")]
    pub(crate) fn unit_or(self, bare_mm: f64) -> f64 {
        self.unit_mm.unwrap_or(bare_mm)
    }

    pub(crate) fn mm_of(self, bare_mm: f64) -> f64 {
        converted(self.value, self.unit_mm.unwrap_or(bare_mm))
    }
}

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.unit_mm {
            None => write!(f, "{}", self.value),
            Some(unit) => write!(f, "{} mm", converted(self.value, unit)),
        }
    }
}

/// Digits behind the decimal point that a converted length keeps: a hundredth of an atom, in mm.
const DIGITS: f64 = 1e9;
/// Beyond this a length has no such digits.
const MOST_MM: f64 = 1e6;

/// Millimeters as one would write them: 0.875 in are 22.225, not 22.224999999999998.
pub(crate) fn converted(value: f64, unit_mm: f64) -> f64 {
    let mm = value * unit_mm;
    if unit_mm == 1.0 { mm } else { tidy(mm) }
}

/// A sum or product of lengths without its last roundings.
pub(crate) fn tidy(mm: f64) -> f64 {
    if mm.abs() < MOST_MM { libm::round(mm * DIGITS) / DIGITS } else { mm }
}

/// Number and unit of a text, as they stand.
pub(crate) fn split(text: &str) -> Option<(String, String)> {
    let text = text.trim().replace("''", "\"").replace(['”', '″'], "\"").replace(['′', '’'], "'");
    let text = with_plain_fractions(&text);
    let is_of_number = |c: char| c.is_ascii_digit() || "+-.,/' \t\u{a0}\u{202f}".contains(c);
    // What follows the feet of `1' 2"` belongs to the number.
    let end = text.find(|c| !is_of_number(c)).unwrap_or(text.len());
    let number = text[..end].trim_end();
    let unit = text[end..].trim();
    let (number, unit) = match number.strip_suffix('\'') {
        Some(feet) if unit.is_empty() => (feet.trim_end(), "ft"),
        _ => (number, unit),
    };
    (!number.is_empty()).then(|| (number.into(), unit.into()))
}

/// `1½` as `1 1/2`.
fn with_plain_fractions(text: &str) -> String {
    const SIGNS: [(char, &str); 7] = [
        ('¼', " 1/4"),
        ('½', " 1/2"),
        ('¾', " 3/4"),
        ('⅛', " 1/8"),
        ('⅜', " 3/8"),
        ('⅝', " 5/8"),
        ('⅞', " 7/8"),
    ];
    let plain = |text: String, (sign, plain): (char, &str)| text.replace(sign, plain);
    SIGNS.into_iter().fold(text.replace('⁄', "/"), plain).trim_start().into()
}

/// `1'` and `2` of `1' 2"`, or of `1 ft 2 in`; an apostrophe between digits of a thousand divides nothing.
fn feet_and_inches(number: &str, unit: &str) -> Option<(String, String)> {
    if let Some(rest) = unit.strip_prefix("ft") {
        let (inches, unit) = split(rest).unwrap_or_default();
        let is_whole = rest.trim().is_empty() || unit_mm(&unit) == Some(Unit::Inch.millimeters());
        return is_whole.then(|| (number.into(), inches));
    }
    let (feet, inches) = number.split_once('\'')?;
    let is_inch = unit_mm(unit) == Some(Unit::Inch.millimeters());
    is_inch.then(|| (feet.trim().into(), inches.trim().into()))
}

/// Millimeters of a unit by its name.
pub(crate) fn unit_mm(name: &str) -> Option<f64> {
    match name.trim().trim_end_matches('.').to_lowercase().as_str() {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" | "metric" => Some(1.0),
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => Some(10.0),
        "m" | "meter" | "meters" | "metre" | "metres" => Some(1000.0),
        "in" | "inch" | "inches" | "\"" | "″" | "zoll" | "imperial" => Some(25.4),
        "um" | "µm" | "μm" => Some(1e-3),
        "thou" | "mil" => Some(0.0254),
        "ft" | "foot" | "feet" | "'" | "′" => Some(304.8),
        _ => None,
    }
}

fn number_of(text: &str) -> Option<f64> {
    let text = text.trim();
    let Some((before, below)) = text.split_once('/') else { return decimal(text) };
    let below = decimal(below.trim()).filter(|below| *below > 0.0)?;
    let before = before.trim_end();
    // The whole number of `1 1/2` or `1-1/2`.
    let at = before.rfind([' ', '-', '\u{a0}', '\u{202f}']).filter(|at| *at > 0);
    let (whole, above) = match at {
        Some(at) => (
            decimal(before[..at].trim())?,
            before[at..].trim_start_matches([' ', '-', '\u{a0}', '\u{202f}']),
        ),
        None => (0.0, before),
    };
    let share = decimal(above)? / below;
    Some(if whole < 0.0 { whole - share } else { whole + share })
}

/// A decimal number with a point or a comma; of both, the last is the decimal one.
pub(crate) fn decimal(text: &str) -> Option<f64> {
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
    fn lengths_are_read_as_people_write_them() {
        for (text, mm) in [
            ("1/4\"", 6.35),
            ("3/8\"", 9.525),
            ("1/4 in", 6.35),
            ("0,25 in", 6.35),
            (".25in", 6.35),
            ("0.25 inch", 6.35),
            ("1/4''", 6.35),
            ("1/4”", 6.35),
            ("1 1/2\"", 38.1),
            ("1-1/2 in.", 38.1),
            ("1'", 304.8),
            ("1 ft", 304.8),
            ("0' 0 1/4\"", 6.35),
            ("1' 2 1/2\"", 368.3),
            ("1'6\"", 457.2),
            ("1 ft 6 in", 457.2),
            ("6,35 mm", 6.35),
            ("6.35mm", 6.35),
            ("1'250.5 mm", 1250.5),
            ("1 250,5 mm", 1250.5),
            ("5 cm", 50.0),
            ("250 µm", 0.25),
            ("125 thou", 3.175),
            ("-2 in", -50.8),
            ("0.875 in", 22.225),
            ("¼\"", 6.35),
            ("1½ in", 38.1),
            ("1 ⅜”", 34.925),
            ("1⁄8 in", 3.175),
        ] {
            let length = Length::read(text).unwrap_or_else(|| panic!("{text}"));
            assert_eq!((length.has_unit(), length.mm(Unit::Meter)), (true, mm), "{text}");
        }
        let bare = Length::read("1 1/8").unwrap();
        assert_eq!((bare.has_unit(), bare.mm(Unit::Inch)), (false, 28.575));
        assert_eq!(Length::read("30").unwrap().mm(Unit::Millimeter), 30.0);
        for text in [
            "",
            "mm",
            "6 furlong",
            "1/0 in",
            "1/ in",
            "1/2/3 in",
            "nan",
            "1,2,3",
            "6 mm 7",
            "1e3 x",
        ] {
            assert_eq!(Length::read(text), None, "{text}");
        }
    }

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

    #[test]
    fn converted_lengths_have_no_roundings_to_be_seen() {
        for (inch, mm) in [(0.875, 22.225), (1.1, 27.94), (0.0568, 1.44272), (0.1, 2.54)] {
            assert_eq!(converted(inch, 25.4), mm);
        }
        assert_eq!((tidy(27.94 - 6.35), converted(0.1 + 0.2, 1.0)), (21.59, 0.1 + 0.2));
    }
}
