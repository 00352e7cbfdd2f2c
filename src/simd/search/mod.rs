//! The search for labels: which queries does some obstacle collide with, in one direction?
//!
//! The greatest height of all obstacles decides most queries. Each step of finite radius, the widest first,
//! asks what is open then of a grid of the obstacles high enough to matter: two rasters of heights bound
//! the greatest height within the radius from above and below; where the threshold lies between the two, the
//! obstacles of the cells around are tested by the predicate: for a wide step those of the ring between the two
//! discs, together for neighbours; for a narrow one all, query by query.

mod disc;
mod grid;
mod known;

use super::cells::Extent;
use super::collide::{Coordinates, StepSquared, eights};
use super::level::{Kernel, Simd};
use crate::simd::ones;
use grid::{Cylinder, Grid};
pub use known::Known;

/// Sets the bit of every query at which some obstacle collides.
pub struct Search<'a> {
    /// Reference points in the direction's frame.
    pub centres: &'a Coordinates,
    /// The cutter: heights ascend, radii never shrink.
    pub steps: &'a [StepSquared],
    /// Obstacles in the direction's frame, padding at height −∞.
    pub obstacles: &'a Coordinates,
    /// Height of the obstacle that is the query itself, −∞ for none; as long as the centres.
    pub own_z: &'a [f32],
    /// Bits of the queries, zeroed.
    pub row: &'a mut [u64],
    /// Receives the queries whose own obstacle is high enough to matter; their bits stay 0.
    pub undecided: &'a mut Vec<u32>,
    /// What is known from searches with the same centres in this direction; what this one finds out is added.
    pub known: Option<&'a mut Known>,
    /// Reused from search to search.
    pub room: &'a mut Room,
}

/// Memory of a search.
#[derive(Debug, Default)]
pub struct Room {
    /// Per eight queries, the open ones.
    open: Vec<u8>,
    /// Per eight queries, those that the step at hand is asked about.
    asked: Vec<u8>,
    /// Per eight queries, those that some step was asked about.
    ever_asked: Vec<u8>,
    /// Per eight queries, those for which obstacles were tested.
    tested: Vec<u8>,
    grid: Grid,
}

/// How queries were decided.
#[derive(Debug, Clone, Copy, Default)]
pub struct Searched {
    /// By the greatest height alone.
    pub by_height: u64,
    /// By what was known of other cutters.
    pub by_known: u64,
    /// By the rasters alone.
    pub by_grid: u64,
    /// Obstacles tested for the others.
    pub tested: u64,
}

impl Kernel for Search<'_> {
    type Output = Searched;

    #[inline(always)]
    fn run<S: Simd>(mut self, s: S) -> Searched {
        let infinite = |step: &StepSquared| step.radius_squared == f32::INFINITY;
        let n_finite = self.steps.iter().position(infinite).unwrap_or(self.steps.len());
        let mut done = self.by_height(s, self.steps.get(n_finite));
        let n_questions = count(&self.room.open);
        let steps = &self.steps[..n_finite];
        self.recall(steps);
        for step in steps.iter().rev() {
            let n_asked = self.choose(step);
            if n_asked == 0 {
                continue;
            }
            let extent = self.extent(s);
            let floor = extent.least[2] + step.height;
            if self.room.grid.fill(s, (self.obstacles, floor), step, &extent, n_asked) {
                done.tested += self.ask(s, step);
            }
            if let Some(known) = &mut self.known {
                known.learn(step, &self.room.asked, &self.room.open);
            }
        }
        let n_asked = self.known.map_or(n_questions, |_| count(&self.room.ever_asked));
        done.by_known = n_questions - n_asked;
        done.by_grid = n_asked - count(&self.room.tested);
        done
    }
}

impl Search<'_> {
    /// Decides what the greatest height of all obstacles decides; the rest is open. `shaft` is the first
    /// infinitely wide step.
    #[inline(always)]
    fn by_height<S: Simd>(&mut self, s: S, shaft: Option<&StepSquared>) -> Searched {
        let highest = s.splat(highest(s, &self.obstacles.z));
        let first = s.splat(self.steps[0].height);
        let n = self.centres.n;
        let mut by_height = 0;
        let Room { open, tested, ever_asked, .. } = &mut *self.room;
        for bits in [open, tested, ever_asked] {
            bits.clear();
            bits.resize(n.div_ceil(8), 0);
        }
        let queries = eights(&self.centres.z).iter().zip(eights(self.own_z));
        for (block, (to, (z, own_z))) in self.room.open.iter_mut().zip(queries).enumerate() {
            let z = s.load(z);
            let valid = !0u32 >> (24 + (8 * block + 8).saturating_sub(n));
            let contact = s.add(z, first);
            let own = s.greater(s.load(own_z), contact) & valid;
            let reached = s.greater(highest, contact) & valid;
            let hit = shaft.map_or(0, |step| s.greater(highest, s.add(z, s.splat(step.height))));
            let hit = hit & valid & !own;
            let open = reached & !hit & !own;
            by_height += u64::from((valid & !own & !open).count_ones());
            self.row[block / 8] |= u64::from(hit) << (8 * (block % 8));
            for lane in ones(own) {
                self.undecided.push((8 * block + lane) as u32);
            }
            *to = open as u8;
        }
        Searched { by_height, ..Searched::default() }
    }

    /// Decides the open queries at which some obstacle is known to be in one of the steps.
    #[inline(always)]
    fn recall(&mut self, steps: &[StepSquared]) {
        let Room { open, asked: hits, .. } = &mut *self.room;
        let Some(known) = &self.known else { return };
        hits.clear();
        hits.resize(open.len(), 0);
        known.hits(steps, hits);
        for (block, (open, hits)) in open.iter_mut().zip(hits).enumerate() {
            self.row[block / 8] |= u64::from(*hits & *open) << (8 * (block % 8));
            *open &= !*hits;
        }
    }

    /// Chooses the open queries that this step may decide, and counts them.
    #[inline(always)]
    fn choose(&mut self, step: &StepSquared) -> u64 {
        let Room { open, asked, ever_asked, .. } = &mut *self.room;
        asked.clone_from(open);
        if let Some(known) = &self.known {
            known.keep_open(step, asked);
            ever_asked.iter_mut().zip(&*asked).for_each(|(ever, asked)| *ever |= asked);
        }
        count(asked)
    }

    /// What the queries asked about span.
    #[inline(always)]
    fn extent<S: Simd>(&self, s: S) -> Extent {
        let mut least = [s.splat(f32::INFINITY); 3];
        let mut greatest = [s.splat(f32::NEG_INFINITY); 3];
        let axes = [&self.centres.x, &self.centres.y, &self.centres.z].map(|axis| eights(axis));
        for (block, &asked) in self.room.asked.iter().enumerate().filter(|(_, asked)| **asked != 0)
        {
            for (axis, lanes) in axes.iter().enumerate() {
                let asked_or =
                    |other| s.only(s.load(&lanes[block]), u32::from(asked), s.splat(other));
                least[axis] = s.min(least[axis], asked_or(f32::INFINITY));
                greatest[axis] = s.max(greatest[axis], asked_or(f32::NEG_INFINITY));
            }
        }
        Extent::of(s, least, greatest)
    }

    /// Asks the grid about the chosen queries; the obstacles tested.
    #[inline(always)]
    fn ask<S: Simd>(&mut self, s: S, step: &StepSquared) -> u64 {
        let Room { open, asked, tested, grid, .. } = &mut *self.room;
        let [x, y, z] =
            [&self.centres.x, &self.centres.y, &self.centres.z].map(|axis| eights(axis));
        let reach = s.splat(grid.reach);
        let mut n_tested = 0;
        for (block, &asked) in asked.iter().enumerate().filter(|(_, asked)| **asked != 0) {
            let [x, y, z] = [&x[block], &y[block], &z[block]];
            let [lane_x, lane_y] = [s.load(x), s.load(y)];
            let threshold = s.add(s.load(z), s.splat(step.height));
            let middle = grid.cells.places(s, lane_x, lane_y);
            let bounds = grid.bounds(s, &middle, threshold);
            let mut hit = bounds.hit & u32::from(asked);
            let may = bounds.may & u32::from(asked) & !hit;
            if may != 0 {
                let ring = if grid.cells.wide { may & bounds.clear } else { 0 };
                if ring != 0 {
                    let within = s.splat(step.radius_squared);
                    let cylinders = Cylinder { x: lane_x, y: lane_y, above: threshold, within };
                    let (struck, n) = grid.ring_strikes(s, &cylinders, ring);
                    hit |= struck;
                    n_tested += n;
                }
                if may != ring {
                    let first = grid.cells.places(s, s.sub(lane_x, reach), s.sub(lane_y, reach));
                    let last = grid.cells.places(s, s.add(lane_x, reach), s.add(lane_y, reach));
                    let mut above = [0.0; 8];
                    s.store(threshold, &mut above);
                    for lane in ones(may & !ring) {
                        let cylinder = [x[lane], y[lane], above[lane], step.radius_squared];
                        let cells = [first.get(lane), last.get(lane)];
                        let (struck, n) = grid.strikes(s, cylinder, cells);
                        hit |= u32::from(struck) << lane;
                        n_tested += n;
                    }
                }
                tested[block] |= may as u8;
            }
            open[block] &= !hit as u8;
            self.row[block / 8] |= u64::from(hit) << (8 * (block % 8));
        }
        n_tested
    }
}

/// The greatest of these heights.
#[inline(always)]
fn highest<S: Simd>(s: S, z: &[f32]) -> f32 {
    let mut highest = s.splat(f32::NEG_INFINITY);
    for z in eights(z) {
        highest = s.max(highest, s.load(z));
    }
    s.greatest(highest)
}

fn count(bits: &[u8]) -> u64 {
    bits.iter().map(|byte| u64::from(byte.count_ones())).sum()
}
