//! Triangles and points, in millimeters: meshes, their files and faults, and sample sites.

#[cfg(feature = "generate")]
pub mod bodies;
pub mod cells;
pub mod check;
#[cfg(feature = "formats")]
pub mod formats;
pub mod inside;
pub mod intersect;
pub mod mesh;
pub mod origin;
pub mod regions;
pub mod repair;
pub mod selection;
pub mod sites;
pub mod solids;
pub mod spacing;
pub mod units;
pub mod weld;

pub use mesh::Mesh;
pub use sites::Sites;
