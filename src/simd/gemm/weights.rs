//! The right-hand side of a product over kernel offsets, and its panels side by side.

use super::super::{Level, Simd};
use super::Tiled;
use super::tile::Real;
use std::hint::black_box;
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
    pub(super) fn fill<S: Simd, const N: usize>(
        &self,
        simd: S,
        offset: usize,
        depth: Range<usize>,
        first: usize,
        mut put: impl FnMut([T; N]),
    ) {
        let (stored, width) = (self.stored(offset), N.min(self.width() - first));
        if self.transposed {
            let rows = &stored[first * self.columns..(first + width) * self.columns];
            transpose::<T, S, N>(simd, rows, self.columns, depth, put);
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

/// Calls `put` with the columns `depth` of up to `N` rows, `stride` apart, one by one; zeros where rows are
/// missing.
#[inline(always)]
fn transpose<T: Real, S: Simd, const N: usize>(
    simd: S,
    rows: &[T],
    stride: usize,
    depth: Range<usize>,
    mut put: impl FnMut([T; N]),
) {
    const EDGE: usize = 8;
    const { assert!(N.is_multiple_of(EDGE)) };
    // Rows side by side are more streams than a processor fetches ahead; one after another they are one.
    for row in rows.chunks_exact(stride) {
        row[depth.clone()].iter().step_by(CACHE_LINE / size_of::<T>()).for_each(|x| {
            black_box(*x);
        });
    }
    // Loops: what `array::from_fn` calls need not be inlined, and is then compiled for any processor.
    for p in depth.clone().step_by(EDGE) {
        let n = EDGE.min(depth.end - p);
        let mut columns = [[T::default(); N]; EDGE];
        let mut rows = rows.chunks_exact(stride);
        for i in (0..N).step_by(EDGE) {
            let mut square = [[T::default(); EDGE]; EDGE];
            for (to, row) in square.iter_mut().zip(&mut rows) {
                match row[p..].first_chunk::<EDGE>() {
                    Some(row) if n == EDGE => *to = *row,
                    _ => to[..n].copy_from_slice(&row[p..p + n]),
                }
            }
            for (column, part) in columns.iter_mut().zip(T::columns(simd, &square)) {
                column[i..i + EDGE].copy_from_slice(&part);
            }
        }
        for column in &columns[..n] {
            put(*column);
        }
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
    /// consecutive blocks of that length. What is in `memory` is lost.
    pub fn new(
        level: Level,
        weights: &Weights<T>,
        memory: Vec<T>,
        for_each_block: impl FnOnce(&mut [T], usize, &(dyn Fn(usize, &mut [T]) + Sync)),
    ) -> Self
    where
        T: Send + Sync,
    {
        let (n_offsets, depth, width) = (weights.n_offsets(), weights.depth(), weights.width());
        let mut packed = Self::unwritten(level, n_offsets, depth, width, memory);
        let len = depth * packed.panel_width;
        if len > 0 {
            for_each_block(packed.numbers_mut(), len, &|i, to| {
                level.run(Pack { weights, panel: i / n_offsets, offset: i % n_offsets, to });
            });
        }
        packed
    }

    /// Panels of whatever was in `memory`.
    pub(super) fn unwritten(
        level: Level,
        n_offsets: usize,
        depth: usize,
        width: usize,
        mut memory: Vec<T>,
    ) -> Self {
        let panel_width = panel_width::<T>(level);
        let len = width.div_ceil(panel_width) * n_offsets * depth * panel_width;
        let needed = len + CACHE_LINE / size_of::<T>();
        if memory.len() < needed {
            memory = vec![T::default(); needed];
        }
        let start = memory.as_ptr().align_offset(CACHE_LINE).min(memory.len() - len);
        Packed { memory, start, n_offsets, depth, width, panel_width }
    }

    /// The memory; what is in it is lost.
    pub fn into_memory(self) -> Vec<T> {
        self.memory
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
    fn run_tiled<S: Simd, const M: usize, const N: usize>(self, simd: S) {
        let mut rows = self.to.as_chunks_mut::<N>().0.iter_mut();
        let depth = 0..self.weights.depth();
        self.weights.fill::<S, N>(simd, self.offset, depth, self.panel * N, |row| {
            if let Some(to) = rows.next() {
                *to = row;
            }
        });
    }
}
