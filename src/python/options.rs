//! Keyword arguments, with the words of this library where they are wrong.

use super::errors::{Watch, checked, refused, shown, wrong_type};
use super::input;
use crate::geom::units::Unit;
use crate::tool::directions::{DirectionSet, Directions};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};

/// The keyword arguments of a call that are not yet taken.
pub struct Options<'py> {
    py: Python<'py>,
    left: Option<Bound<'py, PyDict>>,
    /// Names that were taken.
    names: Vec<&'static str>,
}

impl<'py> Options<'py> {
    /// All of a call.
    pub fn new(py: Python<'py>, given: Option<Bound<'py, PyDict>>) -> PyResult<Self> {
        let left = given.map(|given| given.copy()).transpose()?;
        Ok(Options { py, left, names: Vec::new() })
    }

    /// The interpreter.
    pub fn py(&self) -> Python<'py> {
        self.py
    }

    /// What was given by this name; none for `None`.
    pub fn take(&mut self, name: &'static str) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.names.push(name);
        let Some(left) = &self.left else { return Ok(None) };
        let value = left.get_item(name)?;
        if value.is_some() {
            left.del_item(name)?;
        }
        Ok(value.filter(|value| !value.is_none()))
    }

    /// An error if something is left that nobody took.
    pub fn finish(self) -> PyResult<()> {
        let Some(left) = &self.left else { return Ok(()) };
        match left.keys().iter().next() {
            None => Ok(()),
            Some(name) => Err(PyTypeError::new_err(format!(
                "there is no option {name}, expected one of {}",
                self.names.join(", ")
            ))),
        }
    }

    /// A real number.
    pub fn number(&mut self, name: &'static str) -> PyResult<Option<f64>> {
        self.take(name)?.map(|value| number(name, &value)).transpose()
    }

    /// A whole number from 0 on.
    pub fn whole<T: for<'a> FromPyObject<'a, 'py>>(
        &mut self,
        name: &'static str,
    ) -> PyResult<Option<T>> {
        let Some(value) = self.take(name)? else { return Ok(None) };
        if value.is_instance_of::<PyBool>() {
            return Err(wrong_type(name, &value, "a whole number from 0 on"));
        }
        match value.extract::<T>() {
            Ok(number) => Ok(Some(number)),
            Err(_) if value.call_method0("__index__").is_ok() => {
                let found = value.to_string();
                Err(refused(
                    self.py,
                    name,
                    found,
                    "a whole number from 0 on",
                    "give one that fits into a machine word",
                ))
            }
            Err(_) => Err(wrong_type(name, &value, "a whole number from 0 on")),
        }
    }

    /// `True` or `False`.
    pub fn flag(&mut self, name: &'static str) -> PyResult<Option<bool>> {
        let Some(value) = self.take(name)? else { return Ok(None) };
        value.extract().map(Some).map_err(|_| wrong_type(name, &value, "True or False"))
    }

    /// Text.
    pub fn text(&mut self, name: &'static str) -> PyResult<Option<String>> {
        self.take(name)?.map(|value| text_of(name, &value)).transpose()
    }

    /// A unit of length.
    pub fn unit(&mut self, name: &'static str) -> PyResult<Unit> {
        let text = self.text(name)?;
        let unit = text.map(|text| {
            text.parse().map_err(|_| {
                let remedy = "None is mm";
                refused(self.py, name, format!("`{text}`"), "mm, cm, m or in", remedy)
            })
        });
        Ok(unit.transpose()?.unwrap_or_default())
    }

    /// A callable for progress, if there is one.
    pub fn progress(&mut self) -> PyResult<Watch> {
        Watch::new(self.take("progress")?)
    }

    /// Directions: a set in words, a number of them over the upper half, or vectors `[n, 3]`.
    pub fn directions(&mut self) -> PyResult<Option<Directions>> {
        const NAME: &str = "directions";
        let Some(value) = self.take(NAME)? else { return Ok(None) };
        let is_count = !value.is_instance_of::<PyBool>() && value.extract::<usize>().is_ok();
        let made = if value.is_instance_of::<PyString>() || is_count {
            value.str()?.to_string().parse()
        } else {
            let vectors = input::vectors(NAME, &value)?;
            Directions::new(DirectionSet::List { vectors })
        };
        checked(self.py, made).map(Some)
    }
}

/// Text.
pub fn text_of(name: &'static str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    if !value.is_instance_of::<PyString>() {
        return Err(wrong_type(name, value, "a str"));
    }
    value.extract().map_err(|_| {
        refused(value.py(), name, shown(value), "text in Unicode", "leave out lone surrogates")
    })
}

/// A real number.
pub fn number(name: &'static str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    if value.is_instance_of::<PyBool>() {
        return Err(wrong_type(name, value, "a number"));
    }
    let number: f64 = value.extract().map_err(|_| wrong_type(name, value, "a number"))?;
    match number.is_nan() {
        false => Ok(number),
        true => Err(refused(value.py(), name, "nan", "a number", "leave it out for the default")),
    }
}
