//! One cutter at many queries: points first, triangles last, then the directions between.

use super::bvh::Bvh;
use super::caps::Silhouette;
use super::cells::{Domain, Hierarchy};
use super::labels::{SurfaceLabels, SurfaceOptions, SurfaceStats, Tally};
use super::query::{Probe, Scratch};
use super::refine::{Place, Refinement, Tools};
use super::samples;
use super::tool::{Contact, Outline, Stand, axes};
use super::verdict::Verdict;
use crate::access::{self, CollisionMatrix, LabelOptions, Obstacles, Queries};
use crate::cutter::Cutter;
use crate::directions::Directions;
use crate::geom::Sites;
use crate::{Result, par};
use glam::{DVec3, Vec3};
use std::ops::ControlFlow;

/// What separates a collision that a point proves from one that is left to the triangles, as a share of all lengths:
/// several times what `f32` can round.
const MARGIN: f64 = 2e-6;

/// One cutter at all queries.
pub(super) struct Problem<'a> {
    /// Search tree over all triangles.
    pub bvh: &'a Bvh,
    /// Corners of the part's own triangles, mm.
    pub part: &'a [[DVec3; 3]],
    pub contacts: Vec<Contact>,
    pub tolerances: Vec<f64>,
    pub outline: Outline,
    /// Greatest distance of a reference point from the middle of the triangles, mm.
    pub reach: f64,
}

/// A block of queries shares a word of the answers by points.
pub(super) const WORD: usize = 64;
/// Queries of a task of the search between the directions.
const SEARCHED: usize = 128;
/// Tools that are tested as a whole before the ball is tested on its own.
const TESTED_WHOLE: u64 = 2;

/// What is known of the ball at a site.
enum Ball {
    Unknown,
    Fits,
    Gouges,
}

impl Problem<'_> {
    /// Where points of the surface prove a collision. The tool is shrunk by the greatest tolerance and by more than all
    /// roundings, and all is about the middle of the triangles, where `f32` is finest.
    pub fn by_points(
        &self,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<CollisionMatrix> {
        let Problem { bvh, part, .. } = self;
        let origin = bvh.origin();
        let margin = MARGIN * (bvh.radius() + self.reach + self.outline.size());
        let tolerance = self.tolerances.iter().fold(0.0, |a: f64, b| a.max(*b));
        let shrunk = cutter.with_clearance(-(tolerance + margin))?;
        // A table would take nearly all points for itself.
        let samples = samples::points(part, options.n_samples, origin);
        let samples: Vec<Vec3> = samples.into_iter().map(|p| p.as_vec3()).collect();
        let mut sites = Sites::default();
        for contact in &self.contacts {
            sites.points.push((contact.point() - origin).as_vec3());
            sites.normals.extend(contact.normal().map(|normal| normal.as_vec3()));
        }
        let volume = sites.normals.is_empty();
        let queries = if volume { Queries::Volume(&sites.points) } else { Queries::Sites(&sites) };
        let obstacles = Obstacles::Points(&samples);
        let options =
            LabelOptions { occlusion: false, collision_matrix: true, ..LabelOptions::default() };
        let labels = access::label(queries, obstacles, &shrunk, directions, &options)?;
        Ok(labels.collision_matrix.expect("the option is set"))
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
            let (mut scratch, mut tools) = (Scratch::default(), None);
            let word = range.start / WORD;
            let column: Vec<u64> = (0..axes.len()).map(|k| matrix.words(k)[word]).collect();
            let tally = |i| {
                let tools = self.tools(i, &mut tools);
                scratch = Scratch::renewed(std::mem::take(&mut scratch));
                self.tally(i, tools, &axes, &column, options.counts, &mut scratch)
            };
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
        let found = par::map_blocks(rest.len(), SEARCHED, |range| {
            let (mut scratch, mut state, mut tools) = Default::default();
            let search = |k: usize| {
                let i = rest[k];
                let (mut tally, mut stats) = given[i];
                let tools = self.tools(i, &mut tools);
                let place = Place {
                    contact: &self.contacts[i],
                    outline: &self.outline,
                    tools,
                    bvh: self.bvh,
                };
                scratch = Scratch::with_last(std::mem::take(&mut scratch));
                let known = tally.collision_free > 0;
                let found = refinement.search(&place, known, &mut state, &mut scratch);
                tally.witness = found.witness;
                tally.free_between = found.collision_free;
                tally.open = found.open as f32;
                stats.found_between = u64::from(found.witness.is_some());
                stats.tools_tested += scratch.n_queries;
                stats.triangles_tested += scratch.n_triangles;
                if found.witness.is_some() {
                    stats.knife_edge = u64::from(scratch.knife_edge);
                }
                (tally, stats)
            };
            range.map(search).collect::<Vec<_>>()
        });
        for (&i, found) in rest.iter().zip(found.into_iter().flatten()) {
            tallies[i] = found;
        }
    }

    /// The tools for a query; kept while the tolerance stays the same.
    pub fn tools<'t>(&self, i: usize, kept: &'t mut Option<Tools>) -> &'t Tools {
        let tolerance = self.tolerances[i];
        let same = kept.take().filter(|tools| tools.tolerance == tolerance);
        kept.insert(same.unwrap_or_else(|| self.new_tools(tolerance)))
    }

    fn new_tools(&self, tolerance: f64) -> Tools {
        let Problem { bvh, outline, reach, .. } = self;
        let whole = Probe::new(outline, tolerance, bvh, *reach);
        let volume = self.contacts.first().is_some_and(|contact| contact.normal().is_none());
        // The middle of the caps of a query in space is the tip, and stays on the axis.
        let (lift, side) = if volume { (outline.corner(), 0.0) } else { (0.0, outline.side()) };
        let margin = MARGIN * (bvh.radius() + reach + outline.size());
        let lifted = |[height, radius]: [f64; 2]| [height + lift, radius];
        let steps = || outline.steps(tolerance).map(lifted);
        let all = std::iter::once(lifted(outline.tip(tolerance).shaft())).chain(steps());
        Tools {
            tolerance,
            without_ball: whole.without_ball(outline, bvh, *reach),
            steps: Probe::of_steps(outline, tolerance, bvh, *reach),
            whole,
            silhouettes: [
                Silhouette::new(steps(), side, margin),
                Silhouette::new(all, side, margin),
            ],
        }
    }

    fn tally(
        &self,
        i: usize,
        tools: &Tools,
        axes: &[[DVec3; 3]],
        column: &[u64],
        counts: bool,
        scratch: &mut Scratch,
    ) -> (Tally, SurfaceStats) {
        let mut tally = Tally { open: 1.0, ..Tally::default() };
        let mut stats = SurfaceStats { pairs: axes.len() as u64, ..SurfaceStats::default() };
        let mut on_edge = false;
        stats.by_points =
            self.verdicts(i, tools, axes, column, scratch, |k, verdict, knife_edge| {
                on_edge |= knife_edge;
                tally.add(axes[k][2].as_vec3(), verdict);
                if tally.accessible == 1 && verdict == Verdict::Free {
                    stats.knife_edge = u64::from(knife_edge);
                    if !counts {
                        return ControlFlow::Break(());
                    }
                }
                ControlFlow::Continue(())
            });
        if tally.accessible == 0 {
            stats.knife_edge = u64::from(on_edge);
        }
        stats.tools_tested = scratch.n_queries;
        stats.triangles_tested = scratch.n_triangles;
        (tally, stats)
    }

    /// Tells `then` of every direction that points leave open, in order: its number, the verdict, whether that is on the knife edge. Returns
    /// the number of collisions that points prove, as far as it went.
    pub fn verdicts(
        &self,
        i: usize,
        tools: &Tools,
        axes: &[[DVec3; 3]],
        column: &[u64],
        scratch: &mut Scratch,
        mut then: impl FnMut(usize, Verdict, bool) -> ControlFlow<()>,
    ) -> u64 {
        let (mut by_points, mut ball) = (0, Ball::Unknown);
        for (k, (axes, word)) in axes.iter().zip(column).enumerate() {
            let trusted = self.contacts[i].is_steady(&self.outline, axes[2]);
            if trusted && word >> (i % WORD) & 1 == 1 {
                by_points += 1;
                continue;
            }
            let reference = self.contacts[i].reference_point(&self.outline, axes[2]);
            let stand = Stand { reference, axes: *axes };
            if scratch.n_queries == TESTED_WHOLE {
                ball = self.ball(i, tools);
            }
            let verdict = match ball {
                Ball::Unknown => tools.whole.verdict(self.bvh, &stand, scratch),
                Ball::Fits => tools.without_ball.verdict(self.bvh, &stand, scratch),
                Ball::Gouges => {
                    tools.steps.verdict(self.bvh, &stand, scratch).max(Verdict::TipGouges)
                }
            };
            if then(k, verdict, scratch.knife_edge).is_break() {
                break;
            }
        }
        by_points
    }

    /// Whether the tip of the tool at a query is a ball that gouges, in every direction.
    pub fn ball_gouges(&self, i: usize) -> bool {
        matches!(self.ball(i, &self.new_tools(self.tolerances[i])), Ball::Gouges)
    }

    /// Whether a ball fits is the same for all directions.
    fn ball(&self, i: usize, tools: &Tools) -> Ball {
        match self.contacts[i] {
            Contact::Surface { point, normal } if self.outline.side() == 0.0 => {
                let center = point + normal * self.outline.corner();
                if tools.whole.ball_gouges(self.bvh, center) { Ball::Gouges } else { Ball::Fits }
            }
            _ => Ball::Unknown,
        }
    }

    pub fn labels(
        self,
        tallies: Vec<(Tally, SurfaceStats)>,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> SurfaceLabels {
        let mut labels = SurfaceLabels {
            tolerance_mm: self.tolerances,
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
