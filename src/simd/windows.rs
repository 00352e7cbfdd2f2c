//! Counting kernels of β: how many centres of a window lie within a radius of each obstacle?
//!
//! Centres come as a list sorted by height, so "the cutter's step reaches this obstacle" is a window of
//! places in the list. [`Split`] compares the list with a circle around some obstacles: centres within
//! the radius of the whole circle are counted for all its obstacles by prefix sums, centres beyond reach
//! are dropped, and the ring between is handed down. [`CountWindows`] tests what is left. The ring is
//! drawn wider than rounding could ever matter, see `split::Ring`.

mod split;

use super::collide::{eights, squared_distance};
use super::level::{Kernel, Simd};
pub use split::{Split, Word};

/// Places of a list that must be readable, and writable, past its end.
pub const SLACK: usize = 80;

/// Obstacles with their windows `[from, to)` into a list and their counts so far; equal lengths.
pub struct Windows<'a> {
    /// First place of each window.
    pub from: &'a mut [u32],
    /// Place after each window.
    pub to: &'a mut [u32],
    /// Centres counted.
    pub counts: &'a mut [u32],
}

impl<'a> Windows<'a> {
    /// The first `n` of them, or all if there are fewer; they are taken away.
    pub fn split_to(&mut self, n: usize) -> Windows<'a> {
        let n = n.min(self.counts.len());
        let take = |slice: &mut &'a mut [u32]| {
            let (head, tail) = std::mem::take(slice).split_at_mut(n);
            *slice = tail;
            head
        };
        Windows {
            from: take(&mut self.from),
            to: take(&mut self.to),
            counts: take(&mut self.counts),
        }
    }

    /// The same windows, lent.
    pub fn reborrow(&mut self) -> Windows<'_> {
        Windows { from: self.from, to: self.to, counts: self.counts }
    }
}

/// What the windows that are not empty cover.
#[derive(Debug, Clone, Copy)]
pub struct Cover {
    /// First place.
    pub first: u32,
    /// Place after the last.
    pub last: u32,
    /// Sum of the windows' lengths.
    pub pairs: u64,
}

/// Finds what windows cover.
pub struct Span<'a>(pub &'a Windows<'a>);

impl Kernel for Span<'_> {
    type Output = Cover;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Cover {
        let (mut first, mut last, mut pairs) = (u32::MAX, 0, 0);
        for (&from, &to) in self.0.from.iter().zip(&*self.0.to) {
            let length = to.saturating_sub(from);
            pairs += u64::from(length);
            first = first.min(if length > 0 { from } else { u32::MAX });
            last = last.max(if length > 0 { to } else { 0 });
        }
        Cover { first, last, pairs }
    }
}

/// Counts, for each obstacle, the centres of its window within the radius.
pub struct CountWindows<'a> {
    /// Squared radius of the step, mm².
    pub radius_squared: f32,
    /// Centres' x, with [`SLACK`].
    pub x: &'a [f32],
    /// Centres' y, with [`SLACK`].
    pub y: &'a [f32],
    /// Obstacles' x.
    pub obstacle_x: &'a [f32],
    /// Obstacles' y.
    pub obstacle_y: &'a [f32],
    /// Obstacles' windows and counts.
    pub windows: Windows<'a>,
}

/// A squared distance beyond all that coordinates of up to 1 km, and steps, have.
const BEYOND: f32 = 1e30;
/// From place `16 − n` on: `n` zeros, then [`BEYOND`].
static MASK: [f32; 32] = {
    let mut mask = [0.0; 32];
    let mut place = 16;
    while place < 32 {
        mask[place] = BEYOND;
        place += 1;
    }
    mask
};

impl Kernel for CountWindows<'_> {
    /// Pairs tested.
    type Output = u64;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> u64 {
        let within = s.splat(self.radius_squared.min(0.5 * BEYOND));
        let Windows { from, to, counts } = self.windows;
        let obstacles = self.obstacle_x.iter().zip(self.obstacle_y);
        let mut tested = 0;
        for (((&from, &to), count), (&ox, &oy)) in from.iter().zip(&*to).zip(counts).zip(obstacles)
        {
            if from >= to {
                continue;
            }
            let n = (to - from) as usize;
            let range = from as usize..from as usize + n.next_multiple_of(16);
            let (x, y) = (sixteens(&self.x[range.clone()]), sixteens(&self.y[range]));
            let ([x @ .., last_x], [y @ .., last_y]) = (x, y) else { continue };
            let (ox, oy) = (s.splat(ox), s.splat(oy));
            let mut counts = [s.no_counts(); 2];
            for (x, y) in x.iter().zip(y) {
                for half in 0..2 {
                    let squared = squared_distance(s, ox, oy, &x[half], &y[half]);
                    counts[half] = s.count_at_most(counts[half], squared, within);
                }
            }
            let mask = eights(&MASK[15 - (n - 1) % 16..]);
            for half in 0..2 {
                let squared = squared_distance(s, ox, oy, &last_x[half], &last_y[half]);
                let squared = s.max(squared, s.load(&mask[half]));
                counts[half] = s.count_at_most(counts[half], squared, within);
            }
            *count += s.total(s.add_counts(counts[0], counts[1]));
            tested += n as u64;
        }
        tested
    }
}

#[inline(always)]
fn sixteens(axis: &[f32]) -> &[[[f32; 8]; 2]] {
    eights(axis).as_chunks().0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};
    use crate::simd::Level;

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

    /// Windows of every length up to 69, and some to the end of the list.
    fn windows(n: usize, stream: &mut Stream) -> [Vec<u32>; 2] {
        let from: Vec<u32> = (0..n).map(|_| stream.range(0.0, (N - 70) as f64) as u32).collect();
        let to = from.iter().zip(0..).map(|(from, i)| if i % 9 == 8 { N as u32 } else { from + i });
        let to = to.collect();
        [from, to]
    }

    #[test]
    fn lists_split_or_not_give_the_counts_of_plain_loops() {
        let mut stream = Stream::new(5, 0, 0, Purpose::Probe);
        for (radius_squared, spread) in [(0.25, 2.0), (25.0, 2.0), (100.0, 12.0), (f32::MAX, 5.0)] {
            let [x, y] = places(N, 30.0, &mut stream);
            let [obstacle_x, obstacle_y] = places(70, spread, &mut stream);
            let [from, to] = windows(70, &mut stream);
            let (obstacle_x, obstacle_y) = (&obstacle_x[..72], &obstacle_y[..72]);
            let plain = |j: usize| {
                let within = |&i: &usize| {
                    let (dx, dy) = (obstacle_x[j] - x[i], obstacle_y[j] - y[i]);
                    dx * dx + dy * dy <= radius_squared
                };
                (from[j] as usize..to[j] as usize).filter(within).count() as u32
            };
            let expected: Vec<u32> = (0..70).map(plain).collect();
            for &level in Level::available() {
                let mut counts = vec![0; 70];
                let (mut f, mut t) = (from.clone(), to.clone());
                let windows = Windows { from: &mut f, to: &mut t, counts: &mut counts };
                let [ox, oy] = [&obstacle_x[..70], &obstacle_y[..70]];
                level.run(CountWindows {
                    radius_squared,
                    x: &x,
                    y: &y,
                    obstacle_x: ox,
                    obstacle_y: oy,
                    windows,
                });
                assert_eq!(counts, expected, "{}", level.name());
                counts.fill(0);
                let mut windows = Windows { from: &mut f, to: &mut t, counts: &mut counts };
                let Cover { first, last, .. } = level.run(Span(&windows));
                let [mut ring_x, mut ring_y] = [vec![0.0; N + SLACK], vec![0.0; N + SLACK]];
                level.run(Split {
                    radius_squared,
                    obstacle_x,
                    obstacle_y,
                    x: &x,
                    y: &y,
                    first,
                    last,
                    windows: windows.reborrow(),
                    words: &mut vec![Word::default(); N / 64 + 3],
                    ring_x: &mut ring_x,
                    ring_y: &mut ring_y,
                });
                level.run(CountWindows {
                    radius_squared,
                    x: &ring_x,
                    y: &ring_y,
                    obstacle_x: ox,
                    obstacle_y: oy,
                    windows,
                });
                assert_eq!(counts, expected, "split at {}", level.name());
            }
        }
    }
}
