//! Tool axes about a rotary axis whose turn is limited.

use super::{DirectionSet, basis};
use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;

/// Directions about an axis that are tested if no number is given.
const AROUND: usize = 72;

/// From where to where the tool axis may be about a rotary axis, degrees: 0 is +z (for an axis along z: +x) as near as
/// it is across the axis; positive angles turn right-handed about the axis.
///
/// ```
/// use deepmill::directions::{Directions, TurnLimits};
/// use deepmill::glam::Vec3;
///
/// assert_eq!(TurnLimits::new(-30.0, 90.0)?.to_string(), "-30,90");
/// let directions: Directions = "4-axis:x:-30,90".parse()?;
/// let (first, last) = (directions.vectors()[0], directions.vectors()[directions.len() - 1]);
/// assert!(first.distance(Vec3::new(0.0, 0.5, 0.75_f32.sqrt())) < 1e-6); // 30 degrees before +z
/// assert!(last.distance(Vec3::NEG_Y) < 1e-6); // about +x, +z turns to -y
/// let error = TurnLimits::new(-200.0, 200.0).unwrap_err().to_string();
/// assert!(error.contains("at most a full turn apart"), "{error}");
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TurnLimits {
    low_deg: f64,
    high_deg: f64,
}

impl TurnLimits {
    /// Limits from `low_deg` to `high_deg`.
    ///
    /// # Errors
    /// If they are not in order, span more than the full turn, or one is beyond ±360 degrees.
    pub fn new(low_deg: f64, high_deg: f64) -> Result<Self> {
        let within = |x: f64| (-360.0..=360.0).contains(&x);
        if within(low_deg) && within(high_deg) && (0.0..=360.0).contains(&(high_deg - low_deg)) {
            return Ok(TurnLimits { low_deg, high_deg });
        }
        Err(refused(format!("{low_deg},{high_deg}")))
    }

    /// The directions: multiples of a full turn over `n_per_turn` within the limits, and the limits themselves.
    pub(crate) fn directions(self, axis: DVec3, n_per_turn: usize) -> Vec<DVec3> {
        let axis = axis.normalize();
        let [across, zero] = zero_about(axis);
        let step = 360.0 / n_per_turn.max(1) as f64;
        let first = (self.low_deg / step).ceil() as i64;
        let last = (self.high_deg / step).floor() as i64;
        let mut angles = vec![self.low_deg];
        angles.extend((first..=last).map(|k| k as f64 * step));
        angles.push(self.high_deg);
        angles.dedup_by(|b, a| (*b - *a).abs() < 1e-6);
        // Both ends of a full turn are one direction.
        if angles.len() > 1 && self.high_deg - self.low_deg > 360.0 - 1e-6 {
            angles.pop();
        }
        let at = |degrees: f64| {
            let radians = (degrees / 360.0) * TAU;
            zero * libm::cos(radians) + across * libm::sin(radians)
        };
        angles.into_iter().map(at).collect()
    }
}

fn refused(found: String) -> Error {
    let expected = "LOW,HIGH in degrees, within ±360, at most a full turn apart";
    let remedy = "write for example 4-axis:x:-30,90";
    Error::argument("limits of the rotary axis", found, expected, remedy)
}

/// The direction a quarter turn on, and that of angle 0, of a unit axis.
fn zero_about(axis: DVec3) -> [DVec3; 2] {
    let up = if axis.z.abs() < 1.0 - 1e-9 { DVec3::Z } else { DVec3::X };
    let zero = up.reject_from_normalized(axis).try_normalize().unwrap_or(basis(axis)[0]);
    [axis.cross(zero), zero]
}

/// `-30,90`.
impl fmt::Display for TurnLimits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.low_deg, self.high_deg)
    }
}

impl FromStr for TurnLimits {
    type Err = Error;

    /// # Errors
    /// As [`TurnLimits::new`], or if the text is not two numbers with a comma.
    fn from_str(text: &str) -> Result<Self> {
        let (low, high) = text.split_once(',').unwrap_or((text, ""));
        match [low, high].map(|number| number.trim().parse()) {
            [Ok(low), Ok(high)] => TurnLimits::new(low, high),
            _ => Err(refused(format!("`{text}`"))),
        }
    }
}

/// `x`, `y`, `z` or `X,Y,Z`; none if it has no length.
pub(crate) fn axis_of(text: &str) -> Option<[f64; 3]> {
    match text {
        "x" => return Some([1.0, 0.0, 0.0]),
        "y" => return Some([0.0, 1.0, 0.0]),
        "z" => return Some([0.0, 0.0, 1.0]),
        _ => {}
    }
    let axis = super::parse_vector(text)?;
    let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length.is_finite() && length > 1e-12).then_some(axis)
}

/// The directions of `4-axis:AXIS` and `4-axis:AXIS:LOW,HIGH`; the part after `4-axis:` is given.
pub(super) fn parse(text: &str) -> Option<DirectionSet> {
    let (axis, limits) = text.split_once(':').map_or((text, None), |(a, b)| (a, Some(b)));
    let axis = axis_of(axis)?;
    let Some(limits) = limits else {
        return Some(DirectionSet::Circle { axis, n_dirs: AROUND });
    };
    let limits: TurnLimits = limits.parse().ok()?;
    let directions = limits.directions(DVec3::from_array(axis), AROUND);
    let vectors = directions.into_iter().map(|d| d.to_array()).collect();
    Some(DirectionSet::List { vectors })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_kept_and_their_ends_are_among_the_directions() {
        let found = "-30,90".parse::<TurnLimits>().unwrap().directions(DVec3::X * 2.0, 72);
        assert_eq!(found.len(), 25);
        let degrees = |d: &DVec3| libm::atan2(-d.y, d.z).to_degrees();
        assert!((degrees(&found[0]) + 30.0).abs() < 1e-9, "right-handed about x: z turns to -y");
        assert!((degrees(&found[24]) - 90.0).abs() < 1e-9);
        assert!(found.iter().any(|d| (*d - DVec3::Z).length() < 1e-12));
        assert!(found.iter().all(|d| d.x.abs() < 1e-12 && (-30.001..90.001).contains(&degrees(d))));
        let odd = TurnLimits::new(-7.0, 11.0).unwrap().directions(DVec3::Z, 36);
        assert_eq!(odd.len(), 4, "-7, 0, 10 and 11 degrees");
        assert!((odd[1] - DVec3::X).length() < 1e-12);
        assert_eq!(TurnLimits::new(-180.0, 180.0).unwrap().directions(DVec3::Y, 72).len(), 72);
        assert_eq!(TurnLimits::new(5.0, 5.0).unwrap().directions(DVec3::Y, 72).len(), 1);
    }

    #[test]
    fn texts_are_read_or_refused_with_an_example() {
        let set = parse("x:-30,90").unwrap();
        assert!(matches!(&set, DirectionSet::List { vectors } if vectors.len() == 25));
        assert_eq!(parse("0,1,0"), Some(DirectionSet::Circle { axis: [0., 1., 0.], n_dirs: 72 }));
        for text in ["", "w", "x:", "x:90,-30", "x:0", "x:-400,0", "x:-200,200", "0,0,0"] {
            assert_eq!(parse(text), None, "{text}");
        }
        let message = "90,-30".parse::<TurnLimits>().unwrap_err().to_string();
        assert!(message.contains("4-axis:x:-30,90"), "{message}");
    }
}
