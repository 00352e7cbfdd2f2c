//! Kernels over all points of a direction: rotate points, find an obstacle in a cutter, count the cutters that
//! an obstacle is in.
//!
//! One body per kernel over the vectors of the instruction set. The order of every operation is that of
//! [`predicate`](super::predicate), multiply then add, never fused, so all instruction sets and the plain loops agree.

use super::predicate::{Frame, StepSquared};
use crate::simd::vector::MAX_LANES;
use crate::simd::{Float32, Isa, Kernel, Mask, Simd, Vector};
use crate::spatial::Coordinates;

/// Points that kernels look at together, with every instruction set: one vector or several.
pub const GROUP: usize = MAX_LANES;

/// The whole groups of an axis.
#[inline(always)]
pub fn groups(axis: &[f32]) -> &[[f32; GROUP]] {
    axis.as_chunks().0
}

/// The places of the bits that are set, ascending.
#[inline(always)]
pub fn set_bits(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = bits.trailing_zeros() as usize;
        let more = bits != 0;
        bits &= bits.wrapping_sub(1);
        more.then_some(place)
    })
}

/// Squared distances across the axis, lane by lane, in the order of the predicate.
#[inline(always)]
pub fn squared_distance<V: Vector>([x0, y0]: [V; 2], [x, y]: [V; 2]) -> V {
    let (dx, dy) = (x0 - x, y0 - y);
    dx * dx + dy * dy
}

/// Rotates the obstacles into a direction's frame; padding repeats the place of the last one, at height −∞.
pub fn rotate_obstacles(obstacles: &Coordinates, frame: &Frame, isa: Isa, to: &mut Coordinates) {
    isa.run(Rotate { frame, from: obstacles, to: &mut *to });
    to.pad_z(f32::NEG_INFINITY);
    if let Some(last) = to.n.checked_sub(1) {
        let [x, y, _] = to.get(last);
        to.x[last..].fill(x);
        to.y[last..].fill(y);
    }
}

/// `to = frame · from` for every point, padding included.
pub struct Rotate<'a> {
    /// Rows u, v, d of the rotation.
    pub frame: &'a Frame,
    /// Points in the part's frame.
    pub from: &'a Coordinates,
    /// Points in the direction's frame; as long as `from`.
    pub to: &'a mut Coordinates,
}

impl Kernel for Rotate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let [u, v, w] = self.frame;
        let (u, v, w) = (splat_row::<S>(s, u), splat_row::<S>(s, v), splat_row::<S>(s, w));
        let (from, to) = (self.from, self.to);
        let points = vectors::<S>(&from.x).zip(vectors::<S>(&from.y)).zip(vectors::<S>(&from.z));
        let to_x = to.x.chunks_exact_mut(S::LANES);
        let to_y = to.y.chunks_exact_mut(S::LANES);
        let to_z = to.z.chunks_exact_mut(S::LANES);
        for (((x, y), z), ((to_x, to_y), to_z)) in points.zip(to_x.zip(to_y).zip(to_z)) {
            let point = [S::F32::load(s, x), S::F32::load(s, y), S::F32::load(s, z)];
            dot(u, point).store(to_x);
            dot(v, point).store(to_y);
            dot(w, point).store(to_z);
        }
    }
}

#[inline(always)]
fn vectors<S: Simd>(axis: &[f32]) -> std::slice::ChunksExact<'_, f32> {
    axis.chunks_exact(S::LANES)
}

#[inline(always)]
fn splat_row<S: Simd>(s: S, row: &[f32; 3]) -> [S::F32; 3] {
    [S::F32::splat(s, row[0]), S::F32::splat(s, row[1]), S::F32::splat(s, row[2])]
}

#[inline(always)]
fn dot<V: Vector>([u, v, w]: [V; 3], [x, y, z]: [V; 3]) -> V {
    u * x + v * y + w * z
}

/// Does some obstacle collide with a cutter? Stops at the first group that holds one.
pub struct AnyObstacle<'a> {
    /// Reference point of the cutter in the direction's frame.
    pub center: [f32; 3],
    /// The cutter.
    pub steps: &'a [StepSquared],
    /// Obstacles in the direction's frame, padding at height −∞.
    pub obstacles: &'a Coordinates,
    /// Index of the one obstacle that does not count; `usize::MAX` for none.
    pub except: usize,
}

impl Kernel for AnyObstacle<'_> {
    /// Whether one collides, and how many obstacles were tested.
    type Output = (bool, usize);

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> (bool, usize) {
        let [cx, cy, cz] = self.center;
        let axis = [S::F32::splat(s, cx), S::F32::splat(s, cy)];
        let Coordinates { x, y, z, n } = self.obstacles;
        let obstacles = groups(x).iter().zip(groups(y)).zip(groups(z));
        for (group, ((x, y), z)) in obstacles.enumerate() {
            let mut hits = 0;
            for at in (0..GROUP).step_by(S::LANES) {
                let place = [S::F32::load(s, &x[at..]), S::F32::load(s, &y[at..])];
                let (z, squared) = (S::F32::load(s, &z[at..]), squared_distance(place, axis));
                let mut inside = S::F32::mask_from_bits(s, 0);
                for step in self.steps {
                    let above = S::F32::splat(s, cz + step.height);
                    let within = S::F32::splat(s, step.radius_squared);
                    inside = inside.or(z.gt(above).and(squared.le(within)));
                }
                hits |= inside.bits() << at;
            }
            if hits & !bit_of(self.except, group) != 0 {
                return (true, (*n).min(GROUP * (group + 1)));
            }
        }
        (false, *n)
    }
}

/// In how many of these cutters is an obstacle?
pub struct CountCenters<'a> {
    /// The obstacle in the direction's frame.
    pub obstacle: [f32; 3],
    /// The cutter.
    pub steps: &'a [StepSquared],
    /// Reference points in the direction's frame, padding at height +∞.
    pub centers: &'a Coordinates,
    /// Index of the one center that does not count; `usize::MAX` for none.
    pub except: usize,
}

impl Kernel for CountCenters<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> u64 {
        let [ox, oy, oz] = self.obstacle;
        let (place, oz) = ([S::F32::splat(s, ox), S::F32::splat(s, oy)], S::F32::splat(s, oz));
        let Coordinates { x, y, z, .. } = self.centers;
        let centers = groups(x).iter().zip(groups(y)).zip(groups(z));
        let mut count = 0;
        for (group, ((x, y), z)) in centers.enumerate() {
            let mut hits = 0;
            for at in (0..GROUP).step_by(S::LANES) {
                let axis = [S::F32::load(s, &x[at..]), S::F32::load(s, &y[at..])];
                let (z, squared) = (S::F32::load(s, &z[at..]), squared_distance(place, axis));
                let mut inside = S::F32::mask_from_bits(s, 0);
                for step in self.steps {
                    let above = z + S::F32::splat(s, step.height);
                    let within = S::F32::splat(s, step.radius_squared);
                    inside = inside.or(oz.gt(above).and(squared.le(within)));
                }
                hits |= inside.bits() << at;
            }
            count += u64::from((hits & !bit_of(self.except, group)).count_ones());
        }
        count
    }
}

/// The bit that `index` has in its group, 0 in other groups.
#[inline(always)]
fn bit_of(index: usize, group: usize) -> u32 {
    if index / GROUP == group { 1 << (index % GROUP) } else { 0 }
}
