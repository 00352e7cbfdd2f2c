//! What every network is to a model and a trainer: the trait that one's own networks implement too.

use super::training::TrainingPass;
use crate::nn::arena::Buffer;
use crate::nn::params::Layout;
use crate::nn::pass::{Backward, Inference, Training};
use crate::numeric::scalar::Scalar;

/// A network: an immutable description whose numbers lie in the flat vectors of a [`Model`](super::Model), with any
/// input, any number of heads and any number of classes in each.
///
/// `examples/own_network.rs` is one of one's own, trained by [`Trainer`](crate::train::Trainer).
pub trait Network<T: Scalar>: Sync {
    /// The input of a step: several shapes, samples, or whatever the network reads.
    type Batch: Sync;
    /// What a training pass leaves for backward besides the logits; `()` if nothing.
    type Saved: Send;

    /// Names, shapes and places of all parameters and running statistics.
    fn layout(&self) -> &Layout;

    /// Number of shapes in `batch`: dropout draws from one stream for each.
    fn n_shapes(&self, batch: &Self::Batch) -> usize;

    /// Inference: logits of the heads, `[n_points, n_classes]` each. Those of a shape do not depend on the rest of the
    /// batch.
    fn logits(&self, pass: &Inference<T>, batch: &Self::Batch) -> Vec<Buffer<T>>;

    /// Training pass: statistics of the batch.
    fn forward_train(
        &self,
        pass: &mut Training<T>,
        batch: &Self::Batch,
    ) -> TrainingPass<T, Self::Saved>;

    /// Adds to `pass.grads` the gradient of a loss whose gradients by the logits are `dlogits`, shaped as these.
    ///
    /// `forward` comes from [`Network::forward_train`] with the same parameters and batch.
    ///
    /// # Panics
    /// If there is not one gradient for each head.
    fn backward(
        &self,
        pass: &mut Backward<T>,
        batch: &Self::Batch,
        forward: TrainingPass<T, Self::Saved>,
        dlogits: &[&[T]],
    );
}
