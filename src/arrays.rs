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

use crate::access::Labels;
use crate::access::surface::SurfaceEvidence;
use crate::answers::{NetworkEvidence, SiteAnswers};
use crate::geom::{Mesh, Sites};
use crate::model::Prediction;
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};

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

/// One method for each list of numbers or flags, `name_array`.
macro_rules! views {
    ($of:ident { $($view:ident of $field:ident: $number:ty, $text:literal;)* }) => {
        impl $of {
            $(
                #[doc = $text]
                pub fn $view(&self) -> ArrayView1<'_, $number> {
                    ArrayView1::from(&self.$field)
                }
            )*
        }
    };
}

views!(SiteAnswers {
    occlusion_array of occlusion: bool, "Per site: is an occlusion point; empty if not wanted.";
    accessible_directions_array of accessible_directions: u32,
        "Per site: number of accessible directions; empty from a network.";
    accessible_share_array of accessible_share: f32,
        "Per site: share of such directions; empty from a network without that head.";
    clearance_mm_array of clearance_mm: f32, "Per site: signed clearance, mm; empty if not wanted.";
    rest_mm_array of rest_mm: f32, "Per site: what the tool leaves, mm; empty if not wanted.";
    rest_volume_mm3_array of rest_volume_mm3: f32,
        "Per site: volume of what is left, mm³; empty if not wanted.";
});

views!(NetworkEvidence {
    probability_inaccessible_array of probability_inaccessible: f32,
        "Per site: probability that it is inaccessible.";
    probability_occlusion_array of probability_occlusion: f32,
        "Per site: probability that it is an occlusion point.";
});

impl SiteAnswers {
    /// Per site: the cutter collides in every direction. A copy.
    pub fn inaccessible_array(&self) -> Array1<bool> {
        self.inaccessible().into()
    }

    /// Per site: only the tip is in the way; empty by the published definition. A copy.
    pub fn tip_does_not_fit_array(&self) -> Array1<bool> {
        self.tip_does_not_fit().into()
    }

    /// Per site, `[n, 3]`: a direction in which it is accessible, NaN where there is none. A copy.
    pub fn witness_array(&self) -> Array2<f32> {
        let row = |k: usize| self.witness[k].map_or([f32::NAN; 3], |v| v.to_array());
        Array2::from_shape_fn((self.witness.len(), 3), |(k, axis)| row(k)[axis])
    }
}

views!(Labels {
    beta_array of beta: u64,
        "Per obstacle: pairs (inaccessible query, direction) it collides in; empty if not wanted.";
});

views!(SurfaceEvidence {
    collision_free_directions_array of collision_free_directions: u32,
        "Per query: directions in which no step penetrates the part; empty if not counted.";
    open_directions_array of open_directions: f32,
        "Per query: share of the directions that was not proven closed.";
    retreat_unproven_array of retreat_unproven: bool,
        "Per query: a pose is free, but no retreat is proven; empty for most tools.";
});

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

    /// Share of accessible directions per site; empty for a network without that head.
    pub fn accessible_share_array(&self) -> ArrayView1<'_, f32> {
        ArrayView1::from(&self.accessible_share)
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
    use ndarray::{ShapeBuilder, array};

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
    fn every_list_of_evidence_is_a_view_of_the_same_memory() {
        let mut answers = SiteAnswers::new(vec![true, false], vec![false, true]);
        answers.witness = vec![None, Some(Vec3::Z)];
        answers.clearance_mm = vec![-0.5, 2.0];
        let view = answers.clearance_mm_array();
        assert_eq!(view, array![-0.5, 2.0]);
        assert_eq!(view.as_ptr(), answers.clearance_mm.as_ptr());
        assert_eq!(answers.occlusion_array(), array![false, true]);
        assert_eq!(answers.inaccessible_array(), array![true, false]);
        assert!(answers.rest_mm_array().is_empty());
        let witness = answers.witness_array();
        assert!(witness.row(0).iter().all(|x| x.is_nan()));
        assert_eq!(witness.row(1), array![0.0, 0.0, 1.0]);
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
