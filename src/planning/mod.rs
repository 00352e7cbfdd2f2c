//! What is planned with answers: the fewest tools that reach what all do, and the fewest setups.

pub mod cover;
pub mod setups;
