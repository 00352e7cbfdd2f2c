//! What a tool that is wider below than above removes under edges: in free poses with a sideways retreat.
//!
//! ```text
//! for sites spread over the part, so densely that the ridges between two poses are below the accuracy:
//!     the pose that reaches it, if its retreat is sideways; and this pose moved across and along the axis, as far as
//!         that is free
//! round 1:    a node is removed if it is in what cuts in one of these poses
//! then:       if also what does not cut is clear of what is left, in the pose and during its retreat
//! ```

use super::super::profile::{AsidePose, Frame, ProfileTool};
use super::super::samples;
use super::grid::Grid;
use crate::Result;
use crate::exec::par;
use crate::spatial::KdTree;
use glam::DVec3;

/// Between two poses a tool of radius R leaves a ridge of `spacing² / 8 R`: this share of the accuracy.
const RIDGE: f64 = 0.25;
/// Poses are moved by so many times the spacing at most.
const FARTHEST: f64 = 1.5;
/// Number of sites.
const SITES: [f64; 2] = [2000.0, 60_000.0];
/// Sites after which it may be stopped.
const CHECKED: usize = 1024;
/// Poses per task.
const TASK: usize = 64;

/// The poses of a tool along the directions of a setup.
pub struct Aside<'a> {
    tool: &'a ProfileTool<'a>,
    poses: Vec<AsidePose>,
}

impl<'a> Aside<'a> {
    /// `check` may stop it.
    pub fn new(
        tool: &'a ProfileTool<'a>,
        part: &[[DVec3; 3]],
        frames: &[Frame],
        accuracy_mm: f64,
        check: &mut dyn FnMut() -> Result<()>,
    ) -> Result<Self> {
        let mut poses = Vec::new();
        if !tool.may_leave_aside() {
            return Ok(Aside { tool, poses });
        }
        let area: f64 = part.iter().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum();
        let spacing_mm2 = 8.0 * tool.cutting_radius() * RIDGE * accuracy_mm;
        let n = (area / spacing_mm2).clamp(SITES[0], SITES[1]);
        let sites = samples::sites(part, n as usize);
        let spacing = (area / n).sqrt();
        for sites in sites.chunks(CHECKED) {
            check()?;
            poses.extend(tool.aside_poses(sites, frames, FARTHEST * spacing));
        }
        Ok(Aside { tool, poses })
    }

    /// Raises the nodes of a grid to their depths in what cuts, in the poses that are clear of what is left.
    pub fn raise(&self, grid: &mut Grid, rest: &[DVec3]) {
        let all = self.poses.iter().zip(self.are_clear(rest));
        let poses: Vec<_> = all.filter_map(|(pose, clear)| clear.then_some(pose)).collect();
        if poses.is_empty() {
            return;
        }
        let middles = poses.iter().map(|pose| self.tool.middle_of_cuts(&pose.frame, pose.tip));
        let tree = KdTree::build(&middles.collect::<Vec<_>>());
        let radius = self.tool.reach_of_cuts();
        grid.raise_about(|middle, within_mm| {
            let mut near = Vec::new();
            tree.within(middle, within_mm + radius, |k, d2| near.push((d2, k)));
            near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let near: Vec<&AsidePose> = near.iter().map(|&(_, k)| poses[k as usize]).collect();
            move |point: DVec3, [least, enough]: [f64; 2]| {
                let mut most = least.max(-2.0 * enough);
                for pose in &near {
                    most = self.tool.cut_depth(&pose.frame, pose.tip, point, most);
                    if most >= enough {
                        break;
                    }
                }
                most
            }
        });
    }

    /// Whether some pose is not clear of what is left.
    pub fn may_meet(&self, rest: &[DVec3]) -> bool {
        self.are_clear(rest).contains(&false)
    }

    fn are_clear(&self, rest: &[DVec3]) -> Vec<bool> {
        let found = par::map_blocks(self.poses.len(), TASK, |range| {
            // What meets one pose mostly meets the next.
            let mut last = 0;
            let is_clear = |pose: &AsidePose| {
                let met = |k: &usize| self.tool.meets_on_retreat(pose, rest[*k]);
                let found = (last..rest.len().min(last + 1)).chain(0..rest.len()).find(met);
                last = found.unwrap_or(last);
                found.is_none()
            };
            self.poses[range].iter().map(is_clear).collect::<Vec<_>>()
        });
        found.into_iter().flatten().collect()
    }
}
