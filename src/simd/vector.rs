//! The vector traits of an instruction set: the operations that kernels are written in.
//!
//! A kernel names the instruction set's types, never a width: [`Vector::LANES`] is 4, 8 or 16 for `f32`. Lane by lane
//! each operation is the scalar operation of the same name, rounded once; nothing is reassociated. A value of
//! a vector type is made from a [`Simd`] token only, so holding one proves that the processor has its
//! instructions.
//!
//! | instruction set | `F32` | `F64` | `U32` | `U16` | masks of `F32` and `U32` |
//! |---|---|---|---|---|---|
//! | portable, NEON | `[f32; 4]` | `[f64; 2]` | `[u32; 4]` | `[u16; 8]` | `[u32; 4]`, all bits of a lane or none |
//! | AVX2 | `__m256` | `__m256d` | `__m256i` | `__m256i` | `__m256` |
//! | AVX-512 | `__m512` | `__m512d` | `__m512i` | `__m512i` | `__mmask16` |

mod arrays;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

use std::ops::{Add, Mul, Sub};

/// Most lanes of an `f32` vector of any instruction set.
pub const MAX_LANES: usize = 16;

/// Vector types and constants of an instruction set, for kernel bodies.
pub trait Simd: Copy {
    /// Lanes of `f32` in a vector register.
    const LANES: usize;
    /// Rows of a register tile of products: with two vectors each they leave room for a row of the other
    /// operand, and their addresses fit the general registers.
    const TILE_ROWS: usize;
    /// `LANES` numbers.
    type F32: Float32<Token = Self>;
    /// Half as many.
    type F64: Float64<Token = Self>;
    /// `LANES` whole numbers.
    type U32: Unsigned32<Token = Self>;
    /// Twice as many.
    type U16: Unsigned16<Token = Self>;

    /// Asks for the cache line of a number that will be read soon.
    #[inline(always)]
    fn prefetch(self, x: &f32) {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: every 64-bit x86 processor has the instruction, and the reference is valid.
        unsafe {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(x).cast());
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = x;
    }
}

/// Lanes of numbers in one register.
pub trait Vector: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// The instruction set's token.
    type Token: Simd;
    /// What a lane holds.
    type Element: Copy + Default;
    /// The outcome of a comparison, lane by lane.
    type Mask: Copy;
    /// Number of lanes.
    const LANES: usize;

    /// All lanes `x`.
    fn splat(token: Self::Token, x: Self::Element) -> Self;

    /// The numbers from `from` on.
    ///
    /// # Safety
    /// `from` is valid for reading [`Vector::LANES`] numbers.
    unsafe fn load_ptr(token: Self::Token, from: *const Self::Element) -> Self;

    /// Writes all lanes from `to` on.
    ///
    /// # Safety
    /// `to` is valid for writing [`Vector::LANES`] numbers.
    unsafe fn store_ptr(self, to: *mut Self::Element);

    /// The first `n` numbers from `from` on, zeros in the other lanes.
    ///
    /// # Safety
    /// `n ≤ LANES`, and `from` is valid for reading `n` numbers.
    unsafe fn load_partial_ptr(token: Self::Token, from: *const Self::Element, n: usize) -> Self;

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
    fn load(token: Self::Token, from: &[Self::Element]) -> Self {
        assert!(from.len() >= Self::LANES);
        // SAFETY: the slice has as many numbers as are read (asserted, or by its length).
        unsafe { Self::load_ptr(token, from.as_ptr()) }
    }

    /// Writes all lanes to the front of a slice.
    ///
    /// # Panics
    /// If it has fewer places than [`Vector::LANES`].
    #[inline(always)]
    fn store(self, to: &mut [Self::Element]) {
        assert!(to.len() >= Self::LANES);
        // SAFETY: the slice has as many places as are written (asserted, or by its length), borrowed here alone.
        unsafe { self.store_ptr(to.as_mut_ptr()) }
    }

    /// As many numbers of a slice as it has and the vector holds, zeros in the other lanes.
    #[inline(always)]
    fn load_partial(token: Self::Token, from: &[Self::Element]) -> Self {
        // SAFETY: the slice has as many numbers as are read (asserted, or by its length).
        unsafe { Self::load_partial_ptr(token, from.as_ptr(), from.len().min(Self::LANES)) }
    }

    /// Writes as many lanes as there are places in the slice.
    #[inline(always)]
    fn store_partial(self, to: &mut [Self::Element]) {
        // SAFETY: the slice has as many places as are written (asserted, or by its length), borrowed here alone.
        unsafe { self.store_partial_ptr(to.as_mut_ptr(), to.len().min(Self::LANES)) }
    }
}

/// Lane by lane, whether something holds.
pub trait Mask: Copy {
    /// Where both hold.
    fn and(self, other: Self) -> Self;
    /// Where one of them holds.
    fn or(self, other: Self) -> Self;
    /// Bit `l` is set where it holds in lane `l`; bits beyond the lanes are 0.
    fn bits(self) -> u32;
}

/// `f32` vectors: what they have beyond [`Vector`].
pub trait Float32: Vector<Element = f32, Mask: Mask> {
    /// Where `self ≤ other`; false for NaN.
    fn le(self, other: Self) -> Self::Mask;

    /// The lanes whose bit is set; bits beyond the lanes are ignored.
    fn mask_from_bits(token: Self::Token, bits: u32) -> Self::Mask;

    /// The lanes whose bit is set, in order, moved to the front; the other lanes are unspecified.
    /// Bits beyond the lanes are 0.
    fn compress(self, bits: u32) -> Self;

    /// The square root of every lane, rounded to nearest; NaN of a negative one.
    fn sqrt(self) -> Self;

    /// Lanes from 0 to 2³¹, 2³¹ excluded, without their fractions; others become unspecified numbers.
    fn truncate(self) -> <Self::Token as Simd>::U32;

    /// The least lane; none is NaN; either zero when both are least.
    fn reduce_min(self) -> f32;

    /// The greatest lane; none is NaN; either zero when both are greatest.
    fn reduce_max(self) -> f32;

    /// The rows of a square of [`Vector::LANES`] rows become its columns.
    ///
    /// # Panics
    /// If there are not that many rows.
    fn transpose(rows: &mut [Self]);

    /// The lower and the upper half of the lanes, exactly.
    fn widen(self) -> [<Self::Token as Simd>::F64; 2];
}

/// `f64` vectors, half as many lanes as `f32` has: sums of `f32`.
pub trait Float64: Vector<Element = f64> {}

/// The mask of an instruction set's `f32` and `u32` vectors.
pub type MaskOf<S> = <<S as Simd>::F32 as Vector>::Mask;

/// Lanes of unsigned whole numbers.
pub trait Unsigned: Copy {
    /// The instruction set's token.
    type Token: Simd;
    /// What a lane holds.
    type Element: Copy + Default;
    /// Number of lanes.
    const LANES: usize;

    /// All lanes `x`.
    fn splat(token: Self::Token, x: Self::Element) -> Self;

    /// The numbers from `from` on.
    ///
    /// # Safety
    /// `from` is valid for reading [`Unsigned::LANES`] numbers.
    unsafe fn load_ptr(token: Self::Token, from: *const Self::Element) -> Self;

    /// Writes all lanes from `to` on.
    ///
    /// # Safety
    /// `to` is valid for writing [`Unsigned::LANES`] numbers.
    unsafe fn store_ptr(self, to: *mut Self::Element);

    /// The greater of each pair.
    fn max(self, other: Self) -> Self;

    /// The first numbers of a slice.
    ///
    /// # Panics
    /// If it has fewer than [`Unsigned::LANES`].
    #[inline(always)]
    fn load(token: Self::Token, from: &[Self::Element]) -> Self {
        assert!(from.len() >= Self::LANES);
        // SAFETY: the slice has as many numbers as are read (asserted, or by its length).
        unsafe { Self::load_ptr(token, from.as_ptr()) }
    }

    /// Writes all lanes to the front of a slice.
    ///
    /// # Panics
    /// If it has fewer places than [`Unsigned::LANES`].
    #[inline(always)]
    fn store(self, to: &mut [Self::Element]) {
        assert!(to.len() >= Self::LANES);
        // SAFETY: the slice has as many places as are written (asserted, or by its length), borrowed here alone.
        unsafe { self.store_ptr(to.as_mut_ptr()) }
    }
}

/// `u32` vectors, as many lanes as `f32` has: counters and indices.
pub trait Unsigned32: Unsigned<Element = u32> {
    /// `self + other`, modulo 2³².
    fn add(self, other: Self) -> Self;
    /// `self − other`, modulo 2³².
    fn sub(self, other: Self) -> Self;
    /// `self · other`, modulo 2³².
    fn mul(self, other: Self) -> Self;
    /// Shifted down by `bits`, below 32.
    fn shr(self, bits: u32) -> Self;
    /// The bits that both have.
    fn and(self, other: Self) -> Self;
    /// The lesser of each pair.
    fn min(self, other: Self) -> Self;
    /// Where `self ≥ other`.
    fn ge(self, other: Self) -> MaskOf<Self::Token>;
    /// `self` where `mask` holds, else `other`.
    fn select(self, mask: MaskOf<Self::Token>, other: Self) -> Self;
    /// Adds one where `mask` holds, modulo 2³².
    fn count(self, mask: MaskOf<Self::Token>) -> Self;
    /// Sum of the lanes, modulo 2³².
    fn reduce_add(self) -> u32;
    /// The least lane.
    fn reduce_min(self) -> u32;
    /// The greatest lane.
    fn reduce_max(self) -> u32;
}

/// `u16` vectors, twice as many lanes as `f32` has: rasters.
pub trait Unsigned16: Unsigned<Element = u16> {
    /// Whether `self ≥ other` in some lane.
    fn any_ge(self, other: Self) -> bool;
}

#[cfg(test)]
mod tests;
