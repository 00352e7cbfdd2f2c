//! The default engine: height bounds and rasters decide most queries, the predicate decides the rest.
//! Its labels and counts equal those of the reference engine bit for bit.
//!
//! Labels: see [`search`]. β: see [`count`]. Obstacles and queries are put into a spatial
//! order once, the rest is done anew in every direction from the rotated coordinates.

mod annulus_split;
mod bounds;
mod count;
mod rank_ranges;
mod ranks;
mod search;

use super::kernels::{AnyObstacle, rotate_obstacles};
use super::method::Method;
use super::predicate::{self, Frame};
use super::problem::{PlacedCutter, Scene};
use super::stats::Stats;
use crate::simd::Isa;
use crate::spatial::Coordinates;
use bounds::Bounding;
use count::Counting;
use search::{AnswerCache, Search, SearchScratch};

pub(super) use bounds::BetaBounds;

/// The engine; its scene must be in spatial order to be fast.
pub(super) struct Pruned<'a> {
    pub scene: &'a Scene,
    pub isa: Isa,
}

/// Coordinates and lists of the current direction.
pub(super) struct Scratch {
    frame: Frame,
    obstacles: Coordinates,
    centers: Coordinates,
    own_z: Vec<f32>,
    undecided: Vec<u32>,
    /// The group of cutters whose reference points `centers` and `cache` belong to.
    group: Option<usize>,
    cache: AnswerCache,
    search: SearchScratch,
    counting: Counting,
    bounding: Bounding,
}

impl Method for Pruned<'_> {
    type Scratch = Scratch;

    fn scratch(&self) -> Scratch {
        Scratch {
            frame: Frame::default(),
            obstacles: Coordinates::zeros(self.scene.obstacles.n),
            centers: Coordinates::default(),
            own_z: Vec::new(),
            undecided: Vec::new(),
            group: None,
            cache: AnswerCache::default(),
            search: SearchScratch::default(),
            counting: Counting::default(),
            bounding: Bounding::default(),
        }
    }

    fn enter(&self, scratch: &mut Scratch, frame: &Frame) {
        scratch.frame = *frame;
        scratch.group = None;
        rotate_obstacles(&self.scene.obstacles, frame, self.isa, &mut scratch.obstacles);
    }

    fn collide(&self, scratch: &mut Scratch, cutter: &PlacedCutter, row: &mut [u64]) -> Stats {
        let Scratch { frame, obstacles, centers, own_z, undecided, group, cache, search, .. } =
            scratch;
        if cutter.group.is_none() || *group != cutter.group {
            centers.resize(cutter.n());
            cutter.centers(frame, self.isa, centers);
            cache.clear();
            *group = cutter.group;
        }
        let cache = cutter.group.is_some().then_some(cache);
        let own_z = if cutter.own_in_order(obstacles.n) {
            &obstacles.z
        } else {
            own_heights(cutter, &obstacles.z, own_z, centers.z.len());
            own_z
        };
        undecided.clear();
        let done = self.isa.run(Search {
            centers,
            steps: &cutter.steps,
            obstacles,
            own_z,
            row: &mut *row,
            undecided,
            cache,
            scratch: search,
        });
        let mut stats = Stats {
            queries: cutter.n() as u64,
            by_height: done.by_height,
            by_cutter: done.by_cache,
            by_grid: done.by_grid,
            pairs_tested: done.tested,
            ..Stats::default()
        };
        for &i in &*undecided {
            let (hit, tested) = self.isa.run(AnyObstacle {
                center: centers.get(i as usize),
                steps: &cutter.steps,
                obstacles,
                except: cutter.own(i as usize),
            });
            row[i as usize / 64] |= u64::from(hit) << (i % 64);
            stats.pairs_tested += tested as u64;
        }
        stats
    }

    fn count(&self, scratch: &mut Scratch, cutter: &PlacedCutter, beta: &mut [u64]) -> Stats {
        let Scratch { frame, obstacles, centers, counting, .. } = scratch;
        centers.resize(cutter.n());
        cutter.centers(frame, self.isa, centers);
        let stats = counting.run(&cutter.steps, centers, obstacles, beta, self.isa);
        for i in 0..cutter.n() {
            let own = cutter.own(i);
            // Nearly all are too low, which is quickly seen.
            if own != usize::MAX
                && obstacles.z[own] > centers.z[i] + cutter.steps[0].height
                && predicate::collides(&cutter.steps, centers.get(i), obstacles.get(own))
            {
                beta[own] -= 1;
            }
        }
        stats
    }
}

impl Pruned<'_> {
    /// Adds what the current direction adds to the bounds of β.
    pub fn bound(&self, scratch: &mut Scratch, cutter: &PlacedCutter, bounds: &mut BetaBounds) {
        let Scratch { frame, obstacles, centers, bounding, .. } = scratch;
        centers.resize(cutter.n());
        cutter.centers(frame, self.isa, centers);
        bounding.add(&cutter.steps, centers, obstacles, bounds, self.isa);
    }
}

/// Height of each query's own obstacle, −∞ where it has none.
fn own_heights(cutter: &PlacedCutter, z: &[f32], own_z: &mut Vec<f32>, len: usize) {
    own_z.clear();
    own_z.extend(cutter.own.iter().map(|&j| z[j as usize]));
    own_z.resize(len, f32::NEG_INFINITY);
}
