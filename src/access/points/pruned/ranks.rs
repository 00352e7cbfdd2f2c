//! Reference points sorted by height, and the rank of any height among them.

use crate::simd::vector::MAX_LANES;
use crate::simd::{Float32, Isa, Kernel, Mask, Simd, Unsigned, Vector};
use crate::spatial::{Coordinates, CountingSort};

/// Heights in ascending order, with a coarse index into them.
#[derive(Default)]
pub(super) struct Sorted {
    /// Height and index of each center, ascending in height.
    places: Vec<(f32, u32)>,
    /// The heights alone, between one −∞ and so many times +∞ as lie [`AHEAD`].
    heights: Vec<f32>,
    /// Places of the centers of each bucket.
    sort: CountingSort,
    buckets: HeightBuckets,
    /// Bucket of each center.
    bucket: Vec<u32>,
}

/// Buckets of equal height.
#[derive(Default, Clone, Copy)]
pub(super) struct HeightBuckets {
    lowest: f32,
    per_mm: f32,
    last: f32,
}

impl HeightBuckets {
    /// As many buckets as heights between `lowest` and `greatest`, up to the whole numbers that `f32` can count.
    fn new(n: usize, [lowest, greatest]: [f32; 2]) -> Self {
        let n = n.clamp(1, 1 << f32::MANTISSA_DIGITS) as f32;
        HeightBuckets { lowest, per_mm: (n / (greatest - lowest)).min(f32::MAX), last: n - 1.0 }
    }

    /// Those of some heights; they never descend with the height.
    #[inline(always)]
    pub fn of<S: Simd>(self, s: S, z: S::F32) -> S::U32 {
        let bucket = (z - S::F32::splat(s, self.lowest)) * S::F32::splat(s, self.per_mm);
        bucket.max(S::F32::splat(s, 0.0)).min(S::F32::splat(s, self.last)).truncate()
    }
}

/// Heights that are compared with one whose rank is wanted, from the place before its bucket on: one vector, or
/// two of the shortest.
const AHEAD: usize = MAX_LANES;

/// Buckets of up to this many centers are sorted by insertion.
const SMALL_BUCKET: u32 = 24;

impl Sorted {
    /// Sorts the centers, at least one: into as many buckets as there are centers, then by insertion.
    pub fn fill(&mut self, centers: &Coordinates, isa: Isa) {
        let z = &centers.z[..centers.n];
        isa.run(Distribute {
            z,
            raised: 0.0,
            buckets: &mut self.buckets,
            bucket: &mut self.bucket,
        });
        self.sort.clear(z.len());
        self.bucket.iter().for_each(|&bucket| self.sort.count(bucket as usize));
        let fullest = self.sort.finish_counting();
        self.places.resize(z.len(), (0.0, 0));
        for ((&z, &bucket), i) in z.iter().zip(&self.bucket).zip(0..) {
            self.places[self.sort.place(bucket as usize)] = (z, i);
        }
        if fullest > SMALL_BUCKET {
            self.sort_full_buckets();
        }
        insert_each(&mut self.places);
        self.heights.clear();
        self.heights.push(f32::NEG_INFINITY);
        self.heights.extend(self.places.iter().map(|place| place.0));
        self.heights.extend([f32::INFINITY; AHEAD]);
    }

    fn sort_full_buckets(&mut self) {
        let buckets = (0..self.sort.n_buckets()).map(|bucket| self.sort.range(bucket, bucket));
        for bucket in buckets.filter(|bucket| bucket.len() > SMALL_BUCKET as usize) {
            let places = &mut self.places[bucket];
            places.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        }
    }

    /// Indices of the centers, ascending in height.
    pub fn indices(&self) -> impl Iterator<Item = usize> {
        self.places.iter().map(|place| place.1 as usize)
    }

    /// For each of the heights `z`, the number of centers with `height of the center + step < z`.
    pub fn ranks(&self, z: &[f32], step: f32, ranks: &mut Vec<u32>, isa: Isa) {
        ranks.resize(z.len(), 0);
        isa.run(Ranks { sorted: self, z, step, ranks });
    }

    /// One rank, without the index.
    #[cold]
    fn rank(&self, z: f32, step: f32) -> u32 {
        self.heights[1..].partition_point(|&height| height + step < z) as u32
    }
}

/// Chooses the buckets and finds that of each height.
pub(super) struct Distribute<'a> {
    /// At least one.
    pub z: &'a [f32],
    /// Added to each.
    pub raised: f32,
    pub buckets: &'a mut HeightBuckets,
    pub bucket: &'a mut Vec<u32>,
}

impl Kernel for Distribute<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Distribute { z, raised, buckets, bucket } = self;
        let raised = S::F32::splat(s, raised);
        let whole = z.chunks_exact(S::LANES);
        let rest = whole.remainder();
        let mut last = [z[0]; MAX_LANES];
        last[..rest.len()].copy_from_slice(rest);
        let last = S::F32::load(s, &last) + raised;
        let (mut least, mut greatest) = (last, last);
        for z in whole.clone() {
            let z = S::F32::load(s, z) + raised;
            (least, greatest) = (least.min(z), greatest.max(z));
        }
        *buckets = HeightBuckets::new(z.len(), [least.reduce_min(), greatest.reduce_max()]);
        bucket.resize(z.len().next_multiple_of(S::LANES), 0);
        let (to_whole, to_rest) = bucket.split_at_mut(z.len() - rest.len());
        for (z, to) in whole.zip(to_whole.chunks_exact_mut(S::LANES)) {
            buckets.of(s, S::F32::load(s, z) + raised).store(to);
        }
        if !rest.is_empty() {
            buckets.of(s, last).store(to_rest);
        }
        bucket.truncate(z.len());
    }
}

struct Ranks<'a> {
    sorted: &'a Sorted,
    z: &'a [f32],
    step: f32,
    ranks: &'a mut [u32],
}

impl Kernel for Ranks<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Ranks { sorted, z, step, ranks } = self;
        let lanes = S::F32::splat(s, step);
        for (z, ranks) in z.chunks(S::LANES).zip(ranks.chunks_mut(S::LANES)) {
            let mut buckets = [0; MAX_LANES];
            sorted.buckets.of(s, S::F32::load_partial(s, z) - lanes).store(&mut buckets);
            for ((rank, &z), &bucket) in ranks.iter_mut().zip(z).zip(&buckets) {
                let start = sorted.sort.start(bucket as usize);
                let ahead = &sorted.heights[start..];
                let mut below = 0;
                let n_ahead = if S::LANES < 8 { 2 * S::LANES } else { S::LANES };
                for at in (0..n_ahead).step_by(S::LANES) {
                    let heights = S::F32::load(s, &ahead[at..at + S::LANES]) + lanes;
                    below |= S::F32::splat(s, z).gt(heights).bits() << at;
                }
                // The first of them comes before the bucket. If it is not below, or all are, rounding led to
                // a neighbor or the bucket is full.
                let found = below != 0 && below >> (n_ahead - 1) == 0;
                *rank = if found {
                    start as u32 + below.count_ones() - 1
                } else {
                    sorted.rank(z, step)
                };
            }
        }
    }
}

/// Sorts what is nearly in order.
fn insert_each(places: &mut [(f32, u32)]) {
    for i in 1..places.len() {
        let place = places[i];
        let mut j = i;
        while j > 0 && places[j - 1].0 > place.0 {
            places[j] = places[j - 1];
            j -= 1;
        }
        places[j] = place;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    /// Ranks found in whole vectors and in a part of one, with each instruction set, and the one found by bisection.
    fn ranks(sorted: &Sorted, z: f32, step: f32) -> Vec<usize> {
        let mut all = vec![sorted.rank(z, step)];
        for &isa in Isa::available() {
            let mut ranks = vec![];
            sorted.ranks(&[z; MAX_LANES + 1], step, &mut ranks, isa);
            all.extend(ranks);
        }
        all.into_iter().map(|rank| rank as usize).collect()
    }

    /// Finds the bucket of a height.
    struct BucketOf(HeightBuckets, f32);

    impl Kernel for BucketOf {
        type Output = u32;

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> u32 {
            let mut buckets = [0; MAX_LANES];
            self.0.of(s, S::F32::splat(s, self.1)).store(&mut buckets);
            buckets[0]
        }
    }

    #[test]
    fn no_height_is_beyond_the_buckets_however_many_they_are() {
        for n in [1, 2, 1000, (1 << 24) - 1, 1 << 24, (1 << 24) + 1, (1 << 24) + 3, 100_000_000] {
            let buckets = HeightBuckets::new(n, [-3.0, 5.0]);
            for &isa in Isa::available() {
                assert_eq!(isa.run(BucketOf(buckets, -3.0)), 0);
                let last = isa.run(BucketOf(buckets, 5.0)) as usize;
                assert_eq!(last, n.min(1 << 24) - 1);
            }
        }
    }

    #[test]
    fn ranks_are_counts_whatever_the_heights() {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        for (n, grid) in [(1, 1.0), (2, 0.0), (50, 4.0), (300, 0.0), (300, 1e-7), (1000, 1e4)] {
            let mut centers = Coordinates::zeros(n);
            for i in 0..n {
                centers.z[i] = 5.0 + (stream.range(-1.0, 1.0) * grid).round() as f32 * 0.3;
            }
            let mut sorted = Sorted::default();
            sorted.fill(&centers, Isa::fastest());
            let z = &centers.z[..n];
            let ordered: Vec<f32> = sorted.indices().map(|i| z[i]).collect();
            assert!(ordered.is_sorted());
            for &probe in z.iter().chain(&[-1e6, 1e6, 5.0, 5.15]) {
                for step in [0.0, 0.3, 1.0, 0.1] {
                    for z_j in [probe, probe + step] {
                        let count = z.iter().filter(|&&c| c + step < z_j).count();
                        assert!(ranks(&sorted, z_j, step).into_iter().all(|rank| rank == count));
                    }
                }
            }
        }
    }
}
