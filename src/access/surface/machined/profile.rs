//! What a tool of any profile leaves of a line.
//!
//! A point is removed if it is in what cuts of the tool in some pose that is free and has a retreat ([`profile`]), or
//! above the lower surface of what cuts of a tool that came down along its axis.
//!
//! ```text
//! straight: over places of the axis, as for tools that only widen; a place is better iff the retracting tool is free
//!           where it would leave less than before, then lower until it is not
//! aside:    of the poses that touch the site, and of those that have it anywhere on what cuts, those that penetrate
//!           least, pushed clear of what they penetrate
//! the best of all: moved by halved steps, each pushed clear again, while that leaves less
//! ```
//!
//! [`profile`]: super::super::profile

use super::super::profile::{Cuts, Frame, ProfileTool, Push, Underside};
use super::pose::{Line, least_over_places, within};
use crate::tool::cutter::Profile;
use glam::{DVec2, DVec3};

/// A tool, and what of it cuts.
pub struct AnyTool<'a> {
    tool: &'a ProfileTool<'a>,
    underside: Underside,
    cuts: Cuts,
}

/// A pose that leaves the least so far.
#[derive(Debug, Clone, Copy)]
pub struct Leaves {
    /// Of the line, mm.
    pub mm: f64,
    pub tip: DVec3,
}

/// Places along a line that are tried.
const PLACES: usize = 24;
/// Heights and lengths are found to this, mm.
const EXACT_MM: f64 = 1e-4;
/// Poses that are pushed from the site: at least so many, more along few directions; and how often.
const PUSHED: usize = 10;
const PUSHED_OF_FEW: usize = 40;
const PUSHED_OF_ALL: usize = 200;
const PUSHES: usize = 16;
/// Directions in which a pose may have the site anywhere on what cuts: those that the part suggests, then those of the
/// best poses so far.
const DIRECTIONS: usize = 12;
/// Pushes of a pose after a step.
const PUSHES_OF_STEP: usize = 4;
/// Pushes after which each is twice as far as what is penetrated asks, four times, and so on up to 2 to this.
const FARTHER_FROM: usize = 3;
const MOST_DOUBLED: usize = 6;
/// Ways out aside that are looked for about one site.
const WAYS_OUT: usize = 6;
/// First and last step, as shares of the tool's radius.
const STEPS: [f64; 2] = [0.1, 1.0 / 640.0];

impl<'a> AnyTool<'a> {
    /// What cuts is shrunk by `shrink` mm.
    pub fn new(tool: &'a ProfileTool<'a>, profile: &Profile, shrink: f64) -> Self {
        let underside = Underside::new(profile, shrink);
        AnyTool { tool, underside, cuts: Cuts::new(profile, shrink) }
    }

    /// The least length of a line that is left along a direction by tools that come down, from a place of the axis `x`,
    /// across, from the line's begin; as [`Dropped::least`](super::pose::Dropped::least).
    pub fn least_straight(
        &self,
        line: &Line,
        frame: &Frame,
        x: DVec2,
        steps: [f64; 2],
        below: f64,
    ) -> Option<Leaves> {
        let mut last = None;
        let left = |x: DVec2, best: Option<f64>| {
            let below = best.map_or(below, |best| best - EXACT_MM);
            self.straight((line, frame), x, below, &mut last)
        };
        let (mm, tip) = least_over_places(x, steps, left)?;
        Some(Leaves { mm, tip })
    }

    /// With the axis at `x`: the length that is left, if it is below a bound, and the tip.
    fn straight(
        &self,
        (line, frame): (&Line, &Frame),
        x: DVec2,
        below: f64,
        last: &mut Option<u32>,
    ) -> Option<(f64, DVec3)> {
        let way = frame.local(line.along);
        let [begin, end] = within(way, x, self.underside.radius())?;
        let (begin, end) = (begin.max(0.0), end.min(line.length).min(below));
        if begin > end {
            return None;
        }
        // How high the tip may be to remove the place of the line.
        let tip = |r: f64| r * way.z - self.underside.height((way.truncate() * r - x).length());
        let places = places([begin, end]);
        let heights = places.map(tip);
        let highest = heights.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        let at = |height: f64| frame.moved(line.from, x) + frame.axes[2] * height;
        let mut is_free = |height: f64| self.tool.retracts_along_axis(frame, at(height), last);
        if !highest.is_finite() || !is_free(highest) {
            return None;
        }
        // Where it stops, or a little above.
        let lowest = heights.iter().copied().find(|height| height.is_finite())?.min(highest);
        let [mut low, mut high] = [lowest, highest];
        if is_free(low) {
            high = low;
        }
        while high - low > EXACT_MM {
            let middle = 0.5 * (low + high);
            if is_free(middle) { high = middle } else { low = middle }
        }
        let first = heights.iter().position(|height| *height >= high)?;
        let (mut found, mut before) = (places[first], places[first.saturating_sub(1)]);
        while found - before > EXACT_MM {
            let middle = 0.5 * (before + found);
            if tip(middle) >= high { found = middle } else { before = middle }
        }
        Some((found, at(high)))
    }

    /// Where a line is in what cuts first, if it is before a bound.
    fn first_cut(&self, line: &Line, frame: &Frame, tip: DVec3, below: f64) -> Option<f64> {
        let (from, way) = (frame.local(line.from - tip), frame.local(line.along));
        let [mut begin, mut end] = within(way, -from.truncate(), self.cuts.radius())?;
        let heights = self.cuts.heights();
        if way.z.abs() > 1e-9 {
            let [a, b] = heights.map(|height| (height - from.z) / way.z);
            (begin, end) = (begin.max(a.min(b)), end.min(a.max(b)));
        } else if !(heights[0]..=heights[1]).contains(&from.z) {
            return None;
        }
        let (begin, end) = (begin.max(0.0), end.min(below));
        if begin > end {
            return None;
        }
        let is_cut = |r: &f64| {
            let at = from + way * *r;
            self.cuts.holds(at.truncate().length(), at.z)
        };
        let places = places([begin, end]);
        let first = places.iter().position(is_cut)?;
        let (mut found, mut before) = (places[first], places[first.saturating_sub(1)]);
        while found - before > EXACT_MM {
            let middle = 0.5 * (before + found);
            if is_cut(&middle) { found = middle } else { before = middle }
        }
        Some(found)
    }

    /// Whether a pose leaves less of a line than this, is free and has a way out.
    #[cfg(test)]
    pub fn leaves_less(&self, line: &Line, frame: &Frame, tip: DVec3, mm: f64) -> bool {
        self.first_cut(line, frame, tip, mm).is_some()
            && self.tool.is_free(frame, tip)
            && (self.tool.retracts_along_axis(frame, tip, &mut None)
                || self.tool.way_aside(frame, tip, &mut None).is_some())
    }

    /// The least length of a line that is left, by a tool with a way out that need not be straight; `best` so far.
    pub fn least_aside(
        &self,
        line: &Line,
        frames: &[Frame],
        best: Option<(usize, Leaves)>,
    ) -> Option<(usize, Leaves)> {
        if !self.tool.may_leave_aside() {
            return best;
        }
        let mut search =
            Aside { any: self, line, frames, best, way_out: None, last: None, n_ways: WAYS_OUT };
        let n = (PUSHED_OF_ALL / frames.len().max(1)).clamp(PUSHED, PUSHED_OF_FEW);
        let touching = self.tool.shallowest_at([line.from, line.along], frames, n);
        let mut which: Vec<usize> = (0..frames.len()).filter(|k| frames[*k].is_suggested).collect();
        which.extend(best.map(|(k, _)| k).into_iter().chain(touching.iter().map(|(k, _)| *k)));
        which.extend(0..frames.len().min(DIRECTIONS));
        let mut seen = vec![false; frames.len()];
        which.retain(|k| !std::mem::replace(&mut seen[*k], true));
        which.truncate(DIRECTIONS);
        let about = self.tool.shallowest_about(line.from, (frames, &which), n);
        for (k, tip) in touching.into_iter().chain(about) {
            search.way_out = None;
            search.settle(k, tip, PUSHES);
        }
        search.refine(STEPS.map(|share| share * self.underside.radius()));
        search.best
    }
}

/// A search over poses of any kind.
struct Aside<'a> {
    any: &'a AnyTool<'a>,
    line: &'a Line,
    frames: &'a [Frame],
    best: Option<(usize, Leaves)>,
    /// Where the last way out came back to the axis.
    way_out: Option<DVec3>,
    last: Option<u32>,
    n_ways: usize,
}

impl Aside<'_> {
    fn limit(&self) -> f64 {
        self.best.map_or(self.line.length, |(_, best)| best.mm - EXACT_MM)
    }

    /// Pushes a pose clear of what it penetrates and takes it, if that leaves less than the best.
    fn settle(&mut self, k: usize, mut tip: DVec3, n_pushes: usize) -> bool {
        let (frame, is_short) = (&self.frames[k], n_pushes == PUSHES_OF_STEP);
        for n in 0..=n_pushes {
            // A step that has nothing to gain is not worth a push.
            let mm = self.any.first_cut(self.line, frame, tip, self.limit());
            if is_short && mm.is_none() {
                return false;
            }
            match self.any.tool.push(frame, tip, &mut self.last) {
                // In a corner of the tool pushes come to nothing; then farther ones clear it.
                Push::By(by) => {
                    let n_doubled = n.saturating_sub(FARTHER_FROM).min(MOST_DOUBLED);
                    tip += by * f64::from(1u32 << n_doubled);
                }
                Push::Free => {
                    let Some(mm) = mm.filter(|_| self.has_way_out(frame, tip)) else {
                        return false;
                    };
                    self.best = Some((k, Leaves { mm, tip }));
                    return true;
                }
            }
        }
        false
    }

    fn has_way_out(&mut self, frame: &Frame, tip: DVec3) -> bool {
        let (tool, last) = (self.any.tool, &mut None);
        if tool.retracts_along_axis(frame, tip, last) {
            return true;
        }
        let by = |to: DVec3| frame.local(to - tip).truncate();
        if self.way_out.is_some_and(|to| tool.is_way_out(frame, tip, by(to))) {
            return true;
        }
        if self.n_ways == 0 {
            return false;
        }
        self.n_ways -= 1;
        let found = tool.way_aside(frame, tip, last);
        self.way_out = found.map(|by| frame.moved(tip, by)).or(self.way_out);
        found.is_some()
    }

    fn refine(&mut self, [mut step, finest]: [f64; 2]) {
        while step > finest {
            let Some((k, Leaves { mm, tip })) = self.best.filter(|(_, best)| best.mm > 0.0) else {
                return;
            };
            for by in around() {
                // From the best at first.
                self.settle(k, tip + self.frames[k].global(by * step), PUSHES_OF_STEP);
            }
            if self.best.is_some_and(|(_, best)| best.mm >= mm) {
                step *= 0.5;
            }
        }
    }
}

/// The directions of steps: along and across the axis, and between.
fn around() -> impl Iterator<Item = DVec3> {
    let of =
        |k: i32| DVec3::new(f64::from(k % 3 - 1), f64::from(k / 3 % 3 - 1), f64::from(k / 9 - 1));
    (0..27).map(of).filter(|by| by.length_squared() > 0.5).map(DVec3::normalize)
}

/// Even places of a line between two others.
fn places([begin, end]: [f64; 2]) -> [f64; PLACES + 1] {
    std::array::from_fn(|k| begin + (end - begin) * (k as f64 / PLACES as f64))
}
