//! Fixtures of gradient checks: the inputs, outputs and gradients of a case of the [suite](super::suite) as named f64
//! arrays.
//!
//! `docs/gradcheck-fixtures.md` says how to hold another implementation against them.

#[cfg(feature = "formats")]
use crate::Result;
#[cfg(feature = "formats")]
use crate::model::weights::tensors::{Tensor, TensorFile, TensorValues};
use crate::nn::params::Entry;
#[cfg(feature = "formats")]
use std::path::Path;

/// Name of the metadata entry of a fixture's file.
#[cfg(feature = "formats")]
pub const METADATA_KEY: &str = "gradcheck";
/// Version of the names and conventions of a fixture's arrays.
pub const VERSION: u32 = 1;

/// Inputs, parameters, geometry, outputs and gradients of one case.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixture {
    /// Name of the case.
    pub case: &'static str,
    /// What it computes.
    pub formula: &'static str,
    /// Numbers that the arrays do not tell, such as a dropout probability.
    pub constants: Vec<(&'static str, f64)>,
    /// The arrays, no two of the same name.
    pub arrays: Vec<NamedArray>,
}

/// One array of a [`Fixture`].
#[derive(Debug, Clone, PartialEq)]
pub struct NamedArray {
    /// Kind and name, such as `param.linear.weight`.
    pub name: String,
    /// What its elements are.
    pub meaning: String,
    /// Shape, row-major; empty for a single number.
    pub shape: Vec<usize>,
    /// As many elements as the shape says.
    pub values: ArrayValues,
}

/// Elements of an array.
#[derive(Debug, Clone, PartialEq)]
pub enum ArrayValues {
    /// Numbers.
    F64(Vec<f64>),
    /// Indices, keys, classes.
    I64(Vec<i64>),
}

impl NamedArray {
    /// Numbers.
    pub(super) fn numbers(
        name: impl Into<String>,
        meaning: impl Into<String>,
        shape: &[usize],
        values: &[f64],
    ) -> Self {
        let values = ArrayValues::F64(values.to_vec());
        NamedArray { name: name.into(), meaning: meaning.into(), shape: shape.to_vec(), values }
    }

    /// Indices, `c` in a row; a list where `c` is 1.
    pub(super) fn indices(
        name: impl Into<String>,
        meaning: impl Into<String>,
        c: usize,
        values: impl IntoIterator<Item = i64>,
    ) -> Self {
        let values: Vec<i64> = values.into_iter().collect();
        let shape = if c == 1 { vec![values.len()] } else { vec![values.len() / c, c] };
        let values = ArrayValues::I64(values);
        NamedArray { name: name.into(), meaning: meaning.into(), shape, values }
    }
}

impl Fixture {
    /// The array of this name.
    pub fn get(&self, name: &str) -> Option<&NamedArray> {
        self.arrays.iter().find(|array| array.name == name)
    }

    pub(super) fn add(&mut self, name: &str, meaning: &str, shape: &[usize], values: &[f64]) {
        self.arrays.push(NamedArray::numbers(name, meaning, shape, values));
    }

    /// The tensors of a flat vector as `{kind}.{name}`.
    pub(super) fn add_tensors(
        &mut self,
        (kind, meaning): (&str, &str),
        tensors: &[Entry],
        values: &[f64],
    ) {
        for entry in tensors {
            let name = format!("{kind}.{}", entry.name);
            self.add(&name, meaning, &entry.shape, &values[entry.range.clone()]);
        }
    }

    /// The arrays as tensors; the metadata entry [`METADATA_KEY`] is a JSON object with version, case, formula,
    /// constants, and shape and meaning of each array.
    #[cfg(feature = "formats")]
    pub fn to_tensors(&self) -> TensorFile {
        let mut file = TensorFile::default();
        let mut arrays = serde_json::Map::new();
        for NamedArray { name, meaning, shape, values } in &self.arrays {
            arrays.insert(name.clone(), serde_json::json!({ "shape": shape, "meaning": meaning }));
            let values = match values {
                ArrayValues::F64(values) => TensorValues::F64(values.clone()),
                ArrayValues::I64(values) => TensorValues::I64(values.clone()),
            };
            file.tensors.insert(name.clone(), Tensor { shape: shape.clone(), values });
        }
        let constants = self.constants.iter().map(|(name, x)| (name.to_string(), (*x).into()));
        let description = serde_json::json!({
            "version": VERSION,
            "case": self.case,
            "formula": self.formula,
            "constants": constants.collect::<serde_json::Map<_, _>>(),
            "arrays": arrays,
        });
        file.metadata.insert(METADATA_KEY.into(), description.to_string());
        file
    }

    /// Writes [`Fixture::to_tensors`] as a safetensors file.
    ///
    /// # Errors
    /// If the file cannot be written.
    #[cfg(feature = "formats")]
    pub fn write(&self, path: &Path) -> Result<()> {
        self.to_tensors().write(path)
    }
}
