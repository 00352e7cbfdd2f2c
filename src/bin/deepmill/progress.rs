//! Progress bars on standard error, and the flag that Ctrl-C sets.

use deepmill::analysis::{Observer, Progress, Stage};
use deepmill::{Error, Result};
use indicatif::{ProgressBar, ProgressStyle};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A bar over `n` things with the time that went by and is left; it moves on while one of them takes long. Invisible
/// where standard error is no terminal.
pub fn bar(n: u64, things: &'static str) -> ProgressBar {
    let template = "{bar:32} {pos}/{len} {prefix}, {elapsed} gone, {eta} left  {msg}";
    let style = ProgressStyle::with_template(template).unwrap_or(ProgressStyle::default_bar());
    let bar = ProgressBar::new(n).with_style(style).with_prefix(things);
    bar.enable_steady_tick(TICK);
    bar
}

/// Bars for the stages of an analysis that go by tools.
#[derive(Default)]
pub struct Bars(Option<ProgressBar>);

impl Observer for Bars {
    fn progress(&mut self, progress: Progress) -> ControlFlow<()> {
        let things = match progress.stage {
            Stage::Labels | Stage::Verifying | Stage::Writing => "tools",
            Stage::Machining => "directions",
            _ => return ControlFlow::Continue(()),
        };
        let bar = self.0.get_or_insert_with(|| bar(progress.of as u64, things));
        bar.set_length(progress.of as u64);
        bar.set_position(progress.done as u64);
        if progress.done == progress.of {
            bar.finish_and_clear();
            self.0 = None;
        }
        ControlFlow::Continue(())
    }
}

const TICK: Duration = Duration::from_millis(500);

/// A flag that Ctrl-C or a termination signal sets; a second Ctrl-C ends the program at once.
///
/// # Errors
/// If the system does not let signals be caught.
pub fn stop_flag() -> Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&flag);
    let caught = ctrlc::set_handler(move || {
        if seen.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
    });
    caught.map_err(|e| {
        let remedy = "run it where signals can be caught";
        Error::argument("signal handler", e, "one that can be set", remedy)
    })?;
    Ok(flag)
}
