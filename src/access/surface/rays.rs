//! Rays and distances against all triangles.

use super::obstacles::TriangleObstacles;
use super::tool::{Stand, axes};
use super::triangle::{crossing, nearest};
use glam::DVec3;

impl TriangleObstacles {
    /// Where a ray first meets a triangle beyond `start`: the distance, and the triangle's place in the tree.
    pub(super) fn ray(&self, from: DVec3, direction: DVec3, start: f64) -> Option<(f64, u32)> {
        let stand = Stand { reference: from, axes: axes(direction.as_vec3()) };
        let far = 4.0 * self.bvh.radius() + from.distance(self.bvh.origin());
        let mut bands = [self.bvh.band([start, far], 0.0, far)];
        let mut found: Option<(f64, u32)> = None;
        self.bvh.visit(&stand, &mut bands, &mut Vec::new(), |place, _| {
            if let Some(t) = crossing(self.bvh.triangle(place), from, direction)
                && t > start
                && found.is_none_or(|(least, of)| t < least || t == least && place < of)
            {
                found = Some((t, place));
            }
            false
        });
        found
    }

    /// Outward unit normal of the triangle at a place of the tree.
    pub(super) fn facing(&self, place: u32) -> DVec3 {
        let [a, b, c] = *self.bvh.triangle(place);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Distance of a point from the nearest triangle, mm; infinite if there is none.
    #[doc(hidden)] // of `analysis`
    pub fn distance_to(&self, p: DVec3) -> f64 {
        let (mut radius, most) = (
            0.01 * self.bvh.radius(),
            4.0 * (self.bvh.radius() + (p - self.bvh.origin()).length()),
        );
        while radius <= most {
            let mut distance = f64::INFINITY;
            self.bvh.near(p, radius, |place| {
                distance = distance.min(nearest(p, self.bvh.triangle(place)).distance(p));
                false
            });
            if distance <= radius {
                return distance;
            }
            radius *= 4.0;
        }
        f64::INFINITY
    }
}
