//! The input of an octree: points with normals of one shape.

use crate::{Error, Result};
use glam::Vec3;

/// Points of one shape in [−1, 1]³, and their normals: as many, or none at all.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::octree::{Cloud, Octree, OctreeOptions};
///
/// let (points, options) = ([Vec3::ZERO, Vec3::splat(0.5)], OctreeOptions::default());
/// let octree = Octree::build(&[Cloud::new(&points, &[]), Cloud::new(&points[1..], &[])], &options)?;
/// assert_eq!((octree.n_shapes(), octree.n_points()), (2, 3)); // two shapes without normals
/// let error = Octree::build(&[Cloud::new(&points, &[Vec3::Z])], &options).unwrap_err().to_string();
/// assert!(error.starts_with("shape 0: 1 normals for 2 points") && error.contains("give each point"));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cloud<'a> {
    /// Positions, dimensionless (see [`super::normalize`]).
    pub(crate) points: &'a [Vec3],
    /// Normals, one per point, of any length; or empty.
    pub(crate) normals: &'a [Vec3],
}

impl<'a> Cloud<'a> {
    /// A cloud with normals.
    pub fn new(points: &'a [Vec3], normals: &'a [Vec3]) -> Self {
        Cloud { points, normals }
    }

    /// Whether the cloud can be put into an octree; `shape` is its index, for the message.
    pub(super) fn check(&self, shape: usize, wants_normals: bool) -> Result<()> {
        if self.points.is_empty() {
            return Err(Error::geometry(
                format!("shape {shape}"),
                "it has no points",
                "give every shape of a batch at least one point",
            ));
        }
        let n_normals = if wants_normals { self.points.len() } else { 0 };
        if self.normals.len() != n_normals {
            return Err(Error::geometry(
                format!("shape {shape}"),
                format!("{} normals for {} points", self.normals.len(), self.points.len()),
                "give each point of every shape a normal, or none at all",
            ));
        }
        let vectors = self.points.iter().map(|p| ("point", p)).enumerate();
        let vectors = vectors.chain(self.normals.iter().map(|n| ("normal", n)).enumerate());
        match vectors.into_iter().find(|(_, (_, v))| !v.is_finite()) {
            None => Ok(()),
            Some((i, (what, v))) => Err(Error::NotFinite {
                place: format!("{what} {i} of shape {shape}"),
                found: v.to_string(),
                remedy: "remove or repair it".into(),
            }),
        }
    }
}
