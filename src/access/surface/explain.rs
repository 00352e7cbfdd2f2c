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
//! A tool **given by its profile** may be in many poses. A pose penetrates by the greatest depth of a point in the
//! tool, its distance from everything outside, beyond the tolerance. Of a direction the pose counts that penetrates
//! least; it is blocked by the lowest part that does not cut and penetrates there, or else by what cuts, the tip. A
//! pose may be free and not count: a retreat is not proven, or a drill is at no bore of its own diameter. Amounts of
//! changes are labeled.
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

mod case;
mod change;
mod meet;
mod nearest;
mod parts;
mod profile;
mod profile_change;
mod region;
mod remedies;

pub(crate) use change::short;
pub use change::{Change, ChangeKind};
pub use nearest::NearestPose;
#[doc(hidden)] // of `analysis`
pub use parts::blocking_parts_among_points;
pub(crate) use region::BlockedQuery;
#[doc(hidden)] // for findings, of the program
pub use region::{RegionAdvice, RegionChange};
#[doc(hidden)] // checked by tests
pub use remedies::sold_diameter;
pub use remedies::{Remedies, Stopped};

use super::labels::SurfaceOptions;
use super::obstacles::{TriangleObstacles, tested};
use crate::Result;
use crate::answers::SiteAnswer;
use crate::tool::cutter::{Assembly, ToolPart, require_steps};
use crate::tool::directions::Directions;
use case::{Barrier, Case};
use glam::{DVec3, Vec3};
use meet::Points;
use profile::ProfileCase;
use serde::{Deserialize, Serialize};

/// A site, and what it is labeled for.
///
/// A margin is part of the question. A wall of 20 mm is 5 mm beside a site, and the tool's radius 1.5 mm:
///
/// ```
/// use deepmill::access::surface::{SurfaceOptions, TriangleObstacles, explain::Query};
/// use deepmill::{cutter::*, directions::Directions, geom::solids, glam::{DVec3, Vec3}};
///
/// let table = solids::cuboid(DVec3::new(60.0, 60.0, 5.0));
/// let mut wall = solids::cuboid(DVec3::new(60.0, 10.0, 20.0));
/// wall.vertices.iter_mut().for_each(|v| *v += DVec3::new(0.0, 35.0, 5.0));
/// let tip = TipShape::Straight { radius_mm: 1.5, corner_mm: 1.5 };
/// let body = [Section::cylinder(10.0, 1.5), Section::cylinder(50.0, 1.5)]; // flutes and shank
/// let tool = Assembly::new(tip, &body, &[Section::cylinder(30.0, 15.0)], 30.0)?;
/// let (obstacles, options) = (TriangleObstacles::new(&table, &[wall])?, SurfaceOptions::default());
/// let up = Directions::up();
/// let query = Query::new(Vec3::new(30.0, 30.0, 5.0), Vec3::Z, &tool, &up, &options);
/// assert!(obstacles.explain(&query.with_clearance_mm(3.0))?.directions[0].is_free()); // 1.5 + 3 < 5
/// let why = obstacles.explain(&query.with_clearance_mm(4.0))?;
/// assert_eq!(why.directions[0].blocked.map(|blocked| blocked.part), Some(ToolPart::Shank)); // 1.5 + 4 > 5
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
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

impl<'a> Query<'a> {
    /// For a tool without a margin, with the remedies that are proposed by default.
    pub fn new(
        site: Vec3,
        normal: Vec3,
        tool: &'a Assembly,
        directions: &'a Directions,
        options: &'a SurfaceOptions,
    ) -> Self {
        let (clearance_mm, witness, remedies) = (0.0, None, Remedies::default());
        Query { site, normal, tool, clearance_mm, directions, options, witness, remedies }
    }
}

setters!(Query<'a> {
    with_clearance_mm(clearance_mm: f64),
    with_witness(witness: Option<Vec3>),
    with_remedies(remedies: Remedies),
});

/// Why a site can or cannot be reached.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Explanation {
    /// The answer.
    pub answer: SiteAnswer,
    /// Contact tolerance, mm; 0 where points are the obstacles.
    pub tolerance_mm: f64,
    /// The free pose of the tool.
    pub witness: Option<Witness>,
    /// The directions tested.
    pub directions: Vec<DirectionState>,
    /// For a site that is not accessible, the pose nearest to being free; none among points.
    pub nearest_pose: Option<NearestPose>,
    /// Changes of the tool that help, the least first; none for an accessible site.
    pub changes: Vec<Change>,
    /// A stick-out that would help and is not proposed, if there is one.
    pub stopped: Option<Stopped>,
    /// For a site that is not accessible: a direction outside of those of the query with a free pose of this tool.
    pub other_direction: Option<Vec3>,
    pub(crate) of_profile: bool,
}

/// A direction with a free pose of the tool, by the reference engine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Witness {
    /// From tip to spindle.
    pub direction: Vec3,
    /// The lowest point of the tool on its axis, mm; none among points.
    pub tip_mm: Option<DVec3>,
    /// How far the tool could be lowered until it penetrates, mm: 0 or more; infinite if it meets nothing. Among
    /// points: how far its steps could grow, which is no more than that.
    #[serde(with = "crate::tool::cutter::infinite")]
    pub margin_mm: f64,
}

/// What was found in a direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct DirectionState {
    /// From tip to spindle.
    pub direction: Vec3,
    /// What blocks; `None` if nothing does. In a direction that is not [free](DirectionState::is_free) nothing may, of
    /// a tool given by its profile: [`DirectionState::reason`].
    pub blocked: Option<Blocked>,
    /// How far the steps may grow (negative: must shrink), mm, to 1e-4 mm and within ±1 m. Of a tool given by its
    /// profile 0 if nothing penetrates; else negative: how much smaller all around it would have to be in the pose
    /// nearest to being free. −1 m if nothing of what cuts has the site's normal.
    pub clearance_mm: f64,
    pub(crate) outcome: Outcome,
}

/// What was found in a direction, from the best.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Outcome {
    Free,
    /// Of a tool given by its profile: a pose is free, but no way out of one is proven.
    NoRetreat,
    /// Of a drill: the site is at no bore of its own diameter.
    NotAtOwnBore,
    Blocked,
    /// Of a tool given by its profile: nothing of what cuts has the site's normal.
    DoesNotTouch,
}

impl DirectionState {
    /// Whether the tool has a free pose there.
    pub fn is_free(&self) -> bool {
        self.outcome == Outcome::Free
    }

    /// Why it may not where nothing blocks, of a tool given by its profile.
    pub fn reason(&self) -> Option<&'static str> {
        match self.outcome {
            Outcome::Free | Outcome::Blocked => None,
            Outcome::NoRetreat => Some("no proven way out"),
            Outcome::NotAtOwnBore => Some("no bore of its own diameter"),
            Outcome::DoesNotTouch => Some("nothing that cuts touches there"),
        }
    }
}

/// What blocks a direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Blocked {
    /// Part of the tool. Of one given by its profile: the lowest that does not cut and penetrates in the pose nearest
    /// to being free, else the tip, which is all that cuts.
    pub part: ToolPart,
    /// How far it would have to be raised to be clear, mm. Of a tool given by its profile: the greatest depth of a
    /// point in the part, its distance from all that is outside of the tool, beyond the tolerance.
    pub penetration_mm: f64,
    /// What it meets: triangle of the part, or beyond these of the fixtures; or number of the point.
    pub face: u32,
    /// The highest place of that face in the part of the tool, mm; of a profile about the deepest.
    pub at_mm: DVec3,
}

/// Clearances are not followed beyond this.
pub(crate) const MOST_CLEARANCE_MM: f64 = 1e3;

impl Explanation {
    /// Number of the directions tested that each part blocks, in the order of [`ToolPart::ALL`].
    pub fn counts(&self) -> [usize; 5] {
        ToolPart::ALL.map(|part| {
            let blocked = self.directions.iter().filter_map(|state| state.blocked);
            blocked.filter(|blocked| blocked.part == part).count()
        })
    }

    /// Of the blocked directions the nearest to being free, the first among equals: with the least penetration of the
    /// tip where no step is in the way, else with the greatest clearance. Of a tool given by its profile one in which a
    /// pose is free and still does not count, else the one with the greatest clearance.
    pub fn nearest(&self) -> Option<&DirectionState> {
        if self.of_profile {
            let of = self.directions.iter().filter(|state| !state.is_free());
            let is_nearer = |a: &DirectionState, b: &DirectionState| {
                (a.outcome, -a.clearance_mm) < (b.outcome, -b.clearance_mm)
            };
            return of.reduce(|best, next| if is_nearer(next, best) { next } else { best });
        }
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

    /// Whether a pose is free and no way out of one is proven:
    /// [`SurfaceEvidence::retreat_unproven`](super::SurfaceEvidence::retreat_unproven).
    pub fn retreat_unproven(&self) -> bool {
        let is_free = |state: &DirectionState| state.outcome == Outcome::NoRetreat;
        self.answer == SiteAnswer::Inaccessible && self.directions.iter().any(is_free)
    }

    /// The part that blocks in the direction which gets furthest: the tip where no step blocks some direction, else the
    /// highest of the parts that block; of a tool given by its profile the one in the direction nearest to being free.
    /// `None` for an accessible site, and where [no way out is proven](Explanation::retreat_unproven).
    pub fn blocked_by(&self) -> Option<ToolPart> {
        let parts = || self.directions.iter().filter_map(|state| state.blocked).map(|b| b.part);
        match self.answer {
            SiteAnswer::Accessible => None,
            SiteAnswer::TipDoesNotFit => Some(ToolPart::Tip),
            SiteAnswer::Inaccessible if self.of_profile => self.nearest()?.blocked.map(|b| b.part),
            SiteAnswer::Inaccessible => parts().max(),
        }
    }
}

impl TriangleObstacles {
    /// Why `query`'s site can or cannot be reached among these triangles.
    ///
    /// ```
    /// use deepmill::access::surface::explain::{ChangeKind, Query};
    /// use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
    /// use deepmill::answers::SiteAnswer;
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
    /// let (up, options) = (Directions::up(), SurfaceOptions::default());
    /// let query = Query::new(Vec3::new(30.0, 30.0, 5.0), Vec3::Z, &tool, &up, &options);
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
        if query.tool.profile().is_some() {
            return ProfileCase::new(self, query)?.explain();
        }
        let tested = tested(query.directions)?;
        Case { barrier: Barrier::Triangles(self), query, tested, proves: true }.explain()
    }
}

const BY_POINTS: &str = "label against a mesh: points do not say what blocks a tool of any profile";

/// Why a site can or cannot be reached by the published definition: `obstacles` block, `own` is the one of them that is
/// the site itself. The witness is proved, and changes are labeled, by
/// [`Engine::Reference`](crate::access::Engine::Reference).
///
/// # Errors
/// As [`label`](crate::access::label), or if the tool is none ([`Assembly::cutter`]).
#[doc(hidden)] // of the program
pub fn explain_among_points(
    obstacles: &[Vec3],
    own: Option<usize>,
    query: &Query,
) -> Result<Explanation> {
    require_steps(query.tool.profile(), BY_POINTS)?;
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
