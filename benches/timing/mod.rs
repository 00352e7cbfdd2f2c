//! Times repeated work: one line with the median, the least and the greatest of its runs.

#![allow(clippy::print_stdout)]

use std::hint::black_box;
use std::time::{Duration, Instant};

/// Runs before the clock starts: caches, page tables and the processor's clock settle.
const WARM_UP: Duration = Duration::from_millis(200);
/// All samples together, give or take one.
const MEASURED: Duration = Duration::from_secs(1);
const N_SAMPLES: u32 = 20;
const FEWEST_SAMPLES: usize = 5;

/// Prints the time of one run of `work`; `n_elements` are what it gets through, 0 for no throughput.
pub fn time<R>(name: impl std::fmt::Display, n_elements: usize, mut work: impl FnMut() -> R) {
    let (start, mut n_runs) = (Instant::now(), 0);
    while start.elapsed() < WARM_UP || n_runs == 0 {
        black_box(work());
        n_runs += 1;
    }
    // Short work is repeated within a sample, so that the clock's resolution does not matter.
    let run = start.elapsed() / n_runs;
    let repeats = ((MEASURED / N_SAMPLES).as_secs_f64() / run.as_secs_f64()).ceil().max(1.0) as u32;
    let (start, mut samples) = (Instant::now(), Vec::new());
    while samples.len() < FEWEST_SAMPLES || start.elapsed() < MEASURED {
        let start = Instant::now();
        (0..repeats).for_each(|_| drop(black_box(work())));
        samples.push(start.elapsed().as_secs_f64() / f64::from(repeats));
    }
    samples.sort_by(f64::total_cmp);
    let median = samples[samples.len() / 2];
    let [least, greatest] = [samples[0], samples[samples.len() - 1]];
    let shown = format!("{} ({} to {})", seconds(median), seconds(least), seconds(greatest));
    match n_elements {
        0 => println!("{name:<44} {shown}"),
        n => println!("{name:<44} {shown:<42} {:>9.3} G/s", n as f64 / median / 1e9),
    }
}

fn seconds(s: f64) -> String {
    match s {
        s if s < 1e-3 => format!("{:.2} µs", 1e6 * s),
        s if s < 1.0 => format!("{:.2} ms", 1e3 * s),
        s => format!("{s:.2} s"),
    }
}
