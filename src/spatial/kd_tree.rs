//! A k-d tree over points: nearest neighbors, and all within a radius.
//!
//! Points of a surface fill few cells of a uniform grid, and mesh vertices are anything but uniform;
//! a tree does not mind either. Splitting at the median makes the shape a function of the number of points alone, so a node is
//! its number and a range. Building costs n log n, a query on a surface about log n.

use glam::DVec3;
use std::ops::Range;

/// Most points in a leaf.
const LEAF: usize = 8;

/// Points sorted for spatial queries; answers are indices into the slice it was built from.
pub(crate) struct KdTree {
    points: Vec<DVec3>,
    order: Vec<u32>,
    /// Axis and value of the split of each inner node; children of `i` are `2i + 1` and `2i + 2`.
    splits: Vec<(u8, f64)>,
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
        let mut limit = best.1;
        self.visit(
            0,
            0..self.order.len(),
            q,
            &mut |i, d2, limit| {
                if (d2 < best.1 || d2 == best.1 && i < best.0) && accept(i) {
                    best = (i, d2);
                    *limit = d2;
                }
            },
            &mut limit,
        );
        (best.0 != u32::MAX).then_some(best)
    }

    /// The `k` accepted points nearest to `q`, nearest first (ties: lower index); fewer if there are not as many.
    pub fn k_nearest(&self, q: DVec3, k: usize, accept: impl Fn(u32) -> bool) -> Vec<u32> {
        let mut best: Vec<(f64, u32)> = Vec::with_capacity(k + 1);
        let mut show = |i: u32, d2: f64, limit: &mut f64| {
            let place = best.partition_point(|found| *found < (d2, i));
            if place < k && accept(i) {
                best.insert(place, (d2, i));
                best.truncate(k);
                if best.len() == k {
                    *limit = best[k - 1].0;
                }
            }
        };
        let mut limit = f64::INFINITY;
        self.visit(0, 0..self.order.len(), q, &mut show, &mut limit);
        best.into_iter().map(|(_, i)| i).collect()
    }

    /// Calls `found(index, squared distance)` for every point within `radius` of `q`, in a fixed order.
    pub fn within(&self, q: DVec3, radius: f64, mut found: impl FnMut(u32, f64)) {
        let mut limit = radius * radius;
        self.visit(
            0,
            0..self.order.len(),
            q,
            &mut |i, d2, limit| {
                if d2 <= *limit {
                    found(i, d2);
                }
            },
            &mut limit,
        );
    }

    /// Shows every point of a leaf that the ball around `q` with squared radius `limit` may reach.
    fn visit(
        &self,
        node: usize,
        range: Range<usize>,
        q: DVec3,
        show: &mut impl FnMut(u32, f64, &mut f64),
        limit: &mut f64,
    ) {
        if range.len() <= LEAF {
            for at in range {
                show(self.order[at], self.points[at].distance_squared(q), limit);
            }
            return;
        }
        let middle = range.start + range.len() / 2;
        let (axis, value) = self.splits[node];
        let beyond = q[axis as usize] - value;
        let low = (2 * node + 1, range.start..middle);
        let high = (2 * node + 2, middle..range.end);
        let (near, far) = if beyond < 0.0 { (low, high) } else { (high, low) };
        self.visit(near.0, near.1, q, show, limit);
        if beyond * beyond <= *limit {
            self.visit(far.0, far.1, q, show, limit);
        }
    }
}

fn split(points: &[DVec3], order: &mut [u32], node: usize, splits: &mut Vec<(u8, f64)>) {
    if order.len() <= LEAF {
        return;
    }
    let first = points[order[0] as usize];
    let (low, high) = order.iter().fold((first, first), |(low, high), &i| {
        (low.min(points[i as usize]), high.max(points[i as usize]))
    });
    let axis = (high - low).max_position();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&i, &j| {
        let (x, y) = (points[i as usize][axis], points[j as usize][axis]);
        x.total_cmp(&y).then(i.cmp(&j))
    });
    if splits.len() <= node {
        splits.resize(node + 1, (0, 0.0));
    }
    splits[node] = (axis as u8, points[order[middle] as usize][axis]);
    let (left, right) = order.split_at_mut(middle);
    split(points, left, 2 * node + 1, splits);
    split(points, right, 2 * node + 2, splits);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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
            prop_assert_eq!(found, near);
            for k in [0, 1, 7, 300] {
                let squares = points.iter().enumerate().map(|(i, p)| (p.distance_squared(q), i as u32));
                let mut all: Vec<(f64, u32)> = squares.filter(|(_, i)| odd(*i)).collect();
                all.sort_by(|x, y| x.partial_cmp(y).unwrap());
                let nearest: Vec<u32> = all.into_iter().map(|(_, i)| i).take(k).collect();
                prop_assert_eq!(tree.k_nearest(q, k, odd), nearest);
            }
        }
    }
}
