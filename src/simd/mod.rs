//! Vector kernels and the choice between them: the only room with unsafe code.
//!
//! # Numeric contract
//!
//! A kernel returns the same bits at every [`Level`]: lanes run over outputs, every output takes its
//! terms one at a time in the documented order, tails use the same operations as full vectors.
//!
//! # Safety contract
//!
//! Instructions beyond the baseline of the target run only inside [`Level::run`], under a token that
//! nothing but a successful check of the processor can build. Kernels check every index that they
//! are given before they form a pointer from it.
#![allow(unsafe_code)]

pub mod boxes;
pub mod cells;
pub mod collide;
mod double;
pub mod eights;
pub mod elementwise;
pub mod fma;
pub mod gemm;
pub mod level;
pub mod normalize;
pub mod real;
pub mod search;
pub mod vector;
pub mod windows;

pub use level::{Kernel, Level, Simd};
pub use real::Real;
pub use vector::{Float32, Float64, Vector};

/// The places of the bits that are set.
#[inline(always)]
fn ones(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = bits.trailing_zeros() as usize;
        let more = bits != 0;
        bits &= bits.wrapping_sub(1);
        more.then_some(place)
    })
}
