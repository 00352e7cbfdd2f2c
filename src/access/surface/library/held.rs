//! A holder above the sites of a problem: from which stick-out on it is clear.

use super::super::bvh::Bvh;
use super::super::drop;
use super::super::problem::Problem;
use super::super::query::{Scratch, from_box};
use super::super::tool::{Stand, axes};
use crate::access::evidence::WitnessPose;
use crate::exec::par;
use crate::tool::cutter::Assembly;
use glam::Vec3;

/// A holder over the sites of a problem.
pub(super) struct Held<'a> {
    problem: &'a Problem<'a>,
    /// Height above the nose and radius of the steps below the spindle.
    steps: Vec<[f64; 2]>,
    /// Height of the spindle above the nose.
    spindle: f64,
    corner: f64,
    /// No stick-out is less.
    pub floor: f64,
    size: f64,
}

impl<'a> Held<'a> {
    pub fn new(problem: &'a Problem<'a>, assembly: &Assembly) -> Self {
        let finite = assembly.holder().iter().filter(|step| step.radius_mm.is_finite());
        let steps: Vec<[f64; 2]> = finite.map(|step| [step.height_mm, step.radius_mm]).collect();
        let spindle = assembly.holder().iter().find(|step| step.radius_mm == f64::INFINITY);
        let size = steps.iter().flatten().fold(problem.outline.size(), |a, b| a.max(*b));
        Held {
            problem,
            steps,
            spindle: spindle.map_or(f64::INFINITY, |step| step.height_mm),
            corner: problem.outline.above_tip(),
            floor: 2.0 * problem.outline.radius(),
            size: size + problem.reach,
        }
    }

    /// Stick-out from which on the spindle is clear.
    pub fn clear_of_spindle(&self, stand: &Stand, top: f64) -> f64 {
        let least = self.problem.tolerances.least;
        top - stand.reference.dot(stand.axes[2]) + self.corner - self.spindle - least
    }

    /// Whether the holder at this stick-out meets the part.
    pub fn collides_at(
        &self,
        stand: &Stand,
        top: f64,
        stick_out: f64,
        scratch: &mut Scratch,
    ) -> bool {
        self.clear_of_spindle(stand, top) >= stick_out
            || self.clear_stick_out(stand, [stick_out, stick_out], scratch) > stick_out
    }

    /// The least stick-out in a pose, along whose direction the triangles are as high as `top`; anything at or above
    /// `enough` if it is not below that.
    pub fn stick_out(&self, stand: &Stand, top: f64, enough: f64, scratch: &mut Scratch) -> f64 {
        let low = self.clear_of_spindle(stand, top).max(self.floor);
        if low >= enough { low } else { self.clear_stick_out(stand, [low, enough], scratch) }
    }

    /// The stick-out from which on no triangle meets the steps, at least `low`; some value above `enough` if it is
    /// above.
    pub fn clear_stick_out(
        &self,
        stand: &Stand,
        [low, enough]: [f64; 2],
        scratch: &mut Scratch,
    ) -> f64 {
        let (bvh, tolerances) = self.problem.triangles();
        let shrunk = |[height, radius]: &[f64; 2], tolerance: f64| {
            [height + tolerance - self.corner, (radius - tolerance).max(0.0)]
        };
        let steps: Vec<[f64; 2]> =
            self.steps.iter().map(|step| shrunk(step, tolerances.least)).collect();
        let value = |place: u32, least: f64| {
            let tolerance = tolerances.at(place);
            let corners = stand.triangle(bvh.triangle(place));
            let top = corners[0].z.max(corners[1].z).max(corners[2].z);
            let squared = from_box(&corners);
            // The wide steps reach more, the low ones reach higher.
            let value = |best: f64, step: &[f64; 2]| {
                let [height, radius] = shrunk(step, tolerance);
                let may_raise = top - height > best && squared <= radius * radius;
                if may_raise { best.max(drop::disc(&corners, radius) - height) } else { best }
            };
            self.steps.iter().fold(least, value)
        };
        scratch.max_raise(bvh, stand, (&steps, self.size), [low, enough], value)
    }
}

/// The tool in a pose.
pub(super) fn stand(problem: &Problem, pose: &WitnessPose) -> Stand {
    Stand { reference: pose.reference(&problem.outline), axes: axes(pose.direction) }
}

/// Height of the triangles along each of these directions, which may repeat; a height below all if there are none.
pub(super) fn tops_along(bvh: &Bvh, directions: &[Vec3]) -> Vec<f64> {
    let key = |d: &Vec3| d.to_array().map(f32::to_bits);
    let mut distinct = directions.to_vec();
    distinct.sort_unstable_by_key(key);
    distinct.dedup_by_key(|d| key(d));
    let tops = par::map(distinct.len(), |k| top_along(bvh, distinct[k]));
    let of = |d: &Vec3| distinct.binary_search_by_key(&key(d), key).map(|k| tops[k]);
    directions.iter().map(|d| of(d).expect("all directions are among the distinct ones")).collect()
}

fn top_along(bvh: &Bvh, direction: Vec3) -> f64 {
    let stand = Stand { reference: bvh.origin(), axes: axes(direction) };
    let highest = |place: u32, _: f64| {
        stand
            .triangle(bvh.triangle(place))
            .map(|p| p.z)
            .into_iter()
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let all = [-2.0 * bvh.radius() - 1.0, f64::INFINITY];
    let everywhere = [[0.0, f64::INFINITY]];
    let above =
        Scratch::default().max_raise(bvh, &stand, (&everywhere, bvh.radius()), all, highest);
    above + bvh.origin().dot(stand.axes[2])
}
