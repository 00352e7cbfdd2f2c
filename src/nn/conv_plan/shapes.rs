//! Products with columns that are constant over a shape: one product per shape instead of one per row.
//!
//! In a convolution `Σ_k x[neigh[n, k]]·W_k` the share of such columns `v`, whose rows of `W_k` are `V_k`, is
//! `Σ_{k: neigh[n, k] exists} p_k` with `p_k = v·V_k`: 27 vectors per shape, chosen by which neighbors exist. On
//! the backward pass, with `s_k = Σ dy[n]` over the nodes whose neighbor `k` exists, `dV_k = vᵀ·s_k` and
//! `dv = Σ_k s_k·V_kᵀ`.

use super::super::arena::{Arena, Buffer};
use super::super::rows;
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::octree::KernelMap;
use crate::simd::Isa;
use crate::simd::elementwise::{self, Combination};
use crate::simd::gemm::block::{self, WeightSource};
use crate::simd::gemm::matmul_rows;
use crate::simd::gemm::weights::Weights;
use std::ops::Range;

/// `p[k, s] = v[s]·V_k`, `[n_offsets, n_shapes, c_out]`; `weights(k)` is `V_k: [c, c_out]`.
pub(in crate::nn) fn products<'a, T: Scalar>(
    arena: &Arena<T>,
    (values, c): (&[T], usize),
    weights: impl Fn(usize) -> &'a [T] + Sync,
    (n_offsets, c_out): (usize, usize),
) -> Buffer<T> {
    let shapes: Vec<u32> = (0..(values.len() / c) as u32).collect();
    let mut products = arena.zeroed(n_offsets * shapes.len() * c_out);
    par::for_each_block(&mut products, shapes.len() * c_out, |k, products| {
        matmul_rows(Isa::active(), (values, &shapes), c, weights(k), c_out, (products, &shapes));
    });
    products
}

/// `sums[k, s] = Σ_o g[o]` over the output rows `o` of shape `s` that have an input at offset `k`:
/// `[n_offsets, n_shapes, c]`. Inputs and outputs are the same rows.
pub(in crate::nn) fn sums<T: Scalar>(
    arena: &Arena<T>,
    map: &KernelMap,
    shapes: &[Range<usize>],
    (g, c): (&[T], usize),
) -> Buffer<T> {
    let partials = par::map(map.n_blocks(), |block| {
        let first = block * map.block_len();
        let (mut slots, mut sums) = (Vec::new(), Vec::new());
        for k in 0..map.n_offsets() {
            for_each_shape(shapes, first, map.pairs(block, k).1, |shape, outputs| {
                slots.push(k * shapes.len() + shape);
                sums.resize(slots.len() * c, T::ZERO);
                add_rows(g, first, outputs, &mut sums[(slots.len() - 1) * c..]);
            });
        }
        (slots, sums)
    });
    let mut sums = arena.zeroed(map.n_offsets() * shapes.len() * c);
    for (slots, partial) in partials {
        for (slot, partial) in slots.into_iter().zip(partial.chunks_exact(c)) {
            rows::add(&mut sums[slot * c..][..c], partial);
        }
    }
    sums
}

/// `sum += Σ g[first + row]` over `rows`.
fn add_rows<T: Scalar>(g: &[T], first: usize, rows: &[u32], sum: &mut [T]) {
    let (isa, c) = (Isa::active(), sum.len());
    for &row in rows {
        let g = &g[(first + row as usize) * c..][..c];
        elementwise::combine(isa, Combination::Add, sum, g);
    }
}

/// `y[r] = Σ_k x[k·n + r]·weights[k]`: `n` rows of `y`, for each of which every offset has one row of `x`.
pub(in crate::nn) fn product_of_rows<T: Scalar>(
    arena: &Arena<T>,
    x: &[T],
    n: usize,
    weights: &Weights<T>,
) -> Buffer<T> {
    let (depth, c_out) = (weights.depth(), weights.width());
    assert_eq!(x.len(), weights.n_offsets() * n * depth, "one row for each offset and output");
    let mut y = arena.get(n * c_out);
    par::for_each_block(&mut y, block::MAX_ROWS * c_out, |i, y| {
        let outputs: Vec<u32> = (0..(y.len() / c_out) as u32).collect();
        let first = |k: usize| (k * n + i * block::MAX_ROWS) as u32;
        let inputs =
            (0..weights.n_offsets()).map(|k| outputs.iter().map(|r| first(k) + r).collect());
        let inputs: Vec<Vec<u32>> = inputs.collect();
        let pairs = inputs.iter().map(|inputs| (&inputs[..], &outputs[..])).collect();
        let weights = WeightSource::Matrices(weights.clone());
        let terms = [block::BlockTerm::Products { x, pairs, weights }];
        block::sum_of_terms(Isa::active(), &terms, c_out, 0..c_out, y);
    });
    y
}

/// Calls `work(shape, rows)` for the runs of `rows`, ascending and counted from `first`, that lie in one
/// shape.
pub(super) fn for_each_shape<'a>(
    shapes: &[Range<usize>],
    first: usize,
    mut rows: &'a [u32],
    mut work: impl FnMut(usize, &'a [u32]),
) {
    while let Some(&row) = rows.first() {
        let shape = shapes.partition_point(|shape| shape.end <= first + row as usize);
        let (run, rest) =
            rows.split_at(rows.partition_point(|&r| first + (r as usize) < shapes[shape].end));
        work(shape, run);
        rows = rest;
    }
}
