//! `deepmill tools`: what every tool of a library reaches on a part, in one pass.

use crate::args::{DirectionArgs, GateArgs, SiteArgs, UnsaidArgs, name_of, share, with_names};
use crate::clock::Clock;
use crate::mesh_args::{MeshArgs, warn_wide_tools};
use crate::output::Output;
use crate::part_itself::{self, SurfaceArgs};
use crate::premise::premise;
use crate::progress;
use crate::region::{self, RegionArgs};
use deepmill::access::surface::{SiteAnswer, ToolReach, Warning};
use deepmill::analysis::{Analysis, without_area};
use deepmill::answers::SiteAnswers;
use deepmill::cutter::Assembly;
use deepmill::data::files::tools::Tool;
use deepmill::geom::Mesh;
use deepmill::report::PartView;
use deepmill::report::coverage::Coverage;
use deepmill::report::folder::Show;
use deepmill::report::gate::SiteAreas;
use deepmill::report::library::Library;
use deepmill::report::tables::{Cell, Facts};
use deepmill::{Result, atomic_file};
use serde_json::json;
use std::path::PathBuf;

/// Say what every tool of a library reaches on a part, which few of them reach nearly all, and how little each may
/// stick out.
///
/// Writes to DIR: tools.csv (the table, a tool table again), stick-out.csv and stick-out.svg (area within reach by
/// stick-out), tools.ply and tools.png (the first tool that reaches each site) and part.stl (the surface as used, in
/// mm).
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill tools part.stl --library shop.json --out tools\n\
Tool bits: deepmill tools part.stl --library Bit --stick-out 35 --holder er20.csv --out tools")]
pub struct Args {
    /// Mesh (STL, OBJ, PLY, 3MF).
    part: PathBuf,
    #[command(flatten)]
    read: MeshArgs,
    /// Files of tools: Fusion 360 libraries (JSON), FreeCAD tool bits (.fctb) or folders of them, LinuxCNC tables
    /// (.tbl), CSV tables.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    library: Vec<PathBuf>,
    #[command(flatten)]
    unsaid: UnsaidArgs,
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
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Draw no picture of the part.
    #[arg(long)]
    no_picture: bool,
    /// Take a mesh that does not bound one solid; the answer may mean nothing.
    #[arg(long)]
    force: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let limits = args.gate.limits(&["occlusion"])?;
    let share = share(&args.share)?;
    let tools = with_names(args.unsaid.read(&args.library, output)?)?;
    let tools = args.surface.tolerances.with_allowance(tools)?;
    let options = args.surface.options(1.0)?;
    let directions = args.directions.directions()?;
    atomic_file::check_writable_folder(&args.out)?;
    let mut clock = Clock::start();
    let mesh = args.read.read_bodies(&args.part, args.force, output)?;
    warn_wide_tools(&mesh, &tools, output);
    clock.lap("read_s", "reading");
    let name = name_of(&args.part);
    let analysis = Analysis::new(&*name, mesh, tools.clone());
    let analysis = args.surface.add_to(analysis, &args.read, output)?;
    let placed = args.region.place(analysis, &args.sites, &args.read, output)?;
    let (surface, of_surface) = placed.shown();
    let sites = placed.sites();
    let areas = SiteAreas::of(of_surface, surface)?;
    clock.lap("sites_s", "sites");
    let obstacles = placed.obstacles()?.expect("triangles of a mesh block");
    without_area(&obstacles).iter().for_each(|notice| output.say(notice));
    clock.lap("index_s", "search tree");
    let held: Vec<Assembly> = tools.iter().map(Tool::held).collect::<Result<_>>()?;
    let progress = progress::bar(1, "pass over all tools");
    let reach = obstacles.reach_many(sites, &held, &directions, &options)?;
    progress.finish_and_clear();
    clock.lap("tools_s", "tools");
    let library = Library::new(&tools, &reach, &areas, share)?;
    let mut rests = Vec::new();
    for (tool, reach) in tools.iter().zip(&reach) {
        let found = (&accessible(reach)[..], &reach.witness[..]);
        let cutter = &tool.cutter;
        let of_tool =
            obstacles.rest_on_wide_tolerance(sites, cutter, &directions, &options, found)?;
        rests.push(of_tool.iter().filter(|rests| **rests).count());
        if tool.clearance_mm > 0.0 && !found.0.contains(&true) {
            let (without, answered) = (tool.assembly.cutter()?, (&options, &reach.answers[..]));
            let closed =
                obstacles.share_closed_by_clearance(sites, &without, &directions, answered)?;
            let warning = Warning::of_clearance(tool.clearance_mm, closed, false);
            warning.iter().for_each(|warning| output.warn(format!("{}: {warning}", tool.name)));
        }
    }
    clock.lap("tolerances_s", "tolerances");

    let show = if args.no_picture { Show::Points } else { Show::Pictures };
    let mut paths = library.write(&args.out, output.unit())?;
    let accessible: Vec<Vec<bool>> = reach.iter().map(accessible).collect();
    let words = format!("{} tools", tools.len());
    let view = PartView {
        name: &name,
        mesh: surface,
        sites: of_surface,
        cutter: &words,
        outlines: &placed.outlines(),
    };
    paths.extend(
        Coverage::of_reached(&tools, &accessible, &areas).write_first(&args.out, view, show)?,
    );
    paths.extend(placed.write_surfaces(&args.out)?);
    clock.lap("write_s", "writing and drawing");

    let answers: Vec<SiteAnswers> = reach.iter().map(answers).collect();
    let named = tools.iter().zip(&answers).map(|(tool, answers)| (&*tool.name, answers));
    let broken = output.check_limits(&limits, (of_surface, surface), named)?;
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(&name));
    part_itself::add_rests(&mut facts, rests.iter().copied().max().unwrap_or(0));
    facts.add("finish_mm", "finish tolerance, mm", Cell::Given(options.finish_mm));
    facts.add("area_mm2", "surface, mm²", Cell::Number(surface.map_or(0.0, Mesh::area)));
    facts.add("n_sites", "sites", Cell::count(sites.len()));
    facts.add("n_tools", "tools", Cell::count(tools.len()));
    facts.add(
        "unreached",
        "of the surface, out of reach of every tool",
        Cell::Share(library.unreached()),
    );
    facts.add(
        "n_needed",
        "tools that reach the share of what can be reached",
        Cell::count(library.cover.chosen.len()),
    );
    facts.add("n_needed_at_least", "no fewer than", Cell::count(library.cover.at_least));
    facts.add("share", "share for the tools and the least stick-out", Cell::Share(share));
    facts.add("n_needed_for_all", "tools that reach all of it", Cell::count(library.n_for_all));
    clock.add_to(&mut facts);
    let premise = premise(&directions, &args.surface);
    let mut result = facts.json();
    output.say(&premise);
    region::say(placed.region(), &mut result, output);
    output.say(facts.text_in(output.unit()));
    output.files(&paths);
    let (table, cover) = (library.table(), library.cover_table());
    output.say(table.text_in(output.unit()));
    output.say(cover.text_in(output.unit()));
    let named = tools.iter().zip(&rests);
    let named = named.map(|(tool, n)| json!({ "name": tool.name, "n_sites": n }));
    result["rests_on_tolerance_of"] = named.collect();
    result["premise"] = json!(premise);
    result["tools"] = table.json();
    result["smallest_set"] = cover.json();
    result["smallest_set_is_proven"] = json!(library.cover.is_smallest());
    result["limits_broken"] = broken;
    args.read.add_origin(&mut result);
    output.result_with_files(result, &paths);
    Ok(())
}

fn accessible(reach: &ToolReach) -> Vec<bool> {
    reach.answers.iter().map(|answer| *answer == SiteAnswer::Accessible).collect()
}

fn answers(reach: &ToolReach) -> SiteAnswers {
    let is = |wanted: SiteAnswer| reach.answers.iter().map(|answer| *answer == wanted).collect();
    let mut answers = SiteAnswers::new(is(SiteAnswer::Inaccessible), Vec::new());
    answers.tip_does_not_fit = is(SiteAnswer::TipDoesNotFit);
    answers
}
