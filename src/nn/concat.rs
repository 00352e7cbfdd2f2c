//! Columns side by side: per-node features, and features of a shape repeated over its nodes.

use super::rows;
use crate::scalar::Scalar;
use std::ops::Range;

/// One group of columns of the output.
#[derive(Debug, Clone, Copy)]
pub enum Part<'a, T> {
    /// `[n, c]`: its own row for every node.
    Nodes(&'a [T]),
    /// `[n_shapes, c]`: the shape's row for every node of the shape.
    Shapes(&'a [T]),
}

/// Where the gradient of one [`Part`] goes.
#[derive(Debug)]
pub enum PartGradient<'a, T> {
    /// `[n, c]`, overwritten.
    Nodes(&'a mut Vec<T>),
    /// `[n_shapes, c]`, overwritten: sums over the nodes of each shape.
    Shapes(&'a mut Vec<T>),
}

/// Rows of each shape of a batch, and the columns of each part.
#[derive(Debug, Clone, Copy)]
pub struct Concat<'a> {
    /// Rows of each shape: consecutive, from 0.
    pub shapes: &'a [Range<usize>],
    /// Columns of each part.
    pub widths: &'a [usize],
}

impl Concat<'_> {
    /// `y[n] = [part 0 | part 1 | …]`, `[n, Σ widths]`.
    pub fn forward<T: Scalar>(&self, parts: &[Part<T>], y: &mut Vec<T>) {
        let width: usize = self.widths.iter().sum();
        let n = self.shapes.last().map_or(0, |s| s.end);
        y.resize(n * width, T::ZERO);
        rows::for_each_row(y, width, |row, mut y| {
            for (part, &c) in parts.iter().zip(self.widths) {
                let (columns, rest) = y.split_at_mut(c);
                columns.copy_from_slice(match part {
                    Part::Nodes(x) => &x[row * c..][..c],
                    Part::Shapes(x) => &x[self.shape_of(row) * c..][..c],
                });
                y = rest;
            }
        });
    }

    /// Splits `dy: [n, Σ widths]` over the parts.
    pub fn backward<T: Scalar>(&self, dy: &[T], parts: &mut [PartGradient<T>]) {
        let width: usize = self.widths.iter().sum();
        let mut first = 0;
        for (part, &c) in parts.iter_mut().zip(self.widths) {
            let columns = |row: usize| &dy[row * width + first..][..c];
            match part {
                PartGradient::Nodes(dx) => {
                    dx.resize(dy.len() / width * c, T::ZERO);
                    rows::for_each_row(dx, c, |row, dx| dx.copy_from_slice(columns(row)));
                }
                PartGradient::Shapes(dx) => {
                    dx.clear();
                    for shape in self.shapes {
                        let [sums] = rows::column_sums(
                            shape.clone(),
                            c,
                            #[inline(always)]
                            |row, [sum]| {
                                let dy = columns(row);
                                sum.iter_mut().zip(dy).for_each(|(sum, dy)| *sum += dy.to_f64());
                            },
                        );
                        dx.extend(sums.into_iter().map(T::from_f64));
                    }
                }
            }
            first += c;
        }
    }

    fn shape_of(&self, row: usize) -> usize {
        self.shapes.partition_point(|shape| shape.end <= row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradcheck;

    #[test]
    fn places_every_part_and_its_backward_is_the_adjoint() {
        let shapes = [0..2, 2..2, 2..5];
        let concat = Concat { shapes: &shapes, widths: &[2, 1, 3] };
        let forward = |x: &[f64]| {
            let (nodes, rest) = x.split_at(10);
            let (per_shape, other) = rest.split_at(3);
            let mut y = Vec::new();
            let parts = [Part::Nodes(nodes), Part::Shapes(per_shape), Part::Nodes(other)];
            concat.forward(&parts, &mut y);
            y
        };
        let backward = |dy: &[f64]| {
            let (mut nodes, mut per_shape, mut other) = (Vec::new(), Vec::new(), Vec::new());
            let mut parts = [
                PartGradient::Nodes(&mut nodes),
                PartGradient::Shapes(&mut per_shape),
                PartGradient::Nodes(&mut other),
            ];
            concat.backward(dy, &mut parts);
            [nodes, per_shape, other].concat()
        };
        let x: Vec<f64> = (0..28).map(f64::from).collect();
        let y = forward(&x);
        assert_eq!(y[..6], [0.0, 1.0, 10.0, 13.0, 14.0, 15.0]);
        assert_eq!(y[12..18], [4.0, 5.0, 12.0, 19.0, 20.0, 21.0]);
        assert!(gradcheck::adjoint(28, 30, forward, backward) < 1e-14);
    }
}
