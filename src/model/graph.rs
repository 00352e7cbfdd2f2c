//! A batch of graphs, of meshes or of sites, in the form of a graph network's input.

use super::batch::cutter_input;
use super::config::{Cube, CutterInput};
use super::cutter_modules::N_LENGTHS;
use crate::exec::par;
use crate::nn::neighbor_mean::Neighbors;
use crate::numeric::rng::Stream;
use crate::numeric::scalar::Scalar;
use crate::octree::Normalization;
use crate::spatial::KdTree;
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use std::ops::Range;

/// Channels of a vertex: position and normal.
pub const N_FEATURES: usize = 6;

/// Which vertices are neighbors.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Edges<'a> {
    /// Corner indices of each face; its three edges join neighbors.
    Faces(&'a [[u32; 3]]),
    /// The so many nearest others of each vertex, by distance, then by index: for sites without a mesh.
    Nearest(usize),
}

/// The vertices of one graph, in millimeters, and the edges between them.
#[derive(Debug, Clone, Copy)]
pub struct GraphShape<'a> {
    /// Vertices, mm.
    pub points: &'a [Vec3],
    /// Outward unit normals, one per vertex.
    pub normals: &'a [Vec3],
    /// The edges.
    pub edges: Edges<'a>,
    /// CR, CH, FR, FH of the cutter, mm.
    pub cutter_mm: [f64; N_LENGTHS],
}

/// Several graphs, ready for a graph network.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct GraphBatch<T> {
    /// Normalized position and normal of every vertex, `[n, 6]`.
    pub features: Vec<T>,
    /// Neighbors of every vertex, ascending.
    pub neighbors: Vec<Vec<u32>>,
    /// The same lists as a layer takes them.
    pub all: Neighbors,
    /// Vertices of each shape.
    pub shapes: Vec<Range<usize>>,
    /// Cutter lengths as the network takes them, `[n_shapes, 4]`.
    pub cutters: Vec<T>,
    /// The neighbors that each layer takes the mean over in training, see [`GraphBatch::sample`]; inference takes all.
    pub samples: Vec<Neighbors>,
}

impl<T: Scalar> GraphBatch<T> {
    /// Normalizes each shape and joins the graphs.
    ///
    /// # Errors
    /// If a shape has no vertices, not one normal per vertex, a number that is not finite, or a face with
    /// a corner that is not a vertex.
    pub fn new(shapes: &[GraphShape], cube: Cube, cutter: CutterInput) -> Result<Self> {
        let (mut features, mut neighbors) = (Vec::new(), Vec::new());
        let (mut ranges, mut cutters) = (Vec::new(), Vec::new());
        for (i, shape) in shapes.iter().enumerate() {
            check(i, shape)?;
            let transform = Normalization::from(cube).transform(shape.points)?;
            for (point, normal) in shape.points.iter().zip(shape.normals) {
                let numbers = [transform.apply(*point).to_array(), normal.to_array()];
                features.extend(numbers.as_flattened().iter().map(|&x| T::from_f64(f64::from(x))));
            }
            let lengths = shape.cutter_mm.map(|mm| cutter_input(cutter, mm, &transform));
            cutters.extend(lengths.map(T::from_f64));
            let start = neighbors.len();
            neighbors.extend(neighbors_of(shape, start as u32));
            ranges.push(start..neighbors.len());
        }
        let all = Neighbors::new(neighbors.iter().map(Vec::as_slice));
        Ok(GraphBatch { features, neighbors, all, shapes: ranges, cutters, samples: Vec::new() })
    }

    /// Number of vertices over all shapes.
    pub fn n_points(&self) -> usize {
        self.neighbors.len()
    }

    /// At most `n_neighbors` neighbors of each vertex, drawn without repetition; shape `i` draws from
    /// `streams[i]`.
    pub fn sample(&self, n_neighbors: usize, streams: &mut [Stream]) -> Neighbors {
        let mut lists = self.neighbors.clone();
        for (shape, stream) in self.shapes.iter().zip(streams) {
            for list in lists[shape.clone()].iter_mut().filter(|list| list.len() > n_neighbors) {
                for i in 0..n_neighbors {
                    let other = i + stream.below(list.len() - i);
                    list.swap(i, other);
                }
                list.truncate(n_neighbors);
                list.sort_unstable();
            }
        }
        Neighbors::new(lists.iter().map(Vec::as_slice))
    }
}

/// Ascending lists; the first vertex is number `start`.
fn neighbors_of(shape: &GraphShape, start: u32) -> Vec<Vec<u32>> {
    match shape.edges {
        Edges::Faces(triangles) => joined_by_faces(shape.points.len(), triangles, start),
        Edges::Nearest(k) => nearest(shape.points, k, start),
    }
}

/// Vertices per parallel task.
const BLOCK: usize = 256;

fn nearest(points: &[Vec3], k: usize, start: u32) -> Vec<Vec<u32>> {
    let points: Vec<DVec3> = points.iter().map(|p| p.as_dvec3()).collect();
    let tree = KdTree::build(&points);
    let list = |i: usize| {
        let mut list = tree.k_nearest(points[i], k, |j| j as usize != i);
        list.iter_mut().for_each(|j| *j += start);
        list.sort_unstable();
        list
    };
    par::map_blocks(points.len(), BLOCK, |range| range.map(list).collect::<Vec<_>>()).concat()
}

fn joined_by_faces(n: usize, triangles: &[[u32; 3]], start: u32) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); n];
    for corners in triangles {
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            lists[a as usize].push(start + b);
            lists[b as usize].push(start + a);
        }
    }
    for list in &mut lists {
        list.sort_unstable();
        list.dedup();
    }
    lists
}

fn check(i: usize, shape: &GraphShape) -> Result<()> {
    let n = shape.points.len();
    let place = format!("shape {i}");
    if shape.normals.len() != n {
        let found = format!("{} normals for {n} vertices", shape.normals.len());
        return Err(Error::geometry(place, found, "give each vertex a normal"));
    }
    if let Some(v) = shape.normals.iter().position(|normal| !normal.is_finite()) {
        let found = format!("the normal of vertex {v} is not finite");
        return Err(Error::geometry(place, found, "remove or repair it"));
    }
    let Edges::Faces(triangles) = shape.edges else { return Ok(()) };
    match triangles.as_flattened().iter().find(|&&corner| corner as usize >= n) {
        None => Ok(()),
        Some(corner) => {
            let found = format!("a face has corner {corner} of {n} vertices");
            Err(Error::geometry(place, found, "give the faces of these vertices"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::arena::Arena;
    use crate::nn::layer::Layer;
    use crate::nn::neighbor_mean::NeighborMean;
    use crate::nn::operand::Operand;
    use crate::nn::pass::Inference;
    use crate::numeric::rng::Purpose;

    fn tetrahedron() -> ([Vec3; 4], [[u32; 3]; 4]) {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        (points, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    }

    #[test]
    fn edges_join_the_vertices_of_each_shape() {
        let (points, triangles) = tetrahedron();
        let shape = GraphShape {
            points: &points,
            normals: &points,
            edges: Edges::Faces(&triangles),
            cutter_mm: [0.25, 0.5, 0.75, 2.5],
        };
        let batch =
            GraphBatch::<f64>::new(&[shape, shape], Cube::Box, CutterInput::Scaled).unwrap();
        assert_eq!(batch.neighbors[1], [0, 2, 3]);
        assert_eq!(batch.neighbors[6], [4, 5, 7]);
        assert_eq!(batch.shapes, [0..4, 4..8]);
        assert_eq!(batch.cutters[..4], [0.5, 1.0, 1.5, 4.0], "at most 4");
        let mut streams = [0, 1].map(|i| Stream::new(1, 0, i, Purpose::Neighbors));
        let (ones, arena) = (vec![1.0; 48], &Arena::default());
        let pass = Inference { params: &[], buffers: &[], arena };
        let x = Operand::new(&ones, N_FEATURES);
        let y = NeighborMean.forward(&pass, &batch.sample(2, &mut streams), x);
        assert_eq!(y[..], ones);
    }

    #[test]
    fn sites_are_joined_to_the_nearest_of_their_own_shape() {
        let line = [0.0, 1.0, 2.5, 9.0].map(|x| Vec3::X * x);
        let shape = |n: usize| GraphShape {
            points: &line[..n],
            normals: &[Vec3::Z; 4][..n],
            edges: Edges::Nearest(2),
            cutter_mm: [1.0; 4],
        };
        let shapes = [shape(4), shape(2), shape(1)];
        let batch = GraphBatch::<f64>::new(&shapes, Cube::Box, CutterInput::Scaled).unwrap();
        let expected: [&[u32]; 7] = [&[1, 2], &[0, 2], &[0, 1], &[1, 2], &[5], &[4], &[]];
        assert_eq!(batch.neighbors, expected);
    }

    #[test]
    fn faces_of_other_vertices_are_refused() {
        let (points, _) = tetrahedron();
        let shape = GraphShape {
            points: &points,
            normals: &points[..3],
            edges: Edges::Faces(&[[0, 1, 9]]),
            cutter_mm: [1.0; 4],
        };
        let build = |shape| GraphBatch::<f32>::new(&[shape], Cube::Box, CutterInput::Scaled);
        assert!(build(shape).unwrap_err().to_string().contains("3 normals for 4 vertices"));
        let shape = GraphShape { normals: &points, ..shape };
        assert!(build(shape).unwrap_err().to_string().contains("corner 9"));
    }
}
