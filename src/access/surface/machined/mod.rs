//! How much is left: the distance from a site to the surface of what the tools leave.
//!
//! # Definition
//!
//! Coming down along a direction, a tool that only widens stops where its shrunk outline touches a triangle (`drop`).
//! A point is *removed* if in some direction it is above the lower surface of what cuts of a tool that stopped there.
//! The **rest** at a site is the length of the line from it along its normal to the first point that is removed; if
//! none is, the whole line: to the next wall of the part, or to where it leaves the stock. At an accessible site it
//! is 0. What a tool of any profile removes beside that is in `profile`.
//!
//! # Engine
//!
//! ```text
//! for every direction:                                                    (images)
//!     h: greatest height of the triangles at the middle of every pixel
//!     t: where the tool, shrunk by half a pixel's diagonal, stops:  max over its pixels of h − height of the tool
//!     m: what it leaves:                                            min over its pixels of t + height of what cuts
//!     for every site: first point of its line above m
//! for every site, for its best directions:                                (poses)
//!     least length over places of the axis, by halved steps, with the closed formulas of `drop`
//! ```
//!
//! Images are a search; what is returned is what a tool leaves that stops exactly. It may be more than the least of all
//! poses, never less than what some pose leaves.
//!
//! 1. **Tiles on demand.** t and m are computed on tiles of pixels that some line may still need.
//! 2. **Blocks of offsets.** Extremes over blocks of pixels bound what a block of the tool can add to a tile; most are
//!    skipped.
//! 3. **Discs by windows.** For a disc, one image has the greatest height of 2ᵏ pixels of a row: two of these hold a
//!    row of the disc.

mod aside;
mod bodies;
mod footprint;
mod grid;
mod heights;
mod pose;
mod profile;
mod sites;
mod solid;
mod swept;
#[cfg(test)]
mod tests;
mod view;
mod volumes;

pub use bodies::RestBody;
pub use solid::{Job, Machined};
