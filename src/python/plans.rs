//! Setups, and tools of a library compared.

use super::answers::{array, findings_of};
use super::errors::{called, checked, refused};
use super::folder::{self, Takes};
use super::input;
use super::options::{Options, text_of};
use super::output::{list, of_json, rows, threes};
use super::part::Part;
use super::region;
use super::request::{Purpose, add_holding, analysis};
use super::tool::Tool;
use crate::Result;
use crate::analysis::{self, Analysis, Observer, SetupRequest};
use crate::answers::SiteAnswer;
use crate::data::files::machines;
use crate::planning::setups::{Clampings, direction_of_words};
use glam::{DVec3, Vec3};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use std::path::PathBuf;

/// A share above 0, at most 1.
fn share_of(options: &mut Options<'_>, default: f64) -> PyResult<f64> {
    let share = options.number("share")?.unwrap_or(default);
    match share > 0.0 && share <= 1.0 {
        true => Ok(share),
        false => Err(refused(
            options.py(),
            "share",
            share,
            "above 0, at most 1",
            "give for example 0.95",
        )),
    }
}

/// In how few setups the tools reach a part on a machine.
///
/// machine: "3-axis", "3+2:DEGREES", "4-axis", "4-axis:x", "4-axis:x:LOW,HIGH" or "5-axis:DEGREES";
/// or the path of a machine file, "FILE.toml" or "FILE.fcm".
/// share: of the area that can be reached, that the setups cover. at_most: no more setups than this.
/// clampings: "standing", "flat", "box" or "any". directions: how many are tested.
/// given: these setups in their order, none chosen: "+z", "-x" ..., or vectors, float [k, 3].
/// vise: jaw width, opening, height and perhaps parallels, mm: it grips the part in every setup.
/// table: how far below the lowest place of the part, mm, or that and its width.
/// fixtures: meshes in the part's coordinates that are there in every setup; or pairs of a setup, from 1 on, and a mesh
/// that is there in that one of the given.
/// The other options are those of `analyze`.
#[pyfunction]
#[pyo3(signature = (part, tools, machine, **options))]
#[pyo3(
    text_signature = "(part, tools, machine, *, share=0.99, at_most=None, clampings=None, directions=None, \
        given=(), vise=None, table=None, fixtures=(), sites=7000, seed=0, smooth=None, only=(), \
        except_=(), tolerance=None, finish=None, allowance=0.0, name=None, progress=None)"
)]
pub fn setups(
    part: &Bound<'_, PyAny>,
    tools: &Bound<'_, PyAny>,
    machine: &Bound<'_, PyAny>,
    options: Option<Bound<'_, PyDict>>,
) -> PyResult<SetupsOutcome> {
    let py = part.py();
    let mut options = Options::new(py, options)?;
    let text = text_of("machine", machine)?;
    let machine = checked(py, machines::of_words_or_file(&text))?;
    let part = Part::of(part)?;
    let analysis = analysis(&part, tools, &mut options, Purpose::Setups)?;
    let mut request = SetupRequest::on(machine).share(share_of(&mut options, 0.99)?);
    if let Some(n) = options.whole::<usize>("at_most")? {
        if n == 0 {
            return Err(refused(py, "at_most", n, "1 or more", "leave it out for no bound"));
        }
        request = request.at_most(n);
    }
    if let Some(name) = options.text("clampings")? {
        request = request.clampings(match &*name {
            "standing" => Clampings::Standing,
            "flat" => Clampings::Flat,
            "box" => Clampings::Box,
            "any" => Clampings::Any,
            other => {
                let expected = "standing, flat, box or any";
                return Err(refused(
                    py,
                    "clampings",
                    format!("`{other}`"),
                    expected,
                    "leave it out for the usual ones",
                ));
            }
        });
    }
    if let Some(n) = options.whole::<usize>("directions")? {
        request = request.n_directions(n);
    }
    request = request.given(given_of(&mut options)?);
    let (analysis, request) = add_holding((analysis, request), &part, &mut options)?;
    let watch = options.progress()?;
    options.finish()?;
    let outcome = watch.run_apart(py, move |observer| plan(analysis, request, observer))?;
    let first =
        outcome.setups().plan().first.iter().map(|first| first.map_or(-1, |k| k as i64)).collect();
    Ok(SetupsOutcome { notices: part.notices_and(outcome.notices()), outcome, first })
}

/// Errors of fixtures have the name of the argument here.
fn plan(
    analysis: Analysis,
    request: SetupRequest,
    observer: &mut dyn Observer,
) -> Result<analysis::SetupsOutcome> {
    let outcome = region::named(analysis.place(observer))?.plan(request, observer);
    outcome.map_err(|error| called("fixture", error, "fixtures"))
}

/// Those of a machine, if one is given.
pub fn setups_of(options: &mut Options<'_>) -> PyResult<Option<SetupRequest>> {
    let machine = options.text("machine")?;
    let given = given_of(options)?;
    match machine {
        Some(machine) => {
            let machine = checked(options.py(), machines::of_words_or_file(&machine))?;
            Ok(Some(SetupRequest::on(machine).given(given)))
        }
        None if given.is_empty() => Ok(None),
        None => {
            let remedy = "name the machine that has them";
            Err(refused(options.py(), "given", "setups", "setups of a machine", remedy))
        }
    }
}

fn given_of(options: &mut Options<'_>) -> PyResult<Vec<Vec3>> {
    let py = options.py();
    let Some(given) = options.take("given")? else { return Ok(Vec::new()) };
    let words: Option<Vec<String>> = match given.is_instance_of::<PyString>() {
        true => Some(vec![text_of("given", &given)?]),
        false => given.extract().ok(),
    };
    if let Some(words) = words {
        return words.iter().map(|word| checked(py, direction_of_words(word))).collect();
    }
    let unit =
        |row: [f64; 3]| DVec3::from_array(row).try_normalize().map(|vector| vector.as_vec3());
    let vectors: Option<Vec<Vec3>> =
        input::vectors("given", &given)?.into_iter().map(unit).collect();
    vectors.ok_or_else(|| {
        refused(py, "given", "a vector without length", "directions", "give for example [0, 0, 1]")
    })
}

/// The chosen setups, and what they reach.
#[pyclass(frozen, module = "deepmill")]
pub struct SetupsOutcome {
    outcome: analysis::SetupsOutcome,
    first: Vec<i64>,
    notices: Vec<String>,
}

#[pymethods]
impl SetupsOutcome {
    /// The setups in their order: dicts with the keys of setups.csv, turn, tools and positions.
    #[getter]
    fn setups(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(of_json(py, &self.outcome.setups().json())?.unbind())
    }

    /// The first setup that reaches each site, -1 if none does: int64 [n].
    #[getter]
    fn first<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<i64>>> {
        list(this, |of| &of.first[..])
    }

    /// Some setup to choose from reaches the site: bool [n].
    #[getter]
    fn can_be_reached<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<bool>>> {
        list(this, |of| &of.outcome.setups().plan().can_be_reached[..])
    }

    /// Positions of the sites, float32 [n, 3], mm.
    #[getter]
    fn points<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| threes(&of.outcome.placed().sites().points))
    }

    /// Outward unit normals, float32 [n, 3].
    #[getter]
    fn normals<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| threes(&of.outcome.placed().sites().normals))
    }

    /// Share of the surface that the setups reach.
    #[getter]
    fn reached_share(&self) -> f64 {
        self.outcome.setups().reached()
    }

    /// Share of the surface that some setup to choose from reaches.
    #[getter]
    fn reachable_share(&self) -> f64 {
        self.outcome.setups().can_be_reached()
    }

    /// No choice of setups that covers the share has fewer.
    #[getter]
    fn at_least(&self) -> usize {
        self.outcome.setups().plan().at_least
    }

    /// On what the part lies, and which tool axes were allowed.
    #[getter]
    fn premise(&self) -> String {
        self.outcome.premise()
    }

    /// The region that the answers are about: a dict with `only`, `except`, `area_mm2`, `part_area_mm2`; None for all
    /// of the part.
    #[getter]
    fn region(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        region::of_outcome(py, self.outcome.placed().region())
    }

    /// The regions that the setups leave, the largest first: dicts with the keys of findings.json.
    #[getter]
    fn findings(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        findings_of(py, self.outcome.findings())
    }

    /// What was changed or left out, of the part too, a sentence each.
    #[getter]
    fn notices(&self) -> Vec<String> {
        self.notices.clone()
    }

    /// Writes what `deepmill setups` writes into a folder; returns the paths.
    #[pyo3(signature = (folder, **options))]
    #[pyo3(
        text_signature = "($self, folder, *, report=False, pictures=True, unit='mm', progress=None)"
    )]
    fn save(
        &self,
        py: Python<'_>,
        folder: &Bound<'_, PyAny>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Vec<PathBuf>> {
        folder::save(py, folder, options, Takes::Report, |path, files, observer| {
            self.outcome.write(path, files, observer)
        })
    }

    fn __len__(&self) -> usize {
        self.outcome.setups().plan().setups.len()
    }

    fn __repr__(&self) -> String {
        format!("<deepmill.SetupsOutcome: {} setups, {}>", self.__len__(), self.outcome.premise())
    }
}

/// What each tool of a library reaches, the fewest tools that reach nearly all, and the least stick-outs.
///
/// tools: of `read_tools`, or a sequence of Tool. share: of what any tool reaches, that the fewest tools reach.
/// The other options are those of `analyze`.
#[pyfunction]
#[pyo3(signature = (part, tools, **options))]
#[pyo3(
    text_signature = "(part, tools, *, share=0.95, directions=None, sites=7000, seed=0, smooth=None, \
        only=(), except_=(), fixtures=(), table=None, tolerance=None, finish=None, allowance=0.0, search=None, \
        prove=False, name=None, progress=None)"
)]
pub fn compare(
    part: &Bound<'_, PyAny>,
    tools: &Bound<'_, PyAny>,
    options: Option<Bound<'_, PyDict>>,
) -> PyResult<ToolsOutcome> {
    let py = part.py();
    let mut options = Options::new(py, options)?;
    let part = Part::of(part)?;
    let analysis = analysis(&part, tools, &mut options, Purpose::Reach)?;
    let share = share_of(&mut options, 0.95)?;
    let watch = options.progress()?;
    options.finish()?;
    let outcome = watch.run_apart(py, move |observer| {
        region::named(analysis.place(observer))?.reach(share, observer)
    })?;
    Ok(ToolsOutcome { notices: part.notices_and(outcome.notices()), outcome })
}

/// What the tools of a library reach.
#[pyclass(frozen, module = "deepmill")]
pub struct ToolsOutcome {
    outcome: analysis::ToolsOutcome,
    notices: Vec<String>,
}

#[pymethods]
impl ToolsOutcome {
    /// The tools.
    #[getter]
    fn tools(&self) -> Vec<Tool> {
        let tool =
            |tool: &crate::data::files::tools::Tool| Tool { tool: tool.clone(), of_file: false };
        self.outcome.library().tools().iter().map(tool).collect()
    }

    /// A dict per tool, with the keys of tools.csv.
    #[getter]
    fn table(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(of_json(py, &self.outcome.library().table().json())?.unbind())
    }

    /// The fewest tools that reach the share: a dict each, in the order in which they add most.
    #[getter]
    fn fewest(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(of_json(py, &self.outcome.library().cover_table().json())?.unbind())
    }

    /// Per tool and site, whether the tool reaches it: bool [t, n], a copy.
    #[getter]
    fn accessible<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<bool>> {
        let reach = self.outcome.library().reach();
        let n = reach.first().map_or(0, |of| of.answers.len());
        ndarray::Array2::from_shape_fn((reach.len(), n), |(k, i)| {
            reach[k].answers[i] == SiteAnswer::Accessible
        })
        .into_pyarray(py)
    }

    /// Per tool and site, from which stick-out on the tool reaches it, infinite if from none: float64 [t, n], mm, a
    /// copy.
    #[getter]
    fn least_stick_out_mm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let reach = self.outcome.library().reach();
        let n = reach.first().map_or(0, |of| of.least_stick_out_mm.len());
        ndarray::Array2::from_shape_fn((reach.len(), n), |(k, i)| reach[k].least_stick_out_mm[i])
            .into_pyarray(py)
    }

    /// Positions of the sites, float32 [n, 3], mm, a copy.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f32>> {
        let points = &self.outcome.placed().sites().points;
        array(points.iter().map(Vec3::to_array).collect()).into_pyarray(py)
    }

    /// Share of the surface that no tool reaches.
    #[getter]
    fn unreached_share(&self) -> f64 {
        self.outcome.library().unreached()
    }

    /// The region that the answers are about: a dict with `only`, `except`, `area_mm2`, `part_area_mm2`; None for all
    /// of the part.
    #[getter]
    fn region(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        region::of_outcome(py, self.outcome.placed().region())
    }

    /// What may make the answers misleading, a sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.outcome.placed().warnings().iter().chain(self.outcome.warnings()).cloned().collect()
    }

    /// What was changed or left out, of the part too, a sentence each.
    #[getter]
    fn notices(&self) -> Vec<String> {
        self.notices.clone()
    }

    /// Writes what `deepmill tools` writes into a folder; returns the paths.
    #[pyo3(signature = (folder, **options))]
    #[pyo3(text_signature = "($self, folder, *, pictures=True, unit='mm', progress=None)")]
    fn save(
        &self,
        py: Python<'_>,
        folder: &Bound<'_, PyAny>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Vec<PathBuf>> {
        folder::save(py, folder, options, Takes::Progress, |path, files, observer| {
            self.outcome.write(path, files, observer)
        })
    }

    fn __len__(&self) -> usize {
        self.outcome.library().tools().len()
    }

    fn __repr__(&self) -> String {
        format!("<deepmill.ToolsOutcome: {} tools>", self.__len__())
    }
}
