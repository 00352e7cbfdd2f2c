//! One tool at one place against all triangles, through the tree.

use super::bvh::{Bvh, Level};
use super::labels::KNIFE_EDGE_MM;
use super::penetrate;
use super::tool::{Outline, Stand, Tip, across};
use super::verdict::Verdict;
use glam::{DVec2, DVec3};

/// A cutter shrunk by one tolerance, ready to be tested.
#[derive(Debug, Clone)]
pub(super) struct Probe {
    steps: Vec<[f64; 2]>,
    tip: Tip,
    /// The tip, then the steps.
    levels: Vec<Level>,
}

impl Probe {
    /// `reach` is the greatest distance of a reference point from the middle of the triangles, mm.
    pub fn new(outline: &Outline, tolerance: f64, bvh: &Bvh, reach: f64) -> Self {
        let steps: Vec<[f64; 2]> = outline.steps(tolerance).collect();
        let tip = outline.tip(tolerance);
        let lower_end = match tip {
            Tip::Round { ring, radius } => [-radius, ring + radius],
            Tip::Flat { height, radius } => [height, radius],
        };
        let size = outline.size() + reach;
        let coarse = enclosing(&steps);
        let levels = std::iter::once(&lower_end).chain(&coarse);
        let levels = levels.map(|&[height, radius]| bvh.level(height, radius, size)).collect();
        Probe { steps, tip, levels }
    }

    /// The steps alone: `shrunk` may be negative, for steps that are grown. There is no tip.
    pub fn of_steps(outline: &Outline, shrunk: f64, bvh: &Bvh, reach: f64) -> Self {
        let steps: Vec<[f64; 2]> = outline.steps(shrunk).collect();
        let size = outline.size() + shrunk.abs() + reach;
        let levels = enclosing(&steps).into_iter();
        let levels = levels.map(|[height, radius]| bvh.level(height, radius, size)).collect();
        Probe { steps, tip: Tip::Flat { height: f64::INFINITY, radius: 0.0 }, levels }
    }

    /// For places where the ball is known to be clear of the surface: of the tip only what is above the ball's middle is
    /// left to test, and this is as wide as the ball.
    pub fn without_ball(&self, outline: &Outline, bvh: &Bvh, reach: f64) -> Self {
        let Tip::Round { ring: 0.0, radius } = self.tip else { return self.clone() };
        let mut probe = self.clone();
        probe.tip = Tip::Flat { height: 0.0, radius };
        probe.levels[0] = bvh.level(0.0, radius, outline.size() + reach);
        probe
    }

    /// The verdict over all triangles. The one that a step penetrated last is tried first.
    pub fn verdict(&self, bvh: &Bvh, stand: &Stand, scratch: &mut Scratch) -> Verdict {
        self.verdict_with(bvh, stand, scratch, |_| true)
    }

    /// As [`Probe::verdict`]; `enough` is told of the triangles that the steps or the tip penetrate, until it says so of one of
    /// the former.
    pub fn verdict_with<'p>(
        &'p self,
        bvh: &Bvh,
        stand: &Stand,
        scratch: &mut Scratch,
        mut enough: impl FnMut(&[DVec3; 3]) -> bool,
    ) -> Verdict {
        let Scratch { stack, last, n_triangles, n_queries, knife_edge } = scratch;
        *n_queries += 1;
        *knife_edge = false;
        let (mut collides, mut gouges) = (false, false);
        let first = *last;
        let mut levels = &self.levels[..];
        let mut test = |place: u32, levels: &mut &'p [Level]| {
            *n_triangles += 1;
            let corners = stand.triangle(bvh.triangle(place));
            // What a slightly greater tool is clear of, this one is clear of for certain.
            if self.step_penetrates(&corners, KNIFE_EDGE_MM) {
                if self.step_penetrates(&corners, 0.0) {
                    collides = true;
                    *knife_edge = !self.step_penetrates(&corners, -KNIFE_EDGE_MM);
                    *last = Some(place);
                    return enough(bvh.triangle(place));
                }
                *knife_edge = true;
            }
            if !collides && !gouges && penetrate::tip(&corners, self.tip.grown(KNIFE_EDGE_MM)) {
                gouges = penetrate::tip(&corners, self.tip);
                *knife_edge |= !penetrate::tip(&corners, self.tip.grown(-KNIFE_EDGE_MM));
                if gouges {
                    enough(bvh.triangle(place));
                    // What else is in the tip does not matter.
                    *levels = &self.levels[1..];
                }
            }
            false
        };
        if !first.is_some_and(|place| test(place, &mut levels)) {
            bvh.visit(stand, &mut levels, stack, test);
        }
        match (collides, gouges) {
            (true, _) => Verdict::Collides,
            (false, true) => Verdict::TipGouges,
            (false, false) => Verdict::Free,
        }
    }

    /// Whether the tip is a ball that penetrates a triangle when its center is at `center`, from all directions.
    pub fn ball_gouges(&self, bvh: &Bvh, center: DVec3) -> bool {
        let Tip::Round { ring: 0.0, radius } = self.tip else { return false };
        bvh.near(center, radius, |place| {
            penetrate::ball(&bvh.triangle(place).map(|p| p - center), radius)
        })
    }

    /// Calls `consider` with points of a triangle that may be deep in the tool.
    pub fn candidates(&self, corners: &[DVec3; 3], stand: &Stand, mut consider: impl FnMut(DVec3)) {
        let [a, b, c] = *corners;
        [a, b, c, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)].into_iter().for_each(&mut consider);
        let heights = corners.map(|p| (p - stand.reference).dot(stand.axes[2]));
        let (bottom, top) = (
            heights[0].min(heights[1]).min(heights[2]),
            heights[0].max(heights[1]).max(heights[2]),
        );
        for &[height, radius] in &self.steps {
            if radius == f64::INFINITY || top <= height {
                continue;
            }
            let low = bottom.max(height);
            for share in SHARES {
                let on_axis = stand.reference + stand.axes[2] * (low + share * (top - low));
                consider(nearest(on_axis, corners));
            }
        }
    }

    /// Whether one of the steps, `grown` on all sides, penetrates a triangle; the widest is tried first.
    fn step_penetrates(&self, corners: &[DVec3; 3], grown: f64) -> bool {
        let top = corners[0].z.max(corners[1].z).max(corners[2].z);
        let steps =
            self.steps.iter().rev().map(|[height, radius]| [height - grown, radius + grown]);
        let mut nearest = None;
        steps.skip_while(|[height, _]| top <= *height).any(|[height, radius]| {
            let squared = *nearest.get_or_insert_with(|| from_box(corners));
            radius >= 0.0 && squared <= radius * radius && penetrate::step(corners, height, radius)
        })
    }
}

/// Steps that the boxes of the tree are compared with, below the spindle.
const MOST_LEVELS: usize = 5;

/// At most [`MOST_LEVELS`] steps, and the spindle, that hold all of `steps`, which widen upward.
fn enclosing(steps: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let n_finite = steps.iter().take_while(|[_, radius]| radius.is_finite()).count();
    let (finite, spindle) = steps.split_at(n_finite);
    let groups = finite.chunks(finite.len().div_ceil(MOST_LEVELS).max(1));
    let enclose = |group: &[[f64; 2]]| [group[0][0], group[group.len() - 1][1]];
    groups.map(enclose).chain(spindle.iter().copied()).collect()
}

/// Where on the axis, between the lowest and the highest that a triangle has in a step.
const SHARES: [f64; 4] = [0.06, 0.2, 0.45, 0.8];

/// The point of a triangle nearest to `p`, or nearly: any point of it would do.
fn nearest(p: DVec3, [a, b, c]: &[DVec3; 3]) -> DVec3 {
    let n = (*b - *a).cross(*c - *a);
    let squared = n.length_squared();
    if squared == 0.0 {
        return *a;
    }
    let weight = |q: DVec3, r: DVec3| ((r - q).cross(p - q).dot(n) / squared).clamp(0.0, 1.0);
    let [u, v, w] = [weight(*b, *c), weight(*c, *a), weight(*a, *b)];
    (*a * u + *b * v + *c * w) / (u + v + w)
}

/// Distance, squared, of the axis from the upright box around a triangle.
pub(super) fn from_box(corners: &[DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(across);
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    low.max(-high).max(DVec2::ZERO).length_squared()
}

impl Scratch {
    /// For the next site: the memory and the triangle that collided last are kept.
    pub fn with_last(self) -> Self {
        Scratch { stack: self.stack, last: self.last, ..Scratch::default() }
    }

    /// The greatest value of a triangle that reaches into one of the `steps`, but at least `low`; stops at any value above `high`. A step is a
    /// height and a radius; a triangle's value is by how much the steps would have to be raised to be clear of it, if that is more than its
    /// second argument. `size` is the tool's, mm.
    pub fn max_raise(
        &mut self,
        bvh: &Bvh,
        stand: &Stand,
        (steps, size): (&[[f64; 2]], f64),
        [mut low, high]: [f64; 2],
        value: impl Fn(u32, f64) -> f64,
    ) -> f64 {
        let Scratch { stack, last, .. } = self;
        let steps = enclosing(steps);
        if let Some(first) = *last {
            low = low.max(value(first, low));
            if low > high {
                return low;
            }
        }
        let level =
            |[height, radius]: &[f64; 2], low: f64| bvh.level(height + low, *radius, size + low);
        let mut levels: Vec<Level> = steps.iter().map(|step| level(step, low)).collect();
        bvh.visit(stand, &mut levels, stack, |place, levels| {
            let value = value(place, low);
            if value <= low {
                return false;
            }
            (low, *last) = (value, Some(place));
            for (raised, step) in levels.iter_mut().zip(&steps) {
                *raised = level(step, low);
            }
            low > high
        });
        low
    }

    /// For the next site: only the memory is kept.
    pub fn renewed(self) -> Self {
        Scratch { stack: self.stack, ..Scratch::default() }
    }
}

/// What a worker keeps from query to query.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    stack: Vec<u32>,
    /// Place of the triangle that collided last.
    pub last: Option<u32>,
    /// Tools tested against triangles.
    pub n_queries: u64,
    /// Triangles tested for them.
    pub n_triangles: u64,
    /// Whether the last verdict is on the knife edge: see [`SurfaceStats`](super::SurfaceStats).
    pub knife_edge: bool,
}
