//! Free poses with a sideways retreat.

use super::frame::Frame;
use super::label::ProfileTool;
use crate::access::surface::tool::{Contact, Stand};
use crate::exec::par;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Sites per task.
const BLOCK: usize = 32;
/// Moves of a pose across the axis, even around it, and to which share of their length all moves are found.
const MOVES: usize = 8;
const EXACT: f64 = 0.02;

/// A free pose with a sideways retreat.
#[derive(Debug, Clone)]
pub(in crate::access::surface) struct AsidePose {
    pub frame: Frame,
    pub tip: DVec3,
    /// The move across the axis, after which the tool is drawn back along it.
    by: DVec2,
}

impl ProfileTool<'_> {
    /// The poses that reach sites and have no straight retreat; and each of them moved until something is in the way,
    /// or by `farthest` mm.
    pub fn aside_poses(
        &self,
        sites: &[Contact],
        frames: &[Frame],
        farthest: f64,
    ) -> Vec<AsidePose> {
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

    /// The pose moved as far as that is free, across the axis in several directions, and along it up and down.
    fn moved_to_ends(&self, pose: &AsidePose, farthest: f64) -> impl Iterator<Item = AsidePose> {
        let AsidePose { frame, tip, by } = *pose;
        let across = (0..MOVES).map(|k| {
            let angle = TAU * (k as f64 / MOVES as f64);
            DVec3::new(libm::cos(angle), libm::sin(angle), 0.0)
        });
        across.chain([DVec3::Z, DVec3::NEG_Z]).filter_map(move |along| {
            let moved = |length: f64| tip + frame.global(along * length);
            let is_blocked = |length: f64| match along.z == 0.0 {
                true => self.is_way_blocked(&frame, tip, along.truncate() * length),
                false => !self.is_free(&frame, moved(length)),
            };
            let [mut free, mut blocked] = [0.0, farthest];
            if !is_blocked(farthest) {
                free = farthest;
            }
            while free < farthest && blocked - free > EXACT * farthest {
                let middle = 0.5 * (free + blocked);
                if is_blocked(middle) { blocked = middle } else { free = middle }
            }
            let (tip, by) = (moved(free), by - along.truncate() * free);
            let moved = AsidePose { frame, tip, by };
            (free > 0.0 && self.is_way_out(&frame, tip, by)).then_some(moved)
        })
    }

    /// Whether what does not cut meets a point, in a pose or during its retreat.
    pub fn meets_on_retreat(&self, pose: &AsidePose, point: DVec3) -> bool {
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
