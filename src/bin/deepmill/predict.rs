//! `deepmill predict`: predicts with a network which sites of a part a cutter cannot reach.

use crate::args::{CutterArgs, SiteArgs, name_of};
use crate::clock::Clock;
use crate::mesh_args::{Accept, MeshArgs};
use crate::model_args::ModelArgs;
use crate::output::Output;
use deepmill::data::files::{PredictionFile, Provenance};
use deepmill::model::Predictor;
use deepmill::report::export::Extra;
use deepmill::report::findings::Findings;
use deepmill::report::folder::{self, Show};
use deepmill::report::page::{Page, View};
use deepmill::report::tables::{Cell, Facts};
use deepmill::{Error, Result, atomic_file};
use serde_json::json;
use std::path::PathBuf;

/// Predict which sites of a part a ball-end cutter cannot reach, and which sites are in its way.
///
/// Writes to DIR: predictions.npz (numbers), predictions.ply (colored points), predictions.png
/// (picture) and part.stl (the surface as used, in mm).
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill predict part.stl --cutter 1.5,6,40,5 --out predictions")]
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
    model: ModelArgs,
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Draw no picture.
    #[arg(long)]
    no_picture: bool,
    /// Also write these: `glb` (binary glTF in the colors of the answers), `csv` (a row per site); several with commas.
    #[arg(long, value_name = "FORMATS", value_delimiter = ',')]
    also: Vec<String>,
    /// Also write report.html, a page to send: 3-D view with sections, findings, settings, warnings.
    #[arg(long)]
    report: bool,
    /// Take a mesh that does not bound one solid; the answer may mean nothing.
    #[arg(long)]
    force: bool,
    /// Answer even far outside of the sizes that the network was trained for; the answer may mean nothing.
    #[arg(long)]
    far: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let tool = args.cutter.tool()?;
    let also = args.also.iter().map(|name| name.parse()).collect::<Result<Vec<Extra>>>()?;
    if tool.cutter.as_ball_end().is_none() {
        let remedy = "leave out --corner and --clearance, or use `deepmill label`";
        let expected = "a ball end without clearance: the network knows no other";
        return Err(Error::argument("cutter", tool.words(), expected, remedy));
    }
    atomic_file::check_writable_folder(&args.out)?;
    let (model, model_name) = args.model.read()?;
    let mut clock = Clock::start();
    let part = args.read.read_part(&args.part, Accept::one_body_or(args.force), output)?;
    clock.lap("read_s", "reading");
    let (mesh, sites) = args.sites.place(part)?;
    clock.lap("sites_s", "sites");
    let settings = json!({
        "sites": args.sites.settings(mesh.is_some()),
        "model": model_name,
    });
    let definition = model.definition.map(|definition| definition.to_string());
    let predictor = Predictor::new(model);
    let predictor = if args.far { predictor.accept_far() } else { predictor };
    let (prediction, outside) = predictor.predict(&sites, &tool.cutter)?;
    let outside: Vec<String> = outside.iter().map(ToString::to_string).collect();
    for outside in &outside {
        output.warn(format!("{outside}: the prediction may be wrong; `deepmill label` is exact"));
    }
    clock.lap("predict_s", "prediction");
    let mut provenance = Provenance::ball_end(name_of(&args.part), tool.params, settings);
    provenance.settings["outside_domain"] = json!(outside);
    provenance.settings["definition"] = json!(definition);
    let file = PredictionFile { prediction, provenance, sites };
    let show = if args.no_picture { Show::Points } else { Show::Pictures };
    let mut paths = folder::write_predictions(&args.out, &file, mesh.as_ref(), show)?;
    let export = |extra| folder::export_predictions(&args.out, &file, mesh.as_ref(), extra);
    paths.extend(also.into_iter().map(export).collect::<Result<Vec<_>>>()?);
    if let Some(mesh) = &mesh {
        paths.push(folder::write_surface(&args.out, mesh)?);
    }
    if args.report {
        let (mesh, sites) = (mesh.as_ref(), &file.sites);
        let findings = Findings::of(sites, mesh, &file.prediction.answers(), &[])?;
        let views = [View::of_predictions(&file, findings)];
        let page = Page { part: &file.provenance.part, mesh, sites, views: &views };
        paths.push(page.write(&args.out)?);
    }
    clock.lap("write_s", "writing and drawing");

    let share = |flags: Vec<bool>| {
        Cell::Share(flags.iter().filter(|f| **f).count() as f64 / flags.len().max(1) as f64)
    };
    let answers = file.prediction.answers();
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(&file.provenance.part));
    facts.add("definition", "definition", definition.map_or(Cell::Missing, Cell::text));
    facts.add("cutter", "cutter", Cell::text(&file.provenance.tool));
    facts.add("n_sites", "sites", Cell::count(file.sites.len()));
    facts.add("inaccessible", "inaccessible", share(answers.inaccessible));
    facts.add("occlusion", "occlusion", share(answers.occlusion));
    clock.add_to(&mut facts);
    output.say(facts.text());
    output.files(&paths);
    let mut result = facts.json();
    result["outside_domain"] = json!(outside);
    output.result_with_files(result, &paths);
    Ok(())
}
