//! Profiles of the usual families of tools: what cuts, lengths in mm. Neck and shank are added by
//! [`Profile::with_shank`]; without, the upper end goes on as wide as it is.

use super::{Profile, ProfileSection};
use crate::{Error, Result};

/// What is above a face across the axis or on a line.
pub(super) fn line(radius_mm: f64, height_mm: f64) -> ProfileSection {
    ProfileSection::line(radius_mm, height_mm)
}

pub(super) fn arc(radius_mm: f64, height_mm: f64, center_mm: [f64; 2]) -> ProfileSection {
    ProfileSection::arc(radius_mm, height_mm, center_mm)
}

/// A length in an open interval.
pub(super) fn between(name: &'static str, length: f64, [least, most]: [f64; 2]) -> Result<()> {
    if length > least && length < most {
        return Ok(());
    }
    let expected = match most.is_finite() {
        true => format!("between {least} and {most} mm"),
        false => format!("more than {least} mm"),
    };
    Err(Error::argument(name, length, expected, "correct one of the tool's lengths"))
}

/// An angle in radians in an open interval.
pub(super) fn between_angles(
    name: &'static str,
    angle: f64,
    [least, most]: [f64; 2],
) -> Result<()> {
    if angle > least && angle < most {
        return Ok(());
    }
    let found = format!("{angle} rad");
    let expected = format!("between {least:.4} and {most:.4} rad");
    Err(Error::argument(name, found, expected, "give it in radians, against the tool's axis"))
}

/// A corner, 0 or more and no more than a length.
pub(super) fn corner(name: &'static str, corner_mm: f64, most: f64) -> Result<()> {
    if (0.0..=most).contains(&corner_mm) {
        return Ok(());
    }
    let expected = format!("from 0 to {most} mm");
    Err(Error::argument(name, corner_mm, expected, "correct one of the tool's lengths"))
}

impl Profile {
    /// A ball on a thinner neck (lollipop, undercutting ball mill): the ball cuts all around, up to the neck.
    ///
    /// # Errors
    /// If a length is not positive or the neck is not thinner than the ball.
    pub fn lollipop(radius_mm: f64, neck_radius_mm: f64) -> Result<Self> {
        between("radius of the ball", radius_mm, [0.0, f64::INFINITY])?;
        between("radius of the neck", neck_radius_mm, [0.0, radius_mm])?;
        let above = (radius_mm * radius_mm - neck_radius_mm * neck_radius_mm).sqrt();
        let top = radius_mm + above;
        Profile::new(0.0, vec![arc(neck_radius_mm, top, [0.0, radius_mm])])
    }

    /// A disc on a thinner neck (T-slot cutter, Woodruff or keyseat cutter, side mill): rim and both faces cut, both
    /// edges are rounded.
    ///
    /// # Errors
    /// If a length is not positive, the neck is not thinner than the disc, or the corner does not fit.
    pub fn t_slot(
        radius_mm: f64,
        thickness_mm: f64,
        corner_mm: f64,
        neck_radius_mm: f64,
    ) -> Result<Self> {
        between("thickness of the disc", thickness_mm, [0.0, f64::INFINITY])?;
        between("radius of the neck", neck_radius_mm, [0.0, radius_mm])?;
        corner(
            "corner of the disc",
            corner_mm,
            (radius_mm - neck_radius_mm).min(0.5 * thickness_mm),
        )?;
        let flat = radius_mm - corner_mm;
        let mut sections = Vec::new();
        if corner_mm > 0.0 {
            sections.push(arc(radius_mm, corner_mm, [flat, corner_mm]));
        }
        sections.push(line(radius_mm, thickness_mm - corner_mm));
        if corner_mm > 0.0 {
            sections.push(arc(flat, thickness_mm, [flat, thickness_mm - corner_mm]));
        }
        sections.push(line(neck_radius_mm, thickness_mm));
        Profile::new(flat, sections)
    }

    /// A cone that is widest at its lower end (dovetail cutter): the flank leans by `angle_rad` from the axis.
    ///
    /// # Errors
    /// If a length is not positive, the angle is not between 0 and a right angle, or the cone is thinner than the neck
    /// at its top.
    pub fn dovetail(
        radius_mm: f64,
        angle_rad: f64,
        height_mm: f64,
        neck_radius_mm: f64,
    ) -> Result<Self> {
        Profile::rounded_dovetail(radius_mm, 0.0, angle_rad, height_mm, neck_radius_mm)
    }

    /// As [`Profile::dovetail`], with an edge below that is rounded: `radius_mm` is the greatest.
    ///
    /// # Errors
    /// As [`Profile::dovetail`], or if the corner does not fit.
    pub fn rounded_dovetail(
        radius_mm: f64,
        corner_mm: f64,
        angle_rad: f64,
        height_mm: f64,
        neck_radius_mm: f64,
    ) -> Result<Self> {
        between("height of the flank", height_mm, [0.0, f64::INFINITY])?;
        between_angles("angle of the flank", angle_rad, [0.0, std::f64::consts::FRAC_PI_2])?;
        corner("corner of the edge", corner_mm, radius_mm)?;
        let (cos, sin) = (libm::cos(angle_rad), libm::sin(angle_rad));
        let flat = radius_mm - corner_mm;
        let touch = [flat + corner_mm * cos, corner_mm * (1.0 + sin)];
        between("height of the corner", touch[1], [-1.0, height_mm])?;
        let upper = touch[0] - (height_mm - touch[1]) * libm::tan(angle_rad);
        between("radius at the top of the flank", upper, [0.0, radius_mm])?;
        let same = 1e-9 * radius_mm;
        between("radius of the neck", neck_radius_mm, [0.0, upper + same])?;
        let mut sections = Vec::new();
        if corner_mm > 0.0 {
            sections.push(arc(touch[0], touch[1], [flat, corner_mm]));
        }
        sections.push(line(upper, height_mm));
        if upper > neck_radius_mm {
            sections.push(line(neck_radius_mm, height_mm));
        }
        Profile::new(flat, sections)
    }

    /// A point or a small flat, and a flank that leans by `angle_rad` from the axis (chamfer mill, spot drill,
    /// countersink, point of a drill), below a cylinder.
    ///
    /// # Errors
    /// If a length is not positive, the angle is not between 0 and a right angle, or the tip is wider than the tool.
    pub fn chamfer(tip_radius_mm: f64, angle_rad: f64, radius_mm: f64) -> Result<Self> {
        between("radius of the tool", radius_mm, [tip_radius_mm.max(0.0), f64::INFINITY])?;
        between_angles("angle of the flank", angle_rad, [0.0, std::f64::consts::FRAC_PI_2])?;
        let height = (radius_mm - tip_radius_mm) / libm::tan(angle_rad);
        Profile::new(tip_radius_mm, vec![line(radius_mm, height)])
    }
}
