//! Buckets: ranges of the gradient that are joined together while the backward pass goes on.
//!
//! A range of parameters is complete as soon as backward has left its layer. Ranges that become complete one after
//! another are joined in one bucket of at least [`BUCKET`] numbers, because each exchange has a latency. Which ranges
//! lie in which bucket changes no bit: sums are those of single numbers.

use crate::exec::processes::Processes;
use std::collections::HashMap;
use std::ops::Range;

/// Numbers per bucket, at least: 4 MiB.
const BUCKET: usize = 1 << 20;

/// All ranges of a vector, in the order in which they are joined; the same on all processes.
#[derive(Debug)]
pub(super) struct Buckets(Vec<Vec<Range<usize>>>);

/// How far backward has come.
pub(super) struct Completed<'a> {
    buckets: &'a Buckets,
    /// Bucket of each range.
    places: HashMap<Range<usize>, usize>,
    /// Ranges of each bucket that are not complete.
    missing: Vec<usize>,
    next: usize,
}

impl Buckets {
    /// One bucket of all `len` numbers: for a step whose order is not known yet.
    pub(super) fn whole(len: usize) -> Self {
        Buckets(vec![vec![Range { start: 0, end: len }]])
    }

    /// Whether they are those of [`Buckets::whole`].
    pub(super) fn is_whole(&self) -> bool {
        self.0.len() == 1
    }

    /// Buckets of a vector of `len` numbers in the order of process 0, in which it has completed `ranges`.
    pub(super) fn in_order(processes: &dyn Processes, ranges: &[Range<usize>], len: usize) -> Self {
        let bytes = ranges.iter().flat_map(|range| [range.start, range.end]);
        let bytes: Vec<u8> = bytes.flat_map(|end| (end as u64).to_le_bytes()).collect();
        let all = processes.gather(&bytes);
        let ends =
            all[0].as_chunks::<8>().0.iter().map(|bytes| u64::from_le_bytes(*bytes) as usize);
        let ends: Vec<usize> = ends.collect();
        let ranges = ends.as_chunks::<2>().0.iter().map(|&[start, end]| start..end);
        Buckets::of(ranges.collect(), len)
    }

    /// The ranges in their order, and last what none of them holds.
    fn of(ranges: Vec<Range<usize>>, len: usize) -> Self {
        let (mut rest, mut end) = (Vec::new(), 0);
        let mut sorted = ranges.clone();
        sorted.sort_unstable_by_key(|range| range.start);
        for range in sorted.into_iter().chain([Range { start: len, end: len }]) {
            rest.extend((end < range.start).then_some(end..range.start));
            end = range.end;
        }
        let (mut buckets, mut bucket) = (Vec::new(), Vec::new());
        for range in ranges {
            bucket.push(range);
            if bucket.iter().map(Range::len).sum::<usize>() >= BUCKET {
                buckets.push(std::mem::take(&mut bucket));
            }
        }
        buckets.extend([bucket, rest].into_iter().filter(|bucket| !bucket.is_empty()));
        Buckets(buckets)
    }

    /// None is complete.
    pub(super) fn start(&self) -> Completed<'_> {
        let places = self.0.iter().enumerate();
        let places = places.flat_map(|(i, bucket)| bucket.iter().map(move |r| (r.clone(), i)));
        let missing = self.0.iter().map(Vec::len).collect();
        Completed { buckets: self, places: places.collect(), missing, next: 0 }
    }

    /// Puts the numbers of each bucket, its ranges one after another, into their places.
    pub(super) fn scatter(&self, joined: &[Vec<f32>], to: &mut [f32]) {
        for (bucket, mut values) in self.0.iter().zip(joined.iter().map(|v| &v[..])) {
            for range in bucket {
                let (own, rest) = values.split_at(range.len());
                to[range.clone()].copy_from_slice(own);
                values = rest;
            }
        }
    }
}

impl<'a> Completed<'a> {
    /// Marks a range; the buckets that are complete now and whose turn it is.
    pub(super) fn add(&mut self, range: &Range<usize>) -> &'a [Vec<Range<usize>>] {
        if let Some(&bucket) = self.places.get(range) {
            self.missing[bucket] -= 1;
        }
        let n_ready = self.missing[self.next..].iter().take_while(|n| **n == 0).count();
        self.take(n_ready)
    }

    /// Marks all; the buckets that are left.
    pub(super) fn rest(&mut self) -> &'a [Vec<Range<usize>>] {
        self.take(self.missing.len() - self.next)
    }

    fn take(&mut self, n: usize) -> &'a [Vec<Range<usize>>] {
        self.next += n;
        &self.buckets.0[self.next - n..self.next]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_hold_every_number_once_and_leave_in_order() {
        let ranges = vec![2 * BUCKET..3 * BUCKET, 5..9, 9..BUCKET, 3 * BUCKET..3 * BUCKET + 7];
        let len = 3 * BUCKET + 20;
        let buckets = Buckets::of(ranges.clone(), len);
        let mut all: Vec<Range<usize>> = buckets.0.concat();
        assert_eq!(buckets.0.len(), 3);
        all.sort_unstable_by_key(|range| range.start);
        assert!(all.windows(2).all(|pair| pair[0].end == pair[1].start));
        assert_eq!((all[0].start, all[all.len() - 1].end), (0, len));
        let mut completed = buckets.start();
        // Another order than that of the buckets.
        assert!(completed.add(&ranges[1]).is_empty());
        assert_eq!(completed.add(&ranges[0]), &buckets.0[..1]);
        assert!(completed.add(&ranges[3]).is_empty());
        assert_eq!(completed.add(&ranges[2]), &buckets.0[1..2]);
        assert_eq!(completed.rest(), &buckets.0[2..]);
        let values: Vec<f32> = (0..len).map(|i| i as f32).collect();
        let of = |bucket: &Vec<Range<usize>>| {
            bucket.iter().flat_map(|range| &values[range.clone()]).copied().collect::<Vec<f32>>()
        };
        let mut back = vec![0.0; len];
        buckets.scatter(&buckets.0.iter().map(of).collect::<Vec<_>>(), &mut back);
        assert!(back == values);
    }
}
