//! Parity: comparison of this implementation with tensors recorded from the reference implementation.
//!
//! A fixture is a folder with `config.json`, `weights.safetensors`, `input.safetensors`,
//! `expected.safetensors` and, if it has single-layer cases, `ops.safetensors`. [`run`] rebuilds octree,
//! features, stage outputs, logits, loss, gradients and three optimizer steps in f32 and again in f64, and
//! compares every recorded tensor with ours. Each kind of tensor has its own gate: the noise that the
//! reference's own float32 runs show against float64 and other thread counts, with room to spare.

mod fixture;
mod gates;
mod network;
mod ops;

use crate::model::weights::tensors::{Tensor, TensorFile, TensorValues};
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};
pub use gates::GateRow;
use std::collections::BTreeMap;
use std::path::Path;

/// Outcome of a comparison.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// One row per gate; every recorded tensor has at least one.
    pub rows: Vec<GateRow>,
    /// Our own tensors under the fixture's names, whole.
    pub actual: TensorFile,
}

impl Outcome {
    /// Whether every gate is kept.
    pub fn passed(&self) -> bool {
        self.rows.iter().all(GateRow::passed)
    }

    /// The row of each group that comes nearest to its gate or exceeds it most, by group name.
    pub fn worst(&self) -> Vec<&GateRow> {
        let mut worst: BTreeMap<&str, &GateRow> = BTreeMap::new();
        for row in &self.rows {
            let kept = worst.entry(&row.group).or_insert(row);
            if row.share_of_gate() > kept.share_of_gate() {
                *kept = row;
            }
        }
        worst.into_values().collect()
    }
}

/// Reads the fixture in `folder`, computes everything it records, and compares.
///
/// # Errors
/// If a file is missing or broken, or if the fixture records a tensor, or needs a variant of the network,
/// that this crate does not know. A missed gate is not an error; see [`Outcome::passed`].
pub fn run(folder: &Path) -> Result<Outcome> {
    let fixture = fixture::Fixture::read(folder)?;
    let mut actual = Tensors::default();
    network::run::<f32>(&fixture, "", &mut actual)?;
    network::run::<f64>(&fixture, "f64.", &mut actual)?;
    let expected = &fixture.expected;
    let mut rows = gates::compare(&expected.tensors, &actual, "", &folder.join(fixture::EXPECTED))?;
    let mut actual = actual.0;
    actual.retain(|name, _| expected.tensors.keys().any(|e| gates::split_stride(e).0 == name));
    if let Some(recorded) = &fixture.ops {
        let origin = folder.join(fixture::OPS);
        for prefix in ["", "f64."] {
            let mut own = Tensors::default();
            match prefix {
                "" => ops::run::<f32>(&fixture, recorded, &mut own)?,
                _ => ops::run::<f64>(&fixture, recorded, &mut own)?,
            }
            rows.extend(gates::compare(
                &recorded.tensors,
                &own,
                &format!("{prefix}ops."),
                &origin,
            )?);
            let named = |(name, tensor)| (format!("{prefix}{name}"), tensor);
            actual.extend(own.0.into_iter().map(named));
        }
    }
    Ok(Outcome { rows, actual: TensorFile { tensors: actual, ..TensorFile::default() } })
}

/// Named results.
#[derive(Debug, Default)]
struct Tensors(BTreeMap<String, Tensor>);

impl Tensors {
    fn add<T: Scalar>(&mut self, name: impl Into<String>, shape: &[usize], values: &[T]) {
        let exact = values.iter().map(|v| v.to_f64());
        let values = match size_of::<T>() {
            8 => TensorValues::F64(exact.collect()),
            _ => TensorValues::F32(exact.map(|v| v as f32).collect()),
        };
        self.insert(name, shape, values);
    }

    /// Rows of `c` columns.
    fn add_rows<T: Scalar>(&mut self, name: impl Into<String>, c: usize, values: &[T]) {
        self.add(name, &[values.len() / c, c], values);
    }

    fn insert(&mut self, name: impl Into<String>, shape: &[usize], values: TensorValues) {
        self.0.insert(name.into(), Tensor { shape: shape.to_vec(), values });
    }
}

/// A tensor that a fixture must have.
fn tensor<'a>(file: &'a TensorFile, name: &str, origin: &Path) -> Result<&'a Tensor> {
    file.tensors.get(name).ok_or_else(|| {
        let place = format!("tensor {name}");
        Error::file(origin, place, "it is missing", "make the fixture again")
    })
}
