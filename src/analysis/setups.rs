//! In how few setups a part can be milled on a machine.

use super::clamping::{Clamping, Holding, Table, Tested, Tests, Vise};
use super::fixtures::Fixture;
use super::observer::{Observer, Stage, report};
use super::placed::{Placed, without_area};
use super::write::Files;
use crate::Result;
use crate::access::surface::{AccessibleDirections, TriangleObstacles};
use crate::answers::SiteAnswers;
use crate::data::files::tools::{Tool, thick_and_short_first};
use crate::findings::gate::SiteAreas;
use crate::findings::{Findings, add_fixtures};
use crate::geom::units::Unit;
use crate::geom::{Mesh, Sites};
use crate::planning::setups::{Candidates, Choice, Clampings, Machine, Plan, reached_in};
use crate::report::PartView;
use crate::report::page::{LivePage, Page};
use crate::report::setups::{Held, Setups};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
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
/// A block in a three-axis mill: from above all but the underside, from two setups all of it.
///
/// ```
/// use deepmill::analysis::{Analysis, SetupRequest};
/// use deepmill::data::files::tools::Tool;
/// use deepmill::{geom::solids, glam::DVec3};
///
/// let tool = Tool::new("3,20,20,30".parse()?, Some(0.0), 0.0)?; // a flat end of 6 mm
/// let part = solids::cuboid(DVec3::new(40.0, 30.0, 15.0));
/// let placed = Analysis::new("block", part, vec![tool]).n_sites(400).place(&mut ())?;
/// let plan = placed.plan(SetupRequest::on("3-axis".parse()?), &mut ())?;
/// assert_eq!(plan.setups().plan().setups.len(), 2);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SetupRequest {
    machine: Machine,
    clampings: Option<Clampings>,
    n_directions: usize,
    share: f64,
    at_most: Option<usize>,
    given: Vec<Vec3>,
    pub(super) holding: Holding,
}

impl SetupRequest {
    /// The setups of a machine that cover 99 % of what can be reached, of the clampings that are usual on it.
    pub fn on(machine: Machine) -> Self {
        SetupRequest {
            clampings: None,
            n_directions: if machine.is_of_one_axis() { AROUND } else { OVER_SPHERE },
            machine,
            share: SHARE,
            at_most: None,
            given: Vec::new(),
            holding: Holding::default(),
        }
    }

    /// The clampings to choose from.
    #[must_use]
    pub fn clampings(self, clampings: Clampings) -> Self {
        SetupRequest { clampings: Some(clampings), ..self }
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

    /// A vise that grips the part in every setup; unless it is requested otherwise, the part stands on a flat face.
    #[must_use]
    #[doc(hidden)] // of the program, as the type is
    pub fn vise(mut self, vise: Vise) -> Self {
        self.holding.vise = Some(vise);
        self
    }

    /// A square table in every setup, along x' and y', so far below the lowest place of the part and below its middle;
    /// if it has no width, twice as wide as the diagonal of the part's box.
    #[must_use]
    pub fn table_below(mut self, below_mm: f64, width_mm: Option<f64>) -> Self {
        self.holding.table = Some(Table { below_mm, width_mm });
        self
    }

    /// A fixture of one of the given setups, by its number from 1, in the part's coordinates. Those of the
    /// [`Analysis`](super::Analysis::fixture) are there in every setup.
    #[must_use]
    pub fn fixture_of(mut self, setup: usize, fixture: Fixture) -> Self {
        self.holding.fixtures.push((setup, fixture));
        self
    }

    /// Those requested, or those that are usual.
    fn clampings_or_usual(&self) -> Clampings {
        self.clampings.unwrap_or(match self.holding.vise {
            Some(_) => Clampings::Standing,
            None => Clampings::usual(&self.machine),
        })
    }

    /// The machine.
    pub(super) fn machine(&self) -> &Machine {
        &self.machine
    }

    /// What to choose from, and what holds the part in each, if anything does.
    pub(super) fn held(
        &self,
        part: &Mesh,
        fixtures: &[Fixture],
        (sites, n_tools): (&Sites, usize),
    ) -> Result<(Candidates, Vec<Clamping>)> {
        let candidates = self.candidates(part)?;
        if self.holding.is_none(fixtures) {
            return Ok((candidates, Vec::new()));
        }
        let given = !self.given.is_empty();
        let list = self.holding.clampings(part, &candidates, fixtures, given)?.list;
        let numbers: Vec<usize> = list.iter().map(|clamping| clamping.candidate).collect();
        Ok((candidates.clamped(&numbers, sites, n_tools)?, list))
    }

    fn candidates(&self, part: &Mesh) -> Result<Candidates> {
        let SetupRequest { machine, n_directions, .. } = self;
        let clampings = self.clampings_or_usual();
        match &self.given[..] {
            [] => Candidates::new(part, machine.clone(), clampings, *n_directions),
            given => Candidates::given(part, machine.clone(), given, *n_directions),
        }
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
    pub(super) request: SetupRequest,
    pub(super) candidates: Candidates,
    pub(super) setups: Setups,
    pub(super) findings: Findings,
    pub(super) n_rests: usize,
    pub(super) notices: Vec<String>,
    pub(super) seconds: [f64; 4],
}

impl Placed {
    /// In how few setups the tools reach the part, by the mesh definition, with what holds it in the way. See
    /// `docs/setups.md`.
    ///
    /// # Errors
    /// If there are no triangles that block, the part cannot be held as requested, a request is out of its domain,
    /// lists would not fit into memory, or the observer stops it.
    pub fn plan(self, request: SetupRequest, observer: &mut dyn Observer) -> Result<SetupsOutcome> {
        let obstacles = self.require_triangles()?;
        let mut notices: Vec<String> = without_area(&obstacles).into_iter().collect();
        let (shown, of_shown) = self.shown();
        let areas = SiteAreas::of(of_shown, shown)?;
        let mesh = self.mesh().expect("a part of triangles");
        let (tools, sites) = (&self.request.tools, &self.sites);
        let candidates = request.candidates(mesh)?;
        Plan::require_memory(&candidates, sites.len(), tools.len())?;
        let tests = Tests { tools, sites, options: self.options() };
        let (fixtures, holding) = (&self.request.fixtures, &request.holding);
        let tested = if holding.is_none(fixtures) {
            let tested = tests.unclamped(&obstacles, candidates.directions(), observer)?;
            InClampings { candidates, tested, clamped: None }
        } else {
            notices.extend(holding.warnings(mesh)?);
            let given = !request.given.is_empty();
            let clampings = holding.clampings(mesh, &candidates, fixtures, given)?;
            notices.extend(clampings.notice);
            InClampings::test(&tests, mesh, candidates, clampings.list, observer)?
        };
        let InClampings { candidates, tested, clamped } = tested;
        let start = Instant::now();
        report(observer, Stage::Findings, (0, 1))?;
        let order = thick_and_short_first(tools);
        let (shares, choice) = (areas.shares(), request.choice());
        let plan = Plan::new(&candidates, mesh, sites, &tested.accessible, shares, choice, &order)?;
        let kept_out = clamped.map(|clamped| clamped.kept_out(&plan, mesh, sites, shares));
        let names = tools.iter().map(|tool| tool.name.clone()).collect();
        let setups = Setups::new(plan, request.machine.clone(), names, areas);
        notices.extend(setups.stroke_notices());
        let mut findings = Findings::of(of_shown, shown, &setups.answers(), &[])?;
        let setups = match kept_out {
            Some(kept_out) => {
                add_fixtures(&mut findings, &kept_out.names(), &kept_out.by);
                setups.held(kept_out.held)
            }
            None => setups,
        };
        findings.identify(ALL_SETUPS, self.bounds());
        report(observer, Stage::Findings, (1, 1))?;
        let [directions_s, tolerances_s] = tested.seconds;
        let cover_s = start.elapsed().as_secs_f64();
        Ok(SetupsOutcome {
            candidates,
            setups,
            findings,
            n_rests: tested.rests.count(),
            request,
            notices,
            seconds: [self.seconds(), directions_s, tolerances_s, cover_s],
            placed: self,
        })
    }
}

/// What the tools reach in the candidates, each with what holds the part in it.
struct InClampings {
    candidates: Candidates,
    tested: Tested,
    clamped: Option<Clamped>,
}

/// Candidates that something holds.
struct Clamped {
    /// As if nothing did.
    free: Candidates,
    alone: Vec<AccessibleDirections>,
    list: Vec<Clamping>,
}

impl InClampings {
    fn test(
        tests: &Tests,
        part: &Mesh,
        free: Candidates,
        list: Vec<Clamping>,
        observer: &mut dyn Observer,
    ) -> Result<Self> {
        let numbers: Vec<usize> = list.iter().map(|clamping| clamping.candidate).collect();
        let candidates = free.clamped(&numbers, tests.sites, tests.tools.len())?;
        Plan::require_memory(&candidates, tests.sites.len(), tests.tools.len())?;
        let start = Instant::now();
        let progress = (0, tests.tools.len() * (1 + list.len()));
        let obstacles = TriangleObstacles::new(part, &[])?;
        let alone = tests.alone(&obstacles, free.directions(), progress, observer)?;
        let alone_s = start.elapsed().as_secs_f64();
        let mut tested = tests.clamped(part, (&list, &free), &alone, observer)?;
        tested.seconds[0] += alone_s;
        Ok(InClampings { candidates, tested, clamped: Some(Clamped { free, alone, list }) })
    }
}

impl Clamped {
    /// What keeps the tools off in the chosen setups.
    fn kept_out(&self, plan: &Plan, part: &Mesh, sites: &Sites, shares: &[f64]) -> KeptOff {
        let mut kept = KeptOff { held: Vec::new(), by: vec![None; sites.len()] };
        for (k, setup) in plan.setups.iter().enumerate() {
            let clamping = &self.list[setup.candidate()];
            let number = clamping.candidate;
            let without = reached_in(&self.free, number, (part, sites), &self.alone);
            let is_kept_out = |i: &usize| without[*i] && !setup.reaches[*i];
            let kept_out: Vec<usize> = (0..sites.len()).filter(is_kept_out).collect();
            kept_out.iter().for_each(|&i| kept.by[i] = kept.by[i].or(Some(k)));
            // Never minus zero.
            let kept_out = kept_out.into_iter().map(|i| shares[i]).sum::<f64>() + 0.0;
            kept.held.push(Held { kept_out, ..clamping.held.clone() });
        }
        kept
    }
}

/// What holds the part in the chosen setups, each with the share of the surface that is out of reach for it alone; per
/// site the first setup that would reach it with nothing but the part in the way, and does not.
struct KeptOff {
    held: Vec<Held>,
    by: Vec<Option<usize>>,
}

impl KeptOff {
    fn names(&self) -> Vec<String> {
        let name = |(k, held): (usize, &Held)| format!("setup {}: {}", k + 1, held.words);
        self.held.iter().enumerate().map(name).collect()
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

    /// What holds the part, as it was requested.
    fn held_words(&self) -> String {
        self.request.holding.words(&self.placed.request.fixtures)
    }

    /// On what the part lies, and which tool axes were allowed.
    pub fn premise(&self) -> String {
        let SetupRequest { machine, given, .. } = &self.request;
        let clampings = self.request.clampings_or_usual();
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
        let n_axes = self.candidates.n_tool_axes();
        let with = match &*self.held_words() {
            "" => String::new(),
            words => format!("; in the way: {words}"),
        };
        format!(
            "machine {machine}, {n_axes} tool axes; part {held}{with}; {n} {one} to choose from"
        )
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
        let outlines = &self.placed.outlines()[..];
        let view = PartView { name, mesh, sites, cutter: words, outlines };
        let mut paths = self.setups.write(folder, view, files.show(), unit)?;
        paths.extend(self.findings.write(folder, (name, words), unit)?);
        if files.report {
            paths.push(self.with_page(unit, |page| page.write(folder))?);
        }
        paths.extend(self.placed.write_surfaces(folder)?);
        paths.push(self.write_record(folder)?);
        report(observer, Stage::Writing, (1, 1))?;
        Ok(paths)
    }

    /// Gives the page to a function.
    fn with_page<T>(&self, unit: Unit, with: impl FnOnce(Page) -> Result<T>) -> Result<T> {
        let ((mesh, sites), outlines) = (self.placed.shown(), &self.placed.outlines()[..]);
        let views = &self.setups.views(self.findings.clone(), &self.settings())[..];
        with(Page { part: self.placed.part(), mesh, sites, views, unit, outlines })
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
        let held = self.held_words();
        let strokes = self.request.machine.axes().map(|axes| axes.strokes_mm());
        let not_modelled = [
            ("fixtures, table", held.is_empty()),
            ("stock", true),
            ("strokes of the machine's axes", strokes.is_none_or(|mm| mm == DVec3::INFINITY)),
        ];
        let not_modelled = not_modelled.iter().filter(|(_, is_it)| *is_it).map(|(words, _)| *words);
        let mut settings = json!({
            "machine": self.request.machine.to_string(),
            "share": format!("{percent}%"),
            "tools": analysis.tools.iter().map(words).collect::<Vec<String>>(),
            "tool_axes_tested": self.candidates.n_tool_axes(),
            "candidates": self.candidates.list().len(),
            "sites": analysis.site_settings(),
            "not_modelled": not_modelled.collect::<Vec<&str>>().join(", "),
            "tolerance_mm": tolerances.tolerance_mm,
            "finish_mm": tolerances.finish_mm,
        });
        if !held.is_empty() {
            settings["held_by"] = json!(held);
        }
        settings
    }
}
