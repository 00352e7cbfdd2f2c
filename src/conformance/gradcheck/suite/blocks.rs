//! Cases of blocks: a linear operator with batch norm and ReLU, residual blocks, heads, cutter modules.

use super::SuiteCase;
use super::case::{InputMatrix, LayerCase};
use super::layers::{levels, side_by_side};
use super::probes::{
    ConvLevel, N_HIDDEN, ProbeGeometry, clear_of_kinks, cutter, dropout_streams, masks, sign,
};
use crate::Result;
use crate::model::config::CutterConfig;
use crate::model::cutter_modules::{CutterModule, N_LENGTHS};
use crate::model::heads::{Head, N_CLASSES};
use crate::model::policy::MemoryPolicy;
use crate::nn::batch_norm::BatchNorm;
use crate::nn::blocks::Blocks;
use crate::nn::conv::OctreeConv;
use crate::nn::deconv::OctreeDeconv;
use crate::nn::downsample::Downsample;
use crate::nn::layer::Layer;
use crate::nn::linear::Linear;
use crate::nn::linear_norm_act::LinearNormAct;
use crate::nn::params::Layout;
use crate::nn::residual::Residual;
use crate::nn::saved::Policy;
use crate::nn::strided_conv::{OctreeStridedConv, OutputRows};
use crate::octree::{Octree, OctreeLevel};
use std::borrow::Borrow;

/// Batch norm over rows of small deviation magnifies rounding, which wants a long step, and curvature, which
/// wants a short one, most of all where all points share a cell; this step balances the two.
const BLOCK_STEP: f64 = 4e-5;
/// The same balance for the batch norm of a cutter module over two shapes, where rounding weighs most: the
/// worst error falls as 1/step from 4e-7 at 1e-5 to 6e-8 at 6e-5, and rises again to 4e-7 at 12e-5.
const MODULE_STEP: f64 = 6e-5;

pub(super) fn cases(octree: &Octree, policy: &MemoryPolicy) -> Result<Vec<SuiteCase>> {
    let mut cases = normalized(octree, policy);
    cases.extend(residual(&levels(octree).0.clone(), policy));
    cases.extend(heads(policy));
    cases.push(cutter_module(octree.n_shapes(), true)?);
    cases.push(cutter_module(octree.n_shapes(), false)?);
    Ok(cases)
}

/// A block whose input ReLUs see only behind batch norm.
fn block<L: Layer<f64> + 'static, G: Borrow<L::Geometry> + ProbeGeometry + 'static>(
    build: impl FnOnce(&mut Layout) -> L,
    geometry: G,
    x: Vec<InputMatrix>,
    (c_out, n): (usize, usize),
) -> LayerCase {
    let case = LayerCase::new(build, geometry, x, c_out);
    case.params(|layout| clear_of_kinks(layout, n)).step(BLOCK_STEP)
}

/// A linear operator of `c_out` columns with batch norm and ReLU.
fn norm_act<M>(
    linear: impl FnOnce(&mut Layout) -> M,
    c_out: usize,
    policy: Policy,
) -> impl FnOnce(&mut Layout) -> LinearNormAct<M> {
    move |layout| LinearNormAct {
        linear: linear(layout),
        norm: BatchNorm::new(layout, "stage.bn", c_out),
        relu: true,
        policy,
    }
}

fn normalized(octree: &Octree, policy: &MemoryPolicy) -> Vec<SuiteCase> {
    let (coarse, fine) = levels(octree);
    let (n, n_coarse) = (fine.n_nodes(), coarse.n_nodes());
    let conv = |layout: &mut Layout| OctreeConv::new(layout, "stage.conv", 3, 5);
    let linear = |layout: &mut Layout| Linear::new(layout, "stage.linear", 3, 5, false);
    let deconv = |layout: &mut Layout| OctreeDeconv::new(layout, "stage.deconv", 5, 4);
    let rows = OutputRows::AllNodes;
    let strided = |layout: &mut Layout| OctreeStridedConv::new(layout, "stage.conv", 4, 5, rows);
    let downsample = |rows: OutputRows| {
        let build =
            |layout: &mut Layout| Downsample::new(layout, "stage", (4, 5), rows, policy.down);
        block(build, coarse.clone(), vec![InputMatrix::probe(n, 4, 1)], (5, n))
    };
    let x = |n: usize, c: usize| vec![InputMatrix::probe(n, c, 1)];
    let conv = block(norm_act(conv, 5, policy.stem), ConvLevel(fine.clone()), x(n, 3), (5, n));
    let linear = block(norm_act(linear, 5, policy.head), (), x(20, 3), (5, 20));
    let strided = block(norm_act(strided, 5, policy.down), coarse.clone(), x(n, 4), (5, n));
    let deconv = block(norm_act(deconv, 4, policy.up), coarse.clone(), x(n_coarse, 5), (4, n));
    vec![
        linear.named("linear_norm_relu", "y = relu(bn(linear(x)))"),
        conv.named("conv_norm_relu", "y = relu(bn(octree_conv(x)))"),
        strided.named("strided_conv_norm_relu", "y = relu(bn(strided_conv(x)))"),
        deconv.named("deconv_norm_relu", "y = relu(bn(deconv(x)))"),
        downsample(OutputRows::AllNodes).named("downsample", "y = relu(bn(strided_conv(x)))"),
        downsample(OutputRows::NonEmpty)
            .named("downsample_nonempty", "y = pad(relu(bn(strided_conv_nonempty(x))))"),
    ]
}

/// Columns of one sign each, so that what an identity shortcut adds to the last ReLU takes nothing away.
fn of_safe_sign(mut x: Vec<InputMatrix>) -> Vec<InputMatrix> {
    let mut start = 0;
    for matrix in &mut x {
        let c = matrix.c;
        for (i, x) in matrix.values.iter_mut().enumerate() {
            *x = sign(start + i % c) * (0.1 + x.abs());
        }
        start += c;
    }
    x
}

fn residual(level: &OctreeLevel, policy: &MemoryPolicy) -> Vec<SuiteCase> {
    let n = level.n_nodes();
    let rows = |c: usize| of_safe_sign(vec![InputMatrix::probe(n, c, 1)]);
    let parts = |widths: [usize; 3]| of_safe_sign(side_by_side(&level.ranges, widths));
    let width = |x: &[InputMatrix]| x.iter().map(|x| x.c).sum::<usize>();
    let single = |x: Vec<InputMatrix>| {
        let (c, policy) = (width(&x), policy.blocks.block);
        let build = |layout: &mut Layout| Residual::new(layout, "block", c, 4, policy);
        block(build, ConvLevel(level.clone()), x, (4, n))
    };
    let several = |n_blocks: usize, x: Vec<InputMatrix>| {
        let (c, policy) = (width(&x), policy.blocks);
        let build = |layout: &mut Layout| Blocks::new(layout, "stage", n_blocks, (c, 4), policy);
        block(build, ConvLevel(level.clone()), x, (4, n))
    };
    let one = "y = relu(bn_b(conv_b(relu(bn_a(conv_a(x))))) + shortcut(x)), the shortcut the identity or, where the \
               width changes, bn(linear(x))";
    let more = "residual blocks one after another, the first with a shortcut of its own where the width changes";
    let of_parts = "as residual, of [x[0] | x[1] of the row's shape | x[2]]";
    vec![
        single(rows(4)).named("residual", one),
        single(rows(6)).named("residual_shortcut", one),
        single(parts([1, 1, 2])).named("residual_of_parts", of_parts),
        single(parts([3, 2, 2])).named("residual_shortcut_of_parts", of_parts),
        several(2, rows(4)).named("blocks_2", more),
        several(2, rows(6)).named("blocks_2_shortcut", more),
        several(3, rows(4)).named("blocks_3", more),
        several(3, rows(6)).named("blocks_3_shortcut", more),
        several(2, parts([3, 2, 2]))
            .named("blocks_of_parts", "as blocks_2, of [x[0] | x[1] of the row's shape | x[2]]"),
    ]
}

fn heads(policy: &MemoryPolicy) -> Vec<SuiteCase> {
    let head = |n: usize| {
        let build = |layout: &mut Layout| Head::new(layout, "header", 6, 4, policy.head);
        block(build, (), vec![InputMatrix::probe(n, 6, 1)], (N_CLASSES, n))
    };
    let formula = "y = linear(relu(bn(linear_without_bias(x))))";
    vec![
        head(40).named("head", formula),
        head(2).named("head_two_rows", formula),
        head(1).named("head_one_row", formula),
    ]
}

/// Without batch norm, the shipped network's way, the first half puts out at most `2.5 / 0.7`; half the weights
/// keep `|W₂ h| ≤ 4 · ¼ · 3.6` below the biases of the second.
fn cutter_module(n_shapes: usize, batch_norm: bool) -> Result<SuiteCase> {
    let (width, p) = (5, 0.3);
    let config = CutterConfig {
        hidden_width: N_HIDDEN,
        width,
        batch_norm,
        dropout: p,
        ..Default::default()
    };
    let params = |layout: &Layout| {
        let mut params = clear_of_kinks(layout, n_shapes);
        for entry in layout.params.iter().filter(|e| e.name.ends_with(".4.weight")) {
            let factor = if batch_norm { 1.0 } else { 0.5 };
            params[entry.range.clone()].iter_mut().for_each(|w| *w *= factor);
        }
        params
    };
    let values = (0..n_shapes).flat_map(cutter).collect();
    let x = vec![InputMatrix { values, c: N_LENGTHS, shapes: None }];
    let streams = dropout_streams(n_shapes, 5);
    let widths = [("dropout.first".into(), N_HIDDEN), ("dropout.second".into(), width)];
    let masks = masks(p, &streams, &widths)?;
    let mut layout = Layout::default();
    let module = CutterModule::new(&mut layout, "fc_module_1", &config)?;
    let case = LayerCase::new(|of_case| (*of_case = layout, module).1, (), x, width);
    let case = case.params(params).step(MODULE_STEP).dropout(streams, masks);
    let (name, formula) = match batch_norm {
        true => ("cutter_module", "twice: y = bn(relu(linear(x))) mask"),
        false => ("cutter_module_without_norm", "twice: y = relu(linear(x)) mask"),
    };
    Ok(case.named(name, formula).constant("p", p))
}
