//! Layers: forward, backward, nothing else.
//!
//! # The contract
//!
//! A layer is an immutable description: sizes, and the ranges of its numbers in two flat vectors that
//! the model owns, `params` (learned) and `buffers` (running statistics). Matrices are `[n, c]`
//! row-major slices.
//!
//! - `forward(&self, params, buffers, x, …, y)` is inference: `y` is overwritten.
//! - `forward_train(&self, params, buffers, x, …, y, cache)` also fills `cache` with what backward needs.
//! - `backward(&self, params, x, …, cache, dy, dx, grads)`: `dx` is overwritten, `grads` (as long as
//!   `params`) accumulates. Residual blocks use `cache` up.
//!
//! Output vectors are `&mut Vec<T>`, resized by the layer, so that buffers live on between steps.
//! A layer without buffers or without need of `x` in backward leaves that argument out.
//! Layers that act on each element or column (normalisation, ReLU, dropout) turn `dy` into `dx` in
//! place: their argument `d` holds `dy` before the call and `dx` after it.

pub mod batch_norm;
pub mod blocks;
pub mod concat;
pub mod conv;
pub mod conv_transpose;
pub mod down;
pub mod downsample;
pub mod dropout;
pub mod group_norm;
pub mod interp;
pub mod joined;
mod kernel_product;
mod lent;
pub mod linear;
pub mod neighbour_mean;
pub mod pad;
pub mod params;
pub mod pool;
pub mod relu;
pub mod residual;
pub(crate) mod rows;
pub mod unit;
pub mod upsample;
mod winograd;
