//! Vector kernels for several instruction sets, chosen at run time; the only module with unsafe code.
//!
//! # Numeric contract
//!
//! A kernel returns the same bits at every [`Isa`]: lanes run over outputs, every output takes its
//! terms one at a time in the documented order, tails use the same operations as full vectors.
//!
//! # Safety contract
//!
//! Instructions beyond the baseline of the target run only inside [`Isa::run`], under a token that
//! nothing but a successful check of the processor can build. Kernels check every index that they
//! are given before they form a pointer from it.
#![allow(unsafe_code)]
// Registers are arrays of constant length, counted by the same index as rows and panels beside them.
#![allow(clippy::needless_range_loop)]

mod double;
pub(crate) mod elementwise;
pub(crate) mod extremes;
pub(crate) mod float_state;
pub(crate) mod fma;
#[doc(hidden)] // kernels, checked by benches
pub mod gemm;
pub(crate) mod isa;
pub(crate) mod normalize;
pub(crate) mod real;
pub(crate) mod token;
pub(crate) mod vector;

pub use isa::Isa;
pub(crate) use isa::Kernel;
pub(crate) use real::Real;
pub(crate) use vector::{Float32, Mask, Simd, Unsigned, Unsigned16, Unsigned32, Vector};
