//! Triangles without area that bound nothing: no surface, but they widen the part's box, or leave edges open.

use super::Change;
use crate::geom::Mesh;
use crate::geom::check::SLIVER;
use crate::geom::check::topology::{Topology, Use, has_three_corners};
use crate::geom::weld::{join, root};

/// Drops slivers that hang together if some edge of theirs is open and none is without them, and triangles with a
/// corner used twice that reach beyond the others; their vertices go with them. A mesh of nothing else stays as it is.
///
/// Triangles without area between others stay: they close the surface, and hold neither sites nor tools off.
pub fn drop_loose(mesh: &mut Mesh) -> Option<Change> {
    if mesh.check().is_err() {
        return None;
    }
    let least = SLIVER * mesh.diagonal();
    let is_thin = |f: usize| {
        let [a, b, c] = mesh.corners(f);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        !mesh.has_area(f) || mesh.area_vector(f).length() < least * longest
    };
    let n = mesh.triangles.len();
    let thin: Vec<bool> = (0..n).map(is_thin).collect();
    if !thin.contains(&true) {
        return None;
    }
    let mut loose = open_groups(&Topology::of(mesh), &thin);
    let mut used = vec![false; mesh.vertices.len()];
    for (f, triangle) in mesh.triangles.iter().enumerate() {
        if has_three_corners(triangle) && !loose[f] {
            triangle.iter().for_each(|&v| used[v as usize] = true);
        }
    }
    for (f, triangle) in mesh.triangles.iter().enumerate() {
        loose[f] |= triangle.iter().any(|&v| !used[v as usize]);
    }
    let n_loose = loose.iter().filter(|is_loose| **is_loose).count();
    if n_loose == 0 || n_loose == n {
        return None;
    }
    let mut number = vec![0; used.len()];
    let mut n_used = 0;
    for (v, _) in used.iter().enumerate().filter(|(_, used)| **used) {
        (number[v], mesh.vertices[n_used]) = (n_used as u32, mesh.vertices[v]);
        n_used += 1;
    }
    mesh.vertices.truncate(n_used);
    let mut faces = loose.iter();
    mesh.triangles.retain(|_| faces.next() == Some(&false));
    mesh.triangles.iter_mut().for_each(|t| *t = t.map(|v| number[v as usize]));
    Some(Change::DroppedLoose(n_loose))
}

/// Of the groups of such faces that hang together, those with an open edge and none without them.
fn open_groups(topology: &Topology, thin: &[bool]) -> Vec<bool> {
    let is_thin = |u: &&Use| thin[u.face as usize];
    let mut parent: Vec<u32> = (0..thin.len() as u32).collect();
    for uses in topology.edges() {
        let mut faces = uses.iter().filter(is_thin).map(|u| u.face);
        if let Some(first) = faces.next() {
            faces.for_each(|face| join(&mut parent, first, face));
        }
    }
    let (mut is_open, mut closes) = (vec![false; thin.len()], vec![false; thin.len()]);
    for uses in topology.edges() {
        let Some(first) = uses.iter().find(is_thin) else { continue };
        let group = root(&mut parent, first.face) as usize;
        is_open[group] |= !is_balanced(uses.iter());
        closes[group] |= !is_balanced(uses.iter().filter(|u| !is_thin(u)));
    }
    let mut is_loose = |f: usize| {
        let group = root(&mut parent, f as u32) as usize;
        thin[f] && is_open[group] && !closes[group]
    };
    (0..thin.len()).map(&mut is_loose).collect()
}

/// Whether an edge is passed equally often in both directions.
fn is_balanced<'a>(uses: impl Iterator<Item = &'a Use>) -> bool {
    uses.map(|u| if u.forward { 1 } else { -1 }).sum::<i32>() == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::cuboid;
    use glam::{DVec3, dvec3};

    fn with_triangle(corners: [DVec3; 3]) -> Mesh {
        let mut mesh = cuboid(dvec3(40.0, 30.0, 20.0));
        let n = mesh.vertices.len() as u32;
        mesh.vertices.extend(corners);
        mesh.triangles.insert(3, [n, n + 1, n + 2]);
        crate::geom::weld::weld(&mesh, 1e-6).unwrap()
    }

    #[test]
    fn triangles_without_area_apart_from_the_part_go_with_their_corners() {
        let at = dvec3(20.0, 15.0, 60.0);
        let along = dvec3(0.3, 0.7, 0.1);
        let rounded = |k: f64| (at + along * k).as_vec3().as_dvec3();
        for corners in [
            [at; 3],
            [at, at, at + along],
            [at - along, at, at + 17.0 * along],
            [rounded(0.0), rounded(3.3), rounded(9.7)],
        ] {
            let mut mesh = with_triangle(corners);
            assert_eq!(drop_loose(&mut mesh), Some(Change::DroppedLoose(1)), "{corners:?}");
            let block = cuboid(dvec3(40.0, 30.0, 20.0));
            assert_eq!(mesh.bounds(), block.bounds());
            assert_eq!(mesh.triangles.len(), 12);
            assert_eq!(mesh.volume(), block.volume());
        }
    }

    #[test]
    fn triangles_without_area_that_leave_an_edge_open_go() {
        let block = cuboid(dvec3(40.0, 30.0, 20.0));
        let on_edge = [dvec3(0.0, 0.0, 20.0), dvec3(40.0, 0.0, 20.0), dvec3(20.0, 0.0, 20.0)];
        let mut one = with_triangle(on_edge);
        assert_eq!(
            (one.triangles.len(), drop_loose(&mut one)),
            (13, Some(Change::DroppedLoose(1)))
        );
        assert_eq!((one.volume(), one.vertices.len()), (block.volume(), 8));
        // A second one hangs on the first.
        let mut two = with_triangle(on_edge);
        let middle = two.vertices.len() as u32;
        two.vertices.push(dvec3(10.0, 0.0, 20.0));
        let first = two.triangles[3];
        two.triangles.push([first[2], first[0], middle]);
        assert_eq!(drop_loose(&mut two), Some(Change::DroppedLoose(2)));
        assert!(crate::geom::check::check(&two).require_bodies().is_ok());
    }

    #[test]
    fn what_has_an_area_or_closes_the_part_stays() {
        let mut with_area = with_triangle([DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| p + 50.0));
        assert_eq!(drop_loose(&mut with_area), None);
        let mut stitched = cuboid(DVec3::ONE);
        stitched.triangles.push([1, 1, 2]);
        assert_eq!(drop_loose(&mut stitched), None);
        let mut nothing_else =
            Mesh { vertices: vec![DVec3::ZERO, DVec3::X], triangles: vec![[0, 0, 1]] };
        assert_eq!(drop_loose(&mut nothing_else), None);
        let mut missing = cuboid(DVec3::ONE);
        missing.triangles[3][2] = 8;
        assert_eq!(drop_loose(&mut missing), None);
    }
}
