//! Atomic files: written to a temporary file in the same folder, synced to the disk, then renamed into place.

use crate::{Error, Result};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes `path` through `fill`; an older file of that name stays until the new one is complete.
///
/// Missing parent folders are made. The file has the permissions of any new file of this user. The file is synced before
/// the rename and, on Unix, its folder after it: after a loss of power there is the old file or the new one.
///
/// # Errors
/// If the system or `fill` refuses; nothing is left behind then, unless only the sync of the folder failed.
pub fn write_atomic(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&File>) -> std::io::Result<()>,
) -> Result<()> {
    write_synced(path, fill).map_err(|source| Error::write(path, source))
}

/// Checks that files can be written into `folder`, which need not exist yet; leaves nothing behind.
///
/// # Errors
/// If `folder`, or what of its path exists, is no folder or takes no files.
pub fn check_writable_folder(folder: &Path) -> Result<()> {
    let mut existing = folder;
    while !existing.as_os_str().is_empty() && !existing.exists() {
        existing = existing.parent().unwrap_or(Path::new(""));
    }
    let existing = if existing.as_os_str().is_empty() { Path::new(".") } else { existing };
    if !existing.is_dir() {
        let remedy = "name another folder";
        return Err(Error::file(existing, "folder", "it is a file", remedy));
    }
    let probe = tempfile::Builder::new().prefix(PREFIX).tempfile_in(existing);
    probe.map(drop).map_err(|source| Error::write(folder, source))
}

/// Checks that the file `path` can be written; leaves nothing behind.
///
/// # Errors
/// If `path` is a folder, or its folder takes no files.
pub fn check_writable_file(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::file(path, "file", "it is a folder", "name a file"));
    }
    check_writable_folder(path.parent().unwrap_or(Path::new("")))
}

/// Removes from `folder` the half-written files that killed processes have left there.
///
/// # Errors
/// If the folder cannot be listed or a file not removed.
pub fn remove_temporary_files(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder).map_err(|e| Error::read(folder, e))? {
        let entry = entry.map_err(|e| Error::read(folder, e))?;
        if entry.file_name().to_string_lossy().starts_with(PREFIX) {
            std::fs::remove_file(entry.path()).map_err(|e| Error::write(entry.path(), e))?;
        }
    }
    Ok(())
}

/// Beginning of the names of files that are being written.
const PREFIX: &str = ".deepmill-";

fn write_synced(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&File>) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let temporary = builder.tempfile_in(folder)?;
    let mut writer = BufWriter::new(temporary.as_file());
    fill(&mut writer)?;
    writer.flush()?;
    drop(writer);
    temporary.as_file().sync_all()?;
    temporary.persist(path)?;
    sync_folder(folder)
}

/// Makes a rename in `folder` last. File systems that cannot sync a folder say `InvalidInput` or `Unsupported`.
#[cfg(unix)]
fn sync_folder(folder: &Path) -> std::io::Result<()> {
    use std::io::ErrorKind::{InvalidInput, Unsupported};
    match File::open(folder)?.sync_all() {
        Err(error) if !matches!(error.kind(), InvalidInput | Unsupported) => Err(error),
        _ => Ok(()),
    }
}

#[cfg(not(unix))]
fn sync_folder(_: &Path) -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_checked_without_a_trace() {
        let folder = tempfile::tempdir().unwrap();
        let [file, new] = ["a.txt", "new"].map(|name| folder.path().join(name));
        std::fs::write(&file, "a").unwrap();
        check_writable_folder(&new.join("deep")).unwrap();
        check_writable_file(&new.join("deep/a.txt")).unwrap();
        check_writable_file(&file).unwrap();
        for place in [&file, &file.join("deep/er")] {
            let message = check_writable_folder(place).unwrap_err().to_string();
            assert!(message.contains("a.txt: folder: it is a file"), "{message}");
        }
        assert!(
            check_writable_file(folder.path()).unwrap_err().to_string().contains("it is a folder")
        );
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/a.txt");
        write_atomic(&path, |w| w.write_all(b"first")).unwrap();
        let failed = write_atomic(&path, |w| {
            w.write_all(b"half")?;
            Err(std::io::Error::other("full"))
        });
        assert!(failed.unwrap_err().to_string().contains("a.txt: cannot be written: full"));
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
        std::fs::write(path.with_file_name(".deepmill-x"), b"left").unwrap();
        remove_temporary_files(path.parent().unwrap()).unwrap();
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
        assert!(path.exists());
    }
}
