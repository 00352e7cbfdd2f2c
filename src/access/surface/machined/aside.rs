//! What a tool that is wider below than above removes under edges, in poses out of which it moves aside.
//!
//! ```text
//! sites spread over the part, so near to one another that what poses leave between two is below the accuracy
//! poses that reach them and have no straight retreat, and where these may move across their axes: what is in what cuts is
//!     removed
//! with something left: of these poses those in which, and on the way out of which, what does not cut is clear of it
//! ```

use super::super::profile::{AsidePose, Frame, ProfileTool};
use super::super::samples;
use super::grid::Grid;
use crate::spatial::KdTree;
use crate::{Result, par};
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

    /// Raises the nodes of a grid to how far they are in what cuts, in the poses that are clear of what is left.
    pub fn raise(&self, grid: &mut Grid, rest: &[DVec3]) {
        let clear = self.clear(rest);
        let poses: Vec<&AsidePose> = self
            .poses
            .iter()
            .zip(clear)
            .filter(|(_, is_clear)| *is_clear)
            .map(|(p, _)| p)
            .collect();
        if poses.is_empty() {
            return;
        }
        let balls: Vec<(DVec3, f64)> = poses.iter().map(|p| self.tool.ball_of_cuts(p)).collect();
        let tree = KdTree::build(&balls.iter().map(|(middle, _)| *middle).collect::<Vec<_>>());
        // Of one tool all are of one size.
        let radius = balls[0].1;
        grid.raise_about(|middle, within_mm| {
            let mut near = Vec::new();
            tree.within(middle, within_mm + radius, |k, d2| near.push((d2, k)));
            near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let near: Vec<&AsidePose> = near.iter().map(|&(_, k)| poses[k as usize]).collect();
            move |point: DVec3, [least, enough]: [f64; 2]| {
                let mut most = least.max(-2.0 * enough);
                for pose in &near {
                    most = self.tool.cut_depth(pose, point, most);
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
        self.clear(rest).contains(&false)
    }

    fn clear(&self, rest: &[DVec3]) -> Vec<bool> {
        let found = par::map_blocks(self.poses.len(), TASK, |range| {
            // What meets one pose mostly meets the next.
            let mut last = 0;
            let is_clear = |pose: &AsidePose| {
                let met = |k: &usize| self.tool.meets_on_way(pose, rest[*k]);
                let found = (last..rest.len().min(last + 1)).chain(0..rest.len()).find(met);
                last = found.unwrap_or(last);
                found.is_none()
            };
            self.poses[range].iter().map(is_clear).collect::<Vec<_>>()
        });
        found.into_iter().flatten().collect()
    }
}
