//! Atomic files: written to a temporary file in the same folder, synced to the disk, then renamed into place.

use crate::{Error, Result};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes `path` through `fill`; an older file of that name stays until the new one is complete.
///
/// Missing parent folders are made. The file has the permissions of any new file of this user. The file is synced
/// before the rename and, on Unix, its folder after it, and the parents of folders that were made: after a loss of
/// power there is the old file or the new one.
///
/// # Errors
/// If the system or `fill` refuses; nothing is left behind then, unless only the sync of the folder failed.
pub fn write_atomic(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
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

/// What a write has the file system do, in this order; `Write` as often as there are full buffers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step {
    MakeFolders,
    MakeFile,
    Write,
    SyncFile,
    Rename,
    SyncFolder,
}

/// Called before every step: a test may refuse it.
#[cfg(not(test))]
fn before(_: Step) -> std::io::Result<()> {
    Ok(())
}

#[cfg(test)]
use faults::before;

/// Unit tests, which cut no power, do not wait for the disk.
const SYNCS: bool = cfg!(not(test));

/// A temporary file in which every write is a step.
struct Steps<'a>(&'a File);

impl Write for Steps<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        before(Step::Write)?;
        self.0.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

fn write_synced(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    before(Step::MakeFolders)?;
    make_folders(folder)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    before(Step::MakeFile)?;
    let temporary = builder.tempfile_in(folder)?;
    let mut writer = BufWriter::new(Steps(temporary.as_file()));
    fill(&mut writer)?;
    writer.flush()?;
    drop(writer);
    before(Step::SyncFile)?;
    if SYNCS {
        temporary.as_file().sync_all()?;
    }
    before(Step::Rename)?;
    temporary.persist(path)?;
    before(Step::SyncFolder)?;
    sync_folder(folder)
}

/// Makes `folder` and what is missing above it, to last.
fn make_folders(folder: &Path) -> std::io::Result<()> {
    let missing: Vec<PathBuf> = folder
        .ancestors()
        .take_while(|f| !f.as_os_str().is_empty() && !f.exists())
        .map(PathBuf::from)
        .collect();
    std::fs::create_dir_all(folder)?;
    missing.iter().try_for_each(|made| match made.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => sync_folder(parent),
        _ => sync_folder(Path::new(".")),
    })
}

/// Makes a change of the names in `folder` last. File systems that cannot sync a folder say `InvalidInput` or
/// `Unsupported`.
#[cfg(unix)]
fn sync_folder(folder: &Path) -> std::io::Result<()> {
    use std::io::ErrorKind::{InvalidInput, Unsupported};
    if !SYNCS {
        return Ok(());
    }
    match File::open(folder)?.sync_all() {
        Err(error) if !matches!(error.kind(), InvalidInput | Unsupported) => Err(error),
        _ => Ok(()),
    }
}

#[cfg(not(unix))]
fn sync_folder(_: &Path) -> std::io::Result<()> {
    Ok(())
}

/// A file system that refuses the n-th step of a thread, for tests of what is then on the disk.
#[cfg(test)]
pub(crate) mod faults {
    use super::Step;
    use std::cell::RefCell;

    #[derive(Default)]
    struct Plan {
        refused: usize,
        begun: Vec<Step>,
    }

    thread_local! {
        static PLAN: RefCell<Option<Plan>> = const { RefCell::new(None) };
    }

    pub(super) fn before(step: Step) -> std::io::Result<()> {
        PLAN.with_borrow_mut(|plan| {
            let Some(plan) = plan else { return Ok(()) };
            plan.begun.push(step);
            match plan.begun.len() == plan.refused {
                true => Err(std::io::ErrorKind::StorageFull.into()),
                false => Ok(()),
            }
        })
    }

    /// Runs `work`, whose steps are refused at number `refused` (from 1; 0: none); returns what it gives and the steps
    /// that it began.
    pub(super) fn steps_of<T>(refused: usize, work: impl FnOnce() -> T) -> (T, Vec<Step>) {
        PLAN.set(Some(Plan { refused, begun: Vec::new() }));
        let result = work();
        let plan = PLAN.take();
        (result, plan.map(|plan| plan.begun).unwrap_or_default())
    }

    /// For every n, from one that refuses the first step to one that refuses none: `work` with step n refused, which
    /// must then fail, and then `check`, which hears whether it failed. Returns the number of steps.
    pub(crate) fn at_every_step<T: std::fmt::Debug>(
        mut work: impl FnMut() -> crate::Result<T>,
        mut check: impl FnMut(bool),
    ) -> usize {
        for n in 1.. {
            let (result, steps) = steps_of(n, &mut work);
            let refused = steps.len() >= n;
            assert_eq!(refused, result.is_err(), "step {n}, {:?}: {result:?}", steps.last());
            check(refused);
            if !refused {
                return steps.len();
            }
        }
        unreachable!()
    }
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

    #[test]
    fn a_file_is_synced_before_its_name_is_changed_and_the_folder_after() {
        use Step::{MakeFile, MakeFolders, Rename, SyncFile, SyncFolder, Write};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let write = |n| faults::steps_of(0, || write_atomic(&path, |w| w.write_all(&vec![7; n])));
        let (result, steps) = write(3);
        result.unwrap();
        assert_eq!(steps, [MakeFolders, MakeFile, Write, SyncFile, Rename, SyncFolder]);
        let (_, steps) = write(100_000);
        assert_eq!(steps[steps.len() - 4..], [Write, SyncFile, Rename, SyncFolder]);
    }

    #[test]
    fn refused_at_any_step_there_is_the_old_file_or_the_new_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/er/a.txt");
        for (old, new) in [(None, &b"first"[..]), (Some(&b"first"[..]), b"second")] {
            let work = || {
                // Every byte is a step of its own.
                write_atomic(&path, |w| {
                    new.iter().try_for_each(|b| w.write_all(&[*b]).and_then(|()| w.flush()))
                })
            };
            let n = faults::at_every_step(work, |_| {
                let found = std::fs::read(&path).ok();
                assert!(found.as_deref() == old || found.as_deref() == Some(new), "{found:?}");
                let n_files = path.parent().unwrap().read_dir().map_or(0, Iterator::count);
                assert_eq!(n_files, usize::from(found.is_some()), "nothing is left behind");
                match old {
                    Some(old) => write_atomic(&path, |w| w.write_all(old)).unwrap(),
                    None => drop(std::fs::remove_dir_all(folder.path().join("deep"))),
                }
            });
            assert_eq!(n, new.len() + 5);
            write_atomic(&path, |w| w.write_all(b"first")).unwrap();
        }
    }
}
