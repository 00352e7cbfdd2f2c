//! The labels of all queries: own poses in every direction; where none is free, the directions between, then all other
//! poses.
//!
//! The directions between come first as they cost less: what they reach or prove closed is not searched for other
//! poses.

use super::caps::Silhouette;
use super::cells::{Domain, Hierarchy};
use super::labels::{SurfaceLabels, SurfaceOptions, Tally};
use super::problem::{Problem, WORD};
use super::refine::{Place, Refinement, SearchState};
use super::site::SiteState;
use super::tool::{Axes, axes};
use super::verdict::Verdict;
use crate::Result;
use crate::access::CollisionMatrix;
use crate::access::evidence::{SurfaceEvidence, SurfaceStats, WitnessPose};
use crate::exec::par;
use crate::tool::cutter::Cutter;
use crate::tool::directions::Directions;
use glam::DVec3;

/// Queries of a task of a search.
const SEARCHED: usize = 32;

impl Problem<'_> {
    /// Tests the triangles for the pairs that points leave open, then searches.
    pub fn by_triangles(
        &self,
        cutter: &Cutter,
        directions: &Directions,
        domain: Option<Domain>,
        options: &SurfaceOptions,
    ) -> Result<Vec<(Tally, SurfaceStats)>> {
        let matrix = self.own_by_points(cutter, directions, options)?;
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
        self.search_rest((cutter, options), directions, &axes, &mut tallies)?;
        Ok(tallies)
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
                    stats.borderline = u64::from(site.scratch.borderline);
                }
                (tally, stats)
            };
            range.map(search).collect::<Vec<_>>()
        });
        for (&i, found) in rest.iter().zip(found.into_iter().flatten()) {
            tallies[i] = found;
        }
    }

    /// The tool as the caps see it, for poses within some distances of the middle of the caps; all poses are within the
    /// last.
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
        for (k, (axes, word)) in axes.iter().zip(column).enumerate() {
            let is_blocked = word >> (i % WORD) & 1 == 1;
            if is_blocked && self.contacts[i].is_by_points(&self.outline, axes[2]) {
                stats.by_points += 1;
                continue;
            }
            let (verdict, at) = self.own_pose(i, axes, is_blocked, state);
            let borderline = state.scratch.borderline;
            on_edge |= borderline;
            tally.add(at.map(|at| pose(k, at)), verdict);
            if tally.accessible == 1 && at.is_some() {
                stats.borderline = u64::from(borderline);
                if !options.counts {
                    break;
                }
            }
        }
        if tally.accessible == 0 {
            stats.borderline = u64::from(on_edge);
        }
        stats.tools_tested = state.scratch.n_queries;
        stats.triangles_tested = state.scratch.n_triangles;
        (tally, stats)
    }

    /// Searches other poses in the directions of the set, for queries that nothing reaches so far and that may be open.
    fn search_rest(
        &self,
        (cutter, options): (&Cutter, &SurfaceOptions),
        directions: &Directions,
        axes: &[Axes],
        tallies: &mut [(Tally, SurfaceStats)],
    ) -> Result<()> {
        let is_left = |tally: &Tally| tally.witness.is_none() && tally.open > 0.0;
        let rest: Vec<usize> = (0..tallies.len()).filter(|&i| is_left(&tallies[i].0)).collect();
        if rest.is_empty() {
            return Ok(());
        }
        let matrix = self.all_by_points(cutter, directions, options, &rest)?;
        let given: &[(Tally, SurfaceStats)] = tallies;
        let found = par::map_blocks(rest.len(), SEARCHED, |range| {
            let mut state = SiteState::default();
            let search = |k: usize| {
                let i = rest[k];
                let (mut tally, mut stats) = given[i];
                state.begin();
                let is_blocked = |d: usize| is_set(&matrix, d, k);
                if let Some((k, at)) = self.search_directions(i, axes, is_blocked, &mut state) {
                    tally.found(WitnessPose::new(&self.outline, at, directions.vectors()[k]));
                }
                stats.tools_tested += state.scratch.n_queries;
                stats.triangles_tested += state.scratch.n_triangles;
                (tally, stats)
            };
            range.map(search).collect::<Vec<_>>()
        });
        for (&i, found) in rest.iter().zip(found.into_iter().flatten()) {
            tallies[i] = found;
        }
        Ok(())
    }

    /// A free pose in one of the directions that points leave open, by search: the first of them that is found.
    fn search_directions(
        &self,
        i: usize,
        axes: &[Axes],
        is_blocked: impl Fn(usize) -> bool,
        state: &mut SiteState,
    ) -> Option<(usize, DVec3)> {
        /// Tests of all directions together that are more than the least of each.
        const TESTS: usize = 400;
        const LEAST_TESTS: usize = 10;
        self.place_ball(i, state);
        let mut remaining = TESTS;
        for (k, axes) in axes.iter().enumerate() {
            if is_blocked(k) && self.is_trusted(i, axes[2]) {
                continue;
            }
            // Directions that were tested before the ball was moved are among these.
            if let Some(at) = self.pose_of_moved_ball(i, axes, state) {
                return Some((k, at));
            }
            let before = state.scratch.n_queries;
            let n_tests = (remaining / 3).max(LEAST_TESTS);
            if let Some(at) = self.search_poses(i, axes, n_tests, state) {
                return Some((k, at));
            }
            remaining = remaining.saturating_sub((state.scratch.n_queries - before) as usize);
        }
        None
    }

    /// Gives `then` every direction that points leave open for some pose, in order: its number, and the verdict over
    /// all poses. `own` and `all` are of the query's own poses and of all.
    pub fn verdicts(
        &self,
        i: usize,
        axes: &[Axes],
        [own, all]: [&CollisionMatrix; 2],
        state: &mut SiteState,
        mut then: impl FnMut(usize, Verdict),
    ) {
        state.begin();
        for (k, axes) in axes.iter().enumerate() {
            if !(is_set(all, k, i) && self.is_trusted(i, axes[2])) {
                then(k, self.verdict(i, axes, is_set(own, k, i), state).0);
            }
        }
    }

    pub fn labels(
        self,
        tallies: Vec<(Tally, SurfaceStats)>,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> SurfaceLabels {
        let mut labels = SurfaceLabels::default();
        let mut evidence = SurfaceEvidence {
            tolerance_mm: self.own_tolerances,
            finish_mm: self.outline.finish(),
            n_directions: directions.len(),
            ..SurfaceEvidence::default()
        };
        for (tally, stats) in tallies {
            labels.answers.push(tally.answer());
            evidence.witness.push(tally.witness);
            evidence.open_directions.push(if tally.witness.is_some() { 0.0 } else { tally.open });
            if options.counts {
                evidence.collision_free_directions.push(tally.collision_free);
                labels.accessible_directions.push(tally.accessible);
            }
            evidence.stats += stats;
        }
        SurfaceLabels { evidence, ..labels }
    }
}

fn is_set(matrix: &CollisionMatrix, direction: usize, query: usize) -> bool {
    matrix.words(direction)[query / WORD] >> (query % WORD) & 1 == 1
}

/// The tool as the caps see it: the steps; and the steps and what of the tip is above its middle.
struct Silhouettes {
    /// For poses within this of the middle of the caps, mm.
    within: f64,
    of: [Silhouette; 2],
}
