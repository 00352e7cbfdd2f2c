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

    /// Height and radius of every shrunk step.
    pub fn steps(&self) -> &[[f64; 2]] {
        &self.steps
    }

    /// The shrunk tip.
    pub fn tip(&self) -> Tip {
        self.tip
    }

    /// The verdict over all triangles. The one that a step penetrated last is tried first.
    pub fn verdict(&self, bvh: &Bvh, stand: &Stand, scratch: &mut Scratch) -> Verdict {
        self.verdict_with(bvh, stand, scratch, |_| true)
    }

    /// As [`Probe::verdict`]; `enough` is told of the triangles that the steps or the tip penetrate, until it says so of one of
    /// the former.
    pub fn verdict_with(
        &self,
        bvh: &Bvh,
        stand: &Stand,
        scratch: &mut Scratch,
        mut enough: impl FnMut(&[DVec3; 3]) -> bool,
    ) -> Verdict {
        let Scratch { stack, last, n_triangles, n_queries } = scratch;
        *n_queries += 1;
        let (mut collides, mut gouges) = (false, false);
        let first = *last;
        let mut test = |place: u32| {
            *n_triangles += 1;
            let corners = stand.triangle(bvh.triangle(place));
            if self.step_penetrates(&corners) {
                collides = true;
                *last = Some(place);
                return enough(bvh.triangle(place));
            }
            if !collides && !gouges && penetrate::tip(&corners, self.tip) {
                gouges = true;
                enough(bvh.triangle(place));
            }
            false
        };
        if !first.is_some_and(&mut test) {
            bvh.visit(stand, &self.levels, stack, test);
        }
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
