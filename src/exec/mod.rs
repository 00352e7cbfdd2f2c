//! How work runs: threads, memory, time, processes.

pub mod memory;
pub mod par;
pub mod processes;
pub(crate) mod stopwatch;
