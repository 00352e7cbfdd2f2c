//! Vectors as arrays: the portable level, and NEON, which belongs to the baseline of 64-bit ARM.

use super::{Float32, Float64, Vector};
use crate::simd::level;
use std::marker::PhantomData;
use std::ops::{Add, Mul, Sub};

/// `N` numbers of the level `I`.
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
    ($t:ty, $n:literal, $isa:ty, $mul_add:expr) => {
        impl Vector for Lanes<$t, $n, $isa> {
            type Isa = $isa;
            type Element = $t;
            type Mask = [bool; $n];
            const LANES: usize = $n;

            #[inline(always)]
            fn splat(_: $isa, x: $t) -> Self {
                Lanes([x; $n], PhantomData)
            }
            #[inline(always)]
            unsafe fn load_ptr(_: $isa, from: *const $t) -> Self {
                // SAFETY: the caller's promise; arrays of numbers may lie anywhere.
                Lanes(unsafe { from.cast::<[$t; $n]>().read_unaligned() }, PhantomData)
            }
            #[inline(always)]
            unsafe fn store_ptr(self, to: *mut $t) {
                // SAFETY: the caller's promise.
                unsafe { to.cast::<[$t; $n]>().write_unaligned(self.0) }
            }
            #[inline(always)]
            unsafe fn load_partial_ptr(_: $isa, from: *const $t, n: usize) -> Self {
                // SAFETY: lanes below `n` are the caller's promise, others are not read.
                Self::from_fn(|l| if l < n { unsafe { *from.add(l) } } else { 0.0 })
            }
            #[inline(always)]
            unsafe fn store_partial_ptr(self, to: *mut $t, n: usize) {
                for (l, x) in self.0.into_iter().enumerate().take(n) {
                    // SAFETY: `l < n`, the caller's promise.
                    unsafe { *to.add(l) = x };
                }
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Self::from_fn(|l| $mul_add(self.0[l], b.0[l], c.0[l]))
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
            fn gt(self, other: Self) -> [bool; $n] {
                std::array::from_fn(|l| self.0[l] > other.0[l])
            }
            #[inline(always)]
            fn select(self, mask: [bool; $n], other: Self) -> Self {
                Self::from_fn(|l| if mask[l] { self.0[l] } else { other.0[l] })
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

array_vector!(f32, 4, level::Portable, crate::simd::fma::mul_add);
array_vector!(f64, 2, level::Portable, f64::mul_add);
#[cfg(target_arch = "aarch64")]
array_vector!(f32, 4, level::Neon, f32::mul_add);
#[cfg(target_arch = "aarch64")]
array_vector!(f64, 2, level::Neon, f64::mul_add);

macro_rules! float {
    ($isa:ty) => {
        impl Float32 for Lanes<f32, 4, $isa> {
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
    };
}

float!(level::Portable);
#[cfg(target_arch = "aarch64")]
float!(level::Neon);
