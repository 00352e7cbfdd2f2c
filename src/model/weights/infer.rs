//! Infers a network's configuration from the tensor shapes of a state dict.

use super::tensors::TensorFile;
use crate::model::config::{
    AttentionConfig, CutterConfig, CutterPlacement, InputConfig, UNetConfig,
};
use crate::{Error, Result};
use std::path::Path;

/// The configuration that follows from the shapes; depth, conventions and dropout are the reference's.
pub(super) fn config(file: &TensorFile, origin: &Path) -> Result<UNetConfig> {
    let shapes = Shapes { file, origin };
    let stem = shapes.of("conv1.conv.weights", 3)?;
    let n = count(|i| shapes.has(&format!("downsample.{i}.conv.weights")));
    let encoder_widths = (0..n)
        .map(|i| Ok(shapes.of(&format!("downsample.{i}.conv.weights"), 3)?[2]))
        .collect::<Result<Vec<_>>>()?;
    let decoder_widths = (0..n)
        .map(|i| Ok(shapes.of(&format!("upsample.{i}.deconv.weights"), 3)?[1]))
        .collect::<Result<Vec<_>>>()?;
    let mut config = UNetConfig {
        input: InputConfig {
            features: features(stem[1]).into(),
            depth: InputConfig::reference().depth.max(n),
            ..InputConfig::reference()
        },
        stem_width: stem[2],
        encoder_blocks: (0..n).map(|i| shapes.blocks("encoder", i)).collect(),
        decoder_blocks: (0..n).map(|i| shapes.blocks("decoder", i)).collect(),
        encoder_widths,
        decoder_widths,
        head_width: shapes.of("header.0.conv.linear.weight", 2)?[0],
        normalize_empty_parents: true,
        cutter: CutterConfig::default(),
        // The reference has neither.
        attention: AttentionConfig::default(),
        share_head: false,
    };
    config.cutter = shapes.cutter(&config)?;
    Ok(config)
}

struct Shapes<'a> {
    file: &'a TensorFile,
    origin: &'a Path,
}

impl Shapes<'_> {
    fn has(&self, name: &str) -> bool {
        self.file.tensors.contains_key(name)
    }

    fn of(&self, name: &str, rank: usize) -> Result<&[usize]> {
        let error = |found: String| {
            let remedy = "give the whole state dict of an octree U-Net";
            Err(Error::file(self.origin, format!("tensor {name}"), found, remedy))
        };
        match self.file.tensors.get(name) {
            None => error("it is missing".into()),
            Some(t) if t.shape.len() != rank => {
                error(format!("its shape is {:?}, not one of {rank} numbers", t.shape))
            }
            Some(t) => Ok(&t.shape),
        }
    }

    fn blocks(&self, part: &str, stage: usize) -> usize {
        count(|j| self.has(&format!("{part}.{stage}.resblks.{j}.conv3x3a.conv.weights")))
    }

    /// Modules and the stages whose first convolution is wide enough for cutter features.
    fn cutter(&self, config: &UNetConfig) -> Result<CutterConfig> {
        let n = config.decoder_widths.len();
        let modules: Vec<usize> =
            (0..n).filter(|i| self.has(&format!("fc_module_{}.0.weight", i + 1))).collect();
        let Some(first) = modules.first() else {
            let placement = CutterPlacement::None;
            return Ok(CutterConfig { placement, ..CutterConfig::default() });
        };
        let sees = |stage: usize| {
            let name = format!("decoder.{stage}.resblks.0.conv3x3a.conv.weights");
            let skip = if stage + 1 < n {
                config.encoder_widths[n - 2 - stage]
            } else {
                config.stem_width
            };
            Ok::<_, Error>(self.of(&name, 3)?[1] > skip + config.decoder_widths[stage])
        };
        let (sees_first, sees_last) = (sees(0)?, sees(n - 1)?);
        let placement = match (sees_first, sees_last) {
            (true, false) => CutterPlacement::First,
            (false, true) => CutterPlacement::Last,
            _ => CutterPlacement::All,
        };
        Ok(CutterConfig {
            placement,
            shared: placement == CutterPlacement::All && n > 1 && modules.len() == 1,
            hidden_width: self.of(&format!("fc_module_{}.0.weight", first + 1), 2)?[0],
            width: self.of(&format!("fc_module_{}.4.weight", first + 1), 2)?[0],
            batch_norm: self.has(&format!("fc_module_{}.2.weight", first + 1)),
            ..CutterConfig::default()
        })
    }
}

fn features(n_channels: usize) -> &'static str {
    match n_channels {
        1 => "D",
        3 => "N",
        6 => "NP",
        7 => "NDP",
        _ => "ND",
    }
}

fn count(exists: impl Fn(usize) -> bool) -> usize {
    (0..).take_while(|&i| exists(i)).count()
}
