//! `deepmill predict`: predicts with a network which sites of a part a cutter cannot reach.

use crate::args::{DirectionArgs, GateArgs, SiteArgs, ToolArgs, called, name_of};
use crate::clock::Clock;
use crate::mesh_args::{Accept, MeshArgs, warn_wide_tools};
use crate::model_args::ModelArgs;
use crate::out_folder::check_out;
use crate::output::Output;
use crate::progress::Bars;
use deepmill::access::LabelOptions;
use deepmill::analysis::{
    Analysis, PredictRequest, PredictionsOutcome, ToolPrediction, known_to_networks,
};
use deepmill::answers::SiteAnswers;
use deepmill::data::files::PredictionFile;
use deepmill::geom::formats::MeshOrCloud;
use deepmill::model::Predictor;
use deepmill::tables::{Cell, Facts, Table};
use deepmill::{Error, Result};
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
    /// Also write report.html, an HTML report: 3-D view with sections, findings, settings, warnings.
    #[arg(long)]
    report: bool,
    /// Take a mesh that does not bound one solid; the answer may mean nothing.
    #[arg(long)]
    force: bool,
    /// Answer even far outside of the sizes that the network was trained for; the answer may mean nothing.
    #[arg(long)]
    far: bool,
    /// Answer for a cloud of fewer than half of the points that the network was trained with; the answer may mean
    /// nothing. On a mesh sites are added.
    #[arg(long)]
    few_sites: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let unknown = match args.verify {
        Some(0.0) => &["rest"][..],
        _ => &["rest", "tip_does_not_fit"],
    };
    let limits = args.gate.limits(unknown)?;
    let directions = args.directions.directions()?;
    args.tools.check_one_cutter()?;
    let (tools, left_out) = known_to_networks(args.tools.tools(output)?)?;
    left_out.iter().for_each(|tool| output.warn(tool));
    let files = output.forms(!args.no_picture, args.report, &args.also)?;
    check_out(&args.out)?;
    let request = args.request()?;
    let mut clock = Clock::start();
    let part = args.read.read_part(&args.part, Accept::bodies_or(args.force), output)?;
    if let MeshOrCloud::Mesh(mesh) = &part {
        warn_wide_tools(mesh, &tools, output);
    }
    clock.lap("read_s", "reading");
    let analysis = Analysis::new(name_of(&args.part), part, tools)
        .folders(args.tools.are_several())
        .library(args.tools.are_of_files())
        .origin(args.read.origin())
        .directions(directions);
    let placed = args.sites.add_to(analysis)?.place(&mut Bars::default())?;
    let (mesh, sites) = placed.shown();
    files.show().require_memory(mesh, sites)?;
    let mut bars = Bars::default();
    let outcome = placed.predict(&request, &mut bars).map_err(|error| match error {
        Error::Argument { name: "verify", .. } => called(error, "--verify"),
        Error::Argument { name: "tools", .. } => called(error, "--tools"),
        other => other,
    })?;
    outcome.warnings().iter().for_each(|warning| output.warn(warning));
    let [sites_s, predict_s, verify_s] = outcome.seconds();
    clock.stages([["sites_s", "sites"], ["predict_s", "prediction"]], [sites_s, predict_s]);
    if args.verify.is_some() {
        clock.stages([["verify_s", "verification"]], [verify_s]);
    }
    let paths = outcome.write(&args.out, &files, &mut bars)?;
    clock.lap("write_s", "writing and drawing");
    let (mesh, sites) = outcome.placed().shown();
    let named = outcome.named();
    let each = named.iter().map(|(name, answers)| (*name, answers));
    let broken = output.check_limits(&limits, (sites, mesh), each, None)?;
    let mut result = say(&outcome, &named, &clock, &paths, output);
    result["limits_broken"] = broken;
    output.result_with_files(result, &paths);
    Ok(())
}

impl Args {
    fn request(&self) -> Result<PredictRequest> {
        let (model, name) = self.model.read()?;
        let predictor = Predictor::new(model);
        let predictor = if self.far { predictor.allow_out_of_domain() } else { predictor };
        let predictor = if self.few_sites { predictor.allow_few_sites() } else { predictor };
        let request = PredictRequest::new(predictor, name).occlusion_share(self.occlusion_share);
        Ok(match self.verify {
            Some(bound) => request.verify(bound),
            None => request,
        })
    }
}

/// The answers for people; as JSON for the result.
fn say(
    outcome: &PredictionsOutcome,
    named: &[(&str, SiteAnswers)],
    clock: &Clock,
    paths: &[PathBuf],
    output: &Output,
) -> Value {
    let (placed, predictions) = (outcome.placed(), outcome.predictions());
    let mut facts = Facts::new();
    facts.add("part", "part", Cell::text(placed.part()));
    let definition = outcome.definition().map(|definition| Cell::text(definition.to_string()));
    facts.add("definition", "definition", definition.unwrap_or(Cell::Missing));
    let alone = (!outcome.has_folders()).then(|| (&predictions[0].file, &named[0].1));
    if let Some((file, _)) = alone {
        facts.add("cutter", "cutter", Cell::text(&file.provenance.tool));
    }
    facts.add("n_sites", "sites", Cell::count(placed.sites().len()));
    if let Some((file, answers)) = alone {
        facts.add("inaccessible", "inaccessible", share(&answers.inaccessible()));
        facts.add("occlusion", "occlusion", share(answers.occlusion()));
        if let Some(verified) = &file.verified {
            facts.add("verified", "computed", share(&verified.verified));
            facts.add("spot_check", "spot check", spot_check(file));
            facts.add("counted", "beta counted", Cell::Share(verified.share_counted()));
        }
    }
    clock.add_to(&mut facts);
    output.say(facts.text_in(output.unit()));
    output.files(paths);
    let mut result = facts.json();
    if let Some((file, _)) = alone {
        result["outside_domain"] = json!(file.provenance.settings.outside_domain);
        if file.verified.is_some() {
            result["spot_check"] = numbers_of_check(file);
        }
        return result;
    }
    let table = table(predictions.iter().zip(named.iter().map(|(_, answers)| answers)));
    output.say(table.text_in(output.unit()));
    result["tools"] = table.json();
    for (row, ToolPrediction { tool, file, .. }) in (0..).zip(predictions) {
        result["tools"][row]["spot_check"] = numbers_of_check(file);
        result["tools"][row]["outside_domain"] = json!(file.provenance.settings.outside_domain);
        result["tools"][row]["folder"] = json!(tool.folder());
    }
    result
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

fn table<'a>(rows: impl Iterator<Item = (&'a ToolPrediction, &'a SiteAnswers)>) -> Table {
    let mut table = Table::new(&[
        ("name", "tool"),
        ("words", ""),
        ("inaccessible", "inaccessible"),
        ("occlusion", "occlusion"),
        ("verified", "computed"),
        ("spot_check", "spot check"),
    ]);
    for (ToolPrediction { tool, file, .. }, answers) in rows {
        table.row([
            Cell::text(&tool.name),
            Cell::text(tool.words()),
            share(&answers.inaccessible()),
            share(answers.occlusion()),
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
