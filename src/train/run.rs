//! The training loop: epochs of steps, with observers, interruption and exact resumption.

use super::evaluate::evaluate_together;
use super::groups::Groups;
use super::step::{self, Step, StepScratch, Streams};
use super::{EpochRow, HeadScore, Settings};
use crate::answers::Definition;
use crate::data::{Sample, SampleSource, loader};
use crate::exec::par;
#[cfg(feature = "formats")]
use crate::exec::processes::share_bytes;
use crate::exec::processes::{Processes, SingleProcess, agree, agree_to_go_on, require_same};
use crate::exec::stopwatch::Stopwatch;
use crate::learn::metrics::Confusion;
use crate::model::{AnyModel, AnyNetwork, Domain};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// One finished step.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct StepReport {
    /// Epoch, from 1.
    pub epoch: u64,
    /// Steps of this epoch that are done.
    pub step: usize,
    /// Steps per epoch.
    pub n_steps: usize,
    /// Loss of this step's batch.
    pub loss: f64,
    /// Training scores of both heads since the epoch began.
    pub scores: [HeadScore; 2],
}

/// What looks on while a run goes on.
pub trait Observer {
    /// After every step. `Break` stops the run after it; the run can be stored and resumed.
    fn step(&mut self, report: &StepReport) -> ControlFlow<()> {
        let _ = report;
        ControlFlow::Continue(())
    }

    /// After every epoch, with the run in the state that a checkpoint would store.
    ///
    /// # Errors
    /// Whatever stops the run, such as a checkpoint that cannot be written.
    fn epoch(&mut self, run: &Run, row: &EpochRow) -> Result<ControlFlow<()>> {
        let _ = (run, row);
        Ok(ControlFlow::Continue(()))
    }
}

/// An observer that only lets the run go on.
impl Observer for () {}

/// How far a run has come.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Progress {
    /// One row per finished epoch.
    pub history: Vec<EpochRow>,
    /// Steps done in the running epoch.
    pub steps_done: usize,
    /// Sum of the running epoch's losses.
    pub loss_sum: f64,
    /// Confusion counts of both heads in the running epoch.
    pub confusion: [Confusion; 2],
    /// Wall-clock seconds of the running epoch before it was interrupted.
    pub seconds: f64,
    /// What the network has seen, with what it saw before this run.
    #[serde(default)]
    pub domain: Option<Domain>,
    /// What the labels are about, if that is known: goes into the weights.
    #[serde(default)]
    pub definition: Option<Definition>,
    /// Best validation score so far and its epoch: the sum of both heads' F1.
    pub best: Option<(f64, u64)>,
}

/// Numbers for each parameter beside the sums of gradients: parameters, velocity and their gradient; copies of the
/// first two for a checkpoint, as numbers, as bytes and as a file.
const N_VECTORS: usize = 9;

/// A training run.
///
/// ```
/// use deepmill::train::{Run, Settings};
/// # use deepmill::{answers::SiteAnswers, data::Sample, geom::Sites, glam::Vec3};
///
/// # let points: Vec<Vec3> = (0..40).map(|i| Vec3::new((i % 7) as f32, (i / 7) as f32, (i % 3) as f32)).collect();
/// # let sites = Sites { normals: vec![Vec3::Z; 40], points, faces: vec![] };
/// # let answers = SiteAnswers::new(vec![false; 40], vec![true; 40]);
/// # let samples = [Sample::new("part", sites.into(), [1.5, 6.0, 40.0, 5.0].into(), answers)];
/// let mut run = Run::new(Settings::tiny().with_n_epochs(1).with_seed(7))?;
/// let error = run.train(&samples[..0], &[], &mut ()).unwrap_err().to_string();
/// assert!(error.contains("training set is empty") && !run.is_finished());
/// let before = run.model.params.clone();
/// assert!(run.train(&samples[..], &[], &mut ())?.is_continue()); // no observer stopped it
/// assert!(run.is_finished() && run.model.params != before);
/// let mut again = Run::new(run.settings.clone())?;
/// again.train(&samples[..], &[], &mut ())?;
/// assert_eq!(again.model.params, run.model.params); // the seed decides everything
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug)]
pub struct Run {
    /// How it was set up.
    pub settings: Settings,
    /// How far it has come.
    #[doc(hidden)] // what a checkpoint keeps
    pub progress: Progress,
    /// The network.
    pub model: AnyModel<f32>,
    /// Velocity of the optimizer, as long as the parameters.
    #[doc(hidden)] // what a checkpoint keeps
    pub velocity: Vec<f32>,
    pub(super) scratch: StepScratch,
}

impl Run {
    /// A run at its beginning.
    ///
    /// # Errors
    /// If a setting is outside its domain, or training does not fit into the memory.
    pub fn new(settings: Settings) -> Result<Self> {
        settings.check()?;
        let n_sums = settings.n_groups.ilog2() as usize + 2;
        let bytes_of_each = 4 * (N_VECTORS + n_sums);
        let net = AnyNetwork::new(&settings.network)?;
        net.layout().require_memory("training", bytes_of_each)?;
        let model = AnyModel::with_network(net, settings.seed);
        let velocity = vec![0.0; model.params.len()];
        let progress = Progress::default();
        Ok(Run { settings, progress, model, velocity, scratch: StepScratch::default() })
    }

    /// Begins with the weights of `model` instead of random ones. The number of
    /// [coarse directions](crate::model::config::InputConfig::coarse_directions) may be another one.
    ///
    /// # Errors
    /// If it is another network than that of the settings.
    pub fn start_from(&mut self, model: AnyModel<f32>) -> Result<()> {
        if !model.net.config().has_parameters_of(&self.settings.network) {
            let remedy = "train with the settings.toml of the run that the weights come from";
            let expected = "the network of the settings";
            return Err(Error::argument(
                "weights to start from",
                "another network",
                expected,
                remedy,
            ));
        }
        self.progress.domain = model.domain;
        self.progress.definition = model.definition;
        let net = self.model.net.clone();
        self.model = AnyModel { net, ..model };
        Ok(())
    }

    /// Says what the labels are about that it learns from.
    pub fn learns(&mut self, definition: Definition) {
        self.progress.definition = Some(definition);
        self.model.definition = Some(definition);
    }

    /// The state to store.
    #[cfg(feature = "formats")]
    #[doc(hidden)] // of `RunFolder`
    pub fn checkpoint(&self) -> super::Checkpoint {
        super::Checkpoint {
            settings: self.settings.clone(),
            progress: self.progress.clone(),
            params: self.model.params.clone(),
            buffers: self.model.buffers.clone(),
            velocity: self.velocity.clone(),
        }
    }

    /// The run whose state `checkpoint` is.
    ///
    /// # Errors
    /// If its vectors do not fit its settings.
    #[cfg(feature = "formats")]
    #[doc(hidden)] // of `RunFolder`
    pub fn resume(checkpoint: super::Checkpoint) -> Result<Self> {
        let mut run = Run::new(checkpoint.settings)?;
        let fits = checkpoint.params.len() == run.model.params.len()
            && checkpoint.velocity.len() == run.model.params.len()
            && checkpoint.buffers.len() == run.model.buffers.len();
        if !fits {
            let found = format!("{} parameters in the checkpoint", checkpoint.params.len());
            let expected = format!("{}, as its network has", run.model.params.len());
            return Err(Error::argument("checkpoint", found, expected, "start the run anew"));
        }
        run.model.domain = checkpoint.progress.domain;
        run.model.definition = checkpoint.progress.definition;
        run.model.params = checkpoint.params;
        run.model.buffers = checkpoint.buffers;
        run.velocity = checkpoint.velocity;
        run.progress = checkpoint.progress;
        Ok(run)
    }

    /// The run of process 0, on all processes: there `own` is `Some`, elsewhere `None`.
    ///
    /// # Errors
    /// If process 0 has none, or another cannot make it.
    #[cfg(feature = "formats")]
    pub fn share(own: Option<Result<Run>>, processes: &dyn Processes) -> Result<Run> {
        let text = |run: &Option<Run>| {
            let state = run.as_ref().map(|run| (&run.settings, &run.progress));
            serde_json::to_vec(&state).unwrap_or_default()
        };
        let (own, all) = share_bytes(processes, own.transpose(), text)?;
        let run = own.map_or_else(|| Run::from_text(&all[0]), Ok);
        let mut run = agree(processes, run)?;
        let AnyModel { params, buffers, .. } = &mut run.model;
        for numbers in [params, buffers, &mut run.velocity] {
            processes.broadcast(numbers);
        }
        Ok(run)
    }

    /// A run with the settings and the progress of another.
    #[cfg(feature = "formats")]
    fn from_text(text: &[u8]) -> Result<Run> {
        let (settings, progress): (_, Progress) = serde_json::from_slice(text).map_err(|e| {
            let remedy = "start the same program on all nodes";
            Error::argument("state of the run", e, "that of process 0", remedy)
        })?;
        let mut run = Run::new(settings)?;
        (run.model.domain, run.model.definition) = (progress.domain, progress.definition);
        run.progress = progress;
        Ok(run)
    }

    /// Whether all epochs are done.
    pub fn is_finished(&self) -> bool {
        self.progress.history.len() as u64 >= self.settings.n_epochs
    }

    /// Trains until the last epoch is done or the observer stops it.
    ///
    /// # Errors
    /// If there are no samples, one is inconsistent or cannot be drawn, the loss is not finite, or the
    /// observer fails.
    pub fn train(
        &mut self,
        source: &(impl SampleSource + ?Sized),
        validation: &[Sample],
        observer: &mut impl Observer,
    ) -> Result<ControlFlow<()>> {
        self.train_together(source, validation, observer, &SingleProcess)
    }

    /// [`Run::train`] on several processes, which share out the groups of each step and the validation samples. All
    /// call it with the same run and the same samples, and end with the bits that a single process ends with. Each has
    /// an observer.
    ///
    /// # Errors
    /// As [`Run::train`], if there are fewer groups than processes, or if another process fails.
    pub fn train_together(
        &mut self,
        source: &(impl SampleSource + ?Sized),
        validation: &[Sample],
        observer: &mut impl Observer,
        processes: &dyn Processes,
    ) -> Result<ControlFlow<()>> {
        agree(processes, self.check_for(source, processes))?;
        require_same(processes, "number of samples", &source.len().to_string())?;
        require_same(processes, "number of validation samples", &validation.len().to_string())?;
        while !self.is_finished() {
            if self.steps(source, observer, processes)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
            let row = self.close_epoch(validation, processes)?;
            if agree_to_go_on(processes, observer.epoch(self, &row))?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Checks that there are samples, and work for every process.
    fn check_for(
        &self,
        source: &(impl SampleSource + ?Sized),
        processes: &dyn Processes,
    ) -> Result<()> {
        if source.is_empty() {
            let remedy = "build a data set with at least one part that can be labeled";
            return Err(Error::argument("training set", "empty", "one sample or more", remedy));
        }
        let n_samples = self.settings.batch_size.min(source.len());
        let n_groups = Groups::new(n_samples, self.settings.n_groups, &SingleProcess).len();
        if processes.size() > n_groups {
            let expected = format!("at most {n_groups}, one for each group of a step's samples");
            let remedy = "start fewer processes, or a run with more groups (n_groups)";
            return Err(Error::argument("number of processes", processes.size(), expected, remedy));
        }
        Ok(())
    }

    /// The steps that are left of the running epoch.
    fn steps(
        &mut self,
        source: &(impl SampleSource + ?Sized),
        observer: &mut impl Observer,
        processes: &dyn Processes,
    ) -> Result<ControlFlow<()>> {
        let epoch = self.progress.history.len() as u64 + 1;
        let Settings { batch_size, n_groups, seed, lr, n_epochs, .. } = self.settings;
        let n = source.len();
        let batches = match self.settings.samples_per_epoch {
            None => loader::batches(n, batch_size, seed, epoch),
            Some(n_draws) => loader::short_batches(n, batch_size, n_draws, seed, epoch),
        };
        let lr = self.settings.schedule.lr(lr, epoch, n_epochs);
        let groups = |indices: &[usize]| Groups::new(indices.len(), n_groups, processes);
        let (settings, mut ahead) = (self.settings.clone(), None);
        let draw = |indices: &[usize]| step::draw(source, &settings, epoch, indices);
        for (i, indices) in batches.iter().enumerate().skip(self.progress.steps_done) {
            let start = Stopwatch::start();
            let next = batches.get(i + 1).map(|next| &next[groups(next).own_samples()]);
            let groups = groups(indices);
            let indices = &indices[groups.own_samples()];
            let samples = ahead.take().unwrap_or_else(|| draw(indices));
            let mut streams = Streams::new(seed, epoch, indices);
            let place = &format!("epoch {epoch}, batch {}", i + 1);
            let step = Step { lr, place, groups, processes };
            // The next step's samples are drawn, and online ones labeled, by threads that this one leaves idle.
            let learn = || self.learn(step, samples, &mut streams);
            let (outcome, drawn) = par::with_ahead(learn, || next.map(draw));
            let outcome = outcome?;
            ahead = drawn;
            let progress = &mut self.progress;
            progress.steps_done = i + 1;
            progress.loss_sum += outcome.loss;
            progress.confusion[0] += outcome.confusion[0];
            progress.confusion[1] += outcome.confusion[1];
            progress.seconds += start.seconds();
            let report = StepReport {
                epoch,
                step: i + 1,
                n_steps: batches.len(),
                loss: outcome.loss,
                scores: progress.confusion.map(score),
            };
            if agree_to_go_on(processes, Ok(observer.step(&report)))?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Turns the running epoch into a row of the history.
    fn close_epoch(
        &mut self,
        validation: &[Sample],
        processes: &dyn Processes,
    ) -> Result<EpochRow> {
        let epoch = self.progress.history.len() as u64 + 1;
        let settings = &self.settings;
        let due = epoch.is_multiple_of(settings.evaluate_every) || epoch == settings.n_epochs;
        let scores = match due && !validation.is_empty() {
            true => Some(evaluate_together(&self.model, validation, processes)?.mean()),
            false => None,
        };
        let progress = &mut self.progress;
        let [a, b] = progress.confusion.map(score);
        let row = EpochRow {
            epoch,
            lr: settings.schedule.lr(settings.lr, epoch, settings.n_epochs),
            loss: progress.loss_sum / progress.steps_done.max(1) as f64,
            inaccessible: a,
            occlusion: b,
            validation: scores,
            seconds: progress.seconds,
        };
        let score = scores.map(|[a, b]| a.f1 + b.f1);
        if let Some(score) = score.filter(|s| progress.best.is_none_or(|(best, _)| *s > best)) {
            progress.best = Some((score, epoch));
        }
        (progress.steps_done, progress.loss_sum, progress.seconds) = (0, 0.0, 0.0);
        progress.confusion = Default::default();
        progress.history.push(row);
        Ok(row)
    }
}

fn score(counts: Confusion) -> HeadScore {
    HeadScore { accuracy: counts.accuracy(), f1: counts.f1() }
}

#[cfg(test)]
mod tests;
