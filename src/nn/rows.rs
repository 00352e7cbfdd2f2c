//! Dense products and column sums over blocks of rows: what linear and normalising layers share.

use crate::par;
use crate::scalar::{Scalar, identity, vectorised};
use std::borrow::Cow;
use std::ops::Range;

/// Rows of one task. A constant, so that sums over rows do not depend on the number of threads.
const BLOCK_ROWS: usize = 1024;

/// Elements of one task, where rows do not matter.
const BLOCK_ELEMENTS: usize = 1 << 15;

static IDENTITY: [u32; BLOCK_ROWS] = identity();

/// Called with the number of the first of some finished rows, and these rows.
pub(super) type Then<'a, T> = dyn Fn(usize, &mut [T]) + Sync + 'a;

/// The [`Then`] that leaves rows as they are.
pub(super) fn nothing<T>(_: usize, _: &mut [T]) {}

/// One summand of [`linear`].
pub(super) enum Term<'a, T: Scalar> {
    /// `x[n, c_in] · w[c_in, c_out]`, each element in the order of [`Scalar::matmul_rows`].
    Product { x: &'a [T], w: Cow<'a, [T]>, c_in: usize },
    /// One row of `[n_shapes, c_out]` for all rows of a shape.
    Shapes { values: Vec<T>, shapes: &'a [Range<usize>] },
}

/// `y[n, c_out] = bias + Σ terms`, and `then` on each block of rows; no bias is zeros.
pub(super) fn linear<T: Scalar>(
    terms: &[Term<T>],
    bias: Option<&[T]>,
    (n, c_out): (usize, usize),
    y: &mut Vec<T>,
    then: &Then<T>,
) {
    y.resize(n * c_out, T::ZERO);
    par::for_each_block(y, BLOCK_ROWS * c_out, |i, y| {
        let (first, rows) = (i * BLOCK_ROWS, &IDENTITY[..y.len() / c_out]);
        match bias {
            None => y.fill(T::ZERO),
            Some(bias) => y.chunks_exact_mut(c_out).for_each(|y| y.copy_from_slice(bias)),
        }
        for term in terms {
            match term {
                Term::Product { x, w, c_in } => {
                    T::matmul_rows(&x[first * c_in..], rows, *c_in, w, c_out, y, rows);
                }
                Term::Shapes { values, shapes } => {
                    for (row, y) in y.chunks_exact_mut(c_out).enumerate() {
                        let shape = shapes.partition_point(|shape| shape.end <= first + row);
                        add(y, &values[shape * c_out..]);
                    }
                }
            }
        }
        then(first, y);
    });
}

/// `y[n, c_out] += x[n, c_in] · w[c_in, c_out]`, each element in the order of [`Scalar::matmul_rows`].
pub(super) fn add_product<T: Scalar>(x: &[T], w: &[T], c_in: usize, c_out: usize, y: &mut [T]) {
    par::for_each_block(y, BLOCK_ROWS * c_out, |i, y| {
        let rows = &IDENTITY[..y.len() / c_out];
        let x = &x[i * BLOCK_ROWS * c_in..];
        T::matmul_rows(x, rows, c_in, w, c_out, y, rows);
    });
}

/// `d[k, n] += aᵀ[k, rows] · g[rows, n]`: blocks of rows, joined in order.
pub(super) fn add_transposed_product<T: Scalar>(a: &[T], k: usize, g: &[T], n: usize, d: &mut [T]) {
    let partial = par::map_blocks(a.len() / k, BLOCK_ROWS, |block| {
        let rows = &IDENTITY[..block.len()];
        let mut sum = vec![T::ZERO; k * n];
        T::matmul_tn_rows(&a[block.start * k..], rows, k, &g[block.start * n..], rows, n, &mut sum);
        sum
    });
    for sum in partial {
        add(d, &sum);
    }
}

/// `x: [rows, columns]` as `[columns, rows]`.
pub(super) fn transposed<T: Scalar>(x: &[T], rows: usize, columns: usize) -> Vec<T> {
    let column = |i| (0..rows).map(move |row| x[row * columns + i]);
    (0..columns).flat_map(column).collect()
}

/// `y += x`, element by element.
pub(super) fn add<T: Scalar>(y: &mut [T], x: &[T]) {
    y.iter_mut().zip(x).for_each(|(y, &x)| *y += x);
}

/// `y += x`, element by element, in parallel.
pub(crate) fn add_all<T: Scalar>(y: &mut [T], x: &[T]) {
    combine(y, x, |y, x| y + x);
}

/// `y = f(y, x)`, element by element, in parallel.
pub(super) fn combine<T: Scalar>(y: &mut [T], x: &[T], f: impl Fn(T, T) -> T + Sync) {
    assert_eq!(y.len(), x.len());
    par::for_each_block(y, BLOCK_ELEMENTS, |i, y| {
        let x = &x[i * BLOCK_ELEMENTS..][..y.len()];
        vectorised(
            #[inline(always)]
            || y.iter_mut().zip(x).for_each(|(y, &x)| *y = f(*y, x)),
        );
    });
}

/// Sums of `N` quantities per column over `rows`, in f64, blocks joined in order.
///
/// `add(row, sums)` adds one row's share to `sums[q][column]`.
pub(super) fn column_sums<const N: usize>(
    rows: Range<usize>,
    n_columns: usize,
    add: impl Fn(usize, &mut [Vec<f64>; N]) + Sync,
) -> [Vec<f64>; N] {
    let zero = || std::array::from_fn(|_| vec![0.0; n_columns]);
    let start = rows.start;
    let partial = par::map_blocks(rows.len(), BLOCK_ROWS, |block| {
        let mut sums = zero();
        vectorised(
            #[inline(always)]
            || block.for_each(|row| add(start + row, &mut sums)),
        );
        sums
    });
    let mut total = zero();
    for block in &partial {
        for (total, block) in total.iter_mut().zip(block) {
            self::add(total, block);
        }
    }
    total
}

/// Calls `work(row_index, row)` for every row of `x: [n, c]`.
pub(super) fn for_each_row<T: Scalar>(
    x: &mut [T],
    c: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    par::for_each_block(x, BLOCK_ROWS * c, |i, block| {
        vectorised(
            #[inline(always)]
            || {
                for (row, x) in block.chunks_exact_mut(c).enumerate() {
                    work(i * BLOCK_ROWS + row, x);
                }
            },
        );
    });
}

/// Mean and biased variance of every column of `x: [n, c]`, `n ≥ 1`; two passes.
pub(super) fn moments<T: Scalar>(x: &[T], c: usize) -> (Vec<f64>, Vec<f64>) {
    let n = x.len() / c;
    let [mut mean] = column_sums(
        0..n,
        c,
        #[inline(always)]
        |row, [sum]| {
            sum.iter_mut().zip(&x[row * c..][..c]).for_each(|(sum, x)| *sum += x.to_f64());
        },
    );
    mean.iter_mut().for_each(|m| *m /= n as f64);
    let [mut var] = column_sums(
        0..n,
        c,
        #[inline(always)]
        |row, [sum]| {
            for ((sum, x), mean) in sum.iter_mut().zip(&x[row * c..][..c]).zip(&mean) {
                let centred = x.to_f64() - mean;
                *sum += centred * centred;
            }
        },
    );
    var.iter_mut().for_each(|v| *v /= n as f64);
    (mean, var)
}
