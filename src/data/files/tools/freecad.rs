//! FreeCAD tool bits (`.fctb`): JSON with one tool, lengths as texts with a unit; and libraries (`.fctl`) of
//! them.

use super::MissingParameters;
use super::described::{Cone, Described, Family, Form};
use super::place::{Place, shown, shown_value};
use super::reading::Reading;
use crate::Result;
use crate::geom::units::length::{Length, decimal, split};
use crate::tool::cutter::Crest;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A tool bit that a library names.
pub(super) struct Bit {
    pub number: Option<u32>,
    pub path: String,
}

/// The bits of a library, if this is one.
pub(super) fn bits(value: &Value) -> Option<Vec<Bit>> {
    let tools = value.get("tools")?.as_array()?;
    let bit = |tool: &Value| {
        let number = tool.get("nr").and_then(Value::as_u64).and_then(|n| u32::try_from(n).ok());
        let path = tool.get("path").and_then(Value::as_str).map(str::to_string)?;
        Some(Bit { number, path })
    };
    let bits: Vec<Bit> = tools.iter().filter_map(bit).collect();
    (!bits.is_empty() || tools.is_empty() && value.get("data").is_none()).then_some(bits)
}

/// The file of a bit: where the library says, beside it, or in the folder `Bit` beside it or its folder.
pub(super) fn find(bit: &str, library: &Path) -> Option<PathBuf> {
    let bit = PathBuf::from(bit.replace('\\', "/"));
    let here = library.parent().unwrap_or(Path::new(""));
    let above = match here.file_name() {
        Some(_) => here.parent().unwrap_or(Path::new("")).to_path_buf(),
        None => here.join(".."),
    };
    let name = bit.file_name().map(PathBuf::from).unwrap_or_default();
    let places = [here.to_path_buf(), here.join("Bit"), above.join("Bit"), above];
    let mut files = places.iter().flat_map(|place| [place.join(&bit), place.join(&name)]);
    files.find(|file| file.is_file())
}

pub(super) fn read(value: &Value, path: &Path, defaults: &MissingParameters) -> Reading {
    let word = |key: &str| value.get(key).and_then(Value::as_str).filter(|w| !w.trim().is_empty());
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = word("name").or(word("label")).map(str::to_string).or(stem).unwrap_or_default();
    let label = format!("tool {}", shown(&name));
    let place = Place { path, name: &label };
    let mut reading = Reading::default();
    let shapes: Vec<&str> = [word("shape-type"), word("shape")].into_iter().flatten().collect();
    let Some(first) = shapes.first() else {
        let found = "neither shape-type nor shape is there";
        reading.add(Err(place.error(found, "save the tool bit again")));
        return reading;
    };
    let parameters = value.get("parameter").unwrap_or(&Value::Null);
    let bit = Parameters { parameters, place: &place, defaults };
    match shapes.iter().find_map(|shape| shape_of(shape)) {
        None => reading.leave_out_kind(place.error(
            format!(
                "the shape {} cannot be represented, only end mills (ball, bull nose, flat, tapered), {FAMILIES}",
                shown(first)
            ),
            "it is left out",
        )),
        Some(shape) => {
            let described = bit.described(name.clone(), shape);
            reading.add(described.and_then(|described| described.tool(defaults, &place)));
            if shape == Shape::ThreadMill && parameters.get("cuttingAngle").is_none() {
                let found = "its cuttingAngle is missing: 60° counts, as in FreeCAD's shape";
                reading.notices.push(place.sentence(found));
            }
        }
    }
    reading
}

/// Shapes beside end mills.
const FAMILIES: &str = "dovetail, chamfer, radius and thread mills, V-bits, slitting saws, T-slot cutters, \
     lollipops, drills and reamers";

#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    Flat,
    Ball,
    Bull,
    TaperedBall,
    Dovetail,
    Chamfer,
    VBit,
    Radius,
    ThreadMill,
    Saw,
    Slot,
    Lollipop,
    Drill,
    Reamer,
}

/// `Shapes/Ball-End.FCStd`, `_fusion_ball_end_mill.fcstd` and `BallEnd` are the same: versions and add-ons differ.
fn shape_of(shape: &str) -> Option<Shape> {
    let file = shape.rsplit(['/', '\\']).next().unwrap_or(shape).to_ascii_lowercase();
    let stem = file.strip_suffix(".fcstd").unwrap_or(&file);
    let letters: String = stem.chars().filter(|c| c.is_ascii_alphanumeric()).collect();
    let letters = letters.strip_prefix("fusion").unwrap_or(&letters);
    let letters = letters.strip_prefix("toolbit").unwrap_or(letters);
    // `ballendmill`, `ballnosemill` → `ballend`, `ballnose`; `endmill` is `end`.
    match letters.strip_suffix("mill").unwrap_or(letters) {
        "end" | "flatend" | "flat" | "squareend" | "square" => Some(Shape::Flat),
        "ballend" | "ballnose" | "ball" | "ballnoseend" => Some(Shape::Ball),
        "bullnose" | "bullnoseend" | "bullend" | "bull" | "torus" => Some(Shape::Bull),
        "taperedballnose" | "taperballnose" | "conicalballnose" | "taperedball" | "taperball"
        | "conicalball" | "taperedballend" | "taperballend" | "taperedballnoseend" => {
            Some(Shape::TaperedBall)
        }
        "dovetail" => Some(Shape::Dovetail),
        "chamfer" => Some(Shape::Chamfer),
        "vbit" => Some(Shape::VBit),
        "radius" | "fillet" | "cornerrounding" | "rounding" => Some(Shape::Radius),
        "thread" => Some(Shape::ThreadMill),
        "slittingsaw" | "saw" => Some(Shape::Saw),
        "tslot" | "tslotcutter" | "slot" | "keyseat" | "keyseatcutter" | "woodruff" => {
            Some(Shape::Slot)
        }
        "lollipop" => Some(Shape::Lollipop),
        "drill" => Some(Shape::Drill),
        "reamer" => Some(Shape::Reamer),
        _ => None,
    }
}

/// Half of the angle of metric and unified threads, that of FreeCAD's shape.
const ISO_THREAD_RAD: f64 = std::f64::consts::FRAC_PI_6;

struct Parameters<'a> {
    parameters: &'a Value,
    place: &'a Place<'a>,
    defaults: &'a MissingParameters,
}

impl Parameters<'_> {
    fn described(&self, name: String, shape: Shape) -> Result<Described> {
        let diameter = self.length("Diameter")?.filter(|d| *d > 0.0);
        let diameter = diameter.ok_or_else(|| self.missing("Diameter"))?;
        let form = match shape {
            Shape::Flat => Form::Flat,
            Shape::Ball => Form::Ball,
            Shape::TaperedBall => {
                // The file has the whole angle of the cone.
                let whole = self.angle("TaperAngle")?.ok_or_else(|| self.missing("TaperAngle"))?;
                Form::Tapered { corner: 0.5 * diameter, taper: 0.5 * whole }
            }
            Shape::Bull => Form::Bull { corner: self.corner(diameter)? },
            shape => Form::Family(self.family(shape, diameter)?),
        };
        let positive = |key: &str| self.length(key).map(|length| length.filter(|x| *x > 0.0));
        let edge = positive("CuttingEdgeHeight")?;
        let flutes = match form {
            // Its edge goes on above the cone.
            Form::Family(Family::Cone { kind: Cone::VBit, tip, angle }) => {
                edge.map(|edge| 0.5 * (diameter - tip) / libm::tan(angle) + edge)
            }
            Form::Family(Family::Cone { .. }) => None,
            Form::Family(Family::Saw { .. }) => positive("BladeThickness")?,
            Form::Family(Family::Slot { .. }) => edge.or(positive("BladeThickness")?),
            // The crown is a cylinder above the arc.
            Form::Family(Family::Rounding { arc, .. }) => match positive("CrownHeight")? {
                Some(crown) => Some(arc + crown),
                None => edge,
            },
            _ => edge,
        };
        let neck_height = positive("NeckHeight")?;
        let neck_end = match positive("NeckLength")? {
            Some(end) if shape == Shape::ThreadMill => Some(end),
            _ => edge.zip(neck_height).map(|(edge, neck)| edge + neck),
        };
        Ok(Described {
            flutes,
            neck: positive("NeckDiameter")?,
            neck_end,
            shank: positive("ShankDiameter")?,
            taper_end: positive("TaperDiameter")?,
            overall: positive("Length")?,
            unit_mm: self.written_in("Diameter")?,
            ..Described::new(name, form, diameter)
        })
    }

    /// The family of a shape that is no end mill.
    fn family(&self, shape: Shape, diameter: f64) -> Result<Family> {
        let or_none = |key: &str| self.length(key).map(|length| length.unwrap_or(0.0));
        let needed = |key: &str| {
            let length = self.length(key)?.filter(|length| *length > 0.0);
            length.ok_or_else(|| self.missing(key))
        };
        Ok(match shape {
            // From the face below.
            Shape::Dovetail => Family::Dovetail {
                angle: std::f64::consts::FRAC_PI_2 - self.edge_angle()?,
                corner: or_none("CornerRadius")?,
            },
            // The whole angle of the cone.
            Shape::Chamfer | Shape::VBit => Family::Cone {
                kind: if shape == Shape::VBit { Cone::VBit } else { Cone::Chamfer },
                tip: or_none("TipDiameter")?,
                angle: 0.5 * self.edge_angle()?,
            },
            // Of `fillet` other words: the arc goes up to the whole diameter, below a crown.
            Shape::Radius if self.is_fillet() => {
                let arc = needed("FilletRadius")?;
                self.length("CrownHeight")?.ok_or_else(|| self.missing("CrownHeight"))?;
                let tip = diameter - 2.0 * arc;
                if tip < 0.0 {
                    let found = format!("FilletRadius {arc} mm on a Diameter of {diameter} mm");
                    let remedy = "the arc is no wider than the radius: correct one of them";
                    return Err(self.place.error(found, remedy));
                }
                Family::Rounding { tip, tip_height: 0.0, arc }
            }
            Shape::Radius => {
                let arc = needed("CuttingRadius")?;
                let tip = self.length("TipDiameter")?;
                let tip = tip.unwrap_or(diameter - 2.0 * arc);
                if tip < 0.0 {
                    return Err(self.missing("TipDiameter"));
                }
                Family::Rounding { tip, tip_height: 0.0, arc }
            }
            Shape::ThreadMill => Family::Thread {
                angle: self.angle("cuttingAngle")?.map_or(ISO_THREAD_RAD, |whole| 0.5 * whole),
                crest: Crest::Flat(or_none("Crest")?),
                root: needed("NeckDiameter")?,
                pitch: 0.0,
                n_rings: 1,
            },
            Shape::Saw => Family::Saw { cap: [or_none("CapDiameter")?, or_none("CapHeight")?] },
            Shape::Slot => Family::Slot { corner: or_none("CornerRadius")? },
            Shape::Drill => {
                let whole = self.angle("TipAngle")?.ok_or_else(|| self.missing("TipAngle"))?;
                Family::Drill { angle: 0.5 * whole }
            }
            Shape::Reamer => Family::Reamer,
            _ => Family::Lollipop,
        })
    }

    /// Whether a corner rounding mill has the parameters of FreeCAD's shape `fillet`.
    fn is_fillet(&self) -> bool {
        let has = |key: &str| self.parameters.get(key).is_some_and(|value| !value.is_null());
        has("FilletRadius") && !has("CuttingRadius")
    }

    fn edge_angle(&self) -> Result<f64> {
        self.angle("CuttingEdgeAngle")?.ok_or_else(|| self.missing("CuttingEdgeAngle"))
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
        let Some(text) = self.text(key)? else { return Ok(None) };
        let Some(length) = Length::read(&text) else {
            return Err(match split(&text).filter(|(number, _)| decimal(number).is_some()) {
                Some((_, unit)) => self.bad_unit(key, &text, &unit, "mm or in"),
                None => self.bad(key, &text),
            });
        };
        let unit = match self.defaults.unit_mm {
            Some(unit) => unit,
            None if length.has_unit() => 1.0,
            None => {
                let found = format!("{key} is {}, without a unit", shown(&text));
                let remedy = "write for example \"6 mm\", or give a unit with `unit_mm` in a program, or --tool-unit mm or in";
                return Err(self.place.error(found, remedy));
            }
        };
        self.place.not_negative(key, length.mm_of(unit)).map(Some)
    }

    /// Millimeters of the unit that a length is written in.
    fn written_in(&self, key: &str) -> Result<f64> {
        let length = self.text(key)?.and_then(|text| Length::read(&text));
        let bare = self.defaults.unit_mm.unwrap_or(1.0);
        Ok(length.map_or(bare, |length| length.unit_or(bare)))
    }

    fn angle(&self, key: &str) -> Result<Option<f64>> {
        let Some(text) = self.text(key)? else { return Ok(None) };
        let found = split(&text).and_then(|(number, unit)| Some((decimal(&number)?, unit)));
        let (x, unit) = found.ok_or_else(|| self.bad(key, &text))?;
        let x = self.place.not_negative(key, x)?;
        match unit.as_str() {
            "°" | "deg" => Ok(Some(x.to_radians())),
            "rad" => Ok(Some(x)),
            unit => Err(self.bad_unit(key, &text, unit, "° or rad")),
        }
    }

    fn bad(&self, key: &str, text: &str) -> crate::Error {
        let found = format!("{key} is {}, not a length or angle", shown(text));
        self.place.error(found, "write for example \"6 mm\" or \"1/4 in\"")
    }

    fn bad_unit(&self, key: &str, text: &str, unit: &str, expected: &str) -> crate::Error {
        let found = format!("{key} is {}: the unit of {key} is {}", shown(text), shown(unit));
        self.place.error(found, format!("expected {expected}: correct it"))
    }

    /// A parameter as a text.
    fn text(&self, key: &str) -> Result<Option<String>> {
        match self.parameters.get(key) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::String(text)) => Ok(Some(text.trim().into())),
            Some(Value::Number(number)) => Ok(Some(number.to_string())),
            Some(value) => Err(self.bad(key, &shown_value(value))),
        }
    }
}
