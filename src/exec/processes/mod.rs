//! Several processes that work as one: what they exchange, and how a failure of one becomes a failure of all.
//!
//! Every process makes the same calls in the same order. Nothing here does arithmetic: what is summed, and in
//! which order, is the caller's, so that results do not depend on the library that moves the bytes.

#[cfg(feature = "mpi")]
mod mpi;

#[cfg(feature = "mpi")]
pub use mpi::Mpi;

use crate::{Error, Result};
use std::ops::{ControlFlow, Range};

/// What one process knows of the others, and sends them.
pub trait Processes: Sync {
    /// Number of this process, from 0.
    fn rank(&self) -> usize;

    /// Number of processes.
    fn size(&self) -> usize;

    /// The byte strings of all processes, in order.
    fn gather(&self, own: &[u8]) -> Vec<Vec<u8>>;

    /// Gives all processes the numbers of process 0. `data` is as long everywhere.
    fn broadcast(&self, data: &mut [f32]);

    /// Sends `own[parts[r]]` to every process `r`; returns what they all send here, in order. `lengths[r]` is the
    /// length of what comes from process `r`.
    fn exchange(&self, own: &[f32], parts: &[Range<usize>], lengths: &[usize]) -> Vec<f32>;

    /// Completes `all`, of which each process `r` has `parts[r]`; the parts lie one after another.
    fn complete(&self, all: &mut [f32], parts: &[Range<usize>]);

    /// What this process has sent so far.
    #[doc(hidden)] // of the program
    fn traffic(&self) -> Traffic {
        Traffic::default()
    }
}

/// What a process has sent, and how long it was at it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[doc(hidden)] // of the program
#[non_exhaustive]
pub struct Traffic {
    /// Bytes for other processes.
    pub bytes_sent: u64,
    /// Wall-clock seconds in calls, with the time of waiting for others.
    pub seconds: f64,
}

/// One process that has no others.
///
/// What is written for several processes is the same for one:
///
/// ```
/// use deepmill::processes::{Processes, SingleProcess};
///
/// fn mean(own: f64, processes: &dyn Processes) -> f64 {
///     let all = processes.gather(&own.to_le_bytes());
///     let number = |bytes: &Vec<u8>| f64::from_le_bytes(bytes[..].try_into().expect("eight bytes"));
///     all.iter().map(number).sum::<f64>() / processes.size() as f64
/// }
/// assert_eq!(mean(0.25, &SingleProcess), 0.25);
/// assert_eq!(SingleProcess.exchange(&[1.0, 2.0, 3.0], &[1..3], &[2]), [2.0, 3.0]); // sent to itself
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct SingleProcess;

impl Processes for SingleProcess {
    fn rank(&self) -> usize {
        0
    }

    fn size(&self) -> usize {
        1
    }

    fn gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
        vec![own.to_vec()]
    }

    fn broadcast(&self, _: &mut [f32]) {}

    fn exchange(&self, own: &[f32], parts: &[Range<usize>], _: &[usize]) -> Vec<f32> {
        own[parts[0].clone()].to_vec()
    }

    fn complete(&self, _: &mut [f32], _: &[Range<usize>]) {}
}

/// Which of `n` things in a row belong to process `rank` of `size`: shares in order that differ by at most one.
///
/// # Panics
/// If `size` is 0.
#[doc(hidden)] // of the program
pub fn share(n: usize, rank: usize, size: usize) -> Range<usize> {
    rank * n / size..(rank + 1) * n / size
}

/// What this process made, and the bytes that `message` takes from it on every process; an error everywhere, if one of
/// them failed.
///
/// # Errors
/// [`Error::Process`] with the error of the first process that failed, on that process, and [`Error::OtherProcess`] on
/// all others. A single process has its own error.
pub(crate) fn share_bytes<T>(
    processes: &dyn Processes,
    own: Result<T>,
    message: impl FnOnce(&T) -> Vec<u8>,
) -> Result<(T, Vec<Vec<u8>>)> {
    let bytes =
        own.as_ref().map_or_else(|_| vec![FAILED], |own| [vec![FINE], message(own)].concat());
    let all = processes.gather(&bytes);
    match (own, all.iter().position(|bytes| bytes[0] == FAILED)) {
        (Ok(own), None) => Ok((own, all.into_iter().map(|bytes| bytes[1..].to_vec()).collect())),
        (Err(error), Some(first)) if first == processes.rank() => Err(of_process(processes, error)),
        (_, first) => Err(Error::OtherProcess { rank: first.unwrap_or_default() }),
    }
}

const FINE: u8 = 0;
const FAILED: u8 = 1;

fn of_process(processes: &dyn Processes, error: Error) -> Error {
    match (processes.size(), error) {
        (1, error) | (_, error @ Error::Process { .. }) => error,
        (size, error) => Error::Process { rank: processes.rank(), size, source: Box::new(error) },
    }
}

/// [`share_bytes`] with nothing to say: this process's result, if all succeeded.
///
/// # Errors
/// As [`share_bytes`].
#[doc(hidden)] // of the program
pub fn agree<T>(processes: &dyn Processes, own: Result<T>) -> Result<T> {
    Ok(share_bytes(processes, own, |_| Vec::new())?.0)
}

/// [`agree`] on whether to go on: one process that stops, stops all.
///
/// # Errors
/// As [`share_bytes`].
#[doc(hidden)] // of the program
pub fn agree_to_go_on(
    processes: &dyn Processes,
    own: Result<ControlFlow<()>>,
) -> Result<ControlFlow<()>> {
    let (_, all) = share_bytes(processes, own, |flow| vec![u8::from(flow.is_break())])?;
    Ok(match all.iter().any(|stops| stops[0] == 1) {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    })
}

/// [`share_bytes`] of numbers: those of all processes, one after another.
///
/// # Errors
/// As [`share_bytes`].
pub(crate) fn share_numbers<T>(
    processes: &dyn Processes,
    own: Result<T>,
    message: impl FnOnce(&T) -> Vec<f64>,
) -> Result<(T, Vec<f64>)> {
    let to_bytes = |own: &T| message(own).iter().flat_map(|x| x.to_le_bytes()).collect();
    let (own, all) = share_bytes(processes, own, to_bytes)?;
    let numbers = all.iter().flat_map(|bytes| bytes.as_chunks::<8>().0);
    Ok((own, numbers.map(|bytes| f64::from_le_bytes(*bytes)).collect()))
}

/// Checks that `value` is the same on all processes; `name` says what it is of.
///
/// # Errors
/// On the first process where it is not that of process 0, with both; [`Error::OtherProcess`] on the others.
#[doc(hidden)] // of the program
pub fn require_same(processes: &dyn Processes, name: &'static str, value: &str) -> Result<()> {
    let all = processes.gather(value.as_bytes());
    let expected = String::from_utf8_lossy(&all[0]);
    let own = match value == expected {
        true => Ok(()),
        false => {
            let expected = format!("{expected}, as on process 0");
            let remedy = "start the same program with the same options and data on all nodes";
            Err(Error::argument(name, value, expected, remedy))
        }
    };
    agree(processes, own)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use std::sync::{Barrier, Mutex};

    /// Threads that act as processes.
    pub(crate) struct Threads {
        barrier: Barrier,
        bytes: Mutex<Vec<Vec<u8>>>,
        numbers: Mutex<Vec<Vec<Vec<f32>>>>,
    }

    struct Thread<'a> {
        rank: usize,
        shared: &'a Threads,
    }

    impl Threads {
        /// Calls `work` as each of `n` processes at once; their results in order.
        pub(crate) fn run<R: Send>(n: usize, work: impl Fn(&dyn Processes) -> R + Sync) -> Vec<R> {
            let shared = &Threads {
                barrier: Barrier::new(n),
                bytes: Mutex::new(vec![Vec::new(); n]),
                numbers: Mutex::new(vec![Vec::new(); n]),
            };
            let work = &work;
            std::thread::scope(|scope| {
                let start = |rank| scope.spawn(move || work(&Thread { rank, shared }));
                let threads: Vec<_> = (0..n).map(start).collect();
                threads.into_iter().map(|thread| thread.join().unwrap()).collect()
            })
        }
    }

    impl Thread<'_> {
        fn all<T: Clone>(&self, place: &Mutex<Vec<T>>, own: T) -> Vec<T> {
            place.lock().unwrap()[self.rank] = own;
            self.shared.barrier.wait();
            let all = place.lock().unwrap().clone();
            self.shared.barrier.wait();
            all
        }
    }

    impl Processes for Thread<'_> {
        fn rank(&self) -> usize {
            self.rank
        }

        fn size(&self) -> usize {
            self.shared.bytes.lock().unwrap().len()
        }

        fn gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
            self.all(&self.shared.bytes, own.to_vec())
        }

        fn broadcast(&self, data: &mut [f32]) {
            let all = self.all(&self.shared.numbers, vec![data.to_vec()]);
            data.copy_from_slice(&all[0][0]);
        }

        fn exchange(&self, own: &[f32], parts: &[Range<usize>], lengths: &[usize]) -> Vec<f32> {
            let own = parts.iter().map(|part| own[part.clone()].to_vec()).collect();
            let all = self.all(&self.shared.numbers, own);
            let received = all.iter().map(|sent| &sent[self.rank]);
            assert!(received.clone().map(Vec::len).eq(lengths.iter().copied()));
            received.flatten().copied().collect()
        }

        fn complete(&self, all: &mut [f32], parts: &[Range<usize>]) {
            let own = all[parts[self.rank].clone()].to_vec();
            let sent = self.all(&self.shared.numbers, vec![own]);
            for (part, sent) in parts.iter().zip(sent) {
                all[part.clone()].copy_from_slice(&sent[0]);
            }
        }
    }

    #[test]
    fn shares_are_even_and_leave_nothing_out() {
        for n in 0..20 {
            for size in 1..9 {
                let shares = (0..size).map(|rank| share(n, rank, size));
                assert!(shares.clone().flatten().eq(0..n));
                assert!(shares.clone().all(|s| (n / size..=n.div_ceil(size)).contains(&s.len())));
            }
        }
    }

    #[test]
    fn one_process_says_what_failed_and_all_end() {
        let fail = |rank: usize| match rank {
            0 | 3 => Ok(rank),
            _ => Err(Error::argument("disk", format!("full on {rank}"), "space", "free some")),
        };
        let found = Threads::run(4, |p| agree(p, fail(p.rank())).unwrap_err().to_string());
        assert_eq!(found[1], "process 1 of 4: disk is full on 1, expected space; free some");
        for rank in [0, 2, 3] {
            assert!(found[rank].starts_with("process 1 failed"), "{}", found[rank]);
        }
        let alone = agree(&SingleProcess, fail(2)).unwrap_err().to_string();
        assert_eq!(alone, "disk is full on 2, expected space; free some");
        assert_eq!(Threads::run(4, |p| agree(p, Ok(p.rank())).unwrap()), [0, 1, 2, 3]);
    }

    #[test]
    fn what_differs_is_named_with_both_values() {
        let found = Threads::run(3, |p| {
            let value = if p.rank() == 2 { "0.2.0" } else { "0.1.0" };
            require_same(p, "version", value).map_err(|e| e.to_string())
        });
        let message = found[2].as_ref().unwrap_err();
        let expected = "process 2 of 3: version is 0.2.0, expected 0.1.0, as on process 0; ";
        assert!(message.starts_with(expected), "{message}");
        assert!(found[..2].iter().all(|f| f.as_ref().unwrap_err().contains("process 2 failed")));
    }

    #[test]
    fn numbers_come_in_order_and_one_that_stops_stops_all() {
        let numbers = Threads::run(3, |p| {
            share_numbers(p, Ok(()), |()| vec![p.rank() as f64; p.rank()]).unwrap().1
        });
        assert_eq!(numbers, [[1.0, 2.0, 2.0]; 3]);
        let flow =
            |stops: bool| if stops { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        for stops in [false, true] {
            let found = Threads::run(3, |p| agree_to_go_on(p, Ok(flow(stops && p.rank() == 1))));
            assert!(found.into_iter().all(|found| found.unwrap() == flow(stops)));
        }
    }
}
