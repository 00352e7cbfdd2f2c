//! What cuts of a tool in a pose.

use super::frame::Frame;
use super::label::ProfileTool;
use crate::access::surface::tool::Stand;
use glam::DVec3;

impl ProfileTool<'_> {
    /// Greatest radius of what cuts, mm.
    pub fn cutting_radius(&self) -> f64 {
        self.radius
    }

    /// How deep a point is in what cuts, mm; negative outside, `least` if that is more.
    pub fn cut_depth(&self, frame: &Frame, tip: DVec3, point: DVec3, least: f64) -> f64 {
        let stand = Stand { reference: tip, axes: frame.axes };
        self.outline.depth_in_cuts(stand.local(point), least)
    }

    /// Middle of a ball about what cuts.
    pub fn middle_of_cuts(&self, frame: &Frame, tip: DVec3) -> DVec3 {
        tip + frame.axes[2] * (0.5 * self.flutes)
    }

    /// Radius of the ball about what cuts, mm.
    pub fn reach_of_cuts(&self) -> f64 {
        (self.radius * self.radius + 0.25 * self.flutes * self.flutes).sqrt()
    }
}
