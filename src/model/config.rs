//! Configuration of a network: depths, widths, blocks, cutter modules, attention.

mod input;
mod with;

#[doc(hidden)] // of the networks here, and for the reference's weights
pub use input::{Cube, N_COARSE};
pub use input::{CutterInput, InputConfig};

use super::heads::N_HEADS;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Which decoder stages see the cutter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CutterPlacement {
    /// No stage: the shape is the only input.
    None,
    /// The coarsest stage only.
    First,
    /// The finest stage only.
    Last,
    /// Every stage: the reference's way.
    #[default]
    All,
}

/// The modules that turn four cutter lengths into features of the decoder.
///
/// ```
/// use deepmill::model::config::{CutterConfig, CutterPlacement};
/// let none = CutterConfig::default().with_placement(CutterPlacement::None);
/// assert_ne!(none, CutterConfig::default());
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct CutterConfig {
    /// Which decoder stages get cutter features.
    pub placement: CutterPlacement,
    /// One module for all stages instead of one each.
    pub shared: bool,
    /// Width of the hidden layer.
    pub hidden_width: usize,
    /// Width of the output.
    pub width: usize,
    /// Batch norm over the shapes of a batch after each of the two layers, as the reference has it. With
    /// few shapes its statistics in training (biased variance) and inference (unbiased) differ much:
    /// by a factor of 2 for two shapes.
    pub batch_norm: bool,
    /// Dropout probability after each of the two layers, in `[0, 1)`.
    pub dropout: f64,
}

impl Default for CutterConfig {
    /// The reference's: a module for each stage, 4 → 32 → 256, dropout 0.3.
    fn default() -> Self {
        CutterConfig {
            placement: CutterPlacement::All,
            shared: false,
            hidden_width: 32,
            width: 256,
            batch_norm: true,
            dropout: 0.3,
        }
    }
}

impl CutterConfig {
    /// For batches of a few shapes: neither batch norm nor dropout.
    pub fn small_batches() -> Self {
        CutterConfig { batch_norm: false, dropout: 0.0, ..CutterConfig::default() }
    }
}

/// Attention between all nodes of a shape, after the blocks of decoder stages.
///
/// ```
/// use deepmill::model::UNetConfig;
/// use deepmill::model::config::AttentionConfig;
/// let attention = AttentionConfig::default().with_depths(vec![3]).with_n_heads(2);
/// assert_eq!(UNetConfig::tiny().with_attention(attention).attention.depths, [3]);
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct AttentionConfig {
    /// Depths at which the decoder has it, of 2 to 4: its time grows with the square of the number of nodes. None by
    /// default.
    pub depths: Vec<usize>,
    /// Number of heads, which divides the width of each of these stages.
    pub n_heads: usize,
}

impl Default for AttentionConfig {
    fn default() -> Self {
        AttentionConfig { depths: Vec::new(), n_heads: 4 }
    }
}

impl AttentionConfig {
    fn is_default(&self) -> bool {
        *self == AttentionConfig::default()
    }
}

/// Configuration of a [`super::UNet`]; checked when the network is built.
///
/// There are as many decoder stages as encoder stages, and at most `depth` of each: stage `i` of the
/// encoder works at depth `depth - 1 - i`, stage `i` of the decoder climbs back up.
///
/// ```
/// use deepmill::model::{Model, UNetConfig};
/// let config = UNetConfig::tiny().with_head_width(16);
/// assert!(Model::<f32>::new(&config, 1)?.params.len() < Model::<f32>::new(&UNetConfig::small(), 1)?.params.len());
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct UNetConfig {
    /// Octree, normalization, cutter unit.
    #[serde(default)]
    pub input: InputConfig,
    /// Channels of the first convolution, at the finest depth.
    pub stem_width: usize,
    /// Channels of each encoder stage, from fine to coarse.
    pub encoder_widths: Vec<usize>,
    /// Residual blocks of each encoder stage, at least 1.
    pub encoder_blocks: Vec<usize>,
    /// Channels of each decoder stage, from coarse to fine.
    pub decoder_widths: Vec<usize>,
    /// Residual blocks of each decoder stage, at least 1.
    pub decoder_blocks: Vec<usize>,
    /// Hidden channels of each head.
    pub head_width: usize,
    /// Whether nodes without points take part in the batch norm after a strided convolution, with zero
    /// rows, as in the reference: see [`crate::nn::downsample::Downsample`].
    #[serde(default = "yes")]
    #[serde(rename = "normalise_empty_parents", alias = "normalize_empty_parents")]
    #[doc(hidden)] // for the reference's weights
    pub normalize_empty_parents: bool,
    /// Cutter modules.
    #[serde(default)]
    pub cutter: CutterConfig,
    /// Attention; none by default.
    #[serde(default, skip_serializing_if = "AttentionConfig::is_default")]
    pub attention: AttentionConfig,
    /// Whether a third head gives the share of the directions in which the cutter has a free pose at a site.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub share_head: bool,
}

impl UNetConfig {
    /// The published network, its input conventions included: 43,313,668 parameters.
    pub fn reference() -> Self {
        UNetConfig {
            input: InputConfig::reference(),
            stem_width: 32,
            encoder_widths: vec![32, 64, 128, 256],
            encoder_blocks: vec![2, 3, 4, 6],
            decoder_widths: vec![256, 128, 96, 96],
            decoder_blocks: vec![2; 4],
            head_width: 64,
            normalize_empty_parents: true,
            cutter: CutterConfig::default(),
            attention: AttentionConfig::default(),
            share_head: false,
        }
    }

    /// Number of heads: 2, or 3 with [`UNetConfig::share_head`].
    pub fn n_heads(&self) -> usize {
        N_HEADS + usize::from(self.share_head)
    }

    /// For training on a CPU in hours.
    pub fn small() -> Self {
        UNetConfig {
            input: InputConfig::default(),
            stem_width: 16,
            encoder_widths: vec![32, 48, 64, 96],
            encoder_blocks: vec![1, 1, 2, 2],
            decoder_widths: vec![64, 64, 48, 32],
            decoder_blocks: vec![1; 4],
            head_width: 32,
            normalize_empty_parents: true,
            cutter: CutterConfig { width: 32, ..CutterConfig::small_batches() },
            attention: AttentionConfig::default(),
            share_head: false,
        }
    }

    /// For demonstrations and tests: learns something within seconds.
    pub fn tiny() -> Self {
        UNetConfig {
            input: InputConfig { depth: 4, ..InputConfig::default() },
            stem_width: 16,
            encoder_widths: vec![16, 32, 48],
            encoder_blocks: vec![1; 3],
            decoder_widths: vec![32, 32, 16],
            decoder_blocks: vec![1; 3],
            head_width: 16,
            normalize_empty_parents: true,
            cutter: CutterConfig { width: 16, ..CutterConfig::small_batches() },
            attention: AttentionConfig::default(),
            share_head: false,
        }
    }

    /// The preset of this name: `reference`, `small` or `tiny`.
    ///
    /// # Errors
    /// If there is no such preset.
    pub fn preset(name: &str) -> Result<Self> {
        match name {
            "reference" => Ok(Self::reference()),
            "small" => Ok(Self::small()),
            "tiny" => Ok(Self::tiny()),
            _ => Err(Error::argument(
                "network preset",
                name,
                "reference, small or tiny",
                "choose one of them or give a configuration file",
            )),
        }
    }

    /// Whether the decoder stage sees the cutter.
    pub(super) fn sees_cutter(&self, stage: usize) -> bool {
        match self.cutter.placement {
            CutterPlacement::None => false,
            CutterPlacement::First => stage == 0,
            CutterPlacement::Last => stage + 1 == self.decoder_widths.len(),
            CutterPlacement::All => true,
        }
    }

    /// Every number in its domain and every list of the same length.
    pub(super) fn check(&self) -> Result<()> {
        self.input.node_features()?;
        let n = self.encoder_widths.len();
        require("octree depth", self.input.depth, 1..=10)?;
        require("number of coarse directions", self.input.coarse_directions, 0..=MAX_DIRECTIONS)?;
        if self.input.coarse_directions > 0 && self.input.cutter != CutterInput::Scaled {
            let (found, expected) = ("millimeters", "scaled with coarse_directions");
            let remedy = "change the network's configuration";
            return Err(Error::argument("unit of the cutter", found, expected, remedy));
        }
        require("octree full depth", self.input.full_depth, 0..=self.input.depth)?;
        require("number of encoder stages", n, 1..=self.input.depth)?;
        require("number of encoder block counts", self.encoder_blocks.len(), n..=n)?;
        require("number of decoder stages", self.decoder_widths.len(), n..=n)?;
        require("number of decoder block counts", self.decoder_blocks.len(), n..=n)?;
        let widths = self.encoder_widths.iter().chain(&self.decoder_widths);
        let cutter = [&self.cutter.hidden_width, &self.cutter.width];
        for &width in widths.chain([&self.stem_width, &self.head_width]).chain(cutter) {
            require("width", width, 1..=MAX_WIDTH)?;
        }
        for &blocks in self.encoder_blocks.iter().chain(&self.decoder_blocks) {
            require("number of residual blocks", blocks, 1..=MAX_BLOCKS)?;
        }
        for &depth in &self.attention.depths {
            let coarsest = self.input.depth + 1 - n;
            require("depth of attention", depth, coarsest.max(2)..=self.input.depth.min(4))?;
            let (width, n_heads) = (self.decoder_widths[depth - coarsest], self.attention.n_heads);
            require("heads of attention", n_heads, 1..=width)?;
            if !width.is_multiple_of(n_heads) {
                let expected = format!("a divisor of the stage's width, {width}");
                let remedy = "change the network's configuration";
                return Err(Error::argument("heads of attention", n_heads, expected, remedy));
            }
        }
        if !(0.0..1.0).contains(&self.cutter.dropout) {
            let found = self.cutter.dropout;
            return Err(Error::argument("dropout", found, "0 to below 1", "choose such a value"));
        }
        Ok(())
    }
}

fn yes() -> bool {
    true
}

pub(super) const MAX_WIDTH: usize = 1 << 12;
const MAX_BLOCKS: usize = 1 << 8;
const MAX_DIRECTIONS: usize = 10_000;

fn require(
    name: &'static str,
    value: usize,
    allowed: std::ops::RangeInclusive<usize>,
) -> Result<()> {
    if allowed.contains(&value) {
        return Ok(());
    }
    let (low, high) = (allowed.start(), allowed.end());
    let expected = if low == high { format!("{low}") } else { format!("{low} to {high}") };
    Err(Error::argument(name, value, expected, "change the network's configuration"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn configurations_outside_their_domain_are_refused_by_name() {
        let broken = |change: fn(&mut UNetConfig)| {
            let mut config = UNetConfig::tiny();
            config.check().unwrap();
            change(&mut config);
            config.check().unwrap_err().to_string()
        };
        assert!(broken(|c| c.stem_width = 0).starts_with("width is 0"));
        assert!(
            broken(|c| c.decoder_widths = vec![4]).starts_with("number of decoder stages is 1")
        );
        assert!(broken(|c| c.encoder_blocks[1] = 0).starts_with("number of residual blocks is 0"));
        assert!(broken(|c| c.input.depth = 2).starts_with("number of encoder stages is 3"));
        assert!(broken(|c| c.cutter.dropout = 1.0).starts_with("dropout is 1"));
        assert!(broken(|c| c.attention.depths = vec![5]).starts_with("depth of attention is 5"));
        assert!(
            broken(|c| c.attention = AttentionConfig { depths: vec![3], n_heads: 5 })
                .starts_with("heads of attention is 5")
        );
        assert!(broken(|c| c.input.features = "X".into()).contains("octree features"));
        assert!(UNetConfig::preset("huge").is_err());
    }

    #[cfg(feature = "formats")]
    #[test]
    fn both_spellings_of_field_names_are_read() {
        let config = serde_json::to_string(&UNetConfig::reference()).unwrap();
        let other = config.replace("normalise", "normalize").replace("millimetres", "millimeters");
        assert!(config != other && config.contains("millimetres"));
        for text in [config, other] {
            let read: UNetConfig = serde_json::from_str(&text).unwrap();
            assert_eq!(read, UNetConfig::reference());
        }
    }
}
