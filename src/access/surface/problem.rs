//! One cutter at many queries: points first, triangles last, then the directions between.

use super::bvh::Bvh;
use super::cells::Domain;
use super::labels::{SurfaceLabels, SurfaceOptions, SurfaceStats, Tally};
use super::query::{Probe, Scratch};
use super::refine::{Hints, Place, Refinement};
use super::samples;
use super::tool::{Contact, Outline, Stand, axes};
use crate::access::{self, CollisionMatrix, LabelOptions, Obstacles, Queries};
use crate::cutter::Cutter;
use crate::directions::Directions;
use crate::geom::Sites;
use crate::{Result, par};
use glam::{DVec3, Vec3};

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
const WORD: usize = 64;

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
        Ok(labels.collision_matrix.expect("the matrix was asked for"))
    }

    /// Asks the triangles about the pairs that points leave open.
    pub fn by_triangles(
        &self,
        matrix: &CollisionMatrix,
        directions: &Directions,
        domain: Option<Domain>,
        options: &SurfaceOptions,
    ) -> Vec<Vec<(Tally, SurfaceStats)>> {
        let axes: Vec<_> = directions.vectors().iter().map(|&d| axes(d)).collect();
        let refinement = options.refinement.zip(domain).map(|(options, domain)| {
            Refinement::new(domain, options.n_tests, options.resolution_rad)
        });
        par::map_blocks(self.contacts.len(), WORD, |range| {
            let (mut scratch, mut hints) = (Scratch::default(), Hints::default());
            let word = range.start / WORD;
            let column: Vec<u64> = (0..axes.len()).map(|k| matrix.words(k)[word]).collect();
            let mut probe: Option<(f64, Probe)> = None;
            range
                .map(|i| {
                    let tolerance = self.tolerances[i];
                    let (_, probe) = match probe.take().filter(|probe| probe.0 == tolerance) {
                        Some(known) => probe.insert(known),
                        None => probe.insert((tolerance, self.probe(tolerance))),
                    };
                    scratch = Scratch::renewed(std::mem::take(&mut scratch));
                    let mut tally =
                        self.tally(i, probe, &axes, &column, options.counts, &mut scratch);
                    if let Some(refinement) = &refinement {
                        self.refine(i, probe, refinement, &mut tally, &mut hints, &mut scratch);
                    }
                    tally
                })
                .collect()
        })
    }

    fn probe(&self, tolerance: f64) -> Probe {
        Probe::new(&self.outline, tolerance, self.bvh, self.reach)
    }

    fn tally(
        &self,
        i: usize,
        probe: &Probe,
        axes: &[[DVec3; 3]],
        column: &[u64],
        counts: bool,
        scratch: &mut Scratch,
    ) -> (Tally, SurfaceStats) {
        let mut tally = Tally { open: 1.0, ..Tally::default() };
        let mut stats = SurfaceStats { pairs: axes.len() as u64, ..SurfaceStats::default() };
        for (axes, word) in axes.iter().zip(column) {
            let trusted = self.contacts[i].is_steady(&self.outline, axes[2]);
            if trusted && word >> (i % WORD) & 1 == 1 {
                stats.by_points += 1;
                continue;
            }
            let reference = self.contacts[i].reference_point(&self.outline, axes[2]);
            let stand = Stand { reference, axes: *axes };
            tally.add(axes[2].as_vec3(), probe.verdict(self.bvh, &stand, scratch));
            if tally.witness.is_some() && !counts {
                break;
            }
        }
        stats.tools_tested = scratch.n_queries;
        stats.triangles_tested = scratch.n_triangles;
        (tally, stats)
    }

    /// Searches between the directions if none of them reaches the query.
    fn refine(
        &self,
        i: usize,
        probe: &Probe,
        refinement: &Refinement,
        (tally, stats): &mut (Tally, SurfaceStats),
        hints: &mut Hints,
        scratch: &mut Scratch,
    ) {
        if tally.witness.is_some() {
            return;
        }
        let bvh = self.bvh;
        let place = Place { contact: &self.contacts[i], outline: &self.outline, probe, bvh };
        let found = refinement.search(&place, tally.collision_free > 0, hints, scratch);
        tally.witness = found.witness.map(|direction| direction.as_vec3());
        tally.free_between = found.collision_free;
        tally.open = found.open as f32;
        stats.found_between = u64::from(found.witness.is_some());
        stats.tools_tested = scratch.n_queries;
        stats.triangles_tested = scratch.n_triangles;
    }

    pub fn labels(
        self,
        tallies: Vec<Vec<(Tally, SurfaceStats)>>,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> SurfaceLabels {
        let mut labels = SurfaceLabels {
            tolerance_mm: self.tolerances,
            n_directions: directions.len(),
            ..SurfaceLabels::default()
        };
        for (tally, stats) in tallies.into_iter().flatten() {
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
