//! Triangles and points, in millimeters: meshes, their files and faults, and sample sites.

#[cfg(feature = "generate")]
pub mod bodies;
#[doc(hidden)] // of the program and benches
pub mod cells;
pub mod check;
#[cfg(feature = "formats")]
#[doc(hidden)] // of the program
pub mod file_vertices;
#[cfg(feature = "formats")]
pub mod formats;
#[doc(hidden)] // of the program and fuzz targets
pub mod inside;
#[doc(hidden)] // of the program
pub mod intersect;
pub mod mesh;
#[doc(hidden)] // of the program
pub mod origin;
#[cfg(any(feature = "python", feature = "capi"))]
pub(crate) mod preparation;
#[cfg(feature = "generate")]
mod prepare;
#[doc(hidden)] // of the program
pub mod regions;
pub mod repair;
pub mod selection;
pub mod sites;
pub mod solids;
pub mod spacing;
pub mod units;
pub mod weld;

pub use mesh::Mesh;
#[cfg(feature = "generate")]
pub use prepare::prepare;
pub use sites::Sites;
