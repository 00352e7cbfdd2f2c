//! The machined part.

use super::errors::wrong_type;
use super::folder::{self, Takes};
use super::options::{Options, number};
use super::output::{of_json, rows, threes_f64};
use super::part::{Mesh, Part};
use super::plans;
use super::request::{Purpose, analysis};
use crate::analysis::{self, Stock};
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// What tools together leave of a stock: the part, with all that none of them removes in any direction.
///
/// stock: how much more than the part's box there is on every side, mm, or a Mesh about the part.
/// accuracy: mm; by default a hundredth of the longest side, at most 0.1, but no finer than a 400th of it.
/// machine: in setups of this machine, one after the other, as for `setups`: the fewest that cover 99 %, or those given
/// ("+z", "-x" ..., or vectors). The other options are those of `analyze`.
///
/// >>> import deepmill
/// >>> corners = [[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30]]
/// >>> mesh = deepmill.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
/// >>> part = deepmill.machined(mesh, "3,20,20,20", directions="up", accuracy=1.0)
/// >>> 0 <= part.left_mm3 < part.to_remove_mm3
/// True
#[pyfunction]
#[pyo3(signature = (part, tools, **options))]
#[pyo3(
    text_signature = "(part, tools, *, stock=0.0, accuracy=None, machine=None, given=(), directions=None, \
        fixtures=(), table=None, tolerance=None, finish=None, search=None, prove=False, name=None, progress=None)"
)]
pub fn machined(
    part: &Bound<'_, PyAny>,
    tools: &Bound<'_, PyAny>,
    options: Option<Bound<'_, PyDict>>,
) -> PyResult<MachinedOutcome> {
    let py = part.py();
    let mut options = Options::new(py, options)?;
    let stock = match options.take("stock")? {
        None => Stock::Box(0.0),
        Some(given) => match Mesh::of(&given)? {
            Some(mesh) => Stock::Body(mesh.get().mesh.clone()),
            None if given.extract::<f64>().is_ok() => Stock::Box(number("stock", &given)?),
            None => return Err(wrong_type("stock", &given, "a length in mm or a deepmill.Mesh")),
        },
    };
    let accuracy_mm = options.number("accuracy")?;
    let setups = plans::setups_of(&mut options)?;
    let part = Part::of(part)?;
    let analysis = analysis(&part, tools, &mut options, Purpose::Volume)?;
    let watch = options.progress()?;
    options.finish()?;
    let outcome = watch
        .run_apart(py, move |observer| analysis.machine(&stock, accuracy_mm, setups, observer))?;
    Ok(MachinedOutcome { notices: part.notices_and(outcome.notices()), outcome })
}

/// What tools leave of a stock.
#[pyclass(frozen, module = "deepmill")]
pub struct MachinedOutcome {
    outcome: analysis::MachinedOutcome,
    notices: Vec<String>,
}

#[pymethods]
impl MachinedOutcome {
    /// Corners of the part with all that is left: float64 [n, 3], mm.
    #[getter]
    fn vertices<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f64>> {
        rows(this, |of| threes_f64(&of.outcome.mesh().vertices))
    }

    /// Its triangles: uint32 [n, 3].
    #[getter]
    fn faces<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<u32>> {
        rows(this, |of| &of.outcome.mesh().triangles[..])
    }

    /// Volume that is left, mm^3.
    #[getter]
    fn left_mm3(&self) -> f64 {
        self.outcome.left_mm3()
    }

    /// Volume of the stock without the part, mm^3.
    #[getter]
    fn to_remove_mm3(&self) -> f64 {
        self.outcome.to_remove_mm3()
    }

    /// Step of the lattice, mm.
    #[getter]
    fn accuracy_mm(&self) -> f64 {
        self.outcome.accuracy_mm()
    }

    /// Of each tool what it leaves alone, and what is left after it and those before it; of setups, what is left after
    /// each tool in each of them: a list of dicts.
    #[getter]
    fn tools(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(of_json(py, &self.outcome.table().json())?.unbind())
    }

    /// Volume and place of each body that is left, the largest first: a list of dicts.
    #[getter]
    fn bodies(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(of_json(py, &self.outcome.bodies_table().json())?.unbind())
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

    /// Writes what `deepmill machined` writes into a folder; returns the paths.
    #[pyo3(signature = (folder, **options), text_signature = "($self, folder, *, pictures=True, unit='mm')")]
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
        let (left, n) = (self.outcome.left_mm3(), self.outcome.n_bodies());
        format!("<deepmill.MachinedOutcome: {left:.1} mm^3 left in {n} bodies>")
    }
}
