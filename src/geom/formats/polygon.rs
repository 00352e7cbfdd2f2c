//! Polygons of any number of corners, cut into triangles by ear clipping.
//!
//! The polygon is seen along its Newell normal; an ear is a convex corner whose triangle holds no
//! other corner. Each step takes the best-shaped ear, so that no needle is made without need.
//! Cost: O(n²) for n corners, O(n) if the polygon is convex.

use super::Mesh;
use crate::{Error, Result};
use glam::{DVec2, DVec3};
use robust::{Coord, orient2d};
use std::path::Path;

/// Most corners of one polygon: the cost grows with the square.
const MAX_CORNERS: usize = 4096;

/// Polygons of a file, each with a number for its place.
pub(super) struct Polygons {
    /// How the format counts its first vertex: 0 or 1.
    first: i64,
    /// Vertices as the file counts them.
    corners: Vec<i64>,
    /// End in `corners` and place of each polygon.
    ends: Vec<(usize, usize)>,
}

impl Polygons {
    pub(super) fn counting_from(first: i64) -> Self {
        Polygons { first, corners: Vec::new(), ends: Vec::new() }
    }

    pub(super) fn push_corner(&mut self, vertex: i64) {
        self.corners.push(vertex);
    }

    /// Ends the polygon that the last corners make.
    pub(super) fn end(&mut self, place: usize) {
        self.ends.push((self.corners.len(), place));
    }

    /// Checks every index and cuts every polygon.
    pub(super) fn into_mesh(
        self,
        vertices: Vec<DVec3>,
        path: &Path,
        place: impl Fn(usize) -> String,
    ) -> Result<Mesh> {
        let mut triangles = Vec::with_capacity(self.ends.len());
        let mut begin = 0;
        for (end, at) in self.ends {
            let polygon = indices(&self.corners[begin..end], self.first, vertices.len())
                .and_then(|polygon| cut(&polygon, &vertices, &mut triangles));
            polygon.map_err(|found| Error::file(path, place(at), found, REMEDY))?;
            begin = end;
        }
        Ok(Mesh { vertices, triangles })
    }
}

const REMEDY: &str = "export the part again, as triangles if the program can";

fn indices(
    corners: &[i64],
    first: i64,
    n_vertices: usize,
) -> std::result::Result<Vec<u32>, String> {
    match corners.len() {
        0..3 => return Err(format!("a face has {} corners, at least 3 are needed", corners.len())),
        3..=MAX_CORNERS => {}
        n => return Err(format!("a face has {n} corners, more than {MAX_CORNERS}")),
    }
    let index = |c: &i64| {
        let position = c.checked_sub(first).and_then(|i| u32::try_from(i).ok());
        position.filter(|i| (*i as usize) < n_vertices).ok_or_else(|| {
            format!("vertex {c} of {n_vertices}, counted from {first}, does not exist")
        })
    };
    corners.iter().map(index).collect()
}

/// Appends the triangles of one polygon, in its own sense of rotation.
fn cut(
    polygon: &[u32],
    vertices: &[DVec3],
    triangles: &mut Vec<[u32; 3]>,
) -> std::result::Result<(), String> {
    let &[a, b, c] = polygon else {
        let points = flatten(polygon, vertices);
        for ear in ears(&points)? {
            triangles.push(ear.map(|i| polygon[i]));
        }
        return Ok(());
    };
    triangles.push([a, b, c]);
    Ok(())
}

/// The polygon seen against its normal, so that it runs counter-clockwise: the coordinate plane on
/// which it is largest. No number is rounded by this.
fn flatten(polygon: &[u32], vertices: &[DVec3]) -> Vec<DVec2> {
    let corner = |i: usize| vertices[polygon[i % polygon.len()] as usize];
    let origin = corner(0);
    let normal: DVec3 =
        (1..polygon.len()).map(|i| (corner(i) - origin).cross(corner(i + 1) - origin)).sum();
    let size = normal.abs();
    let project = |v: DVec3| {
        let (plane, along) = if size.z >= size.x && size.z >= size.y {
            (DVec2::new(v.x, v.y), normal.z)
        } else if size.y >= size.x {
            (DVec2::new(v.z, v.x), normal.y)
        } else {
            (DVec2::new(v.y, v.z), normal.x)
        };
        if along < 0.0 { DVec2::new(plane.y, plane.x) } else { plane }
    };
    (0..polygon.len()).map(|i| project(corner(i))).collect()
}

/// Twice the signed area of a triangle; its sign is exact.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    orient2d(coord(a), coord(b), coord(c))
}

/// Area over the sum of squared edges: greatest for the equilateral triangle, 0 for a needle.
fn shape(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let edges = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    if edges > 0.0 { turn(a, b, c) / edges } else { 0.0 }
}

fn ears(points: &[DVec2]) -> std::result::Result<Vec<[usize; 3]>, String> {
    let mut left: Vec<usize> = (0..points.len()).collect();
    let mut quality: Vec<Option<f64>> = (0..left.len()).map(|i| ear(points, &left, i)).collect();
    let mut triangles = Vec::with_capacity(points.len() - 2);
    while left.len() > 3 {
        let best = (0..left.len())
            .filter_map(|i| quality[i].map(|q| (i, q)))
            .reduce(|best, next| if next.1 > best.1 { next } else { best });
        let Some((i, _)) = best else {
            return Err(format!(
                "the outline of a face of {} corners crosses itself",
                points.len()
            ));
        };
        let n = left.len();
        triangles.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
        left.remove(i);
        quality.remove(i);
        let n = left.len();
        for k in [(i + n - 1) % n, i % n] {
            quality[k] = ear(points, &left, k);
        }
    }
    let rest = [left[0], left[1], left[2]];
    if turn(points[rest[0]], points[rest[1]], points[rest[2]]) < 0.0 {
        return Err(crossing(points.len()));
    }
    triangles.push(rest);
    Ok(triangles)
}

fn crossing(n_corners: usize) -> String {
    format!("the outline of a face of {n_corners} corners crosses itself")
}

/// How good an ear corner `i` of what is left makes: above 0 for a proper one, 0 for one without
/// area (corners in line or doubled, taken last), none if it cannot be cut off.
fn ear(points: &[DVec2], left: &[usize], i: usize) -> Option<f64> {
    let n = left.len();
    let [a, b, c] = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]].map(|k| points[k]);
    let area = turn(a, b, c);
    if area < 0.0 {
        return None;
    }
    let inside = |p: DVec2| {
        p != a
            && p != b
            && p != c
            && turn(a, b, p) >= 0.0
            && turn(b, c, p) >= 0.0
            && turn(c, a, p) >= 0.0
    };
    let free = area == 0.0 || !left.iter().any(|k| inside(points[*k]));
    free.then(|| shape(a, b, c))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[[f64; 2]]) -> std::result::Result<(f64, f64), String> {
        let points: Vec<DVec2> = points.iter().map(|p| DVec2::from_array(*p)).collect();
        let areas: Vec<f64> = ears(&points)?
            .iter()
            .map(|t| 0.5 * turn(points[t[0]], points[t[1]], points[t[2]]))
            .collect();
        Ok((areas.iter().sum(), areas.iter().copied().fold(f64::MAX, f64::min)))
    }

    #[test]
    fn cut_polygons_keep_their_area_and_no_triangle_is_turned() {
        let l_shape = [[0., 0.], [4., 0.], [4., 1.], [1., 1.], [1., 4.], [0., 4.]];
        assert_eq!(area(&l_shape), Ok((7.0, 1.5)));
        let comb = [
            [0., 0.],
            [7., 0.],
            [7., 5.],
            [6., 5.],
            [6., 1.],
            [5., 1.],
            [5., 5.],
            [4., 5.],
            [4., 1.],
            [3., 1.],
            [3., 5.],
            [2., 5.],
            [2., 1.],
            [1., 1.],
            [1., 5.],
            [0., 5.],
        ];
        let (sum, least) = area(&comb).unwrap();
        assert!((sum - 23.0).abs() < 1e-12 && least > 0.0);
        let star: Vec<[f64; 2]> = (0..200)
            .map(|i| {
                let (angle, radius) = (f64::from(i) * 0.01 * std::f64::consts::PI, 1 + i % 2 * 8);
                [angle.cos() * f64::from(radius), angle.sin() * f64::from(radius)]
            })
            .collect();
        assert!(area(&star).unwrap().1 > 0.0);
    }

    #[test]
    fn corners_in_line_make_no_triangle_without_area_when_it_can_be_avoided() {
        let square = [[0., 0.], [1., 0.], [2., 0.], [2., 1.], [2., 2.], [0., 2.], [0., 1.]];
        let (sum, least) = area(&square).unwrap();
        assert_eq!(sum, 4.0);
        assert!(least > 0.0);
    }

    #[test]
    fn a_keyhole_is_cut_and_a_crossing_outline_refused() {
        // A square with a square hole, joined by a doubled edge.
        let keyhole = [
            [0., 0.],
            [3., 0.],
            [3., 3.],
            [0., 3.],
            [0., 0.],
            [1., 1.],
            [1., 2.],
            [2., 2.],
            [2., 1.],
            [1., 1.],
        ];
        assert_eq!(area(&keyhole).unwrap().0, 8.0);
        assert!(area(&[[0., 0.], [2., 2.], [2., 0.], [0., 2.]]).is_err());
        assert!(area(&[[0., 0.], [2., 2.], [2., 0.], [0., 2.], [5., 1.]]).is_err());
    }

    #[test]
    fn every_coordinate_plane_keeps_the_sense_of_rotation() {
        let l_shape = [[0., 0.], [4., 0.], [4., 1.], [1., 1.], [1., 4.], [0., 4.]];
        let lift: [fn(f64, f64) -> DVec3; 6] = [
            |x, y| DVec3::new(x, y, 1.0),
            |x, y| DVec3::new(y, x, 1.0),
            |x, y| DVec3::new(1.0, x, y),
            |x, y| DVec3::new(1.0, y, x),
            |x, y| DVec3::new(x, 1.0, y),
            |x, y| DVec3::new(y, 1.0, x),
        ];
        for lift in lift {
            let vertices: Vec<DVec3> = l_shape.iter().map(|[x, y]| lift(*x, *y)).collect();
            let mut triangles = Vec::new();
            cut(&[0, 1, 2, 3, 4, 5], &vertices, &mut triangles).unwrap();
            let mesh = Mesh { vertices, triangles };
            let whole = (0..4).map(|f| mesh.area_vector(f)).sum::<DVec3>();
            assert_eq!((0..4).map(|f| mesh.area_vector(f).length()).sum::<f64>(), 14.0);
            assert_eq!(whole.length(), 14.0);
        }
    }
}
