//! What every tool of a library reaches, in one pass.

use super::observer::{Observer, Stage, report};
use super::placed::{Placed, without_area};
use super::write::Files;
use crate::Result;
use crate::access::surface::{ToolReach, Warning};
use crate::answers::{SiteAnswer, SiteAnswers};
use crate::data::files::tools::Tool;
use crate::findings::gate::SiteAreas;
use crate::findings::{Findings, for_all_tools};
use crate::geom::units::Unit;
use crate::report::PartView;
use crate::report::coverage::Coverage;
use crate::report::library::Library;
use crate::report::page::{LivePage, Page};
use crate::tool::cutter::Assembly;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What the tools reach, which few of them reach nearly all, and how little each may stick out.
#[derive(Debug)]
pub struct ToolsOutcome {
    pub(super) placed: Placed,
    pub(super) library: Library,
    pub(super) rests: Vec<usize>,
    pub(super) warnings: Vec<String>,
    pub(super) notices: Vec<String>,
    pub(super) seconds: [f64; 4],
}

impl Placed {
    /// What each tool reaches by the mesh definition, and the fewest that reach `share` of what any reaches; see
    /// `docs/tools.md`.
    ///
    /// # Errors
    /// If there are no triangles that block, the share is not above 0 and at most 1, the observer stops it, or as
    /// [`TriangleObstacles::label`](crate::access::surface::TriangleObstacles::label).
    pub fn reach(self, share: f64, observer: &mut dyn Observer) -> Result<ToolsOutcome> {
        let start = Instant::now();
        let obstacles = self.require_triangles()?;
        let index_s = start.elapsed().as_secs_f64();
        let (shown, of_shown) = self.shown();
        let areas = SiteAreas::of(of_shown, shown)?;
        let (tools, sites, directions, options) =
            (&self.request.tools, &self.sites, &self.directions, &self.options());
        let held: Vec<Assembly> = tools.iter().map(Tool::held).collect::<Result<_>>()?;
        let start = Instant::now();
        let n = held.len();
        report(observer, Stage::Labels, (0, n))?;
        let mut done = |done: usize| report(observer, Stage::Labels, (done, n));
        let reach = obstacles.reach_bodies(sites, &held, (directions, options), &mut done)?;
        let tools_s = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let (mut rests, mut warnings) = (Vec::new(), Vec::new());
        for (tool, reach) in tools.iter().zip(&reach) {
            let (reached, cutter) = (reached_by(reach), &tool.cutter);
            let found = (&reached[..], &reach.witness[..]);
            let of_tool =
                obstacles.rest_on_wide_tolerance(sites, cutter, directions, options, found)?;
            rests.push(of_tool.iter().filter(|rests| **rests).count());
            if tool.clearance_mm > 0.0 && !reached.contains(&true) {
                let (without, answered) = (tool.assembly.cutter()?, (options, &reach.answers[..]));
                let closed =
                    obstacles.share_closed_by_clearance(sites, &without, directions, answered)?;
                let warning = Warning::of_clearance(tool.clearance_mm, closed, false);
                warnings.extend(warning.map(|warning| format!("{}: {warning}", tool.name)));
            }
        }
        let tolerances_s = start.elapsed().as_secs_f64();
        let library = Library::new(tools.clone(), reach, areas, share)?;
        Ok(ToolsOutcome {
            library,
            rests,
            warnings,
            notices: without_area(&obstacles).into_iter().collect(),
            seconds: [self.seconds(), index_s, tools_s, tolerances_s],
            placed: self,
        })
    }
}

fn reached_by(reach: &ToolReach) -> Vec<bool> {
    reach.answers.iter().map(|answer| *answer == SiteAnswer::Accessible).collect()
}

impl ToolsOutcome {
    /// The part with its sites.
    pub fn placed(&self) -> &Placed {
        &self.placed
    }

    /// What each tool reaches, as a table; the fewest tools.
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// The answers of each tool with its name.
    pub fn named(&self) -> Vec<(&str, SiteAnswers)> {
        let names = self.library.tools().iter().map(|tool| &*tool.name);
        names.zip(self.library.reach().iter().map(answers)).collect()
    }

    /// Per tool, how many sites are accessible by a wide gouge tolerance alone.
    pub fn rests_on_tolerance(&self) -> &[usize] {
        &self.rests
    }

    /// What may make the answers misleading, a sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// What was left out, a sentence each.
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Seconds that sites, search tree, tools and tolerances took.
    pub fn seconds(&self) -> [f64; 4] {
        self.seconds
    }

    /// Writes what `deepmill tools` writes; returns the paths. Every file is written under another name and then
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
        report(observer, Stage::Writing, (0, 1))?;
        let tools = self.library.tools();
        let mut paths = self.library.write(folder, files.unit)?;
        let (mesh, sites) = self.placed.shown();
        let (cutter, outlines) = (&*format!("{} tools", tools.len()), &self.placed.outlines()[..]);
        let view = PartView { name: &self.placed.request.part, mesh, sites, cutter, outlines };
        paths.extend(self.coverage().write_first(folder, view, files.show())?);
        paths.extend(self.placed.write_surfaces(folder)?);
        paths.push(self.write_record(folder)?);
        report(observer, Stage::Writing, (1, 1))?;
        Ok(paths)
    }

    fn coverage(&self) -> Coverage<'_> {
        let accessible: Vec<Vec<bool>> = self.library.reach().iter().map(reached_by).collect();
        Coverage::of_reached(self.library.tools(), &accessible, self.library.areas())
    }

    /// Where no tool reaches.
    ///
    /// # Errors
    /// As [`Findings::of`].
    #[doc(hidden)] // of the program
    pub fn findings(&self) -> Result<Findings> {
        let (mesh, sites) = self.placed.shown();
        let answers: Vec<SiteAnswers> = self.library.reach().iter().map(answers).collect();
        Findings::of(sites, mesh, &for_all_tools(answers.iter()), &[])
    }

    /// A page that follows edits, of what the tools reach together; lengths in this unit.
    ///
    /// # Errors
    /// As [`Findings::of`].
    #[doc(hidden)] // of the program
    pub fn live_page(&self, unit: Unit, findings: Findings) -> Result<LivePage> {
        let (mesh, sites) = self.placed.shown();
        let mut view = self.coverage().view(findings);
        view.tables = vec![
            ("Tools".into(), self.library.table()),
            ("Smallest set".into(), self.library.cover_table()),
        ];
        let (views, outlines) = (&[view][..], &self.placed.outlines()[..]);
        Ok(LivePage::of(Page { part: self.placed.part(), mesh, sites, views, unit, outlines }))
    }
}

fn answers(reach: &ToolReach) -> SiteAnswers {
    SiteAnswers::by_mesh(reach.answers.clone())
}
