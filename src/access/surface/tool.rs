//! The cutter shrunk by the contact tolerance, and where it stands.

use crate::cutter::Cutter;
use crate::directions::basis;
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
    /// All its surface moved outward, mm.
    pub fn grown(self, by: f64) -> Self {
        match self {
            Tip::Round { ring, radius } => Tip::Round { ring, radius: radius + by },
            Tip::Flat { height, radius } => Tip::Flat { height: height - by, radius: radius + by },
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
    pub fn new(cutter: &Cutter) -> Self {
        Outline {
            corner: cutter.corner_mm(),
            side: cutter.side_mm(),
            steps: cutter.steps().iter().map(|step| [step.height_mm, step.radius_mm]).collect(),
        }
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

    /// Height and radius of every step after shrinking by `tolerance`; radii stop at 0.
    pub fn steps(&self, tolerance: f64) -> impl Iterator<Item = [f64; 2]> {
        let shrink =
            move |&[height, radius]: &[f64; 2]| [height + tolerance, (radius - tolerance).max(0.0)];
        self.steps.iter().map(shrink)
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

/// Unit vectors `u, v, d`: across the tool axis, and along it from tip to spindle.
pub(super) type Axes = [DVec3; 3];

/// The axes for direction `d`.
pub(super) fn axes(direction: Vec3) -> Axes {
    basis(direction.as_dvec3().normalize())
}

/// Where the tool is placed.
#[derive(Debug, Clone, Copy)]
pub(super) enum Contact {
    /// To touch the surface at a point with this outward normal.
    Surface { point: DVec3, normal: DVec3 },
    /// To have its tip at a point of space.
    Volume { tip: DVec3 },
}

impl Contact {
    /// The point that the tool touches.
    pub fn point(&self) -> DVec3 {
        match *self {
            Contact::Surface { point, .. } => point,
            Contact::Volume { tip } => tip,
        }
    }

    /// The outward normal there, for a site.
    pub fn normal(&self) -> Option<DVec3> {
        match *self {
            Contact::Surface { normal, .. } => Some(normal),
            Contact::Volume { .. } => None,
        }
    }

    /// Whether the reference point is the same in `f32` but for roundings: not where a small change of the normal
    /// moves a flat end from one side of the site to the other.
    pub fn is_steady(&self, outline: &Outline, direction: DVec3) -> bool {
        match *self {
            Contact::Surface { normal, .. } if outline.side > 0.0 => {
                normal.cross(direction).length_squared() > STEADY * STEADY
            }
            _ => true,
        }
    }

    /// The reference point of the tool along `direction`.
    pub fn reference_point(&self, outline: &Outline, direction: DVec3) -> DVec3 {
        match *self {
            Contact::Volume { tip } => tip + direction * outline.corner,
            Contact::Surface { point, normal } => {
                let center = point + normal * outline.corner;
                let across = normal - direction * normal.dot(direction);
                let length = across.length();
                // A flat end that lies on its face has its axis through the site.
                if outline.side == 0.0 || length <= FLAT {
                    return center;
                }
                center + across * (outline.side / length)
            }
        }
    }
}

/// Above this share across the direction, a rounded normal still has nearly the same direction across.
const STEADY: f64 = 0.3;
/// Below this share across the direction, a normal counts as parallel to it.
const FLAT: f64 = 1e-6;

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

    /// The corners of a triangle, as [`Stand::local`].
    #[inline(always)]
    pub fn triangle(&self, corners: &[DVec3; 3]) -> [DVec3; 3] {
        corners.map(|corner| self.local(corner))
    }
}

/// The part of a vector across the tool axis.
#[inline(always)]
pub(super) fn across(point: DVec3) -> DVec2 {
    point.truncate()
}
