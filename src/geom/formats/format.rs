//! Which formats there are, told by the endings of names.

use crate::{Error, Result};
use std::path::Path;

/// File formats that can hold a mesh or a cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// STL, ASCII or binary.
    Stl,
    /// Wavefront OBJ.
    Obj,
    /// PLY, ASCII or binary.
    Ply,
    /// 3MF.
    ThreeMf,
    /// NumPy archive with `points` and `normals`.
    Npz,
    /// STEP (ISO 10303-21).
    #[cfg(feature = "step")]
    Step,
}

impl Format {
    /// The format that the ending of `path` stands for.
    ///
    /// # Errors
    /// If it stands for none; the message lists those that can be read.
    pub fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("stl") => Ok(Format::Stl),
            Some("obj") => Ok(Format::Obj),
            Some("ply") => Ok(Format::Ply),
            Some("3mf") => Ok(Format::ThreeMf),
            Some("npz") => Ok(Format::Npz),
            Some(ending @ ("step" | "stp" | "iges" | "igs")) => exchange(ending, path),
            _ => Err(no_format(path)),
        }
    }
}

/// What to say of a path without a known ending: it may be misspelled, or a folder.
fn no_format(path: &Path) -> Error {
    match std::fs::metadata(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Error::read(path, error),
        Ok(found) if found.is_dir() => Error::file(
            path,
            "file name",
            "a folder, where a file is expected",
            "name a file in it",
        ),
        _ => Error::file(
            path,
            "file name",
            "its ending names no format that can be read",
            "use .stl, .obj, .ply or .3mf for a mesh, .ply or .npz for a cloud",
        ),
    }
}

/// The format of a CAD exchange file.
fn exchange(ending: &str, path: &Path) -> Result<Format> {
    let found = "a CAD exchange file has no triangles";
    let remedy = "export it as STL in millimeters from the CAD program (docs/meshes.md says how)";
    let is_step = matches!(ending, "step" | "stp");
    #[cfg(feature = "step")]
    if is_step {
        return Ok(Format::Step);
    }
    let remedy = match is_step {
        true => format!("{remedy}, or build deepmill with the feature `step`"),
        false => remedy.into(),
    };
    Err(Error::file(path, "file name", found, remedy))
}
