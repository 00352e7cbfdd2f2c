//! FreeCAD tool bits (`.fctb`): JSON with one tool, lengths as texts with a unit.

use super::described::{Described, Form};
use super::place::{Place, decimal, shown, shown_value, unit_mm};
use super::{ToolTable, Unsaid};
use crate::Result;
use serde_json::Value;
use std::path::Path;

pub(super) fn read(value: &Value, path: &Path, unsaid: &Unsaid) -> Result<ToolTable> {
    let word = |key: &str| value.get(key).and_then(Value::as_str).filter(|w| !w.trim().is_empty());
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = word("name").or(word("label")).map(str::to_string).or(stem).unwrap_or_default();
    let label = format!("tool {}", shown(&name));
    let place = Place { path, name: &label };
    let shape = word("shape-type").or(word("shape"));
    let Some(shape) = shape else {
        return Err(place.error("neither shape-type nor shape is there", "save the tool bit again"));
    };
    let bit =
        Bit { parameters: value.get("parameter").unwrap_or(&Value::Null), place: &place, unsaid };
    let mut table = ToolTable::default();
    match bit.described(name.clone(), &form_name(shape))? {
        None => {
            let words = format!(
                "the shape {} cannot be represented, only ball, bull-nose, flat and tapered end mills; it is left out",
                shown(shape)
            );
            table.refused.push(place.sentence(words));
        }
        Some(described) => {
            let (tool, notices) = described.tool(unsaid, &place)?;
            table.tools.push(tool);
            table.notices = notices;
        }
    }
    Ok(table)
}

/// `Shapes/Ball-End.FCStd` → `ballend`.
fn form_name(shape: &str) -> String {
    let file = shape.rsplit(['/', '\\']).next().unwrap_or(shape).to_ascii_lowercase();
    let stem = file.strip_suffix(".fcstd").unwrap_or(&file);
    stem.chars().filter(|c| c.is_ascii_alphanumeric()).collect()
}

struct Bit<'a> {
    parameters: &'a Value,
    place: &'a Place<'a>,
    unsaid: &'a Unsaid,
}

impl Bit<'_> {
    /// `None` for a shape that cannot be represented.
    fn described(&self, name: String, shape: &str) -> Result<Option<Described>> {
        let is_known =
            ["endmill", "ballend", "bullnose", "torus", "taperedballnose"].contains(&shape);
        if !is_known {
            return Ok(None);
        }
        let diameter = self.length("Diameter")?.filter(|d| *d > 0.0);
        let diameter = diameter.ok_or_else(|| self.missing("Diameter"))?;
        let form = match shape {
            "endmill" => Form::Flat,
            "ballend" => Form::Ball,
            "taperedballnose" => {
                // The file has the whole angle of the cone.
                let whole = self.angle("TaperAngle")?.ok_or_else(|| self.missing("TaperAngle"))?;
                Form::Tapered { corner: 0.5 * diameter, taper: 0.5 * whole }
            }
            _ => Form::Bull { corner: self.corner(diameter)? },
        };
        let positive = |key: &str| self.length(key).map(|length| length.filter(|x| *x > 0.0));
        Ok(Some(Described {
            name,
            form,
            diameter,
            flutes: positive("CuttingEdgeHeight")?,
            neck_end: None,
            neck: None,
            shank: positive("ShankDiameter")?,
            overall: positive("Length")?,
            stick_out: None,
            holder: None,
        }))
    }

    /// Radius of a bull nose's corner. Versions differ in what `FlatRadius` means.
    fn corner(&self, diameter: f64) -> Result<f64> {
        if let Some(corner) = self.length("CornerRadius")?.or(self.length("TorusRadius")?) {
            return Ok(corner);
        }
        match self.length("FlatRadius")? {
            None => Err(self.missing("CornerRadius")),
            Some(flat) if (4.0 * flat - diameter).abs() < 1e-6 * diameter => Ok(flat),
            Some(flat) => {
                let found = format!(
                    "FlatRadius {flat} mm is the radius of the corner in some versions and of the flat in others"
                );
                Err(self.place.error(found, "add CornerRadius"))
            }
        }
    }

    fn missing(&self, key: &str) -> crate::Error {
        self.place.error(format!("{key} is missing or 0"), "add it to the tool bit")
    }

    fn length(&self, key: &str) -> Result<Option<f64>> {
        let Some((x, unit)) = self.value(key)? else { return Ok(None) };
        let mm = match unit.as_str() {
            "" => self.unsaid.unit_mm.ok_or_else(|| {
                let found = format!("{key} is {x} without a unit");
                self.place.error(found, "write for example \"6 mm\", or give --tool-unit mm or in")
            })?,
            unit => unit_mm(unit).ok_or_else(|| self.bad_unit(key, unit, "mm or in"))?,
        };
        self.place.not_negative(key, x * mm).map(Some)
    }

    fn angle(&self, key: &str) -> Result<Option<f64>> {
        let Some((x, unit)) = self.value(key)? else { return Ok(None) };
        let x = self.place.not_negative(key, x)?;
        match unit.as_str() {
            "°" | "deg" => Ok(Some(x.to_radians())),
            "rad" => Ok(Some(x)),
            unit => Err(self.bad_unit(key, unit, "° or rad")),
        }
    }

    fn bad_unit(&self, key: &str, unit: &str, expected: &str) -> crate::Error {
        let found = format!("the unit of {key} is {}", shown(unit));
        self.place.error(found, format!("expected {expected}: correct it"))
    }

    /// Number and unit of a parameter.
    fn value(&self, key: &str) -> Result<Option<(f64, String)>> {
        let bad = |value: &Value| {
            let found = format!("{key} is {}, not a length or angle", shown_value(value));
            self.place.error(found, "write for example \"6 mm\"")
        };
        match self.parameters.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::String(text)) => {
                let text = text.trim();
                let is_of_number =
                    |c: char| c.is_ascii_digit() || "+-.,' \u{a0}\u{202f}".contains(c);
                let end = text.find(|c| !is_of_number(c)).unwrap_or(text.len());
                // An apostrophe alone at the end means feet.
                let number = text[..end].trim_end_matches(['\'', ' ', '\u{a0}', '\u{202f}']);
                let unit = text[number.len()..].trim().to_string();
                let x = decimal(number).ok_or_else(|| bad(&Value::String(text.into())))?;
                Ok(Some((x, unit)))
            }
            Some(value) => match value.as_f64() {
                Some(x) => Ok(Some((x, String::new()))),
                None => Err(bad(value)),
            },
        }
    }
}
