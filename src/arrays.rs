//! Sites, meshes and answers as `ndarray` arrays, without copies on the way out.
//!
//! ```
//! use deepmill::{access, cutter::Cutter, directions::Directions, geom::Sites};
//! use ndarray::array;
//! let points = array![[0.0f32, 0.0, 0.0], [3.0, 0.0, 9.0]];
//! let normals = array![[0.0f32, 0.0, 1.0], [0.0, 0.0, 1.0]];
//! let sites = Sites::from_arrays(points.view(), normals.view())?;
//! assert_eq!(sites.points_array(), points);
//!
//! let cutter: Cutter = "1,2,20,2".parse()?;
//! let directions: Directions = "150".parse()?;
//! let options = access::LabelOptions::default();
//! let labels =
//!     access::label(&sites, access::Obstacles::Queries, &cutter, &directions, &options)?;
//! assert_eq!(labels.answers.accessible_directions_array()[1], 150);
//! # Ok::<(), deepmill::Error>(())
//! ```

use crate::answers::SiteAnswers;
use crate::geom::{Mesh, Sites};
use crate::model::Prediction;
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use ndarray::{ArrayView1, ArrayView2, Axis};

impl Sites {
    /// Sites from points and outward unit normals, both `[n, 3]`, mm.
    ///
    /// # Errors
    /// If an array has not three columns, or the sites fail [`Sites::check`].
    pub fn from_arrays(points: ArrayView2<f32>, normals: ArrayView2<f32>) -> Result<Self> {
        let vectors = |name, array| Ok(rows(name, array)?.map(Vec3::from_array).collect());
        Sites::new(vectors("points", points)?, vectors("normals", normals)?)
    }

    /// Positions, `[n, 3]`, mm.
    pub fn points_array(&self) -> ArrayView2<'_, f32> {
        view::<f32, 3>(bytemuck::cast_slice(&self.points))
    }

    /// Outward unit normals, `[n, 3]`.
    pub fn normals_array(&self) -> ArrayView2<'_, f32> {
        view::<f32, 3>(bytemuck::cast_slice(&self.normals))
    }
}

impl Mesh {
    /// A mesh from vertices `[n, 3]`, mm, and the corner indices of its triangles `[m, 3]`.
    ///
    /// # Errors
    /// If an array has not three columns, or the mesh fails [`Mesh::check`].
    ///
    /// ```
    /// use deepmill::geom::Mesh;
    /// use ndarray::array;
    /// let vertices = array![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let mesh = Mesh::from_arrays(vertices.view(), array![[0, 1, 2]].view())?;
    /// assert_eq!(mesh.area(), 0.5);
    /// assert_eq!(mesh.vertices_array(), vertices);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn from_arrays(vertices: ArrayView2<f64>, triangles: ArrayView2<u32>) -> Result<Self> {
        let vertices = rows("vertices", vertices)?.map(DVec3::from_array).collect();
        Mesh::new(vertices, rows("triangles", triangles)?.collect())
    }

    /// Corner positions, `[n, 3]`, mm.
    pub fn vertices_array(&self) -> ArrayView2<'_, f64> {
        view::<f64, 3>(bytemuck::cast_slice(&self.vertices))
    }

    /// Corner indices of the faces, `[m, 3]`.
    pub fn triangles_array(&self) -> ArrayView2<'_, u32> {
        view(&self.triangles)
    }
}

impl SiteAnswers {
    /// Per site: the cutter collides in every direction.
    pub fn inaccessible_array(&self) -> ArrayView1<'_, bool> {
        ArrayView1::from(&self.inaccessible)
    }

    /// Per site: is an occlusion point; empty if not wanted.
    pub fn occlusion_array(&self) -> ArrayView1<'_, bool> {
        ArrayView1::from(&self.occlusion)
    }

    /// Per site: number of directions in which the cutter can stand there; empty from a network.
    pub fn accessible_directions_array(&self) -> ArrayView1<'_, u32> {
        ArrayView1::from(&self.accessible_directions)
    }
}

impl<T> Prediction<T> {
    /// Logits of head 1, `[n, 2]`: accessible, inaccessible.
    ///
    /// ```
    /// use deepmill::{geom::Sites, model::{Model, UNetConfig}};
    /// use ndarray::array;
    /// let points = array![[0.0f32, 0.0, 0.0], [3.0, 0.0, 9.0]];
    /// let normals = array![[0.0f32, 0.0, 1.0], [0.0, 0.0, 1.0]];
    /// let sites = Sites::from_arrays(points.view(), normals.view())?;
    /// let model = Model::<f32>::new(&UNetConfig::tiny(), 1)?;
    /// let answer = model.predict(&sites.points, &sites.normals, [1.5, 6.0, 40.0, 5.0])?;
    /// assert_eq!(answer.logits_inaccessible_array().dim(), (2, 2));
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn logits_inaccessible_array(&self) -> ArrayView2<'_, T> {
        view(&self.logits_inaccessible)
    }

    /// Logits of head 2, `[n, 2]`: no occlusion point, occlusion point.
    pub fn logits_occlusion_array(&self) -> ArrayView2<'_, T> {
        view(&self.logits_occlusion)
    }
}

/// The rows of an array of three columns.
fn rows<'a, T: Copy>(
    name: &'static str,
    array: ArrayView2<'a, T>,
) -> Result<impl Iterator<Item = [T; 3]> + 'a> {
    if array.ncols() != 3 {
        let found = format!("of shape {:?}", array.shape());
        return Err(Error::argument(name, found, "[n, 3]", "give one row for each"));
    }
    let rows = move |i| std::array::from_fn(|j| array[[i, j]]);
    Ok((0..array.len_of(Axis(0))).map(rows))
}

/// Rows as a matrix.
fn view<T, const N: usize>(rows: &[[T; N]]) -> ArrayView2<'_, T> {
    ArrayView2::from(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, ShapeBuilder, array};

    #[test]
    fn arrays_of_any_order_go_in_and_come_out_as_they_were() {
        let vertices = array![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.0, 0.0, 2.0]];
        let triangles = array![[0u32, 1, 2], [2, 1, 3]];
        let mesh = Mesh::from_arrays(vertices.view(), triangles.view()).unwrap();
        assert_eq!(
            (mesh.vertices_array(), mesh.triangles_array()),
            (vertices.view(), triangles.view())
        );
        let mut fortran = Array2::zeros((4, 3).f());
        fortran.assign(&vertices);
        assert_eq!(Mesh::from_arrays(fortran.view(), triangles.view()).unwrap(), mesh);
    }

    #[test]
    fn arrays_that_are_no_sites_or_meshes_are_refused() {
        let (flat, points) = (Array2::<f32>::zeros((4, 2)), Array2::<f32>::zeros((4, 3)));
        let message = |sites: Result<Sites>| sites.unwrap_err().to_string();
        let wrong = message(Sites::from_arrays(flat.view(), points.view()));
        assert!(wrong.starts_with("points is of shape [4, 2], expected [n, 3]"), "{wrong}");
        assert!(
            message(Sites::from_arrays(points.view(), points.view())).contains("site 0: normal")
        );
        let triangles = array![[0u32, 1, 9]];
        let vertices = Array2::<f64>::zeros((4, 3));
        assert!(Mesh::from_arrays(vertices.view(), triangles.view()).is_err());
    }
}
