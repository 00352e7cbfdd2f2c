//! The numbers that kernels are made for: `f32`, and `f64` for gradient checks.

use super::Level;
use super::elementwise::{Combine, Relu, Scale, SgdStep, SparseRows};
use super::gemm::block::{Block, PackPanel};
use super::gemm::weights::PanelWidth;
use super::gemm::winograd::transforms::{
    GradientKernel, InputKernel, KernelKernel, KernelRows, Work,
};
use super::gemm::winograd::{FrequencyBlock, GradientTransform, InputTransform, KernelTransform};
use super::gemm::{MatmulRows, MatmulTnRows};
use super::normalize::{BackwardApply, BackwardSums, ColumnSums, NormalizeRows};
use kernels::Kernels;
use std::ops::{Add, Mul, Sub};

/// `f32` or `f64`; nobody else can implement it.
pub trait Real:
    Kernels
    + Copy
    + PartialOrd
    + Default
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + 'static
{
    /// Exact value.
    fn from_f32(x: f32) -> Self;
}

/// What each type of number brings along: one kernel each for `f32`, plain loops and matrixmultiply for `f64`.
pub mod kernels {
    use super::*;

    /// Products and transforms; the inputs are checked.
    pub trait Kernels: Sized {
        /// See [`crate::simd::gemm::matmul_rows`].
        fn product(level: Level, x: MatmulRows<Self>);
        /// See [`crate::simd::gemm::matmul_tn_rows`].
        fn transposed_product(level: Level, x: MatmulTnRows<Self>);
        /// Columns of a panel of packed weights that are `width` wide.
        fn panel_width(level: Level, width: usize) -> usize;
        /// Packs one panel of one offset.
        fn pack_panel(level: Level, x: PackPanel<Self>);
        /// See [`crate::simd::gemm::block::sum_of_terms`].
        fn block_sum(level: Level, x: Block<Self>);
        /// See [`crate::simd::gemm::winograd::sum_of_terms`].
        fn frequency_sum(level: Level, x: FrequencyBlock<Self>);
        /// See [`crate::simd::gemm::winograd::transform_inputs`].
        fn transform_inputs(level: Level, x: InputTransform<Self>);
        /// See [`crate::simd::gemm::winograd::transform_gradients`].
        fn transform_gradients(level: Level, x: GradientTransform<Self>);
        /// See [`crate::simd::gemm::winograd::transform_products`] and the functions beside it.
        fn transform_kernels(level: Level, x: KernelTransform<Self>);
        /// See [`crate::simd::elementwise::combine`].
        fn combine(level: Level, x: Combine<Self>);
        /// See [`crate::simd::elementwise::relu`].
        fn relu(level: Level, x: Relu<Self>);
        /// See [`crate::simd::elementwise::scale`].
        fn scale(level: Level, x: Scale<Self>);
        /// See [`crate::simd::elementwise::sgd_step`].
        fn sgd_step(level: Level, x: SgdStep<Self>);
        /// See [`crate::simd::elementwise::sparse_rows`].
        fn sparse_rows(level: Level, x: SparseRows<Self>);
        /// See [`crate::simd::normalize::normalize`].
        fn normalize(level: Level, x: NormalizeRows<Self>);
        /// See [`crate::simd::normalize::backward_sums`].
        fn backward_sums(level: Level, x: BackwardSums<Self>);
        /// See [`crate::simd::normalize::backward_apply`].
        fn backward_apply(level: Level, x: BackwardApply<Self>);
        /// See [`crate::simd::normalize::column_sums`].
        fn column_sums(level: Level, x: ColumnSums<Self>);
    }
}

impl Real for f32 {
    #[inline(always)]
    fn from_f32(x: f32) -> f32 {
        x
    }
}

impl Real for f64 {
    #[inline(always)]
    fn from_f32(x: f32) -> f64 {
        f64::from(x)
    }
}

impl Kernels for f32 {
    fn product(level: Level, x: MatmulRows<f32>) {
        x.run(level);
    }
    fn transposed_product(level: Level, x: MatmulTnRows<f32>) {
        x.run(level);
    }
    fn panel_width(level: Level, _: usize) -> usize {
        level.run(PanelWidth)
    }
    fn pack_panel(level: Level, x: PackPanel<f32>) {
        level.run(x);
    }
    fn block_sum(level: Level, x: Block<f32>) {
        x.run(level);
    }
    fn frequency_sum(level: Level, x: FrequencyBlock<f32>) {
        x.run(level);
    }
    fn transform_inputs(level: Level, x: InputTransform<f32>) {
        level.run(InputKernel(x, &mut Work::new()));
    }
    fn transform_gradients(level: Level, x: GradientTransform<f32>) {
        level.run(GradientKernel(x, &mut Work::new()));
    }
    fn transform_kernels(level: Level, x: KernelTransform<f32>) {
        level.run(KernelKernel(x, &mut Work::new(), &mut KernelRows::new()));
    }
    fn combine(level: Level, x: Combine<f32>) {
        level.run(x);
    }
    fn relu(level: Level, x: Relu<f32>) {
        level.run(x);
    }
    fn scale(level: Level, x: Scale<f32>) {
        level.run(x);
    }
    fn sgd_step(level: Level, x: SgdStep<f32>) {
        level.run(x);
    }
    fn sparse_rows(level: Level, x: SparseRows<f32>) {
        level.run(x);
    }
    fn normalize(level: Level, x: NormalizeRows<f32>) {
        level.run(x);
    }
    fn backward_sums(level: Level, x: BackwardSums<f32>) {
        level.run(x);
    }
    fn backward_apply(level: Level, x: BackwardApply<f32>) {
        level.run(x);
    }
    fn column_sums(level: Level, x: ColumnSums<f32>) {
        level.run(x);
    }
}
