//! How far long work is, and whether it goes on.

use crate::{Error, Result};
use std::ops::ControlFlow;

/// A stage of an analysis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// Sites are placed.
    Sites,
    /// Tools are labeled.
    Labels,
    /// What tools leave is computed.
    Machining,
    /// Predictions are computed again.
    Verifying,
    /// Findings, and what would help.
    Findings,
    /// Files are written.
    Writing,
}

/// How far the work is: `done` of `of` parts of a stage.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// The stage.
    pub stage: Stage,
    /// Parts that are done.
    pub done: usize,
    /// All parts of the stage, such as tools.
    pub of: usize,
}

/// Is called with the progress of long work, and may stop it: between the parts of a stage, from one thread.
///
/// A closure is one: `|p: Progress| { println!("{:?} {}/{}", p.stage, p.done, p.of); ControlFlow::Continue(()) }`; `()`
/// ignores it.
pub trait Observer {
    /// The work is that far. [`ControlFlow::Break`] ends it with [`Error::Interrupted`](crate::Error::Interrupted).
    fn progress(&mut self, progress: Progress) -> ControlFlow<()>;
}

impl Observer for () {
    fn progress(&mut self, _: Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl<F: FnMut(Progress) -> ControlFlow<()>> Observer for F {
    fn progress(&mut self, progress: Progress) -> ControlFlow<()> {
        self(progress)
    }
}

/// Calls the observer; an error if it stops the work.
pub(super) fn report(
    observer: &mut dyn Observer,
    stage: Stage,
    (done, of): (usize, usize),
) -> Result<()> {
    match observer.progress(Progress { stage, done, of }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::Interrupted { remedy: "start it again".into() }),
    }
}
