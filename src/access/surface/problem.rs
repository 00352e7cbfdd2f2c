//! One cutter at many queries: points first, triangles last, then the directions between.

use super::bvh::Bvh;
use super::caps::Silhouette;
use super::cells::{Domain, Hierarchy};
use super::labels::{SurfaceLabels, SurfaceOptions, SurfaceStats, Tally, WitnessPose};
use super::pose::{Limits, PoseSet, Shape};
use super::query::Probe;
use super::refine::{Place, Refinement, SearchState};
use super::samples;
use super::site::SiteState;
use super::surroundings::{PoseBounds, Rings};
use super::tolerance::Tolerances;
use super::tool::{Axes, Contact, Outline, axes};
use super::verdict::Verdict;
use crate::access::{self, CollisionMatrix, LabelOptions, Obstacles, Queries};
use crate::cutter::{Cutter, Step};
use crate::directions::Directions;
use crate::geom::Sites;
use crate::{Result, par};
use glam::{DVec3, Vec3};

/// What separates a collision that a point proves from one that is left to the triangles, as a share of all lengths:
/// several times what `f32` can round.
pub(super) const MARGIN: f64 = 2e-6;

/// One cutter at all queries.
pub(super) struct Problem<'a> {
    /// Search tree over all triangles.
    pub bvh: &'a Bvh,
    /// Corners of the part's own triangles, mm.
    pub part: &'a [[DVec3; 3]],
    pub contacts: Vec<Contact>,
    pub tolerances: Tolerances,
    pub outline: Outline,
    pub poses: PoseSet,
    pub rings: Rings,
    /// Per query.
    pub bounds: Vec<PoseBounds>,
    /// All poses in oblique directions that points may decide are within this of the query's own, mm.
    pub trusted: f64,
    pub probes: Probes,
    /// The whole tool, and its ball, as blockers see them.
    pub shapes: [Shape; 2],
    /// Greatest distance of a reference point from the middle of the triangles, mm.
    pub reach: f64,
}

/// The tool in all forms that are tested.
pub(super) struct Probes {
    pub whole: Probe,
    /// Where the ball is known to fit: see [`Probe::above_ball`].
    pub above_ball: Probe,
    pub ball: Probe,
    /// Where the ball is known to gouge.
    pub steps: Probe,
}

impl Probes {
    fn new(outline: &Outline, least: f64, bvh: &Bvh, reach: f64) -> Self {
        Probes {
            whole: Probe::new(outline, least, bvh, reach),
            above_ball: Probe::above_ball(outline, least, bvh, reach),
            ball: Probe::of_ball(outline, least, bvh, reach),
            steps: Probe::of_steps(outline, [least, 0.0], bvh, reach),
        }
    }
}

/// A block of queries shares a word of the answers by points.
pub(super) const WORD: usize = 64;
/// Queries of a task of the search between the directions.
const SEARCHED: usize = 32;
/// Queries per task of their surroundings.
const SURROUNDED: usize = 256;
/// Samples are taken of facets whose tolerance is at most this many times the least, or this share of the tool's radius.
const USUAL: f64 = 2.0;
const USUAL_SHARE: f64 = 0.02;

impl<'a> Problem<'a> {
    pub fn new(
        bvh: &'a Bvh,
        part: &'a [[DVec3; 3]],
        contacts: Vec<Contact>,
        tolerances: Tolerances,
        outline: Outline,
    ) -> Self {
        let far = contacts.iter().map(|contact| contact.point.distance(bvh.origin()));
        let reach = far.fold(bvh.radius(), f64::max) + outline.radius() + outline.finish();
        let rings = Rings::new(&outline, tolerances.least);
        let of = |contact: &Contact| match contact.normal {
            Some(normal) => rings.at(bvh, &tolerances, contact.point, normal),
            None => rings.everywhere(),
        };
        let bounds = par::map_blocks(contacts.len(), SURROUNDED, |range| {
            contacts[range].iter().map(of).collect::<Vec<_>>()
        });
        let in_space = contacts.first().is_some_and(|contact| contact.normal.is_none());
        let trusted = match in_space {
            true => rings.everywhere().from_center,
            false => rings.on_plane(tolerances.least),
        };
        let probes = Probes::new(&outline, tolerances.least, bvh, reach);
        let bounds = bounds.into_iter().flatten().collect();
        let poses = PoseSet::new(&outline);
        let margin = MARGIN * (bvh.radius() + reach + outline.size());
        let shapes = [false, true].map(|is_ball| Shape::new(&outline, is_ball, margin));
        Problem {
            bvh,
            part,
            contacts,
            tolerances,
            outline,
            poses,
            rings,
            bounds,
            trusted,
            probes,
            shapes,
            reach,
        }
    }

    /// The search tree with the tolerance of each of its triangles.
    pub fn triangles(&self) -> (&Bvh, &Tolerances) {
        (self.bvh, &self.tolerances)
    }

    /// More than the roundings of `f32`, mm.
    pub fn margin(&self) -> f64 {
        MARGIN * (self.bvh.radius() + self.reach + self.outline.size())
    }

    /// Where points of the surface prove that all poses collide which are within [`Problem::trusted`] of the query's own. The tool is shrunk by that,
    /// by the tolerance and by more than all roundings, and all is about the middle of the triangles, where `f32` is finest.
    pub fn by_points(
        &self,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<CollisionMatrix> {
        let origin = self.bvh.origin();
        let least = self.tolerances.least;
        let usual = (USUAL * least).max(USUAL_SHARE * self.outline.radius());
        let tolerance = self.tolerances.most.min(usual);
        let shrink = tolerance + self.trusted + self.margin();
        let Some(shrunk) = shrunk(cutter, shrink)? else {
            let rows = vec![vec![0; self.contacts.len().div_ceil(WORD)]; directions.len()];
            return Ok(CollisionMatrix::new(self.contacts.len(), rows));
        };
        // A table would take nearly all points for itself.
        let samples = match self.tolerances.most > usual {
            false => samples::points(self.part, options.n_samples, origin),
            true => {
                let n = self.bvh.n_triangles() as u32;
                let usual = (0..n).filter(|&place| {
                    let is_of_part = (self.bvh.face(place) as usize) < self.part.len();
                    is_of_part && self.tolerances.at(place) <= tolerance
                });
                let usual: Vec<_> = usual.map(|place| *self.bvh.triangle(place)).collect();
                samples::points(&usual, options.n_samples, origin)
            }
        };
        let samples: Vec<Vec3> = samples.into_iter().map(|p| p.as_vec3()).collect();
        let mut sites = Sites::default();
        for contact in &self.contacts {
            sites.points.push((contact.point - origin).as_vec3());
            sites.normals.extend(contact.normal.map(|normal| normal.as_vec3()));
        }
        let volume = sites.normals.is_empty();
        let queries = if volume { Queries::Volume(&sites.points) } else { Queries::Sites(&sites) };
        let obstacles = Obstacles::Points(&samples);
        let options =
            LabelOptions { occlusion: false, collision_matrix: true, ..LabelOptions::default() };
        let labels = access::label(queries, obstacles, &shrunk, directions, &options)?;
        Ok(labels.collision_matrix.expect("the option is set"))
    }

    /// Whether a collision that points prove holds for all poses of a query along a direction.
    pub fn is_trusted(&self, i: usize, direction: DVec3) -> bool {
        let contact = &self.contacts[i];
        contact.normal.is_none()
            || (self.bounds[i].oblique <= self.trusted
                && contact.is_oblique(&self.outline, direction))
    }

    /// Tests the triangles for the pairs that points leave open, then between the directions.
    pub fn by_triangles(
        &self,
        matrix: &CollisionMatrix,
        directions: &Directions,
        domain: Option<Domain>,
        options: &SurfaceOptions,
    ) -> Vec<(Tally, SurfaceStats)> {
        let axes: Vec<_> = directions.vectors().iter().map(|&d| axes(d)).collect();
        let n = self.contacts.len();
        let tallies = par::map_blocks(n, WORD, |range| {
            let mut state = SiteState::default();
            let word = range.start / WORD;
            let column: Vec<u64> = (0..axes.len()).map(|k| matrix.words(k)[word]).collect();
            let tally = |i| self.tally(i, (directions, &axes), &column, options, &mut state);
            range.map(tally).collect::<Vec<_>>()
        });
        let mut tallies: Vec<_> = tallies.into_iter().flatten().collect();
        if let Some((options, domain)) = options.refinement.zip(domain) {
            let hierarchy = Hierarchy::of(domain, options.n_levels);
            self.refine(&Refinement::new(hierarchy, options), &mut tallies);
        }
        tallies
    }

    /// Searches between the directions for queries that none of them reaches.
    fn refine(&self, refinement: &Refinement, tallies: &mut [(Tally, SurfaceStats)]) {
        let rest: Vec<usize> =
            (0..tallies.len()).filter(|&i| tallies[i].0.witness.is_none()).collect();
        let given: &[(Tally, SurfaceStats)] = tallies;
        let silhouettes = self.silhouettes();
        let found = par::map_blocks(rest.len(), SEARCHED, |range| {
            let (mut site, mut state) = (SiteState::default(), SearchState::default());
            let search = |k: usize| {
                let i = rest[k];
                let (mut tally, mut stats) = given[i];
                let narrow = silhouettes.iter().find(|s| self.bounds[i].from_center <= s.within);
                let silhouettes = &narrow.unwrap_or(&silhouettes[silhouettes.len() - 1]).of;
                let place = Place { problem: self, i, silhouettes };
                site.begin();
                let known = tally.collision_free > 0;
                let found = refinement.search(&place, known, &mut state, &mut site);
                tally.witness = found.witness;
                tally.free_between = found.collision_free;
                tally.open = found.open as f32;
                stats.found_between = u64::from(found.witness.is_some());
                stats.tools_tested += site.scratch.n_queries;
                stats.triangles_tested += site.scratch.n_triangles;
                if found.witness.is_some() {
                    stats.knife_edge = u64::from(site.scratch.knife_edge);
                }
                (tally, stats)
            };
            range.map(search).collect::<Vec<_>>()
        });
        for (&i, found) in rest.iter().zip(found.into_iter().flatten()) {
            tallies[i] = found;
        }
    }

    /// The tool as the caps see it, for poses within some distances of the middle of the caps; all poses are within the last.
    fn silhouettes(&self) -> Vec<Silhouettes> {
        let outline = &self.outline;
        let least = self.tolerances.most;
        let everywhere = self.rings.everywhere().from_center;
        let in_space = self.contacts.first().is_some_and(|contact| contact.normal.is_none());
        // The middle of the caps of a query in space is the tip, and stays on the axis.
        let (lift, bounds) = match in_space {
            true => (outline.corner(), vec![everywhere]),
            false => {
                let usual = outline.side() + self.trusted;
                (0.0, vec![usual, usual + self.trusted, usual.max(everywhere)])
            }
        };
        let lifted = |[height, radius]: [f64; 2]| [height + lift, radius];
        let steps = || outline.steps(least).map(lifted);
        let all = || std::iter::once(lifted(outline.tip(least).shaft())).chain(steps());
        let of = |within: f64| Silhouettes {
            within,
            of: [
                Silhouette::new(steps(), within, self.margin()),
                Silhouette::new(all(), within, self.margin()),
            ],
        };
        bounds.into_iter().map(of).collect()
    }

    fn tally(
        &self,
        i: usize,
        (directions, axes): (&Directions, &[Axes]),
        column: &[u64],
        options: &SurfaceOptions,
        state: &mut SiteState,
    ) -> (Tally, SurfaceStats) {
        let mut tally = Tally { open: 1.0, ..Tally::default() };
        let mut stats = SurfaceStats { pairs: axes.len() as u64, ..SurfaceStats::default() };
        let pose = |k: usize, at| WitnessPose::new(&self.outline, at, directions.vectors()[k]);
        let mut on_edge = false;
        state.begin();
        state.left.clear();
        for (k, (axes, word)) in axes.iter().zip(column).enumerate() {
            let is_blocked = word >> (i % WORD) & 1 == 1;
            if is_blocked && self.is_trusted(i, axes[2]) {
                stats.by_points += 1;
                continue;
            }
            let (verdict, at) = self.own_pose(i, axes, is_blocked, state);
            let knife_edge = state.scratch.knife_edge;
            on_edge |= knife_edge;
            tally.add(at.map(|at| pose(k, at)), verdict);
            if at.is_none() {
                state.left.push(k as u32);
            } else if tally.accessible == 1 {
                stats.knife_edge = u64::from(knife_edge);
                if !options.counts {
                    break;
                }
            }
        }
        if tally.accessible == 0 {
            if let Some((k, at)) = self.search_directions(i, axes, state) {
                tally.found(pose(k, at));
            }
            stats.knife_edge = u64::from(on_edge);
        }
        stats.tools_tested = state.scratch.n_queries;
        stats.triangles_tested = state.scratch.n_triangles;
        (tally, stats)
    }

    /// A free pose in one of the directions that are left, by search: the first of them that is found.
    fn search_directions(
        &self,
        i: usize,
        axes: &[Axes],
        state: &mut SiteState,
    ) -> Option<(usize, DVec3)> {
        /// Tests of all directions together that are more than the least of each.
        const TESTS: usize = 400;
        const LEAST_TESTS: usize = 6;
        let mut remaining = TESTS;
        for n in 0..state.left.len() {
            let k = state.left[n] as usize;
            let before = state.scratch.n_queries;
            let limits = Limits::tests((remaining / 3).max(LEAST_TESTS));
            if let Some(at) = self.search_poses(i, &axes[k], &limits, state) {
                return Some((k, at));
            }
            remaining = remaining.saturating_sub((state.scratch.n_queries - before) as usize);
        }
        None
    }

    /// Gives `then` every direction that points leave open, in order: its number, and the verdict over all poses.
    pub fn verdicts(
        &self,
        i: usize,
        axes: &[Axes],
        column: &[u64],
        state: &mut SiteState,
        mut then: impl FnMut(usize, Verdict),
    ) {
        state.begin();
        for (k, (axes, word)) in axes.iter().zip(column).enumerate() {
            let is_blocked = word >> (i % WORD) & 1 == 1;
            if !(is_blocked && self.is_trusted(i, axes[2])) {
                then(k, self.verdict(i, axes, is_blocked, state).0);
            }
        }
    }

    pub fn labels(
        self,
        tallies: Vec<(Tally, SurfaceStats)>,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> SurfaceLabels {
        let points: Vec<DVec3> = self.contacts.iter().map(|contact| contact.point).collect();
        let mut labels = SurfaceLabels {
            tolerance_mm: self.tolerances.at_sites(self.bvh, &points),
            finish_mm: self.outline.finish(),
            n_directions: directions.len(),
            ..SurfaceLabels::default()
        };
        for (tally, stats) in tallies {
            labels.answers.push(tally.answer());
            labels.witness.push(tally.witness);
            labels.open_directions.push(if tally.witness.is_some() { 0.0 } else { tally.open });
            if options.counts {
                labels.collision_free_directions.push(tally.collision_free);
                labels.accessible_directions.push(tally.accessible);
            }
            labels.stats += stats;
        }
        labels
    }
}

/// The tool as the caps see it: the steps; and the steps and what of the tip is above its middle.
struct Silhouettes {
    /// For poses within this of the middle of the caps, mm.
    within: f64,
    of: [Silhouette; 2],
}

/// The steps that are left after shrinking them; none if none is.
fn shrunk(cutter: &Cutter, by_mm: f64) -> Result<Option<Cutter>> {
    /// Thinner steps hold no point.
    const THIN_MM: f64 = 1e-3;
    let left = cutter.steps().iter().filter(|step| step.radius_mm > by_mm + THIN_MM);
    let steps: Vec<Step> = left
        .map(|step| Step { height_mm: step.height_mm + by_mm, radius_mm: step.radius_mm - by_mm })
        .collect();
    if steps.is_empty() {
        return Ok(None);
    }
    Cutter::from_steps(cutter.corner_mm(), cutter.side_mm(), steps).map(Some)
}
