//! The training loop: epochs of steps, with observers, interruption and exact resumption.

use super::evaluate::evaluate;
use super::step::{self, StepScratch};
use super::{EpochRow, HeadScore, Settings};
use crate::answers::Definition;
use crate::data::{Sample, SampleSource, loader};
use crate::metrics::Confusion;
use crate::model::{Domain, Model};
use crate::rng::{Purpose, Stream};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::time::Instant;

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

/// A training run.
#[derive(Debug)]
pub struct Run {
    /// How it was set up.
    pub settings: Settings,
    /// How far it has come.
    pub progress: Progress,
    /// The network.
    pub model: Model<f32>,
    /// Velocity of the optimizer, as long as the parameters.
    pub velocity: Vec<f32>,
    pub(super) scratch: StepScratch,
}

impl Run {
    /// A run at its beginning.
    ///
    /// # Errors
    /// If a setting is outside its domain.
    pub fn new(settings: Settings) -> Result<Self> {
        settings.check()?;
        let model = Model::new(&settings.network, settings.seed)?;
        let velocity = vec![0.0; model.params.len()];
        let progress = Progress::default();
        Ok(Run { settings, progress, model, velocity, scratch: StepScratch::default() })
    }

    /// Begins with the weights of `model` instead of random ones.
    ///
    /// # Errors
    /// If it is another network than that of the settings.
    pub fn start_from(&mut self, model: Model<f32>) -> Result<()> {
        if model.net.config() != self.model.net.config() {
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
        self.model = model;
        Ok(())
    }

    /// Says what the labels are about that it learns from.
    pub fn learns(&mut self, definition: Definition) {
        self.progress.definition = Some(definition);
        self.model.definition = Some(definition);
    }

    /// The state to store.
    #[cfg(feature = "formats")]
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
        if source.is_empty() {
            let remedy = "build a data set with at least one part that can be labeled";
            return Err(Error::argument("training set", "empty", "one sample or more", remedy));
        }
        while !self.is_finished() {
            if self.steps(source, observer)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
            let row = self.close_epoch(validation)?;
            if observer.epoch(self, &row)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// The steps that are left of the running epoch.
    fn steps(
        &mut self,
        source: &(impl SampleSource + ?Sized),
        observer: &mut impl Observer,
    ) -> Result<ControlFlow<()>> {
        let epoch = self.progress.history.len() as u64 + 1;
        let Settings { batch_size, seed, lr, n_epochs, .. } = self.settings;
        let n = source.len();
        let batches = match self.settings.samples_per_epoch {
            None => loader::batches(n, batch_size, seed, epoch),
            Some(n_draws) => loader::short_batches(n, batch_size, n_draws, seed, epoch),
        };
        let lr = self.settings.schedule.lr(lr, epoch, n_epochs);
        for (i, indices) in batches.iter().enumerate().skip(self.progress.steps_done) {
            let start = Instant::now();
            let samples = step::draw(source, &self.settings, epoch, indices)?;
            let stream = |s: &usize| Stream::new(seed, epoch, *s as u64, Purpose::Dropout);
            let mut dropout: Vec<Stream> = indices.iter().map(stream).collect();
            let place = format!("epoch {epoch}, batch {}", i + 1);
            let outcome = self.learn(lr, &samples, &mut dropout, &place)?;
            let progress = &mut self.progress;
            progress.steps_done = i + 1;
            progress.loss_sum += outcome.loss;
            progress.confusion[0] += outcome.confusion[0];
            progress.confusion[1] += outcome.confusion[1];
            progress.seconds += start.elapsed().as_secs_f64();
            let report = StepReport {
                epoch,
                step: i + 1,
                n_steps: batches.len(),
                loss: outcome.loss,
                scores: progress.confusion.map(score),
            };
            if observer.step(&report).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Turns the running epoch into a row of the history.
    fn close_epoch(&mut self, validation: &[Sample]) -> Result<EpochRow> {
        let epoch = self.progress.history.len() as u64 + 1;
        let settings = &self.settings;
        let due = epoch.is_multiple_of(settings.evaluate_every) || epoch == settings.n_epochs;
        let scores = match due && !validation.is_empty() {
            true => Some(evaluate(&self.model, validation)?.mean()),
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
