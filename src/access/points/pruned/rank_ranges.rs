//! Counting kernels of β: how many centers of a range of ranks lie within a radius of each obstacle?
//!
//! Centers come as a list sorted by height, so "the cutter's step reaches this obstacle" is a range of places in
//! the list. [`CountInRanges`] tests the centers of each range; [`AnnulusSplit`](super::annulus_split::AnnulusSplit)
//! makes ranges shorter before.

use crate::access::points::kernels::squared_distance;
use crate::simd::vector::MAX_LANES;
use crate::simd::{Float32, Kernel, Simd, Unsigned, Unsigned32, Vector};

/// Places of a list that must be readable, and writable, past its end.
pub const SLACK: usize = 64 + MAX_LANES;

/// Obstacles with their ranges `[from, to)` of a list, `from ≤ to`, and their counts so far; equal lengths.
pub struct RankRanges<'a> {
    /// First place of each range.
    pub from: &'a mut [u32],
    /// Place after each range.
    pub to: &'a mut [u32],
    /// Centers counted.
    pub counts: &'a mut [u32],
}

impl<'a> RankRanges<'a> {
    /// The first `n` of them, or all if there are fewer; they are taken away.
    pub fn split_to(&mut self, n: usize) -> RankRanges<'a> {
        let n = n.min(self.counts.len());
        let take = |slice: &mut &'a mut [u32]| {
            let (head, tail) = std::mem::take(slice).split_at_mut(n);
            *slice = tail;
            head
        };
        RankRanges {
            from: take(&mut self.from),
            to: take(&mut self.to),
            counts: take(&mut self.counts),
        }
    }

    /// The same ranges, borrowed for less long.
    pub fn reborrow(&mut self) -> RankRanges<'_> {
        RankRanges { from: self.from, to: self.to, counts: self.counts }
    }
}

/// What the ranges that are not empty span.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RangeSpan {
    /// First place.
    pub first: u32,
    /// Place after the last.
    pub last: u32,
    /// Sum of the ranges' lengths.
    pub pairs: u64,
}

/// Finds what ranges span.
pub struct FindSpan<'a>(pub &'a RankRanges<'a>);

/// Ranges whose lengths are summed in 32 bits, the lower and the upper half of each apart.
const SUMMED: usize = 1 << 16;

impl Kernel for FindSpan<'_> {
    type Output = RangeSpan;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> RangeSpan {
        let mut span = RangeSpan { first: u32::MAX, last: 0, pairs: 0 };
        for (from, to) in self.0.from.chunks(SUMMED).zip(self.0.to.chunks(SUMMED)) {
            let (from, to) = (from.chunks_exact(S::LANES), to.chunks_exact(S::LANES));
            let rest = from.remainder().iter().zip(to.remainder());
            let (zero, none) = (S::U32::splat(s, 0), S::U32::splat(s, u32::MAX));
            let half = S::U32::splat(s, 0xffff);
            let (mut first, mut last, mut low, mut high) = (none, zero, zero, zero);
            for (from, to) in from.zip(to) {
                let (from, to) = (S::U32::load(s, from), S::U32::load(s, to));
                let empty = from.ge(to);
                let length = zero.select(empty, to.sub(from));
                low = low.add(length.and(half));
                high = high.add(length.shr(16));
                first = first.min(none.select(empty, from));
                last = last.max(zero.select(empty, to));
            }
            span.first = span.first.min(first.reduce_min());
            span.last = span.last.max(last.reduce_max());
            span.pairs += u64::from(low.reduce_add()) + (u64::from(high.reduce_add()) << 16);
            for (&from, &to) in rest.filter(|(from, to)| from < to) {
                span.first = span.first.min(from);
                span.last = span.last.max(to);
                span.pairs += u64::from(to - from);
            }
        }
        span
    }
}

/// Counts, for each obstacle, the centers of its range within the radius.
pub struct CountInRanges<'a> {
    /// Squared radius of the step, mm².
    pub radius_squared: f32,
    /// Centers' x, with [`SLACK`].
    pub x: &'a [f32],
    /// Centers' y, with [`SLACK`].
    pub y: &'a [f32],
    /// Obstacles' x.
    pub obstacle_x: &'a [f32],
    /// Obstacles' y.
    pub obstacle_y: &'a [f32],
    /// Obstacles' ranges and counts.
    pub ranges: RankRanges<'a>,
}

/// A squared distance beyond all that coordinates of up to 1 km, and steps, have.
const BEYOND: f32 = 1e30;
/// Most centers that are tested at once: two vectors.
const TWO_VECTORS: usize = 2 * MAX_LANES;
/// From place `TWO_VECTORS − n` on: `n` zeros, then [`BEYOND`].
static TAIL: [f32; 2 * TWO_VECTORS] = {
    let mut tail = [0.0; 2 * TWO_VECTORS];
    let mut place = TWO_VECTORS;
    while place < 2 * TWO_VECTORS {
        tail[place] = BEYOND;
        place += 1;
    }
    tail
};

impl Kernel for CountInRanges<'_> {
    /// Pairs tested.
    type Output = u64;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> u64 {
        let within = S::F32::splat(s, self.radius_squared.min(0.5 * BEYOND));
        let RankRanges { from, to, counts } = self.ranges;
        let obstacles = self.obstacle_x.iter().zip(self.obstacle_y);
        let mut tested = 0;
        for (((&from, &to), count), (&ox, &oy)) in from.iter().zip(&*to).zip(counts).zip(obstacles)
        {
            if from >= to {
                continue;
            }
            let n = (to - from) as usize;
            let obstacle = [S::F32::splat(s, ox), S::F32::splat(s, oy)];
            let range = from as usize..from as usize + n.next_multiple_of(2 * S::LANES);
            *count +=
                count_in_range(s, obstacle, within, [&self.x[range.clone()], &self.y[range]], n);
            tested += n as u64;
        }
        tested
    }
}

/// Counts among the first `n ≥ 1` of the places `[x, y]`, two vectors at a time.
#[inline(always)]
fn count_in_range<S: Simd>(
    s: S,
    obstacle: [S::F32; 2],
    within: S::F32,
    [x, y]: [&[f32]; 2],
    n: usize,
) -> u32 {
    let step = 2 * S::LANES;
    let (whole, last) = ((n - 1) / step * step, (n - 1) % step + 1);
    let (mut even, mut odd) = (S::U32::splat(s, 0), S::U32::splat(s, 0));
    for (x, y) in x[..whole].chunks_exact(step).zip(y[..whole].chunks_exact(step)) {
        even = even.count(distance_of(s, obstacle, x, y).le(within));
        odd = odd.count(distance_of(s, obstacle, &x[S::LANES..], &y[S::LANES..]).le(within));
    }
    let (x, y, tail) = (&x[whole..], &y[whole..], &TAIL[TWO_VECTORS - last..][..step]);
    let squared = distance_of(s, obstacle, x, y).max(S::F32::load(s, tail));
    even = even.count(squared.le(within));
    let (x, y, tail) = (&x[S::LANES..], &y[S::LANES..], &tail[S::LANES..]);
    let squared = distance_of(s, obstacle, x, y).max(S::F32::load(s, tail));
    odd = odd.count(squared.le(within));
    even.add(odd).reduce_add()
}

#[inline(always)]
fn distance_of<S: Simd>(s: S, obstacle: [S::F32; 2], x: &[f32], y: &[f32]) -> S::F32 {
    squared_distance(obstacle, [S::F32::load(s, x), S::F32::load(s, y)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::points::pruned::annulus_split::{AnnulusSplit, Word};
    use crate::numeric::rng::{Purpose, Stream};
    use crate::simd::Isa;

    const N: usize = 500;

    /// Places on a grid, so that many are exactly at the radius.
    fn places(n: usize, size: f64, stream: &mut Stream) -> [Vec<f32>; 2] {
        [(); 2].map(|()| {
            let mut axis: Vec<f32> =
                (0..n).map(|_| stream.range(-size, size).round() as f32 * 0.5).collect();
            axis.resize(n + SLACK, 0.0);
            axis
        })
    }

    /// Ranges of every length up to 69, and some to the end of the list.
    fn ranges(n: usize, stream: &mut Stream) -> [Vec<u32>; 2] {
        let from: Vec<u32> = (0..n).map(|_| stream.range(0.0, (N - 70) as f64) as u32).collect();
        let to = from.iter().zip(0..).map(|(from, i)| if i % 9 == 8 { N as u32 } else { from + i });
        let to = to.collect();
        [from, to]
    }

    fn plain_span(from: &[u32], to: &[u32]) -> RangeSpan {
        let ranges = || from.iter().zip(to).filter(|(from, to)| from < to);
        RangeSpan {
            first: ranges().map(|range| *range.0).min().unwrap_or(u32::MAX),
            last: ranges().map(|range| *range.1).max().unwrap_or(0),
            pairs: ranges().map(|range| u64::from(range.1 - range.0)).sum(),
        }
    }

    #[test]
    fn spans_of_long_lists_do_not_overflow() {
        let n = SUMMED + 77;
        let (mut from, mut to) = (vec![0; n], vec![u32::MAX; n]);
        let mut counts = vec![0; n];
        let expected = plain_span(&from, &to);
        for isa in Isa::available() {
            let (from, to, counts) = (&mut from, &mut to, &mut counts);
            assert_eq!(isa.run(FindSpan(&RankRanges { from, to, counts })), expected);
        }
    }

    #[test]
    fn lists_split_or_not_give_the_counts_of_plain_loops() {
        let mut stream = Stream::new(5, 0, 0, Purpose::Probe);
        for (radius_squared, spread) in [(0.25, 2.0), (25.0, 2.0), (100.0, 12.0), (f32::MAX, 5.0)] {
            let [x, y] = places(N, 30.0, &mut stream);
            let [obstacle_x, obstacle_y] = places(70, spread, &mut stream);
            let [from, to] = ranges(70, &mut stream);
            let (obstacle_x, obstacle_y) = (&obstacle_x[..72], &obstacle_y[..72]);
            let plain = |j: usize| {
                let within = |&i: &usize| {
                    let (dx, dy) = (obstacle_x[j] - x[i], obstacle_y[j] - y[i]);
                    dx * dx + dy * dy <= radius_squared
                };
                (from[j] as usize..to[j] as usize).filter(within).count() as u32
            };
            let expected: Vec<u32> = (0..70).map(plain).collect();
            for &isa in Isa::available() {
                let mut counts = vec![0; 70];
                let (mut f, mut t) = (from.clone(), to.clone());
                let ranges = RankRanges { from: &mut f, to: &mut t, counts: &mut counts };
                let [ox, oy] = [&obstacle_x[..70], &obstacle_y[..70]];
                isa.run(CountInRanges {
                    radius_squared,
                    x: &x,
                    y: &y,
                    obstacle_x: ox,
                    obstacle_y: oy,
                    ranges,
                });
                assert_eq!(counts, expected, "{}", isa.name());
                counts.fill(0);
                let mut ranges = RankRanges { from: &mut f, to: &mut t, counts: &mut counts };
                let span = isa.run(FindSpan(&ranges));
                let RangeSpan { first, last, .. } = span;
                assert_eq!(span, plain_span(&from, &to), "{}", isa.name());
                let [mut annulus_x, mut annulus_y] = [vec![0.0; N + SLACK], vec![0.0; N + SLACK]];
                isa.run(AnnulusSplit {
                    radius_squared,
                    obstacle_x,
                    obstacle_y,
                    x: &x,
                    y: &y,
                    first,
                    last,
                    ranges: ranges.reborrow(),
                    words: &mut vec![Word::default(); N / 64 + 3],
                    annulus_x: &mut annulus_x,
                    annulus_y: &mut annulus_y,
                });
                isa.run(CountInRanges {
                    radius_squared,
                    x: &annulus_x,
                    y: &annulus_y,
                    obstacle_x: ox,
                    obstacle_y: oy,
                    ranges,
                });
                assert_eq!(counts, expected, "split at {}", isa.name());
            }
        }
    }
}
