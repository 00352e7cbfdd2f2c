//! `deepmill demo`: labels a generated part, predicts the same with a network, and draws both.

use crate::output::Output;
use crate::{progress, report};
use deepmill::access::surface::SurfaceOptions;
use deepmill::access::{LabelOptions, Obstacles, label};
use deepmill::analysis::{Analysis, Files, Outcome};
use deepmill::answers::Definition;
use deepmill::cutter::{Cutter, CutterParams, CutterSet};
use deepmill::data::files::settings::Blocking;
use deepmill::data::files::tools::Tool;
use deepmill::data::files::{
    AnalysisSettings, LabelFile, PredictionFile, Provenance, ball_end_words,
};
use deepmill::data::{Sample, generated};
use deepmill::directions::Directions;
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Mesh, Sites};
use deepmill::metrics::Confusion;
use deepmill::model::AnyModel;
use deepmill::optim::Schedule;
use deepmill::report::folder::{self, LABELS, Show};
use deepmill::report::scores;
use deepmill::rng::{Purpose, Stream};
use deepmill::tables::{Cell, Facts};
use deepmill::train::{Observer, Run, Settings, StepReport};
use deepmill::{Error, Result, atomic_file, par};
use indicatif::ProgressBar;
use serde_json::Value;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

const CUTTER: [f64; 4] = [1.5, 6.0, 40.0, 5.0];
const N_SITES: usize = 7000;
const N_DIRECTIONS: usize = 150;
const SEED: u64 = 1;
const FOLDER: &str = "deepmill-demo";

/// Parts, cutters for each, sites on each, and epochs of the training: about a minute on two cores.
const N_PARTS: usize = 24;
const N_CUTTERS: usize = 2;
const N_TRAINING_SITES: usize = 3000;
const N_EPOCHS: u64 = 40;

/// Label a part, let the network predict the same, and draw both.
///
/// Makes its own part and needs no files; writes to the folder deepmill-demo. The same as no command.
#[derive(clap::Args, Default)]
#[command(after_help = "Example: deepmill demo --train")]
pub struct Args {
    /// Train a small network on generated parts first (about half a minute) instead of using the one that
    /// comes with deepmill.
    #[arg(long)]
    train: bool,
    /// Also write report.html, an HTML report: 3-D view with sections, findings, settings.
    #[arg(long)]
    report: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let folder = Path::new(FOLDER);
    atomic_file::check_writable_folder(folder)?;
    let mesh = generated::demo_part();
    let params = CutterParams::from_array(CUTTER);
    let directions = Directions::fibonacci_hemisphere(N_DIRECTIONS)?;
    output.say(format!(
        "The part: a block of 100 x 70 x 40 mm. The tool: {}.",
        ball_end_words(params)
    ));

    let (model, name, train_s) = network(args, &directions, output)?;
    let definition = model.definition.unwrap_or(Definition::Sites);
    let outcome = exact(&mesh, params, &directions, definition)?;
    let (labels, [sites_s, labels_s, _]) = (outcome.file(0)?, outcome.seconds());
    output.say(format!(
        "{N_SITES} sites in {sites_s:.2} s, exact labels over {N_DIRECTIONS} directions in {labels_s:.3} s."
    ));
    let start = Instant::now();
    let mut settings = AnalysisSettings::default();
    (settings.model, settings.definition) = (Some(name.into()), Some(definition));
    let provenance = Provenance::ball_end("demo part", params, settings);
    let sites = labels.sites.clone();
    let prediction = model.predict(&sites.points, &sites.normals, params.to_array())?;
    let predictions = PredictionFile::new(provenance, sites, prediction);
    let predict_s = start.elapsed().as_secs_f64();
    let result = say((&labels, &predictions), definition, (labels_s, train_s, predict_s), output);
    let paths = write(args, folder, (&outcome, &labels, &predictions), output)?;
    output.say(
        "labels.* are the exact answers, predictions.* the network's, difference* where they part;",
    );
    output.say("PNG pictures to look at, PLY colored points, NPZ the numbers.");
    output.files(&paths);
    output.result_with_files(result, &paths);
    Ok(())
}

/// Shares, times and scores for people; as JSON for the result.
fn say(
    (labels, predictions): (&LabelFile, &PredictionFile),
    definition: Definition,
    (labels_s, train_s, predict_s): (f64, Option<f64>, f64),
    output: &Output,
) -> Value {
    let answers = predictions.answers();
    let (inaccessible, occlusion) = (&answers.inaccessible(), answers.occlusion());
    let share = |flags: &[bool]| {
        Cell::Share(flags.iter().filter(|f| **f).count() as f64 / flags.len() as f64)
    };
    let mut facts = Facts::new();
    facts.add("definition", "definition", Cell::text(definition.to_string()));
    facts.add("n_sites", "sites", Cell::count(N_SITES));
    facts.add("inaccessible", "inaccessible, exact", share(&labels.labels.answers.inaccessible()));
    facts.add("predicted_inaccessible", "inaccessible, predicted", share(inaccessible));
    facts.add("occlusion", "occlusion, exact", share(labels.labels.answers.occlusion()));
    facts.add("predicted_occlusion", "occlusion, predicted", share(occlusion));
    facts.add("labels_s", "time: exact labels", Cell::Seconds(labels_s));
    facts.add("train_s", "time: training", train_s.map_or(Cell::Missing, Cell::Seconds));
    facts.add("predict_s", "time: prediction", Cell::Seconds(predict_s));
    output.say(facts.text_in(output.unit()));
    let first = Confusion::of_labels(inaccessible, &labels.labels.answers.inaccessible());
    let second = Confusion::of_labels(occlusion, labels.labels.answers.occlusion());
    let heads = scores::heads(&first, &second);
    let rows: Vec<(&str, &Confusion)> = heads.iter().map(|(name, c)| (*name, c)).collect();
    let table = scores::table(&rows);
    output.say("Prediction against exact labels; each row names its positive class:");
    output.say(table.text_in(output.unit()));

    let mut result = facts.json();
    result["scores"] = table.json();
    result
}

fn write(
    args: &Args,
    folder: &Path,
    (outcome, labels, predictions): (&Outcome, &LabelFile, &PredictionFile),
    output: &Output,
) -> Result<Vec<PathBuf>> {
    let (shown, surface) = (Show::Pictures, outcome.mesh());
    let mut paths = outcome.write(folder, &Files::shown(false), &mut ())?;
    paths.extend(folder::write_predictions(folder, predictions, surface, shown)?);
    paths.extend(folder::write_difference(folder, labels, predictions, surface, shown)?);
    if args.report {
        let exact = Some((labels, &*folder.join(LABELS)));
        let to = (folder, output.unit());
        paths.push(report::page(exact, Some(predictions), surface.into(), to)?);
    }
    Ok(paths)
}

/// The network that comes with deepmill, or one trained now; its name, and the seconds that took.
fn network(
    args: &Args,
    directions: &Directions,
    output: &Output,
) -> Result<(AnyModel<f32>, &'static str, Option<f64>)> {
    #[cfg(feature = "weights")]
    if !args.train {
        let shipped = deepmill::model::Model::shipped()?.into();
        return Ok((shipped, "the network that comes with deepmill", None));
    }
    let _ = args.train;
    let start = Instant::now();
    let samples = training_samples(directions)?;
    output.say(format!(
        "{} labeled training samples from {N_PARTS} generated parts in {:.1} s. Training:",
        samples.len(),
        start.elapsed().as_secs_f64()
    ));
    let start = Instant::now();
    let run = train(&samples)?;
    Ok((run.model, "trained by the demo", Some(start.elapsed().as_secs_f64())))
}

fn exact(
    mesh: &Mesh,
    params: CutterParams,
    directions: &Directions,
    definition: Definition,
) -> Result<Outcome> {
    let options = SiteOptions::default().with_n_sites(N_SITES).with_seed(SEED);
    let blocking = match definition.is_by_mesh() {
        true => Blocking::Part,
        false => Blocking::Points(None),
    };
    let analysis = Analysis::new("demo part", mesh.clone(), vec![Tool::new(params, None, 0.0)?])
        .spread(options)
        .directions(directions.clone())
        .obstacles(blocking)
        .options(SurfaceOptions::default())
        .published(LabelOptions::default());
    analysis.run(&mut ())
}

fn training_samples(directions: &Directions) -> Result<Vec<Sample>> {
    let made: Vec<Result<Vec<Sample>>> = par::map(N_PARTS, |i| {
        let (family, mesh) =
            (generated::family_of(i as u64), generated::mixed_part(SEED, i as u64));
        let options = SiteOptions::default().with_n_sites(N_TRAINING_SITES).with_seed(SEED);
        let sites = Arc::new(sample(&mesh, &options)?);
        let mut stream = Stream::new(SEED, 0, i as u64, Purpose::Cutter);
        (0..N_CUTTERS).map(|_| labeled(family.name(), &sites, &mut stream, directions)).collect()
    });
    let mut samples = Vec::new();
    for part in made {
        samples.extend(part?);
    }
    Ok(samples)
}

fn labeled(
    name: &str,
    sites: &Arc<Sites>,
    stream: &mut Stream,
    directions: &Directions,
) -> Result<Sample> {
    let cutter = CutterSet::Uniform.draw(stream);
    let tool = Cutter::ball_end(cutter)?;
    let labels = label(&**sites, Obstacles::Queries, &tool, directions, &LabelOptions::default())?;
    Ok(Sample::new(name, Arc::clone(sites), cutter, labels.answers))
}

fn train(samples: &[Sample]) -> Result<Run> {
    let settings = Settings::tiny()
        .with_seed(SEED)
        .with_n_epochs(N_EPOCHS)
        .with_schedule(Schedule::Cosine { min_lr: 1e-3 });
    let n_steps = N_EPOCHS * samples.len().div_ceil(settings.batch_size) as u64;
    let mut run = Run::new(settings)?;
    let mut watch = Watch { bar: progress::bar(n_steps, "steps"), stop: progress::stop_flag()? };
    let flow = run.train(samples, &[], &mut watch)?;
    watch.bar.finish_and_clear();
    match flow {
        ControlFlow::Continue(()) => Ok(run),
        ControlFlow::Break(()) => Err(Error::Interrupted { remedy: "start it again".into() }),
    }
}

struct Watch {
    bar: ProgressBar,
    stop: Arc<AtomicBool>,
}

impl Observer for Watch {
    fn step(&mut self, r: &StepReport) -> ControlFlow<()> {
        self.bar.inc(1);
        self.bar.set_message(format!("epoch {} loss {:.3}", r.epoch, r.loss));
        if self.stop.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}
