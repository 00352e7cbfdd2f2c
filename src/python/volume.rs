//! Labels of the space around a part.

use super::errors::refused;
use super::folder::{self, Takes};
use super::options::{Options, number, text_of};
use super::output::view;
use super::part::Part;
use super::request::{Purpose, analysis};
use crate::analysis;
use crate::data::files::volume::PointAnswer;
use ndarray::{ArrayView3, Ix3, ShapeBuilder};
use numpy::PyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Where in the space around a part the tip of a tool can be (roughing).
///
/// step: distance of the points of the lattice in the part's box, mm. The other options are those of `analyze`.
///
/// >>> import deepmill
/// >>> corners = [[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30]]
/// >>> mesh = deepmill.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
/// >>> space = deepmill.volume(mesh, "3,20,20,20", 5.0)
/// >>> space.answers.shape
/// (6, 6, 6)
#[pyfunction]
#[pyo3(signature = (part, tool, step, **options))]
#[pyo3(
    text_signature = "(part, tool, step, *, directions=None, fixtures=(), table=None, tolerance=None, \
        finish=None, search=None, prove=False, name=None, progress=None)"
)]
pub fn volume(
    part: &Bound<'_, PyAny>,
    tool: &Bound<'_, PyAny>,
    step: &Bound<'_, PyAny>,
    options: Option<Bound<'_, PyDict>>,
) -> PyResult<VolumeOutcome> {
    let py = part.py();
    let step_mm = number("step", step)?;
    let mut options = Options::new(py, options)?;
    let part = Part::of(part)?;
    let analysis = analysis(&part, tool, &mut options, Purpose::Volume)?;
    let watch = options.progress()?;
    options.finish()?;
    let outcome = watch.run_apart(py, move |observer| analysis.volume(step_mm, observer))?;
    let answers = outcome.file().answers.iter().map(|answer| *answer as u8).collect();
    Ok(VolumeOutcome { notices: part.notices_and(outcome.notices()), outcome, answers })
}

/// The answers about the points of a lattice; read-only arrays [x, y, z].
#[pyclass(frozen, module = "deepmill")]
pub struct VolumeOutcome {
    outcome: analysis::VolumeOutcome,
    answers: Vec<u8>,
    notices: Vec<String>,
}

impl VolumeOutcome {
    /// A number for each point, x fastest in memory.
    fn lattice<'a, T>(&self, numbers: &'a [T]) -> ArrayView3<'a, T> {
        let [x, y, z] = self.outcome.file().lattice.counts;
        ArrayView3::from_shape((x, y, z).f(), numbers).expect("a number for each point")
    }
}

#[pymethods]
impl VolumeOutcome {
    /// 0 accessible, 1 inaccessible, 2 tip does not fit, 3 inside the part: uint8 [x, y, z].
    #[getter]
    fn answers<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray<u8, Ix3>> {
        view(this, |of| of.lattice(&of.answers))
    }

    /// Number of directions in which the tip can be at the point: uint32 [x, y, z].
    #[getter]
    fn accessible_directions<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray<u32, Ix3>> {
        view(this, |of| of.lattice(&of.outcome.file().accessible_directions))
    }

    /// The first point, mm: point [i, j, k] is at origin_mm + step_mm * (i, j, k).
    #[getter]
    fn origin_mm(&self) -> [f64; 3] {
        self.outcome.file().lattice.origin.to_array()
    }

    /// Distance of neighbors, mm.
    #[getter]
    fn step_mm(&self) -> f64 {
        self.outcome.file().lattice.step_mm
    }

    /// Share of the points outside the part that have an answer: "accessible", "inaccessible" or "tip_does_not_fit".
    fn share(&self, py: Python<'_>, answer: &Bound<'_, PyAny>) -> PyResult<f64> {
        let answer = match &*text_of("answer", answer)? {
            "accessible" => PointAnswer::Accessible,
            "inaccessible" => PointAnswer::Inaccessible,
            "tip_does_not_fit" => PointAnswer::TipDoesNotFit,
            other => {
                let expected = "accessible, inaccessible or tip_does_not_fit";
                return Err(refused(
                    py,
                    "answer",
                    format!("`{other}`"),
                    expected,
                    "name one of them",
                ));
            }
        };
        Ok(self.outcome.file().share(answer))
    }

    /// What is wrong with fixtures and table, a sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.outcome.warnings().to_vec()
    }

    /// What was changed or left out, of the part too, a sentence each.
    #[getter]
    fn notices(&self) -> Vec<String> {
        self.notices.clone()
    }

    /// Writes what `deepmill label --volume` writes into a folder; returns the paths.
    #[pyo3(signature = (folder, **options), text_signature = "($self, folder, *, pictures=True)")]
    fn save(
        &self,
        py: Python<'_>,
        folder: &Bound<'_, PyAny>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Vec<PathBuf>> {
        folder::save(py, folder, options, Takes::Nothing, |path, files, _| {
            self.outcome.write(path, files)
        })
    }

    fn __repr__(&self) -> String {
        let [x, y, z] = self.outcome.file().lattice.counts;
        format!(
            "<deepmill.VolumeOutcome: {x} x {y} x {z} points, {} outside the part>",
            self.outcome.n_points()
        )
    }
}
