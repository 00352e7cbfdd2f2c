//! CAMotics tool tables: JSON, an object by tool number or a list, alone or as `tools` of a project.
//!
//! A tool has a shape, a diameter, the length that cuts, and its unit; nothing of shank, holder and stick-out.

use super::described::{Cone, Described, Family, Form};
use super::place::{Place, shown, shown_value};
use super::reading::Reading;
use super::{MissingParameters, Tool};
use crate::Result;
use crate::geom::units::length::unit_mm;
use serde_json::Value;
use std::path::Path;

/// The tools with their numbers, if this is such a file.
pub(super) fn tools(value: &Value) -> Option<Vec<(Option<u32>, &Value)>> {
    let tools = value.get("tools").unwrap_or(value);
    let has_shape = |tool: &Value| tool.get("shape").is_some() && tool.get("parameter").is_none();
    let number = |value: &Value| value.as_u64().and_then(|n| u32::try_from(n).ok());
    let found: Vec<(Option<u32>, &Value)> = match tools {
        Value::Object(tools) => tools.iter().map(|(key, tool)| (key.parse().ok(), tool)).collect(),
        Value::Array(tools) => {
            tools.iter().map(|tool| (tool.get("number").and_then(number), tool)).collect()
        }
        _ => return None,
    };
    let is_table = !found.is_empty() && found.iter().any(|(_, tool)| has_shape(tool));
    is_table.then(|| {
        let mut found = found;
        found.sort_by_key(|(number, _)| number.unwrap_or(u32::MAX));
        found
    })
}

pub(super) fn read(
    tools: &[(Option<u32>, &Value)],
    path: &Path,
    defaults: &MissingParameters,
) -> Reading {
    let mut reading = Reading::default();
    for (k, (number, tool)) in tools.iter().enumerate() {
        let words = tool.get("description").and_then(Value::as_str).unwrap_or("").trim();
        let tool_number = number.map_or(k as u64 + 1, u64::from);
        let name = if words.is_empty() { format!("T{tool_number}") } else { words.to_string() };
        let label = format!("tool {tool_number} {}", shown(&name));
        let place = Place { path, name: &label };
        let shape = tool.get("shape").and_then(Value::as_str).unwrap_or_default();
        let Some(shape) = shape_of(shape) else {
            let shape = tool.get("shape").map_or("nothing".into(), shown_value);
            let found = format!(
                "the shape {shape} cannot be represented, only cylindrical, ballnose, conical, snubnose and spheroid"
            );
            reading.leave_out_kind(place.error(found, "it is left out"));
            continue;
        };
        reading.add(one(tool, (&name, *number), shape, &place, defaults));
    }
    reading
}

#[derive(Debug, Clone, Copy)]
enum Shape {
    Cylindrical,
    Ballnose,
    Conical,
    Snubnose,
    Spheroid,
}

fn shape_of(name: &str) -> Option<Shape> {
    Some(match name.trim().to_lowercase().as_str() {
        "cylindrical" => Shape::Cylindrical,
        "ballnose" => Shape::Ballnose,
        "conical" => Shape::Conical,
        "snubnose" => Shape::Snubnose,
        "spheroid" => Shape::Spheroid,
        _ => return None,
    })
}

fn one(
    tool: &Value,
    (name, number): (&str, Option<u32>),
    shape: Shape,
    place: &Place,
    defaults: &MissingParameters,
) -> Result<(Tool, Vec<String>)> {
    let unit = match tool.get("units") {
        None | Some(Value::Null) => defaults.unit_mm.ok_or_else(|| {
            place.error(
                "the file does not say the unit",
                "give it with `unit_mm` in a program, or --tool-unit mm or in",
            )
        })?,
        Some(name) => name.as_str().and_then(unit_mm).ok_or_else(|| {
            let found = format!("its units are {}", shown_value(name));
            place.error(found, "expected metric or imperial: correct it")
        })?,
    };
    let length =
        |key: &str| Ok::<_, crate::Error>(place.length(tool, key, unit)?.filter(|x| *x > 0.0));
    let diameter = length("diameter")?
        .ok_or_else(|| place.error("its diameter is missing or 0", "add it to the table"))?;
    let flutes = length("length")?;
    let needed = || {
        let found = "its length is missing or 0";
        flutes.ok_or_else(|| place.error(found, "add it to the table"))
    };
    let is_ball = |length: f64| (length - diameter).abs() <= SAME * diameter;
    // The length is that of the whole form.
    let cone = |tip: f64| -> Result<(Form, f64)> {
        let angle = libm::atan(0.5 * (diameter - tip).abs() / needed()?);
        Ok(match tip {
            tip if (tip - diameter).abs() <= SAME * diameter => (Form::Flat, diameter),
            tip if tip > diameter => (Form::Family(Family::Dovetail { angle, corner: 0.0 }), tip),
            tip => (Form::Family(Family::Cone { kind: Cone::VBit, tip, angle }), diameter),
        })
    };
    let (form, width) = match shape {
        Shape::Cylindrical => (Form::Flat, diameter),
        Shape::Ballnose => (Form::Ball, diameter),
        Shape::Conical => cone(0.0)?,
        Shape::Snubnose => cone(length("snub_diameter")?.unwrap_or(0.0))?,
        Shape::Spheroid if is_ball(needed()?) => (Form::Ball, diameter),
        Shape::Spheroid => (Form::Family(Family::Spheroid), diameter),
    };
    // A cone that narrows upward is as wide as stated at its upper end.
    let neck = (width > diameter).then_some(diameter);
    Described {
        flutes,
        number,
        unit_mm: unit,
        neck,
        neck_end: flutes,
        ..Described::new(name, form, width)
    }
    .tool(defaults, place)
}

/// Lengths that differ by less are the same, as a share.
const SAME: f64 = 1e-6;
