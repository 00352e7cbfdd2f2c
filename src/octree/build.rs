//! Construction of an octree: sorts the points by key, then adds depth after depth from the root.

use super::{Cloud, KernelMap, Octree, OctreeLevel, OctreeOptions, key, neighbors};
use crate::exec::{memory, par};
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use std::ops::Range;

/// Points per task.
const BLOCK: usize = 8192;
/// Upper estimate: key, child, neighbors, row, all 27 pairs of the kernel map, siblings, both padding maps.
const BYTES_PER_NODE: u64 = 8 + 4 + 27 * 4 + 4 + 27 * 8 + 27 * 4 / 8 + 2 * 8;
/// Sorted pair of key and index, node, mean point and normal.
const BYTES_PER_POINT: u64 = 16 + 8 + 4 + 12 + 12;
/// Least depth whose kernel map lists siblings: a shape has too few nodes in coarser ones for that to pay.
const SIBLINGS: usize = 4;

impl Octree {
    /// Builds the octree of a batch of shapes. Every shape's nodes are those it would have alone.
    ///
    /// # Errors
    /// For options outside their domain; for no shapes or too many; for a shape without points, with
    /// missing normals, with a point that is not finite or outside [−1, 1]³; and if the
    /// octree would need more than `options.max_bytes`.
    ///
    /// ```
    /// use deepmill::octree::{Cloud, Octree, OctreeOptions};
    /// use deepmill::glam::Vec3;
    /// let (points, normals) = ([Vec3::ZERO, Vec3::splat(0.5)], [Vec3::X, Vec3::Z]);
    /// let octree = Octree::build(&[Cloud::new(&points, &normals)], &OctreeOptions::default())?;
    /// assert_eq!(octree.finest().n_nonempty(), 2);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn build(clouds: &[Cloud], options: &OctreeOptions) -> Result<Octree> {
        options.check()?;
        check_clouds(clouds)?;
        let point_ranges = point_ranges(clouds);
        let sorted = sorted_points(clouds, &point_ranges, options.depth)?;
        let leaves = Leaves::new(&sorted);
        let nonempty = nonempty_keys(leaves.keys.clone(), options.depth);
        guard_memory(&nonempty, sorted.len(), clouds.len(), options)?;
        let (leaf_points, leaf_normals) =
            leaf_means(clouds, &point_ranges, &sorted, &leaves, options);
        Ok(Octree {
            options: options.clone(),
            levels: levels(&nonempty, clouds.len(), options),
            point_node: leaves.of_points(&sorted),
            point_ranges,
            leaf_points,
            leaf_normals,
        })
    }
}

fn check_clouds(clouds: &[Cloud]) -> Result<()> {
    if clouds.is_empty() || clouds.len() > key::MAX_SHAPES {
        return Err(Error::argument(
            "number of shapes in a batch",
            clouds.len(),
            format!("1 to {}", key::MAX_SHAPES),
            "split the batch or give it a shape",
        ));
    }
    let wants_normals = !clouds[0].normals.is_empty();
    clouds.iter().enumerate().try_for_each(|(i, cloud)| cloud.check(i, wants_normals))
}

fn point_ranges(clouds: &[Cloud]) -> Vec<Range<usize>> {
    let mut end = 0;
    let mut range = |n| {
        end += n;
        end - n..end
    };
    clouds.iter().map(|cloud| range(cloud.points.len())).collect()
}

/// Key of its finest cell and index of every point, sorted by both.
fn sorted_points(
    clouds: &[Cloud],
    ranges: &[Range<usize>],
    depth: usize,
) -> Result<Vec<(u64, u32)>> {
    let mut sorted = vec![(0, 0); ranges.last().map_or(0, |r| r.end)];
    for (shape, (cloud, range)) in clouds.iter().zip(ranges).enumerate() {
        if let Some(i) = cloud.points.iter().position(|&p| key::cell(p, depth).is_none()) {
            return Err(Error::geometry(
                format!("point {i} of shape {shape}"),
                format!("{} lies outside the cube [-1, 1]^3", cloud.points[i]),
                "normalize or clip the points first",
            ));
        }
        par::for_each_block(&mut sorted[range.clone()], BLOCK, |block, pairs| {
            for (i, pair) in pairs.iter_mut().enumerate() {
                let i = block * BLOCK + i;
                let cell = key::cell(cloud.points[i], depth).unwrap_or_default();
                *pair = (key::encode(cell, shape), (range.start + i) as u32);
            }
        });
    }
    par::sort_by_key(&mut sorted, |&pair| pair);
    Ok(sorted)
}

/// The distinct keys of the finest depth, and where their points start in the sorted list.
struct Leaves {
    keys: Vec<u64>,
    starts: Vec<usize>,
}

impl Leaves {
    fn new(sorted: &[(u64, u32)]) -> Self {
        let (mut keys, mut starts) = (Vec::new(), Vec::new());
        for (i, &(key, _)) in sorted.iter().enumerate() {
            if keys.last() != Some(&key) {
                keys.push(key);
                starts.push(i);
            }
        }
        starts.push(sorted.len());
        Leaves { keys, starts }
    }

    fn of_points(&self, sorted: &[(u64, u32)]) -> Vec<u32> {
        let mut nodes = vec![0; sorted.len()];
        for (leaf, range) in self.starts.windows(2).enumerate() {
            for &(_, point) in &sorted[range[0]..range[1]] {
                nodes[point as usize] = leaf as u32;
            }
        }
        nodes
    }
}

/// Keys of the nodes that contain points, for every depth.
fn nonempty_keys(leaves: Vec<u64>, depth: usize) -> Vec<Vec<u64>> {
    let mut keys = vec![leaves];
    for d in 0..depth {
        let mut coarser: Vec<u64> = keys[d].iter().map(|&k| key::ancestor(k, 1)).collect();
        coarser.dedup();
        keys.push(coarser);
    }
    keys.reverse();
    keys
}

fn guard_memory(
    nonempty: &[Vec<u64>],
    n_points: usize,
    n_shapes: usize,
    options: &OctreeOptions,
) -> Result<()> {
    let full = (0..=options.full_depth).map(|d| (n_shapes as u64) << (3 * d));
    let sparse = (options.full_depth..options.depth).map(|d| 8 * nonempty[d].len() as u64);
    let nodes: Vec<u64> = full.chain(sparse).collect();
    let needed_bytes =
        nodes.iter().sum::<u64>() * BYTES_PER_NODE + n_points as u64 * BYTES_PER_POINT;
    let too_many = nodes.iter().any(|&n| n > i32::MAX as u64) || n_points > u32::MAX as usize;
    if needed_bytes > options.max_bytes || too_many {
        return Err(Error::TooLarge {
            operation: "the octree",
            needed_bytes,
            limit_bytes: options.max_bytes,
            remedy: format!(
                "lower its depth ({}) or full depth ({}), take fewer shapes at once ({n_shapes}), or raise the limit",
                options.depth, options.full_depth
            ),
        });
    }
    let remedy =
        format!("lower its depth ({}) or take fewer shapes at once ({n_shapes})", options.depth);
    memory::require("the octree", needed_bytes, remedy)
}

fn levels(nonempty: &[Vec<u64>], n_shapes: usize, options: &OctreeOptions) -> Vec<OctreeLevel> {
    let mut levels: Vec<OctreeLevel> = Vec::with_capacity(options.depth + 1);
    for (d, nonempty) in nonempty.iter().enumerate() {
        let keys = match levels.last() {
            Some(coarse) if d > options.full_depth => children_keys(coarse),
            _ => full_keys(d, n_shapes),
        };
        let children = if d < options.full_depth {
            (0..keys.len() as i32).collect()
        } else {
            children(&keys, nonempty)
        };
        let siblings = levels
            .last()
            .map(|coarse| neighbors::of_parents(&coarse.nonempty, &coarse.children, &coarse.neigh));
        levels.push(level(d, keys, children, siblings, n_shapes));
    }
    levels
}

fn level(
    depth: usize,
    keys: Vec<u64>,
    children: Vec<i32>,
    siblings: Option<Vec<[i32; 27]>>,
    n_shapes: usize,
) -> OctreeLevel {
    let neigh = match &siblings {
        Some(siblings) => neighbors::of_children(siblings),
        None => neighbors::of_roots(n_shapes),
    };
    let first_of = |shape: usize| keys.partition_point(|&k| key::decode(k).1 < shape);
    let ranges = (0..n_shapes).map(|shape| first_of(shape)..first_of(shape + 1)).collect();
    let nonempty: Vec<u32> =
        (0..keys.len() as u32).filter(|&n| children[n as usize] >= 0).collect();
    OctreeLevel {
        conv: KernelMap::convolution(
            &neigh,
            siblings.filter(|_| depth >= SIBLINGS).unwrap_or_default(),
        ),
        pad: KernelMap::scatter(&nonempty, keys.len()),
        depad: KernelMap::gather(&nonempty, keys.len()),
        keys,
        children,
        neigh,
        nonempty,
        ranges,
    }
}

fn full_keys(depth: usize, n_shapes: usize) -> Vec<u64> {
    let shape_keys = |shape| (0..1u64 << (3 * depth)).map(move |k| k | shape << key::SHAPE_SHIFT);
    (0..n_shapes as u64).flat_map(shape_keys).collect()
}

fn children_keys(coarse: &OctreeLevel) -> Vec<u64> {
    let parents = coarse.nonempty.iter().map(|&n| coarse.keys[n as usize]);
    parents.flat_map(|parent| (0..8).map(move |octant| key::child(parent, octant))).collect()
}

/// Place of each key in `nonempty`, −1 if it is not there; both ascend.
fn children(keys: &[u64], nonempty: &[u64]) -> Vec<i32> {
    let mut next = 0;
    let mut place = |key: &u64| {
        if nonempty.get(next) != Some(key) {
            return -1;
        }
        next += 1;
        next as i32 - 1
    };
    keys.iter().map(&mut place).collect()
}

/// Mean point in finest cells and normalized mean normal of every leaf, summed in point order.
fn leaf_means(
    clouds: &[Cloud],
    ranges: &[Range<usize>],
    sorted: &[(u64, u32)],
    leaves: &Leaves,
    options: &OctreeOptions,
) -> (Vec<Vec3>, Vec<Vec3>) {
    let sum_of_leaf = |leaf: usize, value: &dyn Fn(&Cloud, usize) -> Vec3| {
        let shape = key::decode(leaves.keys[leaf]).1;
        let points = &sorted[leaves.starts[leaf]..leaves.starts[leaf + 1]];
        let local = points.iter().map(|&(_, i)| i as usize - ranges[shape].start);
        sum(local.map(|i| value(&clouds[shape], i)), options.single_precision_means)
    };
    let mean = |leaf: usize| {
        let total = sum_of_leaf(leaf, &|cloud, i| key::in_cells(cloud.points[i], options.depth));
        let count = leaves.starts[leaf + 1] - leaves.starts[leaf];
        (total / count as f64).as_vec3()
    };
    let direction = |leaf: usize| {
        let total = sum_of_leaf(leaf, &|cloud, i| match options.absolute_normals {
            true => cloud.normals[i].abs(),
            false => cloud.normals[i],
        });
        (total / total.length().max(1e-12)).as_vec3()
    };
    let n_leaves = leaves.keys.len();
    let n_normals = if clouds[0].normals.is_empty() { 0 } else { n_leaves };
    let points = par::map_blocks(n_leaves, BLOCK, |range| range.map(mean).collect::<Vec<_>>());
    let normals =
        par::map_blocks(n_normals, BLOCK, |range| range.map(direction).collect::<Vec<_>>());
    (points.concat(), normals.concat())
}

fn sum(vectors: impl Iterator<Item = Vec3>, single_precision: bool) -> DVec3 {
    if single_precision {
        vectors.sum::<Vec3>().as_dvec3()
    } else {
        vectors.map(|v| v.as_dvec3()).sum()
    }
}
