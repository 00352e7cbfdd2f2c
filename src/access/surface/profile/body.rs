//! A profile shrunk by a tolerance: radius over height in lines and convex arcs, without faces.
//!
//! The shrunk tool is what is farther than τ from the profile. At a height it is as wide as the least of these: every
//! line moved inward by τ; every convex arc with a radius less by τ, every hollow one with one greater; the radius at
//! which a face across the axis begins, within τ of its height; and an arc of radius τ about every corner that points
//! inward. The arcs that are hollow are replaced by chords.

use crate::tool::cutter::{Piece, Profile};
use std::f64::consts::{FRAC_PI_2, PI};

/// A part of a shrunk profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Element {
    /// Heights of its ends above the tip, mm.
    pub low: f64,
    pub high: f64,
    pub curve: Curve,
    /// Greatest radius.
    pub most: f64,
    pub cuts: bool,
    /// Radii just below and just above, beyond which its ends are faces; infinite where faces do not count.
    pub beside: [f64; 2],
}

/// Radius over height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Curve {
    /// Radius at height 0, and its growth.
    Line { radius: f64, slope: f64 },
    /// Beyond the center.
    Arc { center: [f64; 2], radius: f64 },
}

impl Curve {
    /// Negative where there is nothing.
    pub fn radius_at(&self, height: f64) -> f64 {
        match *self {
            Curve::Line { radius, slope } => radius + slope * height,
            Curve::Arc { center: [c, z], radius } => {
                c + (radius * radius - (height - z) * (height - z)).max(0.0).sqrt()
            }
        }
    }
}

/// A shrunk tool, as elements from below.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Body {
    pub elements: Vec<Element>,
}

/// In place of the spindle's radius and of no upper end, mm: beyond 10 m of tool and 1 km of part.
pub(super) const WIDE: f64 = 1e7;
/// Hollow arcs are replaced by chords that are this far from them at most, mm, as far as so many suffice.
const CHORD_MM: f64 = 2e-4;
const MOST_CHORDS: usize = 256;
/// Heights closer than this are one, mm.
const SAME: f64 = 1e-9;
/// Halvings after which a crossing is found.
const HALVINGS: usize = 60;

/// A bound of the radius between two heights.
#[derive(Debug, Clone, Copy)]
struct Bound {
    low: f64,
    high: f64,
    curve: Curve,
    cuts: bool,
}

impl Body {
    /// The profile shrunk by a tolerance, which is positive. Where that is more than the radius of a convex arc, the
    /// body may be too wide beside it, never too thin: poses may be refused there, none is free that is not.
    pub fn new(profile: &Profile, tolerance: f64) -> Body {
        Body::within(bounds(profile, tolerance))
    }

    /// As [`Body::new`], for depths of any length: beside an arc of a lesser radius it may be too wide, and who tests
    /// against it must look at the depth of the point as well.
    pub fn deep(profile: &Profile, depth: f64) -> Body {
        let mut bounds = bounds(profile, depth);
        for Piece { ends: [[_, low], [_, high]], arc, cuts } in finite_pieces(profile) {
            if let Some(arc) = arc.filter(|arc| arc.is_convex && arc.radius <= depth) {
                let curve = Curve::Line { radius: arc.center[0], slope: 0.0 };
                bounds.push(Bound { low, high, curve, cuts });
            }
        }
        Body::within(bounds)
    }

    fn within(bounds: Vec<Bound>) -> Body {
        let mut heights: Vec<f64> =
            bounds.iter().flat_map(|bound| [bound.low, bound.high]).collect();
        heights.sort_by(f64::total_cmp);
        heights.dedup_by(|b, a| *b - *a < SAME);
        let mut elements = Vec::new();
        for pair in heights.windows(2) {
            let middle = 0.5 * (pair[0] + pair[1]);
            let over = |bound: &&Bound| (bound.low..=bound.high).contains(&middle);
            let here: Vec<Bound> = bounds.iter().filter(over).copied().collect();
            lowest(&here, [pair[0], pair[1]], &mut elements);
        }
        Body { elements: joined(elements) }
    }

    /// The tool that is as wide at every height as anything below: what it sweeps when it is drawn back along its axis.
    pub fn retracting(&self) -> Body {
        let mut widest = (0.0, true);
        let mut elements: Vec<Element> = Vec::new();
        for element in &self.elements {
            let (low, high) = (element.low, element.high);
            let top = peak(element);
            // Where it becomes wider than what is below.
            let from = match element.curve.radius_at(top) > widest.0 {
                false => high,
                true => first_wider(element, widest.0, [low, top]),
            };
            let to = top.max(from);
            let flat = |from: f64, to: f64, (radius, cuts): (f64, bool)| Element {
                low: from,
                high: to,
                curve: Curve::Line { radius, slope: 0.0 },
                most: radius,
                cuts,
                beside: [f64::INFINITY; 2],
            };
            if from > low && widest.0 > 0.0 {
                elements.push(flat(low, from, widest));
            }
            if to > from {
                elements.push(Element { low: from, high: to, ..*element });
            }
            if element.curve.radius_at(to) > widest.0 {
                widest = (element.curve.radius_at(to), element.cuts);
            }
            if high > to && widest.0 > 0.0 {
                elements.push(flat(to, high, widest));
            }
        }
        Body { elements: joined(elements) }
    }

    /// With what is beside every element, so that depths are also measured from the faces across the axis.
    pub fn with_faces(mut self) -> Body {
        let beside = |k: Option<usize>, at: f64, end: fn(&Element) -> f64| {
            let next = k.and_then(|k| self.elements.get(k));
            let next = next.filter(|next| (end(next) - at).abs() < SAME);
            next.map_or(0.0, |next| next.curve.radius_at(at).max(0.0))
        };
        let all: Vec<[f64; 2]> = (0..self.elements.len())
            .map(|k| {
                let Element { low, high, .. } = self.elements[k];
                [beside(k.checked_sub(1), low, |e| e.high), beside(Some(k + 1), high, |e| e.low)]
            })
            .collect();
        self.elements.iter_mut().zip(all).for_each(|(element, beside)| element.beside = beside);
        self
    }

    /// At a height, mm; 0 where there is nothing.
    pub fn radius_at(&self, height: f64) -> f64 {
        let over = |element: &&Element| (element.low..=element.high).contains(&height);
        let radii =
            self.elements.iter().filter(over).map(|element| element.curve.radius_at(height));
        radii.fold(0.0, f64::max)
    }

    /// Greatest radius at a height and below, mm; 0 where there is nothing.
    pub fn radius_below(&self, height: f64) -> f64 {
        let below = self.elements.iter().take_while(|element| element.low <= height);
        let radii = below.map(|element| match element.high <= height {
            true => element.most,
            false => element.curve.radius_at(height).max(element.curve.radius_at(element.low)),
        });
        radii.fold(0.0, f64::max)
    }

    /// The elements that do not cut.
    pub fn non_cutting(&self) -> Body {
        let non_cutting = self.elements.iter().filter(|element| !element.cuts);
        Body { elements: non_cutting.copied().collect() }
    }

    /// Greatest radius below the spindle, mm, and the height of the highest of its ends.
    pub fn size(&self) -> [f64; 2] {
        let finite = |x: &f64| *x < 0.5 * WIDE;
        let radii = self.elements.iter().map(|element| element.most).filter(finite);
        let heights = self.elements.iter().flat_map(|element| [element.low, element.high]);
        [radii.fold(0.0, f64::max), heights.filter(finite).fold(0.0, f64::max)]
    }

    /// Heights of both ends and greatest radius, mm, of so many parts of every element that is not as wide everywhere.
    pub fn slices(&self, n: usize) -> Vec<[f64; 3]> {
        let mut slices = Vec::new();
        for element in &self.elements {
            let is_even = matches!(element.curve, Curve::Line { slope: 0.0, .. });
            let n = if is_even { 1 } else { n };
            let height =
                |k: usize| element.low + (element.high - element.low) * (k as f64 / n as f64);
            for k in 0..n {
                let [low, high] =
                    [height(k), if k + 1 == n { element.high } else { height(k + 1) }];
                let part = Element { low, high, ..*element };
                slices.push([low, high, part.curve.radius_at(peak(&part))]);
            }
        }
        slices
    }
}

/// A tool shrunk by one tolerance, in the forms that are tested.
#[derive(Debug)]
pub(super) struct Shrunk {
    pub whole: Body,
    /// See [`Body::retracting`].
    pub retracting: Body,
    /// What does not cut.
    pub non_cutting: Body,
    pub tolerance: f64,
}

impl Shrunk {
    pub fn new(profile: &Profile, tolerance: f64) -> Self {
        let whole = Body::new(profile, tolerance);
        Shrunk {
            retracting: whole.retracting(),
            non_cutting: whole.non_cutting(),
            whole: whole.with_faces(),
            tolerance,
        }
    }
}

/// The height in an element at which it is widest.
fn peak(element: &Element) -> f64 {
    match element.curve {
        Curve::Line { slope, .. } if slope > 0.0 => element.high,
        Curve::Line { .. } => element.low,
        Curve::Arc { center, .. } => center[1].clamp(element.low, element.high),
    }
}

/// The lowest height of a rising part at which it is wider than this; its end if it nowhere is.
fn first_wider(element: &Element, radius: f64, [mut low, mut high]: [f64; 2]) -> f64 {
    if element.curve.radius_at(low) >= radius {
        return low;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if element.curve.radius_at(middle) < radius { low = middle } else { high = middle }
    }
    high
}

/// Elements of one curve that follow one another become one.
fn joined(elements: Vec<Element>) -> Vec<Element> {
    let mut joined: Vec<Element> = Vec::with_capacity(elements.len());
    for element in elements {
        match joined.last_mut() {
            Some(last)
                if last.curve == element.curve
                    && last.cuts == element.cuts
                    && element.low - last.high < SAME =>
            {
                last.high = element.high;
                last.most = last.most.max(element.most);
            }
            _ => joined.push(element),
        }
    }
    joined
}

/// Appends the least of bounds that hold over all of a range.
fn lowest(bounds: &[Bound], [low, high]: [f64; 2], elements: &mut Vec<Element>) {
    /// Parts in which the least is looked for.
    const PARTS: usize = 8;
    let least = |height: f64| {
        let better = |a: usize, b: usize| {
            let [of_a, of_b] = [a, b].map(|k| bounds[k].curve.radius_at(height));
            if of_b < of_a { b } else { a }
        };
        (0..bounds.len()).reduce(better)
    };
    let mut push = |k: usize, low: f64, high: f64| {
        let Bound { curve, cuts, .. } = bounds[k];
        let beside = [f64::INFINITY; 2];
        let mut element = Element { low, high, curve, most: 0.0, cuts, beside };
        element.most = curve.radius_at(peak(&element));
        if element.most > 0.0 && high > low {
            elements.push(element);
        }
    };
    let at = |k: usize| low + (high - low) * (k as f64 / PARTS as f64);
    for part in 0..PARTS {
        let [from, to] = [at(part), at(part + 1)];
        // Just inside, as bounds meet at the ends.
        let inset = 1e-6 * (to - from);
        let (Some(a), Some(b)) = (least(from + inset), least(to - inset)) else { return };
        if a == b {
            push(a, from, to);
            continue;
        }
        let (mut left, mut right) = (from, to);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (left + right);
            if least(middle) == Some(a) { left = middle } else { right = middle }
        }
        push(a, from, right);
        push(b, right, to);
    }
}

fn line_through([r0, z0]: [f64; 2], [r1, z1]: [f64; 2]) -> Curve {
    let slope = (r1 - r0) / (z1 - z0);
    Curve::Line { radius: r0 - slope * z0, slope }
}

/// Of a profile: pieces without spindle and upper end at infinity.
pub(super) fn finite_pieces(profile: &Profile) -> Vec<Piece> {
    let mut pieces = profile.pieces();
    for piece in &mut pieces {
        piece.ends = piece.ends.map(|[r, z]| [r.min(WIDE), z]);
    }
    let top = pieces.last().map_or([0.0; 2], |piece| piece.ends[1]);
    pieces.push(Piece { ends: [top, [top[0], WIDE]], arc: None, cuts: false });
    pieces
}

/// Outward normal of a piece at one of its ends, as an angle above the plane across the axis.
pub(super) fn normal_at(piece: &Piece, end: usize) -> f64 {
    let [[r0, z0], [r1, z1]] = piece.ends;
    match piece.arc {
        None => libm::atan2(-(r1 - r0), z1 - z0),
        Some(arc) => {
            let [r, z] = piece.ends[end];
            let sign = if arc.is_convex { 1.0 } else { -1.0 };
            libm::atan2(sign * (z - arc.center[1]), sign * (r - arc.center[0]))
        }
    }
}

fn bounds(profile: &Profile, tolerance: f64) -> Vec<Bound> {
    let pieces = finite_pieces(profile);
    let mut bounds = Vec::new();
    for piece in &pieces {
        let [[r0, z0], [r1, z1]] = piece.ends;
        let cuts = piece.cuts;
        if z0 == z1 {
            let curve = Curve::Line { radius: r0.min(r1), slope: 0.0 };
            bounds.push(Bound { low: z0 - tolerance, high: z0 + tolerance, curve, cuts });
            continue;
        }
        match piece.arc {
            None => {
                let normal = normal_at(piece, 0);
                let [by_r, by_z] = [libm::cos(normal), libm::sin(normal)].map(|x| x * tolerance);
                let [low, high] = [z0 - by_z, z1 - by_z];
                let curve = line_through([r0 - by_r, low], [r1 - by_r, high]);
                bounds.push(Bound { low, high, curve, cuts });
            }
            Some(arc) if arc.is_convex => {
                let radius = arc.radius - tolerance;
                let share = (radius / arc.radius).max(0.0);
                let [low, high] = [z0, z1].map(|z| arc.center[1] + share * (z - arc.center[1]));
                let curve = match radius > 0.0 {
                    true => Curve::Arc { center: arc.center, radius },
                    false => Curve::Line { radius: arc.center[0], slope: 0.0 },
                };
                bounds.push(Bound { low, high, curve, cuts });
            }
            Some(arc) => {
                let [from, to] = [0, 1].map(|end| normal_at(piece, end));
                hollow((arc.center, arc.radius + tolerance), [from, to], cuts, &mut bounds);
            }
        }
    }
    corners(&pieces, tolerance, &mut bounds);
    bounds
}

/// Chords of a hollow arc between two normals of what is outside of it.
fn hollow(
    ([c, z], radius): ([f64; 2], f64),
    [from, to]: [f64; 2],
    cuts: bool,
    bounds: &mut Vec<Bound>,
) {
    let step = 2.0 * libm::acos(1.0 - (CHORD_MM / radius).min(1.0));
    let n = (((from - to).abs() / step).ceil() as usize).clamp(1, MOST_CHORDS);
    // The normal points at the center.
    let at = |k: usize| {
        let angle = from + (to - from) * (k as f64 / n as f64);
        [c - radius * libm::cos(angle), z - radius * libm::sin(angle)]
    };
    for k in 0..n {
        let [a, b] = [at(k), at(k + 1)];
        if b[1] - a[1] > SAME {
            bounds.push(Bound { low: a[1], high: b[1], curve: line_through(a, b), cuts });
        }
    }
}

/// Arcs about the corners that point inward.
fn corners(pieces: &[Piece], tolerance: f64, bounds: &mut Vec<Bound>) {
    for pair in pieces.windows(2) {
        let [before, after] = [normal_at(&pair[0], 1), normal_at(&pair[1], 0)];
        // Going up along the profile normals turn upward where it bulges, downward where it is hollow.
        let turn = after - before;
        let turn = if turn < -PI { turn + 2.0 * PI } else { turn };
        if turn < -1e-9 {
            let clamped = [before, after].map(|a| a.clamp(-FRAC_PI_2, FRAC_PI_2));
            hollow((pair[0].ends[1], tolerance), clamped, pair[1].cuts, bounds);
        }
    }
}
