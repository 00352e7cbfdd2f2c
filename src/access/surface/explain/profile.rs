//! Why a tool given by its profile reaches a site or does not.
//!
//! ```text
//! label the site; accessible: the witness, and how far it may be lowered
//! for every direction that labels try: the pose nearest to being free                       (profile/nearest.rs)
//!     blocked by the lowest part that does not cut and penetrates, else by what cuts
//! for every kind of change: the least multiple of 0.01 mm with which the site, labeled, is accessible   (halving)
//! ```

use super::{Blocked, DirectionState, Explanation, NearestPose, Outcome, Query, Witness};
use crate::access::Queries;
use crate::access::evidence::WitnessPose;
use crate::access::surface::cells::Domain;
use crate::access::surface::labels::SurfaceOptions;
use crate::access::surface::obstacles::{TriangleObstacles, tested};
use crate::access::surface::profile::{
    Frame, Ladder, PartHeights, Penetration, PoseState, ProfileTool, SiteResult,
};
use crate::access::surface::tool::Contact;
use crate::answers::SiteAnswer;
use crate::exec::par;
use crate::geom::Sites;
use crate::tool::cutter::{Assembly, Cutter, Profile};
use crate::tool::directions::{DirectionSet, Directions};
use crate::{Error, Result};
use glam::{DVec3, Vec3};

/// A site, and a tool given by its profile.
pub(super) struct ProfileCase<'a> {
    pub triangles: &'a TriangleObstacles,
    pub query: &'a Query<'a>,
    /// All that are tried.
    frames: Vec<Frame>,
}

/// Directions of the whole sphere that are tried beyond those of the query.
const N_SPHERE: usize = 300;
/// Clearance of a direction in which the tool does not touch.
const NONE_MM: f64 = -super::MOST_CLEARANCE_MM;

impl<'a> ProfileCase<'a> {
    pub fn new(triangles: &'a TriangleObstacles, query: &'a Query<'a>) -> Result<Self> {
        let domain = Domain::of(query.directions).filter(|_| query.options.refinement.is_some());
        let directions = tested(query.directions)?;
        let frames = Frame::tested((&directions, domain), &triangles.bvh);
        Ok(ProfileCase { triangles, query, frames })
    }

    pub fn explain(&self) -> Result<Explanation> {
        let _floats = par::DefaultFloats::set();
        let tool = self.query.tool;
        let (mut answer, mut pose, tolerance_mm) = self.label(tool, self.query.directions)?;
        // What the file's direction reaches is accessible, whatever this search finds.
        if let Some(direction) = self.query.witness.filter(|_| pose.is_none()) {
            pose = self.label(tool, &list(direction)?)?.1;
            answer = if pose.is_some() { SiteAnswer::Accessible } else { answer };
        }
        let found = self.with_tool(tool, |cutter, tool| {
            let site = tool.site(cutter.contact, &self.frames);
            let margin =
                |pose: &WitnessPose| tool.lowering(&Frame::along(pose.direction), pose.tip_mm);
            let [holder, spindle] = self.query.tool.upper_heights_mm(self.query.clearance_mm)?;
            let ladder = Ladder::new(tool, cutter.profile, PartHeights { holder, spindle });
            let near = |k: usize| tool.nearest(cutter.contact, &self.frames[k], &ladder);
            let nearest = par::map(self.frames.len(), near);
            Ok((site, pose.as_ref().map(margin), nearest))
        })?;
        let (site, margin, nearest) = found;
        let mut tips: Vec<_> = nearest.iter().map(|nearest| nearest.tip).collect();
        let states = self.frames.iter().zip(&nearest);
        let mut directions: Vec<DirectionState> =
            states.map(|(frame, nearest)| state(frame.direction, nearest.state)).collect();
        // What labels found, the longer search, is known as well.
        let mut known = |direction: Vec3, tip, outcome: Outcome| {
            let at = directions.iter().position(|state| state.direction == direction);
            if let Some(k) = at.filter(|k| directions[*k].outcome > outcome) {
                tips[k] = Some(tip);
                directions[k] =
                    DirectionState { direction, blocked: None, clearance_mm: 0.0, outcome };
            }
        };
        match &pose {
            Some(pose) => known(pose.direction, pose.tip_mm, Outcome::Free),
            None if site.is_free => {
                known(site.last_free_direction, site.last_free, Outcome::NoRetreat);
            }
            None => {}
        }
        let witness = pose.zip(margin).map(|(pose, margin_mm)| Witness {
            direction: pose.direction,
            tip_mm: Some(pose.tip_mm),
            margin_mm,
        });
        let mut why = Explanation {
            answer,
            tolerance_mm,
            witness,
            directions,
            nearest_pose: None,
            changes: Vec::new(),
            stopped: None,
            other_direction: None,
            of_profile: true,
        };
        if answer != SiteAnswer::Accessible {
            (why.changes, why.stopped) = self.changes()?;
            let sphere = Directions::new(DirectionSet::FibonacciSphere { n_dirs: N_SPHERE })?;
            let around = self.label(tool, &sphere)?.1;
            why.other_direction = around.map(|pose| pose.direction);
            why.nearest_pose = why.nearest().and_then(|nearest| {
                let same = |state: &DirectionState| state.direction == nearest.direction;
                let k = why.directions.iter().position(same)?;
                let pose = WitnessPose { direction: nearest.direction, tip_mm: tips[k]? };
                Some(NearestPose { pose, shrink_mm: -nearest.clearance_mm })
            });
        }
        Ok(why)
    }

    /// Answer, free pose and tolerance at the site, as all labels.
    pub fn label(
        &self,
        tool: &Assembly,
        directions: &Directions,
    ) -> Result<(SiteAnswer, Option<WitnessPose>, f64)> {
        let options = SurfaceOptions {
            occlusion: false,
            clearance_limit_mm: None,
            ..self.query.options.for_few(1)
        };
        let (sites, cutter) = (self.site(), self.cutter(tool)?);
        let labels = self.triangles.surface_labels(&sites, &cutter, directions, &options)?;
        Ok((labels.answers[0], labels.evidence.witness[0], labels.evidence.tolerance_mm[0]))
    }

    /// A direction in which a tool reaches the site, of all that are tried; none for a tool that is thinner than its
    /// tolerance.
    pub fn reached_from(&self, tool: &Assembly) -> Result<Option<Vec3>> {
        let found =
            self.with_tool(tool, |cutter, tool| Ok(tool.site(cutter.contact, &self.frames)));
        match found {
            Ok(SiteResult { witness, .. }) => Ok(witness.map(|pose| pose.direction)),
            Err(Error::Argument { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn site(&self) -> Sites {
        let Query { site, normal, .. } = *self.query;
        Sites { points: vec![site], normals: vec![normal], faces: Vec::new() }
    }

    fn cutter(&self, tool: &Assembly) -> Result<Cutter> {
        tool.with_clearance(self.query.clearance_mm)?.cutter()
    }

    /// What `then` makes of a tool at the site.
    fn with_tool<T>(
        &self,
        tool: &Assembly,
        then: impl FnOnce(&Held, &ProfileTool) -> Result<T>,
    ) -> Result<T> {
        let (sites, cutter) = (self.site(), self.cutter(tool)?);
        let options = self.query.options;
        let problem = self.triangles.problem(Queries::Sites(&sites), &cutter, options)?;
        let Some(profile) = cutter.profile() else { return Err(no_profile()) };
        let bvh = &self.triangles.bvh;
        let tool = ProfileTool::new(bvh, &problem.tolerances, profile, options.finish_mm);
        then(&Held { contact: &problem.contacts[0], profile }, &tool)
    }
}

impl TriangleObstacles {
    /// Whether a tool given by its profile is free in poses, directions and places of the tip, whatever it touches and
    /// however it gets there: it penetrates no triangle.
    ///
    /// # Errors
    /// If the tool is given by lengths, or the tolerance is none for it.
    #[doc(hidden)] // of an example, for benches/peers/manifold_poses.py
    pub fn are_free(
        &self,
        cutter: &Cutter,
        poses: &[(Vec3, DVec3)],
        options: &SurfaceOptions,
    ) -> Result<Vec<bool>> {
        let _floats = par::DefaultFloats::set();
        let Some(profile) = cutter.profile() else { return Err(no_profile()) };
        let problem = self.problem(Queries::Sites(&Sites::default()), cutter, options)?;
        let tool = ProfileTool::new(&self.bvh, &problem.tolerances, profile, options.finish_mm);
        let is_free =
            |&(direction, tip): &(Vec3, DVec3)| tool.is_free(&Frame::along(direction), tip);
        Ok(par::map(poses.len(), |k| is_free(&poses[k])))
    }
}

fn no_profile() -> Error {
    Error::argument("tool", "given by lengths", "a profile", "give the tool by its profile")
}

/// A tool in its holder where it touches.
struct Held<'a> {
    contact: &'a Contact,
    profile: &'a Profile,
}

/// One direction alone.
fn list(direction: Vec3) -> Result<Directions> {
    let vectors = vec![direction.as_dvec3().to_array()];
    Directions::new(DirectionSet::List { vectors })
}

fn state(direction: Vec3, found: PoseState) -> DirectionState {
    let blocked = |Penetration { part, in_part, face, at, .. }: Penetration| Blocked {
        part,
        penetration_mm: in_part,
        face,
        at_mm: at,
    };
    let (outcome, blocked, clearance_mm) = match found {
        PoseState::Accessible => (Outcome::Free, None, 0.0),
        PoseState::NoRetreat => (Outcome::NoRetreat, None, 0.0),
        PoseState::NotAtOwnBore => (Outcome::NotAtOwnBore, None, 0.0),
        PoseState::Penetrates(found) => (Outcome::Blocked, Some(blocked(found)), -found.depth),
        PoseState::DoesNotTouch => (Outcome::DoesNotTouch, None, NONE_MM),
    };
    DirectionState { direction, blocked, clearance_mm, outcome }
}
