//! Pieces that are too small to be a body, and triangles that are too small for a file.

use super::append;
use super::pieces::pieces;
use super::solid::{mesh_of, solid_of};
use crate::geom::Mesh;
use crate::geom::check::topology::Topology;
use crate::geom::check::{self, volume_of};
use crate::geom::weld::{DEFAULT_TOLERANCE, weld};

/// Removes pieces that enclose less than this volume, mm³, with their vertices.
fn drop_crumbs(mesh: &mut Mesh, least_mm3: f64) {
    let pieces = pieces(mesh, &Topology::of(mesh));
    let is_kept = |faces: &&Vec<u32>| volume_of(mesh, faces).abs() >= least_mm3;
    let kept: Vec<u32> = pieces.iter().filter(is_kept).flatten().copied().collect();
    let mut whole = Mesh::default();
    append(&mut whole, mesh, &kept);
    *mesh = whole;
}

/// The first tolerance, as a share of the diagonal: ten times that of the readers.
const FIRST: f64 = 10.0 * DEFAULT_TOLERANCE;

/// Removes pieces that enclose less than `least_mm3` ([`drop_crumbs`]), and collapses short edges and narrow triangles
/// of a solid until it bounds one when it is read again from a file of f32 numbers, where corners near to each other
/// are joined; whether it does then. Surfaces move by no more than `most_mm`.
pub(crate) fn settle(mesh: &mut Mesh, least_mm3: f64, most_mm: f64) -> bool {
    drop_crumbs(mesh, least_mm3);
    if is_solid_when_read(mesh) {
        return true;
    }
    let Some(solid) = solid_of(mesh) else { return false };
    let mut tolerance = FIRST * mesh.diagonal();
    while tolerance <= most_mm {
        let mut simple = mesh_of(&solid.simplify(tolerance));
        // Where a collapse pinches the surface a piece comes off.
        drop_crumbs(&mut simple, least_mm3);
        if is_solid_when_read(&simple) {
            *mesh = simple;
            return true;
        }
        tolerance *= 4.0;
    }
    false
}

fn is_solid_when_read(mesh: &Mesh) -> bool {
    let vertices = mesh.vertices.iter().map(|v| v.as_vec3().as_dvec3()).collect();
    let rounded = Mesh { vertices, triangles: mesh.triangles.clone() };
    weld(&rounded, DEFAULT_TOLERANCE).is_ok_and(|read| check::check(&read).require_bodies().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::bodies::union;
    use crate::geom::solids::cuboid;
    use glam::DVec3;

    #[test]
    fn what_is_settled_is_solid_when_read_and_what_is_not_stays() {
        let (block, mut other) = (cuboid(DVec3::splat(10.0)), cuboid(DVec3::splat(10.0)));
        other.vertices.iter_mut().for_each(|v| *v += DVec3::new(10.0 - 1e-7, 10.0 - 1e-7, 0.0));
        let mut mesh = union(&block, &other).unwrap();
        let before = mesh.clone();
        let is_settled = settle(&mut mesh, 0.1, 0.01);
        assert_eq!(is_settled, is_solid_when_read(&mesh));
        assert!(
            (mesh.volume() - 2000.0).abs() < 0.1
                && (is_settled || mesh.triangles.len() == before.triangles.len())
        );
        let mut good = cuboid(DVec3::splat(10.0));
        assert!(settle(&mut good, 0.1, 0.01) && good.vertices.len() == 8);
    }

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
