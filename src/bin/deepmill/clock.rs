//! Wall-clock times of the stages of a command.

use deepmill::tables::{Cell, Facts};
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

    /// Stages that an analysis timed, up to now: keys and names, and the seconds of each.
    pub fn stages<const N: usize>(&mut self, names: [[&'static str; 2]; N], seconds: [f64; N]) {
        let laps = names.into_iter().zip(seconds);
        self.laps.extend(laps.map(|([key, name], seconds)| (key, name, seconds)));
        self.last = Instant::now();
    }

    pub fn add_to(&self, facts: &mut Facts) {
        for (key, name, seconds) in &self.laps {
            facts.add(key, format!("time: {name}"), Cell::Seconds(*seconds));
        }
    }
}
