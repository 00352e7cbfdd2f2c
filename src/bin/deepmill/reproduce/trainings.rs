//! Trained networks, each kept in a folder named after all that decides it.
//!
//! ```text
//! samples per network = given, or budget / seconds per sample of the first steps, kept in plan-HASH.json
//! folder = trainings/HASH of version, settings, training samples and test samples
//! no run there → start; a run that was stopped → resume; a finished one → take it
//! ```

use super::parts::SEED;
use super::samples::{Draw, labeled, samples_of_part_itself};
use super::study::Study;
use deepmill::access::{LabelOptions, Labeler};
use deepmill::answers::Definition;
use deepmill::cutter::CutterSet;
use deepmill::data::online::OnlineSettings;
use deepmill::data::{Online, Sample};
use deepmill::directions::Directions;
use deepmill::model::AnyModel;
use deepmill::train::{EpochRow, Observer, Run, RunFolder, Settings, StepReport};
use deepmill::{Error, Result, atomic_file};
use indicatif::ProgressBar;
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

/// Equal pieces of a training, after each of which the network is scored; fewer if there are fewer steps.
const N_PIECES: u64 = 20;
/// Steps that are timed, after one that is not.
const N_TIMED: u32 = 5;
/// Cutters for each training part.
pub const N_CUTTERS: usize = 4;
/// Cutters for each test part.
pub const N_TEST_CUTTERS: usize = 2;

/// A network that has seen all its samples.
pub struct Trained {
    pub model: AnyModel<f32>,
    pub history: Vec<EpochRow>,
}

/// What a network learns from, and is scored on.
pub struct Data<'a> {
    pub definition: Definition,
    pub training: &'a [Sample],
    pub test: &'a [Sample],
}

impl<'a> Data<'a> {
    /// Labels of the published definition.
    pub fn of_sites(training: &'a [Sample], test: &'a [Sample]) -> Self {
        Data { definition: Definition::Sites, training, test }
    }
}

impl Trained {
    /// Wall-clock time of all steps.
    pub fn seconds(&self) -> f64 {
        self.history.iter().map(|row| row.seconds).sum()
    }
}

/// What networks of one table have in common.
pub struct Trainings<'a> {
    study: &'a Study<'a>,
    settings: Settings,
    /// Published cutters, published directions, parts that no network is trained on.
    pub test: Vec<Sample>,
}

impl<'a> Trainings<'a> {
    pub fn new(study: &'a Study<'a>) -> Result<Self> {
        let test = test_samples(study, CutterSet::Uniform)?;
        let mut settings = Settings::preset(&study.args.preset)?
            .with_seed(SEED)
            .with_n_epochs(N_PIECES)
            .with_evaluate_every(1);
        let wanted = match study.args.samples {
            Some(n) => n,
            None => samples_in_budget(study, &settings)?,
        };
        let n_steps = (wanted / settings.batch_size).max(1);
        settings.n_epochs = N_PIECES.min(n_steps as u64);
        settings.samples_per_epoch =
            Some(n_steps / settings.n_epochs as usize * settings.batch_size);
        Ok(Trainings { study, settings, test })
    }

    /// Samples that each network sees.
    pub fn n_samples(&self) -> usize {
        self.settings.n_epochs as usize * self.settings.samples_per_epoch.unwrap_or(0)
    }

    /// The settings that all networks share.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Samples seen at the end of epoch `epoch`.
    pub fn seen(&self, epoch: u64) -> f64 {
        epoch as f64 * self.settings.samples_per_epoch.unwrap_or(0) as f64
    }

    /// In words, for pages.
    pub fn words(&self) -> String {
        let study = self.study;
        format!(
            "Every network (preset `{}`) saw {} samples of {} parts with {N_CUTTERS} cutters each and was scored on {} \
             parts that it was not trained on, {N_TEST_CUTTERS} cutters each; {} sites on each part. The scores are those \
             at the end of the training: the test parts choose nothing.",
            study.args.preset,
            self.n_samples(),
            study.training_parts().len(),
            study.test_parts().len(),
            study.args.sites,
        )
    }

    /// The network that `change` makes of the common settings, trained on `data`, or as it was trained before.
    pub fn network(
        &self,
        name: &str,
        data: &[Sample],
        change: impl FnOnce(&mut Settings),
    ) -> Result<Trained> {
        self.network_of(name, &Data::of_sites(data, &self.test), change)
    }

    /// As [`Trainings::network`], scored after each piece on samples of one's own, or, without any, not at all. With
    /// `settings.online` the training parts get fresh cutters and labels.
    pub fn network_of(
        &self,
        name: &str,
        data: &Data,
        change: impl FnOnce(&mut Settings),
    ) -> Result<Trained> {
        let study = self.study;
        let mut settings = self.settings.clone();
        change(&mut settings);
        let hash = hash(&json!(settings), &[data.training, data.test]);
        let folder = RunFolder::new(trainings(study).join(&hash));
        let mut run = match folder.checkpoint().exists() {
            true => folder.resume()?,
            false => folder.start(settings)?,
        };
        run.learns(data.definition);
        if !run.is_finished() {
            study.output.say(format!("training `{name}` in {}", folder.path().display()));
            study.count_training();
            let n_steps = self.n_samples() / self.settings.batch_size;
            let bar = study.bar(n_steps, "steps");
            let done = run.progress.history.len() * n_steps / self.settings.n_epochs as usize;
            bar.set_position((done + run.progress.steps_done) as u64);
            let mut watch = Watch { study, bar };
            let flow = match run.settings.online {
                None => folder.train(&mut run, data.training, data.test, &mut watch)?,
                Some(online) => {
                    let online = fresh(data.training, online)?;
                    folder.train(&mut run, &online, data.test, &mut watch)?
                }
            };
            watch.bar.finish_and_clear();
            if flow.is_break() {
                study.go_on()?;
            }
        }
        Ok(Trained { history: run.progress.history, model: run.model })
    }
}

/// The parts of `data`, each as often as it has cutters, so that an epoch draws as many different samples.
fn fresh(data: &[Sample], online: OnlineSettings) -> Result<Online> {
    let turns = (0..N_CUTTERS).flat_map(|k| data.iter().skip(k).step_by(N_CUTTERS));
    let parts: Vec<Sample> = turns.cloned().collect();
    Online::new(&parts, Directions::published(), LabelOptions::published(), online, SEED)
}

/// Training samples with cutters of these sets, labeled by the published definition or parts of it.
pub fn training_samples(
    study: &Study,
    sets: &[CutterSet],
    labeler: &Labeler,
) -> Result<Vec<Sample>> {
    let draw = Draw { sets, n_cutters: N_CUTTERS };
    labeled(study, study.training_parts(), &draw, labeler, study.args.sites)
}

/// Training samples with cutters of these sets, labeled by the mesh definition.
pub fn training_samples_of_part_itself(
    study: &Study,
    sets: &[CutterSet],
    directions: &Directions,
) -> Result<Vec<Sample>> {
    let draw = Draw { sets, n_cutters: N_CUTTERS };
    samples_of_part_itself(study, study.training_parts(), &draw, directions)
}

/// Test samples with cutters of one set, labeled by the published definition.
pub fn test_samples(study: &Study, set: CutterSet) -> Result<Vec<Sample>> {
    let draw = Draw { sets: &[set], n_cutters: N_TEST_CUTTERS };
    labeled(study, study.test_parts(), &draw, &Labeler::published(), study.args.sites)
}

pub fn trainings(study: &Study) -> PathBuf {
    study.folder().join("trainings")
}

/// The number that this folder keeps for the budget, or a new one from the time of the first steps.
fn samples_in_budget(study: &Study, settings: &Settings) -> Result<usize> {
    let args = study.args;
    let names: Vec<_> = study.training_parts().iter().map(|part| &part.name).collect();
    let key = json!([settings, study.minutes(), args.sites, names]);
    let path = trainings(study).join(format!("plan-{}.json", hash(&key, &[])));
    if path.exists() {
        let bytes = std::fs::read(&path).map_err(|e| Error::read(&path, e))?;
        let plan: Value = serde_json::from_slice(&bytes).unwrap_or_default();
        return plan["samples"].as_u64().map(|n| n as usize).ok_or_else(|| {
            let remedy = "remove the file to time the first steps again";
            Error::file(&path, "samples", "no number", remedy)
        });
    }
    let parts = &study.training_parts()[..study.training_parts().len().min(8)];
    let draw = Draw { sets: &[CutterSet::Uniform], n_cutters: 1 };
    let data = labeled(study, parts, &draw, &Labeler::published(), study.args.sites)?;
    let n_timed = (N_TIMED as usize + 1) * settings.batch_size;
    let settings = settings.clone().with_n_epochs(1).with_samples_per_epoch(Some(n_timed));
    let batch_size = settings.batch_size;
    let mut timer = Timer::default();
    let _ = Run::new(settings)?.train(&data[..], &[], &mut timer)?;
    let seconds = timer.seconds() / f64::from(N_TIMED) / batch_size as f64;
    let minutes = study.minutes();
    let n = (60.0 * minutes / seconds.max(1e-6)) as usize;
    study.output.say(format!("{seconds:.4} s per sample: {n} samples in {minutes} minutes"));
    let plan = json!({ "budget_minutes": minutes, "seconds_per_sample": seconds, "samples": n });
    atomic_file::write_atomic(&path, |file| writeln!(file, "{plan}"))?;
    Ok(n)
}

/// Times steps.
#[derive(Default)]
struct Timer(Vec<Instant>);

impl Timer {
    /// From the end of the first step to that of the last.
    fn seconds(&self) -> f64 {
        let ends = self.0.first().zip(self.0.last());
        ends.map_or(0.0, |(first, last)| (*last - *first).as_secs_f64())
    }
}

impl Observer for Timer {
    fn step(&mut self, _: &StepReport) -> ControlFlow<()> {
        self.0.push(Instant::now());
        ControlFlow::Continue(())
    }
}

/// Shows a training, and stops it after Ctrl-C.
struct Watch<'a> {
    study: &'a Study<'a>,
    bar: ProgressBar,
}

impl Observer for Watch<'_> {
    fn step(&mut self, report: &StepReport) -> ControlFlow<()> {
        self.bar.inc(1);
        self.bar.set_message(format!("loss {:.3}", report.loss));
        if self.study.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Sixteen hexadecimal digits of all that decides a training.
pub fn hash(settings: &Value, data: &[&[Sample]]) -> String {
    let mut hasher = hmac_sha256::Hash::new();
    hasher.update(format!("deepmill {} {settings}", env!("CARGO_PKG_VERSION")));
    for samples in data {
        hasher.update((samples.len() as u64).to_le_bytes());
        samples.iter().for_each(|sample| add(&mut hasher, sample));
    }
    hasher.finalize()[..8].iter().map(|byte| format!("{byte:02x}")).collect()
}

fn add(hasher: &mut hmac_sha256::Hash, sample: &Sample) {
    hasher.update((sample.sites.len() as u64).to_le_bytes());
    let surface = sample.surface().map(|surface| &**surface);
    let sites = std::iter::once(&*sample.sites).chain(surface);
    for vector in sites.flat_map(|sites| sites.points.iter().chain(&sites.normals)) {
        vector.to_array().iter().for_each(|x| hasher.update(x.to_le_bytes()));
    }
    sample.cutter.to_array().iter().for_each(|x| hasher.update(x.to_le_bytes()));
    for flags in [&sample.answers.inaccessible(), sample.answers.occlusion()] {
        hasher.update(flags.iter().map(|flag| u8::from(*flag)).collect::<Vec<u8>>());
    }
}
