//! The collision predicate: one order of `f32` operations, used by all engines.
//!
//! Nothing is fused, so the same bits come out at every vector width:
//!
//! 1. frame: rows `u, v, d` in `f64` from the direction (Duff et al. 2017), rounded to `f32` once;
//! 2. rotation: `x = (u.x·p.x + u.y·p.y) + u.z·p.z`, likewise `y` by `v` and `z` by `d`;
//! 3. reference point: base `s + corner·n` per component, rotated; then `z + lift`, and for a cutter
//!    with a side offset `x + k·n.x`, `y + k·n.y` with the rotated normal and `k = side/√(n.x²+n.y²)`
//!    (0 where that root is below 1e-6: a flat end lying on its face);
//! 4. collision: `z_j > z_c + height` and `dx·dx + dy·dy ≤ radius²` with `dx = x_j − x_c`; `height`
//!    and `radius²` are computed in `f64` and rounded once.

use crate::tool::cutter::Cutter;
use crate::tool::directions::basis;
use glam::Vec3;

/// One widening of a cutter as the predicate uses it: collides above `height` within `radius_squared`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepSquared {
    /// Height above the reference point, mm.
    pub height: f32,
    /// Squared radius, mm²; may be infinite.
    pub radius_squared: f32,
}

/// Rows `u, v, d` of the rotation into a direction's frame.
pub type Frame = [[f32; 3]; 3];

/// The frame of unit vector `direction`.
pub fn frame(direction: Vec3) -> Frame {
    let [u, v, _] = basis(direction.as_dvec3().normalize());
    [u.as_vec3(), v.as_vec3(), direction].map(|row| row.to_array())
}

/// `point` in the frame.
pub fn rotate(frame: &Frame, point: [f32; 3]) -> [f32; 3] {
    frame.map(|row| (row[0] * point[0] + row[1] * point[1]) + row[2] * point[2])
}

/// `point + length·normal`: where a query's reference point is before the direction is known.
pub fn base(point: Vec3, normal: Vec3, length: f32) -> [f32; 3] {
    [point.x + length * normal.x, point.y + length * normal.y, point.z + length * normal.z]
}

/// What depends on the direction in a reference point's place: `center` is the rotated base,
/// `normal` the rotated normal.
pub fn displace(center: [f32; 3], lift: f32, side: f32, normal: [f32; 3]) -> [f32; 3] {
    let across = (normal[0] * normal[0] + normal[1] * normal[1]).sqrt();
    let k = if side > 0.0 && across > 1e-6 { side / across } else { 0.0 };
    [center[0] + k * normal[0], center[1] + k * normal[1], center[2] + lift]
}

/// The steps of a cutter, as the predicate uses them.
pub fn steps(cutter: &Cutter) -> Vec<StepSquared> {
    let steps = cutter.steps().iter();
    steps
        .map(|step| StepSquared {
            height: step.height_mm as f32,
            radius_squared: (step.radius_mm * step.radius_mm) as f32,
        })
        .collect()
}

/// Whether `obstacle` collides with the cutter whose reference point is `center`, both rotated.
pub fn collides(steps: &[StepSquared], center: [f32; 3], obstacle: [f32; 3]) -> bool {
    let (dx, dy) = (obstacle[0] - center[0], obstacle[1] - center[1]);
    let squared = dx * dx + dy * dy;
    let within = |step: &&StepSquared| squared <= step.radius_squared;
    steps.iter().filter(within).any(|step| obstacle[2] > center[2] + step.height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::cutter::CutterParams;
    use crate::tool::directions::Directions;

    #[test]
    fn frames_keep_lengths_and_put_the_direction_upright() {
        for &d in Directions::fibonacci_hemisphere(100).unwrap().vectors() {
            let frame = frame(d);
            let up = rotate(&frame, d.to_array());
            assert!(up[0].abs() < 1e-6 && up[1].abs() < 1e-6 && (up[2] - 1.0).abs() < 1e-6);
            let p = Vec3::new(3.0, -4.0, 12.0);
            assert!((Vec3::from(rotate(&frame, p.to_array())).length() - 13.0).abs() < 1e-5);
        }
    }

    /// CR 1, CH 2, FR 5, FH 3: steps (1, 1), (3, 5), (6, ∞) above the center.
    #[test]
    fn every_face_of_the_cutter_is_where_the_definition_puts_it() {
        let params = CutterParams::from_array([1.0, 2.0, 5.0, 3.0]);
        let steps = steps(&Cutter::ball_end(params).unwrap());
        let hit = |x: f32, z: f32| collides(&steps, [10.0, 20.0, 30.0], [10.0 + x, 20.0, 30.0 + z]);
        assert!(!hit(0.0, 1.0), "h = CR is contact");
        assert!(hit(0.0, 1.1) && hit(1.0, 1.1), "r = CR is inside");
        assert!(!hit(1.1, 3.0) && hit(1.1, 3.1) && hit(5.0, 3.1), "holder");
        assert!(!hit(5.1, 6.0) && hit(5.1, 6.1) && hit(1e4, 6.1), "spindle");
        assert!(!hit(0.0, -5.0) && !hit(0.0, 0.0), "nothing below");
    }

    #[test]
    fn a_flat_end_stands_beside_the_wall_and_on_the_floor() {
        let beside = displace([0.0; 3], 0.0, 2.0, [0.6, 0.8, 0.0]);
        assert!((beside[0] - 1.2).abs() < 1e-6 && (beside[1] - 1.6).abs() < 1e-6);
        assert_eq!(displace([0.0; 3], 0.5, 2.0, [0.0, 0.0, 1.0]), [0.0, 0.0, 0.5]);
    }
}
