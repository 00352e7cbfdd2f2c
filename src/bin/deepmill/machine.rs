//! The machine of `setups` and `machined`: words or a file.

use deepmill::Result;
use deepmill::data::files::machines;
use deepmill::planning::setups::Machine;
use std::path::PathBuf;

/// Read after the arguments, so that what is wrong in a file is one line of error.
#[derive(Clone)]
pub enum MachineOrFile {
    Machine(Machine),
    File(PathBuf),
}

impl MachineOrFile {
    /// The file that is read.
    pub fn files(&self) -> Option<&PathBuf> {
        match self {
            MachineOrFile::Machine(_) => None,
            MachineOrFile::File(path) => Some(path),
        }
    }

    /// The machine.
    pub fn machine(&self) -> Result<Machine> {
        match self {
            MachineOrFile::Machine(machine) => Ok(machine.clone()),
            MachineOrFile::File(path) => machines::read(path),
        }
    }
}

/// The argument.
pub fn machine_or_file(text: &str) -> Result<MachineOrFile> {
    match machines::is_file(text) {
        true => Ok(MachineOrFile::File(text.into())),
        false => text.parse().map(MachineOrFile::Machine),
    }
}
