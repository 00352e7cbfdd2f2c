//! GraphSAGE on the mesh graph (Hamilton et al. 2017): the baseline without an octree.
//!
//! Layer: `h' = relu(norm(W·[h | cutter | mean of (h | cutter) over neighbours]))`, with a cutter module where
//! the configuration puts one. Both heads read the last layer. Training takes the mean over a sample of
//! the neighbours, inference over all.

use super::config::{Cube, CutterConfig, CutterInput, CutterPlacement};
use super::cutter_modules::{self, CutterModule};
use super::graph::{GraphBatch, N_FEATURES};
use super::heads::{self, Head};
use super::unet::N_HEADS;
use crate::nn::batch_norm::BatchNorm;
use crate::nn::concat::{Concat, Part, PartGradient};
use crate::nn::linear::Linear;
use crate::nn::neighbour_mean::NeighbourMean;
use crate::nn::params::Layout;
use crate::nn::unit::{self, Unit};
use crate::rng::Stream;
use crate::scalar::Scalar;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Configuration of a [`GraphSage`]; checked when the network is built.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GraphSageConfig {
    /// Normalisation of the vertices.
    pub cube: Cube,
    /// Unit of the cutter's lengths.
    pub cutter_input: CutterInput,
    /// Channels of each layer.
    pub widths: Vec<usize>,
    /// Neighbours that training draws for each vertex and layer.
    pub n_neighbours: usize,
    /// Hidden channels of each head.
    pub head_width: usize,
    /// Cutter modules; "stage" means layer.
    pub cutter: CutterConfig,
}

impl Default for GraphSageConfig {
    /// Four layers of 64 channels, ten neighbours, a cutter module of 32 channels before each layer.
    fn default() -> Self {
        GraphSageConfig {
            cube: Cube::Box,
            cutter_input: CutterInput::Scaled,
            widths: vec![64; 4],
            n_neighbours: 10,
            head_width: 64,
            cutter: CutterConfig { width: 32, ..CutterConfig::default() },
        }
    }
}

/// Description of a graph network; its numbers live in the two vectors that [`GraphSage::layout`] describes.
#[derive(Debug, Clone)]
pub struct GraphSage {
    config: GraphSageConfig,
    layout: Layout,
    cutters: Vec<CutterModule>,
    layers: Vec<Layer>,
    heads: [Head; N_HEADS],
}

#[derive(Debug, Clone)]
struct Layer {
    unit: Unit<Linear>,
    /// Columns of the features and, if the layer sees a cutter, of its features.
    widths: Vec<usize>,
    cutter: Option<usize>,
}

/// Memory of a pass, kept between calls; after training it is what backward needs.
#[derive(Debug, Clone, Default)]
pub struct GraphWorkspace<T> {
    /// Logits of both heads, `[n_points, 2]` each.
    pub logits: [Vec<T>; N_HEADS],
    cutters: Vec<(Vec<T>, cutter_modules::Cache<T>)>,
    layers: Vec<LayerCache<T>>,
    heads: [heads::Cache<T>; N_HEADS],
    hidden: Vec<T>,
}

#[derive(Debug, Clone, Default)]
struct LayerCache<T> {
    own: Vec<T>,
    mean: Vec<T>,
    both: Vec<T>,
    y: Vec<T>,
    unit: unit::Cache<T>,
}

impl GraphSage {
    /// Checks the configuration and lays out all parameters.
    ///
    /// # Errors
    /// If there is no layer or a width is 0.
    pub fn new(config: &GraphSageConfig) -> Result<Self> {
        let zero = config.widths.iter().chain([&config.head_width, &config.n_neighbours]);
        let cutter = [&config.cutter.width, &config.cutter.hidden_width];
        if config.widths.is_empty() || zero.chain(cutter).any(|&width| width == 0) {
            return Err(Error::argument(
                "graph network",
                format!("{:?}", config.widths),
                "at least one layer, every width and the number of neighbours above 0",
                "change the network's configuration",
            ));
        }
        let (mut layout, mut cutters, mut layers) = (Layout::default(), Vec::new(), Vec::new());
        let mut c_in = N_FEATURES;
        for (i, &c) in config.widths.iter().enumerate() {
            let cutter = sees_cutter(config, i).then(|| {
                if cutters.is_empty() || !config.cutter.shared {
                    let name = format!("fc_module_{}", i + 1);
                    cutters.push(CutterModule::new(&mut layout, &name, &config.cutter));
                }
                cutters.len() - 1
            });
            let widths: Vec<usize> =
                [c_in].into_iter().chain(cutter.map(|_| config.cutter.width)).collect();
            let both = 2 * widths.iter().sum::<usize>();
            let map = Linear::new(&mut layout, &format!("layer.{i}.linear"), both, c, false);
            let norm = BatchNorm::new(&mut layout, &format!("layer.{i}.bn"), c);
            layers.push(Layer { unit: Unit { map, norm, relu: true }, widths, cutter });
            c_in = c;
        }
        let heads =
            ["header", "header_2"].map(|n| Head::new(&mut layout, n, c_in, config.head_width));
        Ok(GraphSage { config: config.clone(), layout, cutters, layers, heads })
    }

    /// The configuration it was built with.
    pub fn config(&self) -> &GraphSageConfig {
        &self.config
    }

    /// Names, shapes and places of all parameters and running statistics.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Inference over all neighbours: fills [`GraphWorkspace::logits`].
    pub fn forward<T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        batch: &GraphBatch<T>,
        work: &mut GraphWorkspace<T>,
    ) {
        work.resize(self);
        for (module, (y, _)) in self.cutters.iter().zip(&mut work.cutters) {
            module.forward(params, buffers, &batch.cutters, y);
        }
        for (i, layer) in self.layers.iter().enumerate() {
            let (x, now) = split(&mut work.layers, i, &batch.features);
            let cutter = layer.cutter.map(|m| &work.cutters[m].0[..]);
            layer.gather(&batch.shapes, &batch.mean, x, cutter, now);
            layer.unit.forward(params, buffers, &(), &now.both[..], &mut now.y);
        }
        let GraphWorkspace { logits, layers, hidden, .. } = work;
        for (head, logits) in self.heads.iter().zip(logits) {
            head.forward(params, buffers, &layers[layers.len() - 1].y, logits, hidden);
        }
    }

    /// Training pass; `means[i]` is what layer `i` takes the mean over (see [`GraphBatch::sample`]).
    ///
    /// `dropout` holds one stream per shape; `None` turns dropout off.
    ///
    /// # Panics
    /// If there are fewer means than layers.
    pub fn forward_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        batch: &GraphBatch<T>,
        means: &[NeighbourMean],
        mut dropout: Option<&mut [Stream]>,
        work: &mut GraphWorkspace<T>,
    ) {
        work.resize(self);
        for (module, (y, cache)) in self.cutters.iter().zip(&mut work.cutters) {
            let streams = dropout.as_deref_mut();
            module.forward_train(params, buffers, streams, &batch.cutters, y, cache);
        }
        for (i, layer) in self.layers.iter().enumerate() {
            let (x, now) = split(&mut work.layers, i, &batch.features);
            let cutter = layer.cutter.map(|m| &work.cutters[m].0[..]);
            layer.gather(&batch.shapes, &means[i], x, cutter, now);
            let LayerCache { both, y, unit, .. } = now;
            layer.unit.forward_train(params, buffers, &(), &both[..], y, unit);
        }
        let GraphWorkspace { logits, layers, heads, hidden, .. } = work;
        for ((head, logits), cache) in self.heads.iter().zip(logits).zip(heads) {
            let x = &layers[layers.len() - 1].y;
            head.forward_train(params, buffers, x, logits, cache, hidden);
        }
    }

    /// Adds to `grads` the gradient of a loss whose gradients by the logits are `dlogits`.
    ///
    /// `work` and `means` are those of the preceding [`GraphSage::forward_train`].
    pub fn backward<T: Scalar>(
        &self,
        params: &[T],
        batch: &GraphBatch<T>,
        means: &[NeighbourMean],
        dlogits: [&[T]; N_HEADS],
        work: &GraphWorkspace<T>,
        grads: &mut [T],
    ) {
        let x = &work.layers[work.layers.len() - 1].y;
        let mut d = vec![T::ZERO; x.len()];
        let (mut hidden, mut memory) = (Vec::new(), Vec::new());
        for (head, dlogits) in dlogits.into_iter().enumerate() {
            let (head, cache) = (&self.heads[head], &work.heads[head]);
            head.backward(params, x, cache, dlogits, grads, &mut hidden, &mut memory);
            head.add_dx(params, &hidden, &mut d);
        }
        let mut dcutters = vec![vec![T::ZERO; 0]; self.cutters.len()];
        for (i, layer) in self.layers.iter().enumerate().rev() {
            let LayerCache { both, unit, .. } = &work.layers[i];
            let mut dboth = Vec::new();
            let to = Some((&mut dboth).into());
            layer.unit.backward(params, &(), &both[..], unit, &mut d, to, grads);
            let mut dcutter = Vec::new();
            layer.spread(&batch.shapes, &means[i], &dboth, &mut d, &mut dcutter);
            if let Some(m) = layer.cutter {
                dcutters[m].resize(dcutter.len(), T::ZERO);
                add(&mut dcutters[m], &dcutter);
            }
        }
        for ((module, (_, cache)), d) in self.cutters.iter().zip(&work.cutters).zip(&mut dcutters) {
            module.backward(params, &batch.cutters, cache, d, None, grads);
        }
    }
}

impl Layer {
    fn c_own(&self) -> usize {
        self.widths.iter().sum()
    }

    /// `both = [own | mean of own]` with `own = [x | cutter]`.
    fn gather<T: Scalar>(
        &self,
        shapes: &[Range<usize>],
        mean: &NeighbourMean,
        x: &[T],
        cutter: Option<&[T]>,
        to: &mut LayerCache<T>,
    ) {
        let parts: Vec<_> = [Part::Nodes(x)].into_iter().chain(cutter.map(Part::Shapes)).collect();
        Concat { shapes, widths: &self.widths }.forward(&parts, &mut to.own);
        mean.forward(self.c_own(), &to.own, &mut to.mean);
        let widths = [self.c_own(); 2];
        let parts = [Part::Nodes(&to.own), Part::Nodes(&to.mean)];
        Concat { shapes, widths: &widths }.forward(&parts, &mut to.both);
    }

    /// Splits the gradient of `both` over `x` and the cutter features.
    fn spread<T: Scalar>(
        &self,
        shapes: &[Range<usize>],
        mean: &NeighbourMean,
        dboth: &[T],
        dx: &mut Vec<T>,
        dcutter: &mut Vec<T>,
    ) {
        let (mut down, mut dmean, mut through) = (Vec::new(), Vec::new(), Vec::new());
        let widths = [self.c_own(); 2];
        let mut parts = [PartGradient::Nodes(&mut down), PartGradient::Nodes(&mut dmean)];
        Concat { shapes, widths: &widths }.backward(dboth, &mut parts);
        mean.backward(self.c_own(), &dmean, &mut through);
        add(&mut down, &through);
        let mut parts = vec![PartGradient::Nodes(dx)];
        parts.extend(self.cutter.map(|_| PartGradient::Shapes(dcutter)));
        Concat { shapes, widths: &self.widths }.backward(&down, &mut parts);
    }
}

impl<T: Scalar> GraphWorkspace<T> {
    fn resize(&mut self, net: &GraphSage) {
        self.cutters.resize_with(net.cutters.len(), Default::default);
        self.layers.resize_with(net.layers.len(), Default::default);
    }
}

/// Input of layer `i`, and its memory.
fn split<'a, T>(
    layers: &'a mut [LayerCache<T>],
    i: usize,
    features: &'a [T],
) -> (&'a [T], &'a mut LayerCache<T>) {
    let (before, after) = layers.split_at_mut(i);
    (before.last().map_or(features, |layer| &layer.y), &mut after[0])
}

fn sees_cutter(config: &GraphSageConfig, layer: usize) -> bool {
    match config.cutter.placement {
        CutterPlacement::None => false,
        CutterPlacement::First => layer == 0,
        CutterPlacement::Last => layer + 1 == config.widths.len(),
        CutterPlacement::All => true,
    }
}

fn add<T: Scalar>(y: &mut [T], x: &[T]) {
    for (y, &x) in y.iter_mut().zip(x) {
        *y += x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::graph::GraphShape;
    use glam::Vec3;

    #[test]
    fn shapes_together_and_one_by_one_give_the_same_bits() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
        let faces: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 4]];
        let shape = |n: usize, cutter_mm| GraphShape {
            points: &points[..n],
            normals: &points[..n],
            triangles: &faces[..n - 1],
            cutter_mm,
        };
        let shapes = [shape(5, [1.0, 2.0, 9.0, 4.0]), shape(4, [2.0, 0.1, 30.0, 9.0])];
        let net = GraphSage::new(&GraphSageConfig::default()).unwrap();
        let params: Vec<f32> = net.layout().init_params(1);
        let buffers: Vec<f32> = net.layout().init_buffers();
        let run = |shapes: &[GraphShape]| {
            let batch = GraphBatch::new(shapes, Cube::Box, CutterInput::Scaled).unwrap();
            let mut work = GraphWorkspace::default();
            net.forward(&params, &buffers, &batch, &mut work);
            work.logits
        };
        let together = run(&shapes);
        let alone = shapes.map(|shape| run(&[shape]));
        for head in 0..N_HEADS {
            assert_eq!(together[head], [alone[0][head].clone(), alone[1][head].clone()].concat());
        }
    }

    #[test]
    fn a_network_without_layers_is_refused() {
        let config = GraphSageConfig { widths: vec![], ..GraphSageConfig::default() };
        assert!(GraphSage::new(&config).unwrap_err().to_string().contains("at least one layer"));
    }
}
