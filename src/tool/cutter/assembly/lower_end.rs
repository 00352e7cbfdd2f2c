//! Where the body of a tool begins: its contact and, if tapered, its flank.

use super::{Section, TipShape};
use crate::tool::cutter::{MAX_LENGTH_MM, positive};
use crate::{Error, Result};

/// Lower end of a tool as its contact and, if tapered, its flank.
pub(super) struct LowerEnd {
    pub corner_mm: f64,
    pub side_mm: f64,
    pub radius_mm: f64,
    /// Height of the cone's or the body's lower end above the tip, mm.
    pub start_mm: f64,
    pub cone: Option<Section>,
}

/// A corner within this of the radius, as a share of it, makes a ball.
const BALL: f64 = 1e-6;

impl LowerEnd {
    pub fn of(tip: TipShape) -> Result<Self> {
        let (TipShape::Straight { radius_mm, corner_mm }
        | TipShape::Tapered { radius_mm, corner_mm, .. }) = tip;
        positive("cutter radius", radius_mm)?;
        let is_ball = (corner_mm - radius_mm).abs() <= BALL * radius_mm;
        let corner_mm = if is_ball { radius_mm } else { corner_mm };
        if !(0.0..=radius_mm).contains(&corner_mm) {
            let expected = format!("between 0 and the cutter's radius of {radius_mm} mm");
            let remedy = "a ball end has the whole radius, a flat end 0";
            return Err(Error::argument("corner radius", corner_mm, expected, remedy));
        }
        let TipShape::Tapered { taper_rad, flutes_mm, .. } = tip else {
            let side_mm = radius_mm - corner_mm;
            return Ok(LowerEnd { corner_mm, side_mm, radius_mm, start_mm: 0.0, cone: None });
        };
        if !(taper_rad > 0.0 && taper_rad < std::f64::consts::FRAC_PI_2) {
            let found = format!("{} degrees", taper_rad.to_degrees());
            let remedy = "give the angle between flank and axis";
            return Err(Error::argument("taper", found, "between 0 and 90 degrees", remedy));
        }
        let [sin, cos, tan] = [libm::sin(taper_rad), libm::cos(taper_rad), libm::tan(taper_rad)];
        let side_mm = if is_ball { 0.0 } else { radius_mm + corner_mm * (tan - 1.0 / cos) };
        let start_mm = corner_mm * (1.0 - sin);
        let lower_radius_mm = side_mm + corner_mm * cos;
        let length_mm = flutes_mm - start_mm;
        if !(length_mm > 0.0 && flutes_mm <= MAX_LENGTH_MM) {
            let expected = format!("more than the tip's height of {start_mm} mm, at most 10 m");
            let remedy = "give the length of the flutes from the tip";
            return Err(Error::argument("flute length", flutes_mm, expected, remedy));
        }
        let upper_radius_mm = lower_radius_mm + length_mm * tan;
        positive("radius at the top of the taper", upper_radius_mm)?;
        let cone = Some(Section { length_mm, lower_radius_mm, upper_radius_mm });
        Ok(LowerEnd { corner_mm, side_mm, radius_mm: corner_mm + side_mm, start_mm, cone })
    }
}
