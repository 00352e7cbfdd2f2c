//! The labels of all queries: own poses in every direction, other poses where none is free, then the directions between.

use super::caps::Silhouette;
use super::cells::{Domain, Hierarchy};
use super::labels::{SurfaceLabels, SurfaceOptions, SurfaceStats, Tally, WitnessPose};
use super::pose::Limits;
use super::problem::{Problem, WORD};
use super::refine::{Place, Refinement, SearchState};
use super::site::SiteState;
use super::tool::{Axes, axes};
use super::verdict::Verdict;
use crate::access::CollisionMatrix;
use crate::directions::Directions;
use crate::par;
use glam::DVec3;

/// Queries of a task of the search between the directions.
const SEARCHED: usize = 32;

impl Problem<'_> {
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
        let mut labels = SurfaceLabels {
            tolerance_mm: self.own_tolerances,
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
