//! The algorithm for few rows, which take less time than reading the weights: one task computes some columns of all
//! output rows, so that the weights are read once.

use super::super::arena::Arena;
use super::blocks::terms_of_block;
use super::product::{Product, Term};
use super::shapes::for_each_shape;
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::octree::KernelMap;
use crate::simd::Isa;
use crate::simd::elementwise::{self, Combination};
use crate::simd::gemm::block::{self, WeightSource};
use crate::simd::gemm::matmul_columns;
use std::ops::Range;

/// Parts into which the columns of a map of one block are cut, and the width they are multiples of: whole
/// cache lines of weights that no other task reads.
const PARTS: usize = 4;
const PART_WIDTH: usize = 32;

pub(super) fn sum_of_terms<T: Scalar>(
    arena: &Arena<T>,
    map: &KernelMap,
    product: &Product<T>,
    y: &mut [T],
) {
    let (isa, c_out) = (Isa::active(), product.c_out);
    let width = c_out.div_ceil(PARTS).next_multiple_of(PART_WIDTH);
    let columns = |part: usize| part * width..c_out.min((part + 1) * width);
    let parts = par::map(c_out.div_ceil(width), |part| {
        let columns = columns(part);
        let mut y = arena.zeroed(map.n_outputs() * columns.len());
        if product.terms.iter().all(is_plain) {
            add_in_place(isa, map, product, columns, &mut y);
        } else {
            let copied = |i: usize| match &product.terms[i] {
                Term::Nodes { weights, .. } => Some(WeightSource::Matrices(weights.clone())),
                Term::Shapes { .. } => None,
            };
            let terms = terms_of_block(map, 0, product, copied);
            block::sum_of_terms(isa, &terms, c_out, columns, &mut y);
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

fn is_plain<T: Scalar>(term: &Term<T>) -> bool {
    match term {
        Term::Nodes { weights, .. } => weights.plain(0).is_some(),
        Term::Shapes { .. } => true,
    }
}

/// Adds some columns of the terms to `y`, offset by offset, so that weights are read as they lie.
fn add_in_place<T: Scalar>(
    isa: Isa,
    map: &KernelMap,
    product: &Product<T>,
    columns: Range<usize>,
    y: &mut [T],
) {
    let c_out = product.c_out;
    for term in product.terms {
        for k in 0..map.n_offsets() {
            let (inputs, outputs) = map.pairs(0, k);
            match term {
                Term::Nodes { x, weights } => {
                    let w = weights.plain(k).expect("weights that are not transposed");
                    let (w, c) = ((w, c_out, columns.clone()), (&mut *y, outputs));
                    matmul_columns(isa, (x, inputs), weights.depth(), w, c);
                }
                Term::Shapes { products, shapes } => {
                    for_each_shape(shapes, 0, outputs, |shape, outputs| {
                        let product = &products[(k * shapes.len() + shape) * c_out..][..c_out];
                        add_to_rows(isa, &product[columns.clone()], outputs, y);
                    });
                }
            }
        }
    }
}

/// Adds `x` to these rows of `y`.
fn add_to_rows<T: Scalar>(isa: Isa, x: &[T], rows: &[u32], y: &mut [T]) {
    for &row in rows {
        let y = &mut y[row as usize * x.len()..][..x.len()];
        elementwise::combine(isa, Combination::Add, y, x);
    }
}
