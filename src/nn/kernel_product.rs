//! Products over a kernel map: the loop behind every convolution, and its weight gradient.
//!
//! `y[o] = Σ_k Σ_{i →k o} x[i]·W_k`. A block of outputs is one task; each output row takes its terms in
//! order, for each its offsets in order and, within one, the input channels in order, so that its value
//! depends on nothing but its own inputs. Wide 3×3×3 convolutions take another way: see `nn/winograd.rs`.

use super::lent::{Large, Lent};
use super::rows::{Then, nothing};
use super::winograd;
use crate::octree::KernelMap;
use crate::par;
use crate::scalar::block::{self, Source};
use crate::scalar::weights::Packed;
pub(super) use crate::scalar::weights::Weights;
use crate::scalar::{Level, Scalar, matmul_columns, vectorised};
use std::ops::Range;

/// Output rows per partial sum of a weight gradient.
const RANGE_ROWS: usize = 8192;
/// Parts into which the columns of a map of one block are cut, and the width they are multiples of: whole
/// cache lines of weights that nobody else reads.
const PARTS: usize = 4;
const PART_WIDTH: usize = 32;

/// Some of the input columns of a product.
pub(super) enum Term<'a, T> {
    /// `x: [n_inputs, depth of the weights]`.
    Nodes { x: &'a [T], weights: Weights<'a, T> },
    /// Columns that are the same in all rows of a shape, multiplied already: what each shape adds for
    /// each offset, `[n_offsets, n_shapes, c_out]`. Inputs and outputs are the same rows.
    Shapes { products: Vec<T>, shapes: &'a [Range<usize>] },
}

/// `y[o] = Σ_k Σ_{i →k o} x[i]·weights[k]`; `y` is overwritten.
pub(super) fn product<T: Scalar>(map: &KernelMap, x: &[T], weights: Weights<T>, y: &mut Vec<T>) {
    product_then(map, x, weights, y, &nothing);
}

/// [`product`], and `then` on each block of rows as soon as it is done.
pub(super) fn product_then<T: Scalar>(
    map: &KernelMap,
    x: &[T],
    weights: Weights<T>,
    y: &mut Vec<T>,
    then: &Then<T>,
) {
    let c_out = weights.width();
    sum_of_terms(map, &[Term::Nodes { x, weights }], c_out, y, then);
}

/// [`product_then`] with the columns of `x` in several terms.
pub(super) fn sum_of_terms<T: Scalar>(
    map: &KernelMap,
    terms: &[Term<T>],
    c_out: usize,
    y: &mut Vec<T>,
    then: &Then<T>,
) {
    for term in terms {
        if let Term::Nodes { x, weights } = term {
            let n = map.n_inputs() * weights.depth();
            assert_eq!(x.len(), n, "rows of the input and of the kernel map differ");
        }
    }
    y.resize(map.n_outputs() * c_out, T::ZERO);
    let suits = |term: &Term<T>| match term {
        Term::Nodes { weights, .. } => winograd::suits(map, weights.depth(), c_out),
        Term::Shapes { .. } => true,
    };
    match map.n_blocks() {
        _ if terms.iter().all(suits) => winograd::sum_of_terms(map, terms, c_out, y, then),
        1 => {
            sum_by_columns(map, terms, c_out, y);
            then(0, y);
        }
        _ => sum_by_blocks(map, terms, c_out, y, then),
    }
}

/// A block of rows is one task. Weights are packed once for all blocks.
fn sum_by_blocks<T: Scalar>(
    map: &KernelMap,
    terms: &[Term<T>],
    c_out: usize,
    y: &mut [T],
    then: &Then<T>,
) {
    let (level, mut lent) = (Level::active(), Lent::<Large<T>>::new());
    let pack = |term: &Term<T>| match term {
        Term::Nodes { weights, .. } => {
            let memory = lent.get().take();
            Some(Packed::new(level, weights, memory, |panels, len, work| {
                par::for_each_block(panels, len, work);
            }))
        }
        Term::Shapes { .. } => None,
    };
    let packed: Vec<_> = terms.iter().map(pack).collect();
    par::for_each_block(y, map.block_len() * c_out, |block, rows| {
        let source = |i: usize| packed[i].as_ref().map(Source::Packed);
        let terms = terms_of_block(map, block, terms, c_out, source);
        block::sum_of_terms(level, &terms, c_out, 0..c_out, rows);
        then(block * map.block_len(), rows);
    });
    lent.get().give(packed.into_iter().flatten().map(Packed::into_memory));
}

/// Some columns of all rows are one task: few rows take less time than their weights take to be read,
/// which is done once.
fn sum_by_columns<T: Scalar>(map: &KernelMap, terms: &[Term<T>], c_out: usize, y: &mut [T]) {
    let level = Level::active();
    let width = c_out.div_ceil(PARTS).next_multiple_of(PART_WIDTH);
    let columns = |part: usize| part * width..c_out.min((part + 1) * width);
    let plain = |term: &Term<T>| match term {
        Term::Nodes { weights, .. } => weights.plain(0).is_some(),
        Term::Shapes { .. } => true,
    };
    let in_place = terms.iter().all(plain);
    let parts = par::map(c_out.div_ceil(width), |part| {
        let columns = columns(part);
        let mut y = vec![T::ZERO; map.n_outputs() * columns.len()];
        if in_place {
            add_in_place(level, map, terms, c_out, columns, &mut y);
        } else {
            let copied = |i: usize| match &terms[i] {
                Term::Nodes { weights, .. } => Some(Source::Matrices(weights.clone())),
                Term::Shapes { .. } => None,
            };
            let terms = terms_of_block(map, 0, terms, c_out, copied);
            block::sum_of_terms(level, &terms, c_out, columns, &mut y);
        }
        y
    });
    for (row, y) in y.chunks_exact_mut(c_out).enumerate() {
        for (part, from) in parts.iter().enumerate() {
            let columns = columns(part);
            y[columns.clone()].copy_from_slice(&from[row * columns.len()..][..columns.len()]);
        }
    }
}

/// Adds some columns of the terms to `y`, offset by offset, so that weights are read as they lie.
fn add_in_place<T: Scalar>(
    level: Level,
    map: &KernelMap,
    terms: &[Term<T>],
    c_out: usize,
    columns: Range<usize>,
    y: &mut [T],
) {
    for term in terms {
        for k in 0..map.n_offsets() {
            let (inputs, outputs) = map.pairs(0, k);
            match term {
                Term::Nodes { x, weights } => {
                    let w = weights.plain(k).expect("weights that are not transposed");
                    let (w, c) = ((w, c_out, columns.clone()), (&mut *y, outputs));
                    matmul_columns(level, (x, inputs), weights.depth(), w, c);
                }
                Term::Shapes { products, shapes } => {
                    for_each_shape(shapes, 0, outputs, |shape, outputs| {
                        let product = &products[(k * shapes.len() + shape) * c_out..][..c_out];
                        let product = &product[columns.clone()];
                        vectorised(
                            #[inline(always)]
                            || add_to_rows(product, outputs, y),
                        );
                    });
                }
            }
        }
    }
}

/// The terms as the kernel takes them; `source(i)` holds the weights of term `i`.
fn terms_of_block<'a, T: Scalar>(
    map: &'a KernelMap,
    block: usize,
    terms: &'a [Term<T>],
    c_out: usize,
    source: impl Fn(usize) -> Option<Source<'a, T>>,
) -> Vec<block::Term<'a, T>> {
    let offsets = 0..map.n_offsets();
    let term = |(i, term): (usize, &'a Term<T>)| match (term, source(i)) {
        (Term::Nodes { x, .. }, Some(weights)) => {
            let pairs = offsets.clone().map(|k| map.pairs(block, k)).collect();
            block::Term::Products { x, pairs, weights }
        }
        (Term::Shapes { products, shapes }, _) => {
            let mut rows = Vec::new();
            for k in offsets.clone() {
                let first = block * map.block_len();
                for_each_shape(shapes, first, map.pairs(block, k).1, |shape, outputs| {
                    let product = &products[(k * shapes.len() + shape) * c_out..][..c_out];
                    rows.push((product, outputs));
                });
            }
            block::Term::Rows(rows)
        }
        _ => unreachable!("each product has its weights"),
    };
    terms.iter().enumerate().map(term).collect()
}

/// Adds `x` to these rows of `y`.
#[inline(always)]
fn add_to_rows<T: Scalar>(x: &[T], rows: &[u32], y: &mut [T]) {
    for &row in rows {
        let y = &mut y[row as usize * x.len()..][..x.len()];
        y.iter_mut().zip(x).for_each(|(y, &x)| *y += x);
    }
}

/// Calls `work(shape, rows)` for the runs of `rows`, ascending and counted from `first`, that lie in one
/// shape.
fn for_each_shape<'a>(
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

/// `sums[k, s] = Σ_o g[o]` over the output rows `o` of shape `s` that have an input at offset `k`:
/// `[n_offsets, n_shapes, c]`. Inputs and outputs are the same rows.
pub(super) fn sums_of_shapes<T: Scalar>(
    map: &KernelMap,
    shapes: &[Range<usize>],
    g: &[T],
    c: usize,
) -> Vec<T> {
    let partials = par::map(map.n_blocks(), |block| {
        let first = block * map.block_len();
        let mut partial = Vec::new();
        for k in 0..map.n_offsets() {
            for_each_shape(shapes, first, map.pairs(block, k).1, |shape, outputs| {
                let mut sum = vec![T::ZERO; c];
                vectorised(
                    #[inline(always)]
                    || {
                        for &o in outputs {
                            let g = &g[(first + o as usize) * c..][..c];
                            sum.iter_mut().zip(g).for_each(|(sum, &g)| *sum += g);
                        }
                    },
                );
                partial.push((k * shapes.len() + shape, sum));
            });
        }
        partial
    });
    let mut sums = vec![T::ZERO; map.n_offsets() * shapes.len() * c];
    for (slot, partial) in partials.into_iter().flatten() {
        sums[slot * c..][..c].iter_mut().zip(partial).for_each(|(sum, p)| *sum += p);
    }
    sums
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
    weight_gradient_of_columns(map, group, (a, 0..c_a, c_a), (g, c_g), grads);
}

/// [`weight_gradient`] where `a` has only `columns` of the `c_a` input columns.
pub(super) fn weight_gradient_of_columns<T: Scalar>(
    map: &KernelMap,
    group: usize,
    (a, columns, c_a): (&[T], Range<usize>, usize),
    (g, c_g): (&[T], usize),
    grads: &mut [T],
) {
    let width = columns.len();
    assert_eq!(a.len(), map.n_inputs() * group * width, "rows of `a` and of the kernel map differ");
    assert_eq!(g.len(), map.n_outputs() * c_g, "rows of `g` and of the kernel map differ");
    if group == 1 && winograd::suits_gradient(map, width, c_g) {
        winograd::weight_gradient(map, (a, columns, c_a), (g, c_g), grads);
        return;
    }
    let blocks_per_range = (RANGE_ROWS / map.block_len().max(1)).max(1);
    let n_ranges = map.n_blocks().div_ceil(blocks_per_range);
    let add = |slot: usize, range: usize, d: &mut [T]| {
        let first = range * blocks_per_range;
        let blocks = first..(first + blocks_per_range).min(map.n_blocks());
        let (inputs, outputs) = pairs_of_blocks(map, blocks, group, slot);
        T::matmul_tn_rows(a, &inputs, width, g, &outputs, c_g, d);
    };
    let place = columns.start * c_g..columns.end * c_g;
    if n_ranges <= 1 {
        par::for_each_block(grads, c_a * c_g, |slot, d| add(slot, 0, &mut d[place.clone()]));
        return;
    }
    let partials = par::map(grads.len() / (c_a * c_g) * n_ranges, |task| {
        let mut d = vec![T::ZERO; width * c_g];
        add(task / n_ranges, task % n_ranges, &mut d);
        d
    });
    par::for_each_block(grads, c_a * c_g, |slot, d| {
        for partial in &partials[slot * n_ranges..(slot + 1) * n_ranges] {
            d[place.clone()].iter_mut().zip(partial).for_each(|(d, &p)| *d += p);
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

/// `y[r] = Σ_k x[k·n + r]·weights[k]`: `n` rows of `y`, for each of which every offset has one row of `x`.
pub(super) fn product_of_rows<T: Scalar>(x: &[T], n: usize, weights: &Weights<T>, y: &mut Vec<T>) {
    let (depth, c_out) = (weights.depth(), weights.width());
    assert_eq!(x.len(), weights.n_offsets() * n * depth, "one row for each offset and output");
    y.resize(n * c_out, T::ZERO);
    par::for_each_block(y, block::MAX_ROWS * c_out, |i, y| {
        let outputs: Vec<u32> = (0..(y.len() / c_out) as u32).collect();
        let first = |k: usize| (k * n + i * block::MAX_ROWS) as u32;
        let inputs =
            (0..weights.n_offsets()).map(|k| outputs.iter().map(|r| first(k) + r).collect());
        let inputs: Vec<Vec<u32>> = inputs.collect();
        let pairs = inputs.iter().map(|inputs| (&inputs[..], &outputs[..])).collect();
        let weights = Source::Matrices(weights.clone());
        let terms = [block::Term::Products { x, pairs, weights }];
        block::sum_of_terms(Level::active(), &terms, c_out, 0..c_out, y);
    });
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
