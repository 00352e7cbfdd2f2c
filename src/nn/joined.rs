//! Linear maps of columns that stand side by side, without putting them there.
//!
//! Columns that are constant over a shape, such as a cutter's features `v`, need no product per node.
//! In a convolution `Σ_k x[neigh[n, k]]·W_k` their share of the sum is
//! `Σ_{k: neigh[n, k] exists} p_k` with `p_k = v·V_k`, where `V_k` are their rows of `W_k`: 27 vectors per
//! shape, chosen by which neighbours exist. On the way back, with `s_k = Σ dy[n]` over the nodes whose
//! neighbour `k` exists, `dV_k = vᵀ·s_k` and `dv = Σ_k s_k·V_kᵀ`.

use super::concat::{Part, PartGradient};
use super::conv::OctreeConv;
use super::kernel_product::{
    Term, product, product_of_rows, sum_of_terms, sums_of_shapes, weight_gradient_of_columns,
};
use super::linear::Linear;
use super::rows;
use crate::octree::KernelMap;
use crate::par;
use crate::scalar::Scalar;
use std::ops::Range;

/// `[part 0 | part 1 | …]`, one row per node.
#[derive(Debug, Clone, Copy)]
pub struct Joined<'a, T> {
    /// Rows of each shape: consecutive, from 0.
    pub shapes: &'a [Range<usize>],
    /// Columns of each part.
    pub widths: &'a [usize],
    /// The parts.
    pub parts: &'a [Part<'a, T>],
}

/// What a layer reads: a matrix, or one whose columns stand apart.
#[derive(Debug, Clone, Copy)]
pub enum Columns<'a, T> {
    /// `[n, c]`.
    One(&'a [T]),
    /// Several groups of columns.
    Joined(Joined<'a, T>),
}

/// Where the gradient of [`Columns`] goes.
#[derive(Debug)]
pub enum ColumnsGradient<'a, 'b, T> {
    /// `[n, c]`.
    One(&'a mut Vec<T>),
    /// One for each group of columns.
    Joined(&'a mut [PartGradient<'b, T>]),
}

impl<'a, T> From<&'a [T]> for Columns<'a, T> {
    fn from(x: &'a [T]) -> Self {
        Columns::One(x)
    }
}

impl<'a, T> From<&'a Vec<T>> for Columns<'a, T> {
    fn from(x: &'a Vec<T>) -> Self {
        Columns::One(x)
    }
}

impl<'a, T> From<Joined<'a, T>> for Columns<'a, T> {
    fn from(x: Joined<'a, T>) -> Self {
        Columns::Joined(x)
    }
}

impl<'a, T> From<&'a mut Vec<T>> for ColumnsGradient<'a, '_, T> {
    fn from(dx: &'a mut Vec<T>) -> Self {
        ColumnsGradient::One(dx)
    }
}

impl<'a, 'b, T> From<&'a mut [PartGradient<'b, T>]> for ColumnsGradient<'a, 'b, T> {
    fn from(dx: &'a mut [PartGradient<'b, T>]) -> Self {
        ColumnsGradient::Joined(dx)
    }
}

impl<'a, T> Columns<'a, T> {
    /// The one matrix.
    ///
    /// # Panics
    /// If the columns stand apart.
    pub fn one(self) -> &'a [T] {
        match self {
            Columns::One(x) => x,
            Columns::Joined(_) => unreachable!("this layer reads one matrix"),
        }
    }
}

impl<'a, 'b, T> ColumnsGradient<'a, 'b, T> {
    /// The one matrix.
    ///
    /// # Panics
    /// If the columns stand apart.
    pub fn one(self) -> &'a mut Vec<T> {
        match self {
            ColumnsGradient::One(dx) => dx,
            ColumnsGradient::Joined(_) => unreachable!("this layer read one matrix"),
        }
    }

    /// Where the gradient of the last columns goes, if it differs from node to node.
    pub(super) fn last(&mut self) -> Option<&mut Vec<T>> {
        match self {
            ColumnsGradient::One(dx) => Some(dx),
            ColumnsGradient::Joined([.., PartGradient::Nodes(dx)]) => Some(dx),
            ColumnsGradient::Joined(_) => None,
        }
    }

    /// The same place, lent for a while.
    pub fn reborrow(&mut self) -> ColumnsGradient<'_, 'b, T> {
        match self {
            ColumnsGradient::One(dx) => ColumnsGradient::One(dx),
            ColumnsGradient::Joined(dx) => ColumnsGradient::Joined(dx),
        }
    }
}

impl<'a, T: Scalar> Joined<'a, T> {
    fn n_rows(&self) -> usize {
        self.shapes.last().map_or(0, |shape| shape.end)
    }

    /// Each part and its columns.
    fn columns(&self) -> impl Iterator<Item = (Part<'a, T>, Range<usize>)> + use<'a, T> {
        let mut end = 0;
        self.parts.iter().zip(self.widths).map(move |(part, width)| {
            end += width;
            (*part, end - width..end)
        })
    }
}

impl OctreeConv {
    /// [`OctreeConv::forward`] of joined columns: equal up to rounding.
    ///
    /// # Panics
    /// If `x` has not one row per node.
    pub fn forward_joined<T: Scalar>(
        &self,
        params: &[T],
        map: &KernelMap,
        x: &Joined<T>,
        y: &mut Vec<T>,
    ) {
        self.forward_joined_then(params, map, x, y, &rows::nothing);
    }

    /// [`OctreeConv::forward_joined`], and `then` on each block of rows.
    pub(super) fn forward_joined_then<T: Scalar>(
        &self,
        params: &[T],
        map: &KernelMap,
        x: &Joined<T>,
        y: &mut Vec<T>,
        then: &rows::Then<T>,
    ) {
        let (weights, c_in, c_out) = (&params[self.weights()], self.c_in(), self.c_out());
        let term = |(part, columns)| match part {
            Part::Nodes(x) => Term::Nodes { x, weights: self.matrices(params).rows(columns) },
            Part::Shapes(values) => {
                let mut products = vec![T::ZERO; map.n_offsets() * x.shapes.len() * c_out];
                let shapes: Vec<u32> = (0..x.shapes.len() as u32).collect();
                par::for_each_block(&mut products, shapes.len() * c_out, |k, products| {
                    let w =
                        &weights[k * c_in * c_out..][columns.start * c_out..columns.end * c_out];
                    T::matmul_rows(values, &shapes, columns.len(), w, c_out, products, &shapes);
                });
                Term::Shapes { products, shapes: x.shapes }
            }
        };
        let terms: Vec<_> = x.columns().map(term).collect();
        sum_of_terms(map, &terms, c_out, y, then);
    }

    /// [`OctreeConv::backward`] of joined columns; every part of `dx` is overwritten.
    ///
    /// # Panics
    /// If `x` or `dy` has not one row per node.
    pub fn backward_joined<T: Scalar>(
        &self,
        params: &[T],
        map: &KernelMap,
        x: &Joined<T>,
        dy: &[T],
        dx: &mut [PartGradient<T>],
        grads: &mut [T],
    ) {
        let (c_in, c_out) = (self.c_in(), self.c_out());
        let grads = &mut grads[self.weights()];
        for ((part, columns), dx) in x.columns().zip(dx) {
            let width = columns.len();
            let transposed = self.matrices(params).rows(columns.clone()).transposed();
            match (part, dx) {
                (Part::Nodes(x), PartGradient::Nodes(dx)) => {
                    product(map, dy, transposed.reversed(), dx);
                    weight_gradient_of_columns(map, 1, (x, columns, c_in), (dy, c_out), grads);
                }
                (Part::Shapes(values), PartGradient::Shapes(dv)) => {
                    let shapes: Vec<u32> = (0..x.shapes.len() as u32).collect();
                    let len = shapes.len() * c_out;
                    let sums = sums_of_shapes(map, x.shapes, dy, c_out);
                    product_of_rows(&sums, shapes.len(), &transposed, dv);
                    par::for_each_block(grads, c_in * c_out, |k, d| {
                        let d = &mut d[columns.start * c_out..columns.end * c_out];
                        let sums = &sums[k * len..][..len];
                        T::matmul_tn_rows(values, &shapes, width, sums, &shapes, c_out, d);
                    });
                }
                _ => unreachable!("a part and its gradient are of one kind"),
            }
        }
    }
}

impl Linear {
    /// [`Linear::forward`] of joined columns: equal up to rounding.
    pub fn forward_joined<T: Scalar>(&self, params: &[T], x: &Joined<T>, y: &mut Vec<T>) {
        self.forward_joined_then(params, x, y, &rows::nothing);
    }

    /// [`Linear::forward_joined`], and `then` on each block of rows.
    pub(super) fn forward_joined_then<T: Scalar>(
        &self,
        params: &[T],
        x: &Joined<T>,
        y: &mut Vec<T>,
        then: &rows::Then<T>,
    ) {
        let terms = x.columns().map(|(part, columns)| {
            let c_in = columns.len();
            let w = rows::transposed(&self.columns(params, columns), self.c_out, c_in);
            match part {
                Part::Nodes(x) => rows::Term::Product { x, w: w.into(), c_in },
                Part::Shapes(features) => {
                    let mut values = vec![T::ZERO; x.shapes.len() * self.c_out];
                    rows::add_product(features, &w, c_in, self.c_out, &mut values);
                    rows::Term::Shapes { values, shapes: x.shapes }
                }
            }
        });
        let terms: Vec<_> = terms.collect();
        rows::linear(&terms, self.bias(params), (x.n_rows(), self.c_out), y, then);
    }

    /// As [`Linear::backward`], for an input that another branch has already sent a gradient to: `dx` is
    /// added to.
    pub fn add_backward<T: Scalar>(
        &self,
        params: &[T],
        x: Columns<T>,
        dy: &[T],
        dx: ColumnsGradient<T>,
        grads: &mut [T],
    ) {
        match (x, dx) {
            (Columns::One(x), ColumnsGradient::One(dx)) => {
                self.backward(params, x, dy, None, grads);
                self.add_dx(params, dy, dx);
            }
            (Columns::Joined(x), ColumnsGradient::Joined(dx)) => {
                self.add_backward_joined(params, &x, dy, dx, grads);
            }
            _ => unreachable!("columns and their gradient are of one kind"),
        }
    }

    /// [`Linear::backward`] of joined columns; every part of `dx` is added to.
    fn add_backward_joined<T: Scalar>(
        &self,
        params: &[T],
        x: &Joined<T>,
        dy: &[T],
        dx: &mut [PartGradient<T>],
        grads: &mut [T],
    ) {
        self.add_bias_gradient(dy, grads);
        for ((part, columns), dx) in x.columns().zip(dx) {
            let (width, w) = (columns.len(), self.columns(params, columns.clone()));
            let mut dw = vec![T::ZERO; w.len()];
            match (part, dx) {
                (Part::Nodes(x), PartGradient::Nodes(dx)) => {
                    rows::add_product(dy, &w, self.c_out, width, dx);
                    rows::add_transposed_product(dy, self.c_out, x, width, &mut dw);
                }
                (Part::Shapes(values), PartGradient::Shapes(dv)) => {
                    let sums = self.sums_of_shapes(x.shapes, dy);
                    rows::add_product(&sums, &w, self.c_out, width, dv);
                    rows::add_transposed_product(&sums, self.c_out, values, width, &mut dw);
                }
                _ => unreachable!("a part and its gradient are of one kind"),
            }
            let grads = grads[self.weight.clone()].chunks_exact_mut(self.c_in);
            for (d, dw) in grads.zip(dw.chunks_exact(width)) {
                rows::add(&mut d[columns.clone()], dw);
            }
        }
    }

    /// These columns of the weight, `[c_out, columns.len()]`.
    fn columns<T: Scalar>(&self, params: &[T], columns: Range<usize>) -> Vec<T> {
        let rows = params[self.weight.clone()].chunks_exact(self.c_in);
        rows.flat_map(|row| &row[columns.clone()]).copied().collect()
    }

    /// Sum of the rows of each shape, `[n_shapes, c_out]`.
    fn sums_of_shapes<T: Scalar>(&self, shapes: &[Range<usize>], dy: &[T]) -> Vec<T> {
        let sum = |shape: &Range<usize>| {
            let [sums] = rows::column_sums(
                shape.clone(),
                self.c_out,
                #[inline(always)]
                |row, [sum]| {
                    let dy = &dy[row * self.c_out..][..self.c_out];
                    sum.iter_mut().zip(dy).for_each(|(sum, dy)| *sum += dy.to_f64());
                },
            );
            sums
        };
        shapes.iter().flat_map(sum).map(T::from_f64).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::concat::Concat;
    use super::super::kernel_product::tests::octrees;
    use super::super::params::Layout;
    use super::*;
    use crate::gradcheck::probe;

    const WIDTHS: [usize; 3] = [3, 5, 2];

    /// Largest difference, over the largest magnitude.
    fn difference(a: &[f64], b: &[f64]) -> f64 {
        assert_eq!(a.len(), b.len());
        let scale = b.iter().fold(1e-300, |m: f64, b| m.max(b.abs()));
        a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / scale
    }

    /// Runs `joined` on the parts and `plain` on the columns put side by side; both return outputs and
    /// gradients by the parts and the parameters, which must be equal up to rounding.
    fn assert_equal(
        (widths, c_out): ([usize; 3], usize),
        shapes: &[Range<usize>],
        n_params: usize,
        joined: impl Fn(&Joined<f64>, &[f64], &mut [PartGradient<f64>], &mut [f64]) -> Vec<f64>,
        plain: impl Fn(&[f64], &[f64], &mut Vec<f64>, &mut [f64]) -> Vec<f64>,
    ) {
        let n = shapes.last().unwrap().end;
        let [skip, cutter, up] = [n, shapes.len(), n];
        let skip = probe(skip * widths[0], 1);
        let (cutter, up) = (probe(cutter * widths[1], 2), probe(up * widths[2], 3));
        let parts = [Part::Nodes(&skip[..]), Part::Shapes(&cutter), Part::Nodes(&up)];
        let dy = probe(n * c_out, 4);
        let concat = Concat { shapes, widths: &widths };
        let (mut x, mut dx) = (vec![], vec![]);
        concat.forward(&parts, &mut x);
        let (mut a, mut grads_a) = (std::array::from_fn(|_| vec![]), vec![0.0; n_params]);
        let (mut b, mut grads_b) = (std::array::from_fn(|_| vec![]), vec![0.0; n_params]);
        let y_b = plain(&x, &dy, &mut dx, &mut grads_b);
        concat.backward(&dx, &mut gradients(&mut b));
        let x = Joined { shapes, widths: &widths, parts: &parts };
        let y_a = joined(&x, &dy, &mut gradients(&mut a), &mut grads_a);
        assert!(difference(&y_a, &y_b) < 1e-14);
        assert!(difference(&grads_a, &grads_b) < 1e-14);
        for (a, b) in a.iter().zip(&b) {
            assert!(difference(a, b) < 1e-14);
        }
    }

    fn gradients(dx: &mut [Vec<f64>; 3]) -> [PartGradient<'_, f64>; 3] {
        let [skip, cutter, up] = dx;
        [PartGradient::Nodes(skip), PartGradient::Shapes(cutter), PartGradient::Nodes(up)]
    }

    fn assert_convolutions_equal((widths, c_out): ([usize; 3], usize)) {
        let mut layout = Layout::default();
        let conv = OctreeConv::new(&mut layout, "conv", widths.iter().sum(), c_out);
        let params = layout.init_params(1);
        for octree in octrees() {
            for level in &octree.levels {
                let map = &level.conv;
                assert_equal(
                    (widths, c_out),
                    &level.ranges,
                    params.len(),
                    |x, dy, dx, grads| {
                        let mut y = vec![];
                        conv.forward_joined(&params, map, x, &mut y);
                        conv.backward_joined(&params, map, x, dy, dx, grads);
                        y
                    },
                    |x, dy, dx, grads| {
                        let mut y = vec![];
                        conv.forward(&params, map, x, &mut y);
                        conv.backward(&params, map, x, dy, Some(dx), grads);
                        y
                    },
                );
            }
        }
    }

    #[test]
    fn convolution_equals_that_of_the_columns_side_by_side() {
        assert_convolutions_equal((WIDTHS, 4));
    }

    #[test]
    fn wide_convolution_equals_that_of_the_columns_side_by_side() {
        assert_convolutions_equal(([64, 8, 72], 64));
    }

    #[test]
    fn linear_map_equals_that_of_the_columns_side_by_side() {
        for bias in [false, true] {
            let mut layout = Layout::default();
            let linear = Linear::new(&mut layout, "linear", 10, 4, bias);
            let params = layout.init_params(1);
            let shapes = [0..700, 700..700, 700..701, 701..2500];
            assert_equal(
                (WIDTHS, 4),
                &shapes,
                params.len(),
                |x, dy, dx, grads| {
                    let mut y = vec![];
                    linear.forward_joined(&params, x, &mut y);
                    for (dx, width) in dx.iter_mut().zip(WIDTHS) {
                        match dx {
                            PartGradient::Nodes(dx) => dx.resize(x.n_rows() * width, 0.0),
                            PartGradient::Shapes(dx) => dx.resize(x.shapes.len() * width, 0.0),
                        }
                    }
                    linear.add_backward_joined(&params, x, dy, dx, grads);
                    y
                },
                |x, dy, dx, grads| {
                    let mut y = vec![];
                    linear.forward(&params, x, &mut y);
                    linear.backward(&params, x, dy, Some(dx), grads);
                    y
                },
            );
        }
    }
}
