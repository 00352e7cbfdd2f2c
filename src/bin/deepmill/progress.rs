//! Progress on standard error, and the flag that Ctrl-C sets.

use deepmill::analysis::{Observer, Progress, Stage};
use deepmill::{Error, Result};
use indicatif::{ProgressBar, ProgressState, ProgressStyle};
use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A bar over `n` things with the time that went by and, once one of them is done, how much is left; it moves on while
/// one takes long. Invisible where standard error is no terminal.
pub fn bar(n: u64, things: &'static str) -> ProgressBar {
    let template = "{bar:32} {pos}/{len} {prefix}, {elapsed} gone{left}  {msg}";
    let left = |state: &ProgressState, text: &mut dyn fmt::Write| {
        if state.pos() > 0 {
            let _ = write!(text, ", about {} left", rounded(state.eta()));
        }
    };
    let style = ProgressStyle::with_template(template).unwrap_or(ProgressStyle::default_bar());
    let bar = ProgressBar::new(n).with_style(style.with_key("left", left)).with_prefix(things);
    tick(&bar);
    bar
}

/// Moves a bar on by a thread of its own, which takes memory: not where nobody sees it.
fn tick(bar: &ProgressBar) {
    if io::stderr().is_terminal() {
        bar.enable_steady_tick(TICK);
    }
}

/// Says what is done and for how long, until it is dropped. Invisible where standard error is no terminal.
pub struct Working(ProgressBar);

/// Says that this goes on.
pub fn working(what: &'static str) -> Working {
    let style = ProgressStyle::with_template("{spinner} {prefix}, {elapsed} gone");
    let style = style.unwrap_or(ProgressStyle::default_spinner());
    let bar = ProgressBar::new_spinner().with_style(style).with_prefix(what);
    tick(&bar);
    Working(bar)
}

impl Drop for Working {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// How far the stages of an analysis are: as bars on a terminal, else as a line every [`BETWEEN_LINES`].
#[derive(Default)]
pub struct Bars {
    shown: Option<Shown>,
    lines: Lines,
}

/// What a terminal shows.
enum Shown {
    Bar(ProgressBar),
    Working { _until_dropped: Working },
}

impl Observer for Bars {
    fn progress(&mut self, progress: Progress) -> ControlFlow<()> {
        let Progress { stage, done, of, .. } = progress;
        let words = words(stage);
        if done == of {
            if let Some(Shown::Bar(bar)) = self.shown.take() {
                bar.finish_and_clear();
            }
            self.lines.began = None;
        } else if of > 1 {
            if !matches!(self.shown, Some(Shown::Bar(_))) {
                self.shown = Some(Shown::Bar(bar(of as u64, words)));
            }
            if let Some(Shown::Bar(bar)) = &self.shown {
                bar.set_length(of as u64);
                bar.set_position(done as u64);
            }
            if let Some(line) = self.lines.line(words, (done, of), Instant::now())
                && !io::stderr().is_terminal()
            {
                let _ = io::stderr().write_all(line.as_bytes());
            }
        } else {
            let words = if stage == Stage::Labels { "computing answers" } else { words };
            self.shown = Some(Shown::Working { _until_dropped: working(words) });
        }
        ControlFlow::Continue(())
    }
}

fn words(stage: Stage) -> &'static str {
    match stage {
        Stage::Sites => "placing sites",
        Stage::Labels | Stage::Verifying => "tools",
        Stage::Machining => "directions",
        Stage::Findings => "findings",
        Stage::Writing => "writing and drawing",
        _ => "working",
    }
}

/// Lines of a log.
#[derive(Default)]
struct Lines {
    began: Option<Instant>,
    last: Option<Instant>,
}

impl Lines {
    /// How far a stage is, unless it was said shortly before, or began then.
    fn line(&mut self, things: &str, (done, of): (usize, usize), now: Instant) -> Option<String> {
        let began = *self.began.get_or_insert(now);
        if done == 0 {
            (self.began, self.last) = (Some(now), None);
        }
        if now - self.last.unwrap_or(began) < BETWEEN_LINES || done == 0 {
            return None;
        }
        self.last = Some(now);
        let gone = now - began;
        Some(format!("{done} of {of} {things}, {} gone{}\n", rounded(gone), left(gone, done, of)))
    }
}

/// `, about 70 s left`, if so much of it took so long; nothing before a part is done.
fn left(gone: Duration, done: usize, of: usize) -> String {
    match done {
        0 => String::new(),
        _ => {
            let rest = of.saturating_sub(done) as f64 / done as f64;
            format!(", about {} left", rounded(gone.mul_f64(rest)))
        }
    }
}

/// `70 s`, `12 min`, `3.5 h`.
fn rounded(time: Duration) -> String {
    match time.as_secs_f64() {
        s if s < 99.5 => format!("{s:.0} s"),
        s if s < 99.5 * 60.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// Between two lines about the progress in a log.
const BETWEEN_LINES: Duration = Duration::from_secs(10);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_is_given_once_a_part_is_done_and_lines_are_seconds_apart() {
        let start = Instant::now();
        let after = |seconds: u64| start + Duration::from_secs(seconds);
        let mut lines = Lines::default();
        assert_eq!(lines.line("tools", (0, 33), start), None);
        assert_eq!(lines.line("tools", (2, 33), after(4)), None);
        let line = lines.line("tools", (11, 33), after(20)).unwrap();
        assert_eq!(line, "11 of 33 tools, 20 s gone, about 40 s left\n");
        assert_eq!(lines.line("tools", (12, 33), after(29)), None);
        let line = lines.line("tools", (22, 33), after(600)).unwrap();
        assert_eq!(line, "22 of 33 tools, 10 min gone, about 5 min left\n");
        // The next stage begins anew.
        assert_eq!(lines.line("tools", (0, 4), after(700)), None);
        let line = lines.line("tools", (1, 4), after(715)).unwrap();
        assert_eq!(line, "1 of 4 tools, 15 s gone, about 45 s left\n");
        assert_eq!(left(Duration::from_secs(9), 0, 3), "");
        assert_eq!(rounded(Duration::from_secs(3 * 3600)), "3.0 h");
    }
}
