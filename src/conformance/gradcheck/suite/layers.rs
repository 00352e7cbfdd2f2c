//! Cases of single layers.

use super::SuiteCase;
use super::case::{InputMatrix, LayerCase, LossCase, LossInput, LossStep};
use super::probes::{ConvLevel, ProbeGeometry, band, dropout_streams, masks};
use crate::Result;
use crate::conformance::gradcheck::fixture::NamedArray;
use crate::conformance::gradcheck::probe;
use crate::learn::loss::CrossEntropy;
use crate::model::config::{Cube, CutterInput};
use crate::model::graph::{Edges, GraphBatch, GraphShape};
use crate::nn::attention::Attention;
use crate::nn::batch_norm::{self, BatchNorm};
use crate::nn::conv::OctreeConv;
use crate::nn::deconv::OctreeDeconv;
use crate::nn::dropout::Dropout;
use crate::nn::group_norm::{self, GroupNorm};
use crate::nn::interp::{Interpolate, Interpolation};
use crate::nn::layer::Layer;
use crate::nn::linear::Linear;
use crate::nn::neighbor_mean::{NeighborMean, Neighbors};
use crate::nn::pad::{Depad, Pad};
use crate::nn::params::Layout;
use crate::nn::pool::{GlobalMeanPool, MaxPool, MeanPool};
use crate::nn::relu::Relu;
use crate::nn::strided_conv::{OctreeStridedConv, OutputRows};
use crate::nn::upsample::NearestUpsample;
use crate::octree::{Octree, OctreeLevel};
use glam::Vec3;
use std::borrow::Borrow;
use std::ops::Range;

/// Depths between which layers work.
pub(super) fn levels(octree: &Octree) -> (&OctreeLevel, &OctreeLevel) {
    (&octree.levels[octree.depth() - 1], octree.finest())
}

/// Matrices side by side: one row per node, one per shape, one per node.
pub(super) fn side_by_side(shapes: &[Range<usize>], [a, b, c]: [usize; 3]) -> Vec<InputMatrix> {
    let n = shapes.last().map_or(0, |rows| rows.end);
    let per_shape = InputMatrix::probe(shapes.len(), b, 4);
    let per_shape = InputMatrix { shapes: Some(shapes.to_vec()), ..per_shape };
    vec![InputMatrix::probe(n, a, 3), per_shape, InputMatrix::probe(n, c, 5)]
}

pub(super) fn cases(octree: &Octree) -> Result<Vec<SuiteCase>> {
    let mut cases = linear_operators(octree);
    cases.extend(norms());
    cases.extend(row_by_row()?);
    cases.extend(between_rows(octree));
    cases.extend(interpolations(octree));
    cases.push(neighbor_mean()?);
    cases.push(attention());
    cases.push(cross_entropy());
    Ok(cases)
}

fn linear_operators(octree: &Octree) -> Vec<SuiteCase> {
    let (coarse, fine) = levels(octree);
    let (n, n_coarse, shapes) = (fine.n_nodes(), coarse.n_nodes(), &fine.ranges);
    let conv = |c_in: usize, x: Vec<InputMatrix>| {
        let build = |layout: &mut Layout| OctreeConv::new(layout, "conv", c_in, 5);
        LayerCase::new(build, ConvLevel(fine.clone()), x, 5)
    };
    let strided = |rows: OutputRows| {
        let build = |layout: &mut Layout| OctreeStridedConv::new(layout, "conv", 3, 4, rows);
        LayerCase::new(build, coarse.clone(), vec![InputMatrix::probe(n, 3, 2)], 4)
    };
    let linear = |c_in: usize, x: Vec<InputMatrix>| {
        let build = |layout: &mut Layout| Linear::new(layout, "linear", c_in, 4, true);
        LayerCase::new(build, (), x, 4)
    };
    let deconv = |layout: &mut Layout| OctreeDeconv::new(layout, "deconv", 4, 3);
    let deconv =
        LayerCase::new(deconv, coarse.clone(), vec![InputMatrix::probe(n_coarse, 4, 2)], 3);
    vec![
        linear(3, vec![InputMatrix::probe(7, 3, 2)]).named("linear", "y = x weight^T + bias"),
        linear(6, side_by_side(&[0..2, 2..5], [3, 1, 2])).named(
            "linear_of_parts",
            "y = [x[0] | x[1] of the row's shape | x[2]] weight^T + bias",
        ),
        conv(3, vec![InputMatrix::probe(n, 3, 2)]).named(
            "octree_conv",
            "y[n] = sum over k of x[neigh[n, k]] weights[k], over the neighbors that exist",
        ),
        conv(6, side_by_side(shapes, [3, 2, 1])).named(
            "octree_conv_of_parts",
            "as octree_conv, of [x[0] | x[1] of the row's shape | x[2]]",
        ),
        strided(OutputRows::AllNodes).named(
            "strided_conv",
            "y[n] = sum over k of x[8 children[n] + k] weights[k]; 0 for empty nodes",
        ),
        strided(OutputRows::NonEmpty)
            .named("strided_conv_nonempty", "the rows of strided_conv of the non-empty nodes"),
        deconv.named("deconv", "y[8 children[n] + k] = weights[k] x[n], for non-empty nodes n"),
    ]
}

fn norms() -> Vec<SuiteCase> {
    let c = 4;
    let with_probes = |layout: &Layout| probe(layout.n_params(), 5);
    let batch_norm = |n: usize| {
        let build = |layout: &mut Layout| BatchNorm::new(layout, "bn", c);
        LayerCase::new(build, (), vec![InputMatrix::probe(n, c, 7)], c).params(with_probes)
    };
    let formula = "y = (x - mean) / sqrt(var + eps) weight + bias, mean and biased var of each column; running \
                   statistics move by momentum, that of the variance to the unbiased one";
    let group_norm = |n_groups: usize| {
        let build = |layout: &mut Layout| GroupNorm::new(layout, "gn", 6, n_groups);
        let x = vec![InputMatrix::probe(13, 6, 7)];
        LayerCase::new(build, vec![0..5, 5..6, 6..13], x, 6).params(with_probes)
    };
    let of_groups = "y = (x - mean) / sqrt(var + eps) weight + bias, mean and biased var over the rows of a shape \
                     and the columns of a group";
    let batch = [
        batch_norm(40).named("batch_norm", formula),
        batch_norm(6).named("batch_norm_few_rows", formula),
        batch_norm(1).named(
            "batch_norm_one_row",
            "as batch_norm, with the running statistics, which stay as they are",
        ),
    ];
    let group = [("group_norm", 2), ("group_norm_of_all", 1), ("group_norm_of_channels", 6)]
        .map(|(name, n)| group_norm(n).named(name, of_groups).constant("n_groups", n as f64));
    let eps = batch.into_iter().map(|case| {
        let momentum = ("momentum", batch_norm::MOMENTUM);
        case.constant("eps", batch_norm::EPS).constant(momentum.0, momentum.1)
    });
    eps.chain(group.map(|case| case.constant("eps", group_norm::EPS))).collect()
}

fn row_by_row() -> Result<Vec<SuiteCase>> {
    let mut clear = InputMatrix::probe(10, 4, 1);
    clear.values.iter_mut().for_each(|x| *x += x.signum() * 0.1);
    let relu = LayerCase::new(|_| Relu, (), vec![clear], 4);
    let (p, streams) = (0.4, dropout_streams(4, 3));
    let mask = masks(p, &streams, &[("dropout.mask".into(), 10)])?;
    let layer = Dropout::new(p)?;
    let dropout = LayerCase::new(|_| layer, (), vec![InputMatrix::probe(4, 10, 1)], 10);
    Ok(vec![
        relu.named("relu", "y = max(x, 0)"),
        dropout.dropout(streams, mask).named("dropout", "y = x mask").constant("p", p),
    ])
}

fn attention() -> SuiteCase {
    let build = |layout: &mut Layout| Attention::new(layout, "attention", 6, 2);
    let shapes = vec![0..5, 5..6, 6..13];
    let case = LayerCase::new(build, shapes, vec![InputMatrix::probe(13, 6, 7)], 6);
    let case = case.params(|layout| probe(layout.n_params(), 5));
    let formula = "y = x + [o_1 | o_2] out.weight^T; [q | k | v] = x qkv.weight^T; o_h = softmax(q_h k_h^T / sqrt(3)) \
                   v_h over the rows of a shape, of columns 3h..3h+3";
    case.named("attention", formula).constant("n_heads", 2.0)
}

/// A layer without parameters of `n` rows.
fn plain<L, G>(
    layer: L,
    geometry: G,
    n: usize,
    name: &'static str,
    formula: &'static str,
) -> SuiteCase
where
    L: Layer<f64> + 'static,
    G: Borrow<L::Geometry> + ProbeGeometry + 'static,
{
    LayerCase::new(|_| layer, geometry, vec![InputMatrix::probe(n, 3, 2)], 3).named(name, formula)
}

fn between_rows(octree: &Octree) -> Vec<SuiteCase> {
    let (coarse, fine) = levels(octree);
    let (n, n_coarse, n_nonempty) = (fine.n_nodes(), coarse.n_nodes(), fine.n_nonempty());
    let level = || coarse.clone();
    vec![
        plain(Pad, fine.clone(), n_nonempty, "pad", "y[n] = x[children[n]]; 0 for empty nodes"),
        plain(Depad, fine.clone(), n, "depad", "y[children[n]] = x[n], for non-empty nodes n"),
        plain(
            MaxPool,
            level(),
            n,
            "max_pool",
            "y[n] = max over k of x[8 children[n] + k], column by column; 0 for empty nodes",
        ),
        plain(
            MeanPool,
            level(),
            n,
            "mean_pool",
            "y[n] = mean over k of x[8 children[n] + k]; 0 for empty nodes",
        ),
        plain(
            GlobalMeanPool,
            fine.clone(),
            n,
            "global_mean_pool",
            "y[s] = mean over the rows n of shape s of x[n], empty nodes included",
        ),
        plain(
            NearestUpsample,
            level(),
            n_coarse,
            "nearest_upsample",
            "y[8 children[n] + k] = x[n], for non-empty nodes n",
        ),
    ]
}

fn interpolations(octree: &Octree) -> Vec<SuiteCase> {
    let (coarse, fine) = levels(octree);
    let (depth, ranges) = (octree.depth(), &octree.point_ranges);
    // Means of the cells' points: as many as there are points, in the cells that hold them.
    let to_cube = 2.0 / (1u32 << depth) as f32;
    let mean = |&node: &u32| octree.leaf_points[node as usize] * to_cube - Vec3::ONE;
    let points: Vec<Vec3> = octree.point_node.iter().map(mean).collect();
    let formula = "y[r] = sum over i in starts[r]..starts[r + 1] of weights[i] x[sources[i]]";
    let (n, n_coarse) = (fine.n_nodes(), coarse.n_nodes());
    let linear = Interpolation::linear(octree, depth, &points, ranges);
    let nearest = Interpolation::nearest(octree, depth, &points, ranges);
    let depths = Interpolation::between_depths(octree, depth - 1, depth);
    vec![
        plain(Interpolate, linear, n, "interpolate_points", formula),
        plain(Interpolate, nearest, n, "interpolate_nearest", formula),
        plain(Interpolate, depths, n_coarse, "interpolate_depths", formula),
    ]
}

fn neighbor_mean() -> Result<SuiteCase> {
    let (points, triangles) = band(3);
    let shape = GraphShape {
        points: &points,
        normals: &points,
        edges: Edges::Faces(&triangles),
        cutter_mm: [1.0; 4],
    };
    let batch = GraphBatch::<f64>::new(&[shape], Cube::Box, CutterInput::Millimeters)?;
    let n = batch.n_points();
    // One vertex without neighbors, at the end.
    let lists = batch.neighbors.iter().map(Vec::as_slice).chain([&[][..]]);
    let neighbors = Neighbors::new(lists);
    let formula =
        "y[v] = mean over i in starts[v]..starts[v + 1] of x[sources[i]]; 0 without neighbors";
    Ok(plain(NeighborMean, neighbors, n + 1, "neighbor_mean", formula))
}

fn cross_entropy() -> SuiteCase {
    let (n, weights) = (20, [1.0, 0.5, 3.0]);
    let entropy = CrossEntropy { class_weights: weights.to_vec(), label_smoothing: 0.1 };
    let targets: Vec<u8> = (0..n).map(|i| i % 3).collect();
    let classes = targets.iter().map(|&target| target.into());
    let fixed = vec![
        NamedArray::indices("fixed.targets", "class of each row", 1, classes),
        NamedArray::numbers("fixed.class_weights", "weight of each class", &[3], &weights),
    ];
    let run = move |v: &[Vec<f64>], _: bool| {
        let mut d = Vec::new();
        let loss = entropy.loss(&v[0], &targets, 1.0, &mut d);
        LossStep { loss, gradients: vec![d], buffers: Vec::new(), outputs: Vec::new() }
    };
    let values = probe(3 * usize::from(n), 1);
    let logits = LossInput { name: "logits", shape: vec![usize::from(n), 3], values };
    let layout = Layout::default();
    let case = LossCase {
        layout,
        inputs: vec![logits],
        fixed,
        run: Box::new(run),
        max_elements: usize::MAX,
    };
    case.named("cross_entropy", "PyTorch's cross_entropy with class weights and label smoothing")
        .constant("label_smoothing", 0.1)
}
