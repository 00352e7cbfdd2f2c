//! Does a shrunk tool penetrate a triangle? Yes or no, without drop heights, for the fast engine.
//!
//! A step is a half-infinite cylinder: it penetrates iff the part of the triangle above its lower end comes within
//! its radius of the axis. A round tip consists of all points within its corner radius of a disc and of everything
//! above: it penetrates iff the part of the triangle above the reference point comes within the whole radius of the
//! axis, or an edge or the facet comes within the corner radius of the disc. Nothing is divided by the slope of
//! the facet, so nothing is lost on steep ones.

use super::tool::{Tip, across};
use glam::{DVec2, DVec3};

/// Whether some point of the triangle is higher than `height` and within `radius` of the axis.
#[inline]
pub(super) fn step(corners: &[DVec3; 3], height: f64, radius: f64) -> bool {
    let above = corners.map(|p| p.z > height);
    if above == [false; 3] {
        return false;
    }
    if radius == f64::INFINITY {
        return true;
    }
    let mut rim = [DVec2::ZERO; 4];
    let mut n = 0;
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if above[k] {
            rim[n] = across(a);
            n += 1;
        }
        if above[k] != above[(k + 1) % 3] {
            rim[n] = across(a).lerp(across(b), (height - a.z) / (b.z - a.z));
            n += 1;
        }
    }
    within(&rim[..n], radius * radius)
}

/// Whether a convex polygon comes within a distance, squared, of the origin.
#[inline]
fn within(rim: &[DVec2], squared: f64) -> bool {
    let (mut left, mut right) = (true, true);
    let (mut low, mut high) = (rim[0], rim[0]);
    for (k, &a) in rim.iter().enumerate() {
        let b = rim[(k + 1) % rim.len()];
        let run = b - a;
        let turn = a.perp_dot(run);
        left &= turn >= 0.0;
        right &= turn <= 0.0;
        (low, high) = (low.min(a), high.max(a));
        let length = run.length_squared();
        let part = if length > 0.0 { (-a.dot(run) / length).clamp(0.0, 1.0) } else { 0.0 };
        if (a + run * part).length_squared() <= squared {
            return true;
        }
    }
    // A facet seen edge-on turns by roundings alone, but then its box is beside the origin.
    left != right && low.max(-high).max_element() <= 0.0
}

/// Whether a tip penetrates the triangle.
#[inline]
pub(super) fn tip(corners: &[DVec3; 3], tip: Tip) -> bool {
    match tip {
        Tip::Flat { height, radius } => step(corners, height, radius),
        Tip::Round { ring, radius } => {
            let lowest = -radius;
            corners.iter().any(|p| p.z > lowest)
                && !is_clear(corners, onto_disc(middle(corners), ring), radius)
                && (step(corners, 0.0, ring + radius) || near_disc(corners, ring, radius))
        }
    }
}

/// Whether the triangle is certainly no part of what a tip raised by `raised` holds: most are told apart by this alone.
#[inline]
pub(super) fn is_clear_of_tip(corners: &[DVec3; 3], tip: Tip, raised: f64) -> bool {
    let Tip::Round { ring, radius } = tip else { return false };
    let corners = corners.map(|p| p - DVec3::Z * raised);
    is_clear(&corners, onto_disc(middle(&corners), ring), radius)
}

/// Whether the plane at a distance of `radius` from a convex body, seen from the triangle's middle, has the triangle
/// beyond it: with a margin for roundings. `nearest` is the body's place nearest to that middle.
#[inline]
fn is_clear(corners: &[DVec3; 3], nearest: DVec3, radius: f64) -> bool {
    /// Share of the distance, squared.
    const MARGIN: f64 = 1e-9;
    let toward = middle(corners) - nearest;
    let [a, b, c] = corners.map(|p| (p - nearest).dot(toward));
    let least = a.min(b).min(c);
    let needed = radius * radius * toward.length_squared();
    least > 0.0 && least * least > needed * (1.0 + MARGIN)
}

fn middle([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (*a + *b + *c) / 3.0
}

/// The place of the horizontal disc of radius `ring`, or above it, that is nearest to `p`.
fn onto_disc(p: DVec3, ring: f64) -> DVec3 {
    across(p).clamp_length_max(ring).extend(p.z.max(0.0))
}

/// Whether the triangle comes within `radius` of the origin.
pub(super) fn ball(corners: &[DVec3; 3], radius: f64) -> bool {
    // Below and above the middle.
    !is_clear(corners, DVec3::ZERO, radius)
        && (near_disc(corners, 0.0, radius) || facet_near_disc(&corners.map(|p| -p), 0.0, radius))
}

/// Whether the triangle comes within `radius` of the horizontal disc of radius `ring` or of what is above it.
fn near_disc(corners: &[DVec3; 3], ring: f64, radius: f64) -> bool {
    let [a, b, c] = *corners;
    [[a, b], [b, c], [c, a]].into_iter().any(|[a, b]| edge_near_disc(a, b, ring, radius))
        || facet_near_disc(corners, ring, radius)
}

/// Whether an edge does.
fn edge_near_disc(a: DVec3, b: DVec3, ring: f64, radius: f64) -> bool {
    let squared = radius * radius;
    if ring == 0.0 {
        let run = b - a;
        let length = run.length_squared();
        let part = if length > 0.0 { (-a.dot(run) / length).clamp(0.0, 1.0) } else { 0.0 };
        return (a + run * part).length_squared() < squared;
    }
    // The squared distance is convex along the edge: nowhere below its tangents.
    let run = b - a;
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let t = 0.5 * (low + high);
        let p = a + run * t;
        let away = p - onto_disc(p, ring);
        let distance = away.length_squared();
        if distance < squared {
            return true;
        }
        let slope = 2.0 * away.dot(run);
        let end = if slope > 0.0 { low } else { high };
        if distance + slope * (end - t) >= squared {
            return false;
        }
        if slope > 0.0 { high = t } else { low = t }
    }
    false
}

/// One half to this power is less than the spacing of `f64`.
const HALVINGS: usize = 60;

/// Whether the place of the facet that is nearest to the disc lies within its rim and near enough.
fn facet_near_disc(corners: &[DVec3; 3], ring: f64, radius: f64) -> bool {
    let [a, b, c] = corners;
    let Some(normal) = (b - a).cross(c - a).try_normalize() else { return false };
    let normal = if normal.z < 0.0 { -normal } else { normal };
    let lowest = (across(normal).normalize_or_zero() * -ring).extend(0.0);
    let distance = normal.dot(lowest - a);
    if !(0.0..radius).contains(&distance) {
        return false;
    }
    let foot = lowest - normal * distance;
    if !in_box(foot, corners) {
        return false;
    }
    let turn = |p: DVec3, q: DVec3| (q - p).cross(foot - p).dot(normal);
    let turns = [turn(*a, *b), turn(*b, *c), turn(*c, *a)];
    turns.iter().all(|t| *t >= 0.0) || turns.iter().all(|t| *t <= 0.0)
}

/// Whether a point of the plane of a triangle is in its box, but for roundings: the turns about a sliver are
/// nothing but roundings.
pub(super) fn in_box(p: DVec3, [a, b, c]: &[DVec3; 3]) -> bool {
    let (low, high) = (a.min(*b).min(*c), a.max(*b).max(*c));
    (low - p).max(p - high).max_element() <= 1e-9
}

/// Of the part of a triangle that is higher than `height`, the distance from the axis and the place nearest to it.
pub(super) fn nearest_above(corners: &[DVec3; 3], height: f64) -> Option<(f64, DVec3)> {
    let (mut rim, mut n_rim) = ([DVec3::ZERO; 4], 0);
    let mut push = |p: DVec3| {
        rim[n_rim] = p;
        n_rim += 1;
    };
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if a.z > height {
            push(a);
        }
        if (a.z > height) != (b.z > height) {
            push(a.lerp(b, (height - a.z) / (b.z - a.z)));
        }
    }
    let rim = &rim[..n_rim];
    let mut best: Option<(f64, DVec3)> = None;
    let (mut left, mut right) = (true, true);
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for (k, &a) in rim.iter().enumerate() {
        let b = rim[(k + 1) % rim.len()];
        let (start, run) = (across(a), across(b - a));
        (low, high) = (low.min(start), high.max(start));
        let turn = start.perp_dot(run);
        (left, right) = (left && turn >= 0.0, right && turn <= 0.0);
        let length = run.length_squared();
        let part = if length > 0.0 { (-start.dot(run) / length).clamp(0.0, 1.0) } else { 0.0 };
        let at = a.lerp(b, part);
        let distance = across(at).length();
        if best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, at));
        }
    }
    // A facet seen edge-on turns by roundings alone, but then its box is beside the axis.
    if left != right && low.max(-high).max_element() <= 0.0 {
        let [a, b, c] = *corners;
        let normal = (b - a).cross(c - a);
        return Some((0.0, DVec3::Z * (normal.dot(a) / normal.z)));
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::drop;
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};

    #[test]
    fn the_nearest_place_above_a_height_is_on_the_triangle_and_agrees_with_drop_heights() {
        let mut stream = Stream::new(11, 0, 0, Purpose::Probe);
        let mut n_met = 0;
        for _ in 0..4000 {
            let mut range = || stream.range(-3.0, 3.0);
            let corners = [0; 3].map(|_| DVec3::new(range(), range(), range()));
            let radius = 0.2 + (range() + 3.0) / 3.0;
            let wanted = drop::disc(&corners, radius);
            if !wanted.is_finite() {
                continue;
            }
            n_met += 1;
            // Below the greatest height over a disc something is in it, above it nothing.
            let (distance, at) = nearest_above(&corners, wanted - 1e-6).unwrap();
            assert!(distance <= radius + 1e-6 && (across(at).length() - distance).abs() < 1e-9);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            assert!(normal.dot(at - corners[0]).abs() < 1e-9 && at.z >= wanted - 1e-6 - 1e-9);
            let above = nearest_above(&corners, wanted + 1e-6);
            assert!(above.is_none_or(|(distance, _)| distance > radius - 1e-4));
        }
        assert!(n_met > 1000, "{n_met}");
    }
}
