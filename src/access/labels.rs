//! Options and results of labeling.

use super::evidence::SurfaceEvidence;
use super::matrix::CollisionMatrix;
use super::points::bottom::bottom_sites;
use super::points::stats::Stats;
use crate::answers::{Rounding, SiteAnswers};
use crate::simd::Isa;
use crate::tool::cutter::ToolPart;
use crate::{Error, Result};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// How labels are computed. All engines give the same labels and counts, bit for bit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Engine {
    /// Plain loops in plain order: the reference that the other engines must equal.
    Reference,
    /// The same tests, a vector at a time.
    Batched,
    /// Heights, rasters and runs of obstacles decide most queries, the same tests the rest.
    #[default]
    Pruned,
}

impl Engine {
    /// Every engine, slowest first.
    pub const ALL: [Engine; 3] = [Engine::Reference, Engine::Batched, Engine::Pruned];

    /// `reference`, `batched` or `pruned`.
    pub fn name(self) -> &'static str {
        match self {
            Engine::Reference => "reference",
            Engine::Batched => "batched",
            Engine::Pruned => "pruned",
        }
    }
}

impl fmt::Display for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Reads a [name](Engine::name).
impl FromStr for Engine {
    type Err = Error;

    /// # Errors
    /// If no engine has it.
    fn from_str(name: &str) -> Result<Self> {
        Engine::ALL.into_iter().find(|engine| engine.name() == name).ok_or_else(|| {
            let expected = Engine::ALL.map(Engine::name).join(" or ");
            Error::argument("engine", name, expected, "all engines give the same labels")
        })
    }
}

/// What to compute.
///
/// ```
/// use deepmill::access::{Engine, LabelOptions};
/// let options = LabelOptions::default().with_occlusion(false).with_engine(Engine::Reference);
/// assert_eq!(options.share, 0.1); // as by default
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct LabelOptions {
    /// The engine; pruned by default.
    pub engine: Engine,
    /// Also mark occlusion points (default). Costs several times the labels alone.
    pub occlusion: bool,
    /// Return β (default). Otherwise the pruned engine counts it only for obstacles that may be occlusion points, and
    /// marks these in less time; [`Labels::stats`] then leaves β out.
    pub beta: bool,
    /// Share of the ranked obstacles that are occlusion points, in (0, 1]; the paper's is 0.1.
    pub share: f64,
    /// How many obstacles that share is; [`Rounding::Ceil`] by default, [`Rounding::Floor`] in the published
    /// definition.
    pub rounding: Rounding,
    /// The bottom rule: sites lower than the lowest plus so many mm are labeled accessible, and are not ranked as
    /// occlusion points. `None` (default): no such rule; points of space have none either. The published definition has
    /// 1 mm.
    pub bottom_mm: Option<f64>,
    /// Also keep the answer for every direction and query, one bit each.
    pub collision_matrix: bool,
    /// Also compute the signed clearance, up to this many mm either way. Costs tens of times the labels.
    pub clearance_limit_mm: Option<f64>,
    /// Instruction set of the kernels; results do not depend on it.
    #[doc(hidden)] // for tests and benches
    #[serde(skip)]
    pub isa: Isa,
}

setters!(LabelOptions {
    with_engine(engine: Engine),
    with_occlusion(occlusion: bool),
    with_beta(beta: bool),
    with_share(share: f64),
    with_rounding(rounding: Rounding),
    with_bottom_mm(bottom_mm: Option<f64>),
    with_collision_matrix(collision_matrix: bool),
    with_clearance_limit_mm(clearance_limit_mm: Option<f64>),
    #[doc(hidden)]
    with_isa(isa: Isa),
});

impl Default for LabelOptions {
    fn default() -> Self {
        LabelOptions {
            engine: Engine::Pruned,
            occlusion: true,
            beta: true,
            share: 0.1,
            rounding: Rounding::Ceil,
            bottom_mm: None,
            collision_matrix: false,
            clearance_limit_mm: None,
            isa: Isa::active(),
        }
    }
}

/// Tolerance of the published bottom rule, mm.
pub const BOTTOM_MM: f64 = 1.0;

impl LabelOptions {
    /// Those of the published definition: bottom rule of 1 mm, shares rounded down. Its directions are
    /// [`Directions::published`](crate::tool::directions::Directions::published).
    pub fn published() -> Self {
        LabelOptions {
            rounding: Rounding::Floor,
            bottom_mm: Some(BOTTOM_MM),
            ..LabelOptions::default()
        }
    }

    /// The number of occlusion points among these sites (mm), if enough of them collide at all.
    pub fn n_occlusion(&self, points: &[Vec3]) -> usize {
        let n_bottom = self.bottom_mm.map_or(0, |bottom_mm| {
            bottom_sites(points, bottom_mm).into_iter().filter(|at_bottom| *at_bottom).count()
        });
        self.rounding.n_of_share(self.share, points.len() - n_bottom)
    }

    pub(super) fn check(&self) -> Result<()> {
        if !(self.share > 0.0 && self.share <= 1.0) {
            let expected = "above 0, at most 1";
            let remedy = "the paper uses 0.1";
            return Err(Error::argument("occlusion share", self.share, expected, remedy));
        }
        if let Some(bottom_mm) = self.bottom_mm.filter(|mm| !(0.0..f64::INFINITY).contains(mm)) {
            let remedy = "the published definition has 1 mm";
            return Err(Error::argument("bottom", bottom_mm, "a length of 0 mm or more", remedy));
        }
        match self.clearance_limit_mm {
            Some(limit) if !(limit > 0.0 && limit < f64::INFINITY) => {
                let remedy = "give the greatest clearance of interest in mm";
                Err(Error::argument("clearance limit", limit, "a positive length", remedy))
            }
            _ => Ok(()),
        }
    }
}

/// Exact labels of a set of queries: the answers, and what they rest on. Lists follow the order of queries or obstacles
/// as given.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Labels {
    /// Per query, what any engine answers.
    pub answers: SiteAnswers,
    /// Per query: the first direction of the set without collision; empty by the mesh definition, where
    /// [`SiteAnswers::witness`] may lie between the directions of the set.
    pub witness: Vec<Option<u32>>,
    /// Per obstacle: pairs (inaccessible query, direction) it collides in; empty if not wanted.
    pub beta: Vec<u64>,
    /// The answer per direction and query, if wanted.
    pub collision_matrix: Option<CollisionMatrix>,
    /// What only the mesh definition gives; `None` by the published definition.
    pub surface: Option<SurfaceEvidence>,
    /// Per query: the part of the tool that blocks in the direction which gets furthest; empty if not wanted
    /// ([`surface::explain`](super::surface::explain)).
    pub blocked_by: Vec<Option<ToolPart>>,
    /// What the engine did.
    #[doc(hidden)] // counts for benches
    pub stats: Stats,
}

impl Labels {
    /// Gives clearances the sign of the collisions where rounding left it open.
    pub(super) fn settle_signs(&mut self) {
        let answers = &mut self.answers;
        for (c, &n_free) in answers.clearance_mm.iter_mut().zip(&answers.accessible_directions) {
            *c = if n_free == 0 { c.min(0.0) } else { c.max(0.0) };
        }
    }
}
