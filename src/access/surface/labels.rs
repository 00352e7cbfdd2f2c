//! What to compute by the mesh definition, and what comes out.

use super::tolerance::{ContactTolerance, LEAST_MM};
use super::tool::{Outline, axes};
use super::verdict::Verdict;
use crate::access::evidence::{SurfaceEvidence, WitnessPose};
use crate::access::labels::Labels;
use crate::answers::{SiteAnswer, SiteAnswers};
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// What to compute.
///
/// ```
/// use deepmill::access::surface::{RefinementOptions, SurfaceOptions};
/// let search = RefinementOptions::default().with_prove(false);
/// let options = SurfaceOptions::default().with_refinement(Some(search)).with_clearance_limit_mm(Some(1.0));
/// assert_eq!(options.finish_mm, SurfaceOptions::default().finish_mm);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct SurfaceOptions {
    /// How deep the tool may seem to cut: by this it is shrunk.
    pub tolerance: ContactTolerance,
    /// How much may remain at a site that counts as reached, mm; [`FINISH_MM`] by default.
    pub finish_mm: f64,
    /// Count directions exactly (default); otherwise a site is done with its first accessible direction.
    pub counts: bool,
    /// Also count β and mark occlusion points (default); not for volume queries.
    pub occlusion: bool,
    /// Return β of these (default). Otherwise it is counted only for sites that may be occlusion points, in less time.
    pub beta: bool,
    /// Share of the sites that are occlusion points, in (0, 1].
    pub share: f64,
    /// Search between the directions of an even set for sites that none of them reaches (default).
    pub refinement: Option<RefinementOptions>,
    /// Also compute the signed clearance, up to this many mm either way.
    pub clearance_limit_mm: Option<f64>,
    /// Points of the surface that are tested before the triangles.
    #[doc(hidden)] // answers do not depend on it
    #[serde(skip)]
    pub n_samples: usize,
}

setters!(SurfaceOptions {
    with_tolerance(tolerance: ContactTolerance),
    with_finish_mm(finish_mm: f64),
    with_counts(counts: bool),
    with_occlusion(occlusion: bool),
    with_beta(beta: bool),
    with_share(share: f64),
    with_refinement(refinement: Option<RefinementOptions>),
    with_clearance_limit_mm(clearance_limit_mm: Option<f64>),
    #[doc(hidden)]
    with_n_samples(n_samples: usize),
});

/// How far the search between the directions goes: see `docs/mesh-definition.md`.
///
/// ```
/// use deepmill::access::surface::RefinementOptions;
/// let more = RefinementOptions::default();
/// let more = more.with_n_kept(2 * more.n_kept);
/// assert!(more.n_kept > RefinementOptions::default().n_kept);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RefinementOptions {
    /// Most cells of directions that are cut in four at every level, for one site.
    pub n_kept: usize,
    /// Levels of cells, at most 8: 64 cells on the upper half at the first, four times as many at every further one.
    #[doc(hidden)] // chosen by measurement
    pub n_levels: usize,
    /// Also look for proofs that nothing is open: tens of times the cost.
    pub prove: bool,
}

setters!(RefinementOptions {
    with_n_kept(n_kept: usize),
    #[doc(hidden)]
    with_n_levels(n_levels: usize),
    with_prove(prove: bool),
});

impl Default for RefinementOptions {
    fn default() -> Self {
        RefinementOptions { n_kept: 32, n_levels: DEFAULT_LEVELS, prove: false }
    }
}

impl RefinementOptions {
    /// A longer search, for proofs that the sites found inaccessible are so in every direction.
    pub fn proving() -> Self {
        RefinementOptions { n_kept: 1024, n_levels: DEFAULT_LEVELS + 2, prove: true }
    }
}

/// Chosen by measurement. The cells of the last level are as wide as 16,000 even directions on the upper half are
/// apart.
pub(super) const DEFAULT_LEVELS: usize = 5;
/// 2²⁰ cells on the upper half.
const MOST_LEVELS: usize = 8;

/// Chosen by measurement.
const N_SAMPLES: usize = 20_000;

impl Default for SurfaceOptions {
    fn default() -> Self {
        SurfaceOptions {
            tolerance: ContactTolerance::default(),
            finish_mm: FINISH_MM,
            counts: true,
            occlusion: true,
            beta: true,
            share: 0.1,
            refinement: Some(RefinementOptions::default()),
            clearance_limit_mm: None,
            n_samples: N_SAMPLES,
        }
    }
}

/// Most samples of the surface per site, for few sites: turning more costs more than it saves.
const SAMPLES_OF_SITE: usize = 8;

impl SurfaceOptions {
    /// For the answers of a few sites alone.
    pub(crate) fn for_few(&self, n_sites: usize) -> Self {
        SurfaceOptions {
            counts: false,
            occlusion: false,
            clearance_limit_mm: None,
            n_samples: self.n_samples.min(SAMPLES_OF_SITE * n_sites),
            ..*self
        }
    }

    /// Whether they can be.
    ///
    /// # Errors
    /// If one of them is outside of its domain.
    pub fn check(&self) -> Result<()> {
        if self.n_samples > MAX_SAMPLES {
            let expected = format!("at most {MAX_SAMPLES}");
            return Err(Error::argument("samples", self.n_samples, expected, "20,000 are plenty"));
        }
        if let Some(n) = self.refinement.map(|r| r.n_levels).filter(|n| *n > MOST_LEVELS) {
            let expected = format!("at most {MOST_LEVELS}");
            return Err(Error::argument("levels of cells", n, expected, "5 are the default"));
        }
        if let Some(limit) = self.clearance_limit_mm.filter(|c| !(*c > 0.0 && *c < f64::INFINITY)) {
            let remedy = "give the greatest clearance of interest in mm";
            return Err(Error::argument("clearance limit", limit, "a positive length", remedy));
        }
        if !(self.finish_mm > 0.0 && self.finish_mm <= MOST_FINISH_MM) {
            let expected = format!("positive, at most {MOST_FINISH_MM} mm");
            let remedy =
                "give how much may remain at a site that counts as reached, 0.01 mm by default";
            return Err(Error::argument("finish tolerance", self.finish_mm, expected, remedy));
        }
        if self.share > 0.0 && self.share <= 1.0 {
            return Ok(());
        }
        let expected = "above 0, at most 1";
        Err(Error::argument("occlusion share", self.share, expected, "the paper uses 0.1"))
    }
}

/// The finish tolerance by default, mm.
pub const FINISH_MM: f64 = LEAST_MM;
/// What clearances are exact to, mm.
pub const CLEARANCE_STEP_MM: f64 = 1e-4;
/// Answers that a lesser change of the tolerance turns, mm, are left to rounding.
pub const BORDERLINE_MM: f64 = 1e-6;

const MAX_SAMPLES: usize = 100_000_000;
/// More than any finish, mm.
const MOST_FINISH_MM: f64 = 10.0;

/// Answers by the mesh definition, in the order of the queries, without β.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct SurfaceLabels {
    /// Per query.
    pub answers: Vec<SiteAnswer>,
    /// Per query: directions in which no step penetrates the part and the tip fits; empty if not counted.
    pub accessible_directions: Vec<u32>,
    /// Per query, mm: how far the margin about what of the shrunk cutter does not cut may grow before the query becomes
    /// inaccessible (positive), or every step must shrink before it is not any more (negative), within the limit of the
    /// options and to 1e-4 mm; over the directions of the set and the witness. Empty without that option.
    pub clearance_mm: Vec<f32>,
    pub evidence: SurfaceEvidence,
}

impl SurfaceLabels {
    /// Per query, whether no direction is collision-free.
    pub fn inaccessible(&self) -> Vec<bool> {
        self.answers.iter().map(|answer| *answer == SiteAnswer::Inaccessible).collect()
    }

    /// Share of the queries with this answer; 0 if there are none.
    pub fn share(&self, answer: SiteAnswer) -> f64 {
        let n = self.answers.iter().filter(|other| **other == answer).count();
        n as f64 / self.answers.len().max(1) as f64
    }

    /// As labels without β.
    pub fn into_labels(self) -> Labels {
        let SurfaceLabels { answers, accessible_directions, clearance_mm, evidence } = self;
        let direction = |pose: &Option<WitnessPose>| Some(pose.as_ref()?.direction);
        let answers = SiteAnswers {
            accessible_directions,
            witness: evidence.witness.iter().map(direction).collect(),
            clearance_mm,
            ..SiteAnswers::by_mesh(answers)
        };
        let answers = answers.with_shares_of(evidence.n_directions);
        Labels { answers, surface: Some(evidence), ..Labels::default() }
    }
}

impl WitnessPose {
    /// Of a tool with its reference point there.
    pub(super) fn new(outline: &Outline, reference: DVec3, direction: Vec3) -> Self {
        WitnessPose { direction, tip_mm: reference - axes(direction)[2] * outline.above_tip() }
    }

    /// The reference point of the tool.
    pub(super) fn reference(&self, outline: &Outline) -> DVec3 {
        self.tip_mm + axes(self.direction)[2] * outline.above_tip()
    }
}

/// Directions of a query in the order they were tested.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tally {
    pub collision_free: u32,
    pub accessible: u32,
    pub witness: Option<WitnessPose>,
    /// Whether a direction between those of the set is collision-free.
    pub free_between: bool,
    /// See [`SurfaceEvidence::open_directions`].
    pub open: f32,
}

impl Tally {
    /// Notes the verdict in a direction of the set, with a free pose if there is one.
    pub fn add(&mut self, pose: Option<WitnessPose>, verdict: Verdict) {
        self.collision_free += u32::from(verdict != Verdict::Collides);
        if verdict == Verdict::Free {
            self.accessible += 1;
            self.witness = self.witness.or(pose);
        }
    }

    /// Notes a pose that was found by search in a direction of the set, where no own pose is free.
    pub fn found(&mut self, pose: WitnessPose) {
        (self.accessible, self.witness) = (1, Some(pose));
        self.collision_free = self.collision_free.max(1);
    }

    pub fn answer(&self) -> SiteAnswer {
        match self {
            Tally { witness: Some(_), .. } => SiteAnswer::Accessible,
            Tally { collision_free: 0, free_between: false, .. } => SiteAnswer::Inaccessible,
            _ => SiteAnswer::TipDoesNotFit,
        }
    }
}
