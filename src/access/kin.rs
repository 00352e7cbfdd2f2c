//! Which cutters of a call can learn from each other, and in which order to ask them.

use super::problem::Tool;
use std::collections::VecDeque;

/// Marks the tools that share their reference points with others. The order to ask them in: kin one after the
/// other, of these the shortest and the longest first and then those between, so that most of what is in question
/// for one is decided by another that holds it or that it holds.
pub(super) fn acquaint(tools: &mut [Tool]) -> Vec<usize> {
    let mut order = Vec::with_capacity(tools.len());
    for first in 0..tools.len() {
        if order.contains(&first) {
            continue;
        }
        let kin = (first..tools.len()).filter(|&t| tools[t].is_kin(&tools[first]));
        let mut kin: Vec<usize> = kin.collect();
        if kin.len() > 1 {
            kin.iter().for_each(|&t| tools[t].kin = Some(first));
            let length = |t: usize| tools[t].steps.last().map_or(0.0, |step| step.height);
            kin.sort_by(|&a, &b| length(a).total_cmp(&length(b)));
        }
        order.extend(ends_first(&kin));
    }
    order
}

/// The first and the last, then the middle one between them, and so on.
fn ends_first(tools: &[usize]) -> Vec<usize> {
    let [first, between @ .., last] = tools else { return tools.to_vec() };
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
    fn every_tool_comes_once_and_ends_come_first() {
        for n in 0..20 {
            let order = ends_first(&(0..n).collect::<Vec<_>>());
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..n), "{order:?}");
        }
        assert_eq!(ends_first(&[7, 5, 3, 2, 1]), [7, 1, 3, 5, 2]);
    }
}
