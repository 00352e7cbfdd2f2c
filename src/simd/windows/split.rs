//! Splitting a list of centres by a ring around obstacles.

use super::Windows;
use crate::simd::collide::{eights, squared_distance};
use crate::simd::level::{Kernel, Simd};

/// Sixty-four places of a split list: which are inside and ring, and how many of each came before.
#[derive(Debug, Clone, Copy, Default)]
pub struct Word {
    inside: u64,
    ring: u64,
    inside_before: u32,
    ring_before: u32,
}

impl Word {
    #[inline(always)]
    fn before(&self, place: u32) -> (u32, u32) {
        let mask = (1u64 << (place % 64)) - 1;
        (
            self.inside_before + (self.inside & mask).count_ones(),
            self.ring_before + (self.ring & mask).count_ones(),
        )
    }
}

/// Centres between the two circles may or may not be within a radius of some obstacle; inside
/// the inner one they are within it of all, outside the outer one of none.
#[derive(Debug, Clone, Copy)]
pub struct Ring {
    x: f32,
    y: f32,
    inner_squared: f32,
    outer_squared: f32,
}

/// Share of the radius by which circles keep their distance from the knife edge. Each squared distance
/// in `f32` is off by four roundings at most, 1.2e-7 of the distance, and so is the predicate's own:
/// this is thirty times as much.
const MARGIN: f64 = 1e-5;

impl Ring {
    /// For a step of `radius_squared` (mm², finite) and obstacles at most `reach` away from a place.
    #[inline(always)]
    fn new([x, y]: [f32; 2], reach: f64, radius_squared: f32) -> Self {
        let radius = f64::from(radius_squared).sqrt();
        let outer = (radius + reach) * (1.0 + MARGIN);
        let inner = radius * (1.0 - MARGIN) - reach * (1.0 + MARGIN);
        let inner_squared = if inner > 0.0 { (inner * inner) as f32 } else { -1.0 };
        Ring { x, y, inner_squared, outer_squared: (outer * outer) as f32 }
    }
}

/// A place among the obstacles, and how far they are from it at most, mm.
#[inline(always)]
fn middle_and_reach<S: Simd>(s: S, x: &[f32], y: &[f32]) -> ([f32; 2], f64) {
    let middle = [middle(s, x), middle(s, y)];
    let (x0, y0) = (s.splat(middle[0]), s.splat(middle[1]));
    let mut farthest = s.splat(0.0);
    for (x, y) in eights(x).iter().zip(eights(y)) {
        farthest = s.max(farthest, squared_distance(s, x0, y0, x, y));
    }
    (middle, f64::from(s.greatest(farthest)).sqrt())
}

#[inline(always)]
fn middle<S: Simd>(s: S, axis: &[f32]) -> f32 {
    let (mut least, mut most) = (s.splat(f32::INFINITY), s.splat(f32::NEG_INFINITY));
    for eight in eights(axis) {
        (least, most) = (s.min(least, s.load(eight)), s.max(most, s.load(eight)));
    }
    0.5 * (s.least(least) + s.greatest(most))
}

/// Splits a list of centres by a ring; counts the inside, moves the windows on to the ring.
pub struct Split<'a> {
    /// Squared radius of the step, mm².
    pub radius_squared: f32,
    /// Obstacles' x, a multiple of eight: the last one again where there are fewer.
    pub obstacle_x: &'a [f32],
    /// Obstacles' y.
    pub obstacle_y: &'a [f32],
    /// Centres' x, the windows' places, with `SLACK`.
    pub x: &'a [f32],
    /// Centres' y, with `SLACK`.
    pub y: &'a [f32],
    /// Place of the first centre that some window uses.
    pub first: u32,
    /// Place after the last one.
    pub last: u32,
    /// Windows of the obstacles.
    pub windows: Windows<'a>,
    /// Room for one word per 64 centres and one more.
    pub words: &'a mut [Word],
    /// Receives the ring's x, with `SLACK`.
    pub ring_x: &'a mut [f32],
    /// Receives the ring's y.
    pub ring_y: &'a mut [f32],
}

impl Kernel for Split<'_> {
    /// Centres in the ring, and pairs counted.
    type Output = (usize, u64);

    #[inline(always)]
    fn run<S: Simd>(mut self, s: S) -> (usize, u64) {
        let (middle, reach) = middle_and_reach(s, self.obstacle_x, self.obstacle_y);
        let ring = Ring::new(middle, reach, self.radius_squared);
        let (n_inside, n_ring) = if ring.inner_squared < 0.0 {
            self.split::<S, false>(s, ring)
        } else {
            self.split::<S, true>(s, ring)
        };
        let n = (self.last - self.first) as usize;
        self.words[n.div_ceil(64)] =
            Word { inside_before: n_inside, ring_before: n_ring as u32, ..Word::default() };
        (n_ring, move_windows(self.windows, self.words, self.first))
    }
}

impl Split<'_> {
    /// Fills the words and the ring; places past the last one, up to a multiple of 64, are split like the
    /// others, but no window ends behind them. `INNER`: whether there is an inner circle.
    #[inline(always)]
    fn split<S: Simd, const INNER: bool>(&mut self, s: S, ring: Ring) -> (u32, usize) {
        let (x0, y0) = (s.splat(ring.x), s.splat(ring.y));
        let (inner, outer) = (s.splat(ring.inner_squared), s.splat(ring.outer_squared));
        let n = ((self.last - self.first) as usize).next_multiple_of(64);
        let range = self.first as usize..self.first as usize + n;
        let (x, y) = (eights(&self.x[range.clone()]), eights(&self.y[range]));
        assert!(self.ring_x.len() >= n + 8 && self.ring_y.len() >= n + 8);
        let (mut n_inside, mut n_ring) = (0, 0);
        let words = x.as_chunks::<8>().0.iter().zip(y.as_chunks::<8>().0).zip(&mut *self.words);
        for ((x, y), word) in words {
            let (inside_before, ring_before) = (n_inside, n_ring as u32);
            let (mut inside_bits, mut ring_bits) = ([0; 8], [0; 8]);
            for c in 0..8 {
                let squared = squared_distance(s, x0, y0, &x[c], &y[c]);
                let inside = if INNER { s.at_most(squared, inner) } else { 0 };
                let ring = s.at_most(squared, outer) & !inside;
                (inside_bits[c], ring_bits[c]) = (inside as u8, ring as u8);
                // SAFETY: every eight before has brought `n_ring` forward by eight at most, so there is room
                // for eight behind it, as asserted above.
                unsafe {
                    append(s, s.compress(s.load(&x[c]), ring), self.ring_x, n_ring);
                    append(s, s.compress(s.load(&y[c]), ring), self.ring_y, n_ring);
                }
                n_ring += ring.count_ones() as usize;
            }
            let [inside, ring] = [inside_bits, ring_bits].map(u64::from_le_bytes);
            *word = Word { inside, ring, inside_before, ring_before };
            n_inside += inside.count_ones();
        }
        (n_inside, n_ring)
    }
}

/// Writes eight lanes from `place` on.
///
/// # Safety
/// `to` must have eight places there.
#[inline(always)]
unsafe fn append<S: Simd>(s: S, lanes: S::Eight, to: &mut [f32], place: usize) {
    // SAFETY: the caller's promise.
    let to = unsafe { &mut *to.as_mut_ptr().add(place).cast::<[f32; 8]>() };
    s.store(lanes, to);
}

/// Counts the inside of each window and replaces it by its window into the ring.
#[inline(always)]
fn move_windows(windows: Windows, words: &[Word], first: u32) -> u64 {
    let Windows { from, to, counts } = windows;
    let mut counted = 0;
    for ((from, to), count) in from.iter_mut().zip(to).zip(counts) {
        if *from < *to {
            let (a, b) = (*from - first, *to - first);
            let (inside_a, ring_a) = words[a as usize / 64].before(a);
            let (inside_b, ring_b) = words[b as usize / 64].before(b);
            *count += inside_b - inside_a;
            counted += u64::from(inside_b - inside_a);
            (*from, *to) = (ring_a, ring_b);
        } else {
            (*from, *to) = (0, 0);
        }
    }
    counted
}
