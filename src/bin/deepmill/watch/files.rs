//! The files that are watched: how often they were written.

use deepmill::{Error, Result};
use notify::event::{AccessKind, AccessMode, ModifyKind};
use notify::{Event, EventKind, RecommendedWatcher, RecursiveMode, Watcher};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A file is complete if nothing was written for so long, or it was closed or renamed.
const QUIET: Duration = Duration::from_millis(40);

/// Watches files; their folders, so that one that is replaced by another is seen.
pub struct Files {
    written: Arc<Written>,
    _watcher: RecommendedWatcher,
}

/// What was written.
#[derive(Default)]
struct Written {
    last: Mutex<Last>,
    changed: Condvar,
}

#[derive(Default, Clone, Copy)]
struct Last {
    number: u64,
    at: Option<Instant>,
    is_complete: bool,
}

impl Files {
    /// Watches these files, and of a folder all files in it.
    ///
    /// # Errors
    /// If the system does not let a folder be watched.
    pub fn watch(paths: &[PathBuf]) -> Result<Self> {
        let written = Arc::new(Written::default());
        let of_watcher = Arc::clone(&written);
        let (names, folders) = places(paths);
        let is_meant = move |path: &PathBuf| {
            names.contains(path) || path.parent().is_some_and(|folder| folders.contains(folder))
        };
        let mut watcher = notify::recommended_watcher(move |event: notify::Result<Event>| {
            // What is lost may be a change.
            let (is_meant, kind) = match &event {
                Ok(event) => (event.paths.iter().any(&is_meant), event.kind),
                Err(_) => (true, EventKind::Any),
            };
            if let Some(is_complete) = is_written(kind).filter(|_| is_meant) {
                of_watcher.add(is_complete);
            }
        })
        .map_err(|error| refused(Path::new("."), &error))?;
        for folder in folders_of(paths) {
            watcher
                .watch(&folder, RecursiveMode::NonRecursive)
                .map_err(|error| refused(&folder, &error))?;
        }
        Ok(Files { written, _watcher: watcher })
    }

    /// How often something was written.
    pub fn n_written(&self) -> u64 {
        self.written.last().number
    }

    /// Waits until more than `seen` was written, and is complete; the number then.
    pub fn wait(&self, seen: u64) -> u64 {
        let mut last = self.written.last();
        loop {
            let quiet = last.at.map_or(Duration::ZERO, |at| at.elapsed());
            let changed = &self.written.changed;
            last = match last.number > seen {
                true if last.is_complete || quiet >= QUIET => return last.number,
                true => {
                    let waited = changed.wait_timeout(last, QUIET - quiet);
                    waited.unwrap_or_else(PoisonError::into_inner).0
                }
                false => changed.wait(last).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    /// Whether more than `seen` is written within a time from now on.
    pub fn is_written_within(&self, seen: u64, time: Duration) -> bool {
        let is_seen = |last: &mut Last| last.number <= seen;
        let waited = self.written.changed.wait_timeout_while(self.written.last(), time, is_seen);
        waited.unwrap_or_else(PoisonError::into_inner).0.number > seen
    }
}

impl Written {
    fn last(&self) -> std::sync::MutexGuard<'_, Last> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn add(&self, is_complete: bool) {
        let mut last = self.last();
        *last = Last { number: last.number + 1, at: Some(Instant::now()), is_complete };
        drop(last);
        self.changed.notify_all();
    }
}

/// Whether an event is that of something written, and if so, whether that is complete.
fn is_written(kind: EventKind) -> Option<bool> {
    match kind {
        EventKind::Access(AccessKind::Close(AccessMode::Write))
        | EventKind::Modify(ModifyKind::Name(_)) => Some(true),
        EventKind::Access(_) | EventKind::Modify(ModifyKind::Metadata(_)) => None,
        EventKind::Any
        | EventKind::Create(_)
        | EventKind::Modify(_)
        | EventKind::Remove(_)
        | EventKind::Other => Some(false),
    }
}

/// Files and folders as the events name them; of a link also what it leads to.
fn places(paths: &[PathBuf]) -> (HashSet<PathBuf>, HashSet<PathBuf>) {
    let (mut names, mut folders) = (HashSet::new(), HashSet::new());
    for path in paths {
        if path.is_dir() {
            folders.insert(absolute(path));
            continue;
        }
        let folder = absolute(folder_of(path));
        names.extend(path.file_name().map(|name| folder.join(name)));
        names.extend(path.canonicalize());
    }
    (names, folders)
}

fn folders_of(paths: &[PathBuf]) -> HashSet<PathBuf> {
    let (names, mut folders) = places(paths);
    folders.extend(names.iter().filter_map(|name| name.parent()).map(Path::to_path_buf));
    folders
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn absolute(folder: &Path) -> PathBuf {
    folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf())
}

fn refused(folder: &Path, error: &notify::Error) -> Error {
    let remedy = "put the files into a folder of this machine that can be watched, or raise its limit of watched files";
    Error::file(folder, "folder", format!("it cannot be watched ({error})"), remedy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const LONG: Duration = Duration::from_secs(10);

    #[test]
    fn a_file_that_is_written_or_replaced_is_seen_and_one_beside_it_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.stl");
        fs::write(&path, "a").unwrap();
        let files = Files::watch(std::slice::from_ref(&path)).unwrap();
        fs::write(folder.path().join("other.stl"), "b").unwrap();
        assert!(!files.is_written_within(0, Duration::from_millis(200)));
        fs::write(&path, "c").unwrap();
        let seen = files.wait(0);
        assert!(seen > 0);
        let temporary = folder.path().join("part.tmp");
        fs::write(&temporary, "d").unwrap();
        let before = files.n_written();
        fs::rename(&temporary, &path).unwrap();
        assert!(files.is_written_within(before, LONG));
    }

    #[test]
    fn reading_is_not_writing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.stl");
        fs::write(&path, "a").unwrap();
        let files = Files::watch(std::slice::from_ref(&path)).unwrap();
        fs::read(&path).unwrap();
        assert!(!files.is_written_within(0, Duration::from_millis(200)));
    }

    #[test]
    fn of_a_folder_every_file_counts() {
        let folder = tempfile::tempdir().unwrap();
        let files = Files::watch(&[folder.path().to_path_buf()]).unwrap();
        fs::write(folder.path().join("bit.fctb"), "a").unwrap();
        assert!(files.is_written_within(0, LONG));
    }
}
