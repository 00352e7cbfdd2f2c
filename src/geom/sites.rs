//! Sample sites: near-uniform points on a surface, with outward normals.

use glam::Vec3;

/// Points on a surface with outward unit normals; all vectors have the same length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sites {
    /// Positions, mm.
    pub points: Vec<Vec3>,
    /// Outward unit normals.
    pub normals: Vec<Vec3>,
    /// Face each site lies on; empty for a point cloud without a mesh.
    pub faces: Vec<u32>,
}

impl Sites {
    /// Number of sites.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}
