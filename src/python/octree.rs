//! The octree of a batch, for layers that are written in Python.

use super::errors::{detached, refused, wrong_type};
use super::options::Options;
use super::output::{list, rows, threes};
use super::part::Sites;
use crate::octree::{self, Cloud, Normalization, OctreeOptions};
use glam::Vec3;
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// The octree over a batch of clouds, each moved into the cube [-1, 1]: its box is centered, its longest edge fills it.
///
/// clouds: a sequence of Sites, or of pairs (points float [n, 3], normals float [n, 3]).
/// depth: the finest, 1 to 10. full_depth: down to it all nodes are there.
///
/// >>> import deepmill, numpy as np
/// >>> points = np.random.default_rng(1).random((100, 3))
/// >>> tree = deepmill.Octree([(points, np.tile([0.0, 0.0, 1.0], (100, 1)))], depth=3)
/// >>> tree[3].neighbors.shape[1]
/// 27
/// >>> int(tree[3].neighbors[0, 13])  # the node itself
/// 0
#[pyclass(frozen, module = "deepmill")]
pub struct Octree {
    tree: Arc<octree::Octree>,
    /// The points in the cube, over all clouds.
    points: Vec<Vec3>,
    scales: Vec<f64>,
}

#[pymethods]
impl Octree {
    #[new]
    #[pyo3(signature = (clouds, **options), text_signature = "(clouds, *, depth=5, full_depth=2)")]
    fn new(clouds: &Bound<'_, PyAny>, options: Option<Bound<'_, PyDict>>) -> PyResult<Self> {
        let py = clouds.py();
        let mut options = Options::new(py, options)?;
        let mut settings = OctreeOptions::default();
        settings.depth = options.whole("depth")?.unwrap_or(settings.depth);
        settings.full_depth =
            options.whole("full_depth")?.unwrap_or(settings.full_depth.min(settings.depth));
        options.finish()?;
        let expected = "a sequence of deepmill.Sites or pairs (points, normals)";
        let items = clouds.try_iter().map_err(|_| wrong_type("clouds", clouds, expected))?;
        let mut all = Vec::new();
        for item in items {
            let item = item?;
            if let Ok(sites) = item.cast::<Sites>() {
                all.push(Arc::clone(&sites.get().0));
                continue;
            }
            let pair: (Bound<'_, PyAny>, Bound<'_, PyAny>) =
                item.extract().map_err(|_| wrong_type("clouds", &item, expected))?;
            all.push(Sites::of(&pair.0, &pair.1)?.0);
        }
        if all.is_empty() {
            return Err(refused(py, "clouds", "empty", expected, "give at least one cloud"));
        }
        detached(py, move || {
            let (mut moved, mut scales) = (Vec::new(), Vec::new());
            for sites in &all {
                let to_cube = Normalization::UnitCube.transform(&sites.points)?;
                moved.push(
                    sites.points.iter().map(|point| to_cube.apply(*point)).collect::<Vec<_>>(),
                );
                scales.push(to_cube.scale);
            }
            let clouds: Vec<Cloud<'_>> = moved
                .iter()
                .zip(&all)
                .map(|(points, sites)| Cloud::new(points, &sites.normals))
                .collect();
            let tree = Arc::new(octree::Octree::build(&clouds, &settings)?);
            Ok(Octree { tree, points: moved.concat(), scales })
        })
    }

    /// Finest depth.
    #[getter]
    fn depth(&self) -> usize {
        self.tree.depth()
    }

    /// The points in the cube, of all clouds in their order: float32 [n, 3].
    #[getter]
    fn points<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| threes(&of.points))
    }

    /// Per point, the number among the non-empty finest nodes of the one that holds it: uint32 [n].
    #[getter]
    fn node_of_point<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<u32>>> {
        list(this, |of| &of.tree.point_node[..])
    }

    /// Per cloud, the rows of its points.
    #[getter]
    fn point_ranges(&self) -> Vec<(usize, usize)> {
        self.tree.point_ranges.iter().map(|range| (range.start, range.end)).collect()
    }

    /// Per cloud, the length in the cube of one millimeter: float64 [clouds].
    #[getter]
    fn scales<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f64>>> {
        list(this, |of| &of.scales[..])
    }

    /// The nodes of a depth, 0 to `depth`.
    fn __getitem__(&self, depth: &Bound<'_, PyAny>) -> PyResult<OctreeLevel> {
        let given: isize =
            depth.extract().map_err(|_| wrong_type("depth", depth, "a whole number"))?;
        let found = usize::try_from(given).ok().filter(|given| *given <= self.tree.depth());
        match found {
            Some(depth) => Ok(OctreeLevel { tree: Arc::clone(&self.tree), depth }),
            None => Err(PyIndexError::new_err(format!(
                "there is no depth {given}, expected 0 to {}",
                self.tree.depth()
            ))),
        }
    }

    /// Number of depths, the root included.
    fn __len__(&self) -> usize {
        self.tree.levels.len()
    }

    fn __repr__(&self) -> String {
        format!(
            "<deepmill.Octree: depth {}, {} points, {} clouds>",
            self.depth(),
            self.points.len(),
            self.scales.len()
        )
    }
}

/// The nodes of one depth, of all clouds; read-only arrays.
#[pyclass(frozen, module = "deepmill")]
pub struct OctreeLevel {
    tree: Arc<octree::Octree>,
    depth: usize,
}

impl OctreeLevel {
    fn level(&self) -> &octree::OctreeLevel {
        &self.tree.levels[self.depth]
    }
}

#[pymethods]
impl OctreeLevel {
    /// Key of every node, ascending: uint64 [n]; bit 3 i + 2 is bit i of x, 3 i + 1 of y, 3 i
    /// of z, the cloud from bit 48 on.
    #[getter]
    fn keys<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<u64>>> {
        list(this, |of| &of.level().keys[..])
    }

    /// Number of every node among the non-empty ones, -1 of an empty one: int32 [n]; the children of k are the rows 8 k
    /// to 8 k + 7 of the next depth.
    #[getter]
    fn children<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<i32>>> {
        list(this, |of| &of.level().children[..])
    }

    /// Rows of the 3x3x3 nodes around every node, -1 where there is none: int32 [n, 27]; column 9 (dx + 1) + 3 (dy + 1)
    /// + dz + 1.
    #[getter]
    fn neighbors<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<i32>> {
        rows(this, |of| &of.level().neigh[..])
    }

    /// Rows of the non-empty nodes, ascending: uint32 [k].
    #[getter]
    fn nonempty<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<u32>>> {
        list(this, |of| &of.level().nonempty[..])
    }

    /// Per cloud, the rows of its nodes.
    #[getter]
    fn ranges(&self) -> Vec<(usize, usize)> {
        self.level().ranges.iter().map(|range| (range.start, range.end)).collect()
    }

    fn __len__(&self) -> usize {
        self.level().n_nodes()
    }

    fn __repr__(&self) -> String {
        format!("<deepmill.OctreeLevel {}: {} nodes>", self.depth, self.level().n_nodes())
    }
}
