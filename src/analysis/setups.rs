//! In how few setups a part can be milled on a machine.

use super::observer::{Observer, Stage, report};
use super::placed::{Placed, without_area};
use super::write::Files;
use crate::Result;
use crate::access::setups::{Candidates, Choice, Clampings, Machine, Plan};
use crate::access::surface::{AccessibleDirections, SurfaceOptions, TriangleObstacles};
use crate::answers::SiteAnswers;
use crate::data::files::tools::{Tool, thick_and_short_first};
use crate::geom::units::Unit;
use crate::report::PartView;
use crate::report::findings::Findings;
use crate::report::gate::SiteAreas;
use crate::report::page::{LivePage, Page};
use crate::report::setups::Setups;
use glam::Vec3;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Directions around a rotary axis, and over the sphere.
const AROUND: usize = 72;
const OVER_SPHERE: usize = 300;
/// Of the area that can be reached.
const SHARE: f64 = 0.99;
/// The name of all setups together, of which what none reaches is found.
pub(super) const ALL_SETUPS: &str = "setups";

/// On which machine, in which clampings, and how few.
#[derive(Debug, Clone, PartialEq)]
pub struct SetupRequest {
    machine: Machine,
    clampings: Clampings,
    n_directions: usize,
    share: f64,
    at_most: Option<usize>,
    given: Vec<Vec3>,
}

impl SetupRequest {
    /// The setups of a machine that cover 99 % of what can be reached, of the clampings that are usual on it.
    pub fn on(machine: Machine) -> Self {
        SetupRequest {
            clampings: Clampings::usual(&machine),
            n_directions: if machine.is_of_one_axis() { AROUND } else { OVER_SPHERE },
            machine,
            share: SHARE,
            at_most: None,
            given: Vec::new(),
        }
    }

    /// The clampings to choose from.
    #[must_use]
    pub fn clampings(self, clampings: Clampings) -> Self {
        SetupRequest { clampings, ..self }
    }

    /// Directions tested beside box axes and flat faces; by default 300 over the sphere, 72 around a rotary axis.
    #[must_use]
    pub fn n_directions(self, n_directions: usize) -> Self {
        SetupRequest { n_directions, ..self }
    }

    /// The share of the area within reach that the setups cover.
    #[must_use]
    pub fn share(self, share: f64) -> Self {
        SetupRequest { share, ..self }
    }

    /// No more setups than this: those that add most, one after the other.
    #[must_use]
    pub fn at_most(self, n_setups: usize) -> Self {
        SetupRequest { at_most: Some(n_setups), ..self }
    }

    /// These setups in their order, none chosen: of each the direction of the part that points to the spindle, or
    /// along the rotary axis; unit vectors.
    #[must_use]
    pub fn given(self, given: Vec<Vec3>) -> Self {
        SetupRequest { given, ..self }
    }

    fn choice(&self) -> Choice {
        let choice = Choice::share(self.share);
        match self.at_most {
            _ if !self.given.is_empty() => choice.all(),
            Some(n) => choice.at_most(n),
            None => choice,
        }
    }
}

/// The chosen setups, what each reaches, and what they leave.
#[derive(Debug)]
pub struct SetupsOutcome {
    pub(super) placed: Placed,
    request: SetupRequest,
    candidates: Candidates,
    setups: Setups,
    pub(super) findings: Findings,
    n_rests: usize,
    notices: Vec<String>,
    seconds: [f64; 4],
}

impl Placed {
    /// In how few setups the tools reach the part, by the mesh definition; fixtures are not modelled. See
    /// `docs/setups.md`.
    ///
    /// # Errors
    /// If there are no triangles that block, a request is out of its domain, lists would not fit into memory, or the
    /// observer stops it.
    pub fn plan(self, request: SetupRequest, observer: &mut dyn Observer) -> Result<SetupsOutcome> {
        let obstacles = self.require_triangles()?;
        let (shown, of_shown) = self.shown();
        let areas = SiteAreas::of(of_shown, shown)?;
        let mesh = self.mesh().expect("a part of triangles");
        let (tools, sites) = (&self.request.tools, &self.sites);
        let SetupRequest { clampings, n_directions, .. } = request;
        let machine = request.machine.clone();
        let candidates = match &request.given[..] {
            [] => Candidates::new(mesh, machine.clone(), clampings, n_directions)?,
            given => Candidates::given(mesh, machine.clone(), given, n_directions)?,
        };
        Plan::require_memory(&candidates, sites.len(), tools.len())?;
        let start = Instant::now();
        let accessible = self.accessible_directions(&obstacles, &candidates, observer)?;
        let directions_s = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let n_rests = self.n_rests(&obstacles, &candidates, &accessible)?;
        let tolerances_s = start.elapsed().as_secs_f64();
        let start = Instant::now();
        report(observer, Stage::Findings, (0, 1))?;
        let order = thick_and_short_first(tools);
        let (shares, choice) = (areas.shares(), request.choice());
        let plan = Plan::new(&candidates, mesh, sites, &accessible, shares, choice, &order)?;
        let names = tools.iter().map(|tool| tool.name.clone()).collect();
        let setups = Setups::new(plan, machine, names, areas);
        let mut findings = Findings::of(of_shown, shown, &setups.answers(), &[])?;
        findings.identify(ALL_SETUPS, self.bounds());
        report(observer, Stage::Findings, (1, 1))?;
        Ok(SetupsOutcome {
            candidates,
            setups,
            findings,
            n_rests,
            request,
            notices: without_area(&obstacles).into_iter().collect(),
            seconds: [self.seconds(), directions_s, tolerances_s, start.elapsed().as_secs_f64()],
            placed: self,
        })
    }

    /// Of every tool.
    fn accessible_directions(
        &self,
        obstacles: &TriangleObstacles,
        candidates: &Candidates,
        observer: &mut dyn Observer,
    ) -> Result<Vec<AccessibleDirections>> {
        let (tools, options) = (&self.request.tools, self.options());
        let mut all = Vec::with_capacity(tools.len());
        report(observer, Stage::Labels, (0, tools.len()))?;
        for (k, tool) in tools.iter().enumerate() {
            let directions = candidates.directions();
            let cutter = &tool.cutter;
            all.push(obstacles.accessible_directions(&self.sites, cutter, directions, &options)?);
            report(observer, Stage::Labels, (k + 1, tools.len()))?;
        }
        Ok(all)
    }

    /// Sites that some tool reaches, and all that do by a wide gouge tolerance alone.
    fn n_rests(
        &self,
        obstacles: &TriangleObstacles,
        candidates: &Candidates,
        accessible: &[AccessibleDirections],
    ) -> Result<usize> {
        let (sites, directions) = (&self.sites, candidates.directions());
        let options = SurfaceOptions { refinement: None, ..self.options() };
        let mut rests = vec![true; sites.len()];
        let mut is_reached = vec![false; sites.len()];
        for (tool, found) in self.request.tools.iter().zip(accessible) {
            let reached = found.sites();
            let (cutter, by) = (&tool.cutter, (&reached[..], &[][..]));
            let of_tool =
                obstacles.rest_on_wide_tolerance(sites, cutter, directions, &options, by)?;
            for (i, reached) in reached.into_iter().enumerate() {
                // Unless another tool reaches it by less.
                rests[i] &= !reached || of_tool[i];
                is_reached[i] |= reached;
            }
        }
        Ok(rests.iter().zip(is_reached).filter(|(rests, reached)| **rests && *reached).count())
    }
}

impl SetupsOutcome {
    /// The part with its sites.
    pub fn placed(&self) -> &Placed {
        &self.placed
    }

    /// What was to choose from.
    pub fn candidates(&self) -> &Candidates {
        &self.candidates
    }

    /// The setups, with tables of each.
    pub fn setups(&self) -> &Setups {
        &self.setups
    }

    /// What the setups leave.
    pub fn answers(&self) -> SiteAnswers {
        self.setups.answers()
    }

    /// The regions of it.
    pub fn findings(&self) -> &Findings {
        &self.findings
    }

    /// Sites that are reached by a wide gouge tolerance alone.
    pub fn rests_on_tolerance(&self) -> usize {
        self.n_rests
    }

    /// What was left out, a sentence each.
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Seconds that sites, directions of every site, tolerances and the choice took.
    pub fn seconds(&self) -> [f64; 4] {
        self.seconds
    }

    /// On what the part lies, and which tool axes were allowed.
    pub fn premise(&self) -> String {
        let SetupRequest { machine, clampings, given, .. } = &self.request;
        let n = self.candidates.list().len();
        let one = if n == 1 { "setup" } else { "setups" };
        let held = match (machine, clampings) {
            _ if machine.is_chucked() => "held along the rotary axis",
            _ if !given.is_empty() => "as given, what it lies on is not reached",
            (_, Clampings::Standing) if self.candidates.stand_on_flat_faces() => {
                "standing on a flat face, which is not reached"
            }
            (_, Clampings::Standing) => {
                "along the axes of its box: it has no flat face to stand on"
            }
            (_, Clampings::Flat) => "along a flat face, what it lies on is not reached",
            (_, Clampings::Box) => {
                "along a flat face or a box axis, what it lies on is not reached"
            }
            (_, Clampings::Any) => "in any position, even on an edge",
        };
        let n_axes = self.candidates.directions().len();
        format!("machine {machine}, {n_axes} tool axes; part {held}; {n} {one} to choose from")
    }

    /// Writes what `deepmill setups` writes; returns the paths. Every file is written under another name and then
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
        let (mesh, sites) = self.placed.shown();
        let (name, unit) = (&*self.placed.request.part, files.unit);
        let words = &*format!("{} tools", self.placed.request.tools.len());
        let view = PartView { name, mesh, sites, cutter: words, outlines: &[] };
        let mut paths = self.setups.write(folder, view, files.show(), unit)?;
        paths.extend(self.findings.write(folder, (name, words), unit)?);
        if files.report {
            paths.push(self.with_page(unit, |page| page.write(folder))?);
        }
        paths.extend(self.placed.write_surfaces(folder)?);
        report(observer, Stage::Writing, (1, 1))?;
        Ok(paths)
    }

    /// Gives the page to a function.
    fn with_page<T>(&self, unit: Unit, with: impl FnOnce(Page) -> Result<T>) -> Result<T> {
        let (mesh, sites) = self.placed.shown();
        let views = &self.setups.views(self.findings.clone(), &self.settings())[..];
        with(Page { part: self.placed.part(), mesh, sites, views, unit, outlines: &[] })
    }

    /// As [`Outcome::live_page`](super::Outcome::live_page).
    ///
    /// # Errors
    /// As [`SetupsOutcome::write`].
    #[doc(hidden)] // of the program
    pub fn live_page(&self, unit: Unit) -> Result<LivePage> {
        self.with_page(unit, |page| Ok(LivePage::of(page)))
    }

    /// As the page shows them.
    fn settings(&self) -> Value {
        let analysis = &self.placed.request;
        let words = |tool: &Tool| format!("{}: {}", tool.name, tool.words());
        let tolerances = analysis.part_settings();
        let percent = (1e10 * self.request.share).round() / 1e8;
        json!({
            "machine": self.request.machine.to_string(),
            "share": format!("{percent}%"),
            "tools": analysis.tools.iter().map(words).collect::<Vec<String>>(),
            "tool_axes_tested": self.candidates.directions().len(),
            "candidates": self.candidates.list().len(),
            "sites": analysis.site_settings(),
            "not_modelled": "fixtures, table, stock, travel of the machine's axes",
            "tolerance_mm": tolerances.tolerance_mm,
            "finish_mm": tolerances.finish_mm,
        })
    }
}
