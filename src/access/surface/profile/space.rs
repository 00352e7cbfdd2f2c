//! Labels of points of space: whether some pose removes what is there.
//!
//! In a pose that is free and has a retreat a tool **removes** the points in what cuts, grown by the finish tolerance.
//!
//! ```text
//! poses of sites spread over the part, as labels find them: free, with a retreat
//! for every point:
//!     in what cuts of one of them that are near: accessible
//!     for every direction: the pose with the tip at the point: free, with a retreat: accessible
//!     for every direction, poses that touch the point with some places of the profile, in some turns about the axis:
//!         free, with a retreat: accessible
//!     poses that penetrate least, pushed along the profile as at a site: free, with a retreat: accessible
//! ```
//!
//! Poses that touch the point are enough. During its retreat a tool that holds a point comes to a pose that touches it
//! with what cuts; that pose is free, and the rest of the retreat is its own.
//!
//! In a narrow place few poses are free. Those that reach its walls are among them; pushing poses about a point far
//! from the walls rarely leads there.

use super::contact::REACH;
use super::frame::Frame;
use super::label::{Form, ProfileTool, SiteResult, State};
use super::shallow::{Candidate, Shallow};
use crate::access::surface::samples;
use crate::access::surface::tool::Contact;
use crate::exec::par;
use crate::spatial::KdTree;
use glam::DVec3;

/// Sites of the part whose poses are tried.
const N_SITES: usize = 4000;
/// So many of these poses are tried at a point, those nearest to it.
const N_NEAR: usize = 64;
/// Points per task.
const BLOCK: usize = 32;
/// Distances beyond the finish tolerance that are rounding, mm.
const ROUNDING_MM: f64 = 1e-9;

/// A pose that is free.
struct Free {
    tip: DVec3,
    frame: Frame,
    has_retreat: bool,
}

/// Free poses at sites.
struct Known {
    poses: Vec<Free>,
    /// Of the middles of what cuts.
    tree: KdTree,
}

impl ProfileTool<'_> {
    /// Answers for points of the space around a part.
    pub(super) fn in_space(
        &self,
        points: &[Contact],
        part: &[[DVec3; 3]],
        frames: &[Frame],
    ) -> Vec<SiteResult> {
        let known = self.known(&samples::sites(part, N_SITES), frames);
        let found = par::map_blocks(points.len(), BLOCK, |range| {
            range.map(|i| self.at_point(&known, points[i].point, frames)).collect::<Vec<_>>()
        });
        found.into_iter().flatten().collect()
    }

    /// The poses that reach sites; where none does, the last that is free.
    fn known(&self, sites: &[Contact], frames: &[Frame]) -> Known {
        let found = par::map_blocks(sites.len(), BLOCK, |range| {
            let free = |i: usize| {
                let found = self.milled(&sites[i], frames);
                let frame = Frame::along(found.last_free_direction);
                let has_retreat = found.witness.is_some();
                found.is_free.then_some(Free { tip: found.last_free, frame, has_retreat })
            };
            range.filter_map(free).collect::<Vec<_>>()
        });
        let poses: Vec<Free> = found.into_iter().flatten().collect();
        let middles = poses.iter().map(|pose| self.middle_of_cuts(&pose.frame, pose.tip));
        let tree = KdTree::build(&middles.collect::<Vec<_>>());
        Known { poses, tree }
    }

    fn at_point(&self, known: &Known, point: DVec3, frames: &[Frame]) -> SiteResult {
        let Known { poses, tree } = known;
        let grown_by = self.finish() + ROUNDING_MM;
        let farthest = self.reach_of_cuts() + grown_by;
        let mut is_free = false;
        for (_, k) in tree.k_nearest_within(point, N_NEAR, farthest, |_| true) {
            let Free { tip, frame, has_retreat } = &poses[k as usize];
            if self.cut_depth(frame, *tip, point, -2.0 * grown_by) < -grown_by {
                continue;
            }
            if *has_retreat {
                let found = SiteResult { is_free: true, last_free: *tip, ..Default::default() };
                return found.with_witness(frame.direction, &State::default());
            }
            is_free = true;
        }
        let found = self.searched(point, frames);
        SiteResult { is_free: found.is_free || is_free, ..found }
    }

    /// The answer for a point by a search over poses that touch it. Where none is free, *tip does not fit* is about the
    /// poses with the tip at the point.
    pub(super) fn searched(&self, point: DVec3, frames: &[Frame]) -> SiteResult {
        let (mut state, mut found) = (State::default(), SiteResult::default());
        for frame in frames {
            state.n_tested += 1;
            match self.first_hit(frame, point, Form::Whole, &mut state.last) {
                None if self.retracts(frame, point, &mut state, &mut found) => {
                    return found.with_witness(frame.direction, &state);
                }
                Some((_, hit)) if hit.cuts && !found.only_tip => {
                    found.only_tip = self.only_cutting_penetrates(frame, point, &mut state);
                }
                _ => {}
            }
        }
        let (mut shallow, mut suggested) = (Shallow::along(frames.len()), Shallow::suggested());
        for (k, frame) in frames.iter().enumerate() {
            let is_removed = self.contacts.for_each_around(|pose| {
                let tip = self.tip(frame, point, &pose);
                state.n_tested += 1;
                let Some((place, hit)) = self.first_hit(frame, tip, Form::Whole, &mut state.last)
                else {
                    return self.retracts(frame, tip, &mut state, &mut found);
                };
                let tolerance = self.shrunk(place).tolerance;
                let depth = self.outline.depth(hit.point).mm - tolerance;
                if depth <= REACH * self.contacts.freedom(&pose, tolerance + self.finish()) {
                    let among = if frame.is_suggested { &mut suggested } else { &mut shallow };
                    among.add(Candidate { depth, k, pose });
                }
                false
            });
            if is_removed {
                return found.with_witness(frame.direction, &state);
            }
        }
        self.push_shallow([suggested, shallow], frames, (point, None), state, found)
    }
}
