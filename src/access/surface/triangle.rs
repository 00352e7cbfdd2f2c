//! Points and rays against one triangle.

use glam::DVec3;

/// Sine of the angle between a ray and a triangle that it runs along.
const ALONG: f64 = 1e-6;

/// The point of a triangle nearest to `p` (Ericson 2004, Real-Time Collision Detection, 5.1.5).
pub fn nearest(p: DVec3, [a, b, c]: &[DVec3; 3]) -> DVec3 {
    let on_edge = |from: DVec3, to: DVec3| {
        let run = to - from;
        let length = run.length_squared();
        let part = if length > 0.0 { ((p - from).dot(run) / length).clamp(0.0, 1.0) } else { 0.0 };
        from + run * part
    };
    let n = (*b - *a).cross(*c - *a);
    let squared = n.length_squared();
    let weight = |q: DVec3, r: DVec3| (r - q).cross(p - q).dot(n);
    let weights = [weight(*b, *c), weight(*c, *a), weight(*a, *b)];
    if squared > 0.0 && weights.iter().all(|w| *w >= 0.0) {
        return p - n * ((p - *a).dot(n) / squared);
    }
    let ends = [on_edge(*a, *b), on_edge(*b, *c), on_edge(*c, *a)];
    let nearer = |q: DVec3, r: DVec3| {
        if (r - p).length_squared() < (q - p).length_squared() { r } else { q }
    };
    nearer(nearer(ends[0], ends[1]), ends[2])
}

/// How far along a ray a triangle is that it does not run along; on its edge counts.
pub fn crossing(&[a, b, c]: &[DVec3; 3], from: DVec3, direction: DVec3) -> Option<f64> {
    let (x, y) = (b - a, c - a);
    let across = direction.cross(y);
    let determinant = x.dot(across);
    let least = ALONG * (x.length_squared() * y.length_squared()).sqrt();
    if determinant.abs() <= least {
        return None;
    }
    let offset = from - a;
    let u = offset.dot(across) / determinant;
    let turned = offset.cross(x);
    let v = direction.dot(turned) / determinant;
    let is_in = u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9;
    is_in.then(|| y.dot(turned) / determinant)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_of_a_triangle_is_on_its_face_an_edge_or_a_corner() {
        let triangle = [DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0];
        for (p, q) in [
            (glam::dvec3(1.0, 1.0, 5.0), glam::dvec3(1.0, 1.0, 0.0)),
            (glam::dvec3(1.0, -2.0, 1.0), glam::dvec3(1.0, 0.0, 0.0)),
            (glam::dvec3(4.0, 4.0, -1.0), glam::dvec3(2.0, 2.0, 0.0)),
            (glam::dvec3(-1.0, -1.0, 0.0), DVec3::ZERO),
        ] {
            assert!(nearest(p, &triangle).distance(q) < 1e-12, "{p}");
        }
        assert_eq!(crossing(&triangle, glam::dvec3(1.0, 1.0, 5.0), -DVec3::Z), Some(5.0));
        assert_eq!(crossing(&triangle, glam::dvec3(3.0, 3.0, 5.0), -DVec3::Z), None);
    }

    #[test]
    fn a_ray_in_the_plane_of_a_triangle_does_not_meet_it() {
        let triangle = [DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0];
        let along = glam::dvec3(1.0, 0.0, 1e-8).normalize();
        assert_eq!(crossing(&triangle, glam::dvec3(-1.0, 1.0, -1e-8), along), None);
    }
}
