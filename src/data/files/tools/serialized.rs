//! Tools that are read with serde, checked.

use super::names::is_folder;
use super::{Tool, check_clearance};
use crate::cutter::{Assembly, Cutter, CutterParams};
use crate::geom::units::Unit;
use crate::{Error, Result};
use serde::Deserialize;

/// A tool as it was written.
#[derive(Deserialize)]
pub(super) struct Stated {
    name: String,
    number: Option<u32>,
    folder: String,
    unit: Unit,
    params: CutterParams,
    corner_mm: f64,
    clearance_mm: f64,
    cutter: Cutter,
    assembly: Assembly,
    description: Option<String>,
}

impl TryFrom<Stated> for Tool {
    type Error = Error;

    fn try_from(stated: Stated) -> Result<Self> {
        let Stated {
            name,
            number,
            folder,
            unit,
            params,
            corner_mm,
            clearance_mm,
            cutter,
            assembly,
            description,
        } = stated;
        let remedy = "give the tool as it was written";
        if !is_folder(&folder) {
            return Err(Error::argument("folder", folder, "the name of a folder", remedy));
        }
        let lengths = params.to_array();
        let mut numbers = lengths.iter().chain([&corner_mm, &clearance_mm]);
        if let Some(number) = numbers.find(|number| !number.is_finite()) {
            return Err(Error::argument("tool", number, "finite lengths", remedy));
        }
        check_clearance(clearance_mm, params.cr_mm)?;
        Ok(Tool {
            name,
            number,
            folder,
            unit,
            params,
            corner_mm,
            clearance_mm,
            cutter,
            assembly,
            description,
        })
    }
}
