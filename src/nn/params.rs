//! Names, shapes and places of every number of a model in its two flat vectors.

use crate::rng::{Purpose, Stream};
use crate::scalar::Scalar;
use std::ops::Range;

/// How a parameter or buffer starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Init {
    /// Every element the same.
    Constant(f64),
    /// Uniform in `±bound`.
    Uniform {
        /// Largest magnitude.
        bound: f64,
    },
}

/// One named tensor inside a flat vector.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Name in weight files: the reference implementation's state-dict key.
    pub name: String,
    /// Shape, row-major.
    pub shape: Vec<usize>,
    /// Place in the flat vector.
    pub range: Range<usize>,
    /// Starting values.
    pub init: Init,
}

/// The tensors of a model, in the order in which its layers were built.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layout {
    /// Learned tensors.
    pub params: Vec<Entry>,
    /// Running statistics.
    pub buffers: Vec<Entry>,
}

impl Layout {
    /// Appends a learned tensor and returns its range in the parameter vector.
    pub fn param(&mut self, name: impl Into<String>, shape: &[usize], init: Init) -> Range<usize> {
        append(&mut self.params, name.into(), shape, init)
    }

    /// Appends a running statistic and returns its range in the buffer vector.
    pub fn buffer(&mut self, name: impl Into<String>, shape: &[usize], init: Init) -> Range<usize> {
        append(&mut self.buffers, name.into(), shape, init)
    }

    /// Length of the parameter vector.
    pub fn n_params(&self) -> usize {
        self.params.last().map_or(0, |e| e.range.end)
    }

    /// Length of the buffer vector.
    pub fn n_buffers(&self) -> usize {
        self.buffers.last().map_or(0, |e| e.range.end)
    }

    /// Starting parameters; tensor `i` draws from stream (`seed`, 0, `i`, [`Purpose::Init`]).
    pub fn init_params<T: Scalar>(&self, seed: u64) -> Vec<T> {
        init(&self.params, seed)
    }

    /// Starting running statistics.
    pub fn init_buffers<T: Scalar>(&self) -> Vec<T> {
        init(&self.buffers, 0)
    }
}

fn append(entries: &mut Vec<Entry>, name: String, shape: &[usize], init: Init) -> Range<usize> {
    let start = entries.last().map_or(0, |e| e.range.end);
    let range = start..start + shape.iter().product::<usize>();
    entries.push(Entry { name, shape: shape.to_vec(), range: range.clone(), init });
    range
}

fn init<T: Scalar>(entries: &[Entry], seed: u64) -> Vec<T> {
    let mut values = Vec::with_capacity(entries.last().map_or(0, |e| e.range.end));
    for (i, entry) in entries.iter().enumerate() {
        let mut stream = Stream::new(seed, 0, i as u64, Purpose::Init);
        values.extend(entry.range.clone().map(|_| {
            T::from_f64(match entry.init {
                Init::Constant(value) => value,
                Init::Uniform { bound } => stream.range(-bound, bound),
            })
        }));
    }
    values
}
