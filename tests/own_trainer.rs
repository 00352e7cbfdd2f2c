//! A network of one's own, with heads of five and of three classes and dropout: trained, stopped, stored and resumed.

use deepmill::loss::CrossEntropy;
use deepmill::metrics::ConfusionMatrix;
use deepmill::model::{Calibration, Model, Network, TrainingPass};
use deepmill::nn::arena::{Arena, Buffer};
use deepmill::nn::batch_norm::BatchNorm;
use deepmill::nn::dropout::Dropout;
use deepmill::nn::layer::Layer;
use deepmill::nn::linear::Linear;
use deepmill::nn::linear_norm_act::{LinearNormAct, SavedLinearNormAct};
use deepmill::nn::operand::Operand;
use deepmill::nn::params::Layout;
use deepmill::nn::pass::{Backward, Inference, Training};
use deepmill::nn::saved::Policy;
use deepmill::optim::{Schedule, Sgd};
use deepmill::rng::{Purpose, Stream};
use deepmill::train::Trainer;
use deepmill::{Error, Result, par};
use std::ops::ControlFlow;

const WIDTH: usize = 16;
const HEADS: [usize; 2] = [5, 3];

/// Linear, norm, ReLU, dropout, and a linear layer for each head.
#[derive(Debug, Clone)]
struct Classifier {
    layout: Layout,
    hidden: LinearNormAct<Linear>,
    dropout: Dropout,
    heads: [Linear; 2],
}

/// Points of a plane, `[n, 2]`.
struct Points(Vec<f32>);

struct Kept {
    hidden: Buffer<f32>,
    of_hidden: SavedLinearNormAct<f32>,
    dropped: Buffer<f32>,
    of_dropout: Option<Buffer<f32>>,
}

impl Classifier {
    fn new() -> Self {
        Self::named("first")
    }

    fn named(name: &str) -> Self {
        let mut layout = Layout::default();
        let hidden = LinearNormAct {
            linear: Linear::new(&mut layout, name, 2, WIDTH, false),
            norm: BatchNorm::new(&mut layout, "norm", WIDTH),
            relu: true,
            policy: Policy::Save,
        };
        let head = |i| Linear::new(&mut layout, &format!("head.{i}"), WIDTH, HEADS[i], true);
        let heads = [0, 1].map(head);
        Classifier { layout, hidden, dropout: Dropout::new(0.1).unwrap(), heads }
    }
}

impl Network<f32> for Classifier {
    type Batch = Points;
    type Saved = Kept;

    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn n_shapes(&self, batch: &Points) -> usize {
        batch.0.len() / 2
    }

    fn logits(&self, pass: &Inference<f32>, batch: &Points) -> Vec<Buffer<f32>> {
        let hidden = self.hidden.forward(pass, &(), Operand::new(&batch.0, 2));
        let x = Operand::new(&hidden, WIDTH);
        self.heads.iter().map(|head| head.forward(pass, &(), x)).collect()
    }

    fn forward_train(&self, pass: &mut Training<f32>, batch: &Points) -> TrainingPass<f32, Kept> {
        let x = Operand::new(&batch.0, 2);
        let (hidden, of_hidden) = self.hidden.forward_train(pass, &(), x);
        let x = Operand::new(&hidden, WIDTH);
        let (dropped, of_dropout) = self.dropout.forward_train(pass, &(), x);
        let x = Operand::new(&dropped, WIDTH);
        let logits = self.heads.iter().map(|head| head.forward_train(pass, &(), x).0).collect();
        TrainingPass::new(logits, Kept { hidden, of_hidden, dropped, of_dropout })
    }

    fn backward(
        &self,
        pass: &mut Backward<f32>,
        batch: &Points,
        forward: TrainingPass<f32, Kept>,
        dlogits: &[&[f32]],
    ) {
        let Kept { hidden, of_hidden, dropped, of_dropout } = forward.into_saved();
        let mut sum = pass.arena.zeroed(dropped.len());
        for (head, dlogits) in self.heads.iter().zip(dlogits) {
            let dy = pass.arena.copy_of(dlogits);
            let dx = head.backward(pass, &(), Operand::new(&dropped, WIDTH), (), dy).into_first();
            sum.iter_mut().zip(&dx[..]).for_each(|(sum, dx)| *sum += dx);
        }
        let x = Operand::new(&hidden, WIDTH);
        let dy = self.dropout.backward(pass, &(), x, of_dropout, sum).into_first();
        self.hidden.backward(pass, &(), Operand::new(&batch.0, 2), of_hidden, dy);
    }
}

type Classes = [Vec<u8>; 2];
type Loss<'a> = &'a dyn Fn(&[Buffer<f32>], &mut [Vec<f32>]) -> Result<f64>;

/// Points, and in which of five strips and of three others they lie.
fn source(epoch: u64, step: u64) -> Result<(Points, Classes)> {
    let mut stream = Stream::new(5, epoch, step, Purpose::Probe);
    let points: Vec<f32> = (0..256).map(|_| stream.range(0.0, 1.0) as f32).collect();
    let strips =
        |k: usize| points.iter().skip(k).step_by(2).map(|x| (x * HEADS[k] as f32) as u8).collect();
    let classes = [strips(0), strips(1)];
    Ok((Points(points), classes))
}

fn loss(logits: &[Buffer<f32>], classes: &Classes, dlogits: &mut [Vec<f32>]) -> Result<f64> {
    let mut sum = 0.0;
    for (head, d) in dlogits.iter_mut().enumerate() {
        let criterion = CrossEntropy::equal(HEADS[head]);
        sum += criterion.try_loss(&logits[head], &classes[head], 1.0, d)?;
    }
    Ok(sum)
}

fn trainer() -> Trainer<Classifier> {
    let sgd = Sgd::new(0.9, 1e-4);
    let trainer = Trainer::new(Classifier::new(), 3, (12, 5)).unwrap();
    trainer.with_sgd(0.2, sgd).unwrap().with_schedule(Schedule::Cosine { min_lr: 1e-3 }).unwrap()
}

/// Trains for at most `n_steps`; whether that was to the end.
fn run(trainer: &mut Trainer<Classifier>, n_steps: usize) -> bool {
    let mut left = n_steps;
    let observer = |_: &Trainer<Classifier>, _| {
        left -= 1;
        Ok(if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    };
    trainer.train(source, loss, observer).unwrap().is_continue()
}

fn bits(trainer: &Trainer<Classifier>) -> Vec<u32> {
    let Model { params, buffers, .. } = trainer.model();
    params.iter().chain(buffers).map(|x| x.to_bits()).collect()
}

#[test]
fn it_learns_both_labels() {
    let mut trainer = trainer();
    assert!(run(&mut trainer, usize::MAX) && trainer.is_finished());
    let (points, classes) = source(99, 0).unwrap();
    let logits = trainer.model().logits(&points, &Arena::default());
    let (others, of_others) = source(98, 0).unwrap();
    let validation = trainer.model().logits(&others, &Arena::default());
    for (head, n_classes) in HEADS.into_iter().enumerate() {
        let fit = Calibration::fit(&validation[head], &of_others[head], n_classes).unwrap();
        let mut calibrated = logits[head].to_vec();
        fit.calibrate(&mut calibrated, n_classes).unwrap();
        let loss = |logits: &[f32]| {
            let criterion = CrossEntropy::equal(n_classes);
            criterion.try_loss(logits, &classes[head], 1.0, &mut Vec::new()).unwrap()
        };
        let (before, after) = (loss(&logits[head]), loss(&calibrated));
        assert!(after < before, "head {head}: {after} after {before}");
        let mut counts = ConfusionMatrix::new(n_classes).unwrap();
        counts.add_logits(&logits[head], &classes[head]).unwrap();
        assert!(counts.accuracy() > 0.75 && counts.mean_iou() > 0.5, "head {head}: {counts:?}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let on = |n| {
        let trained = || {
            let mut trainer = trainer();
            run(&mut trainer, 9);
            bits(&trainer)
        };
        par::with_threads(n, trained).unwrap()
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn a_step_that_fails_changes_nothing() {
    let mut trainer = trainer();
    run(&mut trainer, 2);
    let before = (bits(&trainer), trainer.position());
    let mut fails = |loss: Loss, words: &str| {
        let error = trainer.step(&source(1, 2).unwrap().0, loss).unwrap_err().to_string();
        assert!(error.starts_with(words), "{error}");
        assert_eq!((bits(&trainer), trainer.position()), before);
    };
    let zeros = |logits: &[Buffer<f32>], dlogits: &mut [Vec<f32>]| {
        dlogits.iter_mut().zip(logits).for_each(|(d, of)| d.resize(of.len(), 0.0));
    };
    fails(&|_, _| Err(Error::argument("label", 7, "fewer", "repair it")), "label is 7");
    fails(
        &|logits, dlogits| {
            zeros(logits, dlogits);
            Ok(f64::NAN)
        },
        "epoch 1, step 3: the loss is NaN; ",
    );
    fails(
        &|logits, dlogits| {
            zeros(logits, dlogits);
            dlogits[1].clear();
            Ok(1.0)
        },
        "number of gradients by logits is 0 for head 1, expected 384",
    );
    let wrong = |_, _| Ok((source(1, 2)?.0, [vec![0; 128], vec![3; 128]]));
    let error = trainer.train(wrong, loss, |_, _| unreachable!()).unwrap_err().to_string();
    assert!(error.starts_with("target is 3 in row 0, expected below 3"), "{error}");
    assert_eq!((bits(&trainer), trainer.position()), before);
}

#[test]
fn settings_out_of_their_domain_and_steps_after_the_last_are_refused() {
    let new = |steps| Trainer::new(Classifier::new(), 1, steps);
    let message = |trainer: Result<Trainer<Classifier>>| trainer.unwrap_err().to_string();
    assert!(message(new((0, 5))).starts_with("n_epochs is 0"));
    assert!(message(new((5, 0))).starts_with("n_steps is 0"));
    let with = |lr, momentum| new((1, 1)).unwrap().with_sgd(lr, Sgd::new(momentum, 0.0));
    assert!(message(with(f64::NAN, 0.9)).starts_with("lr is NaN"));
    assert!(message(with(0.1, 1.0)).starts_with("momentum is 1"));
    let schedule = Schedule::Cosine { min_lr: -1.0 };
    assert!(message(new((1, 1)).unwrap().with_schedule(schedule)).starts_with("schedule is "));
    let other = Model::with_network(Classifier::named("second"), 1);
    let message = message(new((1, 1)).unwrap().start_from(other));
    assert!(message.starts_with("model to start from is another network"), "{message}");
    let model = Model::with_network(Classifier::new(), 9);
    let mut trainer = new((1, 1)).unwrap().start_from(model.clone()).unwrap();
    assert_eq!(trainer.model().params, model.params);
    assert!(run(&mut trainer, 2));
    let (batch, classes) = source(1, 1).unwrap();
    let error = trainer.step(&batch, |logits, d| loss(logits, &classes, d)).unwrap_err();
    assert!(error.to_string().starts_with("training step is after the last"), "{error}");
}

#[cfg(feature = "formats")]
mod files {
    use super::*;

    #[test]
    fn a_training_stopped_anywhere_and_resumed_ends_with_the_same_bits_and_the_same_file() {
        let folder = tempfile::tempdir().unwrap();
        let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(name));
        let mut expected = trainer();
        assert!(run(&mut expected, usize::MAX));
        expected.write(&whole).unwrap();
        for stops in [&[1][..], &[5], &[7, 6, 20], &[59, 1]] {
            let mut stopped = trainer();
            for n_steps in stops {
                assert!(!run(&mut stopped, *n_steps));
                stopped.write(&parts).unwrap();
                stopped = Trainer::resume(Classifier::new(), &parts).unwrap();
            }
            run(&mut stopped, usize::MAX);
            stopped.write(&parts).unwrap();
            assert_eq!(bits(&stopped), bits(&expected), "stopped after {stops:?}");
            assert!(std::fs::read(&parts).unwrap() == std::fs::read(&whole).unwrap());
        }
    }

    #[test]
    fn tensors_are_read_back_bit_by_bit_from_either_file() {
        let folder = tempfile::tempdir().unwrap();
        let [state, tensors] = ["state", "tensors"].map(|name| folder.path().join(name));
        let mut trainer = trainer();
        run(&mut trainer, 3);
        trainer.write(&state).unwrap();
        trainer.model().write_tensors(&tensors).unwrap();
        for path in [&state, &tensors] {
            let read = Model::<f32, _>::read_tensors(Classifier::new(), path).unwrap();
            assert_eq!(read.params, trainer.model().params);
            assert_eq!(read.buffers, trainer.model().buffers);
        }
    }

    #[test]
    fn files_that_are_damaged_or_of_another_network_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [state, other] = ["state", "other"].map(|name| folder.path().join(name));
        let mut trainer = trainer();
        run(&mut trainer, 3);
        trainer.write(&state).unwrap();
        let refused = |net, path: &std::path::Path, words: &str| {
            let error = Trainer::resume(net, path).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        };
        refused(Classifier::named("second"), &state, "tensor second.weight: it is missing");
        trainer.model().write_tensors(&other).unwrap();
        refused(Classifier::new(), &other, "deepmill_training: it is not in the metadata");
        let bytes = std::fs::read(&state).unwrap();
        for at in [bytes.len() - 1, bytes.len() - 300] {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1;
            std::fs::write(&other, &damaged).unwrap();
            refused(Classifier::new(), &other, "content hash: the file is damaged; use an earlier");
        }
        let text = String::from_utf8_lossy(&bytes);
        let place = text.find("steps_done").unwrap() + "steps_done\\\":".len();
        let mut damaged = bytes.clone();
        assert_eq!(damaged[place], b'3');
        damaged[place] = b'4';
        std::fs::write(&other, &damaged).unwrap();
        refused(Classifier::new(), &other, "content hash: the file is damaged");
        let error = Trainer::new(Classifier::named("velocity:a"), 1, (1, 1)).unwrap_err();
        assert!(error.to_string().starts_with("name of a tensor is `velocity:a"), "{error}");
    }
}
