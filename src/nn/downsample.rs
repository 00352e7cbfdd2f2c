//! Downsampling stage: strided convolution, batch norm and ReLU.

use super::batch_norm::BatchNorm;
use super::down::{OctreeDown, PackedDown};
use super::joined::ColumnsGradient;
use super::pad::{Depad, Pad};
use super::params::Layout;
use super::unit::{self, Unit};
use crate::octree::Level;
use crate::scalar::Scalar;

/// `relu(norm(down(x)))` in one of two ways to treat the nodes of the coarse depth that hold no points.
///
/// Both have the same parameters.
#[derive(Debug, Clone)]
pub enum Downsample {
    /// Their zero rows take part in the batch norm: they count in its statistics, and come out of it and
    /// of the ReLU as a constant per channel. The reference's way.
    AllNodes(Unit<OctreeDown>),
    /// They take no part and stay zero.
    NonEmpty(Unit<PackedDown>),
}

/// What [`Downsample::forward_train`] keeps for backward.
#[derive(Debug, Clone, Default)]
pub struct Cache<T> {
    unit: unit::Cache<T>,
    packed: Vec<T>,
}

impl Downsample {
    /// Appends `{name}.conv` and `{name}.bn`.
    pub fn new(
        layout: &mut Layout,
        name: &str,
        c_in: usize,
        c_out: usize,
        normalise_empty: bool,
    ) -> Self {
        let map = OctreeDown::new(layout, &format!("{name}.conv"), c_in, c_out);
        let norm = BatchNorm::new(layout, &format!("{name}.bn"), c_out);
        match normalise_empty {
            true => Downsample::AllNodes(Unit { map, norm, relu: true }),
            false => Downsample::NonEmpty(Unit { map: PackedDown(map), norm, relu: true }),
        }
    }

    /// Inference: from `x: [8·n_nonempty, c_in]`, all nodes one depth finer than `coarse`, to
    /// `y: [n_nodes, c_out]` of `coarse`.
    ///
    /// # Panics
    /// If `x` has not one row per finer node.
    pub fn forward<T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        coarse: &Level,
        x: &[T],
        y: &mut Vec<T>,
    ) {
        match self {
            Downsample::AllNodes(unit) => unit.forward(params, buffers, coarse, x, y),
            Downsample::NonEmpty(unit) => {
                let mut packed = Vec::new();
                unit.forward(params, buffers, coarse, x, &mut packed);
                Pad::new(unit.norm.c).forward(coarse, &packed, y);
            }
        }
    }

    /// Training: statistics of the batch.
    ///
    /// # Panics
    /// If `x` has not one row per finer node.
    pub fn forward_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        coarse: &Level,
        x: &[T],
        y: &mut Vec<T>,
        cache: &mut Cache<T>,
    ) {
        let Cache { unit: kept, packed } = cache;
        match self {
            Downsample::AllNodes(unit) => unit.forward_train(params, buffers, coarse, x, y, kept),
            Downsample::NonEmpty(unit) => {
                unit.forward_train(params, buffers, coarse, x, packed, kept);
                Pad::new(unit.norm.c).forward(coarse, packed, y);
            }
        }
    }

    /// `d` holds the gradient of the output and is used up.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<T: Scalar>(
        &self,
        params: &[T],
        coarse: &Level,
        x: &[T],
        cache: &Cache<T>,
        d: &mut Vec<T>,
        dx: Option<ColumnsGradient<T>>,
        grads: &mut [T],
    ) {
        match self {
            Downsample::AllNodes(unit) => {
                unit.backward(params, coarse, x, &cache.unit, d, dx, grads);
            }
            Downsample::NonEmpty(unit) => {
                let mut packed = Vec::new();
                Depad::new(unit.norm.c).forward(coarse, d, &mut packed);
                *d = packed;
                unit.backward(params, coarse, x, &cache.unit, d, dx, grads);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::kernel_product::tests::octrees;
    use super::*;
    use crate::gradcheck::probe;

    #[test]
    fn only_the_reference_way_lets_empty_nodes_count() {
        let [all, nonempty] = [true, false].map(|normalise_empty| {
            let mut layout = Layout::default();
            let stage = Downsample::new(&mut layout, "down", 3, 2, normalise_empty);
            let mut params: Vec<f64> = layout.init_params(1);
            params[layout.n_params() - 2..].fill(0.5);
            (stage, params, layout.init_buffers::<f64>())
        });
        for octree in octrees() {
            let coarse = &octree.levels[octree.depth() - 1];
            let x = probe(8 * coarse.n_nonempty() * 3, 2);
            let [a, b] = [&all, &nonempty].map(|(stage, params, buffers)| {
                let (mut y, mut cache) = (vec![f64::NAN; 5], Cache::default());
                stage.forward_train(params, &mut buffers.clone(), coarse, &x, &mut y, &mut cache);
                let mut inferred = Vec::new();
                stage.forward(params, buffers, coarse, &x, &mut inferred);
                assert_eq!((y.len(), inferred.len()), (2 * coarse.n_nodes(), y.len()));
                y
            });
            let has_empty = coarse.n_nonempty() < coarse.n_nodes();
            assert_eq!(a == b, !has_empty);
            for (n, y) in b.chunks_exact(2).enumerate() {
                assert!(coarse.children[n] >= 0 || y == [0.0; 2]);
            }
        }
    }
}
