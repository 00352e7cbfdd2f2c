//! The trait of numbers that kernels exist for: `f32`, and `f64` for gradient checks.

use super::Isa;
use super::elementwise::{Combine, ReluInPlace, Scale, SgdStep, SparseRows};
use super::gemm::block::{Block, PackPanel};
use super::gemm::weights::PanelWidth;
use super::gemm::winograd::transforms::{
    GradientKernel, InputKernel, KernelKernel, KernelRows, TransformScratch,
};
use super::gemm::winograd::{FrequencyBlock, GradientTransform, InputTransform, KernelTransform};
use super::gemm::{MatmulRows, MatmulTnRows};
use super::normalize::{BackwardApply, BackwardSums, ColumnSums, NormalizeRows};
use kernels::Kernels;
use std::ops::{Add, Mul, Sub};

/// `f32` or `f64`; sealed.
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
        fn product(isa: Isa, x: MatmulRows<Self>);
        /// See [`crate::simd::gemm::matmul_tn_rows`].
        fn transposed_product(isa: Isa, x: MatmulTnRows<Self>);
        /// Columns of a panel of packed weights that are `width` wide.
        fn panel_width(isa: Isa, width: usize) -> usize;
        /// Packs one panel of one offset.
        fn pack_panel(isa: Isa, x: PackPanel<Self>);
        /// See [`crate::simd::gemm::block::sum_of_terms`].
        fn block_sum(isa: Isa, x: Block<Self>);
        /// See [`crate::simd::gemm::winograd::sum_of_terms`].
        fn frequency_sum(isa: Isa, x: FrequencyBlock<Self>);
        /// See [`crate::simd::gemm::winograd::transform_inputs`].
        fn transform_inputs(isa: Isa, x: InputTransform<Self>);
        /// See [`crate::simd::gemm::winograd::transform_gradients`].
        fn transform_gradients(isa: Isa, x: GradientTransform<Self>);
        /// See [`crate::simd::gemm::winograd::transform_products`] and the functions beside it.
        fn transform_kernels(isa: Isa, x: KernelTransform<Self>);
        /// See [`crate::simd::elementwise::combine`].
        fn combine(isa: Isa, x: Combine<Self>);
        /// See [`crate::simd::elementwise::relu`].
        fn relu(isa: Isa, x: ReluInPlace<Self>);
        /// See [`crate::simd::elementwise::scale`].
        fn scale(isa: Isa, x: Scale<Self>);
        /// See [`crate::simd::elementwise::sgd_step`].
        fn sgd_step(isa: Isa, x: SgdStep<Self>);
        /// See [`crate::simd::elementwise::sparse_rows`].
        fn sparse_rows(isa: Isa, x: SparseRows<Self>);
        /// See [`crate::simd::normalize::normalize`].
        fn normalize(isa: Isa, x: NormalizeRows<Self>);
        /// See [`crate::simd::normalize::backward_sums`].
        fn backward_sums(isa: Isa, x: BackwardSums<Self>);
        /// See [`crate::simd::normalize::backward_apply`].
        fn backward_apply(isa: Isa, x: BackwardApply<Self>);
        /// See [`crate::simd::normalize::column_sums`].
        fn column_sums(isa: Isa, x: ColumnSums<Self>);
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

/// Functions that run a kernel as it is.
macro_rules! run_kernels {
    ($($name:ident: $kernel:ident),* $(,)?) => {
        $(fn $name(isa: Isa, x: $kernel<f32>) {
            isa.run(x);
        })*
    };
}

impl Kernels for f32 {
    fn product(isa: Isa, x: MatmulRows<f32>) {
        x.run(isa);
    }
    fn transposed_product(isa: Isa, x: MatmulTnRows<f32>) {
        x.run(isa);
    }
    fn panel_width(isa: Isa, _: usize) -> usize {
        isa.run(PanelWidth)
    }
    fn block_sum(isa: Isa, x: Block<f32>) {
        x.run(isa);
    }
    fn frequency_sum(isa: Isa, x: FrequencyBlock<f32>) {
        x.run(isa);
    }
    fn transform_inputs(isa: Isa, x: InputTransform<f32>) {
        isa.run(InputKernel(x, &mut TransformScratch::new()));
    }
    fn transform_gradients(isa: Isa, x: GradientTransform<f32>) {
        isa.run(GradientKernel(x, &mut TransformScratch::new()));
    }
    fn transform_kernels(isa: Isa, x: KernelTransform<f32>) {
        isa.run(KernelKernel(x, &mut TransformScratch::new(), &mut KernelRows::new()));
    }
    run_kernels! {
        pack_panel: PackPanel,
        combine: Combine,
        relu: ReluInPlace,
        scale: Scale,
        sgd_step: SgdStep,
        sparse_rows: SparseRows,
        normalize: NormalizeRows,
        backward_sums: BackwardSums,
        backward_apply: BackwardApply,
        column_sums: ColumnSums,
    }
}
