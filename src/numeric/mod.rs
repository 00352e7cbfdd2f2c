//! Numbers: what kernels and layers compute with, and random ones.

pub mod rng;
pub mod scalar;
