//! Families of tools that files describe by lengths, as profiles: wider below than above, touching with the flank, or
//! cutting along their axis alone.

use super::{Described, round};
use crate::data::files::tools::place::Place;
use crate::tool::cutter::{Crest, Profile};
use crate::{Error, Result};
use std::f64::consts::{FRAC_PI_2, PI};

/// Lengths in mm, angles between flank and axis in radians; of all, the diameter is the greatest of what cuts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::data::files::tools) enum Family {
    Lollipop,
    /// T-slot cutter, keyseat cutter, side mill: its flutes are as high as the disc.
    Slot {
        corner: f64,
    },
    /// A thin disc, as high as the flutes, above a cap of this diameter and height that holds it.
    Saw {
        cap: [f64; 2],
    },
    /// Wider below; the edge below may be rounded.
    Dovetail {
        angle: f64,
        corner: f64,
    },
    /// Wider above.
    Cone {
        kind: Cone,
        tip: f64,
        angle: f64,
    },
    /// A cylinder wider than what is above.
    Head {
        kind: &'static str,
        corner: f64,
    },
    /// A cone from the diameter `lower` at the height of the tip, with rounded corners below and above.
    FaceMill {
        lower: f64,
        angle: f64,
        corners: [f64; 2],
    },
    /// A hollow arc above a tip of this diameter and height.
    Rounding {
        tip: f64,
        tip_height: f64,
        arc: f64,
    },
    /// Rings of flanks that lean by `angle` from a plane across the axis.
    Thread {
        angle: f64,
        crest: Crest,
        /// Diameter between the rings.
        root: f64,
        pitch: f64,
        n_rings: usize,
    },
    /// Radius of the flank's arc, height of its center and corners below and above.
    Barrel {
        arc: f64,
        center: Option<f64>,
        corners: [f64; 2],
    },
    Lens {
        cap: f64,
        corner: f64,
    },
    Oval {
        arc: f64,
        tip: f64,
    },
    /// `tip` is the diameter of a flat lower end.
    TaperedBarrel {
        tip: f64,
        arc: f64,
        angle: f64,
        corners: [f64; 2],
    },
    /// An ellipsoid of revolution, as long as its flutes.
    Spheroid,
    /// `angle` is half of that of its point.
    Drill {
        angle: f64,
    },
    /// A pilot of this diameter and length, its point included, below a countersink; of both half of the angle.
    CenterDrill {
        pilot: f64,
        length: f64,
        point: f64,
        angle: f64,
    },
    Reamer,
}

/// Kinds of cones: a point or a small flat below.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::data::files::tools) enum Cone {
    /// Above its widest place it narrows to the neck as it widened.
    Chamfer,
    /// These go on as a cylinder up to the end of the flutes.
    CornerChamfer,
    VBit,
    SpotDrill,
    Countersink,
    Engraver,
}

impl Cone {
    /// The kind that remarks and tables name so.
    pub fn named(kind: &str) -> Option<Cone> {
        let all = [Cone::Chamfer, Cone::VBit, Cone::SpotDrill, Cone::Countersink, Cone::Engraver];
        all.into_iter().find(|cone| cone.name() == kind)
    }

    fn name(self) -> &'static str {
        match self {
            Cone::Chamfer => "chamfer mill",
            Cone::CornerChamfer => "corner chamfer mill",
            Cone::VBit => "V-bit",
            Cone::SpotDrill => "spot drill",
            Cone::Countersink => "countersink",
            Cone::Engraver => "engraver",
        }
    }
}

/// Half of the angle of center drills' countersinks (ISO 866), and of their points.
pub(in crate::data::files::tools) const CENTER_RAD: [f64; 2] =
    [30.0 / 180.0 * PI, 59.0 / 180.0 * PI];

/// Heights closer than this are one, mm.
const SAME_MM: f64 = 1e-6;

impl Family {
    pub fn words(self) -> String {
        let rounded = |name: &str, corner: f64| match corner {
            0.0 => name.to_string(),
            corner => format!("{name} R{}", round(corner)),
        };
        match self {
            Family::Lollipop => "lollipop".into(),
            Family::Slot { corner } => rounded("T-slot cutter", corner),
            Family::Saw { .. } => "slitting saw".into(),
            Family::Dovetail { angle, corner } => {
                rounded(&format!("dovetail cutter {}°", round(angle.to_degrees())), corner)
            }
            // As makers name them: per side, or the whole point.
            Family::Cone { kind, angle, .. } => {
                let is_per_side = matches!(kind, Cone::Chamfer | Cone::CornerChamfer);
                let stated = if is_per_side { angle } else { 2.0 * angle };
                format!("{} {}°", kind.name(), round(stated.to_degrees()))
            }
            Family::Head { kind, corner } => rounded(kind, corner),
            Family::FaceMill { angle, corners, .. } => {
                rounded(&format!("face mill {}°", round(angle.to_degrees())), corners[0])
            }
            Family::Rounding { arc, .. } => format!("corner rounding mill R{}", round(arc)),
            Family::Thread { angle, n_rings: n, .. } => {
                let rings = if n == 1 { "ring" } else { "rings" };
                format!("thread mill {}°, {n} {rings},", round(2.0 * angle.to_degrees()))
            }
            Family::Barrel { arc, .. } => format!("barrel R{}", round(arc)),
            Family::Lens { cap, .. } => format!("lens R{}", round(cap)),
            Family::Oval { arc, .. } => format!("oval R{}", round(arc)),
            Family::TaperedBarrel { arc, angle, .. } => {
                format!("tapered barrel R{} {}°", round(arc), round(angle.to_degrees()))
            }
            Family::Spheroid => "spheroid".into(),
            Family::Drill { angle } => format!("drill {}°", round(2.0 * angle.to_degrees())),
            Family::CenterDrill { pilot, angle, .. } => {
                let degrees = round(2.0 * angle.to_degrees());
                format!("center drill {degrees}°, pilot {} mm,", round(pilot))
            }
            Family::Reamer => "reamer".into(),
        }
    }

    /// Whether it is not known where a neck ends that the file gives no end of.
    fn needs_end_of_neck(self) -> bool {
        matches!(
            self,
            Family::Lollipop
                | Family::Slot { .. }
                | Family::Dovetail { .. }
                | Family::Thread { .. }
        )
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
        let shank = 0.5 * shank;
        let cutting = self.cutting(family, flutes, shank, place)?;
        let top = cutting.flutes_mm();
        // Of what cuts, unless the file says more of the neck.
        let radius = cutting.radius_at(2.0 * top.max(1.0));
        let mut neck = self.neck.map_or(radius, |neck| 0.5 * neck);
        let mut end = top;
        let mut sections = Vec::new();
        if let Family::Cone { kind: Cone::Chamfer, angle, .. } = family {
            neck = self.neck.map_or(shank, |neck| 0.5 * neck).min(radius);
            end = top + (radius - neck) / libm::tan(angle);
            sections.push([neck, end]);
        }
        let flutes = flutes.unwrap_or(end);
        let is_said = matches!(family, Family::FaceMill { .. }) && self.neck.is_some();
        if flutes > end + SAME_MM && !family.needs_end_of_neck() && !is_said {
            let above = if sections.is_empty() { radius } else { neck };
            sections.push([above, flutes]);
            end = flutes;
        }
        match self.neck_end {
            Some(neck_end) if neck_end > end + SAME_MM => {
                sections.extend([[neck, end], [neck, neck_end]]);
                sections.extend(self.shaft_from(neck_end, shank));
            }
            None if family.needs_end_of_neck() && shank > neck + SAME_MM => {
                let found = "the file does not say where the neck ends";
                return Err(place.error(found, "add the length from the tip to the neck's end"));
            }
            None if family.needs_end_of_neck() => sections.push([neck, end]),
            // The neck ends where what cuts does, or that is all that is known.
            _ => sections.extend(self.shaft_from(end, shank)),
        }
        cutting.with_shank(&sections).map_err(|error| place.within(error))
    }

    /// Points of the shank, or of a shaft that is no cylinder, from a height on.
    fn shaft_from(&self, mut height: f64, shank: f64) -> Vec<[f64; 2]> {
        if self.shaft.is_empty() {
            return vec![[shank, height]];
        }
        let mut points = Vec::with_capacity(2 * self.shaft.len());
        for section in &self.shaft {
            points.push([section.lower_radius_mm, height]);
            height += section.length_mm;
            points.push([section.upper_radius_mm, height]);
        }
        points
    }

    /// What cuts.
    fn cutting(
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
        let margin = || {
            let found = "the file does not say the flute length, where its margin ends";
            flutes.ok_or_else(|| {
                place.error(found, "give it with `flutes_mm` in a program, or --flute-length MM")
            })
        };
        let cutting = match family {
            Family::Lollipop => Profile::lollipop(radius, neck()?),
            Family::Slot { corner } => Profile::t_slot(radius, height()?, corner, neck()?),
            Family::Saw { cap: [cap, cap_height] } => {
                Profile::saw(radius, height()?, [0.5 * cap, cap_height], shank)
            }
            Family::Dovetail { angle, corner } => {
                Profile::rounded_dovetail(radius, corner, angle, height()?, neck()?)
            }
            Family::Cone { tip, angle, .. } => Profile::chamfer(0.5 * tip, angle, radius),
            Family::Head { corner, .. } => Profile::cylinder(radius, corner, height()?),
            Family::FaceMill { lower, angle, corners } => {
                Profile::face_mill(0.5 * lower, radius, angle, corners)
            }
            Family::Rounding { tip, tip_height, arc } => {
                Profile::corner_rounding(0.5 * tip, tip_height, arc, radius)
            }
            Family::Thread { angle, crest, root, pitch, n_rings } => {
                Profile::of_rings([radius, 0.5 * root], angle, crest, pitch, n_rings)
            }
            Family::Barrel { arc, center, corners } => {
                let height = height()?;
                let center = center.unwrap_or(0.5 * (height + corners[0]));
                Profile::barrel_at(radius, arc, center, corners, height)
            }
            Family::Lens { cap, corner } => Profile::lens(radius, cap, corner, height()?),
            Family::Oval { arc, tip } => Profile::oval(radius, arc, tip),
            Family::TaperedBarrel { tip, arc, angle, corners } => {
                Profile::tapered_barrel(0.5 * tip, radius, arc, angle.min(FRAC_PI_2), corners)
            }
            Family::Spheroid => Profile::spheroid(radius, height()?, shank),
            Family::Drill { angle } => Profile::drill(radius, 2.0 * angle, margin()?),
            Family::CenterDrill { pilot, length, point, angle } => {
                Profile::center_drill([0.5 * pilot, radius], length, [2.0 * point, 2.0 * angle])
            }
            Family::Reamer => Profile::reamer(radius, 0.0, margin()?),
        };
        cutting.map_err(|error| place.within(error))
    }
}
