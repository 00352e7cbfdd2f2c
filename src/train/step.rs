//! One training step: samples to batch, forward, losses, backward, update.

use super::{Reduction, Run, Settings};
use crate::data::{Sample, SampleSource};
use crate::loss::CrossEntropy;
use crate::metrics::Confusion;
use crate::model::{Batch, Domain, Model, Shape, TrainingPass};
use crate::nn::arena::Arena;
use crate::optim::Sgd;
use crate::rng::{Purpose, Stream};
use crate::simd::Isa;
use crate::simd::elementwise::scale;
use crate::{Error, Result};
use std::ops::Range;

/// Work space that is kept from step to step.
#[derive(Debug, Default)]
pub(super) struct StepScratch {
    arena: Arena<f32>,
    /// Zeros between steps; empty where each layer is updated as soon as its gradient is whole.
    grads: Vec<f32>,
    dlogits: [Vec<f32>; 2],
}

/// What one step found.
pub(super) struct StepOutcome {
    pub loss: f64,
    pub confusion: [Confusion; 2],
}

/// The samples `indices` of `epoch`, augmented; in parallel, in order.
pub(super) fn draw(
    source: &(impl SampleSource + ?Sized),
    settings: &Settings,
    epoch: u64,
    indices: &[usize],
) -> Result<Vec<Sample>> {
    let one = |i: usize| -> Result<Sample> {
        let sample = source.sample(epoch, indices[i])?;
        sample.check()?;
        let mut stream = Stream::new(settings.seed, epoch, indices[i] as u64, Purpose::Augment);
        Ok(settings.augment.apply(&sample, &mut stream))
    };
    crate::par::map(indices.len(), one).into_iter().collect()
}

/// The network's input for `samples`.
pub(super) fn batch(model: &Model<f32>, samples: &[Sample]) -> Result<Batch<f32>> {
    let shapes: Vec<Shape> = samples.iter().map(shape).collect();
    Batch::new(&shapes, &model.net.config().input)
}

fn shape(sample: &Sample) -> Shape<'_> {
    let sites = &sample.sites;
    let cutter_mm = sample.cutter.to_array();
    Shape { points: &sites.points, normals: &sites.normals, cutter_mm }
}

/// Classes of both heads: 0 = inaccessible, and 1 = occlusion point.
pub(super) fn targets(samples: &[Sample]) -> [Vec<u8>; 2] {
    let head1 = samples.iter().flat_map(|s| s.answers.inaccessible.iter().map(|l| u8::from(!*l)));
    let head2 = samples.iter().flat_map(|s| s.answers.occlusion.iter().map(|l| u8::from(*l)));
    [head1.collect(), head2.collect()]
}

/// Class that counts as positive in each head.
pub(super) const POSITIVE: [u8; 2] = [0, 1];

impl Run {
    /// Learns from `samples` at learning rate `lr`; `place` names the step in an error.
    pub(super) fn learn(
        &mut self,
        lr: f64,
        samples: &[Sample],
        dropout: &mut [Stream],
        place: &str,
    ) -> Result<StepOutcome> {
        let Run { settings, progress, model, velocity, scratch } = self;
        let scale = match settings.loss.reduction {
            Reduction::Sum => 1.0,
            Reduction::Mean => 0.5,
        };
        let criteria = [0, 1].map(|head| criterion(settings, head));
        let weights = |samples: &[Sample]| {
            let targets = targets(samples);
            [0, 1].map(|head: usize| criteria[head].total_weight(&targets[head]))
        };
        let (all, size) =
            (weights(samples), settings.micro_batch_size.unwrap_or(samples.len().max(1)));
        let sgd = Sgd { momentum: settings.momentum, weight_decay: settings.weight_decay };
        let by_layer = samples.len() <= size && settings.clip_norm.is_none();
        let mut outcome = StepOutcome { loss: 0.0, confusion: Default::default() };
        for (part, dropout) in samples.chunks(size).zip(dropout.chunks_mut(size)) {
            let some = weights(part);
            let shares = [0, 1].map(|head: usize| scale * (some[head] / all[head]));
            let forward = scratch.forward(model, part, dropout, &criteria, shares, &mut outcome);
            let (batch, pass) = forward.inspect_err(|_| scratch.grads.fill(0.0))?;
            if !outcome.loss.is_finite() {
                scratch.grads.fill(0.0);
                return Err(not_finite(place, outcome.loss, samples));
            }
            let dlogits = scratch.dlogits.each_ref().map(|d| &d[..]);
            if by_layer {
                let mut update = |range: Range<usize>, grads: &mut [f32], params: &mut [f32]| {
                    sgd.step(lr, grads, &mut velocity[range], params);
                };
                model.backward_and_update(&batch, pass, dlogits, &mut update, &scratch.arena);
            } else {
                scratch.grads.resize(model.params.len(), 0.0);
                model.backward(&batch, pass, dlogits, &mut scratch.grads, &scratch.arena);
            }
        }
        if !by_layer {
            if let Some(most) = settings.clip_norm {
                clip(&mut scratch.grads, most);
            }
            sgd.step(lr, &mut scratch.grads, velocity, &mut model.params);
        }
        for sample in samples {
            let seen = Domain::of(&sample.sites.points, sample.cutter);
            progress.domain.get_or_insert(seen).include(&seen);
        }
        model.domain = progress.domain;
        Ok(outcome)
    }
}

impl StepScratch {
    /// The network's input for some of a step's samples, and what backward needs beside `dlogits`: `shares` times
    /// the gradients of the mean losses by the logits.
    fn forward(
        &mut self,
        model: &mut Model<f32>,
        samples: &[Sample],
        dropout: &mut [Stream],
        criteria: &[CrossEntropy; 2],
        shares: [f64; 2],
        outcome: &mut StepOutcome,
    ) -> Result<(Batch<f32>, TrainingPass<f32>)> {
        let (batch, targets) = (batch(model, samples)?, targets(samples));
        let pass = model.forward_train(&batch, Some(dropout), &self.arena);
        for head in 0..2 {
            let (logits, targets) = (&pass.logits[head], &targets[head]);
            let (share, dlogits) = (shares[head], &mut self.dlogits[head]);
            outcome.loss += share * criteria[head].loss(logits, targets, share, dlogits);
            outcome.confusion[head] += Confusion::of_logits(logits, targets, POSITIVE[head]);
        }
        Ok((batch, pass))
    }
}

fn not_finite(place: &str, loss: f64, samples: &[Sample]) -> Error {
    let names: Vec<&str> = samples.iter().map(|s| s.name.as_str()).collect();
    Error::NotFinite {
        place: place.into(),
        found: format!("the loss is {loss} (samples {})", names.join(", ")),
        remedy: "lower the learning rate, or clip gradients with clip_norm".into(),
    }
}

fn criterion(settings: &Settings, head: usize) -> CrossEntropy {
    let mut class_weights = vec![1.0; 2];
    if let Some(weights) = settings.loss.positive_weights {
        class_weights[POSITIVE[head] as usize] = weights[head];
    }
    CrossEntropy { class_weights, label_smoothing: settings.loss.label_smoothing }
}

/// Block of the sum of squares: a constant, so that the norm does not depend on threads.
const CLIP_BLOCK: usize = 1 << 14;

/// Shortens `grads` to Euclidean norm `most`, if longer.
fn clip(grads: &mut [f32], most: f64) {
    let squares = crate::par::map_blocks(grads.len(), CLIP_BLOCK, |range| {
        grads[range].iter().map(|g| f64::from(*g) * f64::from(*g)).sum::<f64>()
    });
    let norm = squares.iter().sum::<f64>().sqrt();
    if norm > most {
        let factor = (most / norm) as f32;
        crate::par::for_each_block(grads, CLIP_BLOCK, |_, block| {
            scale(Isa::active(), factor, block);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::SiteAnswers;
    use crate::cutter::CutterParams;
    use crate::geom::Sites;
    use glam::Vec3;

    /// Two parts of different size, labeled by a plane.
    fn samples() -> Vec<Sample> {
        let sample = |n: usize| {
            let mut stream = Stream::new(3, 0, n as u64, Purpose::Probe);
            let mut unit = || Vec3::from_array([0; 3].map(|_| stream.range(-1.0, 1.0) as f32));
            let points: Vec<Vec3> = (0..n).map(|_| unit() * 40.0).collect();
            let normals = (0..n).map(|_| (unit() + Vec3::Z).normalize()).collect();
            let labels: Vec<bool> = points.iter().map(|p| p.x > 20.0).collect();
            let cutter = CutterParams { cr_mm: 1.5, ch_mm: 6.0, fr_mm: 40.0, fh_mm: 5.0 };
            let sites = Sites { points, normals, faces: Vec::new() }.into();
            let name = format!("{n} sites");
            let answers = SiteAnswers::new(labels.clone(), labels);
            Sample { name, sites, cutter, answers }
        };
        [90, 40].map(sample).into()
    }

    /// Loss of one step, and what it adds to the parameters.
    fn step(micro_batch_size: Option<usize>, samples: &[Sample]) -> (f64, Vec<f32>) {
        clipped_step(None, micro_batch_size, samples)
    }

    fn clipped_step(
        clip_norm: Option<f64>,
        micro_batch_size: Option<usize>,
        samples: &[Sample],
    ) -> (f64, Vec<f32>) {
        let mut settings = Settings { micro_batch_size, clip_norm, ..Settings::tiny() };
        settings.network.cutter.dropout = 0.0;
        // A single shape has no statistics of its cutter.
        settings.network.cutter.batch_norm = false;
        settings.loss.positive_weights = Some([2.0, 5.0]);
        let mut run = Run::new(settings).unwrap();
        let start = run.model.params.clone();
        let mut dropout: Vec<_> =
            (0..samples.len() as u64).map(|i| Stream::new(1, 0, i, Purpose::Dropout)).collect();
        let outcome = run.learn(0.1, samples, &mut dropout, "here").unwrap();
        let moved = run.model.params.iter().zip(&start).map(|(new, old)| new - old);
        (outcome.loss, moved.collect())
    }

    #[test]
    fn a_micro_batch_of_all_samples_changes_no_bit() {
        let samples = samples();
        assert_eq!(step(None, &samples), step(Some(2), &samples));
        assert_eq!(step(None, &samples), step(Some(9), &samples));
    }

    /// Clipping needs the gradient of all parameters at once, an update layer by layer never has it.
    #[test]
    fn an_update_layer_by_layer_changes_no_bit() {
        let samples = samples();
        assert_eq!(step(None, &samples), clipped_step(Some(1e30), None, &samples));
    }

    /// Equal samples have equal statistics, so that parts differ from the whole by rounding alone; the
    /// weights of classes are those of the whole step.
    #[test]
    fn micro_batches_add_up_to_the_step() {
        let sample = samples().swap_remove(0);
        let samples = [sample.clone(), sample];
        let ((whole_loss, whole), (loss, moved)) = (step(None, &samples), step(Some(1), &samples));
        assert!((loss - whole_loss).abs() < 1e-5 * whole_loss, "{loss} {whole_loss}");
        let norm = |x: &[f32]| x.iter().map(|x| x * x).sum::<f32>().sqrt();
        let apart: Vec<f32> = moved.iter().zip(&whole).map(|(a, b)| a - b).collect();
        assert!(norm(&apart) < 0.01 * norm(&whole), "{} of {}", norm(&apart), norm(&whole));
    }

    #[test]
    fn clipping_shortens_long_gradients_only() {
        let mut grads = vec![3.0, 4.0];
        clip(&mut grads, 10.0);
        assert_eq!(grads, [3.0, 4.0]);
        clip(&mut grads, 1.0);
        assert!((grads[0] - 0.6).abs() < 1e-6 && (grads[1] - 0.8).abs() < 1e-6);
    }
}
