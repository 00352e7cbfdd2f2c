//! Closed plane outlines, counter-clockwise, in millimeters: what prisms and turned bodies start from.

use glam::DVec2;
use std::f64::consts::TAU;

/// Greatest distance between a curve and its chords, mm.
const CHORD_MM: f64 = 0.1;
/// Fewest corners of a full circle: chords turn by at most about 0.31 rad.
const MIN_CORNERS: f64 = 20.0;

/// A closed polygon without self-crossings, counter-clockwise.
#[derive(Debug, Clone)]
pub(super) struct Outline(pub Vec<DVec2>);

/// The point at distance `radius` from the origin, `angle` from the x axis.
pub(super) fn polar(radius: f64, angle: f64) -> DVec2 {
    DVec2::new(radius * libm::cos(angle), radius * libm::sin(angle))
}

/// Corners of a full circle of `radius`: a multiple of four that keeps the chord error.
pub(super) fn circle_corners(radius: f64) -> usize {
    let step = 2.0 * libm::acos(1.0 - (CHORD_MM / radius).min(0.9));
    4 * (TAU / step).max(MIN_CORNERS).div_euclid(4.0) as usize + 4
}

impl Outline {
    /// A polygon through `points`, mm, counter-clockwise.
    pub fn polygon(points: &[[f64; 2]]) -> Self {
        Outline(points.iter().map(|p| DVec2::from_array(*p)).collect())
    }

    /// A circle about the origin.
    pub fn circle(radius: f64) -> Self {
        Self::regular(circle_corners(radius), radius)
    }

    /// A regular polygon with `n` corners at distance `radius`, the first on the x axis.
    pub fn regular(n: usize, radius: f64) -> Self {
        Outline((0..n).map(|i| polar(radius, TAU * i as f64 / n as f64)).collect())
    }

    /// A closed curve `radius(angle)` about the origin, `n` corners.
    pub fn round(n: usize, radius: impl Fn(f64) -> f64) -> Self {
        let angles = (0..n).map(|i| TAU * i as f64 / n as f64);
        Outline(angles.map(|a| polar(radius(a), a)).collect())
    }

    /// A rectangle of size `w` by `d` about the origin.
    pub fn rectangle(w: f64, d: f64) -> Self {
        let (x, y) = (0.5 * w, 0.5 * d);
        Self::polygon(&[[-x, -y], [x, -y], [x, y], [-x, y]])
    }

    /// A rectangle about the origin with corners rounded to `radius`.
    pub fn rounded(w: f64, d: f64, radius: f64) -> Self {
        Self::rectangle(w, d).filleted(radius)
    }

    /// An oblong of total size `l` by `w` along x, with half-round ends.
    pub fn oblong(l: f64, w: f64) -> Self {
        Self::rounded(l.max(1.001 * w), w, 0.5 * w)
    }

    /// A star or wheel: `n` repeats of the points (radius, share of one pitch), shares growing in 0..1.
    pub fn wheel(n: usize, pitch: &[[f64; 2]]) -> Self {
        let corner = |i: usize, p: &[f64; 2]| polar(p[0], TAU * (i as f64 + p[1]) / n as f64);
        Outline((0..n).flat_map(|i| pitch.iter().map(move |p| corner(i, p))).collect())
    }

    /// The outline of a path of half-width `half` along `path`, flat ends.
    pub fn stroke(path: &[DVec2], half: f64) -> Self {
        let side = |i: usize| {
            let before = path[i] - path[i.saturating_sub(1)];
            let after = path[(i + 1).min(path.len() - 1)] - path[i];
            let (a, b) = (before.normalize_or_zero(), after.normalize_or_zero());
            let middle = (a + b).normalize_or_zero().perp();
            let other = if a == DVec2::ZERO { b } else { a };
            middle * (half / middle.dot(other.perp()).max(0.2))
        };
        let right = (0..path.len()).map(|i| path[i] - side(i));
        let left = (0..path.len()).rev().map(|i| path[i] + side(i));
        Outline(right.chain(left).collect())
    }

    /// The same outline with every corner rounded to `radius`, or to what its edges leave room for.
    pub fn filleted(self, radius: f64) -> Self {
        let n = self.0.len();
        let mut points = Vec::with_capacity(8 * n);
        for i in 0..n {
            fillet([self.0[(i + n - 1) % n], self.0[i], self.0[(i + 1) % n]], radius, &mut points);
        }
        points.dedup_by(|a, b| a.distance(*b) < 1e-6);
        while points.len() > 3 && points[0].distance(points[points.len() - 1]) < 1e-6 {
            points.pop();
        }
        Outline(points)
    }

    /// Moved by (`x`, `y`).
    pub fn at(mut self, x: f64, y: f64) -> Self {
        self.0.iter_mut().for_each(|p| *p += DVec2::new(x, y));
        self
    }

    /// Turned about the origin by `angle_rad`.
    pub fn turned(mut self, angle_rad: f64) -> Self {
        let turn = polar(1.0, angle_rad);
        self.0.iter_mut().for_each(|p| *p = turn.rotate(*p));
        self
    }

    /// Signed area, mm²; positive when counter-clockwise.
    pub fn area(&self) -> f64 {
        let n = self.0.len();
        (0..n).map(|i| 0.5 * self.0[i].perp_dot(self.0[(i + 1) % n])).sum()
    }

    /// The same polygon, counter-clockwise.
    pub fn counter_clockwise(mut self) -> Self {
        if self.area() < 0.0 {
            self.0.reverse();
        }
        self
    }

    /// Stretched about the origin.
    pub fn stretched(mut self, x: f64, y: f64) -> Self {
        self.0.iter_mut().for_each(|p| *p *= DVec2::new(x, y));
        self
    }

    /// Edges cut into equal pieces no longer than `length`, so that a bent body stays smooth.
    pub fn refined(self, length: f64) -> Self {
        let n = self.0.len();
        let edge = |i: usize| {
            let (a, b) = (self.0[i], self.0[(i + 1) % n]);
            let pieces = (a.distance(b) / length).ceil().max(1.0) as usize;
            (0..pieces).map(move |k| a.lerp(b, k as f64 / pieces as f64))
        };
        Outline((0..n).flat_map(edge).collect())
    }
}

/// Appends the arc that rounds the corner `b` between `a` and `c`.
fn fillet([a, b, c]: [DVec2; 3], radius: f64, points: &mut Vec<DVec2>) {
    let (u, v) = ((a - b).normalize_or_zero(), (c - b).normalize_or_zero());
    let turn = v.perp_dot(u);
    let half = 0.5 * libm::atan2(turn.abs(), u.dot(v));
    let tangent = libm::tan(half);
    let reach = (radius / tangent).min(0.4999 * a.distance(b).min(b.distance(c)));
    let radius = reach * tangent;
    if turn.abs() < 1e-9 || radius < 1e-3 {
        points.push(b);
        return;
    }
    let sweep = std::f64::consts::PI - 2.0 * half;
    let pieces = (sweep / TAU * circle_corners(radius) as f64).ceil().max(1.0) as usize;
    let outward = -(u + v).normalize_or_zero();
    let center = b - outward * (radius / libm::sin(half));
    for k in 0..=pieces {
        let angle = (k as f64 / pieces as f64 - 0.5) * sweep * turn.signum();
        points.push(center + radius * polar(1.0, angle).rotate(outward));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn outlines_are_counter_clockwise_with_the_area_they_claim() {
        let rounded = Outline::rounded(40.0, 30.0, 5.0).area();
        let exact = 40.0 * 30.0 - (4.0 - PI) * 25.0;
        assert!((rounded - exact).abs() < 1.0 && rounded < exact, "{rounded} {exact}");
        let disc = Outline::circle(25.0).area();
        assert!(disc < PI * 625.0 && disc > PI * (25.0 - CHORD_MM) * (25.0 - CHORD_MM));
        let path = [DVec2::ZERO, DVec2::new(10.0, 0.0), DVec2::new(10.0, 10.0)];
        assert!((Outline::stroke(&path, 1.0).area() - 40.0).abs() < 1e-9);
        assert!(Outline::rectangle(4.0, 2.0).turned(1.0).area() > 0.0);
    }

    #[test]
    fn a_notch_is_filleted_inward() {
        let ell = [[0.0, 0.0], [20.0, 0.0], [20.0, 10.0], [10.0, 10.0], [10.0, 20.0], [0.0, 20.0]];
        let filleted = Outline::polygon(&ell).filleted(3.0).area();
        let exact = 300.0 - (4.0 - PI) / 4.0 * 9.0 * 4.0;
        assert!((filleted - exact).abs() < 0.5, "{filleted} {exact}");
    }

    #[test]
    fn circles_keep_the_chord_error() {
        for radius in [0.3, 2.0, 10.0, 120.0] {
            let n = circle_corners(radius);
            assert!(n.is_multiple_of(4) && n >= 20);
            assert!(radius * (1.0 - libm::cos(PI / n as f64)) <= CHORD_MM);
        }
    }
}
