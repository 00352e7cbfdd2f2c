//! The network equals the reference implementation, tensor by tensor.
#![cfg(feature = "formats")]

use deepmill::model::weights::{self, tensors::TensorFile};
use deepmill::parity;
use std::fs;
use std::path::{Path, PathBuf};

fn fixture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/parity")
}

/// Made by `tests/make_fixture.py` from the published `ocnn` and `torch` packages.
#[test]
fn every_recorded_tensor_is_reproduced() {
    let outcome = parity::run(&fixture()).unwrap();
    let missed: Vec<_> = outcome.rows.iter().filter(|row| !row.passed()).collect();
    assert!(missed.is_empty(), "{missed:?}");
    for name in ["octree.d5.neigh", "eval.decoder.3", "f64.grad.conv1.bn.bias", "ops.resblock.y"] {
        assert!(outcome.rows.iter().any(|row| row.name == name), "{name} was not compared");
    }
    assert_eq!(outcome.actual.tensors["grad.conv1.conv.weights"].shape, [27, 4, 4]);
}

/// A copy of the fixture with one file changed.
fn changed(file: &str, change: impl FnOnce(&mut TensorFile)) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(fixture()).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
    }
    let path = folder.path().join(file);
    let mut tensors = TensorFile::read(&path).unwrap();
    change(&mut tensors);
    tensors.write(&path).unwrap();
    folder
}

#[test]
fn a_changed_weight_is_noticed() {
    use deepmill::model::weights::tensors::TensorValues;
    let folder = changed("weights.safetensors", |file| {
        let weight = file.tensors.get_mut("upsample.1.deconv.weights").unwrap();
        let TensorValues::F32(values) = &mut weight.values else { panic!("weights are f32") };
        values[7] *= 1.01;
    });
    let outcome = parity::run(folder.path()).unwrap();
    let missed: Vec<_> = outcome.rows.iter().filter(|row| !row.passed()).collect();
    assert!(missed.iter().any(|row| row.name == "eval.upsample.1"));
    assert!(missed.iter().all(|row| row.name != "eval.encoder.3"));
}

#[test]
fn a_fixture_without_training_tensors_or_operations_is_enough() {
    let folder = changed("expected.safetensors", |file| {
        file.tensors.retain(|name, _| name.starts_with("octree") || name.starts_with("eval"));
    });
    fs::remove_file(folder.path().join("ops.safetensors")).unwrap();
    let outcome = parity::run(folder.path()).unwrap();
    assert!(outcome.passed() && outcome.rows.len() > 40);
}

#[test]
fn a_missing_or_unknown_tensor_is_named() {
    let folder = changed("input.safetensors", |file| drop(file.tensors.remove("cutter")));
    let message = parity::run(folder.path()).unwrap_err().to_string();
    assert!(message.contains("input.safetensors: tensor cutter: it is missing"), "{message}");
    let folder = changed("expected.safetensors", |file| {
        let tensor = file.tensors["eval.conv1"].clone();
        file.tensors.insert("eval.conv9".into(), tensor);
    });
    let message = parity::run(folder.path()).unwrap_err().to_string();
    assert!(message.contains("tensor eval.conv9"), "{message}");
}

#[test]
fn a_checkpoint_of_the_reference_loads_and_comes_back_unchanged() {
    let path = fixture().join("weights.safetensors");
    let model = weights::read::<f32>(&path).unwrap().into_octree().unwrap();
    let config = model.net.config();
    assert_eq!(
        (config.encoder_widths[3], config.decoder_blocks[3], config.cutter.width),
        (10, 2, 6)
    );
    let bytes = weights::to_bytes(&model, weights::Storage::Exact, "");
    let copy = TensorFile::from_bytes(&bytes, &path).unwrap();
    assert_eq!(copy.tensors, TensorFile::read(&path).unwrap().tensors);
}
