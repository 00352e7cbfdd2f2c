//! Layers of neural networks, each with a forward and a backward pass.
//!
//! # The contract
//!
//! A layer is an immutable description: sizes, and the ranges of its numbers in two flat vectors that
//! the model owns, `params` (learned) and `buffers` (running statistics). Every layer is a [`layer::Layer`];
//! its passes take
//!
//! 1. the pass ([`pass::Inference`], [`pass::Training`] or [`pass::Backward`]): numbers and memory,
//! 2. the geometry: which rows meet, from the octree,
//! 3. the operand: what it reads, an [`operand::Operand`].
//!
//! Outputs and gradients are buffers of the pass's [`arena::Arena`]. What a training pass leaves for backward is
//! a value of its own type, which backward uses up. Input gradients are new matrices, parameter gradients
//! accumulate.
//!
//! # The map
//!
//! Imports point down this list only; a test holds that.
//!
//! | | |
//! |---|---|
//! | composite | [`blocks`], [`residual`], [`downsample`], [`linear_norm_act`] |
//! | linear operators | [`conv`], [`strided_conv`], [`deconv`], [`linear`], [`linear_operator`] |
//! | other layers | [`batch_norm`], [`group_norm`], [`relu`], [`dropout`], [`interp`], [`neighbor_mean`], [`pad`], [`pool`], [`upsample`] |
//! | how products are computed | `conv_plan` |
//! | what layers share | [`layer`], [`operand`], [`pass`], [`saved`], [`params`], [`column_norm`], `rows`, [`arena`], `scratch` |

pub mod arena;
pub mod attention;
pub mod batch_norm;
pub mod blocks;
pub mod column_norm;
pub mod conv;
mod conv_plan;
pub mod deconv;
pub mod downsample;
pub mod dropout;
pub mod group_norm;
pub mod interp;
pub mod layer;
pub mod linear;
pub mod linear_norm_act;
pub mod linear_operator;
pub mod neighbor_mean;
pub mod operand;
pub mod pad;
pub mod params;
pub mod pass;
pub(crate) mod pass_memory;
pub mod pool;
pub mod relu;
pub mod residual;
pub(crate) mod rows;
pub mod saved;
mod scratch;
pub mod strided_conv;
pub mod upsample;

pub(crate) use conv_plan::OperatorShape;

#[cfg(test)]
mod testing {
    //! Octrees and checks that tests of layers share.

    use super::arena::Arena;
    use super::layer::Layer;
    use super::operand::Operand;
    use super::params::Layout;
    use super::pass::{Backward, Inference, Training};
    use crate::conformance::gradcheck::{self, Case, GradcheckSettings};
    use crate::numeric::scalar::Scalar;
    use crate::octree::tests::sheets;
    use crate::octree::{Cloud, Octree, OctreeOptions};
    use glam::Vec3;

    /// Octrees with empty nodes, of one and of several shapes, of one point, of points in one cell.
    pub(super) fn octrees() -> Vec<Octree> {
        let options = OctreeOptions { depth: 4, full_depth: 2, ..OctreeOptions::default() };
        let lumps = [vec![Vec3::splat(0.3)], vec![Vec3::new(-0.7, 0.1, 0.9); 20]];
        let lump = |p: &Vec<Vec3>| Octree::build(&[Cloud::new(p, &[])], &options).unwrap();
        let mut octrees: Vec<Octree> = lumps.iter().map(lump).collect();
        octrees.push(sheets(&[120], &options));
        octrees.push(sheets(&[50, 1, 30], &options));
        octrees
    }

    /// An octree whose finest depths have several blocks, and several ranges of a weight gradient.
    pub(super) fn large_octree() -> Octree {
        sheets(&[15_000, 5000], &OctreeOptions { depth: 6, ..OctreeOptions::default() })
    }

    /// Inference of a layer without running statistics.
    pub(super) fn forward<T: Scalar, L: Layer<T>>(
        layer: &L,
        params: &[T],
        geometry: &L::Geometry,
        x: Operand<T>,
    ) -> Vec<T> {
        let pass = Inference { params, buffers: &[], arena: &Arena::default() };
        layer.forward(&pass, geometry, x).to_vec()
    }

    /// Gradients by the matrices of `x`, one after another, and by the parameters, of a layer without running
    /// statistics.
    pub(super) fn gradients<T: Scalar, L: Layer<T>>(
        layer: &L,
        params: &[T],
        geometry: &L::Geometry,
        x: Operand<T>,
        dy: &[T],
    ) -> (Vec<T>, Vec<T>) {
        let (arena, mut grads) = (&Arena::default(), vec![T::ZERO; params.len()]);
        let mut pass = Training { params, buffers: &mut [], dropout: None, arena };
        let (_, saved) = layer.forward_train(&mut pass, geometry, x);
        let mut pass = Backward::new(params, &mut grads, arena);
        let dx = layer.backward(&mut pass, geometry, x, saved, arena.copy_of(dy));
        (dx.into_parts().iter().flat_map(|part| part.to_vec()).collect(), grads)
    }

    /// Finite differences of a training pass, at most 120 elements of each matrix and tensor.
    pub(super) fn require_gradients<L: Layer<f64>>(
        layer: &L,
        (layout, params): (&Layout, &[f64]),
        geometry: &L::Geometry,
        x: Operand<f64>,
    ) {
        let settings = GradcheckSettings { max_elements: 120, ..GradcheckSettings::default() };
        let case = Case { layout, params, geometry, x, dropout: None };
        gradcheck::layer(layer, &case, &settings).unwrap().require(1e-7).unwrap();
    }

    /// Adjoint test of a linear layer of `c_in` columns and the gradient by its input.
    pub(super) fn require_adjoint<L: Layer<f64>>(
        layer: &L,
        params: &[f64],
        geometry: &L::Geometry,
        (n_in, c_in): (usize, usize),
        n_out: usize,
    ) {
        let zeros = vec![0.0; n_in];
        let apply = |x: &[f64]| forward(layer, params, geometry, Operand::new(x, c_in));
        let back =
            |dy: &[f64]| gradients(layer, params, geometry, Operand::new(&zeros, c_in), dy).0;
        let error = gradcheck::adjoint(n_in, n_out, apply, back).unwrap();
        assert!(error < 1e-13, "{error}");
    }

    /// Largest difference, over the largest magnitude.
    pub(super) fn difference(a: &[f64], b: &[f64]) -> f64 {
        assert_eq!(a.len(), b.len());
        let scale = b.iter().fold(1e-300, |m: f64, b| m.max(b.abs()));
        a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / scale
    }

    /// A linear operator of three groups of columns side by side, the second constant over each shape, gives what it
    /// gives of their columns in one matrix, and its gradients are right.
    pub(super) fn require_concatenation<L: Layer<f64>>(
        layer: &L,
        (layout, params): (&Layout, &[f64]),
        geometry: &L::Geometry,
        shapes: &[std::ops::Range<usize>],
        widths: [usize; 3],
    ) {
        let (n, arena) = (shapes.last().unwrap().end, Arena::default());
        let [a, b, c] = [(n, 1), (shapes.len(), 2), (n, 3)]
            .map(|(rows, i)| gradcheck::probe(rows * widths[i - 1], i as u64));
        let parts = [
            Operand::new(&a, widths[0]),
            Operand::PerShape { x: &b, c: widths[1], shapes },
            Operand::new(&c, widths[2]),
        ];
        let x = Operand::Concat(&parts);
        let matrix = x.to_matrix(&arena);
        let plain = Operand::new(&matrix, x.width());
        let y = forward(layer, params, geometry, x);
        assert!(difference(&y, &forward(layer, params, geometry, plain)) < 1e-13);
        let dy = gradcheck::probe(y.len(), 4);
        let (dx, grads) = gradients(layer, params, geometry, x, &dy);
        let (dplain, grads_plain) = gradients(layer, params, geometry, plain, &dy);
        let dplain = super::operand::OperandGradient::of_matrix(&arena, x, arena.copy_of(&dplain));
        assert!(difference(&dx, &dplain.into_parts().concat()) < 1e-12);
        assert!(difference(&grads, &grads_plain) < 1e-12);
        // Finite differences of wide layers take minutes; their parts were just compared with one matrix.
        if x.width() <= 16 {
            require_gradients(layer, (layout, params), geometry, x);
        }
    }
}
