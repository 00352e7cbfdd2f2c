//! One optimisation step: samples to batch, forward, losses, backward, update.

use super::{Reduction, Run, Settings};
use crate::data::{Sample, Source};
use crate::loss::CrossEntropy;
use crate::metrics::Confusion;
use crate::model::{Batch, Model, Shape, Workspace};
use crate::optim::Sgd;
use crate::rng::{Purpose, Stream};
use crate::{Error, Result};

/// Memory of a step that lives on between steps.
#[derive(Debug, Default)]
pub(super) struct Memory {
    work: Workspace<f32>,
    grads: Vec<f32>,
    dlogits: [Vec<f32>; 2],
}

/// What one step found.
pub(super) struct Outcome {
    pub loss: f64,
    pub confusion: [Confusion; 2],
}

/// The samples `indices` of `epoch`, augmented; in parallel, in order.
pub(super) fn draw(
    source: &(impl Source + ?Sized),
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
    let head1 = samples.iter().flat_map(|s| s.inaccessible.iter().map(|l| u8::from(!*l)));
    let head2 = samples.iter().flat_map(|s| s.occlusion.iter().map(|l| u8::from(*l)));
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
    ) -> Result<Outcome> {
        let Run { settings, model, velocity, memory, .. } = self;
        let batch = batch(model, samples)?;
        let targets = targets(samples);
        model.forward_train(&batch, Some(dropout), &mut memory.work);
        let scale = match settings.loss.reduction {
            Reduction::Sum => 1.0,
            Reduction::Mean => 0.5,
        };
        let mut outcome = Outcome { loss: 0.0, confusion: Default::default() };
        for head in 0..2 {
            let (logits, targets) = (&memory.work.logits[head], &targets[head]);
            let criterion = criterion(settings, head);
            let dlogits = &mut memory.dlogits[head];
            outcome.loss += scale * criterion.loss(logits, targets, scale, dlogits);
            outcome.confusion[head] = Confusion::of_logits(logits, targets, POSITIVE[head]);
        }
        if !outcome.loss.is_finite() {
            return Err(not_finite(place, outcome.loss, samples));
        }
        memory.grads.clear();
        memory.grads.resize(model.params.len(), 0.0);
        let [first, second] = &memory.dlogits;
        model.backward(&batch, [first, second], &mut memory.work, &mut memory.grads);
        if let Some(most) = settings.clip_norm {
            clip(&mut memory.grads, most);
        }
        let sgd = Sgd { momentum: settings.momentum, weight_decay: settings.weight_decay };
        sgd.step(lr, &memory.grads, velocity, &mut model.params);
        Ok(outcome)
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
            block.iter_mut().for_each(|g| *g *= factor);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipping_shortens_long_gradients_only() {
        let mut grads = vec![3.0, 4.0];
        clip(&mut grads, 10.0);
        assert_eq!(grads, [3.0, 4.0]);
        clip(&mut grads, 1.0);
        assert!((grads[0] - 0.6).abs() < 1e-6 && (grads[1] - 0.8).abs() < 1e-6);
    }
}
