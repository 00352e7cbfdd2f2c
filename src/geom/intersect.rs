//! The search for pairs of triangles that pierce, cross or lie on each other.
//!
//! Decided by signs of determinants without rounding error (Shewchuk 1997). Two triangles intersect if
//! an edge of one passes from one side of the other's plane to the other side through the triangle or
//! its border, or if they lie in one plane and overlap in area. Sharing a vertex or an edge, or touching
//! with a vertex, is no intersection. Candidates come from a uniform grid; O(n) for meshes whose triangles
//! meet few others.

use super::Mesh;
use super::check::topology::has_three_corners;
use super::check::{Fault, Finding, N_PLACES, Place};
use crate::exec::par;
use crate::spatial::AabbGrid;
use glam::{DVec2, DVec3};
use robust::{Coord, Coord3D, orient2d, orient3d};

/// Cells per parallel task.
const BLOCK: usize = 128;
/// Most pairs looked for in one cell: a mesh with more is hopeless, and counting them all could take
/// the square of its size.
const MAX_PAIRS: usize = 10_000;

/// The intersecting pairs of triangles, ascending, the lower index first; all of them, unless more
/// than 10,000 crowd in one cell of the search grid.
///
/// # Panics
/// If a triangle names a missing vertex ([`Mesh::check`]).
pub fn pairs(mesh: &Mesh) -> Vec<[u32; 2]> {
    let bounds = |f: usize| {
        let [a, b, c] = mesh.corners(f);
        (a.min(b).min(c), a.max(b).max(c))
    };
    let bounds: Vec<_> = (0..mesh.triangles.len()).map(bounds).collect();
    let grid = AabbGrid::new(&bounds);
    let in_cells = par::map_blocks(grid.n_cells(), BLOCK, |cells| {
        let mut found = Vec::new();
        for cell in cells {
            let has_area = |f: &&u32| has_three_corners(&mesh.triangles[**f as usize]);
            let begins = |f: &u32| (*f, grid.same_axes(bounds[*f as usize].0, cell));
            let near: Vec<(u32, u8)> =
                grid.in_cell(cell).iter().filter(has_area).map(begins).collect();
            // A pair that meets in several cells is looked at in one: that in which what is common to their boxes
            // begins.
            let begins_here = |a: u8, b: u8| a | b == 0b111;
            let is_there: [bool; 8] =
                std::array::from_fn(|axes| near.iter().any(|(_, of)| usize::from(*of) == axes));
            let has_partner =
                |of: u8| (0..8).any(|axes| is_there[usize::from(axes)] && begins_here(of, axes));
            let candidates = near.iter().enumerate().filter(|(_, (_, of))| has_partner(*of));
            let candidates = candidates.flat_map(|(k, (a, of))| {
                let others = near[k + 1..].iter().filter(|(_, other)| begins_here(*of, *other));
                others.map(|(b, _)| [*a, *b])
            });
            let meet = |[a, b]: &[u32; 2]| {
                let (one, other) = (bounds[*a as usize], bounds[*b as usize]);
                one.0.max(other.0).cmple(one.1.min(other.1)).all()
                    && intersect(mesh, *a as usize, *b as usize)
            };
            found.extend(candidates.filter(meet).take(MAX_PAIRS));
        }
        found
    });
    let mut pairs: Vec<_> = in_cells.into_iter().flatten().collect();
    pairs.sort_unstable();
    pairs
}

/// [`pairs`] as a finding; `None` if there are none.
///
/// # Panics
/// As [`pairs`].
pub fn finding(mesh: &Mesh) -> Option<Finding> {
    let pairs = pairs(mesh);
    let place = |pair: &[u32; 2]| Place::Triangles(*pair, between(mesh, *pair));
    let places = pairs.iter().take(N_PLACES).map(place).collect();
    let fault = Fault::SelfIntersection;
    (!pairs.is_empty()).then_some(Finding { fault, count: pairs.len(), places })
}

/// The middle of what the bounding boxes of two triangles have in common.
fn between(mesh: &Mesh, pair: [u32; 2]) -> DVec3 {
    let [f, g] = pair.map(|f| mesh.corners(f as usize));
    let low = |[a, b, c]: [DVec3; 3]| a.min(b).min(c);
    let high = |[a, b, c]: [DVec3; 3]| a.max(b).max(c);
    0.5 * (low(f).max(low(g)) + high(f).min(high(g)))
}

/// Whether two triangles with three corners each intersect.
fn intersect(mesh: &Mesh, f: usize, g: usize) -> bool {
    let (tf, tg) = (&mesh.triangles[f], &mesh.triangles[g]);
    let (a, b) = (mesh.corners(f), mesh.corners(g));
    let heights_a = a.map(|p| above(&b, p));
    if same_side(heights_a) {
        return false;
    }
    let heights_b = b.map(|p| above(&a, p));
    if same_side(heights_b) {
        return false;
    }
    if heights_a == [0; 3] {
        return overlap_in_plane(&a, &b);
    }
    pierces(&a, heights_a, &b, |v| tg.contains(&tf[v]))
        || pierces(&b, heights_b, &a, |v| tf.contains(&tg[v]))
}

fn same_side(heights: [i32; 3]) -> bool {
    heights == [1; 3] || heights == [-1; 3]
}

/// Side of the plane of a triangle on which `p` lies: +1 the side it faces, 0 on it. A triangle
/// without area has all points on its plane.
fn above(&[a, b, c]: &[DVec3; 3], p: DVec3) -> i32 {
    let coord = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    -sign(orient3d(coord(a), coord(b), coord(c), coord(p)))
}

fn sign(value: f64) -> i32 {
    i32::from(value > 0.0) - i32::from(value < 0.0)
}

/// Whether an edge of `a` that has no end in `shared` passes through the triangle `b`, border included.
fn pierces(
    a: &[DVec3; 3],
    heights: [i32; 3],
    b: &[DVec3; 3],
    shared: impl Fn(usize) -> bool,
) -> bool {
    (0..3).any(|i| {
        let j = (i + 1) % 3;
        if heights[i] * heights[j] >= 0 || shared(i) || shared(j) {
            return false;
        }
        // The line from p to q passes the edges of b all on the same side.
        let turns = [0, 1, 2].map(|k| above(&[a[i], a[j], b[k]], b[(k + 1) % 3]));
        turns.iter().all(|t| *t >= 0) || turns.iter().all(|t| *t <= 0)
    })
}

/// Whether two triangles of one plane have area in common: no edge of either separates them.
fn overlap_in_plane(a: &[DVec3; 3], b: &[DVec3; 3]) -> bool {
    let normal = (a[1] - a[0]).cross(a[2] - a[0]).abs();
    let project = |p: DVec3| {
        if normal.z >= normal.x && normal.z >= normal.y {
            DVec2::new(p.x, p.y)
        } else if normal.y >= normal.x {
            DVec2::new(p.z, p.x)
        } else {
            DVec2::new(p.y, p.z)
        }
    };
    let (a, b) = (counter_clockwise(a.map(project)), counter_clockwise(b.map(project)));
    let (Some(a), Some(b)) = (a, b) else { return false };
    let separates = |a: &[DVec2; 3], b: &[DVec2; 3]| {
        (0..3).any(|i| b.iter().all(|p| turn(a[i], a[(i + 1) % 3], *p) <= 0))
    };
    !separates(&a, &b) && !separates(&b, &a)
}

fn counter_clockwise([a, b, c]: [DVec2; 3]) -> Option<[DVec2; 3]> {
    match turn(a, b, c) {
        1 => Some([a, b, c]),
        -1 => Some([a, c, b]),
        _ => None,
    }
}

fn turn(a: DVec2, b: DVec2, c: DVec2) -> i32 {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    sign(orient2d(coord(a), coord(b), coord(c)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::{cuboid, torus};

    fn two(shift: DVec3) -> Mesh {
        let mut both = cuboid(DVec3::splat(2.0));
        both.vertices.extend(cuboid(DVec3::splat(2.0)).vertices.iter().map(|v| *v + shift));
        both.triangles.extend(cuboid(DVec3::ONE).triangles.iter().map(|t| t.map(|v| v + 8)));
        crate::geom::weld::weld(&both, 0.0).unwrap()
    }

    #[test]
    fn a_solid_does_not_intersect_itself_and_neither_do_neighbors() {
        assert!(pairs(&cuboid(DVec3::ONE)).is_empty());
        assert!(pairs(&torus(3.0, 1.0, 60, 40)).is_empty());
        assert!(pairs(&two(DVec3::splat(3.0))).is_empty());
        assert!(pairs(&two(DVec3::splat(2.0))).is_empty());
    }

    #[test]
    fn overlapping_boxes_intersect_however_they_are_aligned() {
        // In general position; with edges through edges; with faces on faces.
        for shift in [[0.7, 0.9, 1.3], [1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.5, 0.5, 2.0]] {
            let found = pairs(&two(DVec3::from_array(shift)));
            assert!(!found.is_empty(), "{shift:?}");
            assert!(found.iter().all(|[a, b]| *a < 12 && *b >= 12), "{shift:?}");
        }
    }

    #[test]
    fn a_torus_with_too_thick_a_tube_intersects_itself() {
        let found = finding(&torus(1.0, 1.2, 40, 30)).unwrap();
        assert_eq!(found.fault, Fault::SelfIntersection);
        assert_eq!(found.places.len(), 5);
    }

    #[test]
    fn a_flap_folded_onto_its_neighbor_is_found_and_a_flat_quad_is_not() {
        let corner = |x: f64, y: f64| DVec3::new(x, y, 0.3 * x + 0.1 * y);
        let vertices = vec![corner(0., 0.), corner(4., 0.), corner(0., 4.), corner(1., 1.)];
        let fold = Mesh { vertices, triangles: vec![[0, 1, 2], [1, 0, 3]] };
        assert!(pairs(&fold).is_empty(), "0.3 and 0.1 round the corner off the plane");
        let flat = fold.vertices.iter().map(|v| v.with_z(0.0)).collect();
        assert_eq!(pairs(&Mesh { vertices: flat, triangles: fold.triangles }), [[0, 1]]);
        let quad = vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let quad = Mesh { vertices: quad, triangles: vec![[0, 1, 2], [0, 2, 3]] };
        assert!(pairs(&quad).is_empty());
    }

    /// Large triangles touch every cell, collapsed ones crowd in one: no cell but that in which they begin looks at all
    /// pairs.
    #[test]
    fn coincident_triangles_are_paired_in_one_cell_only() {
        let n = 100_000;
        let corner = |i: usize| 1.0 + 1e-7 * (i / 3) as f64;
        let axes = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let vertices = (0..3 * n).map(|i| corner(i) * axes[i % 3]).collect();
        let triangles = (0..n as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        let collapsed = std::iter::repeat_n([0; 3], n);
        let mesh = Mesh { vertices, triangles: triangles.chain(collapsed).collect() };
        assert!(pairs(&mesh).len() >= MAX_PAIRS);
    }

    #[test]
    fn pairs_are_the_same_as_by_trying_all() {
        let mesh = two(DVec3::new(0.7, 0.9, 1.3));
        let n = mesh.triangles.len();
        let all = (0..n).flat_map(|f| (f + 1..n).map(move |g| (f, g)));
        let all: Vec<_> = all
            .filter(|(f, g)| intersect(&mesh, *f, *g))
            .map(|(f, g)| [f as u32, g as u32])
            .collect();
        assert_eq!(pairs(&mesh), all);
    }
}
