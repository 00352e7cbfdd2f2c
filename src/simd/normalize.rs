//! Kernels of batch and group normalization: inference, training and the backward pass.
//!
//! ```text
//! n(x) = (x − mean) · factor + bias          factor = weight · inv_std
//! dx   = factor · (dy − mean_db − x̂ · mean_dw)   x̂ = (x − mean) · inv_std
//! ```
//!
//! 1. Rows are read and written once, in order; what belongs to a column stays in the first-level cache.
//! 2. Sums over rows are kept in `f64`: a few rows at a time pass over each vector of columns, so that sums stay
//!    in registers, rows in the cache, and every column takes its terms in the order of rows.
//!
//! Products and sums are rounded one by one, never fused.

use super::elementwise::{Chunk, for_each_vector};
use super::{Float32, Isa, Kernel, Real, Simd, Vector};

/// Rows that pass over a vector of columns before the next one: with 256 columns they fill half of a
/// first-level cache.
const STRIP: usize = 16;

/// What normalizes each column; equal lengths.
#[derive(Debug, Clone, Copy)]
pub struct Columns<'a, T> {
    /// Subtracted first.
    pub mean: &'a [T],
    /// Multiplied by.
    pub factor: &'a [T],
    /// Added last.
    pub bias: &'a [T],
}

impl<T> Columns<'_, T> {
    /// Panics unless the lengths agree and `len` numbers are whole rows.
    pub(super) fn check(&self, len: usize) {
        let c = self.mean.len();
        assert!(c > 0 && self.factor.len() == c && self.bias.len() == c, "one number per column");
        assert!(len.is_multiple_of(c), "{len} numbers in rows of {c}");
    }
}

/// What becomes of normalized rows.
#[derive(Debug, Clone, Copy)]
pub enum Activation<'a, T> {
    /// `y = n(x)`.
    Identity,
    /// `y = max(n(x), 0)`.
    Relu,
    /// `y = max(n(x) + other, 0)`, `other` as large as `x`.
    ReluOfSum(&'a [T]),
    /// `y = max(n(x) + y, 0)`.
    ReluOfSumWithOutput,
    /// `y` stays where `n(x) + other > 0` and becomes 0 elsewhere: a gradient passes that ReLU.
    PassReluOfSum(&'a [T]),
}

/// Rows to normalize: `[n, c]` each.
#[derive(Debug)]
pub struct NormalizeRows<'a, T> {
    /// What normalizes them.
    pub columns: Columns<'a, T>,
    /// The input; `None` if `y` holds it.
    pub x: Option<&'a [T]>,
    /// What follows.
    pub activation: Activation<'a, T>,
    /// The output.
    pub y: &'a mut [T],
}

impl<T> NormalizeRows<'_, T> {
    /// Panics unless the slices are whole rows of equal number.
    pub(super) fn check(&self) {
        self.columns.check(self.y.len());
        let other = match self.activation {
            Activation::ReluOfSum(other) | Activation::PassReluOfSum(other) => Some(other),
            _ => None,
        };
        let fits = |slice: &[T]| slice.len() == self.y.len();
        assert!(self.x.is_none_or(fits) && other.is_none_or(fits), "rows of equal number");
    }
}

/// Normalizes rows.
///
/// # Panics
/// If the slices are not whole rows of equal number.
pub fn normalize<T: Real>(isa: Isa, rows: NormalizeRows<T>) {
    rows.check();
    T::normalize(isa, rows);
}

impl Kernel for NormalizeRows<'_, f32> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let NormalizeRows { columns, x, activation, y } = self;
        let zero = S::F32::splat(s, 0.0);
        let n_rows = y.len() / columns.mean.len();
        let y = y.as_mut_ptr();
        let x = x.map_or(y.cast_const(), <[f32]>::as_ptr);
        // SAFETY: `x`, `y` and the other operand have the same number of whole rows, and columns the width of a row
        // (`check`); `y` is borrowed here alone, and where `x` is `y` it is the same pointer: each number is read
        // before it is written.
        unsafe {
            match activation {
                Activation::Identity => {
                    for_each_row(
                        s,
                        &columns,
                        n_rows,
                        [x, x],
                        y,
                        #[inline(always)]
                        |n, _, _| n,
                    );
                }
                Activation::Relu => {
                    for_each_row(
                        s,
                        &columns,
                        n_rows,
                        [x, x],
                        y,
                        #[inline(always)]
                        |n, _, _| zero.max(n),
                    );
                }
                Activation::ReluOfSum(other) => {
                    let rows = [x, other.as_ptr()];
                    for_each_row(
                        s,
                        &columns,
                        n_rows,
                        rows,
                        y,
                        #[inline(always)]
                        |n, other, _| zero.max(n + other),
                    );
                }
                Activation::ReluOfSumWithOutput => {
                    for_each_row(
                        s,
                        &columns,
                        n_rows,
                        [x, x],
                        y,
                        #[inline(always)]
                        |n, _, y| zero.max(n + y),
                    );
                }
                Activation::PassReluOfSum(other) => {
                    let rows = [x, other.as_ptr()];
                    for_each_row(
                        s,
                        &columns,
                        n_rows,
                        rows,
                        y,
                        #[inline(always)]
                        |n: S::F32, other, d: S::F32| d.select((n + other).gt(zero), zero),
                    );
                }
            }
        }
    }
}

/// `y = f(n(x), other, y)` for every row; `x` and `other` may be `y`.
///
/// # Safety
/// The pointers are valid for `n_rows` rows of as many numbers as there are columns, `y` for writing too and for nobody
/// else; the three columns are of one length.
#[inline(always)]
unsafe fn for_each_row<S: Simd>(
    s: S,
    columns: &Columns<f32>,
    n_rows: usize,
    [x, other]: [*const f32; 2],
    y: *mut f32,
    f: impl Fn(S::F32, S::F32, S::F32) -> S::F32,
) {
    let Columns { mean, factor, bias } = columns;
    let (c, mean, factor, bias) = (mean.len(), mean.as_ptr(), factor.as_ptr(), bias.as_ptr());
    for row in 0..n_rows {
        // SAFETY: row `row < n_rows` of each pointer has `c` numbers, and so have the columns (the caller's promise);
        // chunks end at `c`.
        for_each_vector!(S, c, |chunk| unsafe {
            let (x, other, y) = (x.add(row * c), other.add(row * c), y.add(row * c));
            let centered = chunk.load(s, x) - chunk.load(s, mean);
            let n = centered * chunk.load(s, factor) + chunk.load(s, bias);
            chunk.store::<S>(f(n, chunk.load(s, other), chunk.load(s, y)), y);
        });
    }
}

/// Rows of a batch norm in the backward pass, `[n, c]` each.
#[derive(Debug, Clone, Copy)]
pub struct BackwardRows<'a, T> {
    /// What normalized them.
    pub columns: Columns<'a, T>,
    /// 1/deviation of each column.
    pub inv_std: &'a [T],
    /// Whether a ReLU followed: `dy` passes where `n(x) > 0`.
    pub relu: bool,
}

impl<T> BackwardRows<'_, T> {
    pub(super) fn check(&self, x: &[T], dy: &[T]) {
        self.columns.check(x.len());
        assert!(x.len() == dy.len(), "rows of equal number");
        assert_eq!(self.inv_std.len(), self.columns.mean.len(), "one deviation per column");
    }
}

impl BackwardRows<'_, f32> {
    /// `x̂` and what passes of `dy`.
    ///
    /// # Safety
    /// `x` and `dy` are valid for the chunk, which lies within the columns.
    #[inline(always)]
    unsafe fn load<S: Simd, const WHOLE: bool>(
        &self,
        s: S,
        chunk: Chunk<WHOLE>,
        x: *const f32,
        dy: *const f32,
    ) -> [S::F32; 2] {
        let Columns { mean, factor, bias } = self.columns;
        // SAFETY: the chunk is within `x`, `dy` and the columns (the caller's promise), which are of one length, as
        // `inv_std` is (`check`).
        unsafe {
            let centered = chunk.load(s, x) - chunk.load(s, mean.as_ptr());
            let mut dy = chunk.load(s, dy);
            if self.relu {
                let n = centered * chunk.load(s, factor.as_ptr()) + chunk.load(s, bias.as_ptr());
                let zero = S::F32::splat(s, 0.0);
                dy = dy.select(n.gt(zero), zero);
            }
            [centered * chunk.load(s, self.inv_std.as_ptr()), dy]
        }
    }
}

/// Adds over the rows of `x` and `dy` what [`BackwardSums`] says.
///
/// # Panics
/// If the slices are not whole rows of equal number.
pub fn backward_sums<T: Real>(isa: Isa, sums: BackwardSums<T>) {
    sums.rows.check(sums.x, sums.dy);
    T::backward_sums(isa, sums);
}

/// Turns `x` or `dy` into `dx`, see [`BackwardApply`].
///
/// # Panics
/// If the slices are not whole rows of equal number.
pub fn backward_apply<T: Real>(isa: Isa, work: BackwardApply<T>) {
    work.rows.check(work.read, work.over);
    T::backward_apply(isa, work);
}

/// Adds to `sums` the rows of `x`, or the squares of their distances from `mean`, per column.
///
/// # Panics
/// If `x` is not whole rows of as many numbers as there are sums.
pub fn column_sums<T: Real>(isa: Isa, x: &[T], mean: Option<&[f64]>, sums: &mut [f64]) {
    let c = sums.len();
    assert!(c > 0 && x.len().is_multiple_of(c) && mean.is_none_or(|mean| mean.len() == c));
    T::column_sums(isa, ColumnSums { x, mean, sums });
}

/// `dweight += Σ x̂·dy` and `dbias += Σ dy` over rows, in `f64`.
#[derive(Debug)]
pub struct BackwardSums<'a, T> {
    /// How the rows were normalized.
    pub rows: BackwardRows<'a, T>,
    /// `[n, c]`, before the normalization.
    pub x: &'a [T],
    /// `[n, c]`, gradient of what came after it.
    pub dy: &'a [T],
    /// Sums of each column: by the weight, by the bias.
    pub sums: [&'a mut [f64]; 2],
}

impl Kernel for BackwardSums<'_, f32> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let BackwardSums { rows, x, dy, sums: [dweight, dbias] } = self;
        let c = rows.columns.mean.len();
        assert!(dweight.len() == c && dbias.len() == c);
        for (x, dy) in x.chunks(STRIP * c).zip(dy.chunks(STRIP * c)) {
            let n_rows = x.len() / c;
            // SAFETY: `x` and `dy` are of one length (`check`), so both strips have `n_rows` whole rows of `c` numbers;
            // chunks end at `c`, the width of the columns. Sums are slices.
            for_each_vector!(S, c, |chunk| unsafe {
                let mut dw = load_sums(s, chunk, dweight);
                let mut db = load_sums(s, chunk, dbias);
                for row in 0..n_rows {
                    let (x, dy) = (x.as_ptr().add(row * c), dy.as_ptr().add(row * c));
                    let [x_hat, dy] = rows.load(s, chunk, x, dy);
                    let (by_weight, by_bias) = ((x_hat * dy).widen(), dy.widen());
                    dw = [dw[0] + by_weight[0], dw[1] + by_weight[1]];
                    db = [db[0] + by_bias[0], db[1] + by_bias[1]];
                }
                store_sums::<S, _>(chunk, dw, dweight);
                store_sums::<S, _>(chunk, db, dbias);
            });
        }
    }
}

/// The sums of the columns of a chunk.
#[inline(always)]
fn load_sums<S: Simd, const WHOLE: bool>(s: S, chunk: Chunk<WHOLE>, sums: &[f64]) -> [S::F64; 2] {
    let sums = &sums[chunk.first..chunk.first + chunk.n];
    let (low, high) = sums.split_at(S::F64::LANES.min(chunk.n));
    match WHOLE {
        true => [S::F64::load(s, low), S::F64::load(s, high)],
        false => [S::F64::load_partial(s, low), S::F64::load_partial(s, high)],
    }
}

#[inline(always)]
fn store_sums<S: Simd, const WHOLE: bool>(
    chunk: Chunk<WHOLE>,
    [a, b]: [S::F64; 2],
    sums: &mut [f64],
) {
    let sums = &mut sums[chunk.first..chunk.first + chunk.n];
    let (low, high) = sums.split_at_mut(S::F64::LANES.min(chunk.n));
    match WHOLE {
        true => {
            a.store(low);
            b.store(high);
        }
        false => {
            a.store_partial(low);
            b.store_partial(high);
        }
    }
}

/// Turns `x` into `dx`, or `dy` if `over_dy`.
#[derive(Debug)]
pub struct BackwardApply<'a, T> {
    /// How the rows were normalized.
    pub rows: BackwardRows<'a, T>,
    /// Mean over the rows of the weight's and of the bias's gradient, per column.
    pub means: [&'a [T]; 2],
    /// Whether `over` holds `dy`.
    pub over_dy: bool,
    /// The other one of `x` and `dy`, `[n, c]`.
    pub read: &'a [T],
    /// Becomes `dx`, `[n, c]`.
    pub over: &'a mut [T],
}

impl Kernel for BackwardApply<'_, f32> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let BackwardApply { rows, means: [dweight, dbias], over_dy, read, over } = self;
        let c = rows.columns.mean.len();
        assert!(dweight.len() == c && dbias.len() == c && read.len() == over.len());
        let n_rows = over.len() / c;
        let (read, over) = (read.as_ptr(), over.as_mut_ptr());
        let (x, dy) = if over_dy { (read, over.cast_const()) } else { (over.cast_const(), read) };
        for row in 0..n_rows {
            // SAFETY: `read` and `over` are of one length (asserted), `n_rows` rows of `c` numbers; `over` is borrowed
            // here alone, and each of its numbers is read before it is written; the columns and means have `c` numbers
            // (`check`, asserted); chunks end at `c`.
            for_each_vector!(S, c, |chunk| unsafe {
                let [x_hat, dy] = rows.load(s, chunk, x.add(row * c), dy.add(row * c));
                let shift = x_hat * chunk.load(s, dweight.as_ptr());
                let centered = dy - chunk.load(s, dbias.as_ptr()) - shift;
                let dx = chunk.load(s, rows.columns.factor.as_ptr()) * centered;
                chunk.store::<S>(dx, over.add(row * c));
            });
        }
    }
}

/// `sums += Σ x`, or `sums += Σ (x − mean)²`, over rows, per column, in `f64`.
pub struct ColumnSums<'a, T> {
    pub(super) x: &'a [T],
    pub(super) mean: Option<&'a [f64]>,
    pub(super) sums: &'a mut [f64],
}

impl Kernel for ColumnSums<'_, f32> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let ColumnSums { x, mean, sums } = self;
        let c = sums.len();
        assert!(c > 0 && x.len().is_multiple_of(c) && mean.is_none_or(|mean| mean.len() == c));
        for x in x.chunks(STRIP * c) {
            let n_rows = x.len() / c;
            // SAFETY: `x` is whole rows of `c` numbers (asserted), and the strip `n_rows` of them; chunks end at `c`.
            // Sums are slices.
            for_each_vector!(S, c, |chunk| unsafe {
                let mut sum = load_sums(s, chunk, sums);
                match mean {
                    None => {
                        for row in 0..n_rows {
                            let x = chunk.load(s, x.as_ptr().add(row * c)).widen();
                            sum = [sum[0] + x[0], sum[1] + x[1]];
                        }
                    }
                    Some(mean) => {
                        let mean = load_sums(s, chunk, mean);
                        for row in 0..n_rows {
                            let x = chunk.load(s, x.as_ptr().add(row * c)).widen();
                            let centered = [x[0] - mean[0], x[1] - mean[1]];
                            let square = [centered[0] * centered[0], centered[1] * centered[1]];
                            sum = [sum[0] + square[0], sum[1] + square[1]];
                        }
                    }
                }
                store_sums::<S, _>(chunk, sum, sums);
            });
        }
    }
}

#[cfg(test)]
mod tests;
