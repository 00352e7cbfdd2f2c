//! Linear map of every row: `y = x Wᵀ + b`.
//!
//! A convolution with one offset that joins each row to itself. Columns that are the same in all rows of a shape
//! are multiplied once per shape; their gradients come from the sums of `dy` over each shape.

use super::arena::Buffer;
use super::column_norm::Epilogue;
use super::conv_plan::{ConvPlan, OuterProduct, Product, RowMap, Term, Weights, dense, shapes};
use super::linear_operator::{LinearOperator, check_width};
use super::operand::{Operand, OperandGradient, OperandPart};
use super::params::{Init, Layout};
use super::pass::{Backward, Context};
use super::rows;
use crate::numeric::scalar::Scalar;
use std::ops::Range;

/// `y[n, c_out] = x[n, c_in] · Wᵀ + b` with `W: [c_out, c_in]`.
///
/// ```
/// use deepmill::nn::{arena::Arena, layer::Layer, linear::Linear, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Inference};
///
/// let linear = Linear::new(&mut Layout::default(), "linear", 2, 3, true);
/// let params = [1.0, 0.0, 0.0, 1.0, 1.0, -1.0, 10.0, 20.0, 30.0]; // three rows of weights, three biases
/// let arena = Arena::default();
/// let y = linear.forward(&Inference::new(&params, &[], &arena), &(), Operand::new(&[5.0, 3.0], 2));
/// assert_eq!(y[..], [15.0, 23.0, 32.0]);
/// ```
#[derive(Debug, Clone)]
pub struct Linear {
    c_in: usize,
    c_out: usize,
    weight: Range<usize>,
    bias: Option<Range<usize>>,
}

impl Linear {
    /// Appends `{name}.weight` and, if wanted, `{name}.bias`; both start uniform in `±1/√c_in`.
    ///
    /// # Panics
    /// If a width is 0 or a name is taken.
    pub fn new(layout: &mut Layout, name: &str, c_in: usize, c_out: usize, bias: bool) -> Self {
        assert!(c_in > 0 && c_out > 0, "{name}: a linear layer of {c_in} to {c_out} columns");
        let init = Init::Uniform { bound: 1.0 / (c_in as f64).sqrt() };
        let weight = layout.param(format!("{name}.weight"), &[c_out, c_in], init);
        let bias = bias.then(|| layout.param(format!("{name}.bias"), &[c_out], init));
        Linear { c_in, c_out, weight, bias }
    }

    /// Appends `{name}.weight`, which starts at 0; there is no bias.
    ///
    /// # Panics
    /// As [`Linear::new`].
    pub fn zeros(layout: &mut Layout, name: &str, c_in: usize, c_out: usize) -> Self {
        assert!(c_in > 0 && c_out > 0, "{name}: a linear layer of {c_in} to {c_out} columns");
        let init = Init::Constant(0.0);
        let weight = layout.param(format!("{name}.weight"), &[c_out, c_in], init);
        Linear { c_in, c_out, weight, bias: None }
    }

    /// Columns of `x`.
    pub fn c_in(&self) -> usize {
        self.c_in
    }

    /// Columns of `y`.
    pub fn c_out(&self) -> usize {
        self.c_out
    }

    /// Adds the gradient by `x` to `dx`, to which another branch has sent its own already.
    ///
    /// # Panics
    /// If a part of `dx` is not shaped as that of `x`.
    pub fn add_input_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        x: Operand<T>,
        dy: &[T],
        dx: &mut OperandGradient<T>,
    ) {
        for ((part, columns), dx) in x.parts().into_iter().zip(dx.parts_mut()) {
            self.add_part_gradient(context, (part, columns), dy, dx);
        }
    }

    /// Adds the gradient by these columns of the input, a row of their own for each node, to `dx`.
    ///
    /// # Panics
    /// If `dx` has not one row for each of `dy`.
    pub(crate) fn add_node_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        columns: Range<usize>,
        dy: &[T],
        dx: &mut [T],
    ) {
        let n = dy.len() / self.c_out * columns.len();
        assert_eq!(dx.len(), n, "rows of both gradients differ");
        let (c_out, width) = (self.c_out, columns.len());
        let some = (width < self.c_in).then(|| self.columns(context, columns));
        let w = some.as_deref().unwrap_or(&context.params[self.weight.clone()]);
        dense::add_product(dy, w, c_out, width, dx);
    }

    /// The gradient by a single matrix of the input's width, in its memory: nothing else reads it any more.
    pub(crate) fn input_gradient_over<T: Scalar>(
        &self,
        context: Context<T>,
        mut x: Buffer<T>,
        dy: &[T],
    ) -> Buffer<T> {
        x.fill(T::ZERO);
        self.add_node_gradient(context, 0..self.c_in, dy, &mut x);
        x
    }

    fn add_part_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        (part, columns): (OperandPart<T>, Range<usize>),
        dy: &[T],
        dx: &mut [T],
    ) {
        match part {
            OperandPart::Nodes(_) => self.add_node_gradient(context, columns, dy, dx),
            OperandPart::Shapes(_, shapes) => {
                let sums = self.sums_of_shapes(context, shapes, dy);
                self.add_node_gradient(context, columns, &sums, dx);
            }
        }
    }

    /// These columns of the weight, `[c_out, columns.len()]`.
    fn columns<T: Scalar>(&self, context: Context<T>, columns: Range<usize>) -> Buffer<T> {
        let rows = context.params[self.weight.clone()].chunks_exact(self.c_in);
        let mut some = context.arena.get(self.c_out * columns.len());
        for (some, row) in some.chunks_exact_mut(columns.len()).zip(rows) {
            some.copy_from_slice(&row[columns.clone()]);
        }
        some
    }

    /// Sum of the rows of each shape, `[n_shapes, c_out]`.
    fn sums_of_shapes<T: Scalar>(
        &self,
        context: Context<T>,
        shapes: &[Range<usize>],
        dy: &[T],
    ) -> Buffer<T> {
        let c = self.c_out;
        let mut sums = context.arena.get(shapes.len() * c);
        for (sums, shape) in sums.chunks_exact_mut(c).zip(shapes) {
            let of_columns = rows::sums_of_columns(
                shape.clone(),
                c,
                #[inline(always)]
                |row| &dy[row * c..][..c],
            );
            sums.iter_mut().zip(of_columns).for_each(|(sum, of)| *sum = T::from_f64(of));
        }
        sums
    }

    fn add_bias_gradient<T: Scalar>(&self, pass: &mut Backward<T>, dy: &[T]) {
        let (Some(bias), c) = (&self.bias, self.c_out) else { return };
        let sums = rows::sums_of_columns(
            0..dy.len() / c,
            c,
            #[inline(always)]
            |row| &dy[row * c..][..c],
        );
        let grads = pass.grads(bias).iter_mut();
        grads.zip(sums).for_each(|(d, sum)| *d += T::from_f64(sum));
    }

    /// `dW += dyᵀ x` for some columns of `x` and `dW`.
    fn add_weight_gradient<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        columns: Range<usize>,
        (dy, x): (&[T], &[T]),
    ) {
        let (width, n) = (columns.len(), dy.len() / self.c_out);
        let product = OuterProduct::new((dy, self.c_out), (x, width));
        let (arena, grads) = (pass.arena, pass.grads(&self.weight));
        if width == self.c_in {
            return ConvPlan::add_weight_gradient(arena, RowMap::Same(n), &product, grads);
        }
        let mut dw = arena.zeroed(self.c_out * width);
        ConvPlan::add_weight_gradient(arena, RowMap::Same(n), &product, &mut dw);
        for (d, dw) in grads.chunks_exact_mut(self.c_in).zip(dw.chunks_exact(width)) {
            rows::add(&mut d[columns.clone()], dw);
        }
    }
}

impl LinearOperator for Linear {
    type Geometry = ();

    fn c_in(&self) -> usize {
        self.c_in
    }

    fn c_out(&self) -> usize {
        self.c_out
    }

    fn tensor_ranges(&self) -> Vec<Range<usize>> {
        [Some(self.weight.clone()), self.bias.clone()].into_iter().flatten().collect()
    }

    fn map<T: Scalar>(&self, context: Context<T>, (): &(), x: Operand<T>) -> Buffer<T> {
        self.apply(context, &(), x, Epilogue::Identity)
    }

    fn apply<T: Scalar>(
        &self,
        context: Context<T>,
        (): &(),
        x: Operand<T>,
        epilogue: Epilogue<T>,
    ) -> Buffer<T> {
        check_width(&x, self.c_in);
        let (c_in, c_out, arena) = (self.c_in, self.c_out, context.arena);
        let mut transposed = arena.get(c_in * c_out);
        dense::transpose(&context.params[self.weight.clone()], c_out, c_in, &mut transposed);
        let terms = x.parts().into_iter().map(|(part, columns)| match part {
            OperandPart::Nodes(x) => {
                Term::Nodes { x, weights: Weights::new(&transposed, c_in, c_out).rows(columns) }
            }
            OperandPart::Shapes(values, shapes) => {
                let w = &transposed[columns.start * c_out..columns.end * c_out];
                let size = (1, c_out);
                let products = shapes::products(arena, (values, columns.len()), |_| w, size);
                Term::Shapes { products, shapes }
            }
        });
        let terms: Vec<_> = terms.collect();
        let bias = self.bias.as_ref().map(|bias| &context.params[bias.clone()]);
        let product = Product { bias, epilogue, ..Product::new(&terms, c_out) };
        ConvPlan::of(RowMap::Same(x.n_rows()), &product).run(arena, &product)
    }

    /// `dW += dyᵀ x`, `db += Σ dy`.
    fn weight_gradient<T: Scalar>(&self, pass: &mut Backward<T>, (): &(), x: Operand<T>, dy: &[T]) {
        check_width(&x, self.c_in);
        assert_eq!(dy.len(), x.n_rows() * self.c_out, "rows of the gradient and of x differ");
        for (part, columns) in x.parts() {
            match part {
                OperandPart::Nodes(x) => self.add_weight_gradient(pass, columns, (dy, x)),
                OperandPart::Shapes(values, shapes) => {
                    let sums = self.sums_of_shapes(pass.context(), shapes, dy);
                    self.add_weight_gradient(pass, columns, (&sums, values));
                }
            }
        }
        self.add_bias_gradient(pass, dy);
    }

    /// `dx = dy W`.
    fn input_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        (): &(),
        x: Operand<T>,
        dy: &[T],
    ) -> OperandGradient<T> {
        let of_part = |(part, columns): (OperandPart<T>, Range<usize>)| {
            let len = match part {
                OperandPart::Nodes(x) | OperandPart::Shapes(x, _) => x.len(),
            };
            let mut dx = context.arena.zeroed(len);
            self.add_part_gradient(context, (part, columns), dy, &mut dx);
            dx
        };
        OperandGradient::new(x.parts().into_iter().map(of_part).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{
        forward, require_adjoint, require_concatenation, require_gradients,
    };
    use super::*;
    use crate::conformance::gradcheck::probe;

    fn linear(c_in: usize, c_out: usize, bias: bool) -> (Linear, Layout, Vec<f64>) {
        let mut layout = Layout::default();
        let linear = Linear::new(&mut layout, "l", c_in, c_out, bias);
        let params = layout.init_params(1);
        (linear, layout, params)
    }

    #[test]
    fn gradients_are_right_and_the_map_is_adjoint_to_its_backward() {
        for (n, c_in, c_out, bias) in [(1, 1, 1, true), (3, 4, 2, true), (1030, 2, 3, false)] {
            let (linear, layout, params) = linear(c_in, c_out, bias);
            let x = probe(n * c_in, 2);
            require_gradients(&linear, (&layout, &params), &(), Operand::new(&x, c_in));
            if !bias {
                require_adjoint(&linear, &params, &(), (n * c_in, c_in), n * c_out);
            }
        }
    }

    #[test]
    fn columns_side_by_side_give_what_they_give_in_one_matrix() {
        for bias in [false, true] {
            let (linear, layout, params) = linear(10, 4, bias);
            let shapes = [0..700, 700..700, 700..701, 701..2500];
            require_concatenation(&linear, (&layout, &params), &(), &shapes, [3, 5, 2]);
        }
    }

    #[test]
    fn rows_do_not_influence_each_other() {
        let (linear, _, params) = linear(3, 5, true);
        let x = probe(6, 2);
        let both = forward(&linear, &params, &(), Operand::new(&x, 3));
        assert_eq!(both[..5], forward(&linear, &params, &(), Operand::new(&x[..3], 3)));
    }

    #[test]
    #[should_panic(expected = "l: a linear layer of 0 to 2 columns")]
    fn a_layer_without_columns_is_refused() {
        linear(0, 2, true);
    }

    #[test]
    #[should_panic(expected = "ragged rows")]
    fn ragged_rows_are_refused() {
        let (linear, _, params) = linear(3, 5, true);
        forward(&linear, &params, &(), Operand::PerNode { x: &[0.0; 7], c: 3 });
    }
}
