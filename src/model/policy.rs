//! The memory policy of training: which intermediate matrices are saved for the backward pass and which are recomputed.
//!
//! Bytes are per row of the block's output and channel of it, in f32; "recomputed" costs one more run of the
//! operator named, "—" nothing.
//!
//! | block | matrix | policy | bytes | cost of recomputing |
//! |---|---|---|---|---|
//! | stem | convolution, before norm | recompute | 0 | the 4-channel convolution |
//! | stem | output (skip) | save | 4 | — |
//! | downsampling | strided convolution, before norm | save | 4 | — |
//! | downsampling | output (input of the blocks) | save | 4 | — |
//! | residual block | both convolutions, before norm | save | 8 | — |
//! | residual block | between the convolutions | recompute | 0 | norm and ReLU |
//! | residual block | shortcut, before norm | recompute | 0 | the 1×1 map |
//! | residual blocks | output of each but the last | recompute | 0 | norms and ReLUs of the blocks before |
//! | residual blocks | output of the last (skip, next stage) | save | 4 | — |
//! | upsampling | transposed convolution, before norm and after | recompute | 0 | the transposed convolution, twice |
//! | points | interpolated features | save | 4 | — |
//! | head | hidden matrix, before norm and after | recompute | 0 | the 96-channel linear map |
//! | cutter module | all, one row per shape | save | — | — |
//!
//! What is saved costs memory for as long as the pass lasts; what is recomputed lives while its own stage is on
//! the backward pass. Gradients have the same bits under any policy; a test holds that.

use crate::nn::blocks::BlocksPolicy;
use crate::nn::residual::ResidualPolicy;
use crate::nn::saved::Policy;

/// One policy for each kind of block of a [`super::UNet`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct MemoryPolicy {
    /// The stem's convolution, before normalization.
    pub stem: Policy,
    /// Strided convolutions, before normalization.
    pub down: Policy,
    /// Residual blocks of encoder and decoder.
    pub blocks: BlocksPolicy,
    /// Transposed convolutions, before normalization, and what comes out of their stage.
    pub up: Policy,
    /// Hidden matrices of the heads, before normalization.
    pub head: Policy,
}

setters!(MemoryPolicy {
    with_stem(stem: Policy),
    with_down(down: Policy),
    with_blocks(blocks: BlocksPolicy),
    with_up(up: Policy),
    with_head(head: Policy),
});

impl Default for MemoryPolicy {
    /// The table of this module.
    fn default() -> Self {
        MemoryPolicy {
            stem: Policy::Recompute,
            down: Policy::Save,
            blocks: BlocksPolicy::default(),
            up: Policy::Recompute,
            head: Policy::Recompute,
        }
    }
}

impl MemoryPolicy {
    /// The same policy for all.
    pub fn uniform(policy: Policy) -> Self {
        let block = ResidualPolicy { convolutions: policy, shortcut: policy };
        let blocks = BlocksPolicy { outputs: policy, block };
        MemoryPolicy { stem: policy, down: policy, blocks, up: policy, head: policy }
    }
}
