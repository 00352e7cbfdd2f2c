//! The tabs of a page: one set of answers each.

use super::tool::ToolAt;
use crate::answers::{SiteAnswer, SiteAnswers};
use crate::data::files::{AnalysisSettings, LabelFile, PredictionFile, Provenance};
use crate::findings::Findings;
use crate::render::color::{LABELS, PART_ITSELF, layered};
use crate::report::folder::rest;
use crate::report::points::PointValues;
use crate::report::{Class, Coloring, DARK_AND_LIGHT, Rgb, folder};
use crate::tables::Table;
use serde_json::Value;

/// The name of rests in [`View::values`]; the script draws them in a section.
pub(super) const REST: &str = "rest";

/// One tab: answers about the sites of the page.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct View {
    /// Name of the tab.
    pub name: String,
    /// What is answered.
    pub caption: String,
    /// The cutter in words.
    pub tool: String,
    /// Names and colors of the groups, at most 16.
    pub classes: Vec<(String, Rgb)>,
    /// The group of each site.
    pub of: Vec<u8>,
    /// What can be shown upon the groups, and taken off.
    pub layer: Option<Layer>,
    /// Whether each site has another answer than in the version before, on a page that has one: they are outlined.
    #[doc(hidden)] // of live pages
    pub changed: Option<Vec<bool>>,
    /// Whether shares in the legend are of the sites, as the published definition has them, and not of the surface.
    pub counts_sites: bool,
    /// Numbers per site, shown where the pointer is.
    pub values: Vec<SiteValues>,
    /// Tables below the colors, each with its title.
    pub tables: Vec<(String, Table)>,
    /// The regions that are not accessible.
    pub findings: Option<Findings>,
    /// Options and inputs that decided the answers, as in the file.
    pub settings: Value,
    /// Warnings about them.
    pub warnings: Vec<String>,
    /// Where the tool is shown.
    pub(in crate::report) tool_at: ToolAt,
}

/// Marked sites in colors of their own, upon the groups: the shares of the groups do not depend on it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Layer {
    /// What the marks mean.
    pub name: String,
    /// Whether a site is marked.
    pub of: Vec<bool>,
    /// The color of the marked sites of each group.
    pub colors: Vec<Rgb>,
    /// Whether it is shown when the page opens.
    pub is_shown: bool,
}

/// A number for every site.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SiteValues {
    /// In words.
    pub name: &'static str,
    /// Unit, if it has one.
    pub unit: &'static str,
    /// The numbers.
    pub numbers: Numbers,
}

/// Counts or reals.
#[derive(Debug, Clone, PartialEq)]
pub enum Numbers {
    /// Whole numbers.
    Counts(Vec<u32>),
    /// Others; not a number where there is none.
    Reals(Vec<f32>),
}

impl View {
    /// Exact answers.
    pub fn of_labels(name: impl Into<String>, file: &LabelFile, findings: Findings) -> Self {
        let n = file.sites.len();
        let (labels, answers) = (&file.labels, &file.labels.answers);
        let occlusion = answers.occlusion.get(..n).unwrap_or_default();
        let mut view = View::about(name, &file.provenance);
        view.values = site_values(answers, n);
        view.tool_at = ToolAt::of_labels(file, false);
        if let Some(beta) = labels.beta.get(..n) {
            let beta = beta.iter().map(|b| *b as f32).collect();
            view.add("collisions with it, from inaccessible sites", "", Numbers::Reals(beta));
        }
        match &labels.surface {
            Some(surface) => {
                view.caption = "mesh definition: the part's triangles block".into();
                let of_sites = &answers.of_sites[..n];
                view.color(&Coloring::Surface { answers: of_sites, occlusion: &[], areas: &[] });
                view.mark(occlusion, &PART_ITSELF, folder::shows_occlusion(file));
                let open = surface.open_directions.iter().zip(of_sites);
                let open = open.map(|(open, answer)| match answer {
                    SiteAnswer::Accessible => f32::NAN,
                    _ => 100.0 * open,
                });
                view.add("directions not proven closed", "%", Numbers::Reals(open.collect()));
                let tolerance = surface.tolerance_mm.iter().map(|t| *t as f32).collect();
                view.add("contact tolerance", "mm", Numbers::Reals(tolerance));
            }
            None => {
                view.caption = "published definition: sites block".into();
                view.color_labels(&answers.inaccessible()[..n], occlusion);
            }
        }
        view.findings = Some(findings);
        view
    }

    /// The tabs of exact answers: the answers, and how much is left if that was computed.
    pub fn tabs_of_labels(name: &str, file: &LabelFile, findings: Findings) -> Vec<Self> {
        let answers = View::of_labels(name, file, findings);
        let rests = &file.labels.answers.rest_mm;
        if rests.is_empty() {
            return vec![answers];
        }
        let tool_at = ToolAt::of_labels(file, true);
        let mut rest = View { layer: None, tool_at, ..answers.clone() };
        (rest.name, rest.caption) = (format!("{name}: rest"), "how much the tool leaves".into());
        rest.color(&Coloring::Groups {
            classes: &rest::CLASSES,
            of: &rest::bands(rests),
            areas: &[],
        });
        vec![answers, rest]
    }

    /// Predicted answers.
    pub fn of_predictions(file: &PredictionFile, findings: Findings) -> Self {
        let answers = file.answers();
        let mut view = View::about("predicted", &file.provenance);
        view.caption = folder::origin(file);
        view.values = site_values(&answers, answers.len());
        if let Some(verified) = &file.verified {
            let verified = verified.verified.iter().map(|v| f32::from(u8::from(*v))).collect();
            view.add("computed (1) or predicted (0)", "", Numbers::Reals(verified));
        }
        view.color_labels(&answers.inaccessible(), &answers.occlusion);
        view.findings = Some(findings);
        view
    }

    /// Where predictions differ from exact answers, for both heads. Dark: over-predicted. Light: under-predicted.
    ///
    /// # Panics
    /// If labels and predictions differ in length; check with [`folder::same_sites`].
    pub fn of_differences(labels: &LabelFile, predictions: &PredictionFile) -> Vec<Self> {
        let (truth, predicted) = (&labels.labels.answers, predictions.answers());
        let n = labels.sites.len();
        let inaccessible = truth.inaccessible();
        let heads = [
            ("inaccessible", inaccessible.get(..n), predicted.inaccessible()),
            ("occlusion", truth.occlusion.get(..n), predicted.occlusion),
        ];
        let mut views = Vec::new();
        for ((head, truth, predicted), classes) in heads.into_iter().zip(DARK_AND_LIGHT) {
            let Some(truth) = truth else { continue };
            let mut view = View::about(format!("difference: {head}"), &predictions.provenance);
            view.caption = format!(
                "predicted against exact: {head}; dark over-predicted, light under-predicted"
            );
            let coloring = Coloring::Difference { positive: "", truth, predicted: &predicted };
            view.counts_sites = true;
            view.of = (0..n).map(|i| coloring.class(i) as u8).collect();
            view.classes = classes.map(|class| (class.name.to_string(), class.color)).into();
            views.push(view);
        }
        views
    }

    /// The first of several tools that reaches each site; `classes` and `of` as for a picture.
    pub fn of_first_tools(classes: &[Class], of: &[usize], findings: Findings) -> Self {
        let view = View::of_groups("all tools", "first tool that reaches", classes, of);
        View { findings: Some(findings), tool_at: ToolAt::FirstOfOthers, ..view }
    }

    /// Sites in groups; `classes` and `of` as for a picture.
    pub fn of_groups(
        name: impl Into<String>,
        caption: impl Into<String>,
        classes: &[Class],
        of: &[usize],
    ) -> Self {
        let mut view = View { name: name.into(), caption: caption.into(), ..View::default() };
        view.color(&Coloring::Groups { classes, of, areas: &[] });
        view
    }

    fn about(name: impl Into<String>, provenance: &Provenance) -> Self {
        let Provenance { tool, settings, .. } = provenance;
        let warnings = settings.warnings_in_words();
        let settings =
            AnalysisSettings { warnings: None, outside_domain: None, ..settings.clone() }.json();
        View { name: name.into(), tool: tool.clone(), settings, warnings, ..View::default() }
    }

    fn color(&mut self, coloring: &Coloring) {
        let class = |class: &Class| (class.name.to_string(), class.color);
        self.classes = coloring.classes().iter().map(class).collect();
        self.of = (0..coloring.len()).map(|i| coloring.class(i) as u8).collect();
    }

    /// Answers by the published definition, or predicted.
    fn color_labels(&mut self, inaccessible: &[bool], occlusion: &[bool]) {
        self.counts_sites = true;
        let (classes, _) = layered(&LABELS);
        self.classes = classes.iter().map(|class| (class.name.to_string(), class.color)).collect();
        self.of = inaccessible.iter().map(|yes| u8::from(*yes)).collect();
        self.mark(occlusion, &LABELS, true);
    }

    /// Adds the layer of occlusion points, if they are known.
    fn mark(&mut self, occlusion: &[bool], with_layer: &'static [Class<'static>], is_shown: bool) {
        let (name, of) = ("occlusion".to_string(), occlusion.to_vec());
        let (_, colors) = layered(with_layer);
        self.layer = (!of.is_empty()).then_some(Layer { name, of, colors, is_shown });
    }

    fn add(&mut self, name: &'static str, unit: &'static str, numbers: Numbers) {
        self.values.push(SiteValues { name, unit, numbers });
    }
}

/// The numbers of a folder's point file that are no flags; those are what the colors say.
fn site_values(answers: &SiteAnswers, n: usize) -> Vec<SiteValues> {
    let values = folder::point_values(answers, n).into_iter();
    let named = values.filter_map(|(name, values)| {
        let (name, unit, scale) = match name {
            "accessible_directions" => ("accessible directions", "", 1.0),
            "clearance" => ("clearance", "mm", 1.0),
            "rest" => (REST, "mm", 1.0),
            "probability_inaccessible" => ("probability, inaccessible", "%", 100.0),
            "probability_occlusion" => ("probability, occlusion", "%", 100.0),
            _ => return None,
        };
        let numbers = match values {
            PointValues::Counts(counts) => Numbers::Counts(counts.to_vec()),
            PointValues::Reals(reals) => Numbers::Reals(reals.iter().map(|x| x * scale).collect()),
            PointValues::Flags(_) | PointValues::Are(..) | PointValues::LargeCounts(_) => {
                return None;
            }
        };
        Some(SiteValues { name, unit, numbers })
    });
    named.collect()
}
