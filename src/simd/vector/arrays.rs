//! Vectors as arrays: the portable instruction set, and NEON, which belongs to the baseline of 64-bit ARM.

use super::{Float32, Float64, Mask, Simd, Unsigned, Unsigned16, Unsigned32, Vector};
#[cfg(target_arch = "aarch64")]
use crate::simd::token::Neon;
use crate::simd::token::Portable;
use std::marker::PhantomData;
use std::ops::{Add, Mul, Sub};

/// `N` numbers of the instruction set `I`.
#[derive(Debug, Clone, Copy)]
pub struct Lanes<T, const N: usize, I>([T; N], PhantomData<I>);

impl<T: Copy, const N: usize, I> Lanes<T, N, I> {
    #[inline(always)]
    fn from_fn(lane: impl FnMut(usize) -> T) -> Self {
        Lanes(std::array::from_fn(lane), PhantomData)
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $t:ty) => {
        impl<const N: usize, I> $trait for Lanes<$t, N, I> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self::from_fn(|l| self.0[l].$method(other.0[l]))
            }
        }
    };
}

macro_rules! array_vector {
    ($t:ty, $bits:ty, $n:literal, $isa:ty, $mul_add:expr) => {
        impl Vector for Lanes<$t, $n, $isa> {
            type Token = $isa;
            type Element = $t;
            type Mask = [$bits; $n];
            const LANES: usize = $n;

            #[inline(always)]
            fn splat(_: $isa, x: $t) -> Self {
                Lanes([x; $n], PhantomData)
            }
            #[inline(always)]
            unsafe fn load_ptr(_: $isa, from: *const $t) -> Self {
                // SAFETY: LANES numbers may be read (the caller's promise), and `read_unaligned` takes any address.
                Lanes(unsafe { from.cast::<[$t; $n]>().read_unaligned() }, PhantomData)
            }
            #[inline(always)]
            unsafe fn store_ptr(self, to: *mut $t) {
                // SAFETY: LANES places may be written (the caller's promise), and `write_unaligned` takes any address.
                unsafe { to.cast::<[$t; $n]>().write_unaligned(self.0) }
            }
            #[inline(always)]
            unsafe fn load_partial_ptr(_: $isa, from: *const $t, n: usize) -> Self {
                // SAFETY: `l < n`, and `n` numbers may be read (the caller's promise); the address is that of a number.
                Self::from_fn(|l| if l < n { unsafe { *from.add(l) } } else { 0.0 })
            }
            #[inline(always)]
            unsafe fn store_partial_ptr(self, to: *mut $t, n: usize) {
                for (l, x) in self.0.into_iter().enumerate().take(n) {
                    // SAFETY: `l < n`, and `n` places may be written (the caller's promise); the address is that of a
                    // number.
                    unsafe { *to.add(l) = x };
                }
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Lanes($mul_add(self.0, b.0, c.0), PhantomData)
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self::from_fn(|l| if self.0[l] < other.0[l] { self.0[l] } else { other.0[l] })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self::from_fn(|l| if self.0[l] > other.0[l] { self.0[l] } else { other.0[l] })
            }
            #[inline(always)]
            fn gt(self, other: Self) -> [$bits; $n] {
                std::array::from_fn(|l| if self.0[l] > other.0[l] { !0 } else { 0 })
            }
            #[inline(always)]
            fn select(self, mask: [$bits; $n], other: Self) -> Self {
                Self::from_fn(|l| {
                    let (bits, other) = (self.0[l].to_bits(), other.0[l].to_bits());
                    <$t>::from_bits(bits & mask[l] | other & !mask[l])
                })
            }
        }
    };
}

operator!(Add, add, f32);
operator!(Sub, sub, f32);
operator!(Mul, mul, f32);
operator!(Add, add, f64);
operator!(Sub, sub, f64);
operator!(Mul, mul, f64);

/// `scalar` for each lane.
#[inline(always)]
fn lanes<T: Copy, const N: usize>(
    scalar: fn(T, T, T) -> T,
) -> impl Fn([T; N], [T; N], [T; N]) -> [T; N] {
    move |a, b, c| std::array::from_fn(|l| scalar(a[l], b[l], c[l]))
}

#[cfg(target_arch = "x86_64")]
array_vector!(f32, u32, 4, Portable, crate::simd::fma::mul_add4);
#[cfg(not(target_arch = "x86_64"))]
array_vector!(f32, u32, 4, Portable, lanes(crate::simd::fma::mul_add));
array_vector!(f64, u64, 2, Portable, lanes(f64::mul_add));
#[cfg(target_arch = "aarch64")]
array_vector!(f32, u32, 4, Neon, lanes(f32::mul_add));
#[cfg(target_arch = "aarch64")]
array_vector!(f64, u64, 2, Neon, lanes(f64::mul_add));

impl Mask for [u32; 4] {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        std::array::from_fn(|l| self[l] & other[l])
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        std::array::from_fn(|l| self[l] | other[l])
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        let [a, b, c, d] = self;
        a & 1 | b & 2 | c & 4 | d & 8
    }
}

macro_rules! unsigned {
    ($t:ty, $n:literal, $isa:ty) => {
        impl Unsigned for Lanes<$t, $n, $isa> {
            type Token = $isa;
            type Element = $t;
            const LANES: usize = $n;

            #[inline(always)]
            fn splat(_: $isa, x: $t) -> Self {
                Lanes([x; $n], PhantomData)
            }
            #[inline(always)]
            unsafe fn load_ptr(_: $isa, from: *const $t) -> Self {
                // SAFETY: LANES numbers may be read (the caller's promise), and `read_unaligned` takes any address.
                Lanes(unsafe { from.cast::<[$t; $n]>().read_unaligned() }, PhantomData)
            }
            #[inline(always)]
            unsafe fn store_ptr(self, to: *mut $t) {
                // SAFETY: LANES places may be written (the caller's promise), and `write_unaligned` takes any address.
                unsafe { to.cast::<[$t; $n]>().write_unaligned(self.0) }
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self::from_fn(|l| self.0[l].max(other.0[l]))
            }
        }
    };
}

macro_rules! isa_vectors {
    ($isa:ty) => {
        impl Float32 for Lanes<f32, 4, $isa> {
            #[inline(always)]
            fn le(self, other: Self) -> [u32; 4] {
                std::array::from_fn(|l| if self.0[l] <= other.0[l] { !0 } else { 0 })
            }
            #[inline(always)]
            fn mask_from_bits(_: $isa, bits: u32) -> [u32; 4] {
                std::array::from_fn(|l| if bits & 1 << l != 0 { !0 } else { 0 })
            }
            #[inline(always)]
            fn compress(self, bits: u32) -> Self {
                let mut packed = [0.0; 4];
                let mut n = 0;
                for (l, x) in self.0.into_iter().enumerate() {
                    packed[n & 3] = x;
                    n += (bits >> l & 1) as usize;
                }
                Lanes(packed, PhantomData)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self::from_fn(|l| self.0[l].sqrt())
            }
            #[inline(always)]
            fn truncate(self) -> Lanes<u32, 4, $isa> {
                // By way of `i32`, which every processor converts to in one instruction.
                Lanes::from_fn(|l| self.0[l] as i32 as u32)
            }
            #[inline(always)]
            fn reduce_min(self) -> f32 {
                let [a, b, c, d] = self.0;
                let lesser = |x: f32, y: f32| if x < y { x } else { y };
                lesser(lesser(a, b), lesser(c, d))
            }
            #[inline(always)]
            fn reduce_max(self) -> f32 {
                let [a, b, c, d] = self.0;
                let greater = |x: f32, y: f32| if x > y { x } else { y };
                greater(greater(a, b), greater(c, d))
            }
            #[inline(always)]
            fn transpose(rows: &mut [Self]) {
                let rows: &mut [Self; 4] = rows.try_into().expect("as many rows as lanes");
                let old = rows.map(|row| row.0);
                for (l, row) in rows.iter_mut().enumerate() {
                    *row = Self::from_fn(|r| old[r][l]);
                }
            }
            #[inline(always)]
            fn widen(self) -> [Lanes<f64, 2, $isa>; 2] {
                let half = |first: usize| Lanes::from_fn(|l| f64::from(self.0[first + l]));
                [half(0), half(2)]
            }
        }

        impl Float64 for Lanes<f64, 2, $isa> {}

        unsigned!(u32, 4, $isa);
        unsigned!(u16, 8, $isa);

        impl Unsigned32 for Lanes<u32, 4, $isa> {
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self::from_fn(|l| self.0[l].wrapping_add(other.0[l]))
            }
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self::from_fn(|l| self.0[l].wrapping_sub(other.0[l]))
            }
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                Self::from_fn(|l| self.0[l].wrapping_mul(other.0[l]))
            }
            #[inline(always)]
            fn shr(self, bits: u32) -> Self {
                Self::from_fn(|l| self.0[l] >> (bits & 31))
            }
            #[inline(always)]
            fn and(self, other: Self) -> Self {
                Self::from_fn(|l| self.0[l] & other.0[l])
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self::from_fn(|l| self.0[l].min(other.0[l]))
            }
            #[inline(always)]
            fn ge(self, other: Self) -> [u32; 4] {
                std::array::from_fn(|l| if self.0[l] >= other.0[l] { !0 } else { 0 })
            }
            #[inline(always)]
            fn select(self, mask: [u32; 4], other: Self) -> Self {
                Self::from_fn(|l| self.0[l] & mask[l] | other.0[l] & !mask[l])
            }
            #[inline(always)]
            fn count(self, mask: [u32; 4]) -> Self {
                // All bits set is −1.
                Self::from_fn(|l| self.0[l].wrapping_sub(mask[l]))
            }
            #[inline(always)]
            fn reduce_add(self) -> u32 {
                self.0.into_iter().fold(0, u32::wrapping_add)
            }
            #[inline(always)]
            fn reduce_min(self) -> u32 {
                self.0.into_iter().fold(u32::MAX, u32::min)
            }
            #[inline(always)]
            fn reduce_max(self) -> u32 {
                self.0.into_iter().fold(0, u32::max)
            }
        }

        impl Unsigned16 for Lanes<u16, 8, $isa> {
            #[inline(always)]
            fn any_ge(self, other: Self) -> bool {
                (0..8).fold(false, |any, l| any | (self.0[l] >= other.0[l]))
            }
        }
    };
}

isa_vectors!(Portable);
#[cfg(target_arch = "aarch64")]
isa_vectors!(Neon);

macro_rules! simd {
    ($isa:ty, $rows:literal) => {
        impl Simd for $isa {
            const LANES: usize = 4;
            const TILE_ROWS: usize = $rows;
            type F32 = Lanes<f32, 4, $isa>;
            type F64 = Lanes<f64, 2, $isa>;
            type U32 = Lanes<u32, 4, $isa>;
            type U16 = Lanes<u16, 8, $isa>;
        }
    };
}

simd!(Portable, 2);
#[cfg(target_arch = "aarch64")]
simd!(Neon, 8);
