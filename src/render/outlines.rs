//! Outlines of what blocks beside the part, for pictures and pages: they show where it is and hide nothing.

use crate::geom::Mesh;
use glam::DVec3;
use std::collections::BTreeMap;

/// What is farther from the part's box than this share of its diagonal is cut off.
const MARGIN: f64 = 0.15;
/// Cosine of the angle between two faces above which the edge between them is not drawn: 20 degrees.
const SMOOTH: f64 = 0.94;
/// More segments say no more.
const MOST: usize = 20_000;

/// Sharp and open edges of `fixtures` near the `part`, mm, and where they are cut off there.
///
/// ```text
/// box = box of the part, wider by 0.15 of its diagonal
/// for each triangle: clip it to the box, side by side
///     an edge of what is left is drawn if it lies on a side of the box, or is a sharp or open edge of the mesh
/// ```
pub fn outlines(fixtures: &Mesh, part: &Mesh) -> Vec<[DVec3; 2]> {
    let Some((low, high)) = part.bounds() else { return Vec::new() };
    let margin = MARGIN * (high - low).length();
    let (low, high) = (low - margin, high + margin);
    let normals: Vec<DVec3> = (0..fixtures.triangles.len())
        .map(|f| fixtures.area_vector(f).normalize_or_zero())
        .collect();
    let mut faces: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    for (f, triangle) in fixtures.triangles.iter().enumerate() {
        for edge in edges(*triangle) {
            faces.entry(edge).or_default().push(f);
        }
    }
    let is_sharp = |edge: &[u32; 2]| match faces[edge][..] {
        [a, b] => normals[a].dot(normals[b]) < SMOOTH,
        _ => true,
    };
    let mut segments = Vec::new();
    for (f, triangle) in fixtures.triangles.iter().enumerate() {
        let edges = edges(*triangle);
        // Two faces share an edge: the first draws it.
        let is_drawn = |edge: &[u32; 2]| is_sharp(edge) && faces[edge][0] == f;
        let corners = fixtures.corners(f);
        let polygon: Vec<Corner> =
            corners.into_iter().zip(edges.map(|edge| is_drawn(&edge))).collect();
        let clipped = (0..6).fold(polygon, |polygon, side| clip(&polygon, side, low, high));
        for (k, (from, is_drawn)) in clipped.iter().enumerate() {
            let to = clipped[(k + 1) % clipped.len()].0;
            if *is_drawn && *from != to && segments.len() < MOST {
                segments.push([*from, to]);
            }
        }
    }
    segments
}

/// A corner of a polygon, and whether the edge that begins there is drawn.
type Corner = (DVec3, bool);

/// The edges of a triangle, each from its lower to its higher vertex.
fn edges([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)])
}

/// The part of a polygon on the inner side of a side of the box; the new edge is drawn.
fn clip(polygon: &[Corner], side: usize, low: DVec3, high: DVec3) -> Vec<Corner> {
    let axis = side / 2;
    let depth = |p: DVec3| match side % 2 {
        0 => p[axis] - low[axis],
        _ => high[axis] - p[axis],
    };
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (k, &(from, is_drawn)) in polygon.iter().enumerate() {
        let to = polygon[(k + 1) % polygon.len()].0;
        let (a, b) = (depth(from), depth(to));
        let crossing = || from + (to - from) * (a / (a - b));
        match (a >= 0.0, b >= 0.0) {
            (true, true) => out.push((from, is_drawn)),
            (true, false) => out.extend([(from, is_drawn), (crossing(), true)]),
            (false, true) => out.push((crossing(), is_drawn)),
            (false, false) => {}
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::cuboid;

    fn length(segments: &[[DVec3; 2]]) -> f64 {
        segments.iter().map(|[a, b]| a.distance(*b)).sum()
    }

    #[test]
    fn a_block_has_its_twelve_edges_and_a_wide_one_ends_near_the_part() {
        let part = cuboid(DVec3::new(40.0, 30.0, 20.0));
        let mut clamp = cuboid(DVec3::splat(4.0));
        let drawn = outlines(&clamp, &part);
        assert_eq!(drawn.len(), 12, "no diagonals");
        assert!((length(&drawn) - 48.0).abs() < 1e-9);
        // Four long edges are cut off; both ends have a border there.
        clamp.vertices.iter_mut().for_each(|v| v.x *= 1000.0);
        let (low, high) = part.bounds().unwrap();
        let margin = MARGIN * (high - low).length();
        let reach = 40.0 + 2.0 * margin;
        let start = clamp.bounds().unwrap().0.x.max(low.x - margin);
        let end = clamp.bounds().unwrap().1.x.min(high.x + margin);
        let drawn = outlines(&clamp, &part);
        assert!(end - start <= reach + 1e-9);
        assert!(drawn.iter().flatten().all(|p| p.x >= start - 1e-9 && p.x <= end + 1e-9));
        assert!((length(&drawn) - (4.0 * (end - start) + 32.0)).abs() < 1e-9, "{}", length(&drawn));
    }

    #[test]
    fn a_table_is_a_rectangle_about_the_part_and_far_things_are_left_out() {
        let part = cuboid(DVec3::new(40.0, 30.0, 20.0));
        let (low, high) = part.bounds().unwrap();
        let square = |z: f64| {
            let corner = |x: f64, y: f64| DVec3::new(1e3 * x, 1e3 * y, z);
            let vertices =
                vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }
        };
        let margin = 2.0 * MARGIN * (high - low).length();
        let around = 2.0 * (high.x - low.x + margin + high.y - low.y + margin);
        assert!((length(&outlines(&square(low.z - 1.0), &part)) - around).abs() < 1e-9);
        assert!(outlines(&square(low.z - 900.0), &part).is_empty());
        assert!(outlines(&square(0.0), &Mesh::default()).is_empty());
    }
}
