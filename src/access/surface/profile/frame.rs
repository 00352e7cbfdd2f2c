//! The axes of a tool in the directions that are tried.

use super::axes::axes_of;
use crate::access::surface::bvh::Bvh;
use crate::access::surface::cells::Domain;
use crate::access::surface::tool::{Axes, axes};
use crate::tool::directions::Directions;
use glam::{DVec2, DVec3, Vec3};

/// The axes of the tool.
#[derive(Debug, Clone, Copy)]
pub(in crate::access::surface) struct Frame {
    pub axes: Axes,
    pub direction: Vec3,
    /// Whether the part suggests it.
    pub is_suggested: bool,
}

impl Frame {
    pub fn along(direction: Vec3) -> Frame {
        Frame { axes: axes(direction), direction, is_suggested: false }
    }

    /// Of a set, and those that the part suggests where the set stands for a domain.
    pub fn tested((directions, domain): (&Directions, Option<Domain>), bvh: &Bvh) -> Vec<Frame> {
        match domain {
            Some(domain) => Frame::of(directions, bvh, domain),
            None => Frame::all(directions),
        }
    }

    pub fn all(directions: &Directions) -> Vec<Frame> {
        directions.vectors().iter().map(|d| Frame::along(*d)).collect()
    }

    /// Of a set, and those that the part suggests within its domain.
    fn of(directions: &Directions, bvh: &Bvh, domain: Domain) -> Vec<Frame> {
        /// Directions nearer than this are one, as the sine of the angle.
        const SAME: f32 = 1e-5;
        let mut frames = Frame::all(directions);
        let both = axes_of(bvh).into_iter().flat_map(|axis| [axis, -axis]);
        for axis in both.filter(|axis| domain.holds(*axis)) {
            let direction = axis.as_vec3();
            let same = |frame: &&mut Frame| {
                let d = frame.direction;
                d.dot(direction) > 0.0 && d.cross(direction).length() < SAME
            };
            match frames.iter_mut().find(same) {
                Some(frame) => frame.is_suggested = true,
                None => frames.push(Frame { is_suggested: true, ..Frame::along(direction) }),
            }
        }
        frames
    }

    /// A place moved across the axis.
    pub fn moved(&self, tip: DVec3, by: DVec2) -> DVec3 {
        tip + self.axes[0] * by.x + self.axes[1] * by.y
    }

    pub fn local(&self, vector: DVec3) -> DVec3 {
        let [u, v, d] = self.axes;
        DVec3::new(vector.dot(u), vector.dot(v), vector.dot(d))
    }

    pub fn global(&self, local: DVec3) -> DVec3 {
        let [u, v, d] = self.axes;
        u * local.x + v * local.y + d * local.z
    }
}
