//! Fused multiply-add in `f32` for processors, or builds, without the instruction.

/// `a * b + c` with one rounding: the bits of the fused instruction, by arithmetic in `f64`.
///
/// The product of two `f32` has at most 48 significant bits, so it is exact in `f64`. The sum is
/// rounded to odd (Boldo and Melquiond 2008): of the two doubles around an inexact sum the one with
/// an odd last bit is taken. As 53 ≥ 24 + 2, rounding that to `f32` is rounding the exact value,
/// subnormal and overflowing results included. No branches, so loops over it become vectors.
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
    let bits = sum.to_bits();
    let even = (bits & 1) ^ 1;
    // The bit patterns of doubles are ordered by magnitude: away from zero is one up.
    let up = even & u64::from((lost > 0.0) & (sum > 0.0) | (lost < 0.0) & (sum < 0.0));
    let down = even & u64::from((lost < 0.0) & (sum > 0.0) | (lost > 0.0) & (sum < 0.0));
    f64::from_bits(bits.wrapping_add(up).wrapping_sub(down)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small deterministic generator: this room imports nothing.
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
    }

    #[test]
    fn emulation_equals_the_fused_operation_on_any_bits() {
        let mut state = 0x9E37_79B9_7F4A_7C15;
        for _ in 0..1_000_000 {
            let (x, y) = (bits(&mut state), bits(&mut state));
            let [a, b, c] = [x as u32, (x >> 32) as u32, y as u32].map(f32::from_bits);
            assert_fused(a, b, c);
        }
    }

    /// Sums that end next to the middle between two neighbouring results, where rounding twice
    /// goes wrong, at every exponent down to the subnormals.
    #[test]
    fn emulation_equals_the_fused_operation_near_ties() {
        let mut state = 88_172_645_463_325_252;
        for _ in 0..1_000_000 {
            let x = bits(&mut state);
            let (a, b) = (f32::from_bits(x as u32), f32::from_bits((x >> 32) as u32));
            let product = f64::from(a) * f64::from(b);
            if !product.is_finite() || product == 0.0 {
                continue;
            }
            let y = bits(&mut state);
            // c between 2^-60 and 2^60 of the product, with few or many significant bits.
            let scaled = product * 2f64.powi((y % 121) as i32 - 60);
            let c = f32::from_bits((scaled as f32).to_bits() & !0u32 << (y >> 32 & 23));
            assert_fused(a, b, c);
            assert_fused(a, b, -c);
            assert_fused(a, b, -(product as f32));
            // A short product that is a tie of c's last place, and one unit beside it.
            let short = f32::from_bits((y as u32) & 0xFFFF_F000);
            let half = f32::from_bits((short.to_bits() >> 23 & 0xFF).saturating_sub(24) << 23);
            assert_fused(half, 1.0, short);
            assert_fused(half, 1.0 + f32::EPSILON, short);
            assert_fused(half, 1.0 - f32::EPSILON / 2.0, -short);
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
