//! A sequence of residual blocks at one depth of the octree.

use super::arena::Buffer;
use super::conv_plan::OperatorShape;
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::params::Layout;
use super::pass::{Backward, Inference, Training};
use super::pass_memory::PassMemory;
use super::residual::{Residual, ResidualPolicy, SavedResidual};
use super::saved::{Policy, Saved};
use crate::exec::memory::product;
use crate::numeric::scalar::Scalar;
use crate::octree::KernelMap;
use std::ops::Range;

/// What a row of blocks saves for backward.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct BlocksPolicy {
    /// Outputs of all blocks but the last, `[n, c_out]` each: the inputs of the blocks after them.
    pub outputs: Policy,
    /// What each block saves of its own.
    pub block: ResidualPolicy,
}

setters!(BlocksPolicy {
    with_outputs(outputs: Policy),
    with_block(block: ResidualPolicy),
});

impl Default for BlocksPolicy {
    /// Outputs are recomputed, and each block saves what it does by default.
    fn default() -> Self {
        BlocksPolicy { outputs: Policy::Recompute, block: ResidualPolicy::default() }
    }
}

/// At least one [`Residual`]; the first may change the width.
///
/// What is not saved is computed once more: the gradients have the same bits, from less memory between the passes.
///
/// ```
/// # use deepmill::octree::{Cloud, Octree, OctreeOptions};
/// use deepmill::nn::blocks::{Blocks, BlocksPolicy};
/// use deepmill::nn::pass::{Backward, Training};
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, params::Layout, saved::Policy};
///
/// # let options = OctreeOptions::default().with_depth(1).with_full_depth(1);
/// # let octree = Octree::build(&[Cloud::new(&[deepmill::glam::Vec3::ZERO], &[])], &options)?;
/// let (x, map) = (deepmill::gradcheck::probe(16, 1), &octree.finest().conv); // eight nodes of depth 1
/// let gradient = |outputs| {
///     let (mut layout, arena, x) = (Layout::default(), Arena::default(), Operand::new(&x, 2));
///     let blocks = Blocks::new(&mut layout, "stage", 3, (2, 4), BlocksPolicy::default().with_outputs(outputs));
///     let (params, mut buffers) = (layout.init_params::<f64>(1), layout.init_buffers());
///     let (y, saved) = blocks.forward_train(&mut Training::new(&params, &mut buffers, &arena), map, x);
///     let (bytes, mut grads) = (arena.in_use_bytes(), vec![0.0; params.len()]);
///     blocks.backward(&mut Backward::new(&params, &mut grads, &arena), map, x, saved, y);
///     (grads, bytes)
/// };
/// let ((saved, more), (recomputed, less)) = (gradient(Policy::Save), gradient(Policy::Recompute));
/// assert_eq!(saved, recomputed);
/// assert_eq!(more - less, 2 * 8 * 4 * 8); // outputs of two blocks: eight rows of four numbers in f64
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Blocks {
    blocks: Vec<Residual>,
    outputs: Policy,
}

/// What a training pass leaves for backward.
#[derive(Debug)]
pub struct SavedBlocks<T> {
    blocks: Vec<SavedResidual<T>>,
    /// Of all blocks but the last.
    outputs: Vec<Saved<T>>,
}

impl Blocks {
    /// Appends `{name}.resblks.0`, `{name}.resblks.1`, …
    ///
    /// # Panics
    /// If `n` or a width is 0, or a name is taken.
    pub fn new(
        layout: &mut Layout,
        name: &str,
        n: usize,
        (c_in, c_out): (usize, usize),
        policy: BlocksPolicy,
    ) -> Self {
        assert!(n > 0, "{name}: at least one residual block");
        let mut block = |i| {
            let c_in = if i == 0 { c_in } else { c_out };
            Residual::new(layout, &format!("{name}.resblks.{i}"), c_in, c_out, policy.block)
        };
        Blocks { blocks: (0..n).map(&mut block).collect(), outputs: policy.outputs }
    }

    /// Columns of the output.
    pub fn c_out(&self) -> usize {
        self.blocks[0].c_out()
    }

    /// Output of the blocks that `saved` belongs to, at least one, from the first block's input.
    fn recompute_output<T: Scalar>(
        &self,
        pass: &Backward<T>,
        map: &KernelMap,
        x: Operand<T>,
        saved: &[SavedResidual<T>],
    ) -> Buffer<T> {
        let mut y = self.blocks[0].recompute_output(pass, map, x, &saved[0]);
        for (block, saved) in self.blocks.iter().zip(saved).skip(1) {
            y = block.recompute_output_over(pass, map, y, saved);
        }
        y
    }
}

impl<T: Scalar> Layer<T> for Blocks {
    type Geometry = KernelMap;
    type Saved = SavedBlocks<T>;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        self.blocks.iter().flat_map(Layer::<T>::param_ranges).collect()
    }

    fn forward(&self, pass: &Inference<T>, map: &KernelMap, x: Operand<T>) -> Buffer<T> {
        let mut y = self.blocks[0].forward(pass, map, x);
        for block in &self.blocks[1..] {
            y = block.forward(pass, map, Operand::new(&y, self.c_out()));
        }
        y
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        map: &KernelMap,
        x: Operand<T>,
    ) -> (Buffer<T>, SavedBlocks<T>) {
        let (mut y, first) = self.blocks[0].forward_train(pass, map, x);
        let mut saved = SavedBlocks { blocks: vec![first], outputs: Vec::new() };
        for block in &self.blocks[1..] {
            let (next, of_block) = block.forward_train(pass, map, Operand::new(&y, self.c_out()));
            saved.blocks.push(of_block);
            saved.outputs.push(Saved::new(self.outputs, std::mem::replace(&mut y, next)));
        }
        (y, saved)
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        map: &KernelMap,
        x: Operand<T>,
        saved: SavedBlocks<T>,
        mut dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let SavedBlocks { blocks: mut saved, outputs } = saved;
        let [first, others @ ..] = &self.blocks[..] else { return OperandGradient::default() };
        for (block, output) in others.iter().zip(outputs).rev() {
            let Some(of_block) = saved.pop() else { break };
            let input = output.restore(|| self.recompute_output(pass, map, x, &saved));
            let input = Operand::new(&input, self.c_out());
            dy = block.backward(pass, map, input, of_block, dy).into_first();
            pass.layer_done();
        }
        match saved.pop() {
            Some(of_block) => first.backward(pass, map, x, of_block, dy),
            None => OperandGradient::default(),
        }
    }
}

/// Memory of residual blocks on `n` rows.
pub(crate) fn memory(pass: &mut PassMemory, n: usize, n_blocks: usize, [c_in, c]: [usize; 2]) {
    let shortcut = OperatorShape::linear(n, c_in, c);
    pass.run(OperatorShape::convolution(n, c_in, c));
    pass.run(OperatorShape::convolution(n, c, c));
    pass.run(shortcut);
    // Before each norm, and the sum; in inference each block's output replaces that of the one before.
    let n_saved = if pass.training { 3 * n_blocks + usize::from(c_in != c) } else { 1 };
    pass.save(product([n, c, n_saved]));
}
