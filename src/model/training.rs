//! The U-Net's training pass and its way back, over memory that lives between steps.

use super::batch::Batch;
use super::unet::{N_HEADS, UNet, conv_rows, down_rows, up_rows};
use super::{cutter_modules, heads};
use crate::nn::blocks;
use crate::nn::concat::PartGradient;
use crate::nn::downsample;
use crate::nn::joined::{Columns, ColumnsGradient};
use crate::nn::residual::Scratch;
use crate::nn::rows;
use crate::nn::unit;
use crate::rng::Stream;
use crate::scalar::Scalar;

/// What a training pass keeps for backward, and the memory both work in.
#[derive(Debug, Clone, Default)]
pub struct Workspace<T> {
    /// Logits of both heads, `[n_points, 2]` each.
    pub logits: [Vec<T>; N_HEADS],
    stem: Kept<T>,
    down: Vec<KeptDown<T>>,
    encoder: Vec<blocks::Cache<T>>,
    cutters: Vec<KeptCutter<T>>,
    up: Vec<unit::Cache<T>>,
    decoder: Vec<blocks::Cache<T>>,
    points: Vec<T>,
    heads: [heads::Cache<T>; N_HEADS],
    gradients: Gradients<T>,
}

/// Gradient of a loss by what the network is fed with.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct InputGradients<T> {
    /// By the features of the finest nodes, shaped as [`Batch::features`].
    pub features: Vec<T>,
    /// By the cutter's lengths as fed in, shaped as [`Batch::cutters`].
    pub cutters: Vec<T>,
}

#[derive(Debug, Clone, Default)]
struct Kept<T> {
    y: Vec<T>,
    cache: unit::Cache<T>,
}

#[derive(Debug, Clone, Default)]
struct KeptDown<T> {
    y: Vec<T>,
    cache: downsample::Cache<T>,
}

#[derive(Debug, Clone, Default)]
struct KeptCutter<T> {
    y: Vec<T>,
    cache: cutter_modules::Cache<T>,
}

#[derive(Debug, Clone, Default)]
struct Gradients<T> {
    /// Of the current stage's output.
    d: Vec<T>,
    /// Of the features that skip from encoder to decoder: stem, encoder stages.
    skips: Vec<Vec<T>>,
    cutters: Vec<Vec<T>>,
    scratch: Scratch<T>,
}

impl UNet {
    /// Training pass: statistics of the batch, logits in [`Workspace::logits`].
    ///
    /// `dropout` holds one stream per shape, keyed by (seed, epoch, sample); `None` turns dropout off.
    pub fn forward_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        batch: &Batch<T>,
        mut dropout: Option<&mut [Stream]>,
        work: &mut Workspace<T>,
    ) {
        work.resize(self);
        self.encode_train(params, buffers, batch, work);
        for (module, kept) in self.cutters.iter().zip(&mut work.cutters) {
            let (streams, KeptCutter { y, cache }) = (dropout.as_deref_mut(), kept);
            module.forward_train(params, buffers, streams, &batch.cutters, y, cache);
        }
        self.decode_train(params, buffers, batch, work);
        for (i, head) in self.heads.iter().enumerate() {
            let (y, cache) = (&mut work.logits[i], &mut work.heads[i]);
            let hidden = &mut work.gradients.scratch.middle;
            head.forward_train(params, buffers, &work.points, y, cache, hidden);
        }
    }

    fn encode_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        batch: &Batch<T>,
        work: &mut Workspace<T>,
    ) {
        let octree = &batch.octree;
        // Backward computes it once more.
        let Kept { y, cache } = &mut work.stem;
        let rows = conv_rows(octree, octree.depth());
        self.stem.forward_train_in_place(params, buffers, rows, &batch.features, y, cache);
        for (i, stage) in self.encoder.iter().enumerate() {
            let depth = octree.depth() - 1 - i;
            let (before, after) = work.encoder.split_at_mut(i);
            let x = before.last().map_or(&work.stem.y[..], |stage| stage.output());
            let KeptDown { y, cache } = &mut work.down[i];
            stage.down.forward_train(params, buffers, down_rows(octree, depth), x, y, cache);
            let rows = conv_rows(octree, depth);
            let scratch = &mut work.gradients.scratch;
            stage.blocks.forward_train(params, buffers, rows, &*y, &mut after[0], scratch);
        }
    }

    fn decode_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        batch: &Batch<T>,
        work: &mut Workspace<T>,
    ) {
        let (octree, n) = (&batch.octree, self.decoder.len());
        for (i, stage) in self.decoder.iter().enumerate() {
            let depth = self.decoder_depth(octree, i);
            let (before, after) = work.decoder.split_at_mut(i);
            let x = before.last().unwrap_or(&work.encoder[n - 1]).output();
            // Backward computes it once more.
            let Gradients { d: y, scratch, .. } = &mut work.gradients;
            let (rows, cache) = (up_rows(octree, depth), &mut work.up[i]);
            stage.up.forward_train_in_place(params, buffers, rows, x, y, cache);
            let skip = if i + 1 < n { work.encoder[n - 2 - i].output() } else { &work.stem.y };
            let cutter = stage.cutter.map(|m| &work.cutters[m].y[..]);
            let parts = stage.parts(skip, cutter, y);
            let (rows, x) = (conv_rows(octree, depth), stage.join(octree, depth, &parts));
            stage.blocks.forward_train(params, buffers, rows, x, &mut after[0], scratch);
        }
        let x = work.decoder[n - 1].output();
        batch.point_features(self.point_width(), x, &mut work.points);
    }

    /// Adds to `grads` the gradient of a loss whose gradients by the logits are `dlogits`.
    ///
    /// `work` comes from [`UNet::forward_train`] with the same parameters and batch, and serves one
    /// backward only: what it kept becomes memory to work in.
    pub fn backward<T: Scalar>(
        &self,
        params: &[T],
        batch: &Batch<T>,
        dlogits: [&[T]; N_HEADS],
        work: &mut Workspace<T>,
        grads: &mut [T],
    ) {
        self.backward_to(params, batch, dlogits, work, None, grads);
    }

    /// [`UNet::backward`], and the gradient by what the network is fed with: which nodes and which lengths
    /// of the cutter an answer hangs on.
    pub fn backward_to_inputs<T: Scalar>(
        &self,
        params: &[T],
        batch: &Batch<T>,
        dlogits: [&[T]; N_HEADS],
        work: &mut Workspace<T>,
        inputs: &mut InputGradients<T>,
        grads: &mut [T],
    ) {
        self.backward_to(params, batch, dlogits, work, Some(inputs), grads);
    }

    fn backward_to<T: Scalar>(
        &self,
        params: &[T],
        batch: &Batch<T>,
        dlogits: [&[T]; N_HEADS],
        work: &mut Workspace<T>,
        inputs: Option<&mut InputGradients<T>>,
        grads: &mut [T],
    ) {
        let (dfeatures, mut dcutters) = inputs.map(|i| (&mut i.features, &mut i.cutters)).unzip();
        if let Some(dcutters) = &mut dcutters {
            dcutters.clear();
            dcutters.resize(batch.cutters.len(), T::ZERO);
        }
        let mut g = std::mem::take(&mut work.gradients);
        g.skips.resize_with(self.encoder.len(), Vec::new);
        g.cutters.resize_with(self.cutters.len(), Vec::new);
        g.cutters.iter_mut().for_each(Vec::clear);
        self.backward_heads(params, dlogits, work, &mut g, grads);
        batch.point_features_backward(self.point_width(), &mut work.points, &mut g.d);
        self.backward_decoder(params, batch, work, &mut g, grads);
        for (m, module) in self.cutters.iter().enumerate() {
            let cache = &work.cutters[m].cache;
            let mut share = dcutters.is_some().then(Vec::new);
            let d = &mut g.cutters[m];
            module.backward(params, &batch.cutters, cache, d, share.as_mut(), grads);
            if let (Some(sum), Some(share)) = (&mut dcutters, &share) {
                rows::add_all(sum, share);
            }
        }
        self.backward_encoder(params, batch, work, &mut g, dfeatures, grads);
        work.gradients = g;
    }

    /// Turns what the heads read into the gradient by it.
    fn backward_heads<T: Scalar>(
        &self,
        params: &[T],
        dlogits: [&[T]; N_HEADS],
        work: &mut Workspace<T>,
        g: &mut Gradients<T>,
        grads: &mut [T],
    ) {
        let Workspace { decoder, points, heads: caches, .. } = work;
        let last = decoder.len() - 1;
        let mut memory = decoder[last].take_output();
        let mut hidden = [&mut g.d, &mut g.scratch.middle];
        let heads = || self.heads.iter().zip(&*caches).zip(dlogits);
        for (((head, cache), dlogits), hidden) in heads().zip(&mut hidden) {
            head.backward(params, points, cache, dlogits, grads, hidden, &mut memory);
        }
        decoder[last].give_output(memory);
        points.fill(T::ZERO);
        for (head, hidden) in self.heads.iter().zip(hidden) {
            head.add_dx(params, hidden, points);
        }
    }

    /// From the gradient of the decoder's output in `g.d` to that of the encoder's.
    fn backward_decoder<T: Scalar>(
        &self,
        params: &[T],
        batch: &Batch<T>,
        work: &mut Workspace<T>,
        g: &mut Gradients<T>,
        grads: &mut [T],
    ) {
        let (octree, n) = (&batch.octree, self.decoder.len());
        let Gradients { d, skips, cutters, scratch } = g;
        // What the heads read has served: the largest memory there is.
        let upsampled = &mut work.points;
        let mut cutter = Vec::new();
        for (i, stage) in self.decoder.iter().enumerate().rev() {
            let depth = self.decoder_depth(octree, i);
            let skip = if i + 1 < n { work.encoder[n - 2 - i].output() } else { &work.stem.y };
            let features = stage.cutter.map(|m| &work.cutters[m].y[..]);
            let (before, after) = work.decoder.split_at_mut(i);
            let (x, cache) =
                (before.last().unwrap_or(&work.encoder[n - 1]).output(), &mut after[0]);
            let coarse = up_rows(octree, depth);
            stage.up.output_again(params, coarse, x.into(), &work.up[i], upsampled);
            let parts = stage.parts(skip, features, upsampled);
            let (rows, joined) = (conv_rows(octree, depth), stage.join(octree, depth, &parts));
            let mut dx = Vec::new();
            let mut to = vec![PartGradient::Nodes(&mut skips[n - 1 - i])];
            to.extend(stage.cutter.map(|_| PartGradient::Shapes(&mut cutter)));
            to.push(PartGradient::Nodes(&mut dx));
            let to = (&mut to[..]).into();
            stage.blocks.backward(params, rows, joined, cache, d, to, grads, scratch);
            if let Some(m) = stage.cutter {
                cutters[m].resize(cutter.len(), T::ZERO);
                rows::add_all(&mut cutters[m], &cutter);
            }
            let memory = std::mem::take(upsampled);
            let mut kept = stage.up.again(params, coarse, x.into(), &work.up[i], memory);
            stage.up.backward(params, coarse, x, &kept, &mut dx, Some(d.into()), grads);
            *upsampled = kept.take_memory();
            cache.give_memory(dx);
        }
    }

    /// From the gradient of the encoder's output in `g.d`, and those of the skips, to the stem.
    fn backward_encoder<T: Scalar>(
        &self,
        params: &[T],
        batch: &Batch<T>,
        work: &mut Workspace<T>,
        g: &mut Gradients<T>,
        dfeatures: Option<&mut Vec<T>>,
        grads: &mut [T],
    ) {
        let octree = &batch.octree;
        let Gradients { d, skips, scratch, .. } = g;
        for (i, stage) in self.encoder.iter().enumerate().rev() {
            let depth = octree.depth() - 1 - i;
            let KeptDown { y, cache } = &work.down[i];
            let (before, after) = work.encoder.split_at_mut(i);
            let (rows, blocks) = (conv_rows(octree, depth), &mut after[0]);
            let mut dx = Vec::new();
            let to = (&mut dx).into();
            stage.blocks.backward(params, rows, y, blocks, d, to, grads, scratch);
            let x = before.last().map_or(&work.stem.y[..], |stage| stage.output());
            let rows = down_rows(octree, depth);
            stage.down.backward(params, rows, x, cache, &mut dx, Some(d.into()), grads);
            blocks.give_memory(dx);
            rows::add_all(d, &skips[i]);
        }
        let (rows, memory) = (conv_rows(octree, octree.depth()), std::mem::take(&mut work.points));
        let x = Columns::One(&batch.features);
        let mut kept = self.stem.again(params, rows, x, &work.stem.cache, memory);
        let to = dfeatures.map(ColumnsGradient::from);
        self.stem.backward(params, rows, x, &kept, d, to, grads);
        work.points = kept.take_memory();
    }
}

impl<T: Scalar> Workspace<T> {
    fn resize(&mut self, net: &UNet) {
        let n = net.encoder.len();
        self.down.resize_with(n, Default::default);
        self.encoder.resize_with(n, Default::default);
        self.cutters.resize_with(net.cutters.len(), Default::default);
        self.up.resize_with(n, Default::default);
        self.decoder.resize_with(n, Default::default);
    }
}
