//! `only` and `except_`: the region of interest.

use super::errors::{called, checked, refused, wrong_type};
use super::input;
use super::options::{Options, text_of};
use super::output::of_json;
use super::part::{Mesh, Part, raw_mesh};
use crate::Result;
use crate::analysis::{Analysis, selector};
use crate::data::files::settings::RegionSettings;
use crate::geom;
use crate::geom::formats::{self, ReadOptions};
use crate::geom::origin;
use crate::geom::selection::{Selection, Selector};
use glam::DVec3;
use numpy::PyUntypedArray;
use pyo3::prelude::*;
use pyo3::types::PyString;
use serde_json::json;

/// The analysis, of the region that the options `only` and `except_` give.
pub fn add_to(
    analysis: Analysis,
    part: &Part<'_>,
    options: &mut Options<'_>,
) -> PyResult<Analysis> {
    let (mut selection, mut names) = (Selection::default(), [Vec::new(), Vec::new()]);
    for (k, name) in ["only", "except_"].into_iter().enumerate() {
        let Some(value) = options.take(name)? else { continue };
        for item in items(name, &value)? {
            let Chosen { selector, words } = chosen(name, &item, part)?;
            let list = if k == 0 { &mut selection.only } else { &mut selection.except };
            list.push(selector);
            names[k].push(words);
        }
    }
    let [only, except] = names;
    Ok(match only.is_empty() && except.is_empty() {
        true => analysis,
        false => analysis.region(selection, only, except),
    })
}

/// A result; an error of a region is about the arguments of this module.
pub fn named<T>(result: Result<T>) -> Result<T> {
    result.map_err(|error| called("region", error, "only, except_"))
}

/// The region of an outcome, as a dict.
pub fn of_outcome(py: Python<'_>, region: Option<RegionSettings>) -> PyResult<Option<Py<PyAny>>> {
    let region = region.map(|region| of_json(py, &json!(region)));
    Ok(region.transpose()?.map(Bound::unbind))
}

const EXPECTED: &str =
    "text such as \"box:0,0,10,40,30,20\", a mesh, an array of triangles, or a sequence of these";

/// The value, or what it holds.
fn items<'py>(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let is_one = value.is_instance_of::<PyString>()
        || value.cast::<PyUntypedArray>().is_ok()
        || value.cast::<Mesh>().is_ok()
        || value.getattr_opt("faces")?.is_some();
    match is_one {
        true => Ok(vec![value.clone()]),
        false => value.try_iter().map_err(|_| wrong_type(name, value, EXPECTED))?.collect(),
    }
}

/// A selector, and how files name it.
struct Chosen {
    selector: Selector,
    words: String,
}

fn chosen(name: &'static str, item: &Bound<'_, PyAny>, part: &Part<'_>) -> PyResult<Chosen> {
    let of_part = part.mesh_and_origin();
    let about = of_part.and_then(|(_, origin)| origin);
    if item.is_instance_of::<PyString>() {
        let words = text_of(name, item)?;
        let read = |path: &std::path::Path| {
            let (mut mesh, _) = formats::read_mesh_with_notices(path, &ReadOptions::default())?;
            about.iter().for_each(|at| origin::make_relative(&mut mesh, *at));
            Ok(mesh)
        };
        let selector = checked(item.py(), selector(&words, name, about, &read))?;
        return Ok(Chosen { selector, words });
    }
    if item.cast::<PyUntypedArray>().is_ok() {
        let Some((all, _)) = of_part else {
            let remedy = "leave it out: a region is of triangles";
            return Err(refused(item.py(), name, "triangles of points", "a mesh as part", remedy));
        };
        let n = all.triangles.len();
        let rows = input::chosen(name, item, (n, "triangles of the part"))?;
        let words = format!("{} of {n} triangles", rows.len());
        let triangles = rows.into_iter().map(|row| all.triangles[row]).collect();
        let mesh = geom::Mesh { triangles, vertices: all.vertices.clone() };
        return Ok(Chosen { selector: Selector::Faces(mesh), words });
    }
    let (mut mesh, from, words) = match item.cast::<Mesh>() {
        Ok(mesh) => {
            let Mesh { mesh, origin, name, .. } = mesh.get();
            (mesh.clone(), origin.unwrap_or_default(), name.clone())
        }
        Err(_) => match raw_mesh(item)? {
            Some(mesh) => (mesh, DVec3::ZERO, "mesh".into()),
            None => return Err(wrong_type(name, item, EXPECTED)),
        },
    };
    let from = about.unwrap_or_default() - from;
    if from != DVec3::ZERO {
        origin::make_relative(&mut mesh, from);
    }
    Ok(Chosen { selector: Selector::Faces(mesh), words: format!("faces:{words}") })
}
