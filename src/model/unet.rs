//! The U-Net on an octree: stem, encoder, decoder with cutter features, two heads at the points.

use super::batch::Batch;
use super::config::UNetConfig;
use super::cutter_modules::CutterModule;
use super::heads::Head;
use crate::Result;
use crate::nn::batch_norm::BatchNorm;
use crate::nn::blocks::Blocks;
use crate::nn::concat::Part;
use crate::nn::conv::OctreeConv;
use crate::nn::conv_transpose::OctreeUp;
use crate::nn::downsample::Downsample;
use crate::nn::joined::Joined;
use crate::nn::params::Layout;
use crate::nn::residual::Scratch;
use crate::nn::unit::Unit;
use crate::octree::{KernelMap, Level, Octree};
use crate::scalar::Scalar;

/// Heads of the network: inaccessible (class 0 = inaccessible), occlusion (class 1 = occlusion point).
pub const N_HEADS: usize = 2;

/// Description of a network; its numbers live in the two vectors that [`UNet::layout`] describes.
#[derive(Debug, Clone)]
pub struct UNet {
    pub(super) config: UNetConfig,
    pub(super) layout: Layout,
    pub(super) stem: Unit<OctreeConv>,
    pub(super) encoder: Vec<EncoderStage>,
    pub(super) cutters: Vec<CutterModule>,
    pub(super) decoder: Vec<DecoderStage>,
    pub(super) heads: [Head; N_HEADS],
}

#[derive(Debug, Clone)]
pub(super) struct EncoderStage {
    pub down: Downsample,
    pub blocks: Blocks,
}

#[derive(Debug, Clone)]
pub(super) struct DecoderStage {
    pub up: Unit<OctreeUp>,
    /// Columns of skip, cutter (if it sees one) and upsampled features.
    pub widths: Vec<usize>,
    /// Index of its cutter module.
    pub cutter: Option<usize>,
    pub blocks: Blocks,
}

/// Every intermediate result of one inference, by the reference's names; reusable.
#[derive(Debug, Clone, Default)]
pub struct Activations<T> {
    /// `conv1`: finest depth.
    pub stem: Vec<T>,
    /// `downsample.i`, from fine to coarse.
    pub downsampled: Vec<Vec<T>>,
    /// `encoder.i`.
    pub encoded: Vec<Vec<T>>,
    /// `fc_module_{i+1}`: features of each cutter module, `[n_shapes, width]`.
    pub cutters: Vec<Vec<T>>,
    /// `upsample.i`, from coarse to fine.
    pub upsampled: Vec<Vec<T>>,
    /// `decoder.i`.
    pub decoded: Vec<Vec<T>>,
    /// `interp`: what the heads read at the points.
    pub points: Vec<T>,
    /// Logits of both heads, `[n_points, 2]` each.
    pub logits: [Vec<T>; N_HEADS],
    hidden: Vec<T>,
    scratch: Scratch<T>,
}

impl UNet {
    /// Checks the configuration and lays out all parameters.
    ///
    /// # Errors
    /// If a number of the configuration is outside its domain.
    pub fn new(config: &UNetConfig) -> Result<Self> {
        config.check()?;
        let mut layout = Layout::default();
        let c_in = config.input.node_features()?.n_channels();
        let stem = Unit {
            map: OctreeConv::new(&mut layout, "conv1.conv", c_in, config.stem_width),
            norm: BatchNorm::new(&mut layout, "conv1.bn", config.stem_width),
            relu: true,
        };
        let encoder = encoder(config, &mut layout);
        let mut seeing = cutter_stages(config);
        seeing.truncate(if config.cutter.shared { 1 } else { seeing.len() });
        let module = |stage: &usize| {
            CutterModule::new(&mut layout, &format!("fc_module_{}", stage + 1), &config.cutter)
        };
        let cutters = seeing.iter().map(module).collect();
        let decoder = decoder(config, &mut layout);
        let normal = if config.input.point_normals { 3 } else { 0 };
        let c = config.decoder_widths[config.decoder_widths.len() - 1] + normal;
        let heads =
            ["header", "header_2"].map(|name| Head::new(&mut layout, name, c, config.head_width));
        Ok(UNet { config: config.clone(), layout, stem, encoder, cutters, decoder, heads })
    }

    /// The configuration it was built with.
    pub fn config(&self) -> &UNetConfig {
        &self.config
    }

    /// Names, shapes and places of all parameters and running statistics.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Inference: fills every field of `to`; logits of a shape do not depend on the rest of the batch.
    pub fn forward<T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        batch: &Batch<T>,
        to: &mut Activations<T>,
    ) {
        self.encode(params, buffers, batch, to);
        to.cutters.resize_with(self.cutters.len(), Vec::new);
        for (module, y) in self.cutters.iter().zip(&mut to.cutters) {
            module.forward(params, buffers, &batch.cutters, y);
        }
        self.decode(params, buffers, batch, to);
        let Activations { points, logits, hidden, .. } = to;
        for (head, logits) in self.heads.iter().zip(logits) {
            head.forward(params, buffers, points, logits, hidden);
        }
    }

    fn encode<T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        batch: &Batch<T>,
        to: &mut Activations<T>,
    ) {
        let (octree, n) = (&batch.octree, self.encoder.len());
        let Activations { stem, downsampled, encoded, scratch, .. } = to;
        self.stem.forward(
            params,
            buffers,
            conv_rows(octree, octree.depth()),
            &batch.features,
            stem,
        );
        downsampled.resize_with(n, Vec::new);
        encoded.resize_with(n, Vec::new);
        for (i, stage) in self.encoder.iter().enumerate() {
            let depth = octree.depth() - 1 - i;
            let (before, after) = encoded.split_at_mut(i);
            let x = before.last().unwrap_or(stem);
            stage.down.forward(params, buffers, down_rows(octree, depth), x, &mut downsampled[i]);
            let (rows, x) = (conv_rows(octree, depth), &downsampled[i]);
            stage.blocks.forward(params, buffers, rows, x, &mut after[0], scratch);
        }
    }

    fn decode<T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        batch: &Batch<T>,
        to: &mut Activations<T>,
    ) {
        let (octree, n) = (&batch.octree, self.decoder.len());
        let Activations { stem, encoded, cutters, upsampled, decoded, scratch, .. } = to;
        upsampled.resize_with(n, Vec::new);
        decoded.resize_with(n, Vec::new);
        for (i, stage) in self.decoder.iter().enumerate() {
            let depth = self.decoder_depth(octree, i);
            let (before, after) = decoded.split_at_mut(i);
            let x = before.last().unwrap_or(&encoded[n - 1]);
            stage.up.forward(params, buffers, up_rows(octree, depth), x, &mut upsampled[i]);
            let skip = if i + 1 < n { &encoded[n - 2 - i] } else { &*stem };
            let cutter = stage.cutter.map(|m| &cutters[m][..]);
            let parts = stage.parts(skip, cutter, &upsampled[i]);
            let (rows, x) = (conv_rows(octree, depth), stage.join(octree, depth, &parts));
            stage.blocks.forward(params, buffers, rows, x, &mut after[0], scratch);
        }
        batch.point_features(self.point_width(), &decoded[n - 1], &mut to.points);
    }

    /// Columns of the octree features that are interpolated to the points.
    pub fn point_width(&self) -> usize {
        self.config.decoder_widths[self.config.decoder_widths.len() - 1]
    }

    /// Depth at which decoder stage `i` works.
    pub(super) fn decoder_depth(&self, octree: &Octree, i: usize) -> usize {
        octree.depth() + 1 + i - self.decoder.len()
    }
}

impl DecoderStage {
    /// Skip, cutter (if the stage sees one) and upsampled features.
    pub fn parts<'a, T>(
        &self,
        skip: &'a [T],
        cutter: Option<&'a [T]>,
        upsampled: &'a [T],
    ) -> Vec<Part<'a, T>> {
        let cutter = cutter.map(Part::Shapes);
        std::iter::once(Part::Nodes(skip)).chain(cutter).chain([Part::Nodes(upsampled)]).collect()
    }

    /// `[skip | cutter | upsampled]`: the one place where the cutter meets the shape.
    pub fn join<'a, T>(
        &'a self,
        octree: &'a Octree,
        depth: usize,
        parts: &'a [Part<'a, T>],
    ) -> Joined<'a, T> {
        Joined { shapes: &octree.levels[depth].ranges, widths: &self.widths, parts }
    }
}

/// Rows of a 3³ convolution at `depth`.
pub(super) fn conv_rows(octree: &Octree, depth: usize) -> &KernelMap {
    &octree.levels[depth].conv
}

/// Rows of the strided convolution that ends at `depth`.
pub(super) fn down_rows(octree: &Octree, depth: usize) -> &Level {
    &octree.levels[depth]
}

/// Rows of the transposed convolution that ends at `depth`.
pub(super) fn up_rows(octree: &Octree, depth: usize) -> &Level {
    &octree.levels[depth - 1]
}

fn encoder(config: &UNetConfig, layout: &mut Layout) -> Vec<EncoderStage> {
    let mut c_in = config.stem_width;
    let mut stage = |(i, (&c, &n_blocks)): (usize, (&usize, &usize))| {
        let name = format!("downsample.{i}");
        let down = Downsample::new(layout, &name, c_in, c, config.normalise_empty_parents);
        c_in = c;
        EncoderStage { down, blocks: Blocks::new(layout, &format!("encoder.{i}"), n_blocks, c, c) }
    };
    let stages = config.encoder_widths.iter().zip(&config.encoder_blocks);
    stages.enumerate().map(&mut stage).collect()
}

fn decoder(config: &UNetConfig, layout: &mut Layout) -> Vec<DecoderStage> {
    let skips = std::iter::once(&config.stem_width).chain(&config.encoder_widths);
    let mut skips: Vec<usize> = skips.copied().collect();
    let mut c_in = skips.pop().unwrap_or_default();
    let seeing = cutter_stages(config);
    let mut stage = |(i, (&c, &n_blocks)): (usize, (&usize, &usize))| {
        let up = Unit {
            map: OctreeUp::new(layout, &format!("upsample.{i}.deconv"), c_in, c),
            norm: BatchNorm::new(layout, &format!("upsample.{i}.bn"), c),
            relu: true,
        };
        c_in = c;
        let shared = |m: usize| if config.cutter.shared { 0 } else { m };
        let cutter = seeing.iter().position(|&stage| stage == i).map(shared);
        let mut widths = vec![skips[skips.len() - 1 - i]];
        widths.extend(cutter.map(|_| config.cutter.width));
        widths.push(c);
        let name = format!("decoder.{i}");
        let blocks = Blocks::new(layout, &name, n_blocks, widths.iter().sum(), c);
        DecoderStage { up, widths, cutter, blocks }
    };
    let stages = config.decoder_widths.iter().zip(&config.decoder_blocks);
    stages.enumerate().map(&mut stage).collect()
}

/// Decoder stages that see the cutter.
fn cutter_stages(config: &UNetConfig) -> Vec<usize> {
    (0..config.decoder_widths.len()).filter(|&stage| config.sees_cutter(stage)).collect()
}
