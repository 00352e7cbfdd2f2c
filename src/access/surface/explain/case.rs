//! One query, of a site, a tool and what blocks it: labels, proofs and what is met in every direction.

use super::meet::{self, Meeting, Points, ShrunkTool};
use super::{Blocked, DirectionState, Explanation, MOST_CLEARANCE_MM, Outcome, Query, Witness};
use crate::Result;
use crate::access::evidence::WitnessPose;
use crate::access::surface::labels::{RefinementOptions, SurfaceOptions};
use crate::access::surface::obstacles::TriangleObstacles;
use crate::access::surface::query::Scratch;
use crate::access::surface::site::{Ball, SiteState};
use crate::access::surface::tool::{Outline, Stand, axes};
use crate::access::surface::verdict::{Raise, raise_over};
use crate::access::{Engine, LabelOptions, Obstacles, Queries, label};
use crate::answers::SiteAnswer;
use crate::exec::par;
use crate::geom::Sites;
use crate::tool::cutter::{Assembly, Cutter, ToolPart};
use crate::tool::directions::{DirectionSet, Directions};
use glam::Vec3;

/// One direction alone.
fn list(direction: Vec3) -> Result<Directions> {
    let vectors = vec![direction.as_dvec3().to_array()];
    Directions::new(DirectionSet::List { vectors })
}

/// What blocks.
pub(super) enum Barrier<'a> {
    Triangles(&'a TriangleObstacles),
    /// And all but the site itself.
    Points(Points<'a>, Vec<Vec3>),
}

pub(super) struct Case<'a> {
    pub barrier: Barrier<'a>,
    pub query: &'a Query<'a>,
    pub tested: Directions,
    /// Whether changes are proved by the reference engine, besides being labeled.
    pub proves: bool,
}

/// Whether directions between those of a set are searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Between {
    None,
    /// No longer than by default.
    Quick,
    AsGiven,
}

/// The answer for a tool.
pub(super) struct Answered {
    pub answer: SiteAnswer,
    pub witness: Option<Vec3>,
    /// The free pose, among triangles.
    pub pose: Option<WitnessPose>,
    pub tolerance: f64,
}

/// Samples of the surface for one site: triangles are cheaper.
const N_SAMPLES: usize = 0;
/// Directions of the whole sphere that are tried beyond those of the query.
const N_SPHERE: usize = 300;

impl Between {
    fn of(self, given: RefinementOptions) -> Option<RefinementOptions> {
        let default = RefinementOptions::default();
        match self {
            Between::None => None,
            Between::AsGiven => Some(given),
            Between::Quick => Some(RefinementOptions {
                n_kept: given.n_kept.min(default.n_kept),
                n_levels: given.n_levels.min(default.n_levels),
                prove: false,
            }),
        }
    }
}

impl Case<'_> {
    pub fn explain(&self) -> Result<Explanation> {
        let tool = self.query.tool;
        let found = self.label(tool, self.query.directions, Between::AsGiven)?;
        let mut answer = found.answer;
        let candidates = self.query.witness.into_iter().chain(found.witness);
        let mut witness = None;
        for direction in candidates {
            witness = witness.or(self.prove(tool, direction)?);
        }
        // What the file's direction reaches is accessible, whatever this search finds.
        if witness.is_some() {
            answer = SiteAnswer::Accessible;
        }
        let directions = self.states(tool)?;
        let (mut changes, mut stopped, mut other_direction) = (Vec::new(), None, None);
        if answer != SiteAnswer::Accessible {
            (changes, stopped) = self.changes(found.tolerance)?;
            let sphere = Directions::new(DirectionSet::FibonacciSphere { n_dirs: N_SPHERE })?;
            let around = self.label(tool, &sphere, Between::Quick)?;
            if let Some(direction) = around.witness {
                other_direction = self.prove(tool, direction)?.map(|witness| witness.direction);
            }
        }
        let mut why = Explanation {
            answer,
            tolerance_mm: found.tolerance,
            witness,
            directions,
            nearest_pose: None,
            changes,
            stopped,
            other_direction,
            of_profile: false,
        };
        if answer != SiteAnswer::Accessible {
            why.nearest_pose = self.nearest_pose(tool, found.tolerance, why.nearest())?;
        }
        Ok(why)
    }

    pub fn site(&self) -> Sites {
        let Query { site, normal, .. } = *self.query;
        Sites { points: vec![site], normals: vec![normal], faces: Vec::new() }
    }

    pub fn cutter(&self, tool: &Assembly) -> Result<Cutter> {
        tool.with_clearance(self.query.clearance_mm)?.cutter()
    }

    /// The answer for a tool over these directions and, if wanted, those between.
    pub fn label(
        &self,
        tool: &Assembly,
        directions: &Directions,
        between: Between,
    ) -> Result<Answered> {
        let (sites, cutter) = (self.site(), self.cutter(tool)?);
        match &self.barrier {
            Barrier::Triangles(triangles) => {
                let given = self.query.options;
                let options = SurfaceOptions {
                    tolerance: given.tolerance,
                    finish_mm: given.finish_mm,
                    counts: false,
                    occlusion: false,
                    refinement: given.refinement.and_then(|given| between.of(given)),
                    n_samples: N_SAMPLES,
                    ..SurfaceOptions::default()
                };
                let labels = triangles.surface_labels(&sites, &cutter, directions, &options)?;
                let (answer, pose) = (labels.answers[0], labels.evidence.witness[0]);
                let witness = pose.map(|pose| pose.direction);
                Ok(Answered { answer, witness, pose, tolerance: labels.evidence.tolerance_mm[0] })
            }
            Barrier::Points(_, others) => {
                let options = LabelOptions {
                    engine: Engine::Reference,
                    occlusion: false,
                    ..LabelOptions::default()
                };
                let queries = Queries::Sites(&sites);
                let labels =
                    label(queries, Obstacles::Points(others), &cutter, directions, &options)?;
                let witness = labels.witness[0].map(|k| directions.vectors()[k as usize]);
                let answer = match witness {
                    Some(_) => SiteAnswer::Accessible,
                    None => SiteAnswer::Inaccessible,
                };
                Ok(Answered { answer, witness, pose: None, tolerance: 0.0 })
            }
        }
    }

    /// The tool in a direction by the plain loops of the reference engine; `None` if it penetrates.
    pub fn prove(&self, tool: &Assembly, direction: Vec3) -> Result<Option<Witness>> {
        let cutter = self.cutter(tool)?;
        let raise = match &self.barrier {
            Barrier::Triangles(triangles) => {
                let (sites, options) = (self.site(), self.query.options);
                let problem = triangles.problem(Queries::Sites(&sites), &cutter, options)?;
                let alone = self.label(tool, &list(direction)?, Between::None)?;
                alone.pose.and_then(|pose| {
                    let reference = pose.reference(&problem.outline);
                    let stand = Stand { reference, axes: axes(direction) };
                    let Raise { steps, tip } =
                        raise_over(problem.all_triangles(), &problem.outline, 0.0, &stand);
                    let raise = steps.max(tip);
                    (raise <= 0.0).then_some((raise, Some(pose.tip_mm)))
                })
            }
            Barrier::Points(points, _) => {
                let found = self.label(tool, &list(direction)?, Between::None)?;
                let (parted, outline) = self.parted(tool, 0.0)?;
                let clearance = || points.clearance(&parted, &outline, direction, f64::INFINITY);
                found.witness.map(|_| (-clearance().max(0.0), None))
            }
        };
        Ok(raise.map(|(raise, tip_mm)| Witness { direction, tip_mm, margin_mm: -raise }))
    }

    /// The tool's steps by part, shrunk, and its outline.
    pub fn parted(&self, tool: &Assembly, tolerance: f64) -> Result<(ShrunkTool, Outline)> {
        let outline = Outline::new(&self.cutter(tool)?, self.query.options.finish_mm);
        let shrink = |(part, step): (ToolPart, crate::tool::cutter::Step)| {
            let radius = (step.radius_mm - tolerance).max(0.0);
            (part, [step.height_mm + tolerance, radius])
        };
        let steps = tool.parts(self.query.clearance_mm)?.into_iter().map(shrink).collect();
        let is_tested = matches!(self.barrier, Barrier::Triangles(_));
        let tip = is_tested.then(|| outline.tip(tolerance));
        let size = outline.size();
        Ok((ShrunkTool { steps, tip, size }, outline))
    }

    /// What blocks in every direction tested.
    pub fn states(&self, tool: &Assembly) -> Result<Vec<DirectionState>> {
        let (parted, meetings) = self.meetings(tool, self.tested.vectors())?;
        let clearances = self.clearances(tool)?;
        let state = |k: usize| {
            let blocked = meetings[k].lowest(&parted).map(|(part, met)| Blocked {
                part,
                penetration_mm: met.raise,
                face: met.face,
                at_mm: met.at,
            });
            let direction = self.tested.vectors()[k];
            let outcome = if blocked.is_some() { Outcome::Blocked } else { Outcome::Free };
            DirectionState { direction, blocked, clearance_mm: clearances[k], outcome }
        };
        Ok((0..meetings.len()).map(state).collect())
    }

    /// Whether the tip is a ball that gouges: what is above it does not matter then.
    pub fn ball_gouges(&self, tool: &Assembly) -> Result<bool> {
        let Barrier::Triangles(triangles) = &self.barrier else { return Ok(false) };
        let (sites, cutter) = (self.site(), self.cutter(tool)?);
        let options = self.query.options;
        let problem = triangles.problem(Queries::Sites(&sites), &cutter, options)?;
        let mut state = SiteState::default();
        problem.place_ball(0, &mut state);
        Ok(state.ball == Ball::Gouges)
    }

    /// What the tool meets in each of these directions.
    pub fn meetings(&self, tool: &Assembly, of: &[Vec3]) -> Result<(ShrunkTool, Vec<Meeting>)> {
        match &self.barrier {
            Barrier::Triangles(triangles) => {
                let (sites, cutter) = (self.site(), self.cutter(tool)?);
                let options = self.query.options;
                let problem = triangles.problem(Queries::Sites(&sites), &cutter, options)?;
                let (parted, _) = self.parted(tool, problem.tolerances.least)?;
                let meet = |k: usize| meet::among_triangles(&problem, &parted, of[k]);
                let meetings = par::map(of.len(), meet);
                Ok((parted, meetings))
            }
            Barrier::Points(points, _) => {
                let (parted, outline) = self.parted(tool, 0.0)?;
                let meetings = par::map(of.len(), |k| points.meet(&parted, &outline, of[k]));
                Ok((parted, meetings))
            }
        }
    }

    pub fn clearances(&self, tool: &Assembly) -> Result<Vec<f64>> {
        let of = self.tested.vectors();
        match &self.barrier {
            Barrier::Triangles(triangles) => {
                let (sites, cutter) = (self.site(), self.cutter(tool)?);
                let options = self.query.options;
                let problem = triangles.problem(Queries::Sites(&sites), &cutter, options)?;
                let limits = [-MOST_CLEARANCE_MM, MOST_CLEARANCE_MM];
                Ok(par::map(of.len(), |k| {
                    let stand = problem.own_stand(0, of[k]);
                    problem.clear_up_to(&stand, limits, &mut Scratch::default())
                }))
            }
            Barrier::Points(points, _) => {
                let (parted, outline) = self.parted(tool, 0.0)?;
                let clearance =
                    |k: usize| points.clearance(&parted, &outline, of[k], MOST_CLEARANCE_MM);
                Ok(par::map(of.len(), clearance))
            }
        }
    }
}
