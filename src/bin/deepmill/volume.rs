//! `deepmill label --volume`: where in the space around a part the cutter's tip can be.

use crate::args::name_of;
use crate::clock::Clock;
use crate::label::Args;
use crate::output::Output;
use crate::premise::premise;
use deepmill::access::Queries;
use deepmill::access::surface::SurfaceOptions;
use deepmill::answers::Definition;
use deepmill::data::files::settings::ToolSettings;
use deepmill::data::files::tools::Tool;
use deepmill::data::files::volume::{PointAnswer, VolumeFile};
use deepmill::data::files::{AnalysisSettings, Provenance};
use deepmill::geom::formats::MeshOrCloud;
use deepmill::geom::inside::{Lattice, lattice_inside};
use deepmill::report::section;
use deepmill::report::tables::{Cell, Facts};
use deepmill::{Error, Result};
use glam::Vec3;
use serde_json::json;
use std::path::PathBuf;

pub fn run(
    args: &Args,
    step_mm: f64,
    (part, tools): (MeshOrCloud, Vec<Tool>),
    mut clock: Clock,
    output: &Output,
) -> Result<()> {
    let (MeshOrCloud::Mesh(mesh), [tool]) = (part, &tools[..]) else {
        let found = format!("{}, {} tools", name_of(&args.part), tools.len());
        let remedy = "leave out --volume for a cloud, and name one tool at a time";
        return Err(Error::argument("--volume", found, "a mesh and one tool", remedy));
    };
    let allowance = tool.assembly.allowance_mm();
    if allowance > 0.0 {
        let remedy = "leave it out: what the tool itself removes is labeled";
        return Err(Error::argument("--allowance", allowance, "0 with --volume", remedy));
    }
    let directions = args.directions.directions()?;
    let (low, high) = mesh.bounds().unwrap_or_default();
    let lattice = Lattice::covering(low, high, step_mm)?;
    let inside = lattice_inside(&mesh, &lattice)?;
    let outside = (0..lattice.len()).filter(|&n| !inside[n]);
    let mut points: Vec<Vec3> = Vec::with_capacity(outside.clone().count());
    points.extend(outside.map(|n| lattice.point(n).as_vec3()));
    clock.lap("points_s", "points");
    let obstacles = args.surface.obstacles(&mesh, &args.read, output)?;
    let options = SurfaceOptions { occlusion: false, ..args.surface.options(1.0)? };
    let labels = obstacles.label(Queries::Volume(&points), &tool.cutter, &directions, &options)?;
    clock.lap("labels_s", "labels");

    let mut settings = AnalysisSettings::default();
    settings.tool = Some(ToolSettings::of(tool));
    settings.directions = Some(directions.set().clone());
    settings.n_directions = Some(labels.n_directions);
    settings.definition = Some(Definition::PartInSpace);
    settings.part_itself = Some(args.surface.settings());
    settings.origin_mm = args.read.origin_mm();
    let provenance =
        Provenance { part: name_of(&args.part), cutter: tool.params, tool: tool.words(), settings };
    let file = VolumeFile::new(provenance, lattice, &inside, &labels)?;
    let paths = write(args, &file)?;
    clock.lap("write_s", "writing and drawing");

    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(name_of(&args.part)));
    facts.add("definition", "definition", Cell::text("the part itself, in space"));
    facts.add("cutter", "cutter", Cell::text(tool.words()));
    facts.add("n_points", "points outside the part", Cell::count(points.len()));
    facts.add("step_mm", "step", Cell::Given(step_mm));
    facts.add("n_directions", "directions", Cell::count(labels.n_directions));
    for (key, answer) in [
        ("accessible", PointAnswer::Accessible),
        ("inaccessible", PointAnswer::Inaccessible),
        ("tip_does_not_fit", PointAnswer::TipDoesNotFit),
    ] {
        facts.add(key, answer.words(), Cell::Share(file.share(answer)));
    }
    clock.add_to(&mut facts);
    let premise = premise(&directions, &args.surface);
    output.say(&premise);
    output.say(facts.text_in(output.unit()));
    output.files(&paths);
    let mut result = facts.json();
    result["premise"] = json!(premise);
    output.result_with_files(result, &paths);
    Ok(())
}

fn write(args: &Args, file: &VolumeFile) -> Result<Vec<PathBuf>> {
    let mut paths = vec![args.out.join("volume.npz")];
    file.write(&paths[0])?;
    if !args.no_picture {
        let path = args.out.join("volume.png");
        section::draw(file, section::most_mixed_layer(file)).write_png(&path)?;
        paths.push(path);
    }
    Ok(paths)
}
