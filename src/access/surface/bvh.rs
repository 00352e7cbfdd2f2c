//! Triangles in boxes of boxes: which of them may a tool meet?
//!
//! Eight boxes to a node, split by the surface-area heuristic over sixteen bins (Wald 2007, On fast construction of
//! SAH-based bounding volume hierarchies). Boxes are in `f32` about the middle of all triangles and never smaller than what
//! they hold; queries add a slack that exceeds all roundings, so no triangle is missed.

use super::tool::Stand;
use crate::par;
use glam::{DVec3, Vec3};

/// Most triangles of a leaf.
const LEAF: usize = 4;
/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Below this many triangles one thread goes on alone.
const PARALLEL: usize = 1 << 12;
/// Bins along an axis.
const BINS: usize = 16;

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
}

/// A cylinder without an upper end: lower end and radius, about the tool's axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    pub height: f32,
    pub radius_squared: f32,
}

/// What the levels of a tool are widened by: share of the sizes of tool and triangles.
const SLACK: f64 = 4e-6;

impl Bvh {
    /// The tree over `triangles`, finite.
    pub fn new(triangles: Vec<[DVec3; 3]>) -> Self {
        let corners = || triangles.iter().flatten();
        let low = corners().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let high = corners().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
        let empty = triangles.is_empty();
        let origin = if empty { DVec3::ZERO } else { 0.5 * (low + high) };
        let radius = if empty { 0.0 } else { 0.5 * (high - low).length() };
        let blocks = par::map_blocks(triangles.len(), PARALLEL, |range| {
            range.map(|f| Item::new(&triangles[f], f as u32, origin)).collect::<Vec<_>>()
        });
        let mut items: Vec<Item> = blocks.into_iter().flatten().collect();
        let nodes = if empty { vec![Node::default()] } else { build(&mut items, 0) };
        let faces: Vec<u32> = items.iter().map(|item| item.face).collect();
        let triangles = faces.iter().map(|&f| triangles[f as usize]).collect();
        Bvh { nodes, triangles, faces, origin, radius }
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

    /// Calls `test` with the place of every triangle that may reach into one of the levels, until it returns true;
    /// whether it did. `stack` is memory that calls share.
    pub fn visit(
        &self,
        stand: &Stand,
        levels: &[Level],
        stack: &mut Vec<u32>,
        mut test: impl FnMut(u32) -> bool,
    ) -> bool {
        let reference = (stand.reference - self.origin).as_vec3();
        let axes = stand.axes.map(|axis| axis.as_vec3());
        stack.clear();
        stack.push(0);
        while let Some(node) = stack.pop() {
            let node = &self.nodes[node as usize];
            let mut open = node.reached(reference, &axes, levels) & u32::from(node.used);
            while open != 0 {
                let k = open.trailing_zeros() as usize;
                open &= open - 1;
                let first = node.first[k];
                if node.count[k] == 0 {
                    stack.push(first);
                    continue;
                }
                for place in first..first + u32::from(node.count[k]) {
                    if test(place) {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// Calls `test` with the place of every triangle whose box comes within `radius` of `point`.
    pub fn near(&self, point: DVec3, radius: f64, mut test: impl FnMut(u32)) {
        let point = (point - self.origin).as_vec3();
        let reach = (radius + SLACK * (self.radius + radius)) as f32;
        let mut stack = vec![0u32];
        while let Some(node) = stack.pop() {
            let node = &self.nodes[node as usize];
            for k in (0..WIDTH).filter(|k| node.used >> k & 1 == 1) {
                let beyond = |axis: usize| {
                    ((point[axis] - node.middle[axis][k]).abs() - node.half[axis][k]).max(0.0)
                };
                let squared = (0..3).map(|axis| beyond(axis) * beyond(axis)).sum::<f32>();
                if squared > reach * reach {
                    continue;
                }
                match node.count[k] {
                    0 => stack.push(node.first[k]),
                    count => (node.first[k]..node.first[k] + u32::from(count)).for_each(&mut test),
                }
            }
        }
    }
}

impl Node {
    /// Bit k is set if box k may reach into one of the levels.
    #[inline(always)]
    fn reached(&self, reference: Vec3, [u, v, d]: &[Vec3; 3], levels: &[Level]) -> u32 {
        let mut top = [0f32; WIDTH];
        let mut squared = [0f32; WIDTH];
        for k in 0..WIDTH {
            let x = self.middle[0][k] - reference.x;
            let y = self.middle[1][k] - reference.y;
            let z = self.middle[2][k] - reference.z;
            let [hx, hy, hz] = [self.half[0][k], self.half[1][k], self.half[2][k]];
            let along = |a: &Vec3| x * a.x + y * a.y + z * a.z;
            let extent = |a: &Vec3| hx * a.x.abs() + hy * a.y.abs() + hz * a.z.abs();
            top[k] = along(d) + extent(d);
            let beyond_u = (along(u).abs() - extent(u)).max(0.0);
            let beyond_v = (along(v).abs() - extent(v)).max(0.0);
            squared[k] = beyond_u * beyond_u + beyond_v * beyond_v;
        }
        let mut reached = [0u32; WIDTH];
        for level in levels {
            for k in 0..WIDTH {
                let within = squared[k] <= level.radius_squared;
                reached[k] |= u32::from(within & (top[k] > level.height));
            }
        }
        (0..WIDTH).map(|k| reached[k] << k).sum()
    }
}

/// The box of a triangle.
#[derive(Debug, Clone, Copy)]
struct Item {
    low: Vec3,
    high: Vec3,
    face: u32,
}

impl Item {
    fn new(corners: &[DVec3; 3], face: u32, origin: DVec3) -> Self {
        let corners = corners.map(|p| (p - origin).as_vec3());
        let [a, b, c] = corners;
        Item { low: a.min(b).min(c), high: a.max(b).max(c), face }
    }

    fn middle(&self) -> Vec3 {
        0.5 * (self.low + self.high)
    }
}

#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    const NONE: Bounds = Bounds { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    fn of(items: &[Item]) -> Self {
        items.iter().fold(Bounds::NONE, |bounds, item| bounds.with(item.low, item.high))
    }

    fn with(self, low: Vec3, high: Vec3) -> Self {
        Bounds { low: self.low.min(low), high: self.high.max(high) }
    }

    /// Half the surface of the box.
    fn area(&self) -> f32 {
        let size = (self.high - self.low).max(Vec3::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

/// The nodes of a tree over `items`, root first; leaves count places from `start`.
fn build(items: &mut [Item], start: usize) -> Vec<Node> {
    let groups = split_in_eight(items);
    let mut rest = items;
    let mut parts = Vec::new();
    let mut first = start;
    for len in groups {
        let (part, after) = rest.split_at_mut(len);
        parts.push((first, part));
        first += len;
        rest = after;
    }
    let mut root = Node::default();
    let bounds: Vec<Bounds> = parts.iter().map(|(_, part)| Bounds::of(part)).collect();
    for (k, ((first, part), bounds)) in parts.iter().zip(&bounds).enumerate() {
        root.put(k, bounds);
        if part.len() <= LEAF {
            (root.first[k], root.count[k]) = (*first as u32, part.len() as u8);
        }
    }
    let large = first - start > PARALLEL;
    let grow = |first: usize, part: &mut [Item]| match part.len() > LEAF {
        true => build(part, first),
        false => vec![],
    };
    let subtrees: Vec<Vec<Node>> = match large {
        true => par::map_chunks(&mut parts, 1, |_, part| grow(part[0].0, part[0].1)),
        false => parts.iter_mut().map(|(first, part)| grow(*first, part)).collect(),
    };
    let mut nodes = vec![root];
    for (k, subtree) in subtrees.into_iter().enumerate().filter(|(_, tree)| !tree.is_empty()) {
        let at = nodes.len() as u32;
        nodes[0].first[k] = at;
        nodes.extend(subtree.into_iter().map(|node| node.moved(at)));
    }
    nodes
}

impl Node {
    fn put(&mut self, k: usize, bounds: &Bounds) {
        let middle = 0.5 * (bounds.low + bounds.high);
        // Half sizes are measured from the rounded middle.
        let half = (bounds.high - middle).max(middle - bounds.low);
        for axis in 0..3 {
            self.middle[axis][k] = middle[axis];
            self.half[axis][k] = half[axis];
        }
        self.used |= 1 << k;
    }

    fn moved(mut self, by: u32) -> Self {
        for k in (0..WIDTH).filter(|k| self.used >> k & 1 == 1) {
            self.first[k] += if self.count[k] == 0 { by } else { 0 };
        }
        self
    }
}

/// Reorders `items` into at most eight groups; their lengths.
fn split_in_eight(items: &mut [Item]) -> Vec<usize> {
    let mut groups = vec![(items.len(), Bounds::of(items).area())];
    while groups.len() < WIDTH {
        let splittable = groups.iter().enumerate().filter(|(_, group)| group.0 > LEAF);
        let largest = splittable.max_by(|a, b| a.1.1.total_cmp(&b.1.1).then(b.0.cmp(&a.0)));
        let Some((g, &(len, _))) = largest else { break };
        let start: usize = groups[..g].iter().map(|group| group.0).sum();
        let part = &mut items[start..start + len];
        let left = split(part);
        let areas = [&part[..left], &part[left..]].map(|half| Bounds::of(half).area());
        groups[g] = (left, areas[0]);
        groups.insert(g + 1, (len - left, areas[1]));
    }
    groups.into_iter().map(|group| group.0).collect()
}

/// Reorders at least two items into two groups, neither empty; where the second begins.
fn split(items: &mut [Item]) -> usize {
    let middles = items.iter().fold(Bounds::NONE, |b, item| b.with(item.middle(), item.middle()));
    let size = middles.high - middles.low;
    let mut best = (f32::INFINITY, 0, 0);
    for axis in (0..3).filter(|&axis| size[axis] > 0.0) {
        for (cut, cost) in costs(items, axis, &middles).into_iter().enumerate() {
            if cost < best.0 {
                best = (cost, axis, cut);
            }
        }
    }
    let (cost, axis, cut) = best;
    let half = items.len() / 2;
    if cost == f32::INFINITY {
        return half;
    }
    let left = partition(items, |item| bin(item.middle()[axis], axis, &middles) <= cut);
    // A group that splits off crumbs only would make the tree deep.
    let least = items.len() / 64;
    if left > least && items.len() - left > least {
        return left;
    }
    let axis = size.max_position();
    items.select_nth_unstable_by(half, |a, b| {
        a.middle()[axis].total_cmp(&b.middle()[axis]).then(a.face.cmp(&b.face))
    });
    half
}

fn bin(at: f32, axis: usize, bounds: &Bounds) -> usize {
    let share = (at - bounds.low[axis]) / (bounds.high[axis] - bounds.low[axis]);
    ((share * BINS as f32) as usize).min(BINS - 1)
}

/// Cost of cutting after each bin but the last; infinite where a side would be empty.
fn costs(items: &[Item], axis: usize, middles: &Bounds) -> [f32; BINS - 1] {
    let mut bins = [(0u32, Bounds::NONE); BINS];
    for item in items {
        let (count, bounds) = &mut bins[bin(item.middle()[axis], axis, middles)];
        (*count, *bounds) = (*count + 1, bounds.with(item.low, item.high));
    }
    let sweep = |order: &mut dyn Iterator<Item = usize>| {
        let mut sums = [(0u32, 0f32); BINS];
        let mut sum = (0, Bounds::NONE);
        for k in order {
            sum = (sum.0 + bins[k].0, sum.1.with(bins[k].1.low, bins[k].1.high));
            sums[k] = (sum.0, sum.1.area());
        }
        sums
    };
    let (left, right) = (sweep(&mut (0..BINS)), sweep(&mut (0..BINS).rev()));
    let mut costs = [f32::INFINITY; BINS - 1];
    for (k, cost) in costs.iter_mut().enumerate() {
        let ((n, area), (m, other)) = (left[k], right[k + 1]);
        if n > 0 && m > 0 {
            *cost = n as f32 * area + m as f32 * other;
        }
    }
    costs
}

/// Items for which `first` holds come first, the order of these kept; how many.
fn partition(items: &mut [Item], first: impl Fn(&Item) -> bool) -> usize {
    let mut n = 0;
    for i in 0..items.len() {
        if first(&items[i]) {
            items.swap(i, n);
            n += 1;
        }
    }
    n
}
