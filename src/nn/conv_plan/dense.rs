//! Products in which each row meets only itself: linear layers.

use super::super::arena::Arena;
use super::super::rows::{self, BLOCK_ROWS};
use super::product::{Product, Term};
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::simd::Isa;
use crate::simd::gemm::{identity, matmul_rows, matmul_tn_rows};

static IDENTITY: [u32; BLOCK_ROWS] = identity();

/// `y[n, c_out] = bias + Σ terms`, each element in the order of [`matmul_rows`]; no bias is zeros.
pub(super) fn sum_of_terms<T: Scalar>(product: &Product<T>, y: &mut [T]) {
    let c_out = product.c_out;
    par::for_each_block(y, BLOCK_ROWS * c_out, |i, y| {
        let first = i * BLOCK_ROWS;
        match product.bias {
            None => y.fill(T::ZERO),
            Some(bias) => y.chunks_exact_mut(c_out).for_each(|y| y.copy_from_slice(bias)),
        }
        product.terms.iter().for_each(|term| add_term(term, c_out, first, y));
        product.finish(first, y);
    });
}

/// Adds one term to the rows `y`, whose first one has number `first`.
fn add_term<T: Scalar>(term: &Term<T>, c_out: usize, first: usize, y: &mut [T]) {
    match term {
        Term::Nodes { x, weights } => {
            let (c_in, rows) = (weights.depth(), &IDENTITY[..y.len() / c_out]);
            let w = weights.plain(0).expect("weights that are not transposed");
            matmul_rows(Isa::active(), (&x[first * c_in..], rows), c_in, w, c_out, (y, rows));
        }
        Term::Shapes { products, shapes } => {
            for (row, y) in y.chunks_exact_mut(c_out).enumerate() {
                let shape = shapes.partition_point(|shape| shape.end <= first + row);
                rows::add(y, &products[shape * c_out..]);
            }
        }
    }
}

/// `y[n, c_out] += x[n, c_in] · w[c_in, c_out]`, each element in the order of [`matmul_rows`].
pub(in crate::nn) fn add_product<T: Scalar>(
    x: &[T],
    w: &[T],
    c_in: usize,
    c_out: usize,
    y: &mut [T],
) {
    par::for_each_block(y, BLOCK_ROWS * c_out, |i, y| {
        add_product_here(&x[i * BLOCK_ROWS * c_in..], w, c_in, c_out, y);
    });
}

/// [`add_product`] on this thread alone.
pub(in crate::nn) fn add_product_here<T: Scalar>(
    x: &[T],
    w: &[T],
    c_in: usize,
    c_out: usize,
    y: &mut [T],
) {
    for (i, y) in y.chunks_mut((BLOCK_ROWS * c_out).max(1)).enumerate() {
        let (x, rows) = (&x[i * BLOCK_ROWS * c_in..], &IDENTITY[..y.len() / c_out]);
        matmul_rows(Isa::active(), (x, rows), c_in, w, c_out, (y, rows));
    }
}

/// `d[k, n] += aᵀ[k, rows] · g[rows, n]`: blocks of rows, joined in order.
pub(in crate::nn) fn add_transposed_product<T: Scalar>(
    arena: &Arena<T>,
    (a, k): (&[T], usize),
    (g, n): (&[T], usize),
    d: &mut [T],
) {
    let n_rows = a.len() / k;
    let mut partial = arena.zeroed(n_rows.div_ceil(BLOCK_ROWS) * k * n);
    par::for_each_block(&mut partial, k * n, |i, sum| {
        let first = i * BLOCK_ROWS;
        let rows = &IDENTITY[..BLOCK_ROWS.min(n_rows - first)];
        let (a, g) = ((&a[first * k..], rows), (&g[first * n..], rows));
        matmul_tn_rows(Isa::active(), a, k, g, n, sum);
    });
    partial.chunks_exact(k * n).for_each(|sum| rows::add(d, sum));
}

/// `x: [rows, columns]` into `y: [columns, rows]`.
pub(in crate::nn) fn transpose<T: Scalar>(x: &[T], rows: usize, columns: usize, y: &mut [T]) {
    for (i, y) in y.chunks_exact_mut(rows).enumerate() {
        y.iter_mut().enumerate().for_each(|(row, y)| *y = x[row * columns + i]);
    }
}
