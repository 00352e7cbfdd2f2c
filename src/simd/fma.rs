//! Fused multiply-add of `f32` in software, for processors or builds without the instruction.

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

    /// `c` plus half a unit of its last place, less a little that no double beside `c` can hold:
    /// rounding to `f64` first would call it a tie.
    #[test]
    fn emulation_equals_the_fused_operation_beside_ties() {
        let mut state = 88_172_645_463_325_252;
        for _ in 0..1_000_000 {
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
