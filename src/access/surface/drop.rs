//! Drop heights in closed form: the reference of the module.
//!
//! A tool comes down along its axis, here the z axis, until it touches a triangle. Where its reference
//! point is then is the *drop height*. A triangle is touched at a corner, on an edge or within; each
//! contact has a formula, and the drop height is the greatest of the three.

use super::tool::{Tip, across};
use glam::{DVec2, DVec3};

/// Greatest height of a triangle over the closed disc of `radius` about the axis; −∞ if no point of it is
/// there. An infinite radius gives its highest corner.
pub(super) fn disc(corners: &[DVec3; 3], radius: f64) -> f64 {
    let highest = corners.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    if radius == f64::INFINITY {
        return highest;
    }
    let within = |p: &&DVec3| across(**p).length() <= radius;
    let mut height = corners.iter().filter(within).map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    for [a, b] in edges(corners) {
        if let Some(interval) = in_disc(a, b, radius) {
            height = interval.map(|t| a.lerp(b, t).z).into_iter().fold(height, f64::max);
        }
    }
    // Within the facet the highest place of the disc is uphill at its rim.
    match Facet::of(corners) {
        Some(facet) => {
            let uphill = facet.normal.truncate().normalize_or_zero() * -radius;
            [uphill, DVec2::ZERO].into_iter().fold(height, |h, at| h.max(facet.height_at(at)))
        }
        None => height,
    }
}

/// Drop height of a tip; −∞ if it passes the triangle by.
pub(super) fn tip(corners: &[DVec3; 3], tip: Tip) -> f64 {
    match tip {
        Tip::Flat { height, radius } => disc(corners, radius) - height,
        Tip::Round { ring, radius } => round(corners, ring, radius),
    }
}

/// Drop height of a ball (`ring` 0) or a bull nose.
fn round(corners: &[DVec3; 3], ring: f64, radius: f64) -> f64 {
    let mut height =
        corners.iter().map(|p| on_point(*p, ring, radius)).fold(f64::NEG_INFINITY, f64::max);
    for [a, b] in edges(corners) {
        let on_edge =
            if ring == 0.0 { ball_on_edge(a, b, radius) } else { bull_on_edge(a, b, ring, radius) };
        height = height.max(on_edge);
    }
    if let Some(facet) = Facet::of(corners) {
        let n = facet.normal;
        let contact = -(n.truncate().normalize_or_zero() * ring + n.truncate() * radius);
        height = height.max(facet.height_at(contact) + radius * n.z);
    }
    height
}

/// Height of the reference point of a round tip that rests on a point.
fn on_point(p: DVec3, ring: f64, radius: f64) -> f64 {
    let beyond = (across(p).length() - ring).max(0.0);
    if beyond > radius {
        f64::NEG_INFINITY
    } else {
        p.z + (radius * radius - beyond * beyond).sqrt()
    }
}

/// A ball on an edge: in the plane upright through the edge it is a circle on a line.
fn ball_on_edge(a: DVec3, b: DVec3, radius: f64) -> f64 {
    let run = across(b - a);
    let length = run.length();
    let along = run / length;
    if !along.is_finite() {
        return f64::NEG_INFINITY;
    }
    let offset = along.perp_dot(across(a));
    let squared = radius * radius - offset * offset;
    if squared < 0.0 {
        return f64::NEG_INFINITY;
    }
    let circle = squared.sqrt();
    let (start, rise) = (along.dot(across(a)), b.z - a.z);
    let touch = circle * rise / length.hypot(rise);
    // As a share of the edge: one that is nearly upright has a slope that would multiply roundings of places.
    let part = ((touch - start) / length).clamp(0.0, 1.0);
    let at = start + part * length;
    if at.abs() > circle {
        return f64::NEG_INFINITY;
    }
    a.z + part * rise + (squared - at * at).max(0.0).sqrt()
}

/// Halvings of an interval after which nothing changes in `f64`, by the golden ratio.
const HALVINGS: usize = 90;

/// A bull nose on an edge: the height is concave along the edge, so its greatest value is found by
/// nested intervals.
fn bull_on_edge(a: DVec3, b: DVec3, ring: f64, radius: f64) -> f64 {
    let Some([mut low, mut high]) = in_disc(a, b, ring + radius) else { return f64::NEG_INFINITY };
    let height = |t: f64| {
        let p = a.lerp(b, t);
        let beyond = (across(p).length() - ring).clamp(0.0, radius);
        p.z + (radius * radius - beyond * beyond).sqrt()
    };
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let mut best = height(low).max(height(high));
    for _ in 0..HALVINGS {
        let [left, right] = [high - golden * (high - low), low + golden * (high - low)];
        let [at_left, at_right] = [height(left), height(right)];
        best = best.max(at_left).max(at_right);
        if at_left < at_right { low = left } else { high = right }
    }
    best
}

fn edges([a, b, c]: &[DVec3; 3]) -> [[DVec3; 2]; 3] {
    [[*a, *b], [*b, *c], [*c, *a]]
}

/// Between which parameters the edge from `a` to `b` is over the disc; `None` if it is nowhere.
fn in_disc(a: DVec3, b: DVec3, radius: f64) -> Option<[f64; 2]> {
    let (start, run) = (across(a), across(b - a));
    let (aa, ab, bb) = (run.length_squared(), start.dot(run), start.length_squared());
    if aa == 0.0 {
        return (bb <= radius * radius).then_some([0.0, 1.0]);
    }
    let nearest = run.perp_dot(start) / aa.sqrt();
    let squared = radius * radius - nearest * nearest;
    if squared < 0.0 {
        return None;
    }
    let half = (squared / aa).sqrt();
    let [low, high] = [(-ab / aa - half).max(0.0), (-ab / aa + half).min(1.0)];
    (low <= high).then_some([low, high])
}

/// A triangle that is not vertical.
struct Facet<'a> {
    corners: &'a [DVec3; 3],
    /// Unit normal, upward.
    normal: DVec3,
}

impl<'a> Facet<'a> {
    /// `None` if the triangle is vertical or has no area: its edges say all.
    fn of(corners: &'a [DVec3; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).try_normalize()?;
        let normal = normal * normal.z.signum();
        (normal.z > VERTICAL).then_some(Facet { corners, normal })
    }

    /// Height of the triangle at a place, −∞ beyond its rim.
    fn height_at(&self, at: DVec2) -> f64 {
        let [a, b, c] = self.corners.map(across);
        let turns = [(b - a).perp_dot(at - a), (c - b).perp_dot(at - b), (a - c).perp_dot(at - c)];
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let outside = (low - at).max(at - high).max_element() > 0.0;
        if outside || turns.iter().any(|t| *t < 0.0) && turns.iter().any(|t| *t > 0.0) {
            return f64::NEG_INFINITY;
        }
        let (n, heights) = (self.normal, self.corners.map(|p| p.z));
        let height = heights[0] - n.truncate().dot(at - a) / n.z;
        // On a steep facet roundings would leave the triangle.
        let [low, high] = [f64::min, f64::max].map(|of| of(of(heights[0], heights[1]), heights[2]));
        height.max(low).min(high)
    }
}

/// Normals with less than this share along the axis belong to vertical facets.
const VERTICAL: f64 = 1e-12;
