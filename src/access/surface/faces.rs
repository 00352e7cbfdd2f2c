//! Faces of a part: connected triangles without a sharp edge between them; and which of them are in the way.

use crate::geom::{Mesh, Sites};
use glam::DVec3;

/// Edges that turn by more than this separate faces, radians.
const SHARP_RAD: f64 = 0.5;

/// A smooth connected region of a part that is in the way.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct BlockingFace {
    /// A triangle of it, the first.
    pub triangle: u32,
    /// Area, mm².
    pub area_mm2: f64,
    /// Mean place of its surface, mm.
    pub middle: DVec3,
    /// Mean outward normal; zero for a closed region.
    pub normal: DVec3,
    /// Share of β, summed over all sites, that its sites have.
    pub share: f64,
}

/// The faces with the greatest shares of `beta` (one entry per site), at most `n`, greatest first; none without β.
///
/// # Panics
/// If a site names a triangle that the mesh lacks.
pub fn blocking_faces(mesh: &Mesh, sites: &Sites, beta: &[u64], n: usize) -> Vec<BlockingFace> {
    let first = faces(mesh);
    let mut sums = vec![0u64; first.len()];
    for (&triangle, &beta) in sites.faces.iter().zip(beta) {
        sums[first[triangle as usize] as usize] += beta;
    }
    let total: u64 = sums.iter().sum();
    let mut order: Vec<u32> = (0..first.len() as u32).filter(|&f| sums[f as usize] > 0).collect();
    order.sort_by_key(|&f| (std::cmp::Reverse(sums[f as usize]), f));
    order.truncate(n);
    let describe = |triangle: u32| {
        let (mut area, mut middle, mut normal) = (0.0, DVec3::ZERO, DVec3::ZERO);
        for f in (0..first.len()).filter(|&f| first[f] == triangle) {
            let vector = 0.5 * mesh.area_vector(f);
            let [a, b, c] = mesh.corners(f);
            area += vector.length();
            middle += (a + b + c) / 3.0 * vector.length();
            normal += vector;
        }
        let closed = normal.length() < 1e-3 * area;
        BlockingFace {
            triangle,
            area_mm2: area,
            middle: middle / area,
            normal: if closed { DVec3::ZERO } else { normal.normalize_or_zero() },
            share: sums[triangle as usize] as f64 / total as f64,
        }
    };
    order.into_iter().map(describe).collect()
}

/// Per triangle, the first triangle of its face.
pub(super) fn faces(mesh: &Mesh) -> Vec<u32> {
    let mut first: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (f, corners) in mesh.triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], f as u32));
        }
    }
    edges.sort_unstable();
    let least = libm::cos(SHARP_RAD);
    let normal = |f: u32| mesh.area_vector(f as usize).normalize_or_zero();
    for same in edges.chunk_by(|x, y| x.0 == y.0) {
        let &[(_, f), (_, g)] = same else { continue };
        if normal(f).dot(normal(g)) > least {
            let (f, g) = (root(&mut first, f), root(&mut first, g));
            first[f.max(g) as usize] = f.min(g);
        }
    }
    (0..first.len() as u32).map(|f| root(&mut first, f)).collect()
}

/// The first triangle of a chain, which is shortened on the way.
pub(super) fn root(first: &mut [u32], mut f: u32) -> u32 {
    while first[f as usize] != f {
        first[f as usize] = first[first[f as usize] as usize];
        f = first[f as usize];
    }
    f
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::{cuboid, torus};
    use glam::Vec3;

    #[test]
    fn a_box_has_six_faces_and_a_torus_one() {
        let count =
            |mesh: &Mesh| faces(mesh).iter().enumerate().filter(|(f, g)| *f as u32 == **g).count();
        assert_eq!(count(&cuboid(DVec3::splat(2.0))), 6);
        assert_eq!(count(&torus(10.0, 4.0, 40, 20)), 1);
    }

    #[test]
    fn the_face_with_most_beta_comes_first() {
        let mesh = cuboid(glam::dvec3(2.0, 3.0, 4.0));
        let top = (0..12).find(|&f| mesh.area_vector(f).z > 0.0).unwrap() as u32;
        let side = (0..12).find(|&f| mesh.area_vector(f).x > 0.0).unwrap() as u32;
        let sites =
            Sites { points: vec![Vec3::ZERO; 3], normals: vec![], faces: vec![side, top, top] };
        let found = blocking_faces(&mesh, &sites, &[3, 4, 5], 5);
        assert_eq!((found.len(), found[0].share, found[0].normal), (2, 0.75, DVec3::Z));
        assert!((found[0].area_mm2 - 6.0).abs() < 1e-12);
        assert_eq!(found[0].middle, glam::dvec3(1.0, 1.5, 4.0));
        assert!(blocking_faces(&mesh, &sites, &[0; 3], 5).is_empty());
    }
}
