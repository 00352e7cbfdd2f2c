//! Profiles of mills that round corners, mill threads, face, and saw.

use super::families::{arc, between, between_angles, corner, line};
use super::{Profile, ProfileSection};
use crate::{Error, Result};
use std::f64::consts::FRAC_PI_2;

/// Between the flanks of a thread mill's tooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Crest {
    /// As wide as this, mm; 0 is a point.
    Flat(f64),
    /// An arc of this radius, mm: files alone have it.
    #[cfg(feature = "formats")]
    Round(f64),
}

/// Faces of the polygon about a quarter of an ellipse.
#[cfg(feature = "formats")]
const ELLIPSE_FACES: usize = 12;

impl Profile {
    /// A cylinder whose lower edge is rounded (counterbore, face mill without lead): what is above may be thinner.
    ///
    /// # Errors
    /// If a length is not positive or the corner does not fit.
    pub fn cylinder(radius_mm: f64, corner_mm: f64, height_mm: f64) -> Result<Self> {
        between("radius of the mill", radius_mm, [0.0, f64::INFINITY])?;
        between("height of the flutes", height_mm, [0.0, f64::INFINITY])?;
        corner("corner of the mill", corner_mm, radius_mm.min(height_mm))?;
        let flat = radius_mm - corner_mm;
        let mut sections = Vec::new();
        if corner_mm > 0.0 {
            sections.push(arc(radius_mm, corner_mm, [flat, corner_mm]));
        }
        if height_mm > corner_mm {
            sections.push(line(radius_mm, height_mm));
        }
        Profile::new(flat, sections)
    }

    /// A cone that is wider above (face mill with a lead angle): it leans by `angle_rad` from the axis, from
    /// `lower_radius_mm` at the height of the tip, where it would begin without a corner, to the greatest radius, where
    /// an upper corner may round it.
    ///
    /// # Errors
    /// If a length is not positive, the angle is not between 0 and a right angle, the cone is not wider above, or a
    /// corner does not fit.
    pub fn face_mill(
        lower_radius_mm: f64,
        radius_mm: f64,
        angle_rad: f64,
        [corner_mm, upper_mm]: [f64; 2],
    ) -> Result<Self> {
        between("radius of the mill", radius_mm, [lower_radius_mm.max(0.0), f64::INFINITY])?;
        between_angles("angle of the flank", angle_rad, [0.0, FRAC_PI_2])?;
        let (cos, sin) = (libm::cos(angle_rad), libm::sin(angle_rad));
        let flat = lower_radius_mm - corner_mm * (1.0 - sin) / cos;
        corner("corner of the mill", corner_mm, radius_mm)?;
        corner("upper corner of the mill", upper_mm, radius_mm)?;
        between("radius of the flat lower end", flat, [-f64::EPSILON, radius_mm])?;
        let rise = (radius_mm - lower_radius_mm) / libm::tan(angle_rad);
        let top = rise + upper_mm * libm::tan(0.5 * angle_rad);
        let lower = [flat + corner_mm * cos, corner_mm * (1.0 - sin)];
        let upper = [radius_mm - upper_mm * (1.0 - cos), top - upper_mm * sin];
        between("height of the flank", upper[1] - lower[1], [-f64::EPSILON, f64::INFINITY])?;
        let flat = flat.max(0.0);
        let mut sections = Vec::new();
        if corner_mm > 0.0 {
            sections.push(arc(lower[0], lower[1], [flat, corner_mm]));
        }
        sections.push(line(upper[0], upper[1].max(lower[1])));
        if upper_mm > 0.0 {
            sections.push(arc(radius_mm, top, [radius_mm - upper_mm, top]));
        }
        Profile::new(flat, sections)
    }

    /// A hollow quarter of a circle about a thinner tip (corner rounding mill): the arc begins at the tip's edge,
    /// `tip_height_mm` above its end, and goes on to the greatest radius, by at most its own.
    ///
    /// # Errors
    /// If a length is not positive or the arc does not lead from the tip to the radius.
    pub fn corner_rounding(
        tip_radius_mm: f64,
        tip_height_mm: f64,
        arc_radius_mm: f64,
        radius_mm: f64,
    ) -> Result<Self> {
        between("radius of the arc", arc_radius_mm, [0.0, f64::INFINITY])?;
        corner("radius of the tip", tip_radius_mm, radius_mm)?;
        corner("height of the tip", tip_height_mm, f64::MAX)?;
        let center = tip_radius_mm + arc_radius_mm;
        let most = center + f64::EPSILON * center;
        between("radius of the mill", radius_mm, [tip_radius_mm, most.next_up()])?;
        let aside = (center - radius_mm).max(0.0);
        let rise = (arc_radius_mm * arc_radius_mm - aside * aside).sqrt();
        let mut sections = Vec::new();
        if tip_height_mm > 0.0 {
            sections.push(line(tip_radius_mm, tip_height_mm));
        }
        sections.push(arc(radius_mm, tip_height_mm + rise, [center, tip_height_mm]));
        Profile::new(tip_radius_mm, sections)
    }

    /// Rings on a thinner neck whose flanks meet at a crest (thread mill): each flank leans by `angle_rad` from a plane
    /// across the axis, half of the thread's angle; the crest is a cylinder `crest_mm` high, 0 for a point. The rings
    /// begin at the tip, one `pitch_mm` above the other.
    ///
    /// # Errors
    /// If a length is not positive, the neck is not thinner than the rings, the angle is not between 0 and a right
    /// angle, the rings are higher than the pitch, or there are none or too many.
    pub fn thread_mill(
        radius_mm: f64,
        neck_radius_mm: f64,
        angle_rad: f64,
        crest_mm: f64,
        pitch_mm: f64,
        n_rings: usize,
    ) -> Result<Self> {
        let radii = [radius_mm, neck_radius_mm];
        Profile::of_rings(radii, angle_rad, Crest::Flat(crest_mm), pitch_mm, n_rings)
    }

    /// As [`Profile::thread_mill`], with crests of either kind.
    ///
    /// # Errors
    /// As [`Profile::thread_mill`].
    pub(crate) fn of_rings(
        [radius_mm, neck_mm]: [f64; 2],
        angle_rad: f64,
        crest: Crest,
        pitch_mm: f64,
        n: usize,
    ) -> Result<Self> {
        between("radius of the thread mill", radius_mm, [0.0, f64::INFINITY])?;
        between("radius of the neck", neck_mm, [0.0, radius_mm])?;
        between_angles("angle of the thread's flank", angle_rad, [0.0, FRAC_PI_2])?;
        if !(1..=MOST_RINGS).contains(&n) {
            let expected = format!("1 to {MOST_RINGS}");
            let remedy = "correct the number of teeth along the axis";
            return Err(Error::argument("rings of the thread mill", n, expected, remedy));
        }
        let tan = libm::tan(angle_rad);
        // Where flank and crest meet, from the crest's middle.
        let [edge, half] = match crest {
            Crest::Flat(width) => {
                corner("height of the crest", width, f64::MAX)?;
                [radius_mm, 0.5 * width]
            }
            #[cfg(feature = "formats")]
            Crest::Round(radius) => {
                corner("radius of the crest", radius, radius_mm)?;
                let (cos, sin) = (libm::cos(angle_rad), libm::sin(angle_rad));
                [radius_mm - radius * (1.0 - sin), radius * cos]
            }
        };
        between("radius of the neck", neck_mm, [0.0, edge])?;
        let flank = (edge - neck_mm) * tan;
        let ring = 2.0 * (flank + half);
        if n > 1 {
            between("height of a ring", ring, [0.0, pitch_mm * (1.0 + SAME)])?;
        }
        let mut sections = Vec::new();
        for k in 0..n {
            let from = k as f64 * pitch_mm;
            let middle = from + flank + half;
            if k > 0 {
                // The heights of the rings grow, whatever the rounding.
                let below = sections.last().map_or(0.0, |s: &ProfileSection| s.height_mm);
                sections.push(line(neck_mm, from.max(below)));
            }
            sections.push(line(edge, from + flank));
            match crest {
                Crest::Flat(width) if width > 0.0 => sections.push(line(edge, middle + half)),
                Crest::Flat(_) => {}
                #[cfg(feature = "formats")]
                Crest::Round(radius) => {
                    sections.push(arc(edge, middle + half, [radius_mm - radius, middle]));
                }
            }
            sections.push(line(neck_mm, from + ring));
        }
        Profile::new(neck_mm, sections)
    }

    /// A thin disc on an arbor (slitting saw) above a cap, which does not cut and holds it: rim and both faces cut.
    ///
    /// # Errors
    /// If a length is not positive, or cap or arbor are not thinner than the disc.
    pub fn saw(
        radius_mm: f64,
        thickness_mm: f64,
        [cap_radius_mm, cap_height_mm]: [f64; 2],
        neck_radius_mm: f64,
    ) -> Result<Self> {
        let disc = Profile::t_slot(radius_mm, thickness_mm, 0.0, neck_radius_mm)?;
        corner("height of the cap", cap_height_mm, f64::MAX)?;
        if cap_height_mm == 0.0 {
            return Ok(disc);
        }
        between("radius of the cap", cap_radius_mm, [0.0, radius_mm])?;
        let cap = line(cap_radius_mm, cap_height_mm).non_cutting();
        let raised = |section: ProfileSection| ProfileSection {
            height_mm: section.height_mm + cap_height_mm,
            ..section
        };
        let mut sections = vec![cap, line(radius_mm, cap_height_mm)];
        sections.extend(disc.sections.into_iter().map(raised));
        Profile::new(cap_radius_mm, sections)
    }

    /// An ellipsoid of revolution, in a polygon about it that exceeds it by at most 0.22 %, up to its widest place or
    /// to where it is as thin as the neck.
    ///
    /// # Errors
    /// If a length is not positive.
    #[cfg(feature = "formats")]
    pub(crate) fn spheroid(radius_mm: f64, length_mm: f64, neck_radius_mm: f64) -> Result<Self> {
        between("radius of the ellipsoid", radius_mm, [0.0, f64::INFINITY])?;
        between("length of the ellipsoid", length_mm, [0.0, f64::INFINITY])?;
        corner("radius of the neck", neck_radius_mm, f64::MAX)?;
        let half = 0.5 * length_mm;
        let delta = 0.5 * FRAC_PI_2 / ELLIPSE_FACES as f64;
        // Corners of the polygon about the circle, stretched.
        let at = |k: usize| {
            let angle = (2 * k + 1) as f64 * delta;
            let by = 1.0 / libm::cos(delta);
            [by * radius_mm * libm::sin(angle), half * (1.0 - by * libm::cos(angle))]
        };
        let mut sections = Vec::new();
        let mut from = [at(0)[0], 0.0];
        for k in 1..2 * ELLIPSE_FACES {
            let to = at(k);
            let shrinks = to[0] < from[0];
            if shrinks && to[0] <= neck_radius_mm {
                // The neck comes out of it.
                let share = (from[0] - neck_radius_mm) / (from[0] - to[0]);
                let height = from[1] + share.clamp(0.0, 1.0) * (to[1] - from[1]);
                sections.push(line(neck_radius_mm.min(from[0]), height));
                break;
            }
            sections.push(line(to[0], to[1]));
            from = to;
        }
        Profile::new(at(0)[0], sections)
    }
}

/// No thread mill has more rings.
const MOST_RINGS: usize = 32;
/// Heights that differ by less are the same, as a share.
const SAME: f64 = 1e-9;
