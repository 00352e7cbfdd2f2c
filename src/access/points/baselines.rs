//! Baselines for both labels that test no collision: the highest sites, and the sites whose normal points down.
//!
//! On the upper hemisphere β is mostly height, so [`highest`] alone finds most occlusion points; and a
//! site that faces down is mostly out of reach, so [`facing_away`] alone finds many inaccessible ones. An
//! accuracy means something only beside theirs.

use crate::answers::mark_top_share;
use glam::Vec3;

/// Marks the `ceil(share·n)` points of greatest z, lower index first among equals: the baseline for
/// occlusion points. `share` is in (0, 1].
pub fn highest(points: &[Vec3], share: f64) -> Vec<bool> {
    mark_top_share(points, share, |a, b| a.z.total_cmp(&b.z))
}

/// Marks the normals with `n.z < min_z`: the baseline for inaccessible sites. `min_z = 0` marks what
/// faces down; [`best_facing`] fits it.
pub fn facing_away(normals: &[Vec3], min_z: f32) -> Vec<bool> {
    normals.iter().map(|n| n.z < min_z).collect()
}

/// The `min_z` for which [`facing_away`] reaches the greatest F1 against `inaccessible` on these very
/// sites: more than the baseline deserves, so that beating it means something.
///
/// Ties go to the lower threshold; −∞ (nothing marked) if no site is inaccessible.
///
/// # Panics
/// If there are not as many labels as normals.
pub fn best_facing(normals: &[Vec3], inaccessible: &[bool]) -> f32 {
    assert_eq!(normals.len(), inaccessible.len(), "as many labels as normals");
    let mut sites: Vec<(f32, bool)> =
        normals.iter().map(|n| n.z).zip(inaccessible.iter().copied()).collect();
    sites.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let positives = sites.iter().filter(|site| site.1).count();
    let (mut best, mut best_min_z, mut hits) = (0.0, f32::NEG_INFINITY, 0);
    for (marked, site) in sites.iter().enumerate() {
        // Everything before this site is marked when the threshold is its own z.
        let f1 = 2.0 * hits as f64 / (marked + positives).max(1) as f64;
        let new_value = marked == 0 || sites[marked - 1].0 < site.0;
        if new_value && f1 > best {
            (best, best_min_z) = (f1, site.0);
        }
        hits += usize::from(site.1);
    }
    let f1_of_all = 2.0 * hits as f64 / (sites.len() + positives).max(1) as f64;
    if f1_of_all > best { f32::INFINITY } else { best_min_z }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highest_tenth_is_marked_and_ties_go_to_the_lower_index() {
        let points: Vec<Vec3> = [1.0, 3.0, 3.0, 3.0, 0.0].map(|z| Vec3::new(9.0, 9.0, z)).to_vec();
        assert_eq!(highest(&points, 0.4), [false, true, true, false, false]);
        assert_eq!(highest(&points, 1.0), [true; 5]);
        assert!(highest(&[], 0.1).is_empty());
    }

    #[test]
    fn the_fitted_threshold_separates_what_can_be_separated() {
        let normals: Vec<Vec3> = [-1.0, -0.5, 0.0, 0.5, 1.0]
            .map(|z| Vec3::new((1.0f32 - z * z).sqrt(), 0.0, z))
            .to_vec();
        let labels = [true, true, false, false, false];
        assert_eq!(facing_away(&normals, best_facing(&normals, &labels)), labels);
        assert_eq!(best_facing(&normals, &[false; 5]), f32::NEG_INFINITY);
        assert_eq!(best_facing(&normals, &[true; 5]), f32::INFINITY);
        assert_eq!(facing_away(&normals, 0.0), labels);
    }
}
