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
mod tests {
    use super::*;
    use crate::simd::{Isa, Kernel};

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
    fn every_isa_gives_the_same_lanes() {
        for n in 0..=67 {
            let (a, b) = (numbers(n, 1), numbers(n, 40));
            let expected = Isa::available()[0].run(Operations(&a, &b));
            let fused = a.iter().zip(&b).map(|(a, b)| a.mul_add(*b, 0.1));
            assert!(expected[3].iter().copied().eq(fused), "fused multiply-add of {n}");
            for isa in Isa::available() {
                assert_eq!(isa.run(Operations(&a, &b)), expected, "{} of {n}", isa.name());
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
        for isa in Isa::available() {
            let (n, columns) = isa.run(Transpose(&square));
            let expected = (0..n * n).map(|i| square[i % n * n + i / n]);
            assert!(columns.iter().copied().eq(expected), "{}", isa.name());
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
        for isa in Isa::available() {
            assert!(isa.run(Widen(&x)).into_iter().eq(x.iter().map(|&x| f64::from(x))));
        }
    }

    /// Every operation on masks and whole numbers, over two lists; the results one after another.
    struct MasksAndWholes<'a>(&'a [f32], &'a [f32]);

    impl Kernel for MasksAndWholes<'_> {
        /// Bits of masks, whole numbers lane by lane, and reductions of each vector (numbers, wholes).
        type Output = (Vec<Vec<bool>>, Vec<Vec<u32>>, [Vec<f32>; 2], [Vec<u32>; 3]);

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Self::Output {
            let lanes = S::LANES;
            let (mut masks, mut wholes) = (vec![vec![]; 6], vec![vec![]; 9]);
            let (mut numbers, mut reduced) = ([vec![], vec![]], [vec![], vec![], vec![]]);
            for (a, b) in self.0.chunks_exact(lanes).zip(self.1.chunks_exact(lanes)) {
                let (a, b) = (S::F32::load(s, a), S::F32::load(s, b));
                let hundred = S::F32::splat(s, 100.5);
                let (m, n) = ((a + hundred).truncate(), (b + hundred).truncate());
                let (gt, le) = (a.gt(b), a.le(S::F32::splat(s, 0.0)));
                let odd = S::F32::mask_from_bits(s, 0xaaaa_aaaa);
                for (to, mask) in
                    masks.iter_mut().zip([gt, le, gt.and(le), gt.or(le), m.ge(n), odd])
                {
                    assert_eq!(u64::from(mask.bits()) >> lanes, 0, "bits beyond the lanes");
                    to.extend((0..lanes).map(|l| mask.bits() >> l & 1 == 1));
                }
                let big = S::U32::splat(s, 0x9000_0001);
                let all = [
                    m.add(big),
                    m.sub(n),
                    m.mul(big),
                    m.mul(big).shr(7),
                    m.and(n),
                    m.mul(big).min(n.mul(big)),
                    m.mul(big).max(n.mul(big)),
                    m.select(gt, n),
                    m.count(gt),
                ];
                for (to, whole) in wholes.iter_mut().zip(all) {
                    let mut stored = [0; MAX_LANES];
                    whole.store(&mut stored);
                    to.extend(&stored[..lanes]);
                    assert_eq!(
                        whole.reduce_add(),
                        stored.iter().copied().fold(0, u32::wrapping_add)
                    );
                }
                let same = S::U32::load(s, &[7; MAX_LANES]);
                reduced[0].push(same.reduce_add() / lanes as u32);
                reduced[1].push(m.mul(big).reduce_min());
                reduced[2].push(m.mul(big).reduce_max());
                numbers[0].push(a.reduce_min());
                numbers[1].push(a.reduce_max());
            }
            (masks, wholes, numbers, reduced)
        }
    }

    #[test]
    fn masks_and_whole_numbers_are_those_of_plain_loops() {
        let (a, b) = (numbers(64, 2), numbers(64, 30));
        let (m, n): (Vec<u32>, Vec<u32>) =
            a.iter().zip(&b).map(|(a, b)| ((a + 100.5) as u32, (b + 100.5) as u32)).unzip();
        let big = 0x9000_0001u32;
        for isa in Isa::available() {
            let (masks, wholes, floats, reduced) = isa.run(MasksAndWholes(&a, &b));
            for i in 0..64 {
                let (gt, le) = (a[i] > b[i], a[i] <= 0.0);
                let found: Vec<bool> = masks.iter().map(|mask| mask[i]).collect();
                assert_eq!(found, [gt, le, gt && le, gt || le, m[i] >= n[i], i % 2 == 1]);
                let (up, other) = (m[i].wrapping_mul(big), n[i].wrapping_mul(big));
                let expected = [
                    m[i].wrapping_add(big),
                    m[i].wrapping_sub(n[i]),
                    up,
                    up >> 7,
                    m[i] & n[i],
                    up.min(other),
                    up.max(other),
                    if gt { m[i] } else { n[i] },
                    m[i] + u32::from(gt),
                ];
                let found: Vec<u32> = wholes.iter().map(|whole| whole[i]).collect();
                assert_eq!(found, expected, "{}", isa.name());
            }
            let lanes = 64 / floats[0].len();
            for (v, lanes_of_a) in a.chunks(lanes).enumerate() {
                assert_eq!(floats[0][v], lanes_of_a.iter().copied().fold(f32::MAX, f32::min));
                assert_eq!(floats[1][v], lanes_of_a.iter().copied().fold(f32::MIN, f32::max));
                let ups = wholes[2][v * lanes..][..lanes].iter().copied();
                assert_eq!(reduced[0][v], 7);
                assert_eq!(Some(reduced[1][v]), ups.clone().min());
                assert_eq!(Some(reduced[2][v]), ups.max());
            }
        }
    }

    struct Compress<'a>(&'a [f32; MAX_LANES], u32);

    impl Kernel for Compress<'_> {
        /// Lanes, and what was kept of them.
        type Output = (usize, Vec<f32>);

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Self::Output {
            let mut out = [0.0; MAX_LANES];
            S::F32::load(s, self.0).compress(self.1).store(&mut out);
            (S::LANES, out.to_vec())
        }
    }

    #[test]
    fn compress_brings_the_named_lanes_to_the_front() {
        let lanes: [f32; MAX_LANES] = std::array::from_fn(|l| l as f32 + 1.0);
        for isa in Isa::available() {
            for bits in 0..1 << MAX_LANES {
                let (n, out) = isa.run(Compress(&lanes, bits));
                let named = (0..n).filter(|l| bits >> l & 1 == 1).map(|l| lanes[l]);
                let count = named.clone().count();
                assert!(out[..count].iter().copied().eq(named), "{} {bits:b}", isa.name());
            }
        }
    }

    struct Rasters<'a>(&'a [u16], &'a [u16]);

    impl Kernel for Rasters<'_> {
        /// The greater of each pair, and per vector whether one of the first is not below that of the second.
        type Output = (Vec<u16>, Vec<bool>);

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Self::Output {
            let lanes = S::U16::LANES;
            assert_eq!(lanes, 2 * S::LANES);
            let (mut greater, mut any) = (vec![0; self.0.len()], vec![]);
            let pairs = self.0.chunks_exact(lanes).zip(self.1.chunks_exact(lanes));
            for ((a, b), to) in pairs.zip(greater.chunks_exact_mut(lanes)) {
                let (a, b) = (S::U16::load(s, a), S::U16::load(s, b));
                a.max(b).store(to);
                any.push(a.any_ge(b));
                assert!(S::U16::splat(s, 9).any_ge(S::U16::splat(s, 9)));
            }
            (greater, any)
        }
    }

    #[test]
    fn rasters_are_compared_as_unsigned_numbers() {
        let a: Vec<u16> = (0..6400u32).map(|i| ((i * 40_503) >> 3) as u16 / 2).collect();
        let b: Vec<u16> = (0..6400u32).map(|i| 60_000 - (i % 64 * 700) as u16).collect();
        for isa in Isa::available() {
            let (greater, any) = isa.run(Rasters(&a, &b));
            assert!(greater.iter().copied().eq(a.iter().zip(&b).map(|(a, b)| *a.max(b))));
            let lanes = a.len() / any.len();
            let pairs = a.chunks(lanes).zip(b.chunks(lanes));
            let expected: Vec<bool> =
                pairs.map(|(a, b)| a.iter().zip(b).any(|(a, b)| a >= b)).collect();
            assert_eq!(any, expected, "{}", isa.name());
            assert!(any.contains(&true) && any.contains(&false));
        }
    }
}
