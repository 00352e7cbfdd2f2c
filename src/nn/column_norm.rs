//! Rows normalized column by column, and the activation that follows in the same pass over memory.

use super::rows;
use crate::scalar::{Scalar, vectorised};

/// What follows a normalization.
#[derive(Debug, Clone, Copy)]
pub enum Activation<'a, T> {
    /// `y`.
    Identity,
    /// `max(y, 0)`.
    Relu,
    /// `max(y + other, 0)`, `other` as large as `y`.
    ReluOfSum(&'a [T]),
}

/// What a linear operator does to each block of its output rows as soon as they are done.
#[derive(Debug, Clone, Copy)]
pub enum Epilogue<'a, T> {
    /// Nothing.
    Identity,
    /// Normalization with known statistics, and an activation.
    Normalize(&'a ColumnNorm<T>, Activation<'a, T>),
}

impl<T: Scalar> Epilogue<'_, T> {
    /// Treats some rows; `first` is the number of their first one.
    pub(super) fn apply(&self, first: usize, rows: &mut [T]) {
        if let Epilogue::Normalize(norm, activation) = *self {
            norm.apply(first, activation, rows);
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

/// One column of a [`ColumnNorm`].
#[derive(Clone, Copy)]
pub(super) struct Column<W> {
    pub(super) mean: W,
    pub(super) factor: W,
    bias: W,
}

impl<W: Scalar> Column<W> {
    #[inline(always)]
    fn of<T: Scalar>(self, x: T) -> T {
        cast((cast::<T, W>(x) - self.mean) * self.factor + self.bias)
    }

    #[inline(always)]
    pub(super) fn is_positive<T: Scalar>(self, x: T) -> bool {
        self.of(x) > T::ZERO
    }
}

impl<W: Scalar> ColumnNorm<W> {
    #[inline(always)]
    pub(super) fn iter(&self) -> impl Iterator<Item = Column<W>> + '_ {
        let columns = self.mean.iter().zip(&self.factor).zip(&self.bias);
        columns.map(|((&mean, &factor), &bias)| Column { mean, factor, bias })
    }

    /// Normalizes some rows in place; `first` is the number of their first one.
    pub(super) fn apply<T: Scalar>(&self, first: usize, activation: Activation<T>, rows: &mut [T]) {
        vectorised(
            #[inline(always)]
            || {
                for (i, y) in rows.chunks_exact_mut(self.mean.len()).enumerate() {
                    self.apply_to_row(first + i, activation, y);
                }
            },
        );
    }

    /// Normalizes `x` into `y`.
    pub(super) fn apply_to<T: Scalar>(&self, x: &[T], activation: Activation<T>, y: &mut [T]) {
        let c = self.mean.len();
        rows::for_each_row(
            y,
            c,
            #[inline(always)]
            |row, y| {
                y.copy_from_slice(&x[row * c..][..c]);
                self.apply_to_row(row, activation, y);
            },
        );
    }

    /// Normalizes all rows in place.
    pub(super) fn apply_in_place<T: Scalar>(&self, activation: Activation<T>, x: &mut [T]) {
        rows::for_each_row(
            x,
            self.mean.len(),
            #[inline(always)]
            |row, x| self.apply_to_row(row, activation, x),
        );
    }

    pub(super) fn add_to_and_rectify<T: Scalar>(&self, x: &[T], y: &mut [T]) {
        let c = self.mean.len();
        rows::for_each_row(
            y,
            c,
            #[inline(always)]
            |row, y| {
                let x = &x[row * c..][..c];
                for ((y, &x), column) in y.iter_mut().zip(x).zip(self.iter()) {
                    *y = (column.of(x) + *y).max(T::ZERO);
                }
            },
        );
    }

    pub(super) fn pass_relu_of_sum<T: Scalar>(&self, x: &[T], other: &[T], d: &mut [T]) {
        let c = self.mean.len();
        rows::for_each_row(
            d,
            c,
            #[inline(always)]
            |row, d| {
                let (x, other) = (&x[row * c..][..c], &other[row * c..][..c]);
                for (((d, &x), &other), column) in d.iter_mut().zip(x).zip(other).zip(self.iter()) {
                    *d = if column.of(x) + other > T::ZERO { *d } else { T::ZERO };
                }
            },
        );
    }

    #[inline(always)]
    fn apply_to_row<T: Scalar>(&self, row: usize, activation: Activation<T>, y: &mut [T]) {
        let other = match activation {
            Activation::ReluOfSum(other) => &other[row * y.len()..][..y.len()],
            _ => &[],
        };
        let columns = y.iter_mut().zip(self.iter());
        match activation {
            Activation::Identity => columns.for_each(|(y, column)| *y = column.of(*y)),
            Activation::Relu => columns.for_each(|(y, column)| *y = column.of(*y).max(T::ZERO)),
            Activation::ReluOfSum(_) => columns.zip(other).for_each(|((y, column), &other)| {
                *y = (column.of(*y) + other).max(T::ZERO);
            }),
        }
    }
}

pub(super) fn cast<T: Scalar, W: Scalar>(x: T) -> W {
    W::from_f64(x.to_f64())
}
