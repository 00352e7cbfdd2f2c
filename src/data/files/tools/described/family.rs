//! Families of tools that files describe by lengths, as profiles: wider below than above, or touching with the flank.

use super::{Described, round};
use crate::cutter::Profile;
use crate::data::files::tools::place::Place;
use crate::{Error, Result};

/// Lengths in mm, angles between flank and axis in radians; of all, the diameter is the greatest of what cuts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::data::files::tools) enum Family {
    Lollipop,
    /// T-slot cutter, keyseat cutter, side mill: its flutes are as high as the disc.
    Slot {
        corner: f64,
    },
    /// Wider below.
    Dovetail {
        angle: f64,
    },
    /// Wider above.
    Chamfer {
        tip: f64,
        angle: f64,
    },
}

/// Heights closer than this are one, mm.
const SAME_MM: f64 = 1e-6;

impl Family {
    pub fn words(self) -> String {
        match self {
            Family::Lollipop => "lollipop".into(),
            Family::Slot { corner: 0.0 } => "T-slot cutter".into(),
            Family::Slot { corner } => format!("T-slot cutter R{}", round(corner)),
            Family::Dovetail { angle } => {
                format!("dovetail cutter {}°", round(angle.to_degrees()))
            }
            Family::Chamfer { angle, .. } => {
                format!("chamfer mill {}°", round(angle.to_degrees()))
            }
        }
    }
}

impl Described {
    /// The profile of flutes, neck and shank; `shank` is its diameter.
    pub(super) fn profile_of(
        &self,
        family: Family,
        flutes: Option<f64>,
        shank: f64,
        place: &Place,
    ) -> Result<Profile> {
        let missing = |what: &str| -> Error {
            place.error(format!("the file does not say the {what}"), "add it to the tool")
        };
        let radius = 0.5 * self.diameter;
        let neck =
            || self.neck.map(|neck| 0.5 * neck).ok_or_else(|| missing("diameter of the neck"));
        let height = || flutes.ok_or_else(|| missing("flute length, the height of what cuts"));
        let cutting = match family {
            Family::Lollipop => Profile::lollipop(radius, neck()?),
            Family::Slot { corner } => Profile::t_slot(radius, height()?, corner, neck()?),
            Family::Dovetail { angle } => Profile::dovetail(radius, angle, height()?, neck()?),
            Family::Chamfer { tip, angle } => Profile::chamfer(0.5 * tip, angle, radius),
        };
        let cutting = cutting.map_err(|error| place.within(error))?;
        let top = cutting.flutes_mm();
        let neck = self.neck.map_or(radius, |neck| 0.5 * neck);
        let shank = 0.5 * shank;
        let mut sections = Vec::new();
        match self.neck_end.filter(|end| *end > top + SAME_MM) {
            Some(end) => {
                sections.push([neck, top]);
                sections.push([neck, end]);
                sections.push([shank, end]);
            }
            // The cone is all that is known.
            None if matches!(family, Family::Chamfer { .. }) => {
                sections.push([shank, top.max(flutes.unwrap_or(top))]);
            }
            None if shank > neck + SAME_MM => {
                let found = "the file does not say where the neck ends";
                return Err(place.error(found, "add the length from the tip to the neck's end"));
            }
            None => sections.push([neck, top]),
        }
        cutting.with_shank(&sections).map_err(|error| place.within(error))
    }
}
