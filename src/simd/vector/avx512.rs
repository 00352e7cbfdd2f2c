//! Vectors of 512 bits: AVX-512.

use super::avx2::{operators, unsigned, unsigned32};
use super::{Float32, Float64, Mask, Simd, Unsigned, Unsigned16, Unsigned32, Vector};
use crate::simd::token::Avx512;
use std::arch::x86_64::*;
use std::ops::{Add, Mul, Sub};

/// Sixteen `f32`.
#[derive(Debug, Clone, Copy)]
pub struct F32x16(pub(in crate::simd) __m512);

/// Eight `f64`.
#[derive(Debug, Clone, Copy)]
pub struct F64x8(__m512d);

/// Sixteen `u32`.
#[derive(Debug, Clone, Copy)]
pub struct U32x16(__m512i);

/// Thirty-two `u16`.
#[derive(Debug, Clone, Copy)]
pub struct U16x32(__m512i);

operators!(F32x16, _mm512_add_ps, _mm512_sub_ps, _mm512_mul_ps);
operators!(F64x8, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd);

macro_rules! vector {
    (
        $vector:ident, $element:ty, $lanes:literal, $mask:ty,
        $splat:ident, $load:ident, $store:ident, $maskload:ident, $maskstore:ident,
        $fma:ident, $min:ident, $max:ident, $cmp:ident, $blend:ident
    ) => {
        impl Vector for $vector {
            type Token = Avx512;
            type Element = $element;
            type Mask = $mask;
            const LANES: usize = $lanes;

            #[inline(always)]
            fn splat(_: Avx512, x: $element) -> Self {
                // SAFETY: the token proves AVX-512.
                unsafe { Self($splat(x)) }
            }
            #[inline(always)]
            unsafe fn load_ptr(_: Avx512, from: *const $element) -> Self {
                // SAFETY: the token proves AVX-512; the caller promises the numbers.
                unsafe { Self($load(from)) }
            }
            #[inline(always)]
            unsafe fn store_ptr(self, to: *mut $element) {
                // SAFETY: `self` was made from a token; the caller promises the places.
                unsafe { $store(to, self.0) }
            }
            #[inline(always)]
            unsafe fn load_partial_ptr(_: Avx512, from: *const $element, n: usize) -> Self {
                let mask = ((1u32 << n) - 1) as $mask;
                // SAFETY: the token proves AVX-512; lanes from `n` on are not read.
                unsafe { Self($maskload(mask, from)) }
            }
            #[inline(always)]
            unsafe fn store_partial_ptr(self, to: *mut $element, n: usize) {
                let mask = ((1u32 << n) - 1) as $mask;
                // SAFETY: `self` was made from a token; lanes from `n` on are not written.
                unsafe { $maskstore(to, mask, self.0) }
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                // SAFETY: the operands were made from a token.
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
                unsafe { Self($blend(mask, other.0, self.0)) }
            }
        }
    };
}

vector!(
    F32x16,
    f32,
    16,
    __mmask16,
    _mm512_set1_ps,
    _mm512_loadu_ps,
    _mm512_storeu_ps,
    _mm512_maskz_loadu_ps,
    _mm512_mask_storeu_ps,
    _mm512_fmadd_ps,
    _mm512_min_ps,
    _mm512_max_ps,
    _mm512_cmp_ps_mask,
    _mm512_mask_blend_ps
);
vector!(
    F64x8,
    f64,
    8,
    __mmask8,
    _mm512_set1_pd,
    _mm512_loadu_pd,
    _mm512_storeu_pd,
    _mm512_maskz_loadu_pd,
    _mm512_mask_storeu_pd,
    _mm512_fmadd_pd,
    _mm512_min_pd,
    _mm512_max_pd,
    _mm512_cmp_pd_mask,
    _mm512_mask_blend_pd
);

impl Mask for __mmask16 {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self & other
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self | other
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
}

impl Float32 for F32x16 {
    #[inline(always)]
    fn le(self, other: Self) -> __mmask16 {
        // SAFETY: the operands were made from a token.
        unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn mask_from_bits(_: Avx512, bits: u32) -> __mmask16 {
        bits as __mmask16
    }

    #[inline(always)]
    fn compress(self, bits: u32) -> Self {
        // SAFETY: the operand was made from a token.
        unsafe { Self(_mm512_maskz_compress_ps(bits as __mmask16, self.0)) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the operand was made from a token.
        unsafe { Self(_mm512_sqrt_ps(self.0)) }
    }

    #[inline(always)]
    fn truncate(self) -> U32x16 {
        // SAFETY: the operand was made from a token.
        unsafe { U32x16(_mm512_cvttps_epi32(self.0)) }
    }

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        // SAFETY: the operand was made from a token.
        unsafe { _mm512_reduce_min_ps(self.0) }
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        // SAFETY: the operand was made from a token.
        unsafe { _mm512_reduce_max_ps(self.0) }
    }

    /// Four rounds of exchanges between pairs of rows: neighbors, then rows 2, 4 and 8 apart.
    #[inline(always)]
    fn transpose(rows: &mut [Self]) {
        let rows: &mut [Self; 16] = rows.try_into().expect("as many rows as lanes");
        // SAFETY: the operands were made from a token.
        unsafe {
            let mut r = rows.map(|row| row.0);
            // Pairs of rows: a0 b0 a1 b1 | … within each quarter.
            for i in (0..16).step_by(2) {
                let (a, b) = (r[i], r[i + 1]);
                (r[i], r[i + 1]) = (_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
            }
            // Fours of rows: quarter q of r[4g + c] is column 4q + c of rows 4g..4g + 4.
            for g in (0..16).step_by(4) {
                let [a, b, c, d] = [0, 1, 2, 3].map(|i| _mm512_castps_pd(r[g + i]));
                r[g] = _mm512_castpd_ps(_mm512_unpacklo_pd(a, c));
                r[g + 1] = _mm512_castpd_ps(_mm512_unpackhi_pd(a, c));
                r[g + 2] = _mm512_castpd_ps(_mm512_unpacklo_pd(b, d));
                r[g + 3] = _mm512_castpd_ps(_mm512_unpackhi_pd(b, d));
            }
            // Quarters: a 4×4 transposition of quarters for each c.
            for c in 0..4 {
                let [a, b, e, f] = [0, 4, 8, 12].map(|g| r[g + c]);
                let (ab_even, ab_odd) =
                    (_mm512_shuffle_f32x4::<0x88>(a, b), _mm512_shuffle_f32x4::<0xDD>(a, b));
                let (ef_even, ef_odd) =
                    (_mm512_shuffle_f32x4::<0x88>(e, f), _mm512_shuffle_f32x4::<0xDD>(e, f));
                rows[c].0 = _mm512_shuffle_f32x4::<0x88>(ab_even, ef_even);
                rows[c + 4].0 = _mm512_shuffle_f32x4::<0x88>(ab_odd, ef_odd);
                rows[c + 8].0 = _mm512_shuffle_f32x4::<0xDD>(ab_even, ef_even);
                rows[c + 12].0 = _mm512_shuffle_f32x4::<0xDD>(ab_odd, ef_odd);
            }
        }
    }

    #[inline(always)]
    fn widen(self) -> [F64x8; 2] {
        // SAFETY: the operand was made from a token.
        unsafe {
            let (low, high) = (_mm512_castps512_ps256(self.0), _mm512_extractf32x8_ps::<1>(self.0));
            [F64x8(_mm512_cvtps_pd(low)), F64x8(_mm512_cvtps_pd(high))]
        }
    }
}

impl Float64 for F64x8 {}

unsigned!(
    U32x16,
    Avx512,
    u32,
    16,
    _mm512_set1_epi32 as i32,
    _mm512_loadu_si512,
    _mm512_storeu_si512,
    _mm512_max_epu32
);
unsigned!(
    U16x32,
    Avx512,
    u16,
    32,
    _mm512_set1_epi16 as i16,
    _mm512_loadu_si512,
    _mm512_storeu_si512,
    _mm512_max_epu16
);
unsigned32!(
    U32x16,
    __mmask16,
    _mm512_add_epi32,
    _mm512_sub_epi32,
    _mm512_mullo_epi32,
    _mm512_srl_epi32,
    _mm512_and_si512,
    _mm512_min_epu32,
    |a, b| _mm512_cmpge_epu32_mask(a, b),
    |a, mask, b| _mm512_mask_blend_epi32(mask, b, a),
    |a, mask| _mm512_mask_sub_epi32(a, mask, a, _mm512_set1_epi32(-1)),
    |a| _mm512_reduce_add_epi32(a) as u32,
    |a| _mm512_reduce_min_epu32(a),
    |a| _mm512_reduce_max_epu32(a)
);

impl Unsigned16 for U16x32 {
    #[inline(always)]
    fn any_ge(self, other: Self) -> bool {
        // SAFETY: the operands were made from a token.
        unsafe { _mm512_cmpge_epu16_mask(self.0, other.0) != 0 }
    }
}

impl Simd for Avx512 {
    const LANES: usize = 16;
    const TILE_ROWS: usize = 8;
    type F32 = F32x16;
    type F64 = F64x8;
    type U32 = U32x16;
    type U16 = U16x32;
}
