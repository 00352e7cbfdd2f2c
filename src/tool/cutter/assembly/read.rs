//! Reading tools: what is read is built again, and so checked.

use super::Assembly;
use crate::tool::cutter::{Profile, Step, margins::check_allowance};
use crate::{Error, Result};
use serde::Deserialize;

/// An [`Assembly`] as it is read; steps of the whole body follow from the others.
#[derive(Deserialize)]
#[serde(rename = "Assembly")]
pub(super) struct Unchecked {
    corner_mm: f64,
    side_mm: f64,
    cutting: Vec<Step>,
    upper: Vec<Step>,
    #[serde(rename = "body")]
    _body: Vec<Step>,
    holder: Vec<Step>,
    stick_out_mm: f64,
    allowance_mm: f64,
    excess_mm: f64,
    overall_mm: Option<f64>,
    #[serde(default)]
    profile: Option<Profile>,
}

/// Wider steps hide these, so that the cutter's own check does not see them.
fn check_steps(steps: &[Step]) -> Result<()> {
    let sound = |step: &Step| step.height_mm.is_finite() && step.radius_mm >= 0.0;
    let rising = steps.is_sorted_by(|a, b| a.height_mm <= b.height_mm);
    match steps.iter().find(|step| !sound(step)).or(steps.first().filter(|_| !rising)) {
        None => Ok(()),
        Some(step) => {
            let expected = "finite rising heights and radii of 0 or more";
            let remedy = "write the tool again";
            Err(Error::argument("steps of the tool", format!("{step:?}"), expected, remedy))
        }
    }
}

impl TryFrom<Unchecked> for Assembly {
    type Error = Error;

    /// # Errors
    /// If lengths or steps make no cutter or are not those of the profile, the allowance or the excess is not a number
    /// from 0 on, or the tool sticks out further than its overall length.
    fn try_from(read: Unchecked) -> Result<Self> {
        let Unchecked { corner_mm, side_mm, cutting, upper, holder, .. } = read;
        if holder.is_empty() {
            let remedy = "give the steps of the holder from its nose upward";
            return Err(Error::argument("holder", "without steps", "1 or more", remedy));
        }
        if !(read.excess_mm >= 0.0 && read.excess_mm.is_finite()) {
            let remedy = "give by how much steps are wider than the tool, mm";
            return Err(Error::argument("excess", read.excess_mm, "0 or more", remedy));
        }
        check_allowance(read.allowance_mm)?;
        [&cutting, &upper, &holder].into_iter().try_for_each(|steps| check_steps(steps))?;
        let end = [corner_mm, side_mm];
        let tool =
            Assembly::of_parts(end, cutting, upper, holder, read.stick_out_mm, read.excess_mm)?;
        let tool = match read.overall_mm {
            Some(overall_mm) => tool.with_overall(overall_mm)?,
            None => tool,
        };
        let tool = match read.profile {
            Some(profile) => tool.of_same_lengths(profile)?,
            None => tool,
        };
        tool.with_allowance(read.allowance_mm)
    }
}
