//! GraphSAGE on the graph of a mesh or of sites (Hamilton et al. 2017): the baseline without an octree.
//!
//! Layer: `h' = relu(norm(W·[h | cutter | mean of (h | cutter) over neighbors]))`, with a cutter module where
//! the configuration puts one. Both heads read the last layer. Training takes the mean over a sample of
//! the neighbors, inference over all.

use super::batch::Shape;
use super::config::{Cube, CutterConfig, CutterInput, CutterPlacement, MAX_WIDTH};
use super::cutter_modules::{CutterModule, N_LENGTHS, SavedCutterModule};
use super::graph::{Edges, GraphBatch, GraphShape, N_FEATURES};
use super::heads::{Head, N_HEADS};
use super::training::{InputGradients, TrainingPass};
use super::{cutter_modules, heads};
use crate::exec::memory::product;
use crate::nn::OperatorShape;
use crate::nn::arena::Buffer;
use crate::nn::batch_norm::BatchNorm;
use crate::nn::layer::Layer;
use crate::nn::linear::Linear;
use crate::nn::linear_norm_act::{LinearNormAct, SavedLinearNormAct};
use crate::nn::neighbor_mean::{NeighborMean, Neighbors};
use crate::nn::operand::{Operand, OperandGradient};
use crate::nn::params::Layout;
use crate::nn::pass::{Backward, Inference, Training};
use crate::nn::pass_memory::PassMemory;
use crate::nn::rows;
use crate::nn::saved::Policy;
use crate::numeric::rng::Stream;
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Configuration of a [`GraphSage`]; checked when the network is built.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct GraphSageConfig {
    /// Normalization of the vertices.
    pub cube: Cube,
    /// Unit of the cutter's lengths.
    pub cutter_input: CutterInput,
    /// Channels of each layer.
    pub widths: Vec<usize>,
    /// Edges of a site: it reads so many sites, the nearest ones.
    pub n_nearest: usize,
    /// Neighbors that training draws for each vertex and layer.
    #[serde(rename = "n_neighbours", alias = "n_neighbors")]
    pub n_neighbors: usize,
    /// Hidden channels of each head.
    pub head_width: usize,
    /// Cutter modules; "stage" means layer.
    pub cutter: CutterConfig,
}

setters!(GraphSageConfig {
    with_cube(cube: Cube),
    with_cutter_input(cutter_input: CutterInput),
    with_widths(widths: Vec<usize>),
    with_n_nearest(n_nearest: usize),
    with_n_neighbors(n_neighbors: usize),
    with_head_width(head_width: usize),
    with_cutter(cutter: CutterConfig),
});

impl Default for GraphSageConfig {
    /// Four layers of 64 channels, 16 nearest sites of which training draws ten, a cutter module of 32 channels before
    /// each layer.
    fn default() -> Self {
        GraphSageConfig {
            cube: Cube::Box,
            cutter_input: CutterInput::Scaled,
            widths: vec![64; 4],
            n_nearest: 16,
            n_neighbors: 10,
            head_width: 64,
            cutter: CutterConfig { width: 32, ..CutterConfig::small_batches() },
        }
    }
}

/// Description of a graph network; its numbers live in the two vectors that [`GraphSage::layout`] describes.
#[derive(Debug, Clone)]
pub struct GraphSage {
    config: GraphSageConfig,
    layout: Layout,
    cutters: Vec<CutterModule>,
    layers: Vec<SageLayer>,
    heads: [Head; N_HEADS],
}

#[derive(Debug, Clone)]
struct SageLayer {
    stage: LinearNormAct<Linear>,
    /// Columns of the features that come in.
    c_in: usize,
    /// Columns of a cutter's features.
    c_cutter: usize,
    /// Index of its cutter module.
    cutter: Option<usize>,
}

/// What the training pass of a [`GraphSage`] leaves for backward.
#[derive(Debug)]
#[doc(hidden)] // what a pass leaves
pub struct SavedGraphSage<T> {
    cutters: Vec<(Buffer<T>, SavedCutterModule<T>)>,
    layers: Vec<SavedSageLayer<T>>,
    /// Output of the last layer.
    y: Buffer<T>,
    heads: Vec<SavedLinearNormAct<T>>,
}

#[derive(Debug)]
struct SavedSageLayer<T> {
    /// Output of the layer before; empty for the first, which reads the batch.
    x: Buffer<T>,
    /// `[x | cutter]`, and its mean over the neighbors.
    own: Buffer<T>,
    mean: Buffer<T>,
    stage: SavedLinearNormAct<T>,
}

impl GraphSage {
    /// Checks the configuration and lays out all parameters.
    ///
    /// # Errors
    /// If there is no layer, or a number is outside its domain.
    pub fn new(config: &GraphSageConfig) -> Result<Self> {
        config.check()?;
        let (mut layout, mut cutters, mut layers) = (Layout::default(), Vec::new(), Vec::new());
        let mut c_in = N_FEATURES;
        for (i, &c) in config.widths.iter().enumerate() {
            let cutter = sees_cutter(config, i).then_some(config.cutter.width);
            if cutter.is_some() && (cutters.is_empty() || !config.cutter.shared) {
                let name = format!("fc_module_{}", i + 1);
                cutters.push(CutterModule::new(&mut layout, &name, &config.cutter)?);
            }
            let both = 2 * (c_in + cutter.unwrap_or(0));
            let linear = Linear::new(&mut layout, &format!("layer.{i}.linear"), both, c, false);
            let norm = BatchNorm::new(&mut layout, &format!("layer.{i}.bn"), c);
            let stage = LinearNormAct { linear, norm, relu: true, policy: Policy::Save };
            let cutter = cutter.map(|_| cutters.len() - 1);
            layers.push(SageLayer { stage, c_in, c_cutter: config.cutter.width, cutter });
            c_in = c;
        }
        let heads = ["header", "header_2"]
            .map(|n| Head::new(&mut layout, n, c_in, config.head_width, Policy::Recompute));
        Ok(GraphSage { config: config.clone(), layout, cutters, layers, heads })
    }

    /// The configuration it was built with.
    pub fn config(&self) -> &GraphSageConfig {
        &self.config
    }

    /// Columns of the last layer.
    fn c_out(&self) -> usize {
        self.config.widths[self.config.widths.len() - 1]
    }

    /// Names, shapes and places of all parameters and running statistics.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Inference over all neighbors: logits of both heads, `[n_points, 2]` each.
    pub fn forward<T: Scalar>(&self, pass: &Inference<T>, batch: &GraphBatch<T>) -> Vec<Buffer<T>> {
        let lengths = Operand::new(&batch.cutters, N_LENGTHS);
        let cutters: Vec<_> = self.cutters.iter().map(|m| m.forward(pass, &(), lengths)).collect();
        let mut y = pass.arena.copy_of(&batch.features);
        for layer in &self.layers {
            let cutter = layer.cutter.map(|m| &cutters[m][..]);
            let (own, mean) = layer.gather(pass, &batch.shapes, &batch.all, &y, cutter);
            let both = layer.both(&own, &mean);
            y = layer.stage.forward(pass, &(), Operand::Concat(&both));
        }
        let x = Operand::new(&y, self.c_out());
        self.heads.iter().map(|head| head.forward(pass, &(), x)).collect()
    }

    /// The graphs of the sites of `shapes`. For training, the neighbors that each layer takes the mean over are drawn:
    /// shape `i` draws from `streams[i]`.
    ///
    /// # Errors
    /// As [`GraphBatch::new`].
    pub fn batch<T: Scalar>(
        &self,
        shapes: &[Shape],
        streams: Option<&mut [Stream]>,
    ) -> Result<GraphBatch<T>> {
        let GraphSageConfig { n_nearest, cube, cutter_input, .. } = self.config;
        let graph = shapes.iter().map(|&Shape { points, normals, cutter_mm, .. }| {
            let edges = Edges::Nearest(n_nearest);
            GraphShape { points, normals, edges, cutter_mm }
        });
        let shapes: Vec<_> = graph.collect();
        let mut batch = GraphBatch::new(&shapes, cube, cutter_input)?;
        if let Some(streams) = streams {
            let sample = |_: &SageLayer| batch.sample(self.config.n_neighbors, streams);
            batch.samples = self.layers.iter().map(sample).collect();
        }
        Ok(batch)
    }

    /// Training pass; layer `i` takes the mean over the neighbors `batch.samples[i]`.
    ///
    /// # Panics
    /// If there are fewer samples than layers.
    pub fn forward_train<T: Scalar>(
        &self,
        pass: &mut Training<T>,
        batch: &GraphBatch<T>,
    ) -> TrainingPass<T, SavedGraphSage<T>> {
        let lengths = Operand::new(&batch.cutters, N_LENGTHS);
        let module = |module: &CutterModule| module.forward_train(pass, &(), lengths);
        let cutters: Vec<_> = self.cutters.iter().map(module).collect();
        let (mut x, mut layers) = (Buffer::default(), Vec::new());
        for (i, layer) in self.layers.iter().enumerate() {
            let cutter = layer.cutter.map(|m| &cutters[m].0[..]);
            let input = if i == 0 { &batch.features[..] } else { &x };
            let (own, mean) =
                layer.gather(&pass.inference(), &batch.shapes, &batch.samples[i], input, cutter);
            let both = layer.both(&own, &mean);
            let (y, stage) = layer.stage.forward_train(pass, &(), Operand::Concat(&both));
            let x = std::mem::replace(&mut x, y);
            layers.push(SavedSageLayer { x, own, mean, stage });
        }
        let (mut logits, mut heads) = (Vec::new(), Vec::new());
        for head in &self.heads {
            let (of_head, saved) = head.forward_train(pass, &(), Operand::new(&x, self.c_out()));
            logits.push(of_head);
            heads.push(saved);
        }
        TrainingPass { logits, saved: SavedGraphSage { cutters, layers, y: x, heads } }
    }

    /// Adds to `pass.grads` the gradient of a loss whose gradients by the logits are `dlogits`, and returns that
    /// by features and cutter lengths.
    ///
    /// `forward` comes from [`GraphSage::forward_train`] with the same parameters and batch.
    ///
    /// # Panics
    /// If there is not one gradient for each head.
    pub fn backward<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        batch: &GraphBatch<T>,
        forward: TrainingPass<T, SavedGraphSage<T>>,
        dlogits: &[&[T]],
    ) -> InputGradients<T> {
        let SavedGraphSage { cutters, layers, y, heads } = forward.saved;
        let x = Operand::new(&y, self.c_out());
        let mut d = pass.arena.zeroed(y.len());
        assert_eq!(dlogits.len(), self.heads.len(), "one gradient for each head");
        for ((head, saved), dlogits) in self.heads.iter().zip(heads).zip(dlogits) {
            let dhidden = head.backward_to_hidden(pass, x, saved, dlogits);
            head.add_input_gradient(pass, &dhidden, self.c_out(), &mut d);
        }
        pass.layer_done();
        let zeros = |(features, _): &(Buffer<T>, _)| pass.arena.zeroed(features.len());
        let mut dcutters: Vec<_> = cutters.iter().map(zeros).collect();
        for (i, (layer, saved)) in self.layers.iter().zip(layers).enumerate().rev() {
            let SavedSageLayer { x, own, mean, stage } = saved;
            let both = layer.both(&own, &mean);
            let dboth = layer.stage.backward(pass, &(), Operand::Concat(&both), stage, d);
            pass.layer_done();
            let down = layer.through_mean(pass, &batch.samples[i], &mean, dboth);
            let input = if i == 0 { &batch.features[..] } else { &x };
            let features = layer.cutter.map(|m| &cutters[m].0[..]);
            let inputs = layer.inputs(&batch.shapes, input, features);
            let dinputs = OperandGradient::of_matrix(pass.arena, Operand::Concat(&inputs), down);
            let mut parts = dinputs.into_parts().into_iter();
            d = parts.next().unwrap_or_default();
            if let Some((m, dcutter)) = layer.cutter.zip(parts.next()) {
                rows::add_all(&mut dcutters[m], &dcutter);
            }
        }
        let lengths = Operand::new(&batch.cutters, N_LENGTHS);
        let mut sum = pass.arena.zeroed(batch.cutters.len());
        for ((module, (_, saved)), d) in self.cutters.iter().zip(cutters).zip(dcutters) {
            let share = module.backward(pass, &(), lengths, saved, d).into_first();
            rows::add_all(&mut sum, &share);
        }
        pass.layer_done();
        InputGradients { features: d.to_vec(), cutters: sum.to_vec() }
    }
}

impl SageLayer {
    /// Columns of `[x | cutter]`.
    fn c_own(&self) -> usize {
        self.c_in + self.cutter.map_or(0, |_| self.c_cutter)
    }

    /// `[x | cutter]`, side by side.
    fn inputs<'a, T: Scalar>(
        &self,
        shapes: &'a [Range<usize>],
        x: &'a [T],
        cutter: Option<&'a [T]>,
    ) -> Vec<Operand<'a, T>> {
        let cutter = cutter.map(|x| Operand::PerShape { x, c: self.c_cutter, shapes });
        std::iter::once(Operand::new(x, self.c_in)).chain(cutter).collect()
    }

    /// `[x | cutter]` in one piece, and its mean over neighbors.
    fn gather<T: Scalar>(
        &self,
        pass: &Inference<T>,
        shapes: &[Range<usize>],
        neighbors: &Neighbors,
        x: &[T],
        cutter: Option<&[T]>,
    ) -> (Buffer<T>, Buffer<T>) {
        let own = Operand::Concat(&self.inputs(shapes, x, cutter)).copied(pass.arena);
        let mean = NeighborMean.forward(pass, neighbors, Operand::new(&own, self.c_own()));
        (own, mean)
    }

    /// What the linear map reads: `[own | mean of own]`.
    fn both<'a, T: Scalar>(&self, own: &'a [T], mean: &'a [T]) -> [Operand<'a, T>; 2] {
        [own, mean].map(|x| Operand::new(x, self.c_own()))
    }

    /// Gradient by `[x | cutter]` from that by [`SageLayer::both`].
    fn through_mean<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        neighbors: &Neighbors,
        mean: &[T],
        dboth: OperandGradient<T>,
    ) -> Buffer<T> {
        let mut parts = dboth.into_parts().into_iter();
        let mut down = parts.next().unwrap_or_default();
        let (x, dmean) = (Operand::new(mean, self.c_own()), parts.next().unwrap_or_default());
        let through = NeighborMean.backward(pass, neighbors, x, (), dmean).into_first();
        rows::add_all(&mut down, &through);
        down
    }
}

impl GraphSageConfig {
    /// Every number in its domain.
    fn check(&self) -> Result<()> {
        let widths = self.widths.iter().chain([&self.head_width]);
        let widths = widths.chain([&self.cutter.width, &self.cutter.hidden_width]);
        let error = |name, found: String, expected: String| {
            Err(Error::argument(name, found, expected, "change the network's configuration"))
        };
        if !(1..=MAX_LAYERS).contains(&self.widths.len()) {
            let expected = format!("1 to {MAX_LAYERS}");
            return error("number of graph layers", self.widths.len().to_string(), expected);
        }
        let neighbors = [&self.n_nearest, &self.n_neighbors];
        let numbers = widths.map(|n| ("width", n));
        for (name, n) in numbers.chain(neighbors.map(|n| ("number of neighbors", n))) {
            if !(1..=MAX_WIDTH).contains(n) {
                return error(name, n.to_string(), format!("1 to {MAX_WIDTH}"));
            }
        }
        Ok(())
    }
}

const MAX_LAYERS: usize = 1 << 6;

fn sees_cutter(config: &GraphSageConfig, layer: usize) -> bool {
    match config.cutter.placement {
        CutterPlacement::None => false,
        CutterPlacement::First => layer == 0,
        CutterPlacement::Last => layer + 1 == config.widths.len(),
        CutterPlacement::All => true,
    }
}

/// Numbers of a pass of the graph network.
pub(super) fn memory(
    config: &GraphSageConfig,
    c_in: usize,
    (n, n_shapes): (usize, usize),
    training: bool,
) -> u64 {
    let mut pass = PassMemory::new(n_shapes, training);
    cutter_modules::memory(
        &mut pass,
        config.widths.len(),
        [config.cutter.hidden_width, config.cutter.width],
    );
    let mut c = c_in;
    for &width in &config.widths {
        let own = c + config.cutter.width;
        let operator = OperatorShape::linear(n, 2 * own, width);
        pass.layer(operator);
        let gathered = product([n, own, 2]);
        if training {
            pass.save(gathered.saturating_add(product([n, c])));
            pass.use_workspace(
                operator.workspace(n_shapes, true).saturating_add(gathered.saturating_mul(2)),
            );
        } else {
            pass.use_workspace(operator.workspace(n_shapes, false).saturating_add(gathered));
        }
        c = width;
    }
    heads::memory(&mut pass, N_HEADS, n, [c, config.head_width]);
    pass.numbers()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::arena::Arena;
    use glam::Vec3;

    #[test]
    fn shapes_together_and_one_by_one_give_the_same_bits() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
        let faces: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 4]];
        let shape = |n: usize, cutter_mm| GraphShape {
            points: &points[..n],
            normals: &points[..n],
            edges: Edges::Faces(&faces[..n - 1]),
            cutter_mm,
        };
        let shapes = [shape(5, [1.0, 2.0, 9.0, 4.0]), shape(4, [2.0, 0.1, 30.0, 9.0])];
        let net = GraphSage::new(&GraphSageConfig::default()).unwrap();
        let params: Vec<f32> = net.layout().init_params(1);
        let buffers: Vec<f32> = net.layout().init_buffers();
        let run = |shapes: &[GraphShape]| {
            let batch = GraphBatch::new(shapes, Cube::Box, CutterInput::Scaled).unwrap();
            let pass = Inference { params: &params, buffers: &buffers, arena: &Arena::default() };
            net.forward(&pass, &batch).iter().map(|logits| logits.to_vec()).collect::<Vec<_>>()
        };
        let together = run(&shapes);
        let alone = shapes.map(|shape| run(&[shape]));
        for head in 0..N_HEADS {
            assert_eq!(together[head], [alone[0][head].clone(), alone[1][head].clone()].concat());
        }
    }

    #[test]
    fn networks_outside_their_domain_are_refused_by_name() {
        let refused = |change: fn(&mut GraphSageConfig)| {
            let mut config = GraphSageConfig::default();
            change(&mut config);
            GraphSage::new(&config).unwrap_err().to_string()
        };
        let message = refused(|c| c.widths = vec![]);
        assert!(message.starts_with("number of graph layers is 0, expected 1 to"), "{message}");
        assert!(refused(|c| c.widths = vec![4, 0]).starts_with("width is 0"));
        assert!(refused(|c| c.n_nearest = 0).starts_with("number of neighbors is 0"));
        assert!(refused(|c| c.cutter.dropout = 1.0).starts_with("dropout"));
    }
}
