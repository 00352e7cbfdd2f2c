//! The default engine: heights, rasters and runs decide most questions, the predicate decides the rest.
//! Equal to the law bit for bit.
//!
//! Labels: see [`search`](crate::simd::search). β: see [`count`]. Obstacles and queries are put into a spatial
//! order once, the rest is done anew in every direction from the rotated coordinates.

mod count;
mod ranks;

use super::driver::Method;
use super::predicate::{self, Frame};
use super::problem::{Scene, Tool};
use super::stats::Stats;
use crate::simd::Level;
use crate::simd::collide::{AnyObstacle, Coordinates, Rotate};
use crate::simd::search::{Known, Room, Search};
use count::Counting;

/// The engine; its scene must be in spatial order to be fast.
pub(super) struct Pruned<'a> {
    pub scene: &'a Scene,
    pub level: Level,
}

/// Coordinates and lists of the current direction.
pub(super) struct Scratch {
    frame: Frame,
    obstacles: Coordinates,
    centres: Coordinates,
    own_z: Vec<f32>,
    undecided: Vec<u32>,
    /// Whose reference points `centres` and `known` belong to.
    kin: Option<usize>,
    known: Known,
    room: Room,
    counting: Counting,
}

impl Method for Pruned<'_> {
    type Scratch = Scratch;

    fn scratch(&self) -> Scratch {
        Scratch {
            frame: Frame::default(),
            obstacles: Coordinates::zeros(self.scene.obstacles.n),
            centres: Coordinates::default(),
            own_z: Vec::new(),
            undecided: Vec::new(),
            kin: None,
            known: Known::default(),
            room: Room::default(),
            counting: Counting::default(),
        }
    }

    fn enter(&self, scratch: &mut Scratch, frame: &Frame) {
        scratch.frame = *frame;
        scratch.kin = None;
        turn(&mut scratch.obstacles, &self.scene.obstacles, frame, self.level);
    }

    fn collide(&self, scratch: &mut Scratch, tool: &Tool, row: &mut [u64]) -> Stats {
        let Scratch { frame, obstacles, centres, own_z, undecided, kin, known, room, .. } = scratch;
        if tool.kin.is_none() || *kin != tool.kin {
            centres.resize(tool.n());
            tool.centres(frame, self.level, centres);
            known.clear();
            *kin = tool.kin;
        }
        let known = tool.kin.is_some().then_some(known);
        let own_z = if tool.own_in_order(obstacles.n) {
            &obstacles.z
        } else {
            own_heights(tool, &obstacles.z, own_z, centres.z.len());
            own_z
        };
        undecided.clear();
        let done = self.level.run(Search {
            centres,
            steps: &tool.steps,
            obstacles,
            own_z,
            row: &mut *row,
            undecided,
            known,
            room,
        });
        let mut stats = Stats {
            queries: tool.n() as u64,
            by_height: done.by_height,
            by_cutter: done.by_known,
            by_grid: done.by_grid,
            pairs_tested: done.tested,
            ..Stats::default()
        };
        for &i in &*undecided {
            let (hit, tested) = self.level.run(AnyObstacle {
                centre: centres.get(i as usize),
                steps: &tool.steps,
                obstacles,
                except: tool.own(i as usize),
            });
            row[i as usize / 64] |= u64::from(hit) << (i % 64);
            stats.pairs_tested += tested as u64;
        }
        stats
    }

    fn count(&self, scratch: &mut Scratch, tool: &Tool, beta: &mut [u64]) -> Stats {
        let Scratch { frame, obstacles, centres, counting, .. } = scratch;
        centres.resize(tool.n());
        tool.centres(frame, self.level, centres);
        let stats = counting.run(&tool.steps, centres, obstacles, beta, self.level);
        for i in 0..tool.n() {
            let own = tool.own(i);
            // Nearly all are too low, which is quickly seen.
            if own != usize::MAX
                && obstacles.z[own] > centres.z[i] + tool.steps[0].height
                && predicate::collides(&tool.steps, centres.get(i), obstacles.get(own))
            {
                beta[own] -= 1;
            }
        }
        stats
    }
}

/// Rotates the obstacles; padding repeats the place of the last one, at height −∞.
pub(super) fn turn(points: &mut Coordinates, obstacles: &Coordinates, frame: &Frame, level: Level) {
    level.run(Rotate { frame, from: obstacles, to: points });
    points.pad_z(f32::NEG_INFINITY);
    if let Some(last) = points.n.checked_sub(1) {
        let [x, y, _] = points.get(last);
        points.x[last..].fill(x);
        points.y[last..].fill(y);
    }
}

/// Height of each query's own obstacle, −∞ where it has none.
fn own_heights(tool: &Tool, z: &[f32], own_z: &mut Vec<f32>, len: usize) {
    own_z.clear();
    own_z.extend(tool.own.iter().map(|&j| z[j as usize]));
    own_z.resize(len, f32::NEG_INFINITY);
}
