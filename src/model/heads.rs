//! A head: point features to the two logits of one question.

use crate::nn::batch_norm::BatchNorm;
use crate::nn::linear::Linear;
use crate::nn::params::Layout;
use crate::nn::unit::{self, Unit};
use crate::scalar::Scalar;

/// Logits per point and head.
pub const N_CLASSES: usize = 2;

/// Linear without bias, batch norm, ReLU, linear with bias: `[n, c] → [n, 2]`.
#[derive(Debug, Clone)]
pub struct Head {
    hidden: Unit<Linear>,
    output: Linear,
}

/// What [`Head::forward_train`] keeps for backward: statistics alone.
#[derive(Debug, Clone, Default)]
pub struct Cache<T> {
    unit: unit::Cache<T>,
}

impl Head {
    /// Appends `{name}.0.conv.linear`, `{name}.0.bn` and `{name}.1.linear`.
    pub fn new(layout: &mut Layout, name: &str, c: usize, width: usize) -> Self {
        let map = Linear::new(layout, &format!("{name}.0.conv.linear"), c, width, false);
        let norm = BatchNorm::new(layout, &format!("{name}.0.bn"), width);
        let output = Linear::new(layout, &format!("{name}.1.linear"), width, N_CLASSES, true);
        Head { hidden: Unit { map, norm, relu: true }, output }
    }

    /// Inference: `y` is overwritten with the logits.
    pub fn forward<T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        x: &[T],
        y: &mut Vec<T>,
        hidden: &mut Vec<T>,
    ) {
        self.hidden.forward(params, buffers, &(), x, hidden);
        self.output.forward(params, hidden, y);
    }

    /// Training: statistics of the batch; `hidden` is memory to work in.
    pub fn forward_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        x: &[T],
        y: &mut Vec<T>,
        cache: &mut Cache<T>,
        hidden: &mut Vec<T>,
    ) {
        self.hidden.forward_train_in_place(params, buffers, &(), x, hidden, &mut cache.unit);
        self.output.forward(params, hidden, y);
    }

    /// `dy` is the gradient of the logits. Leaves in `hidden` what [`Head::add_dx`] needs; `memory` is for
    /// working in.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        cache: &Cache<T>,
        dy: &[T],
        grads: &mut [T],
        hidden: &mut Vec<T>,
        memory: &mut Vec<T>,
    ) {
        let mut kept =
            self.hidden.again(params, &(), x.into(), &cache.unit, std::mem::take(hidden));
        self.hidden.output(params, &kept, memory);
        self.output.backward(params, memory, dy, None, grads);
        // Its gradient takes its place.
        memory.fill(T::ZERO);
        self.output.add_dx(params, dy, memory);
        self.hidden.backward_norm(params, &mut kept, memory, grads);
        self.hidden.map.backward(params, x, kept.parts().0, None, grads);
        *hidden = kept.take_memory();
    }

    /// Adds to `dx`, the gradient by `x`, what [`Head::backward`] left in `hidden`.
    pub fn add_dx<T: Scalar>(&self, params: &[T], hidden: &[T], dx: &mut [T]) {
        self.hidden.map.add_dx(params, hidden, dx);
    }
}
