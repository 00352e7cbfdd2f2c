//! Arrays of Python, checked and copied.

use super::errors::{refused, shown};
use numpy::{Element, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// An array, and what it is in words.
struct Given<'py> {
    name: &'static str,
    array: Bound<'py, PyUntypedArray>,
    /// NumPy's letter: `f`, `i`, `u`, `b`, ...
    kind: char,
}

impl<'py> Given<'py> {
    fn new(name: &'static str, value: &Bound<'py, PyAny>, expected: &str) -> PyResult<Self> {
        let py = value.py();
        let numpy = py.import("numpy")?;
        let no_array = || {
            refused(
                py,
                name,
                shown(value),
                expected,
                "give a NumPy array, or what numpy.asarray makes one of",
            )
        };
        let is_masked = numpy.getattr("ma")?.call_method1("is_masked", (value,))?.is_truthy()?;
        if is_masked {
            let remedy = "leave masked rows out, then give the plain array";
            return Err(refused(py, name, "a masked array with masked entries", expected, remedy));
        }
        if value.is_none() {
            return Err(no_array());
        }
        let array = numpy.call_method1("asarray", (value,)).map_err(|_| no_array())?;
        let array = array.cast_into::<PyUntypedArray>().map_err(|_| no_array())?;
        let kind: char = array.dtype().getattr("kind")?.extract()?;
        Ok(Given { name, array, kind })
    }

    fn words(&self) -> String {
        format!("an array of {} of shape {:?}", self.array.dtype(), self.array.shape())
    }

    fn refused(&self, expected: &str, remedy: &str) -> PyErr {
        refused(self.array.py(), self.name, self.words(), expected, remedy)
    }

    /// The numbers in rows, of a type; whatever order, stride, alignment and byte order they have.
    fn rows<T: Element>(&self) -> PyResult<Vec<T>> {
        let py = self.array.py();
        let keywords = PyDict::new(py);
        keywords.set_item("dtype", T::get_dtype(py))?;
        keywords.set_item("requirements", ["C", "A"])?;
        let array = py.import("numpy")?.call_method("require", (&self.array,), Some(&keywords))?;
        Ok(array.cast_into::<PyArrayDyn<T>>()?.to_vec()?)
    }
}

fn threes<T: Copy>(numbers: &[T]) -> impl Iterator<Item = [T; 3]> + '_ {
    numbers.chunks_exact(3).map(|row| [row[0], row[1], row[2]])
}

/// Real numbers `[n, 3]`, `n` at least 1.
pub fn vectors(name: &'static str, value: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 3]>> {
    let expected = "real numbers of shape [n, 3]";
    let given = Given::new(name, value, expected)?;
    if !matches!(given.kind, 'f' | 'i' | 'u') {
        return Err(given.refused(expected, "give float32 or float64"));
    }
    if given.array.ndim() != 2 || given.array.shape()[1] != 3 {
        return Err(given.refused(expected, "give x, y, z of each in a row"));
    }
    if given.array.shape()[0] == 0 {
        return Err(
            given.refused("real numbers of shape [n, 3], n at least 1", "give at least one row")
        );
    }
    let numbers = given.rows::<f64>()?;
    match numbers.iter().position(|x| !x.is_finite()) {
        Some(k) => {
            let found = format!("{} in row {}", numbers[k], k / 3);
            Err(refused(
                value.py(),
                name,
                found,
                "finite numbers",
                "leave such rows out, or mend what made them",
            ))
        }
        None => Ok(threes(&numbers).collect()),
    }
}

/// Whole numbers `[m, 3]`, `m` at least 1, each below `n_vertices`.
pub fn triangles(
    name: &'static str,
    value: &Bound<'_, PyAny>,
    n_vertices: usize,
) -> PyResult<Vec<[u32; 3]>> {
    let expected = "integers of shape [m, 3], rows of vertices";
    let given = Given::new(name, value, expected)?;
    if !matches!(given.kind, 'i' | 'u') {
        return Err(given.refused(expected, "convert it, for example by astype('uint32')"));
    }
    if given.array.ndim() != 2 || given.array.shape()[1] != 3 {
        return Err(given.refused(
            expected,
            "give three corners of each triangle in a row; divide other polygons",
        ));
    }
    if given.array.shape()[0] == 0 {
        return Err(
            given.refused("integers of shape [m, 3], m at least 1", "give at least one triangle")
        );
    }
    let most = n_vertices.min(u32::MAX as usize) as i128;
    let rows = |numbers: &mut dyn Iterator<Item = i128>| -> PyResult<Vec<[u32; 3]>> {
        let mut corners = Vec::new();
        for (k, corner) in numbers.enumerate() {
            if !(0..most).contains(&corner) {
                let found = format!("{corner} in row {}", k / 3);
                let expected = format!("rows of vertices, from 0 to {}", most - 1);
                let remedy = "count vertices from 0, and give all of them";
                return Err(refused(value.py(), name, found, expected, remedy));
            }
            corners.push(corner as u32);
        }
        Ok(threes(&corners).collect())
    };
    match given.kind {
        'u' => rows(&mut given.rows::<u64>()?.into_iter().map(i128::from)),
        _ => rows(&mut given.rows::<i64>()?.into_iter().map(i128::from)),
    }
}

/// A mark for each of `n` sites.
pub fn flags(name: &'static str, value: &Bound<'_, PyAny>, n: usize) -> PyResult<Vec<bool>> {
    let expected = format!("bool of shape [{n}], one for each site");
    let given = Given::new(name, value, &expected)?;
    if given.kind != 'b' || given.array.shape() != [n] {
        return Err(given.refused(&expected, "convert it, for example by astype(bool)"));
    }
    given.rows::<bool>()
}

/// Real numbers, as many as `N`.
pub fn numbers<const N: usize>(
    name: &'static str,
    value: &Bound<'_, PyAny>,
    expected: &str,
) -> PyResult<[f64; N]> {
    let given = Given::new(name, value, expected)?;
    if !matches!(given.kind, 'f' | 'i' | 'u') || given.array.shape() != [N] {
        return Err(given.refused(expected, "give so many numbers in a list or array"));
    }
    let numbers = given.rows::<f64>()?;
    <[f64; N]>::try_from(numbers).map_err(|_| given.refused(expected, "give so many numbers"))
}
