//! Blockers: points of the surface that were in the way of a pose, and by how much they are in the tool in others.

use super::PoseBox;
use crate::access::surface::tool::Outline;
use crate::simd::vector::MAX_LANES;
use crate::simd::{Float32, Isa, Kernel, Simd, Vector};
use glam::DVec3;

/// A point of the surface that was in the way, and the tolerance of its facet, mm.
#[derive(Debug, Clone, Copy)]
pub(in crate::access::surface) struct Blocker {
    pub point: DVec3,
    pub tolerance: f64,
}

/// Most blockers that a point of contact keeps.
const N_BLOCKERS: usize = 48;
/// The first so many, of its own surroundings, are kept for good.
const N_OWN: usize = 16;
/// Most triangles in the way that one test tells of.
const MOST_MET: usize = 6;

/// Blockers of one point of contact; the oldest that are not of its own surroundings give way.
#[derive(Debug, Default, Clone)]
pub(in crate::access::surface) struct Blockers {
    all: Vec<Blocker>,
    next: usize,
}

impl Blockers {
    /// Forgets all but these.
    pub fn begin(&mut self, own: impl Iterator<Item = Blocker>) {
        self.all.clear();
        self.all.extend(own.take(N_OWN));
        self.next = N_OWN;
    }

    pub fn iter(&self) -> impl Iterator<Item = &Blocker> {
        self.all.iter()
    }

    /// One more.
    pub fn push(&mut self, blocker: Blocker) {
        if self.all.len() < N_BLOCKERS {
            self.all.push(blocker);
            return;
        }
        if self.next >= N_BLOCKERS {
            self.next = N_OWN;
        }
        self.all[self.next] = blocker;
        self.next += 1;
    }
}

/// The tool as blockers see it: heights above the reference point and radii, before shrinking.
#[derive(Debug, Clone)]
pub(in crate::access::surface) struct Shape {
    steps: Vec<[f32; 2]>,
    corner: f32,
    side: f32,
    /// The ball alone, above its middle and below.
    is_ball: bool,
    /// More than all roundings, mm.
    margin: f32,
}

impl Shape {
    /// Of the whole tool, or of its ball alone.
    pub fn new(outline: &Outline, is_ball: bool, margin: f64) -> Self {
        let steps = outline.all_steps().iter().map(|step| step.map(|length| length as f32));
        Shape {
            steps: if is_ball { Vec::new() } else { steps.collect() },
            corner: outline.corner() as f32,
            side: outline.side() as f32,
            is_ball,
            margin: margin as f32,
        }
    }
}

impl Shape {
    /// Whether it is a ball end's ball alone.
    pub fn is_ball(&self) -> bool {
        self.is_ball
    }

    /// By how much a point is in the tool, and in which direction the tool has to move to be clear of it.
    fn depth(&self, p: DVec3, tolerance: f64) -> (f64, DVec3) {
        let [corner, side] = [self.corner, self.side].map(f64::from);
        let flat = p.truncate();
        let distance = flat.length();
        let out = -(flat / distance.max(f64::MIN_POSITIVE)).extend(0.0);
        let rounded = corner - tolerance;
        if self.is_ball {
            return (rounded - p.length(), -p.normalize_or_zero());
        }
        let within = flat.clamp_length_max(side).extend(p.z.max(0.0));
        let mut best = (rounded - p.distance(within), (within - p).normalize_or_zero());
        let steps = self.steps.iter().map(|step| step.map(f64::from));
        let shaft = [(-rounded).max(0.0) - tolerance, corner + side];
        for [height, radius] in steps.chain([shaft]) {
            let (above, inside) = (p.z - height - tolerance, radius - tolerance - distance);
            let depth = if above < inside { (above, DVec3::Z) } else { (inside, out) };
            if depth.0 > best.0 {
                best = depth;
            }
        }
        best
    }
}

/// Blockers about the point of contact, in the frame of the tool.
#[derive(Debug, Default)]
pub(super) struct Local {
    axes: [Vec<f32>; 3],
    tolerance: Vec<f32>,
    n: usize,
    /// Work space.
    depths: Vec<f32>,
}

impl Local {
    /// Number of blockers.
    pub fn len(&self) -> usize {
        self.n
    }

    pub fn clear(&mut self) {
        self.axes.iter_mut().for_each(Vec::clear);
        self.tolerance.clear();
        self.n = 0;
    }

    pub fn push(&mut self, p: DVec3, tolerance: f64) {
        if self.n == self.tolerance.len() {
            // Padding is below every tool.
            let padded = self.n + MAX_LANES;
            self.axes.iter_mut().for_each(|axis| axis.resize(padded, FAR_BELOW));
            self.tolerance.resize(padded, 0.0);
        }
        let k = self.n;
        self.axes.iter_mut().zip(p.to_array()).for_each(|(axis, x)| axis[k] = x as f32);
        self.tolerance[k] = tolerance as f32;
        self.n += 1;
    }

    /// By how much the deepest of the blockers from number `first` on is in the tool in all poses of a box: not
    /// positive if none is, and then no distance. For one pose the tool may be shrunk, or moved, by as much before none
    /// is.
    pub fn depth(&self, first: usize, shape: &Shape, poses: &PoseBox, isa: Isa) -> f64 {
        let start = first / MAX_LANES * MAX_LANES;
        let [middle, half] = [poses.middle, poses.half].map(|of| of.to_array().map(|x| x as f32));
        f64::from(isa.run(Depth { local: self, start, shape, middle, half }) - shape.margin)
    }

    /// By how much the deepest blocker is in the tool in a pose, and in which direction the tool has to move to be
    /// clear of it.
    pub fn deepest(&mut self, shape: &Shape, offset: DVec3, isa: Isa) -> (f64, DVec3) {
        let mut each = std::mem::take(&mut self.depths);
        each.clear();
        each.resize(self.tolerance.len(), FAR_BELOW);
        let middle = offset.to_array().map(|x| x as f32);
        let deepest = Depth { local: self, start: 0, shape, middle, half: [0.0; 3] };
        isa.run(EachDepth { of: deepest, each: &mut each });
        let deeper = |a: usize, b: usize| if each[b] > each[a] { b } else { a };
        let k = (0..self.n).reduce(deeper);
        self.depths = each;
        let Some(k) = k else { return (0.0, DVec3::ZERO) };
        let [x, y, z] = [0, 1, 2].map(|axis| f64::from(self.axes[axis][k]));
        shape.depth(DVec3::new(x, y, z) - offset, f64::from(self.tolerance[k]))
    }
}

/// Height of blockers that are none, mm.
const FAR_BELOW: f32 = -1e9;

struct Depth<'a> {
    local: &'a Local,
    start: usize,
    shape: &'a Shape,
    middle: [f32; 3],
    half: [f32; 3],
}

impl Depth<'_> {
    /// By how much blockers are in the tool, from number `k` on.
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, k: usize) -> S::F32 {
        let Depth { local, shape, middle, half, .. } = self;
        let all = |x: f32| S::F32::splat(simd, x);
        let zero = all(0.0);
        let (corner, side) = (all(shape.corner), all(shape.side));
        let at = |axis: usize| S::F32::load(simd, &local.axes[axis][k..]) - all(middle[axis]);
        // Farthest from the axis, and lowest, that a blocker is in these poses.
        let far = |x: S::F32, half: f32| x.max(zero - x) + all(half);
        let (x, y) = (far(at(0), half[0]), far(at(1), half[1]));
        let (z, high) = (at(2) - all(half[2]), at(2) + all(half[2]));
        let tolerance = S::F32::load(simd, &local.tolerance[k..]);
        let across = x * x + y * y;
        let rounded = corner - tolerance;
        if shape.is_ball {
            let upright = (zero - z).max(high);
            return rounded - (across + upright * upright).sqrt();
        }
        let distance = across.sqrt();
        let beyond = (distance - side).max(zero);
        let below = z.min(zero);
        let lifted = (zero - rounded).max(zero);
        let within = corner + side - tolerance - distance;
        let mut deepest = rounded - (beyond * beyond + below * below).sqrt();
        deepest = deepest.max((z - lifted).min(within));
        for &[height, radius] in &shape.steps {
            let above = z - all(height) - tolerance;
            deepest = deepest.max(above.min(all(radius) - tolerance - distance));
        }
        deepest
    }
}

impl Kernel for Depth<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> f32 {
        let mut deepest = S::F32::splat(simd, FAR_BELOW);
        let mut k = self.start;
        while k < self.local.n {
            deepest = deepest.max(self.at(simd, k));
            k += S::F32::LANES;
        }
        deepest.reduce_max()
    }
}

/// The depth of every blocker.
struct EachDepth<'a, 'e> {
    of: Depth<'a>,
    each: &'e mut [f32],
}

impl Kernel for EachDepth<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let mut k = 0;
        while k < self.of.local.n {
            self.of.at(simd, k).store(&mut self.each[k..]);
            k += S::F32::LANES;
        }
    }
}

/// What is in the way in a pose: none if it is free.
#[derive(Debug, Default)]
pub(in crate::access::surface) struct Met {
    all: [Option<Blocker>; MOST_MET],
    n: usize,
}

impl Met {
    /// Notes one more; whether there is room for no other.
    pub fn push(&mut self, blocker: Blocker) -> bool {
        if self.n < MOST_MET {
            self.all[self.n] = Some(blocker);
            self.n += 1;
        }
        self.n == MOST_MET
    }

    pub fn blockers(self) -> impl Iterator<Item = Blocker> {
        self.all.into_iter().flatten()
    }

    /// Whether nothing is in the way.
    pub fn is_free(&self) -> bool {
        self.n == 0
    }
}
