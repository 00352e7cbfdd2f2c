//! Meshes and sites.

use super::errors::{checked, detached, refused, wrong_type};
use super::input;
use super::options::{Options, text_of};
use super::output::{list, rows, threes, threes_f64};
use crate::Error;
use crate::analysis;
use crate::geom::formats::{self, KeepVertices, MeshOrCloud, PartFile, ReadOptions};
use crate::geom::preparation::{Preparation, Prepared};
use crate::geom::sites::{self, Normals, SiteOptions};
use crate::geom::units::Unit;
use crate::geom::{self, weld};
use glam::{DVec3, Vec3};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A mesh of triangles in mm, prepared as the commands do: near corners are joined, loose triangles dropped, a mesh
/// that faces inward is turned, bodies that overlap are joined. What does not bound solids is refused.
///
/// Mesh(vertices, triangles=None, *, name="part", unit="mm", weld=1e-6, repair=False, force=False)
///
/// vertices: float array [n, 3] in `unit`; or an object with `vertices` and `faces`, such as of trimesh.
/// triangles: integer array [m, 3], rows of vertices, counter-clockwise seen from outside.
/// name: for files and titles. unit: "mm", "cm", "m" or "in".
/// weld: corners closer than this share of the box's diagonal become one, in the order in which triangles use them.
/// repair: also mend small faults. force: take what does not bound solids, with a notice.
///
/// >>> import deepmill, numpy as np
/// >>> corners = np.array([[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30]], dtype=float)
/// >>> mesh = deepmill.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
/// >>> round(mesh.volume_mm3)
/// 4500
#[pyclass(frozen, module = "deepmill")]
pub struct Mesh {
    pub mesh: geom::Mesh,
    pub origin: Option<DVec3>,
    pub name: String,
    notices: Vec<String>,
}

/// A file's name without its folder.
fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(|| "part".into(), |name| name.to_string_lossy().into_owned())
}

/// Vertices and triangles of an object that has both.
fn of_object(object: &Bound<'_, PyAny>) -> PyResult<Option<[Py<PyAny>; 2]>> {
    let (Some(vertices), Some(faces)) =
        (object.getattr_opt("vertices")?, object.getattr_opt("faces")?)
    else {
        return Ok(None);
    };
    Ok(Some([vertices.unbind(), faces.unbind()]))
}

/// The triangles of an object with vertices and faces in mm, as they are; of other objects none.
pub fn raw_mesh(object: &Bound<'_, PyAny>) -> PyResult<Option<geom::Mesh>> {
    let Some([corners, faces]) = of_object(object)? else { return Ok(None) };
    let corners = input::vectors("vertices", corners.bind(object.py()))?;
    let triangles = input::triangles("faces", faces.bind(object.py()), corners.len())?;
    let vertices = corners.into_iter().map(DVec3::from_array).collect();
    checked(object.py(), geom::Mesh::new(vertices, triangles)).map(Some)
}

impl Mesh {
    /// The part of an outcome.
    pub fn of_outcome(outcome: &analysis::Outcome) -> Option<Self> {
        let (name, notices) = (outcome.part().to_owned(), outcome.notices().to_vec());
        let mesh = outcome.mesh()?.clone();
        Some(Mesh { mesh, origin: outcome.origin(), name, notices })
    }

    fn named(name: String, Prepared { mesh, origin, notices }: Prepared) -> Self {
        Mesh { mesh, origin, name, notices }
    }

    /// A mesh of this module, or one made of an object with vertices and faces; of other objects none.
    pub fn of<'py>(value: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, Mesh>>> {
        if let Ok(mesh) = value.cast::<Mesh>() {
            return Ok(Some(mesh.clone()));
        }
        match of_object(value)? {
            Some(_) => Bound::new(value.py(), Mesh::new(value, None, None)?).map(Some),
            None => Ok(None),
        }
    }
}

#[pymethods]
impl Mesh {
    #[new]
    #[pyo3(signature = (vertices, triangles=None, **options))]
    #[pyo3(
        text_signature = "(vertices, triangles=None, *, name='part', unit='mm', weld=1e-6, repair=False, force=False)"
    )]
    fn new(
        vertices: &Bound<'_, PyAny>,
        triangles: Option<&Bound<'_, PyAny>>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let py = vertices.py();
        let mut options = Options::new(py, options)?;
        let name = options.text("name")?.unwrap_or_else(|| "part".into());
        let scale = options.unit("unit")?.millimeters();
        let tolerance = options.number("weld")?.unwrap_or(weld::DEFAULT_TOLERANCE);
        let (repair, force) =
            (options.flag("repair")?.unwrap_or(false), options.flag("force")?.unwrap_or(false));
        options.finish()?;
        let object = match triangles {
            None => of_object(vertices)?,
            Some(_) => None,
        };
        let (corners, triangles) = match (&object, triangles) {
            (Some([vertices, faces]), _) => (vertices.bind(py), faces.bind(py)),
            (None, Some(triangles)) => (vertices, triangles),
            (None, None) => {
                let remedy =
                    "give vertices and triangles, or an object with `vertices` and `faces`";
                return Err(refused(
                    py,
                    "triangles",
                    "not given",
                    "integers of shape [m, 3]",
                    remedy,
                ));
            }
        };
        let corners = input::vectors("vertices", corners)?;
        let triangles = input::triangles("triangles", triangles, corners.len())?;
        let prepare = Preparation { repair, force, path: None, scale };
        detached(py, move || {
            let vertices =
                corners.into_iter().map(|corner| DVec3::from_array(corner) * scale).collect();
            let mesh = weld::weld(&geom::Mesh::new(vertices, triangles)?, tolerance)?;
            Ok(Mesh::named(name, prepare.mesh(mesh, Vec::new())?))
        })
    }

    /// Reads a file: STL, OBJ, PLY or 3MF.
    ///
    /// path: str or os.PathLike. unit: that of the file's numbers, "mm", "cm", "m" or "in"; None is mm, or as a 3MF
    /// states. The other options are those of `Mesh`.
    #[staticmethod]
    #[pyo3(signature = (path, unit=None, **options))]
    #[pyo3(text_signature = "(path, unit=None, *, weld=1e-6, repair=False, force=False)")]
    fn read(
        path: &Bound<'_, PyAny>,
        unit: Option<&Bound<'_, PyAny>>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let py = path.py();
        let path = path_of("path", path)?;
        let unit = unit.map(|unit| text_of("unit", unit)).transpose()?;
        let scale = match unit {
            None => 1.0,
            Some(unit) => checked(
                py,
                unit.parse::<Unit>().map_err(|_| {
                    Error::argument("unit", format!("`{unit}`"), "mm, cm, m or in", "None is mm")
                }),
            )?
            .millimeters(),
        };
        let mut options = Options::new(py, options)?;
        let weld = options.number("weld")?.unwrap_or(weld::DEFAULT_TOLERANCE);
        let (repair, force) =
            (options.flag("repair")?.unwrap_or(false), options.flag("force")?.unwrap_or(false));
        options.finish()?;
        detached(py, move || {
            let read = ReadOptions::new(scale, weld);
            let PartFile { part, notices, .. } =
                formats::read_part_file(&path, &read, KeepVertices::No)?;
            let MeshOrCloud::Mesh(mesh) = part else {
                let found = "it holds points without triangles";
                return Err(Error::file(
                    &path,
                    "content",
                    found,
                    "read points and normals with NumPy: deepmill.Sites",
                ));
            };
            let name = name_of(&path);
            let prepare = Preparation { repair, force, path: Some(path), scale };
            Ok(Mesh::named(name, prepare.mesh(mesh, notices)?))
        })
    }

    /// Corners, float64 [n, 3], mm; relative to `origin_mm` if there is one.
    #[getter]
    fn vertices<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f64>> {
        rows(this, |of| threes_f64(&of.mesh.vertices))
    }

    /// Rows of the corners of each triangle, uint32 [m, 3].
    #[getter]
    fn triangles<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<u32>> {
        rows(this, |of| &of.mesh.triangles[..])
    }

    /// As `triangles`: what other libraries name them.
    #[getter]
    fn faces<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<u32>> {
        rows(this, |of| &of.mesh.triangles[..])
    }

    /// Name for files and titles.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Area of the surface, mm².
    #[getter]
    fn area_mm2(&self) -> f64 {
        self.mesh.area()
    }

    /// Volume, mm³.
    #[getter]
    fn volume_mm3(&self) -> f64 {
        self.mesh.volume()
    }

    /// Least and greatest corner of the box, mm.
    #[getter]
    fn bounds_mm(&self) -> ([f64; 3], [f64; 3]) {
        let (low, high) = self.mesh.bounds().unwrap_or_default();
        (low.to_array(), high.to_array())
    }

    /// The origin of the coordinates in those that were given, mm, of a part that is far from it.
    #[getter]
    fn origin_mm(&self) -> Option<[f64; 3]> {
        self.origin.map(|at| at.to_array())
    }

    /// What was changed or left out, a sentence each.
    #[getter]
    fn notices(&self) -> Vec<String> {
        self.notices.clone()
    }

    fn __repr__(&self) -> String {
        let (low, high) = self.mesh.bounds().unwrap_or_default();
        let size = geom::units::size_line(low, high);
        format!("<deepmill.Mesh {:?}: {} triangles, {size}>", self.name, self.mesh.triangles.len())
    }
}

/// A path of text or `os.PathLike`.
pub fn path_of(name: &'static str, value: &Bound<'_, PyAny>) -> PyResult<PathBuf> {
    value.extract().map_err(|_| wrong_type(name, value, "a str or os.PathLike"))
}

/// Points of a surface with outward unit normals.
///
/// Sites(points, normals)
///
/// points: float array [n, 3], mm. normals: float array [n, 3], unit vectors.
#[pyclass(frozen, module = "deepmill")]
pub struct Sites(pub Arc<geom::Sites>);

impl Sites {
    /// Of two arrays.
    pub fn of(points: &Bound<'_, PyAny>, normals: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = points.py();
        let [points, normals] = [("points", points), ("normals", normals)].map(|(name, value)| {
            let of_row = |row: [f64; 3]| Vec3::from_array(row.map(|x| x as f32));
            Ok(input::vectors(name, value)?.into_iter().map(of_row).collect::<Vec<_>>())
        });
        let (points, normals): (PyResult<_>, PyResult<_>) = (points, normals);
        let (points, normals) = (points?, normals?);
        if points.len() != normals.len() {
            let found = format!("of {} rows", normals.len());
            let expected = format!("{}, as many as points", points.len());
            return Err(refused(py, "normals", found, expected, "give one normal for each point"));
        }
        checked(py, geom::Sites::new(points, normals)).map(|sites| Sites(Arc::new(sites)))
    }
}

#[pymethods]
impl Sites {
    #[new]
    fn new(points: &Bound<'_, PyAny>, normals: &Bound<'_, PyAny>) -> PyResult<Self> {
        Sites::of(points, normals)
    }

    /// Positions, float32 [n, 3], mm.
    #[getter]
    fn points<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| threes(&of.0.points))
    }

    /// Outward unit normals, float32 [n, 3].
    #[getter]
    fn normals<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| threes(&of.0.normals))
    }

    /// The triangle that each lies on, uint32 [n]; None if there is no mesh.
    #[getter]
    fn faces<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<u32>>> {
        list(this, |of| &of.0.faces[..])
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __repr__(&self) -> String {
        format!("<deepmill.Sites: {}>", self.0.len())
    }
}

/// How sites are placed, by the options `sites`, `seed` and `smooth`; none if the corners of the mesh are the sites.
pub fn placement(options: &mut Options<'_>) -> PyResult<(Option<SiteOptions>, u64)> {
    let py = options.py();
    let seed = options.whole("seed")?.unwrap_or(0);
    let smooth = options.number("smooth")?;
    let normals = match smooth {
        None => Normals::Face,
        Some(degrees) if (0.0..=180.0).contains(&degrees) => {
            Normals::Smooth { crease_rad: degrees.to_radians() }
        }
        Some(degrees) => {
            let expected = "an angle from 0 to 180 degrees";
            return Err(refused(py, "smooth", degrees, expected, "30 suits most parts"));
        }
    };
    let expected = "2 or more, or \"vertices\"";
    let Some(sites) = options.take("sites")? else {
        return Ok((Some(SiteOptions { seed, normals, ..SiteOptions::default() }), seed));
    };
    if sites.is_instance_of::<PyString>() {
        return match text_of("sites", &sites)?.as_str() {
            "vertices" => Ok((None, seed)),
            other => {
                Err(refused(py, "sites", format!("`{other}`"), expected, "7000 suits most parts"))
            }
        };
    }
    match sites.extract::<usize>() {
        Ok(n_sites) if n_sites >= 2 => Ok((Some(SiteOptions { n_sites, seed, normals }), seed)),
        Ok(n) => Err(refused(py, "sites", n, expected, "7000 suits most parts")),
        Err(_) => Err(wrong_type("sites", &sites, "a whole number from 2 on, or \"vertices\"")),
    }
}

/// Spreads sites over a mesh, as `analyze` does.
///
/// mesh: Mesh, or an object with `vertices` and `faces`. sites: about how many, or "vertices": the corners of the mesh.
/// seed: of the places. smooth: degrees; normals are interpolated across edges that are folded by less.
///
/// >>> import deepmill
/// >>> corners = [[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30]]
/// >>> mesh = deepmill.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
/// >>> deepmill.sample(mesh, sites=500).points.shape
/// (500, 3)
#[pyfunction]
#[pyo3(signature = (mesh, **options), text_signature = "(mesh, *, sites=7000, seed=0, smooth=None)")]
pub fn sample(mesh: &Bound<'_, PyAny>, options: Option<Bound<'_, PyDict>>) -> PyResult<Sites> {
    let py = mesh.py();
    let Some(mesh) = Mesh::of(mesh)? else {
        return Err(wrong_type(
            "mesh",
            mesh,
            "a deepmill.Mesh, or an object with vertices and faces",
        ));
    };
    let mut options = Options::new(py, options)?;
    let (placed, _) = placement(&mut options)?;
    options.finish()?;
    let mesh = &mesh.get().mesh;
    let sites = detached(py, || match placed {
        Some(options) => sites::sample(mesh, &options),
        None => sites::from_vertices(mesh),
    })?;
    Ok(Sites(Arc::new(sites)))
}

/// What a part can be: a mesh or a cloud of points.
pub enum Part<'py> {
    Mesh(Bound<'py, Mesh>),
    Cloud(Bound<'py, Sites>),
}

impl<'py> Part<'py> {
    /// The mesh, if it is one.
    pub fn mesh(&self) -> Option<Py<Mesh>> {
        match self {
            Part::Mesh(mesh) => Some(mesh.clone().unbind()),
            Part::Cloud(_) => None,
        }
    }

    /// The triangles and the origin of their coordinates, if it is a mesh.
    pub fn mesh_and_origin(&self) -> Option<(&geom::Mesh, Option<DVec3>)> {
        match self {
            Part::Mesh(mesh) => Some((&mesh.get().mesh, mesh.get().origin)),
            Part::Cloud(_) => None,
        }
    }

    /// What was changed of it, then what `others` state.
    pub fn notices_and(&self, others: &[String]) -> Vec<String> {
        let own = match self {
            Part::Mesh(mesh) => &mesh.get().notices[..],
            Part::Cloud(_) => &[],
        };
        own.iter().chain(others).cloned().collect()
    }

    /// Of an argument.
    pub fn of(value: &Bound<'py, PyAny>) -> PyResult<Self> {
        if let Ok(sites) = value.cast::<Sites>() {
            return Ok(Part::Cloud(sites.clone()));
        }
        if value.is_instance_of::<PyString>() {
            return Err(PyTypeError::new_err(
                "part is a str, expected a deepmill.Mesh; read a file by deepmill.Mesh.read",
            ));
        }
        match Mesh::of(value)? {
            Some(mesh) => Ok(Part::Mesh(mesh)),
            None => Err(wrong_type(
                "part",
                value,
                "a deepmill.Mesh, deepmill.Sites or an object with vertices and faces",
            )),
        }
    }
}
