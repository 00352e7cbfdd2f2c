//! Meshes as solids of the crate that joins them, and back.

use crate::geom::Mesh;
#[cfg(feature = "formats")]
use crate::geom::check::topology::Topology;
use glam::DVec3;
use manifold_rust::manifold::Manifold;
use manifold_rust::types::MeshGLP;

/// The union of two solids, each of one or more bodies that are clear of one another; `None` if one bounds no solid, or
/// the union does not.
#[cfg(feature = "formats")]
pub(crate) fn union(part: &Mesh, other: &Mesh) -> Option<Mesh> {
    let mesh = mesh_of(&solid_of(part)?.union(&solid_of(other)?));
    let (least, most) = (part.volume(), part.volume() + other.volume());
    let room = 1e-6 * most;
    let is_plausible = (least - room..=most + room).contains(&mesh.volume());
    (is_plausible && Topology::of(&mesh).unbalanced().next().is_none()).then_some(mesh)
}

/// None if the mesh bounds no solid.
pub(super) fn solid_of(mesh: &Mesh) -> Option<Manifold> {
    let solid = Manifold::from_mesh_glp(&MeshGLP::<f64, u32> {
        num_prop: 3,
        vert_properties: mesh.vertices.iter().flat_map(|v| v.to_array()).collect(),
        tri_verts: mesh.triangles.as_flattened().to_vec(),
        ..Default::default()
    });
    (!solid.is_empty()).then_some(solid)
}

/// The surface of a solid.
pub(super) fn mesh_of(solid: &Manifold) -> Mesh {
    let mesh: MeshGLP<f64, u32> = solid.get_mesh_glp(-1);
    let corners = mesh.vert_properties.chunks_exact(mesh.num_prop as usize);
    let vertices = corners.map(|p| DVec3::new(p[0], p[1], p[2])).collect();
    Mesh { vertices, triangles: mesh.tri_verts.as_chunks().0.to_vec() }
}

#[cfg(all(test, feature = "formats"))]
mod tests {
    use super::*;
    use crate::geom::solids::cuboid;

    #[test]
    fn the_union_of_a_block_and_two_others_is_one_solid_of_their_volume() {
        let moved = |x: f64| {
            let mut mesh = cuboid(DVec3::splat(2.0));
            mesh.vertices.iter_mut().for_each(|v| *v += DVec3::new(x, 1.0, 1.0));
            mesh
        };
        let mut ends = moved(-1.0);
        let other = moved(9.0);
        ends.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + 8)));
        ends.vertices.extend(other.vertices);
        let whole = union(&cuboid(DVec3::new(10.0, 4.0, 4.0)), &ends).unwrap();
        assert!((whole.volume() - 168.0).abs() < 1e-9);
        let open = Mesh { triangles: ends.triangles[1..].to_vec(), ..ends.clone() };
        assert!(union(&ends, &open).is_none() && union(&open, &ends).is_none());
    }
}
