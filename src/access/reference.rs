//! Plain loops in plain order: the law. Every pair is tested by the predicate as it stands.

use super::Stats;
use super::driver::Method;
use super::predicate::{self, Frame};
use super::problem::{Scene, Tool};

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

    fn collide(&self, scratch: &mut Scratch, tool: &Tool, row: &mut [u64]) -> Stats {
        let mut stats = Stats { queries: tool.n() as u64, ..Stats::default() };
        for i in 0..tool.n() {
            let centre = tool.centre(&scratch.frame, i);
            for (j, &obstacle) in scratch.obstacles.iter().enumerate() {
                stats.pairs_tested += 1;
                if j != tool.own(i) && predicate::collides(&tool.steps, centre, obstacle) {
                    row[i / 64] |= 1 << (i % 64);
                    break;
                }
            }
        }
        stats
    }

    fn count(&self, scratch: &mut Scratch, tool: &Tool, beta: &mut [u64]) -> Stats {
        for i in 0..tool.n() {
            let centre = tool.centre(&scratch.frame, i);
            for (j, &obstacle) in scratch.obstacles.iter().enumerate() {
                if j != tool.own(i) && predicate::collides(&tool.steps, centre, obstacle) {
                    beta[j] += 1;
                }
            }
        }
        let pairs = tool.n() as u64 * scratch.obstacles.len() as u64;
        Stats { beta_pairs_tested: pairs, ..Stats::default() }
    }
}
