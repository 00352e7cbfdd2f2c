//! Balls that touch a site: where none fits, no tool that holds one does.
//!
//! Everywhere on an arc of its profile a tool holds a ball that touches there from within. Where a ball as large as the
//! least of them, a few tolerances at least, finds no place about the site, poses that touch with the arc are not
//! pushed: one search in place of many, for all directions.

use super::contact::{BEYOND_MM, LEAST_COSINE, SHALLOWER};
use crate::access::surface::bvh::Bvh;
use crate::geom::sites::nearest_in_triangle;
use glam::DVec3;

/// What balls are among.
#[derive(Clone, Copy)]
pub(super) struct Around<'a, T: Fn(u32) -> f64> {
    pub bvh: &'a Bvh,
    /// Gouge tolerance of the triangle at a place, and the least of all, mm.
    pub tolerance: T,
    pub least_tolerance: f64,
    /// Finish tolerance, mm.
    pub finish: f64,
}

/// The balls at one site.
pub(super) struct Balls<'a, T: Fn(u32) -> f64> {
    around: Around<'a, T>,
    point: DVec3,
    normal: DVec3,
    /// Greatest radius known to fit, least known not to, mm.
    fits: f64,
    fails: f64,
}

/// Balls less than this many tolerances large are not looked for.
const LEAST_TOLERANCES: f64 = 4.0;
/// Pushes of a ball, and how many of them may fail to leave it less deep by a tenth.
const PUSHES: usize = 30;
const MOST_STALLED: usize = 5;
/// Sine of the angle between a push and the way to the site below which the push does not move the ball.
const LEAST_SINE: f64 = 0.02;

impl<'a, T: Fn(u32) -> f64> Balls<'a, T> {
    pub fn at(around: Around<'a, T>, [point, normal]: [DVec3; 2]) -> Self {
        Balls { around, point, normal, fits: 0.0, fails: f64::INFINITY }
    }

    /// Whether a ball of a radius, mm, may have a place about the site.
    pub fn may_fit(&mut self, radius: f64) -> bool {
        if radius <= self.fits || radius < LEAST_TOLERANCES * self.around.least_tolerance {
            return true;
        }
        if radius >= self.fails {
            return false;
        }
        let is_free = self.find(radius);
        if is_free {
            self.fits = radius
        } else {
            self.fails = radius
        }
        is_free
    }

    /// ```text
    /// the ball that touches with the normal of the site
    /// again and again: no triangle penetrated: found; else pushed around the site, clear of the one penetrated most
    /// ```
    fn find(&self, radius: f64) -> bool {
        let (mut away, mut least, mut n_stalled) = (self.normal, f64::INFINITY, 0);
        for _ in 0..PUSHES {
            let center = self.point + away * (radius + self.around.finish);
            let Some((depth, nearest)) = self.around.deepest(center, radius) else {
                return away.dot(self.normal) >= LEAST_COSINE;
            };
            let Some(push) = (center - nearest).try_normalize() else { return false };
            let across = push - away * push.dot(away);
            if across.length() < LEAST_SINE {
                return false;
            }
            n_stalled += 1;
            if depth < SHALLOWER * least {
                (least, n_stalled) = (depth, 0);
            }
            if n_stalled == MOST_STALLED {
                return false;
            }
            let step = across * ((depth + BEYOND_MM) / across.length_squared());
            let moved = center + step.clamp_length_max(0.5 * radius) - self.point;
            away = moved.normalize();
        }
        false
    }
}

impl<T: Fn(u32) -> f64> Around<'_, T> {
    /// How deep the triangle is that a ball penetrates most, mm, and its nearest point.
    fn deepest(&self, center: DVec3, radius: f64) -> Option<(f64, DVec3)> {
        let (mut most, mut best) = (0.0, None);
        self.bvh.near(center, radius, |place| {
            let nearest = nearest_in_triangle(center, *self.bvh.triangle(place));
            let depth = radius - (self.tolerance)(place) - nearest.distance(center);
            if depth > most {
                (most, best) = (depth, Some((depth, nearest)));
            }
            false
        });
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::surface::bvh::Bvh;
    use crate::access::surface::chords::Chords;
    use crate::geom::Mesh;
    use crate::tool::cutter::Profile;
    use glam::dvec3;

    #[test]
    fn a_ball_fits_between_two_walls_iff_it_is_less_wide() {
        let mut mesh = Mesh::default();
        for x in [-2.5, 2.5f64] {
            let first = mesh.vertices.len() as u32;
            let corners = [[-40.0, -40.0], [40.0, -40.0], [0.0, 60.0]];
            mesh.vertices.extend(corners.map(|[y, z]| dvec3(x, y, z)));
            // Both face the middle.
            mesh.triangles.push(match x > 0.0 {
                true => [first, first + 2, first + 1],
                false => [first, first + 1, first + 2],
            });
        }
        let corners: Vec<[DVec3; 3]> = (0..mesh.triangles.len()).map(|f| mesh.corners(f)).collect();
        let bvh = Bvh::new(&corners);
        let tolerances = Chords::of(&mesh).as_tolerances(&bvh);
        let profile = Profile::lollipop(2.0, 1.0).unwrap();
        let tolerance = |place: u32| tolerances.at(place).max(0.01);
        let around = Around { bvh: &bvh, tolerance, least_tolerance: 0.01, finish: 0.01 };
        let site = [dvec3(-2.5, 0.0, 0.0), DVec3::X];
        let fits = |radius: f64| Balls::at(around, site).may_fit(radius);
        assert!(fits(0.02) && fits(1.0) && fits(2.49));
        assert!(!fits(2.53) && !fits(4.0));
        // What is known answers for the others.
        let mut balls = Balls::at(around, site);
        assert!(!balls.may_fit(3.0) && balls.may_fit(2.0));
        assert_eq!((balls.fits, balls.fails), (2.0, 3.0));
        // The poses of a lollipop are on its ball; those of a flat face may end at its rim.
        let ball = |profile: &Profile, normal: DVec3| {
            let contacts = super::super::contact::Contacts::new(profile, 0.01);
            let mut radii = Vec::new();
            contacts.for_each(normal, |pose| {
                radii.push(contacts.ball(&pose));
                false
            });
            radii
        };
        assert!(ball(&profile, DVec3::X).iter().any(|radius| (radius - 2.0).abs() < 1e-6));
        let disc = Profile::t_slot(6.0, 3.0, 0.0, 3.0).unwrap();
        assert!(ball(&disc, DVec3::Z).iter().all(|radius| *radius < 0.02));
    }
}
