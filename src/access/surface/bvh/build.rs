//! The tree is built from the top, by the surface-area heuristic over sixteen bins (Wald 2007, On fast construction of SAH-based
//! bounding volume hierarchies).

use super::{LEAF, Node, WIDTH};
use crate::par;
use glam::{DVec3, Vec3};

/// Below this many triangles one thread goes on alone.
pub(super) const PARALLEL: usize = 1 << 12;
/// Bins along an axis.
const BINS: usize = 16;

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

/// The nodes of a tree over `items`, root first; leaves count places from `start`.
pub(super) fn build(items: &mut [Item], start: usize) -> Vec<Node> {
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
