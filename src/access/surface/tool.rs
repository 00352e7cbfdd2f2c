//! The cutter shrunk by the contact tolerance, and where it stands.

use crate::tool::cutter::{Cutter, Step};
use crate::tool::directions::basis;
use crate::{Error, Result};
use glam::{DVec2, DVec3, Vec3};

/// Everything of a cutter that can meet a surface, in the order tip, first step, …, last step.
#[derive(Debug, Clone)]
pub(super) struct Outline {
    /// Corner radius of the tip, mm.
    corner: f64,
    /// Radius of the circle that the corner's center runs on, mm; 0 for a ball.
    side: f64,
    /// Height above the reference point and radius of every step, mm.
    steps: Vec<[f64; 2]>,
    cutter: Cutter,
    /// How much may be left where it touches, mm.
    finish: f64,
}

/// The tip of a shrunk cutter, about its reference point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Tip {
    /// All points within `radius` of the horizontal disc of radius `ring`: a ball if `ring` is 0.
    Round { ring: f64, radius: f64 },
    /// A horizontal disc at this height.
    Flat { height: f64, radius: f64 },
}

impl Tip {
    /// Height of the lowest point and radius.
    pub fn lower_end(self) -> [f64; 2] {
        match self {
            Tip::Round { ring, radius } => [-radius, ring + radius],
            Tip::Flat { height, radius } => [height, radius],
        }
    }

    /// Height and radius of the cylinder without an upper end that the tip continues as.
    pub fn shaft(self) -> [f64; 2] {
        match self {
            Tip::Round { ring, radius } => [0.0, ring + radius],
            Tip::Flat { height, radius } => [height, radius],
        }
    }
}

impl Outline {
    pub fn new(cutter: &Cutter, finish: f64) -> Self {
        Outline {
            corner: cutter.corner_mm(),
            side: cutter.side_mm(),
            steps: cutter.steps().iter().map(pair).collect(),
            cutter: cutter.clone(),
            finish,
        }
    }

    /// The same tool with a margin of this about the steps that do not cut; negative: all steps are shrunk.
    pub fn with_margin(&self, margin: f64) -> Self {
        let steps = self.cutter.steps_with_margin(margin).iter().map(pair).collect();
        Outline { steps, ..self.clone() }
    }

    /// Height of the reference point above the tip of the tool itself, whatever stock it leaves, mm.
    pub fn above_tip(&self) -> f64 {
        self.corner - self.cutter.allowance_mm()
    }

    /// How much may be left where it touches, mm.
    pub fn finish(&self) -> f64 {
        self.finish
    }

    /// Radius of the cutter's lower end, mm.
    pub fn radius(&self) -> f64 {
        self.corner + self.side
    }

    /// Radius of the tip's corner, mm.
    pub fn corner(&self) -> f64 {
        self.corner
    }

    /// Distance of the corner's center from the axis, mm.
    pub fn side(&self) -> f64 {
        self.side
    }

    /// Greatest finite length of the cutter, mm.
    pub fn size(&self) -> f64 {
        let lengths = self.steps.iter().flatten().map(|length| length.abs());
        lengths.filter(|length| length.is_finite()).fold(self.radius(), f64::max)
    }

    /// The tip after shrinking by `tolerance`, which must be below [`Outline::radius`].
    pub fn tip(&self, tolerance: f64) -> Tip {
        if self.corner > tolerance {
            return Tip::Round { ring: self.side, radius: self.corner - tolerance };
        }
        Tip::Flat { height: tolerance - self.corner, radius: self.radius() - tolerance }
    }

    /// Height and radius of every step, mm.
    pub fn all_steps(&self) -> &[[f64; 2]] {
        &self.steps
    }

    /// Height and radius of every step after shrinking by `tolerance`; radii stop at 0.
    pub fn steps(&self, tolerance: f64) -> impl Iterator<Item = [f64; 2]> {
        let shrink =
            move |&[height, radius]: &[f64; 2]| [height + tolerance, (radius - tolerance).max(0.0)];
        self.steps.iter().map(shrink)
    }

    /// Height and radius of the steps that cut.
    pub fn cutting(&self) -> impl Iterator<Item = [f64; 2]> {
        self.cutter.cutting_steps().iter().map(pair)
    }

    /// Height and radius of the steps that do not cut.
    pub fn upper(&self) -> impl Iterator<Item = [f64; 2]> {
        self.cutter.upper_steps().iter().map(pair)
    }

    /// A tolerance for this cutter.
    ///
    /// # Errors
    /// If it is not positive or not below the radius of the cutter's lower end.
    pub fn check_tolerance(&self, tolerance: f64) -> Result<f64> {
        let radius = self.radius();
        if tolerance > 0.0 && tolerance < radius {
            return Ok(tolerance);
        }
        let expected = format!("positive, below the cutter's radius of {radius} mm");
        let remedy = "0.01 mm suits most parts; at 0 every tangent wall would block";
        Err(Error::argument("contact tolerance", tolerance, expected, remedy))
    }
}

fn pair(step: &Step) -> [f64; 2] {
    [step.height_mm, step.radius_mm]
}

/// Unit vectors `u, v, d`: across the tool axis, and along it from tip to spindle.
pub(super) type Axes = [DVec3; 3];

/// The axes for direction `d`.
pub(super) fn axes(direction: Vec3) -> Axes {
    basis(direction.as_dvec3().normalize())
}

/// What the tool is to touch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contact {
    /// Point of the surface, or of space.
    pub point: DVec3,
    /// The outward normal of a surface.
    pub normal: Option<DVec3>,
}

impl Contact {
    /// Where the middle of the tip's corner is when a ball of it touches: fixed for a site, below the spindle for a
    /// point of space.
    pub fn corner_center(&self, outline: &Outline, direction: DVec3) -> DVec3 {
        self.point + self.normal.unwrap_or(direction) * outline.corner
    }

    /// The reference point of the tool along `direction` that touches with its normal: for a direction along the normal
    /// the axis is above the site, and moves to where the rim touches as the direction turns away.
    pub fn reference_point(&self, outline: &Outline, direction: DVec3) -> DVec3 {
        let center = self.corner_center(outline, direction);
        let Some(normal) = self.normal.filter(|_| outline.side > 0.0) else { return center };
        let across = normal - direction * normal.dot(direction);
        center + across * (outline.side / across.length().max(OBLIQUE))
    }

    /// As [`Contact::reference_point`], with the rim at the site even where the direction is nearly the normal.
    pub fn on_rim(&self, outline: &Outline, direction: DVec3) -> DVec3 {
        let center = self.corner_center(outline, direction);
        let normal = self.normal.unwrap_or(direction);
        let across = normal - direction * normal.dot(direction);
        // Of a direction along the normal rounding alone is left, which may be along it.
        match across.length() < ALONG {
            true => center,
            false => center + across.normalize() * outline.side,
        }
    }

    /// Whether [`Contact::reference_point`] is where [`access`](crate::access) puts it, so that points decide.
    pub fn is_by_points(&self, outline: &Outline, direction: DVec3) -> bool {
        self.normal.is_none() || self.is_oblique(outline, direction)
    }

    /// Whether only the rim of a flat or bull-nose end can touch, in about one place.
    pub fn is_oblique(&self, outline: &Outline, direction: DVec3) -> bool {
        let slope = |normal: DVec3| normal.cross(direction).length_squared();
        outline.side == 0.0 || self.normal.is_some_and(|n| slope(n) >= OBLIQUE * OBLIQUE)
    }
}

/// Sine of the angle between normal and direction from which on a flat end touches with its rim alone.
pub(super) const OBLIQUE: f64 = 0.3;

/// Sine of the angle up to which a direction is along the normal.
const ALONG: f64 = 1e-9;

/// Where a tool stands: its reference point and axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stand {
    pub reference: DVec3,
    pub axes: Axes,
}

impl Stand {
    /// `point` relative to the reference point: across the axis twice, then along it.
    #[inline(always)]
    pub fn local(&self, point: DVec3) -> DVec3 {
        let offset = point - self.reference;
        let [u, v, d] = self.axes;
        DVec3::new(offset.dot(u), offset.dot(v), offset.dot(d))
    }

    /// The point that is this relative to the reference point.
    pub fn back(&self, p: DVec3) -> DVec3 {
        let [u, v, d] = self.axes;
        self.reference + u * p.x + v * p.y + d * p.z
    }

    /// The corners of a triangle, as [`Stand::local`].
    #[inline(always)]
    pub fn triangle(&self, corners: &[DVec3; 3]) -> [DVec3; 3] {
        // No closure: in some callers it is not inlined.
        let [a, b, c] = *corners;
        [self.local(a), self.local(b), self.local(c)]
    }
}

/// The part of a vector across the tool axis.
#[inline(always)]
pub(super) fn across(point: DVec3) -> DVec2 {
    point.truncate()
}
