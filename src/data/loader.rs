//! Order of samples: a fresh shuffle per epoch, cut into full batches.

use crate::rng::{Purpose, Stream};

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
}
