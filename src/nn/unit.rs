//! The repeating unit of the network: a linear map, batch norm and, usually, ReLU.

use super::batch_norm::{self, BatchNorm, Finish};
use super::conv::OctreeConv;
use super::conv_transpose::OctreeUp;
use super::down::{OctreeDown, PackedDown};
use super::joined::{Columns, ColumnsGradient};
use super::linear::Linear;
use super::rows::{Then, nothing};
use crate::octree::{KernelMap, Level};
use crate::scalar::Scalar;

/// A linear map between the rows of two matrices, along some map of rows to rows.
pub trait LinearMap {
    /// Which rows meet which; `()` where every row stays alone.
    type Rows: ?Sized;

    /// Overwrites `y` with the map of `x`.
    fn forward<T: Scalar>(&self, params: &[T], rows: &Self::Rows, x: Columns<T>, y: &mut Vec<T>) {
        self.forward_then(params, rows, x, y, &nothing);
    }

    /// [`LinearMap::forward`], and `then` once on every block of rows of `y`, with the number of its
    /// first row, while the block is in the cache.
    fn forward_then<T: Scalar>(
        &self,
        params: &[T],
        rows: &Self::Rows,
        x: Columns<T>,
        y: &mut Vec<T>,
        then: &(dyn Fn(usize, &mut [T]) + Sync),
    );

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

    fn forward_then<T: Scalar>(
        &self,
        params: &[T],
        map: &KernelMap,
        x: Columns<T>,
        y: &mut Vec<T>,
        then: &Then<T>,
    ) {
        match x {
            Columns::One(x) => self.forward_then(params, map, x, y, then),
            Columns::Joined(x) => self.forward_joined_then(params, map, &x, y, then),
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

            fn forward_then<T: Scalar>(
                &self,
                params: &[T],
                rows: &$rows,
                x: Columns<T>,
                y: &mut Vec<T>,
                then: &Then<T>,
            ) {
                <$map>::forward_then(self, params, rows, x.one(), y, then);
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

    fn forward_then<T: Scalar>(
        &self,
        params: &[T],
        _: &(),
        x: Columns<T>,
        y: &mut Vec<T>,
        then: &Then<T>,
    ) {
        match x {
            Columns::One(x) => Linear::forward_then(self, params, x, y, then),
            Columns::Joined(x) => self.forward_joined_then(params, &x, y, then),
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

impl<T> Cache<T> {
    /// Output of the linear map, or what [`Unit::backward_norm`] left in its place, and its statistics.
    pub(crate) fn parts(&self) -> (&[T], &batch_norm::Cache) {
        (&self.mapped, &self.norm)
    }

    /// The memory of the linear map's output, which is lost.
    pub(crate) fn take_memory(&mut self) -> Vec<T> {
        std::mem::take(&mut self.mapped)
    }

    /// Takes back what [`Cache::take_memory`] lent.
    pub(crate) fn give_memory(&mut self, memory: Vec<T>) {
        self.mapped = memory;
    }
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
        self.forward_to(params, buffers, rows, x.into(), self.finish(), y);
    }

    /// [`Unit::forward`] with another end: each block of rows is normalised and finished as soon as the
    /// linear map has written it.
    pub(super) fn forward_to<T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        rows: &M::Rows,
        x: Columns<T>,
        finish: Finish<T>,
        y: &mut Vec<T>,
    ) {
        let columns = self.norm.inference(params, buffers);
        let then = |first: usize, rows: &mut [T]| columns.apply(first, finish, rows);
        self.map.forward_then(params, rows, x, y, &then);
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
        self.map_train(params, buffers, rows, x.into(), cache);
        self.output(params, cache, y);
    }

    /// [`Unit::forward_train`] up to the statistics.
    pub(super) fn map_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        rows: &M::Rows,
        x: Columns<T>,
        cache: &mut Cache<T>,
    ) {
        self.map.forward(params, rows, x, &mut cache.mapped);
        cache.norm = self.norm.measure(buffers, &cache.mapped);
    }

    /// [`Unit::forward_train`] without the memory for the linear map's output, which `cache` then lacks:
    /// it serves [`Unit::output_again`] and [`Unit::again`].
    pub(crate) fn forward_train_in_place<'a, T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        rows: &M::Rows,
        x: impl Into<Columns<'a, T>>,
        y: &mut Vec<T>,
        cache: &mut Cache<T>,
    ) {
        self.map.forward(params, rows, x.into(), y);
        cache.norm = self.norm.measure(buffers, y);
        self.norm.normalise_in_place(params, &cache.norm, self.finish(), y);
    }

    /// The output of [`Unit::forward_train`], computed once more from its input.
    pub(crate) fn output_again<T: Scalar>(
        &self,
        params: &[T],
        rows: &M::Rows,
        x: Columns<T>,
        cache: &Cache<T>,
        y: &mut Vec<T>,
    ) {
        self.map.forward(params, rows, x, y);
        self.norm.normalise_in_place(params, &cache.norm, self.finish(), y);
    }

    /// The output of [`Unit::forward_train`], computed once more from what it kept.
    pub(crate) fn output<T: Scalar>(&self, params: &[T], cache: &Cache<T>, y: &mut Vec<T>) {
        self.norm.normalise(params, &cache.mapped, &cache.norm, self.finish(), y);
    }

    /// What [`Unit::forward_train`] kept, computed once more from its input into `memory`.
    pub(crate) fn again<T: Scalar>(
        &self,
        params: &[T],
        rows: &M::Rows,
        x: Columns<T>,
        cache: &Cache<T>,
        memory: Vec<T>,
    ) -> Cache<T> {
        let mut again = Cache { mapped: memory, norm: cache.norm.clone() };
        self.map.forward(params, rows, x, &mut again.mapped);
        again
    }

    fn finish<T>(&self) -> Finish<'static, T> {
        if self.relu { Finish::Relu } else { Finish::Nothing }
    }

    /// `d` holds the gradient of the output and is used up.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<'a, T: Scalar>(
        &self,
        params: &[T],
        rows: &M::Rows,
        x: impl Into<Columns<'a, T>>,
        cache: &Cache<T>,
        d: &mut [T],
        dx: Option<ColumnsGradient<T>>,
        grads: &mut [T],
    ) {
        let Cache { mapped, norm } = cache;
        match self.relu {
            true => self.norm.backward_relu(params, mapped, norm, d, grads),
            false => self.norm.backward(params, mapped, norm, d, grads),
        }
        self.map.backward(params, rows, x.into(), d, dx, grads);
    }

    /// Turns what was kept of the linear map's output into the gradient by it; `d` is that of the unit's
    /// output.
    pub(crate) fn backward_norm<T: Scalar>(
        &self,
        params: &[T],
        cache: &mut Cache<T>,
        d: &[T],
        grads: &mut [T],
    ) {
        let Cache { mapped, norm } = cache;
        self.norm.backward_over_input(params, mapped, norm, d, self.relu, grads);
    }
}
