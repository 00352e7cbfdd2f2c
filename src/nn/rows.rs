//! Sums over columns and work on rows, by blocks of rows: what normalising and elementwise layers share.

use crate::par;
use crate::scalar::{Scalar, vectorised};
use std::ops::Range;

/// Rows of one task. A constant, so that sums over rows do not depend on the number of threads.
pub(super) const BLOCK_ROWS: usize = 1024;

/// Elements of one task, where rows do not matter.
const BLOCK_ELEMENTS: usize = 1 << 15;

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

/// Sums over `rows` of what `row` returns, per column.
pub(super) fn sums_of_columns<'a, T: Scalar>(
    rows: Range<usize>,
    n_columns: usize,
    row: impl Fn(usize) -> &'a [T] + Sync,
) -> Vec<f64> {
    let [sums] = column_sums(
        rows,
        n_columns,
        #[inline(always)]
        |i, [sum]| sum.iter_mut().zip(row(i)).for_each(|(sum, x)| *sum += x.to_f64()),
    );
    sums
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
    let mut mean = sums_of_columns(
        0..n,
        c,
        #[inline(always)]
        |row| &x[row * c..][..c],
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
