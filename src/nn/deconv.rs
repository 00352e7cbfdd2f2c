//! Transposed 2×2×2 convolution with stride 2: from the nodes of one depth to those of the next finer.
//!
//! `y[8·children[n] + k] = W_k·x[n]`: the adjoint of [`super::strided_conv::OctreeStridedConv`] with the same
//! weights. Rows of empty nodes are not read and get zero gradients.

use super::arena::Buffer;
use super::column_norm::Epilogue;
use super::conv_plan::{ConvPlan, OuterProduct, Product, RowMap, Term, Weights};
use super::linear_operator::{LinearOperator, check_width, xavier_bound};
use super::operand::{Operand, OperandGradient};
use super::params::{Init, Layout};
use super::pass::{Backward, Context};
use crate::numeric::scalar::Scalar;
use crate::octree::OctreeLevel;
use std::ops::Range;

/// Transposed convolution with weights `{name}.weights: [8, c_out, c_in]`; its geometry is the coarse level.
/// Writes `[8·n_nonempty, c_out]`: all nodes one depth finer.
///
/// Each of the eight children of a node has a weight of its own; empty nodes have no children.
///
/// ```
/// # use deepmill::octree::{Cloud, Octree, OctreeOptions};
/// use deepmill::nn::{arena::Arena, deconv::OctreeDeconv, layer::Layer, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Inference};
///
/// # let options = OctreeOptions::default().with_depth(2).with_full_depth(1);
/// # let octree = Octree::build(&[Cloud::new(&[deepmill::glam::Vec3::splat(-0.5)], &[])], &options)?;
/// let coarse = &octree.levels[1]; // eight nodes; one point, so that only node 0 has children
/// let up = OctreeDeconv::new(&mut Layout::default(), "up", 1, 1);
/// let weights = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]; // W_k = k
/// let (arena, mut x) = (Arena::default(), [f64::NAN; 8]);
/// x[0] = 3.0; // the rows of empty nodes are not read
/// let y = up.forward(&Inference::new(&weights, &[], &arena), coarse, Operand::new(&x, 1));
/// assert_eq!(y[..], [0.0, 3.0, 6.0, 9.0, 12.0, 15.0, 18.0, 21.0]);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct OctreeDeconv {
    c_in: usize,
    c_out: usize,
    weights: Range<usize>,
}

impl OctreeDeconv {
    /// Appends the weights to `layout`, uniform in ±√(6 / (8·c_in + 8·c_out)) as in the reference.
    ///
    /// # Panics
    /// If a width is 0 or the name is taken.
    pub fn new(layout: &mut Layout, name: &str, c_in: usize, c_out: usize) -> Self {
        let bound = xavier_bound(8, c_in, c_out);
        let shape = [8, c_out, c_in];
        let weights = layout.param(format!("{name}.weights"), &shape, Init::Uniform { bound });
        OctreeDeconv { c_in, c_out, weights }
    }

    /// Number of input channels.
    pub fn c_in(&self) -> usize {
        self.c_in
    }

    /// Number of output channels.
    pub fn c_out(&self) -> usize {
        self.c_out
    }

    /// The weights as one matrix: the children of a node are one row.
    fn matrix<'a, T: Scalar>(&self, params: &'a [T]) -> Weights<'a, T> {
        Weights::new(&params[self.weights.clone()], 8 * self.c_out, self.c_in)
    }
}

impl LinearOperator for OctreeDeconv {
    type Geometry = OctreeLevel;

    fn c_in(&self) -> usize {
        self.c_in
    }

    fn c_out(&self) -> usize {
        self.c_out
    }

    fn tensor_ranges(&self) -> Vec<Range<usize>> {
        vec![self.weights.clone()]
    }

    fn map<T: Scalar>(
        &self,
        context: Context<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
    ) -> Buffer<T> {
        self.apply(context, coarse, x, Epilogue::Identity)
    }

    fn apply<T: Scalar>(
        &self,
        context: Context<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
        epilogue: Epilogue<T>,
    ) -> Buffer<T> {
        check_width(&x, self.c_in);
        let x = x.to_matrix(context.arena);
        let terms = [Term::Nodes { x: &x, weights: self.matrix(context.params).transposed() }];
        let product =
            Product { epilogue, rows_per_output: 8, ..Product::new(&terms, 8 * self.c_out) };
        ConvPlan::of(RowMap::Kernel(&coarse.depad), &product).run(context.arena, &product)
    }

    fn weight_gradient<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
        dy: &[T],
    ) {
        check_width(&x, self.c_in);
        let x = x.to_matrix(pass.arena);
        let product =
            OuterProduct { group: 8, ..OuterProduct::new((dy, self.c_out), (&x, self.c_in)) };
        let (arena, grads) = (pass.arena, pass.grads(&self.weights));
        ConvPlan::add_weight_gradient(arena, RowMap::Kernel(&coarse.pad), &product, grads);
    }

    fn input_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
        dy: &[T],
    ) -> OperandGradient<T> {
        let weights = self.matrix(context.params);
        let dx = ConvPlan::product(context.arena, RowMap::Kernel(&coarse.pad), dy, weights);
        OperandGradient::of_matrix(context.arena, x, dx)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{
        forward, large_octree, octrees, require_adjoint, require_concatenation, require_gradients,
    };
    use super::*;
    use crate::conformance::gradcheck::probe;

    fn up(c_in: usize, c_out: usize) -> (OctreeDeconv, Layout, Vec<f64>) {
        let mut layout = Layout::default();
        let layer = OctreeDeconv::new(&mut layout, "up", c_in, c_out);
        let params = layout.init_params(1);
        (layer, layout, params)
    }

    #[test]
    fn output_is_as_defined_and_empty_parents_are_not_read() {
        let (layer, _, w) = up(3, 2);
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let x = probe(coarse.n_nodes() * 3, 2);
                let y = forward(&layer, &w, coarse, Operand::new(&x, 3));
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
        let (layer, layout, w) = up(3, 2);
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let x = probe(coarse.n_nodes() * 3, 3);
                require_gradients(&layer, (&layout, &w), coarse, Operand::new(&x, 3));
            }
        }
    }

    #[test]
    fn columns_side_by_side_give_what_they_give_in_one_matrix() {
        let (layer, layout, w) = up(6, 2);
        for octree in octrees() {
            let coarse = &octree.levels[octree.depth() - 1];
            require_concatenation(&layer, (&layout, &w), coarse, &coarse.ranges, [3, 2, 1]);
        }
    }

    #[test]
    fn input_gradient_is_the_adjoint_on_a_large_octree() {
        let (octree, (layer, _, w)) = (large_octree(), up(2, 3));
        let coarse = &octree.levels[octree.depth() - 1];
        let (n_fine, n_coarse) = (8 * coarse.n_nonempty(), coarse.n_nodes());
        require_adjoint(&layer, &w, coarse, (2 * n_coarse, 2), 3 * n_fine);
    }
}
