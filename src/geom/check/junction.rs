//! T-junctions: a corner of one triangle in the middle of another's edge, which both stay open there.

use super::topology::Topology;
use crate::geom::{Mesh, weld};
use crate::spatial::AabbGrid;
use glam::DVec3;

/// Pairs of a vertex and an edge that are looked at, at most: many edges may lie in one line.
const MOST_PAIRS: usize = 50_000_000;

/// Vertices of open edges that lie within another open edge, ascending.
pub(super) fn t_junctions(mesh: &Mesh, topology: &Topology) -> Vec<u32> {
    let open = topology.edges().filter(|uses| uses.len() == 1).map(|uses| uses[0].ends());
    let at = |v: u32| mesh.vertices[v as usize];
    let edges: Vec<[u32; 2]> =
        open.filter(|ends| ends.iter().all(|v| at(*v).is_finite())).collect();
    if edges.is_empty() {
        return Vec::new();
    }
    let near = weld::DEFAULT_TOLERANCE * mesh.diagonal();
    let bounds = |ends: &[u32; 2]| {
        let [a, b] = ends.map(at);
        (a.min(b) - near, a.max(b) + near)
    };
    let grid = AabbGrid::new(&edges.iter().map(bounds).collect::<Vec<_>>());
    let mut vertices: Vec<u32> = edges.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let mut left = MOST_PAIRS;
    let is_within = |v: &u32| {
        let candidates = grid.in_cell(grid.cell_of(at(*v)));
        left = left.saturating_sub(candidates.len());
        left > 0
            && candidates
                .iter()
                .map(|e| edges[*e as usize])
                .any(|ends| !ends.contains(v) && lies_within(at(*v), ends.map(at), near))
    };
    vertices.retain(is_within);
    vertices
}

/// Whether a point is on a segment, farther than `near` from its ends.
fn lies_within(point: DVec3, [a, b]: [DVec3; 2], near: f64) -> bool {
    let along = b - a;
    let share = (point - a).dot(along) / along.length_squared();
    let foot = a + share * along;
    share > 0.0
        && share < 1.0
        && foot.distance(point) <= near
        && point.distance(a) > near
        && point.distance(b) > near
}

#[cfg(test)]
mod tests {
    use super::super::{Fault, check, require_labelable};
    use super::*;
    use crate::geom::solids::cuboid;

    /// A cube of which one edge of one triangle is cut in the middle.
    fn cut_cube() -> Mesh {
        let mut mesh = cuboid(DVec3::splat(10.0));
        let [a, b, c] = mesh.triangles[0];
        mesh.vertices.push(0.5 * (mesh.vertices[a as usize] + mesh.vertices[b as usize]));
        mesh.triangles[0] = [a, 8, c];
        mesh.triangles.push([8, b, c]);
        mesh
    }

    #[test]
    fn a_corner_within_an_edge_is_a_t_junction_and_a_hole_is_none() {
        let report = check(&cut_cube());
        let found: Vec<_> = report.findings.iter().map(|f| (f.fault, f.count)).collect();
        assert_eq!(found, [(Fault::TJunction, 1), (Fault::OpenEdge, 3)]);
        assert!(!report.is_closed());
        let message = require_labelable(&cut_cube()).unwrap_err().to_string();
        assert!(message.starts_with("vertex 8 (") && message.contains("1 T-junction"), "{message}");
        let mut hole = cuboid(DVec3::splat(10.0));
        hole.triangles.pop();
        assert_eq!(check(&hole).count(Fault::TJunction), 0);
        // Sides that share no vertices touch at their ends only.
        let cube = cuboid(DVec3::ONE);
        let vertices: Vec<DVec3> = (0..12).flat_map(|f| cube.corners(f)).collect();
        let triangles = (0..12).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        assert_eq!(check(&Mesh { vertices, triangles }).count(Fault::TJunction), 0);
    }

    #[test]
    fn many_edges_in_one_line_take_no_time_quadratic_in_their_number() {
        let n = 100_000;
        let x = |k: u32| DVec3::new(f64::from(k), 0.0, 0.0);
        let mut vertices: Vec<DVec3> = (0..n).map(x).collect();
        vertices.push(DVec3::Y);
        let triangles = (1..n).map(|k| [0, k, n]).collect();
        let report = check(&Mesh { vertices, triangles });
        assert!(report.count(Fault::TJunction) > 0);
    }
}
