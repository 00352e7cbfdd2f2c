//! Input files: read whole, up to a stated size, however large they say or do not say they are.

use crate::exec::memory;
use crate::{Error, Result};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// How much of a file is read, and what that takes.
#[derive(Debug, Clone, Copy)]
pub struct ReadLimit {
    most_bytes: u64,
    /// Memory for each byte of the file, with all that is read out of it at worst.
    expansion: u64,
}

/// Meshes, clouds, weights, checkpoints, parts of a data set. What is made of them is estimated by their readers.
pub const DATA: ReadLimit = ReadLimit { most_bytes: 4 << 30, expansion: 1 };
/// Manifests, records, text of the published format.
pub const TEXT: ReadLimit = ReadLimit { most_bytes: 1 << 30, expansion: 16 };
/// Tool libraries, tables, holders, fixtures of gradients: two bytes may be a number of JSON, 72 bytes in a vector that
/// doubles.
pub const LIBRARY: ReadLimit = ReadLimit { most_bytes: 64 << 20, expansion: 80 };
/// Findings that are known: some 700 bytes each.
pub const BASELINE: ReadLimit = ReadLimit { most_bytes: 16 << 20, expansion: 250 };
/// Settings.
pub const SETTINGS: ReadLimit = ReadLimit { most_bytes: 1 << 20, expansion: 250 };

/// The bytes of `path`, within `limit`.
///
/// # Errors
/// If there are more, they do not fit into the memory, or the system refuses the file.
pub fn read(path: &Path, limit: ReadLimit) -> Result<Vec<u8>> {
    let failed = |e| Error::read(path, e);
    let ReadLimit { most_bytes, expansion } = limit;
    let file = File::open(path).map_err(failed)?;
    // A device or a pipe has no size.
    let size = file.metadata().map_err(failed)?.len();
    if size > most_bytes {
        return Err(too_large(path, format!("{size} bytes"), most_bytes));
    }
    memory::require_for(path, "reading the file", size * expansion)?;
    let most_bytes = match size {
        // Vectors grow by doubling.
        0 => most_bytes.min(memory::limit_bytes() / (2 + expansion)),
        _ => most_bytes,
    };
    let mut bytes = Vec::with_capacity(size as usize);
    file.take(most_bytes + 1).read_to_end(&mut bytes).map_err(failed)?;
    match bytes.len() as u64 > most_bytes {
        true => Err(too_large(path, "more than that".into(), most_bytes)),
        false => Ok(bytes),
    }
}

/// The text of `path`, within `limit`.
///
/// # Errors
/// As [`read`], or if it is no text in UTF-8.
pub fn read_text(path: &Path, limit: ReadLimit) -> Result<String> {
    String::from_utf8(read(path, limit)?).map_err(|e| {
        let place = format!("byte {}", e.utf8_error().valid_up_to());
        Error::file(path, place, "it is no text in UTF-8", "save the file as text in UTF-8")
    })
}

/// The line of a byte, from 1 on.
pub fn line_of(text: &[u8], byte: usize) -> usize {
    1 + text[..byte.min(text.len())].iter().filter(|b| **b == b'\n').count()
}

/// An entry of an archive, unpacked within `limit`; `claimed` is the size that the archive says it has.
///
/// # Errors
/// If there is more, it does not fit into the memory, or the archive is damaged.
pub fn read_entry(
    entry: impl Read,
    claimed: u64,
    path: &Path,
    limit: ReadLimit,
) -> Result<Vec<u8>> {
    let ReadLimit { most_bytes, expansion } = limit;
    let most_bytes = most_bytes.min(claimed);
    if claimed > limit.most_bytes {
        return Err(too_large(path, format!("it unpacks to {claimed} bytes"), limit.most_bytes));
    }
    memory::require_for(path, "reading the file", claimed * expansion)?;
    let mut bytes = Vec::new();
    entry.take(most_bytes + 1).read_to_end(&mut bytes).map_err(|e| {
        Error::file(path, "zip archive", e.to_string(), "copy or export the file again")
    })?;
    match bytes.len() as u64 > most_bytes {
        true => Err(too_large(path, "it unpacks to more than it says".into(), most_bytes)),
        false => Ok(bytes),
    }
}

/// What a file is that people take for another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Foreign {
    /// HTML.
    WebPage,
    /// A ZIP archive, or a document that is one inside.
    Zip,
}

/// Whether these bytes begin as a web page or an archive.
pub fn foreign(bytes: &[u8]) -> Option<Foreign> {
    const LOOK: usize = 1024;
    if bytes.starts_with(b"PK\x03\x04") {
        return Some(Foreign::Zip);
    }
    let start = String::from_utf8_lossy(&bytes[..bytes.len().min(LOOK)]).to_lowercase();
    let start = start.trim_start_matches('\u{feff}').trim_start();
    let is_page =
        start.starts_with('<') && (start.contains("<!doctype html") || start.contains("<html"));
    is_page.then_some(Foreign::WebPage)
}

impl Foreign {
    /// The error of a file that should be `what`.
    pub fn error(self, path: &Path, what: &str) -> Error {
        let (found, remedy) = match self {
            Foreign::WebPage => (
                format!("it is a web page, not {what}"),
                "download the file itself (\"raw\"), not the page that shows it",
            ),
            Foreign::Zip => (format!("it is a ZIP archive, not {what}"), "unpack it first"),
        };
        Error::file(path, "byte 0", found, remedy)
    }
}

fn too_large(path: &Path, found: String, most_bytes: u64) -> Error {
    let found = format!("{found}, at most {most_bytes} are read");
    Error::file(path, "size", found, "check that this is the file you mean, or divide it")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn web_pages_and_archives_are_called_that() {
        for page in ["<!DOCTYPE html><html>", "\u{feff}\n <HTML lang=\"en\">", "<?xml?><html>"] {
            let kind = foreign(page.as_bytes()).unwrap();
            let message = kind.error(Path::new("a.csv"), "a table").to_string();
            assert!(
                message.contains("a.csv: byte 0: it is a web page, not a table; "),
                "{message}"
            );
        }
        assert_eq!(foreign(b"PK\x03\x04..."), Some(Foreign::Zip));
        for other in ["a,b <html>", "", "<svg>", "name,CR"] {
            assert_eq!(foreign(other.as_bytes()), None, "{other}");
        }
    }

    #[test]
    fn files_of_any_length_are_read_up_to_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        std::fs::write(&path, [255; 100]).unwrap();
        let up_to = |most_bytes| ReadLimit { most_bytes, expansion: 1 };
        assert_eq!(read(&path, up_to(100)).unwrap(), [255; 100]);
        let message = read(&path, up_to(99)).unwrap_err().to_string();
        assert!(message.contains("a.bin: size: 100 bytes, at most 99 are read; "), "{message}");
        let message = read_text(&path, up_to(100)).unwrap_err().to_string();
        assert!(message.contains("a.bin: byte 0: it is no text"), "{message}");
        assert!(read(folder.path(), DATA).unwrap_err().to_string().contains("cannot be read"));
        // It says that it has no bytes, and never ends.
        if cfg!(target_os = "linux") {
            let message = read(Path::new("/dev/zero"), up_to(1000)).unwrap_err().to_string();
            assert!(message.contains("/dev/zero: size: more than that, at most 1000"), "{message}");
        }
    }
}
