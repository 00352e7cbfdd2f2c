//! Collision kernels: rotate points, find an obstacle in a cutter, count the cutters an obstacle is in.
//!
//! One body per kernel over [`Eights`](super::eights::Eights). The order of every operation is that of
//! `access::predicate`, multiply then add, never fused, so all levels and the plain loops agree.

use super::level::{Kernel, Simd};

/// Coordinates as three arrays, each padded to a multiple of [`PADDING`].
#[derive(Debug, Clone, Default)]
pub struct Coordinates {
    /// x, mm.
    pub x: Vec<f32>,
    /// y, mm.
    pub y: Vec<f32>,
    /// z, mm.
    pub z: Vec<f32>,
    /// Number of points without padding.
    pub n: usize,
}

/// Arrays of [`Coordinates`] have a length that is a multiple of this.
pub const PADDING: usize = 64;

impl Coordinates {
    /// `n` points at the origin, padding too.
    pub fn zeros(n: usize) -> Self {
        let zeros = vec![0.0; n.next_multiple_of(PADDING)];
        Coordinates { x: zeros.clone(), y: zeros.clone(), z: zeros, n }
    }

    /// Makes room for `n` points; what the places hold is unspecified.
    pub fn resize(&mut self, n: usize) {
        let len = n.next_multiple_of(PADDING);
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.resize(len, 0.0);
        }
        self.n = n;
    }

    /// Point `i`.
    pub fn get(&self, i: usize) -> [f32; 3] {
        [self.x[i], self.y[i], self.z[i]]
    }

    /// Puts `point` in place `i`.
    pub fn set(&mut self, i: usize, point: [f32; 3]) {
        [self.x[i], self.y[i], self.z[i]] = point;
    }

    /// Gives every place of the padding this height.
    pub fn pad_z(&mut self, z: f32) {
        self.z[self.n..].fill(z);
    }
}

/// One widening of a cutter as the predicate uses it: collides above `height` within `radius_squared`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepSquared {
    /// Height above the reference point, mm.
    pub height: f32,
    /// Squared radius, mm²; may be infinite.
    pub radius_squared: f32,
}

/// `to = frame · from` for every point, padding included; `frame` holds three rows.
pub struct Rotate<'a> {
    /// Rows u, v, d of the rotation.
    pub frame: &'a [[f32; 3]; 3],
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
        let (u, v, w) = (splat_row(s, u), splat_row(s, v), splat_row(s, w));
        let from = eights(&self.from.x).iter().zip(eights(&self.from.y)).zip(eights(&self.from.z));
        let Coordinates { x, y, z, .. } = self.to;
        let to = eights_mut(x).iter_mut().zip(eights_mut(y)).zip(eights_mut(z));
        for (((x, y), z), ((to_x, to_y), to_z)) in from.zip(to) {
            let (x, y, z) = (s.load(x), s.load(y), s.load(z));
            s.store(dot(s, u, x, y, z), to_x);
            s.store(dot(s, v, x, y, z), to_y);
            s.store(dot(s, w, x, y, z), to_z);
        }
    }
}

#[inline(always)]
fn splat_row<S: Simd>(s: S, row: &[f32; 3]) -> [S::Eight; 3] {
    [s.splat(row[0]), s.splat(row[1]), s.splat(row[2])]
}

#[inline(always)]
fn dot<S: Simd>(s: S, row: [S::Eight; 3], x: S::Eight, y: S::Eight, z: S::Eight) -> S::Eight {
    s.add(s.add(s.mul(row[0], x), s.mul(row[1], y)), s.mul(row[2], z))
}

/// Does some obstacle collide with a cutter? Stops at the first eight that hold one.
pub struct AnyObstacle<'a> {
    /// Reference point of the cutter in the direction's frame.
    pub centre: [f32; 3],
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
        let [cx, cy, cz] = self.centre;
        let (x0, y0) = (s.splat(cx), s.splat(cy));
        let obstacles = eights(&self.obstacles.x).iter().zip(eights(&self.obstacles.y));
        for (block, ((x, y), z)) in obstacles.zip(eights(&self.obstacles.z)).enumerate() {
            let (dx, dy) = (s.sub(s.load(x), x0), s.sub(s.load(y), y0));
            let squared = s.add(s.mul(dx, dx), s.mul(dy, dy));
            let z = s.load(z);
            let mut hits = 0;
            for step in self.steps {
                let (above, within) = (s.splat(cz + step.height), s.splat(step.radius_squared));
                hits |= s.greater_and_at_most(z, above, squared, within);
            }
            if hits & !bit_of(self.except, block) != 0 {
                return (true, self.obstacles.n.min(8 * block + 8));
            }
        }
        (false, self.obstacles.n)
    }
}

/// In how many of these cutters is an obstacle?
pub struct CountCentres<'a> {
    /// The obstacle in the direction's frame.
    pub obstacle: [f32; 3],
    /// The cutter.
    pub steps: &'a [StepSquared],
    /// Reference points in the direction's frame, padding at height +∞.
    pub centres: &'a Coordinates,
    /// Index of the one centre that does not count; `usize::MAX` for none.
    pub except: usize,
}

impl Kernel for CountCentres<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> u64 {
        let [ox, oy, oz] = splat_row(s, &self.obstacle);
        let centres = eights(&self.centres.x).iter().zip(eights(&self.centres.y));
        let mut count = 0;
        for (block, ((x, y), z)) in centres.zip(eights(&self.centres.z)).enumerate() {
            let (dx, dy) = (s.sub(ox, s.load(x)), s.sub(oy, s.load(y)));
            let squared = s.add(s.mul(dx, dx), s.mul(dy, dy));
            let z = s.load(z);
            let mut hits = 0;
            for step in self.steps {
                let above = s.add(z, s.splat(step.height));
                hits |= s.greater_and_at_most(oz, above, squared, s.splat(step.radius_squared));
            }
            count += u64::from((hits & !bit_of(self.except, block)).count_ones());
        }
        count
    }
}

/// The bit that `index` has in its block of eight, 0 in other blocks.
#[inline(always)]
fn bit_of(index: usize, block: usize) -> u32 {
    if index / 8 == block { 1 << (index % 8) } else { 0 }
}

/// Squared distances from a place to eight points, in the order of the predicate.
#[inline(always)]
pub(super) fn squared_distance<S: Simd>(
    s: S,
    x0: S::Eight,
    y0: S::Eight,
    x: &[f32; 8],
    y: &[f32; 8],
) -> S::Eight {
    let (dx, dy) = (s.sub(x0, s.load(x)), s.sub(y0, s.load(y)));
    s.add(s.mul(dx, dx), s.mul(dy, dy))
}

/// The whole eights of `a`.
#[inline(always)]
pub fn eights(a: &[f32]) -> &[[f32; 8]] {
    a.as_chunks().0
}

#[inline(always)]
pub(super) fn eights_mut(a: &mut [f32]) -> &mut [[f32; 8]] {
    a.as_chunks_mut().0
}
