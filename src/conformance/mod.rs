//! Checks against differences and a reference network.

pub mod gradcheck;
#[cfg(feature = "formats")]
pub mod parity;
