//! Groups of cutters with the same reference points, whose answers bound each other, and the order to compute them in.

use super::problem::PlacedCutter;
use std::collections::VecDeque;

/// Marks the cutters that share their reference points with others. The order to query them in: group by group; of
/// a group the shortest and the longest cutter first and then those between, so that most of what is open
/// for one is decided by another that contains it or that it contains.
pub(super) fn group_by_reference_point(cutters: &mut [PlacedCutter]) -> Vec<usize> {
    let mut order = Vec::with_capacity(cutters.len());
    for first in 0..cutters.len() {
        if order.contains(&first) {
            continue;
        }
        let shares = |&c: &usize| cutters[c].shares_reference_points(&cutters[first]);
        let mut group: Vec<usize> = (first..cutters.len()).filter(shares).collect();
        if group.len() > 1 {
            group.iter().for_each(|&c| cutters[c].group = Some(first));
            let length = |c: usize| cutters[c].steps.last().map_or(0.0, |step| step.height);
            group.sort_by(|&a, &b| length(a).total_cmp(&length(b)));
        }
        order.extend(bisection_order(&group));
    }
    order
}

/// The first and the last, then the middle one between them, and so on.
fn bisection_order(items: &[usize]) -> Vec<usize> {
    let [first, between @ .., last] = items else { return items.to_vec() };
    let mut order = vec![*first, *last];
    let mut gaps = VecDeque::from([between]);
    while let Some(gap) = gaps.pop_front() {
        let (before, after) = gap.split_at(gap.len() / 2);
        if let [middle, after @ ..] = after {
            order.push(*middle);
            gaps.extend([before, after]);
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cutter_comes_once_and_ends_come_first() {
        for n in 0..20 {
            let order = bisection_order(&(0..n).collect::<Vec<_>>());
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..n), "{order:?}");
        }
        assert_eq!(bisection_order(&[7, 5, 3, 2, 1]), [7, 1, 3, 5, 2]);
    }
}
