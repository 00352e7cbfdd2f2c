//! The order of samples in training: one shuffle per epoch, cut into full batches.

use crate::numeric::rng::{Purpose, Stream};

/// Sample indices of every batch of `epoch`, from stream (`seed`, `epoch`, 0, shuffle).
///
/// There are `ceil(n / batch_size)` batches, each of `min(batch_size, n)` samples: the last one is
/// filled up from the epoch's beginning, because batch norm wants full batches.
pub fn batches(n_samples: usize, batch_size: usize, seed: u64, epoch: u64) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..n_samples).collect();
    Stream::new(seed, epoch, 0, Purpose::Shuffle).shuffle(&mut order);
    let batch_size = batch_size.clamp(1, n_samples.max(1));
    let member = |b: usize, i: usize| order[(b * batch_size + i) % n_samples];
    (0..n_samples.div_ceil(batch_size))
        .map(|b| (0..batch_size).map(|i| member(b, i)).collect())
        .collect()
}

/// Sample indices of every batch of `epoch` (from 1) when an epoch is only `n_draws` samples long.
///
/// The samples come from one endless row of fresh shuffles, shuffle `p` from stream (`seed`, `p`, 0,
/// shuffle), and each epoch goes on where the one before ended. Batches are full: `n_draws` is rounded up.
pub fn short_batches(
    n_samples: usize,
    batch_size: usize,
    n_draws: usize,
    seed: u64,
    epoch: u64,
) -> Vec<Vec<usize>> {
    let batch_size = batch_size.clamp(1, n_samples.max(1));
    let n_batches = if n_samples == 0 { 0 } else { n_draws.div_ceil(batch_size) };
    let first = epoch.saturating_sub(1) as usize * n_batches * batch_size;
    let mut pass = (usize::MAX, Vec::new());
    let mut member = |place: usize| {
        let number = place / n_samples;
        if pass.0 != number {
            pass = (number, (0..n_samples).collect());
            Stream::new(seed, number as u64, 0, Purpose::Shuffle).shuffle(&mut pass.1);
        }
        pass.1[place % n_samples]
    };
    let mut batch =
        |b: usize| (0..batch_size).map(|i| member(first + b * batch_size + i)).collect();
    (0..n_batches).map(&mut batch).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_comes_once_and_batches_are_full() {
        for (n, size) in [(0, 4), (1, 4), (4, 4), (10, 4), (10, 1)] {
            let epoch = batches(n, size, 5, 2);
            assert_eq!(epoch, batches(n, size, 5, 2));
            assert!(epoch.iter().all(|b| b.len() == size.min(n)));
            let mut seen: Vec<usize> = epoch.into_iter().flatten().take(n).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..n).collect::<Vec<_>>());
        }
        assert_ne!(batches(50, 50, 5, 2), batches(50, 50, 5, 3));
    }

    #[test]
    fn short_epochs_follow_each_other_through_whole_shuffles() {
        let drawn = |epochs: std::ops::RangeInclusive<u64>| {
            epochs.flat_map(|e| short_batches(10, 4, 7, 5, e)).flatten().collect::<Vec<_>>()
        };
        let all = drawn(1..=5);
        assert_eq!(all.len(), 40);
        for pass in all.chunks(10) {
            let mut pass = pass.to_vec();
            pass.sort_unstable();
            assert_eq!(pass, (0..10).collect::<Vec<_>>());
        }
        assert!(short_batches(0, 4, 7, 5, 1).is_empty());
        assert_eq!(drawn(3..=5), all[16..]);
        assert_ne!(all[..10], all[10..20]);
    }
}
