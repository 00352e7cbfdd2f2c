//! The published definition: points are the obstacles.

pub mod baselines;
mod batched;
pub mod bottom;
mod clearance;
mod cutter_groups;
pub mod driver;
pub mod gouge;
pub(super) mod kernels;
mod method;
pub mod occlusion;
mod order;
pub mod predicate;
pub mod problem;
mod pruned;
mod reference;
pub mod stats;
