//! Profiles of circle segment mills: the flank is an arc of a great radius, its corners are tangent to it.

use super::families::{arc, between, between_angles, corner, line};
use super::{Profile, ProfileSection};
use crate::Result;

/// A circle in the plane of radius and height.
#[derive(Clone, Copy)]
struct Circle {
    center: [f64; 2],
    radius: f64,
}

impl Circle {
    /// Where a circle inside this one touches it.
    fn touches(&self, inner: &Circle) -> [f64; 2] {
        let [c, z] = self.center;
        let by = self.radius / (self.radius - inner.radius);
        [c + by * (inner.center[0] - c), z + by * (inner.center[1] - z)]
    }

    fn arc_to(&self, [radius_mm, height_mm]: [f64; 2]) -> ProfileSection {
        arc(radius_mm, height_mm, self.center)
    }

    /// The circle of this radius inside `self` that reaches as low as height 0, or as high as `top`.
    fn corner_at(&self, radius: f64, height: f64) -> Result<Circle> {
        let [c, z] = self.center;
        let (inner, away) = (self.radius - radius, height - z);
        between("corner of the flank", radius, [-f64::EPSILON, self.radius])?;
        between("distance of the corner from the flank's center", away.abs(), [-1.0, inner])?;
        Ok(Circle { center: [c + (inner * inner - away * away).sqrt(), height], radius })
    }
}

impl Profile {
    /// A flank that is an arc (barrel mill), of the greatest radius at the height of its center, which may be below or
    /// above the flutes' middle, with rounded corners at the lower and the upper end of the flutes.
    ///
    /// # Errors
    /// If a length is not positive, the arc is smaller than the radius, or the corners do not fit.
    pub fn barrel_at(
        radius_mm: f64,
        arc_radius_mm: f64,
        center_height_mm: f64,
        [lower_mm, upper_mm]: [f64; 2],
        flutes_mm: f64,
    ) -> Result<Self> {
        between("radius of the mill", radius_mm, [0.0, f64::INFINITY])?;
        between("height of the flutes", flutes_mm, [0.0, f64::INFINITY])?;
        between("radius of the flank's arc", arc_radius_mm, [radius_mm, f64::INFINITY])?;
        corner("corner of the lower end", lower_mm, radius_mm.min(flutes_mm))?;
        corner("corner of the upper end", upper_mm, radius_mm.min(flutes_mm - lower_mm))?;
        let center = [radius_mm - arc_radius_mm, center_height_mm];
        let flank = Circle { center, radius: arc_radius_mm };
        let lower = flank.corner_at(lower_mm, lower_mm)?;
        let upper = flank.corner_at(upper_mm, flutes_mm - upper_mm)?;
        let start = lower.center[0];
        between("radius at the lower end", start, [-f64::EPSILON, radius_mm + f64::EPSILON])?;
        between("radius at the upper end", upper.center[0], [0.0, f64::INFINITY])?;
        let mut sections = Vec::new();
        if lower_mm > 0.0 {
            sections.push(lower.arc_to(flank.touches(&lower)));
        }
        sections.push(flank.arc_to(flank.touches(&upper)));
        if upper_mm > 0.0 {
            sections.push(upper.arc_to([upper.center[0], flutes_mm]));
        }
        Profile::new(start.max(0.0), sections)
    }

    /// A flank that is an arc (barrel, oval or circle segment mill), widest in the middle of its flutes, above a
    /// rounded lower end.
    ///
    /// # Errors
    /// If a length is not positive, the arc is smaller than the radius, or it leaves nothing of the lower end.
    pub fn barrel(
        radius_mm: f64,
        arc_radius_mm: f64,
        corner_mm: f64,
        flutes_mm: f64,
    ) -> Result<Self> {
        let middle = 0.5 * (flutes_mm + corner_mm);
        Profile::barrel_at(radius_mm, arc_radius_mm, middle, [corner_mm, 0.0], flutes_mm)
    }

    /// A ball whose flank goes on as an arc, up to the greatest radius (oval or tangent form mill).
    ///
    /// # Errors
    /// If a length is not positive, the ball is not smaller than the radius, or the arc not greater.
    pub fn oval(radius_mm: f64, arc_radius_mm: f64, tip_radius_mm: f64) -> Result<Self> {
        between("radius of the tip", tip_radius_mm, [0.0, radius_mm])?;
        between("radius of the flank's arc", arc_radius_mm, [radius_mm, f64::INFINITY])?;
        let (inner, aside) = (arc_radius_mm - tip_radius_mm, arc_radius_mm - radius_mm);
        let height = tip_radius_mm + (inner * inner - aside * aside).sqrt();
        let flank = Circle { center: [-aside, height], radius: arc_radius_mm };
        let tip = Circle { center: [0.0, tip_radius_mm], radius: tip_radius_mm };
        let touch = flank.touches(&tip);
        Profile::new(0.0, vec![tip.arc_to(touch), flank.arc_to([radius_mm, height])])
    }

    /// A rounded lower end and a rounded upper edge, and between them an arc for a flank (conical barrel, taper form
    /// mill). The cone that touches both corners leans by `angle_rad` from the axis; `flat_mm` is the radius of a flat
    /// lower end, 0 for a ball.
    ///
    /// # Errors
    /// If a length is negative, the angle is not between 0 and a right angle, the arc is not greater than the corners,
    /// or the upper edge is not wider than the lower end.
    pub fn tapered_barrel(
        flat_mm: f64,
        radius_mm: f64,
        arc_radius_mm: f64,
        angle_rad: f64,
        [lower_mm, upper_mm]: [f64; 2],
    ) -> Result<Self> {
        between("radius of the mill", radius_mm, [0.0, f64::INFINITY])?;
        between_angles("angle of the flank", angle_rad, [0.0, std::f64::consts::FRAC_PI_2])?;
        corner("corner of the upper edge", upper_mm, radius_mm)?;
        corner("flat of the lower end", flat_mm, radius_mm)?;
        corner("corner of the lower end", lower_mm, radius_mm)?;
        between("radius of the flank's arc", arc_radius_mm, [radius_mm, f64::INFINITY])?;
        // Both corners are on the same side of their common tangent cone.
        let (cos, sin) = (libm::cos(angle_rad), libm::sin(angle_rad));
        let wider = radius_mm - upper_mm - flat_mm;
        let rise = (wider * cos + upper_mm - lower_mm) / sin;
        between("height of the flank", rise, [0.0, f64::INFINITY])?;
        let lower = Circle { center: [flat_mm, lower_mm], radius: lower_mm };
        let upper = Circle { center: [radius_mm - upper_mm, lower_mm + rise], radius: upper_mm };
        // The flank's center is as far from both as its radius exceeds theirs, toward the axis.
        let (a, b) = (arc_radius_mm - lower_mm, arc_radius_mm - upper_mm);
        let span = libm::hypot(wider, rise);
        let along = (a * a - b * b + span * span) / (2.0 * span);
        between("distance of the corners", along.abs(), [-1.0, a])?;
        let aside = (a * a - along * along).sqrt();
        let (x, z) = (wider / span, rise / span);
        let center = [flat_mm + along * x - aside * z, lower_mm + along * z + aside * x];
        let flank = Circle { center, radius: arc_radius_mm };
        let touch = flank.touches(&upper);
        // Else it would be wider than the upper edge.
        between("height of the flank's center", center[1], [touch[1], f64::INFINITY])?;
        let mut sections = Vec::new();
        if lower_mm > 0.0 {
            sections.push(lower.arc_to(flank.touches(&lower)));
        }
        sections.push(flank.arc_to(touch));
        if upper_mm > 0.0 {
            sections.push(upper.arc_to([radius_mm, upper.center[1]]));
        }
        Profile::new(flat_mm, sections)
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
        between("radius of the mill", radius_mm, [0.0, f64::INFINITY])?;
        between("radius of the lens", cap_radius_mm, [radius_mm, f64::INFINITY])?;
        corner("corner of the lens", corner_mm, radius_mm)?;
        // Center of the corner: within the cap by the corner, and that far from the cylinder.
        let (inner, side) = (cap_radius_mm - corner_mm, radius_mm - corner_mm);
        let height = cap_radius_mm - (inner * inner - side * side).sqrt();
        between("height of the flutes", flutes_mm, [height, f64::INFINITY])?;
        let cap = Circle { center: [0.0, cap_radius_mm], radius: cap_radius_mm };
        let edge = Circle { center: [side, height], radius: corner_mm };
        let mut sections = vec![cap.arc_to(cap.touches(&edge))];
        if corner_mm > 0.0 {
            sections.push(edge.arc_to([radius_mm, height]));
        }
        sections.push(line(radius_mm, flutes_mm));
        Profile::new(0.0, sections)
    }
}
