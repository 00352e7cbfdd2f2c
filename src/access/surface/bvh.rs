//! Triangles in boxes of boxes: which of them may a tool meet?
//!
//! Eight boxes to a node. Boxes are in `f32` about the middle of all triangles and never smaller than what
//! they hold; queries add a slack that exceeds all roundings, so no triangle is missed.

mod build;

use super::tool::Stand;
use crate::exec::par;
use crate::geom::mesh::has_area;
use crate::simd::{Float32, Isa, Kernel, Mask, Simd, Vector};
use build::{Item, PARALLEL, build};
use glam::{DVec3, Vec3};

/// Most triangles of a leaf.
const LEAF: usize = 4;
/// Children of a node.
pub(super) const WIDTH: usize = 8;

/// Boxes by middle and half size, eight of each.
#[derive(Debug, Clone)]
struct Node {
    middle: [[f32; WIDTH]; 3],
    half: [[f32; WIDTH]; 3],
    /// Node, or first triangle of a leaf.
    first: [u32; WIDTH],
    /// Triangles of a leaf; 0 for a node.
    count: [u8; WIDTH],
    /// Which of the eight there are.
    used: u8,
}

impl Default for Node {
    fn default() -> Self {
        Node {
            middle: [[0.0; WIDTH]; 3],
            half: [[0.0; WIDTH]; 3],
            first: [0; WIDTH],
            count: [0; WIDTH],
            used: 0,
        }
    }
}

/// The tree.
#[derive(Debug)]
pub(super) struct Bvh {
    nodes: Vec<Node>,
    /// Corners in the order of the leaves.
    triangles: Vec<[DVec3; 3]>,
    /// Which triangle, as given, comes at each place.
    faces: Vec<u32>,
    origin: DVec3,
    /// Half of the diagonal of everything, mm.
    radius: f64,
    isa: Isa,
}

/// A cylinder without an upper end: lower end and radius, about the tool's axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    height: f32,
    radius_squared: f32,
}

/// A cylinder about the tool's axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Band {
    level: Level,
    top: f32,
}

/// What boxes are compared with.
pub(super) trait Reach: Copy {
    /// Bit k is set if box k may reach into it: of the boxes, the squared distances from the axis, the heights of the
    /// upper ends, and the heights of the lower ends.
    fn reached<S: Simd>(self, simd: S, squared: S::F32, heights: [S::F32; 2]) -> u32;
}

impl Reach for Level {
    #[inline(always)]
    fn reached<S: Simd>(self, simd: S, squared: S::F32, [top, _]: [S::F32; 2]) -> u32 {
        let within = squared.le(S::F32::splat(simd, self.radius_squared));
        within.and(top.gt(S::F32::splat(simd, self.height))).bits()
    }
}

impl Reach for Band {
    #[inline(always)]
    fn reached<S: Simd>(self, simd: S, squared: S::F32, heights: [S::F32; 2]) -> u32 {
        let below = S::F32::splat(simd, self.top).gt(heights[1]).bits();
        self.level.reached(simd, squared, heights) & below
    }
}

/// What the levels of a tool are widened by: share of the sizes of tool and triangles.
const SLACK: f64 = 4e-6;

impl Bvh {
    /// The tree over those of `triangles`, finite, that have an area.
    pub fn new(triangles: &[[DVec3; 3]]) -> Self {
        let blocks = par::map_blocks(triangles.len(), PARALLEL, |range| {
            range.filter(|&f| has_area(&triangles[f])).map(|f| f as u32).collect::<Vec<_>>()
        });
        let with_area: Vec<u32> = blocks.into_iter().flatten().collect();
        let corners = || with_area.iter().flat_map(|&f| triangles[f as usize]);
        let low = corners().fold(DVec3::INFINITY, |low, p| low.min(p));
        let high = corners().fold(DVec3::NEG_INFINITY, |high, p| high.max(p));
        let empty = with_area.is_empty();
        let origin = if empty { DVec3::ZERO } else { 0.5 * (low + high) };
        let radius = if empty { 0.0 } else { 0.5 * (high - low).length() };
        let blocks = par::map_blocks(with_area.len(), PARALLEL, |range| {
            let item = |&f: &u32| Item::new(&triangles[f as usize], f, origin);
            with_area[range].iter().map(item).collect::<Vec<_>>()
        });
        let mut items: Vec<Item> = blocks.into_iter().flatten().collect();
        let mut nodes = Vec::new();
        if empty {
            nodes.push(Node::default());
        } else {
            build(&mut items, 0, &mut nodes);
        }
        let faces: Vec<u32> = items.iter().map(|item| item.face).collect();
        let mut ordered = vec![[DVec3::ZERO; 3]; faces.len()];
        par::for_each_block(&mut ordered, PARALLEL, |block, ordered| {
            for (corners, &f) in ordered.iter_mut().zip(&faces[block * PARALLEL..]) {
                *corners = triangles[f as usize];
            }
        });
        Bvh { nodes, triangles: ordered, faces, origin, radius, isa: Isa::active() }
    }

    pub fn n_triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Corners of the triangle at a place in the order of the leaves.
    pub fn triangle(&self, place: u32) -> &[DVec3; 3] {
        &self.triangles[place as usize]
    }

    /// Number, as given, of the triangle at a place.
    pub fn face(&self, place: u32) -> u32 {
        self.faces[place as usize]
    }

    /// Middle of all triangles.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Half of the diagonal of all triangles, mm.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The level of a cylinder for [`Bvh::visit`], widened; `size` is the tool's size, mm.
    pub fn level(&self, height: f64, radius: f64, size: f64) -> Level {
        let slack = SLACK * (self.radius + size);
        let radius = radius + slack;
        Level {
            height: (height - slack) as f32,
            radius_squared: (radius * radius * (1.0 + SLACK)) as f32,
        }
    }

    /// The band between two heights for [`Bvh::visit`], as [`Bvh::level`]; nothing reaches into one of negative radius.
    pub fn band(&self, [low, high]: [f64; 2], radius: f64, size: f64) -> Band {
        let slack = SLACK * (self.radius + size);
        let mut level = self.level(low, radius, size);
        if radius + slack < 0.0 {
            level.radius_squared = -1.0;
        }
        Band { level, top: (high + slack) as f32 }
    }

    /// Calls `test` with the place of every triangle that may reach into one of the levels or bands, until it returns
    /// true; whether it did. `test` may change the levels on the way: raise them, or make them narrower or fewer.
    /// `stack` is memory that calls share.
    pub fn visit<R: Reach, L: AsRef<[R]>>(
        &self,
        stand: &Stand,
        levels: &mut L,
        stack: &mut Vec<u32>,
        mut test: impl FnMut(u32, &mut L) -> bool,
    ) -> bool {
        let reference = (stand.reference - self.origin).as_vec3();
        let axes = stand.axes.map(|axis| axis.as_vec3());
        stack.clear();
        stack.push(0);
        while let Some(node) = stack.pop() {
            let node = &self.nodes[node as usize];
            let reached = Reached { node, reference, axes: &axes, levels: levels.as_ref() };
            let mut open = self.isa.run(reached) & u32::from(node.used);
            while open != 0 {
                let k = open.trailing_zeros() as usize;
                open &= open - 1;
                let first = node.first[k];
                if node.count[k] == 0 {
                    stack.push(first);
                    continue;
                }
                for place in first..first + u32::from(node.count[k]) {
                    if test(place, levels) {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// Calls `test` with the place of every triangle whose box comes within `radius` of `point`, until it returns true;
    /// whether it did.
    pub fn near(&self, point: DVec3, radius: f64, mut test: impl FnMut(u32) -> bool) -> bool {
        let point = (point - self.origin).as_vec3();
        let reach = (radius + SLACK * (self.radius + radius)) as f32;
        let mut stack = vec![0u32];
        while let Some(node) = stack.pop() {
            let node = &self.nodes[node as usize];
            let squared = reach * reach;
            let mut open = self.isa.run(Near { node, point, squared }) & u32::from(node.used);
            while open != 0 {
                let k = open.trailing_zeros() as usize;
                open &= open - 1;
                let (first, count) = (node.first[k], u32::from(node.count[k]));
                match count {
                    0 => stack.push(first),
                    _ if (first..first + count).any(&mut test) => return true,
                    _ => {}
                }
            }
        }
        false
    }
}

// Functions and no closures: what is not inlined into a kernel is compiled for the baseline of the target.

/// The same three coordinates of as many boxes as a vector has lanes, from box `start` on.
#[inline(always)]
fn vectors<S: Simd>(simd: S, of: &[[f32; WIDTH]; 3], start: usize) -> [S::F32; 3] {
    [
        S::F32::load_partial(simd, &of[0][start..]),
        S::F32::load_partial(simd, &of[1][start..]),
        S::F32::load_partial(simd, &of[2][start..]),
    ]
}

#[inline(always)]
fn splat3<S: Simd>(simd: S, a: Vec3) -> [S::F32; 3] {
    [S::F32::splat(simd, a.x), S::F32::splat(simd, a.y), S::F32::splat(simd, a.z)]
}

#[inline(always)]
fn dot<V: Vector>(a: [V; 3], b: [V; 3]) -> V {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

struct Reached<'a, R> {
    node: &'a Node,
    reference: Vec3,
    axes: &'a [Vec3; 3],
    levels: &'a [R],
}

impl<R: Reach> Kernel for Reached<'_, R> {
    type Output = u32;

    /// Bit k is set if box k may reach into one of the levels.
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u32 {
        let Reached { node, reference, axes: [u, v, d], levels } = self;
        let zero = S::F32::splat(simd, 0.0);
        let mut reached = 0;
        let mut start = 0;
        while start < WIDTH {
            let middle = vectors(simd, &node.middle, start);
            let half = vectors(simd, &node.half, start);
            let r = splat3(simd, reference);
            let from = [middle[0] - r[0], middle[1] - r[1], middle[2] - r[2]];
            let (along, reach) = (dot(from, splat3(simd, *d)), dot(half, splat3(simd, d.abs())));
            let heights = [along + reach, along - reach];
            let along_u = dot(from, splat3(simd, *u));
            let along_v = dot(from, splat3(simd, *v));
            let u = along_u.max(zero - along_u) - dot(half, splat3(simd, u.abs()));
            let v = along_v.max(zero - along_v) - dot(half, splat3(simd, v.abs()));
            let (u, v) = (u.max(zero), v.max(zero));
            let squared = u * u + v * v;
            let mut bits = 0;
            for level in levels {
                bits |= level.reached(simd, squared, heights);
            }
            reached |= bits << start;
            start += S::F32::LANES;
        }
        reached & ((1 << WIDTH) - 1)
    }
}

/// Which boxes come near a point.
struct Near<'a> {
    node: &'a Node,
    point: Vec3,
    /// The distance, squared.
    squared: f32,
}

impl Kernel for Near<'_> {
    type Output = u32;

    /// Bit k is set if box k comes within the distance.
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u32 {
        let Near { node, point, squared } = self;
        let zero = S::F32::splat(simd, 0.0);
        let mut near = 0;
        let mut start = 0;
        while start < WIDTH {
            let middle = vectors(simd, &node.middle, start);
            let half = vectors(simd, &node.half, start);
            let p = splat3(simd, point);
            let from = [p[0] - middle[0], p[1] - middle[1], p[2] - middle[2]];
            let x = (from[0].max(zero - from[0]) - half[0]).max(zero);
            let y = (from[1].max(zero - from[1]) - half[1]).max(zero);
            let z = (from[2].max(zero - from[2]) - half[2]).max(zero);
            let distance = x * x + y * y + z * z;
            near |= distance.le(S::F32::splat(simd, squared)).bits() << start;
            start += S::F32::LANES;
        }
        near & ((1 << WIDTH) - 1)
    }
}
