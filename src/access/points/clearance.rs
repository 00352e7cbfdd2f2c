//! Signed clearance of a query: how far every height and radius of the cutter may grow before the query becomes
//! inaccessible.
//!
//! Growing a cutter by `c` lowers every step by `c` and widens it by `c`
//! ([`Cutter::grown`](crate::tool::cutter::Cutter::grown)). In one direction, obstacle `j`
//! begins to collide with the grown cutter at `c = min over steps of max(height − h, r − radius)`; the
//! direction is accessible for every smaller `c`. A query's clearance is therefore
//!
//! ```text
//! max over directions of  min over obstacles j ≠ i of  min over steps of  max(height − h, r − radius)
//! ```
//!
//! no search for `c` is needed. It is evaluated in `f64` on the rotated `f32` coordinates; boxes only
//! discard obstacles that cannot be the minimum, and directions that cannot be the maximum, so the value
//! does not depend on threads or instruction sets.

use super::kernels::rotate_obstacles;
use super::predicate::Frame;
use super::problem::{PlacedCutter, Scene};
use crate::exec::par;
use crate::simd::Isa;
use crate::spatial::Coordinates;
use crate::spatial::bvh::{Aabbs, Bvh8, FAN_OUT};
use crate::tool::cutter::Cutter;

/// Clearance of every query of `scene`, within ±`limit_mm`; next to 0 the sign is open to rounding.
pub(super) fn signed_clearance(
    scene: &Scene,
    cutter: &Cutter,
    frames: &[Frame],
    limit_mm: f64,
    isa: Isa,
) -> Vec<f32> {
    let placed = PlacedCutter::new(scene, cutter);
    let steps: Vec<[f64; 2]> =
        cutter.steps().iter().map(|step| [step.height_mm, step.radius_mm]).collect();
    let state = || {
        let best = vec![-limit_mm; placed.n()];
        (Bvh8::new(scene.obstacles.n), Coordinates::default(), best)
    };
    let (_, workers) = par::map_with(frames.len(), state, |(tree, centers, best), k| {
        rotate_obstacles(&scene.obstacles, &frames[k], isa, &mut tree.points);
        tree.enclose();
        centers.resize(placed.n());
        placed.centers(&frames[k], isa, centers);
        for (i, best) in best.iter_mut().enumerate() {
            let center = centers.get(i).map(f64::from);
            let search = Nearest { tree, steps: &steps, center, own: placed.own(i), floor: *best };
            *best = search.least(limit_mm).max(*best);
        }
    });
    let mut clearance = vec![-limit_mm; placed.n()];
    for (_, _, best) in &workers {
        clearance.iter_mut().zip(best).for_each(|(all, &one)| *all = all.max(one));
    }
    clearance.into_iter().map(|c| c as f32).collect()
}

/// The obstacle that a growing cutter meets first, in one direction.
struct Nearest<'a> {
    tree: &'a Bvh8,
    steps: &'a [[f64; 2]],
    center: [f64; 3],
    own: usize,
    /// A result at or below this is of no interest.
    floor: f64,
}

impl Nearest<'_> {
    /// The growth at which the first obstacle is met, at most `limit`; anything at or below the floor
    /// if that lies there.
    fn least(&self, limit: f64) -> f64 {
        let mut least = limit;
        let top = self.tree.levels.len();
        for group in 0..self.tree.levels[top - 1].n.div_ceil(FAN_OUT) {
            self.descend(top, group, &mut least);
        }
        least
    }

    fn descend(&self, height: usize, group: usize, least: &mut f64) {
        if height == 0 {
            let end = self.tree.points.n.min(FAN_OUT * (group + 1));
            for j in (FAN_OUT * group..end).filter(|&j| j != self.own) {
                let [x, y, z] = self.tree.points.get(j).map(f64::from);
                let (dx, dy) = (x - self.center[0], y - self.center[1]);
                *least = least.min(self.meets(z, (dx * dx + dy * dy).sqrt()));
            }
            return;
        }
        let boxes = &self.tree.levels[height - 1];
        let mut bounds = [(0.0, 0); FAN_OUT];
        let mut n = 0;
        for child in FAN_OUT * group..boxes.n.min(FAN_OUT * (group + 1)) {
            bounds[n] = (self.bound(boxes, child), child);
            n += 1;
        }
        bounds[..n].sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        for &(bound, child) in &bounds[..n] {
            if bound < *least && *least > self.floor {
                self.descend(height - 1, child, least);
            }
        }
    }

    /// Growth at which a point at height `z` and distance `r` from the axis is met.
    fn meets(&self, z: f64, r: f64) -> f64 {
        let h = z - self.center[2];
        let steps = self.steps.iter().map(|[height, radius]| (height - h).max(r - radius));
        steps.fold(f64::INFINITY, f64::min)
    }

    /// No obstacle of a box is met at less growth than this.
    fn bound(&self, boxes: &Aabbs, b: usize) -> f64 {
        let outside = |c: f64, least: f32, greatest: f32| {
            (f64::from(least) - c).max(c - f64::from(greatest)).max(0.0)
        };
        let dx = outside(self.center[0], boxes.x0[b], boxes.x1[b]);
        let dy = outside(self.center[1], boxes.y0[b], boxes.y1[b]);
        self.meets(f64::from(boxes.top[b]), (dx * dx + dy * dy).sqrt())
    }
}
