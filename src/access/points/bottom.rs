//! The bottom rule of the published definition.

/// The sites of the bottom rule: lower than the lowest one plus `bottom_mm`. Points are in mm.
///
/// ```
/// use deepmill::access::bottom_sites;
/// use deepmill::glam::Vec3;
/// let points = [0.0, 0.5, 1.0, 7.0].map(|z| Vec3::new(0.0, 0.0, z - 3.0));
/// assert_eq!(bottom_sites(&points, 1.0), [true, true, false, false]);
/// ```
pub fn bottom_sites(points: &[glam::Vec3], bottom_mm: f64) -> Vec<bool> {
    let lowest = points.iter().fold(f64::INFINITY, |lowest, p| lowest.min(f64::from(p.z)));
    points.iter().map(|p| f64::from(p.z) < lowest + bottom_mm).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn the_bottom_is_measured_from_the_lowest_site() {
        let points = [Vec3::new(9.0, 0.0, -4.0), Vec3::new(0.0, 0.0, -3.0), Vec3::ZERO];
        assert_eq!(bottom_sites(&points, 1.0), [true, false, false], "lower than, not at");
        assert_eq!(bottom_sites(&points, 5.0), [true; 3]);
        assert_eq!(bottom_sites(&[], 1.0), [false; 0]);
    }
}
