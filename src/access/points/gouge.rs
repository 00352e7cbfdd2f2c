//! The gouge test: does the ball, touching a site, cut deeper than a tolerance into another part of the surface?
//!
//! The labels treat everything at or below the ball's top as contact. Where the surface curves more
//! tightly than the ball, or a wall stands closer than its radius, the ball cannot touch the site at all
//! without cutting elsewhere, in any direction: this test finds those sites.

use super::predicate;
use crate::exec::par;
use crate::geom::Sites;
use crate::geom::sites::check_points;
use crate::spatial::PointGrid;
use crate::tool::cutter::Cutter;
use crate::{Error, Result};
use glam::Vec3;

/// Sites per task.
const BLOCK: usize = 256;

/// Marks the sites at which some other obstacle lies inside the ball by more than `tolerance_mm`:
/// `|s_j − c_i| < corner − tolerance`. With obstacles of the sites themselves pass their points; points
/// that coincide with the site are on the ball and never inside it.
///
/// # Errors
/// If the tolerance is not positive or not below the corner radius (a flat end has no ball to test), the
/// sites fail [`Sites::check`], or an obstacle is not finite or beyond 1 km.
pub fn gouges(
    sites: &Sites,
    obstacles: &[Vec3],
    cutter: &Cutter,
    tolerance_mm: f64,
) -> Result<Vec<bool>> {
    let corner = cutter.corner_mm();
    if !(tolerance_mm > 0.0 && tolerance_mm < corner) {
        let expected = format!("positive, below the corner radius of {corner} mm");
        let remedy = "a hundredth of the radius suits most samplings";
        return Err(Error::argument("gouge tolerance", tolerance_mm, expected, remedy));
    }
    sites.check()?;
    check_points("obstacle", obstacles)?;
    let grid = PointGrid::new(obstacles);
    let reach = (corner - tolerance_mm) as f32;
    let blocks = par::map_blocks(sites.len(), BLOCK, |range| {
        let inside = |i: usize| {
            let center = predicate::base(sites.points[i], sites.normals[i], corner as f32);
            let mut found = false;
            grid.for_each_within(center.into(), reach, |_, squared| {
                found |= squared < f64::from(reach) * f64::from(reach);
            });
            found
        };
        range.map(inside).collect::<Vec<bool>>()
    });
    Ok(blocks.concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::cutter::CutterParams;

    /// A V-groove of a right angle: a ball of radius 1 touches both flanks at once when it touches
    /// 1 mm up the flank, and cuts into the other flank when it touches lower.
    #[test]
    fn a_ball_gouges_the_far_flank_of_a_groove_when_it_touches_too_low() {
        let mut sites = Sites::default();
        for k in 1..=40 {
            let along = k as f32 * 0.05;
            for side in [-1.0, 1.0] {
                let a = std::f32::consts::FRAC_1_SQRT_2;
                sites.points.push(Vec3::new(side * along * a, 0.0, along * a));
                sites.normals.push(Vec3::new(-side * a, 0.0, a));
            }
        }
        let cutter = Cutter::ball_end(CutterParams::from_array([1.0, 2.0, 3.0, 4.0])).unwrap();
        let found = gouges(&sites, &sites.points, &cutter, 0.01).unwrap();
        for (k, pair) in found.chunks(2).enumerate() {
            let along = (k + 1) as f32 * 0.05;
            if !(0.85..=1.0).contains(&along) {
                assert_eq!(pair, [along < 0.9; 2], "{along}");
            }
        }
        assert!(gouges(&sites, &[], &cutter, -1.0).is_err());
        assert!(gouges(&sites, &sites.points, &cutter, f64::NAN).is_err());
        let message = gouges(&sites, &[Vec3::NAN], &cutter, 0.01).unwrap_err().to_string();
        assert!(message.starts_with("obstacle 0: position"), "{message}");
        let mut broken = sites.clone();
        broken.normals[5] = Vec3::NAN;
        assert!(gouges(&broken, &sites.points, &cutter, 0.01).is_err());
        broken = Sites { normals: vec![], ..sites.clone() };
        assert!(gouges(&broken, &sites.points, &cutter, 0.01).is_err());
        let flat = Cutter::flat_end(CutterParams::from_array([1.0, 2.0, 3.0, 4.0])).unwrap();
        assert!(gouges(&sites, &sites.points, &flat, 0.0).is_err());
    }
}
