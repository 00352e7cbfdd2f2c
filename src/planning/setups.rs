//! Setups: few orientations of a part that cover what a machine can cover.
//!
//! # Definition
//!
//! A *setup* is a clamping of the part: the direction z' of the part that points to the spindle, or that lies along a
//! rotary axis. Its *tool axes* are those that the [`Machine`] can take without clamping again: of a machine file those
//! for which its rotary axes have angles within their limits. A site is reached in a setup iff some tool has a [free
//! pose](crate::access::surface::AccessibleDirections) there along one of them, within the strokes of the machine where
//! they are known, and the site is not on what the part lies on. The setups of a [`Plan`] are few of the [`Candidates`]
//! that cover a share of the area that all candidates reach together. What holds the part is in the way if the answers
//! are about obstacles with it; stock is not modelled.
//!
//! # Pseudo-code
//!
//! ```text
//! for every tool, for every direction tested: a bit per site, whether the tool has a free pose there
//! for every candidate: the union of the bits over its tool axes and all tools
//! the fewest candidates that cover the share                                  (cover_share: greedy, lower bound, exact when small)
//! positions and tools of a setup: the fewest tool axes, and tools, that cover the share of what it adds
//! ```
//!
//! ```
//! use deepmill::planning::setups::{Candidates, Choice, Clampings, Plan};
//! use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
//! use deepmill::cutter::Cutter;
//! use deepmill::geom::{sites, solids, spacing};
//!
//! let part = solids::cuboid(deepmill::glam::DVec3::new(30.0, 20.0, 10.0));
//! let sites = sites::sample(&part, &sites::SiteOptions::default().with_n_sites(300))?;
//! let cutter = Cutter::ball_end([1.5, 30.0, 20.0, 30.0].into())?;
//! let candidates = Candidates::new(&part, "3-axis".parse()?, Clampings::Any, 20)?;
//! let obstacles = TriangleObstacles::new(&part, &[])?;
//! let options = SurfaceOptions::default();
//! let accessible = obstacles.accessible_directions(&sites, &cutter, candidates.directions(), &options)?;
//! let areas = spacing::areas_mm2(&sites, Some(part.area()))?;
//! let plan = Plan::new(&candidates, &part, &sites, &[accessible], &areas, Choice::share(1.0), &[0])?;
//! // The top and what is around it, then the underside.
//! assert_eq!((plan.setups.len(), plan.at_least), (2, 2));
//! # Ok::<(), deepmill::Error>(())
//! ```

mod candidates;
#[cfg(all(feature = "formats", feature = "generate"))]
mod clamped;
mod kinematics;
mod machine;
mod plan;
mod strokes;
mod turned;

pub use candidates::{Candidate, Candidates, Clampings};
#[doc(hidden)] // of machine files and the program
pub use kinematics::{Carrier, Fault, Kinematics, RotaryParams, plane_euler_deg};
pub use machine::Machine;
#[cfg(all(feature = "formats", feature = "generate"))]
pub(crate) use machine::{DOWN_RAD, LOWEST_MM};
#[doc(hidden)] // of the program
pub use machine::{direction_of_words, direction_words};
#[cfg(all(feature = "formats", feature = "generate"))]
pub(crate) use plan::reached_in;
pub use plan::{Choice, Plan, Setup};
