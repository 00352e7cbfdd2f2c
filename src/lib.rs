//! Computes which parts of a surface a milling cutter cannot reach, and which other parts are in its way.
//!
//! Two engines give the same kind of answer for every sample *site* on a part: the exact collision
//! labeler in [`access`], and the octree network in [`model`], trained on the labeler's answers.
//! One stage hands over to the next:
//!
//! ```text
//! mesh → sites → labels → samples → octree → network → predictions → report
//! geom   geom    access   data      octree   nn/model  model         report
//! ```
//!
//! Lengths are millimeters, directions and normals unit vectors, matrices `[n, c]` row-major.
#![deny(unsafe_code)]

pub mod access;
pub mod answers;
#[cfg(feature = "ndarray")]
pub mod arrays;
#[cfg(feature = "formats")]
pub mod atomic_file;
pub mod cutter;
pub mod data;
pub mod directions;
pub mod error;
pub mod geom;
pub mod gradcheck;
pub mod loss;
pub mod metrics;
pub mod model;
pub mod nn;
pub mod octree;
pub mod optim;
pub mod par;
#[cfg(feature = "formats")]
pub mod parity;
#[cfg(feature = "formats")]
pub mod report;
pub mod rng;
pub mod scalar;
pub mod simd;
mod spatial;
pub mod train;

pub use error::{Error, Result};
/// The vectors that this crate's types hold.
pub use glam;
