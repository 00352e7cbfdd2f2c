//! What the library holds, as NumPy arrays and Python objects.
#![allow(unsafe_code)]

use ndarray::{ArrayView, ArrayView1, ArrayView2, Dimension, Ix1, Ix2};
use numpy::{Element, IntoPyArray, PyArray, PyArrayMethods};
use pyo3::PyClass;
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::True;
use serde_json::Value;

/// A read-only array over memory of `owner`, which the array keeps alive.
///
/// `pick` takes the view out of any reference to the owner, so it cannot lead to memory that the owner does not hold.
pub fn view<'py, O, T, D>(
    owner: &Bound<'py, O>,
    pick: impl for<'a> Fn(&'a O) -> ArrayView<'a, T, D>,
) -> Bound<'py, PyArray<T, D>>
where
    O: PyClass<Frozen = True> + Sync,
    T: Element,
    D: Dimension,
{
    let array = pick(owner.get());
    // SAFETY: the memory belongs to `owner`: `pick` borrows it for the lifetime of a reference to the owner. The owner
    // is frozen, so nobody ever gets a mutable reference to it, and `T` has no interior mutability; NumPy holds the
    // owner as the base of the array, so the memory outlives the array. That the array is not writable is set before
    // anybody else sees it.
    let array = unsafe { PyArray::borrow_from_array(&array, owner.clone().into_any()) };
    array.readwrite().make_nonwriteable();
    array
}

/// [`view`] of a list; none of an empty one: it was not computed.
pub fn list<'py, O, T>(
    owner: &Bound<'py, O>,
    pick: impl for<'a> Fn(&'a O) -> &'a [T],
) -> Option<Bound<'py, PyArray<T, Ix1>>>
where
    O: PyClass<Frozen = True> + Sync,
    T: Element,
{
    (!pick(owner.get()).is_empty()).then(|| view(owner, |of| ArrayView1::from(pick(of))))
}

/// A read-only array of flags that are made for it; none of an empty one: it was not computed.
pub fn flags<'py>(py: Python<'py>, flags: Vec<bool>) -> Option<Bound<'py, PyArray<bool, Ix1>>> {
    if flags.is_empty() {
        return None;
    }
    let array = flags.into_pyarray(py);
    array.readwrite().make_nonwriteable();
    Some(array)
}

/// [`view`] of rows of a fixed length.
pub fn rows<'py, O, T, const N: usize>(
    owner: &Bound<'py, O>,
    pick: impl for<'a> Fn(&'a O) -> &'a [[T; N]],
) -> Bound<'py, PyArray<T, Ix2>>
where
    O: PyClass<Frozen = True> + Sync,
    T: Element,
{
    view(owner, |of| ArrayView2::from(pick(of)))
}

/// Vectors as rows.
pub fn threes(vectors: &[glam::Vec3]) -> &[[f32; 3]] {
    bytemuck::cast_slice(vectors)
}

/// Vectors as rows.
pub fn threes_f64(vectors: &[glam::DVec3]) -> &[[f64; 3]] {
    bytemuck::cast_slice(vectors)
}

/// JSON as Python objects.
pub fn of_json<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (value.to_string(),))
}
