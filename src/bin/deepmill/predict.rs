//! `deepmill predict`: predicts with a network which sites of a part a cutter cannot reach.

use crate::args::{DirectionArgs, GateArgs, SiteArgs, ToolArgs, name_of};
use crate::clock::Clock;
use crate::mesh_args::{Accept, MeshArgs, warn_wide_tools};
use crate::model_args::ModelArgs;
use crate::output::Output;
use deepmill::access::LabelOptions;
use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
use deepmill::answers::{Definition, OutsideDomain, SiteAnswers};
use deepmill::data::files::settings::VerifySettings;
use deepmill::data::files::tools::Tool;
use deepmill::data::files::{AnalysisSettings, PredictionFile, Provenance};
use deepmill::geom::units::Unit;
use deepmill::geom::{Mesh, Sites};
use deepmill::model::{Prediction, Predictor};
use deepmill::report::export::Extra;
use deepmill::report::findings::Findings;
use deepmill::report::folder::{self, Show};
use deepmill::report::page::{Page, View};
use deepmill::report::tables::{Cell, Facts, Table};
use deepmill::{Error, Result, atomic_file};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Predict which sites of a part a ball-end cutter cannot reach, and which sites are in its way.
///
/// Writes to DIR: predictions.npz (numbers), predictions.ply (colored points), predictions.png (picture) and part.stl
/// (the surface as used, in mm). With --tools, each ball end of the files has the first three in a folder DIR/NAME of
/// its own; others are left out by name. With --verify answers are computed as `deepmill label` does, the least certain
/// first, until a random sample of the others bounds the share of them that is wrong.
#[derive(clap::Args)]
#[command(
    after_help = "Example: deepmill predict part.stl --cutter 1.5,6,40,5 --out predictions\n\
A library: deepmill predict part.stl --tools library.json --out predictions\n\
With proof: deepmill predict part.stl --cutter 1.5,6,40,5 --verify 0.01 --out predictions"
)]
pub struct Args {
    /// Mesh (STL, OBJ, PLY, 3MF) or cloud of points with normals (PLY, NPZ).
    part: PathBuf,
    #[command(flatten)]
    read: MeshArgs,
    #[command(flatten)]
    tools: ToolArgs,
    #[command(flatten)]
    sites: SiteArgs,
    #[command(flatten)]
    model: ModelArgs,
    /// Compute sites, the least certain first, until at most this share of the other answers `inaccessible` of this
    /// part and tool is wrong, at a confidence of 95 %: random samples of them, drawn by --seed, are computed to
    /// compare. 0.01 if no share is given, `all` for every site. The occlusion points follow from all answers; no
    /// bound is stated on them.
    #[arg(long, value_name = "SHARE", num_args = 0..=1, default_missing_value = "0.01", value_parser = verify_bound)]
    verify: Option<f64>,
    /// For --verify: the directions tested.
    #[command(flatten)]
    directions: DirectionArgs,
    #[command(flatten)]
    gate: GateArgs,
    /// Share of the sites that are occlusion points: those that the network finds likeliest, or with --verify those of
    /// greatest β.
    #[arg(long, allow_negative_numbers = true, value_name = "SHARE", default_value_t = LabelOptions::default().share, value_parser = occlusion_share)]
    occlusion_share: f64,
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
    let only_computed = ["tip_does_not_fit"];
    let unknown = if args.verify == Some(0.0) { &[][..] } else { &only_computed };
    let limits = args.gate.limits(unknown)?;
    let directions = args.directions.directions()?;
    args.tools.check_one_cutter()?;
    let tools = known_to_networks(args.tools.tools(output)?, output)?;
    let also = args.also.iter().map(|name| name.parse()).collect::<Result<Vec<Extra>>>()?;
    atomic_file::check_writable_folder(&args.out)?;
    let (model, model_name) = args.model.read()?;
    let mut clock = Clock::start();
    let part = args.read.read_part(&args.part, Accept::bodies_or(args.force), output)?;
    clock.lap("read_s", "reading");
    let (mesh, sites) = args.sites.place(part)?;
    mesh.iter().for_each(|mesh| warn_wide_tools(mesh, &tools, output));
    clock.lap("sites_s", "sites");
    let obstacles = args.verify.map(|_| part_to_verify(model.definition, mesh.as_ref()));
    let obstacles = obstacles.transpose()?;
    let mut settings = AnalysisSettings::default();
    settings.sites = Some(args.sites.settings(mesh.is_some()));
    settings.model = Some(model_name);
    settings.definition = model.definition;
    settings.origin_mm = args.read.origin_mm();
    settings.verify = args
        .verify
        .map(|bound| VerifySettings::new((bound, args.sites.seed), directions.set().clone()));
    let predictor = Predictor::new(model);
    let predictor = if args.far { predictor.accept_far() } else { predictor };
    Show::pictures_unless(args.no_picture).require_memory(mesh.as_ref(), &sites)?;
    let about = About { args, settings, sites, mesh };
    let mut files = Vec::new();
    for tool in tools {
        match predictor.predict(&about.sites, &tool.cutter) {
            Ok((prediction, outside)) => {
                let outside = about.say_outside(&tool, &outside, output);
                files.push((about.file(&tool, prediction, &outside), tool, outside));
            }
            // One tool of several that is too far from what the network knows.
            Err(error @ Error::Argument { .. }) if args.tools.are_several() => {
                output.warn(format!("{}: {error}; it is left out", tool.name));
            }
            Err(error) => return Err(error),
        }
    }
    if files.is_empty() {
        let expected = "a tool like those that the network was trained on";
        let remedy = "use `deepmill label`, or accept guesses (--far)";
        return Err(Error::argument("--tools", "all left out", expected, remedy));
    }
    clock.lap("predict_s", "prediction");
    if let (Some(bound), Some(obstacles)) = (args.verify, &obstacles) {
        for (file, tool, _) in &mut files {
            let with = (&tool.cutter, &directions);
            let options =
                SurfaceOptions { share: args.occlusion_share, ..SurfaceOptions::default() };
            let predicted = file.prediction.answers();
            let bound = (bound, args.sites.seed);
            let verified = obstacles.verify(&about.sites, with, &options, &predicted, bound)?;
            file.verified = Some(verified);
        }
        clock.lap("verify_s", "verification");
    }
    let paths = about.write(&files, &also, output.unit())?;
    clock.lap("write_s", "writing and drawing");

    let answers: Vec<SiteAnswers> = files.iter().map(|(f, ..)| f.answers()).collect();
    let named = files.iter().zip(&answers).map(|((_, tool, _), answers)| (&*tool.name, answers));
    let broken = output.check_limits(&limits, (&about.sites, about.mesh.as_ref()), named)?;
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(name_of(&args.part)));
    facts.add("definition", "definition", about.definition());
    if !args.tools.are_several() {
        facts.add("cutter", "cutter", Cell::text(&files[0].0.provenance.tool));
    }
    facts.add("n_sites", "sites", Cell::count(about.sites.len()));
    if !args.tools.are_several() {
        facts.add("inaccessible", "inaccessible", share(&answers[0].inaccessible));
        facts.add("occlusion", "occlusion", share(&answers[0].occlusion));
        if let Some(verified) = &files[0].0.verified {
            facts.add("verified", "computed", share(&verified.verified));
            facts.add("spot_check", "spot check", spot_check(&files[0].0));
            facts.add("counted", "beta counted", Cell::Share(verified.share_counted()));
        }
    }
    clock.add_to(&mut facts);
    output.say(facts.text_in(output.unit()));
    output.files(&paths);
    let mut result = facts.json();
    result["limits_broken"] = broken;
    if args.tools.are_several() {
        let table = table(
            files.iter().zip(&answers).map(|((file, tool, _), answers)| (file, tool, answers)),
        );
        output.say(table.text_in(output.unit()));
        result["tools"] = table.json();
        for (row, (file, tool, outside)) in (0..).zip(&files) {
            result["tools"][row]["spot_check"] = numbers_of_check(file);
            result["tools"][row]["outside_domain"] = json!(outside);
            result["tools"][row]["folder"] = json!(tool.folder());
        }
    } else {
        result["outside_domain"] = json!(files[0].2);
        if args.verify.is_some() {
            result["spot_check"] = numbers_of_check(&files[0].0);
        }
    }
    output.result_with_files(result, &paths);
    Ok(())
}

/// The ball ends without clearance; others are named, and none left is an error.
fn known_to_networks(tools: Vec<Tool>, output: &Output) -> Result<Vec<Tool>> {
    let expected = "a ball end without clearance, shank as wide as the ball, in one cylindrical holder: the network knows no other";
    let (known, others): (Vec<Tool>, Vec<Tool>) = tools
        .into_iter()
        .partition(|tool| tool.clearance_mm == 0.0 && tool.cutter.as_ball_end().is_some());
    match (known.is_empty(), others.first()) {
        (true, Some(tool)) => {
            let remedy = "leave out --corner and --clearance, or use `deepmill label`";
            Err(Error::argument("cutter", tool.words(), expected, remedy))
        }
        _ => {
            for tool in others {
                output.warn(format!(
                    "{} ({}): expected {expected}; it is left out",
                    tool.name,
                    tool.words()
                ));
            }
            Ok(known)
        }
    }
}

fn share(flags: &[bool]) -> Cell {
    Cell::Share(flags.iter().filter(|f| **f).count() as f64 / flags.len().max(1) as f64)
}

/// In words.
fn spot_check(file: &PredictionFile) -> Cell {
    let check = file.verified.as_ref().and_then(|verified| verified.spot_check);
    check.map_or(Cell::Missing, |check| Cell::text(check.to_string()))
}

/// For programs.
fn numbers_of_check(file: &PredictionFile) -> Value {
    json!(file.verified.as_ref().and_then(|verified| verified.spot_check))
}

fn table<'a>(rows: impl Iterator<Item = (&'a PredictionFile, &'a Tool, &'a SiteAnswers)>) -> Table {
    let mut table = Table::new(&[
        ("name", "tool"),
        ("words", ""),
        ("inaccessible", "inaccessible"),
        ("occlusion", "occlusion"),
        ("verified", "computed"),
        ("spot_check", "spot check"),
    ]);
    for (file, tool, answers) in rows {
        table.row([
            Cell::text(&tool.name),
            Cell::text(tool.words()),
            share(&answers.inaccessible),
            share(&answers.occlusion),
            file.verified.as_ref().map_or(Cell::Missing, |verified| share(&verified.verified)),
            spot_check(file),
        ]);
    }
    table
}

/// `all`, which is 0, or a share.
pub fn verify_bound(text: &str) -> std::result::Result<f64, String> {
    if text == "all" {
        return Ok(0.0);
    }
    let bound = text.parse().ok().filter(|bound: &f64| *bound > 0.0 && *bound < 1.0);
    bound.ok_or_else(|| "expected `all` or a share above 0 and below 1, such as 0.01".into())
}

fn occlusion_share(text: &str) -> std::result::Result<f64, String> {
    let share = text.parse().ok().filter(|share: &f64| *share > 0.0 && *share <= 1.0);
    share.ok_or_else(|| "expected a share above 0, at most 1, such as 0.1".into())
}

/// The triangles to verify against, if the network answers about them.
fn part_to_verify(learned: Option<Definition>, mesh: Option<&Mesh>) -> Result<TriangleObstacles> {
    let refused = |found| {
        let expected = "a mesh, and a network that learned about the part itself";
        let remedy =
            "leave it out, or use `deepmill label`, which is exact and takes as little time";
        Err(Error::argument("--verify", found, expected, remedy))
    };
    match (learned, mesh) {
        (Some(Definition::Sites), _) => {
            refused("given with a network that learned the published definition")
        }
        (_, None) => refused("given with a cloud of points"),
        (_, Some(mesh)) => TriangleObstacles::new(mesh, &[]),
    }
}

/// What all predictions of a run share.
struct About<'a> {
    args: &'a Args,
    settings: AnalysisSettings,
    sites: Sites,
    mesh: Option<Mesh>,
}

impl About<'_> {
    fn definition(&self) -> Cell {
        let definition = self.settings.definition;
        definition.map_or(Cell::Missing, |definition| Cell::text(definition.to_string()))
    }

    fn say_outside(&self, tool: &Tool, outside: &[OutsideDomain], output: &Output) -> Vec<String> {
        let of =
            if self.args.tools.are_several() { format!("{}: ", tool.name) } else { String::new() };
        let outside: Vec<String> = outside.iter().map(ToString::to_string).collect();
        for outside in &outside {
            output.warn(format!(
                "{of}{outside}: the prediction may be wrong; `deepmill label` is exact"
            ));
        }
        outside
    }

    fn file(&self, tool: &Tool, prediction: Prediction<f32>, outside: &[String]) -> PredictionFile {
        let part = name_of(&self.args.part);
        let mut provenance = Provenance::ball_end(part, tool.params, self.settings.clone());
        provenance.settings.outside_domain = Some(outside.to_vec());
        if tool.description.is_some() {
            provenance.tool = tool.words();
        }
        PredictionFile {
            prediction,
            provenance,
            sites: self.sites.clone(),
            occlusion_share: Some(self.args.occlusion_share),
            verified: None,
        }
    }

    fn write(
        &self,
        files: &[(PredictionFile, Tool, Vec<String>)],
        also: &[Extra],
        unit: Unit,
    ) -> Result<Vec<PathBuf>> {
        let About { args, mesh, .. } = self;
        let show = Show::pictures_unless(args.no_picture);
        let mut paths = Vec::new();
        for (file, tool, _) in files {
            let folder = match args.tools.are_several() {
                true => args.out.join(tool.folder()),
                false => args.out.clone(),
            };
            let mesh = mesh.as_ref();
            paths.extend(folder::write_predictions(&folder, file, mesh, show)?);
            for extra in also {
                paths.push(folder::export_predictions(&folder, file, mesh, *extra)?);
            }
        }
        if let Some(mesh) = mesh {
            paths.push(folder::write_surface(&args.out, mesh)?);
        }
        if args.report {
            let (mesh, sites) = (mesh.as_ref(), &self.sites);
            let view = |(file, tool, _): &(PredictionFile, Tool, Vec<String>)| {
                let findings = Findings::of(sites, mesh, &file.answers(), &[])?;
                let mut view = View::of_predictions(file, findings);
                if args.tools.are_several() {
                    view.name.clone_from(&tool.name);
                }
                Ok(view)
            };
            let views = files.iter().map(view).collect::<Result<Vec<_>>>()?;
            let page = Page {
                part: &name_of(&args.part),
                mesh,
                sites,
                views: &views,
                unit,
                outlines: &[],
            };
            paths.push(page.write(&args.out)?);
        }
        Ok(paths)
    }
}
