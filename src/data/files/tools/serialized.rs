//! Tools that are read with serde, checked.

use super::names::is_folder;
use super::{Tool, check_clearance};
use crate::{Error, Result};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

impl Serialize for Tool {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        Tool::serialize(self, to)
    }
}

impl<'de> Deserialize<'de> for Tool {
    fn deserialize<D: Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
        let read = Tool::deserialize(from)?;
        read.check().map_err(D::Error::custom)?;
        Ok(read)
    }
}

impl Tool {
    /// Lengths are finite, and the folder's name leads nowhere else; cutter and assembly are checked on their own.
    fn check(&self) -> Result<()> {
        let remedy = "give the tool as it was written";
        if !is_folder(&self.folder) {
            let expected = "the name of a folder";
            return Err(Error::argument("folder", &self.folder, expected, remedy));
        }
        let lengths = self.params.to_array();
        let mut numbers = lengths.iter().chain([&self.corner_mm, &self.clearance_mm]);
        if let Some(number) = numbers.find(|number| !number.is_finite()) {
            return Err(Error::argument("tool", number, "finite lengths", remedy));
        }
        check_clearance(self.clearance_mm, self.params.cr_mm)
    }
}
