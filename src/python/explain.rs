//! Why a site can or cannot be reached.

use super::answers::Outcome;
use super::errors::refused;
use super::part::path_of;
use super::why::{self, Place};
use pyo3::prelude::*;

/// Why a site can or cannot be reached, what blocks, and the least change of the tool that helps.
///
/// result: an Outcome, or the folder that `Outcome.save` or `deepmill label` has written (of several tools, that of
/// one). site: its row; or at: x, y, z in mm, for the nearest site. tool: number or name, of an Outcome.
/// Returns a dict: `answer`, `sentences`, `blocked_by`, `witness`, `nearest`, `changes` and more.
#[pyfunction]
#[pyo3(signature = (result, site=None, *, at=None, tool=None))]
pub fn explain(
    result: &Bound<'_, PyAny>,
    site: Option<&Bound<'_, PyAny>>,
    at: Option<&Bound<'_, PyAny>>,
    tool: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<PyAny>> {
    let py = result.py();
    let place = Place::of(py, site, at)?;
    if let Ok(outcome) = result.cast::<Outcome>() {
        let outcome = outcome.get();
        let tool = tool.map_or(Ok(0), |tool| outcome.tool_of(tool))?;
        return why::of_outcome(py, &outcome.outcome, tool, place);
    }
    let path = path_of("result", result)?;
    if tool.is_some() {
        let remedy = "give the folder of that tool";
        return Err(refused(py, "tool", "given with a folder", "none", remedy));
    }
    why::of_folder(py, &path, place)
}
