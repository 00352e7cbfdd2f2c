//! Boxes against boxes and queries, by the predicate's own operations.

use crate::simd::collide::StepSquared;
use crate::simd::level::Simd;

/// The box around some queries, in all lanes.
#[derive(Clone, Copy)]
pub struct Around<E> {
    x: [E; 2],
    y: [E; 2],
    z: [f32; 2],
}

impl<E: Copy> Around<E> {
    /// Around `least` to `greatest` of x, y and z.
    #[inline(always)]
    pub fn of<S: Simd<Eight = E>>(s: S, least: [E; 3], greatest: [E; 3]) -> Self {
        let rows = |[x, y, z]: [E; 3]| [x, y, z, x, x, x, x, x];
        let (mut lo, mut hi) = ([0.0; 8], [0.0; 8]);
        s.store(s.least_of_each(rows(least)), &mut lo);
        s.store(s.greatest_of_each(rows(greatest)), &mut hi);
        let ends = |axis: usize| [s.splat(lo[axis]), s.splat(hi[axis])];
        Around { x: ends(0), y: ends(1), z: [lo[2], hi[2]] }
    }
}

/// With an obstacle of this box (x0, x1, y0, y1, top), which lanes collide for certain, and which may?
#[inline(always)]
pub fn compare_lanes<S: Simd>(
    s: S,
    steps: &[StepSquared],
    packet: [&[f32; 8]; 3],
    sides: [f32; 5],
) -> (u32, u32) {
    let [x, y, z] = packet.map(|axis| s.load(axis));
    let [x0, x1, y0, y1, top] = sides.map(|side| s.splat(side));
    let (near_x, far_x) = near_and_far(s, [x, x], x0, x1);
    let (near_y, far_y) = near_and_far(s, [y, y], y0, y1);
    let (near, far) = (s.add(near_x, near_y), s.add(far_x, far_y));
    let (mut hit, mut some) = (0, 0);
    for step in steps {
        let above = s.add(z, s.splat(step.height));
        let within = s.splat(step.radius_squared);
        hit |= s.greater_and_at_most(top, above, far, within);
        some |= s.greater_and_at_most(top, above, near, within);
    }
    (hit, some)
}

/// With an obstacle of which of these eight boxes do all queries of another box collide for certain, and with
/// which may some of them? Boxes are x0, x1, y0, y1, top.
#[inline(always)]
pub fn compare_boxes<S: Simd>(
    s: S,
    steps: &[StepSquared],
    around: &Around<S::Eight>,
    sides: [&[f32; 8]; 5],
) -> (u32, u32) {
    let [x0, x1, y0, y1, top] = sides.map(|side| s.load(side));
    let (near_x, far_x) = near_and_far(s, around.x, x0, x1);
    let (near_y, far_y) = near_and_far(s, around.y, y0, y1);
    let (near, far) = (s.add(near_x, near_y), s.add(far_x, far_y));
    let (mut all, mut some) = (0, 0);
    for step in steps {
        let [least, greatest] = around.z.map(|z| s.splat(z + step.height));
        let within = s.splat(step.radius_squared);
        all |= s.greater_and_at_most(top, greatest, far, within);
        some |= s.greater_and_at_most(top, least, near, within);
    }
    (all, some)
}

/// Squared distances from the nearest pair and of the farthest pair of places of two intervals, the
/// first given by its ends.
#[inline(always)]
fn near_and_far<S: Simd>(
    s: S,
    [c0, c1]: [S::Eight; 2],
    least: S::Eight,
    greatest: S::Eight,
) -> (S::Eight, S::Eight) {
    let (past_least, to_greatest) = (s.sub(c1, least), s.sub(greatest, c0));
    let near = s.min(s.splat(0.0), s.min(past_least, to_greatest));
    let far = s.max(past_least, to_greatest);
    (s.mul(near, near), s.mul(far, far))
}
