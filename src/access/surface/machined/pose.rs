//! What a tool leaves of a line, where it stops exactly.

use super::super::bvh::Bvh;
use super::super::drop;
use super::super::query::{Scratch, from_box};
use super::super::tolerance::Tolerances;
use super::super::tool::{Axes, Outline, Stand};
use super::footprint::Cutting;
use glam::{DVec2, DVec3};

/// A line from a site outward.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    pub from: DVec3,
    pub along: DVec3,
    /// Length, mm.
    pub length: f64,
}

/// A tool that comes down along a direction.
pub struct Dropped<'a> {
    pub bvh: &'a Bvh,
    pub tolerances: &'a Tolerances,
    pub outline: &'a Outline,
    pub cutting: &'a Cutting,
}

/// Places along a line that are tried, and halvings of what is between two.
const PLACES: usize = 24;
const HALVINGS: usize = 30;
/// Intervals of a line that are bounded each by itself.
const INTERVALS: usize = 16;
/// Of sums of lengths, a share.
const ROUNDING: f64 = 1e-12;

/// What a worker keeps from pose to pose; no result depends on it.
#[derive(Debug, Default)]
pub struct Recent {
    scratch: Scratch,
    /// Places of triangles that a tool stopped at, the last first.
    stops: Vec<u32>,
}

/// Triangles that are tried first.
const MOST_RECENT: usize = 8;

impl Recent {
    fn push(&mut self, place: u32) {
        match self.stops.iter().position(|other| *other == place) {
            Some(k) => self.stops[..=k].rotate_right(1),
            None => {
                self.stops.truncate(MOST_RECENT - 1);
                self.stops.insert(0, place);
            }
        }
    }
}

impl Dropped<'_> {
    /// Height of the reference point above that of `reference` where the tool stops; any at which something is in the
    /// way if it stops above `high`.
    fn stop(&self, stand: &Stand, high: f64, recent: &mut Recent) -> f64 {
        let Dropped { bvh, tolerances, outline, .. } = *self;
        let least = tolerances.least;
        let levels: Vec<[f64; 2]> =
            std::iter::once(outline.tip(least).lower_end()).chain(outline.steps(least)).collect();
        let value = |place: u32, low: f64| {
            let (corners, tolerance) = (stand.triangle(bvh.triangle(place)), tolerances.at(place));
            let top = corners[0].z.max(corners[1].z).max(corners[2].z);
            let distance = from_box(&corners);
            let mut value = low;
            if tolerance < outline.radius() {
                let tip = outline.tip(tolerance);
                let [height, radius] = tip.lower_end();
                if top - height > value && distance <= radius * radius {
                    // By this bound a triangle is passed over: roundings above it would make the order count.
                    value = value.max(drop::tip(&corners, tip).min(top - height));
                }
            }
            for [height, radius] in outline.steps(tolerance) {
                if top - height <= value {
                    break;
                }
                if radius > 0.0 && distance <= radius * radius {
                    value = value.max((drop::disc(&corners, radius) - height).min(top - height));
                }
            }
            value
        };
        let mut low = -2.0 * (bvh.radius() + outline.size());
        for k in 0..recent.stops.len() {
            let place = recent.stops[k];
            low = low.max(value(place, low));
            if low > high {
                recent.push(place);
                return low;
            }
        }
        recent.scratch.last = None;
        low = recent.scratch.max_raise(bvh, stand, (&levels, outline.size()), [low, high], value);
        if let Some(place) = recent.scratch.last {
            recent.push(place);
        }
        low
    }

    /// The length of a line that is left by the tool with its axis at `x` across `axes`, relative to the line's begin;
    /// the reference point above it where the tool stops. None if all of the line is left; it may be none
    /// if more than `below` is.
    pub fn left(
        &self,
        line: &Line,
        axes: Axes,
        (x, below): (DVec2, f64),
        recent: &mut Recent,
    ) -> Option<(f64, DVec3)> {
        let [u, v, d] = axes;
        let stand = Stand { reference: line.from + u * x.x + v * x.y, axes };
        let way = DVec3::new(line.along.dot(u), line.along.dot(v), line.along.dot(d));
        let radius = self.cutting.radius;
        // Where the line is within the radius.
        let across = way.truncate();
        let [begin, end] = within(way, x, radius)?;
        let (begin, end) = (begin.max(0.0), end.min(line.length));
        if begin > end.min(below) {
            return None;
        }
        let high = self.highest_stop(way, x, [begin, end.min(below)]);
        let stop = self.stop(&stand, high, recent);
        if stop > high {
            return None;
        }
        let above = |r: f64| {
            let distance = (across * r - x).length().min(radius);
            r * way.z - stop - self.cutting.height(distance)
        };
        let mut below = begin;
        let place = |k: usize| begin + (end - begin) * k as f64 / PLACES as f64;
        let found = (0..=PLACES).map(place).find(|r| {
            let is_above = above(*r) >= 0.0;
            if !is_above {
                below = *r;
            }
            is_above
        });
        let mut found = found?;
        for _ in 0..HALVINGS {
            if found - below <= 1e-9 {
                break;
            }
            let middle = 0.5 * (below + found);
            if above(middle) >= 0.0 { found = middle } else { below = middle }
        }
        Some((found, stand.reference + d * stop))
    }

    /// Above this the tool removes nothing of a line between two lengths, which is `way` from its begin.
    fn highest_stop(&self, way: DVec3, x: DVec2, [begin, end]: [f64; 2]) -> f64 {
        let (across, n) = (way.truncate(), INTERVALS as f64);
        let nearest = x.dot(across) / across.length_squared();
        let place = |k: usize| begin + (end - begin) * k as f64 / n;
        let of_interval = |k: usize| {
            let [low, high] = [place(k), place(k + 1)];
            let r = if nearest.is_finite() { nearest.max(low).min(high) } else { low };
            let distance = ((across * r - x).length() * (1.0 - ROUNDING)).min(self.cutting.radius);
            (low * way.z).max(high * way.z) - self.cutting.height(distance)
        };
        let highest = (0..INTERVALS).map(of_interval).fold(f64::NEG_INFINITY, f64::max);
        highest + ROUNDING * (1.0 + highest.abs() + end)
    }

    /// The least length of a line that is left along a direction, found by steps from `x` that begin with `step` mm and
    /// are halved down to `finest`; and the reference point of the pose.
    pub fn least(
        &self,
        line: &Line,
        axes: Axes,
        x: DVec2,
        [step, finest]: [f64; 2],
        recent: &mut Recent,
    ) -> Option<(f64, DVec3)> {
        least_over_places(x, [step, finest], |x, best| {
            self.left(line, axes, (x, best.unwrap_or(line.length)), recent)
        })
    }
}

/// The least that is `left`, of places of the axis: found by steps from `x` that begin with `step` mm and are halved
/// down to `finest`. With a place comes what is left by the best so far.
pub fn least_over_places(
    mut x: DVec2,
    [mut step, finest]: [f64; 2],
    mut left: impl FnMut(DVec2, Option<f64>) -> Option<(f64, DVec3)>,
) -> Option<(f64, DVec3)> {
    let mut best = left(x, None);
    let mut better = |there: DVec2, best: &mut Option<(f64, DVec3)>| {
        let found = left(there, best.map(|(mm, _)| mm));
        let is_better = is_less(&found, best);
        if is_better {
            *best = found;
        }
        is_better
    };
    // The exact tool is wider than that of the images: beside a wall it may stop on top of that.
    for farther in FARTHER {
        if best.is_some() {
            break;
        }
        let from = x;
        for [i, j] in AROUND {
            let there = from + DVec2::new(i, j) * (farther * step);
            if better(there, &mut best) {
                x = there;
            }
        }
    }
    while step > finest && best.is_none_or(|(left, _)| left > 0.0) {
        let mut moved = None;
        for [i, j] in AROUND {
            let there = x + DVec2::new(i, j) * step;
            if better(there, &mut best) {
                moved = Some(there);
            }
        }
        match moved {
            Some(there) => x = there,
            None => step *= 0.5,
        }
    }
    best
}

/// Where a line is within a radius of an axis at `x`, from its begin.
pub fn within(way: DVec3, x: DVec2, radius: f64) -> Option<[f64; 2]> {
    let (across, a) = (way.truncate(), way.truncate().length_squared());
    let (b, c) = (-x.dot(across), x.length_squared() - radius * radius);
    if a > 1e-18 {
        let root = b * b - a * c;
        if root < 0.0 {
            return None;
        }
        let root = root.sqrt();
        return Some([(-b - root) / a, (-b + root) / a]);
    }
    (c <= 0.0).then_some([f64::NEG_INFINITY, f64::INFINITY])
}

/// Steps from the place of the images at which a pose is looked for if there is none.
const FARTHER: [f64; 5] = [1.0, 1.7, 2.5, 4.0, 8.0];
const AROUND: [[f64; 2]; 8] = [
    [1.0, 0.0],
    [-1.0, 0.0],
    [0.0, 1.0],
    [0.0, -1.0],
    [0.7, 0.7],
    [-0.7, 0.7],
    [0.7, -0.7],
    [-0.7, -0.7],
];

/// Less by more than rounding.
fn is_less(a: &Option<(f64, DVec3)>, b: &Option<(f64, DVec3)>) -> bool {
    match (a, b) {
        (Some((a, _)), Some((b, _))) => *a < b - 1e-7,
        (Some(_), None) => true,
        (None, _) => false,
    }
}
