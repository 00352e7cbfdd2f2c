//! Options of an octree: depths, conventions, limits.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Greatest depth: keys and rows of deeper trees would still fit, their nodes would not.
pub const MAX_DEPTH: usize = 10;

/// Depths, conventions and limits of an [`super::Octree`].
///
/// ```
/// use deepmill::octree::OctreeOptions;
/// let options = OctreeOptions::default().with_depth(6).with_full_depth(2);
/// assert!(options.depth <= deepmill::octree::MAX_DEPTH);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct OctreeOptions {
    /// Finest depth, `1..=10`.
    pub depth: usize,
    /// Deepest depth that holds all its nodes, `0..=depth`.
    pub full_depth: usize,
    /// Replace every normal by its componentwise absolute value before averaging. The reference does
    /// so, for data with unoriented normals; it loses the difference between inside and outside.
    #[doc(hidden)] // for the reference's weights
    pub absolute_normals: bool,
    /// Let trilinear interpolation within half a cell of a face of the cube take part of its weight from
    /// the cells at the opposite face. The reference does so for want of a bounds check; otherwise
    /// the weights of the cells inside are renormalized.
    #[doc(hidden)] // for the reference's weights
    pub wrap_at_faces: bool,
    /// Sum the points and normals of a cell in f32 as the reference does. Its mean points then err by up
    /// to n·2⁻²⁴ relative for n points in a cell; otherwise sums are made in f64. Both in point order.
    #[doc(hidden)] // for the reference's weights
    pub single_precision_means: bool,
    /// Refuse to build an octree that needs more bytes than this, by an upper estimate.
    pub max_bytes: u64,
}

setters!(OctreeOptions {
    with_depth(depth: usize),
    with_full_depth(full_depth: usize),
    #[doc(hidden)]
    with_wrap_at_faces(wrap_at_faces: bool),
    with_max_bytes(max_bytes: u64),
});

impl Default for OctreeOptions {
    /// Depth 5, full to depth 2, signed normals, no wrapping, means in f64, at most 4 GiB.
    fn default() -> Self {
        OctreeOptions {
            depth: 5,
            full_depth: 2,
            absolute_normals: false,
            wrap_at_faces: false,
            single_precision_means: false,
            max_bytes: 4 << 30,
        }
    }
}

impl OctreeOptions {
    /// What the reference network does: absolute normals, wrapping at the faces, means in f32.
    pub fn reference() -> Self {
        OctreeOptions {
            absolute_normals: true,
            wrap_at_faces: true,
            single_precision_means: true,
            ..Self::default()
        }
    }

    pub(super) fn check(&self) -> Result<()> {
        if !(1..=MAX_DEPTH).contains(&self.depth) {
            return Err(Error::argument(
                "octree depth",
                self.depth,
                "1 to 10",
                "choose another depth",
            ));
        }
        if self.full_depth > self.depth {
            return Err(Error::argument(
                "octree full depth",
                self.full_depth,
                format!("0 to the depth, {}", self.depth),
                "choose a smaller full depth",
            ));
        }
        Ok(())
    }
}
