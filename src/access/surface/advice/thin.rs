//! How thick a part is at its sites.

use crate::access::surface::obstacles::TriangleObstacles;
use crate::exec::par;
use crate::geom::Sites;

/// Faces are two sides of a wall where their normals are within this of opposite, as a cosine: 20 degrees.
const OPPOSITE: f64 = 0.94;
/// Rays begin this far inside, mm.
const INSIDE_MM: f64 = 1e-3;
/// Sites per task.
const BLOCK: usize = 256;

impl TriangleObstacles {
    /// Per site, the thickness of the wall that it is a side of, mm: how far the ray against its normal runs inside of
    /// the part to a face that looks the other way, within 20 degrees. Infinite where it meets another face, as beside
    /// an edge, or nothing.
    ///
    /// # Panics
    /// If there are not as many normals as sites.
    #[doc(hidden)] // of `analysis`
    pub fn thickness(&self, sites: &Sites) -> Vec<f64> {
        assert_eq!(sites.normals.len(), sites.len(), "one normal per site");
        let of = |i: usize| {
            let normal = sites.normals[i].as_dvec3().normalize_or_zero();
            let met = self.ray(sites.points[i].as_dvec3(), -normal, INSIDE_MM);
            let is_side = |(_, place): &(f64, u32)| self.facing(*place).dot(normal) <= -OPPOSITE;
            met.filter(is_side).map_or(f64::INFINITY, |(distance, _)| distance)
        };
        let blocks = par::map_blocks(sites.len(), BLOCK, |range| range.map(of).collect::<Vec<_>>());
        blocks.concat()
    }
}
