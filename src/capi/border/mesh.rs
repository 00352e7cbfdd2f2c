//! Meshes.

use super::super::context::dm_context;
use super::super::mesh::PartMesh;
use super::super::status::{dm_status, not_computed};
use super::raw::{Buffer, Place, optional_text, slice, text};
use super::{copy, copy_text, dm_handle, enter, make};
use std::ffi::c_char;

/// Makes a mesh of arrays and prepares it as the commands do: near corners are joined, a mesh that faces inward is
/// turned, bodies that overlap are joined; what does not bound solids is refused.
///
/// vertices: rows of x, y, z. triangles: rows of three vertices from 0 on, counter-clockwise seen from outside.
/// unit: "mm", "cm", "m" or "in", of the vertices; null is mm. flags: 0, or DM_REPAIR and DM_FORCE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_mesh_new(
    context: *mut dm_context,
    vertices: *const f64,
    n_vertices: usize,
    triangles: *const u32,
    n_triangles: usize,
    unit: *const c_char,
    flags: u32,
    mesh: *mut dm_handle,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header. Three numbers in a row have no padding between them.
    unsafe {
        make(context, ("mesh", mesh), |_| {
            let vertices = slice("vertices", vertices.cast::<[f64; 3]>(), n_vertices)?;
            let triangles = slice("triangles", triangles.cast::<[u32; 3]>(), n_triangles)?;
            PartMesh::of_arrays(vertices, triangles, optional_text("unit", unit)?, flags)
        })
    }
}

/// Reads a mesh of a file, STL, OBJ, PLY or 3MF, and prepares it as dm_mesh_new.
///
/// unit: that of the file's numbers; null is mm, or as a 3MF states.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_mesh_read(
    context: *mut dm_context,
    path: *const c_char,
    unit: *const c_char,
    flags: u32,
    mesh: *mut dm_handle,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        make(context, ("mesh", mesh), |_| {
            PartMesh::read(text("path", path)?, optional_text("unit", unit)?, flags)
        })
    }
}

/// Copies the corners as they were prepared, mm: rows of x, y, z. n and needed count numbers, three of a corner.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_mesh_vertices(
    context: *mut dm_context,
    mesh: dm_handle,
    buffer: *mut f64,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        copy(context, mesh, buffer, |of: &PartMesh| {
            Ok(of.mesh.vertices.iter().flat_map(|v| v.to_array()).collect())
        })
    }
}

/// Copies the triangles as they were prepared: rows of three corners. n and needed count numbers, three of a triangle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_mesh_triangles(
    context: *mut dm_context,
    mesh: dm_handle,
    buffer: *mut u32,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        copy(context, mesh, buffer, |of: &PartMesh| Ok(of.mesh.triangles.as_flattened().into()))
    }
}

/// The origin of the mesh's coordinates in those that were given, three numbers, mm: DM_NOT_COMPUTED if they are the
/// same. They differ of a part that is far from the origin.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_mesh_origin(
    context: *mut dm_context,
    mesh: dm_handle,
    origin_mm: *mut f64,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        enter(context, |context| {
            let place = Place::new("origin_mm", origin_mm.cast::<[f64; 3]>())?;
            let origin = context.get::<PartMesh>(mesh)?.origin;
            let none = || not_computed("another origin", "the coordinates are those given");
            place.put(origin.ok_or_else(none)?.to_array());
            Ok(())
        })
    }
}

/// Copies what was changed of the mesh or left out, a line each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_mesh_notices(
    context: *mut dm_context,
    mesh: dm_handle,
    buffer: *mut c_char,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    let buffer = Buffer { buffer, n, needed };
    // SAFETY: the caller keeps the contract of the header.
    unsafe { copy_text(context, mesh, buffer, |of: &PartMesh| Ok(of.notices.join("\n"))) }
}
