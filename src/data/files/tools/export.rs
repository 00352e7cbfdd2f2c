//! Files of tools as they were understood: read again, they give the same cutters.
//!
//! As CSV it is the table that [`table`](super::table) reads, lengths in mm. As JSON:
//!
//! ```text
//! {"format": "deepmill tools", "version": 1, "tools": [
//!   {"name": …, "number": …, "description": …, "unit": "in", "clearance_mm": 0, "assembly": {…}},
//!   {"name": …, "lengths_mm": [CR, CH, FR, FH], "corner_mm": …, "clearance_mm": 0}]}
//! ```

use super::place::{Place, shown, shown_value};
use super::reading::Reading;
use super::{Tool, steps_words};
use crate::geom::units::Unit;
use crate::tool::cutter::{Assembly, CutterParams};
use crate::{Error, Result};
use serde_json::{Map, Value, json};
use std::path::Path;

/// The value of `format`.
const FORMAT: &str = "deepmill tools";
const VERSION: u64 = 1;

/// As a table.
#[doc(hidden)] // of the program
pub fn to_csv(tools: &[Tool]) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    // A vector takes every row, and the text is UTF-8.
    let mut write = |row: Vec<String>| writer.write_record(row).expect("in memory");
    write(HEADINGS.map(String::from).to_vec());
    for tool in tools {
        write(row(tool));
    }
    writer.into_inner().expect("in memory")
}

/// Of the columns that tables have those that are written, in the order for people.
const HEADINGS: [&str; 16] = [
    "T",
    "name",
    "CR",
    "CH",
    "FR",
    "FH",
    "corner",
    "clearance",
    "body",
    "holder",
    "stick_out",
    "neck_and_shank",
    "overall",
    "profile",
    "drawn_in",
    "description",
];

fn row(tool: &Tool) -> Vec<String> {
    let lengths = tool.params.to_array().into_iter().chain([tool.corner_mm, tool.clearance_mm]);
    let number = tool.number.map(|number| number.to_string()).unwrap_or_default();
    let mut row = vec![number, tool.name.clone()];
    row.extend(lengths.map(|length| length.to_string()));
    let assembly = &tool.assembly;
    row.extend(match tool.description {
        None => ["", "", "", ""].map(String::from),
        Some(_) => [
            steps_words(&assembly.own_body()),
            steps_words(assembly.holder()),
            assembly.stick_out_mm().to_string(),
            steps_words(assembly.neck_and_shank()),
        ],
    });
    row.push(assembly.overall_mm().map(|overall| overall.to_string()).unwrap_or_default());
    row.push(assembly.profile().map(|profile| profile.to_string()).unwrap_or_default());
    row.push(tool.unit.symbol().into());
    row.push(tool.description.clone().unwrap_or_default());
    row
}

/// As JSON.
///
/// # Errors
/// If a length is not finite, which no checked tool has.
#[doc(hidden)] // of the program
pub fn to_json(tools: &[Tool]) -> Result<Vec<u8>> {
    let object = |tool: &Tool| -> serde_json::Result<Value> {
        let mut object = Map::new();
        object.insert("name".into(), tool.name.clone().into());
        object.extend(tool.number.map(|number| ("number".to_string(), number.into())));
        object.insert("unit".into(), tool.unit.symbol().into());
        object.insert("clearance_mm".into(), tool.clearance_mm.into());
        match &tool.description {
            None => {
                object.insert("lengths_mm".into(), json!(tool.params.to_array()));
                object.insert("corner_mm".into(), tool.corner_mm.into());
                let overall = tool.assembly.overall_mm();
                object.extend(overall.map(|mm| ("overall_mm".to_string(), mm.into())));
            }
            Some(description) => {
                object.insert("description".into(), description.clone().into());
                object.insert("assembly".into(), serde_json::to_value(&tool.assembly)?);
            }
        }
        Ok(object.into())
    };
    let tools = tools.iter().map(object).collect::<serde_json::Result<Vec<Value>>>();
    let text = tools.and_then(|tools| {
        serde_json::to_vec_pretty(&json!({ "format": FORMAT, "version": VERSION, "tools": tools }))
    });
    text.map_err(|e| Error::argument("tools", e, "finite lengths", "correct the tools"))
}

/// The tools, if this is such a file.
pub(super) fn tools(value: &Value) -> Option<&Value> {
    value.get("tools").filter(|_| value.get("format").and_then(Value::as_str) == Some(FORMAT))
}

pub(super) fn read(tools: &Value, path: &Path) -> Result<Reading> {
    let list = tools.as_array().ok_or_else(|| {
        Error::file(path, "tools", "it is not a list of tools", "export the tools again")
    })?;
    let mut reading = Reading::default();
    for (k, object) in list.iter().enumerate() {
        let name = object.get("name").and_then(Value::as_str).unwrap_or_default();
        let label = format!("tool {} {}", k + 1, shown(name));
        let place = Place { path, name: &label };
        reading.add(one(object, name, &place).map(|tool| (tool, Vec::new())));
    }
    Ok(reading)
}

fn one(object: &Value, name: &str, place: &Place) -> Result<Tool> {
    const REMEDY: &str = "export the tools again";
    let clearance_mm = place.signed(object, "clearance_mm")?.unwrap_or(0.0);
    let unit = match object.get("unit") {
        None | Some(Value::Null) => Unit::Millimeter,
        Some(unit) => unit.as_str().and_then(|unit| unit.parse().ok()).ok_or_else(|| {
            place.error(format!("its unit is {}", shown_value(unit)), "expected mm, cm, m or in")
        })?,
    };
    let tool = match (object.get("assembly"), object.get("lengths_mm")) {
        (Some(assembly), _) => {
            let assembly: Assembly = serde_json::from_value(assembly.clone())
                .map_err(|e| place.error(format!("its assembly: {}", one_line(&e)), REMEDY))?;
            let words = object.get("description").and_then(Value::as_str).unwrap_or_default();
            Tool::of_assembly(name, assembly, clearance_mm, words.into())
        }
        (None, Some(lengths)) => {
            let lengths: [f64; 4] = serde_json::from_value(lengths.clone()).map_err(|e| {
                let found = format!("its lengths_mm: {}", one_line(&e));
                place.error(found, "expected CR, CH, FR and FH")
            })?;
            let corner = place.number(object, "corner_mm")?;
            Tool::new(CutterParams::from_array(lengths), corner, clearance_mm)
        }
        (None, None) => return Err(place.error("it has neither assembly nor lengths_mm", REMEDY)),
    };
    let tool = match place.number(object, "overall_mm")? {
        None => tool,
        Some(overall) => tool.and_then(|tool| tool.of_overall_length(overall)),
    };
    let mut tool = tool.map_err(|error| place.within(error))?;
    if !name.is_empty() {
        tool = tool.named(name);
    }
    let number = object.get("number").and_then(Value::as_u64);
    tool.number = number.and_then(|number| u32::try_from(number).ok());
    Ok(tool.of_unit(unit))
}

fn one_line(e: &serde_json::Error) -> String {
    e.to_string().replace('\n', " ")
}
