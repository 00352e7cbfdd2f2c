//! Files that a target writes and the crate reads, in a folder of this process, in memory where the system has such a
//! place.
#![allow(dead_code)] // Each target uses some of it.

use std::io::{Cursor, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let memory = Path::new("/dev/shm");
    let root = if memory.is_dir() { memory.into() } else { std::env::temp_dir() };
    root.join(format!("deepmill-fuzz-{}", std::process::id()))
});

/// A path in the folder.
pub fn path(name: &str) -> PathBuf {
    FOLDER.join(name)
}

/// Writes a file and the folders above it.
pub fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = path(name);
    std::fs::create_dir_all(path.parent().expect("a file in a folder")).expect("a writable folder");
    std::fs::write(&path, bytes).expect("a writable folder");
    path
}

/// `bytes` with some changed: each four of `changes` are a place and a value.
pub fn changed(bytes: &[u8], changes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for [a, b, c, value] in changes.as_chunks::<4>().0 {
        let place = u32::from_le_bytes([*a, *b, *c, 0]) as usize % bytes.len();
        bytes[place] = *value;
    }
    bytes
}

/// Names and bytes of the entries of an archive.
pub type Entries = Vec<(String, Vec<u8>)>;

pub fn entries(path: &Path) -> Entries {
    let mut zip = ZipArchive::new(Cursor::new(std::fs::read(path).unwrap())).unwrap();
    let mut entries = Entries::new();
    for i in 0..zip.len() {
        let mut entry = zip.by_index(i).unwrap();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        entries.push((entry.name().unwrap().into_owned(), bytes));
    }
    entries
}

/// An archive of these entries with some bytes changed, under right checksums: an entry takes every n-th change, and is
/// left out if the last of them is 255.
pub fn archive(entries: &Entries, changes: &[u8]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (i, (name, bytes)) in entries.iter().enumerate() {
        let own: Vec<u8> =
            changes.chunks(4).skip(i).step_by(entries.len()).flatten().copied().collect();
        if own.last() == Some(&255) {
            continue;
        }
        zip.start_file(name, stored).unwrap();
        zip.write_all(&changed(bytes, &own)).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// An error is one line.
pub fn assert_one_line<T>(result: Result<T, deepmill::Error>) -> Option<T> {
    match result {
        Ok(value) => Some(value),
        Err(error) => {
            assert!(!error.to_string().contains('\n'), "{error}");
            None
        }
    }
}
