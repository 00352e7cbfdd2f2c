//! Labels of every tool, and what follows from them.

use super::findings;
use super::fixtures::KeptOut;
use super::observer::{Observer, Stage, report};
use super::outcome::{Outcome, ToolOutcome};
use super::placed::{Placed, without_area};
use crate::access::surface::explain::blocking_parts_among_points;
use crate::access::surface::{TriangleObstacles, Warning};
use crate::access::{self, LabelOptions, Labels, Obstacles};
use crate::data::files::tools::Tool;
use crate::findings::{ALL_TOOLS, Findings, add_blocking_parts, for_all_tools};
use crate::geom::Mesh;
use crate::geom::spacing::areas_on;
use crate::tool::cutter::Cutter;
use crate::{Error, Result};
use std::time::Instant;

impl Placed {
    /// Labels all sites for every tool, and finds what follows.
    ///
    /// # Errors
    /// If the observer stops it ([`Error::Interrupted`]), or as [`TriangleObstacles::label`] and
    /// [`access::label_many`].
    pub fn label(self, observer: &mut dyn Observer) -> Result<Outcome> {
        self.label_with_first_look(observer, &mut |_| Ok(()))
    }

    /// As [`Placed::label`]; `look` is given the answers and the regions out of reach before it is known what keeps
    /// the tools out and what would help there, which takes as long again.
    ///
    /// # Errors
    /// As [`Placed::label`], or those of `look`.
    #[doc(hidden)] // of the program
    pub fn label_with_first_look(
        self,
        observer: &mut dyn Observer,
        look: &mut dyn FnMut(&mut Outcome) -> Result<()>,
    ) -> Result<Outcome> {
        let start = Instant::now();
        let triangles = self.obstacles()?;
        let (labels, mut warnings) = self.labels(triangles.as_ref(), observer)?;
        if self.region.is_some() {
            // Sites are on the region alone.
            let is_kept = |warning: &Warning| !matches!(warning, Warning::FacesWithoutSites { .. });
            warnings.iter_mut().for_each(|of_tool| of_tool.retain(is_kept));
        }
        let labels_s = start.elapsed().as_secs_f64();
        let start = Instant::now();
        report(observer, Stage::Findings, (0, 1))?;
        let (found, of_all) = self.findings(&labels)?;
        let each = labels.into_iter().zip(warnings).zip(found);
        let answers =
            each.map(|((labels, warnings), findings)| ToolOutcome { labels, warnings, findings });
        let mut outcome = Outcome {
            answers: answers.collect(),
            of_all,
            kept_out: None,
            notices: triangles.as_ref().and_then(without_area).into_iter().collect(),
            seconds: [self.seconds(), labels_s, 0.0],
            placed: self,
        };
        let found_s = start.elapsed().as_secs_f64();
        look(&mut outcome)?;
        let start = Instant::now();
        outcome.explain(triangles.as_ref())?;
        report(observer, Stage::Findings, (1, 1))?;
        outcome.seconds[2] = found_s + start.elapsed().as_secs_f64();
        Ok(outcome)
    }

    /// Labels and warnings of every tool.
    fn labels(
        &self,
        triangles: Option<&TriangleObstacles>,
        observer: &mut dyn Observer,
    ) -> Result<(Vec<Labels>, Vec<Vec<Warning>>)> {
        let tools = &self.request.tools;
        let centroids = self.centroids();
        let points = self.points(centroids.as_deref());
        report(observer, Stage::Labels, (0, tools.len()))?;
        match (triangles, &self.mesh) {
            (Some(triangles), Some(mesh)) => {
                let (mut all, mut warnings) = (Vec::new(), Vec::new());
                for (k, tool) in tools.iter().enumerate() {
                    let (labels, of_tool) = self.labels_of(tool, mesh, triangles)?;
                    all.push(labels);
                    warnings.push(of_tool);
                    report(observer, Stage::Labels, (k + 1, tools.len()))?;
                }
                Ok((all, warnings))
            }
            _ => {
                if let Some(tool) = tools.iter().find(|tool| tool.assembly.profile().is_some()) {
                    let found = format!("the profile of {}", tool.name);
                    let remedy = "label against a mesh, by the mesh definition";
                    let expected = "lengths, by the published definition";
                    return Err(Error::argument("tools", found, expected, remedy));
                }
                let cutters: Vec<Cutter> = tools.iter().map(|tool| tool.cutter.clone()).collect();
                let options: &LabelOptions = &self.request.published;
                let (sites, directions) = (&self.sites, &self.directions);
                let labels = access::label_many(sites, points, &cutters, directions, options)?;
                report(observer, Stage::Labels, (tools.len(), tools.len()))?;
                Ok((labels, vec![Vec::new(); cutters.len()]))
            }
        }
    }

    /// Of one tool, by the mesh definition.
    fn labels_of(
        &self,
        tool: &Tool,
        mesh: &Mesh,
        obstacles: &TriangleObstacles,
    ) -> Result<(Labels, Vec<Warning>)> {
        let (sites, directions, options) = (&self.sites, &self.directions, &self.options());
        let cutter = &tool.cutter;
        let mut labels = obstacles.label(sites, cutter, directions, options)?;
        let surface = labels.surface.as_mut().expect("labels by the mesh definition");
        let reached = labels.answers.accessible();
        let found = (&reached[..], &surface.witness[..]);
        let rests = obstacles.rest_on_wide_tolerance(sites, cutter, directions, options, found)?;
        if rests.contains(&true) {
            surface.rests_on_tolerance = rests;
        }
        if self.request.rest {
            let which: Vec<usize> = (0..reached.len()).filter(|&i| !reached[i]).collect();
            let (rests, poses) = obstacles.rests((sites, &which), cutter, directions, options)?;
            let areas = areas_on(self.shown().1, self.shown().0)?;
            labels.answers.rest_volume_mm3 = obstacles.rest_volumes(sites, &rests, &areas)?;
            (labels.answers.rest_mm, surface.rest_pose) = (rests, poses);
        }
        let mut warnings = obstacles.warnings(mesh, sites, cutter, surface)?;
        if tool.clearance_mm > 0.0 {
            let answered = (options, labels.answers.of_sites());
            let without = tool.assembly.cutter()?;
            let share =
                obstacles.share_closed_by_clearance(sites, &without, directions, answered)?;
            let is_reached = reached.contains(&true);
            warnings.extend(Warning::of_clearance(tool.clearance_mm, share, is_reached));
        }
        Ok((labels, warnings))
    }

    /// Adds which part of the tool keeps it from every site; without triangles, the points block.
    fn add_blocking_parts(
        &self,
        labels: &mut Labels,
        tool: &Tool,
        (points, triangles): (Obstacles, Option<&TriangleObstacles>),
    ) -> Result<()> {
        let held = (&tool.assembly, tool.clearance_mm);
        let (sites, directions) = (&self.sites, &self.directions);
        labels.blocked_by = match (triangles, &labels.surface) {
            (Some(triangles), Some(surface)) => {
                let options = self.options();
                let answered = (&options, labels.answers.of_sites(), &surface.retreat_unproven[..]);
                triangles.blocking_parts_of(sites, held, directions, answered)?
            }
            _ => {
                let inaccessible = &labels.answers.inaccessible();
                blocking_parts_among_points(sites, points, held, directions, inaccessible)?
            }
        };
        Ok(())
    }

    /// Adds changes of tools and part that help.
    fn advise(
        &self,
        findings: &mut Findings,
        labels: &[&Labels],
        triangles: &TriangleObstacles,
    ) -> Result<()> {
        let tools = &self.request.tools;
        let accessible: Vec<_> = labels.iter().map(|of| of.answers.accessible()).collect();
        let chosen = if tools.len() == 1 { vec![0] } else { findings::advised(tools, &accessible) };
        let name = |k: usize| (tools.len() > 1).then_some(&*tools[k].name);
        let of: Vec<_> = chosen.iter().map(|&k| (name(k), &tools[k].assembly)).collect();
        let (options, remedies) = (self.options(), self.request.remedies());
        findings::advise(findings, &of, |k, members| {
            let tool = &tools[chosen[k]];
            let (of, held) = ((&self.sites, members), (&tool.assembly, tool.clearance_mm));
            let of_tool = triangles.change_for(of, held, &self.directions, &options, &remedies)?;
            let of_part = triangles.part_changes(of, held, &self.directions, &options)?;
            Ok((of_tool, of_part))
        })
    }

    /// What the fixtures keep out of reach, if there are any.
    fn kept_out(&self, labels: &[&Labels]) -> Result<Option<KeptOut>> {
        let Some(mesh) = self.mesh.as_ref().filter(|_| !self.request.fixtures.is_empty()) else {
            return Ok(None);
        };
        let by = (&self.directions, &self.options());
        let of = (&self.sites, labels);
        KeptOut::find((mesh, &self.request.fixtures), of, &self.request.tools, by).map(Some)
    }

    /// The findings of every tool, and of all together if there are several.
    fn findings(&self, labels: &[Labels]) -> Result<(Vec<Findings>, Option<Findings>)> {
        let (mesh, sites) = self.shown();
        let names: Vec<&str> = self.request.tools.iter().map(|tool| &*tool.name).collect();
        let all: Vec<&Labels> = labels.iter().collect();
        let mut of_tools = findings::findings_of_tools(sites, mesh, &names, &all)?;
        let bounds = self.bounds();
        of_tools.iter_mut().zip(&names).for_each(|(found, name)| found.identify(name, bounds));
        let answers = labels.iter().map(|labels| &labels.answers);
        let all = || Findings::of(sites, mesh, &for_all_tools(answers), &[]);
        let mut of_all = (labels.len() > 1).then(all).transpose()?;
        of_all.iter_mut().for_each(|found| found.identify(ALL_TOOLS, bounds));
        Ok((of_tools, of_all))
    }
}

impl Outcome {
    /// Adds what keeps each tool out, and what would help.
    fn explain(&mut self, triangles: Option<&TriangleObstacles>) -> Result<()> {
        let Outcome { placed, answers, of_all, kept_out, .. } = self;
        let centroids = placed.centroids();
        let points = placed.points(centroids.as_deref());
        for (tool, ToolOutcome { labels, findings, .. }) in placed.tools().iter().zip(&mut *answers)
        {
            placed.add_blocking_parts(labels, tool, (points, triangles))?;
            add_blocking_parts(findings, &labels.blocked_by);
        }
        let each = answers.iter_mut().map(|of| (&of.labels, &mut of.findings));
        let (labels, mut found): (Vec<&Labels>, Vec<&mut Findings>) = each.unzip();
        *kept_out = placed.kept_out(&labels)?;
        if let Some(kept_out) = kept_out {
            kept_out.add_to(found.iter_mut().map(|found| &mut **found));
        }
        let found = of_all.as_mut().or(found.first_mut().map(|found| &mut **found));
        if let (Some(triangles), Some(found)) = (triangles, found) {
            placed.advise(found, &labels, triangles)?;
            let of = (&placed.directions, &placed.options());
            findings::add_openings(found, &placed.sites, placed.tools(), triangles, of)?;
        }
        Ok(())
    }
}
