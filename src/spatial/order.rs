//! Spatial orders: neighbors in the list are neighbors in space.

use super::counting_sort::CountingSort;
use super::morton;
use crate::exec::par;
use glam::Vec3;

/// Bits of a coordinate in the Z-order, and of a digit of the sort.
const BITS: u32 = 10;

/// Entry `p` is the index of the point that comes `p`-th along a Z-order curve of ten bits per axis; linear time.
pub fn z_order(points: &[Vec3]) -> Vec<u32> {
    let first = points.first().copied().unwrap_or_default();
    let bounds = |(lo, hi): (Vec3, Vec3), &point: &Vec3| (lo.min(point), hi.max(point));
    let (lo, hi) = points.iter().fold((first, first), bounds);
    let per_mm = ((1 << BITS) as f32 / (hi - lo).max_element()).min(f32::MAX);
    let along_curve = |&point: &Vec3| {
        let cell =
            ((point - lo) * per_mm).to_array().map(|along| (along as u32).min((1 << BITS) - 1));
        morton::encode(cell) as u32
    };
    let mut items: Vec<(u32, u32)> = points.iter().map(along_curve).zip(0..).collect();
    let mut sorted = vec![(0, 0); items.len()];
    let mut sort = CountingSort::default();
    for digit in 0..3 {
        let digit = |key: u32| (key >> (digit * BITS)) as usize % (1 << BITS);
        sort.clear(1 << BITS);
        items.iter().for_each(|&(key, _)| sort.count(digit(key)));
        sort.finish_counting();
        items.iter().for_each(|&item| sorted[sort.place(digit(item.0))] = item);
        std::mem::swap(&mut items, &mut sorted);
    }
    items.into_iter().map(|(_, index)| index).collect()
}

/// Entry `p` is the index of the point that comes `p`-th in a k-d tree whose nodes are runs of `8·2^k` points
/// starting at a multiple of their length: every aligned run of 8, 64, 512, … points is a compact node and needs
/// no pointers.
pub fn k_d_runs(points: &[Vec3]) -> Vec<u32> {
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
    use crate::numeric::rng::{Purpose, Stream};

    #[test]
    fn every_point_comes_once_and_runs_are_compact() {
        for n in [0, 1, 8, 9, 16, 17, 64, 65, 1000, 20_000] {
            let mut stream = Stream::new(n as u64, 0, 0, Purpose::Probe);
            let mut at = || stream.unit() as f32;
            let points: Vec<Vec3> = (0..n).map(|_| Vec3::new(at(), at(), at())).collect();
            for (order, slack) in [(k_d_runs(&points), 8.0), (z_order(&points), 64.0)] {
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
