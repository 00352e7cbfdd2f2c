//! A spatial order: neighbours in the list are neighbours in space.
//!
//! The compact order is built like a k-d tree whose nodes are runs of `8·2^k` points starting at a multiple
//! of their length, so every aligned run of 8, 64, 512, … points is a compact node and needs no pointers. The
//! quick order follows a curve that fills space; it is found sooner, and its runs are less compact.

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
    pub fn compact(scene: &Scene) -> Self {
        Order::by(scene, compact_order)
    }

    pub fn quick(scene: &Scene) -> Self {
        Order::by(scene, quick_order)
    }

    fn by(scene: &Scene, order: impl Fn(&[Vec3]) -> Vec<u32>) -> Self {
        let queries = order(&scene.points);
        let all = &scene.obstacles;
        if !scene.own.is_empty() && scene.own.len() == all.n {
            return Order { obstacles: queries.clone(), queries };
        }
        let obstacles: Vec<Vec3> = (0..all.n).map(|j| Vec3::from(all.get(j))).collect();
        Order { queries, obstacles: order(&obstacles) }
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

/// Bits of a coordinate in the quick order.
const BITS: u32 = 10;

/// Entry `p` is the index of the point that comes `p`-th along a Z-order curve.
fn quick_order(points: &[Vec3]) -> Vec<u32> {
    let first = points.first().copied().unwrap_or_default();
    let bounds = |(lo, hi): (Vec3, Vec3), &point: &Vec3| (lo.min(point), hi.max(point));
    let (lo, hi) = points.iter().fold((first, first), bounds);
    let per_mm = ((1 << BITS) as f32 / (hi - lo).max_element()).min(f32::MAX);
    let along_curve = |&point: &Vec3| {
        let cell =
            ((point - lo) * per_mm).to_array().map(|along| (along as u32).min((1 << BITS) - 1));
        cell.into_iter().zip(0..).map(|(along, axis)| every_third_bit(along) << axis).sum::<u32>()
    };
    let mut items: Vec<(u32, u32)> = points.iter().map(along_curve).zip(0..).collect();
    let mut sorted = vec![(0, 0); items.len()];
    for digit in 0..3 {
        let digit = |key: u32| (key >> (digit * BITS)) as usize % (1 << BITS);
        let mut next = [0; 1 << BITS];
        items.iter().for_each(|&(key, _)| next[digit(key)] += 1);
        let mut sum = 0;
        for next in &mut next {
            (*next, sum) = (sum, sum + *next);
        }
        for &item in &items {
            let next = &mut next[digit(item.0)];
            sorted[*next] = item;
            *next += 1;
        }
        std::mem::swap(&mut items, &mut sorted);
    }
    items.into_iter().map(|(_, index)| index).collect()
}

/// Bit `b` moves to place `3·b`, for ten bits.
fn every_third_bit(bits: u32) -> u32 {
    let bits = (bits | bits << 16) & 0x0300_00ff;
    let bits = (bits | bits << 8) & 0x0300_f00f;
    let bits = (bits | bits << 4) & 0x030c_30c3;
    (bits | bits << 2) & 0x0924_9249
}

/// Entry `p` is the index of the point that comes `p`-th in the k-d tree.
fn compact_order(points: &[Vec3]) -> Vec<u32> {
    let mut items: Vec<(Vec3, u32)> = points.iter().copied().zip(0..).collect();
    split(&mut items);
    items.into_iter().map(|(_, index)| index).collect()
}

/// Below this many points one thread goes on alone.
const PARALLEL: usize = 1 << 12;

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
            for (order, slack) in [(compact_order(&points), 8.0), (quick_order(&points), 64.0)] {
                let mut sorted = order.clone();
                sorted.sort_unstable();
                assert!(sorted.into_iter().eq(0..n as u32));
                let volume = |run: &[u32]| {
                    let points = run.iter().map(|&i| points[i as usize]);
                    let lo = points.clone().fold(Vec3::ONE, Vec3::min);
                    let hi = points.fold(Vec3::ZERO, Vec3::max);
                    (hi - lo).element_product() * n as f32 / run.len() as f32
                };
                let volumes = order.chunks(64).map(volume);
                assert!(volumes.fold(0.0, f32::max) <= slack, "{n}");
            }
        }
    }
}
