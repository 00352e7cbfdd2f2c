//! `deepmill tools`: what every tool of a library reaches on a part, in one pass; and the library itself.

mod library;
mod watched;

use crate::args::{
    DirectionArgs, GateArgs, OutArgs, SiteArgs, UnsaidArgs, name_of, share, with_names,
};
use crate::clock::Clock;
use crate::mesh_args::{MeshArgs, warn_wide_tools};
use crate::output::Output;
use crate::part_itself::{self, SurfaceArgs};
use crate::premise::premise;
use crate::progress::Bars;
use crate::region::{self, RegionArgs};
use deepmill::Result;
use deepmill::analysis::{Analysis, Observer, ToolsOutcome};
use deepmill::data::files::tools::Tool;
use deepmill::findings::gate::Limit;
use deepmill::geom::Mesh;
use deepmill::tables::{Cell, Facts};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Say what every tool of a library reaches on a part, which few of them reach nearly all, and how little each may
/// stick out.
///
/// Writes to DIR: tools.csv (the table, a tool table again), stick-out.csv and stick-out.svg (area within reach by
/// stick-out), tools.ply and tools.png (the first tool that reaches each site) and part.stl (the surface as used, in
/// mm).
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill tools part.stl --library shop.json --out tools\n\
Tool bits: deepmill tools part.stl --library Bit --stick-out 35 --holder er20.csv --out tools\n\
The library alone: deepmill tools --library shop.tools --show --export csv --out tools")]
pub struct Args {
    /// Mesh (STL, OBJ, PLY, 3MF). With --export or --show it may be left out.
    #[arg(required_unless_present_any = ["export", "show"])]
    part: Option<PathBuf>,
    #[command(flatten)]
    read: MeshArgs,
    /// Files of tools: Fusion 360 and HSMWorks libraries (.json, .tools, .hsmlib), FreeCAD tool bits (.fctb), folders
    /// and libraries (.fctl) of them, LinuxCNC tables (.tbl), CAMotics tables (JSON), CSV tables.
    #[arg(long, visible_alias = "tools", value_name = "FILE", num_args = 1.., required = true)]
    library: Vec<PathBuf>,
    #[command(flatten)]
    defaults: UnsaidArgs,
    /// The smallest set reaches this share of what any tool reaches; the least stick-out of a tool is that at which
    /// this share of what it reaches
    /// at any stick-out is reached.
    #[arg(long, value_name = "PERCENT", default_value = "95%")]
    share: String,
    #[command(flatten)]
    sites: SiteArgs,
    #[command(flatten)]
    region: RegionArgs,
    #[command(flatten)]
    directions: DirectionArgs,
    #[command(flatten)]
    surface: SurfaceArgs,
    #[command(flatten)]
    gate: GateArgs,
    #[command(flatten)]
    alone: library::LibraryArgs,
    #[command(flatten)]
    out: OutArgs,
    /// Draw no picture of the part.
    #[arg(long)]
    no_picture: bool,
    /// Take a mesh that does not bound one solid; the answer may mean nothing.
    #[arg(long)]
    force: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let limits = args.limits()?;
    let share = share(&args.share)?;
    let tools = args.tools(output)?;
    let written = args.alone.write(&tools, args.out.folder(), output)?;
    let Some(part) = &args.part else {
        library::say(&tools, &written, output);
        return Ok(());
    };
    let directions = args.directions.directions()?;
    args.surface.options()?;
    args.out.check()?;
    let mut clock = Clock::start();
    let mesh = args.read.read_bodies(part, args.force, output)?;
    clock.lap("read_s", "reading");
    let premise = premise(&directions, &args.surface);
    let mut bars = Bars::default();
    let outcome = args.reach((part, mesh), (tools, share), &mut bars, output)?;
    clock.stages(STAGES, outcome.seconds());
    let files = output.forms(!args.no_picture, false, &[])?;
    let mut paths = outcome.write(args.out.folder(), &files, &mut bars)?;
    paths.extend(written);
    clock.lap("write_s", "writing and drawing");
    let (surface, sites) = outcome.placed().shown();
    let named = outcome.named();
    let named = named.iter().map(|(name, answers)| (*name, answers));
    let broken = output.check_limits(&limits, (sites, surface), named, None)?;
    let mut result = say(&outcome, (&premise, share), &clock, &paths, output);
    result["limits_broken"] = broken;
    args.read.add_origin(&mut result);
    output.result_with_files(result, &paths);
    Ok(())
}

impl Args {
    fn limits(&self) -> Result<Vec<Limit>> {
        self.gate.limits(&["occlusion", "rest"])
    }

    fn tools(&self, output: &Output) -> Result<Vec<Tool>> {
        with_names(self.defaults.read(&self.library, output)?)
    }

    /// What the tools reach on a part that was read.
    fn reach(
        &self,
        (part, mesh): (&Path, Mesh),
        (tools, share): (Vec<Tool>, f64),
        observer: &mut dyn Observer,
        output: &Output,
    ) -> Result<ToolsOutcome> {
        let tools = self.surface.tolerances.with_allowance(tools)?;
        warn_wide_tools(&mesh, &tools, output);
        let analysis = Analysis::new(name_of(part), mesh, tools)
            .library(true)
            .options(self.surface.options()?)
            .directions(self.directions.directions()?);
        let analysis = self.surface.add_to(analysis, &self.read, output)?;
        let placed = self.region.place(analysis, &self.sites, &self.read, output)?;
        let outcome = placed.reach(share, observer)?;
        outcome.notices().iter().for_each(|notice| output.say(notice));
        outcome.warnings().iter().for_each(|warning| output.warn(warning));
        Ok(outcome)
    }
}

/// Keys and names of what [`ToolsOutcome::seconds`] has.
const STAGES: [[&str; 2]; 4] = [
    ["sites_s", "sites"],
    ["index_s", "search tree"],
    ["tools_s", "tools"],
    ["tolerances_s", "tolerances"],
];

/// The answer for people; as JSON for the result.
fn say(
    outcome: &ToolsOutcome,
    (premise, share): (&str, f64),
    clock: &Clock,
    paths: &[PathBuf],
    output: &Output,
) -> Value {
    let (placed, library) = (outcome.placed(), outcome.library());
    let (rests, cover) = (outcome.rests_on_tolerance(), &library.cover);
    let area_mm2 = placed.shown().0.map_or(0.0, Mesh::area);
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(placed.part()));
    part_itself::add_rests(&mut facts, rests.iter().copied().max().unwrap_or(0));
    facts.add("finish_mm", "finish tolerance, mm", Cell::Given(placed.options().finish_mm));
    facts.add("area_mm2", "surface, mm²", Cell::Number(area_mm2));
    facts.add("n_sites", "sites", Cell::count(placed.sites().len()));
    facts.add("n_tools", "tools", Cell::count(library.tools().len()));
    let unreached = Cell::Share(library.unreached());
    facts.add("unreached", "of the surface, out of reach of every tool", unreached);
    let needed = "tools that reach the share of what can be reached";
    facts.add("n_needed", needed, Cell::count(cover.chosen.len()));
    facts.add("n_needed_at_least", "no fewer than", Cell::count(cover.at_least));
    facts.add("share", "share for the tools and the least stick-out", Cell::Share(share));
    facts.add("n_needed_for_all", "tools that reach all of it", Cell::count(library.n_for_all));
    clock.add_to(&mut facts);
    let mut result = facts.json();
    output.say(premise);
    region::say(placed.region(), &mut result, output);
    output.say(facts.text_in(output.unit()));
    output.files(paths);
    let (table, fewest) = (library.table(), library.cover_table());
    output.say(table.text_in(output.unit()));
    output.say(fewest.text_in(output.unit()));
    let named = library.tools().iter().zip(rests);
    let named = named.map(|(tool, n)| json!({ "name": tool.name, "n_sites": n }));
    result["rests_on_tolerance_of"] = named.collect();
    result["premise"] = json!(premise);
    result["tools"] = table.json();
    result["smallest_set"] = fewest.json();
    result["smallest_set_is_proven"] = json!(cover.is_smallest());
    result
}
