//! Stable counting sort of items into buckets.
//!
//! ```text
//! clear(n)                        all counts zero
//! count(bucket) for every item    how many each bucket holds
//! finish_counting()               counts become starts
//! place(bucket) for every item    the item's place in the sorted list
//! range(first, last)              places of the items of these buckets
//! ```

use std::ops::Range;

/// Starts of buckets in a sorted list; the memory is used again.
#[derive(Debug, Clone, Default)]
pub struct CountingSort {
    /// While items are placed, entry `b + 1` is the next place of bucket `b`; afterward entry `b` is its first
    /// place and entry `b + 1` the place after its last.
    starts: Vec<u32>,
}

impl CountingSort {
    /// `n` empty buckets.
    pub fn clear(&mut self, n: usize) {
        self.starts.clear();
        self.starts.resize(n + 2, 0);
    }

    /// One more item for this bucket.
    ///
    /// # Panics
    /// If there is no such bucket.
    #[inline(always)]
    pub fn count(&mut self, bucket: usize) {
        self.starts[bucket + 2] += 1;
    }

    /// Ends counting; returns the greatest count.
    pub fn finish_counting(&mut self) -> u32 {
        let (mut sum, mut greatest) = (0, 0);
        for start in &mut self.starts {
            greatest = greatest.max(*start);
            sum += *start;
            *start = sum;
        }
        greatest
    }

    /// Number of items in lower buckets, once counting has ended and as long as no item is placed; of all items for the
    /// bucket after the last.
    ///
    /// # Panics
    /// If there is no such bucket.
    #[inline(always)]
    pub fn n_below(&self, bucket: usize) -> u32 {
        self.starts[bucket + 1]
    }

    /// Place of the next item of this bucket, to be taken once for every counted item.
    ///
    /// # Panics
    /// If there is no such bucket.
    #[inline(always)]
    pub fn place(&mut self, bucket: usize) -> usize {
        let next = &mut self.starts[bucket + 1];
        let place = *next as usize;
        *next += 1;
        place
    }

    /// Places of the items of the buckets from `first` to `last`, once all items are placed.
    ///
    /// # Panics
    /// If there are no such buckets.
    #[inline(always)]
    pub fn range(&self, first: usize, last: usize) -> Range<usize> {
        self.starts[first] as usize..self.starts[last + 1] as usize
    }

    /// First place of a bucket, once all items are placed.
    ///
    /// # Panics
    /// If there is no such bucket.
    #[inline(always)]
    pub fn start(&self, bucket: usize) -> usize {
        self.starts[bucket] as usize
    }

    /// Number of buckets.
    pub fn n_buckets(&self) -> usize {
        self.starts.len().saturating_sub(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_are_sorted_by_bucket_and_keep_their_order() {
        let mut sort = CountingSort::default();
        for _ in 0..2 {
            let buckets = [3, 0, 3, 1, 0, 3];
            sort.clear(5);
            buckets.iter().for_each(|&b| sort.count(b));
            assert_eq!(sort.finish_counting(), 3);
            let places = buckets.map(|b| sort.place(b));
            assert_eq!(places, [3, 0, 4, 2, 1, 5]);
            assert_eq!([sort.range(0, 0), sort.range(1, 3), sort.range(4, 4)], [0..2, 2..6, 6..6]);
            assert_eq!(sort.n_buckets(), 5);
        }
    }
}
