//! The repeating unit of the network: a linear map, batch norm and, usually, ReLU.

use super::batch_norm::{self, BatchNorm};
use super::conv::OctreeConv;
use super::conv_transpose::OctreeUp;
use super::down::OctreeDown;
use super::linear::Linear;
use super::relu;
use crate::octree::{KernelMap, Level};
use crate::scalar::Scalar;

/// A linear map between the rows of two matrices, along some map of rows to rows.
pub trait LinearMap {
    /// Which rows meet which; `()` where every row stays alone.
    type Rows: ?Sized;

    /// Overwrites `y` with the map of `x`.
    fn forward<T: Scalar>(&self, params: &[T], rows: &Self::Rows, x: &[T], y: &mut Vec<T>);

    /// Overwrites `dx`, where wanted, and adds to `grads`.
    fn backward<T: Scalar>(
        &self,
        params: &[T],
        rows: &Self::Rows,
        x: &[T],
        dy: &[T],
        dx: Option<&mut Vec<T>>,
        grads: &mut [T],
    );
}

impl LinearMap for Linear {
    type Rows = ();

    fn forward<T: Scalar>(&self, params: &[T], _: &(), x: &[T], y: &mut Vec<T>) {
        Linear::forward(self, params, x, y);
    }

    fn backward<T: Scalar>(
        &self,
        params: &[T],
        _: &(),
        x: &[T],
        dy: &[T],
        dx: Option<&mut Vec<T>>,
        grads: &mut [T],
    ) {
        Linear::backward(self, params, x, dy, dx, grads);
    }
}

macro_rules! linear_map {
    ($map:ty, $rows:ty) => {
        impl LinearMap for $map {
            type Rows = $rows;

            fn forward<T: Scalar>(&self, params: &[T], rows: &$rows, x: &[T], y: &mut Vec<T>) {
                <$map>::forward(self, params, rows, x, y);
            }

            fn backward<T: Scalar>(
                &self,
                params: &[T],
                rows: &$rows,
                x: &[T],
                dy: &[T],
                dx: Option<&mut Vec<T>>,
                grads: &mut [T],
            ) {
                <$map>::backward(self, params, rows, x, dy, dx, grads);
            }
        }
    };
}

linear_map!(OctreeConv, KernelMap);
linear_map!(OctreeDown, Level);
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
    norm: batch_norm::Cache<T>,
}

impl<M: LinearMap> Unit<M> {
    /// Inference: `y` is overwritten.
    pub fn forward<T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        rows: &M::Rows,
        x: &[T],
        y: &mut Vec<T>,
    ) {
        self.map.forward(params, rows, x, y);
        self.norm.forward(params, buffers, y);
        if self.relu {
            relu::forward(y);
        }
    }

    /// Training: statistics of the batch.
    pub fn forward_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        rows: &M::Rows,
        x: &[T],
        y: &mut Vec<T>,
        cache: &mut Cache<T>,
    ) {
        self.map.forward(params, rows, x, &mut cache.mapped);
        self.norm.forward_train(params, buffers, &cache.mapped, y, &mut cache.norm);
        if self.relu {
            relu::forward(y);
        }
    }

    /// `d` holds the gradient of `y` and is used up; `y` is the output of `forward_train`.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<T: Scalar>(
        &self,
        params: &[T],
        rows: &M::Rows,
        x: &[T],
        y: &[T],
        cache: &Cache<T>,
        d: &mut [T],
        dx: Option<&mut Vec<T>>,
        grads: &mut [T],
    ) {
        if self.relu {
            relu::backward(y, d);
        }
        self.norm.backward(params, &cache.mapped, &cache.norm, d, grads);
        self.map.backward(params, rows, x, d, dx, grads);
    }
}
