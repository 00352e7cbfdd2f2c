//! 2×2×2 convolution with stride 2: from the nodes of one depth to those of the next coarser.
//!
//! `y[n] = Σ_k x[8·children[n] + k]·W_k`. The children of a node are eight consecutive rows, so this
//! is one product of `[1, 8·c_in]` by `[8·c_in, c_out]` per non-empty node.

use super::arena::Buffer;
use super::column_norm::Epilogue;
use super::conv_plan::{ConvPlan, OuterProduct, Product, RowMap, Term, Weights, dense};
use super::linear_operator::{LinearOperator, check_width, xavier_bound};
use super::operand::{Operand, OperandGradient};
use super::params::{Init, Layout};
use super::pass::{Backward, Context};
use crate::numeric::scalar::Scalar;
use crate::octree::OctreeLevel;
use std::ops::Range;

/// Which nodes of the coarse depth have a row in the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum OutputRows {
    /// All; empty nodes get zero rows.
    AllNodes,
    /// Those that hold points.
    NonEmpty,
}

/// Strided convolution with weights `{name}.weights: [8, c_in, c_out]`; its geometry is the coarse level. Reads
/// `[8·n_nonempty, c_in]`: all nodes one depth finer.
///
/// With equal weights that sum to 1 a node gets the mean of its children.
///
/// ```
/// # use deepmill::octree::{Cloud, Octree, OctreeOptions};
/// use deepmill::nn::strided_conv::{OctreeStridedConv, OutputRows};
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, params::Layout, pass::Inference};
///
/// # let options = OctreeOptions::default().with_depth(2).with_full_depth(1);
/// # let octree = Octree::build(&[Cloud::new(&[deepmill::glam::Vec3::splat(-0.5)], &[])], &options)?;
/// let coarse = &octree.levels[1]; // eight nodes; one point, so that only node 0 has children
/// let (arena, x) = (Arena::default(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
/// let pass = Inference::new(&[0.125; 8], &[], &arena);
/// let output = |rows| {
///     let conv = OctreeStridedConv::new(&mut Layout::default(), "down", 1, 1, rows);
///     conv.forward(&pass, coarse, Operand::new(&x, 1)).to_vec()
/// };
/// assert_eq!(output(OutputRows::NonEmpty), [4.5]);
/// assert_eq!(output(OutputRows::AllNodes), [4.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct OctreeStridedConv {
    c_in: usize,
    c_out: usize,
    rows: OutputRows,
    weights: Range<usize>,
}

impl OctreeStridedConv {
    /// Appends the weights to `layout`, uniform in ±√(6 / (8·c_in + 8·c_out)) as in the reference.
    ///
    /// # Panics
    /// If a width is 0 or the name is taken.
    pub fn new(
        layout: &mut Layout,
        name: &str,
        c_in: usize,
        c_out: usize,
        rows: OutputRows,
    ) -> Self {
        let bound = xavier_bound(8, c_in, c_out);
        let shape = [8, c_in, c_out];
        let weights = layout.param(format!("{name}.weights"), &shape, Init::Uniform { bound });
        OctreeStridedConv { c_in, c_out, rows, weights }
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
        Weights::new(&params[self.weights.clone()], 8 * self.c_in, self.c_out)
    }

    fn row_map<'a>(&self, coarse: &'a OctreeLevel) -> RowMap<'a> {
        match self.rows {
            OutputRows::AllNodes => RowMap::Kernel(&coarse.pad),
            OutputRows::NonEmpty => RowMap::Same(coarse.n_nonempty()),
        }
    }
}

impl LinearOperator for OctreeStridedConv {
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
        let terms = [Term::Nodes { x: &x, weights: self.matrix(context.params) }];
        let product = Product { epilogue, ..Product::new(&terms, self.c_out) };
        ConvPlan::of(self.row_map(coarse), &product).run(context.arena, &product)
    }

    fn weight_gradient<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
        dy: &[T],
    ) {
        check_width(&x, self.c_in);
        let (x, g) = (x.to_matrix(pass.arena), (dy, self.c_out));
        let product = match self.rows {
            OutputRows::AllNodes => {
                OuterProduct { group: 8, ..OuterProduct::new((&x, self.c_in), g) }
            }
            OutputRows::NonEmpty => OuterProduct::new((&x, 8 * self.c_in), g),
        };
        let (arena, grads) = (pass.arena, pass.grads(&self.weights));
        ConvPlan::add_weight_gradient(arena, self.row_map(coarse), &product, grads);
    }

    fn input_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
        dy: &[T],
    ) -> OperandGradient<T> {
        let Context { params, arena } = context;
        let dx = match self.rows {
            OutputRows::AllNodes => {
                let weights = self.matrix(params).transposed();
                ConvPlan::product(arena, RowMap::Kernel(&coarse.depad), dy, weights)
            }
            OutputRows::NonEmpty => {
                let (rows, columns) = (8 * self.c_in, self.c_out);
                let mut transposed = arena.get(rows * columns);
                dense::transpose(&params[self.weights.clone()], rows, columns, &mut transposed);
                let weights = Weights::new(&transposed, columns, rows);
                ConvPlan::product(arena, self.row_map(coarse), dy, weights)
            }
        };
        OperandGradient::of_matrix(context.arena, x, dx)
    }
}

#[cfg(test)]
mod tests {
    use super::super::pad::Depad;
    use super::super::testing::{
        forward, large_octree, octrees, require_adjoint, require_concatenation, require_gradients,
    };
    use super::*;
    use crate::conformance::gradcheck::probe;

    fn down(c_in: usize, c_out: usize, rows: OutputRows) -> (OctreeStridedConv, Layout, Vec<f64>) {
        let mut layout = Layout::default();
        let layer = OctreeStridedConv::new(&mut layout, "down", c_in, c_out, rows);
        let params = layout.init_params(1);
        (layer, layout, params)
    }

    #[test]
    fn output_is_as_defined_and_empty_parents_get_zeros_or_no_row() {
        let (layer, _, w) = down(3, 2, OutputRows::AllNodes);
        let (packed, ..) = down(3, 2, OutputRows::NonEmpty);
        for octree in octrees() {
            for coarse in &octree.levels[..octree.depth()] {
                let x = probe(8 * coarse.n_nonempty() * 3, 2);
                let y = forward(&layer, &w, coarse, Operand::new(&x, 3));
                for (n, y) in y.chunks_exact(2).enumerate() {
                    let mut expected = [0.0; 2];
                    if let Ok(group) = usize::try_from(coarse.children[n]) {
                        for (i, x) in x[24 * group..24 * (group + 1)].iter().enumerate() {
                            expected = [0, 1].map(|j| x.mul_add(w[2 * i + j], expected[j]));
                        }
                    }
                    assert_eq!(y, expected);
                }
                let packed = forward(&packed, &w, coarse, Operand::new(&x, 3));
                assert_eq!(packed, forward(&Depad, &[], coarse, Operand::new(&y, 2)));
            }
        }
    }

    #[test]
    fn gradients_are_right_on_every_kind_of_octree() {
        for rows in [OutputRows::AllNodes, OutputRows::NonEmpty] {
            let (layer, layout, w) = down(3, 2, rows);
            for octree in octrees() {
                for coarse in &octree.levels[..octree.depth()] {
                    let x = probe(8 * coarse.n_nonempty() * 3, 3);
                    require_gradients(&layer, (&layout, &w), coarse, Operand::new(&x, 3));
                }
            }
        }
    }

    #[test]
    fn columns_side_by_side_give_what_they_give_in_one_matrix() {
        for rows in [OutputRows::AllNodes, OutputRows::NonEmpty] {
            let (layer, layout, w) = down(6, 2, rows);
            for octree in octrees() {
                let [.., coarse, fine] = &octree.levels[..] else { unreachable!("two depths") };
                require_concatenation(&layer, (&layout, &w), coarse, &fine.ranges, [3, 2, 1]);
            }
        }
    }

    #[test]
    fn input_gradient_is_the_adjoint_and_that_is_the_transposed_convolution() {
        use super::super::deconv::OctreeDeconv;
        use super::super::testing::gradients;
        let (octree, (layer, _, w)) = (large_octree(), down(2, 3, OutputRows::AllNodes));
        let coarse = &octree.levels[octree.depth() - 1];
        let (n_fine, n_coarse) = (8 * coarse.n_nonempty(), coarse.n_nodes());
        require_adjoint(&layer, &w, coarse, (2 * n_fine, 2), 3 * n_coarse);
        let up = OctreeDeconv::new(&mut Layout::default(), "", 3, 2);
        let (x, dy) = (vec![0.0; 2 * n_fine], probe(3 * n_coarse, 1));
        let (dx, _) = gradients(&layer, &w, coarse, Operand::new(&x, 2), &dy);
        assert_eq!(dx, forward(&up, &w, coarse, Operand::new(&dy, 3)));
    }
}
