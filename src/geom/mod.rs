//! Triangles and points, in millimetres: meshes, their files and faults, and sample sites.

pub mod check;
#[cfg(feature = "formats")]
pub mod formats;
pub mod grid;
pub mod mesh;
pub mod sites;
pub mod solids;
pub mod spacing;
mod tree;
pub mod weld;

pub use mesh::Mesh;
pub use sites::Sites;
