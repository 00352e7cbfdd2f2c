//! Transposed 2×2×2 convolution with stride 2: from the nodes of one depth to those of the next finer.
//!
//! `y[8·children[n] + k] = W_k·x[n]`: the adjoint of [`super::down::OctreeDown`] with the same weights.
//! Rows of empty nodes are not read and get zero gradients.

use super::conv::xavier_bound;
use super::kernel_product::{Weights, product, product_then, weight_gradient};
use super::params::{Init, Layout};
use super::rows::{Then, nothing};
use crate::octree::Level;
use crate::scalar::Scalar;
use std::ops::Range;

/// Transposed convolution with weights `{name}.weights: [8, c_out, c_in]`.
#[derive(Debug, Clone, PartialEq)]
pub struct OctreeUp {
    c_in: usize,
    c_out: usize,
    weights: Range<usize>,
}

impl OctreeUp {
    /// Appends the weights to `layout`, uniform in ±√(6 / (8·c_in + 8·c_out)) as in the reference.
    pub fn new(layout: &mut Layout, name: &str, c_in: usize, c_out: usize) -> Self {
        let bound = xavier_bound(8, c_in, c_out);
        let shape = [8, c_out, c_in];
        let weights = layout.param(format!("{name}.weights"), &shape, Init::Uniform { bound });
        OctreeUp { c_in, c_out, weights }
    }

    /// Number of input channels.
    pub fn c_in(&self) -> usize {
        self.c_in
    }

    /// Number of output channels.
    pub fn c_out(&self) -> usize {
        self.c_out
    }

    /// `x: [n_nodes, c_in]` of `coarse` to `y: [8·n_nonempty, c_out]`, all nodes one depth finer.
    ///
    /// # Panics
    /// If `x` has not one row per node of `coarse`.
    pub fn forward<T: Scalar>(&self, params: &[T], coarse: &Level, x: &[T], y: &mut Vec<T>) {
        self.forward_then(params, coarse, x, y, &nothing);
    }

    /// [`OctreeUp::forward`], and `then` on each block of rows.
    pub(super) fn forward_then<T: Scalar>(
        &self,
        params: &[T],
        coarse: &Level,
        x: &[T],
        y: &mut Vec<T>,
        then: &Then<T>,
    ) {
        // A row of the product is the eight rows of a node's children.
        let then = |first: usize, rows: &mut [T]| then(8 * first, rows);
        product_then(&coarse.depad, x, self.matrix(params).transposed(), y, &then);
    }

    /// The weights as one matrix.
    fn matrix<'a, T: Scalar>(&self, params: &'a [T]) -> Weights<'a, T> {
        Weights::new(&params[self.weights.clone()], 8 * self.c_out, self.c_in)
    }

    /// Overwrites `dx` (shaped as `x`) if wanted and adds to the weights' part of `grads`.
    ///
    /// # Panics
    /// If `x` or `dy` has the wrong number of rows.
    pub fn backward<T: Scalar>(
        &self,
        params: &[T],
        coarse: &Level,
        x: &[T],
        dy: &[T],
        dx: Option<&mut Vec<T>>,
        grads: &mut [T],
    ) {
        if let Some(dx) = dx {
            product(&coarse.pad, dy, self.matrix(params), dx);
        }
        let grads = &mut grads[self.weights.clone()];
        weight_gradient(&coarse.pad, 8, (dy, self.c_out), (x, self.c_in), grads);
    }
}

#[cfg(test)]
mod tests {
    use super::super::kernel_product::tests::{large_octree, octrees, require_gradients};
    use super::*;
    use crate::gradcheck::{adjoint, probe};

    fn up(c_in: usize, c_out: usize) -> (OctreeUp, Vec<f64>) {
        let mut layout = Layout::default();
        let layer = OctreeUp::new(&mut layout, "up", c_in, c_out);
        (layer, layout.init_params(1))
    }

    #[test]
    fn output_is_as_defined_and_empty_parents_are_not_read() {
        let (layer, w) = up(3, 2);
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let x = probe(coarse.n_nodes() * 3, 2);
                let mut y = vec![f64::NAN; 7];
                layer.forward(&w, coarse, &x, &mut y);
                assert_eq!(y.len(), 16 * coarse.n_nonempty());
                for (row, y) in y.chunks_exact(2).enumerate() {
                    let parent = coarse.nonempty[row / 8] as usize;
                    let expected = [0, 1].map(|j| {
                        let w = &w[(2 * (row % 8) + j) * 3..];
                        (0..3).fold(0.0, |sum, p| x[3 * parent + p].mul_add(w[p], sum))
                    });
                    assert_eq!(y, expected);
                }
            }
        }
    }

    #[test]
    fn gradients_are_right_on_every_kind_of_octree() {
        let (layer, w) = up(3, 2);
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let x = probe(coarse.n_nodes() * 3, 3);
                let forward = |v: &[Vec<f64>]| {
                    let mut y = vec![];
                    layer.forward(&v[1], coarse, &v[0], &mut y);
                    y
                };
                let backward = |v: &[Vec<f64>], dy: &[f64]| {
                    let (mut dx, mut grads) = (vec![f64::NAN; 3], vec![0.0; w.len()]);
                    layer.backward(&v[1], coarse, &v[0], dy, Some(&mut dx), &mut grads);
                    vec![dx, grads]
                };
                require_gradients(&[("x", &x), ("weights", &w)], forward, backward);
            }
        }
    }

    #[test]
    fn input_gradient_is_the_adjoint_on_a_large_octree() {
        let (octree, (layer, w)) = (large_octree(), up(2, 3));
        let coarse = &octree.levels[octree.depth() - 1];
        let (n_fine, n_coarse) = (8 * coarse.n_nonempty(), coarse.n_nodes());
        let forward = |x: &[f64]| {
            let mut y = vec![];
            layer.forward(&w, coarse, x, &mut y);
            y
        };
        let transposed = |dy: &[f64]| {
            let (mut dx, mut grads, x) = (vec![], vec![0.0; w.len()], vec![0.0; 2 * n_coarse]);
            layer.backward(&w, coarse, &x, dy, Some(&mut dx), &mut grads);
            dx
        };
        assert!(adjoint(2 * n_coarse, 3 * n_fine, forward, transposed) < 1e-14);
    }
}
