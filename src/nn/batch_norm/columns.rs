//! Rows normalised column by column, with what follows.

use super::super::rows;
use crate::scalar::{Scalar, vectorised};

/// What follows a normalisation, in the same pass over memory.
#[derive(Debug, Clone, Copy)]
pub(in crate::nn) enum Finish<'a, T> {
    /// `y`.
    Nothing,
    /// `max(y, 0)`.
    Relu,
    /// `max(y + other, 0)`, `other` as large as `y`.
    ReluOfSum(&'a [T]),
}

/// What normalises each column: `y = (x - mean) · factor + bias`.
pub(in crate::nn) struct Columns<W> {
    pub(super) mean: Vec<W>,
    pub(super) factor: Vec<W>,
    pub(super) bias: Vec<W>,
}

/// One of [`Columns`].
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

impl<W: Scalar> Columns<W> {
    #[inline(always)]
    pub(super) fn iter(&self) -> impl Iterator<Item = Column<W>> + '_ {
        let columns = self.mean.iter().zip(&self.factor).zip(&self.bias);
        columns.map(|((&mean, &factor), &bias)| Column { mean, factor, bias })
    }

    /// Normalises some rows in place; `first` is the number of their first one.
    pub(in crate::nn) fn apply<T: Scalar>(&self, first: usize, finish: Finish<T>, rows: &mut [T]) {
        vectorised(
            #[inline(always)]
            || {
                for (i, y) in rows.chunks_exact_mut(self.mean.len()).enumerate() {
                    self.apply_to_row(first + i, finish, y);
                }
            },
        );
    }

    /// Normalises `x` into `y`.
    pub(super) fn apply_to<T: Scalar>(&self, x: &[T], finish: Finish<T>, y: &mut Vec<T>) {
        let c = self.mean.len();
        y.resize(x.len(), T::ZERO);
        rows::for_each_row(
            y,
            c,
            #[inline(always)]
            |row, y| {
                y.copy_from_slice(&x[row * c..][..c]);
                self.apply_to_row(row, finish, y);
            },
        );
    }

    /// Normalises all rows in place.
    pub(super) fn apply_in_place<T: Scalar>(&self, finish: Finish<T>, x: &mut [T]) {
        rows::for_each_row(
            x,
            self.mean.len(),
            #[inline(always)]
            |row, x| self.apply_to_row(row, finish, x),
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
    fn apply_to_row<T: Scalar>(&self, row: usize, finish: Finish<T>, y: &mut [T]) {
        let other = match finish {
            Finish::ReluOfSum(other) => &other[row * y.len()..][..y.len()],
            _ => &[],
        };
        let columns = y.iter_mut().zip(self.iter());
        match finish {
            Finish::Nothing => columns.for_each(|(y, column)| *y = column.of(*y)),
            Finish::Relu => columns.for_each(|(y, column)| *y = column.of(*y).max(T::ZERO)),
            Finish::ReluOfSum(_) => columns.zip(other).for_each(|((y, column), &other)| {
                *y = (column.of(*y) + other).max(T::ZERO);
            }),
        }
    }
}

pub(super) fn cast<T: Scalar, W: Scalar>(x: T) -> W {
    W::from_f64(x.to_f64())
}
