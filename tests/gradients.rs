//! Backward passes of composite blocks and of whole networks are the derivatives of their forward passes.
//!
//! Central differences in f64, relative error at most 1e-7. Single layers are checked in their own files.
//! No probe comes near a kink of a ReLU, by construction: where batch norm feeds a ReLU over `n` rows, a
//! normalized value is at most `√(n - 1)`, so with weights up to `0.5 / √n` and biases of magnitude 1 and more
//! every input of the ReLU has magnitude 0.5 and more. Every fourth channel is off, in every layer.

#![allow(clippy::print_stdout)]

use deepmill::gradcheck::{self, Case, GradcheckSettings, GradientReport};
use deepmill::loss::CrossEntropy;
use deepmill::model::config::{Cube, CutterConfig, CutterInput, CutterPlacement, InputConfig};
use deepmill::model::cutter_modules::CutterModule;
use deepmill::model::graph::{GraphBatch, GraphShape};
use deepmill::model::graph_sage::{GraphSage, GraphSageConfig};
use deepmill::model::heads::Head;
use deepmill::model::policy::MemoryPolicy;
use deepmill::model::{Batch, Model, UNetConfig};
use deepmill::nn::arena::Arena;
use deepmill::nn::batch_norm::BatchNorm;
use deepmill::nn::blocks::Blocks;
use deepmill::nn::conv::OctreeConv;
use deepmill::nn::deconv::OctreeDeconv;
use deepmill::nn::downsample::Downsample;
use deepmill::nn::layer::Layer;
use deepmill::nn::linear_norm_act::LinearNormAct;
use deepmill::nn::operand::Operand;
use deepmill::nn::params::Layout;
use deepmill::nn::pass::{Backward, Training};
use deepmill::nn::saved::Policy;
use deepmill::nn::strided_conv::{OctreeStridedConv, OutputRows};
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
    Batch::from_normalized(&clouds, &cutters, &input()).unwrap()
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

/// Batch norm over rows of small deviation magnifies rounding, which wants a long step, and curvature, which
/// wants a short one, most of all where all points share a cell; this step balances the two.
const BLOCK_STEP: f64 = 4e-5;
/// The same balance for the batch norm of a cutter module over two shapes, where rounding weighs most: the
/// worst error falls as 1/step from 4e-7 at 1e-5 to 6e-8 at 6e-5, and rises again to 4e-7 at 12e-5.
const MODULE_STEP: f64 = 6e-5;

fn settings(step: f64, max_elements: usize) -> GradcheckSettings {
    GradcheckSettings { step, max_elements, ..GradcheckSettings::default() }
}

fn require(what: &str, report: &GradientReport) {
    println!("{what}: {} elements, worst {}", report.n_checked, report.worst());
    report.require(LIMIT).unwrap();
}

/// Checks a training pass by every matrix of the operand and every tensor.
fn check_layer<L: Layer<f64>>(
    what: &str,
    layer: &L,
    (layout, params): (&Layout, &[f64]),
    geometry: &L::Geometry,
    x: Operand<f64>,
) {
    let case = Case { layout, params, geometry, x, dropout: None };
    require(what, &gradcheck::layer(layer, &case, &settings(BLOCK_STEP, 40)).unwrap());
}

const KINDS: [&[usize]; 4] = [&[0], &[1], &[2], &[0, 1, 2]];

#[test]
fn convolution_norm_and_relu() {
    for kinds in KINDS {
        let octree = octree(kinds);
        let level = &octree.levels[3];
        let n = level.n_nodes();
        for policy in [Policy::Save, Policy::Recompute] {
            let mut layout = Layout::default();
            let block = LinearNormAct {
                linear: OctreeConv::new(&mut layout, "u.conv", 3, 5),
                norm: BatchNorm::new(&mut layout, "u.bn", 5),
                relu: true,
                policy,
            };
            let params = clear_of_kinks(&layout, n);
            let x = gradcheck::probe(n * 3, 1);
            let of = (&layout, &params[..]);
            check_layer("conv, norm, relu", &block, of, &level.conv, Operand::new(&x, 3));
        }
    }
}

#[test]
fn blocks_between_depths() {
    for kinds in KINDS {
        let octree = octree(kinds);
        let (coarse, fine) = (&octree.levels[2], &octree.levels[3]);
        let mut layout = Layout::default();
        let rows = OutputRows::AllNodes;
        let down = LinearNormAct {
            linear: OctreeStridedConv::new(&mut layout, "down.conv", 4, 5, rows),
            norm: BatchNorm::new(&mut layout, "down.bn", 5),
            relu: true,
            policy: Policy::Save,
        };
        let up = LinearNormAct {
            linear: OctreeDeconv::new(&mut layout, "up.deconv", 5, 4),
            norm: BatchNorm::new(&mut layout, "up.bn", 4),
            relu: true,
            policy: Policy::Recompute,
        };
        let params = clear_of_kinks(&layout, fine.n_nodes());
        let of = (&layout, &params[..]);
        let x = gradcheck::probe(fine.n_nodes() * 4, 1);
        check_layer("down", &down, of, coarse, Operand::new(&x, 4));
        let x = gradcheck::probe(coarse.n_nodes() * 5, 2);
        check_layer("up", &up, of, coarse, Operand::new(&x, 5));
    }
}

#[test]
fn downsampling_with_and_without_empty_nodes() {
    for kinds in KINDS {
        for rows in [OutputRows::AllNodes, OutputRows::NonEmpty] {
            let octree = octree(kinds);
            let (coarse, fine) = (&octree.levels[2], &octree.levels[3]);
            let mut layout = Layout::default();
            let down = Downsample::new(&mut layout, "down", (4, 5), rows, Policy::Save);
            let params = clear_of_kinks(&layout, fine.n_nodes());
            let x = gradcheck::probe(fine.n_nodes() * 4, 1);
            let of = (&layout, &params[..]);
            check_layer("downsampling", &down, of, coarse, Operand::new(&x, 4));
        }
    }
}

/// Numbers that an identity shortcut adds to what enters the last ReLU: same sign, no smaller.
fn of_safe_sign(n: usize, c: usize) -> Vec<f64> {
    let x = gradcheck::probe(n * c, 1).into_iter().enumerate();
    x.map(|(i, x)| sign(i % c) * (0.1 + x.abs())).collect()
}

#[test]
fn residual_blocks_with_and_without_change_of_width() {
    for kinds in KINDS {
        for (n_blocks, c_in) in [(1, 4), (1, 6), (2, 4), (2, 6), (3, 4), (3, 6)] {
            let octree = octree(kinds);
            let level = &octree.levels[2];
            let mut layout = Layout::default();
            let policy = MemoryPolicy::default().blocks;
            let blocks = Blocks::new(&mut layout, "stage", n_blocks, (c_in, 4), policy);
            let params = clear_of_kinks(&layout, level.n_nodes());
            let x = of_safe_sign(level.n_nodes(), c_in);
            let of = (&layout, &params[..]);
            check_layer("residual blocks", &blocks, of, &level.conv, Operand::new(&x, c_in));
        }
    }
}

#[test]
fn residual_blocks_of_concatenated_columns() {
    for kinds in KINDS {
        for (widths, n_blocks) in [([3, 2, 2], 1), ([3, 2, 2], 2), ([1, 1, 2], 1)] {
            let octree = octree(kinds);
            let level = &octree.levels[2];
            let (n, shapes, mut layout) = (level.n_nodes(), &level.ranges, Layout::default());
            let policy = MemoryPolicy::default().blocks;
            let width = widths.iter().sum();
            let blocks = Blocks::new(&mut layout, "stage", n_blocks, (width, 4), policy);
            let params = clear_of_kinks(&layout, n);
            // Columns of one sign each, as an identity shortcut wants them.
            let whole = of_safe_sign(n, width);
            let column = |j: usize| whole.iter().skip(j).step_by(width).copied();
            let rows = |first: usize, c: usize, n: usize| -> Vec<f64> {
                let row = |i: usize| (first..first + c).map(move |j| (i, j));
                (0..n).flat_map(row).map(|(i, j)| column(j).nth(i).unwrap()).collect()
            };
            let skip = rows(0, widths[0], n);
            let cutter = rows(widths[0], widths[1], shapes.len());
            let up = rows(widths[0] + widths[1], widths[2], n);
            let parts = [
                Operand::new(&skip, widths[0]),
                Operand::PerShape { x: &cutter, c: widths[1], shapes },
                Operand::new(&up, widths[2]),
            ];
            let of = (&layout, &params[..]);
            let what = "residual blocks of several operands";
            check_layer(what, &blocks, of, &level.conv, Operand::Concat(&parts));
        }
    }
}

/// Without batch norm, the shipped network's way, the first half puts out at most `2.5 / 0.7`; half the weights
/// keep `|W₂ h| ≤ 4 · ¼ · 3.6` below the biases of the second.
#[test]
fn cutter_modules_with_dropout_for_one_and_several_cutters() {
    for batch_norm in [true, false] {
        for n_shapes in [1, 2, 3] {
            let mut layout = Layout::default();
            let config = CutterConfig {
                hidden_width: N_HIDDEN,
                width: 5,
                batch_norm,
                dropout: 0.3,
                ..Default::default()
            };
            let module = CutterModule::new(&mut layout, "fc_module_1", &config).unwrap();
            let mut params = clear_of_kinks(&layout, n_shapes);
            for entry in layout.params.iter().filter(|e| e.name.ends_with(".4.weight")) {
                let factor = if batch_norm { 1.0 } else { 0.5 };
                params[entry.range.clone()].iter_mut().for_each(|w| *w *= factor);
            }
            let stream = |i| Stream::new(5, 0, i, Purpose::Dropout);
            let streams: Vec<_> = (0..n_shapes as u64).map(stream).collect();
            let cutters = batch(&[0, 1, 2]).cutters;
            let case = Case {
                layout: &layout,
                params: &params,
                geometry: &(),
                x: Operand::new(&cutters[..4 * n_shapes], 4),
                dropout: Some(&streams),
            };
            let report = gradcheck::layer(&module, &case, &settings(MODULE_STEP, 40)).unwrap();
            require("cutter module", &report);
        }
    }
}

#[test]
fn heads() {
    for n in [1, 2, 40] {
        let mut layout = Layout::default();
        let head = Head::new(&mut layout, "header", 6, 4, MemoryPolicy::default().head);
        let params = clear_of_kinks(&layout, n);
        let x = gradcheck::probe(n * 6, 1);
        check_layer("head", &head, (&layout, &params), &(), Operand::new(&x, 6));
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
        normalize_empty_parents: empty,
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
        let (arena, dropout) = (Arena::default(), dropout.then_some(&mut streams[..]));
        let pass = model.forward_train(&batch, dropout, &arena);
        let (mut losses, mut d) = (Vec::new(), [Vec::new(), Vec::new()]);
        for head in 0..2 {
            let (logits, entropy) = (&pass.logits[head], CrossEntropy::binary());
            losses.push(0.5 * entropy.loss(logits, &labels[head], 0.5, &mut d[head]));
        }
        if let Some(gradients) = gradients {
            gradients.resize(n_params, 0.0);
            let d = [&d[0][..], &d[1]];
            let inputs = model.backward_to_inputs(&batch, pass, d, gradients, &arena);
            gradients.extend([inputs.features, inputs.cutters].concat());
        }
        losses.iter().sum::<f64>()
    };
    // Errors are relative to gradients of at least a thousandth of the network's greatest, not tensor by
    // tensor: no difference of rounded losses can confirm much smaller ones. Blocks and layers are held to that
    // tensor by tensor.
    let (params, inputs) = all.split_at(n_params);
    let report = gradcheck::function(
        &[("parameters", params), ("inputs", inputs)],
        |v| vec![run(&v.concat(), None)],
        |v, dy| {
            let mut gradient = Vec::new();
            run(&v.concat(), Some(&mut gradient));
            gradient.iter_mut().for_each(|g| *g *= dy[0]);
            let inputs = gradient.split_off(n_params);
            vec![gradient, inputs]
        },
        &GradcheckSettings {
            max_elements: 9 * layout.params.len(),
            ..GradcheckSettings::default()
        },
    );
    require("network", &report.unwrap());
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
fn graph_networks_with_both_losses_and_sampled_neighbors() {
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
        let batch = GraphBatch::<f64>::new(&shapes, Cube::Box, CutterInput::Millimeters).unwrap();
        let config = GraphSageConfig {
            widths: vec![5, 4],
            n_neighbors: 3,
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
        let mut draws = streams(Purpose::Neighbors);
        let means = [0; 2].map(|_| batch.sample(config.n_neighbors, &mut draws));
        assert_ne!(means[0], means[1]);
        let labels: Vec<u8> =
            (0..batch.n_points()).map(|i| u8::from(i.is_multiple_of(3))).collect();
        // All that the loss depends on: parameters, vertex features, cutter lengths.
        let n_params = layout.n_params();
        let run = |v: &[Vec<f64>], gradients: Option<&mut Vec<Vec<f64>>>| {
            let mut batch = batch.clone();
            batch.features.clone_from(&v[1]);
            batch.cutters.clone_from(&v[2]);
            let (mut buffers, mut dropout) = (layout.init_buffers(), streams(Purpose::Dropout));
            let (arena, params, dropout) = (&Arena::default(), &v[0][..], Some(&mut dropout[..]));
            let mut pass = Training { params, buffers: &mut buffers, dropout, arena };
            let forward = net.forward_train(&mut pass, &batch, &means);
            let mut d = [Vec::new(), Vec::new()];
            let entropy = CrossEntropy::binary();
            let loss = |i: usize, d: &mut Vec<f64>| {
                0.5 * entropy.loss(&forward.logits[i], &labels, 0.5, d)
            };
            let total = loss(0, &mut d[0]) + loss(1, &mut d[1]);
            if let Some(gradients) = gradients {
                let mut grads = vec![0.0; n_params];
                let mut pass = Backward::new(params, &mut grads, arena);
                let d = [&d[0][..], &d[1]];
                let inputs = net.backward(&mut pass, &batch, &means, forward, d);
                gradients.extend([grads, inputs.features, inputs.cutters]);
            }
            total
        };
        let params = clear_of_kinks(layout, batch.n_points());
        let inputs: [(&str, &[f64]); 3] =
            [("parameters", &params), ("features", &batch.features), ("cutters", &batch.cutters)];
        let report = gradcheck::function(
            &inputs,
            |v| vec![run(v, None)],
            |v, dy| {
                let mut gradients = Vec::new();
                run(v, Some(&mut gradients));
                gradients.iter_mut().flatten().for_each(|g| *g *= dy[0]);
                gradients
            },
            &GradcheckSettings {
                max_elements: 12 * layout.params.len(),
                ..GradcheckSettings::default()
            },
        );
        require("graph network", &report.unwrap());
    }
}

#[test]
fn losses() {
    let (logits, targets) = (gradcheck::probe(60, 1), (0..20).map(|i| i % 3).collect::<Vec<u8>>());
    let entropy = CrossEntropy { class_weights: vec![1.0, 0.5, 3.0], label_smoothing: 0.1 };
    let report = gradcheck::function(
        &[("logits", &logits)],
        |v| vec![entropy.loss(&v[0], &targets, 1.0, &mut Vec::new())],
        |v, dy| {
            let mut d = Vec::new();
            entropy.loss(&v[0], &targets, dy[0], &mut d);
            vec![d]
        },
        &GradcheckSettings::default(),
    );
    require("cross-entropy", &report.unwrap());
}
