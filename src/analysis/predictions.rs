//! What a network predicts about the sites, and what is computed of it.

use super::observer::{Observer, Stage, report};
use super::placed::Placed;
use super::write::Files;
use crate::access::LabelOptions;
use crate::access::surface::SurfaceOptions;
use crate::answers::{Definition, SiteAnswers};
use crate::data::files::settings::VerifySettings;
use crate::data::files::tools::Tool;
use crate::data::files::{AnalysisSettings, PredictionFile, Provenance};
use crate::findings::Findings;
use crate::geom::Sites;
use crate::model::{Prediction, Predictor};
use crate::report::folder;
use crate::report::page::{Page, View};
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Which network predicts, and what is computed of its answers.
///
/// Where every site is computed, the answers of an untrained network are those of the labels:
///
/// ```
/// use deepmill::analysis::{Analysis, PredictRequest};
/// use deepmill::data::files::tools::Tool;
/// use deepmill::model::{Model, Predictor, UNetConfig};
/// use deepmill::{geom::solids, glam::DVec3};
///
/// let analysis = Analysis::new("block", solids::cuboid(DVec3::new(40.0, 30.0, 20.0)), vec![
///     Tool::new("3,20,20,20".parse()?, None, 0.0)?,
/// ]);
/// let analysis = analysis.n_sites(100).directions("up".parse()?);
/// let network = Predictor::new(Model::new(&UNetConfig::tiny(), 1)?);
/// let request = PredictRequest::new(network, "tiny").verify(0.0); // no answer may be wrong
/// let outcome = analysis.clone().place(&mut ())?.predict(&request, &mut ())?;
/// let exact = analysis.run(&mut ())?;
/// let answers = outcome.predictions()[0].file.answers();
/// assert_eq!(answers.inaccessible(), exact.answers()[0].labels.answers.inaccessible());
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct PredictRequest {
    predictor: Predictor,
    name: String,
    verify: Option<f64>,
    occlusion_share: f64,
}

impl PredictRequest {
    /// Of a network, with a name for files.
    pub fn new(predictor: Predictor, name: impl Into<String>) -> Self {
        let occlusion_share = LabelOptions::default().share;
        PredictRequest { predictor, name: name.into(), verify: None, occlusion_share }
    }

    /// Sites are computed, the least certain first, until at most this share of the other answers `inaccessible` is
    /// wrong, at a confidence of 95 % ([`TriangleObstacles::verify`]); 0: every site.
    ///
    /// [`TriangleObstacles::verify`]: crate::access::surface::TriangleObstacles::verify
    #[must_use]
    pub fn verify(self, bound: f64) -> Self {
        PredictRequest { verify: Some(bound), ..self }
    }

    /// Share of the sites that are marked as occlusion points; above 0, at most 1.
    #[must_use]
    pub fn occlusion_share(self, occlusion_share: f64) -> Self {
        PredictRequest { occlusion_share, ..self }
    }

    fn definition(&self) -> Option<Definition> {
        self.predictor.definition()
    }

    /// An error if there is a bound to verify, and the network or the part cannot be held against triangles.
    fn require_verifiable(&self, is_mesh: bool) -> Result<()> {
        let refused = |found| {
            let expected = "a mesh, and a network that was trained on the mesh definition";
            let remedy =
                "leave it out, or use `deepmill label`, which is exact and takes as little time";
            Err(Error::argument("verify", found, expected, remedy))
        };
        match self.definition() {
            _ if self.verify.is_none() => Ok(()),
            Some(Definition::Sites) => {
                refused("given with a network that was trained on the published definition")
            }
            _ if !is_mesh => refused("given with a cloud of points"),
            _ => Ok(()),
        }
    }
}

/// The tools that networks can know, and the others, named with the reason.
///
/// # Errors
/// If there is none of the first.
pub fn known_to_networks(tools: Vec<Tool>) -> Result<(Vec<Tool>, Vec<String>)> {
    let expected = "a ball end without clearance, shank as wide as the ball, in one cylindrical holder: the network knows no other";
    let is_known = |tool: &Tool| tool.clearance_mm == 0.0 && tool.cutter.as_ball_end().is_some();
    let (known, others): (Vec<Tool>, Vec<Tool>) = tools.into_iter().partition(is_known);
    if let (true, Some(tool)) = (known.is_empty(), others.first()) {
        let remedy = "leave out corner radius and clearance, or use `deepmill label`";
        return Err(Error::argument("cutter", tool.words(), expected, remedy));
    }
    let words = |tool: &Tool| {
        format!("{} ({}): expected {expected}; it is left out", tool.name, tool.words())
    };
    let others = others.iter().map(words).collect();
    Ok((known, others))
}

/// The predictions about one tool.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ToolPrediction {
    /// The tool.
    pub tool: Tool,
    /// Its file: logits, answers, what was computed.
    pub file: PredictionFile,
}

/// The predictions about every tool that the network knows.
#[derive(Debug)]
pub struct PredictionsOutcome {
    pub(super) placed: Placed,
    pub(super) predictions: Vec<ToolPrediction>,
    pub(super) warnings: Vec<String>,
    pub(super) seconds: [f64; 3],
}

impl Placed {
    /// Predicts the answers of every site for every tool; fixtures are not known to networks.
    ///
    /// # Errors
    /// If the network does not know the part or the only tool, or none of several; if a bound cannot be verified, the
    /// share of occlusion points is out of its domain, or the observer stops it.
    pub fn predict(
        self,
        request: &PredictRequest,
        observer: &mut dyn Observer,
    ) -> Result<PredictionsOutcome> {
        request.require_verifiable(self.mesh().is_some())?;
        let start = Instant::now();
        let mut settings = AnalysisSettings {
            sites: Some(self.request.site_settings()),
            model: Some(request.name.clone()),
            definition: request.definition(),
            origin_mm: self.request.origin.map(|at| at.to_array()),
            ..AnalysisSettings::default()
        };
        settings.verify = request.verify.map(|bound| {
            VerifySettings::new((bound, self.request.seed()), self.directions.set().clone())
        });
        let tools = &self.request.tools;
        let (mut predictions, mut warnings) = (Vec::new(), Vec::new());
        report(observer, Stage::Labels, (0, tools.len()))?;
        for (k, tool) in tools.iter().enumerate() {
            let of = if self.request.has_folders { &*format!("{}: ", tool.name) } else { "" };
            let predictor = &request.predictor;
            let prediction = match self.mesh() {
                Some(mesh) => predictor.predict_on(mesh, &self.sites, &tool.cutter),
                None => predictor.predict(&self.sites, &tool.cutter),
            };
            match prediction {
                Ok((prediction, outside)) => {
                    let outside: Vec<String> = outside.iter().map(ToString::to_string).collect();
                    warnings.extend(outside.iter().map(|outside| {
                        format!(
                            "{of}{outside}: the prediction may be wrong; `deepmill label` is exact"
                        )
                    }));
                    let file = self.file((tool, prediction), (&settings, outside), request);
                    predictions.push(ToolPrediction { tool: tool.clone(), file });
                }
                // One tool of several that is too far from what the network knows.
                Err(error @ Error::Argument { .. }) if self.request.has_folders => {
                    warnings.push(format!("{of}{error}; it is left out"));
                }
                Err(error) => return Err(error),
            }
            report(observer, Stage::Labels, (k + 1, tools.len()))?;
        }
        if predictions.is_empty() {
            let expected = "a tool like those that the network was trained on";
            let remedy = "label them exactly, or accept guesses (`allow_out_of_domain`; `--far` at the command line)";
            return Err(Error::argument("tools", "all left out", expected, remedy));
        }
        let predict_s = start.elapsed().as_secs_f64();
        let start = Instant::now();
        if let Some(bound) = request.verify {
            self.verify(&mut predictions, bound, request, observer)?;
        }
        Ok(PredictionsOutcome {
            predictions,
            warnings,
            seconds: [self.seconds(), predict_s, start.elapsed().as_secs_f64()],
            placed: self,
        })
    }

    fn file(
        &self,
        (tool, prediction): (&Tool, Prediction<f32>),
        (settings, outside): (&AnalysisSettings, Vec<String>),
        request: &PredictRequest,
    ) -> PredictionFile {
        let part = self.part();
        let mut provenance = Provenance::ball_end(part, tool.params, settings.clone());
        provenance.settings.outside_domain = Some(outside);
        if tool.description.is_some() {
            provenance.tool = tool.words();
        }
        PredictionFile {
            prediction,
            provenance,
            sites: self.sites.clone(),
            occlusion_share: Some(request.occlusion_share),
            verified: None,
        }
    }

    fn verify(
        &self,
        predictions: &mut [ToolPrediction],
        bound: f64,
        request: &PredictRequest,
        observer: &mut dyn Observer,
    ) -> Result<()> {
        let obstacles = self.require_triangles()?;
        let options =
            SurfaceOptions { share: request.occlusion_share, ..SurfaceOptions::default() };
        let n = predictions.len();
        report(observer, Stage::Verifying, (0, n))?;
        for (k, ToolPrediction { tool, file }) in predictions.iter_mut().enumerate() {
            let with = (&tool.cutter, &self.directions);
            let predicted = file.prediction.answers();
            let bound = (bound, self.request.seed());
            let verified = obstacles.verify(&self.sites, with, &options, &predicted, bound)?;
            file.verified = Some(verified);
            report(observer, Stage::Verifying, (k + 1, n))?;
        }
        Ok(())
    }
}

impl PredictionsOutcome {
    /// The part with its sites.
    pub fn placed(&self) -> &Placed {
        &self.placed
    }

    /// The definition that the network was trained on, if it is known.
    pub fn definition(&self) -> Option<Definition> {
        self.predictions.first().and_then(|of| of.file.provenance.settings.definition)
    }

    /// The predictions, of the tools that the network knows.
    pub fn predictions(&self) -> &[ToolPrediction] {
        &self.predictions
    }

    /// The answers of each tool with its name.
    pub fn named(&self) -> Vec<(&str, SiteAnswers)> {
        self.predictions.iter().map(|of| (&*of.tool.name, of.file.answers())).collect()
    }

    /// What may make the answers misleading, and tools that are left out, a sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Seconds that sites, predictions and verification took.
    pub fn seconds(&self) -> [f64; 3] {
        self.seconds
    }

    /// Whether each tool has a folder of its own.
    pub fn has_folders(&self) -> bool {
        self.placed.request.has_folders
    }

    /// Writes what `deepmill predict` writes; returns the paths. Every file is written under another name and then
    /// renamed.
    ///
    /// # Errors
    /// If the system refuses a file, or the observer stops it.
    pub fn write(
        &self,
        folder: &Path,
        files: &Files,
        observer: &mut dyn Observer,
    ) -> Result<Vec<PathBuf>> {
        let (mesh, sites) = self.placed.shown();
        let n = self.predictions.len();
        let mut paths = Vec::new();
        report(observer, Stage::Writing, (0, n))?;
        for (k, ToolPrediction { tool, file }) in self.predictions.iter().enumerate() {
            let folder = match self.has_folders() {
                true => folder.join(tool.folder()),
                false => folder.to_path_buf(),
            };
            paths.extend(folder::write_predictions(&folder, file, mesh, files.show())?);
            for extra in &files.also {
                paths.push(folder::export_predictions(&folder, file, mesh, *extra)?);
            }
            report(observer, Stage::Writing, (k + 1, n))?;
        }
        paths.extend(self.placed.write_surfaces(folder)?);
        if files.report {
            let view = |of: &ToolPrediction| self.view(of, sites);
            let views = &self.predictions.iter().map(view).collect::<Result<Vec<_>>>()?[..];
            let (part, unit) = (self.placed.part(), files.unit);
            let page = Page { part, mesh, sites, views, unit, outlines: &[] };
            paths.push(page.write(folder)?);
        }
        paths.push(self.write_record(folder)?);
        Ok(paths)
    }

    /// A tab of the page.
    fn view(&self, of: &ToolPrediction, sites: &Sites) -> Result<View> {
        let mesh = self.placed.shown().0;
        let mut findings = Findings::of(sites, mesh, &of.file.answers(), &[])?;
        findings.identify(&of.tool.name, self.placed.bounds());
        let mut view = View::of_predictions(&of.file, findings);
        if self.has_folders() {
            view.name.clone_from(&of.tool.name);
        }
        Ok(view)
    }
}
