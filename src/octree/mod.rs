//! Sparse octrees: keys, construction, neighbors, batches and kernel maps.
//!
//! An [`Octree`] covers the cube [−1, 1]³ of every shape of a batch. Depth `d` has cells of edge
//! `2^(1−d)`. Depths up to `full_depth` hold all `8^d` nodes; below, every node that contains a point
//! has exactly eight children, empty ones included. Nodes of a depth are sorted by key, so shape after
//! shape, and the children of one node are eight consecutive rows. Features of a depth are matrices
//! `[n_nodes, c]` in that order, empty nodes included.
//!
//! Building is one sort of the points, then one pass per depth: O(n log n + nodes).

mod build;
mod cloud;
mod feature;
pub mod kernel_map;
pub mod key;
mod neighbors;
pub mod normalize;
mod options;

pub use cloud::Cloud;
pub use feature::Features;
pub use kernel_map::KernelMap;
pub use normalize::{CubeTransform, Normalization, Preparation, Prepared};
pub use options::{MAX_DEPTH, OctreeOptions};

use glam::Vec3;
use std::ops::Range;

/// All nodes of one depth, over the whole batch.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct OctreeLevel {
    /// Key of every node ([`key`]), ascending.
    pub keys: Vec<u64>,
    /// Index of every node among the non-empty nodes of its depth, −1 for an empty one; its children
    /// are rows `8·children[n] ..= 8·children[n] + 7` of the next depth. Above `full_depth` every node
    /// counts as non-empty.
    pub children: Vec<i32>,
    /// Rows of the 3×3×3 nodes around every node, −1 where there is none: entry
    /// `9(dx+1) + 3(dy+1) + (dz+1)` is the node displaced by `(dx, dy, dz)` cells; entry 13 is itself.
    pub neigh: Vec<[i32; 27]>,
    /// Rows of the non-empty nodes, ascending: the inverse of `children`.
    pub nonempty: Vec<u32>,
    /// Rows of each shape.
    pub ranges: Vec<Range<usize>>,
    /// `neigh` as compacted lists: what a 3×3×3 convolution at this depth runs over.
    pub conv: KernelMap,
    /// From index among the non-empty nodes to row, one offset: pads, and gathers children to parents.
    pub pad: KernelMap,
    /// The inverse of `pad`: drops empty rows, and spreads parents to children.
    pub depad: KernelMap,
}

impl OctreeLevel {
    /// Number of nodes, empty ones included.
    pub fn n_nodes(&self) -> usize {
        self.keys.len()
    }

    /// Number of nodes that contain points (above `full_depth`: all).
    pub fn n_nonempty(&self) -> usize {
        self.nonempty.len()
    }

    /// Shape to which row `n` belongs.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn shape_of(&self, n: usize) -> usize {
        key::decode(self.keys[n]).1
    }
}

/// A batch of octrees over one list of points.
#[derive(Debug, Clone, PartialEq)]
pub struct Octree {
    options: OctreeOptions,
    /// One entry per depth, `0..=depth`.
    pub levels: Vec<OctreeLevel>,
    /// For each point, the index among the non-empty finest nodes of the node that contains it.
    pub point_node: Vec<u32>,
    /// Points of each shape in the joint list of points.
    pub point_ranges: Vec<Range<usize>>,
    /// Mean point of each non-empty finest node, in finest cells from the cube's corner, `[0, 2^depth]`.
    pub(crate) leaf_points: Vec<Vec3>,
    /// Mean normal of each non-empty finest node, of length 1 or, where normals cancel, 0; empty if the
    /// clouds have no normals.
    pub(crate) leaf_normals: Vec<Vec3>,
}

impl Octree {
    /// The options it was built with.
    pub fn options(&self) -> &OctreeOptions {
        &self.options
    }

    /// Finest depth.
    pub fn depth(&self) -> usize {
        self.options.depth
    }

    /// Number of shapes.
    pub fn n_shapes(&self) -> usize {
        self.point_ranges.len()
    }

    /// Number of points over all shapes.
    pub fn n_points(&self) -> usize {
        self.point_node.len()
    }

    /// The nodes of the finest depth.
    pub fn finest(&self) -> &OctreeLevel {
        &self.levels[self.options.depth]
    }

    /// Row at `depth` of the node with integer coordinates `cell`, each below `2^depth`; `None` where
    /// there is no node, as beyond the cube. Takes at most `depth` steps.
    ///
    /// # Panics
    /// If the octree has no such depth or no such shape.
    pub fn find(&self, depth: usize, shape: usize, cell: [u32; 3]) -> Option<u32> {
        assert!(depth <= self.depth(), "depth {depth} of an octree of depth {}", self.depth());
        assert!(shape < self.n_shapes(), "shape {shape} of {}", self.n_shapes());
        if cell.iter().any(|&c| c >> depth != 0) {
            return None;
        }
        let full = self.options.full_depth.min(depth);
        let key = key::encode(cell, 0);
        let mut row =
            self.levels[full].ranges[shape].start + (key >> (3 * (depth - full))) as usize;
        for d in full..depth {
            let group = usize::try_from(self.levels[d].children[row]).ok()?;
            row = 8 * group + (key >> (3 * (depth - d - 1)) & 7) as usize;
        }
        Some(row as u32)
    }

    /// Row at `depth` of the node of `shape` that contains `point`, given in [−1, 1]³; `None` outside
    /// the cube or where there is no node.
    ///
    /// # Panics
    /// If the octree has no such depth or no such shape.
    pub fn locate(&self, depth: usize, shape: usize, point: Vec3) -> Option<u32> {
        self.find(depth, shape, key::cell(point, depth)?)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};
    use std::collections::HashMap;

    /// `n` points on a wavy sheet with their normals: a surface, with many empty nodes.
    pub(crate) fn sheet(n: usize, seed: u64) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut stream = Stream::new(seed, 0, 0, Purpose::Probe);
        let points = (0..n).map(|_| {
            let [x, y] = [0; 2].map(|_| stream.range(-0.9, 0.9) as f32);
            Vec3::new(x, y, 0.4 * x * x - 0.3 * y + 0.1 * seed as f32)
        });
        let points: Vec<Vec3> = points.collect();
        let normals = points.iter().map(|p| Vec3::new(-0.8 * p.x, 0.3, 1.0).normalize()).collect();
        (points, normals)
    }

    /// The octree of several sheets with these numbers of points.
    pub(crate) fn sheets(sizes: &[usize], options: &OctreeOptions) -> Octree {
        let shapes: Vec<_> = sizes.iter().enumerate().map(|(i, &n)| sheet(n, i as u64)).collect();
        let clouds: Vec<_> = shapes.iter().map(|(p, n)| Cloud::new(p, n)).collect();
        Octree::build(&clouds, options).unwrap()
    }

    fn options(depth: usize, full_depth: usize) -> OctreeOptions {
        OctreeOptions { depth, full_depth, ..OctreeOptions::default() }
    }

    /// Every statement of the documentation, by search in hash maps.
    fn assert_well_formed(octree: &Octree) {
        let full = octree.options().full_depth;
        for (d, level) in octree.levels.iter().enumerate() {
            assert!(level.keys.windows(2).all(|w| w[0] < w[1]));
            let row_of: HashMap<u64, i32> =
                level.keys.iter().enumerate().map(|(n, &k)| (k, n as i32)).collect();
            let mut n_nonempty = 0;
            for (n, &key) in level.keys.iter().enumerate() {
                let (cell, shape) = key::decode(key);
                assert!(level.ranges[shape].contains(&n));
                assert_eq!(octree.find(d, shape, cell), Some(n as u32));
                if level.children[n] >= 0 {
                    assert_eq!(level.children[n], n_nonempty);
                    assert_eq!(level.nonempty[n_nonempty as usize], n as u32);
                    if let Some(finer) = octree.levels.get(d + 1) {
                        let first = 8 * n_nonempty as usize;
                        assert!((0..8).all(|o| finer.keys[first + o] == key::child(key, o as u64)));
                    }
                    n_nonempty += 1;
                }
                for k in 0..27 {
                    let at = [k / 9, k / 3 % 3, k % 3];
                    let at = std::array::from_fn(|i| (cell[i] + at[i]).wrapping_sub(1));
                    let inside = at.iter().all(|&c| c >> d == 0);
                    let expected = if inside { row_of.get(&key::encode(at, shape)) } else { None };
                    assert_eq!(level.neigh[n][k as usize], expected.copied().unwrap_or(-1));
                }
            }
            assert_eq!(level.n_nonempty(), n_nonempty as usize);
            if d <= full {
                assert_eq!(level.n_nodes(), octree.n_shapes() << (3 * d));
            } else {
                assert_eq!(level.n_nodes(), 8 * octree.levels[d - 1].n_nonempty());
            }
        }
    }

    #[test]
    fn octrees_of_every_depth_are_well_formed() {
        for (depth, full) in [(1, 0), (1, 1), (2, 2), (3, 0), (4, 2), (5, 2), (6, 3), (10, 2)] {
            let octree = sheets(&[400, 1, 90], &options(depth, full));
            assert_well_formed(&octree);
            assert_eq!((octree.n_shapes(), octree.n_points()), (3, 491));
        }
    }

    #[test]
    fn degenerate_shapes_are_well_formed() {
        let one_cell = vec![Vec3::new(0.11, 0.12, 0.13); 50];
        let corners = [Vec3::NEG_ONE, Vec3::ONE];
        for depth in [1, 5, 10] {
            for points in [&one_cell[..], &one_cell[..1], &corners] {
                let normals = vec![Vec3::Y; points.len()];
                let octree =
                    Octree::build(&[Cloud::new(points, &normals)], &options(depth, 1)).unwrap();
                assert_well_formed(&octree);
                let (distinct, last) = if points.len() == 2 { (2, 1) } else { (1, 0) };
                assert_eq!(octree.finest().n_nonempty(), distinct);
                assert_eq!(octree.point_node.last(), Some(&last));
            }
        }
    }

    #[test]
    fn points_lie_in_their_nodes() {
        let octree = sheets(&[700, 300], &options(6, 2));
        for (shape, range) in octree.point_ranges.iter().enumerate() {
            let (points, _) = sheet(range.len(), shape as u64);
            for (point, node) in points.iter().zip(&octree.point_node[range.clone()]) {
                let row = octree.finest().nonempty[*node as usize];
                assert_eq!(octree.locate(6, shape, *point), Some(row));
                assert_eq!(octree.finest().shape_of(row as usize), shape);
                let (cell, _) = key::decode(octree.finest().keys[row as usize]);
                let offset = octree.leaf_points[*node as usize] - glam::UVec3::from(cell).as_vec3();
                assert!(offset.min_element() >= 0.0 && offset.max_element() < 1.0);
            }
        }
        assert_eq!(octree.locate(6, 0, Vec3::splat(1.5)), None);
        assert_eq!(octree.locate(6, 0, Vec3::new(0.9, 0.9, -0.9)), None);
    }

    #[test]
    fn a_batch_holds_what_its_shapes_hold_alone() {
        let sizes = [500, 1, 300];
        let batch = sheets(&sizes, &options(5, 2));
        let features = batch.features(Features::default()).unwrap();
        for (shape, &n) in sizes.iter().enumerate() {
            let (points, normals) = sheet(n, shape as u64);
            let alone = Octree::build(&[Cloud::new(&points, &normals)], &options(5, 2)).unwrap();
            for (level, single) in batch.levels.iter().zip(&alone.levels) {
                let range = level.ranges[shape].clone();
                let keys = level.keys[range.clone()].iter().map(|k| k & ((1 << 48) - 1));
                assert!(keys.eq(single.keys.iter().copied()));
                let neigh =
                    |n: &[i32; 27]| n.map(|r| if r < 0 { -1 } else { r - range.start as i32 });
                assert!(
                    level.neigh[range.clone()].iter().map(neigh).eq(single.neigh.iter().copied())
                );
            }
            let rows = batch.finest().ranges[shape].clone();
            assert_eq!(
                features[4 * rows.start..4 * rows.end],
                alone.features(Features::default()).unwrap()
            );
        }
    }

    #[test]
    fn the_order_of_threads_does_not_matter() {
        let build = |n| {
            crate::exec::par::with_threads(n, || sheets(&[20_000, 5000], &options(7, 2))).unwrap()
        };
        assert_eq!(build(1), build(4));
    }

    #[test]
    fn features_are_as_defined() {
        let points = [Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.12, 0.2, 0.3)];
        let normals = [Vec3::new(0.0, -2.0, 0.0), Vec3::new(0.0, -1.0, 0.0)];
        let octree = Octree::build(&[Cloud::new(&points, &normals)], &options(3, 1)).unwrap();
        let row = octree.finest().nonempty[0] as usize;
        let all = octree.features("NDP".parse().unwrap()).unwrap();
        let expected = [0.0, -1.0, 0.0, -(1.2 * 4.0 - 4.0 - 0.5), 0.11, 0.2, 0.3];
        for (a, b) in all[7 * row..][..7].iter().zip(expected) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
        assert_eq!(all.iter().filter(|&&x| x != 0.0).count(), 5);
        let absolute = OctreeOptions { depth: 3, ..OctreeOptions::reference() };
        let octree = Octree::build(&[Cloud::new(&points, &normals)], &absolute).unwrap();
        assert_eq!(octree.leaf_normals, [Vec3::Y]);
        assert!("DN".parse::<Features>().is_err() && "".parse::<Features>().is_err());
        assert_eq!("D".parse::<Features>().unwrap().n_channels(), 1);
    }

    #[test]
    fn bad_input_is_refused_with_its_place() {
        let build = |points: &[Vec3], normals: &[Vec3], options: &OctreeOptions| {
            Octree::build(&[Cloud::new(points, normals)], options).unwrap_err().to_string()
        };
        let fine = OctreeOptions::default();
        let (p, n) = ([Vec3::ZERO; 2], [Vec3::X; 2]);
        assert!(build(&[], &[], &fine).starts_with("shape 0: it has no points"));
        assert!(build(&p, &n[..1], &fine).starts_with("shape 0: 1 normals for 2 points"));
        assert!(build(&[Vec3::ZERO, Vec3::NAN], &n, &fine).starts_with("point 1 of shape 0: "));
        assert!(build(&p, &[Vec3::X, Vec3::INFINITY], &fine).starts_with("normal 1 of shape 0: "));
        assert!(build(&[Vec3::ZERO, Vec3::splat(1.1)], &n, &fine).contains("outside the cube"));
        assert!(build(&p, &n, &options(11, 2)).starts_with("octree depth is 11"));
        assert!(build(&p, &n, &options(0, 0)).starts_with("octree depth is 0"));
        assert!(build(&p, &n, &options(3, 4)).starts_with("octree full depth is 4"));
        assert!(build(&p, &n, &options(10, 10)).starts_with("the octree needs about "));
        assert!(Octree::build(&[], &fine).is_err());
        let octree = Octree::build(&[Cloud::new(&p, &[])], &fine).unwrap();
        assert!(octree.features(Features::default()).is_err());
        assert!(octree.features("P".parse().unwrap()).is_ok());
    }
}
