//! One tool at one place against all triangles, through the tree.

use super::bvh::{Bvh, Level};
use super::penetrate;
use super::tool::{Outline, Stand, Tip, across};
use super::verdict::Verdict;
use glam::{DVec2, DVec3};

/// A cutter shrunk by one tolerance, ready to be asked about.
#[derive(Debug, Clone)]
pub(super) struct Probe {
    steps: Vec<[f64; 2]>,
    tip: Tip,
    /// The tip, then the steps.
    levels: Vec<Level>,
}

impl Probe {
    /// `reach` is the greatest distance of a reference point from the middle of the triangles, mm.
    pub fn new(outline: &Outline, tolerance: f64, bvh: &Bvh, reach: f64) -> Self {
        let steps: Vec<[f64; 2]> = outline.steps(tolerance).collect();
        let tip = outline.tip(tolerance);
        let lower_end = match tip {
            Tip::Round { ring, radius } => [-radius, ring + radius],
            Tip::Flat { height, radius } => [height, radius],
        };
        let size = outline.size() + reach;
        let levels = std::iter::once(&lower_end).chain(&steps);
        let levels = levels.map(|&[height, radius]| bvh.level(height, radius, size)).collect();
        Probe { steps, tip, levels }
    }

    /// The verdict over all triangles; `last` is the place of a triangle to try first, and becomes that of the one
    /// that a step was found to penetrate.
    pub fn verdict(&self, bvh: &Bvh, stand: &Stand, scratch: &mut Scratch) -> Verdict {
        scratch.n_queries += 1;
        if let Some(place) = scratch.last {
            scratch.n_triangles += 1;
            if self.step_penetrates(&stand.triangle(bvh.triangle(place))) {
                return Verdict::Collides;
            }
        }
        let Scratch { stack, last, n_triangles, .. } = scratch;
        let mut gouges = false;
        let collides = bvh.visit(stand, &self.levels, stack, |place| {
            *n_triangles += 1;
            let corners = stand.triangle(bvh.triangle(place));
            let hit = self.step_penetrates(&corners);
            if hit {
                *last = Some(place);
            }
            gouges |= !hit && !gouges && penetrate::tip(&corners, self.tip);
            hit
        });
        match (collides, gouges) {
            (true, _) => Verdict::Collides,
            (false, true) => Verdict::TipGouges,
            (false, false) => Verdict::Free,
        }
    }

    /// Whether one of the steps penetrates a triangle; the widest is tried first.
    fn step_penetrates(&self, corners: &[DVec3; 3]) -> bool {
        let top = corners[0].z.max(corners[1].z).max(corners[2].z);
        let reached = self.steps.iter().rev().skip_while(|[height, _]| top <= *height);
        let mut nearest = None;
        reached.into_iter().any(|&[height, radius]| {
            let squared = *nearest.get_or_insert_with(|| from_box(corners));
            squared <= radius * radius && penetrate::step(corners, height, radius)
        })
    }
}

/// Distance, squared, of the axis from the upright box around a triangle.
fn from_box(corners: &[DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(across);
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    low.max(-high).max(DVec2::ZERO).length_squared()
}

impl Scratch {
    /// For the next site: only the memory is kept.
    pub fn renewed(self) -> Self {
        Scratch { stack: self.stack, ..Scratch::default() }
    }
}

/// What a worker keeps from query to query.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    stack: Vec<u32>,
    /// Place of the triangle that collided last.
    pub last: Option<u32>,
    /// Queries asked of triangles.
    pub n_queries: u64,
    /// Triangles tested for them.
    pub n_triangles: u64,
}
