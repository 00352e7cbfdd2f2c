//! Results that are written into a folder.

use super::errors::{Watch, refused, wrong_type};
use super::options::Options;
use super::part::path_of;
use crate::Result;
use crate::analysis::{Files, Observer};
use crate::report::export::Extra;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};

/// What a `save` takes beside `pictures` and `unit`.
#[derive(Clone, Copy, PartialEq)]
pub enum Takes {
    /// Nothing: it shows no progress.
    Nothing,
    /// `progress`.
    Progress,
    /// `report` and `progress`.
    Report,
    /// `report`, `also` and `progress`.
    Everything,
}

/// Reads the arguments of a `save` and writes.
pub fn save(
    py: Python<'_>,
    folder: &Bound<'_, PyAny>,
    options: Option<Bound<'_, PyDict>>,
    takes: Takes,
    write: impl FnOnce(&Path, &Files, &mut dyn Observer) -> Result<Vec<PathBuf>> + Send,
) -> PyResult<Vec<PathBuf>> {
    let folder = path_of("folder", folder)?;
    let mut options = Options::new(py, options)?;
    let (pictures, unit) = (options.flag("pictures")?.unwrap_or(true), options.unit("unit")?);
    let mut files = Files { pictures, unit, ..Files::default() };
    if matches!(takes, Takes::Report | Takes::Everything) {
        files.report = options.flag("report")?.unwrap_or(false);
    }
    if takes == Takes::Everything {
        files.also = extras_of(&mut options)?;
    }
    let watch = if takes == Takes::Nothing { Watch::new(None)? } else { options.progress()? };
    options.finish()?;
    watch.run(py, |observer| write(&folder, &files, observer))
}

/// Further forms of the answers.
fn extras_of(options: &mut Options<'_>) -> PyResult<Vec<Extra>> {
    let Some(also) = options.take("also")? else { return Ok(Vec::new()) };
    let names: Vec<String> = match also.extract::<String>() {
        Ok(one) => vec![one],
        Err(_) => also
            .extract()
            .map_err(|_| wrong_type("also", &also, "a sequence of \"glb\" and \"csv\""))?,
    };
    let extra = |name: &String| {
        name.parse().map_err(|_| {
            let remedy = "NPZ and PLY are always written";
            refused(options.py(), "also", format!("`{name}`"), "glb or csv", remedy)
        })
    };
    names.iter().map(extra).collect()
}
