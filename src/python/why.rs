//! Why a site of an outcome or of a folder can or cannot be reached.

use super::errors::{detached, refused, wrong_type};
use super::input;
use super::output::of_json;
use crate::analysis::Outcome;
use crate::data::files::label_query::LabelQuery;
use crate::report::explanation::{About, part_advice};
use crate::report::folder::LABELS;
use crate::{Error, Result};
use glam::DVec3;
use pyo3::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

/// Which site.
#[derive(Debug, Clone, Copy)]
pub enum Place {
    Row(usize),
    /// The site nearest to this, mm.
    Near(DVec3),
}

impl Place {
    /// Of one of two arguments.
    pub fn of(
        py: Python<'_>,
        site: Option<&Bound<'_, PyAny>>,
        at: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        match (site, at) {
            (Some(site), None) => {
                let row = site
                    .extract()
                    .map_err(|_| wrong_type("site", site, "the row of a site, from 0 on"))?;
                Ok(Place::Row(row))
            }
            (None, Some(at)) => Ok(Place::Near(input::numbers("at", at, "x, y, z in mm")?.into())),
            (site, _) => {
                let found = if site.is_some() { "given with at" } else { "not given" };
                Err(refused(
                    py,
                    "site",
                    found,
                    "either site or at",
                    "give the row of a site, or a place in mm",
                ))
            }
        }
    }
}

fn words(query: &LabelQuery, place: Place) -> Result<Value> {
    let (site, distance_mm) = match place {
        Place::Row(site) => (site, None),
        Place::Near(at) => query.nearest_site(at).map(|(site, mm)| (site, Some(mm)))?,
    };
    let why = query.explain(site)?;
    let about = About { query, site, why: &why };
    let mut value = about.json();
    value["site"] = json!(site);
    value["distance_mm"] = json!(distance_mm);
    let (lines, advice) = part_advice(&about)?;
    value["sentences"] = json!([about.sentences(), lines].concat());
    value["advice"] = advice;
    Ok(value)
}

/// About a tool of an outcome.
pub fn of_outcome(
    py: Python<'_>,
    outcome: &Outcome,
    tool: usize,
    place: Place,
) -> PyResult<Py<PyAny>> {
    let value = detached(py, || words(&outcome.query(tool)?, place))?;
    Ok(of_json(py, &value)?.unbind())
}

/// About a folder of labels.
pub fn of_folder(py: Python<'_>, path: &Path, place: Place) -> PyResult<Py<PyAny>> {
    let value = detached(py, || words(&read(path)?, place))?;
    Ok(of_json(py, &value)?.unbind())
}

fn read(path: &Path) -> Result<LabelQuery> {
    let labels = if path.is_dir() { path.join(LABELS) } else { path.to_path_buf() };
    if path.is_dir() && !labels.is_file() {
        let found = format!("there is no {LABELS} in it");
        let remedy = "give the folder of one tool, or label the part first";
        return Err(Error::file(path, "folder", found, remedy));
    }
    LabelQuery::read(&labels, None)
}
