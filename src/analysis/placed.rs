//! The sites of a part, and their labels.

use super::fixtures::{Fixture, KeptOut};
use super::observer::{Observer, Stage, tell};
use super::outcome::{Outcome, ToolOutcome};
use super::{Analysis, Placement, findings};
use crate::access::surface::explain::blocking_parts_among_points;
use crate::access::surface::{SiteAnswer, SurfaceOptions, TriangleObstacles, Warning};
use crate::access::{self, LabelOptions, Labels, Obstacles};
use crate::cutter::Cutter;
use crate::data::files::settings::Blocking;
use crate::data::files::tools::Tool;
use crate::directions::Directions;
use crate::geom::formats::MeshOrCloud;
use crate::geom::selection::Region;
use crate::geom::sites::{self, SiteOptions};
use crate::geom::{Mesh, Sites};
use crate::report::findings::{Findings, for_all_tools};
use crate::{Error, Result};
use std::time::Instant;

/// A part with its sites, ready to be labeled.
#[derive(Debug)]
pub struct Placed {
    pub(super) asked: Analysis,
    pub(super) blocking: Blocking,
    pub(super) directions: Directions,
    pub(super) mesh: Option<Mesh>,
    pub(super) sites: Sites,
    pub(super) region: Option<(Region, Sites)>,
    /// Points of the surface that block beside the sites.
    pub(super) more: Option<Sites>,
    triangles: Option<TriangleObstacles>,
    notices: Vec<String>,
    warnings: Vec<String>,
    started: Instant,
}

impl Analysis {
    /// Spreads the sites and reads nothing but what it holds.
    ///
    /// # Errors
    /// If there are no tools, the region is empty or not of triangles that block, sites cannot be placed, a fixture is
    /// not finite, or an option is out of its domain.
    pub fn place(mut self, observer: &mut dyn Observer) -> Result<Placed> {
        let started = Instant::now();
        tell(observer, Stage::Sites, (0, 1))?;
        self.options.check()?;
        if self.tools.is_empty() {
            return Err(Error::argument("tools", "none", "one or more", "name a tool"));
        }
        let blocking = self.blocking();
        if self.region.is_some() && blocking != Blocking::Part {
            let remedy = "the sites block: leave out --obstacles, and give the mesh for a cloud";
            let expected = "triangles that block";
            return Err(Error::argument("region", "points as obstacles", expected, remedy));
        }
        let directions = match (&self.directions, blocking) {
            (Some(given), _) => given.clone(),
            (None, Blocking::Part) => Directions::fibonacci_hemisphere(150)?,
            (None, _) => Directions::published(),
        };
        let (mesh, sites, region) = match self.shape.clone() {
            MeshOrCloud::Cloud(sites) => (None, sites, None),
            MeshOrCloud::Mesh(mesh) => {
                let (sites, region) = self.sites_on(&mesh)?;
                (Some(mesh), sites, region)
            }
        };
        let more = self.further_obstacles(blocking, mesh.as_ref())?;
        let (mut notices, mut warnings) = (Vec::new(), Vec::new());
        let part = mesh.as_ref().filter(|_| blocking == Blocking::Part);
        if part.is_none() {
            self.fixtures.clear();
        }
        let mut triangles = None;
        if let Some(part) = part {
            for fixture in &self.fixtures {
                fixture.require_finite()?;
                warnings.extend(fixture.warnings(part)?);
            }
            if let Some(z_mm) = self.table_z_mm {
                self.fixtures.push(Fixture::table(part, z_mm)?);
                warnings.extend(Fixture::table_warning(part, z_mm));
            }
            let meshes: Vec<Mesh> = self.fixtures.iter().map(|f| f.mesh.clone()).collect();
            let obstacles = TriangleObstacles::new(part, &meshes)?;
            notices.extend(without_area(obstacles.n_without_area()));
            triangles = Some(obstacles);
        }
        tell(observer, Stage::Sites, (1, 1))?;
        Ok(Placed {
            asked: self,
            blocking,
            directions,
            mesh,
            sites,
            region,
            more,
            triangles,
            notices,
            warnings,
            started,
        })
    }

    /// The sites, their faces those of the part, and the region with its own.
    fn sites_on(&self, mesh: &Mesh) -> Result<(Sites, Option<(Region, Sites)>)> {
        let Some(asked) = &self.region else {
            return Ok((self.spread_on(mesh)?, None));
        };
        let region = asked.selection.of(mesh)?;
        let on_region = match &self.sites {
            Placement::Spread(options) => asked.selection.sample(mesh, &region, options)?,
            Placement::Vertices { .. } => self.spread_on(&region.mesh)?,
        };
        Ok((region.on_part(&on_region), Some((region, on_region))))
    }

    fn spread_on(&self, mesh: &Mesh) -> Result<Sites> {
        match &self.sites {
            Placement::Spread(options) => sites::sample(mesh, options),
            Placement::Vertices { .. } => sites::from_vertices(mesh),
        }
    }

    /// Points of the surface beside the sites, from another stream of the same seed.
    fn further_obstacles(&self, blocking: Blocking, mesh: Option<&Mesh>) -> Result<Option<Sites>> {
        let (Blocking::Points(Some(n_sites)), Some(mesh)) = (blocking, mesh) else {
            return Ok(None);
        };
        let seed = self.seed().wrapping_add(1);
        let options = SiteOptions { n_sites, seed, ..SiteOptions::default() };
        sites::sample(mesh, &options).map(Some)
    }
}

/// How many triangles are no obstacles.
fn without_area(n: usize) -> Option<String> {
    let (are, s) = if n == 1 { ("is", "") } else { ("are", "s") };
    (n > 0).then(|| format!("{n} triangle{s} without area {are} no obstacle{s}"))
}

impl Placed {
    /// The surface that answers are about, none for a cloud, and the sites on it: of the region, if there is one.
    pub fn shown(&self) -> (Option<&Mesh>, &Sites) {
        match &self.region {
            Some((region, sites)) => (Some(&region.mesh), sites),
            None => (self.mesh.as_ref(), &self.sites),
        }
    }

    /// What is left out, a sentence each.
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// What is wrong with fixtures and table, a sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Whether the answers are by the mesh definition.
    fn is_by_mesh(&self) -> bool {
        self.blocking == Blocking::Part
    }

    /// Labels all sites for every tool, and finds what follows.
    ///
    /// # Errors
    /// If the observer stops it ([`Error::Interrupted`]), or as [`TriangleObstacles::label_sites`] and
    /// [`access::label_many`].
    pub fn label(self, observer: &mut dyn Observer) -> Result<Outcome> {
        let sites_s = self.started.elapsed().as_secs_f64();
        let start = Instant::now();
        let (labels, mut warnings) = self.labels(observer)?;
        if self.region.is_some() {
            // Sites are on the region alone.
            let is_kept = |warning: &Warning| !matches!(warning, Warning::FacesWithoutSites { .. });
            warnings.iter_mut().for_each(|of_tool| of_tool.retain(is_kept));
        }
        let labels_s = start.elapsed().as_secs_f64();
        let start = Instant::now();
        tell(observer, Stage::Findings, (0, 1))?;
        let kept_out = self.kept_out(&labels)?;
        let (mut found, of_all) = self.findings(&labels)?;
        kept_out.iter().for_each(|kept| kept.add_to(found.iter_mut()));
        if let (Some(triangles), [found], [tool]) =
            (&self.triangles, &mut found[..], &self.asked.tools[..])
        {
            let held = (&tool.assembly, tool.clearance_mm);
            let (options, remedies) = (self.options(), self.asked.remedies());
            findings::advise(found, held.0, |members| {
                let of = (&self.sites, members);
                triangles.change_for(of, held, &self.directions, &options, &remedies)
            })?;
        }
        tell(observer, Stage::Findings, (1, 1))?;
        let findings_s = start.elapsed().as_secs_f64();
        let each = labels.into_iter().zip(warnings).zip(found);
        let answers =
            each.map(|((labels, warnings), findings)| ToolOutcome { labels, warnings, findings });
        Ok(Outcome {
            answers: answers.collect(),
            of_all,
            kept_out,
            seconds: [sites_s, labels_s, findings_s],
            placed: self,
        })
    }

    /// Options of the mesh definition.
    pub(super) fn options(&self) -> SurfaceOptions {
        self.asked.options
    }

    /// Labels and warnings of every tool.
    fn labels(&self, observer: &mut dyn Observer) -> Result<(Vec<Labels>, Vec<Vec<Warning>>)> {
        let tools = &self.asked.tools;
        let centroids = self.mesh.as_ref().filter(|_| self.blocking == Blocking::Centroids);
        let centroids = centroids.map(Mesh::centroids);
        let points = match (&self.more, &centroids) {
            (Some(sites), _) => Obstacles::QueriesAnd(&sites.points),
            (None, Some(centroids)) => Obstacles::Centroids(centroids),
            (None, None) => Obstacles::Queries,
        };
        tell(observer, Stage::Labels, (0, tools.len()))?;
        let (mut labels, warnings) = match (&self.triangles, &self.mesh) {
            (Some(triangles), Some(mesh)) => {
                let (mut all, mut warnings) = (Vec::new(), Vec::new());
                for (k, tool) in tools.iter().enumerate() {
                    let (labels, of_tool) = self.labels_of(tool, mesh, triangles)?;
                    all.push(labels);
                    warnings.push(of_tool);
                    tell(observer, Stage::Labels, (k + 1, tools.len()))?;
                }
                (all, warnings)
            }
            _ => {
                let cutters: Vec<Cutter> = tools.iter().map(|tool| tool.cutter.clone()).collect();
                let options: &LabelOptions = &self.asked.published;
                let (sites, directions) = (&self.sites, &self.directions);
                let labels = access::label_many(sites, points, &cutters, directions, options)?;
                tell(observer, Stage::Labels, (tools.len(), tools.len()))?;
                (labels, vec![Vec::new(); cutters.len()])
            }
        };
        for (tool, labels) in tools.iter().zip(&mut labels) {
            self.add_blocking_parts(labels, tool, points)?;
        }
        Ok((labels, warnings))
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
        let mut labels = obstacles.label_sites(sites, cutter, directions, options)?;
        let surface = labels.surface.as_mut().expect("labels by the mesh definition");
        let reached = surface.answers.iter().map(|a| *a == SiteAnswer::Accessible);
        let reached: Vec<bool> = reached.collect();
        let found = (&reached[..], &surface.witness[..]);
        let rests = obstacles.rest_on_wide_tolerance(sites, cutter, directions, options, found)?;
        if rests.contains(&true) {
            surface.rests_on_tolerance = rests;
        }
        let mut warnings = obstacles.warnings(mesh, sites, cutter, surface)?;
        if tool.clearance_mm > 0.0 {
            let answered = (options, &surface.answers[..]);
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
        points: Obstacles,
    ) -> Result<()> {
        let held = (&tool.assembly, tool.clearance_mm);
        let (sites, directions) = (&self.sites, &self.directions);
        labels.blocked_by = match (&self.triangles, &labels.surface) {
            (Some(triangles), Some(surface)) => {
                let options = self.options();
                let answered = (&options, &surface.answers[..]);
                triangles.blocking_parts(sites, held, directions, answered)?
            }
            _ => {
                let inaccessible = &labels.answers.inaccessible;
                blocking_parts_among_points(sites, points, held, directions, inaccessible)?
            }
        };
        Ok(())
    }

    /// What the fixtures keep out of reach, if there are any.
    fn kept_out(&self, labels: &[Labels]) -> Result<Option<KeptOut>> {
        let Some(mesh) = self.mesh.as_ref().filter(|_| !self.asked.fixtures.is_empty()) else {
            return Ok(None);
        };
        let by = (&self.directions, &self.options());
        let of = (&self.sites, labels);
        KeptOut::find((mesh, &self.asked.fixtures), of, &self.asked.tools, by).map(Some)
    }

    /// The findings of every tool, and of all together if there are several.
    fn findings(&self, labels: &[Labels]) -> Result<(Vec<Findings>, Option<Findings>)> {
        let (mesh, sites) = self.shown();
        let names: Vec<&str> = self.asked.tools.iter().map(|tool| &*tool.name).collect();
        let all: Vec<&Labels> = labels.iter().collect();
        let of_tools = findings::findings_of_tools(sites, mesh, &names, &all)?;
        let answers = labels.iter().map(|labels| &labels.answers);
        let all = || Findings::of(sites, mesh, &for_all_tools(answers), &[]);
        let of_all = (labels.len() > 1).then(all).transpose()?;
        Ok((of_tools, of_all))
    }

    /// Whether occlusion points are among the answers.
    pub(super) fn has_occlusion(&self) -> bool {
        !self.is_by_mesh() || self.options().occlusion
    }
}
