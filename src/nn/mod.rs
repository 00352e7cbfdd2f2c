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
//!   `params`) accumulates.
//!
//! Output vectors are `&mut Vec<T>`, resized by the layer, so that buffers live on between steps.
//! A layer without buffers or without need of `x` in backward leaves that argument out.

pub mod params;
