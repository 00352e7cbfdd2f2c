//! Why a site can or cannot be reached: what blocks in which direction, by how much, and what would help.
//!
//! # Definition
//!
//! In a direction the tool stands where it touches the site. A step, shrunk by the contact tolerance, *penetrates* by
//! as much as it would have to be raised to be clear: the greatest height of the triangles over its disc, less its
//! lower end ([`raise`](super::raise)). The direction is **blocked by** the lowest step that penetrates, or, where none
//! does, by the tip. The **clearance** of a direction is how far all heights and radii of the steps may grow there;
//! negative, how far they must shrink. The direction with the greatest is the nearest to being free.
//!
//! A **change** is one length of the tool: the stick-out, the length or the radius of the holder, those of a shank, or
//! the diameter of the cutter. Its least amount is the least over all directions of what that direction needs:
//!
//! ```text
//! raise part P and all above:  if no lower step and no tip penetrates: max over these steps of (greatest height over the disc − lower end)
//! radii of part P less:        if nothing else penetrates: max over its steps of (radius − distance of the nearest point above the lower end)
//! diameter of the cutter:      not in closed form: the sizes that are sold are labeled from the largest on
//! ```
//!
//! # Pseudo-code
//!
//! ```text
//! label the site; done if it is accessible: the witness is proved by the plain loops of `raise`
//! for every direction tested: what penetrates, by how much; clearance                       (search tree, closed formulas)
//! for every kind of change:
//!     least = the least amount over the directions tested
//!     while the search between the directions finds one for the tool changed by least − 2τ:
//!         least = the amount that this direction needs
//!     label the site with the tool changed by `least`: proved, or left out
//! ```

mod change;
mod meet;
mod nearest;
mod parts;
mod region;
mod remedies;

pub(crate) use change::short;
pub use change::{Change, ChangeKind};
pub use nearest::NearestPose;
pub use parts::blocking_parts_among_points;
pub use region::{N_LABELED, RegionAdvice, RegionChange};
pub use remedies::{Remedies, Stopped, sold_diameter};

use super::labels::{RefinementOptions, SiteAnswer, SurfaceOptions, WitnessPose};
use super::obstacles::{TriangleObstacles, tested};
use super::query::Scratch;
use super::site::{Ball, SiteState};
use super::tool::{Outline, Stand, axes};
use super::verdict::{Raise, raise_over};
use crate::access::{Engine, LabelOptions, Obstacles, Queries, label};
use crate::cutter::{Assembly, Cutter, ToolPart};
use crate::directions::{DirectionSet, Directions};
use crate::geom::Sites;
use crate::{Result, par};
use glam::{DVec3, Vec3};
use meet::{Meeting, Points, ShrunkTool};

/// A site, and what it is labeled for.
#[derive(Debug, Clone, Copy)]
pub struct Query<'a> {
    /// Where the tool touches, mm.
    pub site: Vec3,
    /// Outward unit normal there.
    pub normal: Vec3,
    /// The tool without a margin.
    pub tool: &'a Assembly,
    /// Safety margin all around, mm.
    pub clearance_mm: f64,
    /// Directions of the query.
    pub directions: &'a Directions,
    /// How triangles are tested; of it the tolerance and the search between directions count. Points as obstacles have
    /// neither.
    pub options: &'a SurfaceOptions,
    /// A direction in which the tool is said to stand there: it is tried first.
    pub witness: Option<Vec3>,
    /// Which changed tools are worth a proposal.
    pub remedies: Remedies,
}

/// Why a site can or cannot be reached.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Explanation {
    /// The answer.
    pub answer: SiteAnswer,
    /// Contact tolerance, mm; 0 where points are the obstacles.
    pub tolerance_mm: f64,
    /// Where the tool may stand.
    pub witness: Option<Witness>,
    /// The directions tested.
    pub directions: Vec<DirectionState>,
    /// For a site that is not accessible, the pose nearest to being free; none among points.
    pub nearest_pose: Option<NearestPose>,
    /// Changes of the tool that help, the least first; none for an accessible site.
    pub changes: Vec<Change>,
    /// A stick-out that would help and is not proposed, if there is one.
    pub stopped: Option<Stopped>,
    /// For a site that is not accessible: a direction outside of those of the query in which this tool may stand.
    pub other_direction: Option<Vec3>,
}

/// A direction in which the tool may stand, by the reference engine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Witness {
    /// From tip to spindle.
    pub direction: Vec3,
    /// The lowest point of the tool on its axis, mm; none among points.
    pub tip_mm: Option<DVec3>,
    /// How far the tool could be lowered until it touches, mm: 0 or more; infinite if it meets nothing. Among points:
    /// how far its steps could grow, which is no more than that.
    pub margin_mm: f64,
}

/// What was found in a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionState {
    /// From tip to spindle.
    pub direction: Vec3,
    /// What blocks; `None` if nothing does.
    pub blocked: Option<Blocked>,
    /// How far the steps may grow (negative: must shrink), mm, to [`CLEARANCE_STEP_MM`](super::CLEARANCE_STEP_MM) and
    /// within ±[`MOST_CLEARANCE_MM`].
    pub clearance_mm: f64,
}

/// What blocks a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blocked {
    /// Part of the tool.
    pub part: ToolPart,
    /// How far it would have to be raised to be clear, mm.
    pub penetration_mm: f64,
    /// What it meets: triangle of the part, or beyond these of the fixtures; or number of the point.
    pub face: u32,
    /// The highest place of that face in the part of the tool, mm.
    pub at_mm: DVec3,
}

/// Clearances are not followed beyond this.
pub const MOST_CLEARANCE_MM: f64 = 1e3;

impl Explanation {
    /// Number of the directions tested that each part blocks, in the order of [`ToolPart::ALL`].
    pub fn counts(&self) -> [usize; 5] {
        ToolPart::ALL.map(|part| {
            let blocked = self.directions.iter().filter_map(|state| state.blocked);
            blocked.filter(|blocked| blocked.part == part).count()
        })
    }

    /// Of the blocked directions the nearest to being free, the first among equals: with the least penetration of the
    /// tip where no step is in the way, else with the greatest clearance.
    pub fn nearest(&self) -> Option<&DirectionState> {
        let blocked = || self.directions.iter().filter(|state| state.blocked.is_some());
        let depth = |state: &DirectionState| {
            state.blocked.filter(|b| b.part == ToolPart::Tip).map(|b| b.penetration_mm)
        };
        let tip = blocked().filter_map(|state| depth(state).map(|depth| (depth, state)));
        let by_tip = tip.reduce(|best, next| if next.0 < best.0 { next } else { best });
        let by_steps = || {
            blocked().reduce(
                |best, next| {
                    if next.clearance_mm > best.clearance_mm { next } else { best }
                },
            )
        };
        by_tip.map(|(_, state)| state).or_else(by_steps)
    }

    /// The part that blocks in the direction which gets furthest: the tip where no step blocks some direction, else the
    /// highest of the parts that block; `None` for an accessible site.
    pub fn blocked_by(&self) -> Option<ToolPart> {
        let parts = || self.directions.iter().filter_map(|state| state.blocked).map(|b| b.part);
        match self.answer {
            SiteAnswer::Accessible => None,
            SiteAnswer::TipDoesNotFit => Some(ToolPart::Tip),
            SiteAnswer::Inaccessible => parts().max(),
        }
    }
}

impl TriangleObstacles {
    /// Why `query`'s site can or cannot be reached among these triangles.
    ///
    /// ```
    /// use deepmill::access::surface::explain::{ChangeKind, Query, Remedies};
    /// use deepmill::access::surface::{SiteAnswer, SurfaceOptions, TriangleObstacles};
    /// use deepmill::cutter::{Assembly, Section, TipShape, ToolPart};
    /// use deepmill::directions::Directions;
    /// use deepmill::geom::{Mesh, solids};
    /// use deepmill::glam::{DVec3, Vec3};
    ///
    /// // A wall of 20 mm stands 5 mm beside a site on a table; the holder, 30 mm wide, begins 12 mm above the tip.
    /// let table = solids::cuboid(DVec3::new(60.0, 60.0, 5.0));
    /// let mut wall = solids::cuboid(DVec3::new(60.0, 10.0, 20.0));
    /// wall.vertices.iter_mut().for_each(|v| *v += DVec3::new(0.0, 35.0, 5.0));
    /// let obstacles = TriangleObstacles::new(&table, &[wall])?;
    /// let tip = TipShape::Straight { radius_mm: 1.5, corner_mm: 1.5 };
    /// let holder = [Section::cylinder(30.0, 15.0)];
    /// let tool = Assembly::new(tip, &[Section::cylinder(50.0, 1.5)], &holder, 12.0)?;
    /// let query = Query {
    ///     site: Vec3::new(30.0, 30.0, 5.0),
    ///     normal: Vec3::Z,
    ///     tool: &tool,
    ///     clearance_mm: 0.0,
    ///     directions: &Directions::up(),
    ///     options: &SurfaceOptions::default(),
    ///     witness: None,
    ///     remedies: Remedies::default(),
    /// };
    /// let why = obstacles.explain(&query)?;
    /// assert_eq!(why.answer, SiteAnswer::Inaccessible);
    /// assert_eq!(why.directions[0].blocked.unwrap().part, ToolPart::Holder);
    /// // 8 mm of the wall are above the holder's nose, which is 12 mm above the tip.
    /// let longer = why.changes.iter().find(|c| c.kind == ChangeKind::Raise(ToolPart::Holder)).unwrap();
    /// assert!((longer.by_mm - (8.0 - why.tolerance_mm)).abs() < 1e-3);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`], or if the tool is none ([`Assembly::cutter`]).
    pub fn explain(&self, query: &Query) -> Result<Explanation> {
        let tested = tested(query.directions)?;
        Case { barrier: Barrier::Triangles(self), query, tested, proves: true }.explain()
    }
}

/// Why a site can or cannot be reached by the published definition: `obstacles` block, `own` is the one of them that is
/// the site itself. The witness is proved, and changes are labeled, by [`Engine::Reference`].
///
/// # Errors
/// As [`label`], or if the tool is none ([`Assembly::cutter`]).
pub fn explain_among_points(
    obstacles: &[Vec3],
    own: Option<usize>,
    query: &Query,
) -> Result<Explanation> {
    let others = obstacles.iter().enumerate().filter(|(j, _)| Some(*j) != own);
    let others = others.map(|(_, p)| *p).collect();
    let points = Points {
        obstacles,
        own,
        site: query.site.as_dvec3(),
        normal: query.normal.as_dvec3().normalize_or_zero(),
    };
    let tested = query.directions.clone();
    let barrier = Barrier::Points(points, others);
    Case { barrier, query, tested, proves: true }.explain()
}

/// One direction alone.
fn list(direction: Vec3) -> Result<Directions> {
    let vectors = vec![direction.as_dvec3().to_array()];
    Directions::new(DirectionSet::List { vectors })
}

/// What blocks.
enum Barrier<'a> {
    Triangles(&'a TriangleObstacles),
    /// And all but the site itself.
    Points(Points<'a>, Vec<Vec3>),
}

struct Case<'a> {
    barrier: Barrier<'a>,
    query: &'a Query<'a>,
    tested: Directions,
    /// Whether changes are proved by the reference engine, besides being labeled.
    proves: bool,
}

/// Whether directions between those of a set are searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Between {
    None,
    /// No longer than by default.
    Quick,
    AsGiven,
}

/// The answer for a tool.
struct Answered {
    answer: SiteAnswer,
    witness: Option<Vec3>,
    /// The free pose, among triangles.
    pose: Option<WitnessPose>,
    tolerance: f64,
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
    fn explain(&self) -> Result<Explanation> {
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
        };
        if answer != SiteAnswer::Accessible {
            why.nearest_pose = self.nearest_pose(tool, found.tolerance, why.nearest())?;
        }
        Ok(why)
    }

    fn site(&self) -> Sites {
        let Query { site, normal, .. } = *self.query;
        Sites { points: vec![site], normals: vec![normal], faces: Vec::new() }
    }

    fn cutter(&self, tool: &Assembly) -> Result<Cutter> {
        tool.with_clearance(self.query.clearance_mm)?.cutter()
    }

    /// The answer for a tool over these directions and, if wanted, those between.
    fn label(
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
                let labels = triangles.label(&sites, &cutter, directions, &options)?;
                let (answer, pose) = (labels.answers[0], labels.witness[0]);
                let witness = pose.map(|pose| pose.direction);
                Ok(Answered { answer, witness, pose, tolerance: labels.tolerance_mm[0] })
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
    fn prove(&self, tool: &Assembly, direction: Vec3) -> Result<Option<Witness>> {
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
    fn parted(&self, tool: &Assembly, tolerance: f64) -> Result<(ShrunkTool, Outline)> {
        let outline = Outline::new(&self.cutter(tool)?, self.query.options.finish_mm);
        let shrink = |(part, step): (ToolPart, crate::cutter::Step)| {
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
    fn states(&self, tool: &Assembly) -> Result<Vec<DirectionState>> {
        let (parted, meetings) = self.meetings(tool, self.tested.vectors())?;
        let clearances = self.clearances(tool)?;
        let state = |k: usize| DirectionState {
            direction: self.tested.vectors()[k],
            blocked: meetings[k].lowest(&parted).map(|(part, met)| Blocked {
                part,
                penetration_mm: met.raise,
                face: met.face,
                at_mm: met.at,
            }),
            clearance_mm: clearances[k],
        };
        Ok((0..meetings.len()).map(state).collect())
    }

    /// Whether the tip is a ball that gouges: what is above it does not matter then.
    fn ball_gouges(&self, tool: &Assembly) -> Result<bool> {
        let Barrier::Triangles(triangles) = &self.barrier else { return Ok(false) };
        let (sites, cutter) = (self.site(), self.cutter(tool)?);
        let options = self.query.options;
        let problem = triangles.problem(Queries::Sites(&sites), &cutter, options)?;
        let mut state = SiteState::default();
        problem.place_ball(0, &mut state);
        Ok(state.ball == Ball::Gouges)
    }

    /// What the tool meets in each of these directions.
    fn meetings(&self, tool: &Assembly, of: &[Vec3]) -> Result<(ShrunkTool, Vec<Meeting>)> {
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

    fn clearances(&self, tool: &Assembly) -> Result<Vec<f64>> {
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
