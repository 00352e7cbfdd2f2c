//! Every pair, eight at a time, stopping at the first collision: the law in vectors.

use super::Stats;
use super::driver::Method;
use super::predicate::Frame;
use super::problem::{Scene, Tool};
use crate::simd::Level;
use crate::simd::collide::{AnyObstacle, Coordinates, CountCentres, Rotate};

/// The engine.
pub(super) struct Batched<'a> {
    pub scene: &'a Scene,
    pub level: Level,
}

/// Coordinates of the current direction.
pub(super) struct Scratch {
    frame: Frame,
    obstacles: Coordinates,
    centres: Coordinates,
}

impl Method for Batched<'_> {
    type Scratch = Scratch;

    fn scratch(&self) -> Scratch {
        Scratch {
            frame: Frame::default(),
            obstacles: Coordinates::zeros(self.scene.obstacles.n),
            centres: Coordinates::default(),
        }
    }

    fn enter(&self, scratch: &mut Scratch, frame: &Frame) {
        scratch.frame = *frame;
        let (from, to) = (&self.scene.obstacles, &mut scratch.obstacles);
        self.level.run(Rotate { frame, from, to });
        scratch.obstacles.pad_z(f32::NEG_INFINITY);
    }

    fn collide(&self, scratch: &mut Scratch, tool: &Tool, row: &mut [u64]) -> Stats {
        let Scratch { frame, obstacles, centres } = scratch;
        centres.resize(tool.n());
        tool.centres(frame, self.level, centres);
        let mut stats = Stats { queries: tool.n() as u64, ..Stats::default() };
        for i in 0..tool.n() {
            let (hit, tested) = self.level.run(AnyObstacle {
                centre: centres.get(i),
                steps: &tool.steps,
                obstacles,
                except: tool.own(i),
            });
            row[i / 64] |= u64::from(hit) << (i % 64);
            stats.pairs_tested += tested as u64;
        }
        stats
    }

    fn count(&self, scratch: &mut Scratch, tool: &Tool, beta: &mut [u64]) -> Stats {
        let Scratch { frame, obstacles, centres } = scratch;
        centres.resize(tool.n());
        tool.centres(frame, self.level, centres);
        centres.pad_z(f32::INFINITY);
        let mut own = vec![usize::MAX; obstacles.n];
        tool.own.iter().enumerate().for_each(|(i, &j)| own[j as usize] = i);
        for (j, count) in beta.iter_mut().enumerate() {
            *count += self.level.run(CountCentres {
                obstacle: obstacles.get(j),
                steps: &tool.steps,
                centres,
                except: own[j],
            });
        }
        let pairs = tool.n() as u64 * obstacles.n as u64;
        Stats { beta_pairs_tested: pairs, ..Stats::default() }
    }
}
