//! The error type: what was attempted, where, what was found, and what to do about it.

use std::path::{Path, PathBuf};

/// Result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Every failure this crate reports. The message is one line that ends with a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused to open, read or write a file.
    #[error("{}: cannot be {action}: {source}; {}", path.display(), io_remedy(source))]
    Io {
        /// The file.
        path: PathBuf,
        /// "read" or "written": what was attempted.
        action: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The content of a file is not what its format demands.
    #[error("{}: {place}: {found}; {remedy}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Line, byte offset, element or tensor name.
        place: String,
        /// What is wrong there.
        found: String,
        /// What the user can do.
        remedy: String,
    },
    /// A mesh or point cloud cannot be used as it is.
    #[error("{place}: {found}; {remedy}")]
    Geometry {
        /// Vertex, edge, face or component.
        place: String,
        /// What is wrong there.
        found: String,
        /// What the user can do.
        remedy: String,
    },
    /// An argument is outside its domain.
    #[error("{name} is {found}, expected {expected}; {remedy}")]
    Argument {
        /// The argument's name, of a call or, from the program, of an option.
        name: &'static str,
        /// The value given.
        found: String,
        /// The values allowed.
        expected: String,
        /// What the user can do.
        remedy: String,
    },
    /// The work needs more memory than is sensible.
    #[error("{operation} needs about {needed_bytes} bytes, the limit is {limit_bytes}; {remedy}")]
    TooLarge {
        /// The operation.
        operation: &'static str,
        /// Estimated bytes.
        needed_bytes: u64,
        /// Bytes allowed.
        limit_bytes: u64,
        /// What the user can do.
        remedy: String,
    },
    /// A computation left the finite numbers.
    #[error("{place}: {found}; {remedy}")]
    NotFinite {
        /// Epoch, batch, sample or tensor.
        place: String,
        /// The value.
        found: String,
        /// What the user can do.
        remedy: String,
    },
    /// A backward pass is not the derivative of its forward pass.
    #[error(
        "gradient {place}, expected at most {limit:e}; compare the backward pass with the derivative of the forward pass"
    )]
    Gradient {
        /// The worst element with both of its values.
        place: String,
        /// Greatest relative error allowed.
        limit: f64,
    },
    /// This process failed, first of several that work together.
    #[error("process {rank} of {size}: {source}")]
    Process {
        /// Number of this process, from 0.
        rank: usize,
        /// Number of processes.
        size: usize,
        /// What happened.
        source: Box<Error>,
    },
    /// Another process failed, and says why.
    #[error("process {rank} failed; see its message")]
    OtherProcess {
        /// Its number, from 0.
        rank: usize,
    },
    /// The user interrupted the program; whatever was finished is on disk.
    #[error("interrupted; {remedy}")]
    Interrupted {
        /// How to go on.
        remedy: String,
    },
}

/// What kind of failure an [`Error`] is, to act on without its words.
///
/// ```
/// use deepmill::error::ErrorKind;
/// use deepmill::geom::Mesh;
/// let error = Mesh::from_slices(&[[0.0; 3]], &[[0, 1, 2]]).unwrap_err();
/// assert_eq!(error.kind(), ErrorKind::Geometry);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The system refused to open or read a file.
    Read,
    /// The system refused to write a file.
    Write,
    /// The content of a file is not what its format demands.
    File,
    /// A mesh or point cloud cannot be used as it is.
    Geometry,
    /// An argument is outside its domain.
    Argument,
    /// The work needs more memory than is sensible.
    TooLarge,
    /// A computation left the finite numbers.
    NotFinite,
    /// A backward pass is not the derivative of its forward pass.
    Gradient,
    /// Another process failed.
    OtherProcess,
    /// The user interrupted the work, which can go on.
    Interrupted,
}

/// What helps against a failure of the operating system.
fn io_remedy(source: &std::io::Error) -> &'static str {
    use std::io::ErrorKind::{
        AlreadyExists, FileTooLarge, IsADirectory, NotADirectory, NotFound, PermissionDenied,
        QuotaExceeded, ReadOnlyFilesystem, StorageFull,
    };
    match source.kind() {
        NotFound => "check the path",
        PermissionDenied | ReadOnlyFilesystem => "check the permissions, or name another place",
        StorageFull | QuotaExceeded => "free some space, or name a place on another disk",
        FileTooLarge => "name a place without that limit",
        AlreadyExists | NotADirectory => "a file is where a folder should be: name another path",
        IsADirectory => "this is a folder: name a file",
        _ => "check the path and the disk it is on",
    }
}

/// What was attempted, of a failed write.
const WRITTEN: &str = "written";

impl Error {
    /// What kind of failure it is; of one of several processes, what happened there.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Error::Io { action: WRITTEN, .. } => ErrorKind::Write,
            Error::Io { .. } => ErrorKind::Read,
            Error::File { .. } => ErrorKind::File,
            Error::Geometry { .. } => ErrorKind::Geometry,
            Error::Argument { .. } => ErrorKind::Argument,
            Error::TooLarge { .. } => ErrorKind::TooLarge,
            Error::NotFinite { .. } => ErrorKind::NotFinite,
            Error::Gradient { .. } => ErrorKind::Gradient,
            Error::Process { source, .. } => source.kind(),
            Error::OtherProcess { .. } => ErrorKind::OtherProcess,
            Error::Interrupted { .. } => ErrorKind::Interrupted,
        }
    }

    /// A failed read of `path`.
    pub fn read(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Error::Io { path: path.as_ref().into(), action: "read", source }
    }

    /// A failed write of `path`.
    pub fn write(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Error::Io { path: path.as_ref().into(), action: WRITTEN, source }
    }

    /// Bad content at `place` of `path`. What was found, which may come from another library, becomes one line.
    pub fn file(
        path: impl AsRef<Path>,
        place: impl Into<String>,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        let found: String = found.into();
        let found = match found.contains('\n') {
            true => found.split_whitespace().collect::<Vec<_>>().join(" "),
            false => found,
        };
        Error::File {
            path: path.as_ref().into(),
            place: place.into(),
            found,
            remedy: remedy.into(),
        }
    }

    /// Unusable geometry at `place`.
    pub fn geometry(
        place: impl Into<String>,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Error::Geometry { place: place.into(), found: found.into(), remedy: remedy.into() }
    }

    /// An argument outside its domain.
    pub fn argument(
        name: &'static str,
        found: impl ToString,
        expected: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Error::Argument {
            name,
            found: found.to_string(),
            expected: expected.into(),
            remedy: remedy.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    #[test]
    fn kinds_tell_reads_from_writes_and_look_into_processes() {
        let io = || io::Error::from(io::ErrorKind::NotFound);
        assert_eq!(Error::read("a", io()).kind(), ErrorKind::Read);
        let source = Box::new(Error::write("a", io()));
        let process = Error::Process { rank: 1, size: 2, source };
        assert_eq!(process.kind(), ErrorKind::Write);
    }

    #[test]
    fn remedies_fit_what_the_system_says() {
        for (kind, remedy) in [
            (io::ErrorKind::StorageFull, "; free some space"),
            (io::ErrorKind::PermissionDenied, "; check the permissions"),
            (io::ErrorKind::NotFound, "; check the path"),
            (io::ErrorKind::IsADirectory, "; this is a folder"),
        ] {
            let message = Error::write("a", io::Error::from(kind)).to_string();
            assert!(message.contains(remedy), "{message}");
        }
        let full = Error::write("a", io::Error::from(io::ErrorKind::StorageFull)).to_string();
        assert!(!full.contains("permissions"), "{full}");
    }
}
