//! The tree is built from the top, by the surface-area heuristic over sixteen bins (Wald 2007, On fast construction of
//! SAH-based bounding volume hierarchies).

use super::{LEAF, Node, WIDTH};
use crate::exec::par;
use crate::spatial::each;
use glam::{DVec3, Vec3};

/// Below this many triangles one thread goes on alone.
pub(super) const PARALLEL: usize = 1 << 12;
/// Bins along an axis.
const BINS: usize = 16;
/// Up to this many triangles half as many bins do.
const FEW: usize = 32;

/// The box of a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Item {
    low: Vec3,
    high: Vec3,
    pub face: u32,
}

impl Item {
    pub fn new(corners: &[DVec3; 3], face: u32, origin: DVec3) -> Self {
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

/// Appends the nodes of a tree over `items`, root first, each before its children; leaves count places from `start`.
pub(super) fn build(items: &mut [Item], start: usize, nodes: &mut Vec<Node>) {
    let is_large = items.len() > PARALLEL;
    let groups = split_in_eight(items);
    let root = nodes.len();
    nodes.push(Node::default());
    let mut rest = items;
    let mut inner = Vec::new();
    let mut first = start;
    for (k, &(len, bounds)) in groups.iter().enumerate() {
        let (part, after) = rest.split_at_mut(len);
        rest = after;
        nodes[root].put(k, &bounds);
        if len <= LEAF {
            (nodes[root].first[k], nodes[root].count[k]) = (first as u32, len as u8);
        } else if is_large {
            inner.push((k, first, part));
        } else {
            nodes[root].first[k] = nodes.len() as u32;
            build(part, first, nodes);
        }
        first += len;
    }
    let subtrees = par::map_chunks(&mut inner, 1, |_, part| {
        let (k, first, part) = &mut part[0];
        let mut nodes = Vec::new();
        build(part, *first, &mut nodes);
        (*k, nodes)
    });
    for (k, subtree) in subtrees {
        let at = nodes.len() as u32;
        nodes[root].first[k] = at;
        nodes.extend(subtree.into_iter().map(|node| node.moved(at)));
    }
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

/// Reorders `items` into at most eight groups; their lengths and boxes.
fn split_in_eight(items: &mut [Item]) -> Vec<(usize, Bounds)> {
    let mut groups = Vec::with_capacity(WIDTH);
    groups.push((items.len(), Bounds::of(items)));
    while groups.len() < WIDTH {
        let areas = groups.iter().map(|group| group.1.area()).enumerate();
        let splittable = areas.filter(|(g, _)| groups[*g].0 > LEAF);
        let largest = splittable.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        let Some((g, _)) = largest else { break };
        let start: usize = groups[..g].iter().map(|group| group.0).sum();
        let len = groups[g].0;
        let (n_left, [left, right]) = split(&mut items[start..start + len]);
        groups[g] = (n_left, left);
        groups.insert(g + 1, (len - n_left, right));
    }
    groups
}

/// Reorders at least two items into two groups, neither empty; the length of the first, and the boxes of both.
fn split(items: &mut [Item]) -> (usize, [Bounds; 2]) {
    let middles = join(items, |part| {
        part.iter().fold(Bounds::NONE, |b, item| b.with(item.middle(), item.middle()))
    });
    let middles = middles.reduce(|a, b| a.with(b.low, b.high)).unwrap_or(Bounds::NONE);
    let size = middles.high - middles.low;
    let half = items.len() / 2;
    let halves = |items: &[Item], n: usize| (n, [&items[..n], &items[n..]].map(Bounds::of));
    if size == Vec3::ZERO {
        return halves(items, half);
    }
    let binning = Binning::of(&middles, if items.len() > FEW { BINS } else { BINS / 2 });
    let bins = join(items, |part| Bins::of(part, &binning));
    let bins = bins.reduce(Bins::joined).unwrap_or(Bins::EMPTY);
    let mut best = (f32::INFINITY, 0, 0, [Bounds::NONE; 2]);
    for axis in (0..3).filter(|&axis| size[axis] > 0.0) {
        bins.cuts(axis, binning.n, |cut, cost, sides| {
            if cost < best.0 {
                best = (cost, axis, cut, sides);
            }
        });
    }
    let (cost, axis, cut, sides) = best;
    if cost == f32::INFINITY {
        return halves(items, half);
    }
    let left = partition(items, |item| binning.bin(item.middle())[axis] <= cut);
    // A group that splits off crumbs only would make the tree deep.
    let least = items.len() / 64;
    if left > least && items.len() - left > least {
        return (left, sides);
    }
    let axis = size.max_position();
    items.select_nth_unstable_by(half, |a, b| {
        a.middle()[axis].total_cmp(&b.middle()[axis]).then(a.face.cmp(&b.face))
    });
    halves(items, half)
}

/// `of` consecutive parts of many items, side by side.
fn join<R: Send>(items: &[Item], of: impl Fn(&[Item]) -> R + Sync) -> impl Iterator<Item = R> {
    let len = if items.len() > 8 * PARALLEL { 4 * PARALLEL } else { items.len() };
    match len < items.len() {
        true => par::map_blocks(items.len(), len, |range| of(&items[range])),
        false => vec![of(items)],
    }
    .into_iter()
}

/// Bins of equal width along every axis.
struct Binning {
    low: Vec3,
    per_mm: Vec3,
    n: usize,
}

impl Binning {
    fn of(middles: &Bounds, n: usize) -> Self {
        Binning { low: middles.low, per_mm: n as f32 / (middles.high - middles.low), n }
    }

    /// Bin of a middle along every axis; 0 along axes in which all are equal.
    fn bin(&self, middle: Vec3) -> [usize; 3] {
        let along = (middle - self.low) * self.per_mm;
        each(along.to_array(), |along| (along as usize).min(self.n - 1))
    }
}

/// Numbers and boxes of the items in every bin of every axis.
struct Bins([[(u32, Bounds); BINS]; 3]);

impl Bins {
    const EMPTY: Bins = Bins([[(0, Bounds::NONE); BINS]; 3]);

    fn of(items: &[Item], binning: &Binning) -> Self {
        let mut bins = Bins::EMPTY;
        for item in items {
            for (axis, k) in binning.bin(item.middle()).into_iter().enumerate() {
                let (count, bounds) = &mut bins.0[axis][k];
                (*count, *bounds) = (*count + 1, bounds.with(item.low, item.high));
            }
        }
        bins
    }

    fn joined(mut self, other: Self) -> Self {
        for (bin, other) in self.0.as_flattened_mut().iter_mut().zip(other.0.as_flattened()) {
            *bin = (bin.0 + other.0, bin.1.with(other.1.low, other.1.high));
        }
        self
    }

    /// Calls `consider` with every bin after which an axis may be cut, what that costs, and the boxes of both sides.
    fn cuts(&self, axis: usize, n_bins: usize, mut consider: impl FnMut(usize, f32, [Bounds; 2])) {
        let bins = &self.0[axis][..n_bins];
        let mut right = [(0, Bounds::NONE); BINS + 1];
        for k in (0..n_bins).rev() {
            right[k] =
                (right[k + 1].0 + bins[k].0, right[k + 1].1.with(bins[k].1.low, bins[k].1.high));
        }
        let mut left = (0, Bounds::NONE);
        for k in 0..n_bins - 1 {
            left = (left.0 + bins[k].0, left.1.with(bins[k].1.low, bins[k].1.high));
            let ((n, a), (m, b)) = (left, right[k + 1]);
            if n > 0 && m > 0 {
                consider(k, n as f32 * a.area() + m as f32 * b.area(), [a, b]);
            }
        }
    }
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
