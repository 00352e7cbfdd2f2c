//! One register tile, its rows gathered by pointers and its columns read from a panel.

use super::super::Simd;
use super::DEPTH;
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::ops::{Add, Sub};

/// Calls `$tile::<T, S, HEIGHT, N>` for the height at hand; heights above `$max` are compiled out.
macro_rules! with_height {
    ($height:expr, $max:expr, $tile:ident::<$t:ty, $s:ty, $n:ident>$args:tt) => {
        with_height!(@ $height, $max, $tile, $t, $s, $n, $args, 1 2 3 4 5 6 7 8)
    };
    (@ $height:expr, $max:expr, $tile:ident, $t:ty, $s:ty, $n:ident, $args:tt, $($m:literal)*) => {
        match $height {
            $($m if $m <= $max => $tile::<$t, $s, $m, $n>$args,)*
            height => unreachable!("a tile of {height} rows"),
        }
    };
}
pub(super) use with_height;

/// A number that tiles are made of: `f32` or `f64`.
pub trait Real: Copy + Default + Add<Output = Self> + Sub<Output = Self> + 'static {
    /// `a * b + c` with one rounding.
    fn fused<S: Simd>(simd: S, a: Self, b: Self, c: Self) -> Self;
    /// Exact value.
    fn from_f32(x: f32) -> Self;
    /// Half of it.
    fn half(self) -> Self;
    /// The columns of eight rows.
    fn columns<S: Simd>(simd: S, rows: &[[Self; 8]; 8]) -> [[Self; 8]; 8];
}

impl Real for f32 {
    #[inline(always)]
    fn fused<S: Simd>(simd: S, a: f32, b: f32, c: f32) -> f32 {
        simd.mul_add(a, b, c)
    }

    #[inline(always)]
    fn from_f32(x: f32) -> f32 {
        x
    }

    #[inline(always)]
    fn half(self) -> f32 {
        0.5 * self
    }

    #[inline(always)]
    fn columns<S: Simd>(simd: S, rows: &[[f32; 8]; 8]) -> [[f32; 8]; 8] {
        let mut lanes = [simd.splat(0.0); 8];
        lanes.iter_mut().zip(rows).for_each(|(lanes, row)| *lanes = simd.load(row));
        let mut columns = [[0.0; 8]; 8];
        for (lanes, column) in simd.transpose(lanes).into_iter().zip(&mut columns) {
            simd.store(lanes, column);
        }
        columns
    }
}

impl Real for f64 {
    /// Without the instruction this is a call, right but slow: `f64` serves gradient checks.
    #[inline(always)]
    fn fused<S: Simd>(_: S, a: f64, b: f64, c: f64) -> f64 {
        a.mul_add(b, c)
    }

    #[inline(always)]
    fn from_f32(x: f32) -> f64 {
        f64::from(x)
    }

    #[inline(always)]
    fn half(self) -> f64 {
        0.5 * self
    }

    #[inline(always)]
    fn columns<S: Simd>(_: S, rows: &[[f64; 8]; 8]) -> [[f64; 8]; 8] {
        let mut columns = [[0.0; 8]; 8];
        for (r, row) in rows.iter().enumerate() {
            columns.iter_mut().zip(row).for_each(|(column, &x)| column[r] = x);
        }
        columns
    }
}

/// Rows of a matrix, beginning at a column.
#[derive(Clone, Copy)]
pub(super) struct RowPointers<'a, P> {
    /// Where that column is in row 0.
    pub(super) start: P,
    pub(super) rows: &'a [u32],
    pub(super) width: usize,
}

/// Room for the copy of a panel; whole cache lines, so that no load crosses two.
#[repr(align(64))]
pub(super) struct Copied<T, const N: usize>(pub(super) [MaybeUninit<[T; N]>; DEPTH]);

/// Up to [`DEPTH`] rows of `N` columns.
pub(super) struct Panel<'a, T, const N: usize> {
    start: *const T,
    stride: usize,
    depth: usize,
    source: PhantomData<&'a [T]>,
}

impl<'a, T: Real, const N: usize> Panel<'a, T, N> {
    /// A copy of `rows`, of `N` or fewer numbers each, padded with zeros.
    #[inline(always)]
    pub(super) fn copied<'b>(
        copy: &'a mut [MaybeUninit<[T; N]>],
        rows: impl Iterator<Item = &'b [T]>,
    ) -> Self {
        let mut depth = 0;
        for (place, row) in copy.iter_mut().zip(rows) {
            match row.first_chunk::<N>() {
                Some(row) => place.write(*row),
                None => place
                    .write(std::array::from_fn(|i| row.get(i).copied().unwrap_or(T::default()))),
            };
            depth += 1;
        }
        Panel { start: copy.as_ptr().cast(), stride: N, depth, source: PhantomData }
    }

    /// The rows of `copy`.
    ///
    /// # Safety
    /// They are written.
    #[inline(always)]
    pub(super) unsafe fn of_copy(copy: &'a [MaybeUninit<[T; N]>]) -> Self {
        Panel { start: copy.as_ptr().cast(), stride: N, depth: copy.len(), source: PhantomData }
    }

    /// `depth` rows of `matrix`, which is `stride` wide and begins at the first column of the panel.
    #[inline(always)]
    pub(super) fn in_place(matrix: &'a [T], stride: usize, depth: usize) -> Self {
        assert!(depth == 0 || matrix.len() >= (depth - 1) * stride + N);
        Panel { start: matrix.as_ptr(), stride, depth, source: PhantomData }
    }

    /// Row `p < depth`.
    #[inline(always)]
    unsafe fn row(&self, p: usize) -> [T; N] {
        // SAFETY: both constructors hold `depth` rows of N numbers, `stride` apart.
        unsafe { self.start.add(p * self.stride).cast::<[T; N]>().read() }
    }
}

/// One tile of [`matmul_rows`]; adds to `c` if there is `more`, else overwrites it.
///
/// # Safety
/// `a` and `c` have `M` rows; those of `a` reach `panel.depth` numbers far, those of `c` `width ≤ N`.
#[inline(always)]
pub(super) unsafe fn tile_rows<T: Real, S: Simd, const M: usize, const N: usize>(
    simd: S,
    a: RowPointers<'_, *const T>,
    panel: &Panel<'_, T, N>,
    c: RowPointers<'_, *mut T>,
    width: usize,
    more: bool,
) {
    // SAFETY: the caller's promise.
    unsafe {
        let (mut a_rows, mut c_rows) = ([a.start; M], [c.start; M]);
        for i in 0..M {
            a_rows[i] = a.start.add(a.rows[i] as usize * a.width);
            c_rows[i] = c.start.add(c.rows[i] as usize * c.width);
        }
        let mut sums = match more {
            true => load(&c_rows, width),
            false => [[T::default(); N]; M],
        };
        for p in 0..panel.depth {
            let b = panel.row(p);
            for (sums, a) in sums.iter_mut().zip(&a_rows) {
                let a = *a.add(p);
                for (sum, &b) in sums.iter_mut().zip(&b) {
                    *sum = T::fused(simd, a, b, *sum);
                }
            }
        }
        store(&sums, &c_rows, width);
    }
}

/// One tile of [`matmul_tn_rows`]: `M` rows of `d`, `n` apart.
///
/// # Safety
/// `a` has `panel.depth` rows that reach `M` numbers far; the rows of `d` reach `width ≤ N` far.
#[inline(always)]
pub(super) unsafe fn tile_tn<T: Real, S: Simd, const M: usize, const N: usize>(
    simd: S,
    a: RowPointers<'_, *const T>,
    panel: &Panel<'_, T, N>,
    d: *mut T,
    n: usize,
    width: usize,
) {
    // SAFETY: the caller's promise.
    unsafe {
        let mut d_rows = [d; M];
        for (i, row) in d_rows.iter_mut().enumerate() {
            *row = d.add(i * n);
        }
        let mut sums: [[T; N]; M] = load(&d_rows, width);
        for (r, &row) in a.rows.iter().enumerate() {
            let g = panel.row(r);
            let a = a.start.add(row as usize * a.width).cast::<[T; M]>().read();
            for (sums, &a) in sums.iter_mut().zip(&a) {
                for (sum, &g) in sums.iter_mut().zip(&g) {
                    *sum = T::fused(simd, a, g, *sum);
                }
            }
        }
        store(&sums, &d_rows, width);
    }
}

/// The first `width ≤ N` numbers of each row, padded with zeros.
///
/// # Safety
/// Each row reaches that far.
#[inline(always)]
unsafe fn load<T: Real, const M: usize, const N: usize>(
    rows: &[*mut T; M],
    width: usize,
) -> [[T; N]; M] {
    let mut tile = [[T::default(); N]; M];
    for (tile, row) in tile.iter_mut().zip(rows) {
        // SAFETY: the caller's promise.
        *tile = unsafe {
            if width == N { row.cast::<[T; N]>().read() } else { load_some(*row, width) }
        };
    }
    tile
}

/// Kept out of line: a copy of varying length would force the tile out of its registers.
///
/// # Safety
/// The row reaches `width ≤ N` far.
#[inline(never)]
unsafe fn load_some<T: Real, const N: usize>(row: *const T, width: usize) -> [T; N] {
    let mut padded = [T::default(); N];
    // SAFETY: the caller's promise.
    unsafe { row.copy_to_nonoverlapping(padded.as_mut_ptr(), width) };
    padded
}

/// Writes the first `width ≤ N` numbers of a tile to its rows.
///
/// # Safety
/// Each row reaches that far and belongs to the caller.
#[inline(always)]
unsafe fn store<T: Real, const M: usize, const N: usize>(
    tile: &[[T; N]; M],
    rows: &[*mut T; M],
    width: usize,
) {
    for (tile, row) in tile.iter().zip(rows) {
        // SAFETY: the caller's promise.
        unsafe {
            if width == N {
                row.cast::<[T; N]>().write(*tile);
            } else {
                store_some(*tile, *row, width);
            }
        }
    }
}

/// As [`load_some`], the other way.
///
/// # Safety
/// The row reaches `width ≤ N` far and belongs to the caller.
#[inline(never)]
unsafe fn store_some<T: Real, const N: usize>(tile: [T; N], row: *mut T, width: usize) {
    // SAFETY: the caller's promise.
    unsafe { row.copy_from_nonoverlapping(tile.as_ptr(), width) };
}
