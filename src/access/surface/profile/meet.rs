//! Does a shrunk tool of any profile, in a pose or moved across its axis, penetrate a triangle?
//!
//! The tool moved from the axis along a *core*, a segment across the axis, sweeps at every height all that is nearer to
//! the core than its radius. Of the points of a triangle at one height the nearest to the core is on an edge, on the
//! line of steepest slope through an end of the core, or over the core: six segments represent the triangle, four of
//! them for a pose. Along a segment and over one element
//!
//! ```text
//! line:  distance from the core − radius                                      is convex
//! arc:   max(distance from the core − c, 0)² + (height − z)² − ρ²             is convex
//! ```
//!
//! so that it is nowhere below its tangents, and where two of them meet the next place is tried.

use super::body::{Body, Curve, Element};
use glam::{DVec2, DVec3};

/// A point of a triangle in a shrunk tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hit {
    pub point: DVec3,
    pub cuts: bool,
}

/// A segment and where it goes.
#[derive(Debug, Clone, Copy)]
struct Segment {
    from: DVec3,
    run: DVec3,
}

impl Segment {
    fn new([a, b]: [DVec3; 2]) -> Self {
        Segment { from: a, run: b - a }
    }

    fn at(&self, t: f64) -> DVec3 {
        self.from + self.run * t
    }

    /// Between which shares it is between two heights; none if nowhere.
    fn between(&self, low: f64, high: f64) -> Option<[f64; 2]> {
        let (z, rise) = (self.from.z, self.run.z);
        if rise.abs() < 1e-12 {
            return (z > low && z < high).then_some([0.0, 1.0]);
        }
        let [a, b] = [(low - z) / rise, (high - z) / rise];
        let [from, to] = [a.min(b).max(0.0), a.max(b).min(1.0)];
        (from < to).then_some([from, to])
    }
}

/// Steps to the least value of a convex function.
const STEPS: usize = 60;

/// Whether a triangle, in the frame of the tool, is penetrated; with a point that is in the tool. `core` is from the
/// axis to where it is moved.
pub(super) fn penetrates(body: &Body, corners: &[DVec3; 3], core: DVec2) -> Option<Hit> {
    let mut hit = None;
    over(body, corners, (core, 0.0), |segment, element| {
        let t = inside(segment, element, core);
        hit = t.map(|t| Hit { point: segment.at(t), cuts: element.cuts });
        hit.is_some()
    });
    hit
}

/// Of a triangle, in the frame of the tool, about the point that is farthest in, measured across the axis, if it is
/// farther in than `least`, mm; and how far.
pub(super) fn deepest(body: &Body, corners: &[DVec3; 3], least: f64) -> Option<(f64, DVec3)> {
    let (mut most, mut best) = (least, None);
    over(body, corners, (DVec2::ZERO, least), |segment, element| {
        if let Some((depth, t)) = farthest_in(segment, element, most) {
            (most, best) = (depth, Some((depth, segment.at(t))));
        }
        false
    });
    best
}

/// About the point of a triangle that is deepest, measured from the faces beside an element as well as across the axis.
pub(super) fn deepest_from_faces(body: &Body, corners: &[DVec3; 3]) -> Option<DVec3> {
    let (mut most, mut best) = (0.0, None);
    over(body, corners, (DVec2::ZERO, 0.0), |segment, element| {
        if let Some((depth, t)) = farthest_in(segment, element, most) {
            let (depth, t) = from_faces(segment, element, [depth, t]);
            if depth > most {
                (most, best) = (depth, Some(segment.at(t)));
            }
        }
        false
    });
    best
}

/// Calls `each` with points of a triangle at the heights of elements that it may penetrate: where the segments that
/// represent it come to these heights, leave them, and between.
pub(super) fn for_some_points(body: &Body, corners: &[DVec3; 3], mut each: impl FnMut(DVec3)) {
    over(body, corners, (DVec2::ZERO, 0.0), |segment, element| {
        if let Some([from, to]) = segment.between(element.low, element.high) {
            [from, 0.5 * (from + to), to].into_iter().for_each(|t| each(segment.at(t)));
        }
        false
    });
}

/// Calls `test` with the segments that represent a triangle and the elements at their heights in which it may be deeper
/// than `least`, until it is true.
fn over(
    body: &Body,
    corners: &[DVec3; 3],
    (core, least): (DVec2, f64),
    mut test: impl FnMut(&Segment, &Element) -> bool,
) {
    let low = corners[0].z.min(corners[1].z).min(corners[2].z);
    let high = corners[0].z.max(corners[1].z).max(corners[2].z);
    let beside = from_box(corners, core).sqrt();
    let first = body.elements.partition_point(|element| element.high <= low);
    let over = body.elements[first..].iter().take_while(|element| element.low <= high);
    let mut lines: Option<Lines> = None;
    for element in over.filter(|element| element.most > beside + least) {
        if let Curve::Arc { center: [c, z], radius } = element.curve {
            // Nearer to the center is no point of the triangle.
            let across = (beside + least - c).max(0.0);
            let along = (low - z).max(z - high).max(0.0);
            if across * across + along * along >= radius * radius {
                continue;
            }
        }
        let lines = lines.get_or_insert_with(|| Lines::of(corners, core));
        if lines.segments[..lines.n].iter().any(|segment| test(segment, element)) {
            return;
        }
    }
}

/// The segments that represent a triangle.
struct Lines {
    segments: [Segment; 6],
    n: usize,
}

impl Lines {
    fn of(corners: &[DVec3; 3], core: DVec2) -> Lines {
        let [a, b, c] = *corners;
        let edge = Segment::new([a, b]);
        let mut lines = Lines { segments: [edge; 6], n: 1 };
        lines.push(Some([b, c]));
        lines.push(Some([c, a]));
        let normal = (b - a).cross(c - a);
        let slope = normal.truncate();
        // Of a level triangle any line through the axis does.
        let slope = if slope.length_squared() > 0.0 { slope } else { DVec2::X };
        lines.push(cut(corners, slope.perp(), 0.0));
        if core != DVec2::ZERO {
            lines.push(cut(corners, slope.perp(), slope.perp().dot(core)));
            lines.push(cut(corners, core.perp(), 0.0));
        }
        lines
    }

    fn push(&mut self, ends: Option<[DVec3; 2]>) {
        if let Some(ends) = ends {
            self.segments[self.n] = Segment::new(ends);
            self.n += 1;
        }
    }
}

/// Where the upright plane `across·xy = offset` cuts a triangle.
fn cut(corners: &[DVec3; 3], across: DVec2, offset: f64) -> Option<[DVec3; 2]> {
    let side = |p: DVec3| p.truncate().dot(across) - offset;
    let sides = [side(corners[0]), side(corners[1]), side(corners[2])];
    let (mut ends, mut n) = ([DVec3::ZERO; 2], 0);
    for k in 0..3 {
        let (a, b) = (sides[k], sides[(k + 1) % 3]);
        if (a < 0.0) != (b < 0.0) && n < 2 {
            ends[n] = corners[k].lerp(corners[(k + 1) % 3], a / (a - b));
            n += 1;
        }
    }
    (n == 2).then_some(ends)
}

/// Distance, squared, of the core from the upright box around a triangle, or less.
fn from_box(corners: &[DVec3; 3], core: DVec2) -> f64 {
    let [a, b, c] = [corners[0].truncate(), corners[1].truncate(), corners[2].truncate()];
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let (least, most) = (core.min(DVec2::ZERO), core.max(DVec2::ZERO));
    (low - most).max(least - high).max(DVec2::ZERO).length_squared()
}

/// From the core to a place across the axis.
fn from_core(place: DVec2, core: DVec2) -> DVec2 {
    let squared = core.length_squared();
    if squared == 0.0 {
        return place;
    }
    place - core * (place.dot(core) / squared).clamp(0.0, 1.0)
}

/// A share of the segment at which it is in an element; none if it nowhere is.
fn inside(segment: &Segment, element: &Element, core: DVec2) -> Option<f64> {
    let [low, high] = segment.between(element.low, element.high)?;
    // Value and slope, of a convex function that is negative inside.
    let value = |t: f64| {
        let p = segment.at(t);
        let away = from_core(p.truncate(), core);
        let distance = away.length();
        let growth = match distance > 0.0 {
            true => away.dot(segment.run.truncate()) / distance,
            false => 0.0,
        };
        match element.curve {
            Curve::Line { radius, slope } => {
                [distance - radius - slope * p.z, growth - slope * segment.run.z]
            }
            Curve::Arc { center: [c, z], radius } => {
                let beyond = (distance - c).max(0.0);
                [
                    beyond * beyond + (p.z - z) * (p.z - z) - radius * radius,
                    2.0 * (beyond * growth + (p.z - z) * segment.run.z),
                ]
            }
        }
    };
    negative(value, [low, high])
}

/// A share at which a convex function is negative; none if it nowhere is. `value` is the function and its slope.
///
/// ```text
/// negative at an end: that; the function rises from the lower end, or falls to the upper: none
/// the tangents of both ends meet above 0: none; negative where they meet: that
/// else that becomes an end
/// ```
fn negative(value: impl Fn(f64) -> [f64; 2], [mut low, mut high]: [f64; 2]) -> Option<f64> {
    let mut at_low = value(low);
    if at_low[0] < 0.0 {
        return Some(low);
    }
    let mut at_high = value(high);
    if at_high[0] < 0.0 {
        return Some(high);
    }
    if at_low[1] >= 0.0 || at_high[1] <= 0.0 {
        return None;
    }
    for _ in 0..STEPS {
        let (t, bound) = meeting([low, high], [at_low, at_high]);
        if bound >= 0.0 {
            return None;
        }
        let at = value(t);
        if at[0] < 0.0 {
            return Some(t);
        }
        if at[1] > 0.0 { (high, at_high) = (t, at) } else { (low, at_low) = (t, at) }
    }
    None
}

/// Where two tangents meet, well between the ends, and how high.
fn meeting([low, high]: [f64; 2], [a, b]: [[f64; 2]; 2]) -> (f64, f64) {
    /// Of the length between the ends, from them.
    const INSIDE: f64 = 0.01;
    let width = high - low;
    // The slope of the first is negative, that of the second positive.
    let share = ((b[0] - a[0] - b[1] * width) / ((a[1] - b[1]) * width)).clamp(0.0, 1.0);
    let bound = a[0] + a[1] * share * width;
    (low + width * share.clamp(INSIDE, 1.0 - INSIDE), bound)
}

/// About how far in a segment is in an element at most, and at which share, if that is more than `least`.
fn farthest_in(segment: &Segment, element: &Element, least: f64) -> Option<(f64, f64)> {
    /// What is near enough to the greatest depth, as a share of it.
    const NEAR: f64 = 0.02;
    let [low, high] = segment.between(element.low, element.high)?;
    let across = segment.run.truncate();
    // The distance from the axis less the radius, which is convex, and its slope.
    let value = |t: f64| {
        let p = segment.at(t);
        let distance = p.truncate().length();
        let growth = if distance > 0.0 { p.truncate().dot(across) / distance } else { 0.0 };
        let (radius, widening) = match element.curve {
            Curve::Line { radius, slope } => (radius + slope * p.z, slope),
            Curve::Arc { center: [c, z], radius } => {
                let half = (radius * radius - (p.z - z) * (p.z - z)).max(0.0).sqrt();
                (c + half, -(p.z - z) / half.max(1e-9))
            }
        };
        [distance - radius, growth - widening * segment.run.z]
    };
    // As far in as an end is, or deeper between them.
    let (mut low, mut high) = (low, high);
    let (mut at_low, mut at_high) = (value(low), value(high));
    let mut best = if at_low[0] <= at_high[0] { (at_low[0], low) } else { (at_high[0], high) };
    for _ in 0..STEPS {
        if at_low[1] >= 0.0 || at_high[1] <= 0.0 {
            break;
        }
        let (t, bound) = meeting([low, high], [at_low, at_high]);
        if bound >= best.0.min(-least) * (1.0 + NEAR) {
            break;
        }
        let at = value(t);
        if at[0] < best.0 {
            best = (at[0], t);
        }
        if at[1] > 0.0 { (high, at_high) = (t, at) } else { (low, at_low) = (t, at) }
    }
    (best.0 < -least).then_some((-best.0, best.1))
}

/// About the greatest depth, the lesser of that across the axis and that from a face, and its share; from the share
/// that is deepest across the axis.
///
/// ```text
/// nearer to the axis than the face is, or deeper from the face: that share
/// else away from the face, to where it is as deep across the axis as from the face
/// ```
fn from_faces(segment: &Segment, element: &Element, [depth, at]: [f64; 2]) -> (f64, f64) {
    const HALVINGS: usize = 20;
    let across = |t: f64| {
        let p = segment.at(t);
        element.curve.radius_at(p.z) - p.truncate().length()
    };
    let p = segment.at(at);
    let distance = p.truncate().length();
    let from = [p.z - element.low, element.high - p.z];
    let end = usize::from(from[1] < from[0]);
    if from[end] >= depth || distance <= element.beside[end] {
        return (depth, at);
    }
    let Some([low, high]) = segment.between(element.low, element.high) else { return (depth, at) };
    let side = if end == 0 { 1.0 } else { -1.0 };
    let far = if segment.run.z * side > 0.0 { high } else { low };
    let face = [element.low, element.high][end];
    let from_face = |t: f64| side * (segment.at(t).z - face);
    let (mut near, mut far) = (at, far);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (near + far);
        if across(middle) > from_face(middle) { near = middle } else { far = middle }
    }
    (across(near).min(from_face(near)).max(0.0), near)
}
