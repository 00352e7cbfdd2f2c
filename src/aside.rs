//! Files that appear whole or not at all: written beside their place, then renamed into it.

use crate::{Error, Result};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes `path` through `fill`; an older file of that name stays until the new one is complete.
///
/// Missing parent folders are made. The file has the permissions of any new file of this user.
///
/// # Errors
/// If the system or `fill` refuses; nothing is left behind then.
pub fn write(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&File>) -> std::io::Result<()>,
) -> Result<()> {
    write_aside(path, fill).map_err(|source| Error::write(path, source))
}

/// Checks that files can be written into `folder`, which need not exist yet; leaves nothing behind.
///
/// # Errors
/// If `folder`, or what of its path exists, is no folder or takes no files.
pub fn check_folder(folder: &Path) -> Result<()> {
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
pub fn check_file(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::file(path, "file", "it is a folder", "name a file"));
    }
    check_folder(path.parent().unwrap_or(Path::new("")))
}

/// Removes from `folder` the half-written files that killed processes have left there.
///
/// # Errors
/// If the folder cannot be listed or a file not removed.
pub fn remove_leftovers(folder: &Path) -> Result<()> {
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

fn write_aside(
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
    let aside = builder.tempfile_in(folder)?;
    let mut writer = BufWriter::new(aside.as_file());
    fill(&mut writer)?;
    writer.flush()?;
    drop(writer);
    aside.persist(path)?;
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
        check_folder(&new.join("deep")).unwrap();
        check_file(&new.join("deep/a.txt")).unwrap();
        check_file(&file).unwrap();
        for place in [&file, &file.join("deep/er")] {
            let message = check_folder(place).unwrap_err().to_string();
            assert!(message.contains("a.txt: folder: it is a file"), "{message}");
        }
        assert!(check_file(folder.path()).unwrap_err().to_string().contains("it is a folder"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/a.txt");
        write(&path, |w| w.write_all(b"first")).unwrap();
        let failed = write(&path, |w| {
            w.write_all(b"half")?;
            Err(std::io::Error::other("full"))
        });
        assert!(failed.unwrap_err().to_string().contains("a.txt: cannot be written: full"));
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
        std::fs::write(path.with_file_name(".deepmill-x"), b"left").unwrap();
        remove_leftovers(path.parent().unwrap()).unwrap();
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
        assert!(path.exists());
    }
}
