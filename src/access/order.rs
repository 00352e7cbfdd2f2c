//! A spatial order: neighbours in the list are neighbours in space.
//!
//! Built like a k-d tree whose nodes are runs of `8·2^k` points starting at a multiple of their
//! length, so every aligned run of 8, 64, 512, … points is a compact node and needs no pointers.

use super::labels::Labels;
use super::problem::Scene;
use crate::par;
use glam::Vec3;

/// Which query and obstacle, as given, comes at each place of the spatial order.
pub(super) struct Order {
    pub queries: Vec<u32>,
    pub obstacles: Vec<u32>,
}

impl Order {
    pub fn of(scene: &Scene) -> Self {
        let queries = spatial_order(scene.points.iter().copied());
        let all = &scene.obstacles;
        if !scene.own.is_empty() && scene.own.len() == all.n {
            return Order { obstacles: queries.clone(), queries };
        }
        let obstacles = spatial_order((0..all.n).map(|j| Vec3::from(all.get(j))));
        Order { queries, obstacles }
    }

    /// One value per query in the order of the question.
    pub fn restore_queries<T: Copy + Default>(&self, values: Vec<T>) -> Vec<T> {
        scatter(&self.queries, values)
    }

    /// Labels in the order of the question.
    pub fn restore(&self, labels: Labels) -> Labels {
        Labels {
            inaccessible: scatter(&self.queries, labels.inaccessible),
            accessible_directions: scatter(&self.queries, labels.accessible_directions),
            witness: scatter(&self.queries, labels.witness),
            beta: scatter(&self.obstacles, labels.beta),
            reach: labels.reach.map(|reach| reach.reordered(&self.queries)),
            ..labels
        }
    }
}

fn scatter<T: Copy + Default>(order: &[u32], values: Vec<T>) -> Vec<T> {
    let mut restored = vec![T::default(); values.len()];
    values.into_iter().zip(order).for_each(|(value, &i)| restored[i as usize] = value);
    restored
}

/// Places of the points in spatial order: entry `p` is the index of the point that comes `p`-th.
fn spatial_order(points: impl ExactSizeIterator<Item = Vec3>) -> Vec<u32> {
    let mut items: Vec<(Vec3, u32)> = points.zip(0..).collect();
    split(&mut items);
    items.into_iter().map(|(_, index)| index).collect()
}

/// Below this many points one thread goes on alone.
const PARALLEL: usize = 1 << 14;

fn split(items: &mut [(Vec3, u32)]) {
    let n = items.len();
    if n <= 8 {
        return;
    }
    let left = 4 * n.div_ceil(8).next_power_of_two();
    let first = items[0].0;
    let bounds = |(lo, hi): (Vec3, Vec3), item: &(Vec3, u32)| (lo.min(item.0), hi.max(item.0));
    let (lo, hi) = items.iter().fold((first, first), bounds);
    let axis = (hi - lo).max_position();
    items.select_nth_unstable_by(left, |a, b| {
        a.0[axis].total_cmp(&b.0[axis]).then_with(|| a.1.cmp(&b.1))
    });
    let (low, high) = items.split_at_mut(left);
    if n > PARALLEL {
        par::join(|| split(low), || split(high));
    } else {
        split(low);
        split(high);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};

    #[test]
    fn every_point_comes_once_and_runs_are_compact() {
        for n in [0, 1, 8, 9, 16, 17, 64, 65, 1000, 20_000] {
            let mut stream = Stream::new(n as u64, 0, 0, Purpose::Probe);
            let mut at = || stream.unit() as f32;
            let points: Vec<Vec3> = (0..n).map(|_| Vec3::new(at(), at(), at())).collect();
            let order = spatial_order(points.iter().copied());
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..n as u32));
            for run in order.chunks(64) {
                let fraction = run.len() as f32 / n as f32;
                let points = run.iter().map(|&i| points[i as usize]);
                let lo = points.clone().fold(Vec3::ONE, Vec3::min);
                let hi = points.fold(Vec3::ZERO, Vec3::max);
                assert!((hi - lo).element_product() <= 8.0 * fraction, "{n}: {lo} {hi}");
            }
        }
    }
}
