//! The free poses of tools in every clamping, with what holds the part in the way.

use super::Clamping;
use crate::Result;
use crate::access::surface::{AccessibleDirections, SurfaceOptions, TriangleObstacles};
use crate::analysis::observer::{Observer, Stage, report};
use crate::data::files::tools::Tool;
use crate::geom::{Mesh, Sites};
use crate::planning::setups::Candidates;
use crate::tool::directions::Directions;
use std::time::Instant;

/// What is tested: tools at sites.
#[derive(Clone, Copy)]
pub(in crate::analysis) struct Tests<'a> {
    pub tools: &'a [Tool],
    pub sites: &'a Sites,
    pub options: SurfaceOptions,
}

/// Of every tool, with the sites that are reached by a wide tolerance alone.
pub(in crate::analysis) struct Tested {
    pub accessible: Vec<AccessibleDirections>,
    pub rests: Rests,
    /// Of directions and of tolerances.
    pub seconds: [f64; 2],
}

/// Sites that some tool reaches somewhere, and those that none reaches by less than a wide gouge tolerance.
pub(in crate::analysis) struct Rests {
    is_reached: Vec<bool>,
    rests: Vec<bool>,
}

impl Rests {
    fn of(n_sites: usize) -> Self {
        Rests { is_reached: vec![false; n_sites], rests: vec![true; n_sites] }
    }

    /// Number of sites that are reached by a wide gouge tolerance alone.
    pub fn count(&self) -> usize {
        self.rests
            .iter()
            .zip(&self.is_reached)
            .filter(|(rests, reached)| **rests && **reached)
            .count()
    }
}

impl Tests<'_> {
    /// In the directions, with the same obstacles in all of them; `progress` is what is done before, and all that is to
    /// do.
    pub fn alone(
        &self,
        obstacles: &TriangleObstacles,
        directions: &Directions,
        (before, all): (usize, usize),
        observer: &mut dyn Observer,
    ) -> Result<Vec<AccessibleDirections>> {
        let mut found = Vec::with_capacity(self.tools.len());
        for (k, tool) in self.tools.iter().enumerate() {
            report(observer, Stage::Labels, (before + k, all))?;
            let (cutter, options) = (&tool.cutter, &self.options);
            found.push(obstacles.accessible_directions(self.sites, cutter, directions, options)?);
        }
        report(observer, Stage::Labels, (before + self.tools.len(), all))?;
        Ok(found)
    }

    /// With nothing but the same obstacles in all directions.
    pub fn unclamped(
        &self,
        obstacles: &TriangleObstacles,
        directions: &Directions,
        observer: &mut dyn Observer,
    ) -> Result<Tested> {
        let start = Instant::now();
        let progress = (0, self.tools.len());
        let accessible = self.alone(obstacles, directions, progress, observer)?;
        let directions_s = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let mut rests = Rests::of(self.sites.len());
        let every: Vec<usize> = (0..self.sites.len()).collect();
        for (tool, found) in self.tools.iter().zip(&accessible) {
            self.add_rests(&mut rests, (obstacles, directions), tool, (&every, found))?;
        }
        Ok(Tested { accessible, rests, seconds: [directions_s, start.elapsed().as_secs_f64()] })
    }

    /// In every clamping, the directions of each after those of the one before. `alone` is what each tool reaches with
    /// nothing in the way but the part: more can only be in the way of more, so other sites are not tested again.
    pub fn clamped(
        &self,
        part: &Mesh,
        (clampings, candidates): (&[Clamping], &Candidates),
        alone: &[AccessibleDirections],
        observer: &mut dyn Observer,
    ) -> Result<Tested> {
        let mut rests = Rests::of(self.sites.len());
        let mut seconds = [0.0; 2];
        let of_tool = |alone: &AccessibleDirections| -> Vec<usize> {
            let reached = alone.sites();
            (0..reached.len()).filter(|&i| reached[i]).collect()
        };
        let rows: Vec<Vec<usize>> = alone.iter().map(of_tool).collect();
        let n_all = self.tools.len() * (1 + clampings.len());
        let mut parts: Vec<Vec<AccessibleDirections>> = rows.iter().map(|_| Vec::new()).collect();
        for (c, clamping) in clampings.iter().enumerate() {
            let obstacles = TriangleObstacles::new(part, &clamping.held.bodies)?;
            let directions = candidates.axes_of(clamping.candidate);
            for (t, tool) in self.tools.iter().enumerate() {
                report(observer, Stage::Labels, (self.tools.len() * (1 + c) + t, n_all))?;
                if rows[t].is_empty() {
                    continue;
                }
                let start = Instant::now();
                let subset = Tests { sites: &self.sites.subset(&rows[t]), ..*self };
                let (sites, options) = (subset.sites, &self.options);
                let found =
                    obstacles.accessible_directions(sites, &tool.cutter, &directions, options)?;
                seconds[0] += start.elapsed().as_secs_f64();
                let start = Instant::now();
                subset.add_rests(
                    &mut rests,
                    (&obstacles, &directions),
                    tool,
                    (&rows[t], &found),
                )?;
                seconds[1] += start.elapsed().as_secs_f64();
                parts[t].push(found);
            }
        }
        report(observer, Stage::Labels, (n_all, n_all))?;
        let n_axes = |clamping: &Clamping| candidates.list()[clamping.candidate].axes.len();
        let n_directions = clampings.iter().map(n_axes).sum();
        let accessible = alone.iter().zip(&rows).zip(&parts);
        let accessible = accessible
            .map(|((alone, rows), parts)| alone.with_more_in_the_way(rows, parts, n_directions));
        Ok(Tested { accessible: accessible.collect(), rests, seconds })
    }

    /// `rows` are the numbers of these sites among those of `rests`.
    fn add_rests(
        &self,
        rests: &mut Rests,
        (obstacles, directions): (&TriangleObstacles, &Directions),
        tool: &Tool,
        (rows, found): (&[usize], &AccessibleDirections),
    ) -> Result<()> {
        let options = SurfaceOptions { refinement: None, ..self.options };
        let reached = found.sites();
        // What is reached by less already need not be tested again.
        let open: Vec<bool> =
            rows.iter().zip(&reached).map(|(&i, reached)| *reached && rests.rests[i]).collect();
        let by = (&open[..], &[][..]);
        let of_tool =
            obstacles.rest_on_wide_tolerance(self.sites, &tool.cutter, directions, &options, by)?;
        for ((&i, reached), of_tool) in rows.iter().zip(reached).zip(of_tool) {
            rests.rests[i] &= !reached || of_tool;
            rests.is_reached[i] |= reached;
        }
        Ok(())
    }
}
