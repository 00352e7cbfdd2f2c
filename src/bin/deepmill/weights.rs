//! `deepmill weights`: prints what a weight file says about itself, and writes copies in bf16.

use crate::model_args::SHIPPED;
use crate::output::Output;
use deepmill::answers::Definition;
use deepmill::data::dataset::Dataset;
use deepmill::model::AnyModel;
use deepmill::model::weights::tensors::TensorFile;
use deepmill::model::weights::{self, Storage, WeightsInfo};
use deepmill::train::calibration;
use deepmill::{Error, Result, atomic_file};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Show what a network is, or store it in bf16.
#[derive(clap::Args)]
#[command(
    after_help = "Example: deepmill weights run/best.safetensors --bf16 small.safetensors --notes card.md"
)]
pub struct Args {
    /// Network: a safetensors file. Without it: the network that comes with deepmill.
    #[arg(required = cfg!(not(feature = "weights")))]
    model: Option<PathBuf>,
    /// Write a copy with parameters rounded to bf16 (half the size) to this file.
    #[arg(long, value_name = "FILE")]
    bf16: Option<PathBuf>,
    /// Fit slope and offset of the copy's logits on these data sets, made for validation by `deepmill dataset build`:
    /// its probabilities become frequencies.
    #[arg(long, value_name = "DIR", num_args = 1.., requires = "bf16")]
    calibrate: Vec<PathBuf>,
    /// What the labels were about that the network learned from, where its file does not say: sites or part.
    #[arg(long, value_name = "WHAT", requires = "bf16")]
    obstacles: Option<Learned>,
    /// Text to store in the copy: data, commands, scores. Without it the notes of the original are kept.
    #[arg(long, value_name = "FILE", requires = "bf16")]
    notes: Option<PathBuf>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Learned {
    Sites,
    Part,
}

#[cfg(feature = "weights")]
fn shipped() -> Result<(AnyModel<f32>, Option<WeightsInfo>)> {
    let (bytes, origin) = (deepmill::model::Model::shipped_file(), Path::new(SHIPPED));
    let info = weights::info(&TensorFile::from_bytes(&bytes, origin)?, origin)?;
    Ok((weights::from_bytes(&bytes, origin)?, info))
}

#[cfg(not(feature = "weights"))]
fn shipped() -> Result<(AnyModel<f32>, Option<WeightsInfo>)> {
    Err(deepmill::Error::argument("MODEL", "missing", "a safetensors file", "name one"))
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    args.bf16.iter().try_for_each(|path| atomic_file::check_writable_file(path))?;
    let (mut model, info) = match &args.model {
        Some(path) => (weights::read(path)?, weights::info(&TensorFile::read(path)?, path)?),
        None => shipped()?,
    };
    let mut notes = info.map_or_else(String::new, |info| info.notes);
    let n = model.params.len();
    output.say(format!("{n} parameters, {} running statistics", model.buffers.len()));
    let config = serde_json::to_value(model.net.config()).map_err(|e| {
        let path = args.model.as_deref().unwrap_or(Path::new(SHIPPED));
        Error::file(path, "configuration", e.to_string(), "report this file")
    })?;
    output.say(format!("{config:#}"));
    output.say(&notes);
    if let Some(path) = &args.notes {
        notes = std::fs::read_to_string(path).map_err(|e| Error::read(path, e))?;
    }
    if let Some(learned) = args.obstacles {
        let definition = match learned {
            Learned::Sites => Definition::Sites,
            Learned::Part => Definition::Part,
        };
        model.definition.get_or_insert(definition);
    }
    if !args.calibrate.is_empty() {
        let mut samples = Vec::new();
        for folder in &args.calibrate {
            samples.extend(Dataset::open(folder)?.samples(None)?);
        }
        calibration::fit(&mut model, &samples)?;
    }
    for (head, c) in ["inaccessible", "occlusion"].into_iter().zip(model.calibration) {
        output.say(format!("calibration of {head}: slope {:.4}, offset {:.4}", c.slope, c.offset));
    }
    if let Some(definition) = model.definition {
        output.say(format!("learned from labels of: {definition}"));
    }
    let mut files = Vec::new();
    if let Some(path) = &args.bf16 {
        weights::write(path, &model, Storage::Bf16, &notes)?;
        files.push(path.clone());
        output.files(&files);
    }
    let result = json!({
        "n_parameters": n,
        "config": config,
        "calibration": model.calibration,
        "definition": model.definition,
        "domain": model.domain,
        "notes": notes,
    });
    output.result_with_files(result, &files);
    Ok(())
}
