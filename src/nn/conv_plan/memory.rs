//! An upper estimate of the memory of a linear operator, whichever algorithm computes it. The tests of
//! [`crate::model::SiteNetwork::pass_bytes`] hold it against the arena.

use super::super::rows;
use super::{packed, weight_gradient, winograd};
use crate::exec::memory::product;
use crate::simd::gemm::winograd::N_FREQUENCIES;

/// The shape of a linear operator: rows, columns, kernel offsets.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OperatorShape {
    pub n_in: usize,
    pub n_out: usize,
    pub c_in: usize,
    pub c_out: usize,
    /// 27, 8 or 1.
    pub n_offsets: usize,
}

impl OperatorShape {
    pub fn convolution(n: usize, c_in: usize, c_out: usize) -> Self {
        OperatorShape { n_in: n, n_out: n, c_in, c_out, n_offsets: 27 }
    }

    /// A linear map of each row.
    pub fn linear(n: usize, c_in: usize, c_out: usize) -> Self {
        OperatorShape { n_in: n, n_out: n, c_in, c_out, n_offsets: 1 }
    }

    /// Numbers of the output.
    pub fn output_len(&self) -> u64 {
        product([self.n_out, self.c_out])
    }

    /// Most numbers that the operator, its norm and their gradients hold at once beside what lasts.
    pub fn workspace(&self, n_shapes: usize, training: bool) -> u64 {
        let OperatorShape { n_in, n_out, c_in, c_out, n_offsets } = *self;
        let matrices = if n_offsets == 27 { N_FREQUENCIES } else { n_offsets };
        let weights = product([matrices, c_in + packed::PANEL, c_out + packed::PANEL]);
        let of_shapes = product([n_shapes, N_FREQUENCIES + 27, c_in + c_out]);
        let n_copies = if training { [3, 5] } else { [1, 3] };
        let row_matrices =
            product([n_in, c_in, n_copies[0]]) + product([n_out, c_out, n_copies[1]]);
        let gradient = if training { self.weight_gradient(matrices) } else { 0 };
        [row_matrices, of_shapes, weights.max(gradient)].into_iter().fold(0, u64::saturating_add)
    }

    /// Partial sums over ranges of rows, or transformed groups of nodes.
    fn weight_gradient(&self, matrices: usize) -> u64 {
        let OperatorShape { n_out, c_in, c_out, n_offsets, .. } = *self;
        let n_ranges = match n_offsets {
            27 if n_out <= weight_gradient::RANGE_ROWS => 1,
            27 => n_out / weight_gradient::RANGE_ROWS + 2,
            _ => n_out / rows::BLOCK_ROWS + 2,
        };
        let step = winograd::STEP.min(n_out / 8 + winograd::TASK) * matrices;
        let transformed = product([matrices + n_offsets, c_in, c_out]);
        let transformed = transformed.saturating_add(product([step, c_in + c_out]));
        transformed.max(product([n_offsets, n_ranges, c_in, c_out]))
    }
}
