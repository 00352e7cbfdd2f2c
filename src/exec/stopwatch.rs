//! Seconds that work takes.

use std::time::Instant;

/// Runs from its start on; where the system has no clock (`wasm32-unknown-unknown`), it stays at 0.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch(Option<Instant>);

/// Whether [`Instant::now`] gives an answer: without a system it panics.
const HAS_CLOCK: bool = !cfg!(all(target_family = "wasm", target_os = "unknown"));

impl Stopwatch {
    /// Starts one.
    pub fn start() -> Self {
        Stopwatch(HAS_CLOCK.then(Instant::now))
    }

    /// Seconds since the start.
    pub fn seconds(self) -> f64 {
        self.0.map_or(0.0, |start| start.elapsed().as_secs_f64())
    }
}
