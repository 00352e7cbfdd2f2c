//! The layout of a model's parameters: names, shapes and ranges in its two flat vectors.

use crate::Result;
use crate::exec::memory;
use crate::numeric::rng::{Purpose, Stream};
use crate::numeric::scalar::Scalar;
use std::ops::Range;

/// How a parameter or buffer starts.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
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
    pub(crate) init: Init,
}

/// The tensors of a model, in the order in which its layers were built.
///
/// ```
/// use deepmill::nn::params::{Init, Layout};
/// let mut layout = Layout::default();
/// let weights = layout.param("linear.weight", &[3, 2], Init::Constant(0.0));
/// let bias = layout.param("linear.bias", &[2], Init::Constant(0.0));
/// assert_eq!((weights, bias, layout.n_params()), (0..6, 6..8, 8));
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layout {
    /// Learned tensors.
    pub(crate) params: Vec<Entry>,
    /// Running statistics.
    pub(crate) buffers: Vec<Entry>,
}

impl Layout {
    /// Appends a learned tensor and returns its range in the parameter vector.
    ///
    /// # Panics
    /// If the name is taken, the shape holds no element or more than can be counted, or a number of `init` is not
    /// finite.
    pub fn param(&mut self, name: impl Into<String>, shape: &[usize], init: Init) -> Range<usize> {
        append((&mut self.params, &self.buffers), name.into(), shape, init)
    }

    /// Appends a running statistic and returns its range in the buffer vector.
    ///
    /// # Panics
    /// As [`Layout::param`].
    pub fn buffer(&mut self, name: impl Into<String>, shape: &[usize], init: Init) -> Range<usize> {
        append((&mut self.buffers, &self.params), name.into(), shape, init)
    }

    /// Length of the parameter vector.
    pub fn n_params(&self) -> usize {
        self.params.last().map_or(0, |e| e.range.end)
    }

    /// Length of the buffer vector.
    pub fn n_buffers(&self) -> usize {
        self.buffers.last().map_or(0, |e| e.range.end)
    }

    /// Checks that `operation` fits into the memory, which takes `bytes_of_each` for each parameter and running
    /// statistic.
    ///
    /// # Errors
    /// [`Error::TooLarge`](crate::Error::TooLarge) if it does not.
    pub fn require_memory(&self, operation: &'static str, bytes_of_each: usize) -> Result<()> {
        let n = self.n_params().saturating_add(self.n_buffers());
        let remedy = format!("lower widths or numbers of blocks of the network ({n} parameters)");
        memory::require(operation, memory::product([n, bytes_of_each]), remedy)
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

/// Appends to the first list; a name is that of one tensor in both.
fn append(
    (entries, others): (&mut Vec<Entry>, &[Entry]),
    name: String,
    shape: &[usize],
    init: Init,
) -> Range<usize> {
    let mut all = entries.iter().chain(others);
    assert!(all.all(|entry| entry.name != name), "two tensors with the name {name}");
    assert!(shape.iter().all(|&n| n > 0), "{name}: a tensor of shape {shape:?}");
    let start = entries.last().map_or(0, |e| e.range.end);
    let n = shape.iter().try_fold(1_usize, |n, &of| n.checked_mul(of));
    let end = n.and_then(|n| start.checked_add(n)).filter(|&end| end <= isize::MAX as usize);
    let range = start..end.unwrap_or_else(|| panic!("{name}: a tensor of shape {shape:?}"));
    let (Init::Constant(number) | Init::Uniform { bound: number }) = init;
    assert!(number.is_finite(), "{name}: a tensor that starts at {number}");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_lie_one_after_another() {
        let mut layout = Layout::default();
        let first = layout.param("a", &[2, 3], Init::Constant(1.0));
        let second = layout.param("b", &[], Init::Uniform { bound: 0.5 });
        assert_eq!((first, second, layout.n_params()), (0..6, 6..7, 7));
        let params: Vec<f64> = layout.init_params(1);
        assert!(params[..6] == [1.0; 6] && params[6].abs() <= 0.5);
    }

    #[test]
    #[should_panic(expected = "two tensors with the name a")]
    fn a_name_is_given_once() {
        let mut layout = Layout::default();
        layout.param("a", &[1], Init::Constant(0.0));
        layout.param("a", &[2], Init::Constant(0.0));
    }

    #[test]
    #[should_panic(expected = "two tensors with the name a")]
    fn a_parameter_and_a_running_statistic_have_different_names() {
        let mut layout = Layout::default();
        layout.param("a", &[1], Init::Constant(0.0));
        layout.buffer("a", &[1], Init::Constant(0.0));
    }

    #[test]
    #[should_panic(expected = "a: a tensor of shape [3, 0]")]
    fn a_tensor_without_elements_is_refused() {
        Layout::default().param("a", &[3, 0], Init::Constant(0.0));
    }
}
