//! The mesh definition: which sites a cutter cannot reach, tested against the part's triangles.
//!
//! # Definition
//!
//! The tool touches a site with its reference point `c` where [`access`](super) puts it. It is *shrunk* by the contact
//! tolerance τ: each step `(t, R)` becomes `(t + τ, R − τ)`, the radius of the tip's corner becomes smaller by τ. In
//! direction `d` a **step penetrates** the part iff the greatest height of the triangles over the closed disc of radius
//! `R − τ` about the axis exceeds `c·d + t + τ`; the **tip penetrates** iff its drop height, where its reference point
//! is when it comes down along the axis and touches a triangle, exceeds `c·d`. Per site:
//!
//! - **accessible**: in some direction neither does;
//! - **inaccessible**: in every direction a step does;
//! - **tip does not fit**: in some direction no step does, and in all of these the tip does.
//!
//! No triangle is left out, not even the site's own. At τ = 0 nothing would be certain: a tangent wall touches the tool
//! by construction, and facets of a bore reach into a tool that fits the bore. See [`ContactTolerance`].
//!
//! # Engines
//!
//! [`raise`] is that text in `f64`: plain loops over closed formulas, and [`TriangleObstacles::label_by_drop_heights`]
//! the labels from it. [`TriangleObstacles::label`] gives the same answers wherever a change of τ by 1e-6 mm makes no
//! difference:
//!
//! ```text
//! for every direction: which sites hold a sample point of the surface in the tool, shrunk a little more?   (points)
//! for every site, for every direction left:
//!     triangle that collided last, then those whose boxes reach into the tool, until a step penetrates one (triangles)
//! ```
//!
//! A point of the surface in the tool is a collision for certain, so only what points leave free is tested against
//! triangles.

mod accessible;
mod advice;
mod bvh;
mod caps;
mod cells;
mod chords;
mod clearance;
mod drop;
pub mod explain;
mod faces;
mod facets;
mod folds;
mod labeling;
mod labels;
mod library;
mod machined;
mod obstacles;
mod penetrate;
mod pose;
mod problem;
mod profile;
mod query;
mod rays;
mod reference;
mod refine;
mod rests;
mod samples;
mod site;
mod surroundings;
#[cfg(test)]
mod tests;
mod tolerance;
mod tool;
mod triangle;
mod verdict;
mod verify;
mod warnings;

#[doc(hidden)] // of the program and benches
pub use super::evidence::SurfaceStats;
pub use super::evidence::{SurfaceEvidence, WitnessPose};
pub use accessible::AccessibleDirections;
#[doc(hidden)] // of findings
pub use advice::{PartChange, PartLength};
#[doc(hidden)] // of the program
pub use faces::{BlockingFace, blocking_faces};
#[doc(hidden)] // of the program and benches
pub use labels::FINISH_MM;
pub use labels::{RefinementOptions, SurfaceOptions};
#[doc(hidden)] // of `analysis`, which compares tools
pub use library::ToolReach;
#[doc(hidden)] // of `analysis`
pub use machined::{Job, Machined, RestBody};
pub use obstacles::TriangleObstacles;
#[cfg(all(feature = "formats", feature = "generate"))]
pub(crate) use obstacles::tested;
#[doc(hidden)] // checked by benches
pub use reference::Reached;
pub use tolerance::ContactTolerance;
#[doc(hidden)] // of the program
pub use tolerance::LEAST_MM;
pub use verdict::{Raise, raise};
pub use verify::Verified;
pub(crate) use verify::sites_to_count;
#[doc(hidden)] // of the program
pub use warnings::WIDE_MM;
pub use warnings::Warning;
#[cfg(all(feature = "formats", feature = "generate"))]
pub(crate) use warnings::retreats;
