//! The U-Net's forward pass for training and backward pass. What is saved between them is declared in
//! [`super::policy`].

use super::batch::Batch;
use super::cutter_modules::{N_LENGTHS, SavedCutterModule};
use super::heads::Head;
use super::unet::{UNet, conv_rows, down_rows, up_rows};
use crate::nn::arena::Buffer;
use crate::nn::blocks::SavedBlocks;
use crate::nn::interp::Interpolate;
use crate::nn::layer::Layer;
use crate::nn::linear_norm_act::SavedLinearNormAct;
use crate::nn::operand::Operand;
use crate::nn::pass::{Backward, Training};
use crate::nn::rows;
use crate::nn::saved::Saved;
use crate::numeric::scalar::Scalar;

/// The outcome of a training pass: logits, and what one backward needs and uses up, which [`Network`](super::Network)
/// names.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::model::{Batch, Model, Shape, UNetConfig};
/// use deepmill::nn::arena::Arena;
///
/// let (config, arena) = (UNetConfig::tiny(), Arena::default());
/// let mut model = Model::<f64>::new(&config, 1)?;
/// # let points = [Vec3::ZERO, Vec3::X, Vec3::Y];
/// # let shape = Shape::new(&points, &[Vec3::Z; 3], [1.5, 6.0, 40.0, 5.0]);
/// let batch = Batch::new(&[shape], &config.input)?; // three points
/// let pass = model.forward_train(&batch, None, &arena);
/// let (zeros, ones) = (vec![0.0; pass.logits[0].len()], vec![1.0; pass.logits[1].len()]);
/// let mut grads = vec![0.0; model.params.len()];
/// model.backward(&batch, pass, &[&zeros, &ones], &mut grads, &arena); // uses the pass up
/// // Of the sum of the second head's logits: each of its two biases, the last parameters, is in three of them.
/// assert_eq!(grads[grads.len() - 2..], [3.0, 3.0]);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug)]
pub struct TrainingPass<T, S = SavedUNet<T>> {
    /// Logits of the heads, `[n_points, n_classes]` each; of the networks here two classes: inaccessible, occlusion
    /// and, with [`share_head`](super::UNetConfig::share_head), the share of accessible directions.
    pub logits: Vec<Buffer<T>>,
    /// What backward needs.
    pub(super) saved: S,
}

impl<T, S> TrainingPass<T, S> {
    /// With the logits of each head, `[n_points, n_classes]`, and what backward needs.
    pub fn new(logits: Vec<Buffer<T>>, saved: S) -> Self {
        TrainingPass { logits, saved }
    }

    /// What backward needs.
    pub fn into_saved(self) -> S {
        self.saved
    }
}

/// What the training pass of a [`UNet`] leaves for backward.
#[derive(Debug)]
pub struct SavedUNet<T> {
    stem: SavedLinearNormAct<T>,
    /// Outputs that skip from encoder to decoder: stem, encoder stages but the last.
    skips: Vec<Buffer<T>>,
    encoder: Vec<SavedEncoderStage<T>>,
    /// Features and state of each cutter module.
    cutters: Vec<(Buffer<T>, SavedCutterModule<T>)>,
    decoder: Vec<SavedDecoderStage<T>>,
    points: Buffer<T>,
    heads: Vec<SavedLinearNormAct<T>>,
}

#[derive(Debug)]
struct SavedEncoderStage<T> {
    down: SavedLinearNormAct<T>,
    downsampled: Buffer<T>,
    blocks: SavedBlocks<T>,
}

#[derive(Debug)]
struct SavedDecoderStage<T> {
    /// Output of the stage before: the last encoder's or a decoder's.
    x: Buffer<T>,
    up: SavedLinearNormAct<T>,
    upsampled: Saved<T>,
    blocks: SavedBlocks<T>,
    /// Output of the blocks, if attention reads it.
    attended: Option<Buffer<T>>,
}

/// Gradient of a loss by what the network is fed with.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct InputGradients<T> {
    /// By the features of the finest nodes, shaped as [`Batch::features`].
    pub features: Vec<T>,
    /// By the cutter's lengths as fed in, `[n_shapes, 4]`.
    pub cutters: Vec<T>,
}

/// Gradients that the backward pass holds for later.
struct Waiting<T> {
    /// By the features that skip, from the decoder: stem, encoder stages.
    skips: Vec<Buffer<T>>,
    /// By the features of each cutter module, from all stages that see it.
    cutters: Vec<Buffer<T>>,
}

impl UNet {
    /// Training pass: statistics of the batch.
    pub fn forward_train<T: Scalar>(
        &self,
        pass: &mut Training<T>,
        batch: &Batch<T>,
    ) -> TrainingPass<T> {
        let octree = &batch.octree;
        let features = Operand::new(&batch.features, self.stem.linear.c_in());
        let rows = conv_rows(octree, octree.depth());
        let (y, stem) = self.stem.forward_train(pass, rows, features);
        let (mut skips, encoder) = self.encode_train(pass, batch, y);
        let lengths = Operand::new(&batch.cutters, N_LENGTHS);
        let module = |module: &_| Layer::forward_train(module, pass, &(), lengths);
        let cutters: Vec<_> = self.cutters.iter().map(module).collect();
        let x = skips.pop().unwrap_or_default();
        let (decoded, decoder) = self.decode_train(pass, batch, x, &skips, &cutters);
        let decoded_rows = Operand::new(&decoded, self.point_width());
        let points = Interpolate.forward(&pass.inference(), &batch.interpolation, decoded_rows);
        drop(decoded);
        let inputs = batch.head_inputs(&points, self.point_width());
        let mut heads = Vec::new();
        let mut logits = Vec::new();
        for head in &self.heads {
            let (of_head, saved) = head.forward_train(pass, &(), Operand::Concat(&inputs));
            logits.push(of_head);
            heads.push(saved);
        }
        drop(inputs);
        let saved = SavedUNet { stem, skips, encoder, cutters, decoder, points, heads };
        TrainingPass { logits, saved }
    }

    /// Outputs of the stem and of all stages, and what the stages leave.
    fn encode_train<T: Scalar>(
        &self,
        pass: &mut Training<T>,
        batch: &Batch<T>,
        stem: Buffer<T>,
    ) -> (Vec<Buffer<T>>, Vec<SavedEncoderStage<T>>) {
        let (octree, mut outputs, mut saved) = (&batch.octree, vec![stem], Vec::new());
        for (i, stage) in self.encoder.iter().enumerate() {
            let depth = octree.depth() - 1 - i;
            let x = Operand::new(&outputs[i], self.skip_width(i));
            let (downsampled, down) = stage.down.forward_train(pass, down_rows(octree, depth), x);
            let x = Operand::new(&downsampled, stage.down.c_out());
            let (y, blocks) = stage.blocks.forward_train(pass, conv_rows(octree, depth), x);
            outputs.push(y);
            saved.push(SavedEncoderStage { down, downsampled, blocks });
        }
        (outputs, saved)
    }

    /// Output of the last stage, and what the stages leave.
    fn decode_train<T: Scalar>(
        &self,
        pass: &mut Training<T>,
        batch: &Batch<T>,
        mut x: Buffer<T>,
        skips: &[Buffer<T>],
        cutters: &[(Buffer<T>, SavedCutterModule<T>)],
    ) -> (Buffer<T>, Vec<SavedDecoderStage<T>>) {
        let (octree, mut saved) = (&batch.octree, Vec::new());
        for (i, stage) in self.decoder.iter().enumerate() {
            let depth = self.decoder_depth(octree, i);
            let input = Operand::new(&x, stage.up.linear.c_in());
            let (upsampled, up) = stage.up.forward_train(pass, up_rows(octree, depth), input);
            let cutter = stage.cutter.map(|m| &cutters[m].0[..]);
            let level = &octree.levels[depth];
            let parts = stage.parts(level, &skips[skips.len() - 1 - i], cutter, &upsampled);
            let (mut y, blocks) =
                stage.blocks.forward_train(pass, &level.conv, Operand::Concat(&parts));
            let attended = stage.attention.as_ref().map(|attention| {
                let input = Operand::new(&y, stage.blocks.c_out());
                let (output, ()) = attention.forward_train(pass, &level.ranges, input);
                std::mem::replace(&mut y, output)
            });
            let upsampled = Saved::new(stage.up.policy, upsampled);
            let x = std::mem::replace(&mut x, y);
            saved.push(SavedDecoderStage { x, up, upsampled, blocks, attended });
        }
        (x, saved)
    }

    /// Adds to `pass.grads` the gradient of a loss whose gradients by the logits are `dlogits`.
    ///
    /// `forward` comes from [`UNet::forward_train`] with the same parameters and batch.
    ///
    /// # Panics
    /// If there is not one gradient for each head.
    pub fn backward<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        batch: &Batch<T>,
        forward: TrainingPass<T>,
        dlogits: &[&[T]],
    ) {
        let (stem, dstem, _) = self.backward_to_stem(pass, batch, forward.saved, dlogits);
        let rows = conv_rows(&batch.octree, batch.octree.depth());
        let features = Operand::new(&batch.features, self.stem.linear.c_in());
        self.stem.backward_params(pass, rows, features, stem, dstem);
        pass.layer_done();
    }

    /// [`UNet::backward`], and the gradient by what the network is fed with: the input gradient, or saliency, of
    /// nodes and cutter lengths.
    ///
    /// # Panics
    /// As [`UNet::backward`].
    #[doc(hidden)] // checked by gradient checks
    pub fn backward_to_inputs<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        batch: &Batch<T>,
        forward: TrainingPass<T>,
        dlogits: &[&[T]],
    ) -> InputGradients<T> {
        let (stem, dstem, dcutters) = self.backward_to_stem(pass, batch, forward.saved, dlogits);
        let rows = conv_rows(&batch.octree, batch.octree.depth());
        let features = Operand::new(&batch.features, self.stem.linear.c_in());
        let dfeatures = self.stem.backward(pass, rows, features, stem, dstem).into_first();
        pass.layer_done();
        InputGradients { features: dfeatures.to_vec(), cutters: dcutters.to_vec() }
    }

    /// What the stem left, and the gradients by its output and by the cutters' lengths.
    fn backward_to_stem<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        batch: &Batch<T>,
        saved: SavedUNet<T>,
        dlogits: &[&[T]],
    ) -> (SavedLinearNormAct<T>, Buffer<T>, Buffer<T>) {
        let SavedUNet { stem, skips, encoder, cutters, decoder, points, heads } = saved;
        let dpoints = self.backward_heads(pass, batch, points, heads, dlogits);
        let d = batch.interpolation.adjoint(pass.arena, self.point_width(), &dpoints);
        drop(dpoints);
        let zeros = |(features, _): &(Buffer<T>, _)| pass.arena.zeroed(features.len());
        let mut waiting =
            Waiting { skips: Vec::new(), cutters: cutters.iter().map(zeros).collect() };
        let features = |m: usize| &cutters[m].0[..];
        let d = self.backward_decoder(pass, batch, (&skips, &features), decoder, (d, &mut waiting));
        let dcutters = self.backward_cutters(pass, batch, cutters, waiting.cutters);
        let d = self.backward_encoder(pass, batch, skips, encoder, (d, waiting.skips));
        (stem, d, dcutters)
    }

    /// Gradient by the octree features at the points.
    fn backward_heads<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        batch: &Batch<T>,
        points: Buffer<T>,
        saved: Vec<SavedLinearNormAct<T>>,
        dlogits: &[&[T]],
    ) -> Buffer<T> {
        let inputs = batch.head_inputs(&points, self.point_width());
        let x = Operand::Concat(&inputs);
        assert_eq!(dlogits.len(), self.heads.len(), "one gradient for each head");
        let heads = self.heads.iter().zip(saved).zip(dlogits);
        let back = |((head, saved), dlogits): ((&Head, _), &&[T])| {
            head.backward_to_hidden(pass, x, saved, dlogits)
        };
        let dhidden: Vec<_> = heads.map(back).collect();
        drop(inputs);
        // Nothing reads the points' features any more: their gradient takes their memory.
        let mut dpoints = points;
        dpoints.fill(T::ZERO);
        for (head, dhidden) in self.heads.iter().zip(&dhidden) {
            head.add_input_gradient(pass, dhidden, self.point_width(), &mut dpoints);
        }
        dpoints
    }

    /// From the gradient of the decoder's output to that of the encoder's; those of skips and cutters wait.
    fn backward_decoder<'a, T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        batch: &Batch<T>,
        (skips, features): (&[Buffer<T>], &dyn Fn(usize) -> &'a [T]),
        saved: Vec<SavedDecoderStage<T>>,
        (mut d, waiting): (Buffer<T>, &mut Waiting<T>),
    ) -> Buffer<T> {
        let (octree, n) = (&batch.octree, self.decoder.len());
        for (i, (stage, saved)) in self.decoder.iter().zip(saved).enumerate().rev() {
            let depth = self.decoder_depth(octree, i);
            let SavedDecoderStage { x, up, upsampled, blocks, attended } = saved;
            if let Some((attention, input)) = stage.attention.as_ref().zip(attended) {
                let (ranges, input) =
                    (&octree.levels[depth].ranges, Operand::new(&input, stage.blocks.c_out()));
                d = attention.backward(pass, ranges, input, (), d).into_first();
            }
            let (coarse, input) =
                (up_rows(octree, depth), Operand::new(&x, stage.up.linear.c_in()));
            let recompute = || stage.up.recompute_output(pass, coarse, input, &up);
            let upsampled = upsampled.restore(recompute);
            let cutter = stage.cutter.map(features);
            let parts = stage.parts(&octree.levels[depth], &skips[n - 1 - i], cutter, &upsampled);
            let rows = conv_rows(octree, depth);
            let dparts = stage.blocks.backward(pass, rows, Operand::Concat(&parts), blocks, d);
            drop(upsampled);
            let mut dparts = dparts.into_parts().into_iter();
            waiting.skips.extend(dparts.next());
            if let Some((m, dcutter)) = stage.cutter.zip(stage.cutter.and_then(|_| dparts.next())) {
                rows::add_all(&mut waiting.cutters[m], &dcutter);
            }
            let dup = dparts.next().unwrap_or_default();
            d = stage.up.backward(pass, coarse, input, up, dup).into_first();
            pass.layer_done();
        }
        d
    }

    /// Gradient by the cutters' lengths.
    fn backward_cutters<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        batch: &Batch<T>,
        saved: Vec<(Buffer<T>, SavedCutterModule<T>)>,
        gradients: Vec<Buffer<T>>,
    ) -> Buffer<T> {
        let lengths = Operand::new(&batch.cutters, N_LENGTHS);
        let mut sum = pass.arena.zeroed(batch.cutters.len());
        for ((module, (_, saved)), d) in self.cutters.iter().zip(saved).zip(gradients) {
            let share = module.backward(pass, &(), lengths, saved, d).into_first();
            rows::add_all(&mut sum, &share);
        }
        sum
    }

    /// From the gradient of the encoder's output, and those of the skips (stem first), to that of the stem's.
    fn backward_encoder<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        batch: &Batch<T>,
        mut skips: Vec<Buffer<T>>,
        saved: Vec<SavedEncoderStage<T>>,
        (mut d, mut dskips): (Buffer<T>, Vec<Buffer<T>>),
    ) -> Buffer<T> {
        let octree = &batch.octree;
        for (i, (stage, saved)) in self.encoder.iter().zip(saved).enumerate().rev() {
            let depth = octree.depth() - 1 - i;
            let SavedEncoderStage { down, downsampled, blocks } = saved;
            let x = Operand::new(&downsampled, stage.down.c_out());
            let d_down = stage.blocks.backward(pass, conv_rows(octree, depth), x, blocks, d);
            drop(downsampled);
            let skip = skips.pop().unwrap_or_default();
            let x = Operand::new(&skip, self.skip_width(i));
            let d_down = d_down.into_first();
            d = stage.down.backward(pass, down_rows(octree, depth), x, down, d_down).into_first();
            pass.layer_done();
            rows::add_all(&mut d, &dskips.pop().unwrap_or_default());
        }
        d
    }
}
