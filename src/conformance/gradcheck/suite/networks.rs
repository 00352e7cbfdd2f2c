//! Cases of whole networks: the loss of all heads as a function of parameters, features and cutter lengths.

use super::case::{LossCase, LossInput, LossStep};
use super::probes::{
    self, N_HIDDEN, ProbeGeometry, band, clear_of_kinks, cutter, dropout_streams, masks,
    shape_array,
};
use super::{ProbeShape, Suite, SuiteCase};
use crate::Result;
use crate::conformance::gradcheck::fixture::NamedArray;
use crate::learn::loss::{CrossEntropy, share_loss};
use crate::model::config::{
    AttentionConfig, Cube, CutterConfig, CutterInput, CutterPlacement, InputConfig,
};
use crate::model::cutter_modules::N_LENGTHS;
use crate::model::graph::{Edges, GraphBatch, GraphShape, N_FEATURES};
use crate::model::graph_sage::GraphSageConfig;
use crate::model::heads::N_CLASSES;
use crate::model::heads::N_HEADS;
use crate::model::{Batch, GraphSage, Model, UNet, UNetConfig};
use crate::nn::arena::{Arena, Buffer};
use crate::nn::params::Layout;
use crate::nn::pass::{Backward, Training};
use crate::numeric::rng::{Purpose, Stream};
use crate::octree::Octree;

/// Elements checked of each vector, for each tensor of the network: errors are relative to gradients of at least
/// a thousandth of the network's greatest, not tensor by tensor, as no difference of rounded losses can confirm
/// much smaller ones. Blocks and layers are held to that tensor by tensor.
const ELEMENTS_PER_TENSOR: usize = 12;
const DROPOUT: f64 = 0.3;

pub(super) fn cases(suite: &Suite) -> Result<Vec<SuiteCase>> {
    let of = |placement, shared| CutterConfig {
        placement,
        shared,
        hidden_width: N_HIDDEN,
        width: 3,
        batch_norm: true,
        dropout: DROPOUT,
    };
    use CutterPlacement::{All, First, Last, None};
    let attention = AttentionConfig { depths: vec![2, 3], n_heads: 2 };
    let attention = Extras { attention, ..Extras::default() };
    let without_dropout = CutterConfig { dropout: 0.0, ..of(All, false) };
    let with_attention =
        unet(suite, "unet_attention", (without_dropout, attention), (false, true))?;
    let share = Extras { share_head: true, ..Extras::default() };
    let with_share = unet(suite, "unet_share_head", (of(All, false), share), (true, true))?;
    let coarse = Extras { coarse_directions: 20, ..Extras::default() };
    let with_coarse =
        unet(suite, "unet_coarse_directions", (of(All, false), coarse), (true, true))?;
    let unet = |name, cutter, dropout, empty| {
        unet(suite, name, (cutter, Extras::default()), (dropout, empty))
    };
    Ok(vec![
        unet("unet", of(All, false), true, true)?,
        unet("unet_nonempty", of(All, false), true, false)?,
        unet("unet_shared_cutter", of(All, true), true, true)?,
        unet("unet_first_cutter", of(First, false), true, true)?,
        unet("unet_last_cutter", of(Last, false), false, false)?,
        unet("unet_without_cutter", of(None, false), false, true)?,
        with_attention,
        with_share,
        with_coarse,
        graph_sage(suite, "graph_sage", of(All, false))?,
        graph_sage(suite, "graph_sage_last_cutter", of(Last, false))?,
    ])
}

/// What a network may have beside the published structure.
#[derive(Default)]
struct Extras {
    attention: AttentionConfig,
    share_head: bool,
    coarse_directions: usize,
}

/// Targets of all heads.
struct Labels {
    classes: [Vec<u8>; N_HEADS],
    /// Of the head that tells a share.
    shares: Vec<f32>,
}

impl Labels {
    fn new(n_points: usize) -> Self {
        let of_head =
            |head: usize| (0..n_points).map(move |i| u8::from((i + head).is_multiple_of(3)));
        let classes = [0, 1].map(|head| of_head(head).collect());
        Labels { classes, shares: (0..n_points).map(|i| (i % 5) as f32 * 0.25).collect() }
    }

    /// The mean of all losses, and its gradients by the logits.
    fn loss(&self, logits: &[Buffer<f64>]) -> (f64, Vec<Vec<f64>>) {
        let (mut loss, mut gradients, weight) = (0.0, Vec::new(), 1.0 / logits.len() as f64);
        for (i, logits) in logits.iter().enumerate() {
            let mut d = Vec::new();
            loss += weight
                * match self.classes.get(i) {
                    Some(labels) => CrossEntropy::binary().loss(logits, labels, weight, &mut d),
                    None => share_loss(logits, &self.shares, weight, &mut d),
                };
            gradients.push(d);
        }
        (loss, gradients)
    }

    fn arrays(&self) -> impl Iterator<Item = NamedArray> {
        let array = |(i, labels): (usize, &Vec<u8>)| {
            let labels = labels.iter().map(|&label| label.into());
            NamedArray::indices(format!("fixed.labels.{i}"), "class of each point", 1, labels)
        };
        self.classes.iter().enumerate().map(array)
    }

    fn share_array(&self) -> NamedArray {
        let shares: Vec<f64> = self.shares.iter().map(|&share| share.into()).collect();
        let meaning = "share of the second logit at each point";
        NamedArray::numbers("fixed.shares", meaning, &[shares.len()], &shares)
    }
}

fn logit_arrays(logits: &[Buffer<f64>]) -> Vec<NamedArray> {
    let array = |(i, logits): (usize, &Buffer<f64>)| {
        let shape = [logits.len() / N_CLASSES, N_CLASSES];
        NamedArray::numbers(format!("logits.{i}"), "logits of a head at the points", &shape, logits)
    };
    logits.iter().enumerate().map(array).collect()
}

/// Masks of all cutter modules of a network, in the order in which they draw.
fn module_masks(layout: &Layout, width: usize, streams: &[Stream]) -> Result<Vec<NamedArray>> {
    let first = |name: &str| name.strip_suffix(".0.weight").map(str::to_owned);
    let modules = layout.params.iter().filter_map(|entry| first(&entry.name));
    let modules = modules.filter(|name| name.starts_with("fc_module"));
    let layers = modules.flat_map(|module| {
        [(format!("dropout.{module}.first"), N_HIDDEN), (format!("dropout.{module}.second"), width)]
    });
    masks(DROPOUT, streams, &layers.collect::<Vec<_>>())
}

/// Inputs of a network's loss: parameters, features, cutter lengths.
fn inputs(params: &[f64], features: (usize, &[f64]), cutters: &[f64]) -> Vec<LossInput> {
    let matrix = |name, c: usize, values: &[f64]| LossInput {
        name,
        shape: vec![values.len() / c, c],
        values: values.to_vec(),
    };
    vec![
        matrix("parameters", 1, params),
        matrix("features", features.0, features.1),
        matrix("cutters", N_LENGTHS, cutters),
    ]
}

fn unet(
    suite: &Suite,
    name: &'static str,
    (cutter, extras): (CutterConfig, Extras),
    (dropout, empty): (bool, bool),
) -> Result<SuiteCase> {
    let Extras { attention, share_head, coarse_directions } = extras;
    let config = UNetConfig {
        input: InputConfig { coarse_directions, ..probes::input() },
        stem_width: 4,
        encoder_widths: vec![5, 6],
        encoder_blocks: vec![1, 2],
        decoder_widths: vec![6, 4],
        decoder_blocks: vec![1, 1],
        head_width: 4,
        normalize_empty_parents: empty,
        cutter,
        attention,
        share_head,
    };
    let batch = probes::batch(&suite.shapes, &config.input)?;
    let net = UNet::with_policy(&config, &suite.policy)?;
    let layout = net.layout().clone();
    let params = clear_of_kinks(&layout, batch.octree.finest().n_nodes());
    let labels = Labels::new(batch.n_points());
    let streams = dropout.then(|| dropout_streams(suite.shapes.len(), 6));
    let mut fixed =
        unet_arrays(&batch, &labels, &layout, (config.cutter.width, streams.as_deref()))?;
    fixed.extend(share_head.then(|| labels.share_array()));
    let n_channels = config.input.n_node_channels()?;
    let inputs = inputs(&params, (n_channels, &batch.features), &batch.cutters);
    let max_elements = ELEMENTS_PER_TENSOR * layout.params.len();
    let model = Model::of(net, params, layout.init_buffers());
    let run = move |v: &[Vec<f64>], gradients: bool| {
        let (mut model, mut batch) = (model.clone(), batch.clone());
        model.params.clone_from(&v[0]);
        batch.features.clone_from(&v[1]);
        batch.cutters.clone_from(&v[2]);
        let (arena, mut streams) = (Arena::default(), streams.clone());
        let pass = model.forward_train(&batch, streams.as_deref_mut(), &arena);
        let ((loss, d), outputs) = (labels.loss(&pass.logits), logit_arrays(&pass.logits));
        let mut step = LossStep { loss, gradients: Vec::new(), buffers: Vec::new(), outputs };
        if gradients {
            let mut grads = vec![0.0; v[0].len()];
            let d: Vec<&[f64]> = d.iter().map(|d| &d[..]).collect();
            let inputs = model.backward_to_inputs(&batch, pass, &d, &mut grads, &arena);
            step.gradients = vec![grads, inputs.features, inputs.cutters];
        }
        step.buffers = model.buffers;
        step
    };
    let case = LossCase { layout, inputs, fixed, run: Box::new(run), max_elements };
    let formula = "mean of the cross-entropies of all heads of an octree U-Net of depth 3";
    Ok(case.named(name, formula).constant("normalize_empty_parents", f64::from(u8::from(empty))))
}

fn unet_arrays(
    batch: &Batch<f64>,
    labels: &Labels,
    layout: &Layout,
    (width, streams): (usize, Option<&[Stream]>),
) -> Result<Vec<NamedArray>> {
    let Octree { levels, point_ranges, .. } = &batch.octree;
    let n = batch.n_points();
    let meaning = "normals of the points, which the heads read beside the features";
    let normals =
        NamedArray::numbers("fixed.point_normals", meaning, &[n, 3], &batch.point_normals);
    let meaning = "what the heads read of the points beside the features and the normals";
    let shares = (!batch.coarse_answers.is_empty()).then(|| {
        let shape = [n, batch.coarse_answers.len() / n];
        NamedArray::numbers("fixed.coarse_answers", meaning, &shape, &batch.coarse_answers)
    });
    let mut arrays = vec![normals, shape_array("geometry.points", point_ranges)];
    for (depth, level) in levels.iter().enumerate() {
        arrays.extend(level.arrays(&format!("geometry.{depth}")));
    }
    arrays.extend(batch.interpolation.arrays("geometry.points"));
    arrays.extend(shares);
    arrays.extend(labels.arrays());
    if let Some(streams) = streams {
        arrays.extend(module_masks(layout, width, streams)?);
    }
    Ok(arrays)
}

/// Rings of the band that stands for a shape in a graph network.
fn n_rings(shape: ProbeShape) -> usize {
    match shape {
        ProbeShape::Patch => 3,
        ProbeShape::Point => 4,
        ProbeShape::Cell => 2,
    }
}

fn graph_batch(suite: &Suite) -> Result<GraphBatch<f64>> {
    let meshes: Vec<_> = suite.shapes.iter().map(|&shape| band(n_rings(shape))).collect();
    let shapes = meshes.iter().enumerate().map(|(i, (points, triangles))| GraphShape {
        points,
        normals: points,
        edges: Edges::Faces(triangles),
        cutter_mm: cutter(i),
    });
    let shapes: Vec<_> = shapes.collect();
    GraphBatch::new(&shapes, Cube::Box, CutterInput::Millimeters)
}

fn graph_sage(suite: &Suite, name: &'static str, cutter: CutterConfig) -> Result<SuiteCase> {
    let mut batch = graph_batch(suite)?;
    let config = GraphSageConfig {
        widths: vec![5, 4],
        n_neighbors: 3,
        head_width: 4,
        cutter,
        ..GraphSageConfig::default()
    };
    let net = GraphSage::new(&config)?;
    let layout = net.layout().clone();
    let draws = |i: usize| Stream::new(8, 0, i as u64, Purpose::Neighbors);
    let mut draws: Vec<Stream> = (0..suite.shapes.len()).map(draws).collect();
    batch.samples = [0; 2].map(|_| batch.sample(config.n_neighbors, &mut draws)).to_vec();
    let labels = Labels::new(batch.n_points());
    let streams = dropout_streams(suite.shapes.len(), 8);
    let mut fixed = vec![shape_array("geometry", &batch.shapes)];
    for (i, sample) in batch.samples.iter().enumerate() {
        fixed.extend(sample.arrays(&format!("geometry.layer.{i}")));
    }
    fixed.extend(labels.arrays());
    fixed.extend(module_masks(&layout, config.cutter.width, &streams)?);
    let params = clear_of_kinks(&layout, batch.n_points());
    let inputs = inputs(&params, (N_FEATURES, &batch.features), &batch.cutters);
    let max_elements = ELEMENTS_PER_TENSOR * layout.params.len();
    let run = move |v: &[Vec<f64>], gradients: bool| {
        let mut batch = batch.clone();
        batch.features.clone_from(&v[1]);
        batch.cutters.clone_from(&v[2]);
        let (mut buffers, mut streams) = (net.layout().init_buffers(), streams.clone());
        let (arena, params, dropout) = (&Arena::default(), &v[0][..], Some(&mut streams[..]));
        let mut pass = Training { params, buffers: &mut buffers, dropout, arena };
        let forward = net.forward_train(&mut pass, &batch);
        let ((loss, d), outputs) = (labels.loss(&forward.logits), logit_arrays(&forward.logits));
        let mut step = LossStep { loss, gradients: Vec::new(), buffers, outputs };
        if gradients {
            let mut grads = vec![0.0; params.len()];
            let d: Vec<&[f64]> = d.iter().map(|d| &d[..]).collect();
            let mut pass = Backward::new(params, &mut grads, arena);
            let inputs = net.backward(&mut pass, &batch, forward, &d);
            step.gradients = vec![grads, inputs.features, inputs.cutters];
        }
        step
    };
    let case = LossCase { layout, inputs, fixed, run: Box::new(run), max_elements };
    let formula = "mean of the cross-entropies of both heads of a GraphSAGE network; layer: \
                   relu(bn(linear([own | mean of own over the neighbors]))), own = [x | cutter]";
    Ok(case.named(name, formula))
}
