//! Signed clearance against triangles: how far the steps that do not cut may grow before a site becomes inaccessible,
//! as [`Cutter::with_clearance`](crate::tool::cutter::Cutter::with_clearance) grows them; negative: how far all steps
//! must shrink.
//!
//! Both only grow with the margin, so one tool after the other is tested. In one direction the greatest `c` at which no
//! step penetrates is found by bisection; a direction that is not clear at the best `c` so far is left after one tool.

use super::labels::CLEARANCE_STEP_MM;
use super::problem::Problem;
use super::query::{Probe, Scratch};
use super::tool::{Stand, axes};
use super::verdict::Verdict;
use crate::access::evidence::WitnessPose;
use crate::exec::par;
use crate::tool::directions::Directions;
use glam::Vec3;

/// Queries per task.
const BLOCK: usize = 64;

impl Problem<'_> {
    /// Clearance of every query within ±`limit`: over the poses that touch with its normal along `directions`, and its
    /// witness. The sign is that of the answer.
    pub fn clearance(
        &self,
        directions: &Directions,
        witness: &[Option<WitnessPose>],
        inaccessible: &[bool],
        limit: f64,
    ) -> Vec<f32> {
        let blocks = par::map_blocks(self.contacts.len(), BLOCK, |range| {
            let mut scratch = Scratch::default();
            let of = |i: usize| {
                let mut best = -limit;
                scratch = Scratch::renewed(std::mem::take(&mut scratch));
                if let Some(pose) = witness[i] {
                    let axes = axes(pose.direction);
                    let stand = Stand { reference: pose.reference(&self.outline), axes };
                    best = self.clear_up_to(&stand, [best, limit], &mut scratch);
                }
                for &direction in directions.vectors() {
                    let stand = self.own_stand(i, direction);
                    best = self.clear_up_to(&stand, [best, limit], &mut scratch);
                }
                let sign = if inaccessible[i] { best.min(0.0) } else { best.max(0.0) };
                sign as f32
            };
            range.map(of).collect::<Vec<_>>()
        });
        blocks.into_iter().flatten().collect()
    }

    /// The tool that touches a query with its normal.
    pub fn own_stand(&self, i: usize, direction: Vec3) -> Stand {
        let axes = axes(direction);
        Stand { reference: self.contacts[i].reference_point(&self.outline, axes[2]), axes }
    }

    /// The greatest growth between `low` and `high` at which no step penetrates; `low` if there is none above it.
    pub fn clear_up_to(
        &self,
        stand: &Stand,
        [mut low, mut high]: [f64; 2],
        scratch: &mut Scratch,
    ) -> f64 {
        let least = self.tolerances.least;
        let mut clear = |growth: f64| {
            let outline = self.outline.with_margin(growth);
            let probe = Probe::of_steps(&outline, least, self.bvh, self.reach);
            probe.verdict(self.triangles(), stand, scratch) != Verdict::Collides
        };
        if high - low <= CLEARANCE_STEP_MM || !clear(low + CLEARANCE_STEP_MM) {
            return low;
        }
        if clear(high) {
            return high;
        }
        low += CLEARANCE_STEP_MM;
        while high - low > CLEARANCE_STEP_MM {
            let middle = 0.5 * (low + high);
            if clear(middle) { low = middle } else { high = middle }
        }
        low
    }
}
