//! Bounds of β that need neither sorting nor distances.
//!
//! An obstacle collides in a direction with no more centers than the lowest step passes, and with at least those that
//! an unbounded step passes. Centers and obstacles fall into buckets of height, and
//!
//! ```text
//! bucket(height of the center + step) < bucket(z)   ⇒   height of the center + step < z   ⇒   … ≤ …
//! ```
//!
//! so that the centers in lower buckets are a lower bound, those of the same bucket besides an upper one.

use super::ranks::{Distribute, HeightBuckets};
use crate::access::predicate::StepSquared;
use crate::simd::vector::MAX_LANES;
use crate::simd::{Isa, Kernel, Simd, Unsigned, Vector};
use crate::spatial::{Coordinates, CountingSort};

/// Buckets, reused from direction to direction.
#[derive(Default)]
pub(super) struct Bounding {
    buckets: HeightBuckets,
    /// Of each center.
    bucket: Vec<u32>,
    /// Of each obstacle.
    found: Vec<u32>,
    sort: CountingSort,
}

/// Per obstacle, bounds of its β; a center's own obstacle may be counted.
pub(in crate::access) struct BetaBounds {
    pub lower: Vec<u64>,
    pub upper: Vec<u64>,
}

impl Bounding {
    /// Adds what one direction adds to the bounds.
    pub fn add(
        &mut self,
        steps: &[StepSquared],
        centers: &Coordinates,
        obstacles: &Coordinates,
        bounds: &mut BetaBounds,
        isa: Isa,
    ) {
        let (Some(first), Some(last)) = (steps.first(), steps.last()) else { return };
        if centers.n == 0 {
            return;
        }
        let (centers, z) = (&centers.z[..centers.n], &obstacles.z[..obstacles.n]);
        self.add_counts((centers, first.height), z, 1, &mut bounds.upper, isa);
        if last.radius_squared == f32::INFINITY {
            self.add_counts((centers, last.height), z, 0, &mut bounds.lower, isa);
        }
    }

    /// Adds to each sum the number of centers, raised by a step, below the bucket of the height `z` or so many buckets
    /// beyond.
    fn add_counts(
        &mut self,
        (centers, raised): (&[f32], f32),
        z: &[f32],
        beyond: usize,
        sums: &mut [u64],
        isa: Isa,
    ) {
        let (buckets, bucket) = (&mut self.buckets, &mut self.bucket);
        isa.run(Distribute { z: centers, raised, buckets, bucket });
        self.sort.clear(centers.len());
        self.bucket.iter().for_each(|&bucket| self.sort.count(bucket as usize));
        self.sort.finish_counting();
        self.found.resize(z.len().next_multiple_of(MAX_LANES), 0);
        isa.run(FindBuckets { z, buckets: self.buckets, found: &mut self.found });
        for (sum, &bucket) in sums.iter_mut().zip(&self.found) {
            *sum += u64::from(self.sort.n_below(bucket as usize + beyond));
        }
    }
}

/// Finds the bucket of each height.
struct FindBuckets<'a> {
    z: &'a [f32],
    buckets: HeightBuckets,
    /// As long as `z`, and up to whole vectors.
    found: &'a mut [u32],
}

impl Kernel for FindBuckets<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let FindBuckets { z, buckets, found } = self;
        for (z, found) in z.chunks(S::LANES).zip(found.chunks_exact_mut(S::LANES)) {
            buckets.of(s, S::F32::load_partial(s, z)).store(found);
        }
    }
}

impl BetaBounds {
    pub fn zeros(n: usize) -> Self {
        BetaBounds { lower: vec![0; n], upper: vec![0; n] }
    }

    pub fn add(&mut self, other: &BetaBounds) {
        let sum = |sums: &mut [u64], more: &[u64]| {
            sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        };
        sum(&mut self.lower, &other.lower);
        sum(&mut self.upper, &other.upper);
    }

    /// The obstacles that may be among the `n` of greatest β: fewer than `n` others are sure to have more. No lower
    /// bound counts more than `n_own` pairs of a center with its own obstacle.
    pub fn may_be_among_the_greatest(&self, n: usize, n_own: u64) -> Vec<usize> {
        let n_obstacles = self.lower.len();
        if n == 0 {
            return Vec::new();
        }
        if n >= n_obstacles {
            return (0..n_obstacles).collect();
        }
        let mut lower = self.lower.clone();
        let (_, nth, _) = lower.select_nth_unstable_by(n - 1, |a, b| b.cmp(a));
        let least = nth.saturating_sub(n_own);
        (0..n_obstacles).filter(|&j| self.upper[j] >= least).collect()
    }
}
