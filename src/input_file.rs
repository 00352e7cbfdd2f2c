//! Input files: read whole, up to a stated size, however large they say or do not say they are.

use crate::{Error, Result, memory};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Most bytes of a file of meshes, clouds, weights, checkpoints or a part of a data set.
pub const MOST_DATA: u64 = 4 << 30;
/// Most bytes of a manifest, a record, or text of the published format.
pub const MOST_TEXT: u64 = 1 << 30;
/// Most bytes of settings, tool libraries, tables and notes.
pub const MOST_SETTINGS: u64 = 64 << 20;

/// The bytes of `path`, at most `most_bytes`.
///
/// # Errors
/// If there are more, they do not fit into the memory, or the system refuses the file.
pub fn read(path: &Path, most_bytes: u64) -> Result<Vec<u8>> {
    let failed = |e| Error::read(path, e);
    let file = File::open(path).map_err(failed)?;
    // A device or a pipe has no size.
    let size = file.metadata().map_err(failed)?.len();
    if size > most_bytes {
        return Err(too_large(path, format!("{size} bytes"), most_bytes));
    }
    memory::require("reading the file", size, format!("{}: free some memory", path.display()))?;
    let mut bytes = Vec::with_capacity(size as usize);
    file.take(most_bytes + 1).read_to_end(&mut bytes).map_err(failed)?;
    match bytes.len() as u64 > most_bytes {
        true => Err(too_large(path, "more than that".into(), most_bytes)),
        false => Ok(bytes),
    }
}

/// The text of `path`, at most `most_bytes` of it.
///
/// # Errors
/// As [`read`], or if it is no text in UTF-8.
pub fn read_text(path: &Path, most_bytes: u64) -> Result<String> {
    String::from_utf8(read(path, most_bytes)?).map_err(|e| {
        let place = format!("byte {}", e.utf8_error().valid_up_to());
        Error::file(path, place, "it is no text in UTF-8", "save the file as text in UTF-8")
    })
}

fn too_large(path: &Path, found: String, most_bytes: u64) -> Error {
    let found = format!("{found}, at most {most_bytes} are read");
    Error::file(path, "size", found, "check that this is the file you mean, or divide it")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_any_length_are_read_up_to_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        std::fs::write(&path, [255; 100]).unwrap();
        assert_eq!(read(&path, 100).unwrap(), [255; 100]);
        let message = read(&path, 99).unwrap_err().to_string();
        assert!(message.contains("a.bin: size: 100 bytes, at most 99 are read; "), "{message}");
        let message = read_text(&path, 100).unwrap_err().to_string();
        assert!(message.contains("a.bin: byte 0: it is no text"), "{message}");
        assert!(read(folder.path(), MOST_DATA).unwrap_err().to_string().contains("cannot be read"));
        // It says that it has no bytes, and never ends.
        if cfg!(target_os = "linux") {
            let message = read(Path::new("/dev/zero"), 1000).unwrap_err().to_string();
            assert!(message.contains("/dev/zero: size: more than that, at most 1000"), "{message}");
        }
    }
}
