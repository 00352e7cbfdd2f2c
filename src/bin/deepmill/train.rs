//! `deepmill train`: trains a network on data sets; can be interrupted and resumed at any moment.

use crate::output::Output;
use crate::processes::{hash, interrupted, together};
use crate::progress;
use deepmill::access::LabelOptions;
use deepmill::answers::Definition;
use deepmill::data::dataset::{Dataset, DatasetSettings, Split};
use deepmill::data::online::OnlineSettings;
use deepmill::data::{Online, Sample};
use deepmill::directions::{DirectionSet, Directions};
use deepmill::model::weights;
use deepmill::processes::{Processes, Traffic, agree, require_same};
use deepmill::report::curves::{Chart, Series, write_curves};
use deepmill::train::{EpochRow, Observer, Run, RunFolder, Settings, StepReport, settings_file};
use deepmill::{Error, Result, atomic_file};
use indicatif::ProgressBar;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Train a network on a data set.
///
/// Writes to the run's folder: `model.safetensors` (latest), `best.safetensors` (best sum of both F1 on
/// the validation set; the latest as long as none was measured), `history.csv`, `curves.svg`,
/// `settings.toml`, and `checkpoint.safetensors` to go on from. Ctrl-C stores a checkpoint; `--resume`
/// continues to the same bits as an uninterrupted run.
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
    /// Settings to start from: paper, reference, small (the default) or tiny.
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    /// Settings from a TOML file, in the form of a run's `settings.toml`; what it leaves out is as in the
    /// preset.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Epochs, in place of the settings' number.
    #[arg(long, value_name = "COUNT")]
    epochs: Option<u64>,
    /// Samples per step, in place of the settings' number.
    #[arg(long, value_name = "COUNT")]
    batch_size: Option<usize>,
    /// Groups of samples that each step is split into, in place of the settings' number; each is normalized by itself.
    /// Up to as many processes (`mpirun`, docs/cluster.md) share a step, and the network does not depend on their
    /// number.
    #[arg(long, value_name = "COUNT")]
    groups: Option<usize>,
    /// Learning rate, in place of the settings' number.
    #[arg(long, value_name = "RATE", allow_negative_numbers = true)]
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
    /// Go on with the run in the folder, with the settings it began with.
    #[arg(long)]
    resume: bool,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    together(output, |processes, output| train(args, processes, output))
}

fn train(args: &Args, processes: &dyn Processes, output: &Output) -> Result<()> {
    let folder = RunFolder::new(&args.out);
    let is_first = processes.rank() == 0;
    let mut run = Run::share(is_first.then(|| start(args, &folder)), processes)?;
    let data = agree(processes, Data::read(args))?;
    require_same(processes, "data", &data.fingerprint)?;
    let Data { samples, validation, .. } = &data;
    run.learns(data.definition);
    output.say(format!(
        "{} training samples, {} for validation, {} parameters",
        samples.len(),
        validation.len(),
        run.model.params.len()
    ));
    if processes.size() > 1 {
        output.say(format!("{} processes, {} groups", processes.size(), run.settings.n_groups));
    }
    let bar = progress::bar(run.settings.n_epochs, "epochs");
    let bar = if is_first { bar } else { ProgressBar::hidden() };
    bar.set_position(run.progress.history.len() as u64);
    let stop = progress::stop_flag()?;
    let mut watch = Watch { folder: is_first.then_some(&args.out), bar, stop, output };
    let flow = match run.settings.online {
        None => {
            let samples = &samples[..];
            folder.train_together(&mut run, samples, validation, &mut watch, processes)?
        }
        Some(online) => {
            let online = agree(processes, data.online(online, run.settings.seed))?;
            folder.train_together(&mut run, &online, validation, &mut watch, processes)?
        }
    };
    watch.bar.finish_and_clear();
    if flow.is_break() {
        return Err(interrupted(processes, format!("go on with `{}`", resuming(args))));
    }
    let rows = &run.progress.history;
    output.say(format!("written to {}", folder.model().display()));
    let mut result = json!({
        "model": folder.model(),
        "best": folder.best(),
        "best_epoch": run.progress.best.map(|(_, epoch)| epoch),
        "seconds": rows.iter().map(|r| r.seconds).sum::<f64>(),
        "last": rows.last(),
    });
    if processes.size() > 1 {
        let Traffic { bytes_sent, seconds, .. } = processes.traffic();
        result["processes"] = json!(processes.size());
        result["communication"] = json!({ "bytes_sent": bytes_sent, "seconds": seconds });
    }
    output.result(&result);
    Ok(())
}

/// The command that goes on with a run that was stopped.
fn resuming(args: &Args) -> String {
    let mut words = vec!["deepmill train --data".to_owned()];
    words.extend(args.data.iter().map(|path| quoted(path)));
    if !args.validate.is_empty() {
        words.push("--validate".into());
        words.extend(args.validate.iter().map(|path| quoted(path)));
    }
    words.extend(["--out".into(), quoted(&args.out), "--resume".into()]);
    words.join(" ")
}

/// A path as a shell takes it.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+:".contains(c);
    if text.chars().all(plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// What the data sets hold for this run.
struct Data {
    samples: Vec<Sample>,
    validation: Vec<Sample>,
    /// Directions and the other parts of the rule, the same in all.
    directions: DirectionSet,
    options: LabelOptions,
    /// What the labels are about, in all.
    definition: Definition,
    /// Tells other data sets apart.
    fingerprint: String,
}

impl Data {
    fn read(args: &Args) -> Result<Self> {
        let first = Dataset::open(&args.data[0])?.manifest.settings;
        let (directions, options) = (first.directions.clone(), first.label_options());
        let definition = first.definition();
        let (samples, validation, fingerprint) = (Vec::new(), Vec::new(), String::new());
        let mut data = Data { samples, validation, directions, options, definition, fingerprint };
        let wholly = args.validate.iter().map(|folder| (folder, true));
        for (folder, validate) in args.data.iter().map(|folder| (folder, false)).chain(wholly) {
            let set = Dataset::open(folder)?;
            let manifest = serde_json::to_vec(&set.manifest).unwrap_or_default();
            data.fingerprint = hash(&[data.fingerprint.as_bytes(), &manifest[..]].concat());
            let settings = &set.manifest.settings;
            let kind = |s: &DatasetSettings| (s.directions.clone(), s.definition());
            let rule = |s: &DatasetSettings| {
                let options = s.label_options();
                (options.share, options.rounding, options.bottom_mm)
            };
            if (kind(settings), rule(settings)) != (kind(&first), rule(&first)) {
                let found = "its labels have other directions, another kind of obstacles, another bottom \
                             rule or another share of occlusion points";
                let remedy = "join data sets of the same --directions, --obstacles and --bottom";
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
        if self.definition.is_by_mesh() {
            let found = "a data set by the mesh definition, whose triangles it does not hold";
            let remedy = "leave out --online, or build the data set with --obstacles published";
            return Err(Error::argument("--online", found, "sites as obstacles", remedy));
        }
        let directions = Directions::new(self.directions.clone())?;
        Online::new(&self.samples, directions, self.options, settings, seed)
    }
}

fn start(args: &Args, folder: &RunFolder) -> Result<Run> {
    atomic_file::check_writable_folder(&args.out)?;
    if args.resume {
        let run = folder.resume()?;
        require_settings(&settings(args, Some(&run.settings))?, &run.settings)?;
        draw(&args.out, &run.progress.history)?;
        return Ok(run);
    }
    let mut run = folder.start(settings(args, None)?)?;
    if let Some(path) = &args.start_from {
        run.start_from(weights::read(path)?)?;
    }
    Ok(run)
}

/// What the options say; where they are silent, the settings that a resumed run began with.
fn settings(args: &Args, begun: Option<&Settings>) -> Result<Settings> {
    let preset = || Settings::preset(args.preset.as_deref().unwrap_or("small"));
    let mut settings = match (&args.config, begun) {
        (Some(path), _) => settings_file::read(path, &preset()?)?,
        (None, Some(begun)) if args.preset.is_none() => begun.clone(),
        _ => preset()?,
    };
    settings.n_epochs = args.epochs.unwrap_or(settings.n_epochs);
    settings.batch_size = args.batch_size.unwrap_or(settings.batch_size);
    settings.n_groups = args.groups.unwrap_or(settings.n_groups);
    settings.lr = args.lr.unwrap_or(settings.lr);
    settings.seed = args.seed.unwrap_or(settings.seed);
    settings.samples_per_epoch = args.samples_per_epoch.or(settings.samples_per_epoch);
    if args.online {
        settings.online.get_or_insert_default();
    }
    Ok(settings)
}

/// A resumed run ends with the bits of one that was never stopped, and the learning rate of every epoch
/// depends on the number of all: no setting may change on the way.
fn require_settings(wanted: &Settings, begun: &Settings) -> Result<()> {
    let (wanted, begun) = (numbers(wanted), numbers(begun));
    let differ = |(name, value): (&String, &Value)| {
        let before = begun.get(name).unwrap_or(&Value::Null);
        (before != value).then(|| (format!("{name} {value}"), format!("{name} {before}")))
    };
    let (found, expected): (Vec<_>, Vec<_>) = wanted.iter().filter_map(differ).unzip();
    if found.is_empty() {
        return Ok(());
    }
    let expected = format!("{}, as the run began", expected.join(", "));
    let remedy = "leave the option out; to train longer or otherwise, begin another run with \
                  --start-from and this one's model.safetensors";
    Err(Error::argument("the setting of a resumed run", found.join(", "), expected, remedy))
}

/// Every number of the settings under its path.
fn numbers(settings: &Settings) -> BTreeMap<String, Value> {
    let mut found = BTreeMap::new();
    collect("", serde_json::to_value(settings).unwrap_or_default(), &mut found);
    found
}

fn collect(path: &str, value: Value, to: &mut BTreeMap<String, Value>) {
    let Value::Object(entries) = value else {
        to.insert(path.into(), value);
        return;
    };
    for (key, value) in entries {
        let path = if path.is_empty() { key } else { format!("{path}.{key}") };
        collect(&path, value, to);
    }
}

/// Shows a run while it goes on: a bar at a terminal, a line for each epoch everywhere.
struct Watch<'a> {
    /// Where the curves go.
    folder: Option<&'a PathBuf>,
    bar: ProgressBar,
    stop: Arc<AtomicBool>,
    output: &'a Output,
}

impl Observer for Watch<'_> {
    fn step(&mut self, r: &StepReport) -> ControlFlow<()> {
        let [a, b] = r.scores;
        self.bar.set_message(format!(
            "step {}/{} loss {:.3} F1 inaccessible {:.3} occlusion {:.3}",
            r.step, r.n_steps, r.loss, a.f1, b.f1
        ));
        if self.stop.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn epoch(&mut self, run: &Run, row: &EpochRow) -> Result<ControlFlow<()>> {
        self.folder.map_or(Ok(()), |folder| draw(folder, &run.progress.history))?;
        self.bar.set_position(row.epoch);
        self.bar.suspend(|| self.output.say(row));
        Ok(ControlFlow::Continue(()))
    }
}

/// Loss and scores over the epochs.
fn draw(folder: &Path, rows: &[EpochRow]) -> Result<()> {
    let series = |name: &str, value: &dyn Fn(&EpochRow) -> Option<f64>| Series {
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
    write_curves(&folder.join("curves.svg"), "epoch", &charts)
}
