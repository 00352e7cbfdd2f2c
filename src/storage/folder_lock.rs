//! One program at a time writes a folder: a lock of the operating system on a hidden file in it.
//!
//! The system gives the lock back when the program ends in whatever way, so that a file that a killed program left does
//! not block.

use crate::{Error, Result};
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::Path;

/// Name of the lock of a whole folder.
const WHOLE: &str = ".deepmill.lock";

/// A lock on a folder, given back when it is dropped. Its file stays: removing it would let two programs lock different
/// files of one name.
#[derive(Debug)]
pub struct FolderLock {
    _files: Vec<File>,
}

impl FolderLock {
    /// Locks `folder`, which is made if it is missing, against every other lock.
    ///
    /// A file system without locks (some network drives) is no error: nothing is locked then.
    ///
    /// # Errors
    /// If another program (or another part of this one) has a lock on it, whose number the message says, or the system
    /// refuses the file.
    pub fn whole(folder: &Path) -> Result<Self> {
        let file = open(folder, WHOLE)?;
        hold(&file, File::try_lock, folder, folder)?;
        Ok(FolderLock { _files: vec![file] })
    }

    /// Locks share `index` of `n` of `folder`: against a lock of the whole folder and against the same share, beside
    /// other shares.
    ///
    /// # Errors
    /// As [`FolderLock::whole`].
    pub fn share(folder: &Path, index: usize, n: usize) -> Result<Self> {
        let whole = open(folder, WHOLE)?;
        hold(&whole, File::try_lock_shared, folder, folder)?;
        let share = open(folder, &format!(".deepmill.{index}-of-{n}.lock"))?;
        let place = folder.join(format!("share {index}/{n}"));
        hold(&share, File::try_lock, folder, &place)?;
        Ok(FolderLock { _files: vec![whole, share] })
    }
}

fn open(folder: &Path, name: &str) -> Result<File> {
    std::fs::create_dir_all(folder).map_err(|e| Error::write(folder, e))?;
    let path = folder.join(name);
    let mut options = File::options();
    options.read(true).write(true).create(true).truncate(false);
    options.open(&path).map_err(|e| Error::write(&path, e))
}

/// Takes the lock of `file` by `lock`, and writes the number of this process into it.
fn hold(
    file: &File,
    lock: fn(&File) -> std::result::Result<(), TryLockError>,
    folder: &Path,
    place: &Path,
) -> Result<()> {
    match lock(file) {
        Ok(()) => {}
        Err(TryLockError::Error(e)) if e.kind() == ErrorKind::Unsupported => return Ok(()),
        Err(TryLockError::Error(e)) => return Err(Error::write(folder, e)),
        Err(TryLockError::WouldBlock) => {
            let found = format!("{} is writing into it", holder(file));
            let remedy = "wait until it has ended, or name another folder";
            return Err(Error::file(place, "lock", found, remedy));
        }
    }
    let mut file = file;
    let number = std::process::id();
    // The number serves messages alone: a disk that is full is no reason to stop here.
    let _ = file.set_len(0).and_then(|()| file.rewind()).and_then(|()| writeln!(file, "{number}"));
    Ok(())
}

/// Who has the lock, as far as its file says.
fn holder(file: &File) -> String {
    let mut text = String::new();
    let read = file.take(20).read_to_string(&mut text).ok();
    match read.and_then(|_| text.trim().parse::<u32>().ok()) {
        Some(number) if number == std::process::id() => "this program itself".into(),
        Some(number) => format!("process {number}"),
        None => "another program".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(lock: Result<FolderLock>) -> String {
        lock.unwrap_err().to_string()
    }

    #[test]
    fn a_folder_is_locked_until_the_lock_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let new = folder.path().join("new");
        let first = FolderLock::whole(&new).unwrap();
        let message = refused(FolderLock::whole(&new));
        assert!(message.starts_with(&format!("{}: lock: ", new.display())), "{message}");
        assert!(message.contains("this program itself is writing into it; wait"), "{message}");
        assert!(refused(FolderLock::share(&new, 0, 2)).contains("lock: "));
        drop(first);
        FolderLock::whole(&new).unwrap();
        // What a killed program left says nothing.
        std::fs::write(new.join(WHOLE), "12345\n").unwrap();
        FolderLock::whole(&new).unwrap();
    }

    #[test]
    fn shares_of_a_folder_stand_beside_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let shares = [0, 1].map(|i| FolderLock::share(folder.path(), i, 2).unwrap());
        assert!(refused(FolderLock::whole(folder.path())).contains("is writing into it"));
        assert!(refused(FolderLock::share(folder.path(), 1, 2)).contains("share 1/2: lock"));
        drop(shares);
        FolderLock::whole(folder.path()).unwrap();
    }
}
