//! `deepmill train`: from a data set to a network, resumable at any moment.

use crate::output::Output;
use crate::progress;
use deepmill::data::dataset::{Dataset, Split};
use deepmill::data::online::OnlineSettings;
use deepmill::data::{Online, Sample};
use deepmill::directions::{DirectionSet, Directions};
use deepmill::model::weights::{self, Storage};
use deepmill::report::curves::{Chart, Series, write_curves};
use deepmill::train::{Checkpoint, Flow, Observer, Row, Run, Settings, StepReport, history};
use deepmill::{Error, Result};
use indicatif::ProgressBar;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Train a network on a data set.
///
/// Writes to the run's folder: `model.safetensors` (latest), `best.safetensors` (best sum of both F1 on
/// the validation set), `history.csv`, `curves.svg`, `settings.toml`, and `checkpoint.safetensors` to
/// go on from. Ctrl-C stores a checkpoint; `--resume` continues to the same bits as an uninterrupted run.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill train --data data --out run --preset small --epochs 30")]
pub struct Args {
    /// Data sets made by `deepmill dataset build`; several are joined.
    #[arg(long, value_name = "DIR", required = true, num_args = 1..)]
    data: Vec<PathBuf>,
    /// Data sets that are wholly for validation, beside what `--data` keeps back.
    #[arg(long, value_name = "DIR", num_args = 1..)]
    validate: Vec<PathBuf>,
    /// Folder of the run.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Settings to start from: paper, reference, small or tiny.
    #[arg(long, default_value = "small", value_name = "NAME")]
    preset: String,
    /// Settings from a TOML file instead, in the form of a run's `settings.toml`.
    #[arg(long, value_name = "FILE", conflicts_with = "preset")]
    config: Option<PathBuf>,
    /// Epochs, in place of the settings' number.
    #[arg(long, value_name = "COUNT")]
    epochs: Option<u64>,
    /// Samples per step, in place of the settings' number.
    #[arg(long, value_name = "COUNT")]
    batch_size: Option<usize>,
    /// Learning rate, in place of the settings' number.
    #[arg(long, value_name = "RATE")]
    lr: Option<f64>,
    /// Seed, in place of the settings' number.
    #[arg(long)]
    seed: Option<u64>,
    /// Samples per epoch, if not every sample once.
    #[arg(long, value_name = "COUNT")]
    samples_per_epoch: Option<usize>,
    /// Draw a fresh cutter and orientation for every sample of every epoch and label it in the loop;
    /// `[online]` in the settings says from what.
    #[arg(long)]
    online: bool,
    /// Weights to begin with, of the same network, in place of random ones.
    #[arg(long, value_name = "FILE", conflicts_with = "resume")]
    start_from: Option<PathBuf>,
    /// Go on with the run in the folder.
    #[arg(long)]
    resume: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let mut run = start(args)?;
    let data = Data::read(args)?;
    let Data { samples, validation, .. } = &data;
    output.say(format!(
        "{} training samples, {} for validation, {} parameters",
        samples.len(),
        validation.len(),
        run.model.params.len()
    ));
    let mut watch = Watch {
        folder: &args.out,
        bar: progress::bar(run.settings.n_epochs, "epochs"),
        stop: progress::stop_flag()?,
    };
    watch.bar.set_position(run.progress.history.len() as u64);
    let flow = match run.settings.online {
        None => run.train(&samples[..], validation, &mut watch)?,
        Some(online) => {
            run.train(&data.online(online, run.settings.seed)?, validation, &mut watch)?
        }
    };
    watch.bar.finish_and_clear();
    if flow == Flow::Stop {
        store(&args.out, &run)?;
        let remedy = format!("go on with `--resume --out {}`", args.out.display());
        return Err(Error::Interrupted { remedy });
    }
    let rows = &run.progress.history;
    if let Some(last) = rows.last() {
        output.say(line(last));
    }
    output.say(format!("written to {}", args.out.join(MODEL).display()));
    output.result(&json!({
        "model": args.out.join(MODEL),
        "best_epoch": run.progress.best.map(|(_, epoch)| epoch),
        "seconds": rows.iter().map(|r| r.seconds).sum::<f64>(),
        "last": rows.last(),
    }));
    Ok(())
}

/// What the data sets hold for this run.
struct Data {
    samples: Vec<Sample>,
    validation: Vec<Sample>,
    /// Directions and share of occlusion points, the same in all.
    directions: DirectionSet,
    share: f64,
}

impl Data {
    fn read(args: &Args) -> Result<Self> {
        let first = Dataset::open(&args.data[0])?.manifest.settings;
        let (directions, share) = (first.directions, first.occlusion_share);
        let mut data = Data { samples: Vec::new(), validation: Vec::new(), directions, share };
        let wholly = args.validate.iter().map(|folder| (folder, true));
        for (folder, validate) in args.data.iter().map(|folder| (folder, false)).chain(wholly) {
            let set = Dataset::open(folder)?;
            let settings = &set.manifest.settings;
            if (&settings.directions, settings.occlusion_share) != (&data.directions, data.share) {
                let found = "its labels have other directions or another share of occlusion points";
                let remedy = "join data sets of the same --directions";
                return Err(Error::file(folder, "settings", found, remedy));
            }
            if validate {
                data.validation.extend(set.samples(None)?);
            } else {
                data.samples.extend(set.samples(Some(Split::Train))?);
                data.validation.extend(set.samples(Some(Split::Validation))?);
            }
        }
        Ok(data)
    }

    fn online(&self, settings: OnlineSettings, seed: u64) -> Result<Online> {
        let directions = Directions::new(self.directions.clone())?;
        Online::new(&self.samples, directions, self.share, settings, seed)
    }
}

const MODEL: &str = "model.safetensors";
const BEST: &str = "best.safetensors";
const CHECKPOINT: &str = "checkpoint.safetensors";
const PREVIOUS: &str = "checkpoint.previous.safetensors";
const SETTINGS: &str = "settings.toml";

fn start(args: &Args) -> Result<Run> {
    let checkpoint = args.out.join(CHECKPOINT);
    if args.resume {
        let run = Run::resume(Checkpoint::read(&checkpoint)?)?;
        // What a kill between the checkpoint and these files left out, and what it left behind.
        show(&args.out, &run)?;
        deepmill::aside::remove_leftovers(&args.out)?;
        return Ok(run);
    }
    if checkpoint.exists() {
        return Err(Error::file(
            &checkpoint,
            "run",
            "the folder holds a run already",
            "go on with it by --resume, or choose another folder",
        ));
    }
    let mut settings = match &args.config {
        Some(path) => read_settings(path)?,
        None => Settings::preset(&args.preset)?,
    };
    settings.n_epochs = args.epochs.unwrap_or(settings.n_epochs);
    settings.batch_size = args.batch_size.unwrap_or(settings.batch_size);
    settings.lr = args.lr.unwrap_or(settings.lr);
    settings.seed = args.seed.unwrap_or(settings.seed);
    settings.samples_per_epoch = args.samples_per_epoch.or(settings.samples_per_epoch);
    if args.online {
        settings.online.get_or_insert_default();
    }
    write_settings(&args.out.join(SETTINGS), &settings)?;
    let mut run = Run::new(settings)?;
    if let Some(path) = &args.start_from {
        run.start_from(weights::read(path)?)?;
    }
    Ok(run)
}

fn read_settings(path: &Path) -> Result<Settings> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::read(path, e))?;
    toml::from_str(&text).map_err(|e| {
        let line = e.span().map_or(0, |s| text[..s.start].lines().count().max(1));
        let remedy = "compare with the settings.toml that every run writes";
        Error::file(path, format!("line {line}"), e.message().to_owned(), remedy)
    })
}

fn write_settings(path: &Path, settings: &Settings) -> Result<()> {
    use std::io::Write;
    let text = toml::to_string_pretty(settings)
        .map_err(|e| Error::write(path, std::io::Error::other(e)))?;
    deepmill::aside::write(path, |file| file.write_all(text.as_bytes()))
}

/// Shows a run while it goes on, and stores it after every epoch.
struct Watch<'a> {
    folder: &'a Path,
    bar: ProgressBar,
    stop: Arc<AtomicBool>,
}

impl Observer for Watch<'_> {
    fn step(&mut self, r: &StepReport) -> Flow {
        let [a, b] = r.scores;
        self.bar.set_message(format!(
            "step {}/{} loss {:.3} F1 inaccessible {:.3} occlusion {:.3}",
            r.step, r.n_steps, r.loss, a.f1, b.f1
        ));
        if self.stop.load(Ordering::Relaxed) { Flow::Stop } else { Flow::Continue }
    }

    fn epoch(&mut self, run: &Run, row: &Row) -> Result<Flow> {
        store(self.folder, run)?;
        self.bar.set_position(row.epoch);
        self.bar.println(line(row));
        Ok(Flow::Continue)
    }
}

/// Everything the run's folder needs and shows. At every moment there is a whole checkpoint.
fn store(folder: &Path, run: &Run) -> Result<()> {
    let checkpoint = folder.join(CHECKPOINT);
    if checkpoint.exists() {
        let previous = folder.join(PREVIOUS);
        let bytes = std::fs::read(&checkpoint).map_err(|e| Error::read(&checkpoint, e))?;
        deepmill::aside::write(&previous, |file| std::io::Write::write_all(file, &bytes))?;
    }
    run.checkpoint().write(&checkpoint)?;
    show(folder, run)
}

/// Networks, history and curves, as the run's state says.
fn show(folder: &Path, run: &Run) -> Result<()> {
    let rows = &run.progress.history;
    let notes = rows.last().map_or_else(String::new, line);
    weights::write(&folder.join(MODEL), &run.model, Storage::Exact, &notes)?;
    let is_best = run.progress.best.is_some_and(|(_, epoch)| epoch == rows.len() as u64);
    if is_best && run.progress.steps_done == 0 {
        weights::write(&folder.join(BEST), &run.model, Storage::Exact, &notes)?;
    }
    history::write_csv(&folder.join("history.csv"), rows)?;
    draw(&folder.join("curves.svg"), rows)
}

fn draw(path: &Path, rows: &[Row]) -> Result<()> {
    let series = |name: &str, value: &dyn Fn(&Row) -> Option<f64>| Series {
        name: name.into(),
        points: rows.iter().filter_map(|r| Some((r.epoch as f64, value(r)?))).collect(),
    };
    let charts = [
        Chart { title: "loss".into(), series: vec![series("training", &|r| Some(r.loss))] },
        Chart {
            title: "F1".into(),
            series: vec![
                series("inaccessible, training", &|r| Some(r.inaccessible.f1)),
                series("occlusion, training", &|r| Some(r.occlusion.f1)),
                series("inaccessible, validation", &|r| r.validation.map(|v| v[0].f1)),
                series("occlusion, validation", &|r| r.validation.map(|v| v[1].f1)),
            ],
        },
    ];
    write_curves(path, "epoch", &charts)
}

fn line(row: &Row) -> String {
    let mut text = format!(
        "epoch {}: loss {:.4}, F1 inaccessible {:.3}, F1 occlusion {:.3}",
        row.epoch, row.loss, row.inaccessible.f1, row.occlusion.f1
    );
    if let Some([a, b]) = row.validation {
        text += &format!("; validation {:.3} and {:.3}", a.f1, b.f1);
    }
    text
}
