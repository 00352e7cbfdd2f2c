//! Normalization of rows column by column, with the activation that follows, in one pass over memory.

use super::rows::BLOCK_ROWS;
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::simd::Isa;
pub use crate::simd::normalize::Activation;
use crate::simd::normalize::{Columns, NormalizeRows, normalize};
use std::ops::Range;

/// What a linear operator does to each block of its output rows as soon as they are done.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Epilogue<'a, T> {
    /// Nothing.
    Identity,
    /// Normalization with known statistics, and an activation.
    Normalize(&'a ColumnNorm<T>, Activation<'a, T>),
}

impl<T: Scalar> Epilogue<'_, T> {
    /// Treats some rows of an output, `[n, c_out]`; `first` is the number of their first one.
    ///
    /// # Panics
    /// If these are not whole rows of as many columns as are normalized.
    pub fn apply(&self, first: usize, rows: &mut [T]) {
        if let Epilogue::Normalize(norm, activation) = *self {
            let start = first * norm.mean.len();
            norm.apply_to_block(start..start + rows.len(), None, activation, rows);
        }
    }

    /// Treats all rows of `y: [n, c_out]`.
    pub(super) fn apply_to_all(&self, y: &mut [T]) {
        if let Epilogue::Normalize(norm, activation) = *self {
            norm.apply(None, activation, y);
        }
    }
}

/// What normalizes each column: `y = (x - mean) · factor + bias`.
#[derive(Debug, Clone)]
pub struct ColumnNorm<W> {
    pub(super) mean: Vec<W>,
    pub(super) factor: Vec<W>,
    pub(super) bias: Vec<W>,
}

impl<W> ColumnNorm<W> {
    pub(super) fn columns(&self) -> Columns<'_, W> {
        Columns { mean: &self.mean, factor: &self.factor, bias: &self.bias }
    }
}

impl<T: Scalar> ColumnNorm<T> {
    /// Normalizes `x`, or `y` where there is none, into `y`; both `[n, c]`.
    pub(super) fn apply(&self, x: Option<&[T]>, activation: Activation<T>, y: &mut [T]) {
        let len = BLOCK_ROWS * self.mean.len();
        par::for_each_block(y, len, |i, y| {
            self.apply_to_block(i * len..i * len + y.len(), x, activation, y);
        });
    }

    /// Elements `block` of all.
    fn apply_to_block(
        &self,
        block: Range<usize>,
        x: Option<&[T]>,
        activation: Activation<T>,
        y: &mut [T],
    ) {
        let activation = match activation {
            Activation::ReluOfSum(other) => Activation::ReluOfSum(&other[block.clone()]),
            Activation::PassReluOfSum(other) => Activation::PassReluOfSum(&other[block.clone()]),
            other => other,
        };
        let (columns, x) = (self.columns(), x.map(|x| &x[block]));
        normalize(Isa::active(), NormalizeRows { columns, x, activation, y });
    }
}

impl ColumnNorm<f64> {
    /// [`ColumnNorm::apply`] computed in f64, for few rows.
    pub(super) fn apply_wide<T: Scalar>(
        &self,
        x: Option<&[T]>,
        activation: Activation<T>,
        y: &mut [T],
    ) {
        let rectified = |x: T| x.max(T::ZERO);
        for i in 0..y.len() {
            let n = self.at(i, x.map_or(y[i], |x| x[i]));
            y[i] = match activation {
                Activation::Identity => n,
                Activation::Relu => rectified(n),
                Activation::ReluOfSum(other) => rectified(n + other[i]),
                Activation::ReluOfSumWithOutput => rectified(n + y[i]),
                Activation::PassReluOfSum(other) if n + other[i] > T::ZERO => y[i],
                Activation::PassReluOfSum(_) => T::ZERO,
            };
        }
    }

    /// Element `i` of `[n, c]`, normalized.
    pub(super) fn at<T: Scalar>(&self, i: usize, x: T) -> T {
        let j = i % self.mean.len();
        T::from_f64((x.to_f64() - self.mean[j]) * self.factor[j] + self.bias[j])
    }
}
