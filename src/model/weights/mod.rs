//! Weight files: safetensors under the reference's state-dict names.
//!
//! A file holds every parameter and every running statistic. Files written here also say how to use them,
//! in the metadata entry `deepmill` ([`WeightsInfo`]). A file without it is taken for a checkpoint of the
//! reference: what does not follow from its shapes (depth, conventions, dropout) is the reference's.

mod infer;
mod own;
#[doc(hidden)] // checked by tests
pub mod tensors;

use super::Domain;
use super::heads::N_HEADS;
use super::network_config::NetworkConfig;
use super::predict::{AnyModel, Model};
use super::prediction::{Calibration, INACCESSIBLE_CLASS, OCCLUSION_CLASS};
use super::site_network::{AnyNetwork, SiteNetwork};
use crate::answers::Definition;
use crate::exec::memory;
use crate::nn::params::{Entry, Layout};
use crate::numeric::scalar::Scalar;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;
use tensors::{TensorFile, TensorValues, to_bf16};

pub(crate) use own::{VELOCITY, from_tensors, to_tensors, velocity_layout};

/// Name of our entry in a file's metadata.
const METADATA_KEY: &str = "deepmill";
/// Ending of the one integer in a state dict.
const BATCHES: &str = ".num_batches_tracked";

/// In which type learned numbers are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Storage {
    /// As the model holds them: reading gives the same bits.
    #[default]
    Exact,
    /// Parameters rounded to bf16, running statistics in f32: half the size.
    Bf16,
}

/// What a weight file says about itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[doc(hidden)] // of the program
#[non_exhaustive]
pub struct WeightsInfo {
    /// Configuration of the network.
    pub config: NetworkConfig,
    /// Class of head 1 that means "inaccessible".
    pub inaccessible_class: usize,
    /// Class of head 2 that means "occlusion point".
    pub occlusion_class: usize,
    /// Unit of lengths before normalization.
    pub unit: String,
    /// What the network was trained for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<Domain>,
    /// What its labels were about.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub definition: Option<Definition>,
    /// What is applied to the logits of each head; nothing if it is not there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<[Calibration; N_HEADS]>,
    /// Older files: what the logits of each head are divided by. Never written.
    #[serde(default, skip_serializing)]
    pub temperature: Option<[f64; N_HEADS]>,
    /// Free text: data, commands, scores.
    #[serde(default)]
    pub notes: String,
}

impl WeightsInfo {
    /// A file with this network, its label classes as everywhere in this crate.
    pub fn new(config: NetworkConfig, notes: &str) -> Self {
        WeightsInfo {
            config,
            inaccessible_class: INACCESSIBLE_CLASS,
            occlusion_class: OCCLUSION_CLASS,
            unit: "mm".into(),
            domain: None,
            definition: None,
            calibration: None,
            temperature: None,
            notes: notes.into(),
        }
    }
}

/// Reads a model, ours or a checkpoint of the reference.
///
/// # Errors
/// If the file cannot be read or is not safetensors; if a tensor is missing, extra, of another shape than
/// the configuration demands, or holds a number that is not finite: the first such tensor is named.
pub fn read<T: Scalar>(path: &Path) -> Result<AnyModel<T>> {
    from_file(&TensorFile::read(path)?, path)
}

/// Like [`read`], from a file's content; `origin` is named in errors.
///
/// # Errors
/// As [`read`].
pub fn from_bytes<T: Scalar>(bytes: &[u8], origin: &Path) -> Result<AnyModel<T>> {
    from_file(&TensorFile::from_bytes(bytes, origin)?, origin)
}

/// Writes a model; `notes` go into the metadata.
///
/// # Errors
/// If the file cannot be written, a calibration is not sound, or what is written does not fit into the memory.
pub fn write<T: Scalar, N: SiteNetwork<T>>(
    path: &Path,
    model: &Model<T, N>,
    storage: Storage,
    notes: &str,
) -> Result<()> {
    model.calibration.iter().try_for_each(Calibration::check)?;
    let bytes_of_number = if storage == Storage::Bf16 { 2 } else { size_of::<T>() };
    let needed = memory::product([model.params.len() + model.buffers.len(), bytes_of_number]);
    memory::require_for(path, "writing the network", needed)?;
    to_file(model, storage, notes).write(path)
}

/// The content of the file that [`fn@write`] writes.
pub fn to_bytes<T: Scalar, N: SiteNetwork<T>>(
    model: &Model<T, N>,
    storage: Storage,
    notes: &str,
) -> Vec<u8> {
    to_file(model, storage, notes).to_bytes()
}

/// The metadata of a file, `None` if it was not written by this crate.
///
/// # Errors
/// If the entry is there but cannot be understood, or says that classes mean something else.
#[doc(hidden)] // of the program
pub fn info(file: &TensorFile, origin: &Path) -> Result<Option<WeightsInfo>> {
    let Some(text) = file.metadata.get(METADATA_KEY) else { return Ok(None) };
    let error = |found: String| {
        Error::file(
            origin,
            "metadata entry deepmill",
            found,
            "use a file of this version of deepmill",
        )
    };
    let mut info: WeightsInfo = serde_json::from_str(text).map_err(|e| error(e.to_string()))?;
    if (info.inaccessible_class, info.occlusion_class) != (INACCESSIBLE_CLASS, OCCLUSION_CLASS) {
        return Err(error(
            "its classes mean something else than 0 = inaccessible, 1 = occlusion".into(),
        ));
    }
    let of_temperature = |t: f64| Calibration { slope: 1.0 / t, offset: 0.0 };
    info.calibration = info.calibration.or(info.temperature.take().map(|t| t.map(of_temperature)));
    if let Some(c) = info.calibration.filter(|c| !c.iter().all(Calibration::is_sound)) {
        return Err(error(format!("calibration {c:?}, expected positive slopes, finite numbers")));
    }
    Ok(Some(info))
}

pub(super) fn from_file<T: Scalar>(file: &TensorFile, origin: &Path) -> Result<AnyModel<T>> {
    let info = match info(file, origin)? {
        Some(info) => info,
        None => WeightsInfo::new(infer::config(file, origin)?.into(), ""),
    };
    let net = AnyNetwork::new(&info.config)?;
    let layout = net.layout();
    let (params, buffers) = from_tensors(layout, file, origin)?;
    let WeightsInfo { domain, definition, calibration, .. } = info;
    let calibration = calibration.unwrap_or([Calibration::IDENTITY; N_HEADS]);
    Ok(Model { domain, definition, calibration, ..Model::of(net, params, buffers) })
}

/// All names and shapes, before anything is allocated.
fn compare_names(layout: &Layout, file: &TensorFile, origin: &Path) -> Result<()> {
    let entries = || layout.params.iter().chain(&layout.buffers);
    let error = |name: &str, found: String| {
        let remedy = "give the whole state dict of this network, nothing else";
        Err(Error::file(origin, format!("tensor {name}"), found, remedy))
    };
    for entry in entries() {
        match file.tensors.get(&entry.name) {
            None => return error(&entry.name, "it is missing".into()),
            Some(t) if t.shape != entry.shape => {
                let found = format!("its shape is {:?}, expected {:?}", t.shape, entry.shape);
                return error(&entry.name, found);
            }
            Some(_) => {}
        }
    }
    let known: BTreeSet<&str> = entries().map(|e| e.name.as_str()).collect();
    match file.tensors.keys().find(|name| !known.contains(name.as_str())) {
        Some(extra) => error(extra, "it is not part of the network".into()),
        None => Ok(()),
    }
}

/// All numbers, and those of the largest tensor in f64.
fn require_memory(layout: &Layout, bytes_of_number: usize, origin: &Path) -> Result<()> {
    let largest = layout.params.iter().map(|entry| entry.range.len()).max().unwrap_or(0);
    let numbers = memory::product([layout.n_params() + layout.n_buffers(), bytes_of_number]);
    let needed = numbers.saturating_add(memory::product([largest, size_of::<f64>()]));
    memory::require_for(origin, "the network", needed)
}

fn gather<T: Scalar>(entries: &[Entry], file: &TensorFile, origin: &Path) -> Result<Vec<T>> {
    let mut values = Vec::with_capacity(entries.last().map_or(0, |e| e.range.end));
    for entry in entries {
        let tensor = &file.tensors[&entry.name];
        values.extend(tensor.to_f64().into_iter().map(T::from_f64));
        if let Some(i) = values[entry.range.clone()].iter().position(|v| !v.is_finite()) {
            return Err(Error::NotFinite {
                place: format!("{}: tensor {}, element {i}", origin.display(), entry.name),
                found: values[entry.range.start + i].to_string(),
                remedy: "use an earlier checkpoint".into(),
            });
        }
    }
    Ok(values)
}

pub(super) fn to_file<T: Scalar, N: SiteNetwork<T>>(
    model: &Model<T, N>,
    storage: Storage,
    notes: &str,
) -> TensorFile {
    let mut file = TensorFile::default();
    let info = WeightsInfo {
        domain: model.domain,
        definition: model.definition,
        calibration: (model.calibration != [Calibration::IDENTITY; N_HEADS])
            .then_some(model.calibration),
        ..WeightsInfo::new(model.net.configuration(), notes)
    };
    let info = serde_json::to_string(&info).expect("a configuration has only plain fields");
    file.metadata.insert(METADATA_KEY.into(), info);
    let layout = model.net.layout();
    own::add(&mut file, &layout.params, &model.params, storage);
    own::add(&mut file, &layout.buffers, &model.buffers, Storage::Exact);
    file
}

fn store<T: Scalar>(name: &str, values: &[T], storage: Storage) -> TensorValues {
    let values = values.iter().map(|v| v.to_f64());
    if name.ends_with(BATCHES) && values.clone().all(|v| v.fract() == 0.0) {
        return TensorValues::I64(values.map(|v| v as i64).collect());
    }
    match storage {
        Storage::Bf16 => TensorValues::Bf16(values.map(|v| to_bf16(v as f32)).collect()),
        Storage::Exact if size_of::<T>() == size_of::<f64>() => TensorValues::F64(values.collect()),
        Storage::Exact => TensorValues::F32(values.map(|v| v as f32).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::UNetConfig;
    use crate::model::config::CutterPlacement;
    use crate::model::graph_sage::GraphSageConfig;

    fn origin() -> &'static Path {
        Path::new("w.safetensors")
    }

    /// A network small enough to write often, with recognizable numbers.
    fn model(change: impl Fn(&mut UNetConfig)) -> Model<f32> {
        let mut config = UNetConfig {
            input: super::super::config::InputConfig::reference(),
            stem_width: 3,
            encoder_widths: vec![4, 5, 6, 7],
            encoder_blocks: vec![1, 2, 1, 1],
            decoder_widths: vec![7, 6, 5, 3],
            decoder_blocks: vec![2, 1, 1, 1],
            head_width: 2,
            normalize_empty_parents: true,
            cutter: super::super::config::CutterConfig {
                width: 9,
                hidden_width: 8,
                ..Default::default()
            },
            attention: Default::default(),
            share_head: false,
        };
        change(&mut config);
        let mut model = Model::new(&config, 1).unwrap();
        model.buffers.iter_mut().enumerate().for_each(|(i, b)| *b = (i % 1000) as f32);
        model
    }

    #[test]
    fn a_model_survives_a_file_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.safetensors");
        let mut model = model(|c| c.input.depth = 7);
        let calibration =
            [(1.25, 0.1), (0.1, -2.0)].map(|(slope, offset)| Calibration { slope, offset });
        (model.definition, model.calibration) = (Some(Definition::Part), calibration);
        write(&path, &model, Storage::Exact, "made by a test").unwrap();
        let read = read::<f32>(&path).unwrap().into_octree().unwrap();
        assert_eq!(read.net.config(), model.net.config());
        assert_eq!((read.definition, read.calibration), (model.definition, model.calibration));
        assert_eq!((read.params, read.buffers), (model.params, model.buffers));
        let file = TensorFile::read(&path).unwrap();
        assert_eq!(info(&file, &path).unwrap().unwrap().notes, "made by a test");
    }

    #[test]
    fn a_graph_network_survives_a_file_bit_by_bit_and_is_no_octree_network() {
        let config =
            NetworkConfig::from(GraphSageConfig { widths: vec![5, 3], ..Default::default() });
        let model = AnyModel::<f32>::of_config(&config, 1).unwrap();
        let read = from_bytes::<f32>(&to_bytes(&model, Storage::Exact, ""), origin()).unwrap();
        assert_eq!(read.net.config(), config);
        assert_eq!((&read.params, &read.buffers), (&model.params, &model.buffers));
        let message = read.into_octree().unwrap_err().to_string();
        assert!(message.contains("a graph network"), "{message}");
    }

    #[test]
    fn bf16_storage_keeps_eight_bits() {
        let model = model(|_| ());
        let read = from_bytes::<f32>(&to_bytes(&model, Storage::Bf16, ""), origin()).unwrap();
        for (a, b) in model.params.iter().zip(&read.params) {
            assert!((a - b).abs() <= a.abs() / 256.0);
        }
        assert_eq!(model.buffers, read.buffers);
    }

    #[test]
    fn configuration_follows_from_the_shapes() {
        use CutterPlacement::{All, First, Last, None};
        for (placement, shared) in
            [(All, false), (All, true), (First, false), (Last, false), (None, false)]
        {
            let model = model(|c| {
                c.cutter.placement = placement;
                c.cutter.shared = shared;
                if placement == None {
                    c.cutter =
                        super::super::config::CutterConfig { placement, ..Default::default() };
                }
            });
            let mut file = to_file(&model, Storage::Exact, "");
            file.metadata.clear();
            let read = from_file::<f32>(&file, origin()).unwrap().into_octree().unwrap();
            assert_eq!(read.net.config(), model.net.config());
        }
        let mut file = to_file(&model(|c| c.input.features = "NDP".into()), Storage::Exact, "");
        file.metadata.clear();
        let read = from_file::<f32>(&file, origin()).unwrap().into_octree().unwrap();
        assert_eq!(read.net.config().input.features, "NDP");
    }

    #[test]
    fn missing_extra_misshaped_and_infinite_tensors_are_named() {
        let whole = to_file(&model(|_| ()), Storage::Exact, "");
        let message = |change: &dyn Fn(&mut TensorFile)| {
            let mut file = whole.clone();
            change(&mut file);
            let with_metadata = from_file::<f32>(&file, origin()).unwrap_err().to_string();
            file.metadata.clear();
            assert_eq!(from_file::<f32>(&file, origin()).unwrap_err().to_string(), with_metadata);
            with_metadata
        };
        let name = "encoder.1.resblks.1.conv3x3b.bn.running_var";
        let missing = message(&|f| drop(f.tensors.remove(name)));
        assert!(missing.contains(name) && missing.contains("missing"), "{missing}");
        let extra = message(&|f| {
            let tensor = f.tensors[name].clone();
            f.tensors.insert("extra.weight".into(), tensor);
        });
        assert!(extra.contains("extra.weight: it is not part"), "{extra}");
        let shape = message(&|f| f.tensors.get_mut(name).unwrap().shape = vec![1, 5]);
        assert!(shape.contains(name) && shape.contains("[1, 5], expected [5]"), "{shape}");
        let infinite = message(&|f| {
            f.tensors.get_mut("header.1.linear.bias").unwrap().values =
                TensorValues::F32(vec![0.0, f32::NAN]);
        });
        assert!(infinite.contains("header.1.linear.bias, element 1"), "{infinite}");
    }

    #[test]
    fn nonsense_metadata_and_foreign_files_are_refused() {
        let mut file = to_file(&model(|_| ()), Storage::Exact, "");
        file.metadata.insert(METADATA_KEY.into(), "{}".into());
        let message = from_file::<f32>(&file, origin()).unwrap_err().to_string();
        assert!(message.contains("metadata entry deepmill"), "{message}");
        let with = |added: &str| {
            let mut file = to_file(&model(|_| ()), Storage::Exact, "");
            let entry = file.metadata.get_mut(METADATA_KEY).unwrap();
            *entry = entry.replacen("{", &format!("{{{added},"), 1);
            from_file::<f32>(&file, origin())
        };
        let message = with("\"temperature\":[1.0,-2.0]").unwrap_err().to_string();
        assert!(message.contains("expected positive slopes, finite numbers"), "{message}");
        let older = with("\"temperature\":[1.0,0.5]").unwrap();
        assert_eq!(older.calibration.map(|c| (c.slope, c.offset)), [(1.0, 0.0), (2.0, 0.0)]);
        let empty = from_file::<f32>(&TensorFile::default(), origin()).unwrap_err().to_string();
        assert!(empty.contains("tensor conv1.conv.weights: it is missing"), "{empty}");
    }

    #[test]
    fn files_with_changed_bytes_are_read_or_refused() {
        use crate::numeric::rng::{Purpose, Stream};
        let whole = to_bytes(&model(|_| ()), Storage::Exact, "");
        let header = u64::from_le_bytes(whole[..8].try_into().unwrap()) as usize;
        let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
        let mut n_refused = 0;
        for _ in 0..300 {
            let mut bytes = whole.clone();
            for _ in 0..1 + stream.below(3) {
                let place = stream.below(header + 8);
                bytes[place] = stream.below(256) as u8;
            }
            n_refused += usize::from(from_bytes::<f32>(&bytes, origin()).is_err());
        }
        assert!(n_refused > 200, "{n_refused}");
    }
}
