//! Reading a file of one holder, by what it begins with.

use super::holder::{Holder, of_library, of_profile, of_table};
use super::place::{json, text};
use super::unpack::{Content, content};
use super::{MissingParameters, hsmlib};
use crate::Result;
use crate::storage::input_file;
use std::path::Path;

/// Reads a holder: a Fusion 360 library (JSON or XML) with one holder (of its own or of its tools), a FreeCAD
/// holder (`.fcholder`), or a table with the columns `height`, `lower` and `upper` (diameters), mm.
///
/// # Errors
/// If the file is neither, holds several holders, or a segment is not possible.
pub fn read_holder(path: &Path, defaults: &MissingParameters) -> Result<Holder> {
    holder_from_bytes(&input_file::read(path, input_file::LIBRARY)?, path, defaults)
}

/// As [`read_holder`]; `path` only names the place in errors.
///
/// # Errors
/// As [`read_holder`].
pub fn holder_from_bytes(
    bytes: &[u8],
    path: &Path,
    defaults: &MissingParameters,
) -> Result<Holder> {
    let found = match content(bytes, path)? {
        Content::Text(text) => text,
        Content::Western(_) => return Err(text(bytes, path).expect_err("it is not UTF-8")),
        Content::Library(unpacked) => text(&unpacked, path)?.into_owned().into(),
    };
    match found.trim_start().chars().next() {
        Some('{' | '[') => {
            let value = json(&found, path)?;
            match value.get("profile") {
                Some(profile) => of_profile(&value, profile, path),
                None => of_library(&value, path, defaults),
            }
        }
        Some('<') => of_library(&hsmlib::library(&found, path)?, path, defaults),
        _ => of_table(&found, path),
    }
}
