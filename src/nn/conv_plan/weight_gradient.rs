//! Gradients of weights: sums over ranges of rows of constant length, added in order.

use super::super::arena::Arena;
use super::super::rows;
use super::product::OuterProduct;
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::octree::KernelMap;
use crate::simd::Isa;
use crate::simd::gemm::matmul_tn_rows;
use std::ops::Range;

/// Output rows per partial sum.
pub(super) const RANGE_ROWS: usize = 8192;

/// Adds to `grads`, range by range.
pub(super) fn by_ranges<T: Scalar>(
    arena: &Arena<T>,
    map: &KernelMap,
    product: &OuterProduct<T>,
    grads: &mut [T],
) {
    let OuterProduct { a, ref columns, c_a, g, c_g, group } = *product;
    let width = columns.len();
    let blocks_per_range = (RANGE_ROWS / map.block_len().max(1)).max(1);
    let n_ranges = map.n_blocks().div_ceil(blocks_per_range);
    let add = |slot: usize, range: usize, d: &mut [T]| {
        let first = range * blocks_per_range;
        let blocks = first..(first + blocks_per_range).min(map.n_blocks());
        let (inputs, outputs) = pairs_of_blocks(map, blocks, group, slot);
        matmul_tn_rows(Isa::active(), (a, &inputs), width, (g, &outputs), c_g, d);
    };
    let place = columns.start * c_g..columns.end * c_g;
    if n_ranges <= 1 {
        par::for_each_block(grads, c_a * c_g, |slot, d| add(slot, 0, &mut d[place.clone()]));
        return;
    }
    let (n_slots, len) = (grads.len() / (c_a * c_g), width * c_g);
    let mut partials = arena.zeroed(n_slots * n_ranges * len);
    par::for_each_block(&mut partials, len, |task, d| add(task / n_ranges, task % n_ranges, d));
    par::for_each_block(grads, c_a * c_g, |slot, d| {
        let partials = &partials[slot * n_ranges * len..][..n_ranges * len];
        for partial in partials.chunks_exact(len) {
            rows::add(&mut d[place.clone()], partial);
        }
    });
}

/// Rows of `a` and of `g` that meet in gradient `slot`, block after block: one long sum keeps the tiles of
/// the gradient in registers.
fn pairs_of_blocks(
    map: &KernelMap,
    blocks: Range<usize>,
    group: usize,
    slot: usize,
) -> (Vec<u32>, Vec<u32>) {
    let (offset, member) = (slot / group, slot % group);
    let n_pairs = blocks.clone().map(|block| map.pairs(block, offset).0.len()).sum();
    let (mut a, mut g) = (Vec::with_capacity(n_pairs), Vec::with_capacity(n_pairs));
    for block in blocks {
        let (inputs, outputs) = map.pairs(block, offset);
        let first = (block * map.block_len()) as u32;
        a.extend(inputs.iter().map(|i| i * group as u32 + member as u32));
        g.extend(outputs.iter().map(|o| first + o));
    }
    (a, g)
}

#[cfg(test)]
mod tests {
    use super::super::ConvPlan;
    use super::super::product::RowMap;
    use super::*;
    use crate::conformance::gradcheck;
    use crate::nn::testing::large_octree;

    #[test]
    fn weight_gradients_accumulate_over_blocks_and_ranges() {
        let octree = large_octree();
        let level = octree.finest();
        assert!(level.n_nodes() > RANGE_ROWS && level.conv.n_blocks() > 8);
        let (x, dy) =
            (gradcheck::probe(level.n_nodes() * 2, 1), gradcheck::probe(level.n_nodes(), 2));
        let mut grads = vec![1.0; 27 * 2];
        let product = OuterProduct::new((&x, 2), (&dy, 1));
        let rows = RowMap::Kernel(&level.conv);
        ConvPlan::add_weight_gradient(&Arena::default(), rows, &product, &mut grads);
        for (i, grad) in grads.iter().enumerate() {
            let (k, c) = (i / 2, i % 2);
            let rows = level.neigh.iter().zip(&dy).filter(|(n, _)| n[k] >= 0);
            let plain: f64 = rows.map(|(n, dy)| x[2 * n[k] as usize + c] * dy).sum();
            assert!((grad - 1.0 - plain).abs() < 1e-10);
        }
    }
}
