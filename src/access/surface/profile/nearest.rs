//! The pose of a direction that is nearest to being free, and how far a free one may be lowered.
//!
//! ```text
//! for every place of the profile with the site's normal:
//!     nothing penetrated: free; with a way out: done
//!     else its greatest depth; the few that penetrate least are kept
//! if none is free: each of these, pushed along the profile, clear of what it penetrates, again and again
//!     the least of all greatest depths
//! ```
//!
//! It is an upper bound: of the poses tried and where they are pushed to.

use super::contact::{BEYOND_MM, LEAST_COSINE, PUSHES, Pose};
use super::depth::Ladder;
use super::drilling::DrillPose;
use super::frame::Frame;
use super::label::{Form, MOST_RETREATS, ProfileTool, SiteResult, State};
use super::meet::penetrates;
use super::push::Pushes;
use crate::access::surface::tool::{Contact, Stand};
use crate::tool::cutter::ToolPart;
use glam::{DVec2, DVec3};

/// What is known of a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::access::surface) struct NearestInDirection {
    /// Where the tip is; none if no place of the profile touches.
    pub tip: Option<DVec3>,
    pub state: PoseState,
}

/// What is known of a pose, from the best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::access::surface) enum PoseState {
    /// Free, with a way out.
    Accessible,
    /// Free, and no way out was found.
    NoRetreat,
    /// Of a drill: at no bore of its own diameter.
    NotAtOwnBore,
    Penetrates(Penetration),
    /// What cuts nowhere has the site's normal.
    DoesNotTouch,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::access::surface) struct Penetration {
    /// The greatest depth beyond the tolerance, mm.
    pub depth: f64,
    /// The lowest part that does not cut and penetrates, else what cuts; and the greatest depth in it.
    pub part: ToolPart,
    pub in_part: f64,
    /// Number of the triangle, and a point of it.
    pub face: u32,
    pub at: DVec3,
}

/// Poses of one direction that are pushed.
const PUSHED: usize = 4;
/// To this the way down is halved, mm.
const EXACT_MM: f64 = 1e-4;

/// The search in one direction.
struct Search<'a> {
    tool: &'a ProfileTool<'a>,
    ladder: &'a Ladder<'a>,
    frame: &'a Frame,
    site: DVec3,
    /// In the frame of the tool.
    normal: DVec3,
    state: State,
    /// The best free pose.
    free: Option<(PoseState, DVec3)>,
    /// The poses that penetrate least, in that order, with their depths.
    kept: Vec<(f64, Pose)>,
}

impl ProfileTool<'_> {
    /// The pose of a direction that is nearest to being free.
    pub fn nearest(&self, contact: &Contact, frame: &Frame, ladder: &Ladder) -> NearestInDirection {
        let none = NearestInDirection { tip: None, state: PoseState::DoesNotTouch };
        let Some(normal) = contact.normal else { return none };
        // One retreat of each direction is tried: those that labels try may all be of one.
        let mut state = State::default();
        state.n_retreats = MOST_RETREATS - 1;
        let (site, normal) = (contact.point, frame.local(normal));
        let (free, kept) = (None, Vec::new());
        let tool = self;
        let mut search = Search { tool, ladder, frame, site, normal, state, free, kept };
        let best = match &self.drill {
            Some(_) => match self.drill_pose(contact, frame) {
                DrillPose::OnAxis(tip) => search.try_only(tip),
                DrillPose::NotAtOwnBore => {
                    return NearestInDirection { tip: None, state: PoseState::NotAtOwnBore };
                }
                DrillPose::DoesNotTouch => return none,
            },
            None => {
                self.contacts.for_each(normal, |pose| search.try_pose(pose));
                if search.free.is_none() { search.push_all() } else { None }
            }
        };
        if let Some((state, tip)) = search.free {
            return NearestInDirection { tip: Some(tip), state };
        }
        let Some(tip) = best else { return none };
        let Some((part, deepest, depth)) = ladder.exactly(self, frame, tip) else { return none };
        let stand = Stand { reference: tip, axes: frame.axes };
        let face = self.bvh().face(deepest.place);
        let at = stand.back(deepest.point);
        let found = Penetration { depth, part, in_part: deepest.mm, face, at };
        NearestInDirection { tip: Some(tip), state: PoseState::Penetrates(found) }
    }

    /// How far a free tool may be lowered along its axis until it penetrates, mm; infinite if it meets nothing.
    pub fn lowering(&self, frame: &Frame, tip: DVec3) -> f64 {
        let [widest, height] = self.shrunk_least().whole.size();
        let (mut low, mut high) = (0.0, self.farthest + widest + height);
        if !self.is_lowering_blocked(frame, tip, high) {
            return f64::INFINITY;
        }
        while high - low > EXACT_MM {
            let middle = 0.5 * (low + high);
            match self.is_lowering_blocked(frame, tip, middle) {
                true => high = middle,
                false => low = middle,
            }
        }
        low
    }

    /// Whether the tool penetrates a triangle on its way down: a triangle's way up through the tool is a prism.
    fn is_lowering_blocked(&self, frame: &Frame, tip: DVec3, by: f64) -> bool {
        /// Parts of what is not a cylinder.
        const SLICES: usize = 4;
        let stand = Stand { reference: tip, axes: frame.axes };
        let body = &self.shrunk_least().whole;
        let [widest, height] = body.size();
        let size = self.farthest + widest + height + by;
        let band = |[low, high, radius]: [f64; 3]| self.bvh().band([low - by, high], radius, size);
        let mut bands: Vec<_> = body.slices(SLICES).into_iter().map(band).collect();
        self.bvh().visit(&stand, &mut bands, &mut Vec::new(), |place, _| {
            let corners = stand.triangle(self.bvh().triangle(place));
            let whole = &self.shrunk(place).whole;
            let [a, b, c] = corners;
            let [d, e, f] = corners.map(|p| p + DVec3::Z * by);
            let faces = [
                [a, b, c],
                [d, e, f],
                [a, b, e],
                [a, e, d],
                [b, c, f],
                [b, f, e],
                [c, a, d],
                [c, d, f],
            ];
            faces.iter().any(|face| penetrates(whole, face, DVec2::ZERO).is_some())
        })
    }
}

impl Search<'_> {
    /// Notes the only pose; its tip if it is not free.
    fn try_only(&mut self, tip: DVec3) -> Option<DVec3> {
        match self.tool.first_hit(self.frame, tip, Form::Whole, &mut self.state.last) {
            Some(_) => Some(tip),
            None => {
                self.note_free(tip);
                None
            }
        }
    }

    /// Notes a pose; whether it is free and has a way out.
    fn try_pose(&mut self, pose: Pose) -> bool {
        let tip = self.tool.tip(self.frame, self.site, &pose);
        let met = self.tool.first_hit(self.frame, tip, Form::Whole, &mut self.state.last);
        if met.is_none() {
            return self.note_free(tip);
        }
        if let Some(depth) = self.depth(tip, self.most()) {
            let at = self.kept.partition_point(|(other, _)| *other <= depth);
            self.kept.insert(at, (depth, pose));
            self.kept.truncate(PUSHED);
        }
        false
    }

    /// Deeper poses are not kept.
    fn most(&self) -> f64 {
        match self.kept.len() < PUSHED {
            true => f64::INFINITY,
            false => self.kept[PUSHED - 1].0,
        }
    }

    fn depth(&self, tip: DVec3, most: f64) -> Option<f64> {
        self.ladder.depth_within(self.tool, self.frame, tip, most)
    }

    fn note_free(&mut self, tip: DVec3) -> bool {
        let mut found = SiteResult::default();
        let retracts = self.tool.retracts(self.frame, tip, &mut self.state, &mut found);
        if retracts {
            self.free = Some((PoseState::Accessible, tip));
        } else if self.free.is_none() {
            self.free = Some((PoseState::NoRetreat, tip));
        }
        retracts
    }

    /// The tip of the pose that penetrates least; none if there is a free one.
    fn push_all(&mut self) -> Option<DVec3> {
        let mut best: Option<(f64, DVec3)> = None;
        for (depth, pose) in std::mem::take(&mut self.kept) {
            let tip = self.tool.tip(self.frame, self.site, &pose);
            if best.is_none_or(|(least, _)| depth < least) {
                best = Some((depth, tip));
            }
            self.push(pose, &mut best);
            if self.free.is_some() {
                return None;
            }
        }
        best.map(|(_, tip)| tip)
    }

    /// As labels do, but from any depth.
    fn push(&mut self, mut pose: Pose, best: &mut Option<(f64, DVec3)>) {
        let (tool, frame) = (self.tool, self.frame);
        let mut pushes = Pushes::default();
        for k in 0..PUSHES {
            let tip = tool.tip(frame, self.site, &pose);
            let touches = tool.contacts.normal(&pose).dot(-self.normal) >= LEAST_COSINE;
            let Some((place, point, depth)) =
                tool.deepest(frame, tip, self.state.last, |_, _| false)
            else {
                let last = &mut self.state.last;
                if touches && tool.first_hit(frame, tip, Form::Whole, last).is_none() {
                    self.note_free(tip);
                }
                return;
            };
            self.state.last = Some(place);
            let most = best.map_or(f64::INFINITY, |(least, _)| least);
            if k > 0
                && touches
                && let Some(depth) = self.depth(tip, most)
                && depth < most
            {
                *best = Some((depth, tip));
            }
            let by = (depth.mm - tool.shrunk(place).tolerance).max(0.0) + BEYOND_MM;
            let Some(by) = pushes.next(place, by) else { return };
            let Some(next) = tool.pushed_clear(&pose, (place, point), (by, depth.toward)) else {
                return;
            };
            pose = next;
        }
    }
}
