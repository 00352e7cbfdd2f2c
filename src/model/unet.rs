//! The U-Net on an octree: stem, encoder, decoder with cutter features, heads at the points.

use super::batch::Batch;
use super::config::UNetConfig;
use super::cutter_modules::{CutterModule, N_LENGTHS};
use super::heads::{Head, N_CLASSES};
use super::policy::MemoryPolicy;
use super::{cutter_modules, heads};
use crate::Result;
use crate::exec::memory::product;
use crate::nn::arena::Buffer;
use crate::nn::attention::Attention;
use crate::nn::batch_norm::BatchNorm;
use crate::nn::blocks::Blocks;
use crate::nn::conv::OctreeConv;
use crate::nn::deconv::OctreeDeconv;
use crate::nn::downsample::Downsample;
use crate::nn::interp::Interpolate;
use crate::nn::layer::Layer;
use crate::nn::linear_norm_act::LinearNormAct;
use crate::nn::operand::Operand;
use crate::nn::params::Layout;
use crate::nn::pass::Inference;
use crate::nn::pass_memory::PassMemory;
use crate::nn::strided_conv::OutputRows;
use crate::nn::{OperatorShape, attention, blocks};
use crate::numeric::scalar::Scalar;
use crate::octree::{KernelMap, Octree, OctreeLevel};

/// Description of a network; its numbers live in the two vectors that [`UNet::layout`] describes.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::model::{Batch, Model, Shape, UNet, UNetConfig};
/// use deepmill::nn::arena::Arena;
///
/// let config = UNetConfig::tiny();
/// let model = Model::<f32, _>::with_network(UNet::new(&config)?, 7); // seed of the weights
/// assert_eq!(model.params.len(), model.net.layout().n_params());
/// let points = [Vec3::ZERO, Vec3::X, Vec3::Y];
/// let shape = Shape::new(&points, &[Vec3::Z; 3], [1.5, 6.0, 40.0, 5.0]);
/// let logits = model.logits(&Batch::new(&[shape], &config.input)?, &Arena::default());
/// assert_eq!(logits.iter().map(|l| l.len()).collect::<Vec<_>>(), [3 * 2; 2]); // two heads of two classes
/// let error = UNet::new(&config.with_head_width(0)).unwrap_err().to_string();
/// assert!(error.starts_with("width is 0, expected 1 to 4096"), "{error}");
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct UNet {
    pub(super) config: UNetConfig,
    pub(super) layout: Layout,
    pub(super) stem: LinearNormAct<OctreeConv>,
    pub(super) encoder: Vec<EncoderStage>,
    pub(super) cutters: Vec<CutterModule>,
    pub(super) decoder: Vec<DecoderStage>,
    pub(super) heads: Vec<Head>,
}

#[derive(Debug, Clone)]
pub(super) struct EncoderStage {
    pub down: Downsample,
    pub blocks: Blocks,
}

#[derive(Debug, Clone)]
pub(super) struct DecoderStage {
    pub up: LinearNormAct<OctreeDeconv>,
    /// Columns of the skipping features.
    pub c_skip: usize,
    /// Columns of a cutter's features.
    pub c_cutter: usize,
    /// Index of its cutter module.
    pub cutter: Option<usize>,
    pub blocks: Blocks,
    /// Of what the blocks give.
    pub attention: Option<Attention>,
}

/// Every intermediate result of one inference, by the reference's names.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct Activations<T> {
    /// `conv1`: finest depth.
    pub stem: Buffer<T>,
    /// `downsample.i`, from fine to coarse.
    pub downsampled: Vec<Buffer<T>>,
    /// `encoder.i`.
    pub encoded: Vec<Buffer<T>>,
    /// `fc_module_{i+1}`: features of each cutter module, `[n_shapes, width]`.
    pub cutters: Vec<Buffer<T>>,
    /// `upsample.i`, from coarse to fine.
    pub upsampled: Vec<Buffer<T>>,
    /// `decoder.i`, after attention if there is any.
    pub decoded: Vec<Buffer<T>>,
    /// `interp`: octree features at the points.
    pub points: Buffer<T>,
    /// Logits of the heads, `[n_points, 2]` each.
    pub logits: Vec<Buffer<T>>,
}

impl UNet {
    /// Checks the configuration and lays out all parameters.
    ///
    /// # Errors
    /// If a number of the configuration is outside its domain.
    pub fn new(config: &UNetConfig) -> Result<Self> {
        Self::with_policy(config, &MemoryPolicy::default())
    }

    /// [`UNet::new`] with another choice of what training saves.
    ///
    /// # Errors
    /// As [`UNet::new`].
    #[doc(hidden)] // checked by tests
    pub fn with_policy(config: &UNetConfig, policy: &MemoryPolicy) -> Result<Self> {
        Self::build(config, policy, &vec![N_CLASSES; config.n_heads()])
    }

    /// With one head for each number of classes.
    pub(super) fn build(
        config: &UNetConfig,
        policy: &MemoryPolicy,
        n_classes: &[usize],
    ) -> Result<Self> {
        config.check()?;
        let mut layout = Layout::default();
        let c_in = config.input.n_node_channels()?;
        let stem = LinearNormAct {
            linear: OctreeConv::new(&mut layout, "conv1.conv", c_in, config.stem_width),
            norm: BatchNorm::new(&mut layout, "conv1.bn", config.stem_width),
            relu: true,
            policy: policy.stem,
        };
        let encoder = encoder(config, policy, &mut layout);
        let mut seeing = cutter_stages(config);
        seeing.truncate(if config.cutter.shared { 1 } else { seeing.len() });
        let module = |stage: &usize| {
            CutterModule::new(&mut layout, &format!("fc_module_{}", stage + 1), &config.cutter)
        };
        let cutters = seeing.iter().map(module).collect::<Result<_>>()?;
        let decoder = decoder(config, policy, &mut layout);
        let c_points = config.input.n_point_channels();
        let c = config.decoder_widths[config.decoder_widths.len() - 1] + c_points;
        let mut head = |i: usize, n_classes: usize| {
            let name = if i == 0 { "header".into() } else { format!("header_{}", i + 1) };
            Head::of_classes(&mut layout, &name, (c, config.head_width, n_classes), policy.head)
        };
        let heads = n_classes.iter().enumerate().map(|(i, n)| head(i, *n)).collect();
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

    /// Inference, with every intermediate result; logits of a shape do not depend on the rest of the batch.
    #[doc(hidden)] // checked by tests
    pub fn forward<T: Scalar>(&self, pass: &Inference<T>, batch: &Batch<T>) -> Activations<T> {
        let mut to = Activations::default();
        self.encode(pass, batch, &mut to);
        let cutters = Operand::new(&batch.cutters, N_LENGTHS);
        to.cutters = self.cutters.iter().map(|m| m.forward(pass, &(), cutters)).collect();
        self.decode(pass, batch, &mut to);
        let inputs = batch.head_inputs(&to.points, self.point_width());
        let logits = |head: &Head| head.forward(pass, &(), Operand::Concat(&inputs));
        to.logits = self.heads.iter().map(logits).collect();
        to
    }

    fn encode<T: Scalar>(&self, pass: &Inference<T>, batch: &Batch<T>, to: &mut Activations<T>) {
        let octree = &batch.octree;
        let features = Operand::new(&batch.features, self.stem.linear.c_in());
        to.stem = self.stem.forward(pass, conv_rows(octree, octree.depth()), features);
        for (i, stage) in self.encoder.iter().enumerate() {
            let depth = octree.depth() - 1 - i;
            let x = to.encoded.last().unwrap_or(&to.stem);
            let x = Operand::new(x, self.skip_width(i));
            let down = stage.down.forward(pass, down_rows(octree, depth), x);
            let x = Operand::new(&down, stage.down.c_out());
            to.encoded.push(stage.blocks.forward(pass, conv_rows(octree, depth), x));
            to.downsampled.push(down);
        }
    }

    fn decode<T: Scalar>(&self, pass: &Inference<T>, batch: &Batch<T>, to: &mut Activations<T>) {
        let (octree, n) = (&batch.octree, self.decoder.len());
        for (i, stage) in self.decoder.iter().enumerate() {
            let depth = self.decoder_depth(octree, i);
            let x = to.decoded.last().unwrap_or(&to.encoded[n - 1]);
            let x = Operand::new(x, stage.up.linear.c_in());
            let up = stage.up.forward(pass, up_rows(octree, depth), x);
            let skip = if i + 1 < n { &to.encoded[n - 2 - i] } else { &to.stem };
            let cutter = stage.cutter.map(|m| &to.cutters[m][..]);
            let parts = stage.parts(&octree.levels[depth], skip, cutter, &up);
            let (rows, x) = (conv_rows(octree, depth), Operand::Concat(&parts));
            let mut decoded = stage.blocks.forward(pass, rows, x);
            if let Some(attention) = &stage.attention {
                let x = Operand::new(&decoded, stage.blocks.c_out());
                decoded = attention.forward(pass, &octree.levels[depth].ranges, x);
            }
            to.decoded.push(decoded);
            to.upsampled.push(up);
        }
        let x = Operand::new(&to.decoded[n - 1], self.point_width());
        to.points = Interpolate.forward(pass, &batch.interpolation, x);
    }

    /// Columns of what downsampling stage `i` reads: the stem's, or the stage's before it.
    pub(super) fn skip_width(&self, i: usize) -> usize {
        if i == 0 { self.config.stem_width } else { self.config.encoder_widths[i - 1] }
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
    /// `[skip | cutter | upsampled]`, the cutter's features if the stage sees one: the one place where the cutter
    /// meets the shape.
    pub fn parts<'a, T: Scalar>(
        &self,
        level: &'a OctreeLevel,
        skip: &'a [T],
        cutter: Option<&'a [T]>,
        upsampled: &'a [T],
    ) -> Vec<Operand<'a, T>> {
        let cutter =
            cutter.map(|x| Operand::PerShape { x, c: self.c_cutter, shapes: &level.ranges });
        let up = Operand::new(upsampled, self.up.linear.c_out());
        std::iter::once(Operand::new(skip, self.c_skip)).chain(cutter).chain([up]).collect()
    }
}

/// Rows of a 3³ convolution at `depth`.
pub(super) fn conv_rows(octree: &Octree, depth: usize) -> &KernelMap {
    &octree.levels[depth].conv
}

/// Rows of the strided convolution that ends at `depth`.
pub(super) fn down_rows(octree: &Octree, depth: usize) -> &OctreeLevel {
    &octree.levels[depth]
}

/// Rows of the transposed convolution that ends at `depth`.
pub(super) fn up_rows(octree: &Octree, depth: usize) -> &OctreeLevel {
    &octree.levels[depth - 1]
}

fn encoder(config: &UNetConfig, policy: &MemoryPolicy, layout: &mut Layout) -> Vec<EncoderStage> {
    let rows = match config.normalize_empty_parents {
        true => OutputRows::AllNodes,
        false => OutputRows::NonEmpty,
    };
    let mut c_in = config.stem_width;
    let mut stage = |(i, (&c, &n_blocks)): (usize, (&usize, &usize))| {
        let name = format!("downsample.{i}");
        let down = Downsample::new(layout, &name, (c_in, c), rows, policy.down);
        c_in = c;
        let name = format!("encoder.{i}");
        let blocks = Blocks::new(layout, &name, n_blocks, (c, c), policy.blocks);
        EncoderStage { down, blocks }
    };
    let stages = config.encoder_widths.iter().zip(&config.encoder_blocks);
    stages.enumerate().map(&mut stage).collect()
}

fn decoder(config: &UNetConfig, policy: &MemoryPolicy, layout: &mut Layout) -> Vec<DecoderStage> {
    let skips = std::iter::once(&config.stem_width).chain(&config.encoder_widths);
    let mut skips: Vec<usize> = skips.copied().collect();
    let mut c_in = skips.pop().unwrap_or_default();
    let seeing = cutter_stages(config);
    let mut stage = |(i, (&c, &n_blocks)): (usize, (&usize, &usize))| {
        let up = LinearNormAct {
            linear: OctreeDeconv::new(layout, &format!("upsample.{i}.deconv"), c_in, c),
            norm: BatchNorm::new(layout, &format!("upsample.{i}.bn"), c),
            relu: true,
            policy: policy.up,
        };
        c_in = c;
        let shared = |m: usize| if config.cutter.shared { 0 } else { m };
        let cutter = seeing.iter().position(|&stage| stage == i).map(shared);
        let (c_skip, c_cutter) = (skips[skips.len() - 1 - i], config.cutter.width);
        let width = c_skip + if cutter.is_some() { c_cutter } else { 0 } + c;
        let name = format!("decoder.{i}");
        let blocks = Blocks::new(layout, &name, n_blocks, (width, c), policy.blocks);
        let depth = config.input.depth + 1 + i - config.decoder_widths.len();
        let attends = config.attention.depths.contains(&depth);
        let attention = attends.then(|| {
            Attention::new(layout, &format!("attention.{i}"), c, config.attention.n_heads)
        });
        DecoderStage { up, c_skip, c_cutter, cutter, blocks, attention }
    };
    let stages = config.decoder_widths.iter().zip(&config.decoder_blocks);
    stages.enumerate().map(&mut stage).collect()
}

/// Decoder stages that see the cutter.
fn cutter_stages(config: &UNetConfig) -> Vec<usize> {
    (0..config.decoder_widths.len()).filter(|&stage| config.sees_cutter(stage)).collect()
}

/// What a batch of octrees is made of.
pub(super) struct OctreeExtent {
    /// Nodes of each depth, over all shapes.
    pub n_nodes: Vec<usize>,
    /// Most nodes of a shape in each depth.
    pub max_nodes: Vec<usize>,
    pub n_points: usize,
    pub n_shapes: usize,
}

/// Numbers of a pass of the octree network with `c_in` columns of features.
pub(super) fn memory(config: &UNetConfig, c_in: usize, of: &OctreeExtent, training: bool) -> u64 {
    let (depth, n) = (config.input.depth, config.encoder_widths.len());
    let mut pass = PassMemory::new(of.n_shapes, training);
    let mut c = config.stem_width;
    pass.layer(OperatorShape::convolution(of.n_nodes[depth], c_in, c));
    let mut skips = vec![c];
    for (i, (&width, &n_blocks)) in
        config.encoder_widths.iter().zip(&config.encoder_blocks).enumerate()
    {
        let [n_in, n_out] = [depth - i, depth - 1 - i].map(|d| of.n_nodes[d]);
        pass.layer(OperatorShape { n_in, n_out, c_in: c, c_out: width, n_offsets: 8 });
        blocks::memory(&mut pass, n_out, n_blocks, [width; 2]);
        // The gradient of what skips to the decoder.
        pass.save(if training { product([n_in, c]) } else { 0 });
        c = width;
        skips.push(c);
    }
    let cutter = &config.cutter;
    cutter_modules::memory(&mut pass, n, [cutter.hidden_width, cutter.width]);
    let mut skips = skips.into_iter().rev().skip(1);
    for (i, (&width, &n_blocks)) in
        config.decoder_widths.iter().zip(&config.decoder_blocks).enumerate()
    {
        let d = depth + 1 + i - n;
        let [n_in, n_out] = [d - 1, d].map(|d| of.n_nodes[d]);
        pass.layer(OperatorShape { n_in, n_out, c_in: c, c_out: width, n_offsets: 8 });
        let c_cutter = if config.sees_cutter(i) { cutter.width } else { 0 };
        let joined = skips.next().unwrap_or_default() + c_cutter + width;
        blocks::memory(&mut pass, n_out, n_blocks, [joined, width]);
        if config.attention.depths.contains(&d) {
            attention::memory(&mut pass, [n_out, of.max_nodes[d]], width, config.attention.n_heads);
        }
        c = width;
    }
    // Features at the points; with the gradients by them and by the nodes.
    pass.save(product([of.n_points, c, if training { 2 } else { 1 }]));
    pass.use_workspace(product([of.n_nodes[depth], c, 3]));
    let c = c + config.input.n_point_channels();
    heads::memory(&mut pass, config.n_heads(), of.n_points, [c, config.head_width]);
    pass.numbers()
}
