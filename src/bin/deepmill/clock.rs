//! Wall-clock times of the stages of a command.

use deepmill::report::tables::{Cell, Facts};
use std::time::Instant;

/// A stopwatch with laps.
pub struct Clock {
    last: Instant,
    laps: Vec<(&'static str, &'static str, f64)>,
}

impl Clock {
    pub fn start() -> Self {
        Clock { last: Instant::now(), laps: Vec::new() }
    }

    /// The stage that began with the last lap is over.
    pub fn lap(&mut self, key: &'static str, name: &'static str) {
        let now = Instant::now();
        self.laps.push((key, name, (now - self.last).as_secs_f64()));
        self.last = now;
    }

    /// Stages that were timed by others, up to now.
    pub fn laps(&mut self, laps: impl IntoIterator<Item = (&'static str, &'static str, f64)>) {
        self.laps.extend(laps);
        self.last = Instant::now();
    }

    pub fn add_to(&self, facts: &mut Facts) {
        for (key, name, seconds) in &self.laps {
            facts.add(key, format!("time: {name}"), Cell::Seconds(*seconds));
        }
    }
}
