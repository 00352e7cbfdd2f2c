//! The right-hand side of a product over kernel offsets, and its panels side by side.

use super::super::{Level, Simd};
use super::Tiled;
use super::tile::Real;
use std::marker::PhantomData;
use std::ops::Range;

/// One matrix per kernel offset, or the transposed of each.
#[derive(Debug, Clone)]
pub struct Weights<'a, T> {
    numbers: &'a [T],
    rows: usize,
    columns: usize,
    some: Range<usize>,
    transposed: bool,
    reversed: bool,
}

impl<'a, T: Real> Weights<'a, T> {
    /// `numbers: [n_offsets, rows, columns]`.
    ///
    /// # Panics
    /// If the numbers are not whole matrices.
    pub fn new(numbers: &'a [T], rows: usize, columns: usize) -> Self {
        assert!(rows * columns > 0 && numbers.len().is_multiple_of(rows * columns));
        Weights { numbers, rows, columns, some: 0..rows, transposed: false, reversed: false }
    }

    /// These rows of each matrix alone.
    ///
    /// # Panics
    /// If a matrix lacks the rows, or if it is transposed already.
    pub fn rows(self, some: Range<usize>) -> Self {
        assert!(!self.transposed && some.start <= some.end && some.end <= self.rows);
        Weights { some, ..self }
    }

    /// Each matrix transposed.
    pub fn transposed(self) -> Self {
        Weights { transposed: !self.transposed, ..self }
    }

    /// The last matrix first.
    pub fn reversed(self) -> Self {
        Weights { reversed: !self.reversed, ..self }
    }

    /// Number of matrices.
    pub fn n_offsets(&self) -> usize {
        self.numbers.len() / (self.rows * self.columns)
    }

    /// Rows of each matrix: the length of its sums.
    pub fn depth(&self) -> usize {
        if self.transposed { self.columns } else { self.some.len() }
    }

    /// Columns of each matrix: the number of its sums.
    pub fn width(&self) -> usize {
        if self.transposed { self.some.len() } else { self.columns }
    }

    /// The numbers of one matrix as they lie in memory, unless it is transposed.
    pub fn plain(&self, offset: usize) -> Option<&'a [T]> {
        (!self.transposed).then(|| self.stored(offset))
    }

    /// The rows of one matrix that take part, before transposing.
    fn stored(&self, offset: usize) -> &'a [T] {
        let place = if self.reversed { self.n_offsets() - 1 - offset } else { offset };
        let matrix = &self.numbers[place * self.rows * self.columns..];
        &matrix[self.some.start * self.columns..self.some.end * self.columns]
    }

    /// Calls `put` with the rows `depth` of the matrix of `offset`, one by one: the `N` columns from `first`
    /// on, zeros beyond the last.
    #[inline(always)]
    pub(super) fn fill<const N: usize>(
        &self,
        offset: usize,
        depth: Range<usize>,
        first: usize,
        mut put: impl FnMut([T; N]),
    ) {
        let (stored, width) = (self.stored(offset), N.min(self.width() - first));
        if self.transposed {
            let row = |i: usize| match i < width {
                true => &stored[(first + i) * self.columns..][depth.clone()],
                false => &[],
            };
            transpose::<T, N>(std::array::from_fn(row), depth.len(), put);
            return;
        }
        let stored = &stored[depth.start * self.columns..depth.end * self.columns];
        for row in stored.chunks_exact(self.columns) {
            let row = &row[first..first + width];
            put(match row.first_chunk::<N>() {
                Some(row) => *row,
                None => std::array::from_fn(|i| row.get(i).copied().unwrap_or(T::default())),
            });
        }
    }
}

/// Calls `put` with the columns of the rows, one by one; rows are `depth` long, or empty for zeros.
#[inline(always)]
fn transpose<T: Real, const N: usize>(rows: [&[T]; N], depth: usize, mut put: impl FnMut([T; N])) {
    const EDGE: usize = 8;
    for p in (0..depth).step_by(EDGE) {
        let chunk = |row: &[T]| match row.get(p..).and_then(|row| row.first_chunk::<EDGE>()) {
            Some(chunk) => *chunk,
            None => std::array::from_fn(|i| row.get(p + i).copied().unwrap_or(T::default())),
        };
        // Loops: what `array::from_fn` calls need not be inlined, and is then compiled for any processor.
        let mut columns = [[T::default(); N]; EDGE];
        for (i, row) in rows.iter().enumerate() {
            let chunk = chunk(row);
            for (column, x) in columns.iter_mut().zip(chunk) {
                column[i] = x;
            }
        }
        columns.into_iter().take(depth - p).for_each(&mut put);
    }
}

/// Every panel of [`Weights`] in one piece: `[width / N, n_offsets, depth, N]` for the level's `N`.
pub struct Packed<T> {
    memory: Vec<T>,
    /// Where the panels begin: at a cache line.
    start: usize,
    pub(super) n_offsets: usize,
    pub(super) depth: usize,
    pub(super) width: usize,
    pub(super) panel_width: usize,
}

/// Bytes.
const CACHE_LINE: usize = 64;

/// What one task packs: the panels of one offset.
struct Pack<'a, 'b, T> {
    weights: &'a Weights<'b, T>,
    panel: usize,
    offset: usize,
    to: &'a mut [T],
}

/// Asks for the width of panels.
struct PanelWidth<T>(PhantomData<T>);

impl<T: Real> Packed<T> {
    /// Packs `weights` for `level`; `for_each_block(numbers, length, work)` calls `work(i, block)` for all
    /// consecutive blocks of that length.
    pub fn new(
        level: Level,
        weights: &Weights<T>,
        for_each_block: impl FnOnce(&mut [T], usize, &(dyn Fn(usize, &mut [T]) + Sync)),
    ) -> Self
    where
        T: Send + Sync,
    {
        let (n_offsets, depth, width) = (weights.n_offsets(), weights.depth(), weights.width());
        let mut packed = Self::zeros(level, n_offsets, depth, width);
        let len = depth * packed.panel_width;
        if len > 0 {
            for_each_block(packed.numbers_mut(), len, &|i, to| {
                level.run(Pack { weights, panel: i / n_offsets, offset: i % n_offsets, to });
            });
        }
        packed
    }

    /// Panels of zeros.
    pub(super) fn zeros(level: Level, n_offsets: usize, depth: usize, width: usize) -> Self {
        let panel_width = panel_width::<T>(level);
        let len = width.div_ceil(panel_width) * n_offsets * depth * panel_width;
        let memory = vec![T::default(); len + CACHE_LINE / size_of::<T>()];
        let start = memory.as_ptr().align_offset(CACHE_LINE).min(memory.len() - len);
        Packed { memory, start, n_offsets, depth, width, panel_width }
    }

    /// The panels alone.
    pub(super) fn numbers_mut(&mut self) -> &mut [T] {
        let len =
            self.width.div_ceil(self.panel_width) * self.n_offsets * self.depth * self.panel_width;
        &mut self.memory[self.start..self.start + len]
    }

    /// The panels, and perhaps a little more.
    pub(super) fn numbers(&self) -> &[T] {
        &self.memory[self.start..]
    }
}

/// Columns of a panel at `level`.
pub(super) fn panel_width<T: Real>(level: Level) -> usize {
    level.run(PanelWidth::<T>(PhantomData))
}

impl<T: Real> Tiled for PanelWidth<T> {
    type Number = T;
    type Output = usize;

    #[inline(always)]
    fn run_tiled<S: Simd, const M: usize, const N: usize>(self, _: S) -> usize {
        N
    }
}

impl<T: Real> Tiled for Pack<'_, '_, T> {
    type Number = T;
    type Output = ();

    #[inline(always)]
    fn run_tiled<S: Simd, const M: usize, const N: usize>(self, _: S) {
        let mut rows = self.to.as_chunks_mut::<N>().0.iter_mut();
        self.weights.fill::<N>(self.offset, 0..self.weights.depth(), self.panel * N, |row| {
            if let Some(to) = rows.next() {
                *to = row;
            }
        });
    }
}
