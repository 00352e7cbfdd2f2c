//! Balls and rays among triangles.

use crate::access::surface::obstacles::TriangleObstacles;
use crate::access::surface::tolerance::Tolerances;
use crate::access::surface::triangle::nearest;
use glam::{DMat3, DVec3};

/// A ball outside of the part that touches it.
#[derive(Debug, Clone)]
pub(super) struct Rolled {
    /// Its middle.
    pub center: DVec3,
    /// Outward normals of the planes that it touches.
    pub touched: Vec<DVec3>,
}

/// Planes that are added until no triangle is in the ball.
const ROUNDS: usize = 12;
/// A ball touches a face where its normal is within this of the face's, as a cosine: 20 degrees.
const ALONG_NORMAL: f64 = 0.94;
/// Lengths closer than this are the same, mm.
const SAME_MM: f64 = 1e-7;
/// A face is where its plane is touched within this beyond the tolerance, mm.
const ON_FACE_MM: f64 = 0.02;
/// Equations of planes that are nearly of two directions are not solved.
const LEAST_DETERMINANT: f64 = 1e-3;

/// The half space outside of a face.
#[derive(Debug, Clone, Copy)]
struct Plane {
    normal: DVec3,
    at: DVec3,
}

impl Plane {
    fn distance(&self, p: DVec3) -> f64 {
        self.normal.dot(p - self.at)
    }
}

impl TriangleObstacles {
    /// Number of triangles of the part; fixtures are beyond.
    pub(super) fn n_of_part(&self) -> u32 {
        self.chords.len() as u32
    }

    /// The rolled ball of a radius at a site; `None` if the site is in no inner corner for it: it touches fewer than
    /// two faces there, an edge of the part or a fixture, or there is no room for it.
    pub(super) fn rolled(
        &self,
        (site, normal): (DVec3, DVec3),
        radius: f64,
        tolerances: &Tolerances,
    ) -> Option<Rolled> {
        let mut planes = vec![Plane { normal, at: site }];
        for _ in 0..ROUNDS {
            let (center, touched) = nearest_center(site, &planes, radius)?;
            let Some((place, at)) = self.deepest(center, radius, tolerances) else {
                let is_corner = (2..=3).contains(&touched.len());
                let is_there = |plane: &DVec3| {
                    let foot = center - *plane * radius;
                    let near = ON_FACE_MM + tolerances.most;
                    self.bvh.near(foot, near, |place| {
                        nearest(foot, self.bvh.triangle(place)).distance(foot) <= near
                    })
                };
                let is_there = is_corner && touched.iter().all(is_there);
                return is_there.then_some(Rolled { center, touched });
            };
            if self.bvh.face(place) >= self.n_of_part() {
                return None;
            }
            let [a, b, c] = *self.bvh.triangle(place);
            let facing = (b - a).cross(c - a).normalize_or_zero();
            let from = center - at;
            let along = from.dot(facing).abs();
            if along < ALONG_NORMAL * from.length() {
                return None;
            }
            planes.push(Plane { normal: facing, at });
        }
        None
    }

    /// The triangle that is deepest in a ball, beyond its tolerance, and its nearest point.
    fn deepest(&self, center: DVec3, radius: f64, tolerances: &Tolerances) -> Option<(u32, DVec3)> {
        let mut found: Option<(f64, u32, DVec3)> = None;
        self.bvh.near(center, radius, |place| {
            let at = nearest(center, self.bvh.triangle(place));
            let depth = radius - tolerances.at(place) - at.distance(center);
            let is_first = |(deepest, of, _): (f64, u32, DVec3)| {
                depth > deepest + SAME_MM || depth > deepest - SAME_MM && place < of
            };
            if depth > 0.0 && found.is_none_or(is_first) {
                found = Some((depth, place, at));
            }
            false
        });
        found.map(|(_, place, at)| (place, at))
    }
}

/// The point nearest to `site` at least `radius` outside of every plane, and the planes that it touches: a projection
/// onto an intersection of half spaces, by the few planes that may bound it.
fn nearest_center(site: DVec3, planes: &[Plane], radius: f64) -> Option<(DVec3, Vec<DVec3>)> {
    let n = planes.len();
    let none = usize::MAX;
    let mut best: Option<(f64, DVec3, [usize; 3])> = None;
    let mut consider = |which: [usize; 3]| {
        let few: Vec<&Plane> = which.iter().filter_map(|&k| planes.get(k)).collect();
        let Some((center, is_pushed)) = on_planes(site, &few, radius) else { return };
        let squared = center.distance_squared(site);
        let is_free = || planes.iter().all(|p| p.distance(center) >= radius - SAME_MM);
        if is_pushed && best.is_none_or(|(least, ..)| squared < least - SAME_MM) && is_free() {
            best = Some((squared, center, which));
        }
    };
    for a in 0..n {
        consider([a, none, none]);
        for b in a + 1..n {
            consider([a, b, none]);
            (b + 1..n).for_each(|c| consider([a, b, c]));
        }
    }
    let (_, center, which) = best?;
    let touched = which.iter().filter_map(|&k| planes.get(k)).map(|plane| plane.normal);
    Some((center, touched.collect()))
}

/// The point nearest to `site` that is at `radius` from each of one to three planes, and whether all of them push.
fn on_planes(site: DVec3, planes: &[&Plane], radius: f64) -> Option<(DVec3, bool)> {
    let normal = |k: usize| planes.get(k).map(|p| p.normal);
    let gram = |i: usize, j: usize| match (normal(i), normal(j)) {
        (Some(a), Some(b)) => a.dot(b),
        _ if i == j => 1.0,
        _ => 0.0,
    };
    let column = |j: usize| DVec3::new(gram(0, j), gram(1, j), gram(2, j));
    let matrix = DMat3::from_cols(column(0), column(1), column(2));
    if matrix.determinant() < LEAST_DETERMINANT {
        return None;
    }
    let lacks = |k: usize| planes.get(k).map_or(0.0, |p| radius - p.distance(site));
    let pushes = matrix.inverse() * DVec3::new(lacks(0), lacks(1), lacks(2));
    let all = (0..planes.len()).filter_map(|k| Some(normal(k)? * pushes[k]));
    let is_pushed = (0..planes.len()).all(|k| pushes[k] >= -SAME_MM);
    Some((site + all.sum::<DVec3>(), is_pushed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_in_a_corner_touches_its_planes() {
        let plane = |normal: DVec3| Plane { normal, at: DVec3::ZERO };
        let planes = [plane(DVec3::Z), plane(DVec3::X), plane(-DVec3::Y)];
        let site = glam::dvec3(1.0, -5.0, 0.0);
        let (center, touched) = nearest_center(site, &planes, 3.0).unwrap();
        assert!(center.distance(glam::dvec3(3.0, -5.0, 3.0)) < 1e-12);
        assert_eq!(touched, [DVec3::Z, DVec3::X]);
        let opposite = Plane { normal: -DVec3::X, at: DVec3::X * 4.0 };
        assert!(nearest_center(site, &[planes[0], planes[1], opposite], 3.0).is_none(), "no room");
    }
}
