//! Residual block: two 3³ convolutions around which the input takes a shortcut.

use super::batch_norm::{BatchNorm, Finish};
use super::conv::OctreeConv;
use super::joined::{Columns, ColumnsGradient};
use super::linear::Linear;
use super::params::Layout;
use super::unit::{self, Unit};
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
        let (x, Scratch { middle, b, .. }) = (x.into(), scratch);
        let Cache { first, second, shortcut } = cache;
        self.first.forward_train(params, buffers, rows, x, middle, first);
        let straight = match &self.shortcut {
            None => x.one(),
            Some(unit) => {
                // Backward computes it again: it is cheap beside the convolutions and as large.
                unit.forward_train_in_place(params, buffers, &(), x, b, shortcut);
                b
            }
        };
        let (middle, finish) = (Columns::One(middle), Finish::ReluOfSum(straight));
        self.second.forward_train_to(params, buffers, rows, middle, finish, y, second);
    }

    /// `d` holds the gradient of `y` and is used up; `y` is the output of `forward_train`, or none if
    /// `d` went through the last ReLU already.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<'a, T: Scalar>(
        &self,
        params: &[T],
        rows: &KernelMap,
        x: impl Into<Columns<'a, T>>,
        y: Option<&[T]>,
        cache: &Cache<T>,
        d: &mut [T],
        mut dx: ColumnsGradient<T>,
        grads: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let x = x.into();
        self.backward_to_middle(params, rows, y, cache, d, grads, scratch);
        let Scratch { b, middle, .. } = scratch;
        self.first.backward(params, rows, x, &cache.first, middle, Some(dx.reborrow()), grads);
        match &self.shortcut {
            None => rows::add_all(dx.one(), d),
            Some(unit) => {
                let memory = std::mem::take(b);
                let shortcut = unit.again(params, &(), x, &cache.shortcut, memory);
                unit.backward_norm(params, &shortcut, d, grads);
                *b = shortcut.into_memory();
                unit.map.add_backward(params, x, d, dx, grads);
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
        y: Option<&[T]>,
        cache: &Cache<T>,
        d: &mut [T],
        grads: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        assert!(self.shortcut.is_none(), "the input goes unchanged");
        self.backward_to_middle(params, rows, y, cache, d, grads, scratch);
        let Scratch { b, middle, .. } = scratch;
        self.first.backward(params, rows, x, &cache.first, middle, Some((&mut *b).into()), grads);
        rows::add_all(d, b);
    }

    /// Leaves in `d` what passes the last ReLU, and in `scratch.middle` the gradient of what lies between
    /// the convolutions.
    #[allow(clippy::too_many_arguments)]
    fn backward_to_middle<T: Scalar>(
        &self,
        params: &[T],
        rows: &KernelMap,
        y: Option<&[T]>,
        cache: &Cache<T>,
        d: &mut [T],
        grads: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let Scratch { b, middle, .. } = scratch;
        if let Some(y) = y {
            relu::backward(y, d);
        }
        b.clear();
        b.extend_from_slice(d);
        self.first.output(params, &cache.first, middle);
        self.second.backward(params, rows, &middle[..], &cache.second, b, None, grads);
        // Its place is free now.
        self.second.map.backward_input(params, rows, b, middle);
    }
}
