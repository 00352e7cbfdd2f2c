//! What a call returns, and the text of what went wrong.

use crate::Error;
use crate::error::ErrorKind;

/// What a call of the C interface returns.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(non_camel_case_types)] // the names in C
pub enum dm_status {
    /// It is done.
    DM_OK = 0,
    /// The context is null.
    DM_NO_CONTEXT = 1,
    /// A handle names nothing: it was freed, is of another context, or of an object of another kind.
    DM_BAD_HANDLE = 2,
    /// An argument is null or outside its domain.
    DM_BAD_ARGUMENT = 3,
    /// The buffer is too short; nothing was written into it.
    DM_SHORT_BUFFER = 4,
    /// The numbers were not computed: an option of the analysis was off.
    DM_NOT_COMPUTED = 5,
    /// The callback stopped the work.
    DM_INTERRUPTED = 6,
    /// The system refused to open or read a file.
    DM_CANNOT_READ = 7,
    /// The system refused to write a file.
    DM_CANNOT_WRITE = 8,
    /// The content of a file is not what its format demands.
    DM_BAD_FILE = 9,
    /// A mesh cannot be used as it is.
    DM_BAD_GEOMETRY = 10,
    /// The work needs more memory than is sensible.
    DM_TOO_LARGE = 11,
    /// A computation left the finite numbers.
    DM_NOT_FINITE = 12,
    /// Another failure; the text has more.
    DM_OTHER = 13,
    /// The library failed: a fault of the library, to be reported.
    DM_PANIC = 14,
}

use dm_status::{
    DM_BAD_ARGUMENT, DM_BAD_FILE, DM_BAD_GEOMETRY, DM_BAD_HANDLE, DM_CANNOT_READ, DM_CANNOT_WRITE,
    DM_INTERRUPTED, DM_NO_CONTEXT, DM_NOT_COMPUTED, DM_NOT_FINITE, DM_OK, DM_OTHER, DM_PANIC,
    DM_SHORT_BUFFER, DM_TOO_LARGE,
};

/// Every status with its text.
const TEXTS: [(dm_status, &std::ffi::CStr); 15] = [
    (DM_OK, c"done"),
    (DM_NO_CONTEXT, c"the context is null; make one by dm_context_new"),
    (DM_BAD_HANDLE, c"a handle names nothing"),
    (DM_BAD_ARGUMENT, c"an argument is null or outside its domain"),
    (DM_SHORT_BUFFER, c"a buffer is too short"),
    (DM_NOT_COMPUTED, c"the numbers were not computed"),
    (DM_INTERRUPTED, c"the callback stopped the work"),
    (DM_CANNOT_READ, c"a file cannot be read"),
    (DM_CANNOT_WRITE, c"a file cannot be written"),
    (DM_BAD_FILE, c"the content of a file is faulty"),
    (DM_BAD_GEOMETRY, c"a mesh cannot be used as it is"),
    (DM_TOO_LARGE, c"the work needs too much memory"),
    (DM_NOT_FINITE, c"a computation left the finite numbers"),
    (DM_OTHER, c"another failure"),
    (DM_PANIC, c"the library failed; please report it with the input"),
];

impl dm_status {
    /// The text of the number of a status, or of a number that is none.
    pub fn text_of(number: i32) -> &'static std::ffi::CStr {
        let found = TEXTS.iter().find(|(status, _)| *status as i32 == number);
        found.map_or(c"not a status of this library", |(_, text)| text)
    }
}

/// Why a call failed.
#[derive(Debug)]
pub struct Failure {
    /// What it returns.
    pub status: dm_status,
    /// What was found, what is right, and what to do.
    pub text: String,
}

/// The result of a call.
pub type Answer<T> = Result<T, Failure>;

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match error.kind() {
            ErrorKind::Read => DM_CANNOT_READ,
            ErrorKind::Write => DM_CANNOT_WRITE,
            ErrorKind::File => DM_BAD_FILE,
            ErrorKind::Geometry => DM_BAD_GEOMETRY,
            ErrorKind::Argument => DM_BAD_ARGUMENT,
            ErrorKind::TooLarge => DM_TOO_LARGE,
            ErrorKind::NotFinite => DM_NOT_FINITE,
            ErrorKind::Interrupted => DM_INTERRUPTED,
            ErrorKind::Gradient | ErrorKind::OtherProcess => DM_OTHER,
        };
        Failure { status, text: error.to_string() }
    }
}

/// An argument that is not right.
pub fn refused(
    name: &'static str,
    found: impl ToString,
    expected: impl Into<String>,
    remedy: impl Into<String>,
) -> Failure {
    Error::argument(name, found, expected, remedy).into()
}

/// The error, of an argument by its name in C.
pub fn called(name: &'static str, error: Error) -> Error {
    match error {
        Error::Argument { found, expected, remedy, .. } => {
            Error::Argument { name, found, expected, remedy }
        }
        other => other,
    }
}

/// Numbers that were not computed.
pub fn not_computed(what: &str, remedy: &str) -> Failure {
    Failure { status: DM_NOT_COMPUTED, text: format!("{what} was not computed; {remedy}") }
}

/// The number, if it is one.
pub fn number(name: &'static str, value: f64) -> Answer<f64> {
    match value.is_nan() {
        false => Ok(value),
        true => Err(refused(name, "NaN", "a number", "leave the call out for the default")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_status_has_a_text_and_other_numbers_say_that_they_are_none() {
        for (k, (status, text)) in TEXTS.into_iter().enumerate() {
            assert_eq!(status as usize, k);
            assert_eq!(dm_status::text_of(k as i32), text);
        }
        for number in [-1, TEXTS.len() as i32, i32::MAX] {
            assert_eq!(dm_status::text_of(number), c"not a status of this library");
        }
    }
}
