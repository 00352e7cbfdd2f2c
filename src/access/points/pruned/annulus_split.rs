//! Splitting a list of centers by an annulus around obstacles.
//!
//! ```text
//! annulus = two circles around a place amid the obstacles
//! for each center of the list:
//!     inside the inner circle:    within the radius of every obstacle: counted by prefix sums
//!     outside the outer circle:   within the radius of none: dropped
//!     between:                    appended to the annulus's list
//! for each obstacle:
//!     count += centers inside, among its range
//!     range = its range of the annulus's list
//! ```
//!
//! The circles are drawn wider than rounding could ever matter, see [`MARGIN`].

use super::rank_ranges::{RankRanges, SLACK};
use crate::access::points::kernels::squared_distance;
use crate::simd::{Float32, Kernel, Mask, Simd, Vector};

/// Sixty-four places of a split list: which are inside and which in the annulus, and how many of each came before.
#[derive(Debug, Clone, Copy, Default)]
pub struct Word {
    inside: u64,
    annulus: u64,
    inside_before: u32,
    annulus_before: u32,
}

impl Word {
    #[inline(always)]
    fn before(&self, place: u32) -> (u32, u32) {
        let mask = (1u64 << (place % 64)) - 1;
        (
            self.inside_before + (self.inside & mask).count_ones(),
            self.annulus_before + (self.annulus & mask).count_ones(),
        )
    }
}

/// Centers between the two circles may or may not be within a radius of some obstacle; inside
/// the inner one they are within it of all, outside the outer one of none.
#[derive(Debug, Clone, Copy)]
struct Annulus {
    x: f32,
    y: f32,
    inner_squared: f32,
    outer_squared: f32,
}

/// Share of the radius by which circles keep their distance from borderline cases. Each squared distance
/// in `f32` is off by four roundings at most, 1.2e-7 of the distance, and so is the predicate's own:
/// this is thirty times as much.
const MARGIN: f64 = 1e-5;

impl Annulus {
    /// For a step of `radius_squared` (mm², finite) and obstacles at most `reach` away from a place.
    #[inline(always)]
    fn new([x, y]: [f32; 2], reach: f64, radius_squared: f32) -> Self {
        let radius = f64::from(radius_squared).sqrt();
        let outer = (radius + reach) * (1.0 + MARGIN);
        let inner = radius * (1.0 - MARGIN) - reach * (1.0 + MARGIN);
        let inner_squared = if inner > 0.0 { (inner * inner) as f32 } else { -1.0 };
        Annulus { x, y, inner_squared, outer_squared: (outer * outer) as f32 }
    }
}

/// A place among the obstacles, and how far they are from it at most, mm.
#[inline(always)]
fn middle_and_reach<S: Simd>(s: S, x: &[f32], y: &[f32]) -> ([f32; 2], f64) {
    let middle = [middle(s, x), middle(s, y)];
    let place = [S::F32::splat(s, middle[0]), S::F32::splat(s, middle[1])];
    let mut farthest = S::F32::splat(s, 0.0);
    for (x, y) in x.chunks_exact(S::LANES).zip(y.chunks_exact(S::LANES)) {
        let obstacle = [S::F32::load(s, x), S::F32::load(s, y)];
        farthest = farthest.max(squared_distance(place, obstacle));
    }
    (middle, f64::from(farthest.reduce_max()).sqrt())
}

#[inline(always)]
fn middle<S: Simd>(s: S, axis: &[f32]) -> f32 {
    let mut least = S::F32::splat(s, f32::INFINITY);
    let mut most = S::F32::splat(s, f32::NEG_INFINITY);
    for lanes in axis.chunks_exact(S::LANES) {
        let lanes = S::F32::load(s, lanes);
        (least, most) = (least.min(lanes), most.max(lanes));
    }
    0.5 * (least.reduce_min() + most.reduce_max())
}

/// Splits a list of centers by an annulus; counts the inside, moves the ranges on to the annulus.
pub struct AnnulusSplit<'a> {
    /// Squared radius of the step, mm².
    pub radius_squared: f32,
    /// Obstacles' x, a multiple of the lanes: the last one again where there are fewer.
    pub obstacle_x: &'a [f32],
    /// Obstacles' y.
    pub obstacle_y: &'a [f32],
    /// Centers' x, the ranges' places, with `SLACK`.
    pub x: &'a [f32],
    /// Centers' y, with `SLACK`.
    pub y: &'a [f32],
    /// Place of the first center of some range.
    pub first: u32,
    /// Place after the last one.
    pub last: u32,
    /// Ranges of the obstacles.
    pub ranges: RankRanges<'a>,
    /// One word per 64 centers and one more.
    pub words: &'a mut [Word],
    /// Receives the annulus's x, with `SLACK`.
    pub annulus_x: &'a mut [f32],
    /// Receives the annulus's y.
    pub annulus_y: &'a mut [f32],
}

impl Kernel for AnnulusSplit<'_> {
    /// Centers in the annulus, and pairs counted.
    type Output = (usize, u64);

    #[inline(always)]
    fn run<S: Simd>(mut self, s: S) -> (usize, u64) {
        let (middle, reach) = middle_and_reach(s, self.obstacle_x, self.obstacle_y);
        let annulus = Annulus::new(middle, reach, self.radius_squared);
        let (n_inside, n_annulus) = if annulus.inner_squared < 0.0 {
            self.split::<S, false>(s, annulus)
        } else {
            self.split::<S, true>(s, annulus)
        };
        let n = (self.last - self.first) as usize;
        self.words[n.div_ceil(64)] =
            Word { inside_before: n_inside, annulus_before: n_annulus as u32, ..Word::default() };
        (n_annulus, move_ranges(self.ranges, self.words, self.first))
    }
}

impl AnnulusSplit<'_> {
    /// Fills the words and the annulus; places past the last one, up to a multiple of 64, are split like the
    /// others, but no range ends behind them. `INNER`: whether there is an inner circle.
    #[inline(always)]
    fn split<S: Simd, const INNER: bool>(&mut self, s: S, annulus: Annulus) -> (u32, usize) {
        let middle = [S::F32::splat(s, annulus.x), S::F32::splat(s, annulus.y)];
        let inner = S::F32::splat(s, annulus.inner_squared);
        let outer = S::F32::splat(s, annulus.outer_squared);
        let n = ((self.last - self.first) as usize).next_multiple_of(64);
        let range = self.first as usize..self.first as usize + n;
        let (x, y) = (&self.x[range.clone()], &self.y[range]);
        let (mut n_inside, mut n_annulus) = (0, 0);
        let words = x.as_chunks::<64>().0.iter().zip(y.as_chunks::<64>().0).zip(&mut *self.words);
        for ((x, y), word) in words {
            let to_x = next_places(self.annulus_x, n_annulus);
            let to_y = next_places(self.annulus_y, n_annulus);
            let (mut inside, mut between) = (0, 0);
            let mut filled = 0;
            for at in (0..64).step_by(S::LANES) {
                let (x, y) = (S::F32::load(s, &x[at..]), S::F32::load(s, &y[at..]));
                let squared = squared_distance(middle, [x, y]);
                let within = if INNER { squared.le(inner).bits() } else { 0 };
                let kept = squared.le(outer).bits() & !within;
                inside |= u64::from(within) << at;
                between |= u64::from(kept) << at;
                // Always below 64; states to the compiler that a vector fits behind.
                let place = filled & 63;
                x.compress(kept).store(&mut to_x[place..]);
                y.compress(kept).store(&mut to_y[place..]);
                filled += kept.count_ones() as usize;
            }
            *word = Word {
                inside,
                annulus: between,
                inside_before: n_inside,
                annulus_before: n_annulus as u32,
            };
            n_inside += inside.count_ones();
            n_annulus += filled;
        }
        (n_inside, n_annulus)
    }
}

/// The places that a word's centers may be written to.
#[inline(always)]
fn next_places(list: &mut [f32], place: usize) -> &mut [f32; SLACK] {
    list[place..].first_chunk_mut().expect("a list has slack past its end")
}

/// Counts the inside of each range and replaces it by its range of the annulus's list.
#[inline(always)]
fn move_ranges(ranges: RankRanges, words: &[Word], first: u32) -> u64 {
    let RankRanges { from, to, counts } = ranges;
    let mut counted = 0;
    for ((from, to), count) in from.iter_mut().zip(to).zip(counts) {
        if *from < *to {
            let (a, b) = (*from - first, *to - first);
            let (inside_a, annulus_a) = words[a as usize / 64].before(a);
            let (inside_b, annulus_b) = words[b as usize / 64].before(b);
            *count += inside_b - inside_a;
            counted += u64::from(inside_b - inside_a);
            (*from, *to) = (annulus_a, annulus_b);
        } else {
            (*from, *to) = (0, 0);
        }
    }
    counted
}
