//! Residual block: two 3³ convolutions around which the input takes a shortcut.

use super::batch_norm::{BatchNorm, Finish};
use super::conv::OctreeConv;
use super::joined::{Columns, ColumnsGradient};
use super::linear::Linear;
use super::params::Layout;
use super::unit::{self, LinearMap, Unit};
use super::{relu, rows};
use crate::octree::KernelMap;
use crate::scalar::Scalar;

/// `y = relu(norm(conv(relu(norm(conv(x))))) + shortcut(x))` (He et al. 2016).
///
/// The shortcut is the identity, or a linear map with batch norm where the widths differ.
#[derive(Debug, Clone)]
pub struct Residual {
    first: Unit<OctreeConv>,
    second: Unit<OctreeConv>,
    shortcut: Option<Unit<Linear>>,
}

/// What [`Residual::forward_train`] keeps for backward.
#[derive(Debug, Clone, Default)]
pub struct Cache<T> {
    first: unit::Cache<T>,
    second: unit::Cache<T>,
    shortcut: unit::Cache<T>,
}

/// Working memory that blocks share: nothing in it outlives a call.
#[derive(Debug, Clone, Default)]
pub struct Scratch<T> {
    pub(crate) block: Vec<T>,
    pub(crate) b: Vec<T>,
    pub(crate) middle: Vec<T>,
}

impl Residual {
    /// Appends `{name}.conv3x3a`, `{name}.conv3x3b` and, if `c_in ≠ c_out`, `{name}.conv1x1`.
    pub fn new(layout: &mut Layout, name: &str, c_in: usize, c_out: usize) -> Self {
        let mut convolution = |part: &str, c_in: usize, relu: bool| Unit {
            map: OctreeConv::new(layout, &format!("{name}.{part}.conv"), c_in, c_out),
            norm: BatchNorm::new(layout, &format!("{name}.{part}.bn"), c_out),
            relu,
        };
        let first = convolution("conv3x3a", c_in, true);
        let second = convolution("conv3x3b", c_out, false);
        let shortcut = (c_in != c_out).then(|| {
            let name = format!("{name}.conv1x1");
            Unit {
                map: Linear::new(layout, &format!("{name}.conv.linear"), c_in, c_out, false),
                norm: BatchNorm::new(layout, &format!("{name}.bn"), c_out),
                relu: false,
            }
        });
        Residual { first, second, shortcut }
    }

    /// Columns of the output.
    pub fn c_out(&self) -> usize {
        self.second.norm.c
    }

    /// Inference: `y` is overwritten.
    pub fn forward<'a, T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        rows: &KernelMap,
        x: impl Into<Columns<'a, T>>,
        y: &mut Vec<T>,
        scratch: &mut Scratch<T>,
    ) {
        let (x, Scratch { middle, b, .. }) = (x.into(), scratch);
        self.first.forward(params, buffers, rows, x, middle);
        let straight = match &self.shortcut {
            None => x.one(),
            Some(shortcut) => {
                shortcut.forward(params, buffers, &(), x, b);
                b
            }
        };
        let (middle, finish) = (Columns::One(middle), Finish::ReluOfSum(straight));
        self.second.forward_to(params, buffers, rows, middle, finish, y);
    }

    /// Training: statistics of the batch.
    #[allow(clippy::too_many_arguments)]
    pub fn forward_train<'a, T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        rows: &KernelMap,
        x: impl Into<Columns<'a, T>>,
        y: &mut Vec<T>,
        cache: &mut Cache<T>,
        scratch: &mut Scratch<T>,
    ) {
        let x = x.into();
        self.convolve(params, buffers, rows, x, cache, scratch);
        match &self.shortcut {
            None => self.finish(params, x.one(), cache, y),
            Some(unit) => {
                // Backward computes it again: it is cheap beside the convolutions and as large.
                unit.forward_train_in_place(params, buffers, &(), x, y, &mut cache.shortcut);
                self.finish_in_place(params, cache, y);
            }
        }
    }

    /// [`Residual::forward_train`] of a block around which the input goes unchanged: `x` becomes `y`.
    pub(super) fn forward_train_in_place<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        rows: &KernelMap,
        x: &mut [T],
        cache: &mut Cache<T>,
        scratch: &mut Scratch<T>,
    ) {
        assert!(self.shortcut.is_none(), "the input goes unchanged");
        self.convolve(params, buffers, rows, Columns::One(x), cache, scratch);
        self.finish_in_place(params, cache, x);
    }

    /// The output of [`Residual::forward_train`] once more, from its input and what it kept.
    pub(super) fn output_again<T: Scalar>(
        &self,
        params: &[T],
        x: Columns<T>,
        cache: &Cache<T>,
        y: &mut Vec<T>,
    ) {
        match &self.shortcut {
            None => self.finish(params, x.one(), cache, y),
            Some(unit) => {
                unit.output_again(params, &(), x, &cache.shortcut, y);
                self.finish_in_place(params, cache, y);
            }
        }
    }

    /// Both convolutions, up to the second one's normalisation.
    fn convolve<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        rows: &KernelMap,
        x: Columns<T>,
        cache: &mut Cache<T>,
        scratch: &mut Scratch<T>,
    ) {
        let Cache { first, second, .. } = cache;
        self.first.forward_train(params, buffers, rows, x, &mut scratch.middle, first);
        self.second.map_train(params, buffers, rows, Columns::One(&scratch.middle), second);
    }

    /// The end of the block, beside the shortcut's output.
    fn finish<T: Scalar>(&self, params: &[T], straight: &[T], cache: &Cache<T>, y: &mut Vec<T>) {
        let Unit { norm, .. } = &self.second;
        let (mapped, measured) = cache.second.parts();
        norm.normalise(params, mapped, measured, Finish::ReluOfSum(straight), y);
    }

    /// The end of the block: `y` holds the shortcut's output.
    pub(super) fn finish_in_place<T: Scalar>(&self, params: &[T], cache: &Cache<T>, y: &mut [T]) {
        let (mapped, measured) = cache.second.parts();
        self.second.norm.add_to_and_rectify(params, mapped, measured, y);
    }

    /// `d` holds the gradient of `y` and is used up, and so is `cache`; `y` is the output of
    /// `forward_train`.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<'a, T: Scalar>(
        &self,
        params: &[T],
        rows: &KernelMap,
        x: impl Into<Columns<'a, T>>,
        y: &[T],
        cache: &mut Cache<T>,
        d: &mut [T],
        mut dx: ColumnsGradient<T>,
        grads: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let x = x.into();
        relu::backward(y, d);
        self.backward_to_first(params, rows, cache, d, grads, scratch);
        let Cache { first, second, shortcut } = cache;
        let dy = first.parts().0;
        LinearMap::backward(&self.first.map, params, rows, x, dy, Some(dx.reborrow()), grads);
        match &self.shortcut {
            None => rows::add_all(dx.one(), d),
            Some(unit) => {
                let mut kept = unit.again(params, &(), x, shortcut, second.take_memory());
                unit.backward_norm(params, &mut kept, d, grads);
                unit.map.add_backward(params, x, kept.parts().0, dx, grads);
                second.give_memory(kept.take_memory());
            }
        }
    }

    /// [`Residual::backward`] of a block around which the input goes unchanged: `d` becomes the gradient
    /// of `x`.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn backward_in_place<T: Scalar>(
        &self,
        params: &[T],
        rows: &KernelMap,
        x: &[T],
        cache: &mut Cache<T>,
        d: &mut [T],
        grads: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        assert!(self.shortcut.is_none(), "the input goes unchanged");
        let (mapped, measured) = cache.second.parts();
        self.second.norm.pass_relu_of_sum(params, mapped, measured, x, d);
        self.backward_to_first(params, rows, cache, d, grads, scratch);
        let dx = &mut scratch.middle;
        let dy = cache.first.parts().0;
        self.first.map.backward(params, rows, x, dy, Some(&mut *dx), grads);
        rows::add_all(d, dx);
    }

    /// From `d`, which passed the last ReLU, to the gradient of the first convolution's output, in the place
    /// of that output.
    fn backward_to_first<T: Scalar>(
        &self,
        params: &[T],
        rows: &KernelMap,
        cache: &mut Cache<T>,
        d: &[T],
        grads: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let (Cache { first, second, .. }, Scratch { middle, .. }) = (cache, scratch);
        self.first.output(params, first, middle);
        self.second.backward_norm(params, second, d, grads);
        let dy = second.parts().0;
        self.second.map.backward(params, rows, middle, dy, None, grads);
        // Its place is free now.
        self.second.map.backward_input(params, rows, dy, middle);
        self.first.backward_norm(params, first, middle, grads);
    }
}

impl<T> Cache<T> {
    /// Memory that is free once backward has passed the block.
    pub(super) fn take_memory(&mut self) -> Vec<T> {
        self.first.take_memory()
    }

    /// Takes back what [`Cache::take_memory`] lent.
    pub(super) fn give_memory(&mut self, memory: Vec<T>) {
        self.first.give_memory(memory);
    }
}
