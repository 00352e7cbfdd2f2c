//! The repeating block of the network: a linear operator, batch norm and, usually, ReLU.

use super::arena::Buffer;
use super::batch_norm::{BatchNorm, Statistics};
use super::column_norm::{Activation, Epilogue};
use super::layer::Layer;
use super::linear_operator::LinearOperator;
use super::operand::{Operand, OperandGradient};
use super::pass::{Backward, Inference, Training};
use super::saved::{Policy, Saved};
use crate::numeric::scalar::Scalar;
use std::ops::Range;

/// `y = relu(norm(linear(x)))`, or without the ReLU. Inference normalizes and rectifies each block of rows as
/// soon as the operator has written it.
///
/// ```
/// use deepmill::nn::{arena::Arena, batch_norm::BatchNorm, layer::Layer, linear::Linear};
/// use deepmill::nn::{linear_norm_act::LinearNormAct, operand::Operand, params::Layout};
/// use deepmill::nn::{pass::Training, saved::Policy};
///
/// let mut layout = Layout::default();
/// let linear = Linear::new(&mut layout, "linear", 1, 1, false);
/// let norm = BatchNorm::new(&mut layout, "bn", 1);
/// let block = LinearNormAct { linear, norm, relu: true, policy: Policy::Save };
/// let (mut params, mut buffers) = (layout.init_params::<f64>(0), layout.init_buffers());
/// params[0] = 2.0; // the weight
/// let arena = Arena::default();
/// let mut pass = Training::new(&params, &mut buffers, &arena);
/// let (y, _) = block.forward_train(&mut pass, &(), Operand::new(&[1.0, 3.0], 1));
/// assert!(y[0] == 0.0 && (y[1] - 1.0).abs() < 1e-5); // 2 and 6 are −1 and 1 when normalized
/// ```
#[derive(Debug, Clone)]
pub struct LinearNormAct<M> {
    /// The linear operator.
    pub linear: M,
    /// Normalizes its output.
    pub norm: BatchNorm,
    /// Whether a ReLU follows.
    pub relu: bool,
    /// Whether the operator's output is saved for backward.
    pub policy: Policy,
}

/// What a training pass leaves for backward.
#[derive(Debug)]
pub struct SavedLinearNormAct<T> {
    /// Output of the linear operator, before normalization.
    pub(crate) mapped: Saved<T>,
    pub(crate) statistics: Statistics,
}

impl<M: LinearOperator> LinearNormAct<M> {
    fn activation<T>(&self) -> Activation<'static, T> {
        if self.relu { Activation::Relu } else { Activation::Identity }
    }

    /// [`Layer::forward`] with another activation.
    pub(super) fn forward_with<T: Scalar>(
        &self,
        pass: &Inference<T>,
        geometry: &M::Geometry,
        x: Operand<T>,
        activation: Activation<T>,
    ) -> Buffer<T> {
        let norm = self.norm.inference(pass.params, pass.buffers);
        let epilogue = Epilogue::Normalize(&norm, activation);
        self.linear.apply(pass.context(), geometry, x, epilogue)
    }

    /// [`Layer::forward_train`] up to the statistics.
    pub(super) fn measure<T: Scalar>(
        &self,
        pass: &mut Training<T>,
        geometry: &M::Geometry,
        x: Operand<T>,
    ) -> (Buffer<T>, Statistics) {
        let mapped = self.linear.apply(pass.context(), geometry, x, Epilogue::Identity);
        let statistics = self.norm.measure(pass.buffers, &mapped);
        (mapped, statistics)
    }

    /// The output from that of the linear operator.
    pub(crate) fn output<T: Scalar>(
        &self,
        params: &[T],
        mapped: &[T],
        statistics: &Statistics,
        mut y: Buffer<T>,
    ) -> Buffer<T> {
        self.norm.normalize(params, statistics, Some(mapped), self.activation(), &mut y);
        y
    }

    /// [`LinearNormAct::output`] in the memory of its input.
    pub(super) fn output_over<T: Scalar>(
        &self,
        params: &[T],
        mut mapped: Buffer<T>,
        statistics: &Statistics,
    ) -> Buffer<T> {
        self.norm.normalize(params, statistics, None, self.activation(), &mut mapped);
        mapped
    }

    /// The output of the training pass that left `saved`.
    pub(crate) fn recompute_output<T: Scalar>(
        &self,
        pass: &Backward<T>,
        geometry: &M::Geometry,
        x: Operand<T>,
        saved: &SavedLinearNormAct<T>,
    ) -> Buffer<T> {
        let SavedLinearNormAct { mapped, statistics } = saved;
        match mapped.get() {
            Some(mapped) => {
                self.output(&pass.params, mapped, statistics, pass.arena.get(mapped.len()))
            }
            None => {
                let mapped = self.linear.apply(pass.context(), geometry, x, Epilogue::Identity);
                self.output_over(&pass.params, mapped, statistics)
            }
        }
    }

    /// Output of the linear operator in the training pass that left `saved`.
    pub(crate) fn restore_mapped<T: Scalar>(
        &self,
        pass: &Backward<T>,
        geometry: &M::Geometry,
        x: Operand<T>,
        saved: Saved<T>,
    ) -> Buffer<T> {
        saved.restore(|| self.linear.apply(pass.context(), geometry, x, Epilogue::Identity))
    }

    /// From the gradient of the output to that of the linear operator's output.
    pub(crate) fn backward_norm<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        mapped: Buffer<T>,
        statistics: &Statistics,
        dy: &[T],
    ) -> Buffer<T> {
        self.norm.backward_over_input(pass, mapped, statistics, dy, self.relu)
    }

    /// [`Layer::backward`] up to the gradient by the linear operator's output, which is returned.
    pub(crate) fn backward_params<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        geometry: &M::Geometry,
        x: Operand<T>,
        saved: SavedLinearNormAct<T>,
        dy: Buffer<T>,
    ) -> Buffer<T> {
        let mapped = self.restore_mapped(pass, geometry, x, saved.mapped);
        let dmapped = self.backward_norm(pass, mapped, &saved.statistics, &dy);
        drop(dy);
        self.linear.weight_gradient(pass, geometry, x, &dmapped);
        dmapped
    }
}

impl<T: Scalar, M: LinearOperator> Layer<T> for LinearNormAct<M> {
    type Geometry = M::Geometry;
    type Saved = SavedLinearNormAct<T>;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        let norm = Layer::<T>::param_ranges(&self.norm);
        self.linear.tensor_ranges().into_iter().chain(norm).collect()
    }

    fn forward(&self, pass: &Inference<T>, geometry: &M::Geometry, x: Operand<T>) -> Buffer<T> {
        self.forward_with(pass, geometry, x, self.activation())
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        geometry: &M::Geometry,
        x: Operand<T>,
    ) -> (Buffer<T>, Self::Saved) {
        let (mapped, statistics) = self.measure(pass, geometry, x);
        let (y, mapped) = match self.policy {
            Policy::Save => {
                let y = pass.arena.get(mapped.len());
                let y = self.output(pass.params, &mapped, &statistics, y);
                (y, Saved::new(Policy::Save, mapped))
            }
            Policy::Recompute => {
                let y = self.output_over(pass.params, mapped, &statistics);
                (y, Saved::new(Policy::Recompute, Buffer::default()))
            }
        };
        (y, SavedLinearNormAct { mapped, statistics })
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        geometry: &M::Geometry,
        x: Operand<T>,
        saved: Self::Saved,
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let mapped = self.restore_mapped(pass, geometry, x, saved.mapped);
        let dmapped = self.backward_norm(pass, mapped, &saved.statistics, &dy);
        drop(dy);
        self.linear.gradients(pass, geometry, x, &dmapped)
    }
}
