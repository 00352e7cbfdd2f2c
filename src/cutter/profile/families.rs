//! Profiles of the usual families of tools: what cuts, lengths in mm. Neck and shank are added by
//! [`Profile::with_shank`]; without, the upper end goes on as wide as it is.

use super::{Profile, ProfileSection};
use crate::{Error, Result};

/// What is above a face across the axis or on a line.
fn line(radius_mm: f64, height_mm: f64) -> ProfileSection {
    ProfileSection::line(radius_mm, height_mm)
}

fn arc(radius_mm: f64, height_mm: f64, center_mm: [f64; 2]) -> ProfileSection {
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

/// A corner, 0 or more and no more than a length.
fn corner(name: &'static str, corner_mm: f64, most: f64) -> Result<()> {
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
    /// If a length is not positive, the angle is not between 0 and a right angle, or the cone is thinner than the neck at its top.
    pub fn dovetail(
        radius_mm: f64,
        angle_rad: f64,
        height_mm: f64,
        neck_radius_mm: f64,
    ) -> Result<Self> {
        between("height of the flank", height_mm, [0.0, f64::INFINITY])?;
        between("angle of the flank", angle_rad, [0.0, std::f64::consts::FRAC_PI_2])?;
        let upper = radius_mm - height_mm * libm::tan(angle_rad);
        between("radius at the top of the flank", upper, [0.0, radius_mm])?;
        between("radius of the neck", neck_radius_mm, [0.0, upper + f64::EPSILON])?;
        let face = (upper > neck_radius_mm).then(|| line(neck_radius_mm, height_mm));
        Profile::new(radius_mm, [line(upper, height_mm)].into_iter().chain(face).collect())
    }

    /// A flank that is an arc (barrel, oval or circle segment mill), widest in the middle of its flutes, above a rounded
    /// lower end.
    ///
    /// # Errors
    /// If a length is not positive, the arc is smaller than the radius, or it leaves nothing of the lower end.
    pub fn barrel(
        radius_mm: f64,
        arc_radius_mm: f64,
        corner_mm: f64,
        flutes_mm: f64,
    ) -> Result<Self> {
        between("height of the flutes", flutes_mm, [0.0, f64::INFINITY])?;
        between("radius of the flank's arc", arc_radius_mm, [radius_mm, f64::INFINITY])?;
        // From the corner, which is tangent to the flank and to the flat lower end, to the top.
        let center = [radius_mm - arc_radius_mm, 0.5 * (flutes_mm + corner_mm)];
        let inner = arc_radius_mm - corner_mm;
        let below = center[1] - corner_mm;
        between("height of the flutes", flutes_mm, [corner_mm, corner_mm + 2.0 * inner])?;
        let side = center[0] + (inner * inner - below * below).sqrt();
        corner("corner of the lower end", corner_mm, radius_mm)?;
        between("radius at the lower end", side, [0.0, radius_mm])?;
        let mut sections = Vec::new();
        if corner_mm > 0.0 {
            let away = [side - center[0], corner_mm - center[1]].map(|x| x / inner);
            let touch = [side + corner_mm * away[0], corner_mm + corner_mm * away[1]];
            sections.push(arc(touch[0], touch[1], [side, corner_mm]));
        }
        let above = flutes_mm - center[1];
        let top = center[0] + (arc_radius_mm * arc_radius_mm - above * above).sqrt();
        sections.push(arc(top, flutes_mm, center));
        Profile::new(side, sections)
    }

    /// A lower end that is a wide cap of a sphere with rounded corners (lens mill), below a cylinder.
    ///
    /// # Errors
    /// If a length is not positive, the cap is smaller than the radius, or the corner does not fit.
    pub fn lens(
        radius_mm: f64,
        cap_radius_mm: f64,
        corner_mm: f64,
        flutes_mm: f64,
    ) -> Result<Self> {
        between("radius of the lens", cap_radius_mm, [radius_mm, f64::INFINITY])?;
        between("corner of the lens", corner_mm, [0.0, radius_mm])?;
        // Center of the corner: within the cap by the corner, and that far from the cylinder.
        let inner = cap_radius_mm - corner_mm;
        let side = radius_mm - corner_mm;
        let height = cap_radius_mm - (inner * inner - side * side).sqrt();
        let away = [side / inner, (height - cap_radius_mm) / inner];
        let touch = [side + corner_mm * away[0], height + corner_mm * away[1]];
        between("height of the flutes", flutes_mm, [height, f64::INFINITY])?;
        let sections = vec![
            arc(touch[0], touch[1], [0.0, cap_radius_mm]),
            arc(radius_mm, height, [side, height]),
            line(radius_mm, flutes_mm),
        ];
        Profile::new(0.0, sections)
    }

    /// A point or a small flat, and a flank that leans by `angle_rad` from the axis (chamfer mill, spot drill,
    /// countersink, point of a drill), below a cylinder.
    ///
    /// # Errors
    /// If a length is not positive, the angle is not between 0 and a right angle, or the tip is wider than the tool.
    pub fn chamfer(tip_radius_mm: f64, angle_rad: f64, radius_mm: f64) -> Result<Self> {
        between("radius of the tool", radius_mm, [tip_radius_mm.max(0.0), f64::INFINITY])?;
        between("angle of the flank", angle_rad, [0.0, std::f64::consts::FRAC_PI_2])?;
        let height = (radius_mm - tip_radius_mm) / libm::tan(angle_rad);
        Profile::new(tip_radius_mm, vec![line(radius_mm, height)])
    }
}
