//! Mesh and point-cloud files: STL, OBJ, PLY, 3MF and NPZ in, STL out.
//!
//! STL and OBJ are read here, because the position of a fault in the file belongs into the message and
//! no library reports it; PLY, NPZ and 3MF are read through `ply-rs-bw`, `npyz` and `quick-xml`, behind guards
//! against headers that promise more than the file holds. Memory stays within a small multiple of the
//! file's size, whatever a header claims. Every reader also takes bytes, for tests and fuzzing.

mod format;
pub(crate) mod npz;
mod obj;
mod ply;
mod polygon;
#[cfg(feature = "step")]
mod step;
mod stl;
mod strip;
mod text;
mod threemf;

pub use format::Format;

use super::file_vertices::FileVertices;
use super::{Mesh, Sites, weld};
use crate::exec::memory;
use crate::storage::{atomic_file, input_file};
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use std::path::Path;

/// Bytes while a mesh is read, welded and checked, or a cloud read, for each byte of its file. Files of real parts take
/// 6; text of the shortest numbers 14.
const BYTES_OF_BYTE: u64 = 16;
/// Largest coordinate that is accepted, mm: far beyond any part, and its cube is still far from
/// the largest number, so no later computation overflows.
const MAX_COORDINATE: f64 = 1e12;
/// Shortest normal that still has a direction.
const MIN_NORMAL: f64 = 1e-12;

/// Chord error of STEP files if none is given, mm.
#[cfg(feature = "step")]
#[doc(hidden)] // of the program
pub const DEFAULT_CHORD_MM: f64 = 0.02;

/// How the numbers of a mesh file become a mesh.
///
/// ```
/// let inches = deepmill::geom::formats::ReadOptions::default().with_scale(25.4);
/// assert_eq!(inches.scale, 25.4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// Millimeters per unit of the file; positive. A 3MF says its unit: for it, a factor on top.
    pub scale: f64,
    /// Corners closer than this fraction of the bounding box's diagonal become one; 0 joins only
    /// equal ones. See [`weld::DEFAULT_TOLERANCE`].
    pub weld: f64,
    /// Of STEP files: how far triangles may be from the surfaces that they stand for, mm.
    #[cfg(feature = "step")]
    pub chord_mm: f64,
}

setters!(ReadOptions {
    with_scale(scale: f64),
    with_weld(weld: f64),
    #[cfg(feature = "step")]
    with_chord_mm(chord_mm: f64),
});

impl ReadOptions {
    /// These factor and fraction, all else as by default.
    pub fn new(scale: f64, weld: f64) -> Self {
        ReadOptions {
            scale,
            weld,
            #[cfg(feature = "step")]
            chord_mm: DEFAULT_CHORD_MM,
        }
    }
}

impl Default for ReadOptions {
    /// Millimeters, default weld.
    fn default() -> Self {
        ReadOptions::new(1.0, weld::DEFAULT_TOLERANCE)
    }
}

/// What a command can work on: a mesh, or sites that someone else has sampled.
#[derive(Debug, Clone, PartialEq)]
pub enum MeshOrCloud {
    /// A surface of triangles, corners welded.
    Mesh(Mesh),
    /// Points with unit normals.
    Cloud(Sites),
}

impl From<Mesh> for MeshOrCloud {
    fn from(mesh: Mesh) -> Self {
        MeshOrCloud::Mesh(mesh)
    }
}

impl From<Sites> for MeshOrCloud {
    fn from(cloud: Sites) -> Self {
        MeshOrCloud::Cloud(cloud)
    }
}

/// Reads a mesh or a cloud, whichever `path` holds: an NPZ, or a PLY without faces of any kind but with
/// normals, is a cloud.
///
/// # Errors
/// As [`read_mesh`] and [`read_cloud`].
pub fn read_part(path: &Path, options: &ReadOptions) -> Result<MeshOrCloud> {
    read_part_file(path, options, KeepVertices::No).map(|file| file.part)
}

/// A part as it was read.
#[derive(Debug, Clone, PartialEq)]
#[doc(hidden)] // of the program
pub struct PartFile {
    /// The part.
    pub part: MeshOrCloud,
    /// What was left out of the file, one sentence each: objects of a 3MF that are no part of the solid (supports,
    /// modifiers, items that are not printed).
    pub notices: Vec<String>,
    /// The vertices of the file, if they are kept and the format lists vertices; an STL does not.
    pub vertices: Option<FileVertices>,
}

/// [`read_part`], with what was left out and the vertices of the file.
///
/// # Errors
/// As [`read_part`].
#[doc(hidden)] // of the program
pub fn read_part_file(path: &Path, options: &ReadOptions, keep: KeepVertices) -> Result<PartFile> {
    let format = Format::of(path)?;
    let bytes = input_file::read(path, input_file::DATA)?;
    let cloud = match format {
        Format::Npz => true,
        Format::Ply => ply::is_cloud(&bytes, path)?,
        _ => false,
    };
    if cloud {
        let part = MeshOrCloud::Cloud(cloud_from_bytes(&bytes, format, path, options.scale)?);
        return Ok(PartFile { part, notices: Vec::new(), vertices: None });
    }
    let (mesh, notices, vertices) = mesh_of(&bytes, format, path, options, keep)?;
    Ok(PartFile { part: MeshOrCloud::Mesh(mesh), notices, vertices })
}

/// Whether [`PartFile::vertices`] is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[doc(hidden)] // of the program
pub enum KeepVertices {
    /// It is.
    Yes,
    /// It is not.
    No,
}

/// Reads a mesh: STL, OBJ, PLY or 3MF, by the ending of `path`. Corners are scaled and welded; no
/// triangle is dropped or turned, and polygons are cut into triangles.
///
/// # Errors
/// If the file cannot be read, is not what its ending says, or holds no triangle; the message names
/// the file, the line or byte, and what to do. Whether the mesh is closed is checked not here but by
/// [`super::check`].
pub fn read_mesh(path: &Path, options: &ReadOptions) -> Result<Mesh> {
    read_mesh_with_notices(path, options).map(|(mesh, _)| mesh)
}

/// [`read_mesh`], with what was left out of the file as [`PartFile::notices`].
///
/// # Errors
/// As [`read_mesh`].
#[doc(hidden)] // of the program
pub fn read_mesh_with_notices(path: &Path, options: &ReadOptions) -> Result<(Mesh, Vec<String>)> {
    let format = Format::of(path)?;
    mesh_with_notices(&input_file::read(path, input_file::DATA)?, format, path, options)
}

/// [`read_mesh`] from memory; `path` only serves messages.
///
/// # Errors
/// As [`read_mesh`].
pub fn mesh_from_bytes(
    bytes: &[u8],
    format: Format,
    path: &Path,
    options: &ReadOptions,
) -> Result<Mesh> {
    mesh_with_notices(bytes, format, path, options).map(|(mesh, _)| mesh)
}

fn mesh_with_notices(
    bytes: &[u8],
    format: Format,
    path: &Path,
    options: &ReadOptions,
) -> Result<(Mesh, Vec<String>)> {
    let (mesh, notices, _) = mesh_of(bytes, format, path, options, KeepVertices::No)?;
    Ok((mesh, notices))
}

fn mesh_of(
    bytes: &[u8],
    format: Format,
    path: &Path,
    options: &ReadOptions,
    keep: KeepVertices,
) -> Result<(Mesh, Vec<String>, Option<FileVertices>)> {
    check_options(options)?;
    refuse_empty(bytes, path)?;
    if let Some(kind) = input_file::foreign(bytes).filter(|_| format != Format::ThreeMf) {
        return Err(kind.error(path, "a mesh"));
    }
    let remedy = "export the part with fewer triangles";
    require_memory("reading the mesh", bytes.len() as u64, path, remedy)?;
    let mut notices = Vec::new();
    let mut mesh = match format {
        Format::Stl => stl::read(bytes, path)?,
        Format::Obj => obj::read(bytes, path)?,
        Format::Ply => ply::read_mesh(bytes, path)?,
        Format::ThreeMf => {
            let (mesh, left_out) = threemf::read(bytes, path)?;
            notices = left_out;
            mesh
        }
        #[cfg(feature = "step")]
        Format::Step => {
            let (mesh, left_out) = step::read(bytes, path, options.chord_mm / options.scale)?;
            notices = left_out;
            mesh
        }
        Format::Npz => {
            return Err(Error::file(
                path,
                "file name",
                "an NPZ archive holds points, not a mesh",
                "give a .stl, .obj, .ply or .3mf file here",
            ));
        }
    };
    if mesh.triangles.is_empty() {
        return Err(Error::file(path, "faces", "there is no triangle", "export the part again"));
    }
    for vertex in &mut mesh.vertices {
        *vertex *= options.scale;
    }
    check_size(mesh.vertices.iter().copied(), path)?;
    let (welded, of_vertex) = weld::weld_with_map(&mesh, options.weld)?;
    let lists_vertices = matches!(format, Format::Obj | Format::Ply | Format::ThreeMf);
    let is_kept = keep == KeepVertices::Yes && lists_vertices;
    let vertices = is_kept.then(|| FileVertices::new(&welded, of_vertex));
    Ok((welded, notices, vertices))
}

fn require_memory(operation: &'static str, n_bytes: u64, path: &Path, remedy: &str) -> Result<()> {
    let needed = n_bytes.saturating_mul(BYTES_OF_BYTE);
    memory::require(operation, needed, format!("{}: {remedy}", path.display()))
}

/// Reads points with normals, as they are in the file (millimeters): a PLY with the properties
/// `x y z nx ny nz`, or an NPZ with arrays `points` and `normals` of shape `[n, 3]`. Normals are
/// brought to unit length.
///
/// # Errors
/// If the file cannot be read or is not of that form, normals are missing, a number is not finite,
/// or a normal is zero; if it does not fit into the memory.
pub fn read_cloud(path: &Path) -> Result<Sites> {
    let format = Format::of(path)?;
    cloud_from_bytes(&input_file::read(path, input_file::DATA)?, format, path, 1.0)
}

/// [`read_cloud`] from memory, with `scale` millimeters per unit; `path` only serves messages.
///
/// # Errors
/// As [`read_cloud`].
pub fn cloud_from_bytes(bytes: &[u8], format: Format, path: &Path, scale: f64) -> Result<Sites> {
    check_options(&ReadOptions { scale, ..ReadOptions::default() })?;
    refuse_empty(bytes, path)?;
    require_memory("reading the cloud", bytes.len() as u64, path, "export fewer points")?;
    let (mut points, normals) = match format {
        Format::Ply => ply::read_cloud(bytes, path)?,
        Format::Npz => npz::read_cloud(bytes, path)?,
        _ => {
            return Err(Error::file(
                path,
                "file name",
                "a cloud of points with normals cannot come from this format",
                "give a .ply or .npz file here, or use the file as a mesh",
            ));
        }
    };
    if points.is_empty() {
        return Err(Error::file(path, "points", "there are none", "export the cloud again"));
    }
    for point in &mut points {
        *point *= scale;
    }
    check_size(points.iter().copied(), path)?;
    let unit = |(i, n): (usize, &DVec3)| {
        unit_normal(*n).ok_or_else(|| {
            Error::file(
                path,
                format!("normal {i}"),
                format!("({}, {}, {}) has no direction", n.x, n.y, n.z),
                "give every point a finite normal that is not zero",
            )
        })
    };
    Ok(Sites {
        normals: normals.iter().enumerate().map(unit).collect::<Result<_>>()?,
        points: points.iter().map(|p| p.as_vec3()).collect(),
        faces: Vec::new(),
    })
}

/// Writes a binary STL, coordinates rounded to f32, facet normals from the corners.
///
/// # Errors
/// If the system refuses, or the mesh has more triangles than the format can count.
pub fn write_stl(path: &Path, mesh: &Mesh) -> Result<()> {
    stl::check_count(mesh)?;
    atomic_file::write_atomic(path, |writer| stl::write(writer, mesh))
}

/// The bytes that [`write_stl`] writes.
///
/// # Errors
/// If the mesh has more triangles than the format can count.
pub(crate) fn stl_bytes(mesh: &Mesh) -> Result<Vec<u8>> {
    stl::check_count(mesh)?;
    let mut bytes = Vec::new();
    stl::write(&mut bytes, mesh).map_err(|e| Error::write("memory", e))?;
    Ok(bytes)
}

fn refuse_empty(bytes: &[u8], path: &Path) -> Result<()> {
    if bytes.is_empty() {
        return Err(Error::file(path, "byte 0", "the file is empty", "export the part again"));
    }
    Ok(())
}

fn check_options(options: &ReadOptions) -> Result<()> {
    if !(options.scale > 0.0 && options.scale <= 1e9) {
        return Err(Error::argument(
            "scale",
            options.scale,
            "a number above 0 and up to 1e9",
            "1 is millimeters, 25.4 inches",
        ));
    }
    if !(0.0..=0.1).contains(&options.weld) {
        return Err(Error::argument(
            "weld",
            options.weld,
            "a fraction of the diagonal from 0 to 0.1",
            format!("the default is {:e}", weld::DEFAULT_TOLERANCE),
        ));
    }
    #[cfg(feature = "step")]
    if !(options.chord_mm > 0.0 && options.chord_mm.is_finite()) {
        let remedy = format!("the default is {DEFAULT_CHORD_MM}");
        return Err(Error::argument("chord", options.chord_mm, "a length above 0, in mm", remedy));
    }
    Ok(())
}

fn check_size(mut points: impl Iterator<Item = DVec3>, path: &Path) -> Result<()> {
    match points.position(|p| p.abs().max_element() > MAX_COORDINATE) {
        None => Ok(()),
        Some(i) => Err(Error::file(
            path,
            format!("vertex {i}"),
            format!("a coordinate is beyond {MAX_COORDINATE:e} mm"),
            "check the unit and the export; such numbers usually mean a damaged file",
        )),
    }
}

fn unit_normal(normal: DVec3) -> Option<Vec3> {
    // Scaled first, so that neither very long nor very short normals lose their direction.
    let largest = normal.abs().max_element();
    (normal.is_finite() && largest > MIN_NORMAL).then(|| (normal / largest).normalize().as_vec3())
}

/// Text of unknown origin, fit for a one-line message.
fn one_line(text: impl std::fmt::Display) -> String {
    const LIMIT: usize = 120;
    let words: Vec<String> = text
        .to_string()
        .split(|c: char| c.is_whitespace() || c.is_control())
        .filter(|w| !w.is_empty())
        .take(LIMIT)
        .map(str::to_owned)
        .collect();
    let line = words.join(" ");
    if line.chars().count() <= LIMIT {
        return line;
    }
    line.chars().take(LIMIT).chain("…".chars()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_of_any_length_keep_their_direction() {
        assert_eq!(unit_normal(DVec3::new(0.0, 3e200, 0.0)), Some(Vec3::Y));
        assert_eq!(unit_normal(DVec3::new(1e-9, 0.0, 0.0)), Some(Vec3::X));
        assert_eq!(unit_normal(DVec3::ZERO), None);
        assert_eq!(unit_normal(DVec3::new(f64::NAN, 1.0, 0.0)), None);
        assert_eq!(unit_normal(DVec3::new(f64::INFINITY, 1.0, 0.0)), None);
    }

    #[test]
    fn foreign_text_becomes_one_short_line() {
        assert_eq!(one_line("a\n\tb\u{7}  c"), "a b c");
        assert_eq!(one_line("x".repeat(500)).chars().count(), 121);
    }

    #[test]
    fn endings_decide_the_format_whatever_their_case() {
        assert_eq!(Format::of(Path::new("a/B.STL")).unwrap(), Format::Stl);
        assert!(Format::of(Path::new("a.step")).unwrap_err().to_string().contains("export it"));
        assert!(Format::of(Path::new("a")).is_err());
    }

    #[test]
    fn a_cube_goes_through_a_file_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cube.stl");
        let cube = crate::geom::solids::cuboid(DVec3::new(1.0, 2.0, 3.0));
        write_stl(&path, &cube).unwrap();
        let back = read_mesh(&path, &ReadOptions::default()).unwrap();
        assert_eq!((back.vertices.len(), back.triangles.len()), (8, 12));
        assert_eq!(back.volume(), 6.0);
        let inch = ReadOptions { scale: 25.4, ..ReadOptions::default() };
        assert_eq!(read_mesh(&path, &inch).unwrap().bounds().unwrap().1.z, 3.0 * 25.4);
    }
}
