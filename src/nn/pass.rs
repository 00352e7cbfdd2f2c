//! What every layer needs in a pass through a network, as one value: the numbers of the model and the memory.
//!
//! Three types, because the three passes may do different things: [`Inference`] reads, [`Training`] moves
//! running statistics and draws dropout, [`Backward`] adds to gradients.

use super::arena::Arena;
use crate::rng::Stream;

/// What a linear operator needs in any pass.
#[derive(Debug, Clone, Copy)]
pub struct Context<'a, T> {
    /// Learned numbers of the whole model.
    pub params: &'a [T],
    /// Where results and work space come from.
    pub arena: &'a Arena<T>,
}

/// A pass that answers and changes nothing.
#[derive(Debug, Clone, Copy)]
pub struct Inference<'a, T> {
    /// Learned numbers of the whole model.
    pub params: &'a [T],
    /// Running statistics of the whole model.
    pub buffers: &'a [T],
    /// Where results and work space come from.
    pub arena: &'a Arena<T>,
}

/// The forward pass of a training step: statistics of the batch, running ones move towards them.
#[derive(Debug)]
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

/// The way back: gradients accumulate.
#[derive(Debug)]
pub struct Backward<'a, T> {
    /// Learned numbers of the whole model, as they were in the forward pass.
    pub params: &'a [T],
    /// Gradient by `params`, of the same length; layers add to it.
    pub grads: &'a mut [T],
    /// Where gradients and work space come from.
    pub arena: &'a Arena<T>,
}

impl<'a, T> Inference<'a, T> {
    /// Parameters and memory alone.
    pub fn context(&self) -> Context<'a, T> {
        Context { params: self.params, arena: self.arena }
    }
}

impl<'a, T> Training<'a, T> {
    /// A pass that changes nothing, for layers that do the same in both.
    pub fn inference(&self) -> Inference<'_, T> {
        Inference { params: self.params, buffers: self.buffers, arena: self.arena }
    }

    /// Parameters and memory alone.
    pub fn context(&self) -> Context<'a, T> {
        Context { params: self.params, arena: self.arena }
    }
}

impl<'a, T> Backward<'a, T> {
    /// Parameters and memory alone.
    pub fn context(&self) -> Context<'a, T> {
        Context { params: self.params, arena: self.arena }
    }
}
