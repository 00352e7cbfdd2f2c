//! Residual blocks one after another, all at one depth of the octree.

use super::joined::{Columns, ColumnsGradient};
use super::params::Layout;
use super::residual::{self, Residual, Scratch};
use crate::octree::KernelMap;
use crate::scalar::Scalar;

/// At least one [`Residual`]; the first may change the width.
#[derive(Debug, Clone)]
pub struct Blocks {
    blocks: Vec<Residual>,
}

/// What [`Blocks::forward_train`] keeps for backward: one output for all blocks, since each takes the
/// place of the one before, which backward computes again.
#[derive(Debug, Clone, Default)]
pub struct Cache<T> {
    blocks: Vec<residual::Cache<T>>,
    output: Vec<T>,
    spare: Vec<T>,
}

impl<T> Cache<T> {
    /// Output of the last block.
    pub fn output(&self) -> &[T] {
        &self.output
    }

    /// Memory as large as the output, to work in until [`Cache::give_output`]; the output itself, if backward
    /// can do without.
    pub(crate) fn take_output(&mut self) -> Vec<T> {
        let place = if self.blocks.len() > 1 { &mut self.output } else { &mut self.spare };
        std::mem::take(place)
    }

    /// Takes back what [`Cache::take_output`] lent.
    pub(crate) fn give_output(&mut self, memory: Vec<T>) {
        let place = if self.blocks.len() > 1 { &mut self.output } else { &mut self.spare };
        *place = memory;
    }

    /// Memory as large as the output, free once backward has passed the last block.
    fn take_memory(&mut self) -> Vec<T> {
        match &mut self.blocks[..] {
            [_, .., last] => last.take_memory(),
            _ => std::mem::take(&mut self.spare),
        }
    }

    /// Takes back the memory that [`Blocks::backward`] gave away.
    pub(crate) fn give_memory(&mut self, memory: Vec<T>) {
        match &mut self.blocks[..] {
            [_, .., last] => last.give_memory(memory),
            _ => self.spare = memory,
        }
    }
}

impl Blocks {
    /// Appends `{name}.resblks.0`, `{name}.resblks.1`, …
    pub fn new(layout: &mut Layout, name: &str, n: usize, c_in: usize, c_out: usize) -> Self {
        let mut block = |i| {
            let c_in = if i == 0 { c_in } else { c_out };
            Residual::new(layout, &format!("{name}.resblks.{i}"), c_in, c_out)
        };
        Blocks { blocks: (0..n).map(&mut block).collect() }
    }

    /// Inference: `y` is overwritten.
    pub fn forward<'a, T: Scalar>(
        &self,
        params: &[T],
        buffers: &[T],
        rows: &KernelMap,
        x: impl Into<Columns<'a, T>>,
        y: &mut Vec<T>,
        scratch: &mut Scratch<T>,
    ) {
        let x = x.into();
        let mut previous = std::mem::take(&mut scratch.block);
        for (i, block) in self.blocks.iter().enumerate() {
            std::mem::swap(&mut previous, y);
            let x = if i == 0 { x } else { Columns::One(&previous) };
            block.forward(params, buffers, rows, x, y, scratch);
        }
        scratch.block = previous;
    }

    /// Training; the result is [`Cache::output`].
    pub fn forward_train<'a, T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        rows: &KernelMap,
        x: impl Into<Columns<'a, T>>,
        cache: &mut Cache<T>,
        scratch: &mut Scratch<T>,
    ) {
        cache.blocks.resize_with(self.blocks.len(), Default::default);
        let Cache { blocks: caches, output: y, .. } = cache;
        let [first, others @ ..] = &self.blocks[..] else { return };
        let [cache, caches @ ..] = &mut caches[..] else { return };
        first.forward_train(params, buffers, rows, x, y, cache, scratch);
        for (block, cache) in others.iter().zip(caches) {
            block.forward_train_in_place(params, buffers, rows, y, cache, scratch);
        }
    }

    /// `d` holds the gradient of the output and is used up, and so is `cache`; `dx` is overwritten. If its last
    /// part has no memory, it gets some of `cache`.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<'a, T: Scalar>(
        &self,
        params: &[T],
        rows: &KernelMap,
        x: impl Into<Columns<'a, T>>,
        cache: &mut Cache<T>,
        d: &mut [T],
        mut dx: ColumnsGradient<T>,
        grads: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        let x = x.into();
        for (i, block) in self.blocks.iter().enumerate().skip(1).rev() {
            let Cache { blocks: caches, output, .. } = cache;
            self.output_again(params, x, &caches[..i], output);
            block.backward_in_place(params, rows, output, &mut caches[i], d, grads, scratch);
        }
        if let Some(dx) = dx.last().filter(|dx| dx.capacity() == 0) {
            *dx = cache.take_memory();
        }
        let Cache { blocks: caches, output, .. } = cache;
        self.blocks[0].backward(params, rows, x, output, &mut caches[0], d, dx, grads, scratch);
    }

    /// The output of the blocks that `caches` belong to, at least one.
    fn output_again<T: Scalar>(
        &self,
        params: &[T],
        x: Columns<T>,
        caches: &[residual::Cache<T>],
        y: &mut Vec<T>,
    ) {
        for (i, (block, cache)) in self.blocks.iter().zip(caches).enumerate() {
            match i {
                0 => block.output_again(params, x, cache, y),
                _ => block.finish_in_place(params, cache, y),
            }
        }
    }
}
