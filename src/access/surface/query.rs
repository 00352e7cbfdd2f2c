//! One tool at one place against all triangles, through the tree.

use super::bvh::{Bvh, Level};
use super::labels::BORDERLINE_MM;
use super::penetrate::{self, nearest_above};
use super::pose::blockers::{Blocker, Met};
use super::tolerance::Tolerances;
use super::tool::{Outline, Stand, Tip, across};
use super::triangle::nearest;
use super::verdict::Verdict;
use glam::{DVec2, DVec3};

/// A cutter ready to be tested: against every triangle it is shrunk by the tolerance of that.
#[derive(Debug, Clone)]
pub(super) struct Probe {
    outline: Outline,
    parts: Parts,
    /// The tip, if there is one, then the steps: shrunk by the least tolerance.
    levels: Vec<Level>,
    /// Few steps that hold all, shrunk likewise.
    enclosing: Vec<[f64; 2]>,
}

/// What of a tool is tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Parts {
    Whole,
    /// Where the ball is known to be clear of the surface: of the tip what is above its middle, which is as wide as the
    /// ball.
    AboveBall,
    /// A ball end's ball, above its middle and below.
    Ball,
    Steps,
}

impl Probe {
    /// `least` is the least tolerance, `reach` the greatest distance of a reference point from the middle of the
    /// triangles, mm.
    pub fn new(outline: &Outline, least: f64, bvh: &Bvh, reach: f64) -> Self {
        Probe::of(outline, Parts::Whole, least, bvh, reach)
    }

    /// The steps alone. There is no tip.
    pub fn of_steps(outline: &Outline, least: f64, bvh: &Bvh, reach: f64) -> Self {
        Probe::of(outline, Parts::Steps, least, bvh, reach)
    }

    /// For places where a ball is known to be clear of the surface; the whole tool, if the tip is none.
    pub fn above_ball(outline: &Outline, least: f64, bvh: &Bvh, reach: f64) -> Self {
        let parts = if outline.side() == 0.0 { Parts::AboveBall } else { Parts::Whole };
        Probe::of(outline, parts, least, bvh, reach)
    }

    /// A ball end's ball, for [`Probe::ball_meets`].
    pub fn of_ball(outline: &Outline, least: f64, bvh: &Bvh, reach: f64) -> Self {
        Probe::of(outline, Parts::Ball, least, bvh, reach)
    }

    fn of(outline: &Outline, parts: Parts, least: f64, bvh: &Bvh, reach: f64) -> Self {
        let steps: Vec<[f64; 2]> = outline.steps(least).collect();
        let tip = match parts {
            Parts::Steps | Parts::Ball => None,
            Parts::AboveBall => Some([0.0, outline.radius() - least]),
            Parts::Whole => Some(outline.tip(least).lower_end()),
        };
        let size = outline.size() + least + reach;
        let enclosing = enclosing(&steps);
        let lower_ends = tip.iter().chain(&enclosing);
        let levels = lower_ends.map(|[height, radius]| bvh.level(*height, *radius, size)).collect();
        Probe { outline: outline.clone(), parts, levels, enclosing }
    }

    /// The tip after shrinking by a tolerance, and by `more`; none if nothing is left of it.
    fn tip(&self, tolerance: f64, more: f64) -> Option<Tip> {
        let radius = self.outline.radius() - tolerance - more;
        match self.parts {
            _ if radius <= 0.0 => None,
            Parts::Steps | Parts::Ball => None,
            Parts::AboveBall => Some(Tip::Flat { height: more, radius }),
            Parts::Whole => Some(self.outline.tip(tolerance + more)),
        }
    }

    /// The verdict over all triangles. The one that a step penetrated last is tried first.
    pub fn verdict(
        &self,
        (bvh, tolerances): (&Bvh, &Tolerances),
        stand: &Stand,
        scratch: &mut Scratch,
    ) -> Verdict {
        self.verdict_with((bvh, tolerances), stand, scratch, |_| true)
    }

    /// As [`Probe::verdict`]; `enough` is given the places of triangles that the steps or the tip penetrate, until it
    /// is true of one of the former.
    pub fn verdict_with<'p>(
        &'p self,
        (bvh, tolerances): (&Bvh, &Tolerances),
        stand: &Stand,
        scratch: &mut Scratch,
        mut enough: impl FnMut(u32) -> bool,
    ) -> Verdict {
        let Scratch { stack, last, n_triangles, n_queries, borderline, .. } = scratch;
        *n_queries += 1;
        *borderline = false;
        let (mut collides, mut gouges) = (false, false);
        let first = *last;
        let mut levels = &self.levels[..];
        let mut test = |place: u32, levels: &mut &'p [Level]| {
            *n_triangles += 1;
            let corners = stand.triangle(bvh.triangle(place));
            let tolerance = tolerances.at(place);
            // What a slightly greater tool is clear of, this one is clear of for certain.
            if self.step_penetrates(&corners, tolerance, BORDERLINE_MM) {
                if self.step_penetrates(&corners, tolerance, 0.0) {
                    collides = true;
                    *borderline = !self.step_penetrates(&corners, tolerance, -BORDERLINE_MM);
                    *last = Some(place);
                    return enough(place);
                }
                *borderline = true;
            }
            let tip = |more| self.tip(tolerance, more).is_some_and(|t| penetrate::tip(&corners, t));
            if !collides && !gouges && tip(-BORDERLINE_MM) {
                gouges = tip(0.0);
                *borderline |= !tip(BORDERLINE_MM);
                if gouges {
                    enough(place);
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

    /// Whether the tool is clear of all triangles; what is in the way otherwise, as far as `met` has room.
    pub fn meets(
        &self,
        triangles: (&Bvh, &Tolerances),
        stand: &Stand,
        scratch: &mut Scratch,
    ) -> Met {
        let (bvh, tolerances) = triangles;
        let mut met = Met::default();
        let Scratch { stack, n_triangles, n_queries, .. } = scratch;
        *n_queries += 1;
        let mut levels = &self.levels[..];
        bvh.visit(stand, &mut levels, stack, |place, _| {
            *n_triangles += 1;
            let corners = stand.triangle(bvh.triangle(place));
            let tolerance = tolerances.at(place);
            let tip = || self.tip(tolerance, 0.0).is_some_and(|t| penetrate::tip(&corners, t));
            (self.step_penetrates(&corners, tolerance, 0.0) || tip())
                && met.push(self.blocker(triangles, place, stand))
        });
        met
    }

    /// Whether a triangle collides in every pose within `spread` of this one: it is in what is left of the steps, or of
    /// a ball end's ball, if they shrink by that. The triangle that collided last is tried first.
    pub fn collides_within(
        &self,
        (bvh, tolerances): (&Bvh, &Tolerances),
        stand: &Stand,
        spread: f64,
        scratch: &mut Scratch,
    ) -> bool {
        if self.parts == Parts::Ball {
            let ball = (stand.reference, self.outline.radius() - spread);
            return is_in_ball((bvh, tolerances), ball, &mut scratch.last_in_ball);
        }
        let Scratch { stack, last, cores, n_triangles, .. } = scratch;
        let size = self.outline.size() + bvh.radius() + spread;
        let steps = self.enclosing.iter().filter(|[_, radius]| *radius > spread);
        cores.clear();
        cores.extend(
            steps.map(|[height, radius]| bvh.level(height + spread, radius - spread, size)),
        );
        if cores.is_empty() {
            return false;
        }
        let mut test = |place: u32| {
            *n_triangles += 1;
            let corners = stand.triangle(bvh.triangle(place));
            self.step_penetrates(&corners, tolerances.at(place), -spread)
        };
        if last.is_some_and(&mut test) {
            return true;
        }
        bvh.visit(stand, cores, stack, |place, _| {
            let collides = test(place);
            if collides {
                *last = Some(place);
            }
            collides
        })
    }

    /// As [`Probe::meets`], for a ball end's ball.
    pub fn ball_meets(&self, triangles: (&Bvh, &Tolerances), stand: &Stand) -> Met {
        let (bvh, tolerances) = triangles;
        let mut met = Met::default();
        let radius = self.outline.radius();
        bvh.near(stand.reference, radius - tolerances.least, |place| {
            let corners = bvh.triangle(place).map(|p| p - stand.reference);
            penetrate::ball(&corners, radius - tolerances.at(place))
                && met.push(self.blocker(triangles, place, stand))
        });
        met
    }

    /// By how much a point, in the frame of the tool, is in the tool shrunk by a tolerance.
    fn depth(&self, p: DVec3, tolerance: f64) -> f64 {
        if self.parts == Parts::Ball {
            return self.outline.radius() - tolerance - p.length();
        }
        let (height, distance) = (p.z, across(p).length());
        let step = |[start, radius]: [f64; 2]| (height - start).min(radius - distance);
        let steps = self.outline.steps(tolerance).map(step).fold(f64::NEG_INFINITY, f64::max);
        let Some(tip) = self.tip(tolerance, 0.0) else { return steps };
        let ball = match tip {
            Tip::Flat { .. } => f64::NEG_INFINITY,
            Tip::Round { ring, radius } => {
                let beyond = (distance - ring).max(0.0);
                radius - beyond.hypot(height.min(0.0))
            }
        };
        steps.max(step(tip.shaft())).max(ball)
    }

    /// The point of a triangle that is deepest in the tool, nearly.
    pub fn blocker(
        &self,
        (bvh, tolerances): (&Bvh, &Tolerances),
        place: u32,
        stand: &Stand,
    ) -> Blocker {
        let (corners, tolerance) = (bvh.triangle(place), tolerances.at(place));
        let mut best = (f64::NEG_INFINITY, corners[0]);
        let mut consider = |p: DVec3| {
            let depth = self.depth(stand.local(p), tolerance);
            if depth > best.0 {
                best = (depth, p);
            }
        };
        let local = stand.triangle(corners);
        let tip = self.tip(tolerance, 0.0);
        let shaft = tip.map(Tip::shaft).filter(|_| self.parts != Parts::Ball);
        let steps = self.outline.steps(tolerance).filter(|_| self.parts != Parts::Ball);
        let (low, high) = (
            local[0].z.min(local[1].z).min(local[2].z),
            local[0].z.max(local[1].z).max(local[2].z),
        );
        let from_axis = from_box(&local);
        for [height, radius] in steps.chain(shaft) {
            if high <= height || from_axis >= radius * radius {
                continue;
            }
            let low = low.max(height);
            let mut try_at = |share: f64| {
                let nearest = nearest_above(&local, low + share * (high - low));
                let inside = nearest.filter(|(distance, _)| *distance < radius);
                inside.map(|(_, at)| consider(stand.back(at))).is_some()
            };
            let n_inside = SHARES.iter().take_while(|share| try_at(**share)).count();
            if n_inside == 0 {
                // It reaches in just above the step's lower end.
                LOW_SHARES.into_iter().any(try_at);
            }
        }
        let ring = match tip {
            Some(Tip::Round { ring, .. }) => ring,
            Some(Tip::Flat { .. }) => 0.0,
            None => 0.0,
        };
        let first = nearest(stand.reference, corners);
        consider(first);
        if ring > 0.0 {
            // From the disc within the tip, which is nearer to the triangle.
            let toward = across(stand.local(first)).clamp_length_max(ring);
            let [u, v, _] = stand.axes;
            consider(nearest(stand.reference + u * toward.x + v * toward.y, corners));
        }
        Blocker { point: best.1, tolerance }
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
        let mut from = |low: f64| {
            for share in SHARES {
                let on_axis = stand.reference + stand.axes[2] * (low + share * (top - low));
                consider(nearest(on_axis, corners));
            }
        };
        // Steps rise: those that begin below the triangle see the same of it, and of many within it some will do.
        let steps = self.outline.all_steps();
        let n_finite =
            steps.iter().take_while(|[height, radius]| radius.is_finite() && *height < top).count();
        let n_below = steps[..n_finite].iter().take_while(|[height, _]| *height <= bottom).count();
        if n_below > 0 {
            from(bottom);
        }
        let within = &steps[n_below..n_finite];
        let every = within.len().div_ceil(MOST_LEVELS).max(1);
        within.iter().step_by(every).for_each(|[height, _]| from(*height));
    }

    /// Whether one of the steps, shrunk by a tolerance and then `grown` on all sides, penetrates a triangle; the widest
    /// is tried first.
    fn step_penetrates(&self, corners: &[DVec3; 3], tolerance: f64, grown: f64) -> bool {
        let top = corners[0].z.max(corners[1].z).max(corners[2].z);
        let steps = self.outline.all_steps().iter().rev().map(|[height, radius]| {
            [height + tolerance - grown, (radius - tolerance).max(0.0) + grown]
        });
        let mut nearest = None;
        steps.skip_while(|[height, _]| top <= *height).any(|[height, radius]| {
            let squared = *nearest.get_or_insert_with(|| from_box(corners));
            radius >= 0.0 && squared <= radius * radius && penetrate::step(corners, height, radius)
        })
    }
}

/// Whether a triangle is in a ball that shrinks by its tolerance; `last`, the one that was so last, is tried first.
fn is_in_ball(
    (bvh, tolerances): (&Bvh, &Tolerances),
    (center, radius): (DVec3, f64),
    last: &mut Option<u32>,
) -> bool {
    if radius <= tolerances.least {
        return false;
    }
    let is_in = |place: u32| {
        let radius = radius - tolerances.at(place);
        let corners = bvh.triangle(place).map(|p| p - center);
        let at = nearest(DVec3::ZERO, &corners);
        radius > 0.0
            && at.length_squared() < radius * radius
            // The plane of a sliver is nothing but roundings.
            && (penetrate::in_box(at, &corners) || penetrate::ball(&corners, radius))
    };
    last.is_some_and(is_in)
        || bvh.near(center, radius - tolerances.least, |place| {
            let found = is_in(place);
            if found {
                *last = Some(place);
            }
            found
        })
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
/// The same, below the first of them.
const LOW_SHARES: [f64; 4] = [0.02, 5e-3, 1e-3, 1e-4];

/// Distance, squared, of the axis from the upright box around a triangle.
pub(super) fn from_box(corners: &[DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(across);
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    low.max(-high).max(DVec2::ZERO).length_squared()
}

impl Scratch {
    /// The greatest value of a triangle that reaches into one of the `steps`, but at least `low`; stops at any value
    /// above `high`. A step is a height and a radius; a triangle's value is by how much the steps would have to be
    /// raised to be clear of it, if that is more than its second argument. `size` is the tool's, mm.
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
        Scratch { stack: self.stack, cores: self.cores, ..Scratch::default() }
    }
}

/// What a worker keeps from query to query.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    stack: Vec<u32>,
    cores: Vec<Level>,
    /// Place of the triangle that collided last.
    pub last: Option<u32>,
    /// Place of the triangle that was in the way of a ball last.
    last_in_ball: Option<u32>,
    /// Tools tested against triangles.
    pub n_queries: u64,
    /// Triangles tested for them.
    pub n_triangles: u64,
    /// Whether the last verdict is borderline: see [`SurfaceStats`](super::SurfaceStats).
    pub borderline: bool,
}
