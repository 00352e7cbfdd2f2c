//! What of a drill or a reamer touches.

use super::body::normal_at;
use crate::cutter::Profile;
use glam::DVec3;

/// Normals of walls are this near to what is across the axis, as sine of the angle, and to those of a cone, radians.
pub(super) const NEAR: f64 = 0.12;

/// What of a drill touches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Drill {
    /// Radius and lower end of the margin, mm.
    pub radius: f64,
    pub margin: f64,
    /// Radius and height of the cone's ends, and the angle of its normal above the plane across the axis; none of a
    /// reamer.
    pub cone: Option<([[f64; 2]; 2], f64)>,
}

impl Drill {
    /// None if the profile is of no drill.
    pub fn of(profile: &Profile) -> Option<Self> {
        let radius = profile.cutting_radius_mm();
        let cutting = || profile.pieces().into_iter().filter(|piece| piece.cuts);
        let is_margin = |ends: [[f64; 2]; 2]| ends.iter().all(|end| end[0] >= radius - 1e-9);
        let margin = cutting().find(|piece| is_margin(piece.ends))?.ends[0][1];
        let is_cone = |ends: [[f64; 2]; 2]| ends[0][0] < ends[1][0] && ends[0][1] < ends[1][1];
        let cone = cutting().find(|piece| piece.arc.is_none() && is_cone(piece.ends));
        let cone = cone.map(|piece| (piece.ends, normal_at(&piece, 0)));
        profile.is_drill().then_some(Drill { radius, margin, cone })
    }

    /// Whether a surface of this normal, in the frame of the tool, is touched by the cone.
    pub fn is_by_cone(&self, normal: DVec3) -> bool {
        let toward = libm::asin((-normal.z).clamp(-1.0, 1.0));
        self.cone.is_some_and(|(_, angle)| (toward - angle).abs() <= NEAR)
    }
}
