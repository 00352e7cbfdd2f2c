//! Wide 3×3×3 convolutions by Winograd's minimal filtering: 64 products where the plain sum takes up to 216.
//!
//! The children of one parent are always there together, which makes an octree's nodes the tiles of 2×2×2
//! that the method asks for. See [`crate::scalar::winograd`] for the arithmetic.

use super::kernel_product::Term;
use super::lent::{Large, Lent};
use super::rows::Then;
use crate::octree::KernelMap;
use crate::par;
use crate::scalar::weights::Packed;
use crate::scalar::winograd::{self, CHANNELS, MAX_DEPTH, MAX_GROUPS, N_FREQUENCIES, Room};
use crate::scalar::{Level, Scalar};
use std::ops::Range;

/// Fewest channels for which it pays: with fewer, transforming takes longer than it saves.
const LEAST: usize = 16;
/// Most products of channels: transformed weights of more outgrow the caches.
const MOST: usize = 128 * 128;

/// Blocks into which few groups are cut, and the fewest groups of one.
const MIN_BLOCKS: usize = 8;
const MIN_GROUPS: usize = 8;

/// Groups per step of a weight gradient: as many rows of each frequency.
const STEP: usize = 128;
/// Groups per task of a transform.
const TASK: usize = 8;

/// Fewest products of channels for which a weight gradient pays, too.
const LEAST_OF_GRADIENT: usize = 64 * 64;

/// Whether a convolution with these channels is computed so. Does not depend on the number of nodes: a
/// shape's values are the same in every batch.
pub(super) fn suits(map: &KernelMap, c_in: usize, c_out: usize) -> bool {
    let whole = |c: usize| (LEAST..=MAX_DEPTH).contains(&c) && c.is_multiple_of(CHANNELS);
    !map.siblings().is_empty() && whole(c_in) && whole(c_out) && c_in * c_out <= MOST
}

/// Whether its weight gradient is.
pub(super) fn suits_gradient(map: &KernelMap, c_in: usize, c_out: usize) -> bool {
    suits(map, c_in, c_out) && c_in * c_out >= LEAST_OF_GRADIENT
}

/// Memory of a weight gradient: in frequencies and out of them.
#[derive(Default)]
struct Sums<T>([Vec<T>; 2]);

/// What became of a [`Term`].
enum Transformed<'a, T> {
    Nodes { x: &'a [T], weights: Packed<T> },
    Shapes { products: Vec<T>, shapes: Vec<usize> },
}

/// [`super::kernel_product::sum_of_terms`] of terms that suit.
pub(super) fn sum_of_terms<T: Scalar>(
    map: &KernelMap,
    terms: &[Term<T>],
    c_out: usize,
    y: &mut [T],
    then: &Then<T>,
) {
    let (level, siblings) = (Level::active(), map.siblings());
    let mut lent = Lent::<Large<T>>::new();
    let of_term = |term| transformed(level, map, term, c_out, lent.get());
    let terms: Vec<_> = terms.iter().map(of_term).collect();
    let len = siblings.len().div_ceil(MIN_BLOCKS).clamp(MIN_GROUPS, MAX_GROUPS);
    par::for_each_block_with(y, len * 8 * c_out, Lent::<Room<T>>::new, |room, block, y| {
        let groups = block * len..siblings.len().min((block + 1) * len);
        let term = |term| match term {
            &Transformed::Nodes { x, ref weights } => winograd::Term::Nodes { x, weights },
            Transformed::Shapes { products, shapes } => {
                winograd::Term::Shapes { products, shapes: &shapes[groups.clone()] }
            }
        };
        let terms: Vec<_> = terms.iter().map(term).collect();
        winograd::sum_of_terms(level, &siblings[groups.clone()], &terms, c_out, room.get(), y);
        then(8 * groups.start, y);
    });
    let used = terms.into_iter().filter_map(|term| match term {
        Transformed::Nodes { weights, .. } => Some(weights.into_memory()),
        Transformed::Shapes { .. } => None,
    });
    lent.get().give(used);
}

fn transformed<'a, T: Scalar>(
    level: Level,
    map: &KernelMap,
    term: &Term<'a, T>,
    c_out: usize,
    memory: &mut Large<T>,
) -> Transformed<'a, T> {
    match term {
        Term::Nodes { x, weights } => {
            let weights =
                winograd::transform_weights(level, weights, memory.take(), |panels, len, work| {
                    par::for_each_block(panels, len, work);
                });
            Transformed::Nodes { x, weights }
        }
        Term::Shapes { products: from, shapes } => {
            let mut products = vec![T::ZERO; shapes.len() * N_FREQUENCIES * c_out];
            for (i, to) in products.chunks_exact_mut(N_FREQUENCIES * c_out).enumerate() {
                winograd::transform_products(level, &from[i * c_out..], shapes.len() * c_out, to);
            }
            let shape = |group: usize| shapes.partition_point(|shape| shape.end <= 8 * group);
            let shapes = (0..map.siblings().len()).map(shape).collect();
            Transformed::Shapes { products, shapes }
        }
    }
}

/// [`super::kernel_product::weight_gradient_of_columns`] of a convolution that suits.
pub(super) fn weight_gradient<T: Scalar>(
    map: &KernelMap,
    (a, columns, c_a): (&[T], Range<usize>, usize),
    (g, c_g): (&[T], usize),
    grads: &mut [T],
) {
    let (level, width) = (Level::active(), columns.len());
    let step = STEP.min(map.siblings().len()).next_multiple_of(TASK);
    let (mut large, mut sums) = (Lent::<Large<T>>::new(), Lent::<Sums<T>>::new());
    let (len, len_g) = (step * N_FREQUENCIES * width, step * N_FREQUENCIES * c_g);
    let mut inputs = large.get().take_at_least(len);
    let mut gradients = large.get().take_at_least(len_g);
    let Sums([sums, d]) = sums.get();
    sums.clear();
    sums.resize(N_FREQUENCIES * width * c_g, T::ZERO);
    for (groups, g) in map.siblings().chunks(step).zip(g.chunks(step * 8 * c_g)) {
        par::for_each_block(&mut inputs[..len], TASK * N_FREQUENCIES * width, |i, to| {
            let groups = groups.chunks(TASK).nth(i).unwrap_or_default();
            winograd::transform_inputs(level, groups, (a, width), TASK, to);
        });
        par::for_each_block(&mut gradients[..len_g], TASK * N_FREQUENCIES * c_g, |i, to| {
            let g = g.chunks(TASK * 8 * c_g).nth(i).unwrap_or_default();
            winograd::transform_gradients(level, (g, c_g), TASK, to);
        });
        par::for_each_block(sums, width * c_g, |f, sums| {
            let row = |group: usize| (group / TASK * N_FREQUENCIES + f) * TASK + group % TASK;
            let rows: Vec<u32> = (0..groups.len()).map(|group| row(group) as u32).collect();
            T::matmul_tn_rows(&inputs, &rows, width, &gradients, &rows, c_g, sums);
        });
    }
    large.get().give([inputs, gradients].into_iter());
    d.resize(width * 27 * c_g, T::ZERO);
    add_gradients((sums, columns, c_a), c_g, d, grads);
}

/// Adds to the rows `columns` of each `[c_a, c_g]` what the frequencies `[64, columns.len(), c_g]` say.
fn add_gradients<T: Scalar>(
    (sums, columns, c_a): (&[T], Range<usize>, usize),
    c_g: usize,
    d: &mut [T],
    grads: &mut [T],
) {
    let (level, width) = (Level::active(), columns.len());
    par::for_each_block(d, 27 * c_g, |row, d| {
        winograd::transform_weight_gradients(level, &sums[row * c_g..], width * c_g, d);
    });
    par::for_each_block(grads, c_a * c_g, |k, grads| {
        let grads = grads[columns.start * c_g..columns.end * c_g].chunks_exact_mut(c_g);
        for (grads, d) in grads.zip(d.chunks_exact(27 * c_g)) {
            grads.iter_mut().zip(&d[k * c_g..][..c_g]).for_each(|(grad, &d)| *grad += d);
        }
    });
}
