//! Occlusion points: the share of the obstacles that collide most often.

use crate::answers::mark_top_share;

/// Marks the `ceil(share·n)` entries of greatest `beta`, lower index first among equals, never a zero.
///
/// `share` is in (0, 1]; a product within 1e-9 above a whole number counts as that number.
pub fn occlusion_points(beta: &[u64], share: f64) -> Vec<bool> {
    let mut marks = mark_top_share(beta, share, u64::cmp);
    marks.iter_mut().zip(beta).for_each(|(marked, &beta)| *marked &= beta > 0);
    marks
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
