//! The register tile of the products: `M` rows times `V` vectors of sums; rows are gathered by pointers, columns read
//! from a panel.
//!
//! The sums are a constant number of vector values, so they stay in registers for the whole depth of the
//! panel; the inner loop loads `V` vectors of the panel and makes `M·V` fused multiply-adds.

use super::super::{Simd, Vector};
use super::DEPTH;
use std::marker::PhantomData;
use std::mem::MaybeUninit;

/// Vectors across a tile.
pub(super) const WIDTH: usize = 2;

/// Most columns of a tile, with any instruction set.
pub(super) const MAX_COLUMNS: usize = WIDTH * super::super::vector::MAX_LANES;

/// Columns of a tile.
pub(super) const fn columns<S: Simd>() -> usize {
    WIDTH * S::LANES
}

/// Calls `$tile::<S, HEIGHT, V>` for the height at hand; heights above the instruction set's are compiled out.
macro_rules! with_height {
    ($height:expr, $tile:ident::<$s:ty, $v:ident>$args:tt) => {
        with_height!(@ $height, $tile, $s, $v, $args, 1 2 3 4 5 6 7 8)
    };
    (@ $height:expr, $tile:ident, $s:ty, $v:ident, $args:tt, $($m:literal)*) => {
        match $height {
            $($m if $m <= <$s>::TILE_ROWS => $tile::<$s, $m, $v>$args,)*
            height => unreachable!("a tile of {height} rows"),
        }
    };
}
pub(super) use with_height;

/// Rows of a matrix, beginning at a column.
#[derive(Clone, Copy)]
pub(super) struct RowPointers<'a, P> {
    /// Where that column is in row 0.
    pub(super) start: P,
    pub(super) rows: &'a [u32],
    pub(super) width: usize,
}

/// Memory for the copy of a panel; whole cache lines, so that no load crosses two.
#[repr(align(64))]
pub(super) struct PanelCopy([MaybeUninit<f32>; DEPTH * MAX_COLUMNS]);

impl PanelCopy {
    pub(super) const fn new() -> Self {
        PanelCopy([const { MaybeUninit::uninit() }; DEPTH * MAX_COLUMNS])
    }

    /// Memory for panels of `n_rows` rows of `n_columns` numbers.
    pub(super) fn rows(&mut self, n_rows: usize, n_columns: usize) -> &mut [MaybeUninit<f32>] {
        &mut self.0[..n_rows * n_columns]
    }
}

/// Up to [`DEPTH`] rows of as many numbers as a tile has columns.
#[derive(Clone, Copy)]
pub(super) struct Panel<'a> {
    start: *const f32,
    stride: usize,
    depth: usize,
    source: PhantomData<&'a [f32]>,
}

impl<'a> Panel<'a> {
    /// A copy of `rows`, of `V` vectors or fewer numbers each, padded with zeros. There are as many rows as
    /// `copy` has places for.
    #[inline(always)]
    pub(super) fn copied<'b, S: Simd>(
        s: S,
        copy: &'a mut [MaybeUninit<f32>],
        rows: impl Iterator<Item = &'b [f32]>,
    ) -> Self {
        let mut depth = 0;
        for (place, row) in copy.chunks_exact_mut(columns::<S>()).zip(rows) {
            copy_row(s, row, place);
            depth += 1;
        }
        Panel { start: copy.as_ptr().cast(), stride: columns::<S>(), depth, source: PhantomData }
    }

    /// A copy of the first `width` columns of gathered rows, padded with zeros.
    ///
    /// # Safety
    /// `g` has rows that reach `width` numbers far, as many as `copy` has places for.
    #[inline(always)]
    pub(super) unsafe fn gathered<S: Simd>(
        s: S,
        copy: &'a mut [MaybeUninit<f32>],
        g: RowPointers<'_, *const f32>,
        width: usize,
    ) -> Self {
        let stride = columns::<S>();
        assert!(g.rows.len() * stride == copy.len());
        let to: *mut f32 = copy.as_mut_ptr().cast();
        for (r, &row) in g.rows.iter().enumerate() {
            for v in 0..WIDTH {
                // SAFETY: reads: row `row` reaches `width` numbers far from `start` on (the caller's promise), of which
                // vector `v` takes those below `width`, none if it begins beyond; writes: `copy` has `stride` places
                // for each of the rows (asserted), and `v·LANES + LANES ≤ stride`.
                unsafe {
                    let from = g.start.add(row as usize * g.width).wrapping_add(v * S::LANES);
                    let lanes = match width == stride {
                        true => S::F32::load_ptr(s, from),
                        false => S::F32::load_partial_ptr(s, from, lanes_of::<S>(width, v)),
                    };
                    lanes.store_ptr(to.add(r * stride + v * S::LANES));
                }
            }
        }
        Panel { start: to, stride, depth: g.rows.len(), source: PhantomData }
    }

    /// All rows of a copy.
    ///
    /// # Safety
    /// They are written.
    #[inline(always)]
    pub(super) unsafe fn written<S: Simd>(copy: &'a [MaybeUninit<f32>]) -> Self {
        let (stride, start) = (columns::<S>(), copy.as_ptr().cast());
        Panel { start, stride, depth: copy.len() / stride, source: PhantomData }
    }

    /// `depth` rows of `matrix`, which is `stride` wide and begins at the first column of the panel; tiles are
    /// `n_columns` wide.
    #[inline(always)]
    pub(super) fn in_place(
        matrix: &'a [f32],
        stride: usize,
        depth: usize,
        n_columns: usize,
    ) -> Self {
        assert!(depth == 0 || matrix.len() >= (depth - 1) * stride + n_columns);
        Panel { start: matrix.as_ptr(), stride, depth, source: PhantomData }
    }
}

/// Writes a row of [`WIDTH`] vectors: `row`, padded with zeros.
#[inline(always)]
pub(super) fn copy_row<S: Simd>(s: S, row: &[f32], to: &mut [MaybeUninit<f32>]) {
    assert!(to.len() >= columns::<S>());
    for v in 0..WIDTH {
        let first = v * S::LANES;
        let lanes = match row.get(first..first + S::LANES) {
            Some(row) => S::F32::load(s, row),
            None => S::F32::load_partial(s, row.get(first..).unwrap_or_default()),
        };
        // SAFETY: `to` has `WIDTH·LANES` places (asserted), and `first + LANES` is no more.
        unsafe { lanes.store_ptr(to.as_mut_ptr().add(first).cast()) };
    }
}

/// One tile of `matmul_rows`; adds to `c` if there is `more`, else overwrites it.
///
/// # Safety
/// `a` and `c` have `M` rows; those of `a` reach `panel.depth` numbers far, those of `c` `width ≤ V·LANES`, for writing
/// and by nobody else; the rows of the panel have `V·LANES` numbers. Rows of `c` may be the same.
#[inline(always)]
pub(super) unsafe fn tile_rows<S: Simd, const M: usize, const V: usize>(
    s: S,
    a: RowPointers<'_, *const f32>,
    panel: Panel<'_>,
    c: RowPointers<'_, *mut f32>,
    width: usize,
    more: bool,
) {
    // SAFETY: by the caller's promise: row `a.rows[i]` of `a` has number `p < panel.depth`; the panel has row `p`, with
    // vectors below `V`; the rows of `c` reach `width ≤ V·LANES` far, which is what `load` and `store` ask.
    unsafe {
        let (mut a_rows, mut c_rows) = ([a.start; M], [c.start; M]);
        for i in 0..M {
            a_rows[i] = a.start.add(a.rows[i] as usize * a.width);
            c_rows[i] = c.start.add(c.rows[i] as usize * c.width);
        }
        let mut sums = match more {
            true => load::<S, M, V>(s, |i| c_rows[i], width),
            false => [[S::F32::splat(s, 0.0); V]; M],
        };
        for p in 0..panel.depth {
            if V > M {
                // The shorter side of the tile waits in registers.
                let mut a = [S::F32::splat(s, 0.0); M];
                for i in 0..M {
                    a[i] = S::F32::splat(s, *a_rows[i].add(p));
                }
                for v in 0..V {
                    let b = panel_vector(s, panel, p, v);
                    for i in 0..M {
                        sums[i][v] = a[i].mul_add(b, sums[i][v]);
                    }
                }
            } else {
                let b = panel_row::<S, V>(s, panel, p);
                for i in 0..M {
                    let a = S::F32::splat(s, *a_rows[i].add(p));
                    for v in 0..V {
                        sums[i][v] = a.mul_add(b[v], sums[i][v]);
                    }
                }
            }
        }
        store::<S, M, V>(&sums, |i| c_rows[i], width);
    }
}

/// One tile of `matmul_tn_rows`: `M` rows of `d`, `n` apart.
///
/// # Safety
/// `a` has `panel.depth` rows that reach `M` numbers far; the rows of `d` reach `width ≤ V·LANES` far; the rows
/// of the panel have `V·LANES` numbers.
#[inline(always)]
pub(super) unsafe fn tile_tn<S: Simd, const M: usize, const V: usize>(
    s: S,
    a: RowPointers<'_, *const f32>,
    panel: Panel<'_>,
    (d, n): (*mut f32, usize),
    width: usize,
) {
    // SAFETY: by the caller's promise: `a.rows` has an entry for each of the `panel.depth` rows of the panel, and that
    // row of `a` has `M` numbers; the panel has row `r`, with vectors below `V`; the `M` rows of `d`, `n` apart, reach
    // `width ≤ V·LANES` far.
    unsafe {
        let d_row = |i: usize| d.wrapping_add(i * n);
        let mut sums = load::<S, M, V>(s, d_row, width);
        for r in 0..panel.depth {
            let g = panel_row::<S, V>(s, panel, r);
            let a = a.start.add(*a.rows.get_unchecked(r) as usize * a.width);
            for i in 0..M {
                let a = S::F32::splat(s, *a.add(i));
                for v in 0..V {
                    sums[i][v] = a.mul_add(g[v], sums[i][v]);
                }
            }
        }
        store::<S, M, V>(&sums, d_row, width);
    }
}

/// Row `p` of a panel.
///
/// # Safety
/// The panel has the row, and its rows have `V·LANES` numbers.
#[inline(always)]
unsafe fn panel_row<S: Simd, const V: usize>(s: S, panel: Panel<'_>, p: usize) -> [S::F32; V] {
    let mut row = [S::F32::splat(s, 0.0); V];
    for (v, row) in row.iter_mut().enumerate() {
        // SAFETY: the panel has row `p`, whose `V·LANES` numbers hold vector `v < V` (the caller's promise).
        *row = unsafe { panel_vector(s, panel, p, v) };
    }
    row
}

/// Vector `v` of row `p` of a panel.
///
/// # Safety
/// The panel has the row, which has the vector.
#[inline(always)]
unsafe fn panel_vector<S: Simd>(s: S, panel: Panel<'_>, p: usize, v: usize) -> S::F32 {
    // SAFETY: rows are `stride` apart and the panel has row `p` with vector `v` (the caller's promise); its numbers are
    // written, as all that make a `Panel` see to or ask.
    unsafe { S::F32::load_ptr(s, panel.start.add(p * panel.stride + v * S::LANES)) }
}

/// The first `width ≤ V·LANES` numbers of each row, padded with zeros.
///
/// # Safety
/// Each row reaches that far.
#[inline(always)]
unsafe fn load<S: Simd, const M: usize, const V: usize>(
    s: S,
    row: impl Fn(usize) -> *mut f32,
    width: usize,
) -> [[S::F32; V]; M] {
    let mut tile = [[S::F32::splat(s, 0.0); V]; M];
    for i in 0..M {
        for v in 0..V {
            // SAFETY: the row reaches `width` numbers far (the caller's promise): all of vector `v`, or those of its
            // lanes that are below `width`, none if it begins beyond.
            tile[i][v] = unsafe {
                let from = row(i).wrapping_add(v * S::LANES);
                match width == V * S::LANES {
                    true => S::F32::load_ptr(s, from),
                    false => S::F32::load_partial_ptr(s, from, lanes_of::<S>(width, v)),
                }
            };
        }
    }
    tile
}

/// Writes the first `width ≤ V·LANES` numbers of a tile to its rows.
///
/// # Safety
/// Each row reaches that far and belongs to the caller.
#[inline(always)]
unsafe fn store<S: Simd, const M: usize, const V: usize>(
    tile: &[[S::F32; V]; M],
    row: impl Fn(usize) -> *mut f32,
    width: usize,
) {
    for i in 0..M {
        for v in 0..V {
            let to = row(i).wrapping_add(v * S::LANES);
            // SAFETY: the row reaches `width` places far and is the caller's (its promise): all of vector `v`, or those
            // of its lanes that are below `width`, none if it begins beyond.
            unsafe {
                match width == V * S::LANES {
                    true => tile[i][v].store_ptr(to),
                    false => tile[i][v].store_partial_ptr(to, lanes_of::<S>(width, v)),
                }
            }
        }
    }
}

/// How many lanes of vector `v` lie within `width`.
#[inline(always)]
pub(super) fn lanes_of<S: Simd>(width: usize, v: usize) -> usize {
    width.saturating_sub(v * S::LANES).min(S::LANES)
}
