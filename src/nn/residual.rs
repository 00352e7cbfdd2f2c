//! Residual block: two 3³ convolutions around which the input takes a shortcut.

use super::arena::Buffer;
use super::batch_norm::{BatchNorm, Statistics};
use super::column_norm::{Activation, Epilogue};
use super::conv::OctreeConv;
use super::layer::Layer;
use super::linear::Linear;
use super::linear_norm_act::{LinearNormAct, SavedLinearNormAct};
use super::linear_operator::LinearOperator;
use super::operand::{Matrix, Operand, OperandGradient};
use super::params::Layout;
use super::pass::{Backward, Inference, Training};
use super::saved::{Policy, Saved};
use crate::numeric::scalar::Scalar;
use crate::octree::KernelMap;
use std::ops::Range;

/// What a block saves of its own for backward.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct ResidualPolicy {
    /// Outputs of both convolutions before normalization, `[n, c_out]` each.
    pub convolutions: Policy,
    /// Output of the shortcut's linear map before normalization, `[n, c_out]`.
    pub shortcut: Policy,
}

setters!(ResidualPolicy {
    with_convolutions(convolutions: Policy),
    with_shortcut(shortcut: Policy),
});

impl Default for ResidualPolicy {
    /// Convolutions are saved, the shortcut is recomputed.
    fn default() -> Self {
        ResidualPolicy { convolutions: Policy::Save, shortcut: Policy::Recompute }
    }
}

/// `y = relu(norm(conv(relu(norm(conv(x))))) + shortcut(x))` (He et al. 2016).
///
/// The shortcut is the identity, or a linear map with batch norm where the widths differ.
///
/// The shortcut carries the input past convolutions that do nothing:
///
/// ```
/// # use deepmill::octree::{Cloud, Octree, OctreeOptions};
/// use deepmill::nn::residual::{Residual, ResidualPolicy};
/// use deepmill::nn::{arena::Arena, layer, layer::Layer, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Inference};
///
/// # let options = OctreeOptions::default().with_depth(1).with_full_depth(1);
/// # let octree = Octree::build(&[Cloud::new(&[deepmill::glam::Vec3::ZERO], &[])], &options)?;
/// let (mut layout, arena, policy) = (Layout::default(), Arena::default(), ResidualPolicy::default());
/// let block = Residual::new(&mut layout, "block", 1, 1, policy);
/// let (params, buffers) = (vec![0.0; layout.n_params()], layout.init_buffers());
/// let x = [-4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0]; // of the eight nodes of depth 1
/// let y = block.forward(&Inference::new(&params, &buffers, &arena), &octree.finest().conv, Operand::new(&x, 1));
/// assert_eq!(y[..], x.map(|x: f64| x.max(0.0)));
/// let wider = Residual::new(&mut layout, "wider", 1, 2, policy);
/// assert!(layer::describe::<f64>(&wider, &layout).contains("wider.conv1x1.conv.linear.weight [2, 1]"));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Residual {
    first: LinearNormAct<OctreeConv>,
    second: LinearNormAct<OctreeConv>,
    shortcut: Option<LinearNormAct<Linear>>,
}

/// What a training pass leaves for backward.
#[derive(Debug)]
pub struct SavedResidual<T> {
    first: SavedLinearNormAct<T>,
    second: SavedLinearNormAct<T>,
    shortcut: Option<SavedLinearNormAct<T>>,
}

/// The shortcut in the backward pass: nothing to do, or its linear map's output.
enum Shortcut<'a, T> {
    Identity,
    Linear { layer: &'a LinearNormAct<Linear>, mapped: Buffer<T>, statistics: Statistics },
}

impl Residual {
    /// Appends `{name}.conv3x3a`, `{name}.conv3x3b` and, if `c_in ≠ c_out`, `{name}.conv1x1`.
    ///
    /// # Panics
    /// If a width is 0 or a name is taken.
    pub fn new(
        layout: &mut Layout,
        name: &str,
        c_in: usize,
        c_out: usize,
        policy: ResidualPolicy,
    ) -> Self {
        let mut convolution = |part: &str, c_in: usize, relu: bool| LinearNormAct {
            linear: OctreeConv::new(layout, &format!("{name}.{part}.conv"), c_in, c_out),
            norm: BatchNorm::new(layout, &format!("{name}.{part}.bn"), c_out),
            relu,
            policy: policy.convolutions,
        };
        let first = convolution("conv3x3a", c_in, true);
        let second = convolution("conv3x3b", c_out, false);
        let shortcut = (c_in != c_out).then(|| {
            let name = format!("{name}.conv1x1");
            LinearNormAct {
                linear: Linear::new(layout, &format!("{name}.conv.linear"), c_in, c_out, false),
                norm: BatchNorm::new(layout, &format!("{name}.bn"), c_out),
                relu: false,
                policy: policy.shortcut,
            }
        });
        Residual { first, second, shortcut }
    }

    /// Columns of the output.
    pub fn c_out(&self) -> usize {
        self.second.norm.c()
    }

    /// The output of the training pass that left `saved`.
    pub(super) fn recompute_output<T: Scalar>(
        &self,
        pass: &Backward<T>,
        map: &KernelMap,
        x: Operand<T>,
        saved: &SavedResidual<T>,
    ) -> Buffer<T> {
        let mut y = match (&self.shortcut, &saved.shortcut) {
            (Some(shortcut), Some(saved)) => shortcut.recompute_output(pass, &(), x, saved),
            _ => x.copied(pass.arena),
        };
        let SavedLinearNormAct { mapped, statistics } = &saved.second;
        let (norm, activation) = (&self.second.norm, Activation::ReluOfSumWithOutput);
        let recompute = || self.recompute_second(pass, map, x, saved);
        let recomputed = mapped.get().is_none().then(recompute);
        let mapped = mapped.get().or(recomputed.as_ref()).map(|mapped| &mapped[..]);
        norm.normalize(&pass.params, statistics, mapped, activation, &mut y);
        y
    }

    /// [`Residual::recompute_output`], in the memory of the input where nothing else must be recomputed.
    pub(super) fn recompute_output_over<T: Scalar>(
        &self,
        pass: &Backward<T>,
        map: &KernelMap,
        mut x: Buffer<T>,
        saved: &SavedResidual<T>,
    ) -> Buffer<T> {
        let SavedLinearNormAct { mapped, statistics } = &saved.second;
        match (&self.shortcut, mapped.get()) {
            (None, Some(mapped)) => {
                let (norm, activation) = (&self.second.norm, Activation::ReluOfSumWithOutput);
                norm.normalize(&pass.params, statistics, Some(mapped), activation, &mut x);
                x
            }
            _ => {
                let x = Operand::new(&x, self.first.linear.c_in());
                self.recompute_output(pass, map, x, saved)
            }
        }
    }

    /// Output of the second convolution, before normalization.
    fn recompute_second<T: Scalar>(
        &self,
        pass: &Backward<T>,
        map: &KernelMap,
        x: Operand<T>,
        saved: &SavedResidual<T>,
    ) -> Buffer<T> {
        let middle = self.first.recompute_output(pass, map, x, &saved.first);
        let middle = Operand::new(&middle, self.c_out());
        self.second.linear.apply(pass.context(), map, middle, Epilogue::Identity)
    }

    fn restore_shortcut<T: Scalar>(
        &self,
        pass: &Backward<T>,
        x: Operand<T>,
        saved: Option<SavedLinearNormAct<T>>,
    ) -> Shortcut<'_, T> {
        match (&self.shortcut, saved) {
            (Some(layer), Some(SavedLinearNormAct { mapped, statistics })) => {
                let mapped = layer.restore_mapped(pass, &(), x, mapped);
                Shortcut::Linear { layer, mapped, statistics }
            }
            _ => Shortcut::Identity,
        }
    }

    /// From `d`, which passed the last ReLU, to the gradient of the first convolution's output.
    fn backward_to_first<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        map: &KernelMap,
        first: (Buffer<T>, Statistics),
        second: (Buffer<T>, Statistics),
        d: &[T],
    ) -> Buffer<T> {
        let (c, (mapped, statistics)) = (self.c_out(), first);
        let middle = pass.arena.get(mapped.len());
        let middle = self.first.output(&pass.params, &mapped, &statistics, middle);
        let dsecond = self.second.backward_norm(pass, second.0, &second.1, d);
        let conv = &self.second.linear;
        conv.weight_gradient(pass, map, Operand::new(&middle, c), &dsecond);
        let shape = Operand::new(&mapped, c);
        drop(middle);
        let dmiddle = conv.input_gradient(pass.context(), map, shape, &dsecond).into_first();
        drop(dsecond);
        self.first.backward_norm(pass, mapped, &statistics, &dmiddle)
    }

    /// Leaves of `d`, the gradient of the output, what passes the last ReLU.
    fn pass_last_relu<T: Scalar>(
        &self,
        pass: &Backward<T>,
        x: Operand<T>,
        shortcut: &Shortcut<T>,
        (second, statistics): (&[T], &Statistics),
        d: &mut [T],
    ) {
        let straight = match shortcut {
            Shortcut::Identity => x.to_matrix(pass.arena),
            Shortcut::Linear { layer, mapped, statistics } => {
                let y = pass.arena.get(mapped.len());
                Matrix::Owned(layer.output(&pass.params, mapped, statistics, y))
            }
        };
        let activation = Activation::PassReluOfSum(&straight);
        self.second.norm.normalize(&pass.params, statistics, Some(second), activation, d);
    }
}

impl<T: Scalar> Layer<T> for Residual {
    type Geometry = KernelMap;
    type Saved = SavedResidual<T>;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        let parts = [Layer::<T>::param_ranges(&self.first), Layer::<T>::param_ranges(&self.second)];
        let shortcut = self.shortcut.as_ref().map(Layer::<T>::param_ranges);
        parts.into_iter().chain(shortcut).flatten().collect()
    }

    fn forward(&self, pass: &Inference<T>, map: &KernelMap, x: Operand<T>) -> Buffer<T> {
        let middle = self.first.forward(pass, map, x);
        let straight = match &self.shortcut {
            None => x.to_matrix(pass.arena),
            Some(shortcut) => Matrix::Owned(shortcut.forward(pass, &(), x)),
        };
        let middle = Operand::new(&middle, self.c_out());
        self.second.forward_with(pass, map, middle, Activation::ReluOfSum(&straight))
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        map: &KernelMap,
        x: Operand<T>,
    ) -> (Buffer<T>, SavedResidual<T>) {
        let (middle, first) = self.first.forward_train(pass, map, x);
        let (mapped, statistics) =
            self.second.measure(pass, map, Operand::new(&middle, self.c_out()));
        drop(middle);
        let (params, norm) = (pass.params, &self.second.norm);
        let (y, shortcut) = match &self.shortcut {
            None => {
                let (x, mut y) = (x.to_matrix(pass.arena), pass.arena.get(mapped.len()));
                let activation = Activation::ReluOfSum(&x);
                norm.normalize(params, &statistics, Some(&mapped), activation, &mut y);
                (y, None)
            }
            Some(shortcut) => {
                let (mut y, saved) = shortcut.forward_train(pass, &(), x);
                let activation = Activation::ReluOfSumWithOutput;
                norm.normalize(params, &statistics, Some(&mapped), activation, &mut y);
                (y, Some(saved))
            }
        };
        let mapped = Saved::new(self.second.policy, mapped);
        (y, SavedResidual { first, second: SavedLinearNormAct { mapped, statistics }, shortcut })
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        map: &KernelMap,
        x: Operand<T>,
        saved: SavedResidual<T>,
        mut dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let recomputed = saved.second.mapped.get().is_none();
        let second = recomputed.then(|| self.recompute_second(pass, map, x, &saved));
        let SavedResidual { first, second: saved_second, shortcut } = saved;
        let second = saved_second.mapped.restore(|| second.unwrap_or_default());
        let statistics = saved_second.statistics;
        let shortcut = self.restore_shortcut(pass, x, shortcut);
        self.pass_last_relu(pass, x, &shortcut, (&second, &statistics), &mut dy);
        let mapped = self.first.restore_mapped(pass, map, x, first.mapped);
        let first = (mapped, first.statistics);
        let dfirst = self.backward_to_first(pass, map, first, (second, statistics), &dy);
        let mut dx = self.first.linear.gradients(pass, map, x, &dfirst);
        drop(dfirst);
        match shortcut {
            Shortcut::Identity => dx.add(&OperandGradient::of_matrix(pass.arena, x, dy)),
            Shortcut::Linear { layer, mapped, statistics } => {
                let dmapped = layer.backward_norm(pass, mapped, &statistics, &dy);
                drop(dy);
                layer.linear.weight_gradient(pass, &(), x, &dmapped);
                layer.linear.add_input_gradient(pass.context(), x, &dmapped, &mut dx);
            }
        }
        dx
    }
}
