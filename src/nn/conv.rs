//! 3×3×3 convolution over the nodes of one depth of an octree.
//!
//! `y[n] = Σ_k x[neigh[n, k]]·W_k` over the neighbors that exist, without bias. Since `m` is neighbor
//! `k` of `n` exactly if `n` is neighbor `26 − k` of `m`, the input gradient is the same sum with
//! `W_{26−k}ᵀ` in place of `W_k`.

use super::arena::Buffer;
use super::column_norm::Epilogue;
use super::conv_plan::{ConvPlan, OuterProduct, Product, RowMap, Term, Weights, shapes};
use super::linear_operator::{LinearOperator, check_width, xavier_bound};
use super::operand::{Operand, OperandGradient, OperandPart};
use super::params::{Init, Layout};
use super::pass::{Backward, Context};
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::octree::KernelMap;
use crate::simd::Isa;
use crate::simd::gemm::matmul_tn_rows;
use std::ops::Range;

/// Convolution with weights `{name}.weights: [27, c_in, c_out]`; its geometry is
/// [`crate::octree::OctreeLevel::conv`].
///
/// Each node gets the kernels of the neighbors that it has; those beyond the cube have no part in the sum.
///
/// ```
/// # use deepmill::octree::{Cloud, Octree, OctreeOptions};
/// use deepmill::nn::{arena::Arena, conv::OctreeConv, layer::Layer, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Inference};
///
/// # let options = OctreeOptions::default().with_depth(1).with_full_depth(1);
/// # let octree = Octree::build(&[Cloud::new(&[deepmill::glam::Vec3::ZERO], &[])], &options)?;
/// let conv = OctreeConv::new(&mut Layout::default(), "conv", 1, 1);
/// let weights: Vec<f64> = (0..27).map(f64::from).collect(); // W_k = k
/// let (arena, level) = (Arena::default(), octree.finest()); // depth 1: eight nodes, in the corners of the cube
/// let pass = Inference::new(&weights, &[], &arena);
/// let y = conv.forward(&pass, &level.conv, Operand::new(&[1.0; 8], 1));
/// // Node 0 has itself (13) and its neighbors in the directions of +x, +y, +z.
/// assert_eq!(y[0], f64::from(13 + 14 + 16 + 17 + 22 + 23 + 25 + 26));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct OctreeConv {
    c_in: usize,
    c_out: usize,
    weights: Range<usize>,
}

/// Some columns of the input that are the same in all rows of a shape, and the gradient of the output.
struct ShapeColumns<'a, T> {
    values: &'a [T],
    shapes: &'a [Range<usize>],
    columns: Range<usize>,
    dy: &'a [T],
}

impl OctreeConv {
    /// Appends the weights to `layout`, uniform in ±√(6 / (27·c_in + 27·c_out)) as in the reference.
    ///
    /// # Panics
    /// If a width is 0 or the name is taken.
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

    /// The weights as matrices, one for each offset.
    fn matrices<'a, T: Scalar>(&self, params: &'a [T]) -> Weights<'a, T> {
        Weights::new(&params[self.weights.clone()], self.c_in, self.c_out)
    }

    /// These rows of the matrix of offset `k`.
    fn matrix<'a, T>(&self, params: &'a [T], k: usize, columns: &Range<usize>) -> &'a [T] {
        let weights = &params[self.weights.clone()][k * self.c_in * self.c_out..];
        &weights[columns.start * self.c_out..columns.end * self.c_out]
    }

    fn node_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        map: &KernelMap,
        columns: Range<usize>,
        dy: &[T],
    ) -> Buffer<T> {
        let weights = self.matrices(context.params).rows(columns).transposed().reversed();
        ConvPlan::product(context.arena, RowMap::Kernel(map), dy, weights)
    }

    fn add_weight_gradient<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        map: &KernelMap,
        (a, columns): (&[T], Range<usize>),
        dy: &[T],
    ) {
        let product = OuterProduct { a, columns, c_a: self.c_in, g: dy, c_g: self.c_out, group: 1 };
        let (arena, grads) = (pass.arena, pass.grads(&self.weights));
        ConvPlan::add_weight_gradient(arena, RowMap::Kernel(map), &product, grads);
    }

    /// Gradients of both kinds from the sums of `dy` over the nodes of each shape that have a neighbor.
    fn shape_gradients<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        map: &KernelMap,
        of: ShapeColumns<T>,
    ) -> Buffer<T> {
        let sums = shapes::sums(pass.arena, map, of.shapes, (of.dy, self.c_out));
        self.add_shape_weight_gradient(pass, &of, &sums);
        self.shape_input_gradient(pass.context(), &of, &sums)
    }

    fn shape_input_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        of: &ShapeColumns<T>,
        sums: &[T],
    ) -> Buffer<T> {
        let transposed = self.matrices(context.params).rows(of.columns.clone()).transposed();
        shapes::product_of_rows(context.arena, sums, of.shapes.len(), &transposed)
    }

    fn add_shape_weight_gradient<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        of: &ShapeColumns<T>,
        sums: &[T],
    ) {
        let (c_out, width) = (self.c_out, of.columns.len());
        let shapes: Vec<u32> = (0..of.shapes.len() as u32).collect();
        let len = shapes.len() * c_out;
        let grads = pass.grads(&self.weights);
        par::for_each_block(grads, self.c_in * c_out, |k, d| {
            let d = &mut d[of.columns.start * c_out..of.columns.end * c_out];
            let sums = &sums[k * len..][..len];
            matmul_tn_rows(Isa::active(), (of.values, &shapes), width, (sums, &shapes), c_out, d);
        });
    }
}

impl LinearOperator for OctreeConv {
    type Geometry = KernelMap;

    fn c_in(&self) -> usize {
        self.c_in
    }

    fn c_out(&self) -> usize {
        self.c_out
    }

    fn tensor_ranges(&self) -> Vec<Range<usize>> {
        vec![self.weights.clone()]
    }

    fn map<T: Scalar>(&self, context: Context<T>, map: &KernelMap, x: Operand<T>) -> Buffer<T> {
        self.apply(context, map, x, Epilogue::Identity)
    }

    fn apply<T: Scalar>(
        &self,
        context: Context<T>,
        map: &KernelMap,
        x: Operand<T>,
        epilogue: Epilogue<T>,
    ) -> Buffer<T> {
        check_width(&x, self.c_in);
        let Context { params, arena } = context;
        let terms = x.parts().into_iter().map(|(part, columns)| match part {
            OperandPart::Nodes(x) => {
                Term::Nodes { x, weights: self.matrices(params).rows(columns) }
            }
            OperandPart::Shapes(values, shapes) => {
                let size = (map.n_offsets(), self.c_out);
                let matrix = |k| self.matrix(params, k, &columns);
                let products = shapes::products(arena, (values, columns.len()), matrix, size);
                Term::Shapes { products, shapes }
            }
        });
        let terms: Vec<_> = terms.collect();
        let product = Product { epilogue, ..Product::new(&terms, self.c_out) };
        ConvPlan::of(RowMap::Kernel(map), &product).run(arena, &product)
    }

    fn weight_gradient<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        map: &KernelMap,
        x: Operand<T>,
        dy: &[T],
    ) {
        check_width(&x, self.c_in);
        for (part, columns) in x.parts() {
            match part {
                OperandPart::Nodes(x) => self.add_weight_gradient(pass, map, (x, columns), dy),
                OperandPart::Shapes(values, shapes) => {
                    let sums = shapes::sums(pass.arena, map, shapes, (dy, self.c_out));
                    let of = ShapeColumns { values, shapes, columns, dy };
                    self.add_shape_weight_gradient(pass, &of, &sums);
                }
            }
        }
    }

    fn input_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        map: &KernelMap,
        x: Operand<T>,
        dy: &[T],
    ) -> OperandGradient<T> {
        let of_part = |(part, columns): (OperandPart<T>, Range<usize>)| match part {
            OperandPart::Nodes(_) => self.node_gradient(context, map, columns, dy),
            OperandPart::Shapes(values, shapes) => {
                let sums = shapes::sums(context.arena, map, shapes, (dy, self.c_out));
                let of = ShapeColumns { values, shapes, columns, dy };
                self.shape_input_gradient(context, &of, &sums)
            }
        };
        OperandGradient::new(x.parts().into_iter().map(of_part).collect())
    }

    /// Sums of a shape's gradients serve both.
    fn gradients<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        map: &KernelMap,
        x: Operand<T>,
        dy: &[T],
    ) -> OperandGradient<T> {
        check_width(&x, self.c_in);
        let of_part = |(part, columns): (OperandPart<T>, Range<usize>)| match part {
            OperandPart::Nodes(x) => {
                self.add_weight_gradient(pass, map, (x, columns.clone()), dy);
                self.node_gradient(pass.context(), map, columns, dy)
            }
            OperandPart::Shapes(values, shapes) => {
                self.shape_gradients(pass, map, ShapeColumns { values, shapes, columns, dy })
            }
        };
        OperandGradient::new(x.parts().into_iter().map(of_part).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::arena::Arena;
    use super::super::testing::{
        difference, forward, gradients, large_octree, octrees, require_adjoint,
        require_concatenation, require_gradients,
    };
    use super::*;
    use crate::conformance::gradcheck::probe;
    use crate::exec::par::with_threads;
    use crate::octree::tests::{sheet, sheets};
    use crate::octree::{Cloud, Octree, OctreeLevel, OctreeOptions};

    fn conv(c_in: usize, c_out: usize) -> (OctreeConv, Layout, Vec<f64>) {
        let mut layout = Layout::default();
        let conv = OctreeConv::new(&mut layout, "conv", c_in, c_out);
        let params = layout.init_params(1);
        (conv, layout, params)
    }

    /// The definition, product by product in the promised order.
    fn plain<T: Scalar>(
        level: &OctreeLevel,
        w: &[T],
        c_in: usize,
        c_out: usize,
        x: &[T],
    ) -> Vec<T> {
        let mut y = vec![T::ZERO; level.n_nodes() * c_out];
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
    fn output_equals_the_plain_sum_over_neighbors() {
        let (conv, _, w) = conv(3, 5);
        let narrow = |x: &[f64]| x.iter().map(|&x| x as f32).collect::<Vec<_>>();
        let w_f32 = narrow(&w);
        for octree in octrees() {
            for level in &octree.levels {
                let x = probe(level.n_nodes() * 3, 2);
                let y = forward(&conv, &w, &level.conv, Operand::new(&x, 3));
                assert!(difference(&y, &plain(level, &w, 3, 5, &x)) < 1e-14);
                let x = narrow(&x);
                let y = forward(&conv, &w_f32, &level.conv, Operand::new(&x, 3));
                assert_eq!(y, plain(level, &w_f32, 3, 5, &x));
            }
        }
    }

    /// Levels on which wide convolutions take another way.
    fn levels_of_siblings(octree: &Octree) -> impl Iterator<Item = &OctreeLevel> {
        octree.levels.iter().filter(|level| !level.conv.siblings().is_empty())
    }

    #[test]
    fn wide_output_equals_the_plain_sum_up_to_rounding() {
        for (c_in, c_out) in [(16, 24), (40, 16)] {
            let (conv, _, w) = conv(c_in, c_out);
            for octree in octrees().iter().chain([&large_octree()]) {
                let levels: Vec<_> = levels_of_siblings(octree).collect();
                assert!(!levels.is_empty());
                for level in levels {
                    let x = probe(level.n_nodes() * c_in, 2);
                    let y = forward(&conv, &w, &level.conv, Operand::new(&x, c_in));
                    let plain = plain(level, &w, c_in, c_out, &x);
                    assert!(y.iter().zip(&plain).all(|(y, plain)| (y - plain).abs() < 1e-13));
                    assert!(y.iter().zip(&plain).any(|(y, plain)| y != plain), "another way");
                }
            }
        }
    }

    #[test]
    fn wide_gradients_are_right_on_every_kind_of_octree() {
        let (conv, layout, w) = conv(72, 64);
        let octrees = octrees();
        let levels: Vec<_> = octrees.iter().flat_map(levels_of_siblings).collect();
        par::map(levels.len(), |i| {
            let x = probe(levels[i].n_nodes() * 72, 3);
            require_gradients(&conv, (&layout, &w), &levels[i].conv, Operand::new(&x, 72));
        });
    }

    #[test]
    fn wide_weight_gradient_equals_the_plain_sum_and_is_added() {
        let (c, octree) = (64, large_octree());
        let ((conv, _, w), level) = (conv(c, c), octree.finest());
        let (x, dy) = (probe(level.n_nodes() * c, 4), probe(level.n_nodes() * c, 5));
        let mut grads = vec![1.0; w.len()];
        let arena = &Arena::default();
        let mut pass = Backward::new(&w, &mut grads, arena);
        conv.weight_gradient(&mut pass, &level.conv, Operand::new(&x, c), &dy);
        for (k, p, j) in [(0, 3, 5), (13, 0, 63), (14, 63, 0), (26, 31, 32)] {
            let rows = level.neigh.iter().enumerate().filter(|(_, neigh)| neigh[k] >= 0);
            let plain: f64 =
                rows.map(|(n, neigh)| x[neigh[k] as usize * c + p] * dy[n * c + j]).sum();
            assert!((grads[(k * c + p) * c + j] - 1.0 - plain).abs() < 1e-11);
        }
    }

    #[test]
    fn gradients_are_right_on_every_kind_of_octree() {
        let (conv, layout, w) = conv(3, 2);
        for octree in octrees() {
            for level in &octree.levels[1..] {
                let x = probe(level.n_nodes() * 3, 3);
                require_gradients(&conv, (&layout, &w), &level.conv, Operand::new(&x, 3));
            }
        }
    }

    #[test]
    fn columns_side_by_side_give_what_they_give_in_one_matrix() {
        for (widths, c_out) in [([3, 5, 2], 4), ([64, 8, 72], 64)] {
            let (conv, layout, w) = conv(widths.iter().sum(), c_out);
            for octree in octrees() {
                for level in &octree.levels[3..] {
                    let (of, shapes) = ((&layout, &w[..]), &level.ranges);
                    require_concatenation(&conv, of, &level.conv, shapes, widths);
                }
            }
        }
    }

    #[test]
    fn both_gradients_at_once_have_the_bits_of_each_alone() {
        let (conv, _, w) = conv(5, 3);
        let octree = &octrees()[3];
        let level = octree.finest();
        let (a, b) = (probe(level.n_nodes() * 3, 1), probe(level.ranges.len() * 2, 2));
        let shapes = &level.ranges;
        let parts = [Operand::new(&a, 3), Operand::PerShape { x: &b, c: 2, shapes }];
        let (x, dy) = (Operand::Concat(&parts), probe(level.n_nodes() * 3, 3));
        let (arena, mut grads) = (&Arena::default(), vec![0.0; w.len()]);
        let mut pass = Backward::new(&w, &mut grads, arena);
        conv.weight_gradient(&mut pass, &level.conv, x, &dy);
        let dx = conv.input_gradient(pass.context(), &level.conv, x, &dy).into_parts().concat();
        assert_eq!((dx, grads), gradients(&conv, &w, &level.conv, x, &dy));
    }

    #[test]
    fn input_gradient_is_the_adjoint_on_a_large_octree() {
        let octree = large_octree();
        let (level, n) = (octree.finest(), octree.finest().n_nodes());
        for (c_in, c_out) in [(2, 3), (16, 24)] {
            let (conv, _, w) = conv(c_in, c_out);
            require_adjoint(&conv, &w, &level.conv, (c_in * n, c_in), c_out * n);
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
            let together = forward(&conv, &w, &level.conv, Operand::new(&x, c));
            for (shape, &n) in sizes.iter().enumerate() {
                let (points, normals) = sheet(n, shape as u64);
                let single = Octree::build(&[Cloud::new(&points, &normals)], &options).unwrap();
                let rows = level.ranges[shape].clone();
                let x = Operand::new(&x[c * rows.start..c * rows.end], c);
                let alone = forward(&conv, &w, &single.finest().conv, x);
                assert_eq!(alone, together[24 * rows.start..24 * rows.end]);
            }
        }
    }

    #[test]
    fn both_passes_are_identical_on_any_number_of_threads() {
        let octree = large_octree();
        let (map, n) = (&octree.finest().conv, octree.finest().n_nodes());
        for (c_in, c_out) in [(2, 3), (64, 64)] {
            let (conv, _, w) = conv(c_in, c_out);
            let (x, dy) = (probe(c_in * n, 1), probe(c_out * n, 2));
            let x = Operand::new(&x, c_in);
            let passes = || (forward(&conv, &w, map, x), gradients(&conv, &w, map, x, &dy));
            let run = |n_threads| with_threads(n_threads, passes).unwrap();
            assert!(run(1) == run(5));
        }
    }

    #[test]
    #[should_panic(expected = "columns of the input and of the layer differ")]
    fn an_operand_of_another_width_is_refused() {
        let (conv, _, w) = conv(3, 2);
        let octree = &octrees()[0];
        let x = vec![0.0; 4 * octree.finest().n_nodes()];
        forward(&conv, &w, &octree.finest().conv, Operand::new(&x, 4));
    }
}
