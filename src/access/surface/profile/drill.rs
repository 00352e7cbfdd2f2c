//! What of a drill or a reamer touches.

use super::body::normal_at;
use crate::tool::cutter::Profile;
use glam::DVec3;

/// Normals of walls are this near to what is across the axis, as sine of the angle, and to those of a cone, radians.
pub(super) const NEAR: f64 = 0.12;

/// A cylinder that cuts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Margin {
    /// Radius and height of its lower end, mm.
    pub radius: f64,
    pub low: f64,
}

/// A cone that cuts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DrillCone {
    /// Radius and height of its ends, mm.
    pub ends: [[f64; 2]; 2],
    /// Angle of its normal above the plane across the axis, radians.
    pub normal: f64,
}

/// What of a drill touches.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Drill {
    /// From below, one of each radius: of a center drill that of its pilot, of a step drill several.
    pub margins: Vec<Margin>,
    /// From below: of a center drill its point and its countersink; none of a reamer without a lead.
    pub cones: Vec<DrillCone>,
}

/// Radii closer than this are the same, mm.
const SAME_MM: f64 = 1e-9;

impl Drill {
    /// None if the profile is of no drill.
    pub fn of(profile: &Profile) -> Option<Self> {
        let (mut margins, mut cones) = (Vec::<Margin>::new(), Vec::new());
        for piece in profile.pieces().iter().filter(|piece| piece.cuts && piece.arc.is_none()) {
            let [[r0, z0], [r1, z1]] = piece.ends;
            if z1 <= z0 {
                continue;
            }
            if (r1 - r0).abs() > SAME_MM {
                let cone = DrillCone { ends: piece.ends, normal: normal_at(piece, 0) };
                cones.extend((r1 > r0).then_some(cone));
            } else if margins.last().is_none_or(|last| r0 > last.radius + SAME_MM) {
                margins.push(Margin { radius: r0, low: z0 });
            }
        }
        (profile.is_drill() && !margins.is_empty()).then_some(Drill { margins, cones })
    }

    /// The cones that touch a surface of this normal, in the frame of the tool.
    pub fn cones_by(&self, normal: DVec3) -> impl Iterator<Item = &DrillCone> {
        let toward = libm::asin((-normal.z).clamp(-1.0, 1.0));
        self.cones.iter().filter(move |cone| (toward - cone.normal).abs() <= NEAR)
    }

    /// Whether a surface of this normal, in the frame of the tool, is touched by a cone.
    pub fn is_by_cone(&self, normal: DVec3) -> bool {
        self.cones_by(normal).next().is_some()
    }
}
