//! A mesh prepared for walking on it: face normals and which face lies across which edge.

use super::sheet::OPPOSITE;
use crate::exec::par;
use crate::geom::Mesh;
use crate::geom::mesh::WITHIN_1_KM;
use crate::{Error, Result};
use glam::DVec3;

/// No way across an edge: it is open, non-manifold, inconsistently oriented or sharper than 37°
/// ([`OPPOSITE`]), or the face there has no area.
const WALL: u32 = u32::MAX;
/// A face is taken to have no area when its height is below this fraction of its longest edge.
const FLAT: f64 = 1e-12;
/// Edges one walk may cross; a longer walk ends early, on the surface.
const MAX_CROSSINGS: usize = 1000;

/// A point on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// Position, mm.
    pub point: DVec3,
    /// Face it lies on.
    pub face: u32,
}

/// A mesh with what a walk needs; faces without area have area 0 and normal 0.
pub(super) struct Surface<'a> {
    pub mesh: &'a Mesh,
    /// Outward unit normal of each face.
    pub normals: Vec<DVec3>,
    /// Area of each face, mm².
    pub areas: Vec<f64>,
    /// Sum of `areas`.
    pub area: f64,
    /// Face across the edge from corner `k` to corner `k + 1`, or [`WALL`].
    across: Vec<[u32; 3]>,
}

impl<'a> Surface<'a> {
    /// # Errors
    /// If a face names a missing vertex, a vertex is not finite or beyond 1 km, or the mesh has no area.
    pub fn build(mesh: &'a Mesh) -> Result<Self> {
        mesh.check_within(&WITHIN_1_KM)?;
        let n_faces = mesh.triangles.len();
        let (mut normals, mut areas) = (vec![DVec3::ZERO; n_faces], vec![0.0; n_faces]);
        for face in 0..n_faces {
            let [a, b, c] = mesh.corners(face);
            let doubled = (b - a).cross(c - a);
            let longest = (b - a)
                .length_squared()
                .max((c - b).length_squared())
                .max((a - c).length_squared());
            if doubled.length() > FLAT * longest {
                (normals[face], areas[face]) = (doubled.normalize(), 0.5 * doubled.length());
            }
        }
        let area = areas.iter().sum();
        if area <= 0.0 {
            return Err(Error::geometry("mesh", "no face has an area", "check the file"));
        }
        let across = link(&mesh.triangles, &normals);
        Ok(Surface { mesh, normals, areas, area, across })
    }

    /// From `start` straight ahead along `step` (tangent to its face), around edges as on a taut
    /// string; ends early at a wall, and before a face opposite to the unit vector `sheet`. The
    /// result lies in its face.
    pub fn walk(&self, start: Place, mut step: DVec3, sheet: DVec3) -> Place {
        let Place { mut point, mut face } = start;
        let mut entered = None;
        for _ in 0..MAX_CROSSINGS {
            let Some((edge, part)) = self.first_exit(point, face, step, entered) else {
                point += step;
                break;
            };
            point += step * part;
            let next = self.across[face as usize][edge];
            if next == WALL || self.normals[next as usize].dot(sheet) <= OPPOSITE {
                break;
            }
            (step, entered) = self.turn(face, edge, next, step * (1.0 - part));
            face = next;
        }
        Place { point: nearest_in_triangle(point, self.mesh.corners(face as usize)), face }
    }

    /// The edge through which `point + step` leaves `face`, and the share of the step before it.
    fn first_exit(
        &self,
        point: DVec3,
        face: u32,
        step: DVec3,
        entered: Option<usize>,
    ) -> Option<(usize, f64)> {
        let corners = self.mesh.corners(face as usize);
        let normal = self.normals[face as usize];
        let mut exit = None;
        for k in (0..3).filter(|&k| entered != Some(k)) {
            let inward = normal.cross(corners[(k + 1) % 3] - corners[k]);
            let (distance, rate) = (inward.dot(point - corners[k]).max(0.0), -inward.dot(step));
            if rate > 0.0 && distance < rate && exit.is_none_or(|(_, t)| distance / rate < t) {
                exit = Some((k, distance / rate));
            }
        }
        exit
    }

    /// `step` carried from `face` over its `edge` into face `next`, and the edge's number there.
    fn turn(&self, face: u32, edge: usize, next: u32, step: DVec3) -> (DVec3, Option<usize>) {
        let corners = self.mesh.corners(face as usize);
        let along = (corners[(edge + 1) % 3] - corners[edge]).normalize_or_zero();
        let out = along.cross(self.normals[face as usize]);
        let inward = along.cross(self.normals[next as usize]);
        let from = self.mesh.triangles[face as usize][(edge + 1) % 3];
        let entered = self.mesh.triangles[next as usize].iter().position(|&v| v == from);
        (along * step.dot(along) + inward * step.dot(out), entered)
    }
}

/// Pairs the two faces on each edge unless something of [`WALL`] is the case.
fn link(triangles: &[[u32; 3]], normals: &[DVec3]) -> Vec<[u32; 3]> {
    let mut across = vec![[WALL; 3]; triangles.len()];
    let mut edges: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * triangles.len());
    for (face, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            edges.push((a.min(b), a.max(b), 3 * face as u32 + k as u32));
        }
    }
    par::sort_by_key(&mut edges, |&edge| edge);
    for same in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        let &[(_, _, x), (_, _, y)] = same else { continue };
        let (f, g) = ((x / 3) as usize, (y / 3) as usize);
        let opposed = triangles[f][(x % 3) as usize] != triangles[g][(y % 3) as usize];
        let with_area = normals[f] != DVec3::ZERO && normals[g] != DVec3::ZERO;
        if opposed && with_area && normals[f].dot(normals[g]) > OPPOSITE {
            across[f][(x % 3) as usize] = g as u32;
            across[g][(y % 3) as usize] = f as u32;
        }
    }
    across
}

/// The point of a triangle with area nearest to `p` (Ericson 2005, Real-Time Collision Detection, 5.1.5).
pub(crate) fn nearest_in_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(p - a), ac.dot(p - a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let (d3, d4) = (ab.dot(p - b), ac.dot(p - b));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let (d5, d6) = (ab.dot(p - c), ac.dot(p - c));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    a + (ab * vb + ac * vc) / (va + vb + vc)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::solids::{cuboid, torus};
    use glam::dvec3;

    #[test]
    fn a_walk_around_a_cube_comes_back_to_its_start() {
        let cube = cuboid(DVec3::splat(2.0));
        let surface = Surface::build(&cube).unwrap();
        let face = (0..12).find(|&f| surface.normals[f] == DVec3::Z).unwrap() as u32;
        let corners = cube.corners(face as usize);
        let start = Place { point: (corners[0] + corners[1] + corners[2]) / 3.0, face };
        let end = surface.walk(start, dvec3(8.0, 0.0, 0.0), DVec3::ZERO);
        assert_eq!(surface.normals[end.face as usize], DVec3::Z);
        assert!(end.point.distance(start.point) < 1e-12, "{end:?}");
        let quarter = surface.walk(start, dvec3(0.0, 2.0, 0.0), DVec3::Z);
        assert_eq!(surface.normals[quarter.face as usize], DVec3::Y);
        let stopped = surface.walk(start, dvec3(0.0, 8.0, 0.0), DVec3::Z);
        assert_eq!(surface.normals[stopped.face as usize], DVec3::Y);
        assert_eq!(stopped.point.z, 0.0, "at the edge to the opposite face");
    }

    #[test]
    fn a_walk_stops_at_open_and_sharp_edges_and_at_faces_without_area() {
        let vertices =
            vec![DVec3::ZERO, DVec3::X, DVec3::Y, dvec3(0.1, 0.1, -0.05), dvec3(0.5, 0.5, 0.0)];
        let sharp = [[0, 1, 2], [1, 0, 3], [1, 2, 4]];
        let mesh = Mesh { vertices, triangles: sharp.to_vec() };
        let surface = Surface::build(&mesh).unwrap();
        let start = Place { point: dvec3(0.3, 0.3, 0.0), face: 0 };
        for (step, end) in [
            (-DVec3::X, dvec3(0.0, 0.3, 0.0)),
            (-DVec3::Y, dvec3(0.3, 0.0, 0.0)),
            (dvec3(1.0, 1.0, 0.0), dvec3(0.5, 0.5, 0.0)),
        ] {
            let place = surface.walk(start, step, DVec3::Z);
            assert_eq!(place.face, 0);
            assert!(place.point.distance(end) < 1e-12, "{place:?}");
        }
    }

    #[test]
    fn a_long_walk_on_a_torus_stays_in_its_face() {
        let mesh = torus(10.0, 4.0, 40, 20);
        let surface = Surface::build(&mesh).unwrap();
        let mut place = Place { point: mesh.vertices[mesh.triangles[0][0] as usize], face: 0 };
        for turn in 0..200 {
            let normal = surface.normals[place.face as usize];
            let ahead = normal.cross(dvec3(1.0, f64::from(turn), 2.0)).normalize() * 3.0;
            place = surface.walk(place, ahead, DVec3::ZERO);
            let corners = mesh.corners(place.face as usize);
            assert!(place.point.distance(nearest_in_triangle(place.point, corners)) < 1e-12);
        }
    }

    #[test]
    fn unusable_meshes_are_named() {
        let triangle = |vertices: [DVec3; 3], last: u32| Mesh {
            vertices: vertices.to_vec(),
            triangles: vec![[0, 1, last]],
        };
        let message = |mesh: &Mesh| Surface::build(mesh).err().unwrap().to_string();
        let flat = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        assert!(message(&triangle(flat, 2)).starts_with("mesh: no face has an area"));
        assert!(
            message(&triangle(flat, 3)).starts_with("face 0: names a vertex beyond the last of 3")
        );
        let open = [DVec3::ZERO, DVec3::X, DVec3::Y * f64::NAN];
        assert!(message(&triangle(open, 2)).starts_with("vertex 2: position [NaN"));
        assert!(message(&Mesh::default()).starts_with("mesh: no face"));
    }
}
