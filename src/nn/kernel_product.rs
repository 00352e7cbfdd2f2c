//! Products over a kernel map: the loop behind every convolution, and its weight gradient.
//!
//! `y[o] = Σ_k Σ_{i →k o} x[i]·W_k`. A block of outputs is one task; each output row takes its offsets
//! in order and, within one, the input channels in order, so that its value depends on nothing but its
//! own inputs.

use crate::octree::KernelMap;
use crate::par;
use crate::scalar::Scalar;

/// Output rows per partial sum of a weight gradient.
const RANGE_ROWS: usize = 8192;

/// `y[o] = Σ_k Σ_{i →k o} x[i]·weights[k]` with `weights: [n_offsets, c_in, c_out]`; `y` is overwritten.
pub(super) fn product<T: Scalar>(
    map: &KernelMap,
    x: &[T],
    c_in: usize,
    weights: &[T],
    c_out: usize,
    y: &mut Vec<T>,
) {
    assert_eq!(x.len(), map.n_inputs() * c_in, "rows of the input and of the kernel map differ");
    y.resize(map.n_outputs() * c_out, T::ZERO);
    par::for_each_block(y, map.block_len() * c_out, |block, rows| {
        rows.fill(T::ZERO);
        for (k, w) in weights.chunks_exact(c_in * c_out).enumerate() {
            let (inputs, outputs) = map.pairs(block, k);
            T::matmul_rows(x, inputs, c_in, w, c_out, rows, outputs);
        }
    });
}

/// `grads[group·k + j] += Σ_{i →k o} a[group·i + j]ᵀ·g[o]`, each `[c_a, c_g]`.
///
/// `group` rows of `a` belong to one input of the map: 1 for a convolution, 8 for the children of a node.
pub(super) fn weight_gradient<T: Scalar>(
    map: &KernelMap,
    group: usize,
    (a, c_a): (&[T], usize),
    (g, c_g): (&[T], usize),
    grads: &mut [T],
) {
    assert_eq!(a.len(), map.n_inputs() * group * c_a, "rows of `a` and of the kernel map differ");
    assert_eq!(g.len(), map.n_outputs() * c_g, "rows of `g` and of the kernel map differ");
    let blocks_per_range = (RANGE_ROWS / map.block_len().max(1)).max(1);
    let n_ranges = map.n_blocks().div_ceil(blocks_per_range);
    let add = |slot: usize, range: usize, d: &mut [T]| {
        let first = range * blocks_per_range;
        for block in first..(first + blocks_per_range).min(map.n_blocks()) {
            let (inputs, outputs) = map.pairs(block, slot / group);
            let g = &g[block * map.block_len() * c_g..];
            if group == 1 {
                T::matmul_tn_rows(a, inputs, c_a, g, outputs, c_g, d);
            } else {
                let row = |&i: &u32| i * group as u32 + (slot % group) as u32;
                let rows: Vec<u32> = inputs.iter().map(row).collect();
                T::matmul_tn_rows(a, &rows, c_a, g, outputs, c_g, d);
            }
        }
    };
    if n_ranges <= 1 {
        par::for_each_block(grads, c_a * c_g, |slot, d| add(slot, 0, d));
        return;
    }
    let partials = par::map(grads.len() / (c_a * c_g) * n_ranges, |task| {
        let mut d = vec![T::ZERO; c_a * c_g];
        add(task / n_ranges, task % n_ranges, &mut d);
        d
    });
    par::for_each_block(grads, c_a * c_g, |slot, d| {
        for partial in &partials[slot * n_ranges..(slot + 1) * n_ranges] {
            d.iter_mut().zip(partial).for_each(|(d, &p)| *d += p);
        }
    });
}

/// Each of the matrices `[rows, cols]` of `weights` transposed, the last one first.
pub(super) fn transposed_reversed<T: Scalar>(weights: &[T], rows: usize, cols: usize) -> Vec<T> {
    let mut transposed = vec![T::ZERO; weights.len()];
    let n = weights.len() / (rows * cols);
    par::for_each_block(&mut transposed, rows * cols, |k, to| {
        let from = &weights[(n - 1 - k) * rows * cols..][..rows * cols];
        transpose(from, rows, cols, to);
    });
    transposed
}

/// `to[c, r] = from[r, c]`, in tiles that fit the cache.
fn transpose<T: Scalar>(from: &[T], rows: usize, cols: usize, to: &mut [T]) {
    const TILE: usize = 16;
    for r0 in (0..rows).step_by(TILE) {
        for c0 in (0..cols).step_by(TILE) {
            for c in c0..(c0 + TILE).min(cols) {
                for r in r0..(r0 + TILE).min(rows) {
                    to[c * rows + r] = from[r * cols + c];
                }
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::gradcheck::{self, Settings};
    use crate::octree::tests::sheets;
    use crate::octree::{Cloud, Octree, OctreeOptions};
    use glam::Vec3;

    /// Octrees with empty nodes, of one and of several shapes, of one point, of points in one cell.
    pub(in crate::nn) fn octrees() -> Vec<Octree> {
        let options = OctreeOptions { depth: 4, full_depth: 2, ..OctreeOptions::default() };
        let lumps = [vec![Vec3::splat(0.3)], vec![Vec3::new(-0.7, 0.1, 0.9); 20]];
        let lump = |p: &Vec<Vec3>| Octree::build(&[Cloud::new(p, &[])], &options).unwrap();
        let mut octrees: Vec<Octree> = lumps.iter().map(lump).collect();
        octrees.push(sheets(&[120], &options));
        octrees.push(sheets(&[50, 1, 30], &options));
        octrees
    }

    /// An octree whose finest depths have several blocks, and several ranges of a weight gradient.
    pub(in crate::nn) fn large_octree() -> Octree {
        sheets(&[15_000, 5000], &OctreeOptions { depth: 6, ..OctreeOptions::default() })
    }

    /// Finite differences for a layer of vectors to a vector, at most 120 elements of each.
    pub(in crate::nn) fn require_gradients(
        inputs: &[(&str, &[f64])],
        forward: impl FnMut(&[Vec<f64>]) -> Vec<f64>,
        backward: impl FnMut(&[Vec<f64>], &[f64]) -> Vec<Vec<f64>>,
    ) {
        let settings = Settings { max_elements: 120, ..Settings::default() };
        gradcheck::layer(inputs, forward, backward, &settings).require(1e-7).unwrap();
    }

    #[test]
    fn transposing_twice_is_the_identity() {
        let weights: Vec<f64> = (0..3 * 17 * 35).map(f64::from).collect();
        let once = transposed_reversed(&weights, 17, 35);
        assert_eq!(once[0], weights[2 * 17 * 35]);
        assert_eq!(once[17 * 3 + 5], weights[2 * 17 * 35 + 35 * 5 + 3]);
        assert_eq!(transposed_reversed(&once, 35, 17), weights);
    }

    #[test]
    fn weight_gradients_accumulate_over_blocks_and_ranges() {
        let octree = large_octree();
        let level = octree.finest();
        assert!(level.n_nodes() > RANGE_ROWS && level.conv.n_blocks() > 8);
        let (x, dy) =
            (gradcheck::probe(level.n_nodes() * 2, 1), gradcheck::probe(level.n_nodes(), 2));
        let mut grads = vec![1.0; 27 * 2];
        weight_gradient(&level.conv, 1, (&x, 2), (&dy, 1), &mut grads);
        for (i, grad) in grads.iter().enumerate() {
            let (k, c) = (i / 2, i % 2);
            let rows = level.neigh.iter().zip(&dy).filter(|(n, _)| n[k] >= 0);
            let plain: f64 = rows.map(|(n, dy)| x[2 * n[k] as usize + c] * dy).sum();
            assert!((grad - 1.0 - plain).abs() < 1e-10);
        }
    }
}
