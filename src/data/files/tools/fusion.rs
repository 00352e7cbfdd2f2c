//! Tool libraries exported from Fusion 360 as JSON.

mod families;
mod form_mill;

use super::described::{Described, Family, Form};
use super::place::{Place, shown, shown_value};
use super::reading::Reading;
use super::{MissingParameters, holder};
use crate::{Error, Result};
use serde_json::Value;
use std::path::Path;

/// The types of tools that are read.
const KINDS: &str = "end mills (ball, bull nose, flat, tapered), lollipop, slot, dovetail, chamfer, radius, face, \
     thread, form and circle segment mills, countersinks, counterbores, drills, spot and center \
     drills and reamers";

/// Whether a JSON text is such a library, or one tool of it.
pub(super) fn is_library(value: &Value) -> bool {
    value.get("data").is_some() || value.get("geometry").is_some()
}

/// Whose words the lengths have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Spelling {
    /// Exported as JSON.
    Json,
    /// Those of a `.hsmlib` file.
    Xml,
}

pub(super) fn read(
    value: &Value,
    spelling: Spelling,
    path: &Path,
    defaults: &MissingParameters,
) -> Result<Reading> {
    let tools = match value.get("data") {
        None => std::slice::from_ref(value),
        Some(data) => data.as_array().ok_or_else(|| {
            let remedy = "export the library again";
            Error::file(path, "data", "it is not a list of tools", remedy)
        })?,
    };
    let mut reading = Reading::default();
    for (k, tool) in tools.iter().enumerate() {
        let name = name(tool, k);
        let label = format!("tool {}", shown(&name));
        let place = Place { path, name: &label };
        let Some(kind) = tool.get("type").and_then(Value::as_str) else {
            let found =
                format!("its type is {}", tool.get("type").map_or("missing".into(), shown_value));
            reading.add(Err(place.error(found, "export the library again")));
            continue;
        };
        if kind == "holder" {
            continue;
        }
        match described((name.clone(), kind, tool), spelling, &place, defaults) {
            Ok(None) => reading.leave_out_kind(place.error(
                format!("a {} cannot be represented, only {KINDS}", kind.trim()),
                "it is left out",
            )),
            Ok(Some((described, assumed))) => {
                reading.add(described.tool(defaults, &place).map(|(tool, mut notices)| {
                    notices.extend(assumed);
                    (tool, notices)
                }));
                reading.notices.extend(unnamed_holder(tool, &place));
            }
            Err(why) => reading.add(Err(why)),
        }
    }
    Ok(reading)
}

/// A holder of which the file has the name and nothing else: the one given is taken in its place.
fn unnamed_holder(tool: &Value, place: &Place) -> Option<String> {
    let holder = tool.get("holder").filter(|holder| holder.is_object())?;
    let name = holder.get("description").and_then(Value::as_str)?;
    holder.get("segments").is_none().then(|| {
        place.sentence(format!("its holder {} has no segments: the one given counts", shown(name)))
    })
}

/// The description, else the product number, else the place in the list.
fn name(tool: &Value, k: usize) -> String {
    let word = |key: &str| tool.get(key).and_then(Value::as_str).filter(|w| !w.trim().is_empty());
    let named = word("description").or(word("product-id"));
    named.map_or_else(|| format!("tool {}", k + 1), str::to_string)
}

/// With what was assumed; `None` for a kind of tool that cannot be represented.
fn described(
    (name, kind, tool): (String, &str, &Value),
    spelling: Spelling,
    place: &Place,
    defaults: &MissingParameters,
) -> Result<Option<(Described, Option<String>)>> {
    let kind = kind.trim().to_ascii_lowercase();
    if !families::is_known(&kind) {
        return Ok(None);
    }
    let unit = holder::unit(tool, place, defaults)?;
    let geometry = tool.get("geometry").unwrap_or(&Value::Null);
    let of = Geometry { geometry, unit, spelling, place };
    let described = match &*kind {
        "form mill" => Described::of_profile(name, of.form_mill()?),
        _ => {
            let stated = of.positive("DC")?.ok_or_else(|| of.missing("DC", "diameter"))?;
            let (form, diameter) = of.form(&kind, stated)?;
            Described::new(name, form, diameter)
        }
    };
    let stick_out = match of.length("LB")? {
        Some(0.0) => return Err(of.missing("LB", "length below the holder")),
        stated => stated,
    };
    let holder = match tool.get("holder") {
        None | Some(Value::Null) => None,
        Some(object) => holder::of_object(object, place.path, defaults)
            .map_err(|error| place.about_part(error))?,
    };
    let shaft = match tool.get("shaft").and_then(|shaft| shaft.get("segments")) {
        None | Some(Value::Null) => Vec::new(),
        Some(segments) => {
            let mut shaft = holder::sections_of(segments, unit, place)?;
            shaft.retain(|section| section.length_mm > 0.0);
            shaft
        }
    };
    let flutes = match described.form {
        // The head is as high as both of its corners.
        Form::Family(Family::Slot { corner }) => {
            of.positive("LCF")?.map(|flutes| flutes.max(2.0 * corner))
        }
        _ => of.positive("LCF")?,
    };
    let [neck_end, neck] = [of.positive("shoulder-length")?, of.positive("shoulder-diameter")?];
    let is_at_end = neck_end.zip(flutes).is_none_or(|(end, flutes)| (end - flutes).abs() < 1e-6);
    let number = tool.get("post-process").and_then(|post| post.get("number"));
    let number = number.and_then(Value::as_u64).and_then(|n| u32::try_from(n).ok());
    let described = Described {
        flutes,
        neck_end,
        neck,
        shank: of.positive("SFDM")?,
        shaft,
        taper_end: neck.filter(|_| is_at_end),
        overall: of.positive("OAL")?,
        stick_out,
        holder,
        number: number.filter(|n| *n > 0),
        unit_mm: unit,
        ..described
    };
    Ok(Some((described, of.assumed(&kind))))
}

/// Lengths of a tool.
struct Geometry<'a> {
    geometry: &'a Value,
    unit: f64,
    spelling: Spelling,
    place: &'a Place<'a>,
}

impl Geometry<'_> {
    /// The word that the file has for it.
    fn key(&self, key: &'static str) -> &'static str {
        self.spelling.key(key)
    }

    fn length(&self, key: &'static str) -> Result<Option<f64>> {
        self.place.length(self.geometry, self.key(key), self.unit)
    }

    fn positive(&self, key: &'static str) -> Result<Option<f64>> {
        Ok(self.length(key)?.filter(|x| *x > 0.0))
    }

    /// The form, and the diameter that it is about.
    fn form(&self, kind: &str, diameter: f64) -> Result<(Form, f64)> {
        let corner = self.length("RE")?;
        Ok((
            match kind {
                "ball end mill" => ball(corner, diameter, self.place)?,
                "flat end mill" => flat(corner, self.place)?,
                "bull nose end mill" => {
                    let corner = corner.filter(|r| *r > 0.0);
                    let missing = || self.missing("RE", "corner radius");
                    Form::Bull { corner: corner.ok_or_else(missing)? }
                }
                "tapered mill" => return self.tapered(corner, diameter),
                kind => {
                    let (form, diameter) = self.family(kind, corner.unwrap_or(0.0), diameter)?;
                    return Ok((form, diameter));
                }
            },
            diameter,
        ))
    }

    fn tapered(&self, corner: Option<f64>, diameter: f64) -> Result<(Form, f64)> {
        let taper = self.per_side()?;
        let corner = corner.ok_or_else(|| {
            let found = "RE, the corner radius, is missing";
            self.place.error(found, "add it: 0 for a flat tip")
        })?;
        check_tip(self.length("tip-diameter")?, diameter, corner, self.place)?;
        match is_ball_below_cone(corner, taper, diameter) {
            true => Ok((Form::Tapered { corner, taper }, 2.0 * corner)),
            false => Ok((Form::Tapered { corner, taper }, diameter)),
        }
    }
}

/// Diameters of a cone that differ by less are the same: a share, and mm (four digits of an inch).
const SAME_CONE: (f64, f64) = (2e-3, 2e-3);

/// Vendors state as DC of a tapered ball the cone's diameter at the height of the tip, 2 RE (1/cos TA - tan TA), or
/// where the ball ends, 2 RE cos TA, in place of the ball's: RE says the ball.
fn is_ball_below_cone(corner: f64, taper: f64, diameter: f64) -> bool {
    if !(taper > 0.0 && taper < std::f64::consts::FRAC_PI_2) {
        return false;
    }
    let at_tip = 2.0 * corner * (1.0 / libm::cos(taper) - libm::tan(taper));
    let same = |cone: f64| (cone - diameter).abs() <= SAME_CONE.0 * diameter + SAME_CONE.1;
    corner > 0.5 * diameter && (same(at_tip) || same(2.0 * corner * libm::cos(taper)))
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
