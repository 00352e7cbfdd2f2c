//! The whole network on a fixture: octree, inference, training.

use super::Tensors;
use super::fixture::{Fixture, Sgd as Settings};
use crate::Result;
use crate::learn::loss::CrossEntropy;
use crate::learn::optim::Sgd;
use crate::model::heads::N_CLASSES;
use crate::model::weights::tensors::TensorValues;
use crate::model::{Activations, Batch, Model};
use crate::nn::arena::{Arena, Buffer};
use crate::nn::params::Entry;
use crate::numeric::scalar::Scalar;
use crate::octree::Octree;

/// Weight of each head's loss: the reference averages them.
const HEAD_WEIGHT: f64 = 0.5;

/// Computes in `T` what the fixture records under `prefix`.
pub(super) fn run<T: Scalar>(fixture: &Fixture, prefix: &str, to: &mut Tensors) -> Result<()> {
    let mut model = cast::<T>(&fixture.model);
    let input = &model.net.config().input;
    let batch = Batch::<T>::from_normalized(&fixture.clouds(), &fixture.cutters, input)?;
    if prefix.is_empty() {
        octree(&batch.octree, to);
        to.add_rows("input_feature", input.n_node_channels()?, &batch.features);
    }
    let arena = Arena::default();
    let activations = model.forward(&batch, &arena);
    stages(&model, &activations, &format!("{prefix}eval."), to);
    if let Some(labels) = &fixture.labels {
        let mut run = Run { model: &mut model, batch: &batch, labels, arena: &arena };
        run.train(fixture.config.sgd.unwrap_or_default(), prefix, to);
        let activations = model.forward(&batch, &arena);
        logits(&activations.logits, &format!("{prefix}post."), to);
    }
    Ok(())
}

/// The same model in another precision.
fn cast<T: Scalar>(model: &Model<f32>) -> Model<T> {
    let numbers = |values: &[f32]| values.iter().map(|&v| T::from_f64(f64::from(v))).collect();
    Model::of(model.net.clone(), numbers(&model.params), numbers(&model.buffers))
}

fn octree(octree: &Octree, to: &mut Tensors) {
    let (mut nodes, mut nonempty, mut shape_nodes, mut shape_nonempty) =
        (vec![], vec![], vec![], vec![]);
    for (d, level) in octree.levels.iter().enumerate() {
        let n = level.n_nodes();
        let integers = |values: &[i32]| TensorValues::I32(values.to_vec());
        let keys = level.keys.iter().map(|&key| key as i64).collect();
        to.insert(format!("octree.d{d}.keys"), &[n], TensorValues::I64(keys));
        to.insert(format!("octree.d{d}.children"), &[n], integers(&level.children));
        to.insert(format!("octree.d{d}.neigh"), &[n, 27], integers(level.neigh.as_flattened()));
        nodes.push(n as i64);
        nonempty.push(level.n_nonempty() as i64);
        for range in &level.ranges {
            shape_nodes.push(range.len() as i64);
            let filled = level.children[range.clone()].iter().filter(|&&child| child >= 0).count();
            shape_nonempty.push(filled as i64);
        }
    }
    let (depths, shapes) = (octree.levels.len(), octree.n_shapes());
    to.insert("octree.nnum", &[depths], TensorValues::I64(nodes));
    to.insert("octree.nnum_nempty", &[depths], TensorValues::I64(nonempty));
    to.insert("octree.batch_nnum", &[depths, shapes], TensorValues::I64(shape_nodes));
    to.insert("octree.batch_nnum_nempty", &[depths, shapes], TensorValues::I64(shape_nonempty));
    let leaves = octree.point_node.iter().map(|&node| node as i32).collect();
    to.insert("octree.point_node", &[octree.n_points()], TensorValues::I32(leaves));
    let rows =
        |vectors: &[glam::Vec3]| vectors.iter().flat_map(|v| v.to_array()).collect::<Vec<_>>();
    to.add_rows("octree.points", 3, &rows(&octree.leaf_points));
    to.add_rows("octree.normals", 3, &rows(&octree.leaf_normals));
}

fn stages<T: Scalar>(model: &Model<T>, from: &Activations<T>, prefix: &str, to: &mut Tensors) {
    let config = model.net.config();
    to.add_rows(format!("{prefix}conv1"), config.stem_width, &from.stem);
    let mut add = |name: &str, first: usize, c: &dyn Fn(usize) -> usize, all: &[Buffer<T>]| {
        for (i, values) in all.iter().enumerate() {
            to.add_rows(format!("{prefix}{name}{}", i + first), c(i), values);
        }
    };
    add("downsample.", 0, &|i| config.encoder_widths[i], &from.downsampled);
    add("encoder.", 0, &|i| config.encoder_widths[i], &from.encoded);
    add("fc_module_", 1, &|_| config.cutter.width, &from.cutters);
    add("upsample.", 0, &|i| config.decoder_widths[i], &from.upsampled);
    add("decoder.", 0, &|i| config.decoder_widths[i], &from.decoded);
    to.add_rows(format!("{prefix}interp"), model.net.point_width(), &from.points);
    logits(&from.logits, prefix, to);
}

fn logits<T: Scalar>(logits: &[Buffer<T>], prefix: &str, to: &mut Tensors) {
    for (i, logits) in logits.iter().enumerate() {
        to.add_rows(format!("{prefix}logits_{}", i + 1), N_CLASSES, logits);
    }
}

struct Run<'a, T> {
    model: &'a mut Model<T>,
    batch: &'a Batch<T>,
    labels: &'a [Vec<u8>; 2],
    arena: &'a Arena<T>,
}

impl<T: Scalar> Run<'_, T> {
    fn train(&mut self, settings: Settings, prefix: &str, to: &mut Tensors) {
        let Settings { lr, momentum, weight_decay, steps } = settings;
        let sgd = Sgd { momentum, weight_decay };
        let mut velocity = vec![T::ZERO; self.model.params.len()];
        let mut losses = Vec::new();
        for step in 0..steps {
            let (loss, mut grads, of_heads) = self.gradient();
            losses.push(loss);
            if step == 0 {
                logits(&of_heads, &format!("{prefix}train."), to);
                let entries = &self.model.net.layout().params;
                tensors(entries, &grads, &format!("{prefix}grad."), to);
            }
            sgd.step(lr, &mut grads, &mut velocity, &mut self.model.params);
        }
        let buffers = self.model.buffers.clone();
        losses.push(self.gradient().0);
        self.model.buffers = buffers;
        to.insert(format!("{prefix}train.loss"), &[losses.len()], TensorValues::F64(losses));
        let layout = self.model.net.layout();
        tensors(&layout.params, &self.model.params, &format!("{prefix}post."), to);
        tensors(&layout.buffers, &self.model.buffers, &format!("{prefix}post."), to);
    }

    /// Loss in training mode, its gradient, and the logits.
    fn gradient(&mut self) -> (f64, Vec<T>, Vec<Buffer<T>>) {
        let pass = self.model.forward_train(self.batch, None, self.arena);
        let (mut loss, mut d) = (0.0, [Vec::new(), Vec::new()]);
        for (head, d) in d.iter_mut().enumerate() {
            let (logits, labels) = (&pass.logits[head], &self.labels[head]);
            loss += HEAD_WEIGHT * CrossEntropy::binary().loss(logits, labels, HEAD_WEIGHT, d);
        }
        let (mut grads, logits) = (vec![T::ZERO; self.model.params.len()], pass.logits.clone());
        self.model.backward(self.batch, pass, &[&d[0], &d[1]], &mut grads, self.arena);
        (loss, grads, logits)
    }
}

/// Every tensor of a flat vector by its name; counters as integers.
fn tensors<T: Scalar>(entries: &[Entry], values: &[T], prefix: &str, to: &mut Tensors) {
    for Entry { name, shape, range, .. } in entries {
        let values = &values[range.clone()];
        let full_name = format!("{prefix}{name}");
        match name.ends_with("num_batches_tracked") {
            true => to.insert(full_name, shape, TensorValues::I64(vec![values[0].to_f64() as i64])),
            false => to.add(full_name, shape, values),
        }
    }
}
