//! The batched engine: tests every pair with the predicate, a vector of lanes at a time, until the first collision.

use super::kernels::{AnyObstacle, CountCenters, rotate_obstacles};
use super::method::Method;
use super::predicate::Frame;
use super::problem::{PlacedCutter, Scene};
use super::stats::Stats;
use crate::simd::Isa;
use crate::spatial::Coordinates;

/// The engine.
pub(super) struct Batched<'a> {
    pub scene: &'a Scene,
    pub isa: Isa,
}

/// Coordinates of the current direction.
pub(super) struct Scratch {
    frame: Frame,
    obstacles: Coordinates,
    centers: Coordinates,
}

impl Method for Batched<'_> {
    type Scratch = Scratch;

    fn scratch(&self) -> Scratch {
        Scratch {
            frame: Frame::default(),
            obstacles: Coordinates::zeros(self.scene.obstacles.n),
            centers: Coordinates::default(),
        }
    }

    fn enter(&self, scratch: &mut Scratch, frame: &Frame) {
        scratch.frame = *frame;
        rotate_obstacles(&self.scene.obstacles, frame, self.isa, &mut scratch.obstacles);
    }

    fn collide(&self, scratch: &mut Scratch, cutter: &PlacedCutter, row: &mut [u64]) -> Stats {
        let Scratch { frame, obstacles, centers } = scratch;
        centers.resize(cutter.n());
        cutter.centers(frame, self.isa, centers);
        let mut stats = Stats { queries: cutter.n() as u64, ..Stats::default() };
        for i in 0..cutter.n() {
            let (hit, tested) = self.isa.run(AnyObstacle {
                center: centers.get(i),
                steps: &cutter.steps,
                obstacles,
                except: cutter.own(i),
            });
            row[i / 64] |= u64::from(hit) << (i % 64);
            stats.pairs_tested += tested as u64;
        }
        stats
    }

    fn count(&self, scratch: &mut Scratch, cutter: &PlacedCutter, beta: &mut [u64]) -> Stats {
        let Scratch { frame, obstacles, centers } = scratch;
        centers.resize(cutter.n());
        cutter.centers(frame, self.isa, centers);
        centers.pad_z(f32::INFINITY);
        let mut own = vec![usize::MAX; obstacles.n];
        cutter.own.iter().enumerate().for_each(|(i, &j)| own[j as usize] = i);
        for (j, count) in beta.iter_mut().enumerate() {
            *count += self.isa.run(CountCenters {
                obstacle: obstacles.get(j),
                steps: &cutter.steps,
                centers,
                except: own[j],
            });
        }
        let pairs = cutter.n() as u64 * obstacles.n as u64;
        Stats { beta_pairs_tested: pairs, ..Stats::default() }
    }
}
