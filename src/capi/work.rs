//! Long work: on threads of its own, with its progress on the thread of the caller.

use super::status::Answer;
use crate::Result;
use crate::analysis::{Observer, Progress, Stage};
use crate::exec::par;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{self, Receiver, Sender};

/// Sites are placed.
pub const DM_STAGE_SITES: u32 = 0;
/// Tools are labeled.
pub const DM_STAGE_LABELS: u32 = 1;
/// What tools leave is computed.
pub const DM_STAGE_MACHINING: u32 = 2;
/// Predictions are computed again.
pub const DM_STAGE_VERIFYING: u32 = 3;
/// Findings, and what would help.
pub const DM_STAGE_FINDINGS: u32 = 4;
/// Files are written.
pub const DM_STAGE_WRITING: u32 = 5;

/// The number of a stage in C.
pub fn number(stage: Stage) -> u32 {
    match stage {
        Stage::Sites => DM_STAGE_SITES,
        Stage::Labels => DM_STAGE_LABELS,
        Stage::Machining => DM_STAGE_MACHINING,
        Stage::Verifying => DM_STAGE_VERIFYING,
        Stage::Findings => DM_STAGE_FINDINGS,
        Stage::Writing => DM_STAGE_WRITING,
    }
}

/// What the thread that works sends.
enum Message<T> {
    Progress(Progress),
    /// The result, or what a panic has left.
    Done(std::thread::Result<Result<T>>),
}

/// Passes progress on to the thread that waits.
struct Remote<T> {
    send: Sender<Message<T>>,
    answers: Receiver<ControlFlow<()>>,
}

impl<T> Observer for Remote<T> {
    fn progress(&mut self, progress: Progress) -> ControlFlow<()> {
        match self.send.send(Message::Progress(progress)) {
            Ok(()) => self.answers.recv().unwrap_or(ControlFlow::Break(())),
            Err(_) => ControlFlow::Break(()),
        }
    }
}

/// Runs work on `n_threads` threads of its own (0: one per logical CPU); `observer` is called on this thread. A panic
/// of the work goes on here.
pub fn run<T: Send + 'static>(
    n_threads: usize,
    observer: &mut dyn Observer,
    work: impl FnOnce(&mut dyn Observer) -> Result<T> + Send + 'static,
) -> Answer<T> {
    let (send, receive) = mpsc::channel();
    let (answer, answers) = mpsc::channel();
    par::start(move || {
        let mut remote = Remote { send: send.clone(), answers };
        let with_threads = || par::with_threads(n_threads, || work(&mut remote))?;
        let result = catch_unwind(AssertUnwindSafe(with_threads));
        // The other end waits for it.
        let _ = send.send(Message::Done(result));
    })?;
    loop {
        match receive.recv().expect("the thread sends its result, a panic too, before it ends") {
            Message::Progress(progress) => {
                // The other end waits for it.
                let _ = answer.send(observer.progress(progress));
            }
            Message::Done(Ok(result)) => return Ok(result?),
            Message::Done(Err(panic)) => resume_unwind(panic),
        }
    }
}
