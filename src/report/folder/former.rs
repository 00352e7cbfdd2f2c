//! What a folder holds of former results.

use super::{FIRST_TOOLS, FIXTURES, LABELS, OUTCOME, REGION, SURFACE};
use crate::{Error, Result};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Names that `label` and `report` give their files, other than [`LABELS`] and [`FIRST_TOOLS`]; not those of
/// DeepMill++, whose own files may be there to be compared.
const OTHERS: [&str; 19] = [
    OUTCOME,
    "labels.ply",
    "labels.png",
    "labels.glb",
    "labels.csv",
    "rest.ply",
    "rest.png",
    "tools.csv",
    "tools.png",
    "findings.json",
    "findings.csv",
    "report.html",
    "difference-inaccessible.ply",
    "difference-inaccessible.png",
    "difference-occlusion.ply",
    "difference-occlusion.png",
    SURFACE,
    REGION,
    FIXTURES,
];

/// Names of files that commands write into their folder and that a part, a fixture or a tool table could have.
pub const LIKE_INPUTS: &[&str] = &[
    SURFACE,
    REGION,
    FIXTURES,
    "machined.stl",
    "rest.stl",
    "tools.csv",
    "labels.ply",
    "rest.ply",
    "tools.ply",
    "predictions.ply",
];

/// The files of former results in a folder: without new ones beside them they would be taken for those.
#[derive(Debug)]
pub struct Former {
    paths: Vec<PathBuf>,
}

impl Former {
    /// In a folder that holds labels, or those of several tools; of other folders nothing is a result.
    pub fn of(folder: &Path) -> Self {
        let marks = [LABELS, FIRST_TOOLS].map(|name| folder.join(name));
        let is_result =
            |path: &PathBuf| path.is_file() && (!is_called(path, LIKE_INPUTS) || is_own(path));
        if !marks.iter().any(is_result) {
            return Former { paths: Vec::new() };
        }
        let others = OTHERS.iter().map(|name| folder.join(name));
        Former { paths: marks.into_iter().chain(others).filter(is_result).collect() }
    }

    /// Removes those that were not written again.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn remove_but(self, written: &[PathBuf]) -> Result<()> {
        for path in self.paths.iter().filter(|path| !written.contains(path)) {
            match std::fs::remove_file(path) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(Error::write(path, error));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Checks that a file, which is read, is none that results of some names in a folder would replace.
///
/// # Errors
/// If it is in the folder, has the name of a result and was not written as one.
pub fn require_kept(path: &Path, (folder, names): (&Path, &[&str])) -> Result<()> {
    let real = |path: &Path| path.canonicalize().ok();
    let beside = real(path).and_then(|path| path.parent().map(Path::to_path_buf));
    if beside.is_none() || beside != real(folder) || !is_called(path, names) || is_own(path) {
        return Ok(());
    }
    let found = "a file of the results has this name too, and would replace it";
    Err(Error::file(path, "name", found, "name another folder for the results"))
}

fn is_called(path: &Path, names: &[&str]) -> bool {
    path.file_name().is_some_and(|of| names.iter().any(|name| of == *name))
}

/// Whether a file was written by this crate, as it begins.
fn is_own(path: &Path) -> bool {
    let mut begin = Vec::new();
    let read = File::open(path).and_then(|file| file.take(200).read_to_end(&mut begin));
    let holds = |words: &[u8]| begin.windows(words.len()).any(|window| window == words);
    read.is_ok()
        && (begin.starts_with(b"deepmill ")
            || begin.starts_with(b"name,CR,")
            || (begin.starts_with(b"ply") && holds(b"comment deepmill ")))
}
