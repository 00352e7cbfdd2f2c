//! Poses: every way in which a tool along one direction comes within the finish tolerance of a point.
//!
//! # Definition
//!
//! A *pose* is a place of the tool's reference point. In direction `d` the cutting portion, grown by the finish
//! tolerance δ, touches the point `s` in a pose
//!
//! ```text
//! c = s + (corner + δ)·n + side·w        n: unit vector, n·d ≥ 0;  w = n across d, of length 1, or at most 1 where n = d
//! ```
//!
//! A surface with a normal is touched with an `n` within 84° of it: what only passes around its edge does not touch it.
//! These poses are the highest at their place: lower ones cut more and are in the way of more. They are a surface, dual
//! to the tip: a disc of radius `side` and the quarter of a torus around it. Unrolled along its meridians it is the
//! disc of radius `A = side + π/2·(corner + δ)`, and a pose moves no farther than its place on that disc:
//!
//! ```text
//! |u| ≤ side:   c − s = u + (corner + δ)·d
//! else:         φ = (|u| − side)/(corner + δ),  c − s = (side + (corner + δ)·sin φ)·u/|u| + (corner + δ)·cos φ·d
//! ```
//!
//! The point is **reached** in direction `d` iff some pose is free: neither a step nor the tip, each shrunk by the
//! tolerance of the facet, penetrates a facet. That is the surface which the tool leaves when it is dropped wherever it
//! may go passing within δ of the point: nothing jumps as `d` turns past the normal.

pub(super) mod blockers;
pub(super) mod search;

use super::tool::Outline;
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// The poses about a point, in the frame of the tool.
#[derive(Debug, Clone, Copy)]
pub(super) struct PoseSet {
    corner: f64,
    side: f64,
}

impl PoseSet {
    pub fn new(outline: &Outline) -> Self {
        PoseSet { corner: outline.corner() + outline.finish(), side: outline.side() }
    }

    /// Radius `A` of the disc that the poses are on, mm.
    pub fn radius(&self) -> f64 {
        self.side + FRAC_PI_2 * self.corner
    }

    /// From the point to the reference point, across the axis twice, then along it.
    pub fn offset(&self, at: DVec2) -> DVec3 {
        let length = at.length();
        if length <= self.side {
            return at.extend(self.corner);
        }
        let angle = ((length - self.side) / self.corner).min(FRAC_PI_2);
        let out = self.side + self.corner * libm::sin(angle);
        (at * (out / length)).extend(self.corner * libm::cos(angle))
    }

    /// In which directions a pose moves with its place on the disc: outward, and to the left of that.
    fn tangents(&self, at: DVec2) -> [DVec3; 2] {
        let outward = at.try_normalize().unwrap_or(DVec2::X);
        let angle = ((at.length() - self.side) / self.corner).clamp(0.0, FRAC_PI_2);
        let along = (outward * libm::cos(angle)).extend(-libm::sin(angle));
        [along, outward.perp().extend(0.0)]
    }

    /// The place on the disc whose pose is this far across the axis.
    fn across(&self, offset: DVec2) -> DVec2 {
        let length = offset.length();
        if length <= self.side {
            return offset;
        }
        let angle = libm::asin(((length - self.side) / self.corner).min(1.0));
        offset * ((self.side + self.corner * angle) / length)
    }

    /// Where a pose comes to that is moved by a length, in a unit direction, as far as that goes along the poses; none
    /// if they lie across it.
    fn pushed(&self, at: DVec2, away: DVec3, by: f64) -> Option<DVec2> {
        /// Where poses lie across the push more than this, what they curve matters.
        const ACROSS: f64 = 0.09;
        const LEAST: f64 = 1e-6;
        let [along, beside] = self.tangents(at);
        let push = DVec2::new(away.dot(along), away.dot(beside));
        let squared = push.length_squared();
        if squared >= ACROSS {
            let outward = at.try_normalize().unwrap_or(DVec2::X);
            let step = (outward * push.x + outward.perp() * push.y) * (by / squared);
            let limited = step.clamp_length_max(0.5 * self.radius());
            return Some((at + limited).clamp_length_max(self.radius()));
        }
        // Beside the flank poses rise steeply: what counts is how far they go across the axis.
        let flat = away.truncate();
        (flat.length_squared() > LEAST).then(|| {
            let step = flat * (by / flat.length_squared());
            self.across(self.offset(at).truncate() + step.clamp_length_max(self.side + self.corner))
        })
    }

    /// How far across the axis a pose is, as a share of its distance from the middle of the disc.
    fn contraction(&self, length: f64) -> f64 {
        if length <= self.side {
            return 1.0;
        }
        let angle = ((length - self.side) / self.corner).min(FRAC_PI_2);
        (self.side + self.corner * libm::sin(angle)) / length
    }

    fn height(&self, length: f64) -> f64 {
        let angle = ((length - self.side) / self.corner).clamp(0.0, FRAC_PI_2);
        self.corner * libm::cos(angle)
    }

    /// The offsets of all poses of a rectangle.
    fn around(&self, at: DVec2, half: DVec2) -> PoseBox {
        let nearest = (at.abs() - half).max(DVec2::ZERO).length();
        let farthest = (at.abs() + half).length();
        let [most, least] = [nearest, farthest].map(|length| self.contraction(length));
        let along = |at: f64, half: f64| {
            let ends = [at - half, at + half].map(|x| [x * most, x * least]);
            let low = ends[0][0].min(ends[0][1]);
            let high = ends[1][0].max(ends[1][1]);
            [0.5 * (low + high), 0.5 * (high - low)]
        };
        let ([x, dx], [y, dy]) = (along(at.x, half.x), along(at.y, half.y));
        let [high, low] = [nearest, farthest].map(|length| self.height(length));
        PoseBox {
            middle: DVec3::new(x, y, 0.5 * (low + high)),
            half: DVec3::new(dx, dy, 0.5 * (high - low)),
        }
    }

    /// The place on the disc whose pose touches with this normal, or nearly if that points up.
    fn place(&self, normal: DVec3) -> DVec2 {
        let flat = normal.truncate();
        let angle = libm::atan2(flat.length(), normal.z).min(FRAC_PI_2);
        flat.normalize_or_zero() * (self.side + self.corner * angle)
    }

    /// Whether the tool touches in some pose within `reach` of this one with a normal that belongs to a surface with
    /// the `normal`, in the frame of the tool; for a greater reach it may say so of poses farther away. Places of the
    /// corner within `rim` of each other count as one.
    ///
    /// The rim of a flat end has all normals between down and outward, and so has what is within the tolerances of it.
    pub fn touches(&self, at: DVec2, reach: f64, (normal, rim): (DVec3, f64)) -> bool {
        let length = at.length();
        if length - reach <= self.side && normal.z >= LEAST_COSINE {
            return true;
        }
        if length + reach + rim <= self.side {
            return false;
        }
        let flat = normal.truncate();
        let turn = if reach > 0.0 { flat.length() * (reach / length).min(2.0) } else { 0.0 };
        let outward = (flat.dot(at) / length + turn).min(flat.length());
        let angle = (length - self.side) / self.corner;
        let slack = (rim + reach) / self.corner;
        let [low, high] = [angle - slack, angle + slack].map(|a| a.clamp(0.0, FRAC_PI_2));
        let best = libm::atan2(outward, normal.z).clamp(low, high);
        outward * libm::sin(best) + normal.z * libm::cos(best) >= LEAST_COSINE
    }
}

/// A surface is touched with normals that have at least this cosine with its own: within 84°.
const LEAST_COSINE: f64 = 0.1;

/// Offsets of poses between these, along the axes of the tool.
#[derive(Debug, Clone, Copy)]
struct PoseBox {
    middle: DVec3,
    half: DVec3,
}
