//! Eight numbers in one register: AVX2 and AVX-512.

use super::Eights;
use crate::simd::level::{Avx2, Avx512};
use std::arch::x86_64::*;

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

macro_rules! reduce_each {
    ($pick:ident, $rows:ident) => {{
        let two = |a, b| $pick(_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let four = |a, b| {
            let (a, b) = (_mm256_castps_pd(a), _mm256_castps_pd(b));
            let low = _mm256_castpd_ps(_mm256_unpacklo_pd(a, b));
            $pick(low, _mm256_castpd_ps(_mm256_unpackhi_pd(a, b)))
        };
        let [a, b, c, d, e, f, g, h] = $rows;
        let (low, high) = (four(two(a, b), two(c, d)), four(two(e, f), two(g, h)));
        let halves = _mm256_permute2f128_ps::<0x20>(low, high);
        $pick(halves, _mm256_permute2f128_ps::<0x31>(low, high))
    }};
}

/// Four rows of eight: the first and the second half of each column stand in one vector.
macro_rules! columns_of_halves {
    ($a:ident, $b:ident, $c:ident, $d:ident) => {{
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

macro_rules! ymm {
    ($token:ty, $greater:expr, $at_most:expr, $both:expr, $compress:expr) => {
        impl Eights for $token {
            type Eight = __m256;
            type Counts = __m256i;

            #[inline(always)]
            fn no_counts(self) -> __m256i {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe { _mm256_setzero_si256() }
            }
            #[inline(always)]
            fn count_at_most(self, counts: __m256i, a: __m256, b: __m256) -> __m256i {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe {
                    let minus_ones = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b));
                    _mm256_sub_epi32(counts, minus_ones)
                }
            }
            #[inline(always)]
            fn add_counts(self, a: __m256i, b: __m256i) -> __m256i {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe { _mm256_add_epi32(a, b) }
            }
            #[inline(always)]
            fn total(self, counts: __m256i) -> u32 {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe {
                    let high = _mm256_extracti128_si256::<1>(counts);
                    let four = _mm_add_epi32(_mm256_castsi256_si128(counts), high);
                    let two = _mm_add_epi32(four, _mm_shuffle_epi32::<0b1110>(four));
                    let one = _mm_add_epi32(two, _mm_shuffle_epi32::<1>(two));
                    _mm_cvtsi128_si32(one) as u32
                }
            }

            #[inline(always)]
            fn splat(self, x: f32) -> __m256 {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe { _mm256_set1_ps(x) }
            }
            #[inline(always)]
            fn load(self, from: &[f32; 8]) -> __m256 {
                // SAFETY: AVX2 as above; the reference is valid for eight floats.
                unsafe { _mm256_loadu_ps(from.as_ptr()) }
            }
            #[inline(always)]
            fn store(self, lanes: __m256, to: &mut [f32; 8]) {
                // SAFETY: AVX2 as above; the reference is valid for eight floats.
                unsafe { _mm256_storeu_ps(to.as_mut_ptr(), lanes) }
            }
            #[inline(always)]
            fn add(self, a: __m256, b: __m256) -> __m256 {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe { _mm256_add_ps(a, b) }
            }
            #[inline(always)]
            fn sub(self, a: __m256, b: __m256) -> __m256 {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe { _mm256_sub_ps(a, b) }
            }
            #[inline(always)]
            fn mul(self, a: __m256, b: __m256) -> __m256 {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe { _mm256_mul_ps(a, b) }
            }
            #[inline(always)]
            fn min(self, a: __m256, b: __m256) -> __m256 {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe { _mm256_min_ps(a, b) }
            }
            #[inline(always)]
            fn max(self, a: __m256, b: __m256) -> __m256 {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe { _mm256_max_ps(a, b) }
            }
            #[inline(always)]
            fn greater(self, a: __m256, b: __m256) -> u32 {
                // SAFETY: the token proves that the processor has the level's features.
                unsafe { $greater(a, b) }
            }
            #[inline(always)]
            fn at_most(self, a: __m256, b: __m256) -> u32 {
                // SAFETY: the token proves that the processor has the level's features.
                unsafe { $at_most(a, b) }
            }
            #[inline(always)]
            fn greater_and_at_most(self, a: __m256, b: __m256, c: __m256, d: __m256) -> u32 {
                // SAFETY: the token proves that the processor has the level's features.
                unsafe { $both(a, b, c, d) }
            }
            #[inline(always)]
            fn compress(self, lanes: __m256, mask: u32) -> __m256 {
                // SAFETY: the token proves that the processor has the level's features.
                unsafe { $compress(lanes, mask) }
            }
            #[inline(always)]
            fn only(self, lanes: __m256, mask: u32, other: __m256) -> __m256 {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe {
                    let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
                    let named = _mm256_and_si256(_mm256_set1_epi32(mask as i32), bits);
                    let named = _mm256_castsi256_ps(_mm256_cmpeq_epi32(named, bits));
                    _mm256_blendv_ps(other, lanes, named)
                }
            }
            #[inline(always)]
            fn truncate(self, lanes: __m256) -> [u32; 8] {
                let mut to = [0; 8];
                // SAFETY: AVX2 as above; the array has room for eight whole numbers.
                unsafe {
                    _mm256_storeu_si256(to.as_mut_ptr().cast(), _mm256_cvttps_epi32(lanes));
                }
                to
            }
            #[inline(always)]
            fn transpose(self, rows: [__m256; 8]) -> [__m256; 8] {
                let [a, b, c, d, e, f, g, h] = rows;
                // SAFETY: the token proves that the processor has AVX2.
                unsafe {
                    let [a, b, c, d] = columns_of_halves!(a, b, c, d);
                    let [e, f, g, h] = columns_of_halves!(e, f, g, h);
                    [
                        _mm256_permute2f128_ps::<0x20>(a, e),
                        _mm256_permute2f128_ps::<0x20>(b, f),
                        _mm256_permute2f128_ps::<0x20>(c, g),
                        _mm256_permute2f128_ps::<0x20>(d, h),
                        _mm256_permute2f128_ps::<0x31>(a, e),
                        _mm256_permute2f128_ps::<0x31>(b, f),
                        _mm256_permute2f128_ps::<0x31>(c, g),
                        _mm256_permute2f128_ps::<0x31>(d, h),
                    ]
                }
            }
            #[inline(always)]
            fn least_of_each(self, rows: [__m256; 8]) -> __m256 {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe { reduce_each!(_mm256_min_ps, rows) }
            }
            #[inline(always)]
            fn greatest_of_each(self, rows: [__m256; 8]) -> __m256 {
                // SAFETY: the token proves that the processor has AVX2.
                unsafe { reduce_each!(_mm256_max_ps, rows) }
            }
        }
    };
}

ymm!(
    Avx2,
    |a, b| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(a, b)) as u32,
    |a, b| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32,
    |a, b, c, d| {
        let greater = _mm256_cmp_ps::<_CMP_GT_OQ>(a, b);
        let both = _mm256_and_ps(greater, _mm256_cmp_ps::<_CMP_LE_OQ>(c, d));
        _mm256_movemask_ps(both) as u32
    },
    |lanes, mask: u32| {
        let order: *const [u32; 8] = &TO_FRONT[(mask & 255) as usize];
        _mm256_permutevar8x32_ps(lanes, _mm256_loadu_si256(order.cast()))
    }
);
ymm!(
    Avx512,
    |a, b| u32::from(_mm256_cmp_ps_mask::<_CMP_GT_OQ>(a, b)),
    |a, b| u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b)),
    |a, b, c, d| {
        let greater = _mm256_cmp_ps_mask::<_CMP_GT_OQ>(a, b);
        u32::from(_mm256_mask_cmp_ps_mask::<_CMP_LE_OQ>(greater, c, d))
    },
    |lanes, mask: u32| _mm256_maskz_compress_ps(mask as u8, lanes)
);
