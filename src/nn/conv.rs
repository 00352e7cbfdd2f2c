//! 3×3×3 convolution over the nodes of one depth.
//!
//! `y[n] = Σ_k x[neigh[n, k]]·W_k` over the neighbours that exist, without bias. Since `m` is neighbour
//! `k` of `n` exactly if `n` is neighbour `26 − k` of `m`, the input gradient is the same sum with
//! `W_{26−k}ᵀ` in place of `W_k`.

use super::kernel_product::{Weights, product, product_then, weight_gradient};
use super::params::{Init, Layout};
use super::rows::{Then, nothing};
use crate::octree::KernelMap;
use crate::scalar::Scalar;
use std::ops::Range;

/// Convolution with weights `{name}.weights: [27, c_in, c_out]`.
#[derive(Debug, Clone, PartialEq)]
pub struct OctreeConv {
    c_in: usize,
    c_out: usize,
    weights: Range<usize>,
}

impl OctreeConv {
    /// Appends the weights to `layout`, uniform in ±√(6 / (27·c_in + 27·c_out)) as in the reference.
    pub fn new(layout: &mut Layout, name: &str, c_in: usize, c_out: usize) -> Self {
        let bound = xavier_bound(27, c_in, c_out);
        let shape = [27, c_in, c_out];
        let weights = layout.param(format!("{name}.weights"), &shape, Init::Uniform { bound });
        OctreeConv { c_in, c_out, weights }
    }

    /// Number of input channels.
    pub fn c_in(&self) -> usize {
        self.c_in
    }

    /// Number of output channels.
    pub fn c_out(&self) -> usize {
        self.c_out
    }

    /// Place of the weights in the parameter vector.
    pub fn weights(&self) -> Range<usize> {
        self.weights.clone()
    }

    /// `x: [n_nodes, c_in]` to `y: [n_nodes, c_out]`, with [`crate::octree::Level::conv`] as the map.
    ///
    /// # Panics
    /// If `x` has not one row per node.
    pub fn forward<T: Scalar>(&self, params: &[T], map: &KernelMap, x: &[T], y: &mut Vec<T>) {
        self.forward_then(params, map, x, y, &nothing);
    }

    /// [`OctreeConv::forward`], and `then` on each block of rows.
    pub(super) fn forward_then<T: Scalar>(
        &self,
        params: &[T],
        map: &KernelMap,
        x: &[T],
        y: &mut Vec<T>,
        then: &Then<T>,
    ) {
        product_then(map, x, self.matrices(params), y, then);
    }

    /// The weights as matrices, one for each offset.
    pub(super) fn matrices<'a, T: Scalar>(&self, params: &'a [T]) -> Weights<'a, T> {
        Weights::new(&params[self.weights.clone()], self.c_in, self.c_out)
    }

    /// Overwrites `dx: [n_nodes, c_in]` alone.
    pub(super) fn backward_input<T: Scalar>(
        &self,
        params: &[T],
        map: &KernelMap,
        dy: &[T],
        dx: &mut Vec<T>,
    ) {
        product(map, dy, self.matrices(params).transposed().reversed(), dx);
    }

    /// Overwrites `dx: [n_nodes, c_in]` if wanted and adds to the weights' part of `grads`.
    ///
    /// # Panics
    /// If `x` or `dy` has not one row per node.
    pub fn backward<T: Scalar>(
        &self,
        params: &[T],
        map: &KernelMap,
        x: &[T],
        dy: &[T],
        dx: Option<&mut Vec<T>>,
        grads: &mut [T],
    ) {
        if let Some(dx) = dx {
            self.backward_input(params, map, dy, dx);
        }
        let grads = &mut grads[self.weights.clone()];
        weight_gradient(map, 1, (x, self.c_in), (dy, self.c_out), grads);
    }
}

/// The reference's bound for uniform weights of a kernel with `k` offsets.
pub(super) fn xavier_bound(k: usize, c_in: usize, c_out: usize) -> f64 {
    (6.0 / (k * (c_in + c_out)) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::kernel_product::tests::{large_octree, octrees, require_gradients};
    use super::*;
    use crate::gradcheck::{adjoint, probe};
    use crate::octree::tests::{sheet, sheets};
    use crate::octree::{Cloud, Level, Octree, OctreeOptions};
    use crate::par::with_threads;

    fn conv(c_in: usize, c_out: usize) -> (OctreeConv, Vec<f64>) {
        let mut layout = Layout::default();
        let conv = OctreeConv::new(&mut layout, "conv", c_in, c_out);
        (conv, layout.init_params(1))
    }

    /// The definition, product by product in the promised order.
    fn plain(level: &Level, w: &[f64], c_in: usize, c_out: usize, x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; level.n_nodes() * c_out];
        for (neigh, y) in level.neigh.iter().zip(y.chunks_exact_mut(c_out)) {
            for (k, &m) in neigh.iter().enumerate().filter(|(_, m)| **m >= 0) {
                for p in 0..c_in {
                    for (j, y) in y.iter_mut().enumerate() {
                        let weight = w[(k * c_in + p) * c_out + j];
                        *y = x[m as usize * c_in + p].mul_add(weight, *y);
                    }
                }
            }
        }
        y
    }

    #[test]
    fn output_equals_the_plain_sum_over_neighbours() {
        let (conv, w) = conv(3, 5);
        for octree in octrees() {
            for level in &octree.levels {
                let x = probe(level.n_nodes() * 3, 2);
                let mut y = vec![f64::NAN; 7];
                conv.forward(&w, &level.conv, &x, &mut y);
                assert_eq!(y, plain(level, &w, 3, 5, &x));
            }
        }
    }

    /// Levels on which wide convolutions take another way.
    fn levels_of_siblings(octree: &Octree) -> impl Iterator<Item = &Level> {
        octree.levels.iter().filter(|level| !level.conv.siblings().is_empty())
    }

    #[test]
    fn wide_output_equals_the_plain_sum_up_to_rounding() {
        for (c_in, c_out) in [(16, 24), (40, 16)] {
            let (conv, w) = conv(c_in, c_out);
            for octree in octrees().iter().chain([&large_octree()]) {
                let levels: Vec<_> = levels_of_siblings(octree).collect();
                assert!(!levels.is_empty());
                for level in levels {
                    let x = probe(level.n_nodes() * c_in, 2);
                    let mut y = vec![f64::NAN; 7];
                    conv.forward(&w, &level.conv, &x, &mut y);
                    let plain = plain(level, &w, c_in, c_out, &x);
                    assert!(y.iter().zip(&plain).all(|(y, plain)| (y - plain).abs() < 1e-13));
                    assert!(y.iter().zip(&plain).any(|(y, plain)| y != plain), "another way");
                }
            }
        }
    }

    #[test]
    fn wide_gradients_are_right_on_every_kind_of_octree() {
        let (c_in, c_out) = (72, 64);
        let (conv, w) = conv(c_in, c_out);
        for octree in octrees() {
            for level in levels_of_siblings(&octree) {
                let x = probe(level.n_nodes() * c_in, 3);
                let forward = |v: &[Vec<f64>]| {
                    let mut y = vec![];
                    conv.forward(&v[1], &level.conv, &v[0], &mut y);
                    y
                };
                let backward = |v: &[Vec<f64>], dy: &[f64]| {
                    let (mut dx, mut grads) = (vec![], vec![0.0; w.len()]);
                    conv.backward(&v[1], &level.conv, &v[0], dy, Some(&mut dx), &mut grads);
                    vec![dx, grads]
                };
                require_gradients(&[("x", &x), ("weights", &w)], forward, backward);
            }
        }
    }

    #[test]
    fn wide_weight_gradient_equals_the_plain_sum_and_is_added() {
        let (c, octree) = (64, large_octree());
        let ((conv, w), level) = (conv(c, c), octree.finest());
        let (x, dy) = (probe(level.n_nodes() * c, 4), probe(level.n_nodes() * c, 5));
        let mut grads = vec![1.0; w.len()];
        conv.backward(&w, &level.conv, &x, &dy, None, &mut grads);
        for (k, p, j) in [(0, 3, 5), (13, 0, 63), (14, 63, 0), (26, 31, 32)] {
            let rows = level.neigh.iter().enumerate().filter(|(_, neigh)| neigh[k] >= 0);
            let plain: f64 =
                rows.map(|(n, neigh)| x[neigh[k] as usize * c + p] * dy[n * c + j]).sum();
            assert!((grads[(k * c + p) * c + j] - 1.0 - plain).abs() < 1e-11);
        }
    }

    #[test]
    fn gradients_are_right_on_every_kind_of_octree() {
        let (conv, w) = conv(3, 2);
        for octree in octrees() {
            for level in &octree.levels[1..] {
                let x = probe(level.n_nodes() * 3, 3);
                let forward = |v: &[Vec<f64>]| {
                    let mut y = vec![];
                    conv.forward(&v[1], &level.conv, &v[0], &mut y);
                    y
                };
                let backward = |v: &[Vec<f64>], dy: &[f64]| {
                    let (mut dx, mut grads) = (vec![f64::NAN; 3], vec![0.0; w.len()]);
                    conv.backward(&v[1], &level.conv, &v[0], dy, Some(&mut dx), &mut grads);
                    vec![dx, grads]
                };
                require_gradients(&[("x", &x), ("weights", &w)], forward, backward);
            }
        }
    }

    #[test]
    fn input_gradient_is_the_adjoint_on_a_large_octree() {
        let octree = large_octree();
        let (level, n) = (octree.finest(), octree.finest().n_nodes());
        for (c_in, c_out) in [(2, 3), (16, 24)] {
            let (conv, w) = conv(c_in, c_out);
            let forward = |x: &[f64]| {
                let mut y = vec![];
                conv.forward(&w, &level.conv, x, &mut y);
                y
            };
            let transposed = |dy: &[f64]| {
                let mut dx = vec![];
                conv.backward_input(&w, &level.conv, dy, &mut dx);
                dx
            };
            assert!(adjoint(c_in * n, c_out * n, forward, transposed) < 1e-14);
        }
    }

    #[test]
    fn a_batch_gives_the_bits_of_its_shapes_alone() {
        let (sizes, options) = ([900, 1, 2500], OctreeOptions::default());
        let batch = sheets(&sizes, &options);
        let level = batch.finest();
        for c in [4, 16] {
            let mut layout = Layout::default();
            let conv = OctreeConv::new(&mut layout, "conv", c, 24);
            let w = layout.init_params::<f32>(1);
            let x: Vec<f32> = probe(level.n_nodes() * c, 1).iter().map(|&x| x as f32).collect();
            let (mut together, mut alone) = (vec![], vec![]);
            conv.forward(&w, &level.conv, &x, &mut together);
            for (shape, &n) in sizes.iter().enumerate() {
                let (points, normals) = sheet(n, shape as u64);
                let single = Octree::build(&[Cloud::new(&points, &normals)], &options).unwrap();
                let rows = level.ranges[shape].clone();
                let x = &x[c * rows.start..c * rows.end];
                conv.forward(&w, &single.finest().conv, x, &mut alone);
                assert_eq!(alone, together[24 * rows.start..24 * rows.end]);
            }
        }
    }

    #[test]
    fn both_passes_are_identical_on_any_number_of_threads() {
        let octree = large_octree();
        let n = octree.finest().n_nodes();
        for (c_in, c_out) in [(2, 3), (64, 64)] {
            let (conv, w) = conv(c_in, c_out);
            let (x, dy) = (probe(c_in * n, 1), probe(c_out * n, 2));
            let run = |n_threads| {
                let passes = || {
                    let (mut y, mut dx, mut grads) = (vec![], vec![], vec![0.0; w.len()]);
                    conv.forward(&w, &octree.finest().conv, &x, &mut y);
                    conv.backward(&w, &octree.finest().conv, &x, &dy, Some(&mut dx), &mut grads);
                    (y, dx, grads)
                };
                with_threads(n_threads, passes).unwrap()
            };
            assert!(run(1) == run(5));
        }
    }
}
