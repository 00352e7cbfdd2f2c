//! SHA-256 of files and surfaces, by which a folder that was moved or changed is known.

use crate::Result;
use crate::geom::{Mesh, formats};

/// Of bytes, hexadecimal.
pub(in crate::data) fn hex(bytes: &[u8]) -> String {
    hmac_sha256::Hash::hash(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

/// Of the STL file of a mesh.
pub(super) fn of_mesh(mesh: &Mesh) -> Result<String> {
    Ok(hex(&formats::stl_bytes(mesh)?))
}
