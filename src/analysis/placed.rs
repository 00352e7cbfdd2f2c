//! The sites of a part, and what stands around it.

use super::Analysis;
use super::fixtures::Fixture;
use super::observer::{Observer, Stage, report};
use super::request::{Placement, Request};
use crate::access::surface::{SurfaceOptions, TriangleObstacles};
use crate::access::{LabelOptions, Obstacles};
use crate::data::files::label_query::joined;
use crate::data::files::settings::{Blocking, RegionSettings};
use crate::data::files::tools::Tool;
use crate::findings::{Bounds, bounds_of};
use crate::geom::file_vertices::{FileVertices, SiteVertices};
use crate::geom::formats::MeshOrCloud;
use crate::geom::selection::{Region, Selection};
use crate::geom::sites::{self, SiteOptions};
use crate::geom::{Mesh, Sites};
use crate::render::outlines::outlines;
use crate::tool::directions::Directions;
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use std::mem;
use std::time::Instant;

/// Directions of the mesh definition if none are given.
const N_DIRECTIONS: usize = 150;

/// A part with its sites and what stands around it, ready to be labeled.
#[derive(Debug)]
pub struct Placed {
    pub(super) request: Request,
    pub(super) blocking: Blocking,
    pub(super) directions: Directions,
    pub(super) mesh: Option<Mesh>,
    pub(super) sites: Sites,
    /// The vertices of the part's file that the sites are at.
    pub(super) vertices: Option<SiteVertices>,
    /// The region of interest, with the sites on it.
    pub(super) region: Option<(Region, Sites)>,
    /// Points of the surface that block beside the sites.
    pub(super) more: Option<Sites>,
    pub(super) warnings: Vec<String>,
    pub(super) seconds: f64,
}

/// Sites on a part.
#[derive(Default)]
struct OnPart {
    sites: Sites,
    /// See [`Placed::vertices`].
    vertices: Option<SiteVertices>,
    region: Option<(Region, Sites)>,
}

impl Analysis {
    /// Places the sites, and checks what blocks beside the part.
    ///
    /// # Errors
    /// If there are no tools, the region is empty or not of triangles that block, sites cannot be placed, a fixture is
    /// not finite, or an option is out of its domain.
    pub fn place(self, observer: &mut dyn Observer) -> Result<Placed> {
        let started = Instant::now();
        report(observer, Stage::Sites, (0, 1))?;
        let Analysis { mut request, shape, file_vertices, selection, directions } = self;
        request.options.check()?;
        if request.tools.is_empty() {
            return Err(Error::argument("tools", "none", "one or more", "name a tool"));
        }
        let blocking = request.blocking();
        if selection.is_some() && blocking != Blocking::Part {
            let remedy = "points block: take the triangles of the mesh as obstacles";
            let expected = "triangles that block";
            return Err(Error::argument("region", "points as obstacles", expected, remedy));
        }
        if request.rest && blocking != Blocking::Part {
            let (found, expected) = ("points as obstacles", "triangles that block");
            let remedy = "take the triangles of a mesh as obstacles, or leave the rest out";
            return Err(Error::argument("rest", found, expected, remedy));
        }
        if blocking == Blocking::Part {
            // Nothing else of these options decides any answer: requests are equal without it.
            let engine = request.published.engine;
            request.published = LabelOptions { engine, ..LabelOptions::published() };
        }
        let directions = or_usual(directions, blocking)?;
        let (mesh, on_part) = match shape {
            MeshOrCloud::Cloud(sites) => (None, OnPart { sites, ..OnPart::default() }),
            MeshOrCloud::Mesh(mesh) => {
                let of_file = (selection.as_ref(), file_vertices.as_ref());
                let on_part = request.sites_on(&mesh, of_file)?;
                (Some(mesh), on_part)
            }
        };
        let more = request.further_obstacles(blocking, mesh.as_ref())?;
        let mut warnings = Vec::new();
        let fixtures = mem::take(&mut request.fixtures);
        if let Some(part) = mesh.as_ref().filter(|_| blocking == Blocking::Part) {
            (request.fixtures, warnings) = Fixture::around(part, fixtures, request.table_z_mm)?;
        }
        report(observer, Stage::Sites, (1, 1))?;
        let seconds = started.elapsed().as_secs_f64();
        let OnPart { sites, vertices, region } = on_part;
        Ok(Placed {
            request,
            blocking,
            directions,
            mesh,
            sites,
            vertices,
            region,
            more,
            warnings,
            seconds,
        })
    }
}

/// The directions given, or those that are usual.
pub(super) fn or_usual(given: Option<Directions>, blocking: Blocking) -> Result<Directions> {
    match (given, blocking) {
        (Some(given), _) => Ok(given),
        (None, Blocking::Part) => Directions::fibonacci_hemisphere(N_DIRECTIONS),
        (None, _) => Ok(Directions::published()),
    }
}

impl Request {
    /// The sites, their faces those of the part, and the region with its own.
    fn sites_on(
        &self,
        mesh: &Mesh,
        (selection, file): (Option<&Selection>, Option<&FileVertices>),
    ) -> Result<OnPart> {
        let Some(selection) = selection else {
            let (sites, vertices) = self.spread_on(mesh, file)?;
            return Ok(OnPart { sites, vertices, region: None });
        };
        let region = selection.of(mesh)?;
        let (on_region, vertices) = match &self.sites {
            Placement::Spread(options) => (selection.sample(mesh, &region, options)?, None),
            Placement::Vertices { .. } => self.spread_on(&region.mesh, file)?,
        };
        let sites = region.on_part(&on_region);
        Ok(OnPart { sites, vertices, region: Some((region, on_region)) })
    }

    /// The sites on a mesh, and the vertices of the part's file that they are at, if they are at vertices.
    fn spread_on(
        &self,
        mesh: &Mesh,
        file: Option<&FileVertices>,
    ) -> Result<(Sites, Option<SiteVertices>)> {
        let normals = match &self.sites {
            Placement::Spread(options) => return Ok((sites::sample(mesh, options)?, None)),
            Placement::Vertices { normals, .. } => *normals,
        };
        let (sites, rows) = sites::at_vertices(mesh, normals)?;
        let Some(file) = file else { return Ok((sites, None)) };
        let places: Vec<DVec3> = rows.iter().map(|&v| mesh.vertices[v as usize]).collect();
        let (order, vertices) = file.of_sites(&places);
        let faces = order.iter().map(|&i| sites.faces[i]).collect();
        Ok((Sites { faces, ..sites.subset(&order) }, Some(vertices)))
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

/// How many triangles are no obstacles, in words.
pub(super) fn without_area(obstacles: &TriangleObstacles) -> Option<String> {
    let n = obstacles.n_without_area();
    let (are, s) = if n == 1 { ("is", "") } else { ("are", "s") };
    (n > 0).then(|| format!("{n} triangle{s} without area {are} no obstacle{s}"))
}

impl Placed {
    /// Name of the part.
    pub fn part(&self) -> &str {
        &self.request.part
    }

    /// The tools.
    pub fn tools(&self) -> &[Tool] {
        &self.request.tools
    }

    /// The surface that answers are about, none for a cloud, and the sites on it: of the region, if there is one.
    pub fn shown(&self) -> (Option<&Mesh>, &Sites) {
        match &self.region {
            Some((region, sites)) => (Some(&region.mesh), sites),
            None => (self.mesh.as_ref(), &self.sites),
        }
    }

    /// The whole surface of the part; none for a cloud.
    pub fn mesh(&self) -> Option<&Mesh> {
        self.mesh.as_ref()
    }

    /// The sites; their faces are those of [`Placed::mesh`].
    pub fn sites(&self) -> &Sites {
        &self.sites
    }

    /// The vertices of the part's file that the sites are at, if the sites are vertices and the file lists them.
    #[doc(hidden)] // of the program
    pub fn vertices(&self) -> Option<&SiteVertices> {
        self.vertices.as_ref()
    }

    /// The region of interest, if there is one.
    #[doc(hidden)] // of the program
    pub fn region(&self) -> Option<RegionSettings> {
        let (region, _) = self.region.as_ref()?;
        let named = self.request.region.as_ref()?;
        Some(RegionSettings {
            only: named.only.clone(),
            except: named.except.clone(),
            area_mm2: region.mesh.area(),
            part_area_mm2: self.mesh().map_or(0.0, Mesh::area),
        })
    }

    /// The triangles of part, fixtures and table; none if points block.
    ///
    /// # Errors
    /// As [`TriangleObstacles::new`].
    pub fn obstacles(&self) -> Result<Option<TriangleObstacles>> {
        let Some(part) = self.mesh().filter(|_| self.is_by_mesh()) else { return Ok(None) };
        let fixtures: Vec<Mesh> = self.request.fixtures.iter().map(|f| f.mesh.clone()).collect();
        TriangleObstacles::new(part, &fixtures).map(Some)
    }

    /// As [`Placed::obstacles`]; an error if points block.
    pub(super) fn require_triangles(&self) -> Result<TriangleObstacles> {
        self.obstacles()?.ok_or_else(|| {
            let remedy = "give a mesh, with its triangles as obstacles";
            Error::argument("part", "points that block", "triangles that block", remedy)
        })
    }

    /// All triangles that block beside the part's.
    pub(super) fn fixtures(&self) -> Option<Mesh> {
        let meshes: Vec<Mesh> = self.request.fixtures.iter().map(|f| f.mesh.clone()).collect();
        joined(&meshes)
    }

    /// Outlines of fixtures and table near what is shown.
    pub fn outlines(&self) -> Vec<[DVec3; 2]> {
        let both = self.fixtures().zip(self.shown().0);
        both.map_or_else(Vec::new, |(fixtures, part)| outlines(&fixtures, part))
    }

    /// What is wrong with fixtures and table, a sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Seconds that the sites took.
    pub(super) fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Whether the answers are by the mesh definition.
    fn is_by_mesh(&self) -> bool {
        self.blocking == Blocking::Part
    }

    /// Options of the mesh definition.
    pub fn options(&self) -> SurfaceOptions {
        self.request.options
    }

    /// The box of the whole part.
    pub(super) fn bounds(&self) -> Bounds {
        bounds_of(self.mesh.as_ref(), &self.sites)
    }

    /// Centroids of the triangles, if these block.
    pub(super) fn centroids(&self) -> Option<Vec<Vec3>> {
        let is_blocking = self.blocking == Blocking::Centroids;
        self.mesh.as_ref().filter(|_| is_blocking).map(Mesh::centroids)
    }

    /// What blocks, if points do.
    pub(super) fn points<'a>(&'a self, centroids: Option<&'a [Vec3]>) -> Obstacles<'a> {
        match (&self.more, centroids) {
            (Some(sites), _) => Obstacles::QueriesAnd(&sites.points),
            (None, Some(centroids)) => Obstacles::Centroids(centroids),
            (None, None) => Obstacles::Queries,
        }
    }

    /// Whether occlusion points are among the answers.
    pub(super) fn has_occlusion(&self) -> bool {
        !self.is_by_mesh() || self.options().occlusion
    }
}
