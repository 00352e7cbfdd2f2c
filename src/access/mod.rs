//! The exact collision labeler: which sites a cutter cannot reach, and which sites are in its way.
//!
//! # Definition
//!
//! Direction `d` points from tip to spindle. Touching site `i`, the cutter's reference point (the
//! ball's center) is `c_i = s_i + CR·n_i`. Another point `s_j` at height `h = (s_j − c_i)·d` and
//! distance `r` from the axis collides iff for some [step](crate::tool::cutter::Step) `h > height` and
//! `r ≤ radius`; for the ball-end cutter
//!
//! ```text
//! h > CR+CH+FH   or   h > CR+CH and r ≤ FR   or   h > CR and r ≤ CR
//! ```
//!
//! A site is **inaccessible** iff it collides in every direction. `β_j` counts the pairs
//! (inaccessible `i`, direction) in which `j` is a collider; the **occlusion points** are the
//! `ceil(share·n)` sites of greatest β, lower index first among equals, never one with β = 0.
//! [`predicate`] fixes the order of every `f32` operation.
//!
//! The **published definition** ([`Labeler::published`]) is this with the directions of
//! [`DirectionSet::Published`](crate::tool::directions::DirectionSet::Published) and with [`LabelOptions::published`]:
//! sites lower than the lowest plus 1 mm are accessible by rule and not ranked, and the share of the others is rounded
//! down.
//!
//! # Engines
//!
//! [`Engine::Reference`] is that text as plain loops. [`Engine::Batched`] does the same tests
//! a vector at a time. [`Engine::Pruned`], the default, lets heights, rasters and other cutters decide most of
//! them. All engines return the same labels and counts, bit for bit, for any number of threads and at every SIMD
//! instruction set.
//!
//! # The mesh definition
//!
//! Points are a sample of a part; [`surface`] tests its triangles.

mod evidence;
mod extent;
mod labeler;
mod labels;
mod matrix;
mod points;
pub mod surface;

pub(crate) use extent::Extent;
pub use labeler::Labeler;
#[doc(hidden)] // of data sets
pub use labels::BOTTOM_MM;
pub use labels::{Engine, LabelOptions, Labels};
pub use matrix::CollisionMatrix;
#[doc(hidden)] // of the program
pub use points::bottom::bottom_sites;
pub(crate) use points::driver::{Counted, count_for};
pub use points::driver::{label, label_many};
#[doc(hidden)] // against points; triangles answer by `access::surface`
pub use points::gouge::gouges;
pub(crate) use points::occlusion::occlusion_points;
pub use points::problem::{Obstacles, Queries};
#[doc(hidden)] // counts for benches
pub use points::stats::Stats;
#[doc(hidden)] // of the program's evaluation, tests and benches
pub use points::{baselines, predicate};
