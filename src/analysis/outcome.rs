//! The answers of an analysis, and what follows from them.

use super::fixtures::KeptOut;
use super::placed::Placed;
use crate::Result;
use crate::access::Labels;
use crate::access::surface::Warning;
use crate::answers::{Definition, Rounding, SiteAnswers};
#[cfg(feature = "python")]
use crate::data::files::label_query::LabelQuery;
use crate::data::files::settings::{
    AnalysisSettings, Blocking, RegionSettings, StatedWarning, ToolSettings,
};
use crate::data::files::tools::Tool;
use crate::data::files::{LabelFile, Provenance};
use crate::findings::Findings;
use crate::findings::gate::SiteAreas;
use crate::geom::{Mesh, Sites};
use crate::report::coverage::Coverage;
use crate::tool::directions::Directions;
use serde::{Deserialize, Serialize};

/// The answers about one tool.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ToolOutcome {
    /// Per site.
    pub labels: Labels,
    /// What may make them misleading.
    pub warnings: Vec<Warning>,
    /// The regions out of reach.
    pub findings: Findings,
}

/// Every answer once, and what follows. Two are equal whatever [`Outcome::seconds`] they took.
#[derive(Debug)]
pub struct Outcome {
    pub(super) placed: Placed,
    pub(super) answers: Vec<ToolOutcome>,
    pub(super) of_all: Option<Findings>,
    pub(super) kept_out: Option<KeptOut>,
    pub(super) notices: Vec<String>,
    pub(super) seconds: [f64; 3],
}

impl Outcome {
    /// Name of the part.
    pub fn part(&self) -> &str {
        &self.placed.request.part
    }

    /// By which definition.
    pub fn definition(&self) -> Definition {
        self.placed.blocking.definition()
    }

    /// The tools.
    pub fn tools(&self) -> &[Tool] {
        &self.placed.request.tools
    }

    /// The directions that were tested.
    pub fn directions(&self) -> &Directions {
        &self.placed.directions
    }

    /// The answers, one for each of [`Outcome::tools`].
    pub fn answers(&self) -> &[ToolOutcome] {
        &self.answers
    }

    /// The whole surface of the part; none for a cloud.
    pub fn mesh(&self) -> Option<&Mesh> {
        self.placed.mesh.as_ref()
    }

    /// The sites; their faces are those of [`Outcome::mesh`].
    pub fn sites(&self) -> &Sites {
        &self.placed.sites
    }

    /// As [`Placed::shown`].
    pub fn shown(&self) -> (Option<&Mesh>, &Sites) {
        self.placed.shown()
    }

    /// Points of the surface that blocked beside the sites, if there were any.
    pub fn further_obstacles(&self) -> Option<&Sites> {
        self.placed.more.as_ref()
    }

    /// What each site stands for: by the published definition all for the same.
    ///
    /// # Errors
    /// As [`SiteAreas::of`].
    pub fn areas(&self) -> Result<SiteAreas> {
        let (mesh, sites) = self.shown();
        SiteAreas::by_definition(sites, mesh, self.definition() == Definition::Part)
    }

    /// Per tool, whether it reaches each site.
    pub fn accessible(&self) -> Vec<Vec<bool>> {
        self.answers.iter().map(|answer| answer.labels.answers.accessible()).collect()
    }

    /// The answers of each tool with its name.
    pub fn named(&self) -> impl Iterator<Item = (&str, &SiteAnswers)> {
        let answers = self.answers.iter().map(|answer| &answer.labels.answers);
        self.tools().iter().map(|tool| &*tool.name).zip(answers)
    }

    /// Whether each tool has a folder of its own.
    pub fn has_folders(&self) -> bool {
        self.placed.request.has_folders
    }

    /// What the tools reach together; `areas` are [`Outcome::areas`].
    pub fn coverage<'a>(&'a self, areas: &'a SiteAreas) -> Coverage<'a> {
        let labels: Vec<&Labels> = self.answers.iter().map(|answer| &answer.labels).collect();
        Coverage::of(self.tools(), &labels, self.directions().len(), areas)
    }

    /// Where no tool reaches.
    pub fn findings(&self) -> &Findings {
        self.of_all.as_ref().unwrap_or(&self.answers[0].findings)
    }

    /// What was left out, a sentence each.
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// What fixtures and table keep out of reach, if there are any.
    #[doc(hidden)] // of the program
    pub fn kept_out(&self) -> Option<&KeptOut> {
        self.kept_out.as_ref()
    }

    /// Seconds that sites, labels and findings took.
    pub fn seconds(&self) -> [f64; 3] {
        self.seconds
    }

    /// The bottom rule's tolerance, mm, if there is one.
    pub fn bottom_mm(&self) -> Option<f64> {
        self.placed.request.published.bottom_mm.filter(|_| self.definition() == Definition::Sites)
    }

    /// As [`Placed::region`].
    #[doc(hidden)] // of the program
    pub fn region(&self) -> Option<RegionSettings> {
        self.placed.region()
    }

    /// The file of a tool's answers.
    ///
    /// # Errors
    /// If a mesh has more triangles than an STL file can count.
    ///
    /// # Panics
    /// If there is no such tool.
    pub fn file(&self, tool: usize) -> Result<LabelFile> {
        let provenance = self.provenance(tool)?;
        let labels = self.answers[tool].labels.clone();
        let (sites, vertices) = (self.sites().clone(), self.placed.vertices.clone());
        Ok(LabelFile { provenance, sites, labels, vertices })
    }

    /// What decided the answers of a tool, as their file states it.
    pub(super) fn provenance(&self, tool: usize) -> Result<Provenance> {
        let of = &self.tools()[tool];
        Ok(Provenance {
            part: self.part().to_owned(),
            cutter: of.params,
            tool: of.words(),
            settings: self.settings(tool)?,
        })
    }

    /// What is wrong with fixtures and table, a sentence each.
    #[cfg(feature = "python")]
    pub(crate) fn placed_warnings(&self) -> &[String] {
        self.placed.warnings()
    }

    /// As [`Analysis::origin`](super::Analysis::origin).
    #[cfg(feature = "python")]
    pub(crate) fn origin(&self) -> Option<glam::DVec3> {
        self.placed.request.origin
    }

    /// The answers of a tool, to be explained.
    #[cfg(feature = "python")]
    pub(crate) fn query(&self, tool: usize) -> Result<LabelQuery> {
        let around = (self.mesh().cloned(), self.placed.fixtures());
        LabelQuery::of(self.file(tool)?, self.part().as_ref(), around)
    }

    fn settings(&self, tool: usize) -> Result<AnalysisSettings> {
        let Placed { request, blocking, directions, mesh, .. } = &self.placed;
        let is_by_mesh = *blocking == Blocking::Part;
        let fixtures = self.placed.fixtures();
        let has_occlusion = self.placed.has_occlusion();
        let (options, published) = (&request.options, &request.published);
        let (share, rounding, clearance_limit_mm) = match is_by_mesh {
            true => (options.share, Rounding::Ceil, options.clearance_limit_mm),
            false => (published.share, published.rounding, published.clearance_limit_mm),
        };
        let warnings = self.answers[tool].warnings.iter().map(StatedWarning::from);
        Ok(AnalysisSettings {
            sites: Some(request.site_settings()),
            region: self.region(),
            surface: Some(AnalysisSettings::surface_of(mesh.as_ref(), fixtures.as_ref())?),
            tool: Some(ToolSettings {
                of_library: Some(request.is_library),
                ..ToolSettings::of(&self.tools()[tool])
            }),
            directions: Some(directions.set().clone()),
            n_directions: Some(directions.len()),
            definition: Some(self.definition()),
            obstacles: request.obstacles.map(|_| *blocking),
            part_itself: is_by_mesh.then(|| request.part_settings()),
            warnings: Some(warnings.collect()),
            occlusion: Some(has_occlusion),
            occlusion_share: has_occlusion.then_some(share),
            occlusion_rounding: Some(rounding),
            bottom_mm: self.bottom_mm(),
            clearance_limit_mm,
            engine: Some(published.engine.name().into()),
            origin_mm: request.origin.map(|at| at.to_array()),
            ..AnalysisSettings::default()
        })
    }
}
