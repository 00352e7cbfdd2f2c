//! Stock to leave: what cuts, dilated by a ball.
//!
//! The cutting portion, up to the height at which it ends, is a solid. Dilated by a ball of radius `A` it is again
//! radius over height: the greatest, at every height, of
//!
//! ```text
//! every line moved outward by A · every bulging arc with a radius more by A, every hollow one with one less
//! an arc of radius A about both ends of each
//! ```
//!
//! It begins `A` below the tip. What does not cut stays where it is: the tool is as wide as the wider of both, and goes
//! on as before where what cuts ends.

use super::{Piece, Profile, ProfileSection};

/// Radius over height.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Curve {
    /// From one place to another, radius and height.
    Line([[f64; 2]; 2]),
    Bulging {
        center: [f64; 2],
        radius: f64,
    },
    Hollow {
        center: [f64; 2],
        radius: f64,
    },
}

impl Curve {
    fn radius_at(&self, height: f64) -> f64 {
        match *self {
            Curve::Line([[r0, z0], [r1, z1]]) => {
                if r0 == r1 || z0 == z1 {
                    return r0;
                }
                r0 + (r1 - r0) * ((height - z0) / (z1 - z0))
            }
            Curve::Bulging { center: [c, z], radius } => c + half_chord(radius, height - z),
            Curve::Hollow { center: [c, z], radius } => c - half_chord(radius, height - z),
        }
    }

    fn center(&self) -> Option<[f64; 2]> {
        match *self {
            Curve::Line(_) => None,
            Curve::Bulging { center, .. } | Curve::Hollow { center, .. } => Some(center),
        }
    }
}

fn half_chord(radius: f64, aside: f64) -> f64 {
    (radius * radius - aside * aside).max(0.0).sqrt()
}

/// A curve between two heights.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Span {
    low: f64,
    high: f64,
    curve: Curve,
    cuts: bool,
}

/// Lengths closer than this are the same, mm.
const SAME_MM: f64 = 1e-9;
/// Heights of faces closer than this are one, mm.
const SAME_FACE_MM: f64 = 1e-6;
/// Parts of the height between ends of curves in which the greatest is looked for, and halvings to where that changes.
const PARTS: usize = 16;
const HALVINGS: usize = 60;

impl Profile {
    /// With what cuts dilated by a ball of this radius, mm; heights stay above the tip as it was.
    pub(crate) fn dilated(&self, by_mm: f64) -> Profile {
        let pieces = self.pieces();
        let heights = || pieces.iter().filter(|piece| piece.cuts).flat_map(|piece| piece.ends);
        let lowest = heights().map(|end| end[1]).fold(f64::INFINITY, f64::min) - by_mm;
        let top = heights().map(|end| end[1]).fold(0.0, f64::max) + by_mm;
        let base_mm = lowest.min(self.base_mm);
        let spans = self.spans(&pieces, by_mm);
        let is_face = |height: f64, widens: bool| {
            let of = |piece: &&Piece| {
                let [[r0, z0], [r1, z1]] = piece.ends;
                let moved = if widens { z0 - by_mm } else { z0 + by_mm };
                z0 == z1 && (r1 > r0) == widens && (moved - height).abs() < SAME_FACE_MM
            };
            pieces.iter().find(of).is_some_and(|piece| piece.cuts)
        };
        let (mut sections, mut start_mm) = (Vec::<ProfileSection>::new(), 0.0);
        let mut last = [0.0, base_mm];
        let mut emit = |[from, to]: [[f64; 2]; 2], center_mm: Option<[f64; 2]>, cuts: bool| {
            let is_cutting = is_face(from[1], from[0] > last[0]);
            if sections.is_empty() && is_cutting {
                start_mm = from[0];
            } else if (from[0] - last[0]).abs() > SAME_MM {
                let face = ProfileSection::line(from[0], from[1]);
                sections.push(ProfileSection { cuts: is_cutting, ..face });
            }
            sections.push(ProfileSection { radius_mm: to[0], height_mm: to[1], center_mm, cuts });
            last = to;
        };
        for Span { low, high, curve, cuts } in greatest(&spans, [base_mm, top]) {
            let ends = [low, high].map(|height| [curve.radius_at(height), height]);
            emit(ends, curve.center(), cuts);
        }
        // Above, the profile goes on.
        let mut above = false;
        for piece in pieces.iter().filter(|piece| piece.ends[1][1] > top + SAME_MM) {
            let [low, high] = piece.ends;
            let from =
                if above { low } else { [piece.radius_at(low[1].max(top)), low[1].max(top)] };
            above = true;
            match low[1] == high[1] {
                true => emit([high, high], None, piece.cuts),
                false => emit([from, high], piece.arc.map(|arc| arc.center), piece.cuts),
            }
        }
        if !above {
            let end = pieces.last().map_or([0.0; 2], |piece| [piece.ends[1][0], top]);
            emit([end, end], None, false);
        }
        sections.dedup_by(|next, last| {
            let same = [(next.radius_mm, last.radius_mm), (next.height_mm, last.height_mm)];
            same.iter().all(|(a, b)| a == b || (a - b).abs() < SAME_MM)
        });
        Profile { start_mm, base_mm, sections, is_drill: self.is_drill }
    }

    /// What cuts, dilated, and what does not.
    fn spans(&self, pieces: &[Piece], by: f64) -> Vec<Span> {
        let mut spans = Vec::new();
        for piece in pieces {
            let [[r0, z0], [r1, z1]] = piece.ends;
            let cuts = piece.cuts;
            let curve = match piece.arc {
                None => Curve::Line(piece.ends),
                Some(arc) if arc.is_convex => {
                    Curve::Bulging { center: arc.center, radius: arc.radius }
                }
                Some(arc) => Curve::Hollow { center: arc.center, radius: arc.radius },
            };
            if !cuts {
                spans.extend((z1 > z0).then_some(Span { low: z0, high: z1, curve, cuts }));
                continue;
            }
            for center in piece.ends {
                let (low, high) = (center[1] - by, center[1] + by);
                let curve = Curve::Bulging { center, radius: by };
                spans.push(Span { low, high, curve, cuts });
            }
            let scaled = |center: [f64; 2], share: f64| {
                [z0, z1].map(|z| center[1] + share * (z - center[1]))
            };
            let ([low, high], curve) = match curve {
                Curve::Line(_) => {
                    let length = libm::hypot(r1 - r0, z1 - z0);
                    let out = [by * (z1 - z0) / length, -by * (r1 - r0) / length];
                    let ends = piece.ends.map(|[r, z]| [r + out[0], z + out[1]]);
                    (ends.map(|end| end[1]), Curve::Line(ends))
                }
                Curve::Bulging { center, radius } => {
                    let wider = radius + by;
                    let curve = Curve::Bulging { center, radius: wider };
                    (scaled(center, wider / radius), curve)
                }
                Curve::Hollow { center, radius } => {
                    let narrower = (radius - by).max(0.0);
                    let curve = Curve::Hollow { center, radius: narrower };
                    (scaled(center, narrower / radius), curve)
                }
            };
            if high > low + SAME_MM {
                spans.push(Span { low, high, curve, cuts });
            }
        }
        // Its upper end goes on.
        let end = pieces.last().map_or([0.0; 2], |piece| piece.ends[1]);
        let curve = Curve::Line([end, [end[0], f64::INFINITY]]);
        spans.push(Span { low: end[1], high: f64::INFINITY, curve, cuts: false });
        spans
    }
}

/// The greatest of curves between two heights, from below.
fn greatest(spans: &[Span], [base, top]: [f64; 2]) -> Vec<Span> {
    let ends = spans.iter().flat_map(|span| [span.low, span.high]);
    let mut heights: Vec<f64> = ends.chain([base, top]).map(|z| z.clamp(base, top)).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|b, a| *b - *a < SAME_MM);
    let mut found: Vec<Span> = Vec::new();
    let mut push = |span: &Span, [low, high]: [f64; 2]| match found.last_mut() {
        Some(last) if last.curve == span.curve && last.cuts == span.cuts && last.high == low => {
            last.high = high;
        }
        _ if high > low => found.push(Span { low, high, ..*span }),
        _ => {}
    };
    for pair in heights.windows(2) {
        let middle = 0.5 * (pair[0] + pair[1]);
        let here: Vec<&Span> =
            spans.iter().filter(|span| (span.low..=span.high).contains(&middle)).collect();
        let best = |height: f64| {
            let radius = |k: usize| here[k].curve.radius_at(height);
            (0..here.len()).reduce(|a, b| if radius(b) > radius(a) { b } else { a })
        };
        let at = |k: usize| pair[0] + (pair[1] - pair[0]) * (k as f64 / PARTS as f64);
        for part in 0..PARTS {
            let [from, to] = [at(part), if part + 1 == PARTS { pair[1] } else { at(part + 1) }];
            let inset = 1e-6 * (to - from);
            let (Some(a), Some(b)) = (best(from + inset), best(to - inset)) else { continue };
            if a == b {
                push(here[a], [from, to]);
                continue;
            }
            let (mut left, mut right) = (from, to);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (left + right);
                if best(middle) == Some(a) { left = middle } else { right = middle }
            }
            push(here[a], [from, right]);
            push(here[b], [right, to]);
        }
    }
    found
}
