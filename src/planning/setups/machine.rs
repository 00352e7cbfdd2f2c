//! Which tool axes a machine can take without clamping again.

use super::kinematics::Kinematics;
use crate::tool::directions::TurnLimits;
use crate::tool::directions::rotary::axis_of;
use crate::{Error, Result};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

/// A kind of machine.
///
/// ```
/// use deepmill::planning::setups::Machine;
/// let machine: Machine = "3+2:60".parse()?;
/// assert_eq!(machine.to_string(), "3+2:60");
/// assert!("3+2".parse::<Machine>().is_err(), "the greatest tilt is never guessed");
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Machine {
    /// The spindle is along z'.
    ThreeAxis,
    /// The spindle is fixed at angles within this of z' while it cuts.
    Indexed {
        /// Degrees, above 0, at most 180.
        tilt_deg: f64,
    },
    /// The part turns about a rotary axis, across the spindle.
    Rotary {
        /// The direction of the part along the rotary axis, of any length but zero; free if there is none.
        axis: Option<[f64; 3]>,
        /// How far the part turns, of a given axis; any angle if there are none.
        limits: Option<TurnLimits>,
    },
    /// The spindle tilts by as much as this from z' while it cuts.
    FiveAxis {
        /// Degrees, above 0, at most 180.
        tilt_deg: f64,
    },
    /// The tool axes that its rotary axes reach within their limits, each fixed while it cuts; a machine file
    /// describes them.
    Axes(Kinematics),
}

impl Machine {
    /// Whether tool axes are fixed while it cuts and there may be several in a setup.
    pub fn has_positions(&self) -> bool {
        match self {
            Machine::Indexed { .. } | Machine::Rotary { .. } => true,
            Machine::Axes(axes) => axes.n_axes() > 0,
            Machine::ThreeAxis | Machine::FiveAxis { .. } => false,
        }
    }

    /// The greatest angle of a tool axis from z', radians; none about a rotary axis. Of a machine file with rotary axes
    /// it is a half turn: each axis has its own limits.
    pub fn tilt_rad(&self) -> Option<f64> {
        match self {
            Machine::ThreeAxis => Some(0.0),
            Machine::Indexed { tilt_deg } | Machine::FiveAxis { tilt_deg } => {
                Some(tilt_deg.to_radians())
            }
            Machine::Rotary { .. } => None,
            Machine::Axes(axes) => Some(if axes.n_axes() > 0 { PI } else { 0.0 }),
        }
    }

    /// A setup in words, given by its direction.
    pub fn setup_words(&self, direction: Vec3) -> String {
        let words = direction_words(direction);
        match self {
            Machine::Rotary { .. } => format!("about {}", words.trim_start_matches('+')),
            _ => format!("{words} up"),
        }
    }

    /// The rotary axes of a machine file.
    #[doc(hidden)] // of the program
    pub fn axes(&self) -> Option<&Kinematics> {
        if let Machine::Axes(axes) = self { Some(axes) } else { None }
    }

    /// Whether the tool axes of a setup go around one rotary axis.
    #[cfg(all(feature = "formats", feature = "generate"))]
    pub(crate) fn is_of_one_axis(&self) -> bool {
        match self {
            Machine::Axes(axes) => axes.n_axes() == 1,
            _ => self.tilt_rad().is_none(),
        }
    }

    /// Whether the part is held along a rotary axis and lies on nothing.
    pub(crate) fn is_chucked(&self) -> bool {
        match self {
            Machine::Axes(axes) => axes.is_chucked(),
            _ => self.tilt_rad().is_none(),
        }
    }

    /// Whether every setup has the one tool axis z'.
    pub(super) fn is_upright(&self) -> bool {
        self.tilt_rad() == Some(0.0)
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Machine::ThreeAxis => write!(f, "3-axis"),
            Machine::Indexed { tilt_deg } => write!(f, "3+2:{tilt_deg}"),
            Machine::Rotary { axis: None, .. } => write!(f, "4-axis"),
            Machine::Rotary { axis: Some([x, y, z]), limits } => {
                write!(f, "4-axis:{x},{y},{z}")?;
                limits.iter().try_for_each(|limits| write!(f, ":{limits}"))
            }
            Machine::FiveAxis { tilt_deg } => write!(f, "5-axis:{tilt_deg}"),
            Machine::Axes(axes) => write!(f, "{axes}"),
        }
    }
}

/// Reads `3-axis`, `3+2:DEGREES`, `4-axis`, `4-axis:x` (`y`, `z`, `X,Y,Z`), `4-axis:x:LOW,HIGH` (degrees),
/// `5-axis:DEGREES`.
impl FromStr for Machine {
    type Err = Error;

    /// # Errors
    /// If the text has none of these forms, a tilt is not above 0 and at most 180 degrees, or an axis has no length.
    fn from_str(text: &str) -> Result<Self> {
        let (kind, rest) = text.split_once(':').map_or((text, None), |(a, b)| (a, Some(b)));
        let tilt = || rest.and_then(|t| t.parse().ok()).filter(|t| *t > 0.0 && *t <= 180.0);
        let machine = match (kind, rest) {
            ("3-axis", None) => Some(Machine::ThreeAxis),
            ("3+2", _) => tilt().map(|tilt_deg| Machine::Indexed { tilt_deg }),
            ("5-axis", _) => tilt().map(|tilt_deg| Machine::FiveAxis { tilt_deg }),
            ("4-axis", None) => Some(Machine::Rotary { axis: None, limits: None }),
            ("4-axis", Some(rest)) => {
                let (axis, limits) =
                    rest.split_once(':').map_or((rest, None), |(a, b)| (a, Some(b)));
                let limits = limits.map(|limits| limits.parse::<TurnLimits>()).transpose()?;
                axis_of(axis).map(|axis| Machine::Rotary { axis: Some(axis), limits })
            }
            _ => None,
        };
        machine.ok_or_else(|| {
            let expected = "3-axis, 3+2:DEGREES, 4-axis, 4-axis:x (y, z or X,Y,Z), 4-axis:x:LOW,HIGH or 5-axis:DEGREES";
            let remedy = "give the machine's greatest tilt from its z axis, above 0 and at most 180, as in 3+2:60";
            Error::argument("machine", format!("`{text}`"), expected, remedy)
        })
    }
}

/// `+z`, `-x`, or three numbers.
pub fn direction_words(direction: Vec3) -> String {
    for (k, name) in ["x", "y", "z"].into_iter().enumerate() {
        if direction[k].abs() > 1.0 - 1e-6 {
            return format!("{}{name}", if direction[k] > 0.0 { '+' } else { '-' });
        }
    }
    // Never minus zero.
    let [x, y, z] = direction.to_array().map(|x| (1e3 * x).round() / 1e3 + 0.0);
    format!("{x}, {y}, {z}")
}

/// Reads `+z`, `z`, `-x` or `X,Y,Z`.
///
/// # Errors
/// If the text is none of these, or the vector has no length.
pub fn direction_of_words(text: &str) -> Result<Vec3> {
    let text = text.trim();
    let (sign, name) = match text.strip_prefix('-') {
        Some(name) if name.len() == 1 => (-1.0, name),
        _ => (1.0, text.strip_prefix('+').unwrap_or(text)),
    };
    let axis = axis_of(name).ok_or_else(|| {
        let expected = "+z, -z, +x, -x, +y, -y or X,Y,Z";
        Error::argument("direction", format!("`{text}`"), expected, "write for example +z")
    })?;
    Ok((sign * glam::DVec3::from_array(axis).normalize()).as_vec3())
}

/// What lies as low as this above the lowest place is what the part lies on, mm.
pub(crate) const LOWEST_MM: f64 = 0.01;
/// If its normal is as near to straight down as this, radians.
pub(crate) const DOWN_RAD: f64 = std::f64::consts::PI / 180.0;

/// Radians between unit vectors.
pub(super) fn angle(a: Vec3, b: Vec3) -> f64 {
    let (a, b) = (a.as_dvec3(), b.as_dvec3());
    libm::atan2(a.cross(b).length(), a.dot(b)).min(PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn machines_are_read_and_written_again() {
        for text in
            ["3-axis", "3+2:60", "4-axis", "4-axis:0,1,0.5", "4-axis:1,0,0:-30,90.5", "5-axis:33.3"]
        {
            assert_eq!(text.parse::<Machine>().unwrap().to_string(), text);
        }
        let refused = "4-axis:x:90,-30".parse::<Machine>().unwrap_err().to_string();
        assert!(refused.contains("90,-30") && refused.contains("4-axis:x:-30,90"), "{refused}");
        for text in ["-30", "-30,90,5", "-30,", "low,high"] {
            let refused = format!("4-axis:x:{text}").parse::<Machine>().unwrap_err().to_string();
            assert!(refused.contains(&format!("is `{text}`, expected LOW,HIGH")), "{refused}");
        }
        assert_eq!("4-axis:y".parse::<Machine>().unwrap().to_string(), "4-axis:0,1,0");
        for text in [
            "",
            "3",
            "3-axis:5",
            "3+2:0",
            "3+2:181",
            "3+2:NaN",
            "5-axis",
            "4-axis:w",
            "4-axis:0,0,0",
            "4-axis:1,2",
        ] {
            let message = text.parse::<Machine>().unwrap_err().to_string();
            assert!(message.starts_with("machine is `") && message.contains("3+2:60"), "{message}");
        }
    }

    #[test]
    fn directions_have_the_names_of_the_box() {
        let words = [Vec3::Z, Vec3::NEG_X, Vec3::new(0.6, -0.0, 0.8)].map(direction_words);
        assert_eq!(words, ["+z", "-x", "0.6, 0, 0.8"]);
        for (text, expected) in
            [("+z", Vec3::Z), ("-x", Vec3::NEG_X), ("y", Vec3::Y), ("-0,0,-2", Vec3::NEG_Z)]
        {
            assert_eq!(direction_of_words(text).unwrap(), expected, "{text}");
        }
        for text in ["", "up", "-", "0,0,0", "1,2"] {
            let message = direction_of_words(text).unwrap_err().to_string();
            assert!(message.starts_with("direction is"), "{message}");
        }
        let machine = Machine::Rotary { axis: None, limits: None };
        assert_eq!(machine.setup_words(Vec3::X), "about x");
        assert_eq!(Machine::ThreeAxis.setup_words(Vec3::NEG_Y), "-y up");
    }
}
