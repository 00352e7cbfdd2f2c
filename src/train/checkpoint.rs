//! Checkpoints: the complete state of a training run on disk, from which it resumes to the same bits.
//!
//! A checkpoint is a safetensors file with the flat vectors `params`, `buffers` and `velocity` (f32). Its
//! metadata hold the settings and the progress as JSON, and the SHA-256 of both and of the vectors.

use super::{Progress, Settings};
use crate::exec::memory;
use crate::storage::{atomic_file, input_file};
use crate::{Error, Result};
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde::de::DeserializeOwned;
use std::collections::HashMap;
use std::path::Path;

const REMEDY: &str = "use the previous checkpoint, or start the run anew";

/// Everything that changes while a run goes on.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Checkpoint {
    /// How the run was set up.
    pub settings: Settings,
    /// How far it has come.
    pub progress: Progress,
    /// Parameters of the network.
    pub params: Vec<f32>,
    /// Running statistics of the network.
    pub buffers: Vec<f32>,
    /// Velocity of the optimizer, as long as `params`.
    pub velocity: Vec<f32>,
}

impl Checkpoint {
    /// Writes the checkpoint to `path`, as a whole or not at all.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let failed = |e: String| Error::write(path, std::io::Error::other(e));
        let json = |r: serde_json::Result<String>| r.map_err(|e| failed(e.to_string()));
        let settings = json(serde_json::to_string(&self.settings))?;
        let progress = json(serde_json::to_string(&self.progress))?;
        let vectors = [&self.params, &self.buffers, &self.velocity].map(|v| to_bytes(v));
        let hash = hash(&settings, &progress, &vectors);
        let metadata = HashMap::from([
            ("settings".to_owned(), settings),
            ("progress".to_owned(), progress),
            ("sha256".to_owned(), hash),
        ]);
        let mut views = Vec::new();
        for (name, bytes) in NAMES.iter().zip(&vectors) {
            let view = TensorView::new(Dtype::F32, vec![bytes.len() / 4], bytes);
            views.push((*name, view.map_err(|e| failed(e.to_string()))?));
        }
        let bytes = serialize(views, Some(metadata)).map_err(|e| failed(e.to_string()))?;
        atomic_file::write_atomic(path, |file| file.write_all(&bytes))
    }

    /// Reads a checkpoint and verifies its hash.
    ///
    /// # Errors
    /// If the file is missing, damaged or not a checkpoint; the message advises the previous one.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = input_file::read(path, input_file::DATA)?;
        let bad = |place: &str, e: String| Error::file(path, place, e, REMEDY);
        let (_, header) =
            SafeTensors::read_metadata(&bytes).map_err(|e| bad("header", e.to_string()))?;
        let tensors = SafeTensors::deserialize(&bytes).map_err(|e| bad("header", e.to_string()))?;
        let empty = HashMap::new();
        let metadata = header.metadata().as_ref().unwrap_or(&empty);
        let text = |name: &str| {
            metadata.get(name).ok_or_else(|| bad(name, "it is not in the metadata".into()))
        };
        let mut vectors: [&[u8]; 3] = [&[]; 3];
        for (name, bytes) in NAMES.iter().zip(&mut vectors) {
            let tensor = tensors.tensor(name).map_err(|e| bad(name, e.to_string()))?;
            if tensor.dtype() != Dtype::F32 {
                return Err(bad(name, format!("type {:?}, expected F32", tensor.dtype())));
            }
            *bytes = tensor.data();
        }
        let (settings, progress) = (text("settings")?, text("progress")?);
        let found = hash(settings, progress, &vectors);
        if &found != text("sha256")? {
            return Err(bad("content hash", "the file is damaged".into()));
        }
        memory::require_for(path, "reading the checkpoint", bytes.len() as u64)?;
        let [params, buffers, velocity] = vectors.map(from_bytes);
        let settings = parse(settings).map_err(|e| bad("settings", e))?;
        let progress = parse(progress).map_err(|e| bad("progress", e))?;
        Ok(Checkpoint { settings, progress, params, buffers, velocity })
    }
}

const NAMES: [&str; 3] = ["params", "buffers", "velocity"];

fn parse<T: DeserializeOwned>(text: &str) -> std::result::Result<T, String> {
    serde_json::from_str(text).map_err(|e| e.to_string())
}

fn to_bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn from_bytes(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

fn hash(settings: &str, progress: &str, vectors: &[impl AsRef<[u8]>; 3]) -> String {
    let mut hasher = hmac_sha256::Hash::new();
    for part in [settings.as_bytes(), progress.as_bytes()] {
        hasher.update((part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    for part in vectors {
        hasher.update((part.as_ref().len() as u64).to_le_bytes());
        hasher.update(part.as_ref());
    }
    hasher.finalize().iter().map(|b| format!("{b:02x}")).collect()
}
