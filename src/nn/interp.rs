//! Interpolation of features from nodes to points, and from one depth to a finer one.
//!
//! Each query point takes a weighted sum of at most eight nodes. Trilinear: with the query in cells,
//! `q = (p + 1)·2^(d−1) − ½`, the nodes at `⌊q⌋` and `⌊q⌋ + 1` along each axis, weighted by
//! `Π (1 − |q − node|)`; cells without a node are left out and the weights divided by
//! (their sum + 1e-12). Nearest: the node that contains the point. A point far from every
//! node gets zeros.

use super::arena::{Arena, Buffer};
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::pass::{Backward, Inference, Training};
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::octree::{Octree, key};
use crate::simd::Isa;
use crate::simd::elementwise::{SparseRows, sparse_rows};
use glam::{UVec3, Vec3};
use std::ops::Range;

/// Query points or nodes per task.
const BLOCK: usize = 256;

/// `y[point] = Σ weight·x[node]` over the nodes that the [`Interpolation`] names: from `[n_nodes, c]` to
/// `[n_points, c]`, for any `c`.
///
/// See [`Interpolation`] for an example.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interpolate;

/// Which nodes each query point reads, with which weights.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::nn::arena::Arena;
/// use deepmill::nn::interp::{Interpolate, Interpolation};
/// use deepmill::nn::{layer::Layer, operand::Operand, pass::Inference};
/// use deepmill::octree::{Cloud, Octree, OctreeOptions};
///
/// let options = OctreeOptions::default().with_depth(1).with_full_depth(1);
/// let octree = Octree::build(&[Cloud::new(&[Vec3::ZERO], &[])], &options)?; // eight nodes, centers at ±½
/// let points = [Vec3::new(0.25, 0.0, -0.5), Vec3::new(0.5, 0.5, 0.5)];
/// let between = Interpolation::linear(&octree, 1, &points, &[0..2]);
/// let x: Vec<f64> = (0..8u8).map(|node| f64::from(node >> 2)).collect(); // 1 in the half of +x
/// let arena = Arena::default();
/// let y = Interpolate.forward(&Inference::new(&[], &[], &arena), &between, Operand::new(&x, 1));
/// assert!((y[0] - 0.75).abs() < 1e-9 && (y[1] - 1.0).abs() < 1e-9); // ¾ of the way from −½ to ½
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Interpolation<T> {
    n_nodes: usize,
    terms: Terms<T>,
}

/// Row `r` is the sum over `starts[r]..starts[r + 1]` of `weights[i]` times row `sources[i]`.
#[derive(Debug, Clone, PartialEq, Default)]
struct Terms<T> {
    starts: Vec<usize>,
    sources: Vec<u32>,
    weights: Vec<T>,
}

impl<T: Scalar> Interpolation<T> {
    /// Trilinear between the nodes of `depth`; the points of shape `s` are `points[ranges[s]]`, in [−1, 1]³.
    /// The faces of the cube are treated as `octree.options().wrap_at_faces` says.
    ///
    /// # Panics
    /// If the octree has no such depth, if the ranges do not cover the points in order, or if a point is not finite.
    pub fn linear(octree: &Octree, depth: usize, points: &[Vec3], ranges: &[Range<usize>]) -> Self {
        Self::new(octree, depth, points, ranges, |shape, point, terms| {
            terms.push_linear(octree, depth, shape, point);
        })
    }

    /// The node of `depth` that contains each point; points and ranges as in [`Interpolation::linear`].
    ///
    /// # Panics
    /// As [`Interpolation::linear`].
    pub fn nearest(
        octree: &Octree,
        depth: usize,
        points: &[Vec3],
        ranges: &[Range<usize>],
    ) -> Self {
        Self::new(octree, depth, points, ranges, |shape, point, terms| {
            terms.sources.extend(octree.locate(depth, shape, point));
            terms.weights.resize(terms.sources.len(), T::ONE);
        })
    }

    /// Trilinear from the nodes of depth `from` to the centers of the nodes of depth `to`.
    ///
    /// # Panics
    /// If the octree has not both depths.
    pub fn between_depths(octree: &Octree, from: usize, to: usize) -> Self {
        let edge = 2.0 / (1u32 << to) as f32;
        let center = |&k: &u64| (UVec3::from(key::decode(k).0).as_vec3() + 0.5) * edge - 1.0;
        let level = &octree.levels[to];
        let centers: Vec<Vec3> = level.keys.iter().map(center).collect();
        Self::linear(octree, from, &centers, &level.ranges)
    }

    fn new(
        octree: &Octree,
        depth: usize,
        points: &[Vec3],
        ranges: &[Range<usize>],
        push: impl Fn(usize, Vec3, &mut Terms<T>) + Sync,
    ) -> Self {
        let ends = ranges.iter().scan(0, |end, r| {
            assert_eq!(r.start, *end, "ranges of points must follow each other");
            *end = r.end;
            Some(r.end)
        });
        let ends: Vec<usize> = ends.collect();
        assert_eq!(ends.last().copied().unwrap_or(0), points.len(), "ranges must cover the points");
        let blocks = par::map_blocks(points.len(), BLOCK, |block| {
            let mut terms = Terms::default();
            for i in block {
                assert!(points[i].is_finite(), "point {i} is {}, which is not finite", points[i]);
                push(ends.partition_point(|&end| end <= i), points[i], &mut terms);
                terms.starts.push(terms.sources.len());
            }
            terms
        });
        let mut terms = Terms { starts: vec![0], ..Terms::default() };
        for block in &blocks {
            terms.starts.extend(block.starts.iter().map(|end| terms.sources.len() + end));
            terms.sources.extend_from_slice(&block.sources);
            terms.weights.extend_from_slice(&block.weights);
        }
        Interpolation { n_nodes: octree.levels[depth].n_nodes(), terms }
    }

    /// Number of query points.
    pub fn n_points(&self) -> usize {
        self.terms.starts.len() - 1
    }

    /// Point `p` is the sum over `i` in `starts[p]..starts[p + 1]` of `weights[i]` times node `nodes[i]`: the three
    /// lists.
    pub(crate) fn lists(&self) -> (&[usize], &[u32], &[T]) {
        let Terms { starts, sources, weights } = &self.terms;
        (starts, sources, weights)
    }

    /// The gradient by `[n_nodes, c]` from that by `[n_points, c]`: what [`Interpolate`] does in the backward pass.
    ///
    /// # Panics
    /// If `dy` has not one row per point.
    pub fn adjoint(&self, arena: &Arena<T>, c: usize, dy: &[T]) -> Buffer<T> {
        assert_eq!(dy.len(), self.n_points() * c, "rows of the gradient and points differ");
        let mut dx = arena.get(self.n_nodes * c);
        self.terms.transposed(self.n_nodes).sum(c, dy, &mut dx);
        dx
    }
}

impl<T: Scalar> Layer<T> for Interpolate {
    type Geometry = Interpolation<T>;
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    fn forward(&self, pass: &Inference<T>, map: &Interpolation<T>, x: Operand<T>) -> Buffer<T> {
        let c = x.width();
        let x = x.to_matrix(pass.arena);
        assert_eq!(x.len(), map.n_nodes * c, "rows of the input and of the octree differ");
        let mut y = pass.arena.get(map.n_points() * c);
        map.terms.sum(c, &x, &mut y);
        y
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        map: &Interpolation<T>,
        x: Operand<T>,
    ) -> (Buffer<T>, ()) {
        (self.forward(&pass.inference(), map, x), ())
    }

    /// `dx[node] = Σ weight·dy[point]`, over the points that read the node, in order.
    fn backward(
        &self,
        pass: &mut Backward<T>,
        map: &Interpolation<T>,
        x: Operand<T>,
        (): (),
        dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let dx = map.adjoint(pass.arena, x.width(), &dy);
        OperandGradient::of_matrix(pass.arena, x, dx)
    }
}

impl<T: Scalar> Terms<T> {
    fn sum(&self, channels: usize, x: &[T], y: &mut [T]) {
        let Terms { starts, sources, weights } = self;
        par::for_each_block(y, BLOCK * channels, |block, y| {
            let n = y.len() / channels;
            let starts = &starts[block * BLOCK..=block * BLOCK + n];
            let rows = SparseRows { starts, sources, weights, x, c: channels, y };
            sparse_rows(Isa::active(), rows);
        });
    }

    /// The same terms listed by source; within one source in the order of rows.
    fn transposed(&self, n_sources: usize) -> Terms<T> {
        let mut starts = vec![0; n_sources + 1];
        self.sources.iter().for_each(|&s| starts[s as usize + 1] += 1);
        (0..n_sources).for_each(|s| starts[s + 1] += starts[s]);
        let mut next = starts.clone();
        let mut sources = vec![0; self.sources.len()];
        let mut weights = vec![T::ZERO; self.weights.len()];
        for (row, range) in self.starts.windows(2).enumerate() {
            for t in range[0]..range[1] {
                let place = &mut next[self.sources[t] as usize];
                (sources[*place], weights[*place]) = (row as u32, self.weights[t]);
                *place += 1;
            }
        }
        Terms { starts, sources, weights }
    }
}

impl<T: Scalar> Terms<T> {
    /// Appends the corners around one point, their weights adding up to one.
    fn push_linear(&mut self, octree: &Octree, depth: usize, shape: usize, point: Vec3) {
        let (half_cells, half) = (T::from_f64(0.5 * f64::from(1u32 << depth)), T::from_f64(0.5));
        let q = point.to_array().map(|p| (T::from_f64(f64::from(p)) + T::ONE) * half_cells - half);
        let base = q.map(|q| q.to_f64().floor());
        let fraction: [T; 3] = std::array::from_fn(|i| q[i] - T::from_f64(base[i]));
        let mask = (1i64 << depth) - 1;
        let cell_along = |axis: usize, step: i64| {
            let cell = (base[axis] as i64).saturating_add(step);
            let inside = cell & mask == cell || octree.options().wrap_at_faces;
            inside.then_some((cell & mask) as u32)
        };
        let cells: [[Option<u32>; 2]; 3] =
            std::array::from_fn(|axis| [cell_along(axis, 0), cell_along(axis, 1)]);
        let weights = fraction.map(|f| [T::ONE - f, f]);
        let first = self.weights.len();
        for corner in 0..8 {
            let [i, j, k] = [corner >> 2, corner >> 1 & 1, corner & 1];
            let (Some(x), Some(y), Some(z)) = (cells[0][i], cells[1][j], cells[2][k]) else {
                continue;
            };
            if let Some(node) = octree.find(depth, shape, [x, y, z]) {
                self.sources.push(node);
                self.weights.push(weights[0][i] * weights[1][j] * weights[2][k]);
            }
        }
        let present = &mut self.weights[first..];
        let total = present.iter().copied().sum::<T>() + T::from_f64(1e-12);
        present.iter_mut().for_each(|weight| *weight /= total);
    }
}

#[cfg(test)]
mod tests {
    use super::super::params::Layout;
    use super::super::testing::{self, large_octree, octrees, require_gradients};
    use super::*;
    use crate::conformance::gradcheck::probe;
    use crate::numeric::rng::{Purpose, Stream};
    use crate::octree::{Cloud, OctreeOptions};

    /// Query points all over the cube, its faces included, for each shape.
    fn queries(octree: &Octree, n: usize) -> (Vec<Vec3>, Vec<Range<usize>>) {
        let mut stream = Stream::new(4, 0, 0, Purpose::Probe);
        let n_points = n * octree.n_shapes();
        let mut coordinate = || (stream.range(-1.1, 1.1) as f32).clamp(-1.0, 1.0);
        let points = (0..n_points).map(|_| Vec3::from_array([0; 3].map(|_| coordinate())));
        (points.collect(), (0..octree.n_shapes()).map(|s| s * n..(s + 1) * n).collect())
    }

    fn forward(map: &Interpolation<f64>, c: usize, x: &[f64]) -> Vec<f64> {
        testing::forward(&Interpolate, &[], map, Operand::new(x, c))
    }

    #[test]
    fn linear_functions_are_reproduced_where_all_corners_exist() {
        let octree = Octree::build(
            &[Cloud::new(&[Vec3::ZERO], &[])],
            &OctreeOptions { depth: 3, full_depth: 3, ..Default::default() },
        )
        .unwrap();
        let value = |p: Vec3| f64::from(1.0 + p.x - 2.0 * p.y + 3.0 * p.z);
        let center = |&k: &u64| UVec3::from(key::decode(k).0).as_vec3() * 0.25 - 0.875;
        let x: Vec<f64> = octree.finest().keys.iter().map(|k| value(center(k))).collect();
        let (points, ranges) = queries(&octree, 500);
        let y = forward(&Interpolation::linear(&octree, 3, &points, &ranges), 1, &x);
        let inside = points.iter().zip(y).filter(|(p, _)| p.abs().max_element() < 0.875);
        assert!(inside.clone().count() > 200);
        inside.for_each(|(&p, y)| assert!((y - value(p)).abs() < 1e-6));
    }

    #[test]
    fn weights_are_renormalized_or_wrapped_at_the_faces() {
        let points = [Vec3::new(1.0, 0.3, 0.3)];
        for wrap_at_faces in [false, true] {
            let options =
                OctreeOptions { depth: 2, full_depth: 2, wrap_at_faces, ..Default::default() };
            let octree = Octree::build(&[Cloud::new(&points, &[])], &options).unwrap();
            let along_x = |k: &u64| f64::from(key::decode(*k).0[0]);
            let x: Vec<f64> = octree.finest().keys.iter().map(along_x).collect();
            let y =
                forward(&Interpolation::linear(&octree, 2, &points, &octree.point_ranges), 1, &x);
            // Half of the weight lies outside; wrapped, it is that of the cell x = 0.
            assert!((y[0] - if wrap_at_faces { 1.5 } else { 3.0 }).abs() < 1e-6);
        }
    }

    #[test]
    fn nearest_takes_the_node_that_holds_the_point_or_nothing() {
        for octree in octrees() {
            let level = octree.finest();
            let (points, ranges) = queries(&octree, 100);
            let x: Vec<f64> = (1..=level.n_nodes()).map(|n| n as f64).collect();
            let map = Interpolation::nearest(&octree, octree.depth(), &points, &ranges);
            for (i, y) in forward(&map, 1, &x).into_iter().enumerate() {
                let node = octree.locate(octree.depth(), i / 100, points[i]);
                assert_eq!(y, node.map_or(0.0, |n| f64::from(n + 1)));
            }
        }
    }

    #[test]
    fn constants_stay_constant_from_depth_to_depth() {
        let octree = &octrees()[3];
        let map = Interpolation::between_depths(octree, 2, 4);
        assert_eq!(map.n_points(), octree.finest().n_nodes());
        let y = forward(&map, 2, &vec![5.0; 2 * octree.levels[2].n_nodes()]);
        assert!(y.iter().all(|y| (y - 5.0).abs() < 1e-9));
    }

    #[test]
    fn gradients_are_right_on_every_kind_of_octree() {
        for octree in octrees() {
            let (points, ranges) = queries(&octree, 40);
            for depth in 1..=octree.depth() {
                for map in [Interpolation::linear, Interpolation::nearest] {
                    let map = map(&octree, depth, &points, &ranges);
                    let x = probe(3 * octree.levels[depth].n_nodes(), 1);
                    let none = (&Layout::default(), &[][..]);
                    require_gradients(&Interpolate, none, &map, Operand::new(&x, 3));
                }
            }
        }
    }

    #[test]
    fn gradients_between_depths_are_right() {
        for octree in octrees() {
            for (from, to) in [(1, 2), (2, 4), (3, 4)] {
                let map = Interpolation::between_depths(&octree, from, to);
                let x = probe(2 * octree.levels[from].n_nodes(), 1);
                let none = (&Layout::default(), &[][..]);
                require_gradients(&Interpolate, none, &map, Operand::new(&x, 2));
                let n_out = 2 * octree.levels[to].n_nodes();
                testing::require_adjoint(&Interpolate, &[], &map, (x.len(), 2), n_out);
            }
        }
    }

    #[test]
    fn backward_is_the_adjoint_on_a_large_octree() {
        let octree = large_octree();
        let (points, ranges) = queries(&octree, 3000);
        let map = Interpolation::linear(&octree, 3, &points, &ranges);
        let (n_in, n_out) = (octree.levels[3].n_nodes() * 2, points.len() * 2);
        testing::require_adjoint(&Interpolate, &[], &map, (n_in, 2), n_out);
    }
}
