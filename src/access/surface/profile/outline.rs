//! How deep a point is in a tool of any profile, and which way it is out.

use super::body::finite_pieces;
use crate::tool::cutter::{Piece, Profile};
use glam::{DVec2, DVec3, dvec2};

/// The profile itself, not shrunk.
#[derive(Debug, Clone)]
pub(super) struct Outline {
    pieces: Vec<Piece>,
    /// From and up to which heights something cuts, from below, mm.
    cutting: Vec<[f64; 2]>,
    /// Greatest radius of what cuts, mm.
    cutting_radius: f64,
}

/// How deep a point is in a tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Depth {
    /// Distance from everything outside, mm; negative for a point outside: the distance from the tool.
    pub mm: f64,
    /// From the point toward the nearest place of the profile, a unit vector in the frame of the tool; zero on it.
    pub toward: DVec3,
}

impl Outline {
    pub fn new(profile: &Profile) -> Self {
        let pieces = finite_pieces(profile);
        let mut cutting: Vec<[f64; 2]> = Vec::new();
        for piece in pieces.iter().filter(|piece| piece.cuts) {
            let [low, high] = piece.ends.map(|[_, z]| z);
            match cutting.last_mut().filter(|last| last[1] >= low) {
                Some(last) => last[1] = last[1].max(high),
                None => cutting.push([low, high]),
            }
        }
        Outline { pieces, cutting, cutting_radius: profile.cutting_radius_mm() }
    }

    /// Of a point in the frame of the tool, from its tip.
    pub fn depth(&self, point: DVec3) -> Depth {
        let flat = point.truncate();
        let at = dvec2(flat.length(), point.z);
        let mut best = (f64::INFINITY, DVec2::ZERO);
        for piece in &self.pieces {
            let nearest = nearest(piece, at);
            let squared = (nearest - at).length_squared();
            if squared < best.0 {
                best = (squared, nearest - at);
            }
        }
        let outward = if at.x > 0.0 { flat / at.x } else { DVec2::X };
        let toward = (outward * best.1.x).extend(best.1.y).normalize_or_zero();
        let distance = best.0.sqrt();
        Depth { mm: if self.holds(at) { distance } else { -distance }, toward }
    }

    /// How deep a point in the frame of the tool is in what cuts, mm; negative outside, `least` if that is more.
    pub fn depth_in_cuts(&self, point: DVec3, least: f64) -> f64 {
        let between = |[low, high]: &[f64; 2]| (point.z - low).min(high - point.z);
        let along = self.cutting.iter().map(between).fold(f64::NEG_INFINITY, f64::max);
        if along <= least {
            return least;
        }
        let across = self.cutting_radius - point.truncate().length();
        if across <= least {
            return least;
        }
        self.depth(point).mm.min(along).min(across).max(least)
    }

    /// Whether a place, radius and height, is in the tool.
    fn holds(&self, at: DVec2) -> bool {
        let over = |piece: &&Piece| {
            let [low, high] = piece.ends.map(|[_, z]| z);
            low < high && (low..high).contains(&at.y)
        };
        self.pieces.iter().filter(over).any(|piece| at.x < piece.radius_at(at.y))
    }
}

/// The place of a piece that is nearest to another.
fn nearest(piece: &Piece, at: DVec2) -> DVec2 {
    let [a, b] = piece.ends.map(DVec2::from_array);
    if let Some(arc) = piece.arc {
        let center = DVec2::from_array(arc.center);
        let away = (at - center).normalize_or_zero() * arc.radius;
        let on = center + away;
        let side = if arc.is_convex { away.x >= 0.0 } else { away.x <= 0.0 };
        if side && (a.y..=b.y).contains(&on.y) && away != DVec2::ZERO {
            return on;
        }
        return if (a - at).length_squared() <= (b - at).length_squared() { a } else { b };
    }
    let run = b - a;
    let share = ((at - a).dot(run) / run.length_squared()).clamp(0.0, 1.0);
    a + run * share
}
