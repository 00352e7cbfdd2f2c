//! `deepmill label`: which sites of a part a cutter cannot reach, computed exactly.

use crate::args::{CutterArgs, DirectionArgs, SiteArgs, Tool, name_of};
use crate::clock::Clock;
use crate::density;
use crate::mesh_args::MeshArgs;
use crate::output::Output;
use deepmill::Result;
use deepmill::access::{self, Engine, LabelOptions, Labels, Obstacles};
use deepmill::data::files::{About, LabelFile};
use deepmill::directions::Directions;
use deepmill::geom::sites::{self, SiteOptions};
use deepmill::geom::spacing::Spacing;
use deepmill::geom::{Mesh, Sites};
use deepmill::report::folder::{self, Show};
use deepmill::report::tables::{Cell, Facts};
use serde_json::json;
use std::path::PathBuf;

/// Compute exactly which sites of a part a cutter cannot reach, and which sites are in its way.
///
/// Writes to DIR: labels.npz (numbers), labels.ply (coloured points), labels.png (picture) and
/// part.stl (the surface as used, in mm).
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill label part.stl --cutter 1.5,6,40,5 --out labels")]
pub struct Args {
    /// Mesh (STL, OBJ, PLY, 3MF) or cloud of points with normals (PLY, NPZ).
    part: PathBuf,
    #[command(flatten)]
    read: MeshArgs,
    #[command(flatten)]
    cutter: CutterArgs,
    #[command(flatten)]
    sites: SiteArgs,
    #[command(flatten)]
    directions: DirectionArgs,
    /// Also collide with this many further points of the surface: closer to the truth.
    #[arg(long, value_name = "COUNT")]
    obstacles: Option<usize>,
    /// How to compute; all engines give the same labels.
    #[arg(long, value_name = "NAME", default_value_t = LabelOptions::default().engine.name().into())]
    engine: String,
    /// Share of the sites that are occlusion points.
    #[arg(long, value_name = "SHARE", default_value_t = LabelOptions::default().share)]
    occlusion_share: f64,
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Draw no picture.
    #[arg(long)]
    no_picture: bool,
    /// Label a mesh that does not bound one solid; the answer may mean nothing.
    #[arg(long)]
    force: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let tool = args.cutter.tool()?;
    let directions = args.directions.directions()?;
    let engine = Engine::named(&args.engine)?;
    let options = LabelOptions { engine, share: args.occlusion_share, ..LabelOptions::default() };

    let mut clock = Clock::start();
    let part = args.read.read_part(&args.part, args.force, output)?;
    clock.lap("read_s", "reading");
    let (mesh, sites) = args.sites.place(part)?;
    let more = further_obstacles(args, mesh.as_ref(), output)?;
    clock.lap("sites_s", "sites");
    let obstacles = match &more {
        Some(sites) => Obstacles::QueriesAnd(&sites.points),
        None => Obstacles::Queries,
    };
    let labels = access::label(&sites, obstacles, &tool.cutter, &directions, &options)?;
    clock.lap("labels_s", "labels");

    let about = about(args, &tool, &directions, mesh.is_some());
    let file = LabelFile { about, sites, labels };
    let show = if args.no_picture { Show::Points } else { Show::Pictures };
    let mut paths = folder::write_labels(&args.out, &file, mesh.as_ref(), show)?;
    if let Some(mesh) = &mesh {
        paths.push(folder::write_surface(&args.out, mesh)?);
    }
    clock.lap("write_s", "writing and drawing");

    let mut facts = facts(&file, &directions);
    let mut spacing = density::add_spacing(&mut facts, &file.sites);
    if let Some(denser) = more.filter(|more| more.len() > file.sites.len()) {
        spacing = Spacing::measure_on_sheet(&denser);
    }
    let warning = spacing.and_then(|s| density::add_advice(&mut facts, &s, tool.params.cr_mm));
    clock.add_to(&mut facts);
    output.say(facts.text());
    if let Some(warning) = warning {
        output.warn(format!("{warning}: raise --sites, or add --obstacles"));
    }
    output.files(&paths);
    output.result_with_files(facts.json(), &paths);
    Ok(())
}

/// Points of the surface beside the sites, from another stream of the same seed.
fn further_obstacles(args: &Args, mesh: Option<&Mesh>, output: &Output) -> Result<Option<Sites>> {
    match (args.obstacles, mesh) {
        (None, _) => Ok(None),
        (Some(_), None) => {
            output.warn("--obstacles needs a mesh; a cloud collides with its own points only");
            Ok(None)
        }
        (Some(n_sites), Some(mesh)) => {
            let seed = args.sites.seed.wrapping_add(1);
            let options = SiteOptions { n_sites, seed, ..SiteOptions::default() };
            sites::sample(mesh, &options).map(Some)
        }
    }
}

fn about(args: &Args, tool: &Tool, directions: &Directions, has_mesh: bool) -> About {
    let settings = json!({
        "sites": args.sites.settings(has_mesh),
        "tool": tool.settings,
        "directions": directions.set(),
        "n_directions": directions.len(),
        "further_obstacles": args.obstacles,
        "occlusion_share": args.occlusion_share,
        "engine": args.engine,
    });
    About { part: name_of(&args.part), cutter: tool.params, tool: tool.words.clone(), settings }
}

fn facts(file: &LabelFile, directions: &Directions) -> Facts {
    let Labels { inaccessible, occlusion, accessible_directions, .. } = &file.labels;
    let n = file.sites.len();
    let share = |count: usize| Cell::Share(count as f64 / n.max(1) as f64);
    let count = |flags: &[bool]| flags.iter().filter(|f| **f).count();
    let both = inaccessible.iter().zip(occlusion).filter(|(a, b)| **a && **b).count();
    let free: u64 = accessible_directions.iter().map(|d| u64::from(*d)).sum();
    let mean = free as f64 / (n * directions.len()).max(1) as f64;
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(&file.about.part));
    facts.add("cutter", "cutter", Cell::text(&file.about.tool));
    facts.add("n_sites", "sites", Cell::count(n));
    facts.add("n_directions", "directions", Cell::count(directions.len()));
    facts.add("inaccessible", "inaccessible", share(count(inaccessible)));
    facts.add("occlusion", "occlusion", share(count(occlusion)));
    facts.add("both", "inaccessible and occlusion", share(both));
    facts.add("free_directions", "directions that reach a site, mean", Cell::Share(mean));
    facts
}
