//! Input features of the network at the finest nodes: normal, displacement, position.

use super::{Octree, key};
use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// Which features every finest node carries, in this order; empty nodes carry zeros.
///
/// Written as letters: `N` normal (3 channels), `D` displacement (1), `P` position (3).
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::octree::{Cloud, Features, Octree, OctreeOptions};
///
/// let (points, normals) = ([Vec3::new(0.5, 0.5, 0.75)], [Vec3::Z]);
/// let options = OctreeOptions::default().with_depth(1).with_full_depth(1); // cells of edge 1
/// let octree = Octree::build(&[Cloud::new(&points, &normals)], &options)?;
/// let features: Features = "NDP".parse()?;
/// let (rows, n) = (octree.features(features)?, features.n_channels());
/// assert_eq!((rows.len(), n), (8 * 7, 7)); // eight nodes, seven of them empty
/// assert!(rows[..7 * n].iter().all(|x| *x == 0.0));
/// // The cell's center is (½, ½, ½): the point is a quarter of a cell above it.
/// assert_eq!(rows[7 * n..], [0.0, 0.0, 1.0, 0.25, 0.5, 0.5, 0.75]);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Features {
    /// Mean unit normal.
    pub(crate) normal: bool,
    /// Signed distance, in finest cells, from the cell's center to the plane through the mean point:
    /// (mean point − center) · normal.
    pub(crate) displacement: bool,
    /// Mean point in [−1, 1]³.
    pub(crate) position: bool,
}

impl Default for Features {
    /// `ND`, the reference's four channels.
    fn default() -> Self {
        Features { normal: true, displacement: true, position: false }
    }
}

impl FromStr for Features {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let features = Features {
            normal: text.contains('N'),
            displacement: text.contains('D'),
            position: text.contains('P'),
        };
        if text.is_empty() || features.to_string() != text {
            return Err(Error::argument(
                "octree features",
                format!("{text:?}"),
                "some of the letters N, D, P, in this order",
                "write ND for normal and displacement",
            ));
        }
        Ok(features)
    }
}

impl fmt::Display for Features {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let letters = [(self.normal, "N"), (self.displacement, "D"), (self.position, "P")];
        letters.iter().filter(|(on, _)| *on).try_for_each(|(_, letter)| f.write_str(letter))
    }
}

impl Features {
    /// Whether the points need normals.
    pub(crate) fn needs_normals(&self) -> bool {
        self.normal || self.displacement
    }

    /// Number of channels.
    pub fn n_channels(&self) -> usize {
        3 * usize::from(self.normal)
            + usize::from(self.displacement)
            + 3 * usize::from(self.position)
    }
}

impl Octree {
    /// Features `[n_nodes, n_channels]` of the finest nodes.
    ///
    /// # Errors
    /// If the features need normals and the octree was built without.
    pub fn features(&self, features: Features) -> Result<Vec<f32>> {
        if self.leaf_normals.is_empty() && features.needs_normals() {
            return Err(Error::argument(
                "octree features",
                features,
                "P for points without normals",
                "give the points normals, points of space the part's surface, or use the feature P",
            ));
        }
        let n_channels = features.n_channels();
        let mut rows = vec![0.0; self.finest().n_nodes() * n_channels];
        for (leaf, &node) in self.finest().nonempty.iter().enumerate() {
            let row = &mut rows[node as usize * n_channels..][..n_channels];
            self.write_leaf(leaf, node as usize, features, row);
        }
        Ok(rows)
    }

    fn write_leaf(&self, leaf: usize, node: usize, features: Features, row: &mut [f32]) {
        let mean = self.leaf_points[leaf];
        let mut channels = row.iter_mut();
        let mut write = |values: &[f32]| {
            values.iter().zip(&mut channels).for_each(|(value, channel)| *channel = *value);
        };
        if features.normal {
            write(&self.leaf_normals[leaf].to_array());
        }
        if features.displacement {
            let (cell, _) = key::decode(self.finest().keys[node]);
            let local = mean - glam::UVec3::from(cell).as_vec3() - 0.5;
            write(&[local.dot(self.leaf_normals[leaf])]);
        }
        if features.position {
            let cell_edge = 2.0 / (1u32 << self.depth()) as f32;
            write(&(mean * cell_edge - 1.0).to_array());
        }
    }
}
