//! The functions of C. Only here do pointers come in, and only [`raw`] follows them.
//!
//! Every function checks what it is given, calls the library, and returns a status. No panic leaves it.
#![allow(unsafe_code)]
// What a caller promises is the same of every function: it is stated once, in the header and in `docs/c.md`.
#![allow(clippy::missing_safety_doc)]

mod raw;

// In the order of the header, which the blank lines keep.
mod mesh;

mod tools;

mod analysis;

mod outcome;

pub use analysis::*;
pub use mesh::*;
pub use outcome::*;
pub use tools::*;

use super::context::{Kind, dm_context};
use super::status::{Answer, Failure, dm_status};
use raw::{Buffer, Place};
use std::any::Any;
use std::borrow::Cow;
use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Names an object of a context; 0 names none.
#[allow(non_camel_case_types)] // the name in C
pub type dm_handle = u64;

/// Version of this interface: programs compiled with a header of the same number run with this library.
pub const DM_ABI_VERSION: u32 = 1;

/// Calls `work` with the context; what fails becomes a status, with its text in the context.
///
/// # Safety
/// A context that is not null was made by [`dm_context_new`] and is not freed before this returns.
unsafe fn enter(
    context: *mut dm_context,
    work: impl FnOnce(&dm_context) -> Answer<()>,
) -> dm_status {
    // SAFETY: of this function. References to it are shared ones alone; what changes is behind a lock.
    let Some(context) = (unsafe { context.as_ref() }) else { return dm_status::DM_NO_CONTEXT };
    let failure = match catch_unwind(AssertUnwindSafe(|| work(context))) {
        Ok(Ok(())) => return dm_status::DM_OK,
        Ok(Err(failure)) => failure,
        Err(panic) => of_panic(&*panic),
    };
    context.set_error(failure.text);
    failure.status
}

fn of_panic(panic: &(dyn Any + Send)) -> Failure {
    let words = panic.downcast_ref::<String>().map(String::as_str);
    let words = words.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
    let text = format!("deepmill failed ({words}); please report it with the input");
    Failure { status: dm_status::DM_PANIC, text }
}

/// [`enter`], for a call that makes an object: its handle goes to `place`, 0 if it fails.
///
/// # Safety
/// As [`enter`], and as [`Place::new`].
unsafe fn make<K: Kind>(
    context: *mut dm_context,
    (name, place): (&'static str, *mut dm_handle),
    made: impl FnOnce(&dm_context) -> Answer<K>,
) -> dm_status {
    // SAFETY: of this function.
    unsafe {
        enter(context, |context| {
            let place = Place::new(name, place)?;
            place.put(0);
            place.put(context.add(made(context)?));
            Ok(())
        })
    }
}

/// Copies numbers of an object into a buffer.
///
/// # Safety
/// As [`enter`] and [`Buffer::fill`].
unsafe fn copy<K: Kind, T: Copy>(
    context: *mut dm_context,
    handle: dm_handle,
    buffer: Buffer<T>,
    values: impl FnOnce(&K) -> Answer<Cow<'_, [T]>>,
) -> dm_status {
    // SAFETY: of this function.
    unsafe { enter(context, |context| buffer.fill(&values(&*context.get::<K>(handle)?)?)) }
}

/// Copies text of an object into a buffer.
///
/// # Safety
/// As [`copy`].
unsafe fn copy_text<K: Kind>(
    context: *mut dm_context,
    handle: dm_handle,
    buffer: Buffer<c_char>,
    text: impl FnOnce(&K) -> Answer<String>,
) -> dm_status {
    // SAFETY: of this function.
    unsafe { enter(context, |context| buffer.fill_text(&text(&*context.get::<K>(handle)?)?)) }
}

/// The version of this interface: compare it with DM_ABI_VERSION of the header.
#[unsafe(no_mangle)]
pub extern "C" fn dm_abi_version() -> u32 {
    DM_ABI_VERSION
}

/// The version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn dm_version() -> *const c_char {
    const VERSION: &CStr =
        match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
            Ok(version) => version,
            Err(_) => c"",
        };
    VERSION.as_ptr()
}

/// A status in words, never null. The text of a failure is more: dm_error_text.
#[unsafe(no_mangle)]
pub extern "C" fn dm_status_text(status: i32) -> *const c_char {
    dm_status::text_of(status).as_ptr()
}

/// Makes a context, which holds every object. Pass DM_ABI_VERSION: of another version than the library's it is null.
#[unsafe(no_mangle)]
pub extern "C" fn dm_context_new(abi_version: u32) -> *mut dm_context {
    match abi_version {
        DM_ABI_VERSION => Box::into_raw(Box::new(dm_context::new())),
        _ => std::ptr::null_mut(),
    }
}

/// Frees a context with all of its objects, and sets the variable to null. A null variable stays as it is. No call with
/// this context may be running.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_context_free(context: *mut *mut dm_context) {
    // SAFETY: the variable is null or the caller's, and holds null or what `dm_context_new` has made and nobody freed:
    // after that it is null.
    unsafe {
        if context.is_null() || (*context).is_null() {
            return;
        }
        let freed = Box::from_raw(context.replace(std::ptr::null_mut()));
        // A panic of a destructor ends here; there is no caller to report it to.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(freed)));
    }
}

/// Copies the text of the last failure of this context: what was found, what is right, what to do. At first none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_error_text(
    context: *mut dm_context,
    buffer: *mut c_char,
    n: usize,
    needed: *mut usize,
) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe {
        // Not by `enter`, which would put the text of a short buffer in place of the last error's text.
        let Some(context) = context.as_ref() else { return dm_status::DM_NO_CONTEXT };
        let fill = || Buffer { buffer, n, needed }.fill_text(&context.error());
        match catch_unwind(AssertUnwindSafe(fill)) {
            Ok(Ok(())) => dm_status::DM_OK,
            Ok(Err(failure)) => failure.status,
            Err(_) => dm_status::DM_PANIC,
        }
    }
}

/// Frees an object; 0 is none. What was made of it stays: an analysis holds its mesh and its tools.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dm_free(context: *mut dm_context, handle: dm_handle) -> dm_status {
    // SAFETY: the caller keeps the contract of the header.
    unsafe { enter(context, |context| if handle == 0 { Ok(()) } else { context.free(handle) }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_status_with_its_words_and_the_context_goes_on() {
        let mut context = dm_context_new(DM_ABI_VERSION);
        // SAFETY: the context was made above, and is freed at the end.
        unsafe {
            let status = enter(context, |_| panic!("no such {}", "thing"));
            assert_eq!(status, dm_status::DM_PANIC);
            assert_eq!(
                (*context).error(),
                "deepmill failed (no such thing); please report it with the input"
            );
            assert_eq!(enter(context, |_| Ok(())), dm_status::DM_OK);
            dm_context_free(&raw mut context);
        }
        assert!(context.is_null());
    }

    #[test]
    fn a_panic_of_long_work_becomes_a_status() {
        use crate::capi::work;
        let mut context = dm_context_new(DM_ABI_VERSION);
        // SAFETY: the context was made above, and is freed at the end.
        unsafe {
            let work =
                |_: &dm_context| work::run(1, &mut (), |_| -> crate::Result<()> { panic!() });
            assert_eq!(enter(context, work), dm_status::DM_PANIC);
            dm_context_free(&raw mut context);
        }
    }
}
