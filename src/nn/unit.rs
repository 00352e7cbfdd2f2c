//! The repeating unit of the network: a linear map, batch norm and, usually, ReLU.

use super::batch_norm::{self, BatchNorm};
use super::conv::OctreeConv;
use super::conv_transpose::OctreeUp;
use super::down::{OctreeDown, PackedDown};
use super::joined::{Columns, ColumnsGradient};
use super::linear::Linear;
use super::relu;
use crate::octree::{KernelMap, Level};
use crate::scalar::Scalar;

/// A linear map between the rows of two matrices, along some map of rows to rows.
pub trait LinearMap {
    /// Which rows meet which; `()` where every row stays alone.
    type Rows: ?Sized;

    /// Overwrites `y` with the map of `x`.
    fn forward<T: Scalar>(&self, params: &[T], rows: &Self::Rows, x: Columns<T>, y: &mut Vec<T>);

    /// Overwrites `dx`, where wanted, and adds to `grads`. `dx` is of the kind of `x`.
    fn backward<T: Scalar>(
        &self,
        params: &[T],
        rows: &Self::Rows,
        x: Columns<T>,
        dy: &[T],
        dx: Option<ColumnsGradient<T>>,
        grads: &mut [T],
    );
}

impl LinearMap for OctreeConv {
    type Rows = KernelMap;

    fn forward<T: Scalar>(&self, params: &[T], map: &KernelMap, x: Columns<T>, y: &mut Vec<T>) {
        match x {
            Columns::One(x) => self.forward(params, map, x, y),
            Columns::Joined(x) => self.forward_joined(params, map, &x, y),
        }
    }

    fn backward<T: Scalar>(
        &self,
        params: &[T],
        map: &KernelMap,
        x: Columns<T>,
        dy: &[T],
        dx: Option<ColumnsGradient<T>>,
        grads: &mut [T],
    ) {
        match (x, dx) {
            (Columns::One(x), dx) => {
                self.backward(params, map, x, dy, dx.map(ColumnsGradient::one), grads);
            }
            (Columns::Joined(x), Some(ColumnsGradient::Joined(dx))) => {
                self.backward_joined(params, map, &x, dy, dx, grads);
            }
            _ => unreachable!("columns and their gradient are of one kind"),
        }
    }
}

macro_rules! linear_map {
    ($map:ty, $rows:ty) => {
        impl LinearMap for $map {
            type Rows = $rows;

            fn forward<T: Scalar>(
                &self,
                params: &[T],
                rows: &$rows,
                x: Columns<T>,
                y: &mut Vec<T>,
            ) {
                <$map>::forward(self, params, rows, x.one(), y);
            }

            fn backward<T: Scalar>(
                &self,
                params: &[T],
                rows: &$rows,
                x: Columns<T>,
                dy: &[T],
                dx: Option<ColumnsGradient<T>>,
                grads: &mut [T],
            ) {
                let dx = dx.map(ColumnsGradient::one);
                <$map>::backward(self, params, rows, x.one(), dy, dx, grads);
            }
        }
    };
}

impl LinearMap for Linear {
    type Rows = ();

    fn forward<T: Scalar>(&self, params: &[T], _: &(), x: Columns<T>, y: &mut Vec<T>) {
        match x {
            Columns::One(x) => Linear::forward(self, params, x, y),
            Columns::Joined(x) => self.forward_joined(params, &x, y),
        }
    }

    fn backward<T: Scalar>(
        &self,
        params: &[T],
        _: &(),
        x: Columns<T>,
        dy: &[T],
        dx: Option<ColumnsGradient<T>>,
        grads: &mut [T],
    ) {
        let dx = dx.map(ColumnsGradient::one);
        Linear::backward(self, params, x.one(), dy, dx, grads);
    }
}

linear_map!(OctreeDown, Level);
linear_map!(PackedDown, Level);
linear_map!(OctreeUp, Level);

/// `y = relu(norm(map(x)))`, or without the ReLU.
#[derive(Debug, Clone)]
pub struct Unit<M> {
    /// The linear map.
    pub map: M,
    /// Normalises its output.
    pub norm: BatchNorm,
    /// Whether a ReLU follows.
    pub relu: bool,
}

/// What [`Unit::forward_train`] keeps for backward.
#[derive(Debug, Clone, Default)]
pub struct Cache<T> {
    /// Output of the linear map, before normalisation.
    mapped: Vec<T>,
    norm: batch_norm::Cache,
}

impl<M: LinearMap> Unit<M> {
    /// Inference: `y` is overwritten.
    pub fn forward<'a, T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        rows: &M::Rows,
        x: impl Into<Columns<'a, T>>,
        y: &mut Vec<T>,
    ) {
        self.map.forward(params, rows, x.into(), y);
        match self.relu {
            true => self.norm.forward_then(params, buffers, y, |y| y.max(T::ZERO)),
            false => self.norm.forward(params, buffers, y),
        }
    }

    /// Training: statistics of the batch.
    pub fn forward_train<'a, T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        rows: &M::Rows,
        x: impl Into<Columns<'a, T>>,
        y: &mut Vec<T>,
        cache: &mut Cache<T>,
    ) {
        self.map.forward(params, rows, x.into(), &mut cache.mapped);
        let Cache { mapped, norm } = cache;
        match self.relu {
            true => {
                self.norm.forward_train_then(params, buffers, mapped, y, norm, |y| y.max(T::ZERO));
            }
            false => self.norm.forward_train(params, buffers, mapped, y, norm),
        }
    }

    /// `d` holds the gradient of `y` and is used up; `y` is the output of `forward_train`.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<'a, T: Scalar>(
        &self,
        params: &[T],
        rows: &M::Rows,
        x: impl Into<Columns<'a, T>>,
        y: &[T],
        cache: &Cache<T>,
        d: &mut [T],
        dx: Option<ColumnsGradient<T>>,
        grads: &mut [T],
    ) {
        self.backward_norm(params, y, cache, d, grads);
        self.map.backward(params, rows, x.into(), d, dx, grads);
    }

    /// Turns `d` into the gradient of the linear map's output.
    pub(super) fn backward_norm<T: Scalar>(
        &self,
        params: &[T],
        y: &[T],
        cache: &Cache<T>,
        d: &mut [T],
        grads: &mut [T],
    ) {
        if self.relu {
            relu::backward(y, d);
        }
        self.norm.backward(params, &cache.mapped, &cache.norm, d, grads);
    }
}
