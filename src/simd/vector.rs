//! Vectors of one level of the processor: the operations that kernels are written in.
//!
//! A kernel names the level's types, never a width: [`Vector::LANES`] is 4, 8 or 16 for `f32`. Lane by lane
//! each operation is the scalar operation of the same name, rounded once; nothing is reassociated. A value of
//! a vector type is made from a [`Simd`] token only, so holding one proves that the processor has its
//! instructions.
//!
//! | level | `F32` | `F64` | masks |
//! |---|---|---|---|
//! | portable, NEON | `[f32; 4]` | `[f64; 2]` | one `bool` per lane |
//! | AVX2 | `__m256` | `__m256d` | `__m256` |
//! | AVX-512 | `__m512` | `__m512d` | `__mmask16` |

mod arrays;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

use super::level::Simd;
pub use arrays::Lanes;
#[cfg(target_arch = "x86_64")]
pub use avx2::{F32x8, F64x4};
#[cfg(target_arch = "x86_64")]
pub use avx512::{F32x16, F64x8};
use std::ops::{Add, Mul, Sub};

/// Most lanes of an `f32` vector of any level.
pub const MAX_LANES: usize = 16;

/// Lanes of numbers in one register.
pub trait Vector: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// The level's token.
    type Isa: Simd;
    /// What a lane holds.
    type Element: Copy + Default;
    /// The outcome of a comparison, lane by lane.
    type Mask: Copy;
    /// Number of lanes.
    const LANES: usize;

    /// All lanes `x`.
    fn splat(isa: Self::Isa, x: Self::Element) -> Self;

    /// The numbers from `from` on.
    ///
    /// # Safety
    /// `from` is valid for reading [`Vector::LANES`] numbers.
    unsafe fn load_ptr(isa: Self::Isa, from: *const Self::Element) -> Self;

    /// Writes all lanes from `to` on.
    ///
    /// # Safety
    /// `to` is valid for writing [`Vector::LANES`] numbers.
    unsafe fn store_ptr(self, to: *mut Self::Element);

    /// The first `n` numbers from `from` on, zeros in the other lanes.
    ///
    /// # Safety
    /// `n ≤ LANES`, and `from` is valid for reading `n` numbers.
    unsafe fn load_partial_ptr(isa: Self::Isa, from: *const Self::Element, n: usize) -> Self;

    /// Writes the first `n` lanes from `to` on.
    ///
    /// # Safety
    /// `n ≤ LANES`, and `to` is valid for writing `n` numbers.
    unsafe fn store_partial_ptr(self, to: *mut Self::Element, n: usize);

    /// `self · b + c`, rounded once.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// The lesser of each pair; `other` if one is NaN, either zero when both are zeros.
    fn min(self, other: Self) -> Self;
    /// The greater of each pair; `other` if one is NaN, either zero when both are zeros.
    fn max(self, other: Self) -> Self;
    /// Where `self > other`; false for NaN.
    fn gt(self, other: Self) -> Self::Mask;
    /// `self` where `mask` holds, else `other`.
    fn select(self, mask: Self::Mask, other: Self) -> Self;

    /// The first numbers of a slice.
    ///
    /// # Panics
    /// If it has fewer than [`Vector::LANES`].
    #[inline(always)]
    fn load(isa: Self::Isa, from: &[Self::Element]) -> Self {
        assert!(from.len() >= Self::LANES);
        // SAFETY: the slice has that many numbers.
        unsafe { Self::load_ptr(isa, from.as_ptr()) }
    }

    /// Writes all lanes to the front of a slice.
    ///
    /// # Panics
    /// If it has fewer places than [`Vector::LANES`].
    #[inline(always)]
    fn store(self, to: &mut [Self::Element]) {
        assert!(to.len() >= Self::LANES);
        // SAFETY: the slice has that many places.
        unsafe { self.store_ptr(to.as_mut_ptr()) }
    }

    /// As many numbers of a slice as it has and the vector holds, zeros in the other lanes.
    #[inline(always)]
    fn load_partial(isa: Self::Isa, from: &[Self::Element]) -> Self {
        // SAFETY: the slice has that many numbers.
        unsafe { Self::load_partial_ptr(isa, from.as_ptr(), from.len().min(Self::LANES)) }
    }

    /// Writes as many lanes as there are places in the slice.
    #[inline(always)]
    fn store_partial(self, to: &mut [Self::Element]) {
        // SAFETY: the slice has that many places.
        unsafe { self.store_partial_ptr(to.as_mut_ptr(), to.len().min(Self::LANES)) }
    }
}

/// `f32` vectors: what they have beyond [`Vector`].
pub trait Float32: Vector<Element = f32> {
    /// The rows of a square of [`Vector::LANES`] rows become its columns.
    ///
    /// # Panics
    /// If there are not that many rows.
    fn transpose(rows: &mut [Self]);

    /// The lower and the upper half of the lanes, exactly.
    fn widen(self) -> [<Self::Isa as Simd>::F64; 2];
}

/// `f64` vectors, half as many lanes as `f32` has: sums of `f32`.
pub trait Float64: Vector<Element = f64> {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Kernel, Level};

    fn numbers(n: usize, seed: usize) -> Vec<f32> {
        (0..n).map(|i| (((i + seed) * 7919 + 13) % 97) as f32 * 0.37 - 17.0).collect()
    }

    /// Every operation, `LANES` numbers at a time, over two lists; the results one after another.
    struct Operations<'a>(&'a [f32], &'a [f32]);

    impl Kernel for Operations<'_> {
        type Output = Vec<Vec<f32>>;

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Self::Output {
            let lanes = S::F32::LANES;
            let mut out = vec![vec![0.0; self.0.len()]; 9];
            for (i, (a, b)) in self.0.chunks(lanes).zip(self.1.chunks(lanes)).enumerate() {
                let (a, b) = (S::F32::load_partial(s, a), S::F32::load_partial(s, b));
                let all = [
                    a + b,
                    a - b,
                    a * b,
                    a.mul_add(b, S::F32::splat(s, 0.1)),
                    a.min(b),
                    a.max(b),
                    a.select(a.gt(b), S::F32::splat(s, 7.0)),
                    a,
                    S::F32::splat(s, 3.25),
                ];
                for (v, out) in all.into_iter().zip(&mut out) {
                    let end = out.len().min((i + 1) * lanes);
                    v.store_partial(&mut out[i * lanes..end]);
                }
            }
            out
        }
    }

    #[test]
    fn every_level_gives_the_same_lanes() {
        for n in [0, 1, 3, 4, 5, 8, 15, 16, 17, 64, 67] {
            let (a, b) = (numbers(n, 1), numbers(n, 40));
            let expected = Level::available()[0].run(Operations(&a, &b));
            let fused = a.iter().zip(&b).map(|(a, b)| a.mul_add(*b, 0.1));
            assert!(expected[3].iter().copied().eq(fused), "fused multiply-add of {n}");
            for level in Level::available() {
                assert_eq!(level.run(Operations(&a, &b)), expected, "{} of {n}", level.name());
            }
        }
    }

    struct Transpose<'a>(&'a [f32]);

    impl Kernel for Transpose<'_> {
        /// Lanes and the transposed square.
        type Output = (usize, Vec<f32>);

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Self::Output {
            let lanes = S::F32::LANES;
            let mut rows = [S::F32::splat(s, 0.0); MAX_LANES];
            for (row, from) in rows.iter_mut().zip(self.0.chunks_exact(lanes)).take(lanes) {
                *row = S::F32::load(s, from);
            }
            S::F32::transpose(&mut rows[..lanes]);
            let mut out = vec![0.0; lanes * lanes];
            for (row, to) in rows.iter().zip(out.chunks_exact_mut(lanes)) {
                row.store(to);
            }
            (lanes, out)
        }
    }

    #[test]
    fn rows_become_columns() {
        let square = numbers(256, 5);
        for level in Level::available() {
            let (n, columns) = level.run(Transpose(&square));
            let expected = (0..n * n).map(|i| square[i % n * n + i / n]);
            assert!(columns.iter().copied().eq(expected), "{}", level.name());
        }
    }

    struct Widen<'a>(&'a [f32]);

    impl Kernel for Widen<'_> {
        type Output = Vec<f64>;

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Vec<f64> {
            let mut out = vec![0.0; self.0.len()];
            let lanes = S::F32::LANES;
            for (from, to) in self.0.chunks_exact(lanes).zip(out.chunks_exact_mut(lanes)) {
                let [low, high] = S::F32::load(s, from).widen();
                low.store(to);
                high.store(&mut to[lanes / 2..]);
            }
            out
        }
    }

    #[test]
    fn widening_is_exact() {
        let x = numbers(64, 3);
        for level in Level::available() {
            assert!(level.run(Widen(&x)).into_iter().eq(x.iter().map(|&x| f64::from(x))));
        }
    }
}
