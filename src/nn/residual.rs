//! Residual block: two 3³ convolutions around which the input takes a shortcut.

use super::conv::OctreeConv;
use super::joined::{Columns, ColumnsGradient};
use super::linear::Linear;
use super::params::Layout;
use super::unit::{self, Unit};
use super::{batch_norm::BatchNorm, relu, rows};
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
    middle: Vec<T>,
    straight: Vec<T>,
}

/// Working memory that blocks share: nothing in it outlives a call.
#[derive(Debug, Clone, Default)]
pub struct Scratch<T> {
    pub(super) block: Vec<T>,
    a: Vec<T>,
    b: Vec<T>,
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
        let x = x.into();
        self.first.forward(params, buffers, rows, x, &mut scratch.a);
        self.second.forward(params, buffers, rows, &scratch.a[..], y);
        match &self.shortcut {
            None => relu::forward_sum(y, x.one()),
            Some(shortcut) => {
                shortcut.forward(params, buffers, &(), x, &mut scratch.a);
                relu::forward_sum(y, &scratch.a);
            }
        }
    }

    /// Training: statistics of the batch.
    pub fn forward_train<'a, T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        rows: &KernelMap,
        x: impl Into<Columns<'a, T>>,
        y: &mut Vec<T>,
        cache: &mut Cache<T>,
    ) {
        let x = x.into();
        let Cache { first, second, shortcut, middle, straight } = cache;
        self.first.forward_train(params, buffers, rows, x, middle, first);
        self.second.forward_train(params, buffers, rows, &middle[..], y, second);
        match &self.shortcut {
            None => relu::forward_sum(y, x.one()),
            Some(unit) => {
                unit.forward_train(params, buffers, &(), x, straight, shortcut);
                relu::forward_sum(y, straight);
            }
        }
    }

    /// `d` holds the gradient of `y` and is used up; `y` is the output of `forward_train`.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<'a, T: Scalar>(
        &self,
        params: &[T],
        rows: &KernelMap,
        x: impl Into<Columns<'a, T>>,
        y: &[T],
        cache: &Cache<T>,
        d: &mut [T],
        mut dx: ColumnsGradient<T>,
        grads: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let (x, Scratch { a, b, .. }) = (x.into(), scratch);
        relu::backward(y, d);
        b.clear();
        b.extend_from_slice(d);
        let middle = &cache.middle[..];
        self.second.backward(params, rows, middle, &[], &cache.second, b, Some(a.into()), grads);
        let to = Some(dx.reborrow());
        self.first.backward(params, rows, x, middle, &cache.first, a, to, grads);
        match &self.shortcut {
            None => rows::add_all(dx.one(), d),
            Some(unit) => {
                unit.backward_norm(params, &[], &cache.shortcut, d, grads);
                unit.map.add_backward(params, x, d, dx, grads);
            }
        }
    }
}
