//! Backward passes of composite blocks and of whole networks are the derivatives of their forward passes.
//!
//! Central differences in f64, relative error at most 1e-7. Single layers are checked in their own files.
//! No probe comes near a kink of a ReLU, by construction: where batch norm feeds a ReLU over `n` rows, a
//! normalised value is at most `√(n - 1)`, so with weights up to `0.5 / √n` and biases of magnitude 1 and more
//! every input of the ReLU has magnitude 0.5 and more. Every fourth channel is off, in every layer.

#![allow(clippy::print_stdout)]

use deepmill::gradcheck::{self, Report, Settings};
use deepmill::loss::CrossEntropy;
use deepmill::model::config::{Cube, CutterConfig, CutterInput, CutterPlacement, InputConfig};
use deepmill::model::cutter_modules::{self, CutterModule};
use deepmill::model::graph::{GraphBatch, GraphShape};
use deepmill::model::graph_sage::{GraphSage, GraphSageConfig, GraphWorkspace};
use deepmill::model::heads::{self, Head};
use deepmill::model::{Batch, InputGradients, Model, UNetConfig, Workspace};
use deepmill::nn::batch_norm::BatchNorm;
use deepmill::nn::blocks::{self, Blocks};
use deepmill::nn::conv::OctreeConv;
use deepmill::nn::conv_transpose::OctreeUp;
use deepmill::nn::down::OctreeDown;
use deepmill::nn::params::Layout;
use deepmill::nn::residual::Scratch;
use deepmill::nn::unit::{self, Unit};
use deepmill::octree::{Cloud, Octree};
use deepmill::rng::{Purpose, Stream};
use glam::Vec3;

const LIMIT: f64 = 1e-7;
/// Hidden channels of the cutter modules here.
const N_HIDDEN: usize = 4;

/// Points of one shape: a curved patch with empty nodes around it, a single point, or one full cell.
fn shape(kind: usize) -> (Vec<Vec3>, Vec<Vec3>) {
    let mut stream = Stream::new(kind as u64, 0, 0, Purpose::Probe);
    let mut cube = |r: f64| Vec3::from_array([0; 3].map(|_| stream.range(-r, r) as f32));
    let points: Vec<Vec3> = match kind {
        0 => (0..9).map(|_| cube(0.8)).map(|p| Vec3::new(p.x, p.y, 0.5 * p.x * p.x)).collect(),
        1 => vec![Vec3::new(0.3, -0.6, 0.1)],
        _ => (0..5).map(|_| Vec3::splat(0.4) + cube(0.05)).collect(),
    };
    let normals = points.iter().map(|_| cube(1.0).normalize()).collect();
    (points, normals)
}

fn input() -> InputConfig {
    InputConfig { depth: 3, full_depth: 1, point_normals: true, ..InputConfig::default() }
}

fn batch(kinds: &[usize]) -> Batch<f64> {
    let shapes: Vec<_> = kinds.iter().map(|&kind| shape(kind)).collect();
    let clouds: Vec<_> = shapes.iter().map(|(p, n)| Cloud::new(p, n)).collect();
    let cutter = |i: usize| [0.1, 0.25, 0.4, 0.3].map(|x: f64| (x * (1 + 3 * i) as f64) % 0.5);
    let cutters: Vec<_> = (0..kinds.len()).map(cutter).collect();
    Batch::from_normalised(&clouds, &cutters, &input()).unwrap()
}

fn octree(kinds: &[usize]) -> Octree {
    batch(kinds).octree
}

/// Sign of channel `j` before every ReLU.
fn sign(j: usize) -> f64 {
    if j % 4 == 3 { -1.0 } else { 1.0 }
}

/// Parameters that keep every ReLU away from its kink, see the head of this file; `n` bounds the rows.
fn clear_of_kinks(layout: &Layout, n: usize) -> Vec<f64> {
    let mut params: Vec<f64> = layout.init_params(3);
    let mut stream = Stream::new(4, 0, 0, Purpose::Probe);
    for entry in &layout.params {
        let name = entry.name.as_str();
        let values = params[entry.range.clone()].iter_mut().enumerate();
        let module = name.contains("fc_module");
        for (j, v) in values {
            if name.ends_with(".bn.weight") {
                *v = stream.range(0.25, 0.5) / (n as f64).sqrt();
            } else if name.ends_with(".bn.bias") {
                *v = sign(j) * stream.range(1.0, 1.3);
            } else if module && name.ends_with(".0.bias") {
                *v = sign(j) * 1.5; // beside |Wx| ≤ 4 · ½ · ½
            } else if module && (name.ends_with(".2.weight") || name.ends_with(".2.bias")) {
                *v = stream.range(0.3, 0.6); // so the next input is at most 0.6 (√2 + 1) / 0.7
            } else if module && name.ends_with(".4.bias") {
                *v = sign(j) * (0.5 + 2.1 * (N_HIDDEN as f64).sqrt());
            }
        }
    }
    params
}

/// One named vector per tensor of `params`, after the given inputs.
fn inputs<'a>(
    layout: &'a Layout,
    params: &'a [f64],
    others: &[(&'a str, &'a [f64])],
) -> Vec<(&'a str, &'a [f64])> {
    let tensors = layout.params.iter().map(|e| (e.name.as_str(), &params[e.range.clone()]));
    others.iter().copied().chain(tensors).collect()
}

fn split(layout: &Layout, grads: &[f64]) -> Vec<Vec<f64>> {
    layout.params.iter().map(|e| grads[e.range.clone()].to_vec()).collect()
}

/// Batch norm over rows of small deviation magnifies rounding, which wants a long step, and curvature, which
/// wants a short one, most of all where all points share a cell; these steps balance the two.
const BLOCK_STEP: f64 = 4e-5;
const STEPS: [f64; 5] = [4e-5, 1e-4, 6e-4, 3e-4, 2.5e-5];

fn settings(step: f64, max_elements: usize) -> Settings {
    Settings { step, max_elements, ..Settings::default() }
}

fn require(what: &str, report: &Report) {
    println!("{what}: {} elements, worst {}", report.n_checked, report.worst());
    report.require(LIMIT).unwrap();
}

/// Checks a trained block with one input: `run(params, x)` gives its output, `back(params, x, dy)` its
/// gradients by input and parameters.
fn check_block(
    what: &str,
    layout: &Layout,
    params: &[f64],
    x: &[f64],
    run: impl Fn(&[f64], &[f64]) -> Vec<f64>,
    back: impl Fn(&[f64], &[f64], &[f64]) -> (Vec<f64>, Vec<f64>),
) {
    let report = gradcheck::layer(
        &inputs(layout, params, &[("x", x)]),
        |v| run(&v[1..].concat(), &v[0]),
        |v, dy| {
            let (dx, grads) = back(&v[1..].concat(), &v[0], dy);
            std::iter::once(dx).chain(split(layout, &grads)).collect()
        },
        &settings(BLOCK_STEP, 40),
    );
    require(what, &report);
}

const KINDS: [&[usize]; 4] = [&[0], &[1], &[2], &[0, 1, 2]];

#[test]
fn units_of_convolution_norm_and_relu() {
    for kinds in KINDS {
        let octree = octree(kinds);
        let level = &octree.levels[3];
        let n = level.n_nodes();
        let mut layout = Layout::default();
        let unit = Unit {
            map: OctreeConv::new(&mut layout, "u.conv", 3, 5),
            norm: BatchNorm::new(&mut layout, "u.bn", 5),
            relu: true,
        };
        let params = clear_of_kinks(&layout, n);
        let run = |params: &[f64], x: &[f64]| {
            let (mut y, mut cache) = (Vec::new(), unit::Cache::default());
            let mut buffers = layout.init_buffers();
            unit.forward_train(params, &mut buffers, &level.conv, x, &mut y, &mut cache);
            (y, cache)
        };
        let back = |params: &[f64], x: &[f64], dy: &[f64]| {
            let ((_, cache), mut d) = (run(params, x), dy.to_vec());
            let (mut dx, mut grads) = (Vec::new(), vec![0.0; params.len()]);
            let to = Some((&mut dx).into());
            unit.backward(params, &level.conv, x, &cache, &mut d, to, &mut grads);
            (dx, grads)
        };
        let x = gradcheck::probe(n * 3, 1);
        check_block("unit", &layout, &params, &x, |p, x| run(p, x).0, back);
    }
}

#[test]
fn units_between_depths() {
    for kinds in KINDS {
        let octree = octree(kinds);
        let (coarse, fine) = (&octree.levels[2], &octree.levels[3]);
        let mut layout = Layout::default();
        let down = Unit {
            map: OctreeDown::new(&mut layout, "down.conv", 4, 5),
            norm: BatchNorm::new(&mut layout, "down.bn", 5),
            relu: true,
        };
        let up = Unit {
            map: OctreeUp::new(&mut layout, "up.deconv", 5, 4),
            norm: BatchNorm::new(&mut layout, "up.bn", 4),
            relu: true,
        };
        let params = clear_of_kinks(&layout, fine.n_nodes());
        let run = |params: &[f64], x: &[f64]| {
            let (mut middle, mut y) = (Vec::new(), Vec::new());
            let mut caches = [unit::Cache::default(), unit::Cache::default()];
            let mut buffers = layout.init_buffers();
            down.forward_train(params, &mut buffers, coarse, x, &mut middle, &mut caches[0]);
            up.forward_train(params, &mut buffers, coarse, &middle[..], &mut y, &mut caches[1]);
            (middle, y, caches)
        };
        let back = |params: &[f64], x: &[f64], dy: &[f64]| {
            let ((middle, _, caches), mut d) = (run(params, x), dy.to_vec());
            let (mut dm, mut dx, mut grads) = (Vec::new(), Vec::new(), vec![0.0; params.len()]);
            let to = Some((&mut dm).into());
            up.backward(params, coarse, &middle[..], &caches[1], &mut d, to, &mut grads);
            let to = Some((&mut dx).into());
            down.backward(params, coarse, x, &caches[0], &mut dm, to, &mut grads);
            (dx, grads)
        };
        let x = gradcheck::probe(fine.n_nodes() * 4, 1);
        check_block("down and up", &layout, &params, &x, |p, x| run(p, x).1, back);
    }
}

#[test]
fn residual_blocks_with_and_without_change_of_width() {
    for kinds in KINDS {
        for (n_blocks, c_in) in [(1, 4), (1, 6), (2, 4), (2, 6), (3, 4), (3, 6)] {
            let octree = octree(kinds);
            let level = &octree.levels[2];
            let mut layout = Layout::default();
            let stage = Blocks::new(&mut layout, "stage", n_blocks, c_in, 4);
            let params = clear_of_kinks(&layout, level.n_nodes());
            let run = |params: &[f64], x: &[f64]| {
                let mut cache = blocks::Cache::default();
                let mut buffers = layout.init_buffers();
                let scratch = &mut Scratch::default();
                stage.forward_train(params, &mut buffers, &level.conv, x, &mut cache, scratch);
                cache
            };
            let back = |params: &[f64], x: &[f64], dy: &[f64]| {
                let (mut cache, mut d, mut dx) = (run(params, x), dy.to_vec(), Vec::new());
                let (mut grads, scratch) = (vec![0.0; params.len()], &mut Scratch::default());
                let to = (&mut dx).into();
                stage.backward(params, &level.conv, x, &mut cache, &mut d, to, &mut grads, scratch);
                (dx, grads)
            };
            // An identity shortcut adds x to what enters the last ReLU: same sign, no smaller.
            let x = gradcheck::probe(level.n_nodes() * c_in, 1);
            let x: Vec<f64> =
                x.iter().enumerate().map(|(i, x)| sign(i % c_in) * (0.1 + x.abs())).collect();
            let output = |p: &[f64], x: &[f64]| run(p, x).output().to_vec();
            check_block("residual blocks", &layout, &params, &x, output, back);
        }
    }
}

#[test]
fn cutter_modules_with_dropout_for_one_and_several_cutters() {
    for n_shapes in [1, 2, 3] {
        let mut layout = Layout::default();
        let config = CutterConfig {
            hidden_width: N_HIDDEN,
            width: 5,
            batch_norm: true,
            dropout: 0.3,
            ..Default::default()
        };
        let module = CutterModule::new(&mut layout, "fc_module_1", &config);
        let params = clear_of_kinks(&layout, n_shapes);
        let run = |params: &[f64], x: &[f64]| {
            let mut streams: Vec<_> =
                (0..n_shapes).map(|i| Stream::new(5, 0, i as u64, Purpose::Dropout)).collect();
            let (mut y, mut cache) = (Vec::new(), cutter_modules::Cache::default());
            let mut buffers = layout.init_buffers();
            let dropout = Some(&mut streams[..]);
            module.forward_train(params, &mut buffers, dropout, x, &mut y, &mut cache);
            (y, cache)
        };
        let back = |params: &[f64], x: &[f64], dy: &[f64]| {
            let ((_, cache), mut d) = (run(params, x), dy.to_vec());
            let (mut dx, mut grads) = (Vec::new(), vec![0.0; params.len()]);
            module.backward(params, x, &cache, &mut d, Some(&mut dx), &mut grads);
            (dx, grads)
        };
        let cutters = batch(&[0, 1, 2]).cutters;
        let x = &cutters[..4 * n_shapes];
        check_block("cutter module", &layout, &params, x, |p, x| run(p, x).0, back);
    }
}

#[test]
fn heads() {
    for n in [1, 2, 40] {
        let mut layout = Layout::default();
        let head = Head::new(&mut layout, "header", 6, 4);
        let params = clear_of_kinks(&layout, n);
        let run = |params: &[f64], x: &[f64]| {
            let (mut y, mut cache) = (Vec::new(), heads::Cache::default());
            let (buffers, hidden) = (&mut layout.init_buffers(), &mut Vec::new());
            head.forward_train(params, buffers, x, &mut y, &mut cache, hidden);
            (y, cache)
        };
        let back = |params: &[f64], x: &[f64], dy: &[f64]| {
            let (mut dx, mut grads) = (vec![0.0; x.len()], vec![0.0; params.len()]);
            let (cache, mut memory) = (run(params, x).1, [Vec::new(), Vec::new()]);
            let [hidden, memory] = &mut memory;
            head.backward(params, x, &cache, dy, &mut grads, hidden, memory);
            head.add_dx(params, hidden, &mut dx);
            (dx, grads)
        };
        let x = gradcheck::probe(n * 6, 1);
        check_block("head", &layout, &params, &x, |p, x| run(p, x).0, back);
    }
}

/// The whole network with both losses, dropout held, at a dozen elements per tensor on average.
fn check_network(kinds: &[usize], cutter: CutterConfig, dropout: bool, empty: bool) {
    let config = UNetConfig {
        input: input(),
        stem_width: 4,
        encoder_widths: vec![5, 6],
        encoder_blocks: vec![1, 2],
        decoder_widths: vec![6, 4],
        decoder_blocks: vec![1, 1],
        head_width: 4,
        normalise_empty_parents: empty,
        cutter,
    };
    let batch = batch(kinds);
    let mut model = Model::<f64>::new(&config, 1).unwrap();
    let layout = model.net.layout().clone();
    model.params = clear_of_kinks(&layout, batch.octree.finest().n_nodes());
    let labels = |shift: usize| -> Vec<u8> {
        (0..batch.n_points()).map(|i| u8::from((i + shift).is_multiple_of(3))).collect()
    };
    let labels = [labels(0), labels(1)];
    let (n_params, n_features) = (layout.n_params(), batch.features.len());
    // All that the loss depends on: parameters, node features, cutter lengths.
    let all = [&model.params[..], &batch.features, &batch.cutters].concat();
    let run = |all: &[f64], gradients: Option<&mut Vec<f64>>| {
        let mut streams: Vec<_> =
            (0..kinds.len()).map(|i| Stream::new(6, 0, i as u64, Purpose::Dropout)).collect();
        let (params, inputs) = all.split_at(n_params);
        let mut model = Model { params: params.to_vec(), ..model.clone() };
        let mut batch = batch.clone();
        (batch.features, batch.cutters) =
            (inputs[..n_features].to_vec(), inputs[n_features..].to_vec());
        let mut work = Workspace::default();
        model.forward_train(&batch, dropout.then_some(&mut streams[..]), &mut work);
        let (mut losses, mut d) = (Vec::new(), [Vec::new(), Vec::new()]);
        for head in 0..2 {
            let (logits, entropy) = (&work.logits[head], CrossEntropy::binary());
            losses.push(0.5 * entropy.loss(logits, &labels[head], 0.5, &mut d[head]));
        }
        if let Some(gradients) = gradients {
            let (mut inputs, d) = (InputGradients::default(), [&d[0][..], &d[1]]);
            gradients.resize(n_params, 0.0);
            let Model { net, params, .. } = &model;
            net.backward_to_inputs(params, &batch, d, &mut work, &mut inputs, gradients);
            gradients.extend([inputs.features, inputs.cutters].concat());
        }
        losses.iter().sum::<f64>()
    };
    // Errors are relative to gradients of at least a thousandth of the network's greatest, not tensor by
    // tensor: the loss is rounded to about 1e-16, a quotient over 4e-5 to 2e-12, so no difference can confirm
    // gradients below 2e-5 to 1e-7. Blocks and layers are held to that tensor by tensor.
    let check = |step: f64| {
        let (params, inputs) = all.split_at(n_params);
        gradcheck::layer(
            &[("parameters", params), ("inputs", inputs)],
            |v| vec![run(&v.concat(), None)],
            |v, dy| {
                let mut gradient = Vec::new();
                run(&v.concat(), Some(&mut gradient));
                gradient.iter_mut().for_each(|g| *g *= dy[0]);
                let inputs = gradient.split_off(n_params);
                vec![gradient, inputs]
            },
            &settings(step, 9 * layout.params.len()),
        )
    };
    // Rounding falls with the step and curvature grows with its fourth power, in each network otherwise:
    // a wrong gradient fails at every step.
    let sound = STEPS.into_iter().map(&check).find(|report| report.require(LIMIT).is_ok());
    require("network", &sound.unwrap_or_else(|| check(STEPS[0])));
}

#[test]
fn networks_with_both_losses() {
    let cutter = |placement, shared| CutterConfig {
        placement,
        shared,
        hidden_width: N_HIDDEN,
        width: 3,
        batch_norm: true,
        dropout: 0.3,
    };
    for empty in [true, false] {
        check_network(&[0, 1, 2], cutter(CutterPlacement::All, false), true, empty);
    }
    check_network(&[0, 2], cutter(CutterPlacement::All, true), true, true);
    check_network(&[0, 1], cutter(CutterPlacement::Last, false), false, false);
    for kinds in [[0], [1], [2]] {
        check_network(&kinds, cutter(CutterPlacement::First, false), true, true);
        check_network(&kinds, cutter(CutterPlacement::None, false), false, true);
    }
}

/// A bumpy closed band of `4 n` vertices.
fn band(n: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut stream = Stream::new(n as u64, 0, 0, Purpose::Probe);
    let mut bump = || stream.range(0.8, 1.2) as f32;
    let corners = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
    let points = (0..4 * n).map(|v| {
        let [x, y] = corners[v % 4];
        Vec3::new(bump() * x, bump() * y, bump() * (v / 4) as f32)
    });
    let index = |ring: usize, corner: usize| (4 * ring + corner % 4) as u32;
    let quads = (0..n - 1).flat_map(|r| (0..4).map(move |c| (r, c)));
    let faces = quads.flat_map(|(r, c)| {
        let (a, b) = (index(r, c), index(r, c + 1));
        [[a, b, index(r + 1, c)], [b, index(r + 1, c + 1), index(r + 1, c)]]
    });
    (points.collect(), faces.collect())
}

#[test]
fn graph_networks_with_both_losses_and_sampled_neighbours() {
    for (placement, sizes) in
        [(CutterPlacement::All, &[3, 4, 2][..]), (CutterPlacement::Last, &[5])]
    {
        let meshes: Vec<_> = sizes.iter().map(|&n| band(n)).collect();
        let shapes: Vec<_> = meshes
            .iter()
            .enumerate()
            .map(|(i, (points, triangles))| GraphShape {
                points,
                normals: points,
                triangles,
                cutter_mm: [0.1, 0.25, 0.4, 0.3].map(|x| (x * (1 + 3 * i) as f64) % 0.5),
            })
            .collect();
        let batch = GraphBatch::<f64>::new(&shapes, Cube::Box, CutterInput::Millimetres).unwrap();
        let config = GraphSageConfig {
            widths: vec![5, 4],
            n_neighbours: 3,
            head_width: 4,
            cutter: CutterConfig {
                placement,
                shared: false,
                hidden_width: N_HIDDEN,
                width: 3,
                batch_norm: true,
                dropout: 0.3,
            },
            ..GraphSageConfig::default()
        };
        let net = GraphSage::new(&config).unwrap();
        let layout = net.layout();
        let streams = |purpose| -> Vec<_> {
            (0..sizes.len()).map(|i| Stream::new(8, 0, i as u64, purpose)).collect()
        };
        let mut draws = streams(Purpose::Neighbours);
        let means = [0; 2].map(|_| batch.sample(config.n_neighbours, &mut draws));
        assert_ne!(means[0], means[1]);
        let labels: Vec<u8> =
            (0..batch.n_points()).map(|i| u8::from(i.is_multiple_of(3))).collect();
        let run = |params: &[f64], grads: Option<&mut [f64]>| {
            let (mut work, mut buffers) = (GraphWorkspace::default(), layout.init_buffers());
            let mut dropout = streams(Purpose::Dropout);
            let dropout = Some(&mut dropout[..]);
            net.forward_train(params, &mut buffers, &batch, &means, dropout, &mut work);
            let mut d = [Vec::new(), Vec::new()];
            let entropy = CrossEntropy::binary();
            let loss =
                |i: usize, d: &mut Vec<f64>| 0.5 * entropy.loss(&work.logits[i], &labels, 0.5, d);
            let total = loss(0, &mut d[0]) + loss(1, &mut d[1]);
            if let Some(grads) = grads {
                net.backward(params, &batch, &means, [&d[0], &d[1]], &work, grads);
            }
            total
        };
        let params = clear_of_kinks(layout, batch.n_points());
        let report = gradcheck::layer(
            &inputs(layout, &params, &[]),
            |v| vec![run(&v.concat(), None)],
            |v, dy| {
                let mut grads = vec![0.0; layout.n_params()];
                run(&v.concat(), Some(&mut grads));
                grads.iter_mut().for_each(|g| *g *= dy[0]);
                split(layout, &grads)
            },
            &settings(2.5e-5, 12),
        );
        require("graph network", &report);
    }
}
