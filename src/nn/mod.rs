//! Layers: forward, backward, nothing else.
//!
//! # The contract
//!
//! A layer is an immutable description: sizes, and the ranges of its numbers in two flat vectors that
//! the model owns, `params` (learned) and `buffers` (running statistics). Every layer is a [`layer::Layer`];
//! its passes take
//!
//! 1. the pass ([`pass::Inference`], [`pass::Training`] or [`pass::Backward`]): numbers and memory,
//! 2. the geometry: which rows meet, from the octree,
//! 3. the operand: what it reads, an [`operand::Operand`].
//!
//! Outputs and gradients are buffers of the pass's [`arena::Arena`]. What a training pass leaves for backward is
//! a value of its own type, which backward uses up. Input gradients are new matrices, parameter gradients
//! accumulate.
//!
//! # The map
//!
//! Imports point down this list only; a test holds that.
//!
//! | | |
//! |---|---|
//! | composite | [`blocks`], [`residual`], [`downsample`], [`linear_norm_act`] |
//! | linear operators | [`conv`], [`strided_conv`], [`deconv`], [`linear`], [`linear_operator`] |
//! | other layers | [`batch_norm`], [`group_norm`], [`relu`], [`dropout`], [`interp`], [`neighbor_mean`], [`pad`], [`pool`], [`upsample`] |
//! | how products are computed | `conv_plan` |
//! | what layers share | [`layer`], [`operand`], [`pass`], [`saved`], [`params`], [`column_norm`], `rows`, [`arena`], `scratch` |

pub mod arena;
pub mod batch_norm;
pub mod blocks;
pub mod column_norm;
pub mod conv;
mod conv_plan;
pub mod deconv;
pub mod downsample;
pub mod dropout;
pub mod group_norm;
pub mod interp;
pub mod layer;
pub mod linear;
pub mod linear_norm_act;
pub mod linear_operator;
pub mod neighbor_mean;
pub mod operand;
pub mod pad;
pub mod params;
pub mod pass;
pub mod pool;
pub mod relu;
pub mod residual;
pub(crate) mod rows;
pub mod saved;
mod scratch;
pub mod strided_conv;
#[cfg(test)]
mod testing;
pub mod upsample;
