//! The query that a file of labels answers: part, obstacles, tool, directions and tolerance; a single site can be
//! labeled again and explained.
//!
//! `label` writes the surface beside its labels ([`SURFACE`], and [`FIXTURES`] if there are any) and their SHA-256 into
//! `settings.surface`, so that a folder that was moved or changed is known as such.

mod stated;

use super::LabelFile;
use super::hash;
use super::settings::AnalysisSettings;
use super::tools::Tool;
use crate::access::surface::explain::{Explanation, Query, Remedies, explain_among_points};
use crate::access::surface::{PartChange, SurfaceOptions, TriangleObstacles, WitnessPose};
use crate::access::{self, LabelOptions, Obstacles, Queries, bottom_sites};
use crate::answers::{Definition, SiteAnswer};
use crate::geom::sites::nearest_in_triangle;
use crate::geom::{Mesh, Sites};
use crate::storage::input_file;
use crate::tool::directions::Directions;
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use stated::{LABEL_AGAIN, Stated};
use std::path::Path;

/// The surface that the sites lie on, mm, beside the labels or, of several tools, in the folder above.
pub const SURFACE: &str = "part.stl";
/// Triangles that block beside the part's: fixtures and table, as they were used.
pub const FIXTURES: &str = "fixtures.stl";

/// All triangles of some meshes as one mesh; `None` if there are none.
pub fn joined(meshes: &[Mesh]) -> Option<Mesh> {
    let mut all = Mesh::default();
    for mesh in meshes {
        let first = all.vertices.len() as u32;
        all.vertices.extend(&mesh.vertices);
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    (!all.triangles.is_empty()).then_some(all)
}

/// Passes the surface that answers are about: the one whose SHA-256 they state, or if they state none, one that has the
/// sites on their triangles. `path` is that of the surface, `of` that of the answers; `is_own` if the surface was
/// written with answers, and not the file of a part.
///
/// # Errors
/// If it is another one: what is drawn on it would be said of another part.
#[doc(hidden)] // of the program
pub fn require_surface(
    (mesh, path, is_own): (&Mesh, &Path, bool),
    (sites, settings, of): (&Sites, &AnalysisSettings, &Path),
) -> Result<()> {
    if let Some(stated) = settings.surface.as_ref().and_then(|of| of.sha256.as_deref()) {
        // Reading may join corners of a file that this crate has written.
        let hash = match is_own {
            true => hash::hex(&input_file::read(path, input_file::DATA)?),
            false => hash::of_mesh(mesh)?,
        };
        return if hash == stated { Ok(()) } else { Err(another(path, of, "SHA-256")) };
    }
    let (low, high) = mesh.bounds().unwrap_or_default();
    let within_mm = OFF_SURFACE * low.abs().max(high.abs()).max_element();
    for (i, (point, &face)) in sites.points.iter().zip(&sites.faces).enumerate() {
        let face = face as usize;
        let is_there = face < mesh.triangles.len()
            && point.as_dvec3().distance(nearest_in_triangle(point.as_dvec3(), mesh.corners(face)))
                <= within_mm;
        if !is_there {
            return Err(another(path, of, format!("triangle {face}, of site {i}")));
        }
    }
    Ok(())
}

/// The error that a file is not the surface of answers, as a place of it says.
fn another(path: &Path, of: &Path, place: impl Into<String>) -> Error {
    let found = format!("it is not the surface of {}", of.display());
    Error::file(path, place, found, "compute the answers again, or restore the file")
}

/// How far a site may be off its triangle by roundings, as a share of the greatest coordinate.
const OFF_SURFACE: f64 = 1e-5;

/// Labels, and everything that they rest on.
#[derive(Debug)]
pub struct LabelQuery {
    /// The labels.
    pub file: LabelFile,
    /// By which definition they are.
    pub definition: Definition,
    /// The tool.
    pub tool: Tool,
    /// The directions.
    pub directions: Directions,
    /// Tolerance and search, for triangles.
    pub options: SurfaceOptions,
    /// Which changed tools are worth a proposal.
    pub remedies: Remedies,
    /// The surface; none for a cloud.
    pub mesh: Option<Mesh>,
    /// Fixtures and table.
    pub fixtures: Option<Mesh>,
    barrier: Barrier,
    /// Whether the obstacles are centroids of triangles.
    pub(crate) centroids_block: bool,
}

#[derive(Debug)]
enum Barrier {
    Triangles(TriangleObstacles),
    /// The sites, then further points of the surface; or centroids of triangles.
    Points(Vec<Vec3>),
}

impl LabelQuery {
    /// Reads `labels.npz` and what lies beside it; `mesh` is the surface, if it is not taken from there.
    ///
    /// # Errors
    /// If a file is not what `label` writes, the surface is missing or another one, or the labels are of a version that
    /// did not state what is needed; the message says what to do.
    pub fn read(labels: &Path, mesh: Option<Mesh>) -> Result<Self> {
        Self::with(LabelFile::read(labels)?, labels, (mesh, None))
    }

    /// Of labels in memory, with the surface and what blocks beside it; `name` is for messages.
    ///
    /// # Errors
    /// If the mesh is not that of the labels, or as [`LabelQuery::read`].
    #[cfg(feature = "python")]
    pub(crate) fn of(
        file: LabelFile,
        name: &Path,
        (mesh, fixtures): (Option<Mesh>, Option<Mesh>),
    ) -> Result<Self> {
        Self::with(file, name, (mesh, Some(fixtures)))
    }

    /// Of labels; what is not given lies beside their file.
    fn with(
        file: LabelFile,
        path: &Path,
        (mesh, fixtures): (Option<Mesh>, Option<Option<Mesh>>),
    ) -> Result<Self> {
        let stated = Stated { path, provenance: &file.provenance };
        let (definition, tool, directions) =
            (stated.definition()?, stated.tool()?, stated.directions()?);
        let part_itself = definition == Definition::Part;
        let options = if part_itself { stated.options()? } else { SurfaceOptions::default() };
        let mesh = stated.mesh(mesh, !file.sites.faces.is_empty() || part_itself)?;
        let n_triangles = mesh.as_ref().map_or(0, |mesh| mesh.triangles.len());
        if let Some(face) = file.sites.faces.iter().find(|face| **face as usize >= n_triangles) {
            let found = format!("a site is on triangle {face} of {n_triangles}");
            return Err(stated.fault("faces", found, LABEL_AGAIN));
        }
        let fixtures = match fixtures {
            Some(given) => given,
            None if part_itself => stated.fixtures()?,
            None => None,
        };
        let barrier = match (&mesh, part_itself) {
            (Some(mesh), true) => {
                let fixtures: Vec<Mesh> = fixtures.iter().cloned().collect();
                Barrier::Triangles(TriangleObstacles::new(mesh, &fixtures)?)
            }
            _ => {
                let more = stated.further_points(mesh.as_ref())?;
                Barrier::Points(match mesh.as_ref().filter(|_| stated.centroids_block()) {
                    Some(mesh) => mesh.centroids(),
                    None => file.sites.points.iter().copied().chain(more).collect(),
                })
            }
        };
        file.sites.check()?;
        let (remedies, centroids_block) = (stated.remedies(), stated.centroids_block());
        Ok(LabelQuery {
            centroids_block,
            definition,
            tool,
            directions,
            options,
            remedies,
            mesh,
            fixtures,
            barrier,
            file,
        })
    }

    /// The site nearest to a place, and its distance, mm; the first among equals.
    ///
    /// # Errors
    /// If the place is not finite, or there are no sites.
    pub fn nearest_site(&self, at: DVec3) -> Result<(usize, f64)> {
        let distance = |i: usize| self.file.sites.points[i].as_dvec3().distance(at);
        let all = (0..self.file.sites.len()).map(|i| (i, distance(i)));
        let nearest = all.reduce(|best, next| if next.1 < best.1 { next } else { best });
        nearest.filter(|(_, distance)| distance.is_finite()).ok_or_else(|| {
            let remedy = "give a place of the part in mm";
            Error::argument("place", at, "three finite coordinates, of a part with sites", remedy)
        })
    }

    /// Whether the published definition's bottom rule labels a site accessible, whatever collides.
    ///
    /// # Panics
    /// If there is no such site.
    pub fn is_at_bottom(&self, site: usize) -> bool {
        let bottom_mm = self.file.provenance.settings.bottom_mm;
        let points = &self.file.sites.points;
        bottom_mm.is_some_and(|bottom_mm| bottom_sites(points, bottom_mm)[site])
    }

    /// Why a site can or cannot be reached.
    ///
    /// # Errors
    /// If there is no such site, or as [`TriangleObstacles::explain`].
    pub fn explain(&self, site: usize) -> Result<Explanation> {
        let n = self.file.sites.len();
        if site >= n {
            let expected = format!("below {n}, the number of sites");
            return Err(Error::argument("site", site, expected, "rows count from 0"));
        }
        let Sites { points, normals, .. } = &self.file.sites;
        let query = Query {
            site: points[site],
            normal: normals[site],
            tool: &self.tool.assembly,
            clearance_mm: self.tool.clearance_mm,
            directions: &self.directions,
            options: &self.options,
            witness: self.witness(site),
            remedies: self.remedies,
        };
        match &self.barrier {
            Barrier::Triangles(triangles) => triangles.explain(&query),
            Barrier::Points(points) => {
                let own = (!self.centroids_block).then_some(site);
                explain_among_points(points, own, &query)
            }
        }
    }

    /// The tool of labels that were read at a path.
    ///
    /// # Errors
    /// If they do not state it.
    pub(crate) fn tool_of(file: &LabelFile, path: &Path) -> Result<Tool> {
        Stated { path, provenance: &file.provenance }.tool()
    }

    /// By the published definition, the pose of `tool`, with which the labels were made, along the first free direction
    /// of each site, if they state their directions.
    pub(crate) fn poses_among_points(file: &LabelFile, tool: &Tool) -> Vec<Option<WitnessPose>> {
        let stated = Stated { path: Path::new(""), provenance: &file.provenance };
        let Ok(directions) = stated.directions() else { return Vec::new() };
        let (sites, cutter) = (&file.sites, &tool.cutter);
        let pose = |(i, row): (usize, &Option<u32>)| {
            let direction = *directions.vectors().get(row.as_ref().copied()? as usize)?;
            let (normal, axis) = (sites.normals.get(i)?.as_dvec3(), direction.as_dvec3());
            let across = normal - axis * normal.dot(axis);
            // As in `access::predicate`: a flat end is centered where the normal is along the axis.
            let side = if across.length() < 1e-6 { 0.0 } else { cutter.side_mm() };
            let corner = cutter.corner_mm();
            let reference = sites.points[i].as_dvec3() + normal * corner;
            let reference = reference + across.normalize_or_zero() * side;
            let tip_mm = reference - axis * (corner - cutter.allowance_mm());
            Some(WitnessPose { direction, tip_mm })
        };
        file.labels.witness.iter().take(sites.len()).enumerate().map(pose).collect()
    }

    /// What blocks, if that is triangles.
    pub(crate) fn triangles(&self) -> Option<&TriangleObstacles> {
        match &self.barrier {
            Barrier::Triangles(triangles) => Some(triangles),
            Barrier::Points(_) => None,
        }
    }

    /// Changes of the part with which the tool reaches most of these sites; none are looked for where points are the
    /// obstacles.
    ///
    /// # Errors
    /// As [`TriangleObstacles::part_changes`].
    ///
    /// # Panics
    /// If a member is no site.
    #[doc(hidden)] // of the program and explanations
    pub fn part_changes(&self, members: &[u32]) -> Result<Vec<PartChange>> {
        let Some(triangles) = self.triangles() else { return Ok(Vec::new()) };
        let (of, held) =
            ((&self.file.sites, members), (&self.tool.assembly, self.tool.clearance_mm));
        triangles.part_changes(of, held, &self.directions, &self.options)
    }

    /// Whether another tool may stand at a site, by the directions and options of the labels.
    ///
    /// # Errors
    /// As [`LabelQuery::explain`].
    ///
    /// # Panics
    /// If there is no such site.
    pub fn is_reached_by(&self, site: usize, tool: &Tool) -> Result<bool> {
        let of_site = self.file.sites.subset(&[site]);
        match &self.barrier {
            Barrier::Triangles(triangles) => {
                let options = SurfaceOptions {
                    counts: false,
                    occlusion: false,
                    n_samples: 0,
                    ..self.options
                };
                let labels =
                    triangles.surface_labels(&of_site, &tool.cutter, &self.directions, &options)?;
                Ok(labels.answers[0] == SiteAnswer::Accessible)
            }
            Barrier::Points(points) => {
                let is_other = |k: usize| self.centroids_block || k != site;
                let others = points.iter().enumerate().filter(|(k, _)| is_other(*k));
                let others: Vec<Vec3> = others.map(|(_, p)| *p).collect();
                let options = LabelOptions { occlusion: false, ..LabelOptions::default() };
                let queries = Queries::Sites(&of_site);
                let obstacles = Obstacles::Points(&others);
                let labels =
                    access::label(queries, obstacles, &tool.cutter, &self.directions, &options)?;
                Ok(!labels.answers.is_inaccessible(0))
            }
        }
    }

    /// The direction in which the file says that the tool may stand at a site.
    pub fn witness(&self, site: usize) -> Option<Vec3> {
        let labels = &self.file.labels;
        let of_set = |k: &u32| self.directions.vectors().get(*k as usize).copied();
        match &labels.surface {
            Some(_) => labels.answers.witness.get(site).copied().flatten(),
            None => labels.witness.get(site).and_then(|k| k.as_ref()).and_then(of_set),
        }
    }

    /// Number of triangles of the part; beyond these are the fixtures'.
    pub fn n_triangles(&self) -> usize {
        self.mesh.as_ref().map_or(0, |mesh| mesh.triangles.len())
    }
}
