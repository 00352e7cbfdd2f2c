//! Meshes of arrays and of files.

use super::status::{Answer, refused};
use crate::geom::formats::{self, KeepVertices, MeshOrCloud, PartFile, ReadOptions};
use crate::geom::preparation::{Preparation, Prepared};
use crate::geom::units::Unit;
use crate::geom::{Mesh, weld};
use crate::{Error, Result};
use glam::DVec3;
use std::path::Path;

/// Also mend small faults of the mesh.
pub const DM_REPAIR: u32 = 1;
/// Take a mesh that does not bound solids, with a notice.
pub const DM_FORCE: u32 = 2;

/// A mesh that can be labeled.
pub struct PartMesh {
    pub mesh: Mesh,
    /// Of its coordinates in those that were given, mm, if it was far from the origin.
    pub origin: Option<DVec3>,
    /// Of a file.
    pub name: Option<String>,
    /// What was changed or left out, a sentence each.
    pub notices: Vec<String>,
}

impl PartMesh {
    /// Of corners in rows of three coordinates, and of triangles in rows of three corners.
    pub fn of_arrays(
        vertices: &[[f64; 3]],
        triangles: &[[u32; 3]],
        unit: Option<&str>,
        flags: u32,
    ) -> Answer<Self> {
        let (scale, n) = (unit_of(unit)?.millimeters(), vertices.len());
        if vertices.is_empty() {
            return Err(refused("n_vertices", 0, "3 or more", "give at least one triangle"));
        }
        if triangles.is_empty() {
            return Err(refused("n_triangles", 0, "1 or more", "give at least one triangle"));
        }
        let is_finite = |row: &[f64; 3]| row.iter().all(|x| x.is_finite());
        if let Some(row) = vertices.iter().position(|row| !is_finite(row)) {
            let found = format!("{:?} in row {row}", vertices[row]);
            let remedy = "leave such rows out, or mend what made them";
            return Err(refused("vertices", found, "finite numbers", remedy));
        }
        if let Some(row) = triangles.iter().position(|row| row.iter().any(|&k| k as usize >= n)) {
            let found = format!("{:?} in row {row}", triangles[row]);
            let expected = format!("rows of vertices, from 0 to {}", n - 1);
            let remedy = "count vertices from 0, and give all of them";
            return Err(refused("triangles", found, expected, remedy));
        }
        let corners = vertices.iter().map(|row| DVec3::from_array(*row) * scale).collect();
        let mesh = Mesh::new(corners, triangles.to_vec())?;
        let mesh = weld::weld(&mesh, weld::DEFAULT_TOLERANCE)?;
        PartMesh::prepared(mesh, None, (Vec::new(), scale), flags)
    }

    /// Of a file: STL, OBJ, PLY or 3MF.
    pub fn read(path: &str, unit: Option<&str>, flags: u32) -> Answer<Self> {
        let (path, scale) = (Path::new(path), unit_of(unit)?.millimeters());
        let read = ReadOptions { scale, ..ReadOptions::default() };
        let PartFile { part, notices, .. } =
            formats::read_part_file(path, &read, KeepVertices::No)?;
        let MeshOrCloud::Mesh(mesh) = part else {
            let (found, remedy) = ("it holds points without triangles", "name a file of a mesh");
            return Err(Error::file(path, "content", found, remedy).into());
        };
        PartMesh::prepared(mesh, Some(path), (notices, scale), flags)
    }

    fn prepared(
        mesh: Mesh,
        path: Option<&Path>,
        (notices, scale): (Vec<String>, f64),
        flags: u32,
    ) -> Answer<Self> {
        check_flags(flags, DM_REPAIR | DM_FORCE)?;
        let prepare = Preparation {
            repair: flags & DM_REPAIR != 0,
            force: flags & DM_FORCE != 0,
            path: path.map(Path::to_path_buf),
            scale,
        };
        let Prepared { mesh, origin, notices } = prepare.mesh(mesh, notices)?;
        let name = path.and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        Ok(PartMesh { mesh, origin, name, notices })
    }
}

/// A unit by its symbol; mm without one.
pub fn unit_of(symbol: Option<&str>) -> Answer<Unit> {
    let unit: Option<Result<Unit>> = symbol.map(str::parse);
    unit.transpose().map(Option::unwrap_or_default).map_err(|_| {
        let found = format!("`{}`", symbol.unwrap_or_default());
        refused("unit", found, "mm, cm, m or in", "null is mm")
    })
}

/// An error if a flag is set that is not among those known.
pub fn check_flags(flags: u32, known: u32) -> Answer<()> {
    match flags & !known {
        0 => Ok(()),
        _ => {
            let remedy = "combine those of the header by |";
            Err(refused("flags", format!("{flags:#x}"), format!("bits of {known:#x}"), remedy))
        }
    }
}
