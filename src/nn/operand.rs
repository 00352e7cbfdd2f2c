//! The input of a layer: a matrix, one row per shape that holds for all of its rows, or such matrices side by side.
//!
//! Columns that are constant over a shape, such as features of a cutter, need no copy per row: linear operators
//! multiply them once per shape. An operator that has no such way of its own takes [`Operand::to_matrix`] and
//! [`OperandGradient::of_matrix`].

use super::arena::{Arena, Buffer};
use super::rows;
use crate::numeric::scalar::Scalar;
use std::ops::{Deref, Range};

/// The input of a layer, `[n, c]`.
///
/// ```
/// use deepmill::nn::{arena::Arena, layer::Layer, linear::Linear, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Inference};
///
/// let sum = Linear::new(&mut Layout::default(), "sum", 2, 1, false);
/// let (params, arena) = ([1.0, 1.0], Arena::default());
/// let nodes = Operand::new(&[1.0, 2.0, 3.0], 1); // three nodes
/// let shapes = Operand::PerShape { x: &[10.0, 20.0], c: 1, shapes: &[0..2, 2..3] }; // of two shapes
/// let both = [nodes, shapes]; // side by side: two columns
/// let y = sum.forward(&Inference::new(&params, &[], &arena), &(), Operand::Concat(&both));
/// assert_eq!(y[..], [11.0, 12.0, 23.0]);
/// ```
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Operand<'a, T> {
    /// A matrix with its own row for every node.
    PerNode {
        /// `[n, c]`.
        x: &'a [T],
        /// Columns.
        c: usize,
    },
    /// The same row for all nodes of a shape.
    PerShape {
        /// `[n_shapes, c]`.
        x: &'a [T],
        /// Columns.
        c: usize,
        /// Rows of each shape: consecutive, from 0.
        shapes: &'a [Range<usize>],
    },
    /// Operands side by side, all with the same rows.
    Concat(&'a [Operand<'a, T>]),
}

/// One matrix of an operand, without [`Operand::Concat`].
#[derive(Debug, Clone, Copy)]
pub(super) enum OperandPart<'a, T> {
    Nodes(&'a [T]),
    Shapes(&'a [T], &'a [Range<usize>]),
}

/// An operand as one matrix: borrowed where it is one already.
#[derive(Debug)]
#[non_exhaustive]
pub enum Matrix<'a, T> {
    /// The operand's own numbers.
    Borrowed(&'a [T]),
    /// Numbers put side by side.
    Owned(Buffer<T>),
}

/// Gradient by an [`Operand`]: one buffer for each matrix in it, from left to right, shaped as that matrix.
#[derive(Debug, Default)]
pub struct OperandGradient<T>(Vec<Buffer<T>>);

impl<'a, T: Scalar> Operand<'a, T> {
    /// `x: [n, c]`.
    ///
    /// # Panics
    /// If `x` is not whole rows.
    pub fn new(x: &'a [T], c: usize) -> Self {
        assert!(c > 0 && x.len().is_multiple_of(c), "{} numbers are not rows of {c}", x.len());
        Operand::PerNode { x, c }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        match self {
            Operand::PerNode { c, .. } | Operand::PerShape { c, .. } => *c,
            Operand::Concat(operands) => operands.iter().map(Operand::width).sum(),
        }
    }

    /// Rows.
    ///
    /// # Panics
    /// If operands side by side have different numbers of rows, or one holds numbers that are not whole rows.
    pub fn n_rows(&self) -> usize {
        match self {
            Operand::PerNode { x, c } => {
                assert!(*c > 0 && x.len().is_multiple_of(*c), "ragged rows of {c}: {}", x.len());
                x.len() / c
            }
            Operand::PerShape { x, c, shapes } => {
                assert_eq!(x.len(), shapes.len() * c, "one row of {c} for each shape");
                shapes.last().map_or(0, |shape| shape.end)
            }
            Operand::Concat(operands) => {
                let mut numbers = operands.iter().map(Operand::n_rows);
                let first = numbers.next().unwrap_or(0);
                assert!(numbers.all(|n| n == first), "operands with different numbers of rows");
                first
            }
        }
    }

    /// The matrices in it, from left to right; itself if it is one.
    pub fn matrices(&self) -> Vec<Operand<'a, T>> {
        match self {
            Operand::Concat(operands) => operands.iter().flat_map(Operand::matrices).collect(),
            matrix => vec![*matrix],
        }
    }

    /// The numbers of a single matrix; empty for several.
    pub fn numbers(&self) -> &'a [T] {
        match self {
            Operand::PerNode { x, .. } | Operand::PerShape { x, .. } => x,
            Operand::Concat(_) => &[],
        }
    }

    /// A single matrix of the same kind and width with other numbers; several stay as they are.
    pub fn with_numbers<'b>(&self, x: &'b [T]) -> Operand<'b, T>
    where
        'a: 'b,
    {
        match *self {
            Operand::PerNode { c, .. } => Operand::PerNode { x, c },
            Operand::PerShape { c, shapes, .. } => Operand::PerShape { x, c, shapes },
            Operand::Concat(operands) => Operand::Concat(operands),
        }
    }

    /// Each matrix and its columns, from left to right.
    pub(super) fn parts(&self) -> Vec<(OperandPart<'a, T>, Range<usize>)> {
        let mut parts = Vec::new();
        self.push_parts(&mut parts);
        parts
    }

    fn push_parts(&self, parts: &mut Vec<(OperandPart<'a, T>, Range<usize>)>) {
        let start = parts.last().map_or(0, |(_, columns)| columns.end);
        match *self {
            Operand::PerNode { x, c } => parts.push((OperandPart::Nodes(x), start..start + c)),
            Operand::PerShape { x, c, shapes } => {
                parts.push((OperandPart::Shapes(x, shapes), start..start + c));
            }
            Operand::Concat(operands) => operands.iter().for_each(|o| o.push_parts(parts)),
        }
    }

    /// `[n, c]` in one piece.
    ///
    /// # Panics
    /// As [`Operand::n_rows`].
    pub fn to_matrix(&self, arena: &Arena<T>) -> Matrix<'a, T> {
        let (n, width) = (self.n_rows(), self.width());
        if let Operand::PerNode { x, .. } = self {
            return Matrix::Borrowed(x);
        }
        let (parts, mut y) = (self.parts(), arena.get(n * width));
        rows::for_each_row(&mut y, width, |row, y| {
            for (part, columns) in &parts {
                y[columns.clone()].copy_from_slice(part.row(row, columns.len()));
            }
        });
        Matrix::Owned(y)
    }

    /// [`Operand::to_matrix`] in a buffer of its own.
    pub fn copied(&self, arena: &Arena<T>) -> Buffer<T> {
        match self.to_matrix(arena) {
            Matrix::Borrowed(x) => arena.copy_of(x),
            Matrix::Owned(x) => x,
        }
    }
}

impl<'a, T> OperandPart<'a, T> {
    fn row(&self, row: usize, c: usize) -> &'a [T] {
        let (x, row) = match *self {
            OperandPart::Nodes(x) => (x, row),
            OperandPart::Shapes(x, shapes) => (x, shapes.partition_point(|shape| shape.end <= row)),
        };
        &x[row * c..][..c]
    }
}

impl<T: Scalar> OperandGradient<T> {
    /// From one buffer for each matrix.
    pub(super) fn new(parts: Vec<Buffer<T>>) -> Self {
        OperandGradient(parts)
    }

    /// From the gradient `dx` by `x` as one matrix: columns go to their operands, and rows of a shape are
    /// summed, in f64, where they were one.
    ///
    /// # Panics
    /// If `dx` is not shaped as `x`.
    pub fn of_matrix(arena: &Arena<T>, x: Operand<T>, dx: Buffer<T>) -> Self {
        let width = x.width();
        assert_eq!(dx.len(), x.n_rows() * width, "rows of the gradient and of the input differ");
        if let Operand::PerNode { .. } = x {
            return OperandGradient(vec![dx]);
        }
        let of_part = |(part, columns): (OperandPart<T>, Range<usize>)| {
            let (c, row) =
                (columns.len(), |row: usize| &dx[row * width + columns.start..][..columns.len()]);
            match part {
                OperandPart::Nodes(x) => {
                    let mut d = arena.get(x.len());
                    rows::for_each_row(&mut d, c, |i, d| d.copy_from_slice(row(i)));
                    d
                }
                OperandPart::Shapes(x, shapes) => {
                    let mut d = arena.get(x.len());
                    for (d, shape) in d.chunks_exact_mut(c).zip(shapes) {
                        let sums = rows::sums_of_columns(shape.clone(), c, row);
                        d.iter_mut().zip(sums).for_each(|(d, sum)| *d = T::from_f64(sum));
                    }
                    d
                }
            }
        };
        OperandGradient(x.parts().into_iter().map(of_part).collect())
    }

    /// One buffer for each matrix of the operand, from left to right.
    pub fn into_parts(self) -> Vec<Buffer<T>> {
        self.0
    }

    /// The buffers, to add to.
    pub(super) fn parts_mut(&mut self) -> &mut [Buffer<T>] {
        &mut self.0
    }

    /// The first buffer: all there is if the operand was one matrix.
    pub fn into_first(self) -> Buffer<T> {
        self.0.into_iter().next().unwrap_or_default()
    }

    /// Adds the gradient of another branch by the same operand.
    ///
    /// # Panics
    /// If the other's operand was shaped otherwise.
    pub fn add(&mut self, other: &OperandGradient<T>) {
        assert_eq!(self.0.len(), other.0.len(), "gradients of different operands");
        self.0.iter_mut().zip(&other.0).for_each(|(d, other)| rows::add_all(d, other));
    }
}

impl<T> Deref for Matrix<'_, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match self {
            Matrix::Borrowed(x) => x,
            Matrix::Owned(x) => x,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::gradcheck;

    #[test]
    fn concatenation_places_every_part_and_its_gradient_is_the_adjoint() {
        let (shapes, arena) = ([0..2, 2..2, 2..5], Arena::default());
        let with_operand = |x: &[f64], work: &dyn Fn(Operand<f64>) -> Vec<f64>| {
            let (nodes, rest) = x.split_at(10);
            let (per_shape, other) = rest.split_at(3);
            let inner =
                [Operand::PerShape { x: per_shape, c: 1, shapes: &shapes }, Operand::new(other, 3)];
            work(Operand::Concat(&[Operand::new(nodes, 2), Operand::Concat(&inner)]))
        };
        let forward = |x: &[f64]| with_operand(x, &|x| x.to_matrix(&arena).to_vec());
        let x: Vec<f64> = (0..28).map(f64::from).collect();
        let backward = |dy: &[f64]| {
            with_operand(&x, &|x| {
                let dx = OperandGradient::of_matrix(&arena, x, arena.copy_of(dy));
                dx.into_parts().concat()
            })
        };
        let y = forward(&x);
        assert_eq!(y[..6], [0.0, 1.0, 10.0, 13.0, 14.0, 15.0]);
        assert_eq!(y[12..18], [4.0, 5.0, 12.0, 19.0, 20.0, 21.0]);
        assert!(gradcheck::adjoint(28, 30, forward, backward).unwrap() < 1e-14);
    }

    #[test]
    #[should_panic(expected = "5 numbers are not rows of 2")]
    fn ragged_rows_are_refused() {
        Operand::new(&[0.0; 5], 2);
    }

    #[test]
    #[should_panic(expected = "different numbers of rows")]
    fn operands_of_different_rows_cannot_stand_side_by_side() {
        Operand::Concat(&[Operand::new(&[0.0; 4], 2), Operand::new(&[0.0; 3], 1)]).n_rows();
    }
}
