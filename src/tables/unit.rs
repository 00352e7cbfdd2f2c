//! The unit of what people read: tables, CSV and the page. JSON and NPZ stay in mm.

use super::{Cell, significant};
use crate::geom::units::Unit;

/// What the numbers of a column are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    Length,
    /// A length of a tool table, which names no unit in its heading but takes one with each number.
    ToolLength,
    Area,
    Volume,
}

/// The lengths of a tool table.
const OF_TOOLS: [&str; 9] =
    ["CR", "CH", "FR", "FH", "corner", "clearance", "excess", "stick_out", "overall"];
/// Other lengths of which the key names no unit.
const UNNAMED: [&str; 2] = ["held_at", "least_stick_out"];

impl Quantity {
    /// By the key of a column; `of_tools` is a table of tools.
    pub fn of(key: &str, of_tools: bool) -> Option<Self> {
        match key {
            _ if key.ends_with("_mm2") => Some(Quantity::Area),
            _ if key.ends_with("_mm3") => Some(Quantity::Volume),
            _ if of_tools && OF_TOOLS.contains(&key) => Some(Quantity::ToolLength),
            _ if key.ends_with("_mm") || UNNAMED.contains(&key) || key == "stick_out" => {
                Some(Quantity::Length)
            }
            _ => None,
        }
    }

    /// A number in another unit, without the noise of the division.
    fn number(self, mm: f64, unit: Unit) -> f64 {
        let per = unit.millimeters();
        let per = match self {
            Quantity::Volume => per * per * per,
            Quantity::Area => per * per,
            Quantity::Length | Quantity::ToolLength => per,
        };
        let x = mm / per;
        format!("{x:.11e}").parse().unwrap_or(x)
    }
}

/// A cell in another unit; words and counts stay.
pub(super) fn cell(cell: &Cell, quantity: Option<Quantity>, unit: Unit) -> Cell {
    match (cell, quantity) {
        _ if unit == Unit::Millimeter => cell.clone(),
        (Cell::Millimeters(x), _) => {
            let x = Quantity::Length.number(*x, unit);
            let shown = if x.is_finite() { significant(x) } else { "-".into() };
            Cell::Measure(x, format!("{shown} {}", unit.symbol()))
        }
        (Cell::Number(x), Some(quantity)) => Cell::Number(quantity.number(*x, unit)),
        (Cell::Given(x), Some(quantity)) => Cell::Given(quantity.number(*x, unit)),
        _ => cell.clone(),
    }
}

/// As [`cell`], for people: a length that was chosen in mm has no more digits in another unit than can be read.
pub(super) fn cell_shown(shown: &Cell, quantity: Option<Quantity>, unit: Unit) -> Cell {
    match cell(shown, quantity, unit) {
        Cell::Given(x) if unit != Unit::Millimeter => {
            Cell::Given(format!("{x:.4e}").parse().unwrap_or(x))
        }
        cell => cell,
    }
}

/// A heading, or the name of a fact, in another unit.
pub(super) fn heading(heading: &str, quantity: Option<Quantity>, unit: Unit) -> String {
    let Some(quantity) = quantity.filter(|_| unit != Unit::Millimeter && !heading.is_empty())
    else {
        return heading.into();
    };
    let symbol = unit.symbol();
    if heading.contains("mm") {
        return heading.replace("mm", symbol);
    }
    match quantity {
        Quantity::Area => format!("{heading}, {symbol}²"),
        Quantity::Volume => format!("{heading}, {symbol}³"),
        _ => format!("{heading}, {symbol}"),
    }
}

/// The key of a column of a CSV file.
pub(super) fn key(key: &str, quantity: Option<Quantity>, unit: Unit) -> String {
    let symbol = unit.symbol();
    match quantity {
        _ if unit == Unit::Millimeter => key.into(),
        None | Some(Quantity::ToolLength) => key.into(),
        Some(Quantity::Area) => key.replace("_mm2", &format!("_{symbol}2")),
        Some(Quantity::Volume) => key.replace("_mm3", &format!("_{symbol}3")),
        Some(Quantity::Length) => format!("{}_{symbol}", key.trim_end_matches("_mm")),
    }
}

/// A number of a CSV file: with its unit where the heading names none.
pub(super) fn field(text: String, quantity: Option<Quantity>, unit: Unit) -> String {
    let is_bare = unit == Unit::Millimeter || text.is_empty();
    match quantity {
        Some(Quantity::ToolLength) if !is_bare => format!("{text}{}", unit.symbol()),
        _ => text,
    }
}
