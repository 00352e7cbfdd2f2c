//! `deepmill setups`: in how many clampings a part can be milled, and what each reaches.

mod watched;

use crate::args::{GateArgs, OutArgs, SiteArgs, ToolArgs, called, name_of, share};
use crate::baseline::BaselineArgs;
use crate::clock::Clock;
use crate::findings;
use crate::holding::{self, HoldingArgs};
use crate::machine::{MachineOrFile, machine_or_file};
use crate::mesh_args::{MeshArgs, warn_wide_tools};
use crate::output::Output;
use crate::part_itself::{self, ToleranceArgs};
use crate::progress::Bars;
use crate::region::{self, RegionArgs};
use deepmill::analysis::{Analysis, Files, Observer, SetupRequest, SetupsOutcome};
use deepmill::data::files::tools::Tool;
use deepmill::findings::gate::Limit;
use deepmill::geom::Mesh;
use deepmill::planning::setups::{Clampings, direction_of_words};
use deepmill::tables::{Cell, Facts};
use deepmill::{Error, Result};
use glam::Vec3;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Say in how few setups (clampings) a part can be milled on a machine, and what each reaches with which tools.
///
/// Writes to DIR: setups.csv and setup-tools.csv, positions.csv (3+2, 4-axis and machine files, with angles),
/// setups.ply and setups.png (the first setup that reaches each site), setup-K.ply and, of the first eight, .png, .stl
/// (the part turned as it is clamped) and -fixtures.stl (what holds it), findings.json and findings.csv (what is left)
/// and part.stl.
#[derive(clap::Args)]
#[command(
    after_help = "Example: deepmill setups part.stl --tools shop.csv --machine 3-axis --out setups\n\
Tilting: deepmill setups part.stl --tools shop.csv --machine 3+2:60 --report --out setups\n\
In a vise: deepmill setups part.stl --tools shop.csv --machine 3-axis --vise 100,100,15 --setups 2 --out setups\n\
What is modelled and what is not, such as stock: docs/setups.md."
)]
pub struct Args {
    /// Mesh (STL, OBJ, PLY, 3MF).
    part: PathBuf,
    #[command(flatten)]
    read: MeshArgs,
    #[command(flatten)]
    tools: ToolArgs,
    /// 3-axis, 3+2:DEGREES and 5-axis:DEGREES (greatest tilt from the machine's z), 4-axis (the part may be chucked
    /// along its box or flat faces), 4-axis:x (y, z or X,Y,Z: along this), 4-axis:x:LOW,HIGH (turned by no more than
    /// these degrees from +z); or FILE.toml or FreeCAD's FILE.fcm, the machine's own rotary axes with their limits
    /// (docs/setups.md).
    #[arg(long, value_name = "MACHINE", value_parser = machine_or_file)]
    machine: MachineOrFile,
    /// The setups cover at least this share of the area that can be reached.
    #[arg(long, value_name = "PERCENT", default_value = "99%")]
    share: String,
    /// Directions tested, beside the box axes and flat faces: even over the sphere (300), or around each rotary axis
    /// (72).
    #[arg(long, value_name = "COUNT")]
    directions: Option<usize>,
    /// Which clampings to choose from: `standing` (on a large flat face), `flat` (along one), `box` (these and the box
    /// axes) or `any` (every direction tested). By default `standing` for 3-axis and in a vise, else `box`.
    #[arg(long, value_name = "WHICH")]
    clampings: Option<Clamping>,
    /// At most so many setups: those that add most, one after the other.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..))]
    setups: Option<u64>,
    /// Test this setup: the direction of the part that points to the spindle, or along the rotary axis (+z, -x or
    /// X,Y,Z). May be given again; nothing is chosen then, all are taken in their order.
    #[arg(
        long, value_name = "DIRECTION", allow_hyphen_values = true,
        conflicts_with_all = ["setups", "clampings"]
    )]
    setup: Vec<String>,
    #[command(flatten)]
    holding: HoldingArgs,
    #[command(flatten)]
    sites: SiteArgs,
    #[command(flatten)]
    region: RegionArgs,
    #[command(flatten)]
    tolerances: ToleranceArgs,
    #[command(flatten)]
    gate: GateArgs,
    #[command(flatten)]
    baseline: BaselineArgs,
    #[command(flatten)]
    out: OutArgs,
    /// Draw no pictures.
    #[arg(long)]
    no_picture: bool,
    /// Also write report.html, an HTML report with a tab for every setup.
    #[arg(long)]
    report: bool,
    /// Take a mesh that does not bound one solid; the answer may mean nothing.
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Clamping {
    Standing,
    Flat,
    Box,
    Any,
}

impl From<Clamping> for Clampings {
    fn from(clamping: Clamping) -> Self {
        match clamping {
            Clamping::Standing => Clampings::Standing,
            Clamping::Flat => Clampings::Flat,
            Clamping::Box => Clampings::Box,
            Clamping::Any => Clampings::Any,
        }
    }
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let limits = args.limits()?;
    let share = share(&args.share)?;
    let request = args.request(share)?;
    let tools = args.tools(output)?;
    args.tolerances.options()?;
    let baseline = args.baseline.open()?;
    args.out.check()?;
    let mut clock = Clock::start();
    let mesh = args.read.read_bodies(&args.part, args.force, output)?;
    clock.lap("read_s", "reading");
    let files = args.forms(output)?;
    let mut bars = Bars::default();
    let mut outcome = args.plan(mesh, tools, (request, &files), &mut bars, output)?;
    clock.stages(STAGES, outcome.seconds());
    let check = baseline.check(|known| outcome.hold_against(known));
    let mut paths = outcome.write(args.out.folder(), &files, &mut bars)?;
    paths.extend(baseline.write(|date| outcome.baseline(date))?);
    clock.lap("write_s", "writing and drawing");
    let (surface, sites) = outcome.placed().shown();
    let answers = outcome.answers();
    let named = [("setups", &answers)].into_iter();
    let held = baseline.is_held().then(|| ("setups", outcome.findings()));
    let broken = output.check_limits(&limits, (sites, surface), named, held)?;
    let mut result = args.say(&outcome, share, &clock, &paths, output);
    result["limits_broken"] = broken;
    result["baseline"] = baseline.say(check, outcome.findings(), output);
    args.read.add_origin(&mut result);
    output.result_with_files(result, &paths);
    Ok(())
}

/// Keys and names of what [`SetupsOutcome::seconds`] has.
const STAGES: [[&str; 2]; 4] = [
    ["sites_s", "sites"],
    ["directions_s", "directions of every site"],
    ["tolerances_s", "tolerances"],
    ["cover_s", "choice of setups"],
];

impl Args {
    fn limits(&self) -> Result<Vec<Limit>> {
        self.gate.limits(&["occlusion", "rest"])
    }

    fn tools(&self, output: &Output) -> Result<Vec<Tool>> {
        self.tolerances.with_allowance(self.tools.tools(output)?)
    }

    fn forms(&self, output: &Output) -> Result<Files> {
        output.forms(!self.no_picture, self.report, &[])
    }

    /// The setups of a part that was read.
    fn plan(
        &self,
        mesh: Mesh,
        tools: Vec<Tool>,
        (request, files): (SetupRequest, &Files),
        observer: &mut dyn Observer,
        output: &Output,
    ) -> Result<SetupsOutcome> {
        warn_wide_tools(&mesh, &tools, output);
        let analysis = Analysis::new(name_of(&self.part), mesh, tools);
        let analysis =
            analysis.library(self.tools.are_of_files()).options(self.tolerances.options()?);
        let (analysis, request) = self.holding.add_to(analysis, request, &self.read, output)?;
        let placed = self.region.place(analysis, &self.sites, &self.read, output)?;
        let (surface, sites) = placed.shown();
        files.show().require_memory(surface, sites)?;
        let outcome = placed.plan(request, observer).map_err(|error| match error {
            Error::Argument { name: "setups", .. } => called(error, "--setup"),
            other => holding::called(other),
        })?;
        outcome.notices().iter().for_each(|notice| output.say(notice));
        Ok(outcome)
    }

    fn request(&self, share: f64) -> Result<SetupRequest> {
        let machine = self.machine.machine()?;
        let mut request = SetupRequest::on(machine).share(share);
        if let Some(clampings) = self.clampings {
            request = request.clampings(clampings.into());
        }
        if let Some(n_directions) = self.directions {
            request = request.n_directions(n_directions);
        }
        if let Some(n) = self.setups {
            request = request.at_most(n as usize);
        }
        let given = self.setup.iter().map(|text| direction_of_words(text));
        let given = given.collect::<Result<Vec<Vec3>>>();
        Ok(request.given(given.map_err(|error| called(error, "--setup"))?))
    }

    /// The answer for people; as JSON for the result.
    fn say(
        &self,
        outcome: &SetupsOutcome,
        share: f64,
        clock: &Clock,
        paths: &[PathBuf],
        output: &Output,
    ) -> Value {
        let (placed, setups, candidates) =
            (outcome.placed(), outcome.setups(), outcome.candidates());
        let plan = setups.plan();
        let area_mm2 = placed.shown().0.map_or(0.0, Mesh::area);
        let mut facts = Facts::new();
        facts.add("part", "part", Cell::text(placed.part()));
        facts.add("machine", "machine", Cell::text(candidates.machine().to_string()));
        part_itself::add_rests(&mut facts, outcome.rests_on_tolerance());
        facts.add("finish_mm", "finish tolerance, mm", Cell::Given(placed.options().finish_mm));
        facts.add("area_mm2", "surface, mm²", Cell::Number(area_mm2));
        facts.add("n_sites", "sites", Cell::count(placed.sites().len()));
        facts.add("n_tools", "tools", Cell::count(placed.tools().len()));
        facts.add("n_directions", "tool axes tested", Cell::count(candidates.n_tool_axes()));
        facts.add("n_candidates", "candidates", Cell::count(candidates.list().len()));
        let can_be_reached = Cell::Share(setups.can_be_reached());
        facts.add("can_be_reached", "of the surface, can be reached", can_be_reached);
        facts.add("reached", "of the surface, reached", Cell::Share(setups.reached()));
        facts.add("n_setups", "setups", Cell::count(plan.setups.len()));
        facts.add("n_setups_at_least", "no fewer than", Cell::count(plan.at_least));
        facts.add("share", "that cover, of what can be reached", Cell::Share(share));
        let for_all = "setups that cover all of it, greedy";
        facts.add("n_setups_for_all", for_all, Cell::count(plan.n_for_all));
        if let Some(n) = setups.n_positions() {
            facts.add("n_positions", "positions in them", Cell::count(n));
        }
        clock.add_to(&mut facts);
        let premise = outcome.premise();
        let mut result = facts.json();
        output.say(&premise);
        region::say(placed.region(), &mut result, output);
        output.say(facts.text_in(output.unit()));
        output.files(paths);
        output.say(setups.table().text_in(output.unit()));
        findings::say(outcome.findings(), output);
        result["premise"] = json!(premise);
        result["setups"] = setups.json();
        result["fewest_is_proven"] = json!(plan.setups.len() <= plan.at_least);
        result["findings"] = outcome.findings().json();
        result
    }
}
