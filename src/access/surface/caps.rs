//! Which directions a point of the surface closes: a cap of them.
//!
//! The point `p` is in a step `(t, R)` of the tool with reference point `c` in direction `d` iff, with `v = p − c`,
//! `v·d > t` and `|v|² − (v·d)² < R²`. Both say that the angle between `v` and `d` is small enough: below `acos(t/|v|)`
//! and `asin(R/|v|)`. So a point closes the cap about `v` with the angle
//!
//! ```text
//! α = max over steps of  min(acos(t/|v|), asin(min(1, R/|v|)))
//! ```
//!
//! and a cell of directions within ρ of its middle `m` is closed if `v·m > |v|·cos(α − ρ)`. The reference point of a
//! bull nose or flat end moves when the tool turns: across the axis, by the radius of the ring, by which the steps are
//! made narrower here.

use crate::simd::vector::MAX_LANES;
use crate::simd::{Isa, Kernel, Simd, Vector};
use glam::{DVec3, Vec3};

/// Points that a search keeps.
pub(super) const N_POINTS: usize = 64;
/// Lists of directions are padded to whole vectors of any instruction set.
const LANES: usize = MAX_LANES;
/// Cosine that no direction exceeds.
const NEVER: f32 = 2.0;

/// The tool as points see it: heights above the reference point and radii, a little smaller than they are.
#[derive(Debug, Clone)]
pub(super) struct Silhouette {
    steps: Vec<[f32; 2]>,
    /// The steps without regard to the drift of the reference point.
    whole: Vec<[f64; 2]>,
}

impl Silhouette {
    /// Of steps above the middle of the caps, smaller all around by `margin` and by `within`, by which reference points
    /// may be beside the middle.
    pub fn new(steps: impl Iterator<Item = [f64; 2]>, within: f64, margin: f64) -> Self {
        let shrink = |[height, radius]: [f64; 2], by: f64| [height + by, radius - by];
        let all: Vec<[f64; 2]> = steps.collect();
        let whole = all.iter().map(|step| shrink(*step, margin)).collect();
        let narrow = all.into_iter().map(|step| shrink(step, within + margin).map(|x| x as f32));
        let steps = narrow.filter(|[_, radius]| *radius > 0.0).collect();
        Silhouette { steps, whole }
    }

    /// Within which angle of a direction a point stays in some step for all poses within `within` mm, if the reference
    /// point moves by no more than `drift` mm per radian: turning by α changes height and distance from the axis by no
    /// more than α·(length + drift). `point` is relative to the reference point in that direction.
    pub fn stays(&self, point: DVec3, direction: DVec3, [drift, within]: [f64; 2]) -> f64 {
        let along = point.dot(direction);
        let distance = (point - direction * along).length();
        let margins =
            self.whole.iter().map(|[height, radius]| (along - height).min(radius - distance));
        (margins.fold(f64::NEG_INFINITY, f64::max) - within) / (point.length() + drift)
    }

    /// Cosine of the cap's angle for a point at 1/`inverse` mm; [`NEVER`] if it closes nothing.
    #[inline(always)]
    fn cosine(&self, inverse: f32) -> f32 {
        let mut cosine = NEVER;
        for [height, radius] in &self.steps {
            let share = (radius * inverse).min(1.0);
            cosine = cosine.min((1.0 - share * share).sqrt().max(height * inverse));
        }
        cosine
    }

    /// By what angle, nearly, a direction is within the cap of a point relative to the reference point; not positive
    /// outside.
    pub fn depth(&self, point: Vec3, direction: Vec3) -> f32 {
        let inverse = 1.0 / point.length_squared().max(LEAST).sqrt();
        let cosine = self.cosine(inverse);
        (point.dot(direction) * inverse - cosine) * scale(cosine)
    }
}

/// Squared distances below this count as this.
const LEAST: f32 = 1e-12;

#[inline(always)]
fn scale(cosine: f32) -> f32 {
    1.0 / (1.0 - cosine * cosine).max(1e-6).sqrt()
}

/// Points of the surface that were in the way, relative to the origin of the tree; the oldest gives way to a new one.
#[derive(Debug, Clone)]
pub(super) struct Blockers {
    points: [[f32; N_POINTS]; 3],
    n: usize,
    next: usize,
}

impl Default for Blockers {
    fn default() -> Self {
        Blockers { points: [[0.0; N_POINTS]; 3], n: 0, next: 0 }
    }
}

impl Blockers {
    /// All points.
    pub fn points(&self) -> impl DoubleEndedIterator<Item = Vec3> {
        let [x, y, z] = &self.points;
        (0..self.n).map(|k| Vec3::new(x[k], y[k], z[k]))
    }

    /// Keeps a point; its place.
    pub fn push(&mut self, point: Vec3) -> usize {
        let place = self.next;
        for (axis, x) in self.points.iter_mut().zip(point.to_array()) {
            axis[place] = x;
        }
        self.n = self.n.max(place + 1);
        self.next = (place + 1) % N_POINTS;
        place
    }
}

/// Caps of all blockers about one reference point.
#[derive(Debug, Clone)]
pub(super) struct Caps {
    axis: [[f32; N_POINTS]; 3],
    cosine: [f32; N_POINTS],
    scale: [f32; N_POINTS],
    n: usize,
}

impl Default for Caps {
    fn default() -> Self {
        let none = [0.0; N_POINTS];
        Caps { axis: [none; 3], cosine: none, scale: none, n: 0 }
    }
}

/// Directions, the middles of cells, and how far the caps reach there.
#[derive(Debug, Clone, Default)]
pub(super) struct Middles {
    axis: [Vec<f32>; 3],
    depth: Vec<f32>,
    /// Positive if the whole cell is closed.
    closing: Vec<f32>,
    n: usize,
}

impl Middles {
    /// Becomes these, in no cap.
    pub fn fill(&mut self, directions: impl Iterator<Item = Vec3>) {
        self.axis.iter_mut().for_each(Vec::clear);
        for direction in directions {
            self.axis.iter_mut().zip(direction.to_array()).for_each(|(axis, x)| axis.push(x));
        }
        self.n = self.axis[0].len();
        let len = self.n.next_multiple_of(LANES);
        self.axis.iter_mut().for_each(|axis| axis.resize(len, 0.0));
        for of_all in [&mut self.depth, &mut self.closing] {
            of_all.clear();
            of_all.resize(len, -NEVER);
        }
    }

    /// Number of directions.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Direction `k`.
    pub fn get(&self, k: usize) -> Vec3 {
        Vec3::new(self.axis[0][k], self.axis[1][k], self.axis[2][k])
    }

    /// By what angle direction `k` is within a cap, nearly; not positive if it is in none.
    pub fn depth(&self, k: usize) -> f32 {
        self.depth[k]
    }

    /// Whether a cap holds all of the cell.
    pub fn is_closed(&self, k: usize) -> bool {
        self.closing[k] > 0.0
    }

    /// Notes that cell `k` is closed.
    pub fn close(&mut self, k: usize) {
        self.closing[k] = NEVER;
    }

    /// Raises the depth of direction `k` to this if it is less.
    pub fn is_at_least(&mut self, k: usize, depth: f32) {
        self.depth[k] = self.depth[k].max(depth);
    }
}

struct CapDepths<'a> {
    middles: &'a mut Middles,
    caps: &'a Caps,
    range: std::ops::Range<usize>,
    /// Cosine beyond which a cap holds a whole cell.
    threshold: &'a [f32; N_POINTS],
}

impl Kernel for CapDepths<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let CapDepths { middles, caps, range, threshold } = self;
        let [x, y, z] = &middles.axis;
        let blocks = x.chunks_exact(S::F32::LANES).zip(y.chunks_exact(S::F32::LANES));
        let blocks = blocks.zip(z.chunks_exact(S::F32::LANES));
        let results = middles.depth.chunks_exact_mut(S::F32::LANES);
        let results = results.zip(middles.closing.chunks_exact_mut(S::F32::LANES));
        for (((x, y), z), (depth, closing)) in blocks.zip(results) {
            let x = S::F32::load(simd, x);
            let y = S::F32::load(simd, y);
            let z = S::F32::load(simd, z);
            let mut deepest = S::F32::load(simd, depth);
            let mut most = S::F32::load(simd, closing);
            for k in range.clone() {
                let s = S::F32::splat(simd, caps.axis[0][k]) * x
                    + S::F32::splat(simd, caps.axis[1][k]) * y
                    + S::F32::splat(simd, caps.axis[2][k]) * z;
                let beyond = s - S::F32::splat(simd, caps.cosine[k]);
                deepest = (beyond * S::F32::splat(simd, caps.scale[k])).max(deepest);
                most = (s - S::F32::splat(simd, threshold[k])).max(most);
            }
            deepest.store(depth);
            most.store(closing);
        }
    }
}

/// More than all roundings of a cosine.
const ROUNDING: f32 = 2e-6;

impl Caps {
    /// The caps of all blockers for a tool at `reference`, relative to the origin of the tree.
    pub fn place(&mut self, blockers: &Blockers, silhouette: &Silhouette, reference: Vec3) {
        (0..blockers.n).for_each(|k| self.place_one(k, blockers, silhouette, reference));
        self.n = blockers.n;
    }

    /// The cap of one blocker.
    pub fn place_one(
        &mut self,
        k: usize,
        blockers: &Blockers,
        silhouette: &Silhouette,
        reference: Vec3,
    ) {
        let [x, y, z] = &blockers.points;
        let point = Vec3::new(x[k], y[k], z[k]) - reference;
        let inverse = 1.0 / point.length_squared().max(LEAST).sqrt();
        let axis = point * inverse;
        for (to, x) in self.axis.iter_mut().zip(axis.to_array()) {
            to[k] = x;
        }
        self.cosine[k] = silhouette.cosine(inverse);
        self.scale[k] = scale(self.cosine[k]);
        self.n = blockers.n;
    }

    /// Takes all caps, or one, into account for cells of this radius.
    pub fn reach(&self, only: Option<usize>, radius: f64, middles: &mut Middles, isa: Isa) {
        let range = only.map_or(0..self.n, |k| k..k + 1);
        let [cos, sin] = [libm::cos(radius) as f32, libm::sin(radius) as f32];
        let mut threshold = [NEVER; N_POINTS];
        for k in range.clone() {
            let c = self.cosine[k];
            let within = c * cos + (1.0 - c * c).max(0.0).sqrt() * sin + ROUNDING;
            threshold[k] = if c < cos { within } else { NEVER };
        }
        isa.run(CapDepths { middles, caps: self, range, threshold: &threshold });
    }
}
