//! Which triangles of a mesh bound one body: those that hang together, also where bodies share edges.

use crate::geom::Mesh;
use crate::geom::check::topology::{Topology, Use};
use crate::geom::weld::{join as unite, root};
use glam::DVec3;
use std::collections::BTreeMap;

/// The triangles of each piece, in the order of their first.
pub(super) fn pieces(mesh: &Mesh, topology: &Topology) -> Vec<Vec<u32>> {
    let n_triangles = mesh.triangles.len();
    let mut parent: Vec<u32> = (0..n_triangles as u32).collect();
    let mut used = vec![false; n_triangles];
    for uses in topology.edges() {
        uses.iter().for_each(|u| used[u.face as usize] = true);
        if let [a, b] = uses {
            unite(&mut parent, a.face, b.face);
        }
    }
    for uses in topology.edges().filter(|uses| uses.len() > 2) {
        for [a, b] in with_material_between(mesh, uses, &mut parent) {
            unite(&mut parent, a, b);
        }
    }
    let mut pieces: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for face in (0..n_triangles as u32).filter(|f| used[*f as usize]) {
        pieces.entry(root(&mut parent, face)).or_default().push(face);
    }
    pieces.into_values().collect()
}

/// Pairs of the triangles at an edge between which there is material; those that hang together already come first.
/// None, unless as many triangles pass the edge one way as the other.
fn with_material_between(mesh: &Mesh, uses: &[Use], parent: &mut [u32]) -> Vec<[u32; 2]> {
    /// Triangles whose angles differ by less lie on each other, radians.
    const SAME_RAD: f64 = 1e-7;
    let [low, high] = uses[0].ends().map(|v| mesh.vertices[v as usize]);
    let axis = (high - low).normalize_or_zero();
    let [x, y] = {
        let x = axis.any_orthonormal_vector();
        [x, axis.cross(x)]
    };
    // Turning right-handed about the edge, material begins behind a triangle that passes it backward, and ends at one
    // that passes it forward.
    let angle = |u: &Use| {
        let third = mesh.triangles[u.face as usize].into_iter().find(|v| !u.ends().contains(v));
        let away = third.map_or(DVec3::ZERO, |v| mesh.vertices[v as usize] - low);
        libm::atan2(away.dot(y), away.dot(x))
    };
    let mut pairs = Vec::new();
    let mut left: Vec<(f64, bool, u32)> =
        uses.iter().map(|u| (angle(u), u.forward, u.face)).collect();
    while let Some((i, j)) = same_piece(&left, parent) {
        let (last, first) = (left.remove(i.max(j)), left.remove(i.min(j)));
        pairs.push([first.2, last.2]);
    }
    if 2 * left.iter().filter(|(_, ends, _)| *ends).count() != left.len() {
        return Vec::new();
    }
    left.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    // Of triangles that lie on each other, material ends before other material begins.
    let mut begin = 0;
    for k in 1..=left.len() {
        if k == left.len() || left[k].0 - left[k - 1].0 > SAME_RAD {
            left[begin..k].sort_by_key(|(_, ends, face)| (!ends, *face));
            begin = k;
        }
    }
    // Twice around: what is open at the start is closed the second time.
    let mut open: Vec<u32> = Vec::new();
    let mut done = vec![false; left.len()];
    for k in (0..2 * left.len()).map(|k| k % left.len()) {
        let (_, ends, face) = left[k];
        match open.last() {
            Some(other) if ends && !done[k] => {
                pairs.push([*other, face]);
                open.pop();
                done[k] = true;
            }
            _ if !ends && !done[k] => {
                open.push(face);
                done[k] = true;
            }
            _ => {}
        }
    }
    pairs
}

/// The first two that pass the edge opposite ways and are of one piece.
fn same_piece(uses: &[(f64, bool, u32)], parent: &mut [u32]) -> Option<(usize, usize)> {
    for i in 0..uses.len() {
        for j in i + 1..uses.len() {
            let is_pair = uses[i].1 != uses[j].1;
            if is_pair && root(parent, uses[i].2) == root(parent, uses[j].2) {
                return Some((i, j));
            }
        }
    }
    None
}

/// Whether every piece passes each of its edges once each way.
pub(super) fn are_closed(topology: &Topology, pieces: &[Vec<u32>], n_triangles: usize) -> bool {
    let owner = owners(pieces, n_triangles);
    topology.edges().all(|uses| {
        let mut balance: BTreeMap<u32, [u32; 2]> = BTreeMap::new();
        for u in uses {
            balance.entry(owner[u.face as usize]).or_default()[usize::from(u.forward)] += 1;
        }
        balance.into_values().all(|passes| passes == [1, 1])
    })
}

/// Per triangle the number of its piece, `u32::MAX` for none.
pub(super) fn owners(pieces: &[Vec<u32>], n_triangles: usize) -> Vec<u32> {
    let mut owner = vec![u32::MAX; n_triangles];
    for (i, faces) in pieces.iter().enumerate() {
        faces.iter().for_each(|f| owner[*f as usize] = i as u32);
    }
    owner
}
