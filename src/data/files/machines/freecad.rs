//! Machines as FreeCAD's CAM workbench keeps them: `.fcm`, JSON.
//!
//! ```text
//! machine.axes.NAME: type, role (table_rotary, head_rotary, …), parent (an axis, or the frame), sequence,
//!                    joint {origin, axis} or [origin, axis], limits {min, max}
//! ```
//!
//! Of two table axes the one about z carries the part, and turns on the other; of two head axes the one about z is on
//! the frame, and carries the other: so FreeCAD applies them, whatever their parents say, and an axis about z next to
//! the tool would turn nothing. Without an axis about z the root of the chain of parents is nearest to the part or the
//! tool, as in FreeCAD; on one parent the lesser `sequence` is. A linear axis along x, y or z is as long as its limits
//! are apart, if the file has metric units. Tool heads, output and post-processor are not used.

use super::REMEDY;
use crate::planning::setups::{Carrier, Fault, Kinematics, Machine, RotaryParams};
use crate::{Error, Result};
use glam::DVec3;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Deserialize)]
struct File {
    machine: Option<Described>,
}

#[derive(Deserialize)]
struct Described {
    name: Option<String>,
    units: Option<String>,
    #[serde(default)]
    axes: BTreeMap<String, Axis>,
    #[serde(default)]
    kinematics: Frame,
}

#[derive(Default, Deserialize)]
struct Frame {
    base_frame: Option<BaseFrame>,
}

#[derive(Deserialize)]
struct BaseFrame {
    /// x, y, z, w.
    orientation_quaternion: Option<[f64; 4]>,
}

#[derive(Deserialize)]
struct Axis {
    r#type: Option<String>,
    role: Option<String>,
    parent: Option<String>,
    #[serde(default)]
    sequence: i64,
    joint: Option<Joint>,
    limits: Option<Limits>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Joint {
    Named {
        axis: [f64; 3],
    },
    /// Origin, axis.
    Listed([[f64; 3]; 2]),
}

#[derive(Deserialize)]
struct Limits {
    min: f64,
    max: f64,
}

impl Axis {
    fn vector(&self) -> Option<[f64; 3]> {
        match self.joint {
            Some(Joint::Named { axis } | Joint::Listed([_, axis])) => Some(axis),
            None => None,
        }
    }

    /// Of a linear axis along x, y or z, 0 to 2: which one, and how long it is, mm. None if it is not known.
    fn stroke(&self) -> Option<(usize, f64)> {
        let Limits { min, max } = self.limits.as_ref()?;
        let along = DVec3::from_array(self.vector()?).try_normalize()?.abs();
        let k = (0..3).find(|k| along[*k] > 1.0 - TURNED)?;
        let stroke = max - min;
        (stroke > 0.0 && stroke.is_finite()).then_some((k, stroke))
    }
}

/// Greatest difference of a frame from the machine's own.
const TURNED: f64 = 1e-9;

pub(super) fn parse(text: &str, path: &Path) -> Result<Machine> {
    let refused =
        |place: String, found: String, remedy: &str| Err(Error::file(path, place, found, remedy));
    let file: File = serde_json::from_str(text).map_err(|e| {
        let words = e.to_string().replace('\n', ", ");
        Error::file(path, format!("line {}", e.line()), words, "save the machine in FreeCAD again")
    })?;
    let Some(machine) = file.machine else {
        return refused("file".into(), "no `machine`".into(), "name a machine of FreeCAD's CAM");
    };
    let turned = machine.kinematics.base_frame.and_then(|frame| frame.orientation_quaternion);
    if let Some([x, y, z, _]) = turned.filter(|q| q[..3].iter().any(|x| x.abs() > TURNED)) {
        let found = format!("a base frame turned by the quaternion {x}, {y}, {z}, …");
        let remedy = "give the axes in the machine's own frame, with the tool along +z";
        return refused("machine.kinematics.base_frame".into(), found, remedy);
    }
    let is_metric = machine.units.as_deref().is_none_or(|units| units == "metric");
    let mut strokes_mm = DVec3::INFINITY;
    let mut axes: Vec<(Carrier, usize, i64, RotaryParams)> = Vec::new();
    for (name, axis) in &machine.axes {
        let place = || format!("machine.axes.{name}");
        let carrier = match (axis.r#type.as_deref(), axis.role.as_deref()) {
            (Some("rotary"), Some("table_rotary") | None) => Carrier::Table,
            (Some("rotary"), Some("head_rotary")) => Carrier::Head,
            (Some("rotary"), Some(other)) => {
                let remedy = "give the role table_rotary or head_rotary";
                return refused(place(), format!("role is `{other}`"), remedy);
            }
            (Some("linear"), _) => {
                if let (true, Some((k, stroke))) = (is_metric, axis.stroke()) {
                    strokes_mm[k] = stroke;
                }
                continue;
            }
            (other, _) => {
                let found = format!("type is {}", other.map_or("missing".into(), quoted));
                return refused(place(), found, "give the type linear or rotary");
            }
        };
        let mut letters = name.chars();
        let (Some(letter), None) = (letters.next(), letters.next()) else {
            return refused(place(), quoted(name), "name rotary axes A, B or C");
        };
        let Some(about) = axis.vector() else {
            let remedy = "give joint.axis, a vector along the axis";
            return refused(place(), "no `joint`".into(), remedy);
        };
        let Some(depth) = depth(&machine.axes, name) else {
            let remedy = "give every axis the one it is mounted on, or null for the frame";
            return refused(place(), "a parent that leads to no frame".into(), remedy);
        };
        let limits_deg = axis.limits.as_ref().map(|Limits { min, max }| [*min, *max]);
        let params = RotaryParams { letter, on: carrier, axis: about, limits_deg };
        axes.push((carrier, depth, axis.sequence, params));
    }
    // From the part to the frame, from there to the tool.
    axes.sort_by_key(|(carrier, depth, sequence, params)| {
        let other = i64::from(!is_about_z(params.axis));
        let depth = *depth as i64;
        match carrier {
            Carrier::Table => (0, other, depth, *sequence),
            Carrier::Head => (1, other, -depth, -*sequence),
        }
    });
    let params: Vec<_> = axes.into_iter().map(|(.., params)| params).collect();
    let letters: Vec<char> = params.iter().map(|params| params.letter).collect();
    let name = machine.name.filter(|name| !name.trim().is_empty());
    let name =
        name.unwrap_or_else(|| path.file_stem().unwrap_or_default().to_string_lossy().into());
    let kinematics = Kinematics::new(&name, params);
    let machine = |axes: Kinematics| Machine::Axes(axes.with_strokes_mm(strokes_mm));
    kinematics.map(machine).map_err(|Fault { axis, key, found, remedy }| {
        let of = axis.and_then(|k| letters.get(k));
        let place = of.map_or(format!("machine.{key}"), |letter| format!("machine.axes.{letter}"));
        Error::file(path, place, found, if of.is_some() { remedy } else { REMEDY })
    })
}

/// Whether an axis is about z, by FreeCAD's measure.
fn is_about_z([x, y, z]: [f64; 3]) -> bool {
    const LEAST_COSINE: f64 = 0.9;
    z.abs() > LEAST_COSINE * x.hypot(y).hypot(z)
}

fn quoted(text: &str) -> String {
    format!("`{text}`")
}

/// Number of axes below an axis; none if its parents lead to no frame.
fn depth(axes: &BTreeMap<String, Axis>, name: &str) -> Option<usize> {
    let mut depth = 0;
    let mut axis = axes.get(name)?;
    while let Some(parent) = axis.parent.as_deref().filter(|parent| !parent.is_empty()) {
        axis = axes.get(parent)?;
        depth += 1;
        if depth > axes.len() {
            return None;
        }
    }
    Some(depth)
}
