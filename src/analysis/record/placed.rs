//! Part, request and what stands around it: the same in every record.

use super::REMEDY;
use crate::analysis::fixtures::Fixture;
use crate::analysis::placed::Placed;
use crate::analysis::request::Request;
use crate::data::files::settings::Blocking;
use crate::data::files::vertices;
use crate::data::npz::{NpzReader, NpzWriter};
use crate::geom::file_vertices::SiteVertices;
use crate::geom::selection::Region;
use crate::geom::{Mesh, Sites};
use crate::tool::directions::Directions;
use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::borrow::Cow;
use std::path::Path;

/// What is no array.
#[derive(Serialize, Deserialize)]
pub struct OfPlaced<'a> {
    /// Its fixtures have their meshes in arrays.
    pub request: Cow<'a, Request>,
    fixtures: Vec<Cow<'a, str>>,
    blocking: Blocking,
    pub directions: Cow<'a, Directions>,
    warnings: Cow<'a, [String]>,
}

/// Whatever time the sites took.
impl PartialEq for Placed {
    fn eq(&self, other: &Self) -> bool {
        let Placed {
            request,
            blocking,
            directions,
            mesh,
            sites,
            vertices,
            region,
            more,
            warnings,
            seconds: _,
        } = self;
        (request, blocking, directions, mesh, sites)
            == (&other.request, &other.blocking, &other.directions, &other.mesh, &other.sites)
            && (vertices, region, more, warnings)
                == (&other.vertices, &other.region, &other.more, &other.warnings)
    }
}

impl<'a> OfPlaced<'a> {
    pub fn of(placed: &'a Placed) -> Self {
        let Placed { request, blocking, directions, warnings, .. } = placed;
        OfPlaced {
            request: Cow::Borrowed(request),
            fixtures: request.fixtures.iter().map(|fixture| Cow::from(&*fixture.name)).collect(),
            blocking: *blocking,
            directions: Cow::Borrowed(directions),
            warnings: Cow::Borrowed(warnings),
        }
    }

    /// With the arrays, and sites; none if these are on no triangles of the part.
    pub fn read(
        self,
        (path, npz): (&Path, &mut NpzReader),
        (sites, vertices): (Sites, Option<SiteVertices>),
    ) -> Result<Option<Placed>> {
        let mut request = self.request.into_owned();
        let fixture = |(k, name): (usize, Cow<str>)| {
            let mesh = read_mesh(path, npz, &format!("fixture_{k}_"))?;
            Ok(Fixture::new(name, mesh))
        };
        request.fixtures =
            self.fixtures.into_iter().enumerate().map(fixture).collect::<Result<_>>()?;
        let mesh = npz.has("vertices").then(|| read_mesh(path, npz, "")).transpose()?;
        let is_on = |mesh: &Mesh| {
            let n = mesh.triangles.len();
            sites.faces.len() == sites.len() && sites.faces.iter().all(|f| (*f as usize) < n)
        };
        if mesh.as_ref().is_some_and(|mesh| !is_on(mesh)) {
            return Ok(None);
        }
        let region = read_region(path, npz, &sites)?;
        let more = npz.has("more_points").then(|| read_sites(path, npz, "more_")).transpose()?;
        Ok(Some(Placed {
            request,
            blocking: self.blocking,
            directions: self.directions.into_owned(),
            mesh,
            sites,
            vertices,
            region,
            more,
            warnings: self.warnings.into_owned(),
            seconds: 0.0,
        }))
    }
}

/// As [`OfPlaced::read`] of a record that holds the sites, which are on the triangles of a part.
pub fn read_on_part(of: OfPlaced, path: &Path, npz: &mut NpzReader) -> Result<Placed> {
    let sites = read_sites(path, npz, "")?;
    let vertices = vertices::read(path, npz, &sites)?;
    let bad = |at: &str, found: &str| Error::file(path, at, found, REMEDY);
    let placed = of.read((path, npz), (sites, vertices))?;
    let placed = placed.ok_or_else(|| bad("faces", "other triangles than the part has"))?;
    placed.mesh().ok_or_else(|| bad("vertices", "a part without triangles"))?;
    Ok(placed)
}

/// As [`add`], and the sites.
pub fn add_on_part(path: &Path, npz: &mut NpzWriter, placed: &Placed) -> Result<()> {
    add(npz, placed);
    add_sites(npz, "", &placed.sites);
    add_vertices(path, npz, placed)
}

/// Which vertices of the part's file the sites are at, if they are at any.
pub fn add_vertices(path: &Path, npz: &mut NpzWriter, placed: &Placed) -> Result<()> {
    // The names of the arrays say what they are.
    vertices::add(path, npz, placed.vertices.as_ref(), (placed.sites.len(), &mut Value::Null))
}

/// Adds the meshes of part, fixtures and region, and further points.
pub fn add(npz: &mut NpzWriter, placed: &Placed) {
    let Placed { request, mesh, region, more, .. } = placed;
    if let Some(mesh) = mesh {
        add_mesh(npz, "", mesh);
    }
    for (k, fixture) in request.fixtures.iter().enumerate() {
        add_mesh(npz, &format!("fixture_{k}_"), &fixture.mesh);
    }
    if let Some((region, on_region)) = region {
        add_mesh(npz, "region_", &region.mesh);
        npz.array("region_faces", &[region.faces.len()], &region.faces);
        npz.array("region_site_faces", &[on_region.faces.len()], &on_region.faces);
    }
    if let Some(more) = more {
        add_sites(npz, "more_", more);
    }
}

pub fn add_mesh(npz: &mut NpzWriter, prefix: &str, mesh: &Mesh) {
    let flat: Vec<f64> = mesh.vertices.iter().flat_map(|v| v.to_array()).collect();
    npz.array(&format!("{prefix}vertices"), &[mesh.vertices.len(), 3], &flat);
    npz.array(
        &format!("{prefix}triangles"),
        &[mesh.triangles.len(), 3],
        mesh.triangles.as_flattened(),
    );
}

pub fn read_mesh(path: &Path, npz: &mut NpzReader, prefix: &str) -> Result<Mesh> {
    let (vertices, triangles) = (format!("{prefix}vertices"), format!("{prefix}triangles"));
    let flat = npz.f64s(&vertices, 3)?;
    let corners = npz.count_rows::<u32>(&triangles, 3)?;
    let (places, _) = flat.as_chunks::<3>();
    let (faces, _) = corners.as_chunks::<3>();
    let mesh = Mesh {
        vertices: places.iter().map(|p| DVec3::from_array(*p)).collect(),
        triangles: faces.to_vec(),
    };
    let named = |e: Error| Error::file(path, &*triangles, e.to_string(), REMEDY);
    mesh.check().map_err(named)?;
    Ok(mesh)
}

/// The region with the sites on it.
fn read_region(path: &Path, npz: &mut NpzReader, sites: &Sites) -> Result<Option<(Region, Sites)>> {
    if !npz.has("region_faces") {
        return Ok(None);
    }
    let mesh = read_mesh(path, npz, "region_")?;
    let (faces, of_sites) = (npz.counts("region_faces")?, npz.counts("region_site_faces")?);
    let region = Region::whole(mesh, faces)
        .ok_or_else(|| Error::file(path, "region_faces", "not one per triangle", REMEDY))?;
    let on_region = Sites { faces: of_sites, ..sites.clone() };
    let is_on = |f: &u32| (*f as usize) < region.faces.len();
    if !on_region.faces.iter().all(is_on) || region.on_part(&on_region) != *sites {
        let found = "other faces than those of the sites";
        return Err(Error::file(path, "region_site_faces", found, REMEDY));
    }
    Ok(Some((region, on_region)))
}

fn add_sites(npz: &mut NpzWriter, prefix: &str, sites: &Sites) {
    let name = |name: &str| format!("{prefix}{name}");
    npz.vectors(&name("points"), &sites.points).vectors(&name("normals"), &sites.normals);
    npz.array(&name("faces"), &[sites.faces.len()], &sites.faces);
}

fn read_sites(path: &Path, npz: &mut NpzReader, prefix: &str) -> Result<Sites> {
    let [points, normals, faces] = ["points", "normals", "faces"].map(|n| format!("{prefix}{n}"));
    let sites = Sites {
        points: npz.vectors(&points)?,
        normals: npz.vectors(&normals)?,
        faces: npz.counts(&faces)?,
    };
    let named = |e: Error| Error::file(path, points, e.to_string(), REMEDY);
    sites.check().map_err(named)?;
    Ok(sites)
}
