//! β by counting: for every obstacle, the centers whose cutter it is in.
//!
//! With the centers of a direction sorted by height, "step k's height is passed" is a prefix of the
//! list, one rank per obstacle and step. What the spindle hits is that rank. For a step of finite radius
//! the candidates are the range between its rank and that of the next step (above it the next, wider
//! step decides), and what remains is to count the candidates within the radius. Runs of obstacles, compact
//! because of their spatial order, split the list: centers within reach of the whole run are counted for all
//! its obstacles by prefix sums, centers beyond reach are dropped, the annulus between is handed to the shorter
//! runs.

use super::annulus_split::{AnnulusSplit, Word};
use super::rank_ranges::{CountInRanges, FindSpan, RangeSpan, RankRanges, SLACK};
use super::ranks::Sorted;
use crate::access::points::stats::Stats;
use crate::access::predicate::StepSquared;
use crate::simd::Isa;
use crate::simd::vector::MAX_LANES;
use crate::spatial::Coordinates;

/// Lists and ranges, reused from direction to direction.
#[derive(Default)]
pub(super) struct Counting {
    sorted: Sorted,
    lists: Vec<List>,
    ranks: Vec<u32>,
    above: Vec<u32>,
    from: Vec<u32>,
    counts: Vec<u32>,
}

/// A list of centers, ascending in height, and what a split says about it.
#[derive(Default)]
struct List {
    x: Vec<f32>,
    y: Vec<f32>,
    words: Vec<Word>,
}

/// Testing one pair costs this share of splitting off one center or of moving one obstacle's range on:
/// a run splits its list only if that can pay (chosen by `benches/labeler.rs`).
const PAIRS_PER_CENTER: u64 = 8;
const PAIRS_PER_OBSTACLE: u64 = 64;

impl Counting {
    /// Adds to each obstacle's `beta` the number of centers whose cutter it is in.
    pub fn run(
        &mut self,
        steps: &[StepSquared],
        centers: &Coordinates,
        obstacles: &Coordinates,
        beta: &mut [u64],
        isa: Isa,
    ) -> Stats {
        let mut stats = Stats::default();
        if centers.n == 0 || obstacles.n == 0 {
            return stats;
        }
        self.prepare(centers, obstacles.n, isa);
        for step in steps.iter().rev() {
            self.count(step, obstacles, isa, &mut stats);
        }
        beta.iter_mut().zip(&self.counts).for_each(|(beta, &count)| *beta += u64::from(count));
        stats
    }

    /// Counts for a step of which the next one has been counted before.
    fn count(&mut self, step: &StepSquared, obstacles: &Coordinates, isa: Isa, stats: &mut Stats) {
        let z = &obstacles.z[..obstacles.n];
        self.sorted.ranks(z, step.height, &mut self.ranks, isa);
        if step.radius_squared == f32::INFINITY {
            for (count, &rank) in self.counts.iter_mut().zip(&self.ranks) {
                *count += rank;
                stats.beta_by_rank += u64::from(rank);
            }
            std::mem::swap(&mut self.above, &mut self.ranks);
            return;
        }
        std::mem::swap(&mut self.from, &mut self.above);
        self.above.clone_from(&self.ranks);
        let ranges =
            RankRanges { from: &mut self.from, to: &mut self.ranks, counts: &mut self.counts };
        let radius_squared = step.radius_squared;
        let mut walk = Walk { obstacles, isa, radius_squared, stats };
        walk.visit(longest_run(obstacles.n), 0, &mut self.lists, ranges);
    }

    fn prepare(&mut self, centers: &Coordinates, n_obstacles: usize, isa: Isa) {
        self.sorted.fill(centers, isa);
        let n_lists = (longest_run(n_obstacles) / SHORTEST_RUN).ilog(FAN_OUT) as usize + 2;
        self.lists.resize_with(n_lists, List::default);
        for list in &mut self.lists {
            list.x.resize(centers.n + SLACK, 0.0);
            list.y.resize(centers.n + SLACK, 0.0);
            list.words.resize(centers.n / 64 + 3, Word::default());
        }
        let list = &mut self.lists[0];
        for ((x, y), i) in list.x.iter_mut().zip(&mut list.y).zip(self.sorted.indices()) {
            (*x, *y) = (centers.x[i], centers.y[i]);
        }
        for zeroed in [&mut self.counts, &mut self.above] {
            zeroed.clear();
            zeroed.resize(n_obstacles, 0);
        }
    }
}

/// Obstacles of the runs that split no list for shorter runs, and how many shorter runs a run has.
const SHORTEST_RUN: usize = 32;
const FAN_OUT: usize = 8;

/// Length of the first runs that split a list: there are more than sixteen of them if any are split at all.
fn longest_run(n_obstacles: usize) -> usize {
    let mut length = SHORTEST_RUN;
    while 16 * FAN_OUT * length <= n_obstacles {
        length *= FAN_OUT;
    }
    length
}

/// One step's way down the runs.
struct Walk<'a> {
    obstacles: &'a Coordinates,
    isa: Isa,
    radius_squared: f32,
    stats: &'a mut Stats,
}

impl Walk<'_> {
    /// Counts for the obstacles from `first` on, in runs of `length`; `ranges` are theirs, of the list
    /// `lists[0]`.
    fn visit(&mut self, length: usize, first: usize, lists: &mut [List], ranges: RankRanges) {
        let [list, below @ ..] = lists else { return };
        let n = ranges.counts.len();
        let mut rest = ranges;
        for start in (first..first + n).step_by(length) {
            let mut ranges = rest.split_to(length);
            let RangeSpan { first, last, pairs } = self.isa.run(FindSpan(&ranges));
            if pairs == 0 {
                continue;
            }
            let split = PAIRS_PER_CENTER * u64::from(last - first)
                + PAIRS_PER_OBSTACLE * ranges.counts.len() as u64;
            if pairs <= split {
                self.test(start, list, ranges);
                continue;
            }
            let range = start..start + ranges.counts.len().next_multiple_of(MAX_LANES);
            let (n_annulus, counted) = self.isa.run(AnnulusSplit {
                radius_squared: self.radius_squared,
                obstacle_x: &self.obstacles.x[range.clone()],
                obstacle_y: &self.obstacles.y[range],
                x: &list.x,
                y: &list.y,
                first,
                last,
                ranges: ranges.reborrow(),
                words: &mut list.words,
                annulus_x: &mut below[0].x,
                annulus_y: &mut below[0].y,
            });
            self.stats.beta_by_run += counted;
            if n_annulus > 0 && length > SHORTEST_RUN {
                self.visit(length / FAN_OUT, start, below, ranges);
            } else if n_annulus > 0 {
                self.test(start, &below[0], ranges);
            }
        }
    }

    /// Tests the ranges of the obstacles from `first` on, center by center.
    fn test(&mut self, first: usize, list: &List, ranges: RankRanges) {
        let range = first..first + ranges.counts.len();
        self.stats.beta_pairs_tested += self.isa.run(CountInRanges {
            radius_squared: self.radius_squared,
            x: &list.x,
            y: &list.y,
            obstacle_x: &self.obstacles.x[range.clone()],
            obstacle_y: &self.obstacles.y[range],
            ranges,
        });
    }
}
