//! Centres sorted by height, and ranks of heights among them.

use crate::simd::collide::{Coordinates, eights};
use crate::simd::{Kernel, Level, Simd};

/// Heights in ascending order, with a coarse index into them.
#[derive(Default)]
pub(super) struct Sorted {
    /// Height and index of each centre, ascending in height.
    places: Vec<(f32, u32)>,
    /// The heights alone, between one −∞ and [`AHEAD`] times +∞.
    heights: Vec<f32>,
    /// Place of the first centre of each bucket; the last bucket's end follows.
    starts: Vec<u32>,
    lowest: f32,
    buckets_per_mm: f32,
}

/// Buckets of up to this many centres are sorted by insertion.
const SMALL_BUCKET: usize = 24;
/// Centres of a bucket that a rank looks at without asking whether it needs to.
const AHEAD: usize = 8;

impl Sorted {
    /// Sorts the centres, at least one: into twice as many buckets of equal height as there are centres,
    /// then within each bucket.
    pub fn fill(&mut self, centres: &Coordinates) {
        let z = &centres.z[..centres.n];
        self.lowest = z.iter().fold(f32::INFINITY, |a, &b| if b < a { b } else { a });
        let highest = z.iter().fold(f32::NEG_INFINITY, |a, &b| if b > a { b } else { a });
        let n_buckets = 2 * z.len();
        self.buckets_per_mm = (n_buckets as f32 / (highest - self.lowest)).min(f32::MAX);
        self.starts.clear();
        self.starts.resize(n_buckets + 2, 0);
        for &z in z {
            let bucket = self.bucket(z);
            self.starts[bucket + 2] += 1;
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        self.places.resize(z.len(), (0.0, 0));
        for (&z, i) in z.iter().zip(0..) {
            let bucket = self.bucket(z);
            let next = &mut self.starts[bucket + 1];
            self.places[*next as usize] = (z, i);
            *next += 1;
        }
        for bucket in self.starts.windows(2) {
            sort(&mut self.places[bucket[0] as usize..bucket[1] as usize]);
        }
        self.heights.clear();
        self.heights.push(f32::NEG_INFINITY);
        self.heights.extend(self.places.iter().map(|place| place.0));
        self.heights.extend([f32::INFINITY; AHEAD]);
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

    #[inline(always)]
    fn rank<S: Simd>(&self, s: S, z: f32, step: f32) -> u32 {
        let below = |height: f32| height + step < z;
        let start = self.starts[self.bucket(z - step)] as usize;
        let ahead = &eights(&self.heights[start + 1..start + 1 + AHEAD])[0];
        let ahead = s.greater(s.splat(z), s.add(s.load(ahead), s.splat(step)));
        let rank = start + ahead.count_ones() as usize;
        // The bucket may be fuller, or a neighbour by rounding; the comparison has the last word.
        if rank == start + AHEAD {
            return (rank + self.heights[rank + 1..].partition_point(|&h| below(h))) as u32;
        }
        if !below(self.heights[rank]) {
            return self.heights[1..=rank].partition_point(|&h| below(h)) as u32;
        }
        rank as u32
    }

    /// Never descends with `z`; the cast takes what is below the lowest to bucket 0.
    #[inline(always)]
    fn bucket(&self, z: f32) -> usize {
        (((z - self.lowest) * self.buckets_per_mm) as usize).min(self.starts.len() - 3)
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
        for (rank, &z) in self.ranks.iter_mut().zip(self.z) {
            *rank = self.sorted.rank(s, z, self.step);
        }
    }
}

fn sort(places: &mut [(f32, u32)]) {
    if places.len() > SMALL_BUCKET {
        return places.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    }
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

    fn rank(sorted: &Sorted, z: f32, step: f32) -> usize {
        let mut ranks = vec![];
        sorted.ranks(&[z], step, &mut ranks, Level::fastest());
        ranks[0] as usize
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
            sorted.fill(&centres);
            let z = &centres.z[..n];
            let ordered: Vec<f32> = sorted.indices().map(|i| z[i]).collect();
            assert!(ordered.is_sorted());
            for &probe in z.iter().chain(&[-1e6, 1e6, 5.0, 5.15]) {
                for step in [0.0, 0.3, 1.0, 0.1] {
                    for z_j in [probe, probe + step] {
                        let count = z.iter().filter(|&&c| c + step < z_j).count();
                        assert_eq!(rank(&sorted, z_j, step), count);
                    }
                }
            }
        }
    }
}
