//! Occlusion points: the share of the obstacles that collide most often.

/// Marks the `ceil(share·n)` entries of greatest `beta`, lower index first among equals, never a zero.
///
/// `share` is in (0, 1]; a product within 1e-9 above a whole number counts as that number.
pub fn occlusion_points(beta: &[u64], share: f64) -> Vec<bool> {
    let wanted = n_wanted(beta.len(), share);
    let mut order: Vec<u32> = (0..beta.len() as u32).filter(|&j| beta[j as usize] > 0).collect();
    let rank = |&j: &u32| (std::cmp::Reverse(beta[j as usize]), j);
    if wanted < order.len() {
        order.select_nth_unstable_by_key(wanted, rank);
        order.truncate(wanted);
    }
    let mut marks = vec![false; beta.len()];
    order.into_iter().for_each(|j| marks[j as usize] = true);
    marks
}

/// `ceil(share·n)`, forgiving rounding.
pub(super) fn n_wanted(n: usize, share: f64) -> usize {
    (share * n as f64 - 1e-9).ceil().max(0.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_greatest_tenth_is_marked_and_ties_go_to_the_lower_index() {
        let beta = [5, 9, 9, 0, 9, 1, 0, 0, 0, 0, 0];
        let marked = |share| {
            let marks = occlusion_points(&beta, share);
            (0..11).filter(|&i| marks[i]).collect::<Vec<_>>()
        };
        assert_eq!(marked(0.1), [1, 2], "ceil(1.1) = 2");
        assert_eq!(marked(0.3), [0, 1, 2, 4]);
        assert_eq!(marked(1.0), [0, 1, 2, 4, 5], "zeros are never marked");
        assert!(occlusion_points(&[], 0.1).is_empty());
        assert_eq!(occlusion_points(&[1; 30], 0.1).iter().filter(|&&m| m).count(), 3);
    }
}
