//! A k-d tree over points: nearest neighbors, and all within a radius.
//!
//! Points of a surface fill few cells of a uniform grid, and mesh vertices are anything but uniform; a tree does not
//! mind either. Splitting at the median makes the shape a function of the number of points alone, so a node is its
//! number and a range. Building costs n log n, a query on a surface about log n.

use glam::DVec3;
use std::ops::Range;

/// Most points in a leaf.
const LEAF: usize = 8;

/// Points sorted for spatial queries; answers are indices into the slice it was built from.
pub(crate) struct KdTree {
    points: Vec<DVec3>,
    order: Vec<u32>,
    /// Inner nodes; children of `i` are `2i + 1` and `2i + 2`.
    splits: Vec<InnerNode>,
}

/// An inner node.
#[derive(Clone, Copy, Default)]
struct InnerNode {
    axis: u8,
    value: f64,
    /// Least index of its points.
    least: u32,
}

/// What a query still looks for: points nearer than this, or as near with an index that is not greater.
struct SearchBound {
    squared: f64,
    index: u32,
    /// On which side to begin where the query lies on the split: the low side has the lower indices of equal points.
    low_first: bool,
}

impl SearchBound {
    /// For nearest points: of equal ones those with the lowest indices are found first.
    fn nearest(radius: f64) -> Self {
        SearchBound { squared: radius * radius, index: u32::MAX, low_first: true }
    }

    /// For all points: sums over them depend on the order, which is that of the high side first.
    fn all_within(radius: f64) -> Self {
        SearchBound { low_first: false, ..SearchBound::nearest(radius) }
    }

    fn lower(&mut self, (squared, index): (f64, u32)) {
        (self.squared, self.index) = (squared, index);
    }

    /// Whether points at a squared distance of at least this, with at least this index, may be among them.
    fn admits(&self, squared: f64, least: u32) -> bool {
        squared < self.squared || squared == self.squared && least <= self.index
    }
}

impl KdTree {
    /// `points` must be finite and at most `u32::MAX` many.
    pub fn build(points: &[DVec3]) -> Self {
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut splits = Vec::new();
        split(points, &mut order, 0, &mut splits);
        KdTree { points: order.iter().map(|&i| points[i as usize]).collect(), order, splits }
    }

    /// Indices in tree order: neighbors in the list are near each other in space.
    pub fn into_order(self) -> Vec<u32> {
        self.order
    }

    /// The accepted point nearest to `q`, at most `radius` away, and its squared distance (ties:
    /// lower index).
    pub fn nearest(
        &self,
        q: DVec3,
        radius: f64,
        accept: impl Fn(u32) -> bool,
    ) -> Option<(u32, f64)> {
        let mut best = (u32::MAX, radius * radius);
        let mut show = |i: u32, d2: f64, limit: &mut SearchBound| {
            if (d2 < best.1 || d2 == best.1 && i < best.0) && accept(i) {
                best = (i, d2);
                limit.lower((d2, i));
            }
        };
        self.visit(0, 0..self.order.len(), q, &mut show, &mut SearchBound::nearest(radius));
        (best.0 != u32::MAX).then_some(best)
    }

    /// The `k` accepted points nearest to `q`, nearest first (ties: lower index); fewer if there are not as many.
    pub fn k_nearest(&self, q: DVec3, k: usize, accept: impl Fn(u32) -> bool) -> Vec<u32> {
        let found = self.k_nearest_within(q, k, f64::INFINITY, accept);
        found.into_iter().map(|(_, i)| i).collect()
    }

    /// Those of [`KdTree::k_nearest`] that are at most `radius` away, with their squared distances.
    pub fn k_nearest_within(
        &self,
        q: DVec3,
        k: usize,
        radius: f64,
        accept: impl Fn(u32) -> bool,
    ) -> Vec<(f64, u32)> {
        let mut best: Vec<(f64, u32)> = Vec::with_capacity(k + 1);
        let mut show = |i: u32, d2: f64, limit: &mut SearchBound| {
            if !limit.admits(d2, i) {
                return;
            }
            let place = best.partition_point(|found| *found < (d2, i));
            if place < k && accept(i) {
                best.insert(place, (d2, i));
                best.truncate(k);
                if best.len() == k {
                    limit.lower(best[k - 1]);
                }
            }
        };
        self.visit(0, 0..self.order.len(), q, &mut show, &mut SearchBound::nearest(radius));
        best
    }

    /// Calls `found(index, squared distance)` for every point within `radius` of `q`, in a fixed order.
    pub fn within(&self, q: DVec3, radius: f64, mut found: impl FnMut(u32, f64)) {
        let mut show = |i: u32, d2: f64, limit: &mut SearchBound| {
            if d2 <= limit.squared {
                found(i, d2);
            }
        };
        self.visit(0, 0..self.order.len(), q, &mut show, &mut SearchBound::all_within(radius));
    }

    /// Shows every point of a leaf that may be within `limit` of `q`.
    fn visit(
        &self,
        node: usize,
        range: Range<usize>,
        q: DVec3,
        show: &mut impl FnMut(u32, f64, &mut SearchBound),
        limit: &mut SearchBound,
    ) {
        if range.len() <= LEAF {
            for at in range {
                show(self.order[at], self.points[at].distance_squared(q), limit);
            }
            return;
        }
        let InnerNode { axis, value, least } = self.splits[node];
        if !limit.admits(0.0, least) {
            return;
        }
        let middle = range.start + range.len() / 2;
        let beyond = q[axis as usize] - value;
        let low = (2 * node + 1, range.start..middle);
        let high = (2 * node + 2, middle..range.end);
        let begins_low = beyond < 0.0 || beyond == 0.0 && limit.low_first;
        let (near, far) = if begins_low { (low, high) } else { (high, low) };
        self.visit(near.0, near.1, q, show, limit);
        if limit.admits(beyond * beyond, least) {
            self.visit(far.0, far.1, q, show, limit);
        }
    }
}

fn split(points: &[DVec3], order: &mut [u32], node: usize, splits: &mut Vec<InnerNode>) {
    if order.len() <= LEAF {
        return;
    }
    let first = points[order[0] as usize];
    let (low, high) = order.iter().fold((first, first), |(low, high), &i| {
        (low.min(points[i as usize]), high.max(points[i as usize]))
    });
    let axis = (high - low).max_position();
    let least = order.iter().copied().min().unwrap_or_default();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&i, &j| {
        let (x, y) = (points[i as usize][axis], points[j as usize][axis]);
        x.total_cmp(&y).then(i.cmp(&j))
    });
    if splits.len() <= node {
        splits.resize(node + 1, InnerNode::default());
    }
    let value = points[order[middle] as usize][axis];
    splits[node] = InnerNode { axis: axis as u8, value, least };
    let (left, right) = order.split_at_mut(middle);
    split(points, left, 2 * node + 1, splits);
    split(points, right, 2 * node + 2, splits);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Sites are moved by sums over such lists: another order gives other bits.
    #[test]
    fn points_within_a_radius_come_in_one_order() {
        let lattice = |i: usize| DVec3::new((i % 4) as f64, (i / 4) as f64, 0.0);
        let tree = KdTree::build(&(0..16).map(lattice).collect::<Vec<_>>());
        let mut found = Vec::new();
        // On the first split: from the other side it would be 9, 6, 10, 14, 11.
        tree.within(lattice(10), 1.0, |i, _| found.push(i));
        assert_eq!(found, [6, 10, 14, 11, 9]);
    }

    /// Points that coincide are not all looked at by each query.
    #[test]
    fn queries_among_equal_points_take_no_longer() {
        let n = 200_000;
        let tree = KdTree::build(&vec![DVec3::ONE; n]);
        for i in 0..n as u32 {
            let others = |j: u32| j != i;
            let expected: Vec<u32> = (0..4).filter(|j| *j != i).take(3).collect();
            assert_eq!(tree.k_nearest(DVec3::ONE, 3, others), expected);
            assert_eq!(tree.nearest(DVec3::ONE, 1.0, others), Some((expected[0], 0.0)));
        }
    }

    proptest! {
        #[test]
        fn queries_equal_brute_force(
            cells in prop::collection::vec([0i32..6, 0i32..6, 0i32..3], 0..200),
            q in [-1.0f64..7.0, -1.0f64..7.0, -1.0f64..4.0],
            radius in 0.1f64..4.0,
        ) {
            let points: Vec<DVec3> = cells.iter().map(|c| DVec3::from_array(c.map(f64::from))).collect();
            let (tree, q) = (KdTree::build(&points), DVec3::from_array(q));
            let odd = |i: u32| i % 2 == 1;
            let squares = points.iter().enumerate().map(|(i, p)| (p.distance_squared(q), i as u32));
            let near: Vec<(f64, u32)> = squares.filter(|(d2, _)| *d2 <= radius * radius).collect();
            let nearest = near.iter().copied().filter(|(_, i)| odd(*i)).min_by(|x, y| x.partial_cmp(y).unwrap());
            prop_assert_eq!(tree.nearest(q, radius, odd), nearest.map(|(d2, i)| (i, d2)));
            let mut found = Vec::new();
            tree.within(q, radius, |i, d2| found.push((d2, i)));
            found.sort_by_key(|&(_, i)| i);
            prop_assert_eq!(&found, &near);
            for k in [0, 1, 7, 300] {
                let squares = points.iter().enumerate().map(|(i, p)| (p.distance_squared(q), i as u32));
                let mut all: Vec<(f64, u32)> = squares.filter(|(_, i)| odd(*i)).collect();
                all.sort_by(|x, y| x.partial_cmp(y).unwrap());
                let nearest: Vec<u32> = all.into_iter().map(|(_, i)| i).take(k).collect();
                prop_assert_eq!(tree.k_nearest(q, k, odd), nearest);
                let mut within: Vec<_> = near.iter().copied().filter(|(_, i)| odd(*i)).collect();
                within.sort_by(|x, y| x.partial_cmp(y).unwrap());
                within.truncate(k);
                prop_assert_eq!(tree.k_nearest_within(q, k, radius, odd), within);
            }
        }
    }
}
