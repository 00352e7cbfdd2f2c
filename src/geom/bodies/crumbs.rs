//! Pieces that are too small to be a body.

use super::append;
use super::pieces::pieces;
use crate::geom::Mesh;
use crate::geom::check::topology::Topology;
use crate::geom::check::volume_of;

/// Removes pieces that enclose less than this volume, mm³, with their vertices.
pub(crate) fn drop_crumbs(mesh: &mut Mesh, least_mm3: f64) {
    let pieces = pieces(mesh, &Topology::of(mesh));
    let is_kept = |faces: &&Vec<u32>| volume_of(mesh, faces).abs() >= least_mm3;
    let kept: Vec<u32> = pieces.iter().filter(is_kept).flatten().copied().collect();
    let mut whole = Mesh::default();
    append(&mut whole, mesh, &kept);
    *mesh = whole;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::cuboid;
    use glam::DVec3;

    #[test]
    fn small_pieces_go_with_their_vertices_and_large_ones_keep_their_order() {
        let mut mesh = Mesh::default();
        for (side, x) in [(0.1, 0.0), (3.0, 10.0), (0.2, 20.0), (2.0, 30.0)] {
            let n = mesh.vertices.len() as u32;
            let cube = cuboid(DVec3::splat(side));
            mesh.vertices.extend(cube.vertices.iter().map(|v| *v + DVec3::X * x));
            mesh.triangles.extend(cube.triangles.iter().map(|t| t.map(|v| v + n)));
        }
        drop_crumbs(&mut mesh, 0.5);
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (16, 24));
        assert!((mesh.volume() - 35.0).abs() < 1e-9);
        assert!((mesh.vertices[0].x - 10.0).abs() < 2.0 && (mesh.vertices[8].x - 30.0).abs() < 2.0);
        drop_crumbs(&mut mesh, 100.0);
        assert!(mesh.vertices.is_empty() && mesh.triangles.is_empty());
    }
}
