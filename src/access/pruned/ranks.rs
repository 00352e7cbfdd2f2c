//! Centres sorted by height, and ranks of heights among them.

use crate::simd::collide::{Coordinates, eights};
use crate::simd::{Kernel, Level, Simd};

/// Heights in ascending order, with a coarse index into them.
#[derive(Default)]
pub(super) struct Sorted {
    /// Height and index of each centre, ascending in height.
    places: Vec<(f32, u32)>,
    /// The heights alone, between one −∞ and eight times +∞.
    heights: Vec<f32>,
    /// Place of the first centre of each bucket; the last bucket's end follows.
    starts: Vec<u32>,
    buckets: Buckets,
    /// Bucket of each centre.
    bucket: Vec<u32>,
}

/// Buckets of equal height.
#[derive(Default, Clone, Copy)]
struct Buckets {
    lowest: f32,
    per_mm: f32,
    last: f32,
}

impl Buckets {
    /// As many buckets as heights between `lowest` and `greatest`, up to the whole numbers that `f32` can count.
    fn new(n: usize, [lowest, greatest]: [f32; 2]) -> Self {
        let n = n.clamp(1, 1 << f32::MANTISSA_DIGITS) as f32;
        Buckets { lowest, per_mm: (n / (greatest - lowest)).min(f32::MAX), last: n - 1.0 }
    }

    /// Those of eight heights; they never descend with the height.
    #[inline(always)]
    fn of<S: Simd>(self, s: S, z: S::Eight) -> [u32; 8] {
        let bucket = s.mul(s.sub(z, s.splat(self.lowest)), s.splat(self.per_mm));
        s.truncate(s.min(s.max(bucket, s.splat(0.0)), s.splat(self.last)))
    }
}

/// Buckets of up to this many centres are sorted by insertion.
const SMALL_BUCKET: u32 = 24;

impl Sorted {
    /// Sorts the centres, at least one: into as many buckets as there are centres, then by insertion.
    pub fn fill(&mut self, centres: &Coordinates, level: Level) {
        let z = &centres.z[..centres.n];
        level.run(Distribute { sorted: self, z });
        self.starts.clear();
        self.starts.resize(z.len() + 2, 0);
        for &bucket in &self.bucket {
            self.starts[bucket as usize + 2] += 1;
        }
        let (mut sum, mut fullest) = (0, 0);
        for start in &mut self.starts {
            fullest = fullest.max(*start);
            sum += *start;
            *start = sum;
        }
        self.places.resize(z.len(), (0.0, 0));
        for ((&z, &bucket), i) in z.iter().zip(&self.bucket).zip(0..) {
            let next = &mut self.starts[bucket as usize + 1];
            self.places[*next as usize] = (z, i);
            *next += 1;
        }
        if fullest > SMALL_BUCKET {
            self.sort_full_buckets();
        }
        insert_each(&mut self.places);
        self.heights.clear();
        self.heights.push(f32::NEG_INFINITY);
        self.heights.extend(self.places.iter().map(|place| place.0));
        self.heights.extend([f32::INFINITY; 8]);
    }

    fn sort_full_buckets(&mut self) {
        for bucket in self.starts.windows(2).filter(|b| b[1] - b[0] > SMALL_BUCKET) {
            let places = &mut self.places[bucket[0] as usize..bucket[1] as usize];
            places.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        }
    }

    /// Indices of the centres, ascending in height.
    pub fn indices(&self) -> impl Iterator<Item = usize> {
        self.places.iter().map(|place| place.1 as usize)
    }

    /// For each of the heights `z`, the number of centres with `height of the centre + step < z`.
    pub fn ranks(&self, z: &[f32], step: f32, ranks: &mut Vec<u32>, level: Level) {
        ranks.resize(z.len(), 0);
        level.run(Ranks { sorted: self, z, step, ranks });
    }

    /// One rank, without the index.
    #[cold]
    fn rank(&self, z: f32, step: f32) -> u32 {
        self.heights[1..].partition_point(|&height| height + step < z) as u32
    }
}

/// Chooses the buckets and finds that of each height.
struct Distribute<'a> {
    sorted: &'a mut Sorted,
    z: &'a [f32],
}

impl Kernel for Distribute<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Distribute { sorted: Sorted { buckets, bucket, .. }, z } = self;
        let (whole, rest) = z.as_chunks::<8>();
        let mut last = [z[0]; 8];
        last[..rest.len()].copy_from_slice(rest);
        let (mut least, mut greatest) = (s.load(&last), s.load(&last));
        for z in whole {
            least = s.min(least, s.load(z));
            greatest = s.max(greatest, s.load(z));
        }
        *buckets = Buckets::new(z.len(), [s.least(least), s.greatest(greatest)]);
        bucket.clear();
        for z in whole {
            bucket.extend(buckets.of(s, s.load(z)));
        }
        bucket.extend(&buckets.of(s, s.load(&last))[..rest.len()]);
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
        let lanes = s.splat(step);
        let ((z, z_rest), (ranks, rest)) = (z.as_chunks::<8>(), ranks.as_chunks_mut::<8>());
        for (z, ranks) in z.iter().zip(ranks) {
            let buckets = sorted.buckets.of(s, s.sub(s.load(z), lanes));
            for ((rank, &z), bucket) in ranks.iter_mut().zip(z).zip(buckets) {
                let start = sorted.starts[bucket as usize];
                let ahead = &eights(&sorted.heights[start as usize..])[0];
                let below = s.greater(s.splat(z), s.add(s.load(ahead), lanes));
                // The first of the eight comes before the bucket. If it is not below, or all are, rounding led to
                // a neighbour or the bucket is full.
                let found = (1..255).contains(&below);
                *rank = if found { start + below.count_ones() - 1 } else { sorted.rank(z, step) };
            }
        }
        for (rank, &z) in rest.iter_mut().zip(z_rest) {
            *rank = sorted.rank(z, step);
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
    use crate::rng::{Purpose, Stream};

    /// The rank found in eights and the one found alone.
    fn rank(sorted: &Sorted, z: f32, step: f32) -> [usize; 2] {
        let mut ranks = vec![];
        sorted.ranks(&[z; 9], step, &mut ranks, Level::fastest());
        [ranks[0] as usize, ranks[8] as usize]
    }

    /// Finds the bucket of a height.
    struct BucketOf(Buckets, f32);

    impl Kernel for BucketOf {
        type Output = u32;

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> u32 {
            self.0.of(s, s.splat(self.1))[0]
        }
    }

    #[test]
    fn no_height_is_beyond_the_buckets_however_many_they_are() {
        for n in [1, 2, 1000, (1 << 24) - 1, 1 << 24, (1 << 24) + 1, (1 << 24) + 3, 100_000_000] {
            let buckets = Buckets::new(n, [-3.0, 5.0]);
            for &level in Level::available() {
                assert_eq!(level.run(BucketOf(buckets, -3.0)), 0);
                let last = level.run(BucketOf(buckets, 5.0)) as usize;
                assert_eq!(last, n.min(1 << 24) - 1);
            }
        }
    }

    #[test]
    fn ranks_are_counts_whatever_the_heights() {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        for (n, grid) in [(1, 1.0), (2, 0.0), (50, 4.0), (300, 0.0), (300, 1e-7), (1000, 1e4)] {
            let mut centres = Coordinates::zeros(n);
            for i in 0..n {
                centres.z[i] = 5.0 + (stream.range(-1.0, 1.0) * grid).round() as f32 * 0.3;
            }
            let mut sorted = Sorted::default();
            sorted.fill(&centres, Level::fastest());
            let z = &centres.z[..n];
            let ordered: Vec<f32> = sorted.indices().map(|i| z[i]).collect();
            assert!(ordered.is_sorted());
            for &probe in z.iter().chain(&[-1e6, 1e6, 5.0, 5.15]) {
                for step in [0.0, 0.3, 1.0, 0.1] {
                    for z_j in [probe, probe + step] {
                        let count = z.iter().filter(|&&c| c + step < z_j).count();
                        assert_eq!(rank(&sorted, z_j, step), [count; 2]);
                    }
                }
            }
        }
    }
}
