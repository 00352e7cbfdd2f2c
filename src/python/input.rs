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
    rows(
        name,
        value,
        Rows { shape: "[n, 3]", remedy: "give x, y, z of each in a row", may_be_nan: false },
    )
}

/// Rows of real numbers, as they are expected.
#[derive(Debug, Clone, Copy)]
pub struct Rows {
    /// In words: as `[n, 3]`.
    pub shape: &'static str,
    /// For another shape.
    pub remedy: &'static str,
    /// Whether a row may be all NaN: it is not there.
    pub may_be_nan: bool,
}

/// Real numbers `[n, N]`, `n` at least 1.
pub fn rows<const N: usize>(
    name: &'static str,
    value: &Bound<'_, PyAny>,
    Rows { shape, remedy, may_be_nan }: Rows,
) -> PyResult<Vec<[f64; N]>> {
    let expected = format!("real numbers of shape {shape}");
    let given = Given::new(name, value, &expected)?;
    if !matches!(given.kind, 'f' | 'i' | 'u') {
        return Err(given.refused(&expected, "give float32 or float64"));
    }
    if given.array.ndim() != 2 || given.array.shape()[1] != N {
        return Err(given.refused(&expected, remedy));
    }
    if given.array.shape()[0] == 0 {
        return Err(given.refused(&format!("{expected}, at least 1 row"), "give at least one row"));
    }
    let numbers: Vec<[f64; N]> = given.rows::<f64>()?.as_chunks().0.to_vec();
    let is_right = |row: &[f64; N]| {
        row.iter().all(|x| x.is_finite()) || (may_be_nan && row.iter().all(|x| x.is_nan()))
    };
    match numbers.iter().position(|row| !is_right(row)) {
        Some(k) => {
            let bad = numbers[k].iter().find(|x| !x.is_finite()).unwrap_or(&f64::NAN);
            let remedy = match may_be_nan {
                false => "leave such rows out, or mend what made them",
                true => "a row that is not there is all NaN",
            };
            let found = format!("{bad} in row {k}");
            Err(refused(value.py(), name, found, "finite numbers", remedy))
        }
        None => Ok(numbers),
    }
}

/// Rows that are chosen of `n`: by their numbers, or by a mark for each.
pub fn chosen(
    name: &'static str,
    value: &Bound<'_, PyAny>,
    (n, what): (usize, &str),
) -> PyResult<Vec<usize>> {
    let expected = format!("numbers of {what}, or bool of shape [{n}]");
    let given = Given::new(name, value, &expected)?;
    let rows = match given.kind {
        'b' if given.array.shape() == [n] => {
            let marks = given.rows::<bool>()?;
            (0..n).filter(|&k| marks[k]).collect()
        }
        'i' | 'u' if given.array.ndim() == 1 => {
            let numbers: Vec<i128> = match given.kind {
                'u' => given.rows::<u64>()?.into_iter().map(i128::from).collect(),
                _ => given.rows::<i64>()?.into_iter().map(i128::from).collect(),
            };
            if let Some(beyond) = numbers.iter().find(|number| !(0..n as i128).contains(number)) {
                let expected = format!("{what} from 0 to {}", n.saturating_sub(1));
                let remedy = "count from 0, in the order of Mesh.triangles";
                return Err(refused(value.py(), name, beyond, expected, remedy));
            }
            numbers.into_iter().map(|number| number as usize).collect()
        }
        _ => return Err(given.refused(&expected, "give whole numbers, or a mark for each")),
    };
    match Vec::is_empty(&rows) {
        true => Err(given.refused(&format!("{expected}, one or more of them"), "choose some")),
        false => Ok(rows),
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

/// A mark for each of `n` of something.
pub fn flags(
    name: &'static str,
    value: &Bound<'_, PyAny>,
    (n, what): (usize, &str),
) -> PyResult<Vec<bool>> {
    let expected = format!("bool of shape [{n}], one for each {what}");
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

/// Real numbers, of some counts.
pub fn numbers_of(
    name: &'static str,
    value: &Bound<'_, PyAny>,
    (counts, expected): (std::ops::RangeInclusive<usize>, &str),
) -> PyResult<Vec<f64>> {
    let given = Given::new(name, value, expected)?;
    let is_right = matches!(given.kind, 'f' | 'i' | 'u')
        && given.array.ndim() == 1
        && counts.contains(&given.array.shape()[0]);
    match is_right {
        true => given.rows::<f64>(),
        false => Err(given.refused(expected, "give so many numbers in a list or array")),
    }
}
