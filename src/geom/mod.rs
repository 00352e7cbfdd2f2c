//! Triangles and points, in millimetres: meshes, their files and faults, and sample sites.

pub mod mesh;
pub mod sites;
pub mod spacing;
mod tree;

pub use mesh::Mesh;
pub use sites::Sites;
