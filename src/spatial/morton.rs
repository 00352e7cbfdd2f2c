//! Morton codes: the bits of three coordinates interleaved, so that near codes are near places.
//!
//! Bit `3i + a` of a code is bit `i` of coordinate `a`.

/// Bits of each coordinate.
pub const BITS: u32 = 16;

const ALL: u64 = (1 << (3 * BITS)) - 1;

/// The code of coordinates below 2¹⁶; higher bits are ignored.
pub fn encode([a, b, c]: [u32; 3]) -> u64 {
    spread(a) | spread(b) << 1 | spread(c) << 2
}

/// The coordinates of a code; bits from 48 on are ignored.
pub fn decode(code: u64) -> [u32; 3] {
    [gather(code), gather(code >> 1), gather(code >> 2)]
}

/// Bit `i` moves to place `3i`.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x) & 0xffff;
    x = (x | x << 16) & 0x0000_ff00_00ff;
    x = (x | x << 8) & 0xf00f_00f0_0f00_f00f & ALL;
    x = (x | x << 4) & 0x30c3_0c30_c30c_30c3 & ALL;
    (x | x << 2) & 0x9249_2492_4924_9249 & ALL
}

/// Bit `3i` moves to place `i`.
fn gather(bits: u64) -> u32 {
    let mut x = bits & 0x9249_2492_4924_9249 & ALL;
    x = (x | x >> 2) & 0x30c3_0c30_c30c_30c3;
    x = (x | x >> 4) & 0xf00f_00f0_0f00_f00f;
    x = (x | x >> 8) & 0x0000_ff00_00ff;
    ((x | x >> 16) & 0xffff) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    #[test]
    fn codes_interleave_bits_and_decode() {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        for _ in 0..1000 {
            let cell = [0; 3].map(|_: u32| stream.below(1 << BITS) as u32);
            let bit = |i: u32, axis: u32| u64::from(cell[axis as usize] >> i & 1) << (3 * i + axis);
            let by_definition = (0..BITS).flat_map(|i| (0..3).map(move |axis| (i, axis)));
            let code = by_definition.map(|(i, axis)| bit(i, axis)).sum::<u64>();
            assert_eq!(encode(cell), code);
            assert_eq!(decode(code), cell);
        }
    }
}
