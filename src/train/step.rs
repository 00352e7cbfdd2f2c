//! One training step: samples to batches, forward, losses, backward, update.
//!
//! ```text
//! the samples of this process's groups                       drawn while the step before ran
//! share the weights of all groups' classes                   so that the loss is a mean over the whole step
//! for each of this process's groups:
//!     forward and losses, with the running statistics as they were before the step
//!     backward, unless it is the last one
//! share losses and scores; any failure ends the step on all processes
//! last group backward; layer by layer, join the sum over all groups
//! clip, SGD, running statistics = mean over the groups       on every process, from the same bits
//! ```

use super::buckets::Buckets;
use super::groups::{self, Groups, PartialSums};
use super::{Reduction, Run, Settings};
use crate::data::{Sample, SampleSource};
use crate::exec::processes::{Processes, share_numbers};
use crate::exec::{memory, par};
use crate::learn::loss::{CrossEntropy, share_loss};
use crate::learn::metrics::Confusion;
use crate::learn::optim::Sgd;
use crate::model::heads::{N_HEADS, SHARE_HEAD};
use crate::model::{AnyBatch, AnyModel, AnySaved, Domain, Shape, SiteNetwork, TrainingPass};
use crate::nn::arena::Arena;
use crate::numeric::rng::{Purpose, Stream};
use crate::simd::Isa;
use crate::simd::elementwise::scale;
use crate::{Error, Result};
use std::ops::Range;

/// Work space that is kept from step to step.
#[derive(Debug, Default)]
pub(super) struct StepScratch {
    arena: Arena<f32>,
    /// Sums over groups; empty where each layer is updated as soon as its gradient is whole.
    sums: PartialSums,
    /// By head.
    dlogits: Vec<Vec<f32>>,
    /// In which order processes join the gradient, once a backward pass has shown it.
    buckets: Option<Buckets>,
}

/// What a group, or a step, found.
#[derive(Default)]
pub(super) struct StepOutcome {
    pub loss: f64,
    pub confusion: [Confusion; 2],
    /// What the samples were.
    pub domain: Option<Domain>,
}

/// Numbers of a [`StepOutcome`].
const N_NUMBERS: usize = 21;

impl StepOutcome {
    /// For other processes: loss, counts of both heads, domain.
    fn to_numbers(&self) -> Vec<f64> {
        let counts = self.confusion.iter().flat_map(|c| c.to_array()).map(|n| n as f64);
        let domain = self.domain.iter().flat_map(|domain| domain.ranges()).flatten();
        std::iter::once(self.loss).chain(counts).chain(domain).collect()
    }

    /// Adds what a group has found, from its numbers.
    fn add(&mut self, numbers: &[f64]) {
        let (head, domain) = numbers.split_at(9);
        self.loss += head[0];
        for (sum, counts) in self.confusion.iter_mut().zip(head[1..].as_chunks::<4>().0) {
            *sum += Confusion::from_array(counts.map(|n| n as u64));
        }
        let seen = Domain::from_ranges(std::array::from_fn(|i| [domain[2 * i], domain[2 * i + 1]]));
        self.domain.get_or_insert(seen).include(&seen);
    }
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
    crate::exec::par::map(indices.len(), one).into_iter().collect()
}

/// Random streams of this process's samples of a step, one for each.
pub(super) struct Streams {
    dropout: Vec<Stream>,
    /// What the network draws from its input.
    neighbors: Vec<Stream>,
}

impl Streams {
    pub fn new(seed: u64, epoch: u64, indices: &[usize]) -> Self {
        let of = |purpose| {
            indices.iter().map(|&i| Stream::new(seed, epoch, i as u64, purpose)).collect()
        };
        Streams { dropout: of(Purpose::Dropout), neighbors: of(Purpose::Neighbors) }
    }

    /// Those of the samples at `places`.
    fn at(&mut self, places: Range<usize>) -> (&mut [Stream], &mut [Stream]) {
        (&mut self.dropout[places.clone()], &mut self.neighbors[places])
    }
}

/// Classes of both heads: 0 = inaccessible, and 1 = occlusion point.
pub(super) fn targets(samples: &[Sample]) -> [Vec<u8>; 2] {
    let head1 = samples.iter().flat_map(|s| s.answers.inaccessible()).map(|l| u8::from(!l));
    let head2 = samples.iter().flat_map(|s| &s.answers.occlusion).map(|l| u8::from(*l));
    [head1.collect(), head2.collect()]
}

/// Targets of a head that tells the share of accessible directions.
fn share_targets(samples: &[Sample]) -> Result<Vec<f32>> {
    let lacks = |s: &&Sample| s.answers.accessible_share.len() != s.sites.len();
    if let Some(sample) = samples.iter().find(lacks) {
        let found = "no shares of accessible directions";
        let remedy = "train without share_head, or with labels that count directions";
        return Err(Error::geometry(format!("sample {}", sample.name), found, remedy));
    }
    Ok(samples.iter().flat_map(|s| s.answers.accessible_share.iter().copied()).collect())
}

/// Class that counts as positive in each head.
pub(super) const POSITIVE: [u8; 2] = [0, 1];

/// One step among others.
#[derive(Clone, Copy)]
pub(super) struct Step<'a> {
    /// Learning rate.
    pub lr: f64,
    /// Names the step in an error.
    pub place: &'a str,
    pub groups: Groups,
    pub processes: &'a dyn Processes,
}

/// A group's input, and what its forward pass saved.
type Passed = (AnyBatch<f32>, TrainingPass<f32, AnySaved<f32>>);

impl Run {
    /// Learns from the samples of all processes; `samples` and `streams` are those of this one's groups.
    pub(super) fn learn(
        &mut self,
        step: Step<'_>,
        samples: Result<Vec<Sample>>,
        streams: &mut Streams,
    ) -> Result<StepOutcome> {
        let (last, outcome) = self.forward(step, samples, streams)?;
        let Run { settings, progress, model, velocity, scratch } = self;
        let sgd = Sgd { momentum: settings.momentum, weight_decay: settings.weight_decay };
        if step.groups.len() == 1 && settings.clip_norm.is_none() {
            let dlogits = slices(&scratch.dlogits);
            let mut update = |range: Range<usize>, grads: &mut [f32], params: &mut [f32]| {
                sgd.step(step.lr, grads, &mut velocity[range], params);
            };
            model.backward_and_update(&last.0, last.1, &dlogits, &mut update, &scratch.arena);
        } else {
            let mut sum = scratch.join(model, last, step);
            let (grads, buffers) = sum.split_at_mut(model.params.len());
            if let Some(most) = settings.clip_norm {
                clip(grads, most);
            }
            sgd.step(step.lr, grads, velocity, &mut model.params);
            for (buffer, sum) in model.buffers.iter_mut().zip(buffers) {
                *buffer = *sum / step.groups.len() as f32;
            }
            scratch.sums.recycle(sum);
        }
        if let Some(seen) = outcome.domain {
            progress.domain.get_or_insert(seen).include(&seen);
        }
        model.domain = progress.domain;
        Ok(outcome)
    }

    /// This process's groups forward, and all but the last backward; the last one's pass, and what all
    /// processes found.
    fn forward(
        &mut self,
        step: Step<'_>,
        samples: Result<Vec<Sample>>,
        streams: &mut Streams,
    ) -> Result<(Passed, StepOutcome)> {
        let Run { settings, model, scratch, .. } = self;
        let (own, first) = (step.groups.own(), step.groups.own_samples().start);
        let places = |group| {
            let samples = step.groups.samples(group);
            samples.start - first..samples.end - first
        };
        let criteria = [0, 1].map(|head| criterion(settings, head));
        let weights = |samples: &Vec<Sample>| -> Vec<f64> {
            let targets = own.clone().map(|group| targets(&samples[places(group)]));
            let of_group = |[first, second]: [Vec<u8>; N_HEADS]| {
                let [i, o] = &criteria;
                [i.total_weight(&first), o.total_weight(&second), first.len() as f64]
            };
            targets.flat_map(of_group).collect()
        };
        let (samples, weights) = share_numbers(step.processes, samples, weights)?;
        let weights = weights.as_chunks::<{ N_HEADS + 1 }>().0;
        let totals = [0, 1, SHARE_HEAD].map(|head| weights.iter().map(|w| w[head]).sum::<f64>());
        let scale = match settings.loss.reduction {
            Reduction::Sum => 1.0,
            Reduction::Mean => 0.5,
        };
        let scales = [scale, scale, scale * settings.loss.share_weight.unwrap_or(1.0)];
        scratch.sums.clear(step.groups.len());
        let (before, mut found) = (model.buffers.clone(), Vec::new());
        let mut pass = |group: usize, model: &mut _, scratch: &mut StepScratch| -> Result<Passed> {
            let model: &mut AnyModel<f32> = model;
            model.buffers.copy_from_slice(&before);
            let share = |head| scales[head] * (weights[group][head] / totals[head]);
            let shares = [0, 1, SHARE_HEAD].map(share);
            let (samples, streams) = (&samples[places(group)], streams.at(places(group)));
            let (passed, outcome) = scratch.forward(model, samples, streams, &criteria, shares)?;
            if !outcome.loss.is_finite() {
                return Err(not_finite(step.place, outcome.loss, samples));
            }
            found.extend(outcome.to_numbers());
            Ok(passed)
        };
        let last = (own.start..own.end - 1).try_for_each(|group| {
            let passed = pass(group, model, scratch)?;
            let leaf = scratch.leaf(model, passed);
            scratch.sums.push(group..group + 1, leaf);
            Ok(())
        });
        let last = last.and_then(|()| pass(own.end - 1, model, scratch));
        let (last, found) = share_numbers(step.processes, last, |_| found)?;
        let mut outcome = StepOutcome::default();
        found.chunks_exact(N_NUMBERS).for_each(|group| outcome.add(group));
        Ok((last, outcome))
    }
}

impl StepScratch {
    /// A group forward: what its backward needs beside `dlogits`, which become `shares` times the gradients of the mean
    /// losses by the logits; and what it found.
    fn forward(
        &mut self,
        model: &mut AnyModel<f32>,
        samples: &[Sample],
        (dropout, neighbors): (&mut [Stream], &mut [Stream]),
        criteria: &[CrossEntropy; 2],
        shares: [f64; N_HEADS + 1],
    ) -> Result<(Passed, StepOutcome)> {
        let shapes: Vec<Shape> = samples.iter().map(Sample::shape).collect();
        let (batch, targets) = (model.net.batch(&shapes, Some(neighbors))?, targets(samples));
        let remedy = match samples.len() {
            1 => "lower the network's widths, or its depth".into(),
            n => format!("raise n_groups or lower batch_size ({n} samples pass at once)"),
        };
        let needed = model.net.pass_bytes(&batch, true);
        let held = self.arena.reserved_bytes() as u64;
        memory::require("the training step", needed.saturating_sub(held), remedy)?;
        let pass = model.forward_train(&batch, Some(dropout), &self.arena);
        let mut outcome = StepOutcome::default();
        self.dlogits.resize_with(pass.logits.len(), Vec::new);
        for head in 0..N_HEADS {
            let (logits, targets) = (&pass.logits[head], &targets[head]);
            let (share, dlogits) = (shares[head], &mut self.dlogits[head]);
            outcome.loss += share * criteria[head].loss(logits, targets, share, dlogits);
            outcome.confusion[head] += Confusion::of_logits(logits, targets, POSITIVE[head]);
        }
        if let Some(logits) = pass.logits.get(SHARE_HEAD) {
            let (targets, dlogits) = (share_targets(samples)?, &mut self.dlogits[SHARE_HEAD]);
            let share = shares[SHARE_HEAD];
            outcome.loss += share * share_loss(logits, &targets, share, dlogits);
        }
        for sample in samples {
            let seen = Domain::of(&sample.sites.points, sample.cutter);
            outcome.domain.get_or_insert(seen).include(&seen);
        }
        Ok(((batch, pass), outcome))
    }

    /// A group's backward: its gradient, and after it the running statistics as it has moved them.
    fn leaf(&mut self, model: &AnyModel<f32>, (batch, pass): Passed) -> Vec<f32> {
        let n_params = model.params.len();
        let mut leaf = self.sums.zeros(n_params + model.buffers.len());
        let (grads, buffers) = leaf.split_at_mut(n_params);
        model.backward(&batch, pass, &slices(&self.dlogits), grads, &self.arena);
        buffers.copy_from_slice(&model.buffers);
        leaf
    }

    /// The last group's backward, and the sum over all groups.
    fn join(&mut self, model: &mut AnyModel<f32>, last: Passed, step: Step<'_>) -> Vec<f32> {
        if step.processes.size() > 1 {
            return self.join_processes(model, last, step);
        }
        let (leaf, n) = (self.leaf(model, last), step.groups.len());
        self.sums.push(n - 1..n, leaf);
        self.sums.take_root()
    }

    /// [`StepScratch::join`] with other processes, layer by layer while backward goes on.
    fn join_processes(
        &mut self,
        model: &mut AnyModel<f32>,
        (batch, pass): Passed,
        Step { groups, processes, .. }: Step<'_>,
    ) -> Vec<f32> {
        let n_params = model.params.len();
        let mut leaf = self.sums.zeros(n_params + model.buffers.len());
        let known = self.buckets.take();
        let buckets = known.unwrap_or_else(|| Buckets::whole(leaf.len()));
        let StepScratch { arena, sums, dlogits, .. } = self;
        let dlogits = slices(dlogits);
        let (mut order, mut completed) = (Vec::new(), buckets.start());
        let exchange = |nodes: Vec<Vec<f32>>| groups::join(processes, &groups, &nodes);
        let joined = par::with_background(exchange, |send| {
            let mut collect = |range: Range<usize>, grads: &mut [f32], _: &mut [f32]| {
                leaf[range.clone()].copy_from_slice(grads);
                for bucket in completed.add(&range) {
                    send(sums.with_last(&groups, &leaf, bucket));
                }
                order.push(range);
            };
            model.backward_and_update(&batch, pass, &dlogits, &mut collect, arena);
            leaf[n_params..].copy_from_slice(&model.buffers);
            for bucket in completed.rest() {
                send(sums.with_last(&groups, &leaf, bucket));
            }
        });
        buckets.scatter(&joined, &mut leaf);
        self.buckets = Some(match buckets.is_whole() {
            true => Buckets::in_order(processes, &order, leaf.len()),
            false => buckets,
        });
        leaf
    }
}

fn slices(vectors: &[Vec<f32>]) -> Vec<&[f32]> {
    vectors.iter().map(|v| &v[..]).collect()
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
    let squares = crate::exec::par::map_blocks(grads.len(), CLIP_BLOCK, |range| {
        grads[range].iter().map(|g| f64::from(*g) * f64::from(*g)).sum::<f64>()
    });
    let norm = squares.iter().sum::<f64>().sqrt();
    if norm > most {
        let factor = (most / norm) as f32;
        crate::exec::par::for_each_block(grads, CLIP_BLOCK, |_, block| {
            scale(Isa::active(), factor, block);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::SiteAnswers;
    use crate::exec::processes::SingleProcess;
    use crate::geom::Sites;
    use crate::model::config::CutterConfig;
    use crate::tool::cutter::CutterParams;
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
            Sample::new(name, sites, cutter, answers)
        };
        [90, 40].map(sample).into()
    }

    /// Loss of one step, and what it adds to the parameters.
    fn step(n_groups: usize, samples: &[Sample]) -> (f64, Vec<f32>) {
        clipped_step(None, n_groups, samples)
    }

    fn clipped_step(
        clip_norm: Option<f64>,
        n_groups: usize,
        samples: &[Sample],
    ) -> (f64, Vec<f32>) {
        let mut settings = Settings { n_groups, clip_norm, ..Settings::tiny() };
        // A single shape has no statistics of its cutter.
        *settings.network.cutter_mut() = CutterConfig::small_batches();
        settings.loss.positive_weights = Some([2.0, 5.0]);
        let mut run = Run::new(settings).unwrap();
        let start = run.model.params.clone();
        let mut streams = Streams::new(1, 0, &(0..samples.len()).collect::<Vec<_>>());
        let groups = Groups::new(samples.len(), n_groups, &SingleProcess);
        let step = Step { lr: 0.1, place: "here", groups, processes: &SingleProcess };
        let outcome = run.learn(step, Ok(samples.to_vec()), &mut streams).unwrap();
        let moved = run.model.params.iter().zip(&start).map(|(new, old)| new - old);
        (outcome.loss, moved.collect())
    }

    #[test]
    fn a_head_that_tells_shares_learns_them_and_wants_them() {
        let mut samples = samples();
        let mut settings = Settings { clip_norm: None, ..Settings::tiny() };
        *settings.network.cutter_mut() = CutterConfig::small_batches();
        settings.network.octree_mut().unwrap().share_head = true;
        let mut run = Run::new(settings).unwrap();
        let learn = |run: &mut Run, samples: &[Sample]| {
            let mut streams = Streams::new(1, 0, &[0, 1]);
            let groups = Groups::new(2, 1, &SingleProcess);
            let step = Step { lr: 0.02, place: "here", groups, processes: &SingleProcess };
            run.learn(step, Ok(samples.to_vec()), &mut streams)
        };
        let message = learn(&mut run, &samples).err().unwrap().to_string();
        assert!(message.starts_with("sample 90 sites: no shares of accessible"), "{message}");
        for sample in &mut samples {
            let share = |p: &Vec3| if p.x > 20.0 { 0.0 } else { 0.5 };
            sample.answers.accessible_share = sample.sites.points.iter().map(share).collect();
        }
        let error = |run: &Run| {
            let found = super::super::evaluate(&run.model, &samples).unwrap();
            found.share_error().unwrap()
        };
        let before = error(&run);
        for _ in 0..60 {
            learn(&mut run, &samples).unwrap();
        }
        assert!(error(&run) < 0.5 * before && error(&run) < 0.15, "{before} {}", error(&run));
        let Sample { sites, cutter, .. } = &samples[0];
        let found = run.model.predict(&sites.points, &sites.normals, cutter.to_array()).unwrap();
        assert_eq!(found.answers().accessible_share, found.accessible_share);
        assert!(found.accessible_share.iter().all(|share| (0.0..=1.0).contains(share)));
    }

    /// Clipping needs the gradient of all parameters at once, an update layer by layer never has it.
    #[test]
    fn an_update_layer_by_layer_changes_no_bit() {
        let samples = samples();
        assert_eq!(step(1, &samples), clipped_step(Some(1e30), 1, &samples));
    }

    /// Equal samples have equal statistics, so that groups differ from the whole by rounding alone; the
    /// weights of classes are those of the whole step.
    #[test]
    fn groups_add_up_to_the_step() {
        let sample = samples().swap_remove(0);
        let samples = [sample.clone(), sample];
        let ((whole_loss, whole), (loss, moved)) = (step(1, &samples), step(2, &samples));
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
