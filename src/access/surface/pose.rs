//! Poses: every way in which a tool along one direction comes within the finish tolerance of a point.
//!
//! # Definition
//!
//! A *pose* is a place of the tool's reference point. In direction `d` the cutting portion, grown by the finish tolerance δ,
//! touches the point `s` in a pose
//!
//! ```text
//! c = s + (corner + δ)·n + side·w        n: unit vector, n·d ≥ 0;  w = n across d, of length 1, or at most 1 where n = d
//! ```
//!
//! A surface with a normal is touched with an `n` within 84° of it: what only passes around its edge does not touch it. These poses are the highest at their place: lower ones cut more and are in the way of more. They are a surface, dual to the
//! tip: a disc of radius `side` and the quarter of a torus around it. Unrolled along its meridians it is the disc of radius
//! `A = side + π/2·(corner + δ)`, and a pose moves no farther than its place on that disc:
//!
//! ```text
//! |u| ≤ side:   c − s = u + (corner + δ)·d
//! else:         φ = (|u| − side)/(corner + δ),  c − s = (side + (corner + δ)·sin φ)·u/|u| + (corner + δ)·cos φ·d
//! ```
//!
//! The point is **reached** in direction `d` iff some pose is free: neither a step nor the tip, each shrunk by the tolerance of
//! the facet, penetrates a facet. That is the surface which the tool leaves when it is dropped wherever it may go passing
//! within δ of the point: nothing jumps as `d` turns past the normal.
//!
//! # Search
//!
//! ```text
//! cells = a rectangle around all poses, or around those that are not too deep in the plane of the surface
//! while there is a cell: take the one whose middle is least deep in the tool that known blockers close
//!     some blocker is in the tool in all its poses: closed
//!     none is in the middle: test the triangles there: free → reached; else points of what penetrates become blockers
//!     smaller than the resolution: given up
//!     else: cut in half across the longer side
//! ```
//!
//! The poses of a cell are in a box; a blocker is in the tool for all of them if it is where the box puts it farthest from the axis and lowest.

use super::tool::{Axes, Contact, Outline};
use crate::directions::basis;
use crate::simd::vector::MAX_LANES;
use crate::simd::{Float32, Isa, Kernel, Simd, Vector};
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// The poses about a point, in the frame of the tool.
#[derive(Debug, Clone, Copy)]
pub(super) struct PoseSet {
    corner: f64,
    side: f64,
}

impl PoseSet {
    pub fn new(outline: &Outline) -> Self {
        PoseSet { corner: outline.corner() + outline.finish(), side: outline.side() }
    }

    /// Radius `A` of the disc that the poses are on, mm.
    pub fn radius(&self) -> f64 {
        self.side + FRAC_PI_2 * self.corner
    }

    /// From the point to the reference point, across the axis twice, then along it.
    pub fn offset(&self, at: DVec2) -> DVec3 {
        let length = at.length();
        if length <= self.side {
            return at.extend(self.corner);
        }
        let angle = ((length - self.side) / self.corner).min(FRAC_PI_2);
        let out = self.side + self.corner * libm::sin(angle);
        (at * (out / length)).extend(self.corner * libm::cos(angle))
    }

    /// In which directions a pose moves with its place on the disc: outward, and to the left of that.
    fn tangents(&self, at: DVec2) -> [DVec3; 2] {
        let outward = at.try_normalize().unwrap_or(DVec2::X);
        let angle = ((at.length() - self.side) / self.corner).clamp(0.0, FRAC_PI_2);
        let along = (outward * libm::cos(angle)).extend(-libm::sin(angle));
        [along, outward.perp().extend(0.0)]
    }

    /// The place on the disc whose pose is this far across the axis.
    fn across(&self, offset: DVec2) -> DVec2 {
        let length = offset.length();
        if length <= self.side {
            return offset;
        }
        let angle = libm::asin(((length - self.side) / self.corner).min(1.0));
        offset * ((self.side + self.corner * angle) / length)
    }

    /// Where a pose comes to that is moved by a length, in a unit direction, as far as that goes along the poses; none if they lie across it.
    fn pushed(&self, at: DVec2, away: DVec3, by: f64) -> Option<DVec2> {
        /// Where poses lie across the push more than this, what they curve matters.
        const ACROSS: f64 = 0.09;
        const LEAST: f64 = 1e-6;
        let [along, beside] = self.tangents(at);
        let push = DVec2::new(away.dot(along), away.dot(beside));
        let squared = push.length_squared();
        if squared >= ACROSS {
            let outward = at.try_normalize().unwrap_or(DVec2::X);
            let step = (outward * push.x + outward.perp() * push.y) * (by / squared);
            let limited = step.clamp_length_max(0.5 * self.radius());
            return Some((at + limited).clamp_length_max(self.radius()));
        }
        // Beside the flank poses rise steeply: what counts is how far they go across the axis.
        let flat = away.truncate();
        (flat.length_squared() > LEAST).then(|| {
            let step = flat * (by / flat.length_squared());
            self.across(self.offset(at).truncate() + step.clamp_length_max(self.side + self.corner))
        })
    }

    /// How far across the axis a pose is, as a share of its distance from the middle of the disc.
    fn contraction(&self, length: f64) -> f64 {
        if length <= self.side {
            return 1.0;
        }
        let angle = ((length - self.side) / self.corner).min(FRAC_PI_2);
        (self.side + self.corner * libm::sin(angle)) / length
    }

    fn height(&self, length: f64) -> f64 {
        let angle = ((length - self.side) / self.corner).clamp(0.0, FRAC_PI_2);
        self.corner * libm::cos(angle)
    }

    /// The offsets of all poses of a rectangle.
    fn around(&self, at: DVec2, half: DVec2) -> PoseBox {
        let nearest = (at.abs() - half).max(DVec2::ZERO).length();
        let farthest = (at.abs() + half).length();
        let [most, least] = [nearest, farthest].map(|length| self.contraction(length));
        let along = |at: f64, half: f64| {
            let ends = [at - half, at + half].map(|x| [x * most, x * least]);
            let low = ends[0][0].min(ends[0][1]);
            let high = ends[1][0].max(ends[1][1]);
            [0.5 * (low + high), 0.5 * (high - low)]
        };
        let ([x, dx], [y, dy]) = (along(at.x, half.x), along(at.y, half.y));
        let [high, low] = [nearest, farthest].map(|length| self.height(length));
        PoseBox {
            middle: DVec3::new(x, y, 0.5 * (low + high)),
            half: DVec3::new(dx, dy, 0.5 * (high - low)),
        }
    }

    /// The place on the disc whose pose touches with this normal, or nearly if that points up.
    fn place(&self, normal: DVec3) -> DVec2 {
        let flat = normal.truncate();
        let angle = libm::atan2(flat.length(), normal.z).min(FRAC_PI_2);
        flat.normalize_or_zero() * (self.side + self.corner * angle)
    }

    /// Whether the tool touches in some pose within `reach` of this one with a normal that belongs to a surface with the `normal`, in the frame of the
    /// tool; for a greater reach it may say so of poses farther away. Places of the corner within `rim` of each other count as one.
    ///
    /// The rim of a flat end has all normals between down and outward, and so has what is within the tolerances of it.
    pub fn touches(&self, at: DVec2, reach: f64, (normal, rim): (DVec3, f64)) -> bool {
        let length = at.length();
        if length - reach <= self.side && normal.z >= LEAST_COSINE {
            return true;
        }
        if length + reach + rim <= self.side {
            return false;
        }
        let flat = normal.truncate();
        let turn = if reach > 0.0 { flat.length() * (reach / length).min(2.0) } else { 0.0 };
        let outward = (flat.dot(at) / length + turn).min(flat.length());
        let angle = (length - self.side) / self.corner;
        let slack = (rim + reach) / self.corner;
        let [low, high] = [angle - slack, angle + slack].map(|a| a.clamp(0.0, FRAC_PI_2));
        let best = libm::atan2(outward, normal.z).clamp(low, high);
        outward * libm::sin(best) + normal.z * libm::cos(best) >= LEAST_COSINE
    }
}

/// A surface is touched with normals that have at least this cosine with its own: within 84°.
const LEAST_COSINE: f64 = 0.1;

/// A point of the surface that was in the way, and the tolerance of its facet, mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Blocker {
    pub point: DVec3,
    pub tolerance: f64,
}

/// Most blockers that a point of contact keeps.
const N_BLOCKERS: usize = 48;
/// The first so many, of its own surroundings, are kept for good.
const N_OWN: usize = 16;
/// Most triangles in the way that one test tells of.
pub(super) const MOST_MET: usize = 6;

/// Blockers of one point of contact; the oldest that are not of its own surroundings give way.
#[derive(Debug, Default, Clone)]
pub(super) struct Blockers {
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
pub(super) struct Shape {
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
struct Local {
    axes: [Vec<f32>; 3],
    tolerance: Vec<f32>,
    n: usize,
    /// Work space.
    depths: Vec<f32>,
}

impl Local {
    fn clear(&mut self) {
        self.axes.iter_mut().for_each(Vec::clear);
        self.tolerance.clear();
        self.n = 0;
    }

    fn push(&mut self, p: DVec3, tolerance: f64) {
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

    /// By how much the deepest of the blockers from number `first` on is in the tool in all poses of a box: not positive if none is, and then no
    /// distance. For one pose the tool may be shrunk, or moved, by as much before none is.
    fn depth(&self, first: usize, shape: &Shape, poses: &PoseBox, isa: Isa) -> f64 {
        let start = first / MAX_LANES * MAX_LANES;
        let [middle, half] = [poses.middle, poses.half].map(|of| of.to_array().map(|x| x as f32));
        f64::from(isa.run(Depth { local: self, start, shape, middle, half }) - shape.margin)
    }

    /// By how much the deepest blocker is in the tool in a pose, and in which direction the tool has to move to be clear of it.
    fn deepest(&mut self, shape: &Shape, offset: DVec3, isa: Isa) -> (f64, DVec3) {
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

/// Offsets of poses between these, along the axes of the tool.
#[derive(Debug, Clone, Copy)]
struct PoseBox {
    middle: DVec3,
    half: DVec3,
}

/// A rectangle of places on the disc of poses.
#[derive(Debug, Clone, Copy)]
struct Cell {
    at: DVec2,
    half: DVec2,
    /// Of the pose in the middle.
    depth: f64,
    /// Whether a blocker is in the way of all poses.
    is_closed: bool,
}

impl Cell {
    /// Its halves across the longer side.
    fn halves(&self) -> [Cell; 2] {
        let shift = match self.half.x >= self.half.y {
            true => DVec2::new(0.5 * self.half.x, 0.0),
            false => DVec2::new(0.0, 0.5 * self.half.y),
        };
        [-shift, shift].map(|shift| Cell {
            at: self.at + shift,
            half: self.half - shift.abs(),
            ..*self
        })
    }
}

/// What a search is over.
pub(super) struct Around<'a> {
    shape: &'a Shape,
    poses: PoseSet,
    /// The point of contact.
    point: DVec3,
    /// Across the axis toward where the normal leans, and beside that; along the axis.
    axes: Axes,
    own: Option<OwnPlane>,
    /// No place on the disc is farther along either axis from that of the site's own pose, mm.
    within: f64,
    /// Tolerances at the point: see [`PoseSet::touches`], mm.
    rim: f64,
}

/// A normal leans against the direction by at least this.
const LEANING: f64 = 1e-7;
/// Greatest ratio of distances on the disc and of poses.
const APART: f64 = FRAC_PI_2;

/// The plane of a surface about the point of contact, in the frame of the tool: poses that cut it deeper than the tolerances are closed.
#[derive(Debug, Clone, Copy)]
struct OwnPlane {
    normal: DVec3,
    /// Height of a tip's reference point above the plane when the grown tip touches it.
    touching: f64,
    /// How much less is granted; infinite if the surface is not known to go on about the point.
    slack: f64,
    /// The place on the disc of the pose that is farthest from the plane.
    best: DVec2,
}

impl OwnPlane {
    /// Whether all poses of a cell are too deep in the plane; the axes of the disc are those of the normal.
    fn closes(&self, poses: &PoseSet, cell: &Cell) -> bool {
        let nearest = self.best.clamp(cell.at - cell.half, cell.at + cell.half);
        self.touching - self.normal.dot(poses.offset(nearest)) > self.slack
    }
}

/// What is in the way in a pose: none if it is free.
#[derive(Debug, Default)]
pub(super) struct Met {
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

    /// Whether nothing is in the way.
    pub fn is_free(&self) -> bool {
        self.n == 0
    }
}

/// Memory of a search.
#[derive(Debug)]
pub(super) struct PoseSearch {
    cells: Vec<Cell>,
    local: Local,
    isa: Isa,
}

impl Default for PoseSearch {
    fn default() -> Self {
        PoseSearch { cells: Vec::new(), local: Local::default(), isa: Isa::active() }
    }
}

/// How far a search goes before it gives up.
pub(super) struct Limits {
    /// Most poses that are tested against triangles.
    n_tests: usize,
    /// Most pushes of the site's own pose before that.
    n_pushes: usize,
    /// So many are tested even where a blocker is known, for deeper ones.
    n_deeper: usize,
    /// Most cells.
    n_cells: usize,
}

impl Limits {
    /// At most so many tests.
    pub fn tests(n_tests: usize) -> Self {
        Limits {
            n_tests,
            n_pushes: MOST_PUSHES,
            n_deeper: N_DEEPER,
            n_cells: CELLS_PER_TEST * n_tests,
        }
    }
}

/// Pushes after which nothing is found.
const MOST_PUSHES: usize = 40;
/// Tests for deeper blockers.
const N_DEEPER: usize = 3;
/// A test costs as much as so many cells.
const CELLS_PER_TEST: usize = 10;

impl<'a> Around<'a> {
    /// `slack` is how deep poses may be in the plane of the surface, `within` how far from the site's own they may be, `rim` the tolerances there.
    pub fn new(
        shape: &'a Shape,
        poses: PoseSet,
        contact: &Contact,
        direction: DVec3,
        [slack, within, rim]: [f64; 3],
    ) -> Self {
        let leaning = contact.normal.map(|normal| normal - direction * normal.dot(direction));
        // Where it hardly leans, its roundings point anywhere.
        let leaning = leaning.filter(|leaning| leaning.length() > LEANING);
        let u = leaning.map_or(basis(direction)[0], DVec3::normalize);
        let axes = [u, direction.cross(u), direction];
        let own = contact.normal.map(|normal| {
            let normal = DVec3::new(normal.dot(u), 0.0, normal.dot(direction));
            let touching = poses.corner + poses.side * normal.x.abs();
            OwnPlane { normal, touching, slack, best: poses.place(normal) }
        });
        // Places on the disc are a little farther apart than poses.
        let within = APART * within;
        Around { shape, poses, point: contact.point, axes, own, within, rim }
    }

    fn local(&self, offset: DVec3) -> DVec3 {
        let [u, v, d] = self.axes;
        DVec3::new(offset.dot(u), offset.dot(v), offset.dot(d))
    }

    /// Keeps what was met.
    fn note(&self, met: Met, local: &mut Local, blockers: &mut Blockers) {
        for blocker in met.all.into_iter().flatten() {
            local.push(self.local(blocker.point - self.point), blocker.tolerance);
            blockers.push(blocker);
        }
    }

    /// Where to try next after a pose with something in the way: pushed along the poses away from what is deepest in the tool. In a hollow as wide as the
    /// tool that finds the one place; where it finds none, there may be one.
    fn pushed(&self, at: DVec2, local: &mut Local, isa: Isa) -> Option<DVec2> {
        /// Farther than what is deepest, mm.
        const BEYOND_MM: f64 = 1e-5;
        let (depth, away) = local.deepest(self.shape, self.poses.offset(at), isa);
        let next = (depth > 0.0).then(|| self.poses.pushed(at, away, depth + BEYOND_MM))??;
        (self.is_within(next) && self.may_touch(next, 0.0)).then_some(next)
    }

    /// Whether a place on the disc is near enough to that of the site's own pose.
    fn is_within(&self, at: DVec2) -> bool {
        self.own.is_none_or(|own| (at - own.best).abs().max_element() <= self.within)
    }

    fn may_touch(&self, at: DVec2, reach: f64) -> bool {
        self.own.is_none_or(|own| self.poses.touches(at, reach, (own.normal, self.rim)))
    }

    /// Whether some pose of a cell is on the disc, touches the surface and is not too deep in its plane.
    fn is_possible(&self, cell: &Cell) -> bool {
        let nearest = (cell.at.abs() - cell.half).max(DVec2::ZERO).length();
        nearest <= self.poses.radius()
            && self.may_touch(cell.at, cell.half.length())
            && !self.own.is_some_and(|own| own.closes(&self.poses, cell))
    }

    /// All poses, or all that are not too deep in the plane of the surface.
    fn first_cell(&self) -> Option<Cell> {
        let radius = self.poses.radius();
        let around = match self.own {
            Some(own) if self.within.is_finite() => {
                [own.best - self.within, own.best + self.within]
            }
            _ => [DVec2::splat(-radius), DVec2::splat(radius)],
        };
        let [low, high] = around.map(|p| p.clamp(DVec2::splat(-radius), DVec2::splat(radius)));
        let cell = Cell {
            at: 0.5 * (low + high),
            half: 0.5 * (high - low),
            depth: f64::NEG_INFINITY,
            is_closed: false,
        };
        self.is_possible(&cell).then_some(cell)
    }

    /// The cell with the blockers from number `first` on taken into account.
    fn measured(&self, cell: Cell, local: &Local, first: usize, isa: Isa) -> Cell {
        let middle = PoseBox { middle: self.poses.offset(cell.at), half: DVec3::ZERO };
        let depth = local.depth(first, self.shape, &middle, isa);
        // What is not in the way in the middle closes nothing.
        let is_closed = depth > 0.0
            && local.depth(first, self.shape, &self.poses.around(cell.at, cell.half), isa) > 0.0;
        Cell { depth: cell.depth.max(depth), is_closed: cell.is_closed || is_closed, ..cell }
    }

    /// The reference point of a pose.
    fn reference(&self, at: DVec2) -> DVec3 {
        let [u, v, d] = self.axes;
        let o = self.poses.offset(at);
        self.point + u * o.x + v * o.y + d * o.z
    }
}

impl PoseSearch {
    /// Searches for a free pose; `test` is given reference points.
    pub fn run(
        &mut self,
        around: &Around,
        blockers: &mut Blockers,
        (resolution, limits): (f64, &Limits),
        mut test: impl FnMut(DVec3) -> Met,
    ) -> Searched {
        self.local.clear();
        for blocker in &blockers.all {
            self.local.push(around.local(blocker.point - around.point), blocker.tolerance);
        }
        self.begin(around);
        match self.slide(around, blockers, limits, &mut test) {
            Searched::GivenUp => self.search(around, blockers, (resolution, limits), test),
            searched => searched,
        }
    }

    /// The cells that known blockers leave.
    fn begin(&mut self, around: &Around) {
        /// Halvings of the first cell.
        const N_HALVINGS: usize = 3;
        let PoseSearch { cells, local, isa } = self;
        cells.clear();
        cells.extend(around.first_cell());
        for _ in 0..N_HALVINGS {
            for k in 0..cells.len() {
                let [one, other] = cells[k].halves();
                cells[k] = one;
                cells.push(other);
            }
        }
        cells.retain(|cell| around.is_possible(cell));
        cells.iter_mut().for_each(|cell| *cell = around.measured(*cell, local, 0, *isa));
        cells.retain(|cell| !cell.is_closed);
    }

    /// Tests a pose; notes what is in the way, which closes cells.
    fn test(
        &mut self,
        around: &Around,
        reference: DVec3,
        blockers: &mut Blockers,
        test: &mut impl FnMut(DVec3) -> Met,
    ) -> bool {
        let met = test(reference);
        if met.is_free() {
            return true;
        }
        let PoseSearch { cells, local, isa } = self;
        let first = local.n;
        around.note(met, local, blockers);
        cells.iter_mut().for_each(|cell| *cell = around.measured(*cell, local, first, *isa));
        cells.retain(|cell| !cell.is_closed);
        false
    }

    /// From the site's own pose, pushed again and again.
    fn slide(
        &mut self,
        around: &Around,
        blockers: &mut Blockers,
        limits: &Limits,
        test: &mut impl FnMut(DVec3) -> Met,
    ) -> Searched {
        let mut at = around.own.map_or(DVec2::ZERO, |own| own.best);
        for _ in 0..limits.n_pushes {
            if self.cells.is_empty() {
                return Searched::Closed;
            }
            let reference = around.reference(at);
            if self.test(around, reference, blockers, test) {
                return Searched::Free(reference);
            }
            let Some(next) = around.pushed(at, &mut self.local, self.isa) else { break };
            at = next;
        }
        if self.cells.is_empty() { Searched::Closed } else { Searched::GivenUp }
    }

    /// Best first.
    fn search(
        &mut self,
        around: &Around,
        blockers: &mut Blockers,
        (resolution, limits): (f64, &Limits),
        mut test: impl FnMut(DVec3) -> Met,
    ) -> Searched {
        let (mut n_tests, mut n_cells) = (0, 1);
        let mut outcome = Searched::Closed;
        while let Some(k) = shallowest(&self.cells) {
            let cell = self.cells.swap_remove(k);
            // Covered and not closed: deeper blockers may close it.
            let is_shallow = cell.depth <= 0.0 || n_tests < limits.n_deeper;
            if is_shallow && around.may_touch(cell.at, 0.0) {
                if n_tests == limits.n_tests {
                    return Searched::GivenUp;
                }
                n_tests += 1;
                let reference = around.reference(cell.at);
                let first = self.local.n;
                if self.test(around, reference, blockers, &mut test) {
                    return Searched::Free(reference);
                }
                if around.measured(cell, &self.local, first, self.isa).is_closed {
                    continue;
                }
            }
            if cell.half.length() <= resolution || n_cells > limits.n_cells {
                outcome = Searched::GivenUp;
                continue;
            }
            for half in cell.halves() {
                if around.is_possible(&half) {
                    let half = Cell { depth: f64::NEG_INFINITY, ..half };
                    let half = around.measured(half, &self.local, 0, self.isa);
                    self.cells.extend((!half.is_closed).then_some(half));
                    n_cells += 1;
                }
            }
        }
        outcome
    }
}

/// What a search comes to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Searched {
    /// The reference point of a free pose.
    Free(DVec3),
    /// Blockers close all poses.
    Closed,
    /// Neither was found within the limits.
    GivenUp,
}

impl Searched {
    /// The reference point of a free pose.
    pub fn free(self) -> Option<DVec3> {
        match self {
            Searched::Free(reference) => Some(reference),
            Searched::Closed | Searched::GivenUp => None,
        }
    }
}

/// The cell with the least depth; the first among equals.
fn shallowest(cells: &[Cell]) -> Option<usize> {
    let better = |a: usize, b: usize| if cells[b].depth < cells[a].depth { b } else { a };
    (0..cells.len()).reduce(better)
}
