//! The trait of linear operators: convolutions, strided and transposed ones, linear layers, and those of one's own.

use super::arena::Buffer;
use super::column_norm::Epilogue;
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::pass::{Backward, Context, Inference, Training};
use crate::numeric::scalar::Scalar;
use std::ops::Range;

/// A linear map between the rows of two matrices, along some map of rows to rows. Every one is a [`Layer`] that
/// saves nothing: backward needs its input alone.
///
/// One of one's own has [`LinearOperator::map`] and the gradients;
/// [`LinearNormAct`](super::linear_norm_act::LinearNormAct) normalizes and rectifies its output as that of any other.
pub trait LinearOperator {
    /// Which rows meet which; `()` where every row stays alone.
    type Geometry: ?Sized;

    /// Columns of the input.
    fn c_in(&self) -> usize;

    /// Columns of the output.
    fn c_out(&self) -> usize;

    /// Places of its tensors in the parameter vector.
    fn tensor_ranges(&self) -> Vec<Range<usize>>;

    /// The output, `[n_out, c_out]`, with nothing after it.
    ///
    /// # Panics
    /// If `x` has not the rows and columns that the geometry and the operator demand.
    fn map<T: Scalar>(
        &self,
        context: Context<T>,
        geometry: &Self::Geometry,
        x: Operand<T>,
    ) -> Buffer<T>;

    /// The output, and `epilogue` on each of its rows. An operator that overrides this runs [`Epilogue::apply`] on
    /// every block of rows while the block is in the cache; the bits are the same.
    ///
    /// # Panics
    /// As [`LinearOperator::map`].
    fn apply<T: Scalar>(
        &self,
        context: Context<T>,
        geometry: &Self::Geometry,
        x: Operand<T>,
        epilogue: Epilogue<T>,
    ) -> Buffer<T> {
        let mut y = self.map(context, geometry, x);
        epilogue.apply_to_all(&mut y);
        y
    }

    /// Adds the gradient of the weights to `pass.grads`.
    ///
    /// # Panics
    /// If `x` or `dy` has other rows or columns than in the forward pass.
    fn weight_gradient<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        geometry: &Self::Geometry,
        x: Operand<T>,
        dy: &[T],
    );

    /// Gradient by `x`, whose values are not read.
    ///
    /// # Panics
    /// As [`LinearOperator::weight_gradient`].
    fn input_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        geometry: &Self::Geometry,
        x: Operand<T>,
        dy: &[T],
    ) -> OperandGradient<T>;

    /// Both gradients.
    ///
    /// # Panics
    /// As [`LinearOperator::weight_gradient`].
    fn gradients<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        geometry: &Self::Geometry,
        x: Operand<T>,
        dy: &[T],
    ) -> OperandGradient<T> {
        self.weight_gradient(pass, geometry, x, dy);
        self.input_gradient(pass.context(), geometry, x, dy)
    }
}

impl<T: Scalar, M: LinearOperator> Layer<T> for M {
    type Geometry = M::Geometry;
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        self.tensor_ranges()
    }

    fn forward(&self, pass: &Inference<T>, geometry: &M::Geometry, x: Operand<T>) -> Buffer<T> {
        self.map(pass.context(), geometry, x)
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        geometry: &M::Geometry,
        x: Operand<T>,
    ) -> (Buffer<T>, ()) {
        (self.map(pass.context(), geometry, x), ())
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        geometry: &M::Geometry,
        x: Operand<T>,
        (): (),
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        self.gradients(pass, geometry, x, &dy)
    }
}

/// The reference's bound for uniform weights of a kernel with `k` offsets.
pub(super) fn xavier_bound(k: usize, c_in: usize, c_out: usize) -> f64 {
    (6.0 / (k * (c_in + c_out)) as f64).sqrt()
}

/// Demands an operand of `c` columns.
pub(super) fn check_width<T: Scalar>(x: &Operand<T>, c: usize) {
    assert_eq!(x.width(), c, "columns of the input and of the layer differ");
}
