//! The folds of a mesh: edges that two of its faces share, flat, turning as a curve does, or corners.

use crate::exec::par;
use crate::geom::Mesh;
use crate::spatial::CountingSort;
use glam::DVec3;

/// Turns up to this belong to a curve: ten facets to the full turn.
const SMOOTH_RAD: f64 = 0.63;
/// Turns from this on are corners.
const CORNER_RAD: f64 = 0.785;
/// Turns below this are rounding.
const FLAT_RAD: f64 = 1e-5;
/// So are turns of faces whose corners are off by this share of the part's size, for their heights, up to another.
const ROUNDING: f64 = 2.4e-7;
const MOST_ROUNDING_RAD: f64 = 1e-3;
/// Vertices per task.
const VERTICES: usize = 4096;

/// Two faces over an edge, by half edge: three times the face, plus the number of the corner where it begins.
pub(super) struct Fold {
    pub halves: [u32; 2],
    /// Concave turn, radians; 0 for a flat edge or a corner.
    pub turn: f64,
    /// How much it counts as a turn of a curve, 0 to 1.
    pub counted: f64,
    pub kind: FoldKind,
}

impl Fold {
    pub fn faces(&self) -> [usize; 2] {
        self.halves.map(|half| half as usize / 3)
    }

    /// As its two faces have it.
    pub fn sides(&self) -> [Side; 2] {
        let ([x, y], &Fold { turn, counted, .. }) = (self.halves, self);
        [(x, y), (y, x)].map(|(half, other)| Side { turn, counted, half, other })
    }
}

/// A fold as one of its faces has it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side {
    /// As [`Fold::turn`].
    pub turn: f64,
    /// As [`Fold::counted`].
    pub counted: f64,
    /// Its half edge.
    pub half: u32,
    /// The other face's.
    pub other: u32,
}

#[derive(PartialEq)]
pub(super) enum FoldKind {
    Flat,
    Curve,
    /// The edge of a curve's facet is a chord as well: another face that begins there reaches in as far.
    Corner,
}

/// How much a turn counts.
pub(super) fn smoothness(turn: f64) -> f64 {
    ((CORNER_RAD - turn) / (CORNER_RAD - SMOOTH_RAD)).clamp(0.0, 1.0)
}

/// The ends of a half edge.
pub(super) fn edge(mesh: &Mesh, half: u32) -> [DVec3; 2] {
    let (corners, k) = (mesh.corners(half as usize / 3), half as usize % 3);
    [corners[k], corners[(k + 1) % 3]]
}

/// Height of a face over one of its edges.
pub(super) fn height(mesh: &Mesh, half: u32) -> f64 {
    let [a, b] = edge(mesh, half);
    let edge = (b - a).length();
    if edge > 0.0 { mesh.area_vector(half as usize / 3).length() / edge } else { 0.0 }
}

/// The folds over all edges that two faces share, but for convex curves.
pub(super) fn folds(mesh: &Mesh) -> Vec<Fold> {
    let ends = |half: u32| {
        let (corners, k) = (mesh.triangles[half as usize / 3], half as usize % 3);
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        [a.min(b), a.max(b)]
    };
    let size = mesh.vertices.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    let n_halves = 3 * mesh.triangles.len() as u32;
    let mut sort = CountingSort::default();
    sort.clear(mesh.vertices.len());
    (0..n_halves).for_each(|half| sort.count(ends(half)[0] as usize));
    sort.finish_counting();
    let mut by_lower_end = vec![[0; 2]; n_halves as usize];
    for half in 0..n_halves {
        let [low, high] = ends(half);
        by_lower_end[sort.place(low as usize)] = [high, half];
    }
    let blocks = par::map_blocks(mesh.vertices.len(), VERTICES, |range| {
        let mut found = Vec::new();
        let mut edges = Vec::new();
        for vertex in range {
            edges.clear();
            edges.extend_from_slice(&by_lower_end[sort.range(vertex, vertex)]);
            edges.sort_unstable();
            for same in edges.chunk_by(|x, y| x[0] == y[0]) {
                let &[[_, x], [_, y]] = same else { continue };
                found.extend(fold(mesh, [x, y], size));
            }
        }
        found
    });
    blocks.into_iter().flatten().collect()
}

/// Turns of two faces that are rounding, for corners of a part of a size.
fn rounding(mesh: &Mesh, halves: [u32; 2], size: f64) -> f64 {
    let [x, y] = halves.map(|half| height(mesh, half));
    (ROUNDING * size / x.min(y)).clamp(FLAT_RAD, MOST_ROUNDING_RAD)
}

/// The fold over two half edges; none for a convex curve.
fn fold(mesh: &Mesh, halves: [u32; 2], size: f64) -> Option<Fold> {
    let [n, m] = halves.map(|half| mesh.area_vector(half as usize / 3).normalize_or_zero());
    if n == DVec3::ZERO || m == DVec3::ZERO {
        return None;
    }
    let turn = libm::atan2(n.cross(m).length(), n.dot(m));
    let kind = match turn {
        turn if turn < FLAT_RAD => FoldKind::Flat,
        turn if turn < MOST_ROUNDING_RAD && turn < rounding(mesh, halves, size) => FoldKind::Flat,
        turn if turn >= CORNER_RAD => FoldKind::Corner,
        _ => FoldKind::Curve,
    };
    let corner = |half: u32, k: usize| mesh.corners(half as usize / 3)[(half as usize + k) % 3];
    let rises = n.dot(across(mesh, halves[1]) - corner(halves[0], 0)) > 0.0;
    match kind {
        FoldKind::Curve if !rises => None,
        FoldKind::Curve => Some(Fold { halves, turn, counted: 0.0, kind }),
        _ => Some(Fold { halves, turn: 0.0, counted: 0.0, kind }),
    }
}

/// The corner of a face across from one of its edges.
fn across(mesh: &Mesh, half: u32) -> DVec3 {
    mesh.corners(half as usize / 3)[(half as usize % 3 + 2) % 3]
}
