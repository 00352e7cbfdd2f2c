//! Drills, center drills and reamers.

use super::families::{between, corner};
use super::{Profile, ProfileSection};
use crate::{Error, Result};
use std::f64::consts::PI;

impl Profile {
    /// The same, cutting along its axis alone.
    #[cfg(feature = "python")]
    pub(crate) fn drilling(self) -> Self {
        Profile { is_drill: true, ..self }
    }

    /// A drill: a cone with the point angle between its flanks, radians, and the margin above it up to the end of the
    /// flutes.
    ///
    /// # Errors
    /// If a length is not positive, the angle is not between 0 and a half turn, or the flutes end below the cone.
    pub fn drill(radius_mm: f64, point_angle_rad: f64, flutes_mm: f64) -> Result<Self> {
        between("radius of the drill", radius_mm, [0.0, f64::INFINITY])?;
        check_whole("point angle", point_angle_rad, "118° for most drills")?;
        let cone = radius_mm / libm::tan(0.5 * point_angle_rad);
        between("flute length of the drill", flutes_mm, [cone, f64::INFINITY])?;
        let sections =
            vec![ProfileSection::line(radius_mm, cone), ProfileSection::line(radius_mm, flutes_mm)];
        Ok(Profile { is_drill: true, ..Profile::new(0.0, sections)? })
    }

    /// A center drill: a pilot, which ends `pilot_mm` above its tip, and the countersink above it up to the radius;
    /// each point has the angle between its flanks, radians. What is above the countersink does not cut.
    ///
    /// # Errors
    /// If a length is not positive, an angle is not between 0 and a half turn, the pilot is not thinner than the tool,
    /// or it ends below its own point.
    pub fn center_drill(
        [pilot_radius_mm, radius_mm]: [f64; 2],
        pilot_mm: f64,
        [point_angle_rad, countersink_angle_rad]: [f64; 2],
    ) -> Result<Self> {
        between("radius of the pilot", pilot_radius_mm, [0.0, f64::INFINITY])?;
        between("radius of the center drill", radius_mm, [pilot_radius_mm, f64::INFINITY])?;
        check_whole("point angle", point_angle_rad, "118° for most center drills")?;
        let usual = "60° for most center drills";
        check_whole("angle of the countersink", countersink_angle_rad, usual)?;
        let cone = pilot_radius_mm / libm::tan(0.5 * point_angle_rad);
        between("length of the pilot", pilot_mm, [cone, f64::INFINITY])?;
        let rise = (radius_mm - pilot_radius_mm) / libm::tan(0.5 * countersink_angle_rad);
        let sections = vec![
            ProfileSection::line(pilot_radius_mm, cone),
            ProfileSection::line(pilot_radius_mm, pilot_mm),
            ProfileSection::line(radius_mm, pilot_mm + rise),
        ];
        Ok(Profile { is_drill: true, ..Profile::new(0.0, sections)? })
    }

    /// A reamer: a lead of `lead_mm` by 45°, which may be 0, and the margin above it up to the end of the flutes; its
    /// lower face does not cut.
    ///
    /// # Errors
    /// If another length is not positive, the lead is beyond nine tenths of the radius, or the flutes end below it.
    pub fn reamer(radius_mm: f64, lead_mm: f64, flutes_mm: f64) -> Result<Self> {
        between("radius of the reamer", radius_mm, [0.0, f64::INFINITY])?;
        corner("lead of the reamer", lead_mm, 0.9 * radius_mm)?;
        between("flute length of the reamer", flutes_mm, [lead_mm, f64::INFINITY])?;
        let mut sections = vec![ProfileSection::line(radius_mm - lead_mm, 0.0).non_cutting()];
        if lead_mm > 0.0 {
            sections.push(ProfileSection::line(radius_mm, lead_mm));
        }
        sections.push(ProfileSection::line(radius_mm, flutes_mm));
        Ok(Profile { is_drill: true, ..Profile::new(0.0, sections)? })
    }
}

/// An angle between flanks.
fn check_whole(name: &'static str, angle_rad: f64, usual: &str) -> Result<()> {
    if angle_rad > 0.0 && angle_rad < PI {
        return Ok(());
    }
    let found = format!("{}°", angle_rad.to_degrees());
    let remedy = format!("give the angle between the flanks of the cone, {usual}");
    Err(Error::argument(name, found, "between 0 and 180°", remedy))
}
