//! Searches the poses about a point for a free one.
//!
//! ```text
//! cells = a rectangle around all poses, or around those that are not too deep in the plane of the surface, in eight
//! forget cells that a known blocker closes, now and after every test, or that a triangle closes; none left: closed
//! slide: test the pose that touches with the normal: free → reached; else points of what penetrates become blockers
//!        push it along the poses, clear of the deepest blocker; again, unless it goes to and fro
//! best first: the cell whose middle is least deep in the blockers
//!     no blocker is in the middle: test there, as above
//!     smaller than the resolution: given up; a triangle closes it: forgotten; else cut in half across the longer side
//! ```
//!
//! The poses of a cell are in a box; a blocker is in the tool for all of them if it is where the box puts it farthest
//! from the axis and lowest. A triangle closes a cell if it is in a tool at its middle that is shrunk by half the
//! cell's diagonal: poses are no farther apart than their places on the disc.

use super::blockers::{Blockers, Local, Met, Shape};
use super::{PoseBox, PoseSet};
use crate::access::surface::tool::{Axes, Contact};
use crate::simd::Isa;
use crate::tool::directions::basis;
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// A rectangle of places on the disc of poses.
#[derive(Debug, Clone, Copy)]
struct Cell {
    at: DVec2,
    half: DVec2,
    /// Of the pose in the middle.
    depth: f64,
}

impl Cell {
    /// Its halves across the longer side.
    fn halves(&self) -> [Cell; 2] {
        let shift = match self.half.x >= self.half.y {
            true => DVec2::new(0.5 * self.half.x, 0.0),
            false => DVec2::new(0.0, 0.5 * self.half.y),
        };
        [-shift, shift].map(|shift| Cell {
            at: self.at + shift,
            half: self.half - shift.abs(),
            ..*self
        })
    }
}

/// What a search is over.
pub(in crate::access::surface) struct Around<'a> {
    shape: &'a Shape,
    poses: PoseSet,
    /// The point of contact.
    point: DVec3,
    /// Across the axis toward where the normal leans, and beside that; along the axis.
    axes: Axes,
    own: Option<OwnPlane>,
    /// No place on the disc is farther along either axis from that of the site's own pose, mm.
    within: f64,
    /// Tolerances at the point: see [`PoseSet::touches`], mm.
    rim: f64,
}

/// A normal leans against the direction by at least this.
const LEANING: f64 = 1e-7;
/// Greatest ratio of distances on the disc and of poses.
const APART: f64 = FRAC_PI_2;

/// The plane of a surface about the point of contact, in the frame of the tool: poses that cut it deeper than the
/// tolerances are closed.
#[derive(Debug, Clone, Copy)]
struct OwnPlane {
    normal: DVec3,
    /// Height of a tip's reference point above the plane when the grown tip touches it.
    touching: f64,
    /// How much less is granted; infinite if the surface is not known to go on about the point.
    slack: f64,
    /// The place on the disc of the pose that is farthest from the plane.
    best: DVec2,
}

impl OwnPlane {
    /// Whether all poses of a cell are too deep in the plane; the axes of the disc are those of the normal.
    fn closes(&self, poses: &PoseSet, cell: &Cell) -> bool {
        let nearest = self.best.clamp(cell.at - cell.half, cell.at + cell.half);
        self.touching - self.normal.dot(poses.offset(nearest)) > self.slack
    }
}

/// Memory of a search.
#[derive(Debug)]
pub(in crate::access::surface) struct PoseSearch {
    cells: Vec<Cell>,
    local: Local,
    isa: Isa,
}

impl Default for PoseSearch {
    fn default() -> Self {
        PoseSearch { cells: Vec::new(), local: Local::default(), isa: Isa::active() }
    }
}

/// Pushes after which nothing is found.
const N_PUSHES: usize = 40;
/// A slide ends after so many pushes of which none left less than this share of the least depth before.
const MOST_STALLED: usize = 6;
const SHALLOWER: f64 = 0.9;
/// So many poses are tested even where a blocker is known, for deeper ones.
const N_DEEPER: usize = 3;
/// A test costs as much as so many cells.
const CELLS_PER_TEST: usize = 10;

impl<'a> Around<'a> {
    /// `slack` is how deep poses may be in the plane of the surface, `within` how far from the site's own they may be,
    /// `rim` the tolerances there.
    pub fn new(
        shape: &'a Shape,
        poses: PoseSet,
        contact: &Contact,
        direction: DVec3,
        [slack, within, rim]: [f64; 3],
    ) -> Self {
        let leaning = contact.normal.map(|normal| normal - direction * normal.dot(direction));
        // Where it hardly leans, its roundings point anywhere.
        let leaning = leaning.filter(|leaning| leaning.length() > LEANING);
        let u = leaning.map_or(basis(direction)[0], DVec3::normalize);
        let axes = [u, direction.cross(u), direction];
        let own = contact.normal.map(|normal| {
            let normal = DVec3::new(normal.dot(u), 0.0, normal.dot(direction));
            let touching = poses.corner + poses.side * normal.x.abs();
            OwnPlane { normal, touching, slack, best: poses.place(normal) }
        });
        // Places on the disc are a little farther apart than poses.
        let within = APART * within;
        Around { shape, poses, point: contact.point, axes, own, within, rim }
    }

    fn local(&self, offset: DVec3) -> DVec3 {
        let [u, v, d] = self.axes;
        DVec3::new(offset.dot(u), offset.dot(v), offset.dot(d))
    }

    /// Keeps what was met.
    fn note(&self, met: Met, local: &mut Local, blockers: &mut Blockers) {
        for blocker in met.blockers() {
            local.push(self.local(blocker.point - self.point), blocker.tolerance);
            blockers.push(blocker);
        }
    }

    /// Where to try next after a pose with something in the way: pushed along the poses away from what is deepest in
    /// the tool. In a hollow as wide as the tool that finds the one place; where it finds none, there may be one. With
    /// it the depth of that, mm.
    fn pushed(&self, at: DVec2, local: &mut Local, isa: Isa) -> Option<(DVec2, f64)> {
        /// Farther than what is deepest, mm.
        const BEYOND_MM: f64 = 1e-5;
        let (depth, away) = local.deepest(self.shape, self.poses.offset(at), isa);
        let next = (depth > 0.0).then(|| self.poses.pushed(at, away, depth + BEYOND_MM))??;
        (self.is_within(next) && self.may_touch(next, 0.0)).then_some((next, depth))
    }

    /// Whether a place on the disc is near enough to that of the site's own pose.
    fn is_within(&self, at: DVec2) -> bool {
        self.own.is_none_or(|own| (at - own.best).abs().max_element() <= self.within)
    }

    fn may_touch(&self, at: DVec2, reach: f64) -> bool {
        self.own.is_none_or(|own| self.poses.touches(at, reach, (own.normal, self.rim)))
    }

    /// Whether some pose of a cell is on the disc, touches the surface and is not too deep in its plane.
    fn is_possible(&self, cell: &Cell) -> bool {
        let nearest = (cell.at.abs() - cell.half).max(DVec2::ZERO).length();
        nearest <= self.poses.radius()
            && self.may_touch(cell.at, cell.half.length())
            && !self.own.is_some_and(|own| own.closes(&self.poses, cell))
    }

    /// All poses, or all that are not too deep in the plane of the surface.
    fn first_cell(&self) -> Option<Cell> {
        let radius = self.poses.radius();
        let around = match self.own {
            Some(own) if self.within.is_finite() => {
                [own.best - self.within, own.best + self.within]
            }
            _ => [DVec2::splat(-radius), DVec2::splat(radius)],
        };
        let [low, high] = around.map(|p| p.clamp(DVec2::splat(-radius), DVec2::splat(radius)));
        let cell =
            Cell { at: 0.5 * (low + high), half: 0.5 * (high - low), depth: f64::NEG_INFINITY };
        self.is_possible(&cell).then_some(cell)
    }

    /// The cell with the blockers from number `first` on taken into account; none if one is in the way of all its
    /// poses.
    fn measured(&self, cell: Cell, local: &Local, first: usize, isa: Isa) -> Option<Cell> {
        let middle = PoseBox { middle: self.poses.offset(cell.at), half: DVec3::ZERO };
        let depth = local.depth(first, self.shape, &middle, isa);
        // What is not in the way in the middle closes nothing.
        let is_closed = depth > 0.0
            && local.depth(first, self.shape, &self.poses.around(cell.at, cell.half), isa) > 0.0;
        (!is_closed).then_some(Cell { depth: cell.depth.max(depth), ..cell })
    }

    /// The reference point of a pose.
    fn reference(&self, at: DVec2) -> DVec3 {
        let [u, v, d] = self.axes;
        let o = self.poses.offset(at);
        self.point + u * o.x + v * o.y + d * o.z
    }
}

impl PoseSearch {
    /// Searches for a free pose; `resolution` is the size of cells that are not cut, mm, `n_tests` how many poses are
    /// tested before it gives up, beside those that are pushed.
    pub fn run(
        &mut self,
        around: &Around,
        blockers: &mut Blockers,
        (resolution, n_tests): (f64, usize),
        tool: impl Tested,
    ) -> Searched {
        let mut run = Run { memory: self, around, blockers, tool };
        run.begin();
        match run.slide() {
            Searched::GivenUp => run.best_first(resolution, n_tests),
            searched => searched,
        }
    }
}

/// A tool in one direction, as a search asks about it.
pub(in crate::access::surface) trait Tested {
    /// What is in its way with the reference point here.
    fn meets(&mut self, reference: DVec3) -> Met;

    /// Whether a triangle collides in every pose whose reference point is within `spread` of here.
    fn collides_within(&mut self, reference: DVec3, spread: f64) -> bool;
}

/// Whether a triangle collides in all poses of a cell.
fn covers(tool: &mut impl Tested, around: &Around, cell: &Cell) -> bool {
    tool.collides_within(around.reference(cell.at), cell.half.length())
}

/// One search.
struct Run<'s, 'a, T> {
    memory: &'s mut PoseSearch,
    around: &'s Around<'a>,
    blockers: &'s mut Blockers,
    tool: T,
}

impl<T: Tested> Run<'_, '_, T> {
    /// The cells that known blockers leave.
    fn begin(&mut self) {
        /// Halvings of the first cell.
        const N_HALVINGS: usize = 3;
        let (around, PoseSearch { cells, local, .. }) = (self.around, &mut *self.memory);
        local.clear();
        for blocker in self.blockers.iter() {
            local.push(around.local(blocker.point - around.point), blocker.tolerance);
        }
        cells.clear();
        cells.extend(around.first_cell());
        for _ in 0..N_HALVINGS {
            for k in 0..cells.len() {
                let [one, other] = cells[k].halves();
                cells[k] = one;
                cells.push(other);
            }
        }
        cells.retain(|cell| around.is_possible(cell));
        self.close(0);
        let tool = &mut self.tool;
        self.memory.cells.retain(|cell| !covers(tool, around, cell));
    }

    /// Drops the cells that a blocker from number `first` on is in the way of.
    fn close(&mut self, first: usize) {
        let PoseSearch { cells, local, isa } = &mut *self.memory;
        cells.retain_mut(|cell| match self.around.measured(*cell, local, first, *isa) {
            Some(left) => {
                *cell = left;
                true
            }
            None => false,
        });
    }

    /// Whether a pose is free; what is in the way closes cells.
    fn is_free(&mut self, reference: DVec3) -> bool {
        let met = self.tool.meets(reference);
        if met.is_free() {
            return true;
        }
        let first = self.memory.local.len();
        self.around.note(met, &mut self.memory.local, self.blockers);
        self.close(first);
        false
    }

    /// From the site's own pose, pushed again and again.
    fn slide(&mut self) -> Searched {
        let mut at = self.around.own.map_or(DVec2::ZERO, |own| own.best);
        let (mut least, mut n_stalled) = (f64::INFINITY, 0);
        for _ in 0..N_PUSHES {
            if self.memory.cells.is_empty() {
                return Searched::Closed;
            }
            let reference = self.around.reference(at);
            if self.is_free(reference) {
                return Searched::Free(reference);
            }
            let PoseSearch { local, isa, .. } = &mut *self.memory;
            let Some((next, depth)) = self.around.pushed(at, local, *isa) else { break };
            // Between two walls it goes to and fro.
            n_stalled += 1;
            if depth < SHALLOWER * least {
                (least, n_stalled) = (depth, 0);
            }
            if n_stalled == MOST_STALLED {
                break;
            }
            at = next;
        }
        if self.memory.cells.is_empty() { Searched::Closed } else { Searched::GivenUp }
    }

    fn best_first(&mut self, resolution: f64, most_tests: usize) -> Searched {
        let around = self.around;
        let (mut n_tests, mut n_cells) = (0, 1);
        let mut outcome = Searched::Closed;
        while let Some(k) = shallowest(&self.memory.cells) {
            let cell = self.memory.cells.swap_remove(k);
            // Covered and not closed: deeper blockers may close it.
            let is_shallow = cell.depth <= 0.0 || n_tests < N_DEEPER;
            if is_shallow && around.may_touch(cell.at, 0.0) {
                if n_tests == most_tests {
                    return Searched::GivenUp;
                }
                n_tests += 1;
                let reference = around.reference(cell.at);
                let first = self.memory.local.len();
                if self.is_free(reference) {
                    return Searched::Free(reference);
                }
                let PoseSearch { local, isa, .. } = &*self.memory;
                if around.measured(cell, local, first, *isa).is_none() {
                    continue;
                }
            }
            if cell.half.length() <= resolution || n_cells > CELLS_PER_TEST * most_tests {
                outcome = Searched::GivenUp;
                continue;
            }
            if covers(&mut self.tool, around, &cell) {
                continue;
            }
            let PoseSearch { cells, local, isa } = &mut *self.memory;
            for half in cell.halves().into_iter().filter(|half| around.is_possible(half)) {
                let half = Cell { depth: f64::NEG_INFINITY, ..half };
                cells.extend(around.measured(half, local, 0, *isa));
                n_cells += 1;
            }
        }
        outcome
    }
}

/// What a search comes to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::access::surface) enum Searched {
    /// The reference point of a free pose.
    Free(DVec3),
    /// Blockers close all poses.
    Closed,
    /// Neither was found within the limits.
    GivenUp,
}

impl Searched {
    /// The reference point of a free pose.
    pub fn free(self) -> Option<DVec3> {
        match self {
            Searched::Free(reference) => Some(reference),
            Searched::Closed | Searched::GivenUp => None,
        }
    }
}

/// The cell with the least depth; the first among equals.
fn shallowest(cells: &[Cell]) -> Option<usize> {
    let better = |a: usize, b: usize| if cells[b].depth < cells[a].depth { b } else { a };
    (0..cells.len()).reduce(better)
}
