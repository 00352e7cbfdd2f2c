//! What every experiment is given: options, parts, progress, interruption.

use super::parts::{self, Part};
use super::{Args, Experiment};
use crate::output::Output;
use crate::progress;
use deepmill::{Error, Result};
use indicatif::ProgressBar;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Directions over the upper half, as in the paper.
pub const N_DIRECTIONS: usize = 150;

/// Of the budget, what a training of `all` gets, so that 20 minutes are four hours for all experiments on two cores
/// (docs/reproduce.md has the sum).
const SHARE_IN_ALL: f64 = 0.1;

/// One run of the command.
pub struct Study<'a> {
    pub args: &'a Args,
    pub output: &'a Output,
    /// All parts; those for testing are last.
    parts: Vec<Part>,
    stop: Arc<AtomicBool>,
    n_trained: AtomicUsize,
}

impl<'a> Study<'a> {
    pub fn new(args: &'a Args, output: &'a Output) -> Result<Self> {
        let stop = progress::stop_flag()?;
        let parts = match args.parts.is_empty() {
            true => parts::generate(args.parts_count),
            false => parts::read(args, output)?,
        };
        Ok(Study { args, output, parts, stop, n_trained: AtomicUsize::new(0) })
    }

    /// The parts to train on.
    pub fn training_parts(&self) -> &[Part] {
        &self.parts[..self.parts.len() - self.n_test_parts()]
    }

    /// The parts that no network is trained on.
    pub fn test_parts(&self) -> &[Part] {
        &self.parts[self.parts.len() - self.n_test_parts()..]
    }

    /// A quarter, at least one.
    fn n_test_parts(&self) -> usize {
        (self.parts.len() / 4).max(1)
    }

    /// All parts of the user; none if parts are generated.
    pub fn parts_of_user(&self) -> &[Part] {
        if self.args.parts.is_empty() { &[] } else { &self.parts }
    }

    /// Where a file of this name is written.
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder().join(name)
    }

    pub fn folder(&self) -> &Path {
        &self.args.out
    }

    /// A bar over `n` things.
    pub fn bar(&self, n: usize, things: &'static str) -> ProgressBar {
        progress::bar(n as u64, things)
    }

    /// Budget of a training, minutes.
    pub fn minutes(&self) -> f64 {
        match self.args.experiment {
            Experiment::All => self.args.budget * SHARE_IN_ALL,
            _ => self.args.budget,
        }
    }

    /// Whether Ctrl-C was pressed.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Fails if Ctrl-C was pressed.
    pub fn go_on(&self) -> Result<()> {
        match self.is_stopped() {
            true => {
                Err(Error::Interrupted { remedy: "give the same command again to go on".into() })
            }
            false => Ok(()),
        }
    }

    /// Counts a training of this run.
    pub fn count_training(&self) {
        self.n_trained.fetch_add(1, Ordering::Relaxed);
    }

    /// Trainings that were begun or gone on with, not found finished.
    pub fn n_trained(&self) -> usize {
        self.n_trained.load(Ordering::Relaxed)
    }
}
