//! Reading a [`Cutter`] with serde: what is read is checked as what is built.

use super::margins::{check_allowance, envelope};
use super::{Cutter, MAX_LENGTH_MM, MAX_STEPS, Profile, Step};
use crate::{Error, Result};
use serde::Deserialize;

/// A [`Cutter`] as it is read.
#[derive(Deserialize)]
#[serde(rename = "Cutter")]
pub(super) struct Unchecked {
    corner_mm: f64,
    side_mm: f64,
    steps: Vec<Step>,
    cutting: Vec<Step>,
    upper: Vec<Step>,
    allowance_mm: f64,
    #[serde(default)]
    profile: Option<Profile>,
}

const REMEDY: &str = "write the cutter again";

/// A margin may have moved steps by as much as they are long, and narrowed them to nothing.
fn check_steps(name: &'static str, steps: &[Step]) -> Result<()> {
    let length = 2.0 * MAX_LENGTH_MM;
    let sound = |step: &Step| {
        let radius = step.radius_mm;
        step.height_mm.abs() <= length
            && ((0.0..=length).contains(&radius) || radius == f64::INFINITY)
    };
    let rising = |a: &Step, b: &Step| a.height_mm < b.height_mm && a.radius_mm <= b.radius_mm;
    let bad = steps.iter().find(|step| !sound(step));
    let bad =
        bad.or(steps.windows(2).find(|pair| !rising(&pair[0], &pair[1])).map(|pair| &pair[1]));
    match bad {
        None => Ok(()),
        Some(step) => {
            let expected = "rising heights within 20 m, and radii that do not shrink";
            Err(Error::argument(name, format!("{step:?}"), expected, REMEDY))
        }
    }
}

impl TryFrom<Unchecked> for Cutter {
    type Error = Error;

    /// # Errors
    /// If a length is out of its domain, the steps are not those of the flutes and of what is above them, or they do
    /// not hold the profile.
    fn try_from(read: Unchecked) -> Result<Self> {
        let Unchecked { corner_mm, side_mm, steps, cutting, upper, allowance_mm, profile } = read;
        for (name, length) in [("corner radius", corner_mm), ("side offset", side_mm)] {
            if !(0.0..=2.0 * MAX_LENGTH_MM).contains(&length) {
                return Err(Error::argument(name, length, "zero or more, at most 20 m", REMEDY));
            }
        }
        check_allowance(allowance_mm)?;
        check_steps("cutting steps", &cutting)?;
        check_steps("upper steps", &upper)?;
        let n = cutting.len() + upper.len();
        if n == 0 || n > MAX_STEPS {
            let expected = format!("1 to {MAX_STEPS}");
            return Err(Error::argument("number of steps", n, expected, REMEDY));
        }
        if envelope(steps.clone()) != envelope([&cutting[..], &upper].concat()) {
            let expected = "those of the flutes and of what is above them";
            return Err(Error::argument("steps", format!("{steps:?}"), expected, REMEDY));
        }
        let widest = steps.iter().fold(0.0, |widest: f64, step| widest.max(step.radius_mm));
        let of_profile = profile.as_ref().map_or(0.0, Profile::cutting_radius_mm);
        if of_profile > widest * (1.0 + 1e-9) {
            let expected = format!("at most {widest} mm, the radius of the steps");
            return Err(Error::argument("radius of the profile", of_profile, expected, REMEDY));
        }
        Ok(Cutter { corner_mm, side_mm, steps, cutting, upper, allowance_mm, profile })
    }
}
