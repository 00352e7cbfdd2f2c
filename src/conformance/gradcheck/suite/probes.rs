//! Shapes, graphs, parameters and masks of the suite, and the arrays that describe a geometry.

use super::ProbeShape;
use crate::Result;
use crate::conformance::gradcheck::fixture::NamedArray;
use crate::model::Batch;
use crate::model::config::InputConfig;
use crate::nn::arena::Arena;
use crate::nn::dropout::Dropout;
use crate::nn::interp::Interpolation;
use crate::nn::layer::Layer;
use crate::nn::neighbor_mean::Neighbors;
use crate::nn::operand::Operand;
use crate::nn::params::Layout;
use crate::nn::pass::Training;
use crate::numeric::rng::{Purpose, Stream};
use crate::octree::{Cloud, KernelMap, OctreeLevel};
use glam::Vec3;
use std::borrow::Borrow;
use std::ops::Range;

/// Hidden channels of the cutter modules.
pub(super) const N_HIDDEN: usize = 4;

fn points(shape: ProbeShape) -> (Vec<Vec3>, Vec<Vec3>) {
    let mut stream = Stream::new(shape as u64, 0, 0, Purpose::Probe);
    let mut cube = |r: f64| Vec3::from_array([0; 3].map(|_| stream.range(-r, r) as f32));
    let on_patch = |p: Vec3| Vec3::new(p.x, p.y, 0.5 * p.x * p.x);
    let points: Vec<Vec3> = match shape {
        ProbeShape::Patch => (0..9).map(|_| on_patch(cube(0.8))).collect(),
        ProbeShape::Point => vec![Vec3::new(0.3, -0.6, 0.1)],
        ProbeShape::Cell => (0..5).map(|_| Vec3::splat(0.4) + cube(0.05)).collect(),
    };
    let normals = points.iter().map(|_| cube(1.0).normalize()).collect();
    (points, normals)
}

pub(super) fn input() -> InputConfig {
    InputConfig { depth: 3, full_depth: 1, point_normals: true, ..InputConfig::default() }
}

/// Lengths of the cutter of shape `i`, all below 0.5.
pub(super) fn cutter(i: usize) -> [f64; 4] {
    [0.1, 0.25, 0.4, 0.3].map(|x| (x * (1 + 3 * i) as f64) % 0.5)
}

pub(super) fn batch(shapes: &[ProbeShape], input: &InputConfig) -> Result<Batch<f64>> {
    let shapes: Vec<_> = shapes.iter().map(|&shape| points(shape)).collect();
    let clouds: Vec<_> = shapes.iter().map(|(p, n)| Cloud::new(p, n)).collect();
    let cutters: Vec<_> = (0..shapes.len()).map(cutter).collect();
    Batch::from_normalized(&clouds, &cutters, input)
}

/// A bumpy closed band of `4 n` vertices.
pub(super) fn band(n: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
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

/// Sign of channel `j` before every ReLU.
pub(super) fn sign(j: usize) -> f64 {
    if j % 4 == 3 { -1.0 } else { 1.0 }
}

/// Parameters that keep every ReLU away from its kink, see the head of the suite; `n` bounds the rows.
pub(super) fn clear_of_kinks(layout: &Layout, n: usize) -> Vec<f64> {
    let mut params: Vec<f64> = layout.init_params(3);
    let mut stream = Stream::new(4, 0, 0, Purpose::Probe);
    for entry in &layout.params {
        let name = entry.name.as_str();
        let module = name.contains("fc_module");
        for (j, v) in params[entry.range.clone()].iter_mut().enumerate() {
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

/// One dropout stream per shape.
pub(super) fn dropout_streams(n: usize, seed: u64) -> Vec<Stream> {
    (0..n as u64).map(|i| Stream::new(seed, 0, i, Purpose::Dropout)).collect()
}

/// Factors of the layers that drop with probability `p` one after another, by name and width.
pub(super) fn masks(
    p: f64,
    streams: &[Stream],
    layers: &[(String, usize)],
) -> Result<Vec<NamedArray>> {
    let (dropout, mut streams) = (Dropout::new(p)?, streams.to_vec());
    let mut mask = |(name, c): &(String, usize)| {
        let (ones, arena) = (vec![1.0; streams.len() * c], &Arena::default());
        let dropout_streams = Some(&mut streams[..]);
        let mut pass = Training { params: &[], buffers: &mut [], dropout: dropout_streams, arena };
        let (y, _) = dropout.forward_train(&mut pass, &(), Operand::new(&ones, *c));
        let meaning = "factors of dropout: 0 or 1 / (1 - p)";
        NamedArray::numbers(name, meaning, &[streams.len(), *c], &y)
    };
    Ok(layers.iter().map(&mut mask).collect())
}

/// A geometry that can be told in arrays.
pub(super) trait ProbeGeometry {
    /// Names begin with `prefix` and a dot.
    fn arrays(&self, prefix: &str) -> Vec<NamedArray>;
}

/// The level as the geometry of a 3×3×3 convolution.
pub(super) struct ConvLevel(pub OctreeLevel);

impl Borrow<KernelMap> for ConvLevel {
    fn borrow(&self) -> &KernelMap {
        &self.0.conv
    }
}

impl ProbeGeometry for () {
    fn arrays(&self, _: &str) -> Vec<NamedArray> {
        Vec::new()
    }
}

impl ProbeGeometry for OctreeLevel {
    fn arrays(&self, prefix: &str) -> Vec<NamedArray> {
        let children = "index among the non-empty nodes, -1 for an empty node; the children of node n are rows \
                        8 children[n] + k, k < 8, of the next depth";
        let neigh = "row of the neighbor at offset k = 9 (dx + 1) + 3 (dy + 1) + (dz + 1), -1 where there is none";
        let neighbors = self.neigh.as_flattened().iter().map(|&row| row.into());
        vec![
            NamedArray::indices(
                format!("{prefix}.keys"),
                "key of each node: shape << 48 | bits of its cell, x highest",
                1,
                self.keys.iter().map(|&key| key as i64),
            ),
            NamedArray::indices(
                format!("{prefix}.children"),
                children,
                1,
                self.children.iter().map(|&child| child.into()),
            ),
            NamedArray::indices(format!("{prefix}.neigh"), neigh, 27, neighbors),
            shape_array(prefix, &self.ranges),
        ]
    }
}

impl ProbeGeometry for ConvLevel {
    fn arrays(&self, prefix: &str) -> Vec<NamedArray> {
        self.0.arrays(prefix)
    }
}

impl ProbeGeometry for Vec<Range<usize>> {
    fn arrays(&self, prefix: &str) -> Vec<NamedArray> {
        vec![shape_array(prefix, self)]
    }
}

impl ProbeGeometry for Interpolation<f64> {
    fn arrays(&self, prefix: &str) -> Vec<NamedArray> {
        let (starts, nodes, weights) = self.lists();
        let mut arrays = list_arrays(prefix, starts, nodes);
        let meaning = "factor of each entry of `sources`";
        arrays.push(NamedArray::numbers(
            format!("{prefix}.weights"),
            meaning,
            &[weights.len()],
            weights,
        ));
        arrays
    }
}

impl ProbeGeometry for Neighbors {
    fn arrays(&self, prefix: &str) -> Vec<NamedArray> {
        let (starts, nodes) = self.lists();
        list_arrays(prefix, starts, nodes)
    }
}

fn list_arrays(prefix: &str, starts: &[usize], sources: &[u32]) -> Vec<NamedArray> {
    let meaning = "row r of the output reads sources[starts[r]..starts[r + 1]]";
    vec![
        NamedArray::indices(
            format!("{prefix}.starts"),
            meaning,
            1,
            starts.iter().map(|&i| i as i64),
        ),
        NamedArray::indices(
            format!("{prefix}.sources"),
            "rows of the input",
            1,
            sources.iter().map(|&row| row.into()),
        ),
    ]
}

pub(super) fn shape_array(prefix: &str, shapes: &[Range<usize>]) -> NamedArray {
    let ends = shapes.iter().flat_map(|rows| [rows.start as i64, rows.end as i64]);
    let meaning = "first row of each shape, and the row after its last";
    NamedArray::indices(format!("{prefix}.shapes"), meaning, 2, ends)
}
