//! Tools, and the directions in which they work.

pub mod cutter;
pub mod directions;
