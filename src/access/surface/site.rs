//! One tool at one point of contact along one direction: the verdict over all its poses.
//!
//! ```text
//! the pose that touches with the site's normal: free → reached
//! search over the poses
//! ```
//!
//! A ball end's ball is the same from all directions: where it fits, only what is above it is tested; where it does not
//! touch with the site's normal without cutting, it is first moved to where it does.

use super::pose::blockers::{Blockers, Met, Shape};
use super::pose::search::{Around, PoseSearch, Searched, Tested};
use super::problem::{Probes, Problem};
use super::query::Scratch;
use super::tool::{Axes, Stand};
use super::verdict::Verdict;
use crate::tool::directions::basis;
use glam::DVec3;

/// Cells of poses are not cut finer than to this share of the finish tolerance.
const FINE: f64 = 0.2;
/// Most poses that are tested to find where a ball fits.
const BALL_TESTS: usize = 1000;
/// Most poses that are tested for one direction of several.
const DIRECTION_TESTS: usize = 40;
/// Tools that are tested as a whole before the ball is tested on its own.
const TESTED_WHOLE: u64 = 2;

/// What is known of the ball at a site.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) enum Ball {
    #[default]
    Unknown,
    /// With its center here it is clear of the surface.
    Fits(DVec3),
    /// Wherever it touches, it gouges.
    Gouges,
    /// No place was found where it fits, nor that there is none.
    Undecided,
}

/// What is known of a site, and work space.
#[derive(Debug, Default)]
pub(super) struct SiteState {
    pub scratch: Scratch,
    pub ball: Ball,
    blockers: Blockers,
    /// Whether the blockers are of this site.
    has_blockers: bool,
    poses: PoseSearch,
}

impl SiteState {
    /// For another site: only memory is kept, lest answers depend on the order of sites.
    pub fn begin(&mut self) {
        self.scratch = Scratch::renewed(std::mem::take(&mut self.scratch));
        self.ball = Ball::Unknown;
        self.has_blockers = false;
    }
}

impl Problem<'_> {
    /// The verdict for a query along a direction, and the reference point of a free pose.
    pub fn verdict(
        &self,
        i: usize,
        axes: &Axes,
        is_blocked: bool,
        state: &mut SiteState,
    ) -> (Verdict, Option<DVec3>) {
        let (verdict, pose) = self.own_pose(i, axes, is_blocked, state);
        if pose.is_some() {
            return (verdict, pose);
        }
        if state.ball == Ball::Unknown {
            self.place_ball(i, state);
            if let Some(pose) = self.pose_of_moved_ball(i, axes, state) {
                return (Verdict::Free, Some(pose));
            }
        }
        match self.search_poses(i, axes, DIRECTION_TESTS, state) {
            Some(pose) => (Verdict::Free, Some(pose)),
            None => (verdict, None),
        }
    }

    /// The verdict for the pose that touches with the site's normal, and its reference point if it is free;
    /// `is_blocked` if a point of the surface is known to be in the steps of that pose in oblique directions.
    pub fn own_pose(
        &self,
        i: usize,
        axes: &Axes,
        is_blocked: bool,
        state: &mut SiteState,
    ) -> (Verdict, Option<DVec3>) {
        if is_blocked && self.contacts[i].is_by_points(&self.outline, axes[2]) {
            return (Verdict::Collides, None);
        }
        let triangles = self.triangles();
        if state.scratch.n_queries >= TESTED_WHOLE {
            self.place_ball(i, state);
        }
        let own = self.contacts[i].reference_point(&self.outline, axes[2]);
        let (probe, reference) = match state.ball {
            Ball::Unknown | Ball::Undecided => (&self.probes.whole, own),
            Ball::Fits(center) => (&self.probes.above_ball, center),
            Ball::Gouges => (&self.probes.steps, own),
        };
        let stand = Stand { reference, axes: *axes };
        let verdict = probe.verdict(triangles, &stand, &mut state.scratch);
        match verdict {
            _ if state.ball == Ball::Gouges => (verdict.max(Verdict::TipGouges), None),
            Verdict::Free => (verdict, Some(reference)),
            _ if self.contacts[i].is_oblique(&self.outline, axes[2]) => (verdict, None),
            _ => match self.rim_pose(i, axes, state) {
                Some(reference) => (Verdict::Free, Some(reference)),
                None => (verdict, None),
            },
        }
    }

    /// The reference point with the rim of a flat end at a site, if that is free.
    fn rim_pose(&self, i: usize, axes: &Axes, state: &mut SiteState) -> Option<DVec3> {
        let reference = self.contacts[i].on_rim(&self.outline, axes[2]);
        let stand = Stand { reference, axes: *axes };
        let verdict = self.probes.whole.verdict(self.triangles(), &stand, &mut state.scratch);
        (verdict == Verdict::Free).then_some(reference)
    }

    /// Finds where the ball of a ball end fits at a site, if that is not known.
    pub fn place_ball(&self, i: usize, state: &mut SiteState) {
        let Some(normal) = self.contacts[i].normal.filter(|_| self.outline.side() == 0.0) else {
            return;
        };
        if state.ball != Ball::Unknown {
            return;
        }
        let (ball, triangles) = (&self.probes.ball, self.triangles());
        let center = self.contacts[i].corner_center(&self.outline, normal);
        let axes = basis(normal);
        if ball.ball_meets(triangles, &Stand { reference: center, axes }).is_free() {
            state.ball = Ball::Fits(center);
            return;
        }
        let found = self.search_of(i, &axes, (&self.shapes[1], BALL_TESTS), state);
        state.ball = match found {
            Searched::Free(center) => Ball::Fits(center),
            Searched::Closed => Ball::Gouges,
            Searched::GivenUp => Ball::Undecided,
        };
    }

    /// The reference point with the ball where it fits, if that is not its own place and the tool is free there.
    pub fn pose_of_moved_ball(
        &self,
        i: usize,
        axes: &Axes,
        state: &mut SiteState,
    ) -> Option<DVec3> {
        let contact = &self.contacts[i];
        let own = contact.normal.map(|normal| contact.corner_center(&self.outline, normal));
        match state.ball {
            Ball::Fits(center) if own != Some(center) => self.own_pose(i, axes, false, state).1,
            _ => None,
        }
    }

    /// Whether a direction comes from behind the surface about a query, which is then in the way of all poses.
    fn faces_away(&self, i: usize, direction: DVec3) -> bool {
        let normal = self.contacts[i].normal;
        normal.is_some_and(|normal| normal.dot(direction) < -self.bounds[i].behind)
    }

    /// Whether one triangle collides in all poses in an oblique direction.
    fn is_closed(&self, i: usize, axes: &Axes, state: &mut SiteState) -> bool {
        let spread = self.bounds[i].oblique + self.margin();
        if !(spread.is_finite() && self.contacts[i].is_oblique(&self.outline, axes[2])) {
            return false;
        }
        let reference = self.contacts[i].reference_point(&self.outline, axes[2]);
        let stand = Stand { reference, axes: *axes };
        self.probes.steps.collides_within(self.triangles(), &stand, spread, &mut state.scratch)
    }

    /// The reference point of a free pose, by search.
    pub fn search_poses(
        &self,
        i: usize,
        axes: &Axes,
        n_tests: usize,
        state: &mut SiteState,
    ) -> Option<DVec3> {
        if self.faces_away(i, axes[2])
            || state.ball == Ball::Gouges
            || self.is_closed(i, axes, state)
        {
            return None;
        }
        self.search_of(i, axes, (&self.shapes[0], n_tests), state).free()
    }

    fn search_of(
        &self,
        i: usize,
        axes: &Axes,
        (shape, n_tests): (&Shape, usize),
        state: &mut SiteState,
    ) -> Searched {
        let Problem { bvh, tolerances, .. } = self;
        let contact = &self.contacts[i];
        let SiteState { scratch, blockers, has_blockers, poses, .. } = state;
        if !*has_blockers {
            let own = contact
                .normal
                .map(|normal| self.rings.blockers(bvh, tolerances, contact.point, normal));
            blockers.begin(own.into_iter().flatten());
            *has_blockers = true;
        }
        let bounds = self.bounds[i];
        let within = match contact.is_oblique(&self.outline, axes[2]) {
            true => bounds.oblique,
            false => f64::INFINITY,
        };
        if let Some(place) = scratch.last {
            let reference = contact.reference_point(&self.outline, axes[2]);
            let stand = Stand { reference, axes: *axes };
            blockers.push(self.probes.whole.blocker((bvh, tolerances), place, &stand));
        }
        let around =
            Around::new(shape, self.poses, contact, axes[2], [bounds.slack, within, self.rim(i)]);
        let limits = (FINE * self.outline.finish(), n_tests);
        poses.run(&around, blockers, limits, InDirection { problem: self, shape, axes, scratch })
    }
}

/// The whole tool or its ball, along one direction.
struct InDirection<'a> {
    problem: &'a Problem<'a>,
    shape: &'a Shape,
    axes: &'a Axes,
    scratch: &'a mut Scratch,
}

impl Tested for InDirection<'_> {
    fn meets(&mut self, reference: DVec3) -> Met {
        let Probes { whole, ball, .. } = &self.problem.probes;
        let (triangles, stand) = (self.problem.triangles(), Stand { reference, axes: *self.axes });
        match self.shape.is_ball() {
            true => ball.ball_meets(triangles, &stand),
            false => whole.meets(triangles, &stand, self.scratch),
        }
    }

    fn collides_within(&mut self, reference: DVec3, spread: f64) -> bool {
        let Probes { steps, ball, .. } = &self.problem.probes;
        let (triangles, stand) = (self.problem.triangles(), Stand { reference, axes: *self.axes });
        let probe = if self.shape.is_ball() { ball } else { steps };
        probe.collides_within(triangles, &stand, spread + self.problem.margin(), self.scratch)
    }
}
