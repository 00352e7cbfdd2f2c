//! `deepmill setups`: in how many clampings a part can be milled, and what each reaches.

use crate::args::{GateArgs, SiteArgs, ToolArgs, called, name_of, share};
use crate::clock::Clock;
use crate::findings;
use crate::mesh_args::{MeshArgs, warn_wide_tools};
use crate::output::Output;
use crate::part_itself::{self, ToleranceArgs};
use crate::progress;
use crate::region::{self, RegionArgs};
use deepmill::access::setups::{Candidates, Choice, Clampings, Machine, Plan, direction_of_words};
use deepmill::access::surface::{AccessibleDirections, SurfaceOptions};
use deepmill::analysis::{Analysis, without_area};
use deepmill::data::files::tools::{self, Tool};
use deepmill::geom::Mesh;
use deepmill::report::PartView;
use deepmill::report::findings::Findings;
use deepmill::report::folder::Show;
use deepmill::report::gate::SiteAreas;
use deepmill::report::page::Page;
use deepmill::report::setups::Setups;
use deepmill::report::tables::{Cell, Facts};
use deepmill::{Result, atomic_file};
use glam::Vec3;
use serde_json::json;
use std::path::PathBuf;

/// Say in how few setups (clampings) a part can be milled on a machine, and what each reaches with which tools.
///
/// Writes to DIR: setups.csv and setup-tools.csv, positions.csv (3+2 and 4-axis), setups.ply and setups.png (the first
/// setup that reaches each site), setup-K.ply and, of the first eight, .png and .stl (the part turned as it is
/// clamped), findings.json and findings.csv (what is left) and part.stl.
#[derive(clap::Args)]
#[command(
    after_help = "Example: deepmill setups part.stl --tools shop.csv --machine 3-axis --out setups\n\
Tilting: deepmill setups part.stl --tools shop.csv --machine 3+2:60 --report --out setups\n\
Fixtures, table and stock are not modelled: see docs/setups.md."
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
    /// these degrees from +z).
    #[arg(long, value_name = "MACHINE")]
    machine: Machine,
    /// The setups cover at least this share of the area that can be reached.
    #[arg(long, value_name = "PERCENT", default_value = "99%")]
    share: String,
    /// Directions tested, beside the box axes and flat faces: even over the sphere (300), or around each rotary axis
    /// (72).
    #[arg(long, value_name = "COUNT")]
    directions: Option<usize>,
    /// Which clampings to choose from: `standing` (on a large flat face), `flat` (along one), `box` (these and the box
    /// axes) or `any` (every direction tested). By default `standing` for 3-axis, `box` for other machines.
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
    sites: SiteArgs,
    #[command(flatten)]
    region: RegionArgs,
    #[command(flatten)]
    tolerances: ToleranceArgs,
    #[command(flatten)]
    gate: GateArgs,
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Draw no pictures.
    #[arg(long)]
    no_picture: bool,
    /// Also write report.html, a page to send, with a tab for every setup.
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

/// Directions around a rotary axis, and over the sphere.
const AROUND: usize = 72;
const OVER_SPHERE: usize = 300;

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let limits = args.gate.limits(&["occlusion"])?;
    let share = share(&args.share)?;
    let tools = args.tolerances.with_allowance(args.tools.tools(output)?)?;
    let options = args.tolerances.options()?;
    atomic_file::check_writable_folder(&args.out)?;
    let mut clock = Clock::start();
    let mesh = args.read.read_bodies(&args.part, args.force, output)?;
    warn_wide_tools(&mesh, &tools, output);
    clock.lap("read_s", "reading");
    let name = name_of(&args.part);
    let analysis = Analysis::new(&*name, mesh, tools.clone());
    let placed = args.region.place(analysis, &args.sites, &args.read, output)?;
    let mesh = placed.mesh().expect("a mesh was given");
    let (sites, (surface, of_surface)) = (placed.sites(), placed.shown());
    Show::pictures_unless(args.no_picture).require_memory(surface, of_surface)?;
    let areas = SiteAreas::of(of_surface, surface)?;
    clock.lap("sites_s", "sites");
    let candidates = args.candidates(mesh)?;
    Plan::require_memory(&candidates, sites.len(), tools.len())?;
    let obstacles = placed.obstacles()?.expect("triangles of a mesh block");
    without_area(&obstacles).iter().for_each(|notice| output.say(notice));
    let of_tool = |tool: &Tool| {
        obstacles.accessible_directions(sites, &tool.cutter, candidates.directions(), &options)
    };
    let progress = progress::bar(tools.len() as u64, "tools");
    let counted = tools.iter().map(|tool| of_tool(tool).inspect(|_| progress.inc(1)));
    let accessible: Vec<AccessibleDirections> = counted.collect::<Result<_>>()?;
    progress.finish_and_clear();
    clock.lap("directions_s", "directions of every site");
    let mut rests = vec![true; sites.len()];
    for (tool, found) in tools.iter().zip(&accessible) {
        let reached = found.sites();
        let of_tool = obstacles.rest_on_wide_tolerance(
            sites,
            &tool.cutter,
            candidates.directions(),
            &SurfaceOptions { refinement: None, ..options },
            (&reached, &[]),
        )?;
        // Unless another tool reaches it by less.
        let others = reached.iter().zip(of_tool).map(|(reached, rests)| !reached || rests);
        rests.iter_mut().zip(others).for_each(|(all, of_tool)| *all &= of_tool);
    }
    let is_reached = |i: usize| accessible.iter().any(|found| found.reaches(i));
    let n_rests = (0..sites.len()).filter(|&i| rests[i] && is_reached(i)).count();
    clock.lap("tolerances_s", "tolerances");
    let order = tools::thick_and_short_first(&tools);
    let choice = args.choice(share);
    let plan = Plan::new(&candidates, mesh, sites, &accessible, areas.shares(), choice, &order);
    clock.lap("cover_s", "choice of setups");

    let names: Vec<&str> = tools.iter().map(|tool| &*tool.name).collect();
    let setups = Setups::new(&plan, args.machine, &names, &areas);
    let answers = setups.answers();
    let found = Findings::of(of_surface, surface, &answers, &[])?;
    let words = format!("{} tools", tools.len());
    let view =
        PartView { name: &name, mesh: surface, sites: of_surface, cutter: &words, outlines: &[] };
    let mut paths =
        setups.write(&args.out, view, Show::pictures_unless(args.no_picture), output.unit())?;
    paths.extend(found.write(&args.out, (&name, &words), output.unit())?);
    if args.report {
        let views = setups.views(found.clone(), &args.settings(&tools, &candidates));
        let page = Page {
            part: &name,
            mesh: surface,
            sites: of_surface,
            views: &views,
            unit: output.unit(),
            outlines: &[],
        };
        paths.push(page.write(&args.out)?);
    }
    paths.extend(placed.write_surfaces(&args.out)?);
    clock.lap("write_s", "writing and drawing");

    let named = [("setups", &answers)].into_iter();
    let broken = output.check_limits(&limits, (of_surface, surface), named)?;
    let premise = args.premise(&candidates);
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(&name));
    facts.add("machine", "machine", Cell::text(args.machine.to_string()));
    part_itself::add_rests(&mut facts, n_rests);
    facts.add("finish_mm", "finish tolerance, mm", Cell::Given(options.finish_mm));
    facts.add("area_mm2", "surface, mm²", Cell::Number(surface.map_or(0.0, Mesh::area)));
    facts.add("n_sites", "sites", Cell::count(sites.len()));
    facts.add("n_tools", "tools", Cell::count(tools.len()));
    facts.add("n_directions", "tool axes tested", Cell::count(candidates.directions().len()));
    facts.add("n_candidates", "candidates", Cell::count(candidates.list().len()));
    facts.add(
        "can_be_reached",
        "of the surface, can be reached",
        Cell::Share(setups.can_be_reached()),
    );
    facts.add("reached", "of the surface, reached", Cell::Share(setups.reached()));
    facts.add("n_setups", "setups", Cell::count(plan.setups.len()));
    facts.add("n_setups_at_least", "no fewer than", Cell::count(plan.at_least));
    facts.add("share", "that cover, of what can be reached", Cell::Share(share));
    facts.add(
        "n_setups_for_all",
        "setups that cover all of it, greedy",
        Cell::count(plan.n_for_all),
    );
    if let Some(n) = setups.n_positions() {
        facts.add("n_positions", "positions in them", Cell::count(n));
    }
    clock.add_to(&mut facts);
    let mut result = facts.json();
    output.say(&premise);
    region::say(placed.region(), &mut result, output);
    output.say(facts.text_in(output.unit()));
    output.files(&paths);
    output.say(setups.table().text_in(output.unit()));
    findings::say(&found, output);
    result["premise"] = json!(premise);
    result["setups"] = setups.json();
    result["fewest_is_proven"] = json!(plan.setups.len() <= plan.at_least);
    result["findings"] = found.json();
    result["limits_broken"] = broken;
    args.read.add_origin(&mut result);
    output.result_with_files(result, &paths);
    Ok(())
}

impl Args {
    fn candidates(&self, mesh: &Mesh) -> Result<Candidates> {
        let n_directions = self.n_directions();
        if self.setup.is_empty() {
            return Candidates::new(mesh, self.machine, self.clampings(), n_directions);
        }
        let given = self.setup.iter().map(|text| direction_of_words(text));
        let given = given.collect::<Result<Vec<Vec3>>>();
        given
            .and_then(|given| Candidates::given(mesh, self.machine, &given, n_directions))
            .map_err(|error| called(error, "--setup"))
    }

    fn choice(&self, share: f64) -> Choice {
        let choice = Choice::share(share);
        match self.setups {
            _ if !self.setup.is_empty() => choice.all(),
            Some(n) => choice.at_most(n as usize),
            None => choice,
        }
    }

    /// What the answer rests on: on what the part stands, and which tool axes were allowed.
    fn premise(&self, candidates: &Candidates) -> String {
        let n = candidates.list().len();
        let one = if n == 1 { "setup" } else { "setups" };
        let stands = match (&self.machine, self.clampings()) {
            (Machine::Rotary { .. }, _) => "held along the rotary axis".to_string(),
            _ if !self.setup.is_empty() => "as given, what it lies on is not reached".to_string(),
            (_, Clampings::Standing) if candidates.stand_on_flat_faces() => {
                "standing on a flat face, which is not reached".to_string()
            }
            (_, Clampings::Standing) => {
                "along the axes of its box: it has no flat face to stand on".to_string()
            }
            (_, Clampings::Flat) => "along a flat face, what it lies on is not reached".to_string(),
            (_, Clampings::Box) => {
                "along a flat face or a box axis, what it lies on is not reached".to_string()
            }
            (_, Clampings::Any) => "in any position, even on an edge".to_string(),
        };
        let n_axes = candidates.directions().len();
        format!(
            "machine {}, {n_axes} tool axes; part {stands}; {n} {one} to choose from",
            self.machine
        )
    }

    fn clampings(&self) -> Clampings {
        match self.clampings {
            None => Clampings::usual(&self.machine),
            Some(Clamping::Standing) => Clampings::Standing,
            Some(Clamping::Flat) => Clampings::Flat,
            Some(Clamping::Box) => Clampings::Box,
            Some(Clamping::Any) => Clampings::Any,
        }
    }

    fn n_directions(&self) -> usize {
        let usual = if self.machine.tilt_rad().is_none() { AROUND } else { OVER_SPHERE };
        self.directions.unwrap_or(usual)
    }

    fn settings(&self, tools: &[Tool], candidates: &Candidates) -> serde_json::Value {
        let words: Vec<String> =
            tools.iter().map(|tool| format!("{}: {}", tool.name, tool.words())).collect();
        let tolerances = self.tolerances.settings();
        json!({
            "machine": self.machine.to_string(),
            "share": self.share,
            "tools": words,
            "tool_axes_tested": candidates.directions().len(),
            "candidates": candidates.list().len(),
            "sites": self.sites.settings(true),
            "not_modelled": "fixtures, table, stock, travel of the machine's axes",
            "tolerance_mm": tolerances.tolerance_mm,
            "finish_mm": tolerances.finish_mm,
        })
    }
}
