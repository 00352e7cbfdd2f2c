//! The context of a pass through a network: parameters, buffers, gradients and memory, as one value.
//!
//! Three types, because the three passes may do different things: [`Inference`] reads, [`Training`] moves
//! running statistics and draws dropout, [`Backward`] adds to gradients.

use super::arena::{Arena, Buffer};
use crate::numeric::rng::Stream;
use crate::numeric::scalar::Scalar;
use std::fmt;
use std::ops::{Deref, Range};

/// What a linear operator needs in any pass.
///
/// ```
/// use deepmill::nn::{arena::Arena, linear::Linear, linear_operator::LinearOperator, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Context};
///
/// let linear = Linear::new(&mut Layout::default(), "linear", 2, 1, false);
/// let (params, arena) = ([3.0, 4.0], Arena::default()); // y = 3 x₀ + 4 x₁
/// let (context, x) = (Context::new(&params, &arena), Operand::new(&[1.0, 2.0], 2));
/// assert_eq!(linear.map(context, &(), x)[..], [11.0]);
/// let dx = linear.input_gradient(context, &(), x, &[10.0]);
/// assert_eq!(dx.into_first()[..], [30.0, 40.0]);
/// ```
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Context<'a, T> {
    /// Learned numbers of the whole model.
    pub params: &'a [T],
    /// Where results and work space come from.
    pub arena: &'a Arena<T>,
}

/// A pass that answers and changes nothing.
///
/// ```
/// use deepmill::nn::{arena::Arena, batch_norm::BatchNorm, layer::Layer, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Inference};
///
/// let norm = BatchNorm::new(&mut Layout::default(), "bn", 1);
/// let (params, buffers) = ([1.0, 0.0], [5.0, 4.0, 100.0]); // weight and bias; mean and variance after 100 batches
/// let arena = Arena::default();
/// let pass = Inference::new(&params, &buffers, &arena); // many threads may share it
/// let y = norm.forward(&pass, &(), Operand::new(&[9.0], 1));
/// assert!((y[0] - (9.0 - 5.0) / 2.0_f64).abs() < 1e-5); // the running statistics, not those of one row
/// ```
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Inference<'a, T> {
    /// Learned numbers of the whole model.
    pub params: &'a [T],
    /// Running statistics of the whole model.
    pub buffers: &'a [T],
    /// Where results and work space come from.
    pub arena: &'a Arena<T>,
}

/// The forward pass of a training step: statistics of the batch, running ones move toward them.
///
/// A stream for each shape: the same seed, epoch and sample drop the same elements.
///
/// ```
/// use deepmill::nn::{arena::Arena, dropout::Dropout, layer::Layer, operand::Operand, pass::Training};
/// use deepmill::rng::{Purpose, Stream};
///
/// let (dropout, arena, x) = (Dropout::new(0.3)?, Arena::default(), [1.0; 64]);
/// let output = |epoch: u64| {
///     let mut streams = [0, 1].map(|sample| Stream::new(7, epoch, sample, Purpose::Dropout));
///     let mut pass = Training::new(&[], &mut [], &arena).with_dropout(&mut streams);
///     dropout.forward_train(&mut pass, &(), Operand::new(&x, 32)).0.to_vec() // two rows
/// };
/// assert_eq!(output(1), output(1));
/// assert_ne!(output(1), output(2));
/// let (plain, _) = dropout.forward_train(&mut Training::new(&[], &mut [], &arena), &(), Operand::new(&x, 32));
/// assert_eq!(plain[..], x); // a pass without streams drops nothing
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Training<'a, T> {
    /// Learned numbers of the whole model.
    pub params: &'a [T],
    /// Running statistics of the whole model.
    pub buffers: &'a mut [T],
    /// One stream per shape, keyed by (seed, epoch, sample); `None` turns dropout off.
    pub dropout: Option<&'a mut [Stream]>,
    /// Where results, saved matrices and work space come from.
    pub arena: &'a Arena<T>,
}

/// The backward pass: gradients by the parameters accumulate, or are used up layer by layer.
///
/// ```
/// use deepmill::nn::{arena::Arena, layer::Layer, linear::Linear, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Backward};
///
/// let linear = Linear::new(&mut Layout::default(), "linear", 1, 1, false);
/// let (mut params, arena, x) = ([2.0], Arena::default(), Operand::new(&[3.0], 1)); // y = 2 · 3
/// let dy = || arena.copy_of(&[5.0]);
/// let mut grads = [100.0];
/// linear.backward(&mut Backward::new(&params, &mut grads, &arena), &(), x, (), dy());
/// assert_eq!(grads, [115.0]); // 3 · 5 is added to what was there
/// // Or a step of descent as soon as the gradient of a layer is whole:
/// let mut step = |_, gradient: &mut [f64], params: &mut [f64]| params[0] -= 0.1 * gradient[0];
/// let mut pass = Backward::updating(&mut params, &mut step, &arena);
/// linear.backward(&mut pass, &(), x, (), dy());
/// pass.layer_done();
/// assert_eq!(params, [0.5]);
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Backward<'a, T> {
    /// Learned numbers of the whole model, as they were in the forward pass for every layer whose gradient is
    /// not whole.
    pub params: Params<'a, T>,
    /// Gradient by `params`; layers add to it.
    pub grads: Gradients<'a, T>,
    /// Where gradients and work space come from.
    pub arena: &'a Arena<T>,
}

/// Uses up the gradient of a range of parameters: its arguments are the range, the gradient by it, and the
/// parameters in it, which it may change.
pub type Update<'a, T> = dyn FnMut(Range<usize>, &mut [T], &mut [T]) + Send + 'a;

/// Parameters in a backward pass, read through [`Deref`].
#[derive(Debug)]
#[non_exhaustive]
pub enum Params<'a, T> {
    /// They stay as they are.
    Constant(&'a [T]),
    /// An [`Update`] changes those of a layer as soon as its gradient is whole.
    Updated(&'a mut [T]),
}

/// Where a backward pass adds the gradient by the parameters.
#[non_exhaustive]
pub enum Gradients<'a, T> {
    /// One vector as long as the parameters.
    Vector(&'a mut [T]),
    /// One buffer for each range that a layer has added to, until [`Backward::layer_done`].
    PerLayer {
        /// Ranges of parameters, with the gradient so far.
        open: Vec<(Range<usize>, Buffer<T>)>,
        /// Takes whole gradients.
        update: &'a mut Update<'a, T>,
    },
}

impl<'a, T> Context<'a, T> {
    /// Of these.
    pub fn new(params: &'a [T], arena: &'a Arena<T>) -> Self {
        Context { params, arena }
    }
}

impl<'a, T> Inference<'a, T> {
    /// Of these.
    pub fn new(params: &'a [T], buffers: &'a [T], arena: &'a Arena<T>) -> Self {
        Inference { params, buffers, arena }
    }

    /// Parameters and memory alone.
    pub fn context(&self) -> Context<'a, T> {
        Context { params: self.params, arena: self.arena }
    }
}

impl<'a, T> Training<'a, T> {
    /// Without dropout.
    pub fn new(params: &'a [T], buffers: &'a mut [T], arena: &'a Arena<T>) -> Self {
        Training { params, buffers, dropout: None, arena }
    }

    /// With dropout drawn from these streams, one per shape.
    #[must_use]
    pub fn with_dropout(self, streams: &'a mut [Stream]) -> Self {
        Training { dropout: Some(streams), ..self }
    }

    /// A pass that changes nothing, for layers that do the same in both.
    pub fn inference(&self) -> Inference<'_, T> {
        Inference { params: self.params, buffers: self.buffers, arena: self.arena }
    }

    /// Parameters and memory alone.
    pub fn context(&self) -> Context<'a, T> {
        Context { params: self.params, arena: self.arena }
    }
}

impl<'a, T: Scalar> Backward<'a, T> {
    /// Adds the gradient to `grads`, as long as `params`.
    pub fn new(params: &'a [T], grads: &'a mut [T], arena: &'a Arena<T>) -> Self {
        Backward { params: Params::Constant(params), grads: Gradients::Vector(grads), arena }
    }

    /// Passes the gradient of each layer to `update` as soon as it is whole, so that there is never one of all
    /// parameters. No two layers may share parameters.
    pub fn updating(
        params: &'a mut [T],
        update: &'a mut Update<'a, T>,
        arena: &'a Arena<T>,
    ) -> Self {
        let grads = Gradients::PerLayer { open: Vec::new(), update };
        Backward { params: Params::Updated(params), grads, arena }
    }

    /// The gradient by the parameters in `range`, to be added to. A layer asks for each of its tensors by the
    /// same range every time.
    pub fn grads(&mut self, range: &Range<usize>) -> &mut [T] {
        match &mut self.grads {
            Gradients::Vector(grads) => &mut grads[range.clone()],
            Gradients::PerLayer { open, .. } => {
                let place = open.iter().position(|(other, _)| other == range);
                let place = place.unwrap_or_else(|| {
                    open.push((range.clone(), self.arena.zeroed(range.len())));
                    open.len() - 1
                });
                &mut open[place].1
            }
        }
    }

    /// Says that nothing will be added to the gradients so far, and that none of the parameters that they belong
    /// to is needed any more. Every layer may say so when its backward ends; who runs a whole network must, at
    /// the end.
    pub fn layer_done(&mut self) {
        if let (Gradients::PerLayer { open, update }, Params::Updated(params)) =
            (&mut self.grads, &mut self.params)
        {
            for (range, mut gradient) in open.drain(..) {
                update(range.clone(), &mut gradient, &mut params[range]);
            }
        }
    }

    /// Parameters and memory alone.
    pub fn context(&self) -> Context<'_, T> {
        Context { params: &self.params, arena: self.arena }
    }
}

impl<T> Deref for Params<'_, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match self {
            Params::Constant(params) => params,
            Params::Updated(params) => params,
        }
    }
}

impl<T: fmt::Debug> fmt::Debug for Gradients<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Gradients::Vector(grads) => f.debug_tuple("Vector").field(grads).finish(),
            Gradients::PerLayer { open, .. } => f.debug_tuple("PerLayer").field(open).finish(),
        }
    }
}
