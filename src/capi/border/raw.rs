//! Pointers of a caller in C, checked as far as they can be.
//!
//! Null, addresses that are not aligned and sizes beyond the address space are failures with the name of the argument.
//! That a pointer leads to as much as the header states is left to the caller.
#![allow(unsafe_code)]

use super::super::status::{Answer, Failure, dm_status, refused};
use std::ffi::{CStr, c_char};
use std::ptr::NonNull;

const TYPES: &str = "check the type of what is passed";

/// A place for one result.
pub struct Place<T>(NonNull<T>);

impl<T> Place<T> {
    /// Of an argument; a null one is refused.
    ///
    /// # Safety
    /// A pointer that is not null leads to a `T` that nobody else reads or writes during the call; it need not be
    /// initialized.
    pub unsafe fn new(name: &'static str, pointer: *mut T) -> Answer<Self> {
        let place = NonNull::new(pointer)
            .ok_or_else(|| refused(name, "null", "the address of a variable", "pass &variable"))?;
        require_aligned(name, pointer)?;
        Ok(Place(place))
    }

    /// Of an argument that may be null.
    ///
    /// # Safety
    /// As [`Place::new`].
    pub unsafe fn optional(name: &'static str, pointer: *mut T) -> Answer<Option<Self>> {
        match pointer.is_null() {
            true => Ok(None),
            // SAFETY: of this function.
            false => unsafe { Place::new(name, pointer) }.map(Some),
        }
    }

    /// Puts a result there.
    pub fn put(&self, result: T) {
        // SAFETY: whoever made the place has promised that it can be written during the call, and a `Place` does not
        // outlive that. What was there is not dropped: it need not be initialized.
        unsafe { self.0.write(result) }
    }
}

fn require_aligned<T>(name: &'static str, pointer: *const T) -> Answer<()> {
    if pointer.is_aligned() {
        return Ok(());
    }
    let expected = format!("a multiple of {}", align_of::<T>());
    Err(refused(name, format!("the address {:#x}", pointer.addr()), expected, TYPES))
}

/// So many elements of an array.
///
/// # Safety
/// If `n` is not 0, a pointer that is not null leads to `n` initialized elements, which nobody writes for `'a`.
pub unsafe fn slice<'a, T>(name: &'static str, pointer: *const T, n: usize) -> Answer<&'a [T]> {
    if n == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() {
        return Err(refused(name, "null", format!("an array of {n}"), "pass the array"));
    }
    require_aligned(name, pointer)?;
    if n > isize::MAX as usize / size_of::<T>() {
        let remedy = "check that its length is not negative";
        return Err(refused(name, format!("an array of {n}"), "one that memory holds", remedy));
    }
    // SAFETY: not null, aligned and not too long as checked above; the rest is the promise of the caller.
    Ok(unsafe { std::slice::from_raw_parts(pointer, n) })
}

/// Text in UTF-8 that ends with a zero.
///
/// # Safety
/// A pointer that is not null leads to bytes that end with a zero and that nobody writes for `'a`.
pub unsafe fn text<'a>(name: &'static str, pointer: *const c_char) -> Answer<&'a str> {
    if pointer.is_null() {
        return Err(refused(name, "null", "text that ends with a zero", "pass the text"));
    }
    // SAFETY: not null as checked above; the rest is the promise of the caller.
    let bytes = unsafe { CStr::from_ptr(pointer) };
    bytes.to_str().map_err(|e| {
        let found = format!("not UTF-8 from byte {} on", e.valid_up_to());
        refused(name, found, "text in UTF-8", "convert it")
    })
}

/// As [`text`], of an argument that may be null.
///
/// # Safety
/// As [`text`].
pub unsafe fn optional_text<'a>(
    name: &'static str,
    pointer: *const c_char,
) -> Answer<Option<&'a str>> {
    match pointer.is_null() {
        true => Ok(None),
        // SAFETY: of this function.
        false => unsafe { text(name, pointer) }.map(Some),
    }
}

/// A buffer of a caller for so many elements, and the place for how many are needed.
pub struct Buffer<T> {
    pub buffer: *mut T,
    pub n: usize,
    pub needed: *mut usize,
}

impl<T: Copy> Buffer<T> {
    /// Copies the values, or nothing if they do not fit; sets `needed` in any case. A null buffer of 0 elements only
    /// asks for that.
    ///
    /// # Safety
    /// A buffer that is not null has place for `n` elements, which nobody else reads or writes during the call; of
    /// `needed` as [`Place::optional`].
    pub unsafe fn fill(self, values: &[T]) -> Answer<()> {
        // SAFETY: of this function.
        if let Some(needed) = unsafe { Place::optional("needed", self.needed) }? {
            needed.put(values.len());
        }
        if self.buffer.is_null() {
            return match self.n {
                0 => Ok(()),
                n => Err(refused("buffer", "null", format!("an array of {n}"), "pass 0 elements")),
            };
        }
        require_aligned("buffer", self.buffer)?;
        if self.n < values.len() {
            let text = format!(
                "buffer has {} elements, expected {}; pass a null buffer of 0 elements to ask for their number",
                self.n,
                values.len()
            );
            return Err(Failure { status: dm_status::DM_SHORT_BUFFER, text });
        }
        // SAFETY: the buffer is not null, is aligned and has place for as many as checked above. It does not overlap
        // the values: they are memory of this library, the buffer is the caller's.
        unsafe { self.buffer.copy_from_nonoverlapping(values.as_ptr(), values.len()) };
        Ok(())
    }
}

impl Buffer<c_char> {
    /// Copies text, with a zero at the end.
    ///
    /// # Safety
    /// As [`Buffer::fill`].
    pub unsafe fn fill_text(self, text: &str) -> Answer<()> {
        // A zero within the text would hide the rest.
        let bytes = text.bytes().map(|byte| if byte == 0 { b' ' } else { byte });
        let chars: Vec<c_char> = bytes.chain([0]).map(|byte| byte as c_char).collect();
        // SAFETY: of this function.
        unsafe { self.fill(&chars) }
    }
}
