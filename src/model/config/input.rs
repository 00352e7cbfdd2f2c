//! Configuration of the input: octree, features, normalization, unit of the cutter.

use crate::octree::{Features, Normalization, OctreeOptions};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// In which unit the cutter's four lengths enter the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CutterInput {
    /// As they are, in mm, beside a shape whose millimeters were normalized away: the reference's way.
    #[default]
    #[serde(rename = "millimetres", alias = "millimeters")]
    Millimeters,
    /// In units of the normalized shape: multiplied by its scale, at most 4, which is beyond its diagonal.
    Scaled,
}

/// The cube a shape is moved into; see [`Normalization`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[doc(hidden)] // for the reference's weights
#[non_exhaustive]
pub enum Cube {
    /// Bounding box centered, longest edge to `[-1, 1]`: the paper's.
    #[default]
    Box,
    /// Mean of the points centered, largest |coordinate| 0.8: the reference code's.
    Mean,
}

impl From<Cube> for Normalization {
    fn from(cube: Cube) -> Self {
        match cube {
            Cube::Box => Normalization::UnitCube,
            Cube::Mean => Normalization::Mean,
        }
    }
}

/// Numbers of each site with [`InputConfig::coarse_directions`]: one for each of three tools, and one of occlusion.
#[doc(hidden)] // of the networks here
pub const N_COARSE: usize = 4;

/// From points, normals and cutter in millimeters to the network's input.
///
/// ```
/// use deepmill::model::config::InputConfig;
/// let input = InputConfig::default().with_depth(4).with_features("NDP".into());
/// assert_eq!(input.full_depth, InputConfig::default().full_depth);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct InputConfig {
    /// Finest depth of the octree, `1..=10`.
    pub depth: usize,
    /// Deepest depth that holds all its nodes.
    pub full_depth: usize,
    /// Letters of the node features: some of `NDP`, see [`Features`].
    pub features: String,
    /// Normalization of the points.
    #[doc(hidden)] // for the reference's weights
    pub cube: Cube,
    /// Componentwise absolute normals, as the reference takes them.
    #[doc(hidden)] // for the reference's weights
    pub absolute_normals: bool,
    /// The reference's interpolation across opposite faces of the cube.
    #[doc(hidden)] // for the reference's weights
    pub wrap_at_faces: bool,
    /// The reference's single-precision sums over the points of a cell.
    #[doc(hidden)] // for the reference's weights
    pub single_precision_means: bool,
    /// Unit of the cutter's lengths.
    pub cutter: CutterInput,
    /// The heads also read each point's own normal, beside the features interpolated from the octree: a
    /// cell that holds both sides of a thin wall has only their mean.
    pub point_normals: bool,
    /// If not 0: each site also brings a coarse answer that the network corrects, the labels of the published
    /// definition: the shares of this many directions of the upper hemisphere in which three tools collide with no
    /// other site, and how often the site is in the way of others. Needs normals and [`CutterInput::Scaled`].
    #[serde(skip_serializing_if = "is_zero")]
    pub coarse_directions: usize,
}

impl Default for InputConfig {
    /// Depth 5, full to 2, features `ND`, signed normals, box normalization, cutter scaled.
    fn default() -> Self {
        InputConfig {
            depth: 5,
            full_depth: 2,
            features: "ND".into(),
            cube: Cube::Box,
            absolute_normals: false,
            wrap_at_faces: false,
            single_precision_means: false,
            cutter: CutterInput::Scaled,
            point_normals: false,
            coarse_directions: 0,
        }
    }
}

impl InputConfig {
    /// What the reference code does, its quirks included.
    pub fn reference() -> Self {
        InputConfig {
            cube: Cube::Mean,
            absolute_normals: true,
            wrap_at_faces: true,
            single_precision_means: true,
            cutter: CutterInput::Millimeters,
            ..InputConfig::default()
        }
    }

    /// Options of the octree.
    pub fn octree(&self) -> OctreeOptions {
        OctreeOptions {
            depth: self.depth,
            full_depth: self.full_depth,
            absolute_normals: self.absolute_normals,
            wrap_at_faces: self.wrap_at_faces,
            single_precision_means: self.single_precision_means,
            ..OctreeOptions::default()
        }
    }

    /// Features of the finest nodes.
    ///
    /// # Errors
    /// If the letters are not some of `NDP` in this order.
    pub fn node_features(&self) -> Result<Features> {
        self.features.parse()
    }

    /// Demands that it reads neither normals of points nor coarse answers about them.
    ///
    /// # Errors
    /// If it does.
    pub(in crate::model) fn check_without_normals(&self) -> Result<()> {
        let remedy = "give the points normals, or train without (docs/training.md)";
        let refused = |name, found: String, none: &str| {
            let expected = format!("{none} for points without normals");
            Err(Error::argument(name, found, expected, remedy))
        };
        match (self.point_normals, self.coarse_directions) {
            (false, 0) => Ok(()),
            (true, _) => refused("point_normals", "true".into(), "false"),
            (false, n) => refused("coarse_directions", n.to_string(), "0"),
        }
    }

    /// Columns of the finest nodes' features: those of [`InputConfig::node_features`], and the coarse answer.
    ///
    /// # Errors
    /// As [`InputConfig::node_features`].
    pub fn n_node_channels(&self) -> Result<usize> {
        Ok(self.node_features()?.n_channels() + self.n_coarse())
    }

    /// Columns that the heads read of each point, beside the octree's.
    pub(in crate::model) fn n_point_channels(&self) -> usize {
        3 * usize::from(self.point_normals) + self.n_coarse()
    }

    fn n_coarse(&self) -> usize {
        if self.coarse_directions == 0 { 0 } else { N_COARSE }
    }

    /// Normalization of the points.
    pub fn normalization(&self) -> Normalization {
        self.cube.into()
    }
}

fn is_zero(n: &usize) -> bool {
    *n == 0
}
