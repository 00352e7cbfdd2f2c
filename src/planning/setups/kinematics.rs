//! Rotary axes of a machine: from angles to the tool axis, and back in closed form.
//!
//! Coordinates are those of the machine at home: the tool axis is +z. Axes are in the order of the chain from the part
//! to the tool: table axes from the part outward, then head axes from the frame to the tool. A head axis turns the tool
//! by its angle, a table axis the part, which is the tool by the opposite angle. With a unit vector `k` per axis,
//! negated for a table, the tool axis in the part is `t = R(k₁, θ₁) R(k₂, θ₂) z`.
//!
//! Back: `w = R(k₂, θ₂) z` has `w·k₂ = z·k₂` and `w·k₁ = t·k₁`, so `w = a k₁ + b k₂ ± g k₁×k₂` (Paden and Kahan's
//! second subproblem). Each sign with a real `g` gives θ₂ from z to `w` about `k₂` and θ₁ from `w` to `t` about `k₁`.

mod stated;

use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};
use stated::Stated;
use std::fmt;

/// What a rotary axis turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Carrier {
    /// The part.
    Table,
    /// The tool.
    Head,
}

/// A rotary axis as it is given.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RotaryParams {
    /// `A`, `B` or `C`.
    pub letter: char,
    /// What it turns.
    pub on: Carrier,
    /// At home, of any length but zero: a positive angle turns what it carries right-handed about it.
    pub axis: [f64; 3],
    /// Least and greatest angle, degrees; any angle if there are none.
    pub limits_deg: Option<[f64; 2]>,
}

impl RotaryParams {
    /// That turns by any angle.
    pub fn new(letter: char, on: Carrier, axis: [f64; 3]) -> Self {
        RotaryParams { letter, on, axis, limits_deg: None }
    }

    /// From the least to the greatest angle, degrees.
    #[must_use]
    pub fn with_limits_deg(self, limits: [f64; 2]) -> Self {
        RotaryParams { limits_deg: Some(limits), ..self }
    }
}

/// A checked machine: at most two rotary axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(into = "Stated", try_from = "Stated")]
pub struct Kinematics {
    name: String,
    axes: Vec<RotaryAxis>,
    /// How far the linear axes go; infinite if it is not known.
    strokes_mm: DVec3,
}

#[derive(Debug, Clone, PartialEq)]
struct RotaryAxis {
    letter: char,
    on: Carrier,
    /// Unit length; a positive angle turns the tool against the part about it.
    about: DVec3,
    /// Infinite if there are none.
    limits_deg: [f64; 2],
}

/// What is wrong with a machine, at which key of which axis.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Fault {
    /// Number of the axis, from 0; none if it is the name.
    pub axis: Option<usize>,
    /// As a file calls it.
    pub key: &'static str,
    /// What was found.
    pub found: String,
    /// What the user can do.
    pub remedy: &'static str,
}

/// Directions as near as this are one, and angles as little as this beyond a limit are at it, radians: tool axes are
/// kept in single precision.
const ROUNDING_RAD: f64 = 1e-6;
/// Axes whose angle has a smaller sine are parallel.
const PARALLEL: f64 = 1e-3;
/// Greatest limit, degrees: a hundred turns.
const MOST_DEG: f64 = 36_000.0;

impl Kinematics {
    /// Checks a machine.
    ///
    /// # Errors
    /// If the name is empty or has control characters, there are more than two axes, a letter is no `A`, `B` or `C` or
    /// is there twice, a head axis comes before a table axis, a vector has no length, limits are not in order or
    /// beyond a hundred turns, or two axes are parallel.
    pub fn new(name: &str, params: Vec<RotaryParams>) -> Result<Self, Fault> {
        let fault = |axis, key, found, remedy| Err(Fault { axis, key, found, remedy });
        if name.trim().is_empty() || name.chars().any(char::is_control) {
            let found = format!("{name:?} is no name");
            return fault(None, "name", found, "write one line, for example name = \"trunnion\"");
        }
        if params.len() > 2 {
            let letters: Vec<String> = params.iter().map(|p| p.letter.to_string()).collect();
            let found = format!("{} rotary axes: {}", params.len(), letters.join(", "));
            let remedy =
                "give at most two: two set every tool axis, a third has no angle of its own";
            return fault(Some(2), "letter", found, remedy);
        }
        let mut axes: Vec<RotaryAxis> = Vec::new();
        for (k, RotaryParams { letter, on, axis, limits_deg }) in params.into_iter().enumerate() {
            let fault = |key, found, remedy| fault(Some(k), key, found, remedy);
            if !matches!(letter, 'A' | 'B' | 'C') {
                return fault("letter", format!("`{letter}`"), "write A, B or C");
            }
            if axes.iter().any(|other| other.letter == letter) {
                return fault("letter", format!("{letter} twice"), "give each axis its own letter");
            }
            if on == Carrier::Table && axes.iter().any(|other| other.on == Carrier::Head) {
                let found = format!("table axis {letter} after a head axis");
                let remedy = "list the axes from the part to the tool: those of the table first";
                return fault("on", found, remedy);
            }
            // Scaled first: squares of great numbers are infinite.
            let axis = DVec3::from_array(axis);
            let most = axis.abs().max_element();
            if !axis.is_finite() || most < 1e-9 {
                let [x, y, z] = axis.to_array();
                let remedy = "give a vector along it, for example axis = [1, 0, 0]";
                return fault("axis", format!("the vector {x}, {y}, {z}"), remedy);
            }
            let unit = (axis / most).normalize();
            if let Some([low, high]) = limits_deg {
                let is_angle = |x: f64| x.abs() <= MOST_DEG;
                if !(is_angle(low) && is_angle(high) && low <= high) {
                    let remedy = "give the least and then the greatest angle, degrees, within 36000; \
                                  leave limits out for any angle";
                    return fault("limits", format!("limits {low}, {high}"), remedy);
                }
            }
            if let Some(other) = axes.iter().find(|a| a.about.cross(unit).length() < PARALLEL) {
                let found = format!("{letter} is parallel to {}", other.letter);
                let remedy = "leave one of them out, or correct its vector";
                return fault("axis", found, remedy);
            }
            let about = if on == Carrier::Table { -unit } else { unit };
            let limits_deg = limits_deg.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            axes.push(RotaryAxis { letter, on, about, limits_deg });
        }
        Ok(Kinematics { name: name.trim().into(), axes, strokes_mm: DVec3::INFINITY })
    }

    /// With linear axes that go no farther than this along x, y and z, mm each; infinite if it is not known.
    #[must_use]
    pub fn with_strokes_mm(self, strokes_mm: DVec3) -> Self {
        Kinematics { strokes_mm, ..self }
    }

    /// How far its linear axes go along x, y and z, mm each; infinite if it is not known.
    pub fn strokes_mm(&self) -> DVec3 {
        self.strokes_mm
    }

    /// Letters of the axes, in their order.
    pub fn letters(&self) -> impl Iterator<Item = char> + '_ {
        self.axes.iter().map(|axis| axis.letter)
    }

    /// Number of rotary axes.
    pub fn n_axes(&self) -> usize {
        self.axes.len()
    }

    /// Whether the part is held along one rotary axis across the spindle, as in the chuck of a dividing head: it lies
    /// on nothing.
    pub fn is_chucked(&self) -> bool {
        let [RotaryAxis { on: Carrier::Table, about, .. }] = &self.axes[..] else { return false };
        about.z.abs() < PARALLEL
    }

    /// The tool axis at these angles, degrees, whatever the limits are.
    ///
    /// # Panics
    /// If there is not one angle per axis.
    pub fn tool_axis(&self, angles_deg: &[f64]) -> DVec3 {
        assert_eq!(angles_deg.len(), self.axes.len(), "one angle per axis");
        let mut tool = DVec3::Z;
        for (axis, degrees) in self.axes.iter().zip(angles_deg).rev() {
            tool = turned(axis.about, degrees.to_radians(), tool);
        }
        tool
    }

    /// Every way to set a tool axis within the limits: for each an angle per axis, degrees. There are at most two; the
    /// first has the smaller sum of angles without their signs, of equal sums the greater angle of the last axis.
    ///
    /// Of angles that differ by full turns the one nearest to 0 is given. Where an axis may have any angle, since it
    /// does not move the tool axis, it has the one nearest to 0.
    pub fn poses(&self, tool_axis: DVec3) -> Vec<Vec<f64>> {
        let Some(tool) = tool_axis.try_normalize() else { return Vec::new() };
        let mut found: Vec<Vec<f64>> = Vec::new();
        for radians in self.solutions(tool) {
            let known = radians.iter().map(|turn| turn.unwrap_or(0.0).to_degrees());
            if (self.tool_axis(&known.collect::<Vec<f64>>()) - tool).length() > ROUNDING_RAD {
                continue;
            }
            let angles = self.axes.iter().zip(&radians).map(|(axis, turn)| axis.within(*turn));
            let Some(angles) = angles.collect::<Option<Vec<f64>>>() else { continue };
            let is_same = |other: &Vec<f64>| {
                let near = |(a, b): (&f64, &f64)| (a - b).abs() < ROUNDING_RAD.to_degrees();
                other.iter().zip(&angles).all(near)
            };
            if !found.iter().any(is_same) {
                found.push(angles);
            }
        }
        let sum = |angles: &[f64]| angles.iter().map(|x| x.abs()).sum::<f64>();
        if let [first, second] = &found[..] {
            let (more, rounding) = (sum(second) - sum(first), ROUNDING_RAD.to_degrees());
            // Of equal sums: the last axis to its positive side.
            if more < -rounding || more < rounding && second.last() > first.last() {
                found.swap(0, 1);
            }
        }
        found
    }

    /// For every way to set a tool axis, how the rotary axes have turned the part.
    pub(super) fn part_turns(&self, tool_axis: DVec3) -> impl Iterator<Item = DMat3> + '_ {
        let turn = |angles: Vec<f64>| {
            let of_table =
                self.axes.iter().zip(angles).filter(|(axis, _)| axis.on == Carrier::Table);
            // A table axis turns the part against what it turns the tool.
            of_table.fold(DMat3::IDENTITY, |turn, (axis, degrees)| {
                let axes = [DVec3::X, DVec3::Y, DVec3::Z];
                let [x, y, z] = axes.map(|v| turned(-axis.about, degrees.to_radians(), turn * v));
                DMat3::from_cols(x, y, z)
            })
        };
        self.poses(tool_axis).into_iter().map(turn)
    }

    /// Whether there is such a way.
    pub(super) fn reaches(&self, tool_axis: DVec3) -> bool {
        !self.poses(tool_axis).is_empty()
    }

    /// Of the first axis: multiples of a full turn over `n_per_turn` within the limits, and the limits, degrees.
    pub(super) fn angles_deg(&self, n_per_turn: usize) -> Vec<f64> {
        let step = 360.0 / n_per_turn.max(1) as f64;
        match self.axes.first().map(|axis| axis.limits_deg) {
            Some([low, high]) if high - low < 360.0 => {
                let multiples = (low / step).ceil() as i64..=(high / step).floor() as i64;
                let mut angles = vec![low];
                angles.extend(multiples.map(|k| k as f64 * step));
                angles.push(high);
                angles
            }
            _ => (0..n_per_turn).map(|k| k as f64 * step).collect(),
        }
    }

    /// Angles that may reach `tool`, radians; none for an axis that does not matter.
    fn solutions(&self, tool: DVec3) -> Vec<Vec<Option<f64>>> {
        match &self.axes[..] {
            [] => vec![Vec::new()],
            [only] => vec![vec![angle_about(only.about, DVec3::Z, tool)]],
            [first, second, ..] => {
                let (k1, k2) = (first.about, second.about);
                // A tool axis along the first axis is so exactly, else rounding would choose its angle.
                let along = k1 * k1.dot(tool).signum();
                let tool = if (tool - along).length() < ROUNDING_RAD { along } else { tool };
                images(k1, k2, tool).map(|image| Self::angles_by(k1, k2, image, tool)).into()
            }
        }
    }

    /// `image`: where the second axis turns z to.
    fn angles_by(k1: DVec3, k2: DVec3, image: DVec3, tool: DVec3) -> Vec<Option<f64>> {
        let second = angle_about(k2, DVec3::Z, image);
        let image = turned(k2, second.unwrap_or(0.0), DVec3::Z);
        vec![angle_about(k1, image, tool), second]
    }
}

/// The two vectors whose angle to `k2` is that of z and to `k1` that of `tool`; where there are none, the nearest.
fn images(k1: DVec3, k2: DVec3, tool: DVec3) -> [DVec3; 2] {
    let (c, p, q) = (k1.dot(k2), k1.dot(tool), k2.z);
    let normal = k1.cross(k2);
    let s2 = normal.length_squared();
    // 1 − p² and 1 − q² by cross products: without cancellation near singular poses.
    let product = k1.cross(tool).length_squared() * k2.cross(DVec3::Z).length_squared();
    let across = (product - (p * q - c) * (p * q - c)).max(0.0).sqrt() / s2;
    let middle = k1 * ((p - c * q) / s2) + k2 * ((q - c * p) / s2);
    [middle + normal * across, middle - normal * across]
}

/// Radians by which `from` turns right-handed about a unit axis until it is over `to`; none if one is along the axis.
fn angle_about(axis: DVec3, from: DVec3, to: DVec3) -> Option<f64> {
    let (a, b) = (from - axis * axis.dot(from), to - axis * axis.dot(to));
    let matters = a.length().min(b.length()) > 0.5 * ROUNDING_RAD;
    matters.then(|| libm::atan2(axis.dot(a.cross(b)), a.dot(b)))
}

fn turned(axis: DVec3, radians: f64, v: DVec3) -> DVec3 {
    let half = 0.5 * radians;
    let sine = axis * libm::sin(half);
    DQuat::from_xyzw(sine.x, sine.y, sine.z, libm::cos(half)) * v
}

impl RotaryAxis {
    /// The angle within the limits, degrees: of those that differ by full turns, or of all if it does not matter, the
    /// one nearest to 0, of two the positive one.
    fn within(&self, radians: Option<f64>) -> Option<f64> {
        let [low, high] = self.limits_deg;
        let Some(radians) = radians else { return Some(0.0_f64.clamp(low, high)) };
        let (rounding, angle) = (ROUNDING_RAD.to_degrees(), radians.to_degrees());
        let least = ((low - rounding - angle) / 360.0).ceil();
        let most = ((high + rounding - angle) / 360.0).floor();
        if least > most {
            return None;
        }
        // Half a turn is +180 where it may be, on whichever side of it rounding puts the angle.
        let turns = ((rounding - angle) / 360.0 + 0.5).floor().clamp(least, most);
        Some((angle + 360.0 * turns).clamp(low, high))
    }
}

/// The name and the axes: `Trunnion (table C, table A -120..30)`.
impl fmt::Display for Kinematics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.name)?;
        for (k, axis) in self.axes.iter().enumerate() {
            let on = if axis.on == Carrier::Table { "table" } else { "head" };
            write!(f, "{}{on} {}", if k == 0 { " (" } else { ", " }, axis.letter)?;
            let [low, high] = axis.limits_deg;
            if low.is_finite() {
                write!(f, " {low}..{high}")?;
            }
        }
        if self.axes.is_empty() { Ok(()) } else { write!(f, ")") }
    }
}

/// Precession, nutation and rotation, degrees, of the tilted plane whose z'' is along `tool_axis`: intrinsic turns
/// about Z, X' and Z''. The last is 0, and so is the first where the plane is not tilted.
pub fn plane_euler_deg(tool_axis: DVec3) -> [f64; 3] {
    let across = tool_axis.truncate().length();
    let nutation = libm::atan2(across, tool_axis.z);
    let is_tilted = across > ROUNDING_RAD * tool_axis.length();
    let precession = if is_tilted { libm::atan2(tool_axis.x, -tool_axis.y) } else { 0.0 };
    [precession.to_degrees(), nutation.to_degrees(), 0.0]
}

#[cfg(test)]
mod tests;
