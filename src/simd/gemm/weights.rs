//! Weights of a product over kernel offsets, and their packed panels.

use super::super::vector::MAX_LANES;
use super::super::{Float32, Isa, Kernel, Simd, Vector};
use super::Real;
use super::tile::{WIDTH, columns, copy_row};
use std::mem::MaybeUninit;
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

    /// One matrix with the distances between its rows and between its columns in memory.
    pub(in crate::simd) fn strided(&self, offset: usize) -> (&'a [T], usize, usize) {
        match self.transposed {
            false => (self.stored(offset), self.columns, 1),
            true => (self.stored(offset), 1, self.columns),
        }
    }
}

impl Weights<'_, f32> {
    /// Writes the rows `depth` of the matrix of `offset`: the columns of a tile from `first` on, zeros beyond
    /// the last one.
    #[inline(always)]
    pub(in crate::simd) fn copy_panel<S: Simd>(
        &self,
        s: S,
        offset: usize,
        depth: Range<usize>,
        first: usize,
        to: &mut [MaybeUninit<f32>],
    ) {
        let (stored, width) = (self.stored(offset), columns::<S>().min(self.width() - first));
        assert!(to.len() >= depth.len() * columns::<S>());
        if self.transposed {
            let rows = &stored[first * self.columns..(first + width) * self.columns];
            transpose(s, rows, self.columns, depth, to);
            return;
        }
        let stored = &stored[depth.start * self.columns..depth.end * self.columns];
        let rows = stored.chunks_exact(self.columns);
        for (row, to) in rows.zip(to.chunks_exact_mut(columns::<S>())) {
            copy_row(s, &row[first..first + width], to);
        }
    }
}

/// Writes the columns `depth` of some rows, `stride` apart, as rows of a panel; zeros where rows are missing.
///
/// Squares of as many rows as a vector has lanes are transposed in registers.
#[inline(always)]
fn transpose<S: Simd>(
    s: S,
    rows: &[f32],
    stride: usize,
    depth: Range<usize>,
    to: &mut [MaybeUninit<f32>],
) {
    let n_rows = rows.len() / stride;
    // Rows side by side are more streams than a processor fetches ahead; one after another they are one.
    for row in rows.chunks_exact(stride) {
        row[depth.clone()]
            .iter()
            .step_by(CACHE_LINE / size_of::<f32>())
            .for_each(|x| s.prefetch(x));
    }
    for v in 0..WIDTH {
        for p in (0..depth.len()).step_by(S::LANES) {
            let n = S::LANES.min(depth.len() - p);
            let mut square = [S::F32::splat(s, 0.0); MAX_LANES];
            for r in 0..S::LANES {
                let row = v * S::LANES + r;
                if row < n_rows {
                    let from = &rows[row * stride + depth.start + p..][..n];
                    square[r] = match n == S::LANES {
                        true => S::F32::load(s, from),
                        false => S::F32::load_partial(s, from),
                    };
                }
            }
            S::F32::transpose(&mut square[..S::LANES]);
            for i in 0..n {
                let place = (p + i) * columns::<S>() + v * S::LANES;
                let to = to[place..place + S::LANES].as_mut_ptr().cast();
                // SAFETY: the slice that `to` comes from has `LANES` places, of a type with the layout of `f32`.
                unsafe { square[i].store_ptr(to) };
            }
        }
    }
}

/// Every panel of [`Weights`] in one piece: `[width / N, n_offsets, depth, N]` for the instruction set's `N`.
pub struct Packed<T> {
    memory: Vec<T>,
    /// Where the panels begin: at a cache line.
    start: usize,
    pub(in crate::simd) n_offsets: usize,
    pub(in crate::simd) depth: usize,
    pub(in crate::simd) width: usize,
    pub(in crate::simd) panel_width: usize,
}

/// Bytes.
const CACHE_LINE: usize = 64;

/// What one task packs: one panel of one offset.
pub struct PackPanel<'a, 'b, T> {
    pub(in crate::simd) weights: &'a Weights<'b, T>,
    pub(in crate::simd) panel: usize,
    pub(in crate::simd) offset: usize,
    pub(in crate::simd) to: &'a mut [T],
}

impl<T: Real> Packed<T> {
    /// Packs `weights` for `isa`; `for_each_block(numbers, length, work)` calls `work(i, block)` for all
    /// consecutive blocks of that length. What is in `memory` is lost.
    pub fn new(
        isa: Isa,
        weights: &Weights<T>,
        memory: Vec<T>,
        for_each_block: impl FnOnce(&mut [T], usize, &(dyn Fn(usize, &mut [T]) + Sync)),
    ) -> Self
    where
        T: Send + Sync,
    {
        let (n_offsets, depth, width) = (weights.n_offsets(), weights.depth(), weights.width());
        let mut packed = Self::unwritten(isa, n_offsets, depth, width, memory);
        let len = depth * packed.panel_width;
        if len > 0 {
            for_each_block(packed.numbers_mut(), len, &|i, to| {
                let (panel, offset) = (i / n_offsets, i % n_offsets);
                T::pack_panel(isa, PackPanel { weights, panel, offset, to });
            });
        }
        packed
    }

    /// Panels of whatever was in `memory`.
    pub(in crate::simd) fn unwritten(
        isa: Isa,
        n_offsets: usize,
        depth: usize,
        width: usize,
        mut memory: Vec<T>,
    ) -> Self {
        let panel_width = T::panel_width(isa, width);
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
    pub(in crate::simd) fn numbers_mut(&mut self) -> &mut [T] {
        let len =
            self.width.div_ceil(self.panel_width) * self.n_offsets * self.depth * self.panel_width;
        &mut self.memory[self.start..self.start + len]
    }

    /// The panels, and perhaps a little more.
    pub(in crate::simd) fn numbers(&self) -> &[T] {
        &self.memory[self.start..]
    }
}

impl Kernel for PackPanel<'_, '_, f32> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let PackPanel { weights, panel, offset, to } = self;
        let to = uninit(to);
        weights.copy_panel(s, offset, 0..weights.depth(), panel * columns::<S>(), to);
    }
}

/// Memory that is to be overwritten.
pub(in crate::simd) fn uninit(x: &mut [f32]) -> &mut [MaybeUninit<f32>] {
    // SAFETY: the two types have the same layout and the borrow is the same; `MaybeUninit` would let numbers be
    // un-written, which no kernel does: they call `write`, `store` and `store_ptr` with numbers alone, and this
    // function is for them only.
    unsafe { &mut *(std::ptr::from_mut(x) as *mut [MaybeUninit<f32>]) }
}

/// Asks for the columns of a tile.
pub(in crate::simd) struct PanelWidth;

impl Kernel for PanelWidth {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> usize {
        columns::<S>()
    }
}
