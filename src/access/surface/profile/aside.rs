//! Free poses out of which a tool moves across its axis first, and what they remove.

use super::frame::Frame;
use super::label::ProfileTool;
use crate::access::surface::tool::{Contact, Stand};
use crate::par;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Sites per task.
const BLOCK: usize = 32;
/// Moves of a pose, even around the axis, and to which share of their length they are found.
const MOVES: usize = 8;
const EXACT: f64 = 0.02;

/// A free pose with a way out aside.
#[derive(Debug, Clone)]
pub(in crate::access::surface) struct AsidePose {
    frame: Frame,
    tip: DVec3,
    /// Across the axis, after which it is drawn back along it.
    by: DVec2,
}

impl ProfileTool<'_> {
    /// Greatest radius of what cuts, mm.
    pub fn cutting_radius(&self) -> f64 {
        self.radius
    }

    /// Of the poses that reach sites, those that have no straight retreat; and where these come to when they are moved
    /// across the axis until something is in the way, or by `farthest` mm.
    pub fn aside_poses(
        &self,
        sites: &[Contact],
        frames: &[Frame],
        farthest: f64,
    ) -> Vec<AsidePose> {
        if !self.may_leave_aside() {
            return Vec::new();
        }
        let found = par::map_blocks(sites.len(), BLOCK, |range| {
            let mut poses = Vec::new();
            for i in range {
                let Some(pose) = self.site(&sites[i], frames).witness else { continue };
                let (frame, tip) = (Frame::along(pose.direction), pose.tip_mm);
                if self.retracts_along_axis(&frame, tip, &mut None) {
                    continue;
                }
                if let Some(by) = self.way_aside(&frame, tip, &mut None) {
                    let pose = AsidePose { frame, tip, by };
                    poses.extend(self.moved_to_ends(&pose, farthest));
                    poses.push(pose);
                }
            }
            poses
        });
        found.into_iter().flatten().collect()
    }

    fn moved_to_ends(&self, pose: &AsidePose, farthest: f64) -> impl Iterator<Item = AsidePose> {
        let AsidePose { frame, tip, by } = *pose;
        (0..MOVES).filter_map(move |k| {
            let angle = TAU * (k as f64 / MOVES as f64);
            let along = DVec2::new(libm::cos(angle), libm::sin(angle));
            let [mut free, mut blocked] = [0.0, farthest];
            if !self.is_way_blocked(&frame, tip, along * farthest) {
                free = farthest;
            }
            while free < farthest && blocked - free > EXACT * farthest {
                let middle = 0.5 * (free + blocked);
                match self.is_way_blocked(&frame, tip, along * middle) {
                    true => blocked = middle,
                    false => free = middle,
                }
            }
            let (tip, by) = (frame.moved(tip, along * free), by - along * free);
            let moved = AsidePose { frame, tip, by };
            (free > 0.0 && self.is_way_out(&frame, tip, by)).then_some(moved)
        })
    }

    /// How deep a point is in what cuts, mm, up to the height at which that ends, negative outside; at least `least`.
    pub fn cut_depth(&self, pose: &AsidePose, point: DVec3, least: f64) -> f64 {
        let local = Stand { reference: pose.tip, axes: pose.frame.axes }.local(point);
        // Within the cylinder about what cuts.
        let most = local.z.min(self.flutes - local.z);
        let beside = self.radius - least;
        if most <= least || local.truncate().length_squared() >= beside * beside.abs() {
            return least;
        }
        self.outline.depth(local).mm.min(most).max(least)
    }

    /// Middle and radius of a ball about what cuts.
    pub fn ball_of_cuts(&self, pose: &AsidePose) -> (DVec3, f64) {
        let middle = pose.tip + pose.frame.axes[2] * (0.5 * self.flutes);
        (middle, self.radius.hypot(0.5 * self.flutes))
    }

    /// Whether what does not cut meets a point, in a pose or on the way out of it.
    pub fn meets_on_way(&self, pose: &AsidePose, point: DVec3) -> bool {
        let local = Stand { reference: pose.tip, axes: pose.frame.axes }.local(point);
        let (flat, body) = (local.truncate(), &self.shrunk_least().non_cutting);
        if body.elements.first().is_none_or(|lowest| local.z < lowest.low) {
            return false;
        }
        let share = flat.dot(pose.by) / pose.by.length_squared().max(f64::MIN_POSITIVE);
        let aside = flat.distance(pose.by * share.clamp(0.0, 1.0));
        aside < body.radius_at(local.z) || flat.distance(pose.by) < body.radius_below(local.z)
    }
}
