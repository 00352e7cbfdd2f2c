//! Greatest and least sums over a neighborhood of every pixel: dilation and erosion of images of heights.
//!
//! An image is a row-major slice of `f32`. A tile of [`TILE_WIDTH`] × [`TILE_HEIGHT`] pixels lies in registers row by
//! row while the terms pass.

use super::elementwise::for_each_vector;
use super::vector::MAX_LANES;
use super::{Float32, Isa, Kernel, Simd, Vector};

/// Pixels of a tile's row.
pub const TILE_WIDTH: usize = 64;
/// Rows of a tile.
pub const TILE_HEIGHT: usize = 8;
/// Pixels of a tile.
pub const TILE: usize = TILE_WIDTH * TILE_HEIGHT;

/// Vectors in registers beside that of a term.
const HELD: usize = 4;

/// A term: how far from a pixel the one is that it reads, in the image's row-major order, and what is added to that.
pub type Term = (isize, f32);

/// Which of the sums is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extreme {
    /// The greatest.
    Greatest,
    /// The least.
    Least,
}

/// `tile[p] = extreme(tile[p], image[q] + added)` for every pixel p and term, q being the pixel `term` away from p.
///
/// `first` is the tile's first pixel in the image, `stride` the length of the image's rows. Numbers are finite.
///
/// # Panics
/// If a term reads beyond the image.
pub fn extremes(
    isa: Isa,
    extreme: Extreme,
    tile: &mut [f32; TILE],
    (image, stride): (&[f32], usize),
    first: usize,
    terms: &[Term],
) {
    let span = stride * (TILE_HEIGHT - 1) + TILE_WIDTH;
    for (offset, _) in terms {
        let begin = first.checked_add_signed(*offset).expect("a term before the image");
        assert!(
            begin.checked_add(span).is_some_and(|end| end <= image.len()),
            "a term beyond the image"
        );
    }
    isa.run(Extremes { extreme, tile, image, stride, first, terms });
}

/// The greatest or the least pixel of a tile.
pub fn extreme_of_tile(isa: Isa, extreme: Extreme, tile: &[f32; TILE]) -> f32 {
    isa.run(OfTile { extreme, tile })
}

/// Inputs of [`extreme_of_tile`].
struct OfTile<'a> {
    extreme: Extreme,
    tile: &'a [f32; TILE],
}

impl Kernel for OfTile<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> f32 {
        match self.extreme {
            Extreme::Greatest => self.held(s, |a: S::F32, b: S::F32| a.max(b)).reduce_max(),
            Extreme::Least => self.held(s, |a: S::F32, b: S::F32| a.min(b)).reduce_min(),
        }
    }
}

impl OfTile<'_> {
    #[inline(always)]
    fn held<S: Simd>(self, s: S, of: impl Fn(S::F32, S::F32) -> S::F32) -> S::F32 {
        let mut held: [S::F32; HELD] =
            std::array::from_fn(|k| S::F32::load(s, &self.tile[k * S::LANES..]));
        for block in self.tile.chunks_exact(HELD * S::LANES).skip(1) {
            for k in 0..HELD {
                held[k] = of(held[k], S::F32::load(s, &block[k * S::LANES..]));
            }
        }
        of(of(held[0], held[1]), of(held[2], held[3]))
    }
}

/// `line[k] = max(line[k], first + slope · k)`, the sum kept between `low` and `high`.
pub fn raise_line(isa: Isa, line: &mut [f32], [first, slope]: [f32; 2], [low, high]: [f32; 2]) {
    isa.run(RaiseLine { line, first, slope, low, high });
}

/// Inputs of [`raise_line`].
struct RaiseLine<'a> {
    line: &'a mut [f32],
    first: f32,
    slope: f32,
    low: f32,
    high: f32,
}

/// Numbers of the lanes.
const LANE: [f32; MAX_LANES] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

impl Kernel for RaiseLine<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let [first, slope, low, high] =
            [self.first, self.slope, self.low, self.high].map(|x| S::F32::splat(s, x));
        // Counted in a vector: whole numbers are exact, and no scalar is converted and spread in every step.
        let step = S::F32::splat(s, S::LANES as f32);
        let mut k = S::F32::load(s, &LANE) - step;
        let (n, line) = (self.line.len(), self.line.as_mut_ptr());
        // SAFETY: the slice has `n` numbers, borrowed here alone; chunks end at `n`.
        for_each_vector!(S, n, |chunk| unsafe {
            k = k + step;
            let height = (first + slope * k).max(low).min(high);
            chunk.store::<S>(chunk.load(s, line).max(height), line);
        });
    }
}

/// `out[i] = extreme(a[i], b[i])`.
///
/// # Panics
/// If the lengths differ.
pub fn extreme_of_pairs(isa: Isa, extreme: Extreme, out: &mut [f32], [a, b]: [&[f32]; 2]) {
    assert!(out.len() == a.len() && out.len() == b.len(), "as many elements");
    isa.run(Pairs { extreme, out, a, b });
}

/// Inputs of [`extreme_of_pairs`], checked.
struct Pairs<'a> {
    extreme: Extreme,
    out: &'a mut [f32],
    a: &'a [f32],
    b: &'a [f32],
}

impl Kernel for Pairs<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let (n, out, a, b) =
            (self.out.len(), self.out.as_mut_ptr(), self.a.as_ptr(), self.b.as_ptr());
        match self.extreme {
            // SAFETY: the three slices have `n` numbers each (`extreme_of_pairs` asserts it), `out` is borrowed here
            // alone; chunks end at `n`.
            Extreme::Greatest => for_each_vector!(S, n, |chunk| unsafe {
                chunk.store::<S>(chunk.load(s, a).max(chunk.load(s, b)), out);
            }),
            // SAFETY: the three slices have `n` numbers each (`extreme_of_pairs` asserts it), `out` is borrowed here
            // alone; chunks end at `n`.
            Extreme::Least => for_each_vector!(S, n, |chunk| unsafe {
                chunk.store::<S>(chunk.load(s, a).min(chunk.load(s, b)), out);
            }),
        }
    }
}

/// Inputs of [`extremes`], checked.
struct Extremes<'a> {
    extreme: Extreme,
    tile: &'a mut [f32; TILE],
    image: &'a [f32],
    stride: usize,
    first: usize,
    terms: &'a [Term],
}

impl Kernel for Extremes<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        match self.extreme {
            Extreme::Greatest => self.pass(s, |a: S::F32, b: S::F32| a.max(b)),
            Extreme::Least => self.pass(s, |a: S::F32, b: S::F32| a.min(b)),
        }
    }
}

impl Extremes<'_> {
    #[inline(always)]
    fn pass<S: Simd>(self, s: S, of: impl Fn(S::F32, S::F32) -> S::F32) {
        let Extremes { tile, image, stride, first, terms, .. } = self;
        let image = image.as_ptr();
        for (row, line) in tile.chunks_exact_mut(TILE_WIDTH).enumerate() {
            for (block, held) in line.chunks_exact_mut(HELD * S::LANES).enumerate() {
                let at = first + row * stride + block * HELD * S::LANES;
                let mut extreme = [S::F32::splat(s, 0.0); HELD];
                for k in 0..HELD {
                    extreme[k] = S::F32::load(s, &held[k * S::LANES..]);
                }
                for &(offset, added) in terms {
                    let added = S::F32::splat(s, added);
                    for k in 0..HELD {
                        // SAFETY: with every term, all of the tile is within the image (`extremes` asserts it).
                        let there = unsafe {
                            S::F32::load_ptr(s, image.add(at + k * S::LANES).offset(offset))
                        };
                        extreme[k] = of(extreme[k], there + added);
                    }
                }
                for k in 0..HELD {
                    extreme[k].store(&mut held[k * S::LANES..]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_are_those_of_plain_loops_at_every_instruction_set() {
        let (stride, rows) = (160, 40);
        let value = |i: usize| ((i * 7919) % 1013) as f32 * 0.37 - 100.0;
        let image: Vec<f32> = (0..stride * rows).map(value).collect();
        let first = 12 * stride + 48;
        let terms: Vec<Term> = (0..37)
            .map(|k: isize| ((k % 7 - 3) * stride as isize + k - 18, k as f32 * 0.61 - 9.0))
            .collect();
        for (extreme, start) in [(Extreme::Greatest, -1e30), (Extreme::Least, 1e30)] {
            let mut expected: [f32; TILE] = [start; TILE];
            for (p, out) in expected.iter_mut().enumerate() {
                let at = first + p / TILE_WIDTH * stride + p % TILE_WIDTH;
                for &(offset, added) in &terms {
                    let sum = image[at.checked_add_signed(offset).unwrap()] + added;
                    *out = if extreme == Extreme::Greatest { out.max(sum) } else { out.min(sum) };
                }
            }
            for &isa in Isa::available() {
                let mut tile = [start; TILE];
                extremes(isa, extreme, &mut tile, (&image, stride), first, &terms);
                assert_eq!(tile.map(f32::to_bits), expected.map(f32::to_bits), "{isa}");
            }
        }
    }

    #[test]
    fn extremes_of_pairs_are_those_of_plain_loops_at_every_instruction_set() {
        let a: Vec<f32> = (0..77).map(|i| ((i * 7919) % 1013) as f32 - 500.0).collect();
        let b: Vec<f32> = (0..77).map(|i| ((i * 104_729) % 1009) as f32 - 500.0).collect();
        for n in [0, 1, 7, 16, 33, 77] {
            for &isa in Isa::available() {
                let mut out = vec![0.0; n];
                extreme_of_pairs(isa, Extreme::Greatest, &mut out, [&a[..n], &b[..n]]);
                assert!((0..n).all(|i| out[i] == a[i].max(b[i])), "{isa}");
                extreme_of_pairs(isa, Extreme::Least, &mut out, [&a[..n], &b[..n]]);
                assert!((0..n).all(|i| out[i] == a[i].min(b[i])), "{isa}");
            }
        }
    }

    #[test]
    fn extremes_of_tiles_and_lines_are_those_of_plain_loops_at_every_instruction_set() {
        let tile: [f32; TILE] = std::array::from_fn(|i| ((i * 7919) % 1013) as f32 - 400.0);
        for &isa in Isa::available() {
            let found =
                [Extreme::Greatest, Extreme::Least].map(|of| extreme_of_tile(isa, of, &tile));
            let greatest = tile.iter().copied().fold(f32::MIN, f32::max);
            assert_eq!(found, [greatest, tile.iter().copied().fold(f32::MAX, f32::min)], "{isa}");
            for n in [0, 1, 7, 16, 33, 77] {
                let (mut line, plain) = (tile[..n].to_vec(), |k: usize| 3.0 - 7.3 * k as f32);
                raise_line(isa, &mut line, [3.0, -7.3], [-350.0, 1.0]);
                for (k, found) in line.iter().enumerate() {
                    assert_eq!(*found, tile[k].max(plain(k).clamp(-350.0, 1.0)), "{isa} {n} {k}");
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "beyond the image")]
    fn a_term_beyond_the_image_is_refused() {
        let image = [0.0; TILE];
        let mut tile = [0.0; TILE];
        extremes(
            Isa::fastest(),
            Extreme::Least,
            &mut tile,
            (&image, TILE_WIDTH),
            0,
            &[(0, 0.0), (1, 0.0)],
        );
    }
}
