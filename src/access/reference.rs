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
        let n_queries = self.scene.n_queries();
        let mut stats = Stats { queries: n_queries as u64, ..Stats::default() };
        for i in 0..n_queries {
            let centre = tool.centre(self.scene, &scratch.frame, i);
            for (j, &obstacle) in scratch.obstacles.iter().enumerate() {
                stats.pairs_tested += 1;
                if j != self.scene.own(i) && predicate::collides(&tool.steps, centre, obstacle) {
                    row[i / 64] |= 1 << (i % 64);
                    break;
                }
            }
        }
        stats
    }

    fn count(
        &self,
        scratch: &mut Scratch,
        tool: &Tool,
        inaccessible: &[u32],
        beta: &mut [u64],
    ) -> Stats {
        for &i in inaccessible {
            let i = i as usize;
            let centre = tool.centre(self.scene, &scratch.frame, i);
            for (j, &obstacle) in scratch.obstacles.iter().enumerate() {
                if j != self.scene.own(i) && predicate::collides(&tool.steps, centre, obstacle) {
                    beta[j] += 1;
                }
            }
        }
        let pairs = inaccessible.len() as u64 * scratch.obstacles.len() as u64;
        Stats { beta_pairs_tested: pairs, ..Stats::default() }
    }
}
