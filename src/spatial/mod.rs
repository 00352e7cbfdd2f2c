//! Spatial data structures: orders, sorts, grids and trees over points and boxes.
//!
//! | structure | over | answers | cost |
//! |---|---|---|---|
//! | `KdTree` | points, `f64` | nearest, the k nearest, all within a radius, whatever the distribution | build n log n |
//! | [`PointGrid`] | points of a surface, `f32` | the same, for even distributions | build n |
//! | `AabbGrid` | boxes, `f64` | which boxes may hold a point or meet each other | build n |
//! | [`bvh::Bvh8`] | runs of points in a spatial order | boxes eight to a node, built anew in every direction | build n |
//! | [`morton`], [`order`] | points | neighbors in the list are neighbors in space | n, n log n |
//! | [`CountingSort`] | numbers of buckets | places, bucket by bucket | n |

mod aabb_grid;
pub mod bvh;
mod coordinates;
mod counting_sort;
mod kd_tree;
pub mod morton;
pub mod order;
mod point_grid;

pub(crate) use aabb_grid::AabbGrid;
pub use coordinates::{Coordinates, PADDING};
pub use counting_sort::CountingSort;
pub(crate) use kd_tree::KdTree;
pub use point_grid::PointGrid;

/// `of` three values; inlined, which [`array::map`] is not always.
#[inline(always)]
pub(crate) fn each<T, U>([a, b, c]: [T; 3], of: impl Fn(T) -> U) -> [U; 3] {
    [of(a), of(b), of(c)]
}
