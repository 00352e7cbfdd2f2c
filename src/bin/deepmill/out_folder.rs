//! The folder of the results.

use deepmill::report::folder::{LIKE_INPUTS, require_kept};
use deepmill::{Result, atomic_file};
use std::path::{Path, PathBuf};

/// Passes if results can be written into a folder and replace no file that was named.
pub fn check_out(folder: &Path) -> Result<()> {
    check_out_of(folder, LIKE_INPUTS)
}

/// As [`check_out`], of results of these names.
pub fn check_out_of(folder: &Path, names: &[&str]) -> Result<()> {
    atomic_file::check_writable_folder(folder)?;
    // Whatever is named and is a file is read, but for one that is to be written anyway.
    for argument in std::env::args_os().skip(1) {
        let text = argument.to_string_lossy();
        let path = match text.strip_prefix("--").and_then(|text| text.split_once('=')) {
            Some((_, path)) => PathBuf::from(path),
            None => PathBuf::from(&argument),
        };
        if path.is_file() {
            require_kept(&path, (folder, names))?;
        }
    }
    Ok(())
}
