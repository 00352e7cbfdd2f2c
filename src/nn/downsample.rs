//! Downsampling stage: strided convolution, batch norm and ReLU.

use super::arena::Buffer;
use super::batch_norm::BatchNorm;
use super::layer::Layer;
use super::linear_norm_act::{LinearNormAct, SavedLinearNormAct};
use super::operand::{Operand, OperandGradient};
use super::pad;
use super::params::Layout;
use super::pass::{Backward, Inference, Training};
use super::saved::Policy;
use super::strided_conv::{OctreeStridedConv, OutputRows};
use crate::numeric::scalar::Scalar;
use crate::octree::OctreeLevel;
use std::ops::Range;

/// `relu(norm(conv(x)))` from all nodes of one depth to those of the next coarser, in one of two ways to treat
/// the coarse nodes that hold no points.
///
/// [`OutputRows::AllNodes`]: their zero rows take part in the batch norm: they count in its statistics, and come
/// out of it and of the ReLU as a constant per channel. The reference's way. [`OutputRows::NonEmpty`]: they take
/// no part and stay zero. Both have the same parameters.
///
/// ```
/// # use deepmill::octree::{Cloud, Octree, OctreeOptions};
/// use deepmill::nn::{downsample::Downsample, saved::Policy, strided_conv::OutputRows};
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, params::Layout, pass::Inference};
///
/// # let options = OctreeOptions::default().with_depth(2).with_full_depth(1);
/// # let octree = Octree::build(&[Cloud::new(&[deepmill::glam::Vec3::splat(-0.5)], &[])], &options)?;
/// let coarse = &octree.levels[1]; // eight nodes; one point, so that only node 0 has children
/// let (arena, x) = (Arena::default(), Operand::new(&[0.0; 8], 1));
/// let output = |rows| {
///     let mut layout = Layout::default();
///     let down = Downsample::new(&mut layout, "down", (1, 1), rows, Policy::Save);
///     let (mut params, buffers) = (layout.init_params::<f64>(0), layout.init_buffers());
///     params[9] = 0.5; // the bias of the norm, after eight weights and its weight
///     down.forward(&Inference::new(&params, &buffers, &arena), coarse, x).to_vec()
/// };
/// assert_eq!(output(OutputRows::AllNodes), [0.5; 8]);
/// assert_eq!(output(OutputRows::NonEmpty), [0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Downsample {
    stage: LinearNormAct<OctreeStridedConv>,
    rows: OutputRows,
}

impl Downsample {
    /// Appends `{name}.conv` and `{name}.bn`; `policy` is that of the convolution's output before
    /// normalization.
    ///
    /// # Panics
    /// If a width is 0 or a name is taken.
    pub fn new(
        layout: &mut Layout,
        name: &str,
        (c_in, c_out): (usize, usize),
        rows: OutputRows,
        policy: Policy,
    ) -> Self {
        let linear = OctreeStridedConv::new(layout, &format!("{name}.conv"), c_in, c_out, rows);
        let norm = BatchNorm::new(layout, &format!("{name}.bn"), c_out);
        Downsample { stage: LinearNormAct { linear, norm, relu: true, policy }, rows }
    }

    /// Columns of the output.
    pub fn c_out(&self) -> usize {
        self.stage.norm.c()
    }

    /// A row for each node of `coarse`.
    fn pad<T: Scalar>(
        &self,
        coarse: &OctreeLevel,
        y: Buffer<T>,
        padded: impl FnOnce(usize) -> Buffer<T>,
    ) -> Buffer<T> {
        match self.rows {
            OutputRows::AllNodes => y,
            OutputRows::NonEmpty => {
                let mut all = padded(coarse.n_nodes() * self.c_out());
                pad::scatter(coarse, self.c_out(), &y, &mut all);
                all
            }
        }
    }
}

impl<T: Scalar> Layer<T> for Downsample {
    type Geometry = OctreeLevel;
    type Saved = SavedLinearNormAct<T>;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Layer::<T>::param_ranges(&self.stage)
    }

    fn forward(&self, pass: &Inference<T>, coarse: &OctreeLevel, x: Operand<T>) -> Buffer<T> {
        let y = self.stage.forward(pass, coarse, x);
        self.pad(coarse, y, |n| pass.arena.get(n))
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
    ) -> (Buffer<T>, Self::Saved) {
        let (y, saved) = self.stage.forward_train(pass, coarse, x);
        (self.pad(coarse, y, |n| pass.arena.get(n)), saved)
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        coarse: &OctreeLevel,
        x: Operand<T>,
        saved: Self::Saved,
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let dy = match self.rows {
            OutputRows::AllNodes => dy,
            OutputRows::NonEmpty => {
                let mut packed = pass.arena.get(coarse.n_nonempty() * self.c_out());
                pad::gather(coarse, self.c_out(), &dy, &mut packed);
                packed
            }
        };
        self.stage.backward(pass, coarse, x, saved, dy)
    }
}

#[cfg(test)]
mod tests {
    use super::super::arena::Arena;
    use super::super::testing::octrees;
    use super::*;
    use crate::conformance::gradcheck::probe;

    #[test]
    fn only_the_reference_way_lets_empty_nodes_count() {
        let [all, nonempty] = [OutputRows::AllNodes, OutputRows::NonEmpty].map(|rows| {
            let mut layout = Layout::default();
            let stage = Downsample::new(&mut layout, "down", (3, 2), rows, Policy::Save);
            let mut params: Vec<f64> = layout.init_params(1);
            params[layout.n_params() - 2..].fill(0.5);
            (stage, params, layout.init_buffers::<f64>())
        });
        for octree in octrees() {
            let coarse = &octree.levels[octree.depth() - 1];
            let x = probe(8 * coarse.n_nonempty() * 3, 2);
            let x = Operand::new(&x, 3);
            let [a, b] = [&all, &nonempty].map(|(stage, params, buffers)| {
                let (arena, mut moved) = (&Arena::default(), buffers.clone());
                let mut pass = Training { params, buffers: &mut moved, dropout: None, arena };
                let (y, _) = stage.forward_train(&mut pass, coarse, x);
                let inferred = stage.forward(&Inference { params, buffers, arena }, coarse, x);
                assert_eq!((y.len(), inferred.len()), (2 * coarse.n_nodes(), y.len()));
                y.to_vec()
            });
            let has_empty = coarse.n_nonempty() < coarse.n_nodes();
            assert_eq!(a == b, !has_empty);
            for (n, y) in b.chunks_exact(2).enumerate() {
                assert!(coarse.children[n] >= 0 || y == [0.0; 2]);
            }
        }
    }
}
