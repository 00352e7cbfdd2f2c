//! The training loop of a network of one's own: any input, heads and loss, with stop and resume.

use crate::learn::optim::{Schedule, Sgd};
use crate::model::{Model, Network};
use crate::nn::arena::{Arena, Buffer};
use crate::numeric::rng::{Purpose, Stream};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// A network of one's own with its optimizer and how far its training has come: epochs of steps, each on a batch of the
/// caller's. The settings are momentum 0.9, weight decay 1e-4 and a learning rate of 0.1 that stays, unless others are
/// given.
///
/// Every random decision is keyed by (seed, epoch, step), and all of the state is in one file: a training that was
/// stopped and resumed ends with the bits of one that was not, if its source makes batches from the numbers of epoch
/// and step alone. `examples/own_network.rs` has all of it.
///
/// ```
/// use deepmill::glam::Vec3;
/// use deepmill::loss::CrossEntropy;
/// use deepmill::model::{Batch, Shape, UNet, UNetConfig};
/// use deepmill::{nn::arena::Buffer, train::Trainer};
/// use std::ops::ControlFlow::{Break, Continue};
///
/// # let points = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
/// # let shape = Shape::new(&points, &[Vec3::Z; 4], [1.5, 6.0, 40.0, 5.0]);
/// let (config, three) = (UNetConfig::tiny(), CrossEntropy::equal(3)); // three classes
/// let source = |_epoch, _step| Ok((Batch::new(&[shape], &config.input)?, [0_u8, 1, 2, 0]));
/// let loss = |logits: &[Buffer<f32>], classes: &[u8; 4], dlogits: &mut [Vec<f32>]| {
///     three.try_loss(&logits[0], classes, 1.0, &mut dlogits[0])
/// };
/// let start = || Trainer::new(UNet::with_heads(&config, &[3])?, 1, (2, 2)); // two epochs of two steps
/// let (mut stopped, mut whole) = (start()?, start()?);
/// let flow = stopped.train(source, loss, |trainer, _| {
///     Ok(if trainer.position() == (2, 1) { Break(()) } else { Continue(()) }) // after three steps
/// })?;
/// assert!(flow.is_break() && !stopped.is_finished());
/// stopped.train(source, loss, |_, _| Ok(Continue(())))?;
/// whole.train(source, loss, |_, _| Ok(Continue(())))?;
/// assert_eq!(stopped.model().params, whole.model().params);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug)]
pub struct Trainer<N> {
    pub(super) model: Model<f32, N>,
    pub(super) velocity: Vec<f32>,
    pub(super) state: State,
    arena: Arena<f32>,
    grads: Vec<f32>,
    /// By head.
    dlogits: Vec<Vec<f32>>,
}

/// Settings and progress: what a file holds beside the tensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    seed: u64,
    n_epochs: u64,
    /// Of an epoch.
    n_steps: u64,
    lr: f64,
    momentum: f64,
    weight_decay: f64,
    schedule: Schedule,
    /// Of all epochs.
    steps_done: u64,
}

/// Numbers for each parameter: parameters, velocity and gradient; copies of the first two for a file, as numbers and
/// bytes.
const N_VECTORS: usize = 9;

impl<N: Network<f32>> Trainer<N> {
    /// `net` with random starting weights, to be trained for `n_epochs` of `n_steps` steps each.
    ///
    /// # Errors
    /// If a number is 0, a name of the layout begins with `velocity:`, as those of the optimizer do, or training does
    /// not fit into the memory.
    pub fn new(net: N, seed: u64, (n_epochs, n_steps): (u64, u64)) -> Result<Self> {
        let schedule = Schedule::Constant;
        let (lr, momentum, weight_decay) = (0.1, 0.9, 1e-4);
        let state =
            State { seed, n_epochs, n_steps, lr, momentum, weight_decay, schedule, steps_done: 0 };
        state.check()?;
        let layout = net.layout();
        layout.require_memory("training", size_of::<f32>() * N_VECTORS)?;
        #[cfg(feature = "formats")]
        crate::model::weights::velocity_layout(layout)?;
        let velocity = vec![0.0; layout.n_params()];
        Ok(Self::of(Model::with_network(net, seed), velocity, state))
    }

    /// With these numbers.
    pub(super) fn of(model: Model<f32, N>, velocity: Vec<f32>, state: State) -> Self {
        let grads = vec![0.0; velocity.len()];
        Trainer { model, velocity, state, arena: Arena::default(), grads, dlogits: Vec::new() }
    }

    /// With another learning rate and optimizer.
    ///
    /// # Errors
    /// If the rate or the weight decay is negative or not finite, or the momentum is not in `[0, 1)`.
    pub fn with_sgd(mut self, lr: f64, sgd: Sgd) -> Result<Self> {
        let Sgd { momentum, weight_decay } = sgd;
        self.state = State { lr, momentum, weight_decay, ..self.state };
        self.state.check()?;
        Ok(self)
    }

    /// With a learning rate that changes from epoch to epoch.
    ///
    /// # Errors
    /// If a number of the schedule is outside its domain.
    pub fn with_schedule(mut self, schedule: Schedule) -> Result<Self> {
        self.state.schedule = schedule;
        self.state.check()?;
        Ok(self)
    }

    /// Begins with the numbers of `model` instead of random ones.
    ///
    /// # Errors
    /// If its network has other tensors.
    pub fn start_from(mut self, model: Model<f32, N>) -> Result<Self> {
        if model.net.layout() != self.model.net.layout() {
            let (found, expected) = ("another network", "that of the trainer");
            let remedy = "build both networks alike";
            return Err(Error::argument("model to start from", found, expected, remedy));
        }
        self.model = model;
        Ok(self)
    }

    /// The network and its numbers.
    pub fn model(&self) -> &Model<f32, N> {
        &self.model
    }

    /// The network and its numbers, without the optimizer.
    pub fn into_model(self) -> Model<f32, N> {
        self.model
    }

    /// The epoch of the next step, from 1, and the step's number in it, from 0.
    pub fn position(&self) -> (u64, u64) {
        let State { steps_done, n_steps, .. } = self.state;
        (steps_done / n_steps + 1, steps_done % n_steps)
    }

    /// Whether all steps are done.
    pub fn is_finished(&self) -> bool {
        self.state.steps_done == self.state.n_epochs * self.state.n_steps
    }

    /// Trains until the last step is done or `observer` stops it; it may go on after that, or be written and resumed.
    ///
    /// `source` makes the batch of an epoch (from 1) and a step in it (from 0), and what `loss` compares with; `loss`
    /// is that of [`Trainer::step`]; `observer` gets the trainer and the loss after each step.
    ///
    /// # Errors
    /// Those of the three, and of [`Trainer::step`]. The trainer is then as after the last step that was done.
    pub fn train<Y>(
        &mut self,
        mut source: impl FnMut(u64, u64) -> Result<(N::Batch, Y)>,
        mut loss: impl FnMut(&[Buffer<f32>], &Y, &mut [Vec<f32>]) -> Result<f64>,
        mut observer: impl FnMut(&Self, f64) -> Result<ControlFlow<()>>,
    ) -> Result<ControlFlow<()>> {
        while !self.is_finished() {
            let (epoch, step) = self.position();
            let (batch, truth) = source(epoch, step)?;
            let loss = self.step(&batch, |logits, dlogits| loss(logits, &truth, dlogits))?;
            if observer(self, loss)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// One step on `batch`; returns the loss.
    ///
    /// `loss` gets the logits of all heads, as [`Network::forward_train`] returns them, and returns the loss with its
    /// gradients, one vector for each head, as long as its logits; [`CrossEntropy`](crate::learn::loss::CrossEntropy)
    /// makes them.
    ///
    /// # Errors
    /// If all steps are done, `loss` fails, a gradient has another length than the logits, or one of the numbers that
    /// it returns is not finite. The trainer is then as it was before.
    pub fn step(
        &mut self,
        batch: &N::Batch,
        loss: impl FnOnce(&[Buffer<f32>], &mut [Vec<f32>]) -> Result<f64>,
    ) -> Result<f64> {
        let place = self.place()?;
        let ((epoch, step), seed) = (self.position(), self.state.seed);
        let key = |shape: u64| (step << u32::BITS) + shape;
        let stream = |shape| Stream::new(seed, epoch, key(shape), Purpose::Dropout);
        let n_shapes = self.model.net.n_shapes(batch) as u64;
        let mut streams: Vec<Stream> = (0..n_shapes).map(stream).collect();
        let before = self.model.buffers.clone();
        let pass = self.model.forward_train(batch, Some(&mut streams), &self.arena);
        self.dlogits.resize_with(pass.logits.len(), Vec::new);
        self.dlogits.iter_mut().for_each(Vec::clear);
        let loss = loss(&pass.logits, &mut self.dlogits);
        let loss = loss.and_then(|loss| checked(&place, loss, &pass.logits, &self.dlogits));
        if loss.is_err() {
            self.model.buffers = before;
            return loss;
        }
        let dlogits: Vec<&[f32]> = self.dlogits.iter().map(Vec::as_slice).collect();
        self.model.backward(batch, pass, &dlogits, &mut self.grads, &self.arena);
        let State { lr, momentum, weight_decay, n_epochs, .. } = self.state;
        let lr = self.state.schedule.lr(lr, epoch, n_epochs);
        let sgd = Sgd { momentum, weight_decay };
        sgd.step(lr, &mut self.grads, &mut self.velocity, &mut self.model.params);
        self.state.steps_done += 1;
        loss
    }

    /// Names the next step in an error.
    fn place(&self) -> Result<String> {
        let (epoch, step) = self.position();
        if self.is_finished() {
            let State { n_epochs, n_steps, .. } = self.state;
            let (found, expected) = ("after the last".to_owned(), "one that is left");
            let remedy = format!("give the trainer more than {n_epochs} epochs of {n_steps} steps");
            return Err(Error::argument("training step", found, expected, remedy));
        }
        Ok(format!("epoch {epoch}, step {}", step + 1))
    }
}

/// The loss, if it and its gradients are what they should be.
fn checked(place: &str, loss: f64, logits: &[Buffer<f32>], dlogits: &[Vec<f32>]) -> Result<f64> {
    if !loss.is_finite() {
        return Err(Error::NotFinite {
            place: place.into(),
            found: format!("the loss is {loss}"),
            remedy: "lower the learning rate".into(),
        });
    }
    let mut lengths = logits.iter().zip(dlogits).map(|(of, d)| (of.len(), d.len()));
    match lengths.position(|(n, found)| n != found) {
        None => require_finite(place, dlogits).map(|()| loss),
        Some(head) => {
            let found = format!("{} for head {head}", dlogits[head].len());
            let expected = format!("{}, one for each logit", logits[head].len());
            let remedy =
                "have the loss fill the gradient of every head, with zeros if it does not count";
            Err(Error::argument("number of gradients by logits", found, expected, remedy))
        }
    }
}

fn require_finite(place: &str, dlogits: &[Vec<f32>]) -> Result<()> {
    for (head, dlogits) in dlogits.iter().enumerate() {
        if let Some(k) = dlogits.iter().position(|d| !d.is_finite()) {
            return Err(Error::NotFinite {
                place: place.into(),
                found: format!("gradient {k} by the logits of head {head} is {}", dlogits[k]),
                remedy: "correct the gradient of the loss, or lower the learning rate".into(),
            });
        }
    }
    Ok(())
}

impl State {
    pub(super) fn check(&self) -> Result<()> {
        let State { n_epochs, n_steps, lr, momentum, weight_decay, .. } = *self;
        let remedy = "change the trainer's settings";
        for (name, found) in [("n_epochs", n_epochs), ("n_steps", n_steps)] {
            if found == 0 || n_epochs.checked_mul(n_steps).is_none() || n_steps > u32::MAX.into() {
                return Err(Error::argument(name, found, "1 or more, at most 2^32 steps", remedy));
            }
        }
        for (name, found) in [("lr", lr), ("weight_decay", weight_decay)] {
            if !(found >= 0.0 && found.is_finite()) {
                return Err(Error::argument(name, found, "0 or more, finite", remedy));
            }
        }
        if !(0.0..1.0).contains(&momentum) {
            return Err(Error::argument("momentum", momentum, "0 to below 1", remedy));
        }
        if !self.schedule.is_sound() {
            let (found, expected) =
                (format!("{:?}", self.schedule), "finite numbers in their domain");
            return Err(Error::argument("schedule", found, expected, remedy));
        }
        match n_epochs * n_steps {
            n if self.steps_done > n => {
                let expected = format!("at most {n}, all of them");
                Err(Error::argument("steps_done", self.steps_done, expected, remedy))
            }
            _ => Ok(()),
        }
    }
}
