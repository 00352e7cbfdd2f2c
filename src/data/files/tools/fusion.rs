//! Tool libraries exported from Fusion 360 as JSON.

use super::described::{Described, Form};
use super::place::{Place, shown};
use super::{ToolTable, Unsaid, holder};
use crate::{Error, Result};
use serde_json::Value;
use std::path::Path;

/// Whether a JSON text is such a library, or one tool of it.
pub(super) fn is_library(value: &Value) -> bool {
    value.get("data").is_some() || value.get("geometry").is_some()
}

pub(super) fn read(value: &Value, path: &Path, unsaid: &Unsaid) -> Result<ToolTable> {
    let tools = match value.get("data") {
        None => std::slice::from_ref(value),
        Some(data) => data.as_array().ok_or_else(|| {
            let remedy = "export the library again";
            Error::file(path, "data", "it is not a list of tools", remedy)
        })?,
    };
    let mut table = ToolTable::default();
    for (k, tool) in tools.iter().enumerate() {
        let name = name(tool, k);
        let label = format!("tool {}", shown(&name));
        let place = Place { path, name: &label };
        let Some(kind) = tool.get("type").and_then(Value::as_str) else {
            return Err(place.error("its type is missing", "export the library again"));
        };
        if kind == "holder" {
            continue;
        }
        match described(name.clone(), kind, tool, &place, unsaid)? {
            None => {
                let words = format!(
                    "a {kind} cannot be represented, only ball, bull-nose, flat and tapered end mills; it is left out"
                );
                table.refused.push(place.sentence(words));
            }
            Some(described) => {
                let (tool, notices) = described.tool(unsaid, &place)?;
                table.tools.push(tool);
                table.notices.extend(notices);
            }
        }
    }
    Ok(table)
}

/// The description, else the product number, else the place in the list.
fn name(tool: &Value, k: usize) -> String {
    let word = |key: &str| tool.get(key).and_then(Value::as_str).filter(|w| !w.trim().is_empty());
    let named = word("description").or(word("product-id"));
    named.map_or_else(|| format!("tool {}", k + 1), str::to_string)
}

/// `None` for a kind of tool that cannot be represented.
fn described(
    name: String,
    kind: &str,
    tool: &Value,
    place: &Place,
    unsaid: &Unsaid,
) -> Result<Option<Described>> {
    let kind = kind.trim().to_ascii_lowercase();
    let is_known =
        ["ball end mill", "flat end mill", "bull nose end mill", "tapered mill"].contains(&&*kind);
    if !is_known {
        return Ok(None);
    }
    let unit = holder::unit(tool, place, unsaid)?;
    let geometry = tool.get("geometry").unwrap_or(&Value::Null);
    let length = |key: &str| Ok::<_, Error>(place.number(geometry, key)?.map(|x| x * unit));
    let positive = |key: &str| Ok::<_, Error>(length(key)?.filter(|x| *x > 0.0));
    let missing = |key: &str, what: &str| {
        place.error(
            format!("{key}, the {what}, is missing or 0"),
            "add it where the tool was made, and export again",
        )
    };
    let diameter = positive("DC")?.ok_or_else(|| missing("DC", "diameter"))?;
    let corner = length("RE")?;
    let form = match kind.as_str() {
        "ball end mill" => ball(corner, diameter, place)?,
        "flat end mill" => flat(corner, place)?,
        "bull nose end mill" => {
            let corner = corner.filter(|r| *r > 0.0);
            Form::Bull { corner: corner.ok_or_else(|| missing("RE", "corner radius"))? }
        }
        _ => {
            let degrees = place.number(geometry, "TA")?.filter(|x| *x > 0.0);
            let degrees = degrees.ok_or_else(|| missing("TA", "taper angle per side"))?;
            let corner = corner.ok_or_else(|| {
                place.error("RE, the corner radius, is missing", "add it: 0 for a flat tip")
            })?;
            check_tip(length("tip-diameter")?, diameter, corner, place)?;
            Form::Tapered { corner, taper: degrees.to_radians() }
        }
    };
    let stick_out = match length("LB")? {
        Some(0.0) => return Err(missing("LB", "length below the holder")),
        stated => stated,
    };
    let holder = match tool.get("holder") {
        None | Some(Value::Null) => None,
        Some(object) => holder::of_object(object, place.path, unsaid)?,
    };
    Ok(Some(Described {
        name,
        form,
        diameter,
        flutes: positive("LCF")?,
        neck_end: positive("shoulder-length")?,
        neck: positive("shoulder-diameter")?,
        shank: positive("SFDM")?,
        overall: positive("OAL")?,
        stick_out,
        holder,
    }))
}

/// Radii that differ by less are the same, as a share.
const SAME: f64 = 1e-3;

fn ball(corner: Option<f64>, diameter: f64, place: &Place) -> Result<Form> {
    match corner.filter(|r| *r > 0.0) {
        Some(r) if (2.0 * r - diameter).abs() > SAME * diameter => {
            let found = format!("a ball end with RE {r} and DC {diameter} mm");
            Err(place.error(found, "the radius of a ball is half of its diameter: correct one"))
        }
        _ => Ok(Form::Ball),
    }
}

fn flat(corner: Option<f64>, place: &Place) -> Result<Form> {
    match corner.filter(|r| *r > 0.0) {
        Some(r) => {
            let found = format!("a flat end with a corner radius RE of {r} mm");
            Err(place.error(found, "make it a bull nose end mill, or RE 0"))
        }
        None => Ok(Form::Flat),
    }
}

/// A tip diameter may repeat DC, or state the flat between the corners.
fn check_tip(tip: Option<f64>, diameter: f64, corner: f64, place: &Place) -> Result<()> {
    let same = |a: f64, b: f64| (a - b).abs() <= SAME * diameter;
    match tip {
        Some(tip) if !same(tip, diameter) && !same(tip, diameter - 2.0 * corner) => {
            let found = format!("tip-diameter {tip} beside DC {diameter} and RE {corner} mm");
            Err(place
                .error(found, "expected DC, the diameter of the tip, or DC - 2 RE: correct one"))
        }
        _ => Ok(()),
    }
}
