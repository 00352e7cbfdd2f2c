//! Named tensors, and reading and writing them as safetensors.

use crate::exec::memory;
use crate::storage::{atomic_file, input_file};
use crate::{Error, Result};
use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// Elements of a tensor, row-major, in the type they have in the file.
#[derive(Debug, Clone, PartialEq)]
pub enum TensorValues {
    /// `F64`.
    F64(Vec<f64>),
    /// `F32`; half-precision numbers are read into this type too.
    F32(Vec<f32>),
    /// `BF16`, as bit patterns.
    Bf16(Vec<u16>),
    /// `I64`.
    I64(Vec<i64>),
    /// `I32`.
    I32(Vec<i32>),
}

/// One tensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    /// Shape; empty for a single number.
    pub shape: Vec<usize>,
    /// As many elements as the shape says.
    pub values: TensorValues,
}

impl Tensor {
    /// Every element as f64; exact but for integers beyond 2^53.
    pub fn to_f64(&self) -> Vec<f64> {
        match &self.values {
            TensorValues::F64(v) => v.clone(),
            TensorValues::F32(v) => v.iter().map(|&x| f64::from(x)).collect(),
            TensorValues::Bf16(v) => {
                v.iter().map(|&x| f64::from(f32::from_bits(u32::from(x) << 16))).collect()
            }
            TensorValues::I64(v) => v.iter().map(|&x| x as f64).collect(),
            TensorValues::I32(v) => v.iter().map(|&x| f64::from(x)).collect(),
        }
    }

    /// Whether the elements are integers.
    pub fn is_integer(&self) -> bool {
        matches!(self.values, TensorValues::I64(_) | TensorValues::I32(_))
    }

    fn n_bytes(&self) -> u64 {
        let of = |n: usize, each: usize| memory::product([n, each]);
        match &self.values {
            TensorValues::F64(v) => of(v.len(), 8),
            TensorValues::F32(v) => of(v.len(), 4),
            TensorValues::Bf16(v) => of(v.len(), 2),
            TensorValues::I64(v) => of(v.len(), 8),
            TensorValues::I32(v) => of(v.len(), 4),
        }
    }

    /// Its type in a file, and the bytes of its elements.
    pub(crate) fn bytes(&self) -> (Dtype, Vec<u8>) {
        match &self.values {
            TensorValues::F64(v) => (Dtype::F64, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
            TensorValues::F32(v) => (Dtype::F32, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
            TensorValues::Bf16(v) => {
                (Dtype::BF16, v.iter().flat_map(|x| x.to_le_bytes()).collect())
            }
            TensorValues::I64(v) => (Dtype::I64, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
            TensorValues::I32(v) => (Dtype::I32, v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        }
    }
}

/// Bit pattern of the nearest bf16 number, ties to even; NaN stays NaN.
pub fn to_bf16(x: f32) -> u16 {
    let bits = x.to_bits();
    if x.is_nan() {
        return (bits >> 16) as u16 | 0x40;
    }
    ((bits + 0x7fff + (bits >> 16 & 1)) >> 16) as u16
}

fn from_f16(bits: u16) -> f32 {
    let (exponent, fraction) = (bits >> 10 & 0x1f, u32::from(bits & 0x3ff));
    let magnitude = match exponent {
        0 => fraction as f32 * (1.0 / (1 << 24) as f32),
        31 => f32::from_bits(0x7f80_0000 | fraction << 13),
        _ => f32::from_bits((u32::from(exponent) + 112) << 23 | fraction << 13),
    };
    if bits >> 15 == 1 { -magnitude } else { magnitude }
}

/// Every tensor of a file by name, and the file's text metadata.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TensorFile {
    /// The tensors.
    pub tensors: BTreeMap<String, Tensor>,
    /// The `__metadata__` entries.
    pub metadata: BTreeMap<String, String>,
}

impl TensorFile {
    /// Reads a safetensors file.
    ///
    /// # Errors
    /// If the file cannot be read, is not safetensors, holds a tensor of another type than f64, f32, f16,
    /// bf16, i64, i32, or does not fit into the memory.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_bytes(&input_file::read(path, input_file::DATA)?, path)
    }

    /// Reads the content of a safetensors file; `origin` is named in errors.
    ///
    /// # Errors
    /// As [`TensorFile::read`].
    pub fn from_bytes(bytes: &[u8], origin: &Path) -> Result<Self> {
        let broken = |e: safetensors::SafeTensorError| {
            Error::file(origin, "header", e.to_string(), "give a complete safetensors file")
        };
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(broken)?;
        let mut file = TensorFile::default();
        file.metadata
            .extend(header.metadata().iter().flatten().map(|(k, v)| (k.clone(), v.clone())));
        let views = SafeTensors::deserialize(bytes).map_err(broken)?;
        let sizes = views.iter().map(|(_, view)| bytes_of(&view));
        memory::require_for(origin, "reading the tensors", sizes.sum())?;
        for (name, view) in views.iter() {
            let values = values(&view).ok_or_else(|| {
                Error::file(
                    origin,
                    format!("tensor {name}"),
                    format!("its type is {}", view.dtype()),
                    "convert it to f32",
                )
            })?;
            file.tensors.insert(name.into(), Tensor { shape: view.shape().to_vec(), values });
        }
        Ok(file)
    }

    /// The content of a safetensors file; equal files give equal bytes if they have at most one metadata
    /// entry (the format's library does not order them).
    ///
    /// # Panics
    /// If a tensor has not as many elements as its shape says.
    pub fn to_bytes(&self) -> Vec<u8> {
        let bytes: Vec<_> = self.tensors.iter().map(|(name, t)| (name, t, t.bytes())).collect();
        let views = bytes.iter().map(|(name, tensor, (dtype, bytes))| {
            let view = TensorView::new(*dtype, tensor.shape.clone(), bytes);
            (name.as_str(), view.expect("a tensor has as many elements as its shape says"))
        });
        let metadata: HashMap<String, String> = self.metadata.clone().into_iter().collect();
        let metadata = (!metadata.is_empty()).then_some(metadata);
        serialize(views, metadata).expect("views were checked")
    }

    /// Writes a safetensors file.
    ///
    /// # Errors
    /// If the file cannot be written, or its bytes do not fit into the memory.
    pub fn write(&self, path: &Path) -> Result<()> {
        // Tensor by tensor, and one after another.
        let size = self.tensors.values().map(Tensor::n_bytes).sum::<u64>();
        memory::require_for(path, "writing the tensors", size.saturating_mul(2))?;
        let bytes = self.to_bytes();
        atomic_file::write_atomic(path, |writer| writer.write_all(&bytes))
    }
}

/// Memory of the values.
fn bytes_of(view: &TensorView) -> u64 {
    let times = if view.dtype() == Dtype::F16 { 2 } else { 1 };
    times * view.data().len() as u64
}

fn values(view: &TensorView) -> Option<TensorValues> {
    let data = view.data();
    Some(match view.dtype() {
        Dtype::F64 => TensorValues::F64(numbers(data, f64::from_le_bytes)),
        Dtype::F32 => TensorValues::F32(numbers(data, f32::from_le_bytes)),
        Dtype::F16 => TensorValues::F32(numbers(data, |b| from_f16(u16::from_le_bytes(b)))),
        Dtype::BF16 => TensorValues::Bf16(numbers(data, u16::from_le_bytes)),
        Dtype::I64 => TensorValues::I64(numbers(data, i64::from_le_bytes)),
        Dtype::I32 => TensorValues::I32(numbers(data, i32::from_le_bytes)),
        _ => return None,
    })
}

fn numbers<const N: usize, V>(bytes: &[u8], number: impl Fn([u8; N]) -> V) -> Vec<V> {
    bytes.as_chunks().0.iter().map(|b| number(*b)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_survives_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.safetensors");
        let mut file = TensorFile::default();
        let mut add = |name: &str, shape: &[usize], values| {
            file.tensors.insert(name.into(), Tensor { shape: shape.into(), values });
        };
        add("a", &[2, 1], TensorValues::F64(vec![1e-300, -2.5]));
        add("b", &[3], TensorValues::F32(vec![1.5, f32::MIN_POSITIVE, -0.0]));
        add("c", &[], TensorValues::I64(vec![-(1 << 60)]));
        add("d", &[0, 4], TensorValues::I32(vec![]));
        add("e", &[1], TensorValues::Bf16(vec![to_bf16(-3.0)]));
        file.metadata.insert("deepmill".into(), "{}".into());
        file.write(&path).unwrap();
        let read = TensorFile::read(&path).unwrap();
        assert_eq!(read, file);
        assert_eq!(read.tensors["e"].to_f64(), [-3.0]);
    }

    #[test]
    fn half_precision_numbers_are_exact() {
        let half = [
            (0x0001, 2f32.powi(-24)),
            (0x3c01, 1.0 + 2f32.powi(-10)),
            (0xfbff, -65504.0),
            (0x8000, 0.0),
        ];
        for (bits, value) in half {
            assert_eq!(from_f16(bits), value);
        }
        assert_eq!(from_f16(0x7c00), f32::INFINITY);
        assert!(from_f16(0x7e00).is_nan());
        let step = 1.0 / 256.0;
        let rounded = [(1.0 + step, 0x3f80), (1.0 + 3.0 * step, 0x3f82), (-0.0, 0x8000)];
        for (x, bits) in rounded {
            assert_eq!(to_bf16(x), bits, "{x}");
        }
        assert_eq!(to_bf16(f32::MAX), 0x7f80);
        assert!(f32::from_bits(u32::from(to_bf16(f32::NAN)) << 16).is_nan());
    }

    #[test]
    fn broken_files_are_refused() {
        let origin = Path::new("w.safetensors");
        let message = |b: &[u8]| TensorFile::from_bytes(b, origin).unwrap_err().to_string();
        assert!(message(b"").starts_with("w.safetensors: header: "));
        assert!(message(&[255; 64]).contains("header"));
        let mut file = TensorFile::default();
        file.tensors
            .insert("a".into(), Tensor { shape: vec![4], values: TensorValues::F32(vec![0.0; 4]) });
        let bytes = file.to_bytes();
        assert!(message(&bytes[..bytes.len() - 1]).contains("header"));
    }
}
