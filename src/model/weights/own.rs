//! Files of one's own networks: the tensors of a layout, bit by bit, with or without what an optimizer keeps.

use super::tensors::{Tensor, TensorFile};
use super::{Storage, compare_names, gather, require_memory, store};
use crate::model::{Model, Network};
use crate::nn::params::{Entry, Layout};
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};
use std::path::Path;

/// Beginning of the names of an optimizer's tensors: `velocity:{parameter}`.
pub(crate) const VELOCITY: &str = "velocity:";

impl<T: Scalar, N: Network<T>> Model<T, N> {
    /// Writes every parameter and running statistic under its name in the layout, as safetensors in the type of the
    /// model, as a whole or not at all. A calibration is not written.
    ///
    /// # Errors
    /// If the file cannot be written, or its bytes do not fit into the memory.
    pub fn write_tensors(&self, path: &Path) -> Result<()> {
        to_tensors(self.net.layout(), &self.params, &self.buffers).write(path)
    }

    /// `net` with the numbers of a file of [`Model::write_tensors`], or of
    /// [`Trainer::write`](crate::train::Trainer::write): the same bits, if the model is of the same type.
    ///
    /// # Errors
    /// If the file cannot be read or is not safetensors; if a tensor is missing, extra, of another shape than in the
    /// layout, or holds a number that is not finite: the first such tensor is named.
    pub fn read_tensors(net: N, path: &Path) -> Result<Self> {
        let mut file = TensorFile::read(path)?;
        let of_layout = |name: &str| net.layout().params.iter().any(|e| e.name == name);
        file.tensors.retain(|name, _| !name.starts_with(VELOCITY) || of_layout(name));
        let (params, buffers) = from_tensors(net.layout(), &file, path)?;
        Ok(Model::of(net, params, buffers))
    }
}

/// A file's tensors, named and shaped as in `layout`, in the type of the numbers.
pub(crate) fn to_tensors<T: Scalar>(layout: &Layout, params: &[T], buffers: &[T]) -> TensorFile {
    let mut file = TensorFile::default();
    for (entries, values) in [(&layout.params, params), (&layout.buffers, buffers)] {
        add(&mut file, entries, values, Storage::Exact);
    }
    file
}

/// Adds the tensors `entries` of a flat vector.
pub(super) fn add<T: Scalar>(
    file: &mut TensorFile,
    entries: &[Entry],
    values: &[T],
    storage: Storage,
) {
    for entry in entries {
        let values = store(&entry.name, &values[entry.range.clone()], storage);
        file.tensors.insert(entry.name.clone(), Tensor { shape: entry.shape.clone(), values });
    }
}

/// Parameters and running statistics of `file`, which holds those of `layout` and nothing else.
pub(crate) fn from_tensors<T: Scalar>(
    layout: &Layout,
    file: &TensorFile,
    origin: &Path,
) -> Result<(Vec<T>, Vec<T>)> {
    compare_names(layout, file, origin)?;
    require_memory(layout, size_of::<T>(), origin)?;
    Ok((gather(&layout.params, file, origin)?, gather(&layout.buffers, file, origin)?))
}

/// The layout of a vector that holds a velocity for each parameter.
///
/// # Errors
/// If a tensor of the network has such a name.
pub(crate) fn velocity_layout(layout: &Layout) -> Result<Layout> {
    let mut names = layout.params.iter().chain(&layout.buffers).map(|entry| &entry.name);
    if let Some(name) = names.find(|name| name.starts_with(VELOCITY)) {
        let expected = format!("one that does not begin with `{VELOCITY}`");
        let remedy = "give the layer another name in the layout";
        return Err(Error::argument("name of a tensor", format!("`{name}`"), expected, remedy));
    }
    let of = |entry: &Entry| Entry { name: format!("{VELOCITY}{}", entry.name), ..entry.clone() };
    Ok(Layout { params: layout.params.iter().map(of).collect(), buffers: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{UNet, UNetConfig};
    use crate::storage::atomic_file::faults::at_every_step;

    /// A model is written and read back.
    fn again<T: Scalar>(path: &Path) -> [Vec<u64>; 2] {
        let mut model = Model::<T>::new(&UNetConfig::tiny(), 1).unwrap();
        model.buffers.iter_mut().enumerate().for_each(|(i, b)| *b = T::from_f64(i as f64 / 3.0));
        model.write_tensors(path).unwrap();
        let net = UNet::new(&UNetConfig::tiny()).unwrap();
        let read = Model::<T, _>::read_tensors(net, path).unwrap();
        [model, read].map(|Model { params, buffers, .. }| {
            params.iter().chain(&buffers).map(|x| x.to_f64().to_bits()).collect()
        })
    }

    #[test]
    fn tensors_of_any_network_survive_a_file_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/tensors.safetensors");
        let ([f32s, read_f32s], [f64s, read_f64s]) = (again::<f32>(&path), again::<f64>(&path));
        assert!(f32s == read_f32s && f64s == read_f64s && f32s != f64s);
        let config = UNetConfig { stem_width: 9, ..UNetConfig::tiny() };
        let other = Model::<f64, _>::read_tensors(UNet::new(&config).unwrap(), &path);
        let message = other.err().unwrap().to_string();
        assert!(message.contains("tensor conv1.conv.weights: its shape is ["), "{message}");
    }

    #[test]
    fn a_file_refused_at_any_step_is_the_old_one_or_the_new_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tensors.safetensors");
        let model = |seed| Model::<f32>::new(&UNetConfig::tiny(), seed).unwrap();
        let (old, new) = (model(1), model(2));
        old.write_tensors(&path).unwrap();
        let n = at_every_step(
            || new.write_tensors(&path),
            |_| {
                let net = UNet::new(&UNetConfig::tiny()).unwrap();
                let found = Model::<f32, _>::read_tensors(net, &path).unwrap().params;
                assert!(found == old.params || found == new.params);
                old.write_tensors(&path).unwrap();
            },
        );
        assert!(n >= 6);
    }
}
