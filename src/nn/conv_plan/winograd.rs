//! Wide 3×3×3 convolutions by Winograd's minimal filtering: 64 products where the plain sum takes up to 216.
//!
//! The children of one parent are always there together, which makes an octree's nodes the tiles of 2×2×2
//! that the method needs. See [`crate::simd::gemm::winograd`] for the arithmetic.

use super::super::arena::{Arena, Buffer};
use super::super::rows;
use super::super::scratch::ScratchGuard;
use super::packed::PackedWeights;
use super::product::{OuterProduct, Product, Term};
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::octree::KernelMap;
use crate::simd::Isa;
use crate::simd::gemm::matmul_tn_rows;
use crate::simd::gemm::winograd::{
    self, CHANNELS, FrequencyScratch, MAX_DEPTH, MAX_GROUPS, N_FREQUENCIES,
};

/// Fewest channels for which it pays: with fewer, transforming takes longer than it saves.
const LEAST: usize = 16;
/// Most products of channels: transformed weights of more outgrow the caches.
const MOST: usize = 128 * 128;

/// Blocks into which few groups are cut, and the fewest groups of one.
const MIN_BLOCKS: usize = 8;
const MIN_GROUPS: usize = 8;

/// Groups per step of a weight gradient: as many rows of each frequency.
pub(super) const STEP: usize = 128;
/// Groups per task of a transform.
pub(super) const TASK: usize = 8;

/// Fewest products of channels for which a weight gradient pays, too.
const LEAST_OF_GRADIENT: usize = 64 * 64;

/// Whether a convolution with these channels is computed so.
pub(super) fn suits(map: &KernelMap, c_in: usize, c_out: usize) -> bool {
    let whole = |c: usize| (LEAST..=MAX_DEPTH).contains(&c) && c.is_multiple_of(CHANNELS);
    !map.siblings().is_empty() && whole(c_in) && whole(c_out) && c_in * c_out <= MOST
}

/// Whether its weight gradient is.
pub(super) fn suits_gradient<T>(map: &KernelMap, product: &OuterProduct<T>) -> bool {
    let (width, c_g) = (product.columns.len(), product.c_g);
    product.group == 1 && suits(map, width, c_g) && width * c_g >= LEAST_OF_GRADIENT
}

/// A [`Term`] in the frequency domain.
enum Transformed<'a, T: Scalar> {
    Nodes { x: &'a [T], weights: PackedWeights<T> },
    Shapes { products: Buffer<T>, shapes: Vec<usize> },
}

/// Computes terms that suit.
pub(super) fn sum_of_terms<T: Scalar>(
    arena: &Arena<T>,
    map: &KernelMap,
    product: &Product<T>,
    y: &mut [T],
) {
    let (isa, siblings, c_out) = (Isa::active(), map.siblings(), product.c_out);
    let of_term = |term| transformed(arena, map, term, c_out);
    let terms: Vec<_> = product.terms.iter().map(of_term).collect();
    let len = siblings.len().div_ceil(MIN_BLOCKS).clamp(MIN_GROUPS, MAX_GROUPS);
    par::for_each_block_with(
        y,
        len * 8 * c_out,
        ScratchGuard::<FrequencyScratch<T>>::new,
        |scratch, block, y| {
            let groups = block * len..siblings.len().min((block + 1) * len);
            let term = |term| match term {
                &Transformed::Nodes { x, ref weights } => {
                    winograd::FrequencyTerm::Nodes { x, weights: weights.get() }
                }
                Transformed::Shapes { products, shapes } => {
                    winograd::FrequencyTerm::Shapes { products, shapes: &shapes[groups.clone()] }
                }
            };
            let terms: Vec<_> = terms.iter().map(term).collect();
            winograd::sum_of_terms(isa, &siblings[groups.clone()], &terms, c_out, scratch, y);
            product.finish(8 * groups.start, y);
        },
    );
}

fn transformed<'a, T: Scalar>(
    arena: &Arena<T>,
    map: &KernelMap,
    term: &Term<'a, T>,
    c_out: usize,
) -> Transformed<'a, T> {
    let isa = Isa::active();
    match term {
        Term::Nodes { x, weights } => {
            let weights = PackedWeights::new(arena, weights, N_FREQUENCIES, |memory| {
                winograd::transform_weights(isa, weights, memory, |panels, len, work| {
                    par::for_each_block(panels, len, work);
                })
            });
            Transformed::Nodes { x, weights }
        }
        Term::Shapes { products: from, shapes } => {
            let mut products = arena.get(shapes.len() * N_FREQUENCIES * c_out);
            for (i, to) in products.chunks_exact_mut(N_FREQUENCIES * c_out).enumerate() {
                winograd::transform_products(isa, &from[i * c_out..], shapes.len() * c_out, to);
            }
            let shape = |group: usize| shapes.partition_point(|shape| shape.end <= 8 * group);
            let shapes = (0..map.siblings().len()).map(shape).collect();
            Transformed::Shapes { products, shapes }
        }
    }
}

/// Adds the weight gradient of a convolution that suits.
pub(super) fn weight_gradient<T: Scalar>(
    arena: &Arena<T>,
    map: &KernelMap,
    product: &OuterProduct<T>,
    grads: &mut [T],
) {
    let OuterProduct { a, ref columns, g, c_g, .. } = *product;
    let (isa, width) = (Isa::active(), columns.len());
    let step = STEP.min(map.siblings().len()).next_multiple_of(TASK);
    let mut inputs = arena.get(step * N_FREQUENCIES * width);
    let mut gradients = arena.get(step * N_FREQUENCIES * c_g);
    let mut sums = arena.zeroed(N_FREQUENCIES * width * c_g);
    for (groups, g) in map.siblings().chunks(step).zip(g.chunks(step * 8 * c_g)) {
        par::for_each_block(&mut inputs, TASK * N_FREQUENCIES * width, |i, to| {
            let groups = groups.chunks(TASK).nth(i).unwrap_or_default();
            winograd::transform_inputs(isa, groups, (a, width), TASK, to);
        });
        par::for_each_block(&mut gradients, TASK * N_FREQUENCIES * c_g, |i, to| {
            let g = g.chunks(TASK * 8 * c_g).nth(i).unwrap_or_default();
            winograd::transform_gradients(isa, (g, c_g), TASK, to);
        });
        par::for_each_block(&mut sums, width * c_g, |f, sums| {
            let row = |group: usize| (group / TASK * N_FREQUENCIES + f) * TASK + group % TASK;
            let rows: Vec<u32> = (0..groups.len()).map(|group| row(group) as u32).collect();
            matmul_tn_rows(Isa::active(), (&inputs, &rows), width, (&gradients, &rows), c_g, sums);
        });
    }
    drop((inputs, gradients));
    add_gradients(arena, &sums, product, grads);
}

/// Adds to the rows `columns` of each `[c_a, c_g]` what the frequencies `[64, columns.len(), c_g]` say.
fn add_gradients<T: Scalar>(
    arena: &Arena<T>,
    sums: &[T],
    product: &OuterProduct<T>,
    grads: &mut [T],
) {
    let OuterProduct { ref columns, c_a, c_g, .. } = *product;
    let (isa, width) = (Isa::active(), columns.len());
    let mut d = arena.get(width * 27 * c_g);
    par::for_each_block(&mut d, 27 * c_g, |row, d| {
        winograd::transform_weight_gradients(isa, &sums[row * c_g..], width * c_g, d);
    });
    par::for_each_block(grads, c_a * c_g, |k, grads| {
        let grads = grads[columns.start * c_g..columns.end * c_g].chunks_exact_mut(c_g);
        for (grads, d) in grads.zip(d.chunks_exact(27 * c_g)) {
            rows::add(grads, &d[k * c_g..]);
        }
    });
}
