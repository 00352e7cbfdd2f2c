//! Occlusion points: the share of the obstacles that collide most often.

use crate::access::labels::LabelOptions;
use crate::answers::{mark_top, mark_top_share};

/// Marks the `ceil(share·n)` entries of greatest `beta`, lower index first among equals, never a zero.
///
/// `share` is in (0, 1]; a product within 1e-9 above a whole number counts as that number.
pub fn occlusion_points(beta: &[u64], share: f64) -> Vec<bool> {
    let mut marks = mark_top_share(beta, share, u64::cmp);
    marks.iter_mut().zip(beta).for_each(|(marked, &beta)| *marked &= beta > 0);
    marks
}

/// Places of the ranked sites that are not at the bottom, ascending; `bottom` is empty without a bottom rule.
pub(super) fn above_bottom(n_ranked: usize, bottom: &[bool]) -> Vec<usize> {
    (0..n_ranked).filter(|&i| !bottom.get(i).copied().unwrap_or(false)).collect()
}

/// Occlusion points by the options: of the ranked obstacles, without those at the bottom.
pub(super) fn occlusion_points_above(
    beta: &[u64],
    bottom: &[bool],
    options: &LabelOptions,
) -> Vec<bool> {
    let ranked = above_bottom(beta.len(), bottom);
    let of_ranked: Vec<u64> = ranked.iter().map(|&j| beta[j]).collect();
    let wanted = options.rounding.n_of_share(options.share, ranked.len());
    let mut marks = vec![false; beta.len()];
    for (&j, marked) in ranked.iter().zip(mark_top(&of_ranked, wanted, u64::cmp)) {
        marks[j] = marked && beta[j] > 0;
    }
    marks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::Rounding;

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

    #[test]
    fn without_a_bottom_and_rounded_up_both_rules_are_one() {
        let beta = [5, 9, 9, 0, 9, 1, 0, 0, 0, 0, 0];
        for share in [0.1, 0.3, 1.0] {
            let options = LabelOptions { share, ..LabelOptions::default() };
            assert_eq!(
                occlusion_points_above(&beta, &[], &options),
                occlusion_points(&beta, share)
            );
        }
    }

    #[test]
    fn what_is_at_the_bottom_is_neither_marked_nor_counted() {
        let beta = [9, 8, 7, 6, 5, 4, 3, 2, 1, 1, 1];
        let mut bottom = [false; 11];
        bottom[0] = true;
        bottom[2] = true;
        let marked = |share, rounding| {
            let options = LabelOptions { share, rounding, ..LabelOptions::default() };
            let marks = occlusion_points_above(&beta, &bottom, &options);
            (0..11).filter(|&i| marks[i]).collect::<Vec<_>>()
        };
        assert_eq!(marked(0.3, Rounding::Floor), [1, 3], "floor(2.7) = 2");
        assert_eq!(marked(0.3, Rounding::Ceil), [1, 3, 4]);
        assert!(marked(0.1, Rounding::Floor).is_empty(), "floor(0.9) = 0");
    }
}
