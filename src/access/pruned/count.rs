//! β by counting: for every obstacle, the centres whose cutter it is in.
//!
//! With the centres of a direction sorted by height, "step k's height is passed" is a prefix of the
//! list, one rank per obstacle and step. What the spindle hits is that rank. For a step of finite radius
//! the candidates are the window between its rank and that of the next step (above it the next, wider
//! step decides), and what remains is to count the candidates within the radius. Going down the boxes
//! around the obstacles, each box splits its part of the list: centres within reach of the whole box are
//! counted for all its obstacles by prefix sums, centres beyond reach are dropped, the ring between is
//! handed to the boxes below.

use super::ranks::Sorted;
use crate::access::Stats;
use crate::simd::Level;
use crate::simd::boxes::Tree;
use crate::simd::collide::{Coordinates, StepSquared};
use crate::simd::windows::{CountWindows, Cover, SLACK, Span, Split, Windows, Word};

/// Lists and windows, reused from direction to direction.
#[derive(Default)]
pub(super) struct Counting {
    sorted: Sorted,
    lists: Vec<List>,
    ranks: Vec<u32>,
    above: Vec<u32>,
    from: Vec<u32>,
    counts: Vec<u32>,
}

/// A list of centres, ascending in height, and room for what a split says about it.
#[derive(Default)]
struct List {
    x: Vec<f32>,
    y: Vec<f32>,
    words: Vec<Word>,
}

/// Testing one pair costs this share of splitting off one centre or of moving one obstacle's window on:
/// a box is split only if that can pay (chosen by `benches/labeler.rs`).
const PAIRS_PER_CENTRE: u64 = 12;
const PAIRS_PER_OBSTACLE: u64 = 64;

impl Counting {
    /// Adds to each obstacle's `beta` the number of centres whose cutter it is in.
    pub fn run(
        &mut self,
        steps: &[StepSquared],
        centres: &Coordinates,
        tree: &Tree,
        beta: &mut [u64],
        level: Level,
    ) -> Stats {
        let mut stats = Stats::default();
        if centres.n == 0 {
            return stats;
        }
        self.prepare(centres, tree);
        let z = &tree.points.z[..tree.points.n];
        for step in steps.iter().rev() {
            self.sorted.ranks(z, step.height, &mut self.ranks, level);
            if step.radius_squared == f32::INFINITY {
                for (count, &rank) in self.counts.iter_mut().zip(&self.ranks) {
                    *count += rank;
                    stats.beta_by_rank += u64::from(rank);
                }
                std::mem::swap(&mut self.above, &mut self.ranks);
                continue;
            }
            std::mem::swap(&mut self.from, &mut self.above);
            self.above.clone_from(&self.ranks);
            let windows =
                Windows { from: &mut self.from, to: &mut self.ranks, counts: &mut self.counts };
            let radius_squared = step.radius_squared;
            let mut walk = Walk { tree, level, radius_squared, stats: &mut stats };
            walk.start(&mut self.lists, windows);
        }
        beta.iter_mut().zip(&self.counts).for_each(|(beta, &count)| *beta += u64::from(count));
        stats
    }

    fn prepare(&mut self, centres: &Coordinates, tree: &Tree) {
        self.sorted.fill(centres);
        self.lists.resize_with(tree.levels.len() + 1, List::default);
        for list in &mut self.lists {
            list.x.resize(centres.n + SLACK, 0.0);
            list.y.resize(centres.n + SLACK, 0.0);
            list.words.resize(centres.n / 64 + 3, Word::default());
        }
        let list = &mut self.lists[0];
        for ((x, y), i) in list.x.iter_mut().zip(&mut list.y).zip(self.sorted.indices()) {
            (*x, *y) = (centres.x[i], centres.y[i]);
        }
        for zeroed in [&mut self.counts, &mut self.above] {
            zeroed.clear();
            zeroed.resize(tree.points.n, 0);
        }
    }
}

/// One step's way down the boxes.
struct Walk<'a> {
    tree: &'a Tree,
    level: Level,
    radius_squared: f32,
    stats: &'a mut Stats,
}

/// A top level of so few boxes is not worth a split.
const FEW: usize = 4;

impl Walk<'_> {
    /// Counts for all obstacles from the list `lists[0]`.
    fn start(&mut self, lists: &mut [List], mut windows: Windows) {
        let levels = &self.tree.levels;
        let skipped = levels.len() > 1 && levels[levels.len() - 1].n <= FEW;
        let height = levels.len() - usize::from(skipped);
        for group in 0..levels[height - 1].n.div_ceil(8) {
            let length = 8usize.pow(height as u32 + 1);
            self.visit(height, group, lists, windows.split_to(length));
        }
    }

    /// Counts for the obstacles of `group`, a box above level `height` of the tree; `windows` are
    /// theirs, into the list `lists[0]`.
    fn visit(&mut self, height: usize, group: usize, lists: &mut [List], windows: Windows) {
        let [list, below @ ..] = lists else { return };
        let boxes = &self.tree.levels[height - 1];
        let length = 8usize.pow(height as u32);
        let mut rest = windows;
        for child in 8 * group..boxes.n.min(8 * group + 8) {
            let mut windows = rest.split_to(length);
            let Cover { first, last, pairs } = self.level.run(Span(&windows));
            if pairs == 0 {
                continue;
            }
            let split = PAIRS_PER_CENTRE * u64::from(last - first)
                + PAIRS_PER_OBSTACLE * windows.counts.len() as u64;
            if pairs <= split {
                self.test(child * length, list, windows);
                continue;
            }
            let middle = |least: &[f32], greatest: &[f32]| 0.5 * (least[child] + greatest[child]);
            let start = child * length;
            let obstacles = start..start + windows.counts.len().next_multiple_of(8);
            let (ring, counted) = self.level.run(Split {
                radius_squared: self.radius_squared,
                middle: [middle(&boxes.x0, &boxes.x1), middle(&boxes.y0, &boxes.y1)],
                obstacle_x: &self.tree.points.x[obstacles.clone()],
                obstacle_y: &self.tree.points.y[obstacles],
                x: &list.x,
                y: &list.y,
                first,
                last,
                windows: windows.reborrow(),
                words: &mut list.words,
                ring_x: &mut below[0].x,
                ring_y: &mut below[0].y,
            });
            self.stats.beta_by_box += counted;
            if ring > 0 && height > 1 {
                self.visit(height - 1, child, below, windows);
            } else if ring > 0 {
                self.test(child * length, &below[0], windows);
            }
        }
    }

    /// Tests the windows of the obstacles from `first` on, centre by centre.
    fn test(&mut self, first: usize, list: &List, windows: Windows) {
        let range = first..first + windows.counts.len();
        self.stats.beta_pairs_tested += self.level.run(CountWindows {
            radius_squared: self.radius_squared,
            x: &list.x,
            y: &list.y,
            obstacle_x: &self.tree.points.x[range.clone()],
            obstacle_y: &self.tree.points.y[range],
            windows,
        });
    }
}
