//! Matrix products of gathered rows: a register tile that reads its rows through pointers.
//!
//! ```text
//! matmul_rows:     c[c_rows[r], j] += Σ_p a[a_rows[r], p] · b[p, j]          p ascending
//! matmul_tn_rows:  d[p, j]         += Σ_r a[a_rows[r], p] · g[g_rows[r], j]  r ascending
//! ```
//!
//! 1. A tile of `M` rows and `V` vectors of the output is loaded into registers, takes its products
//!    one index of the sum at a time, and is stored again. Each lane is one output; no sum is ever
//!    split, so tile sizes, tails and instruction sets cannot change a bit.
//! 2. Rows are gathered by pointers in the tile: no im2col, no copy of `a`.
//! 3. Columns are taken a tile's width at a time from a panel: a copy of these columns of `b` or `g`
//!    that stays in the first-level cache while all row tiles pass over it; where there are too few
//!    row tiles to pay for the copy, the matrix itself is read.
//! 4. The last columns are padded with zeros in the panel; the output's are loaded and stored by mask.
//! 5. Rows are split into tiles of equal height, give or take one, so that no tile is short of
//!    independent sums to hide the latency of the multiply-add; the higher ones come first.
//!
//! Tiles exist for `f32`. Products of `f64` go to matrixmultiply (`simd/double.rs`): they serve gradient
//! checks. `benches/gemm.rs` compares the tiles with matrixmultiply's.

pub mod block;
mod tile;
pub mod weights;
pub mod winograd;

use super::Real;
use super::{Isa, Kernel, Simd};
use std::ops::Range;
use tile::{Panel, PanelCopy, RowPointers, WIDTH, columns, tile_rows, tile_tn, with_height};

/// Sum indices per pass: a panel of this depth fills half of a 32 KB first-level cache at 16 columns.
const DEPTH: usize = 256;

/// Rows per pass of a weight gradient: a panel of them and the lines of `a` that a tile reads share that
/// cache.
const TN_DEPTH: usize = 128;

/// Fewest rows and columns of `c` for which copying a panel of `b` pays: narrower matrices stay in
/// the first-level cache as they are (benches/gemm.rs).
const ROWS_FOR_PANEL: usize = 64;
const WIDTH_FOR_PANEL: usize = 128;

/// Rows that are too few to hide the latency of the multiply-add in tiles of the usual width: wider ones
/// do, and read `b` in longer stretches.
const FEW: usize = 3;
const FEW_WIDTH: usize = 2 * WIDTH;

/// Inputs of [`matmul_rows`], checked.
pub struct MatmulRows<'a, T> {
    pub(super) a: &'a [T],
    pub(super) a_rows: &'a [u32],
    pub(super) k: usize,
    pub(super) b: &'a [T],
    pub(super) n: usize,
    pub(super) columns: Range<usize>,
    pub(super) c: &'a mut [T],
    pub(super) c_rows: &'a [u32],
}

/// Inputs of [`matmul_tn_rows`], checked.
pub struct MatmulTnRows<'a, T> {
    pub(super) a: &'a [T],
    pub(super) a_rows: &'a [u32],
    pub(super) k: usize,
    pub(super) g: &'a [T],
    pub(super) g_rows: &'a [u32],
    pub(super) n: usize,
    pub(super) d: &'a mut [T],
}

/// `c[c_rows[r], j] += Σ_p a[a_rows[r], p] · b[p, j]` with a chosen instruction set; `c_rows` must not repeat a row.
///
/// # Panics
/// If a row index is outside its matrix, the two row lists differ in length, or `b` is not `[k, n]`.
pub fn matmul_rows<T: Real>(
    isa: Isa,
    (a, a_rows): (&[T], &[u32]),
    k: usize,
    b: &[T],
    n: usize,
    (c, c_rows): (&mut [T], &[u32]),
) {
    matmul_columns(isa, (a, a_rows), k, (b, n, 0..n), (c, c_rows));
}

/// [`matmul_rows`] with some columns of `b: [k, n]` alone: `c` has only these.
///
/// # Panics
/// As [`matmul_rows`], and if `b` lacks the columns.
pub fn matmul_columns<T: Real>(
    isa: Isa,
    (a, a_rows): (&[T], &[u32]),
    k: usize,
    (b, n, columns): (&[T], usize, Range<usize>),
    (c, c_rows): (&mut [T], &[u32]),
) {
    assert_eq!(a_rows.len(), c_rows.len(), "one row of a for each row of c");
    assert_eq!(b.len(), k * n, "b is [k, n]");
    assert!(columns.start <= columns.end && columns.end <= n, "columns of b");
    check_rows(a_rows, a.len(), k);
    check_rows(c_rows, c.len(), columns.len());
    if !a_rows.is_empty() && k * columns.len() > 0 {
        T::product(isa, MatmulRows { a, a_rows, k, b, n, columns, c, c_rows });
    }
}

/// `d[p, j] += Σ_r a[a_rows[r], p] · g[g_rows[r], j]` with a chosen instruction set.
///
/// # Panics
/// If a row index is outside its matrix, the two row lists differ in length, or `d` is not `[k, n]`.
pub fn matmul_tn_rows<T: Real>(
    isa: Isa,
    (a, a_rows): (&[T], &[u32]),
    k: usize,
    (g, g_rows): (&[T], &[u32]),
    n: usize,
    d: &mut [T],
) {
    assert_eq!(a_rows.len(), g_rows.len(), "one row of a for each row of g");
    assert_eq!(d.len(), k * n, "d is [k, n]");
    check_rows(a_rows, a.len(), k);
    check_rows(g_rows, g.len(), n);
    if !a_rows.is_empty() && k * n > 0 {
        T::transposed_product(isa, MatmulTnRows { a, a_rows, k, g, g_rows, n, d });
    }
}

/// Panics unless every row of width `width` lies inside a matrix of `len` numbers.
fn check_rows(rows: &[u32], len: usize, width: usize) {
    if let Some(last) = rows.iter().copied().max() {
        let end = (last as usize).checked_add(1).and_then(|n| n.checked_mul(width));
        assert!(end.is_some_and(|end| end <= len), "row {last} of width {width} in {len} numbers");
    }
}

/// The row numbers `0..N`, of rows that are not gathered.
pub const fn identity<const N: usize>() -> [u32; N] {
    let mut rows = [0; N];
    let mut i = 0;
    while i < N {
        rows[i] = i as u32;
        i += 1;
    }
    rows
}

/// [`MatmulRows`] and memory for a panel.
struct RowsKernel<'a>(MatmulRows<'a, f32>, &'a mut PanelCopy);

/// [`MatmulTnRows`] and memory for panels.
struct TnRowsKernel<'a>(MatmulTnRows<'a, f32>, &'a mut PanelCopy);

impl<'a> MatmulRows<'a, f32> {
    pub(super) fn run(self, isa: Isa) {
        isa.run(RowsKernel(self, &mut PanelCopy::new()));
    }
}

impl<'a> MatmulTnRows<'a, f32> {
    pub(super) fn run(self, isa: Isa) {
        isa.run(TnRowsKernel(self, &mut PanelCopy::new()));
    }
}

impl Kernel for RowsKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let RowsKernel(x, copy) = self;
        let whole = x.columns.len().is_multiple_of(FEW_WIDTH * S::LANES);
        if x.a_rows.len() <= FEW && S::TILE_ROWS >= FEW && whole {
            matmul_few_rows(s, x);
        } else {
            matmul_all_rows(s, x, copy);
        }
    }
}

#[inline(always)]
fn matmul_all_rows<S: Simd>(s: S, x: MatmulRows<'_, f32>, copy: &mut PanelCopy) {
    let n_columns = columns::<S>();
    let wide = x.n >= WIDTH_FOR_PANEL && x.a_rows.len() >= ROWS_FOR_PANEL;
    for p in passes(x.k, DEPTH) {
        for start in x.columns.clone().step_by(n_columns) {
            let j = start..x.columns.end.min(start + n_columns);
            let panel = if wide || j.len() < n_columns {
                let rows = x.b[p.start * x.n..p.end * x.n].chunks_exact(x.n);
                let rows = rows.map(|row| &row[j.clone()]);
                Panel::copied(s, copy.rows(p.len(), n_columns), rows)
            } else {
                Panel::in_place(&x.b[p.start * x.n + j.start..], x.n, p.len(), n_columns)
            };
            for r in tiles(x.a_rows.len(), S::TILE_ROWS) {
                let a = x.a[p.start..].as_ptr();
                let a = RowPointers { start: a, rows: &x.a_rows[r.clone()], width: x.k };
                let c = x.c[j.start - x.columns.start..].as_mut_ptr();
                let width = x.columns.len();
                let c = RowPointers { start: c, rows: &x.c_rows[r.clone()], width };
                // SAFETY: `a` and `c` have as many rows as the tile is high (`with_height`); rows of `a` are `k` wide
                // and inside it (`check_rows`), and p, the panel's depth, ends within them; rows of `c` are inside it
                // likewise, j ends within them, and `c` is borrowed here alone; rows of the panel have `WIDTH·LANES`
                // numbers: copied with zeros, or j is as wide.
                unsafe {
                    with_height!(r.len(), tile_rows::<S, WIDTH>(s, a, panel, c, j.len(), true))
                };
            }
        }
    }
}

/// [`matmul_all_rows`] in wider tiles: at most [`FEW`] rows, and columns in whole tiles.
#[inline(always)]
fn matmul_few_rows<S: Simd>(s: S, x: MatmulRows<'_, f32>) {
    let n_columns = FEW_WIDTH * S::LANES;
    for p in passes(x.k, DEPTH) {
        for j in x.columns.clone().step_by(n_columns) {
            let panel = Panel::in_place(&x.b[p.start * x.n + j..], x.n, p.len(), n_columns);
            let a = RowPointers { start: x.a[p.start..].as_ptr(), rows: x.a_rows, width: x.k };
            let c = x.c[j - x.columns.start..].as_mut_ptr();
            let c = RowPointers { start: c, rows: x.c_rows, width: x.columns.len() };
            // SAFETY: `a` and `c` have 1, 2 or FEW rows, as many as the tile is high; they are inside their matrices
            // (`check_rows`), p and the whole tile of columns end within them; `c` is borrowed here alone; `in_place`
            // asserts that rows of the panel are as wide.
            unsafe {
                match x.a_rows.len() {
                    1 => tile_rows::<S, 1, FEW_WIDTH>(s, a, panel, c, n_columns, true),
                    2 => tile_rows::<S, 2, FEW_WIDTH>(s, a, panel, c, n_columns, true),
                    _ => tile_rows::<S, FEW, FEW_WIDTH>(s, a, panel, c, n_columns, true),
                }
            }
        }
    }
}

impl Kernel for TnRowsKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let TnRowsKernel(x, copy) = self;
        match x.a_rows.len() * x.n.div_ceil(columns::<S>()) {
            0..=DEPTH => matmul_tn_few_rows(s, x, copy),
            _ => matmul_tn_all_rows(s, x, copy),
        }
    }
}

#[inline(always)]
fn matmul_tn_all_rows<S: Simd>(s: S, x: MatmulTnRows<'_, f32>, copy: &mut PanelCopy) {
    let n_columns = columns::<S>();
    for r in passes(x.a_rows.len(), TN_DEPTH) {
        for j in (0..x.n).step_by(n_columns) {
            let j = j..x.n.min(j + n_columns);
            let g = RowPointers {
                start: x.g[j.start..].as_ptr(),
                rows: &x.g_rows[r.clone()],
                width: x.n,
            };
            // SAFETY: rows of `g` are `n` wide and inside it (`check_rows`), and j, as wide as is read, ends within
            // them.
            let panel = unsafe { Panel::gathered(s, copy.rows(r.len(), n_columns), g, j.len()) };
            for p in tiles(x.k, S::TILE_ROWS) {
                let a = x.a[p.start..].as_ptr();
                let a = RowPointers { start: a, rows: &x.a_rows[r.clone()], width: x.k };
                let d = (x.d[p.start * x.n + j.start..].as_mut_ptr(), x.n);
                // SAFETY: `a` has a row for each row of the panel, inside it (`check_rows`), and p, as wide as the tile
                // is high, ends within them; `d` is `[k, n]` (asserted) and borrowed here alone, p and j end within it;
                // rows of the panel have `WIDTH·LANES` numbers.
                unsafe {
                    with_height!(p.len(), tile_tn::<S, WIDTH>(s, a, panel, d, j.len()));
                }
            }
        }
    }
}

/// [`matmul_tn_all_rows`] where all panels fit side by side: little is added to each number of `d`, which
/// is therefore walked through as it lies.
#[inline(always)]
fn matmul_tn_few_rows<S: Simd>(s: S, x: MatmulTnRows<'_, f32>, copy: &mut PanelCopy) {
    let (n_columns, n_rows) = (columns::<S>(), x.g_rows.len());
    let len = n_rows * n_columns;
    let copies = copy.rows(n_rows * x.n.div_ceil(n_columns), n_columns);
    for (copy, start) in copies.chunks_exact_mut(len).zip((0..).step_by(n_columns)) {
        let g = RowPointers { start: x.g[start..].as_ptr(), rows: x.g_rows, width: x.n };
        // SAFETY: rows of `g` are `n` wide and inside it (`check_rows`), and the columns read, to `n` at most, end
        // within them.
        unsafe { Panel::gathered(s, copy, g, n_columns.min(x.n - start)) };
    }
    let (a, d) = (x.a.as_ptr(), x.d.as_mut_ptr());
    for p in tiles(x.k, S::TILE_ROWS) {
        let a = RowPointers { start: a.wrapping_add(p.start), rows: x.a_rows, width: x.k };
        for (copy, start) in copies.chunks_exact(len).zip((0..).step_by(n_columns)) {
            let width = n_columns.min(x.n - start);
            // SAFETY: every copy was written as a whole by `gathered` above, a row for each row of `a`; these are
            // inside `a` (`check_rows`), and p, as wide as the tile is high, ends within them; `d` is `[k, n]`
            // (asserted) and borrowed here alone, p and the columns end within it; rows of the panel have `WIDTH·LANES`
            // numbers.
            unsafe {
                let panel = Panel::written::<S>(copy);
                let d = (d.add(p.start * x.n + start), x.n);
                with_height!(p.len(), tile_tn::<S, WIDTH>(s, a, panel, d, width));
            }
        }
    }
}

/// Consecutive ranges of `size` indices of `0..n`; the last may be shorter.
#[inline(always)]
fn passes(n: usize, size: usize) -> impl Iterator<Item = Range<usize>> {
    (0..n).step_by(size).map(move |start| start..n.min(start + size))
}

/// Consecutive ranges of `0..n` of at most `max`: the first ones longer by one than the others, if need be.
#[inline(always)]
fn tiles(n: usize, max: usize) -> impl Iterator<Item = Range<usize>> {
    let count = n.div_ceil(max).max(1);
    let (size, longer) = (n / count, n % count);
    (0..count).map(move |i| i * size + i.min(longer)..(i + 1) * size + (i + 1).min(longer))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Below, at and above the edges of tiles, of panels and of the rows that pay for one.
    const SIZES: [usize; 13] = [0, 1, 2, 5, 6, 7, 8, 12, 13, 16, 17, 33, 49];

    /// Whole numbers and others from one formula: this module imports nothing.
    fn numbers(len: usize, whole: bool) -> Vec<f32> {
        let value = |i: usize| ((i * 7919 + 13) % 97) as f32 - 48.0;
        (0..len).map(|i| if whole { value(i) } else { value(i) * 0.37 + 1e-3 }).collect()
    }

    /// Every second row or so, descending.
    fn gathered(n: usize) -> Vec<u32> {
        (0..n as u32).rev().map(|r| r * 2 + r % 2).collect()
    }

    fn bits(x: &[f32]) -> Vec<u32> {
        x.iter().map(|x| x.to_bits()).collect()
    }

    fn assert_rows(isa: Isa, rows: usize, k: usize, n: usize, whole: bool) {
        let (a_rows, c_rows) =
            (gathered(rows), (0..rows as u32).map(|r| r + 1).collect::<Vec<_>>());
        let (a, b) = (numbers(2 * rows * k, whole), numbers(k * n, whole));
        let mut c = numbers((rows + 2) * n, whole);
        c[..n].fill(f32::NAN);
        c[(rows + 1) * n..].fill(f32::NAN);
        let mut expected = c.clone();
        for (&i, &o) in a_rows.iter().zip(&c_rows) {
            for j in 0..n {
                let c = &mut expected[o as usize * n + j];
                for p in 0..k {
                    *c = a[i as usize * k + p].mul_add(b[p * n + j], *c);
                }
            }
        }
        matmul_rows(isa, (&a, &a_rows), k, &b, n, (&mut c, &c_rows));
        assert!(bits(&c) == bits(&expected), "{} {rows} x {k} x {n}", isa.name());
    }

    fn assert_tn_rows(isa: Isa, rows: usize, k: usize, n: usize, whole: bool) {
        let (a_rows, g_rows) = (gathered(rows), (0..rows as u32).rev().collect::<Vec<_>>());
        let (a, g) = (numbers(2 * rows * k, whole), numbers(rows * n, whole));
        let mut d = numbers(k * n, whole);
        let mut expected = d.clone();
        for (&i, &o) in a_rows.iter().zip(&g_rows) {
            for p in 0..k {
                for j in 0..n {
                    let d = &mut expected[p * n + j];
                    *d = a[i as usize * k + p].mul_add(g[o as usize * n + j], *d);
                }
            }
        }
        matmul_tn_rows(isa, (&a, &a_rows), k, (&g, &g_rows), n, &mut d);
        assert!(bits(&d) == bits(&expected), "{} {rows} x {k} x {n}", isa.name());
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long")]
    fn every_isa_equals_the_plain_loop_around_every_edge() {
        for &isa in Isa::available() {
            for rows in SIZES {
                for k in SIZES {
                    for n in SIZES.into_iter().chain([32, 64]) {
                        assert_rows(isa, rows, k, n, false);
                        assert_tn_rows(isa, rows, k, n, false);
                    }
                }
            }
        }
    }

    /// Every height of a tile, every width up to more than a tile of the widest vectors, in matrices without a number
    /// to spare: the address sanitizer sees each step beside them.
    #[test]
    fn all_small_shapes_stay_inside_their_matrices() {
        for &isa in Isa::available() {
            for (rows, k) in (1..=9).flat_map(|rows| (1..=3).map(move |k| (rows, k))) {
                for n in (1..=66).step_by(if cfg!(miri) { 13 } else { 1 }) {
                    let list: Vec<u32> = (0..rows as u32).rev().collect();
                    let [a, b] = [numbers(rows * k, true), numbers(k * n, true)];
                    let mut c = vec![0.0; rows * n].into_boxed_slice();
                    matmul_rows(isa, (&a, &list), k, &b, n, (&mut c, &list));
                    let mut d = vec![0.0; k * n].into_boxed_slice();
                    matmul_tn_rows(isa, (&a, &list), k, (&c, &list), n, &mut d);
                    // Small whole numbers: exact in any order.
                    let product = |r: usize, j: usize| -> f32 {
                        (0..k).map(|p| a[r * k + p] * b[p * n + j]).sum()
                    };
                    for (r, j) in [(0, 0), (rows - 1, n - 1), (rows / 2, n / 2)] {
                        assert_eq!(
                            c[r * n + j],
                            product(r, j),
                            "{} {rows} x {k} x {n}",
                            isa.name()
                        );
                    }
                    let last: f32 = (0..rows).map(|r| a[r * k + k - 1] * c[r * n + n - 1]).sum();
                    assert_eq!(d[k * n - 1], last, "{} {rows} x {k} x {n}", isa.name());
                }
            }
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long")]
    fn every_isa_equals_the_plain_loop_beyond_one_pass() {
        for &isa in Isa::available() {
            for deep in [DEPTH - 1, DEPTH, DEPTH + 1, 2 * DEPTH + 3] {
                assert_rows(isa, 7, deep, 33, false);
                assert_rows(isa, 25, deep, 16, true);
                assert_rows(isa, ROWS_FOR_PANEL + 1, deep, WIDTH_FOR_PANEL + 1, false);
                assert_tn_rows(isa, deep, 7, 33, false);
                assert_tn_rows(isa, deep, 25, 16, true);
            }
        }
    }

    #[test]
    fn f64_equals_the_plain_loop_up_to_rounding() {
        for &isa in Isa::available() {
            for (rows, k, n) in [(1, 1, 1), (25, 7, 9), (13, 300, 17), (7, 5, 35)] {
                let list = gathered(rows);
                let wide =
                    |x: Vec<f32>| x.into_iter().map(|x| f64::from(x) / 3.0).collect::<Vec<_>>();
                let (a, b) = (wide(numbers(2 * rows * k, false)), wide(numbers(k * n, false)));
                let mut c = wide(numbers(2 * rows * n, false));
                let mut d = b.clone();
                let (mut expected_c, mut expected_d, g) = (c.clone(), d.clone(), c.clone());
                for &r in &list {
                    let r = r as usize;
                    for p in 0..k {
                        for j in 0..n {
                            let (c, d) = (&mut expected_c[r * n + j], &mut expected_d[p * n + j]);
                            *c = a[r * k + p].mul_add(b[p * n + j], *c);
                            *d = a[r * k + p].mul_add(g[r * n + j], *d);
                        }
                    }
                }
                matmul_rows(isa, (&a, &list), k, &b, n, (&mut c, &list));
                matmul_tn_rows(isa, (&a, &list), k, (&g, &list), n, &mut d);
                let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-12 * b.abs().max(1e3);
                assert!(c.iter().zip(&expected_c).all(near) && d.iter().zip(&expected_d).all(near));
            }
        }
    }

    #[test]
    #[should_panic(expected = "row 3 of width 4 in 12 numbers")]
    fn a_row_outside_its_matrix_panics() {
        let (a, b, mut c) = ([0.0f32; 12], [0.0; 8], [0.0; 8]);
        matmul_rows(Isa::active(), (&a, &[0, 3]), 4, &b, 2, (&mut c, &[0, 1]));
    }

    #[test]
    #[should_panic(expected = "row 9 of width 2 in 8 numbers")]
    fn an_output_row_outside_its_matrix_panics() {
        let (a, b, mut c) = ([0.0f32; 12], [0.0; 8], [0.0; 8]);
        matmul_rows(Isa::active(), (&a, &[0, 2]), 4, &b, 2, (&mut c, &[0, 9]));
    }

    #[test]
    #[should_panic(expected = "one row of a for each row of g")]
    fn row_lists_of_different_length_panic() {
        let (a, g, mut d) = ([0.0f32; 12], [0.0; 8], [0.0; 8]);
        matmul_tn_rows(Isa::active(), (&a, &[0, 2]), 4, (&g, &[0]), 2, &mut d);
    }
}
