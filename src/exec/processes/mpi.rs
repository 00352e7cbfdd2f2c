//! [`Processes`] of an MPI library.

use super::{Processes, Traffic};
use crate::{Error, Result};
use mpi::Threading;
use mpi::datatype::{Partition, PartitionMut};
use mpi::environment::Universe;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives, Root};
use std::fmt;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// The processes that `mpirun` or `srun` has started together.
///
/// A failure inside of the library, such as a process that died, ends all processes. Dropped, it waits for all others
/// to be dropped.
pub struct Mpi {
    rank: usize,
    size: usize,
    /// Locked in every call: the library takes one call at a time.
    traffic: Mutex<Traffic>,
    _universe: Universe,
}

impl Mpi {
    /// Joins the other processes. Once in a program.
    ///
    /// # Errors
    /// If it was called before, or the library cannot be called from threads in turn.
    pub fn start() -> Result<Self> {
        let failed = |found: &str, remedy: &str| {
            Error::argument("MPI", found, "one start, with calls from any thread", remedy)
        };
        let (universe, threading) = mpi::initialize_with_threading(Threading::Serialized)
            .ok_or_else(|| failed("started already", "start it once"))?;
        if threading < Threading::Serialized {
            let remedy = "use an MPI library with MPI_THREAD_SERIALIZED";
            return Err(failed("a library without threads", remedy));
        }
        let world = universe.world();
        let (rank, size) = (world.rank() as usize, world.size() as usize);
        Ok(Mpi { rank, size, traffic: Mutex::default(), _universe: universe })
    }

    /// Ends all processes at once with exit code `code`, from any thread.
    pub fn abort(code: i32) -> ! {
        SimpleCommunicator::world().abort(code)
    }

    /// Makes a call that sends `bytes`.
    fn call<R>(&self, bytes: usize, work: impl FnOnce(&SimpleCommunicator) -> R) -> R {
        let mut traffic = self.traffic.lock().unwrap_or_else(PoisonError::into_inner);
        let start = Instant::now();
        let result = work(&SimpleCommunicator::world());
        traffic.bytes_sent += bytes as u64;
        traffic.seconds += start.elapsed().as_secs_f64();
        result
    }

    /// Numbers in ranges that go to others.
    fn n_sent(&self, parts: &[Range<usize>]) -> usize {
        let others = parts.iter().enumerate().filter(|(rank, _)| *rank != self.rank);
        others.map(|(_, part)| part.len()).sum()
    }
}

impl fmt::Debug for Mpi {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mpi").field("rank", &self.rank).field("size", &self.size).finish()
    }
}

impl Processes for Mpi {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    /// No buffer is an empty one of bytes: its address may be 1, which Open MPI takes for `MPI_IN_PLACE`.
    fn gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
        let mut lengths = vec![0i32; self.size];
        self.call(4 * (self.size - 1), |world| {
            world.all_gather_into(&counted(own.len()), &mut lengths[..])
        });
        let starts = starts(&lengths);
        let mut all = vec![0u8; 1 + lengths.iter().map(|n| *n as usize).sum::<usize>()];
        let own = if own.is_empty() { &[0][..0] } else { own };
        self.call(own.len() * (self.size - 1), |world| {
            let mut all = PartitionMut::new(&mut all[..], &lengths[..], &starts[..]);
            world.all_gather_varcount_into(own, &mut all);
        });
        let one = |(start, len): (&i32, &i32)| all[*start as usize..][..*len as usize].to_vec();
        starts.iter().zip(&lengths).map(one).collect()
    }

    fn broadcast(&self, data: &mut [f32]) {
        for data in data.chunks_mut(LONGEST) {
            let bytes = if self.rank == 0 { 4 * data.len() * (self.size - 1) } else { 0 };
            self.call(bytes, |world| world.process_at_rank(0).broadcast_into(data));
        }
    }

    fn exchange(&self, own: &[f32], parts: &[Range<usize>], lengths: &[usize]) -> Vec<f32> {
        let mut received = vec![0.0; lengths.iter().sum()];
        let lengths: Vec<i32> = lengths.iter().map(|n| counted(*n)).collect();
        let starts = starts(&lengths);
        let (sent, from) = counts(parts);
        self.call(4 * self.n_sent(parts), |world| {
            let own = Partition::new(own, &sent[..], &from[..]);
            let mut received = PartitionMut::new(&mut received[..], &lengths[..], &starts[..]);
            world.all_to_all_varcount_into(&own, &mut received);
        });
        received
    }

    fn complete(&self, all: &mut [f32], parts: &[Range<usize>]) {
        let own = all[parts[self.rank].clone()].to_vec();
        let (lengths, starts) = counts(parts);
        self.call(4 * own.len() * (self.size - 1), |world| {
            let mut all = PartitionMut::new(all, &lengths[..], &starts[..]);
            world.all_gather_varcount_into(&own[..], &mut all);
        });
    }

    fn traffic(&self) -> Traffic {
        *self.traffic.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Numbers per message; MPI counts in 32 bits.
const LONGEST: usize = 1 << 28;

/// # Panics
/// If a message has 2³¹ elements or more.
fn counted(n: usize) -> i32 {
    i32::try_from(n).expect("a message of fewer than 2^31 elements")
}

fn counts(parts: &[Range<usize>]) -> (Vec<i32>, Vec<i32>) {
    parts.iter().map(|part| (counted(part.len()), counted(part.start))).unzip()
}

/// Where each of `lengths` begins, one after another.
fn starts(lengths: &[i32]) -> Vec<i32> {
    let begin = |next: &mut i32, len: &i32| {
        let start = *next;
        *next += len;
        Some(start)
    };
    lengths.iter().scan(0, begin).collect()
}
