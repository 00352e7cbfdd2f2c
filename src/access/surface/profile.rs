//! Tools of any profile: poses are tested against the whole profile, and each needs a way out.
//!
//! # Definition
//!
//! The tool is a solid of revolution ([`Profile`](crate::tool::cutter::Profile)), with its holder. In a pose it
//! **penetrates** a triangle iff some point of that is deeper in the tool than the gouge tolerance τ of the triangle:
//! farther from everything outside. A pose that penetrates no triangle is **free**.
//!
//! In direction `d` the tool **touches** a site with normal `n` in every pose in which the site is on the profile of
//! what cuts, grown by the finish tolerance δ, where that has the outward normal `−n`, or nearly: on a flank or a face
//! at any place of it, on both sides of a lollipop, on the upper and lower face of a T-slot cutter.
//!
//! A free pose counts if a **retreat** is proven: straight along the axis, which is a pose of the tool that is as wide
//! at every height as anything below; or by one move across the axis, whose swept volume is free, and then along the
//! axis. Per site:
//!
//! - **accessible**: some pose is free and has a retreat;
//! - **inaccessible**, *retreat unproven*: some pose is free, no retreat from one was found;
//! - **tip does not fit**: no pose is free, but in some pose only what cuts penetrates;
//! - **inaccessible** elsewhere.
//!
//! # Pseudo-code
//!
//! ```text
//! for every site, for every direction, for every place of the profile with the site's normal:
//!     some triangle penetrated by the pose: next; the one that the last pose met is tried first
//!     straight retreat free, or moved aside and free: accessible
//! if none: for every direction again, pushing poses along the profile, clear of what they penetrate: those that
//!     penetrate least until it leads no further, those after them a few times;
//!     on an arc only if a ball inside of the tool has a place at the site, which is one search for all directions
//! ```
//!
//! Three things make a test cheap. On a triangle, of all points at one height the one nearest to the axis lies on an
//! edge or on the line of steepest slope through the axis: four segments represent the triangle. The profile shrunk by
//! τ is again radius over height, in lines and convex arcs, made once per τ. Along a segment the distance from the axis
//! less the radius of such a piece is convex, so its least value is found where tangents meet.
//!
//! Of the directions between those of an even set the ones that the part suggests are tested as well, across its flat
//! faces and along its round ones; no others, and nothing is proven of them. Directions and clearances are not
//! counted.
//!
//! Explanations ask for the pose of a direction that is nearest to being free: the depth of its deepest point is
//! between two tools that are shrunk by more and more.
//!
//! Points of space have no normal: `space` says which of them a tool removes.
//!
//! A drill or a reamer cuts along its axis alone, in bores of its own diameter: `drilling` finds these in sections of
//! the part, and what of them the tool reaches.

mod aside;
mod axes;
mod balls;
mod bands;
mod body;
mod clear;
mod contact;
mod cuts;
mod depth;
mod drill;
mod drilling;
mod frame;
mod label;
mod labels;
mod meet;
mod nearest;
mod outline;
mod push;
#[cfg(test)]
mod reference;
mod retreat;
mod shallow;
mod space;
#[cfg(test)]
mod tests;
mod underside;

pub(super) use aside::AsidePose;
pub(super) use clear::Push;
pub(super) use depth::{Ladder, PartHeights};
pub(super) use frame::Frame;
pub(super) use label::{ProfileTool, SiteResult};
pub(super) use labels::{accessible, label};
pub(super) use nearest::{Penetration, PoseState};
pub(super) use underside::{Cuts, Underside};
