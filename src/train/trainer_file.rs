//! The state of a [`Trainer`] on disk: tensors, velocity, settings and progress in one file, from which it resumes to
//! the same bits.
//!
//! A file is safetensors: parameters and running statistics by their names in the layout, `velocity:{name}` of each
//! parameter, and the metadata entry `deepmill_training`: settings and progress as JSON, with the SHA-256 of both and
//! of the tensors.

use super::Trainer;
use super::trainer::State;
use crate::model::weights::tensors::TensorFile;
use crate::model::weights::{VELOCITY, from_tensors, to_tensors, velocity_layout};
use crate::model::{Model, Network};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name of the metadata entry.
const METADATA_KEY: &str = "deepmill_training";
const REMEDY: &str = "use an earlier file of this training, or start it anew";

/// The metadata entry.
#[derive(Serialize, Deserialize)]
struct Entry {
    state: State,
    sha256: String,
}

impl<N: Network<f32>> Trainer<N> {
    /// Writes everything that training changes to `path`, with the settings, as a whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written, or its bytes do not fit into the memory.
    pub fn write(&self, path: &Path) -> Result<()> {
        let Model { net, params, buffers, .. } = &self.model;
        let mut file = to_tensors(net.layout(), params, buffers);
        let velocity = to_tensors(&velocity_layout(net.layout())?, &self.velocity, &[]);
        file.tensors.extend(velocity.tensors);
        let failed = |e: serde_json::Error| Error::write(path, std::io::Error::other(e));
        let state = serde_json::to_string(&self.state).map_err(failed)?;
        let entry = Entry { state: self.state.clone(), sha256: hash(&file, &state) };
        file.metadata.insert(METADATA_KEY.into(), serde_json::to_string(&entry).map_err(failed)?);
        file.write(path)
    }

    /// The trainer that [`Trainer::write`] has written, with its settings; `net` is the same network. Its further
    /// steps have the bits that they would have had without the interruption.
    ///
    /// # Errors
    /// If the file is missing, damaged, not one of a trainer, or of another network.
    pub fn resume(net: N, path: &Path) -> Result<Self> {
        let mut file = TensorFile::read(path)?;
        let bad = |found: String| Error::file(path, METADATA_KEY, found, REMEDY);
        let text = file.metadata.get(METADATA_KEY);
        let text = text.ok_or_else(|| bad("it is not in the metadata".into()))?;
        let Entry { state, sha256 } = serde_json::from_str(text).map_err(|e| bad(e.to_string()))?;
        let written = serde_json::to_string(&state).map_err(|e| bad(e.to_string()))?;
        if hash(&file, &written) != sha256 {
            return Err(Error::file(path, "content hash", "the file is damaged", REMEDY));
        }
        state.check().map_err(|e| bad(e.to_string()))?;
        let of_velocity = velocity_layout(net.layout())?;
        let tensors = std::mem::take(&mut file.tensors);
        let (velocity, tensors) =
            tensors.into_iter().partition(|(name, _)| name.starts_with(VELOCITY));
        let of = |tensors| TensorFile { tensors, ..TensorFile::default() };
        let (params, buffers) = from_tensors(net.layout(), &of(tensors), path)?;
        let (velocity, _) = from_tensors(&of_velocity, &of(velocity), path)?;
        Ok(Trainer::of(Model::of(net, params, buffers), velocity, state))
    }
}

fn hash(file: &TensorFile, state: &str) -> String {
    let mut hasher = hmac_sha256::Hash::new();
    let mut add = |part: &[u8]| {
        hasher.update((part.len() as u64).to_le_bytes());
        hasher.update(part);
    };
    add(state.as_bytes());
    for (name, tensor) in &file.tensors {
        let (dtype, bytes) = tensor.bytes();
        add(name.as_bytes());
        add(format!("{dtype:?} {:?}", tensor.shape).as_bytes());
        add(&bytes);
    }
    hasher.finalize().iter().map(|b| format!("{b:02x}")).collect()
}
