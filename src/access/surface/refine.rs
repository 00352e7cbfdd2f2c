//! Between the directions: openings that a coarse set misses, and proofs that there is none.
//!
//! ```text
//! cells = the octants of the set, cut in four twice
//! for every new cell: ask the tool in its middle
//!     it is free                                   → the site is accessible, done
//!     a point proves the whole cell closed         → forget the cell
//!     otherwise                                    → keep it, with the share of its radius that is closed
//! cut the cell of which the least share is closed in four, and so on, until none is left or enough were asked
//! ```
//!
//! *What a point proves.* A point `p` of the surface lies in a step of the tool with margin
//! `m = min(h − height, radius − r)`. Turning the tool about its reference point `c` by an angle α changes `h` and `r` by
//! no more than `α·|p − c|`, so the point stays in the tool in every direction within `m/|p − c|`. The reference point
//! of a bull nose or flat end moves too, by no more than `α·side/|n⊥|` with the least length of the normal's part across the
//! direction on the way, and never by more than twice the side.
//!
//! *Where openings are.* Directions that were found for the sites before are tried first: openings are shared by neighbors. Beside
//! a wall they end at the directions along it, where the tool's flank touches: such directions are tried for every cell
//! that holds some.

use super::bvh::Bvh;
use super::cells::{Cell, Domain};
use super::closing::Closing;
use super::query::{Probe, Scratch};
use super::tool::{Contact, Outline, Stand, axes};
use super::verdict::Verdict;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// How often the octants are cut before anything is asked: 64 cells on the upper half.
const FIRST_LEVELS: usize = 2;
/// Points that are tried on a new cell before the triangles are asked.
const N_BLOCKERS: usize = 12;

/// What is the same for all sites.
pub(super) struct Refinement {
    domain: Domain,
    first: Vec<Cell>,
    /// Most tools asked for one site.
    n_tests: usize,
    /// Cells with a smaller radius are not cut any more.
    resolution: f64,
}

/// What was found between the directions.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Found {
    /// Where the tool may stand.
    pub witness: Option<DVec3>,
    /// Whether some direction is free of collisions of the steps.
    pub collision_free: bool,
    /// Share of the directions that was not proven closed.
    pub open: f64,
}

impl Found {
    fn accessible(direction: DVec3) -> Self {
        Found { witness: Some(direction), collision_free: true, open: 0.0 }
    }
}

/// Directions that reach sites nearby, the latest last.
#[derive(Default)]
pub(super) struct Hints(Vec<DVec3>);

/// Most hints.
const N_HINTS: usize = 6;

/// One site.
pub(super) struct Place<'a> {
    pub contact: &'a Contact,
    pub outline: &'a Outline,
    pub probe: &'a Probe,
    pub bvh: &'a Bvh,
}

/// What becomes of a cell.
enum Outcome {
    Accessible(DVec3),
    Closed,
    /// With the share of its radius that is closed.
    Open(f64),
}

impl Refinement {
    pub fn new(domain: Domain, n_tests: usize, resolution: f64) -> Self {
        Refinement { domain, first: domain.cells(FIRST_LEVELS), n_tests, resolution }
    }

    /// Searches the cells of one site; `collision_free` if that is known of some direction.
    pub fn search(
        &self,
        place: &Place,
        collision_free: bool,
        hints: &mut Hints,
        scratch: &mut Scratch,
    ) -> Found {
        let found = Found { collision_free, ..Found::default() };
        let mut search = Search { place, scratch, blockers: Vec::new(), found };
        let witness = hints.0.iter().rposition(|&hint| search.stands(hint));
        if let Some(k) = witness {
            let last = hints.0.len() - 1;
            hints.0.swap(k, last);
            return Found::accessible(hints.0[last]);
        }
        let found = self.search_cells(search);
        if let Some(witness) = found.witness {
            if hints.0.len() == N_HINTS {
                hints.0.remove(0);
            }
            hints.0.push(witness);
        }
        found
    }

    fn search_cells(&self, mut search: Search) -> Found {
        let mut queue = Queue::default();
        let mut unresolved = 0.0;
        let mut new: Vec<Cell> = self.first.clone();
        let mut n_tests = 0;
        loop {
            for cell in new.drain(..).filter(|cell| !self.domain.misses(cell)) {
                n_tests += 1;
                match search.ask(&cell, self.domain.holds(cell.middle())) {
                    Outcome::Accessible(direction) => {
                        return Found::accessible(direction);
                    }
                    Outcome::Closed => {}
                    Outcome::Open(_) if cell.radius() < self.resolution => {
                        unresolved += cell.solid_angle();
                    }
                    Outcome::Open(share) => {
                        if let Some(direction) = search.along_surface(&cell, &self.domain) {
                            return Found::accessible(direction);
                        }
                        queue.push(cell, share);
                    }
                }
            }
            match queue.pop() {
                Some(cell) if n_tests < self.n_tests => new.extend(cell.quarters()),
                Some(cell) => {
                    unresolved += cell.solid_angle();
                    break;
                }
                None => break,
            }
        }
        while let Some(cell) = queue.pop() {
            unresolved += cell.solid_angle();
        }
        let all: f64 = self.first.iter().map(Cell::solid_angle).sum();
        Found { open: unresolved / all, ..search.found }
    }
}

/// Open cells. Every second one taken is the least closed, the others come in their order: the former finds the way into an
/// opening, the latter does not get lost in one place.
#[derive(Default)]
struct Queue {
    cells: Vec<Option<Cell>>,
    least_closed: BinaryHeap<Reverse<(u64, usize)>>,
    oldest: usize,
    n_taken: usize,
}

impl Queue {
    fn push(&mut self, cell: Cell, share: f64) {
        self.least_closed.push(Reverse(((share * 1e9) as u64, self.cells.len())));
        self.cells.push(Some(cell));
    }

    fn pop(&mut self) -> Option<Cell> {
        self.n_taken += 1;
        if self.n_taken.is_multiple_of(PERIOD) {
            while self.oldest < self.cells.len() {
                self.oldest += 1;
                if let Some(cell) = self.cells[self.oldest - 1].take() {
                    return Some(cell);
                }
            }
            return None;
        }
        while let Some(Reverse((_, k))) = self.least_closed.pop() {
            if let Some(cell) = self.cells[k].take() {
                return Some(cell);
            }
        }
        None
    }
}

/// Of so many cells one comes in its order.
const PERIOD: usize = 2;

struct Search<'a, 's> {
    place: &'a Place<'a>,
    scratch: &'s mut Scratch,
    /// Points of the surface that were in the tool, the latest last.
    blockers: Vec<DVec3>,
    found: Found,
}

impl Search<'_, '_> {
    /// Asks about a cell; in its middle only if that `counts`.
    fn ask(&mut self, cell: &Cell, counts: bool) -> Outcome {
        let (direction, radius) = (cell.middle(), cell.radius());
        let Place { contact, outline, probe, bvh } = *self.place;
        let stand = self.stand(direction);
        let drift = contact.drift(outline, direction, radius);
        let closing = Closing { probe, drift, tip: self.found.collision_free };
        let mut closed: f64 = 0.0;
        for (k, point) in self.blockers.iter().enumerate().rev() {
            closed = closed.max(closing.angle(stand.local(*point)));
            if closed > radius {
                let last = self.blockers.len() - 1;
                self.blockers.swap(k, last);
                return Outcome::Closed;
            }
        }
        let mut best = (DVec3::ZERO, 0.0);
        let mut n_hits = 0;
        let verdict = probe.verdict_with(bvh, &stand, self.scratch, |corners| {
            let found = closing.best_point(corners, &stand);
            if found.1 > best.1 {
                best = found;
            }
            n_hits += 1;
            best.1 > radius || n_hits >= MOST_HITS
        });
        match verdict {
            Verdict::Free if counts => return Outcome::Accessible(direction),
            Verdict::TipGouges => self.found.collision_free |= counts,
            _ => {}
        }
        if best.1 > 0.0 && (verdict == Verdict::Collides || closing.tip) {
            closed = closed.max(best.1);
            if self.blockers.len() == N_BLOCKERS {
                self.blockers.remove(0);
            }
            self.blockers.push(best.0);
        }
        if closed > radius { Outcome::Closed } else { Outcome::Open(closed / radius) }
    }

    fn stand(&self, direction: DVec3) -> Stand {
        // As the witness will be stated.
        let axes = axes(direction.as_vec3());
        let reference = self.place.contact.reference_point(self.place.outline, axes[2]);
        Stand { reference, axes }
    }

    /// The direction along the surface that is nearest to the middle of a cell, if it is about as near as the cell's rim and
    /// the tool may stand so: flank milling. Openings beside a tangent direction can be thinner than any cell.
    fn along_surface(&mut self, cell: &Cell, domain: &Domain) -> Option<DVec3> {
        let (normal, middle) = (self.place.contact.normal()?, cell.middle());
        let beside = normal.dot(middle);
        if beside.abs() > libm::sin(cell.radius().min(1.0)) {
            return None;
        }
        let direction = (middle - normal * beside).try_normalize()?;
        (domain.holds(direction) && self.stands(direction)).then_some(direction)
    }

    /// Whether the tool may stand in a direction.
    fn stands(&mut self, direction: DVec3) -> bool {
        let stand = self.stand(direction);
        let verdict = self.place.probe.verdict(self.place.bvh, &stand, self.scratch);
        self.found.collision_free |= verdict != Verdict::Collides;
        verdict == Verdict::Free
    }
}

/// Triangles in the way that are looked at in one direction.
const MOST_HITS: usize = 6;

impl Contact {
    /// How fast the reference point moves when the tool turns by up to `radius`, mm per radian.
    fn drift(&self, outline: &Outline, direction: DVec3, radius: f64) -> f64 {
        let Some(normal) = self.normal() else {
            // In space the tip is held, not the reference point.
            return outline.corner();
        };
        if outline.side() == 0.0 {
            return 0.0;
        }
        // It stays within the side's length of one place.
        let at_most = 2.0 * outline.side() / radius;
        let least = normal.cross(direction).length() - radius;
        if least > 0.0 { at_most.min(outline.side() / least) } else { at_most }
    }
}
