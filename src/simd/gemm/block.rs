//! The kernel of a block of output rows: sums of products over all kernel offsets.
//!
//! ```text
//! y[o, j] = Σ over the terms in order; a term of products: Σ_k Σ_p x[i, p] · w[k, p, j]  for i →k o
//! ```
//!
//! Columns are taken a panel at a time: the sums of all rows of the block in it stay in the first-level
//! cache while every offset of every term is added, and the panels of the weights pass by once, in one
//! piece if they were packed.

use super::super::{Isa, Kernel, Simd, Vector};
use super::tile::{
    MAX_COLUMNS, Panel, PanelCopy, RowPointers, WIDTH, columns, copy_row, lanes_of, tile_rows,
    with_height,
};
pub use super::weights::PackPanel;
use super::weights::{Packed, Weights, uninit};
use super::{DEPTH, Real, check_rows, passes, tiles};
use std::ops::Range;

/// Most rows of a block: their sums in one panel of columns fill half of a first-level cache.
pub const MAX_ROWS: usize = 256;

/// Rows that meet at one kernel offset: of the input, and of the block.
pub type Pairs<'a> = (&'a [u32], &'a [u32]);

/// One summand of a block.
pub enum BlockTerm<'a, T> {
    /// Products of rows of `x: [_, depth]`.
    Products {
        /// The inputs.
        x: &'a [T],
        /// Which rows meet at each offset.
        pairs: Vec<Pairs<'a>>,
        /// What they are multiplied by.
        weights: WeightSource<'a, T>,
    },
    /// The same row, of all columns, for each of some rows of the block; one after another.
    Rows(Vec<(&'a [T], &'a [u32])>),
}

/// Where panels come from.
pub enum WeightSource<'a, T> {
    /// One piece of memory.
    Packed(&'a Packed<T>),
    /// The matrices, from which each panel is copied when it is needed.
    Matrices(Weights<'a, T>),
}

/// Inputs of [`sum_of_terms`], checked.
pub struct Block<'a, T> {
    pub(in crate::simd) terms: &'a [BlockTerm<'a, T>],
    pub(in crate::simd) columns: Range<usize>,
    pub(in crate::simd) y: &'a mut [T],
}

/// Sums of one panel of a block, a row of the panel's width each; whole cache lines.
#[repr(align(64))]
struct Sums([f32; MAX_ROWS * MAX_COLUMNS]);

/// Overwrites `y: [n_rows, columns.len()]` with these columns of the sum of the terms. Each element takes
/// its products one by one in the order of terms, offsets and columns of `x`, fused onto 0.
///
/// # Panics
/// If there are more than [`MAX_ROWS`] rows, the columns do not begin with a panel of packed weights, or a
/// term does not fit.
pub fn sum_of_terms<T: Real>(
    isa: Isa,
    terms: &[BlockTerm<T>],
    n: usize,
    columns: Range<usize>,
    y: &mut [T],
) {
    assert!(columns.start <= columns.end && columns.end <= n, "columns of the output");
    if columns.is_empty() {
        return;
    }
    let n_rows = y.len() / columns.len();
    assert!(n_rows * columns.len() == y.len() && n_rows <= MAX_ROWS, "whole rows of a block");
    for term in terms {
        check(isa, term, n, n_rows, columns.start);
    }
    T::block_sum(isa, Block { terms, columns, y });
}

fn check<T: Real>(isa: Isa, term: &BlockTerm<T>, n: usize, n_rows: usize, first: usize) {
    let within_block = |rows: &[u32]| rows.iter().all(|&row| (row as usize) < n_rows);
    match term {
        BlockTerm::Products { x, pairs, weights } => {
            let (n_offsets, depth, width) = match weights {
                WeightSource::Packed(packed) => {
                    let panel_width = T::panel_width(isa, n);
                    assert_eq!(packed.panel_width, panel_width, "packed for this instruction set");
                    assert!(first.is_multiple_of(panel_width), "columns begin with a panel");
                    (packed.n_offsets, packed.depth, packed.width)
                }
                WeightSource::Matrices(w) => (w.n_offsets(), w.depth(), w.width()),
            };
            assert_eq!((pairs.len(), width), (n_offsets, n), "offsets and columns of the weights");
            for (inputs, outputs) in pairs {
                assert_eq!(inputs.len(), outputs.len(), "one row of x for each row of the block");
                assert!(within_block(outputs), "rows of the block");
                check_rows(inputs, x.len(), depth);
            }
        }
        BlockTerm::Rows(rows) => {
            assert!(rows.iter().all(|(row, outputs)| row.len() == n && within_block(outputs)));
        }
    }
}

/// [`Block`] and memory for a panel and its sums.
struct BlockKernel<'a> {
    block: Block<'a, f32>,
    copy: &'a mut PanelCopy,
    sums: &'a mut Sums,
}

impl Block<'_, f32> {
    pub(in crate::simd) fn run(self, isa: Isa) {
        let (mut copy, mut sums) = (PanelCopy::new(), Sums([0.0; MAX_ROWS * MAX_COLUMNS]));
        let Block { terms, columns, y } = self;
        let block = Block { terms, columns, y };
        isa.run(BlockKernel { block, copy: &mut copy, sums: &mut sums });
    }
}

impl Kernel for BlockKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let BlockKernel { block: Block { terms, columns: range, y }, copy, sums } = self;
        let (width, n_columns) = (range.len(), columns::<S>());
        let sums = &mut sums.0[..y.len() / width * n_columns];
        for first in range.clone().step_by(n_columns) {
            sums.fill(0.0);
            for term in terms {
                match term {
                    BlockTerm::Products { x, pairs, weights } => {
                        add_products(s, (x, pairs), weights, first, copy, sums);
                    }
                    BlockTerm::Rows(rows) => add_rows(s, rows, first, sums),
                }
            }
            let place = first - range.start;
            for (y, sums) in y.chunks_exact_mut(width).zip(sums.chunks_exact(n_columns)) {
                for v in 0..WIDTH {
                    let lanes = S::F32::load(s, &sums[v * S::LANES..]);
                    let n = lanes_of::<S>(width - place, v);
                    let to = place + (n > 0) as usize * v * S::LANES;
                    lanes.store_partial(&mut y[to..to + n]);
                }
            }
        }
    }
}

/// Adds the products of one term to the panel that begins at column `first`.
#[inline(always)]
fn add_products<S: Simd>(
    s: S,
    (x, pairs): (&[f32], &[Pairs]),
    weights: &WeightSource<f32>,
    first: usize,
    copy: &mut PanelCopy,
    sums: &mut [f32],
) {
    let n_columns = columns::<S>();
    let depth = match weights {
        WeightSource::Packed(packed) => packed.depth,
        WeightSource::Matrices(weights) => weights.depth(),
    };
    for (k, (inputs, outputs)) in pairs.iter().enumerate().filter(|(_, p)| !p.0.is_empty()) {
        for p in passes(depth, DEPTH) {
            let panel = match weights {
                WeightSource::Packed(packed) => {
                    let place = first / n_columns * packed.n_offsets + k;
                    let numbers = &packed.numbers()[(place * depth + p.start) * n_columns..];
                    Panel::in_place(numbers, n_columns, p.len(), n_columns)
                }
                WeightSource::Matrices(weights) => {
                    let rows = copy.rows(p.len(), n_columns);
                    weights.copy_panel(s, k, p.clone(), first, rows);
                    // SAFETY: `copy_panel` writes every number of `rows`: it has `p.len()` rows of a panel's width.
                    unsafe { Panel::written::<S>(rows) }
                }
            };
            for r in tiles(inputs.len(), S::TILE_ROWS) {
                let a = RowPointers {
                    start: x[p.start..].as_ptr(),
                    rows: &inputs[r.clone()],
                    width: depth,
                };
                let c = RowPointers {
                    start: sums.as_mut_ptr(),
                    rows: &outputs[r.clone()],
                    width: n_columns,
                };
                // SAFETY: `a` and `c` have as many rows as the tile is high (`with_height`); rows of `x` are `depth`
                // wide and inside it (`check`), and p, the panel's depth, ends within them; rows of the block are
                // inside it (`check`), and the sums have a row of `n_columns = WIDTH·LANES` for each, borrowed here
                // alone; rows of the panel are as wide.
                unsafe {
                    with_height!(r.len(), tile_rows::<S, WIDTH>(s, a, panel, c, n_columns, true))
                };
            }
        }
    }
}

/// Adds to each row its share of the panel that begins at column `first`.
#[inline(always)]
fn add_rows<S: Simd>(s: S, rows: &[(&[f32], &[u32])], first: usize, sums: &mut [f32]) {
    let mut padded = [0.0; MAX_COLUMNS];
    for (row, outputs) in rows {
        let row = &row[first..];
        copy_row(s, &row[..row.len().min(columns::<S>())], uninit(&mut padded));
        for v in 0..WIDTH {
            let lanes = S::F32::load(s, &padded[v * S::LANES..]);
            for &output in *outputs {
                let sum = &mut sums[output as usize * columns::<S>() + v * S::LANES..];
                (S::F32::load(s, sum) + lanes).store(sum);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(len: usize, seed: usize) -> Vec<f32> {
        (0..len).map(|i| (((i + seed) * 7919 + 13) % 97) as f32 * 0.37 - 17.0).collect()
    }

    /// Rows that meet: some, none, all.
    fn pairs(n_offsets: usize, n_rows: usize, n_inputs: usize) -> Vec<(Vec<u32>, Vec<u32>)> {
        let some = |k: usize| {
            let outputs = (0..n_rows).filter(move |o| !(o + k).is_multiple_of(3) && k % 4 != 2);
            let pair = |o: usize| (((o * 5 + k) % n_inputs) as u32, o as u32);
            outputs.map(pair).unzip()
        };
        (0..n_offsets).map(some).collect()
    }

    struct Case {
        n_offsets: usize,
        n_rows: usize,
        rows: usize,
        columns: usize,
        some: Range<usize>,
        transposed: bool,
    }

    fn assert_equals_the_plain_sum(isa: Isa, case: &Case) {
        let Case { n_offsets, n_rows, rows, columns, .. } = *case;
        let w = numbers(n_offsets * rows * columns, 3);
        let mut weights = Weights::new(&w, rows, columns).rows(case.some.clone());
        if case.transposed {
            weights = weights.transposed().reversed();
        }
        let (depth, n) = (weights.depth(), weights.width());
        let x = numbers(40 * depth, 5);
        let (constant, lists) = (numbers(n, 7), pairs(n_offsets, n_rows, 40));
        let ones: Vec<u32> = (0..n_rows as u32).step_by(2).collect();
        let mut expected = vec![0.0f32; n_rows * n];
        ones.iter().for_each(|&o| {
            expected[o as usize * n..][..n].iter_mut().zip(&constant).for_each(|(y, c)| *y += c);
        });
        for (k, (inputs, outputs)) in lists.iter().enumerate() {
            for (&i, &o) in inputs.iter().zip(outputs) {
                for j in 0..n {
                    for p in 0..depth {
                        let place = match case.transposed {
                            false => (k * rows + case.some.start + p) * columns + j,
                            true => {
                                ((n_offsets - 1 - k) * rows + case.some.start + j) * columns + p
                            }
                        };
                        let y = &mut expected[o as usize * n + j];
                        *y = x[i as usize * depth + p].mul_add(w[place], *y);
                    }
                }
            }
        }
        let packed = Packed::new(isa, &weights, vec![f32::NAN; 7], |numbers, len, work| {
            numbers.chunks_mut(len).enumerate().for_each(|(i, block)| work(i, block));
        });
        for source in [WeightSource::Packed(&packed), WeightSource::Matrices(weights.clone())] {
            let pairs = lists.iter().map(|(i, o)| (&i[..], &o[..])).collect();
            let rows = BlockTerm::Rows(vec![(&constant[..], &ones[..])]);
            let terms = [rows, BlockTerm::Products { x: &x, pairs, weights: source }];
            for split in [0, 64.min(n)] {
                for columns in [0..split, split..n] {
                    let mut y = vec![f32::NAN; n_rows * columns.len()];
                    sum_of_terms(isa, &terms, n, columns.clone(), &mut y);
                    let expected = expected.chunks_exact(n).flat_map(|row| &row[columns.clone()]);
                    assert!(y.iter().zip(expected).all(|(a, b)| a.to_bits() == b.to_bits()));
                }
            }
        }
    }

    #[test]
    fn every_isa_equals_the_plain_sum_packed_or_not() {
        for &isa in Isa::available() {
            for (n_rows, rows, columns) in [
                (1, 1, 1),
                (5, 7, 16),
                (13, 17, 33),
                (32, 48, 96),
                (7, 2 * DEPTH + 3, 5),
                (256, 8, 70),
            ]
            .into_iter()
            .take(if cfg!(miri) { 3 } else { 6 })
            {
                for transposed in [false, true] {
                    for some in [0..rows, rows / 3..rows] {
                        let case = Case { n_offsets: 5, n_rows, rows, columns, some, transposed };
                        assert_equals_the_plain_sum(isa, &case);
                    }
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "rows of the block")]
    fn an_output_row_outside_the_block_panics() {
        let (x, w, mut y) = ([0.0f32; 4], [0.0; 4], [0.0; 4]);
        let weights = WeightSource::Matrices(Weights::new(&w, 2, 2));
        let terms = [BlockTerm::Products { x: &x, pairs: vec![(&[0], &[2])], weights }];
        sum_of_terms(Isa::active(), &terms, 2, 0..2, &mut y);
    }

    #[test]
    #[should_panic(expected = "row 2 of width 2 in 4 numbers")]
    fn an_input_row_outside_its_matrix_panics() {
        let (x, w, mut y) = ([0.0f32; 4], [0.0; 4], [0.0; 4]);
        let weights = WeightSource::Matrices(Weights::new(&w, 2, 2));
        let terms = [BlockTerm::Products { x: &x, pairs: vec![(&[2], &[0])], weights }];
        sum_of_terms(Isa::active(), &terms, 2, 0..2, &mut y);
    }
}
