//! Between the directions: openings that a coarse set misses, and proofs that there is none.
//!
//! ```text
//! for a flat or bull-nose end: all poses along the normal
//! cells = the octants of the set, cut in four twice
//! for every level:
//!     for every cell, from the caps of all blockers: how deep is its middle in a cap? is all of it in one?
//!     in every middle that no cap covers: test the triangles
//!         nothing is in the way → the site is accessible, done
//!         a triangle is         → of its points the one deepest in the tool becomes a blocker
//!     the same along the surface, for cells that hold such directions
//!     forget closed cells; cut the `n_kept` cells with the shallowest middles in four
//! ```
//!
//! *What a blocker closes* is in [`caps`](super::caps): a point of the surface closes a cap of directions, and how deep
//! a direction is in a cap bounds from below how far the nearest opening is. Sixteen directions are compared with a cap
//! at once, in a few nanoseconds; the triangles, which take a microsecond, are tested where no cap answers. Nothing
//! goes from site to site: the answer is a function of the site alone.
//!
//! *Where openings are.* Beside a wall they end at the directions along it, where the tool's flank touches, and can be
//! thinner than any cell. A flat end lies on a face in one direction alone, the normal, which is tried with all its
//! poses.
//!
//! *To prove*, the triangles are also tested in middles that a cap covers without closing the cell: for points that
//! close more.

use super::caps::{Blockers, Caps, Middles, Silhouette};
use super::cells::Hierarchy;
use super::labels::RefinementOptions;
use super::problem::Problem;
use super::query::Probe;
use super::site::{Ball, SiteState};
use super::tool::{Contact, OBLIQUE, Outline, Stand, axes};
use super::verdict::Verdict;
use crate::access::evidence::WitnessPose;
use crate::simd::Isa;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// What is the same for all sites.
pub(super) struct Refinement {
    hierarchy: Arc<Hierarchy>,
    options: RefinementOptions,
    isa: Isa,
}

/// What was found between the directions.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Found {
    /// A free pose.
    pub witness: Option<WitnessPose>,
    /// Whether in some direction the steps collide with nothing.
    pub collision_free: bool,
    /// Share of the directions that was not proven closed.
    pub open: f64,
}

/// Work space.
#[derive(Default)]
pub(super) struct SearchState {
    blockers: Blockers,
    caps: Caps,
    middles: Middles,
    tangents: Middles,
    /// Cells of the level, and the open ones with the depth of their middles.
    cells: Vec<u32>,
    open: Vec<(f32, u32)>,
}

/// Triangles in the way that are looked at in one direction for a proof.
const MOST_HITS: usize = 6;
/// Depth of a middle that was tested and that no blocker covers.
const TESTED: f32 = 1e-4;

/// One site.
pub(super) struct Place<'a> {
    pub problem: &'a Problem<'a>,
    pub i: usize,
    /// The steps; and the steps and what of the tip is above its middle.
    pub silhouettes: &'a [Silhouette; 2],
}

impl Place<'_> {
    fn contact(&self) -> &Contact {
        &self.problem.contacts[self.i]
    }

    fn outline(&self) -> &Outline {
        &self.problem.outline
    }
}

impl Refinement {
    pub fn new(hierarchy: Arc<Hierarchy>, options: RefinementOptions) -> Self {
        Refinement { hierarchy, options, isa: Isa::active() }
    }

    /// Searches for one site; `collision_free` if that is known of some direction.
    pub fn search(
        &self,
        place: &Place,
        collision_free: bool,
        state: &mut SearchState,
        site: &mut SiteState,
    ) -> Found {
        let found = Found { collision_free, ..Found::default() };
        let Problem { outline, probes, bvh, .. } = place.problem;
        // A ball is the same from all directions.
        place.problem.place_ball(place.i, site);
        let gouges = site.ball == Ball::Gouges;
        if gouges && collision_free {
            return found;
        }
        let contact = place.contact();
        let own = contact.normal.map_or(contact.point, |n| contact.point + n * outline.corner());
        let probe = match site.ball {
            Ball::Fits(_) => &probes.above_ball,
            Ball::Gouges | Ball::Unknown | Ball::Undecided => &probes.whole,
        };
        state.blockers = Blockers::default();
        let mut search = Search {
            place,
            probe,
            refinement: self,
            site,
            state: std::mem::take(state),
            found,
            reference: (own - bvh.origin()).as_vec3(),
            gouges,
        };
        search.place_caps();
        let done = search.try_normal() || search.search_cells();
        let (found, searched) = (search.found, search.state);
        *state = searched;
        if done { Found { open: 0.0, ..found } } else { found }
    }
}

struct Search<'a, 's> {
    place: &'a Place<'a>,
    probe: &'a Probe,
    refinement: &'a Refinement,
    site: &'s mut SiteState,
    state: SearchState,
    found: Found,
    /// Middle of the caps, relative to the origin of the tree.
    reference: Vec3,
    /// Whether the tip gouges in every direction: then only the steps are of interest.
    gouges: bool,
}

/// Outcome of a test in one direction.
enum TestOutcome {
    /// The search is over.
    Done,
    /// That from now on the tip counts too.
    TipCounts,
    /// The place of a new blocker.
    Blocked(usize),
    /// Nothing new.
    Nothing,
}

impl Search<'_, '_> {
    fn silhouette(&self) -> &Silhouette {
        &self.place.silhouettes[usize::from(self.found.collision_free)]
    }

    fn place_caps(&mut self) {
        let silhouette = &self.place.silhouettes[usize::from(self.found.collision_free)];
        let SearchState { caps, blockers, .. } = &mut self.state;
        caps.place(blockers, silhouette, self.reference);
    }

    /// The reference point in a direction: where the ball is known to fit, or where the tip touches with the site's
    /// normal.
    fn reference_point(&self, direction: DVec3) -> DVec3 {
        match self.site.ball {
            Ball::Fits(center) => center,
            _ => self.place.contact().reference_point(self.place.outline(), direction),
        }
    }

    /// Tests the triangles; a new blocker must be deeper in the tool than `depth`.
    fn test(&mut self, direction: Vec3, depth: f32) -> TestOutcome {
        let axes = axes(direction);
        let stand = Stand { reference: self.reference_point(axes[2]), axes };
        let triangles = self.place.problem.triangles();
        let bvh = triangles.0;
        let mut met = [None; MOST_HITS];
        let n_wanted = if self.refinement.options.prove { MOST_HITS } else { 1 };
        let mut n = 0;
        let scratch = &mut self.site.scratch;
        let verdict = self.probe.verdict_with(triangles, &stand, scratch, |place| {
            met[n % MOST_HITS] = Some(*bvh.triangle(place));
            n += 1;
            n >= n_wanted
        });
        let newly_free = verdict != Verdict::Collides && !self.found.collision_free;
        self.found.collision_free |= newly_free;
        if verdict == Verdict::Free {
            let outline = self.place.outline();
            self.found.witness = Some(WitnessPose::new(outline, stand.reference, direction));
        }
        if verdict == Verdict::Free || (newly_free && self.gouges) {
            return TestOutcome::Done;
        }
        if newly_free {
            self.place_caps();
            return TestOutcome::TipCounts;
        }
        let mut best = (Vec3::ZERO, depth.max(0.0));
        let (silhouette, reference) = (self.silhouette(), self.reference);
        for corners in met.iter().flatten() {
            self.probe.candidates(corners, &stand, |p| {
                let p = (p - bvh.origin()).as_vec3();
                let depth = silhouette.depth(p - reference, direction);
                if depth > best.1 {
                    best = (p, depth);
                }
            });
        }
        if best.1 <= depth.max(0.0) {
            return TestOutcome::Nothing;
        }
        let silhouette = &self.place.silhouettes[usize::from(self.found.collision_free)];
        let SearchState { caps, blockers, .. } = &mut self.state;
        let place = blockers.push(best.0);
        caps.place_one(place, blockers, silhouette, reference);
        TestOutcome::Blocked(place)
    }

    /// Tests the middles that no cap covers; to prove, also in those whose cells no cap closes. Whether the search is
    /// over.
    fn test_all(&mut self, middles: &mut Middles, radius: f64) -> bool {
        let Refinement { hierarchy, options, isa } = self.refinement;
        self.state.caps.reach(None, radius, middles, *isa);
        for k in 0..middles.len() {
            let covered = middles.depth(k) > 0.0;
            let wanted = !covered || (options.prove && radius > 0.0 && !middles.is_closed(k));
            let direction = middles.get(k);
            if !wanted || !hierarchy.holds(direction) {
                continue;
            }
            if covered && self.is_closed_for_a_ring(direction, radius) {
                middles.close(k);
                continue;
            }
            match self.test(direction, middles.depth(k)) {
                TestOutcome::Done => return true,
                TestOutcome::TipCounts => self.state.caps.reach(None, radius, middles, *isa),
                TestOutcome::Blocked(place) => {
                    self.state.caps.reach(Some(place), radius, middles, *isa);
                    if options.prove && self.is_closed_for_a_ring(direction, radius) {
                        middles.close(k);
                    }
                }
                TestOutcome::Nothing => {}
            }
            middles.is_at_least(k, TESTED);
        }
        false
    }

    /// Whether a blocker closes the cell of a tool whose reference point moves: more than the caps, which hold for
    /// wherever it moves, for proofs alone.
    fn is_closed_for_a_ring(&self, direction: Vec3, radius: f64) -> bool {
        let Place { problem, i, .. } = self.place;
        let (contact, outline) = (self.place.contact(), self.place.outline());
        let axis = axes(direction)[2];
        let Some(drift) = contact.drift(outline, axis, radius) else { return false };
        let within = problem.bounds[*i].oblique;
        // Directions of the cell must be oblique, too.
        let is_oblique = contact.normal.is_some_and(|n| n.cross(axis).length() - radius >= OBLIQUE);
        if !is_oblique || radius <= 0.0 {
            return false;
        }
        let reference = contact.reference_point(outline, axis) - problem.bvh.origin();
        let silhouette = self.silhouette();
        let stays =
            |point: Vec3| silhouette.stays(point.as_dvec3() - reference, axis, [drift, within]);
        self.state.blockers.points().any(|point| stays(point) > radius)
    }

    /// A flat or bull-nose end that lies on the face of the site: whether the search is over.
    fn try_normal(&mut self) -> bool {
        let Place { problem, i, .. } = self.place;
        let Some(normal) = self.place.contact().normal else { return false };
        let direction = normal.as_vec3();
        if self.place.outline().side() == 0.0 || !self.refinement.hierarchy.holds(direction) {
            return false;
        }
        let (verdict, pose) = problem.verdict(*i, &axes(direction), false, self.site);
        self.found.collision_free |= verdict != Verdict::Collides;
        self.found.witness = pose.map(|at| WitnessPose::new(self.place.outline(), at, direction));
        self.place_caps();
        pose.is_some()
    }

    /// Whether the search is over; otherwise notes how much of the directions stays open.
    fn search_cells(&mut self) -> bool {
        let mut middles = std::mem::take(&mut self.state.middles);
        let mut cells = std::mem::take(&mut self.state.cells);
        let Refinement { hierarchy, options, .. } = self.refinement;
        cells.clear();
        cells.extend(0..hierarchy.n_first() as u32);
        let mut done = false;
        for level in 0..options.n_levels {
            let radius = hierarchy.radius(level);
            middles.fill(cells.iter().map(|&cell| hierarchy.middle(level, cell)));
            done = self.test_all(&mut middles, radius) || self.test_along_surface(&middles, radius);
            if done {
                break;
            }
            let open = &mut self.state.open;
            open.clear();
            open.extend((0..middles.len()).filter_map(|k| {
                let counts = !middles.is_closed(k) && !hierarchy.misses(level, middles.get(k));
                counts.then_some((middles.depth(k), cells[k]))
            }));
            let n_kept = if level + 1 == options.n_levels { 0 } else { options.n_kept };
            if open.len() > n_kept {
                self.found.open += (open.len() - n_kept) as f64 * hierarchy.share(level);
                if n_kept > 0 {
                    let shallow =
                        |a: &(f32, u32), b: &(f32, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
                    open.select_nth_unstable_by(n_kept, shallow);
                }
                open.truncate(n_kept);
                open.sort_unstable_by_key(|open| open.1);
            }
            cells.clear();
            cells.extend(open.iter().flat_map(|(_, cell)| 4 * cell..4 * cell + 4));
        }
        (self.state.middles, self.state.cells) = (middles, cells);
        done
    }

    /// For every open cell that holds directions along the surface, the one nearest to its middle: flank milling.
    fn test_along_surface(&mut self, middles: &Middles, radius: f64) -> bool {
        let Some(normal) = self.place.contact().normal else { return false };
        let normal = normal.as_vec3();
        let greatest = libm::sin(radius.min(1.0)) as f32;
        let mut tangents = std::mem::take(&mut self.state.tangents);
        tangents.fill((0..middles.len()).filter(|&k| !middles.is_closed(k)).filter_map(|k| {
            let middle = middles.get(k);
            let beside = normal.dot(middle);
            let along = (middle - normal * beside).try_normalize()?;
            (beside.abs() <= greatest).then_some(along)
        }));
        let done = self.test_all(&mut tangents, 0.0);
        self.state.tangents = tangents;
        done
    }
}

impl Contact {
    /// How fast the reference point moves when the tool turns by up to `radius`, mm per radian; `None` if it stays.
    fn drift(&self, outline: &Outline, direction: DVec3, radius: f64) -> Option<f64> {
        let normal = self.normal.filter(|_| outline.side() > 0.0)?;
        // It stays within the side's length of one place.
        let at_most = 2.0 * outline.side() / radius;
        let least = normal.cross(direction).length() - radius;
        Some(if least > 0.0 { at_most.min(outline.side() / least) } else { at_most })
    }
}
