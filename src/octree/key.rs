//! Shuffled keys: the bits of a cell's coordinates interleaved, x highest.
//!
//! Bit `3i+2` is bit `i` of x, `3i+1` of y, `3i` of z; the shape's index sits above bit 48. The parent's
//! key is the key without its lowest three bits, which number the child: `4x + 2y + z`.

use crate::spatial::morton;
use glam::Vec3;

/// First bit of the shape's index.
pub(crate) const SHAPE_SHIFT: u32 = 48;
/// Greatest number of shapes in keys.
pub(crate) const MAX_SHAPES: usize = 1 << 15;

const CELL_BITS: u64 = (1 << SHAPE_SHIFT) - 1;

/// Key of `cell` of `shape`.
///
/// # Panics
/// If a coordinate or the shape is not below 2¹⁶.
pub fn encode(cell: [u32; 3], shape: usize) -> u64 {
    let [x, y, z] = cell;
    assert!(
        (x | y | z) >> 16 == 0 && shape >> 16 == 0,
        "cell {cell:?} of shape {shape}, expected below 2^16"
    );
    (shape as u64) << SHAPE_SHIFT | morton::encode([z, y, x])
}

/// Cell and shape of a key.
pub fn decode(key: u64) -> ([u32; 3], usize) {
    let [z, y, x] = morton::decode(key);
    ([x, y, z], (key >> SHAPE_SHIFT) as usize)
}

/// Key of the ancestor `levels` above.
pub(crate) fn ancestor(key: u64, levels: usize) -> u64 {
    (key & !CELL_BITS) | (key & CELL_BITS) >> (3 * levels)
}

/// Key of child `octant`.
///
/// # Panics
/// If the octant is not below 8.
pub(crate) fn child(key: u64, octant: u64) -> u64 {
    assert!(octant < 8, "octant {octant} of 8");
    (key & !CELL_BITS) | (key & CELL_BITS) << 3 | octant
}

/// Position of `point` in cells of `depth` from the cube's corner: `(p + 1)·2^(depth−1)`, first added,
/// then multiplied, in f32.
pub(crate) fn in_cells(point: Vec3, depth: usize) -> Vec3 {
    (point + Vec3::ONE) * (0.5 * (1u32 << depth) as f32)
}

/// Cell of `depth` that contains `point`; `None` outside [−1, 1]³ and for NaN. The far faces of the
/// cube belong to the last cells.
///
/// # Panics
/// If the depth is above 16.
pub(crate) fn cell(point: Vec3, depth: usize) -> Option<[u32; 3]> {
    assert!(depth <= 16, "depth {depth}, expected at most 16");
    if point.is_nan() || point.abs().max_element() > 1.0 {
        return None;
    }
    let last = (1u32 << depth) - 1;
    Some(in_cells(point, depth).to_array().map(|x| (x as u32).min(last)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    /// The definition, bit by bit.
    fn interleave(cell: [u32; 3]) -> u64 {
        (0..16).fold(0, |key, i| {
            let bit = |c: u32, to: u32| u64::from(c >> i & 1) << (3 * i + to);
            key | bit(cell[0], 2) | bit(cell[1], 1) | bit(cell[2], 0)
        })
    }

    #[test]
    fn keys_interleave_bits_and_decode() {
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        for _ in 0..1000 {
            let cell = [0; 3].map(|_: u32| stream.below(1 << 16) as u32);
            let shape = stream.below(MAX_SHAPES);
            let key = encode(cell, shape);
            assert_eq!(key, interleave(cell) | (shape as u64) << 48);
            assert_eq!(decode(key), (cell, shape));
            assert_eq!(ancestor(key, 3), encode(cell.map(|c| c >> 3), shape));
            let octant = u64::from((cell[0] & 1) << 2 | (cell[1] & 1) << 1 | cell[2] & 1);
            assert_eq!(child(ancestor(key, 1), octant), key);
        }
    }

    #[test]
    fn the_far_face_belongs_to_the_last_cell_and_nothing_lies_outside() {
        assert_eq!(cell(Vec3::ONE, 4), Some([15; 3]));
        assert_eq!(cell(-Vec3::ONE, 4), Some([0; 3]));
        assert_eq!(cell(Vec3::ZERO, 4), Some([8; 3]));
        assert_eq!(cell(Vec3::new(0.0, 1.0 + f32::EPSILON, 0.0), 4), None);
        assert_eq!(cell(Vec3::new(0.0, f32::NAN, 0.0), 4), None);
        assert_eq!(cell(Vec3::new(f32::INFINITY, 0.0, 0.0), 4), None);
    }
}
