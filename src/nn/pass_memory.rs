//! Upper estimates of what a pass takes from its arena: a batch that does not fit is refused before the pass begins.
//!
//! ```text
//! numbers     Σ saved over all layers + the greatest workspace of a layer
//! saved       lives until the pass ends: outputs; in training also what backward reads, and gradients that wait for other layers
//! workspace   lives while a layer runs: its input as one matrix, packed weights, partial sums of gradients
//! ```
//!
//! All that any memory policy saves is counted. Each layer has its part beside it; the tests of
//! `model::site_network` hold the estimate of a network against the arena's peak.

use super::conv_plan::OperatorShape;

/// Memory of a pass, layer by layer, in numbers.
pub(crate) struct PassMemory {
    pub training: bool,
    pub n_shapes: usize,
    saved: u64,
    workspace: u64,
}

impl PassMemory {
    pub fn new(n_shapes: usize, training: bool) -> Self {
        PassMemory { training, n_shapes, saved: 0, workspace: 0 }
    }

    pub fn save(&mut self, n: u64) {
        self.saved = self.saved.saturating_add(n);
    }

    pub fn use_workspace(&mut self, n: u64) {
        self.workspace = self.workspace.max(n);
    }

    pub fn run(&mut self, operator: OperatorShape) {
        self.use_workspace(operator.workspace(self.n_shapes, self.training));
    }

    /// An operator whose output lasts, before and after its norm if it is for training.
    pub fn layer(&mut self, operator: OperatorShape) {
        self.run(operator);
        self.save(operator.output_len().saturating_mul(if self.training { 2 } else { 1 }));
    }

    /// All numbers; an arena holds up to an eighth more than what is in use.
    pub fn numbers(self) -> u64 {
        let sum = self.saved.saturating_add(self.workspace);
        sum.saturating_add(sum / 8)
    }
}
