//! Vectors of 256 bits.

use super::{Float32, Float64, Vector};
use crate::simd::level::Avx2;
use std::arch::x86_64::*;
use std::ops::{Add, Mul, Sub};

/// Eight `f32`.
#[derive(Debug, Clone, Copy)]
pub struct F32x8(pub(in crate::simd) __m256);

/// Four `f64`.
#[derive(Debug, Clone, Copy)]
pub struct F64x4(__m256d);

/// All bits of the first `n` of eight lanes from place `8 − n` on.
static FIRST_LANES: [i32; 16] = [-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0];
static FIRST_WIDE_LANES: [i64; 8] = [-1, -1, -1, -1, 0, 0, 0, 0];

macro_rules! operators {
    ($vector:ident, $add:ident, $sub:ident, $mul:ident) => {
        operators!(@ $vector, Add, add, $add);
        operators!(@ $vector, Sub, sub, $sub);
        operators!(@ $vector, Mul, mul, $mul);
    };
    (@ $vector:ident, $trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for $vector {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: the operands were made from a token: the processor has the level's features.
                unsafe { Self($intrinsic(self.0, other.0)) }
            }
        }
    };
}
pub(super) use operators;

operators!(F32x8, _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps);
operators!(F64x4, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd);

macro_rules! vector {
    (
        $vector:ident, $element:ty, $lanes:literal, $mask:ty, $table:ident,
        $splat:ident, $load:ident, $store:ident, $maskload:ident, $maskstore:ident,
        $fma:ident, $min:ident, $max:ident, $cmp:ident, $blend:ident
    ) => {
        impl Vector for $vector {
            type Isa = Avx2;
            type Element = $element;
            type Mask = $mask;
            const LANES: usize = $lanes;

            #[inline(always)]
            fn splat(_: Avx2, x: $element) -> Self {
                // SAFETY: the token proves AVX2 and FMA.
                unsafe { Self($splat(x)) }
            }
            #[inline(always)]
            unsafe fn load_ptr(_: Avx2, from: *const $element) -> Self {
                // SAFETY: the token proves AVX2; the caller promises the numbers.
                unsafe { Self($load(from)) }
            }
            #[inline(always)]
            unsafe fn store_ptr(self, to: *mut $element) {
                // SAFETY: `self` was made from a token; the caller promises the places.
                unsafe { $store(to, self.0) }
            }
            #[inline(always)]
            unsafe fn load_partial_ptr(_: Avx2, from: *const $element, n: usize) -> Self {
                // SAFETY: the token proves AVX2; `n ≤ LANES`, so the table has LANES entries from there on,
                // and lanes from `n` on are not read.
                unsafe {
                    let mask = _mm256_loadu_si256($table.as_ptr().add($lanes - n).cast());
                    Self($maskload(from, mask))
                }
            }
            #[inline(always)]
            unsafe fn store_partial_ptr(self, to: *mut $element, n: usize) {
                // SAFETY: as for loading.
                unsafe {
                    let mask = _mm256_loadu_si256($table.as_ptr().add($lanes - n).cast());
                    $maskstore(to, mask, self.0);
                }
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                // SAFETY: the operands were made from a token, which proves FMA.
                unsafe { Self($fma(self.0, b.0, c.0)) }
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                // SAFETY: the operands were made from a token.
                unsafe { Self($min(self.0, other.0)) }
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // SAFETY: the operands were made from a token.
                unsafe { Self($max(self.0, other.0)) }
            }
            #[inline(always)]
            fn gt(self, other: Self) -> $mask {
                // SAFETY: the operands were made from a token.
                unsafe { $cmp::<_CMP_GT_OQ>(self.0, other.0) }
            }
            #[inline(always)]
            fn select(self, mask: $mask, other: Self) -> Self {
                // SAFETY: the operands were made from a token.
                unsafe { Self($blend(other.0, self.0, mask)) }
            }
        }
    };
}

vector!(
    F32x8,
    f32,
    8,
    __m256,
    FIRST_LANES,
    _mm256_set1_ps,
    _mm256_loadu_ps,
    _mm256_storeu_ps,
    _mm256_maskload_ps,
    _mm256_maskstore_ps,
    _mm256_fmadd_ps,
    _mm256_min_ps,
    _mm256_max_ps,
    _mm256_cmp_ps,
    _mm256_blendv_ps
);
vector!(
    F64x4,
    f64,
    4,
    __m256d,
    FIRST_WIDE_LANES,
    _mm256_set1_pd,
    _mm256_loadu_pd,
    _mm256_storeu_pd,
    _mm256_maskload_pd,
    _mm256_maskstore_pd,
    _mm256_fmadd_pd,
    _mm256_min_pd,
    _mm256_max_pd,
    _mm256_cmp_pd,
    _mm256_blendv_pd
);

/// Four rows of eight: the first and the second half of each column stand in one vector.
macro_rules! columns_of_halves {
    ($a:expr, $b:expr, $c:expr, $d:expr) => {{
        let (ab, cd) = (_mm256_unpacklo_ps($a, $b), _mm256_unpacklo_ps($c, $d));
        let (ab_high, cd_high) = (_mm256_unpackhi_ps($a, $b), _mm256_unpackhi_ps($c, $d));
        [
            _mm256_shuffle_ps::<0x44>(ab, cd),
            _mm256_shuffle_ps::<0xEE>(ab, cd),
            _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
            _mm256_shuffle_ps::<0xEE>(ab_high, cd_high),
        ]
    }};
}

impl Float32 for F32x8 {
    #[inline(always)]
    fn transpose(rows: &mut [Self]) {
        let rows: &mut [Self; 8] = rows.try_into().expect("as many rows as lanes");
        let [a, b, c, d, e, f, g, h] = rows.map(|row| row.0);
        // SAFETY: the operands were made from a token.
        unsafe {
            let upper = columns_of_halves!(a, b, c, d);
            let lower = columns_of_halves!(e, f, g, h);
            for i in 0..4 {
                rows[i].0 = _mm256_permute2f128_ps::<0x20>(upper[i], lower[i]);
                rows[i + 4].0 = _mm256_permute2f128_ps::<0x31>(upper[i], lower[i]);
            }
        }
    }

    #[inline(always)]
    fn widen(self) -> [F64x4; 2] {
        // SAFETY: the operand was made from a token.
        unsafe {
            let (low, high) = (_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            [F64x4(_mm256_cvtps_pd(low)), F64x4(_mm256_cvtps_pd(high))]
        }
    }
}

impl Float64 for F64x4 {}
