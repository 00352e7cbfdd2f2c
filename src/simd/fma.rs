//! Fused multiply-add of `f32` in software, for processors or builds without the instruction.

/// `a * b + c` with one rounding: the bits of the fused instruction, by arithmetic in `f64`.
///
/// The product of two `f32` has at most 48 significant bits, so it is exact in `f64`. The sum is
/// rounded to odd (Boldo and Melquiond 2008): of the two doubles around an inexact sum the one with
/// an odd last bit is taken. As 53 ≥ 24 + 2, rounding that to `f32` is rounding the exact value,
/// subnormal and overflowing results included. No branches.
#[inline(always)]
pub fn mul_add(a: f32, b: f32, c: f32) -> f32 {
    if cfg!(any(target_feature = "fma", target_arch = "aarch64")) {
        return a.mul_add(b, c);
    }
    let product = f64::from(a) * f64::from(b);
    let addend = f64::from(c);
    let sum = product + addend;
    // What the sum lost, exactly (Knuth's two-sum); NaN where a number is not finite.
    let part = sum - product;
    let lost = (product - (sum - part)) + (addend - part);
    // Rounded towards zero, which is one down in the order of bit patterns where the signs differ; then odd.
    let inexact = u64::from(lost.abs() > 0.0);
    let opposite = (lost.to_bits() ^ sum.to_bits()) >> 63;
    f64::from_bits(sum.to_bits().wrapping_sub(opposite & inexact) | inexact) as f32
}

/// [`mul_add`] lane by lane, on the vectors that every 64-bit x86 processor has.
///
/// The sum rounded to nearest does as well as the one rounded to odd, unless it is halfway between two `f32`. Among
/// normal numbers that shows in the 29 bits that `f32` has not; sums of the subnormal range, but 0, are not told apart.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn mul_add4(a: [f32; 4], b: [f32; 4], c: [f32; 4]) -> [f32; 4] {
    use std::arch::x86_64::*;
    if cfg!(target_feature = "fma") {
        return std::array::from_fn(|l| mul_add(a[l], b[l], c[l]));
    }
    // SAFETY: every 64-bit x86 processor has SSE2; the arrays have four places, and any address will do.
    unsafe {
        let [a, b, c] =
            [_mm_loadu_ps(a.as_ptr()), _mm_loadu_ps(b.as_ptr()), _mm_loadu_ps(c.as_ptr())];
        let [a2, b2, c2] = [_mm_movehl_ps(a, a), _mm_movehl_ps(b, b), _mm_movehl_ps(c, c)];
        let [p, p2] = [
            _mm_mul_pd(_mm_cvtps_pd(a), _mm_cvtps_pd(b)),
            _mm_mul_pd(_mm_cvtps_pd(a2), _mm_cvtps_pd(b2)),
        ];
        let [c, c2] = [_mm_cvtps_pd(c), _mm_cvtps_pd(c2)];
        let [mut s, mut s2] = [_mm_add_pd(p, c), _mm_add_pd(p2, c2)];
        if may_be_halfway(s, s2) {
            [s, s2] = [to_odd(p, c, s), to_odd(p2, c2, s2)];
        }
        let mut result = [0.0; 4];
        _mm_storeu_ps(result.as_mut_ptr(), _mm_movelh_ps(_mm_cvtpd_ps(s), _mm_cvtpd_ps(s2)));
        result
    }
}

/// Whether one of four doubles may be halfway between two `f32`.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn may_be_halfway(low: std::arch::x86_64::__m128d, high: std::arch::x86_64::__m128d) -> bool {
    use std::arch::x86_64::*;
    // SAFETY: every 64-bit x86 processor has SSE2.
    unsafe {
        let (low, high) = (_mm_castpd_ps(low), _mm_castpd_ps(high));
        let lower = _mm_castps_si128(_mm_shuffle_ps::<0b10_00_10_00>(low, high));
        let upper = _mm_castps_si128(_mm_shuffle_ps::<0b11_01_11_01>(low, high));
        let dropped = _mm_and_si128(lower, _mm_set1_epi32(0x1FFF_FFFF));
        let halfway = _mm_cmpeq_epi32(dropped, _mm_set1_epi32(0x1000_0000));
        // The upper half of a double other than 0 in this range is not 0; that of 2^-126 is 0x3810_0000.
        let size = _mm_and_si128(upper, _mm_set1_epi32(0x7FFF_FFFF));
        let subnormal = _mm_and_si128(
            _mm_cmpgt_epi32(size, _mm_setzero_si128()),
            _mm_cmplt_epi32(size, _mm_set1_epi32(0x3810_0000)),
        );
        _mm_movemask_epi8(_mm_or_si128(halfway, subnormal)) != 0
    }
}

/// `product + addend`, whose rounded `sum` is given, rounded to odd, as [`mul_add`] has it.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn to_odd(
    product: std::arch::x86_64::__m128d,
    addend: std::arch::x86_64::__m128d,
    sum: std::arch::x86_64::__m128d,
) -> std::arch::x86_64::__m128d {
    use std::arch::x86_64::*;
    // SAFETY: every 64-bit x86 processor has SSE2.
    unsafe {
        let part = _mm_sub_pd(sum, product);
        let lost = _mm_add_pd(_mm_sub_pd(product, _mm_sub_pd(sum, part)), _mm_sub_pd(addend, part));
        let magnitude = _mm_andnot_pd(_mm_set1_pd(-0.0), lost);
        let inexact =
            _mm_srli_epi64::<63>(_mm_castpd_si128(_mm_cmpgt_pd(magnitude, _mm_setzero_pd())));
        let opposite = _mm_srli_epi64::<63>(_mm_castpd_si128(_mm_xor_pd(lost, sum)));
        let truncated = _mm_sub_epi64(_mm_castpd_si128(sum), _mm_and_si128(opposite, inexact));
        _mm_castsi128_pd(_mm_or_si128(truncated, inexact))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small deterministic generator: this module imports nothing.
    fn bits(state: &mut u64) -> u64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        *state
    }

    fn assert_fused(a: f32, b: f32, c: f32) {
        let (ours, libm) = (mul_add(a, b, c), a.mul_add(b, c));
        assert!(
            ours.to_bits() == libm.to_bits() || ours.is_nan() && libm.is_nan(),
            "{a:e} * {b:e} + {c:e} = {ours:e}, not {libm:e}"
        );
        #[cfg(target_arch = "x86_64")]
        for lane in 0..4 {
            let at = |x: f32| std::array::from_fn(|l| if l == lane { x } else { 1.0 });
            let lanes = mul_add4(at(a), at(b), at(c));
            assert!(
                lanes[lane].to_bits() == ours.to_bits() || lanes[lane].is_nan() && ours.is_nan(),
                "{a:e} * {b:e} + {c:e} = {:e} in lane {lane}, not {ours:e}",
                lanes[lane]
            );
        }
    }

    /// Few under Miri, which takes a millisecond for each.
    const N_DRAWS: usize = if cfg!(miri) { 300 } else { 1_000_000 };

    #[test]
    fn emulation_equals_the_fused_operation_on_any_bits() {
        let mut state = 0x9E37_79B9_7F4A_7C15;
        for _ in 0..N_DRAWS {
            let (x, y) = (bits(&mut state), bits(&mut state));
            let [a, b, c] = [x as u32, (x >> 32) as u32, y as u32].map(f32::from_bits);
            assert_fused(a, b, c);
        }
    }

    /// `c` plus half a unit of its last place, less a little that no double beside `c` can hold:
    /// rounding to `f64` first would call it a tie.
    #[test]
    fn emulation_equals_the_fused_operation_beside_ties() {
        let mut state = 88_172_645_463_325_252;
        for _ in 0..N_DRAWS {
            let x = bits(&mut state);
            let exponent = 50 + (x >> 40) % 150;
            let c = f32::from_bits((x as u32 & 0x007F_FFFF) | (exponent as u32) << 23);
            let e = 1.0 / (1 << (15 + (x >> 32) % 9)) as f32;
            let half_unit = f32::from_bits((exponent as u32 - 24) << 23);
            for (a, c) in [(half_unit, c), (half_unit, -c), (-half_unit, c), (-half_unit, -c)] {
                assert_fused(a * (1.0 + e), 1.0 - e, c);
            }
            // The same where the unit is that of the subnormals.
            let c = f32::from_bits(x as u32 & 0x80FF_FFFF);
            let root = f32::from_bits((127 - 75) << 23);
            assert_fused(root * (1.0 + e), root * (1.0 - e), c);
            assert_fused(root * (1.0 + e), -root * (1.0 - e), c);
        }
    }

    #[test]
    fn emulation_knows_the_special_values() {
        let values = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            f32::MIN_POSITIVE,
            -f32::MIN_POSITIVE,
            f32::from_bits(1),
            -f32::from_bits(1),
            f32::MAX,
            f32::MIN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
            f32::EPSILON,
            0.5,
            1.5,
            16_777_216.0,
            f32::from_bits(0x007F_FFFF),
        ];
        for a in values {
            for b in values {
                for c in values {
                    assert_fused(a, b, c);
                }
            }
        }
    }
}
