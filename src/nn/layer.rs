//! The trait of all layers: forward, forward for training, backward, and the ranges of their parameters.
//!
//! `docs/adding-a-layer.md` walks through a new one, with its gradient check and its comparison.

use super::arena::Buffer;
use super::operand::{Operand, OperandGradient};
use super::params::{Entry, Layout};
use super::pass::{Backward, Inference, Training};
use crate::numeric::scalar::Scalar;
use std::ops::Range;

/// A layer: an immutable description whose numbers lie in the model's flat vectors.
///
/// `geometry` says which rows meet: a kernel map, a level of the octree, ranges of rows; `()` where each row
/// stays alone. Matrices are row-major. One [`Layer::forward_train`] serves one [`Layer::backward`], which
/// uses its `Saved` up.
pub trait Layer<T: Scalar> {
    /// Which rows meet.
    type Geometry: ?Sized;
    /// What backward needs besides the input.
    type Saved;

    /// Places of the layer's tensors in the parameter vector.
    fn param_ranges(&self) -> Vec<Range<usize>>;

    /// Inference: `[n_out, c_out]`.
    ///
    /// # Panics
    /// If `x` has not the rows and columns that the geometry and the layer demand.
    fn forward(&self, pass: &Inference<T>, geometry: &Self::Geometry, x: Operand<T>) -> Buffer<T>;

    /// The forward pass of a training step, and what backward needs of it.
    ///
    /// # Panics
    /// As [`Layer::forward`].
    fn forward_train(
        &self,
        pass: &mut Training<T>,
        geometry: &Self::Geometry,
        x: Operand<T>,
    ) -> (Buffer<T>, Self::Saved);

    /// From the gradient `dy` of the output to that of the input; adds to `pass.grads`. `geometry` and `x` are
    /// those of the forward pass.
    ///
    /// # Panics
    /// If `x` or `dy` has other rows or columns than in the forward pass.
    fn backward(
        &self,
        pass: &mut Backward<T>,
        geometry: &Self::Geometry,
        x: Operand<T>,
        saved: Self::Saved,
        dy: Buffer<T>,
    ) -> OperandGradient<T>;
}

/// Number of a layer's learned numbers.
pub fn n_params<T: Scalar>(layer: &impl Layer<T>) -> usize {
    layer.param_ranges().iter().map(Range::len).sum()
}

/// Names, shapes and places of a layer's tensors, in the order of `layout`.
pub fn tensors<'a, T: Scalar>(
    layer: &impl Layer<T>,
    layout: &'a Layout,
) -> impl Iterator<Item = &'a Entry> {
    let ranges = layer.param_ranges();
    layout.params.iter().filter(move |entry| ranges.contains(&entry.range))
}

/// One line for each of a layer's tensors: name, shape, count; and a last one with the sum.
pub fn describe<T: Scalar>(layer: &impl Layer<T>, layout: &Layout) -> String {
    let line = |entry: &Entry| format!("{} {:?} {}\n", entry.name, entry.shape, entry.range.len());
    let lines: String = tensors(layer, layout).map(line).collect();
    lines + &format!("{} parameters", n_params(layer))
}
