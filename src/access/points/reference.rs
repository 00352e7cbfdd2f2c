//! The reference engine: plain loops over all pairs, in plain order; the other engines must give its bits.

use super::method::Method;
use super::predicate::{self, Frame};
use super::problem::{PlacedCutter, Scene};
use super::stats::Stats;

/// The engine; it keeps nothing from one direction to the next.
pub(super) struct Reference<'a> {
    pub scene: &'a Scene,
}

/// Obstacles of the current direction.
#[derive(Default)]
pub(super) struct Scratch {
    frame: Frame,
    obstacles: Vec<[f32; 3]>,
}

impl Method for Reference<'_> {
    type Scratch = Scratch;

    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn enter(&self, scratch: &mut Scratch, frame: &Frame) {
        let obstacles = &self.scene.obstacles;
        scratch.frame = *frame;
        scratch.obstacles =
            (0..obstacles.n).map(|j| predicate::rotate(frame, obstacles.get(j))).collect();
    }

    fn collide(&self, scratch: &mut Scratch, cutter: &PlacedCutter, row: &mut [u64]) -> Stats {
        let mut stats = Stats { queries: cutter.n() as u64, ..Stats::default() };
        for i in 0..cutter.n() {
            let center = cutter.center(&scratch.frame, i);
            for (j, &obstacle) in scratch.obstacles.iter().enumerate() {
                stats.pairs_tested += 1;
                if j != cutter.own(i) && predicate::collides(&cutter.steps, center, obstacle) {
                    row[i / 64] |= 1 << (i % 64);
                    break;
                }
            }
        }
        stats
    }

    fn count(&self, scratch: &mut Scratch, cutter: &PlacedCutter, beta: &mut [u64]) -> Stats {
        for i in 0..cutter.n() {
            let center = cutter.center(&scratch.frame, i);
            for (j, &obstacle) in scratch.obstacles.iter().enumerate() {
                if j != cutter.own(i) && predicate::collides(&cutter.steps, center, obstacle) {
                    beta[j] += 1;
                }
            }
        }
        let pairs = cutter.n() as u64 * scratch.obstacles.len() as u64;
        Stats { beta_pairs_tested: pairs, ..Stats::default() }
    }
}
