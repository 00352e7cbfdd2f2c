//! The sheet test: whether two points of a surface are neighbors along it rather than across a wall or a gap.

use glam::DVec3;

/// Cosine of the angle between two normals (143°) from which on they face opposite ways: the two
/// sides of a wall or of a gap, or of an edge sharper than 37°.
pub(crate) const OPPOSITE: f64 = -0.8;
/// Sine of the angle by which the chord between two points may rise above the surface more than the
/// fold between their normals explains.
const RISE: f64 = 0.3;

/// Whether two points with unit normals `m` and `n`, `chord` apart, are on one sheet of a surface.
///
/// They are not if their normals are more than 143° apart (opposite sides of a wall or a gap), or if
/// the chord leaves the surface too steeply: on an arc it is perpendicular to `m + n`, across an edge
/// folded by θ the sine of its rise is at most sin(θ/2) = |m − n|/2, and a rise of 0.3 more than
/// that means another sheet above this one, such as the next fin of a heat sink.
pub fn same_sheet(chord: DVec3, m: DVec3, n: DVec3) -> bool {
    let (sum, fold) = (m + n, 0.5 * (m - n).length());
    m.dot(n) > OPPOSITE
        && chord.dot(sum).abs()
            <= (fold + RISE) * (sum.length_squared() * chord.length_squared()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn walls_gaps_and_stacked_sheets_part_edges_and_arcs_join() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        assert!(!same_sheet(dvec3(0.3, 0.1, -0.5), z, -z), "two sides of a wall");
        assert!(!same_sheet(dvec3(0.3, 0.1, 0.5), z, -z), "two sides of a gap");
        assert!(!same_sheet(dvec3(0.1, 0.2, 0.9), z, z), "the fin above");
        assert!(same_sheet(dvec3(0.9, 0.2, 0.1), z, z), "over a small step");
        assert!(same_sheet(dvec3(1.0, 2.0, 0.0), z, z), "on a plane");
        assert!(same_sheet(dvec3(0.1, 0.0, -0.9), z, x), "over a right-angled edge");
        assert!(same_sheet(dvec3(-0.5, 0.5, 0.3), x, y), "on an arc");
        assert!(same_sheet(DVec3::ZERO, z, z), "the point itself");
    }
}
