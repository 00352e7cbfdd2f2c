//! A head: a two-layer classifier from point features to the logits of one label.

use crate::exec::memory::product;
use crate::nn::OperatorShape;
use crate::nn::arena::Buffer;
use crate::nn::batch_norm::BatchNorm;
use crate::nn::layer::Layer;
use crate::nn::linear::Linear;
use crate::nn::linear_norm_act::{LinearNormAct, SavedLinearNormAct};
use crate::nn::linear_operator::LinearOperator;
use crate::nn::operand::{Operand, OperandGradient};
use crate::nn::params::Layout;
use crate::nn::pass::{Backward, Inference, Training};
use crate::nn::pass_memory::PassMemory;
use crate::nn::saved::Policy;
use crate::numeric::scalar::Scalar;
use std::ops::Range;

/// Heads that every network has: inaccessible (class 0 = inaccessible), occlusion (class 1 = occlusion point).
pub const N_HEADS: usize = 2;
/// Place of the head after these, for the share of accessible directions
/// ([`UNetConfig::share_head`](super::UNetConfig::share_head)).
pub const SHARE_HEAD: usize = N_HEADS;
/// Logits per point and head of the networks here.
pub const N_CLASSES: usize = 2;

/// Linear without bias, batch norm, ReLU, linear with bias: `[n, c] → [n, n_classes]`.
#[derive(Debug, Clone)]
pub struct Head {
    hidden: LinearNormAct<Linear>,
    output: Linear,
}

impl Head {
    /// Appends `{name}.0.conv.linear`, `{name}.0.bn` and `{name}.1.linear`; `policy` is that of the hidden
    /// matrix before normalization.
    ///
    /// # Panics
    /// If a width is 0 or a name is taken.
    pub fn new(layout: &mut Layout, name: &str, c: usize, width: usize, policy: Policy) -> Self {
        Self::of_classes(layout, name, (c, width, N_CLASSES), policy)
    }

    /// [`Head::new`] with another number of classes than two.
    ///
    /// # Panics
    /// If a width or the number of classes is 0, or a name is taken.
    pub fn of_classes(
        layout: &mut Layout,
        name: &str,
        (c, width, n_classes): (usize, usize, usize),
        policy: Policy,
    ) -> Self {
        let linear = Linear::new(layout, &format!("{name}.0.conv.linear"), c, width, false);
        let norm = BatchNorm::new(layout, &format!("{name}.0.bn"), width);
        let output = Linear::new(layout, &format!("{name}.1.linear"), width, n_classes, true);
        Head { hidden: LinearNormAct { linear, norm, relu: true, policy }, output }
    }

    /// Backward up to the gradient by the hidden linear map's output, from which
    /// [`Head::add_input_gradient`] goes on: where several heads read one input, their gradients are added
    /// into one matrix.
    pub(super) fn backward_to_hidden<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        x: Operand<T>,
        saved: SavedLinearNormAct<T>,
        dlogits: &[T],
    ) -> Buffer<T> {
        let SavedLinearNormAct { mapped, statistics } = saved;
        let mapped = self.hidden.restore_mapped(pass, &(), x, mapped);
        let y = pass.arena.get(mapped.len());
        let y = self.hidden.output(&pass.params, &mapped, &statistics, y);
        let hidden = Operand::new(&y, self.output.c_in());
        self.output.weight_gradient(pass, &(), hidden, dlogits);
        let dy = self.output.input_gradient_over(pass.context(), y, dlogits);
        let dmapped = self.hidden.backward_norm(pass, mapped, &statistics, &dy);
        drop(dy);
        self.hidden.linear.weight_gradient(pass, &(), x, &dmapped);
        dmapped
    }

    /// Adds the gradient by the first columns of `x`, as many as `dx: [n, c]` has, from what
    /// [`Head::backward_to_hidden`] returned.
    pub(super) fn add_input_gradient<T: Scalar>(
        &self,
        pass: &Backward<T>,
        dhidden: &[T],
        c: usize,
        dx: &mut [T],
    ) {
        self.hidden.linear.add_node_gradient(pass.context(), 0..c, dhidden, dx);
    }
}

impl<T: Scalar> Layer<T> for Head {
    type Geometry = ();
    type Saved = SavedLinearNormAct<T>;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        let output = Layer::<T>::param_ranges(&self.output);
        Layer::<T>::param_ranges(&self.hidden).into_iter().chain(output).collect()
    }

    fn forward(&self, pass: &Inference<T>, (): &(), x: Operand<T>) -> Buffer<T> {
        let hidden = self.hidden.forward(pass, &(), x);
        self.output.forward(pass, &(), Operand::new(&hidden, self.output.c_in()))
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        (): &(),
        x: Operand<T>,
    ) -> (Buffer<T>, Self::Saved) {
        let (hidden, saved) = self.hidden.forward_train(pass, &(), x);
        let hidden = Operand::new(&hidden, self.output.c_in());
        (self.output.forward(&pass.inference(), &(), hidden), saved)
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        (): &(),
        x: Operand<T>,
        saved: Self::Saved,
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let dhidden = self.backward_to_hidden(pass, x, saved, &dy);
        self.hidden.linear.input_gradient(pass.context(), &(), x, &dhidden)
    }
}

/// Memory of the heads.
pub(crate) fn memory(
    pass: &mut PassMemory,
    n_heads: usize,
    n_points: usize,
    [c, width]: [usize; 2],
) {
    for _ in 0..n_heads {
        pass.run(OperatorShape::linear(n_points, c, width));
        pass.run(OperatorShape::linear(n_points, width, N_CLASSES));
        let n_saved = if pass.training { width } else { 0 };
        pass.save(product([n_points, N_CLASSES + n_saved]));
    }
}
