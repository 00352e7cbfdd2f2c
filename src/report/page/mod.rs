//! The HTML report: one file with a 3-D view, the findings and every setting, which opens without a network.
//!
//! [`Page::html`] writes what any browser reads without a script (tables, findings, warnings) and one block of numbers
//! for the 3-D view, which is WebGL 2 (`assets/*.js`, no library). `docs/report.md` says what the page shows and how it
//! is made.

mod html;
mod live;
mod pack;
mod tool;
mod view;

#[doc(hidden)] // of the program
pub use live::LivePage;
pub use view::{Layer, Numbers, SiteValues, View};

use crate::exec::memory::product;
use crate::findings::FINDING_JSON_BYTES;
use crate::geom::spacing::{Spacing, areas_on};
use crate::geom::units::Unit;
use crate::geom::{Mesh, Sites, check};
use crate::render::memory::PartSize;
use crate::storage::atomic_file;
use crate::{Error, Result};
use glam::DVec3;
use pack::{Block, Grid};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Name of the file in a folder of results.
pub const REPORT: &str = "report.html";
/// With more tabs, sites carry no numbers but their answer.
const MAX_DETAILED: usize = 8;
/// Groups that the view has colors for.
const MAX_CLASSES: usize = 16;

/// What a page shows.
#[derive(Debug, Clone, Copy)]
pub struct Page<'a> {
    /// Name of the part.
    pub part: &'a str,
    /// The surface, mm; without it sites are drawn as discs.
    pub mesh: Option<&'a Mesh>,
    /// The sites of all tabs, mm.
    pub sites: &'a Sites,
    /// The tabs, at least one.
    pub views: &'a [View],
    /// Of lengths and areas.
    pub unit: Unit,
    /// Outlines of what blocks beside the part, mm ([`outlines`](crate::render::outlines)).
    pub outlines: &'a [[DVec3; 2]],
}

impl Page<'_> {
    /// Writes `report.html`; returns its path.
    ///
    /// # Errors
    /// As [`Page::html`], or if the system refuses the file.
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        let (path, html) = (folder.join(REPORT), self.html()?);
        atomic_file::write_atomic(&path, |file| file.write_all(html.as_bytes()))?;
        Ok(path)
    }

    /// The page; the same input gives the same bytes.
    ///
    /// # Errors
    /// If the sites fail [`Sites::check`], a tab has not one group per site and at most 16 groups, or the page does not
    /// fit into the memory.
    pub fn html(&self) -> Result<String> {
        self.document(None)
    }

    /// The page; with a version and its number among all pages, one that follows its server.
    fn document(&self, live: Option<[u64; 2]>) -> Result<String> {
        self.sites.check()?;
        let n = self.sites.len();
        for view in self.views {
            let is_known = |class: &u8| usize::from(*class) < view.classes.len();
            let layer = view.layer.as_ref();
            let is_marked = layer
                .is_none_or(|l| l.of.len() == n && l.colors.len() == view.classes.len())
                && view.changed.as_ref().is_none_or(|changed| changed.len() == n);
            let n_colors = view.classes.len() + layer.map_or(0, |layer| layer.colors.len());
            if view.of.len() != n
                || !is_marked
                || n_colors > MAX_CLASSES
                || !view.of.iter().all(is_known)
            {
                let found = format!("{} sites in {} groups", view.of.len(), view.classes.len());
                let remedy = "give every site one of at most 16 groups";
                return Err(Error::argument("tab", found, format!("{n} sites"), remedy));
            }
        }
        self.require_memory()?;
        let areas = areas_on(self.sites, self.mesh)?;
        let (about, block) = self.data();
        Ok(html::document(self, &areas, html::Script { about, block: block.base64(), live }))
    }

    fn require_memory(&self) -> Result<()> {
        let of_findings = |view: &View| usize::from(view.findings.is_some()) * 4;
        let of_values = |view: &View| if self.is_detailed() { 4 * view.values.len() } else { 0 };
        let of_tool = |view: &View| if view.tool_at.is_somewhere() { tool::SITE_BYTES } else { 0 };
        let of_site =
            (self.views.iter()).map(|view| 2 + of_findings(view) + of_values(view) + of_tool(view));
        let n_number_bytes = self.sites.len().saturating_mul(of_site.sum());
        let findings = self.views.iter().flat_map(|view| &view.findings);
        let n_findings = findings.map(|findings| findings.list.len()).sum();
        let findings_bytes = product([n_findings, FINDING_JSON_BYTES]);
        PartSize::of(self.mesh, self.sites).require_for_page(n_number_bytes, findings_bytes)
    }

    fn is_detailed(&self) -> bool {
        self.views.len() <= MAX_DETAILED
    }

    /// What the script reads: a description, and the block of numbers.
    fn data(&self) -> (Value, Block) {
        let (low, high) = self.bounds();
        let grid = Grid::over(low, high);
        let mut block = Block::default();
        let [n_vertices, n_triangles] =
            self.mesh.map_or([0, 0], |mesh| block.add_mesh(&grid, mesh));
        let sites = self.sites;
        let places = sites.points.iter().map(|p| p.as_dvec3());
        block.add_points("sites", &grid, places, sites.normals.iter().copied());
        let mut tools = Vec::new();
        let mut views = Vec::with_capacity(self.views.len());
        for (v, view) in self.views.iter().enumerate() {
            let mut about = add_view(&mut block, v, view, self.is_detailed());
            about["pose"] = view.tool_at.add(&mut block, v, sites, &mut tools);
            views.push(about);
        }
        let spacing_mm = match self.mesh {
            Some(mesh) => (mesh.area() / sites.len().max(1) as f64).sqrt(),
            None => Spacing::measure_on_sheet(sites).map_or(0.0, |s| s.mean_mm),
        };
        let unit = self.unit;
        let about = json!({
            "low_mm": grid.low.to_array(),
            "step_mm": grid.step_mm,
            "low_box_mm": self.outlines.iter().flatten().fold(low, |low, p| low.min(*p)).to_array(),
            "high_box_mm": self.outlines.iter().flatten().fold(high, |high, p| high.max(*p)).to_array(),
            "unit": { "name": unit.symbol(), "mm": unit.millimeters() },
            "n_vertices": n_vertices,
            "n_triangles": n_triangles,
            "n_sites": sites.len(),
            "spacing_mm": if spacing_mm > 0.0 { spacing_mm } else { 1.0 },
            "closed": self.mesh.is_some_and(|mesh| check::check(mesh).is_closed()),
            "views": views,
            "tools": tools,
            "outlines": self.outlines.iter().flatten().map(|p| p.to_array().map(to_micron)).collect::<Vec<_>>(),
            "parts": block.parts(),
        });
        (about, block)
    }

    /// The box about the surface and the sites.
    fn bounds(&self) -> (DVec3, DVec3) {
        let of_mesh = self.mesh.and_then(Mesh::bounds).into_iter().flat_map(|(l, h)| [l, h]);
        let points = of_mesh.chain(self.sites.points.iter().map(|p| p.as_dvec3()));
        points
            .map(|p| (p, p))
            .reduce(|(low, high), (p, _)| (low.min(p), high.max(p)))
            .unwrap_or_default()
    }
}

/// A length, mm, to the micrometer.
fn to_micron(mm: f64) -> f64 {
    (mm * 1e3).round() / 1e3
}

/// Adds the numbers of tab `v`; returns what the script must know of it.
fn add_view(block: &mut Block, v: usize, view: &View, detailed: bool) -> Value {
    block.add(format!("view{v}.class"), &view.of);
    if let Some(changed) = &view.changed {
        let changed: Vec<u8> = changed.iter().map(|changed| u8::from(*changed)).collect();
        block.add(format!("view{v}.changed"), &changed);
    }
    let layer = view.layer.as_ref().map(|layer| {
        let marks: Vec<u8> = layer.of.iter().map(|mark| u8::from(*mark)).collect();
        block.add(format!("view{v}.layer"), &marks);
        json!({ "name": layer.name, "colors": layer.colors, "shown": layer.is_shown })
    });
    if let Some(findings) = &view.findings {
        block.add_words(format!("view{v}.finding"), findings.of_site.iter().copied());
    }
    let mut values = Vec::new();
    for (k, value) in view.values.iter().enumerate().take(if detailed { usize::MAX } else { 0 }) {
        let name = format!("view{v}.value{k}");
        match &value.numbers {
            Numbers::Counts(counts) => block.add_words(name, counts.iter().copied()),
            Numbers::Reals(reals) => block.add_words(name, reals.iter().map(|x| pack::rounded(*x))),
        }
        let real = matches!(value.numbers, Numbers::Reals(_));
        values.push(json!({ "name": value.name, "unit": value.unit, "real": real }));
    }
    let findings = view.findings.as_ref().map(|found| {
        let of = |f: &crate::findings::Finding| {
            json!({
                "id": f.id,
                "area_mm2": f.area_mm2,
                "at_mm": f.at_mm.to_array(),
                "low_mm": f.low_mm.to_array(),
                "high_mm": f.high_mm.to_array(),
                "normal": f.normal.to_array(),
            })
        };
        found.list.iter().map(of).collect::<Vec<_>>()
    });
    let class = |(name, color): &(String, [u8; 3])| json!({ "name": name, "color": color });
    json!({
        "name": view.name,
        "classes": view.classes.iter().map(class).collect::<Vec<_>>(),
        "layer": layer,
        "values": values,
        "has_changes": view.changed.is_some(),
        "has_findings": view.findings.is_some(),
        "findings": findings.unwrap_or_default(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::SiteAnswers;
    use crate::data::files::settings::{PartSettings, StatedWarning};
    use crate::data::files::{AnalysisSettings, LabelFile, PredictionFile, Provenance};
    use crate::findings::Findings;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids::cuboid;
    use crate::model::Prediction;
    use crate::tool::cutter::CutterParams;

    const HOSTILE: &str = "a</script><script>alert(1)</script>\"'<b>&amp;<!--";

    fn files() -> (Mesh, LabelFile, PredictionFile) {
        let mesh = cuboid(DVec3::new(30.0, 20.0, 10.0));
        let sites = sample(&mesh, &SiteOptions { n_sites: 300, ..SiteOptions::default() }).unwrap();
        let cutter = CutterParams::from_array([1.0, 2.0, 3.0, 4.0]);
        let settings = AnalysisSettings {
            model: Some(HOSTILE.into()),
            warnings: Some(vec![StatedWarning { words: HOSTILE.into(), warning: None }]),
            part_itself: Some(PartSettings {
                fixtures: vec!["one".into(), "two".into()],
                ..PartSettings::default()
            }),
            ..AnalysisSettings::default()
        };
        let mut provenance = Provenance::ball_end(HOSTILE, cutter, settings);
        provenance.tool = HOSTILE.into();
        let inaccessible: Vec<bool> = sites.normals.iter().map(|n| n.z < -0.5).collect();
        let mut answers = SiteAnswers::new(inaccessible, vec![false; 300]);
        answers.accessible_directions = (0..300).collect();
        let labels = crate::access::Labels { answers, ..Default::default() };
        let logits: Vec<[f32; 2]> =
            (0..300).map(|i| [0.0, if i % 2 == 0 { 1.0 } else { -1.0 }]).collect();
        let prediction = Prediction {
            logits_inaccessible: logits.clone(),
            logits_occlusion: logits,
            ..Prediction::default()
        };
        let file = PredictionFile {
            provenance: provenance.clone(),
            sites: sites.clone(),
            prediction,
            occlusion_share: None,
            verified: None,
        };
        (mesh, LabelFile { provenance, sites, labels, vertices: None }, file)
    }

    fn views(mesh: &Mesh, labels: &LabelFile, predictions: &PredictionFile) -> Vec<View> {
        let of =
            |answers: &SiteAnswers| Findings::of(&labels.sites, Some(mesh), answers, &[]).unwrap();
        let mut views = vec![View::of_labels(HOSTILE, labels, of(&labels.labels.answers))];
        views.push(View::of_predictions(predictions, of(&predictions.answers())));
        views.extend(View::of_differences(labels, predictions));
        views
    }

    fn of<'a>(mesh: Option<&'a Mesh>, sites: &'a Sites, views: &'a [View]) -> Page<'a> {
        Page { part: "p", mesh, sites, views, unit: Unit::Millimeter, outlines: &[] }
    }

    #[test]
    fn strings_of_the_user_stay_text() {
        let (mesh, labels, predictions) = files();
        let views = views(&mesh, &labels, &predictions);
        let part = &labels.provenance.part;
        let page = Page {
            part,
            mesh: Some(&mesh),
            sites: &labels.sites,
            views: &views,
            unit: Unit::Millimeter,
            outlines: &[],
        };
        let html = page.html().unwrap();
        assert!(!html.contains("alert(1)</script>") && !html.contains("<b>&amp;<"), "markup");
        let text = "a&lt;/script&gt;&lt;script&gt;alert(1)&lt;/script&gt;&quot;&#39;&lt;b&gt;&amp;amp;&lt;!--";
        // Title, heading, two tabs' tools, the tab's name, settings and warnings.
        assert!(html.matches(text).count() >= 6, "{}", html.matches(text).count());
        assert_eq!(html.matches("<script").count(), html.matches("</script>").count());
        let about = html.split("id=\"about\" type=\"application/json\">").nth(1).unwrap();
        let about = about.split("</script>").next().unwrap();
        let about: Value = serde_json::from_str(about).unwrap();
        assert_eq!(about["views"][0]["name"], HOSTILE);
        assert_eq!((&about["n_sites"], &about["n_triangles"]), (&json!(300), &json!(12)));
        assert_eq!(html, page.html().unwrap(), "the same bytes");
    }

    #[test]
    fn nothing_is_loaded_from_elsewhere() {
        let (mesh, labels, predictions) = files();
        let views = views(&mesh, &labels, &predictions);
        let page = of(None, &labels.sites, &views);
        let html = page.html().unwrap();
        let calls = ["http:", "https:", "src=\"", "import ", "url(", "<link", "fetch("];
        assert!(calls.iter().all(|call| !html.contains(call)), "{calls:?}");
        assert!(html.contains("default-src 'none'"));
    }

    #[test]
    fn outlines_of_fixtures_are_on_the_page_with_a_box_that_hides_them() {
        let (mesh, labels, predictions) = files();
        let views = views(&mesh, &labels, &predictions);
        let page = of(Some(&mesh), &labels.sites, &views);
        let drawn = |html: &str| html.contains("<svg id=\"outlines\"");
        assert!(!drawn(&page.html().unwrap()));
        let outlines = [[DVec3::new(-50.0, 0.0, 1.23456), DVec3::ZERO]];
        let html = Page { outlines: &outlines, ..page }.html().unwrap();
        assert!(drawn(&html) && html.contains("<label id=\"fixtures\">"));
        assert!(html.contains("\"outlines\":[[-50.0,0.0,1.235],[0.0,0.0,0.0]]"), "coordinates");
        assert!(html.contains("\"low_box_mm\":[-50.0,"), "the view holds them");
    }

    #[test]
    fn tables_are_there_without_a_script() {
        let (mesh, labels, predictions) = files();
        let views = views(&mesh, &labels, &predictions);
        let page = of(Some(&mesh), &labels.sites, &views);
        let html = page.html().unwrap();
        for words in [
            "inaccessible",
            "part_itself.fixtures",
            "data-finding=\"1\"",
            "<noscript>",
            "over-predicted",
        ] {
            assert!(html.contains(words), "{words}");
        }
        let numbers: usize = html.matches("<tr data-finding=").count();
        let listed = views.iter().filter_map(|v| v.findings.as_ref()).map(|f| f.list.len());
        assert_eq!(numbers, listed.sum::<usize>());
    }

    #[test]
    fn groups_that_do_not_fit_are_refused() {
        let (mesh, labels, predictions) = files();
        let mut views = views(&mesh, &labels, &predictions);
        views[1].of[7] = 9;
        let few = views[0].layer.as_mut().unwrap();
        few.of.pop();
        let page = of(Some(&mesh), &labels.sites, &views[..1]);
        assert!(page.html().unwrap_err().to_string().contains("tab"));
        let page = of(Some(&mesh), &labels.sites, &views);
        assert!(page.html().unwrap_err().to_string().contains("tab"));
        let none = Sites::default();
        let empty = [View::default()];
        let page = of(None, &none, &empty);
        assert!(page.html().unwrap().contains("</html>"));
    }
}
