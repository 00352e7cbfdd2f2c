//! 2×2×2 convolution with stride 2: from the nodes of one depth to those of the next coarser.
//!
//! `y[n] = Σ_k x[8·children[n] + k]·W_k`. The children of a node are eight consecutive rows, so this
//! is one product of `[1, 8·c_in]` by `[8·c_in, c_out]` per non-empty node. Empty nodes get zero rows.

use super::conv::xavier_bound;
use super::kernel_product::{Weights, product, product_then, weight_gradient};
use super::params::{Init, Layout};
use super::rows::{self, Term, Then, nothing};
use crate::octree::Level;
use crate::scalar::Scalar;
use std::ops::Range;

/// Strided convolution with weights `{name}.weights: [8, c_in, c_out]`.
#[derive(Debug, Clone, PartialEq)]
pub struct OctreeDown {
    c_in: usize,
    c_out: usize,
    weights: Range<usize>,
}

impl OctreeDown {
    /// Appends the weights to `layout`, uniform in ±√(6 / (8·c_in + 8·c_out)) as in the reference.
    pub fn new(layout: &mut Layout, name: &str, c_in: usize, c_out: usize) -> Self {
        let bound = xavier_bound(8, c_in, c_out);
        let shape = [8, c_in, c_out];
        let weights = layout.param(format!("{name}.weights"), &shape, Init::Uniform { bound });
        OctreeDown { c_in, c_out, weights }
    }

    /// Number of input channels.
    pub fn c_in(&self) -> usize {
        self.c_in
    }

    /// Number of output channels.
    pub fn c_out(&self) -> usize {
        self.c_out
    }

    /// `x: [8·n_nonempty, c_in]` (all nodes one depth finer than `coarse`) to `y: [n_nodes, c_out]` of
    /// `coarse`.
    ///
    /// # Panics
    /// If `x` has not one row per finer node.
    pub fn forward<T: Scalar>(&self, params: &[T], coarse: &Level, x: &[T], y: &mut Vec<T>) {
        self.forward_then(params, coarse, x, y, &nothing);
    }

    /// [`OctreeDown::forward`], and `then` on each block of rows.
    pub(super) fn forward_then<T: Scalar>(
        &self,
        params: &[T],
        coarse: &Level,
        x: &[T],
        y: &mut Vec<T>,
        then: &Then<T>,
    ) {
        product_then(&coarse.pad, x, self.matrix(params), y, then);
    }

    /// The weights as one matrix.
    fn matrix<'a, T: Scalar>(&self, params: &'a [T]) -> Weights<'a, T> {
        Weights::new(&params[self.weights.clone()], 8 * self.c_in, self.c_out)
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
            product(&coarse.depad, dy, self.matrix(params).transposed(), dx);
        }
        let grads = &mut grads[self.weights.clone()];
        weight_gradient(&coarse.pad, 8, (x, self.c_in), (dy, self.c_out), grads);
    }
}

/// [`OctreeDown`] with rows for the non-empty nodes alone.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedDown(pub OctreeDown);

impl PackedDown {
    /// `x: [8·n_nonempty, c_in]` to `y: [n_nonempty, c_out]`.
    ///
    /// # Panics
    /// If `x` has not one row per node one depth finer than `coarse`.
    pub fn forward<T: Scalar>(&self, params: &[T], coarse: &Level, x: &[T], y: &mut Vec<T>) {
        self.forward_then(params, coarse, x, y, &nothing);
    }

    /// [`PackedDown::forward`], and `then` on each block of rows.
    pub(super) fn forward_then<T: Scalar>(
        &self,
        params: &[T],
        coarse: &Level,
        x: &[T],
        y: &mut Vec<T>,
        then: &Then<T>,
    ) {
        let OctreeDown { c_in, c_out, weights } = &self.0;
        assert_eq!(x.len(), 8 * coarse.n_nonempty() * c_in, "rows of input and finer nodes differ");
        let w = (&params[weights.clone()]).into();
        let term = Term::Product { x, w, c_in: 8 * c_in };
        rows::linear(&[term], None, (coarse.n_nonempty(), *c_out), y, then);
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
        let OctreeDown { c_in, c_out, weights } = &self.0;
        assert_eq!(dy.len(), coarse.n_nonempty() * c_out, "rows of dy and non-empty nodes differ");
        if let Some(dx) = dx {
            let transposed = rows::transposed(&params[weights.clone()], 8 * c_in, *c_out);
            dx.clear();
            dx.resize(x.len(), T::ZERO);
            rows::add_product(dy, &transposed, *c_out, 8 * c_in, dx);
        }
        rows::add_transposed_product(x, 8 * c_in, dy, *c_out, &mut grads[weights.clone()]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::kernel_product::tests::{large_octree, octrees, require_gradients};
    use super::*;
    use crate::gradcheck::{adjoint, probe};
    use crate::nn::pad::Depad;

    fn down(c_in: usize, c_out: usize) -> (OctreeDown, Vec<f64>) {
        let mut layout = Layout::default();
        let layer = OctreeDown::new(&mut layout, "down", c_in, c_out);
        (layer, layout.init_params(1))
    }

    #[test]
    fn output_is_as_defined_and_empty_parents_get_zeros() {
        let (layer, w) = down(3, 2);
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let x = probe(8 * coarse.n_nonempty() * 3, 2);
                let mut y = vec![f64::NAN; 7];
                layer.forward(&w, coarse, &x, &mut y);
                for (n, y) in y.chunks_exact(2).enumerate() {
                    let mut expected = [0.0; 2];
                    if let Ok(group) = usize::try_from(coarse.children[n]) {
                        for (i, x) in x[24 * group..24 * (group + 1)].iter().enumerate() {
                            expected = [0, 1].map(|j| x.mul_add(w[2 * i + j], expected[j]));
                        }
                    }
                    assert_eq!(y, expected);
                }
                let (mut packed, mut depadded) = (vec![f64::NAN; 7], vec![]);
                PackedDown(layer.clone()).forward(&w, coarse, &x, &mut packed);
                Depad::new(2).forward(coarse, &y, &mut depadded);
                assert_eq!(packed, depadded);
            }
        }
    }

    #[test]
    fn gradients_are_right_on_every_kind_of_octree() {
        let (layer, w) = down(3, 2);
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let x = probe(8 * coarse.n_nonempty() * 3, 3);
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
    fn input_gradient_is_the_adjoint_and_that_is_the_transposed_convolution() {
        let (octree, (layer, w)) = (large_octree(), down(2, 3));
        let coarse = &octree.levels[octree.depth() - 1];
        let (n_fine, n_coarse) = (8 * coarse.n_nonempty(), coarse.n_nodes());
        let forward = |x: &[f64]| {
            let mut y = vec![];
            layer.forward(&w, coarse, x, &mut y);
            y
        };
        let transposed = |dy: &[f64]| {
            let (mut dx, mut grads, x) = (vec![], vec![0.0; w.len()], vec![0.0; 2 * n_fine]);
            layer.backward(&w, coarse, &x, dy, Some(&mut dx), &mut grads);
            let up = super::super::conv_transpose::OctreeUp::new(&mut Layout::default(), "", 3, 2);
            let mut y = vec![];
            up.forward(&w, coarse, dy, &mut y);
            assert_eq!(y, dx);
            dx
        };
        assert!(adjoint(2 * n_fine, 3 * n_coarse, forward, transposed) < 1e-14);
    }
}
