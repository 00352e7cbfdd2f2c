//! Parallel loops whose results do not depend on the number of threads.
//!
//! Work is cut into blocks whose size is a constant of the call site, each output belongs to one
//! block, and partial results are joined in block order. The only file that names rayon.
//!
//! Work goes to rayon as `&dyn Fn`: one indirect call per block, and rayon's machinery is compiled
//! once per type instead of once per loop.

use crate::{Error, Result};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Calls `work(block_index, block)` for consecutive blocks of `block_len` items.
pub fn for_each_block<T: Send>(
    items: &mut [T],
    block_len: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let work: &(dyn Fn(usize, &mut [T]) + Sync) = &work;
    items.par_chunks_mut(block_len.max(1)).enumerate().for_each(|(i, block)| work(i, block));
}

type PairWork<'a, A, B> = dyn Fn(usize, &mut [A], &mut [B]) + Sync + 'a;

/// Calls `work(block_index, a_block, b_block)` for consecutive blocks of two slices of equal length.
///
/// # Panics
/// If the slices differ in length.
pub fn for_each_block2<A: Send, B: Send>(
    a: &mut [A],
    b: &mut [B],
    block_len: usize,
    work: impl Fn(usize, &mut [A], &mut [B]) + Sync,
) {
    assert_eq!(a.len(), b.len());
    let work: &PairWork<A, B> = &work;
    let blocks = a.par_chunks_mut(block_len.max(1)).zip(b.par_chunks_mut(block_len.max(1)));
    blocks.enumerate().for_each(|(i, (a, b))| work(i, a, b));
}

/// Results of `work(block_index, block)` for consecutive blocks of `block_len` items, in order.
pub fn map_chunks<T: Send, R: Send>(
    items: &mut [T],
    block_len: usize,
    work: impl Fn(usize, &mut [T]) -> R + Sync,
) -> Vec<R> {
    let work: &(dyn Fn(usize, &mut [T]) -> R + Sync) = &work;
    let blocks = items.par_chunks_mut(block_len.max(1)).enumerate();
    blocks.map(|(i, block)| work(i, block)).collect()
}

/// Results of `work` over consecutive ranges of `block_len` indices of `0..n`, in order.
pub fn map_blocks<R: Send>(
    n: usize,
    block_len: usize,
    work: impl Fn(Range<usize>) -> R + Sync,
) -> Vec<R> {
    let block_len = block_len.max(1);
    let work: &(dyn Fn(Range<usize>) -> R + Sync) = &work;
    (0..n.div_ceil(block_len))
        .into_par_iter()
        .map(|i| work(i * block_len..((i + 1) * block_len).min(n)))
        .collect()
}

/// Results of `work` for every index of `0..n`, in order, one task each.
pub fn map<R: Send>(n: usize, work: impl Fn(usize) -> R + Send + Sync) -> Vec<R> {
    let work: &(dyn Fn(usize) -> R + Send + Sync) = &work;
    (0..n).into_par_iter().with_max_len(1).map(work).collect()
}

/// Results of `work` for every index of `0..n`, in order, and the workers' states.
///
/// Each worker makes one state and lends it to every call it makes; indices go to whichever worker is
/// free. What is summed up in a state must not depend on the order of summing: whole numbers do not.
pub fn map_with<S: Send, R: Send>(
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
pub fn join<A: Send, B: Send>(
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    rayon::join(a, b)
}

/// Sorts in parallel by a total order on keys; equal keys keep their order.
pub fn sort_by_key<T: Send, K: Ord>(items: &mut [T], key: impl Fn(&T) -> K + Sync) {
    items.par_sort_by_key(key);
}

/// Number of threads that parallel loops started here would use.
pub fn threads() -> usize {
    rayon::current_num_threads()
}

/// Runs `work` with parallel loops limited to `n_threads` (0: one per logical CPU).
///
/// # Errors
/// If the system refuses to start the threads.
pub fn with_threads<R: Send>(n_threads: usize, work: impl FnOnce() -> R + Send) -> Result<R> {
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
