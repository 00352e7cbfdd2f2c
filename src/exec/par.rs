//! Parallel loops whose results do not depend on the number of threads.
//!
//! Work is cut into blocks whose size is a constant of the call site, each output belongs to one block, and partial
//! results are joined in block order. The only file that names rayon. Loops run in the default state of floating point,
//! whatever the caller's.
//!
//! Blocks are handed out one after another, to whichever thread is idle next; the thread that starts a loop
//! takes part in it. Waking a sleeping thread takes longer than most of the network's loops: a worker spins
//! for `SPIN_TIMEOUT` after its last block, and within `keep_workers_hot` until that call ends.

pub(crate) use crate::simd::float_state::DefaultFloats;
use crate::{Error, Result};
use rayon::Yield;
use rayon::slice::ParallelSliceMut;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// How long a thread without work spins. Finite: a thread that waits here may hold work that another one
/// waits for.
const SPIN_TIMEOUT: Duration = Duration::from_millis(20);

/// Polls for work between two readings of the clock.
const SPINS_PER_CHECK: usize = 64;

/// Calls `work` once for every one of the `n` items, on all threads; each thread makes one state for its calls.
fn share_out<S, I>(
    n: usize,
    items: impl Iterator<Item = I> + Send,
    state: &(dyn Fn() -> S + Sync),
    work: &(dyn Fn(&mut S, I) + Sync),
) where
    I: Send,
{
    let _floats = DefaultFloats::set();
    let n_threads = threads().min(n);
    if n_threads <= 1 {
        let mut state = state();
        items.for_each(|item| work(&mut state, item));
        return;
    }
    let items = Mutex::new(items);
    let next = || items.lock().unwrap_or_else(PoisonError::into_inner).next();
    let drain = || {
        let _floats = DefaultFloats::set();
        let mut state = state();
        while let Some(item) = next() {
            work(&mut state, item);
        }
    };
    on_threads(n_threads, &drain);
}

/// Calls `work` on `n_threads` threads, this one among them, as far as the pool has idle ones. For all loops: compiled
/// once.
fn on_threads(n_threads: usize, work: &(dyn Fn() + Sync)) {
    let n_busy = AtomicUsize::new(n_threads - 1);
    rayon::in_place_scope(|scope| {
        for _ in 1..n_threads {
            scope.spawn(|_| {
                let _done = OnDrop(|| {
                    n_busy.fetch_sub(1, Ordering::Release);
                });
                work();
            });
        }
        work();
        spin_for_work(&|| n_busy.load(Ordering::Acquire) == 0);
    });
}

/// Runs any work of this pool until `done`, or until there has been none for [`SPIN_TIMEOUT`].
fn spin_for_work(done: &dyn Fn() -> bool) {
    let mut idle_since = Instant::now();
    while may_spin() {
        for _ in 0..SPINS_PER_CHECK {
            if done() {
                return;
            }
            match rayon::yield_now() {
                Some(Yield::Executed) => idle_since = Instant::now(),
                Some(Yield::Idle) => std::hint::spin_loop(),
                None => return,
            }
        }
        if idle_since.elapsed() > SPIN_TIMEOUT {
            return;
        }
        std::thread::yield_now();
    }
}

/// Whether every thread of this pool has a processor, so that a spinning thread takes none from another.
fn may_spin() -> bool {
    static N_PROCESSORS: OnceLock<usize> = OnceLock::new();
    let count = || std::thread::available_parallelism().map_or(1, usize::from);
    threads() <= *N_PROCESSORS.get_or_init(count)
}

/// Calls its function when dropped, also by a panic.
struct OnDrop<F: FnMut()>(F);

impl<F: FnMut()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

/// Runs `work`; its threads spin between its parallel loops instead of sleeping. For many short loops.
///
/// Results are those of `work` alone. Without a processor for every thread, this is just a call.
pub(crate) fn keep_workers_hot<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    let _floats = DefaultFloats::set();
    if threads() <= 1 || !may_spin() {
        return work();
    }
    let (mut work, mut result) = (Some(work), None);
    among_hot_workers(&mut || result = work.take().map(|work| work()));
    result.expect("it was called")
}

/// Calls `work` while the other threads of this pool spin.
fn among_hot_workers(work: &mut (dyn FnMut() + Send)) {
    let done = &AtomicBool::new(false);
    rayon::scope(|scope| {
        let _done = OnDrop(|| done.store(true, Ordering::Release));
        let here = rayon::current_thread_index();
        scope.spawn_broadcast(move |_, other| {
            if Some(other.index()) != here {
                spin_for_work(&|| done.load(Ordering::Acquire));
            }
        });
        work();
    });
}

/// Calls `work(block_index, block)` for consecutive blocks of `block_len` items.
#[doc(hidden)] // of benches and the program
pub fn for_each_block<T: Send>(
    items: &mut [T],
    block_len: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    for_each_block_with(items, block_len, || (), |(), i, block| work(i, block));
}

/// [`for_each_block`], with a state for `work` to reuse. Each thread makes its own: what a call leaves there
/// must not change the results of the next.
pub(crate) fn for_each_block_with<T: Send, S>(
    items: &mut [T],
    block_len: usize,
    state: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, usize, &mut [T]) + Sync,
) {
    let blocks = items.chunks_mut(block_len.max(1)).enumerate();
    share_out(blocks.len(), blocks, &state, &|state, (i, block)| work(state, i, block));
}

/// Calls `work(a_block, b_block, c_block)` for consecutive blocks of three slices of equal length.
///
/// # Panics
/// If the slices differ in length.
pub(crate) fn for_each_block3<A: Send, B: Send, C: Send>(
    a: &mut [A],
    b: &mut [B],
    c: &mut [C],
    block_len: usize,
    work: impl Fn(&mut [A], &mut [B], &mut [C]) + Sync,
) {
    assert!(a.len() == b.len() && b.len() == c.len());
    let len = block_len.max(1);
    let blocks = a.chunks_mut(len).zip(b.chunks_mut(len)).zip(c.chunks_mut(len));
    share_out(blocks.len(), blocks, &|| (), &|(), ((a, b), c)| work(a, b, c));
}

/// Results of `work(block_index, block)` for consecutive blocks of `block_len` items, in order.
pub(crate) fn map_chunks<T: Send, R: Send>(
    items: &mut [T],
    block_len: usize,
    work: impl Fn(usize, &mut [T]) -> R + Sync,
) -> Vec<R> {
    collect(items.chunks_mut(block_len.max(1)), work)
}

/// Results of `work` over consecutive ranges of `block_len` indices of `0..n`, in order.
pub(crate) fn map_blocks<R: Send>(
    n: usize,
    block_len: usize,
    work: impl Fn(Range<usize>) -> R + Sync,
) -> Vec<R> {
    let block_len = block_len.max(1);
    map(n.div_ceil(block_len), |i| work(i * block_len..((i + 1) * block_len).min(n)))
}

/// Results of `work` for every index of `0..n`, in order, one task each.
#[doc(hidden)] // of benches and the program
pub fn map<R: Send>(n: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
    collect(0..n, |i, _| work(i))
}

/// Results of `work(index, item)` for every item, in order.
fn collect<I: Send, R: Send>(
    items: impl ExactSizeIterator<Item = I> + Send,
    work: impl Fn(usize, I) -> R + Sync,
) -> Vec<R> {
    let mut results: Vec<Option<R>> = std::iter::repeat_with(|| None).take(items.len()).collect();
    let places = results.iter_mut().zip(items).enumerate();
    share_out(places.len(), places, &|| (), &|(), (i, (place, item))| {
        *place = Some(work(i, item));
    });
    results.into_iter().map(|result| result.expect("every item was handed out")).collect()
}

/// Results of `work` for every index of `0..n`, in order, and the workers' states.
///
/// Each worker makes one state and passes it to all its calls; indices go to whichever worker is
/// free. What is summed up in a state must not depend on the order of summing: whole numbers do not.
pub(crate) fn map_with<S: Send, R: Send>(
    n: usize,
    state: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, usize) -> R + Sync,
) -> (Vec<R>, Vec<S>) {
    let next = AtomicUsize::new(0);
    let run = || {
        let mut state = state();
        let mut results = Vec::new();
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            if i >= n {
                return (results, state);
            }
            results.push((i, work(&mut state, i)));
        }
    };
    let workers = map(threads().min(n), |_| run());
    let (results, states): (Vec<_>, Vec<_>) = workers.into_iter().unzip();
    let mut results: Vec<(usize, R)> = results.into_iter().flatten().collect();
    results.sort_unstable_by_key(|(i, _)| *i);
    (results.into_iter().map(|(_, result)| result).collect(), states)
}

/// Two computations, possibly at the same time.
pub(crate) fn join<A: Send, B: Send>(
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    fn in_default<R>(work: impl FnOnce() -> R) -> R {
        let _floats = DefaultFloats::set();
        work()
    }
    rayon::join(|| in_default(a), || in_default(b))
}

/// Calls `now` on this thread, and `ahead` meanwhile on one that is idle, or else after it.
pub(crate) fn with_ahead<A, B: Send>(
    now: impl FnOnce() -> A,
    ahead: impl FnOnce() -> B + Send,
) -> (A, B) {
    let mut result = None;
    let first = rayon::in_place_scope(|scope| {
        scope.spawn(|_| {
            let _floats = DefaultFloats::set();
            result = Some(ahead());
        });
        now()
    });
    (first, result.expect("the scope has waited for it"))
}

/// Whether the system starts threads: `wasm32-unknown-unknown` does not.
const HAS_THREADS: bool = !cfg!(all(target_family = "wasm", target_os = "unknown"));

/// Calls `main`, and `work` on every message that it sends, in order, on a thread of their own meanwhile if there are
/// threads; the results of `work` in order.
pub(crate) fn with_background<M: Send, R: Send>(
    work: impl FnMut(M) -> R + Send,
    main: impl FnOnce(&(dyn Fn(M) + Sync)),
) -> Vec<R> {
    match HAS_THREADS {
        true => in_background(work, main),
        false => in_turn(work, main),
    }
}

/// [`with_background`] without a thread: each message is worked on when it is sent.
fn in_turn<M: Send, R: Send>(
    work: impl FnMut(M) -> R + Send,
    main: impl FnOnce(&(dyn Fn(M) + Sync)),
) -> Vec<R> {
    let both = Mutex::new((work, Vec::new()));
    main(&|message| {
        let (work, results) = &mut *both.lock().unwrap_or_else(PoisonError::into_inner);
        results.push(work(message));
    });
    both.into_inner().unwrap_or_else(PoisonError::into_inner).1
}

fn in_background<M: Send, R: Send>(
    mut work: impl FnMut(M) -> R + Send,
    main: impl FnOnce(&(dyn Fn(M) + Sync)),
) -> Vec<R> {
    std::thread::scope(|scope| {
        let (sender, receiver) = std::sync::mpsc::channel();
        let background = scope.spawn(move || receiver.into_iter().map(&mut work).collect());
        main(&|message| sender.send(message).expect("its thread takes messages until this ends"));
        drop(sender);
        background.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// Starts `work` on a thread of its own, which nobody waits for.
///
/// # Errors
/// If the system starts no thread.
#[cfg(any(feature = "python", feature = "capi"))]
pub(crate) fn start(work: impl FnOnce() + Send + 'static) -> Result<()> {
    /// As much as a main thread has.
    const STACK_BYTES: usize = 8 << 20;
    let started = std::thread::Builder::new().stack_size(STACK_BYTES).spawn(work);
    started.map(drop).map_err(|e| {
        Error::argument("threads", e, "one more that the system starts", "end other programs")
    })
}

/// Sorts in parallel by a total order on keys; equal keys keep their order.
pub(crate) fn sort_by_key<T: Send, K: Ord>(items: &mut [T], key: impl Fn(&T) -> K + Sync) {
    items.par_sort_by_key(key);
}

/// Number of threads that parallel loops started here would use.
pub fn threads() -> usize {
    rayon::current_num_threads()
}

/// Most threads that [`with_threads`] starts.
pub(crate) const MAX_THREADS: usize = 4096;

/// Runs `work` with parallel loops limited to `n_threads` (0: one per logical CPU); without threads on
/// `wasm32-unknown-unknown`.
///
/// # Errors
/// If there are more than 4096, or the system refuses to start them.
pub fn with_threads<R: Send>(n_threads: usize, work: impl FnOnce() -> R + Send) -> Result<R> {
    if n_threads > MAX_THREADS {
        let expected = format!("at most {MAX_THREADS}");
        return Err(Error::argument("threads", n_threads, expected, "give 0: one per processor"));
    }
    if !HAS_THREADS {
        return Ok(work());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build();
    let pool = pool.map_err(|e| {
        Error::argument("threads", n_threads, "a number the system can start", e.to_string())
    })?;
    Ok(pool.install(work))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_cover_everything_in_order_for_any_thread_count() {
        for n_threads in [1, 2, 5] {
            let ranges = with_threads(n_threads, || map_blocks(10, 4, |r| r)).unwrap();
            assert_eq!(ranges, [0..4, 4..8, 8..10]);
            let mut items = vec![0; 10];
            with_threads(n_threads, || {
                for_each_block(&mut items, 4, |i, block| block.fill(i + 1));
            })
            .unwrap();
            assert_eq!(items, [1, 1, 1, 1, 2, 2, 2, 2, 3, 3]);
        }
        assert!(map_blocks(0, 4, |r| r).is_empty());
    }

    #[test]
    fn no_machine_is_flooded_with_threads() {
        assert!(with_threads(MAX_THREADS + 1, || ()).unwrap_err().to_string().contains("4096"));
    }

    #[test]
    fn a_thread_lends_its_state_to_all_its_blocks() {
        for n_threads in [1, 2, 5] {
            let mut items = vec![0; 50];
            let count = |n: &mut usize, i: usize, block: &mut [usize]| {
                *n += 1;
                block.fill(1000 * i + *n);
            };
            with_threads(n_threads, || for_each_block_with(&mut items, 5, || 0, count)).unwrap();
            let n_states = items.iter().step_by(5).filter(|&item| item % 1000 == 1).count();
            assert!((1..=n_threads).contains(&n_states));
            assert!((0..50).all(|i| items[i] / 1000 == i / 5));
        }
    }

    /// Each level waits for loops below it, on every thread at once.
    fn nested(depth: u32) -> u64 {
        match depth {
            0 => 1,
            _ => keep_workers_hot(|| map(3, |_| nested(depth - 1)).into_iter().sum()),
        }
    }

    #[test]
    fn loops_within_loops_end_with_hot_workers_or_not() {
        for n_threads in [1, 2, 5] {
            assert_eq!(with_threads(n_threads, || nested(5)).unwrap(), 243);
        }
        let (a, b) = std::thread::scope(|scope| {
            let [a, b] = [(); 2].map(|()| scope.spawn(|| nested(4)));
            (a.join().unwrap(), b.join().unwrap())
        });
        assert_eq!((a, b), (81, 81));
    }

    #[test]
    fn what_is_ahead_is_done_with_any_number_of_threads() {
        for n_threads in [1, 2, 5] {
            let found = with_threads(n_threads, || with_ahead(|| nested(3), || nested(2)));
            assert_eq!(found.unwrap(), (27, 9));
        }
        assert_eq!(with_ahead(|| nested(3), || nested(2)), (27, 9));
    }

    #[test]
    fn messages_are_answered_in_order_with_a_background_thread_and_without() {
        let work = |i: usize| 2 * i;
        let main = |send: &(dyn Fn(usize) + Sync)| (0..100).for_each(send);
        for found in [with_background(work, main), in_turn(work, main)] {
            assert!(found.into_iter().eq((0..100).map(|i| 2 * i)));
        }
    }

    #[test]
    fn a_panic_in_a_block_ends_the_loop_and_lets_all_threads_go() {
        let fail = || {
            keep_workers_hot(|| map(100, |i| assert!(i != 57, "this one")));
        };
        let caught = with_threads(2, || std::panic::catch_unwind(fail)).unwrap();
        assert!(caught.is_err());
        assert_eq!(with_threads(2, || map(3, |i| i)).unwrap(), [0, 1, 2]);
    }

    #[test]
    fn workers_share_out_all_indices_and_keep_their_order() {
        for n_threads in [1, 2, 5] {
            let add = |sum: &mut usize, i: usize| {
                *sum += i;
                2 * i
            };
            let (results, sums) = with_threads(n_threads, || map_with(100, || 0, add)).unwrap();
            assert!(results.into_iter().eq((0..100).map(|i| 2 * i)));
            assert_eq!(sums.iter().sum::<usize>(), 4950);
        }
        assert!(map_with(0, || (), |(), i| i).0.is_empty());
    }
}
