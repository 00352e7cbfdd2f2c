//! Tools of any profile in a holder.

use super::{Assembly, Section, ToolPart, steps};
use crate::tool::cutter::margins::envelope;
use crate::tool::cutter::profile::require_steps;
use crate::tool::cutter::{Cutter, Profile, Step, positive};
use crate::{Error, Result};

impl Assembly {
    /// A tool of any profile, clamped so that the holder's nose is `stick_out_mm` above its tip; `holder` is from the
    /// nose upward.
    ///
    /// Its steps are those of a flat end mill that holds it: what does not know of profiles takes it for that.
    ///
    /// # Errors
    /// If a length is not a number from 0.0001 mm to 10 m, or there is no holder.
    pub fn from_profile(profile: Profile, holder: &[Section], stick_out_mm: f64) -> Result<Self> {
        positive("stick-out", stick_out_mm)?;
        holder.iter().try_for_each(|section| section.check("length or radius of the holder"))?;
        if holder.is_empty() {
            let remedy = "give the segments of the holder from its nose upward";
            return Err(Error::argument("holder", "without segments", "1 or more", remedy));
        }
        let (mut held, _, excess_mm) = steps(holder, holder.len(), 0.0, 0.0);
        let top = holder.iter().map(|section| section.length_mm).sum();
        held.push(Step { height_mm: top, radius_mm: f64::INFINITY });
        let [cutting, upper] = steps_of(&profile);
        let end = [0.0, profile.cutting_radius_mm()];
        let tool = Assembly::of_parts(end, cutting, upper, held, stick_out_mm, excess_mm)?;
        Ok(Assembly { profile: Some(profile), ..tool })
    }

    /// The profile of what is clamped, if the tool was given by one.
    pub fn profile(&self) -> Option<&Profile> {
        self.profile.as_ref()
    }

    /// Refuses a tool whose profile a change of its steps would contradict.
    pub(super) fn require_steps(&self) -> Result<()> {
        require_steps(self.profile(), "give the changed profile")
    }

    /// With a profile whose steps these are.
    pub(crate) fn of_same_lengths(self, profile: Profile) -> Result<Self> {
        let [cutting, upper] = steps_of(&profile);
        if self.cutting != cutting || self.upper != upper {
            let remedy = "write the tool again";
            return Err(Error::argument(
                "steps of the tool",
                "others",
                "those of its profile",
                remedy,
            ));
        }
        // Tables round the radius of the tip.
        let side_mm = profile.cutting_radius_mm();
        Ok(Assembly { corner_mm: 0.0, side_mm, profile: Some(profile), ..self })
    }

    /// Heights above the tip at which holder and spindle begin, with a margin, mm.
    ///
    /// # Errors
    /// As [`Assembly::with_clearance`].
    pub(crate) fn upper_heights_mm(&self, clearance_mm: f64) -> Result<[f64; 2]> {
        let held = self.with_clearance(clearance_mm)?;
        let lowest = |is_spindle: bool| {
            let of = held.holder.iter().filter(|step| step.radius_mm.is_infinite() || !is_spindle);
            let heights = of.map(|step| step.height_mm + held.stick_out_mm);
            heights.fold(f64::INFINITY, f64::min)
        };
        Ok([lowest(false), lowest(true)])
    }

    /// The same tool with another profile.
    pub(super) fn with_changed(&self, profile: Profile) -> Self {
        let [cutting, upper] = steps_of(&profile);
        let side_mm = profile.cutting_radius_mm();
        Assembly { side_mm, cutting, upper, profile: Some(profile), ..self.clone() }
    }

    /// The tool without spindle, or without spindle and holder: the uppermost radius goes on.
    pub(super) fn profile_below(
        &self,
        part: ToolPart,
        clearance_mm: f64,
    ) -> Result<Option<Cutter>> {
        let mut tool = self.with_clearance(clearance_mm)?;
        match part {
            ToolPart::Spindle => {
                tool.holder.retain(|step| step.radius_mm.is_finite());
                tool.cutter().map(Some)
            }
            ToolPart::Holder => tool.body_cutter().map(Some),
            ToolPart::Tip | ToolPart::Cutter | ToolPart::Shank => Ok(None),
        }
    }

    /// The cutter with the profile in the holder, or alone.
    pub(super) fn with_profile_of(&self, cutter: Cutter, stick_out_mm: Option<f64>) -> Cutter {
        let profile = self.profile.as_ref().map(|profile| match stick_out_mm {
            Some(stick_out_mm) => profile.held(&self.holder, stick_out_mm),
            None => profile.clone(),
        });
        let profile = profile.map(|profile| match self.allowance_mm > 0.0 {
            true => profile.dilated(self.allowance_mm),
            false => profile,
        });
        Cutter { profile, ..cutter }
    }
}

/// Steps of a flat end mill that holds the profile: its flutes, and what does not cut.
fn steps_of(profile: &Profile) -> [Vec<Step>; 2] {
    // Below the end of the flutes, so that they are separate where steps are read again.
    let top = profile.flutes_mm();
    let flutes = Step { height_mm: 0.5 * top, radius_mm: profile.cutting_radius_mm() };
    // What does not cut below them, the cap of a saw, is within the flat end.
    let above = profile.steps(|piece| !piece.cuts && piece.ends[1][1] >= top);
    [vec![flutes], envelope(above)]
}
