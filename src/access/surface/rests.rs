//! Answers that rest on something: a wide gouge tolerance, or a clearance.

use super::labels::SurfaceOptions;
use super::obstacles::TriangleObstacles;
use super::query::Scratch;
use super::tolerance::ContactTolerance;
use super::tool::{Outline, Stand, axes};
use super::verdict::Verdict;
use super::warnings::WIDE_MM;
use crate::Result;
use crate::access::Queries;
use crate::access::evidence::WitnessPose;
use crate::answers::SiteAnswer;
use crate::exec::par;
use crate::geom::Sites;
use crate::tool::cutter::Cutter;
use crate::tool::directions::Directions;

/// Sites per task.
const BLOCK: usize = 64;

impl TriangleObstacles {
    /// Per site, whether it is `reached` by a tolerance above [`WIDE_MM`] alone: no pose is found in which the cutter
    /// is free if no facet grants more than that. Poses in `witness`, a list that may be empty, are tried first.
    ///
    /// Nothing is where no facet grants more.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`].
    ///
    /// # Panics
    /// If there are not as many entries of `reached`, or of a `witness` that is not empty, as sites.
    pub fn rest_on_wide_tolerance(
        &self,
        sites: &Sites,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
        (reached, witness): (&[bool], &[Option<WitnessPose>]),
    ) -> Result<Vec<bool>> {
        assert_eq!(reached.len(), sites.len(), "answers about these sites");
        assert!(witness.is_empty() || witness.len() == sites.len(), "poses at these sites");
        let mut rest = vec![false; sites.len()];
        let candidates: Vec<usize> = (0..sites.len()).filter(|&i| reached[i]).collect();
        let Some(options) = self.capped(cutter, options)?.filter(|_| !candidates.is_empty()) else {
            return Ok(rest);
        };
        let subset = sites.subset(&candidates);
        let problem = self.problem(Queries::Sites(&subset), cutter, &options)?;
        let blocks = par::map_blocks(candidates.len(), BLOCK, |range| {
            let mut scratch = Scratch::default();
            let is_free = |k: usize| {
                scratch = Scratch::renewed(std::mem::take(&mut scratch));
                let pose = witness.get(candidates[k]).copied().flatten();
                pose.is_some_and(|pose| {
                    let reference = pose.reference(&problem.outline);
                    let stand = Stand { reference, axes: axes(pose.direction) };
                    let triangles = problem.triangles();
                    let verdict = problem.probes.whole.verdict(triangles, &stand, &mut scratch);
                    verdict == Verdict::Free
                })
            };
            range.map(is_free).collect::<Vec<_>>()
        });
        let is_free: Vec<bool> = blocks.into_iter().flatten().collect();
        let left = candidates.iter().zip(is_free).filter(|(_, is_free)| !is_free);
        let left: Vec<usize> = left.map(|(i, _)| *i).collect();
        for (i, is_reached) in self.reached_of(sites, &left, cutter, directions, &options)? {
            rest[i] = !is_reached;
        }
        Ok(rest)
    }

    /// The options with no tolerance above [`WIDE_MM`]; `None` if there is none anyway.
    fn capped(&self, cutter: &Cutter, options: &SurfaceOptions) -> Result<Option<SurfaceOptions>> {
        let outline = Outline::new(cutter, options.finish_mm);
        let granted = options.tolerance.of_triangles(&outline, &self.chords, &self.bvh)?;
        let tolerance = match options.tolerance {
            _ if granted.most <= WIDE_MM => return Ok(None),
            ContactTolerance::Millimeters(_) => ContactTolerance::Millimeters(WIDE_MM),
            ContactTolerance::AtMost(_) | ContactTolerance::Tessellation => {
                ContactTolerance::AtMost(WIDE_MM)
            }
        };
        Ok(Some(SurfaceOptions { tolerance, ..*options }))
    }

    /// Share of the sites that are not accessible to a cutter, and are to it `without` its clearance.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`].
    ///
    /// # Panics
    /// If there are not as many answers as sites.
    pub fn share_closed_by_clearance(
        &self,
        sites: &Sites,
        without: &Cutter,
        directions: &Directions,
        (options, answers): (&SurfaceOptions, &[SiteAnswer]),
    ) -> Result<f64> {
        assert_eq!(answers.len(), sites.len(), "answers about these sites");
        let is_open = |i: &usize| answers[*i] != SiteAnswer::Accessible;
        let open: Vec<usize> = (0..sites.len()).filter(is_open).collect();
        let found = self.reached_of(sites, &open, without, directions, options)?;
        let n = found.iter().filter(|(_, is_reached)| *is_reached).count();
        Ok(n as f64 / sites.len().max(1) as f64)
    }

    /// Some of the sites, and whether the cutter reaches them.
    fn reached_of(
        &self,
        sites: &Sites,
        of: &[usize],
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<Vec<(usize, bool)>> {
        if of.is_empty() {
            return Ok(Vec::new());
        }
        let options = options.for_few(of.len());
        let labels = self.surface_labels(&sites.subset(of), cutter, directions, &options)?;
        let is_reached = labels.answers.iter().map(|answer| *answer == SiteAnswer::Accessible);
        Ok(of.iter().copied().zip(is_reached).collect())
    }
}
