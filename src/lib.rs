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
//!
//! # Example
//!
//! Both engines take the same sites and the same cutter, and return the same
//! [`SiteAnswers`](answers::SiteAnswers).
//!
#![cfg_attr(feature = "weights", doc = "```")]
#![cfg_attr(not(feature = "weights"), doc = "```ignore")]
//! use deepmill::access::{LabelOptions, Labeler, surface::SurfaceOptions};
//! use deepmill::geom::{sites, solids};
//! use deepmill::glam::DVec3;
//! use deepmill::model::{Model, Predictor};
//!
//! let part = solids::cuboid(DVec3::new(80.0, 60.0, 40.0)); // or geom::formats::read_mesh
//! let sites = sites::sample(&part, &sites::SiteOptions::default().with_n_sites(500))?;
//! let cutter = "1.5,6,40,5".parse()?; // CR, CH, FR, FH in mm
//! let directions = "hemisphere:150".parse()?;
//!
//! // About the part's triangles; `Labeler::of_sites` is the published definition.
//! let labeler = Labeler::of_part(&part, &[], directions, SurfaceOptions::default())?;
//! let exact = labeler.answer(&sites, &cutter)?;
//! let share = exact.inaccessible_area_share(&sites)?; // of the surface
//! let way = exact.witness()[0]; // a direction in which the cutter can stand at site 0
//!
//! let predicted = Predictor::new(Model::shipped()?).answer_on(&part, &sites, &cutter)?;
//! assert_eq!(exact.len(), predicted.len());
//! # Ok::<(), deepmill::Error>(())
//! ```
//!
//! `examples/` has eight programs: three tools and a report, label a mesh, drop heights of a tool, predict, a network of
//! one's own, the gradient check of a layer of one's own, training that stops and resumes, tests of poses for comparison
//! with other programs.
//!
//! # Features
//!
//! | feature | default | adds |
//! |---|---|---|
//! | `formats` | by `cli` | files of meshes, clouds, samples, weights and pictures; `train::RunFolder`; `findings`, `tables`, `report` |
//! | `generate` | by `cli` | parts made from a seed (`data::generated`) |
//! | `weights` | yes | the trained network (`Model::shipped`) |
//! | `ndarray` | yes | sites, meshes and answers as `ndarray` views (`arrays`) |
//! | `approx` | no | `approx::AbsDiffEq` and `RelativeEq` of answers and predictions |
//! | `step` | no | STEP files (`geom::formats`): 55 crates more |
//! | `cli` | yes | the `deepmill` program |
//! | `capi` | no | the C interface that `deepmill.h` declares; nothing for Rust |
//! | `python` | no | the Python module that `pyproject.toml` builds; nothing for Rust |
//! | `mpi` | no | several processes on many machines (`processes::Mpi`); binds the MPI library that is installed |
//!
//! `default-features = false` leaves the numerical core: labeler, octree, layers, training. Nothing compiles C. It also
//! runs on `wasm32-unknown-unknown`, with the same bits: on one thread, and without a clock, so that seconds are 0.
//! All other features need a system that has files. Rust 1.91 or newer.
//!
//! # Where to go on
//!
//! - from a part and tools to a folder of results: `analysis` (features `formats` and `generate`)
//! - label: [`access`], [`access::surface`]; sites: [`geom::sites`]; cutters: [`cutter`]; directions: [`directions`]
//! - choose tools and setups: [`planning`]
//! - predict and train: [`model`], [`train`], [`data`]
//! - formulas, formats, limits and how to: `guide`, the pages of `docs`
//! - build networks: [`nn`], [`octree`], [`optim`], [`loss`]; check gradients: [`gradcheck`]
//!
//! Items that this documentation does not show are for the program, tests and benches of this package. They may change
//! in any release.
#![deny(unsafe_code)]

#[macro_use]
mod setters;

pub mod access;
#[cfg(all(feature = "formats", feature = "generate"))]
pub mod analysis;
pub mod answers;
#[cfg(feature = "ndarray")]
pub mod arrays;
#[cfg(feature = "capi")]
#[doc(hidden)] // of C
pub mod capi;
mod conformance;
pub mod data;
pub mod error;
mod exec;
#[cfg(feature = "formats")]
pub mod findings;
pub mod geom;
#[cfg(any(doc, doctest))]
pub mod guide;
mod learn;
pub mod model;
pub mod nn;
mod numeric;
pub mod octree;
pub mod planning;
#[cfg(feature = "python")]
mod python;
#[cfg(feature = "formats")]
mod render;
#[cfg(feature = "formats")]
pub mod report;
pub mod simd;
mod spatial;
#[cfg(feature = "formats")]
mod storage;
#[cfg(feature = "formats")]
pub mod tables;
mod tool;
pub mod train;

pub use conformance::gradcheck;
#[cfg(feature = "formats")]
#[doc(hidden)] // of the program
pub use conformance::parity;
#[doc(hidden)] // limits of this package, set by the program
pub use exec::memory;
pub use exec::{par, processes};
pub use learn::{loss, metrics, optim};
pub use numeric::{rng, scalar};
#[cfg(feature = "formats")]
#[doc(hidden)] // of the program
pub use storage::{atomic_file, folder_lock};
pub use tool::{cutter, directions};

pub use error::{Error, Result};
/// The vectors that this crate's types hold.
pub use glam;
/// The arrays of [`arrays`].
#[cfg(feature = "ndarray")]
pub use ndarray;
