//! Parallel work on blocks of rows, and sums over columns in a fixed order.

use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::simd::elementwise::{self, Combination};
use crate::simd::{Isa, normalize};
use std::ops::Range;

/// Rows of one task. A constant, so that sums over rows do not depend on the number of threads.
pub(super) const BLOCK_ROWS: usize = 1024;

/// Elements of one task, where rows do not matter.
const BLOCK_ELEMENTS: usize = 1 << 15;

/// `y += x`, element by element.
pub(super) fn add<T: Scalar>(y: &mut [T], x: &[T]) {
    elementwise::combine(Isa::active(), Combination::Add, y, &x[..y.len()]);
}

/// `y += x`, element by element, in parallel.
pub(crate) fn add_all<T: Scalar>(y: &mut [T], x: &[T]) {
    combine(Combination::Add, y, x);
}

/// `y = combination(y, x)`, element by element, in parallel.
pub(super) fn combine<T: Scalar>(combination: Combination, y: &mut [T], x: &[T]) {
    assert_eq!(y.len(), x.len());
    par::for_each_block(y, BLOCK_ELEMENTS, |i, y| {
        let x = &x[i * BLOCK_ELEMENTS..][..y.len()];
        elementwise::combine(Isa::active(), combination, y, x);
    });
}

/// `max(x, 0)` in place, in parallel.
pub(super) fn rectify<T: Scalar>(x: &mut [T]) {
    par::for_each_block(x, BLOCK_ELEMENTS, |_, x| elementwise::relu(Isa::active(), x));
}

/// Sums of `N` quantities per column over `rows`, in f64, blocks joined in order.
///
/// `add(block, sums)` adds the share of a block of rows to `sums[q][column]`.
pub(super) fn column_sums<const N: usize>(
    rows: Range<usize>,
    n_columns: usize,
    add: impl Fn(Range<usize>, [&mut [f64]; N]) + Sync,
) -> [Vec<f64>; N] {
    let zero = || std::array::from_fn(|_| vec![0.0; n_columns]);
    let start = rows.start;
    let partial = par::map_blocks(rows.len(), BLOCK_ROWS, |block| {
        let mut sums: [Vec<f64>; N] = zero();
        add(start + block.start..start + block.end, sums.each_mut().map(|sums| &mut sums[..]));
        sums
    });
    let mut total = zero();
    for block in &partial {
        for (total, block) in total.iter_mut().zip(block) {
            total.iter_mut().zip(block).for_each(|(total, sum)| *total += sum);
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
    let [sums] = column_sums(rows, n_columns, |block, [sums]| {
        let isa = Isa::active();
        block.for_each(|i| normalize::column_sums(isa, row(i), None, sums));
    });
    sums
}

/// Calls `work(row_index, row)` for every row of `x: [n, c]`.
pub(super) fn for_each_row<T: Scalar>(
    x: &mut [T],
    c: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    par::for_each_block(x, BLOCK_ROWS * c, |i, block| {
        for (row, x) in block.chunks_exact_mut(c).enumerate() {
            work(i * BLOCK_ROWS + row, x);
        }
    });
}

/// Mean and biased variance of every column of `x: [n, c]`, `n ≥ 1`; two passes.
pub(super) fn moments<T: Scalar>(x: &[T], c: usize) -> (Vec<f64>, Vec<f64>) {
    let n = x.len() / c;
    let sums = |mean: Option<&[f64]>| {
        let [mut sums] = column_sums(0..n, c, |block, [sums]| {
            normalize::column_sums(Isa::active(), &x[block.start * c..block.end * c], mean, sums);
        });
        sums.iter_mut().for_each(|sum| *sum /= n as f64);
        sums
    };
    let mean = sums(None);
    let var = sums(Some(&mean));
    (mean, var)
}
