//! Vectors of 256 bits: AVX2 with FMA.

use super::{Float32, Float64, Mask, Simd, Unsigned, Unsigned16, Unsigned32, Vector};
use crate::simd::token::Avx2;
use std::arch::x86_64::*;
use std::ops::{Add, Mul, Sub};

/// Eight `f32`.
#[derive(Debug, Clone, Copy)]
pub struct F32x8(pub(in crate::simd) __m256);

/// Four `f64`.
#[derive(Debug, Clone, Copy)]
pub struct F64x4(__m256d);

/// Eight `u32`.
#[derive(Debug, Clone, Copy)]
pub struct U32x8(__m256i);

/// Sixteen `u16`.
#[derive(Debug, Clone, Copy)]
pub struct U16x16(__m256i);

/// Lane numbers that bring the lanes of a mask to the front.
static TO_FRONT: [[u32; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut n) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                table[mask][n] = lane as u32;
                n += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

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
                // SAFETY: the operands were made from a token: the processor has the instruction set's features.
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
            type Token = Avx2;
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
                // SAFETY: `self` was made from a token; `n ≤ LANES`, so the table has LANES entries from there on, and
                // lanes from `n` on are not written.
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

impl Mask for __m256 {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        // SAFETY: masks are made by comparisons of vectors, which were made from a token.
        unsafe { _mm256_and_ps(self, other) }
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        // SAFETY: the operands were made from a token.
        unsafe { _mm256_or_ps(self, other) }
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: the operands were made from a token.
        unsafe { _mm256_movemask_ps(self) as u32 }
    }
}

/// Folds the lanes of a vector: halves, then pairs, then single lanes.
macro_rules! reduce {
    ($pick:ident, $v:expr) => {{
        let four = $pick(_mm256_castps256_ps128($v), _mm256_extractf128_ps::<1>($v));
        let two = $pick(four, _mm_movehl_ps(four, four));
        _mm_cvtss_f32($pick(two, _mm_shuffle_ps::<1>(two, two)))
    }};
}

macro_rules! reduce_u32 {
    ($pick:ident, $v:expr) => {{
        let v: __m256i = $v;
        let four = $pick(_mm256_castsi256_si128(v), _mm256_extracti128_si256::<1>(v));
        let two = $pick(four, _mm_shuffle_epi32::<0b1110>(four));
        _mm_cvtsi128_si32($pick(two, _mm_shuffle_epi32::<1>(two))) as u32
    }};
}

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
    fn le(self, other: Self) -> __m256 {
        // SAFETY: the operands were made from a token.
        unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn mask_from_bits(_: Avx2, bits: u32) -> __m256 {
        // SAFETY: the token proves AVX2.
        unsafe {
            let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let named = _mm256_and_si256(_mm256_set1_epi32(bits as i32), lanes);
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(named, lanes))
        }
    }

    #[inline(always)]
    fn compress(self, bits: u32) -> Self {
        let order: *const [u32; 8] = &TO_FRONT[(bits & 255) as usize];
        // SAFETY: the operand was made from a token; the pointer comes from a reference to eight numbers.
        unsafe { Self(_mm256_permutevar8x32_ps(self.0, _mm256_loadu_si256(order.cast()))) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the operand was made from a token.
        unsafe { Self(_mm256_sqrt_ps(self.0)) }
    }

    #[inline(always)]
    fn truncate(self) -> U32x8 {
        // SAFETY: the operand was made from a token.
        unsafe { U32x8(_mm256_cvttps_epi32(self.0)) }
    }

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        // SAFETY: the operand was made from a token.
        unsafe { reduce!(_mm_min_ps, self.0) }
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        // SAFETY: the operand was made from a token.
        unsafe { reduce!(_mm_max_ps, self.0) }
    }

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

macro_rules! unsigned {
    (
        $vector:ident, $isa:ty, $element:ty, $lanes:literal,
        $splat:ident as $cast:ty, $load:ident, $store:ident, $max:ident
    ) => {
        impl Unsigned for $vector {
            type Token = $isa;
            type Element = $element;
            const LANES: usize = $lanes;

            #[inline(always)]
            fn splat(_: $isa, x: $element) -> Self {
                // SAFETY: the token proves the instruction set's features.
                unsafe { Self($splat(x as $cast)) }
            }
            #[inline(always)]
            unsafe fn load_ptr(_: $isa, from: *const $element) -> Self {
                // SAFETY: the token proves the instruction set's features; the caller promises the numbers.
                unsafe { Self($load(from.cast())) }
            }
            #[inline(always)]
            unsafe fn store_ptr(self, to: *mut $element) {
                // SAFETY: `self` was made from a token; the caller promises the places.
                unsafe { $store(to.cast(), self.0) }
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // SAFETY: the operands were made from a token.
                unsafe { Self($max(self.0, other.0)) }
            }
        }
    };
}
pub(super) use unsigned;

macro_rules! unsigned32 {
    (
        $vector:ident, $mask:ty,
        $add:ident, $sub:ident, $mul:ident, $shr:ident, $and:ident, $min:ident,
        $ge:expr, $select:expr, $count:expr, $sum:expr, $reduce_min:expr, $reduce_max:expr
    ) => {
        impl Unsigned32 for $vector {
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                // SAFETY: the operands were made from a token.
                unsafe { Self($add(self.0, other.0)) }
            }
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                // SAFETY: the operands were made from a token.
                unsafe { Self($sub(self.0, other.0)) }
            }
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                // SAFETY: the operands were made from a token.
                unsafe { Self($mul(self.0, other.0)) }
            }
            #[inline(always)]
            fn shr(self, bits: u32) -> Self {
                // SAFETY: the operand was made from a token.
                unsafe { Self($shr(self.0, _mm_cvtsi32_si128((bits & 31) as i32))) }
            }
            #[inline(always)]
            fn and(self, other: Self) -> Self {
                // SAFETY: the operands were made from a token.
                unsafe { Self($and(self.0, other.0)) }
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                // SAFETY: the operands were made from a token.
                unsafe { Self($min(self.0, other.0)) }
            }
            #[inline(always)]
            fn ge(self, other: Self) -> $mask {
                // SAFETY: the operands were made from a token.
                unsafe { $ge(self.0, other.0) }
            }
            #[inline(always)]
            fn select(self, mask: $mask, other: Self) -> Self {
                // SAFETY: the operands were made from a token.
                unsafe { Self($select(self.0, mask, other.0)) }
            }
            #[inline(always)]
            fn count(self, mask: $mask) -> Self {
                // SAFETY: the operand was made from a token.
                unsafe { Self($count(self.0, mask)) }
            }
            #[inline(always)]
            fn reduce_add(self) -> u32 {
                // SAFETY: the operand was made from a token.
                unsafe { $sum(self.0) }
            }
            #[inline(always)]
            fn reduce_min(self) -> u32 {
                // SAFETY: the operand was made from a token.
                unsafe { $reduce_min(self.0) }
            }
            #[inline(always)]
            fn reduce_max(self) -> u32 {
                // SAFETY: the operand was made from a token.
                unsafe { $reduce_max(self.0) }
            }
        }
    };
}
pub(super) use unsigned32;

unsigned!(
    U32x8,
    Avx2,
    u32,
    8,
    _mm256_set1_epi32 as i32,
    _mm256_loadu_si256,
    _mm256_storeu_si256,
    _mm256_max_epu32
);
unsigned!(
    U16x16,
    Avx2,
    u16,
    16,
    _mm256_set1_epi16 as i16,
    _mm256_loadu_si256,
    _mm256_storeu_si256,
    _mm256_max_epu16
);
unsigned32!(
    U32x8,
    __m256,
    _mm256_add_epi32,
    _mm256_sub_epi32,
    _mm256_mullo_epi32,
    _mm256_srl_epi32,
    _mm256_and_si256,
    _mm256_min_epu32,
    |a, b| _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_max_epu32(a, b), a)),
    |a, mask, b| _mm256_blendv_epi8(b, a, _mm256_castps_si256(mask)),
    |a, mask| _mm256_sub_epi32(a, _mm256_castps_si256(mask)),
    |a| reduce_u32!(_mm_add_epi32, a),
    |a| reduce_u32!(_mm_min_epu32, a),
    |a| reduce_u32!(_mm_max_epu32, a)
);

impl Unsigned16 for U16x16 {
    #[inline(always)]
    fn any_ge(self, other: Self) -> bool {
        // SAFETY: the operands were made from a token.
        unsafe {
            let ge = _mm256_cmpeq_epi16(_mm256_max_epu16(self.0, other.0), self.0);
            _mm256_testz_si256(ge, ge) == 0
        }
    }
}

impl Simd for Avx2 {
    const LANES: usize = 8;
    const TILE_ROWS: usize = 6;
    type F32 = F32x8;
    type F64 = F64x4;
    type U32 = U32x8;
    type U16 = U16x16;
}
