//! Labels of sites.

use super::errors::{detached, wrong_type};
use super::folder::{self, Takes};
use super::options::{Options, text_of};
use super::output::{flags, list, of_json, rows, threes};
use super::part::{Mesh, Part, Sites, path_of};
use super::region;
use super::request::{Purpose, analysis};
use super::tool::Tool;
use super::why;
use crate::access::Labels;
use crate::access::surface::SurfaceEvidence;
use crate::analysis;
use crate::answers::SiteAnswers;
use crate::findings::Findings;
use crate::findings::gate::SiteAreas;
use crate::storage::atomic_file;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::exceptions::{PyIndexError, PyKeyError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyList, PyString};
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// Labels every site of a part for one tool or several: exactly which ones a tool cannot reach.
///
/// part: Mesh, an object with `vertices` and `faces`, or Sites (points then block, the published definition).
/// tools: Tool, lengths "CR,CH,FR,FH" in mm, or a sequence of these.
/// directions: number of them over the upper half (150), a set such as "cone:60:150", "sphere:300", "up", or vectors
///     from tip to spindle, float [n, 3].
/// sites: about how many, or "vertices". seed: of the places. smooth: degrees; normals across flatter folds are smooth.
/// occlusion, occlusion_share: also mark that share of the sites that are most often in the way.
/// obstacles: "part", "published", "centroids", or a number of further points. fixtures: meshes that block too.
/// only, except_: answer for these faces alone, or not for these; all of the part blocks. Text as of the command
///     ("box:0,0,10,40,30,20", "normal:0,0,1:10", "faces:FILE" in mm, "findings:DIR"), a mesh of which the faces lie
///     on the part's, an array of rows of Mesh.triangles or a bool for each, or a sequence of these.
/// table: height of a table, mm. tolerance, finish, allowance, clearance_limit: mm.
/// rest: also compute how much each tool leaves where it does not reach.
/// search: how wide to search between the directions, 0 not at all. prove: search far longer, for proofs.
/// progress: callable (stage: str, done: int, of: int); False stops with deepmill.Interrupted.
///
/// >>> import deepmill
/// >>> corners = [[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30]]
/// >>> mesh = deepmill.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
/// >>> outcome = deepmill.analyze(mesh, deepmill.Tool("3,20,20,20", kind="flat"), directions="up", sites=500)
/// >>> outcome[0].accessible.shape
/// (500,)
/// >>> bool(outcome[0].accessible[outcome.normals[:, 2] < -0.5].any())  # the underside
/// False
#[pyfunction]
#[pyo3(signature = (part, tools, **options))]
#[pyo3(
    text_signature = "(part, tools, *, directions=None, sites=7000, seed=0, smooth=None, occlusion=False, \
        occlusion_share=0.1, obstacles=None, only=(), except_=(), fixtures=(), table=None, \
        tolerance=None, finish=None, allowance=0.0, search=None, prove=False, \
        clearance_limit=None, rest=False, name=None, progress=None)"
)]
pub fn analyze(
    part: &Bound<'_, PyAny>,
    tools: &Bound<'_, PyAny>,
    options: Option<Bound<'_, PyDict>>,
) -> PyResult<Outcome> {
    let py = part.py();
    let mut options = Options::new(py, options)?;
    let part = Part::of(part)?;
    let request = analysis(&part, tools, &mut options, Purpose::Labels)?;
    let watch = options.progress()?;
    options.finish()?;
    let (outcome, warnings) = watch.run_apart(py, move |observer| {
        let outcome = region::named(request.place(observer))?.label(observer)?;
        let warnings = warnings_of(&outcome);
        Ok((outcome, warnings))
    })?;
    let notices = part.notices_and(outcome.notices());
    let (outcome, mesh) = (Arc::new(outcome), part.mesh());
    Ok(Outcome { outcome, mesh, warnings, notices, areas: OnceLock::new() })
}

/// Reads what Outcome.save or `deepmill label` has written to a folder: an equal outcome.
///
/// >>> import deepmill, tempfile
/// >>> corners = [[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30]]
/// >>> mesh = deepmill.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
/// >>> outcome = deepmill.analyze(mesh, "3,20,20,20", sites=200)
/// >>> with tempfile.TemporaryDirectory() as folder:
/// ...     paths = outcome.save(folder)
/// ...     read = deepmill.read_outcome(folder)
/// >>> bool((read[0].inaccessible == outcome[0].inaccessible).all()), read.findings == outcome.findings
/// (True, True)
#[pyfunction]
pub fn read_outcome(folder: &Bound<'_, PyAny>) -> PyResult<Outcome> {
    let py = folder.py();
    let path = path_of("folder", folder)?;
    let outcome = detached(py, || analysis::Outcome::read(&path))?;
    let (warnings, notices) = (warnings_of(&outcome), outcome.notices().to_vec());
    let mesh = Mesh::of_outcome(&outcome).map(|mesh| Py::new(py, mesh)).transpose()?;
    Ok(Outcome { outcome: Arc::new(outcome), mesh, warnings, notices, areas: OnceLock::new() })
}

/// About fixtures, then about each tool.
fn warnings_of(outcome: &analysis::Outcome) -> Vec<String> {
    let mut warnings = outcome.placed_warnings().to_vec();
    for (tool, answer) in outcome.tools().iter().zip(outcome.answers()) {
        let of = if outcome.has_folders() { format!("{}: ", tool.name) } else { String::new() };
        warnings.extend(answer.warnings.iter().map(|warning| format!("{of}{warning}")));
    }
    warnings
}

/// The answers about every tool, and what follows from them. Arrays are read-only views, in the order of the sites.
///
/// `outcome[0]`, `outcome["name"]`, iteration and `len` are over the answers of each tool.
#[pyclass(frozen, module = "deepmill")]
pub struct Outcome {
    pub outcome: Arc<analysis::Outcome>,
    mesh: Option<Py<Mesh>>,
    warnings: Vec<String>,
    notices: Vec<String>,
    areas: OnceLock<SiteAreas>,
}

impl Outcome {
    fn areas(&self, py: Python<'_>) -> PyResult<&SiteAreas> {
        if self.areas.get().is_none() {
            let areas = detached(py, || self.outcome.areas())?;
            // Another thread may have been faster, with the same.
            let _ = self.areas.set(areas);
        }
        Ok(self.areas.get().expect("set above"))
    }

    /// The number of a tool, of its number or name.
    pub fn tool_of(&self, key: &Bound<'_, PyAny>) -> PyResult<usize> {
        let n = self.outcome.tools().len();
        if key.is_instance_of::<PyString>() {
            let name = text_of("tool", key)?;
            let found = self.outcome.tools().iter().position(|tool| tool.name == name);
            return found.ok_or_else(|| PyKeyError::new_err(format!("there is no tool {name}")));
        }
        let number: isize =
            key.extract().map_err(|_| wrong_type("tool", key, "a number or the name of a tool"))?;
        let from_end = number.checked_add_unsigned(n).filter(|_| number < 0).unwrap_or(number);
        let found = usize::try_from(from_end).ok().filter(|k| *k < n);
        found.ok_or_else(|| PyIndexError::new_err(format!("there is no tool {number} of {n}")))
    }

    fn all(&self, py: Python<'_>) -> PyResult<Py<PyList>> {
        let list = PyList::empty(py);
        for k in 0..self.outcome.tools().len() {
            list.append(Bound::new(py, ToolAnswers { outcome: Arc::clone(&self.outcome), k })?)?;
        }
        Ok(list.unbind())
    }
}

/// The list of findings, as dicts.
pub fn findings_of(py: Python<'_>, findings: &Findings) -> PyResult<Py<PyAny>> {
    let all = of_json(py, &findings.json())?;
    Ok(all.get_item("findings")?.unbind())
}

#[pymethods]
impl Outcome {
    fn __len__(&self) -> usize {
        self.outcome.tools().len()
    }

    fn __getitem__(&self, key: &Bound<'_, PyAny>) -> PyResult<ToolAnswers> {
        Ok(ToolAnswers { outcome: Arc::clone(&self.outcome), k: self.tool_of(key)? })
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        self.all(py)?.bind(py).try_iter()
    }

    /// Name of the part.
    #[getter]
    fn part(&self) -> &str {
        self.outcome.part()
    }

    /// "mesh": against the triangles; "published": against points.
    #[getter]
    fn definition(&self) -> &'static str {
        if self.outcome.definition().is_by_mesh() { "mesh" } else { "published" }
    }

    /// The tools.
    #[getter]
    fn tools(&self) -> Vec<Tool> {
        let tool =
            |tool: &crate::data::files::tools::Tool| Tool { tool: tool.clone(), of_file: false };
        self.outcome.tools().iter().map(tool).collect()
    }

    /// The mesh as it was labeled, which `faces` are of; None of a cloud.
    #[getter]
    fn mesh(&self, py: Python<'_>) -> Option<Py<Mesh>> {
        self.mesh.as_ref().map(|mesh| mesh.clone_ref(py))
    }

    /// The sites, with the triangle that each lies on.
    #[getter]
    fn sites(&self) -> Sites {
        Sites(Arc::new(self.outcome.sites().clone()))
    }

    /// Positions, float32 [n, 3], mm.
    #[getter]
    fn points<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| threes(&of.outcome.sites().points))
    }

    /// Outward unit normals, float32 [n, 3].
    #[getter]
    fn normals<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| threes(&of.outcome.sites().normals))
    }

    /// The triangle that each site lies on, uint32 [n]; None for a cloud.
    #[getter]
    fn faces<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<u32>>> {
        list(this, |of| &of.outcome.sites().faces[..])
    }

    /// The directions tested, float32 [d, 3], from tip to spindle.
    #[getter]
    fn directions<'py>(this: &Bound<'py, Self>) -> Bound<'py, PyArray2<f32>> {
        rows(this, |of| threes(of.outcome.directions().vectors()))
    }

    /// Share of the surface about each site, float64 [n]; they add up to 1.
    #[getter]
    fn area_shares<'py>(this: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        this.get().areas(this.py())?;
        Ok(list(this, |of| of.areas.get().map_or(&[], SiteAreas::shares)))
    }

    /// Area of the surface, mm²; None by the published definition.
    #[getter]
    fn surface_mm2(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        Ok(self.areas(py)?.total_mm2())
    }

    /// The region that the answers are about: a dict with `only`, `except`, `area_mm2`, `part_area_mm2`; None for all
    /// of the part.
    #[getter]
    fn region(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        region::of_outcome(py, self.outcome.region())
    }

    /// The regions that no tool reaches, the largest first: dicts with the keys of findings.json.
    #[getter]
    fn findings(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        findings_of(py, self.outcome.findings())
    }

    /// What may make the answers misleading, a sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// What was changed or left out, of the part too, a sentence each.
    #[getter]
    fn notices(&self) -> Vec<String> {
        self.notices.clone()
    }

    /// Seconds that sites, labels and findings took.
    #[getter]
    fn seconds(&self) -> (f64, f64, f64) {
        self.outcome.seconds().into()
    }

    /// Writes what `deepmill label` writes into a folder; returns the paths.
    ///
    /// report: also report.html. pictures: PNG files. also: "glb" and "csv". unit: of tables and report.
    #[pyo3(signature = (folder, **options))]
    #[pyo3(
        text_signature = "($self, folder, *, report=False, pictures=True, also=(), unit='mm', progress=None)"
    )]
    fn save(
        &self,
        py: Python<'_>,
        folder: &Bound<'_, PyAny>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<Vec<PathBuf>> {
        folder::save(py, folder, options, Takes::Everything, |path, files, observer| {
            self.outcome.write(path, files, observer)
        })
    }

    /// Writes an HTML report into one file; returns its path. unit: of lengths and areas.
    #[pyo3(signature = (path, **options), text_signature = "($self, path, *, unit='mm')")]
    fn report(
        &self,
        py: Python<'_>,
        path: &Bound<'_, PyAny>,
        options: Option<Bound<'_, PyDict>>,
    ) -> PyResult<PathBuf> {
        let path = path_of("path", path)?;
        let mut options = Options::new(py, options)?;
        let unit = options.unit("unit")?;
        options.finish()?;
        detached(py, || {
            let html = self.outcome.html(unit)?;
            atomic_file::write_atomic(&path, |file| {
                std::io::Write::write_all(file, html.as_bytes())
            })
        })?;
        Ok(path)
    }

    /// Why a site can or cannot be reached: see `deepmill.explain`.
    #[pyo3(signature = (site=None, *, at=None, tool=None))]
    fn explain(
        &self,
        py: Python<'_>,
        site: Option<&Bound<'_, PyAny>>,
        at: Option<&Bound<'_, PyAny>>,
        tool: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Py<PyAny>> {
        let tool = tool.map_or(Ok(0), |tool| self.tool_of(tool))?;
        why::of_outcome(py, &self.outcome, tool, why::Place::of(py, site, at)?)
    }

    fn __repr__(&self) -> String {
        let (sites, tools) = (self.outcome.sites().len(), self.outcome.tools().len());
        format!("<deepmill.Outcome of {:?}: {sites} sites, {tools} tools>", self.outcome.part())
    }
}

/// The answers about one tool. Arrays are read-only, if they are not called copies, one entry per site; None is what
/// was not computed.
#[pyclass(frozen, module = "deepmill")]
pub struct ToolAnswers {
    outcome: Arc<analysis::Outcome>,
    k: usize,
}

impl ToolAnswers {
    fn labels(&self) -> &Labels {
        &self.outcome.answers()[self.k].labels
    }

    fn answers(&self) -> &SiteAnswers {
        &self.labels().answers
    }

    fn surface(&self) -> Option<&SurfaceEvidence> {
        self.labels().surface.as_ref()
    }
}

#[pymethods]
impl ToolAnswers {
    /// The tool.
    #[getter]
    fn tool(&self) -> Tool {
        Tool { tool: self.outcome.tools()[self.k].clone(), of_file: false }
    }

    /// In every direction what does not cut, or the flank, collides: bool [n].
    #[getter]
    fn inaccessible<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<bool>>> {
        flags(py, self.answers().inaccessible())
    }

    /// In some direction only the tip penetrates the part, in none nothing does: bool [n]; None by the published
    /// definition.
    #[getter]
    fn tip_does_not_fit<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<bool>>> {
        flags(py, self.answers().tip_does_not_fit())
    }

    /// The tool reaches the site: neither of the two; bool [n], a copy.
    #[getter]
    fn accessible<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        self.answers().accessible().into_pyarray(py)
    }

    /// Among the sites that are most often in the way: bool [n]; None unless `occlusion`.
    #[getter]
    fn occlusion<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<bool>>> {
        list(this, |of| &of.answers().occlusion[..])
    }

    /// Number of directions in which the tool reaches the site: uint32 [n].
    #[getter]
    fn accessible_directions<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<u32>>> {
        list(this, |of| &of.answers().accessible_directions[..])
    }

    /// That number as a share of the directions: float32 [n].
    #[getter]
    fn accessible_share<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        list(this, |of| &of.answers().accessible_share[..])
    }

    /// A direction in which the tool reaches the site, from tip to spindle; NaN where there is none: float32 [n, 3], a
    /// copy.
    #[getter]
    fn witness<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f32>> {
        let none = [f32::NAN; 3];
        let witness = &self.answers().witness;
        let rows = witness.iter().map(|found| found.map_or(none, |direction| direction.to_array()));
        array(rows.collect()).into_pyarray(py)
    }

    /// Where the tip is then, mm; NaN where there is none: float64 [n, 3], a copy. None by the published definition.
    #[getter]
    fn tip_mm<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let none = [f64::NAN; 3];
        let poses = &self.surface()?.witness;
        let rows = poses.iter().map(|pose| pose.map_or(none, |pose| pose.tip_mm.to_array()));
        Some(array(rows.collect()).into_pyarray(py))
    }

    /// How far every height and radius of the tool may grow (positive) or must shrink: float32 [n], mm; None unless
    /// `clearance_limit`.
    #[getter]
    fn clearance_mm<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        list(this, |of| &of.answers().clearance_mm[..])
    }

    /// How much the tool leaves, 0 where it reaches: float32 [n], mm; None unless `rest`.
    #[getter]
    fn rest_mm<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        list(this, |of| &of.answers().rest_mm[..])
    }

    /// Volume of what is left about each site: float32 [n], mm³; None unless `rest`.
    #[getter]
    fn rest_volume_mm3<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        list(this, |of| &of.answers().rest_volume_mm3[..])
    }

    /// Gouge tolerance at each site: float64 [n], mm; None by the published definition.
    #[getter]
    fn tolerance_mm<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f64>>> {
        list(this, |of| of.surface().map_or(&[], |surface| &surface.tolerance_mm[..]))
    }

    /// Share of the directions that was not proven closed, of sites that are not accessible: float32 [n]; 0: proven.
    #[getter]
    fn open_directions<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f32>>> {
        list(this, |of| of.surface().map_or(&[], |surface| &surface.open_directions[..]))
    }

    /// Number of the finding that each site belongs to, from 1 on, 0 if to none: uint32 [n].
    #[getter]
    fn finding_of_site<'py>(this: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<u32>>> {
        list(this, |of| &of.outcome.answers()[of.k].findings.of_site[..])
    }

    /// The regions out of reach of this tool, the largest first: dicts with the keys of findings.json.
    #[getter]
    fn findings(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        findings_of(py, &self.outcome.answers()[self.k].findings)
    }

    /// What may make the answers misleading, a sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.outcome.answers()[self.k].warnings.iter().map(ToString::to_string).collect()
    }

    fn __len__(&self) -> usize {
        self.answers().len()
    }

    fn __repr__(&self) -> String {
        let (n, name) = (self.answers().len(), &self.outcome.tools()[self.k].name);
        format!(
            "<deepmill.ToolAnswers of {name:?}: {} of {n} sites inaccessible>",
            self.answers().n_inaccessible()
        )
    }
}

/// Rows as an array.
pub fn array<T: Copy, const N: usize>(rows: Vec<[T; N]>) -> ndarray::Array2<T> {
    ndarray::Array2::from(rows)
}
