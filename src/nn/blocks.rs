//! Residual blocks one after another, all at one depth of the octree.

use super::joined::{Columns, ColumnsGradient};
use super::params::Layout;
use super::relu;
use super::residual::{self, Residual, Scratch};
use crate::octree::KernelMap;
use crate::scalar::Scalar;

/// At least one [`Residual`]; the first may change the width.
#[derive(Debug, Clone)]
pub struct Blocks {
    blocks: Vec<Residual>,
}

/// What [`Blocks::forward_train`] keeps for backward.
#[derive(Debug, Clone, Default)]
pub struct Cache<T> {
    blocks: Vec<residual::Cache<T>>,
    outputs: Vec<Vec<T>>,
    /// Whether the gradient went through the last ReLU already.
    passed_relu: bool,
}

impl<T> Cache<T> {
    /// Turns the gradient `d` of the output into that before the last ReLU, which backward then leaves
    /// alone, and lends the memory of the output.
    pub(crate) fn pass_relu(&mut self, d: &mut [T]) -> Vec<T>
    where
        T: Scalar,
    {
        relu::backward(self.output(), d);
        self.passed_relu = true;
        self.outputs.last_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Takes back what [`Cache::pass_relu`] lent.
    pub(crate) fn give_memory(&mut self, memory: Vec<T>) {
        if let Some(output) = self.outputs.last_mut() {
            *output = memory;
        }
    }

    /// Output of block `i`, unless the gradient went through its ReLU already.
    fn output_of(&self, i: usize) -> Option<&[T]> {
        (i + 1 < self.outputs.len() || !self.passed_relu).then(|| &self.outputs[i][..])
    }

    /// Output of the last block.
    pub fn output(&self) -> &[T] {
        self.outputs.last().map_or(&[], |y| y)
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
        let x = x.into();
        cache.blocks.resize_with(self.blocks.len(), Default::default);
        cache.outputs.resize_with(self.blocks.len(), Default::default);
        cache.passed_relu = false;
        for (i, block) in self.blocks.iter().enumerate() {
            let (before, after) = cache.outputs.split_at_mut(i);
            let x = before.last().map_or(x, |x| Columns::One(x));
            let (y, cache) = (&mut after[0], &mut cache.blocks[i]);
            block.forward_train(params, buffers, rows, x, y, cache, scratch);
        }
    }

    /// `d` holds the gradient of the output and is used up; `dx` is overwritten.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<'a, T: Scalar>(
        &self,
        params: &[T],
        rows: &KernelMap,
        x: impl Into<Columns<'a, T>>,
        cache: &Cache<T>,
        d: &mut [T],
        dx: ColumnsGradient<T>,
        grads: &mut [T],
        scratch: &mut Scratch<T>,
    ) {
        for (i, block) in self.blocks.iter().enumerate().skip(1).rev() {
            let (y, cache_i) = (cache.output_of(i), &cache.blocks[i]);
            let x = &cache.outputs[i - 1];
            block.backward_in_place(params, rows, x, y, cache_i, d, grads, scratch);
        }
        let (y, cache) = (cache.output_of(0), &cache.blocks[0]);
        self.blocks[0].backward(params, rows, x, y, cache, d, dx, grads, scratch);
    }
}
