//! Triangle meshes: vertices, faces, and what follows directly from them.

use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A triangle mesh in millimeters, right-handed, +z up; corners counter-clockwise seen from outside.
///
/// The fields are public: whether a mesh is closed, manifold and oriented is a finding of
/// `geom::check`, not a property of the type. Every index must be below `vertices.len()`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Corner positions, mm.
    pub vertices: Vec<DVec3>,
    /// Corner indices of each face.
    pub triangles: Vec<[u32; 3]>,
}

/// A greatest coordinate.
pub(crate) struct Limit {
    pub mm: f64,
    words: &'static str,
}

/// Of what single precision computes with: squares of distances stay far inside `f32`.
pub(crate) const WITHIN_1_KM: Limit = Limit { mm: 1e6, words: "1 km" };
/// Of what double precision computes with, as for files: products of three coordinates stay far inside `f64`.
pub(crate) const WITHIN_1E12_MM: Limit = Limit { mm: 1e12, words: "1e12 mm" };

impl Mesh {
    /// A mesh of these vertices, mm, and triangles.
    ///
    /// # Errors
    /// As [`Mesh::check`].
    pub fn new(vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self> {
        let mesh = Mesh { vertices, triangles };
        mesh.check()?;
        Ok(mesh)
    }

    /// [`Mesh::new`] from plain numbers.
    ///
    /// # Errors
    /// As [`Mesh::check`].
    ///
    /// ```
    /// use deepmill::geom::Mesh;
    /// let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
    /// assert_eq!(Mesh::from_slices(&corners, &[[0, 1, 2]])?.area(), 6.0);
    /// assert!(Mesh::from_slices(&corners, &[[0, 1, 3]]).is_err());
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn from_slices(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Self> {
        let vertices = vertices.iter().map(|v| DVec3::from_array(*v)).collect();
        Mesh::new(vertices, triangles.to_vec())
    }

    /// Checks that every corner names a vertex and every vertex is finite.
    ///
    /// # Errors
    /// Names the first face or vertex of which that is not so.
    pub fn check(&self) -> Result<()> {
        if let Some(f) = self.face_without_vertex() {
            let n = self.vertices.len();
            let found = format!("names a vertex beyond the last of {n}");
            return Err(Error::geometry(format!("face {f}"), found, "check the file"));
        }
        match self.vertices.iter().position(|v| !v.is_finite()) {
            Some(v) => {
                Err(Error::geometry(format!("vertex {v}"), "is not finite", "check the file"))
            }
            None => Ok(()),
        }
    }

    /// [`Mesh::check`], and every coordinate within `limit`.
    pub(crate) fn check_within(&self, limit: &Limit) -> Result<()> {
        if self.face_without_vertex().is_some() {
            return self.check();
        }
        let usable = |v: &DVec3| v.is_finite() && v.abs().max_element() <= limit.mm;
        let Some(v) = self.vertices.iter().position(|v| !usable(v)) else { return Ok(()) };
        let remedy = format!(
            "coordinates must be finite and within {}; check the file and its unit",
            limit.words
        );
        Err(Error::geometry(
            format!("vertex {v}"),
            format!("position {}", self.vertices[v]),
            remedy,
        ))
    }

    /// The first face with a corner that names no vertex.
    pub(crate) fn face_without_vertex(&self) -> Option<usize> {
        let n = self.vertices.len();
        self.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= n))
    }

    /// The corners of face `f`, mm.
    ///
    /// # Panics
    /// If there is no such face, or it names a missing vertex ([`Mesh::check`]); so do all that follow
    /// but the bounds.
    pub fn corners(&self, f: usize) -> [DVec3; 3] {
        self.triangles[f].map(|v| self.vertices[v as usize])
    }

    /// Mean of the corners of every face, mm, computed in `f64`: the obstacles of
    /// [`Obstacles::Centroids`](crate::access::Obstacles::Centroids).
    pub fn centroids(&self) -> Vec<glam::Vec3> {
        let middle = |[a, b, c]: [DVec3; 3]| ((a + b + c) / 3.0).as_vec3();
        (0..self.triangles.len()).map(|f| middle(self.corners(f))).collect()
    }

    /// Twice the area of face `f` times its outward unit normal, mm².
    pub fn area_vector(&self, f: usize) -> DVec3 {
        let [a, b, c] = self.corners(f);
        (b - a).cross(c - a)
    }

    /// Whether face `f` has an area: it is higher than a ten-thousand-millionth of its longest side, which is more than
    /// what rounded coordinates make of three corners in line.
    pub fn has_area(&self, f: usize) -> bool {
        has_area(&self.corners(f))
    }

    /// Least and greatest corner of the bounding box, mm; `None` for a mesh without vertices.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(lo, hi), v| (lo.min(*v), hi.max(*v))))
    }

    /// Length of the bounding box's diagonal, mm; 0 for a mesh without vertices.
    pub fn diagonal(&self) -> f64 {
        self.bounds().map_or(0.0, |(lo, hi)| (hi - lo).length())
    }

    /// Surface area, mm².
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|f| 0.5 * self.area_vector(f).length()).sum()
    }

    /// Enclosed volume by the divergence theorem, mm³; negative for an inward-oriented mesh.
    pub fn volume(&self) -> f64 {
        let six = |f| {
            let [a, b, c] = self.corners(f);
            a.dot(b.cross(c))
        };
        (0..self.triangles.len()).map(six).sum::<f64>() / 6.0
    }
}

/// Height over longest side up to which a triangle is three corners in line.
const FLAT: f64 = 1e-10;

/// [`Mesh::has_area`] for a triangle by its corners.
pub(crate) fn has_area(&[a, b, c]: &[DVec3; 3]) -> bool {
    let sides = [b - a, c - b, a - c].map(DVec3::length_squared);
    let longest = sides.into_iter().fold(0.0, f64::max);
    (b - a).cross(c - a).length() > FLAT * longest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_corners_in_line_have_no_area_however_they_are_turned() {
        for turn in [0.0, 0.3, 1.1] {
            let along = glam::DMat3::from_rotation_y(turn) * DVec3::new(0.1, 0.7, 0.3);
            for far in [0.0, 80.0] {
                let at = |k: f64| DVec3::splat(far) + along * k;
                assert!(!has_area(&[at(1.0), at(20.0), at(70.0)]), "{turn} {far}");
                assert!(!has_area(&[at(1.0), at(1.0), at(70.0)]) && !has_area(&[at(7.0); 3]));
                let beside = at(20.0) + DVec3::new(1e-5, 0.0, 0.0);
                assert!(has_area(&[at(1.0), beside, at(70.0)]));
            }
        }
    }

    #[test]
    fn faces_without_vertices_and_vertices_without_a_place_are_named() {
        let mut mesh = crate::geom::solids::cuboid(DVec3::ONE);
        mesh.check().unwrap();
        mesh.triangles[5][1] = 8;
        assert!(mesh.check().unwrap_err().to_string().starts_with("face 5: names a vertex beyond"));
        mesh.triangles[5][1] = 0;
        mesh.vertices[2].y = f64::NAN;
        assert!(mesh.check().unwrap_err().to_string().starts_with("vertex 2: is not finite"));
    }
}
