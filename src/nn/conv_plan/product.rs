//! The computations of a plan: sums of products, and of outer products, along a map of rows.

use super::super::arena::Buffer;
use super::super::column_norm::Epilogue;
use crate::numeric::scalar::Scalar;
use crate::octree::KernelMap;
use crate::simd::gemm::weights::Weights;
use std::ops::Range;

/// Which input rows meet which output rows.
#[derive(Debug, Clone, Copy)]
pub(in crate::nn) enum RowMap<'a> {
    /// Row `i` meets row `i`, of so many.
    Same(usize),
    /// Pairs for each offset.
    Kernel(&'a KernelMap),
}

/// Some of the input columns of a product.
pub(in crate::nn) enum Term<'a, T> {
    /// `x: [n_inputs, depth of the weights]`.
    Nodes { x: &'a [T], weights: Weights<'a, T> },
    /// Columns that are the same in all rows of a shape, multiplied already: what each shape adds for
    /// each offset, `[n_offsets, n_shapes, c_out]`. Inputs and outputs are the same rows.
    Shapes { products: Buffer<T>, shapes: &'a [Range<usize>] },
}

/// What a plan computes.
pub(in crate::nn) struct Product<'a, T> {
    /// Summands, in order.
    pub terms: &'a [Term<'a, T>],
    /// Where the sums start; only where each row meets itself.
    pub bias: Option<&'a [T]>,
    /// Columns of the output.
    pub c_out: usize,
    /// What follows, block by block.
    pub epilogue: Epilogue<'a, T>,
    /// Rows of the layer's output in one row of the product: 8 where a row holds the children of a node.
    pub rows_per_output: usize,
}

/// `grads[group·k + j] += Σ_{i →k o} a[group·i + j]ᵀ·g[o]`, each `[c_a, c_g]`.
#[derive(Debug, Clone)]
pub(in crate::nn) struct OuterProduct<'a, T> {
    /// `[group · n_inputs, columns.len()]`.
    pub a: &'a [T],
    /// Which of the `c_a` columns `a` has.
    pub columns: Range<usize>,
    /// Rows of each gradient.
    pub c_a: usize,
    /// `[n_outputs, c_g]`.
    pub g: &'a [T],
    /// Columns of each gradient.
    pub c_g: usize,
    /// Rows of `a` that belong to one input of the map: 1 for a convolution, 8 for the children of a node.
    pub group: usize,
}

impl<'a, T: Scalar> OuterProduct<'a, T> {
    /// All columns, one row of `a` for each input.
    pub fn new((a, c_a): (&'a [T], usize), (g, c_g): (&'a [T], usize)) -> Self {
        OuterProduct { a, columns: 0..c_a, c_a, g, c_g, group: 1 }
    }

    pub(super) fn check(&self, rows: RowMap) {
        let n = rows.n_inputs() * self.group * self.columns.len();
        assert_eq!(self.a.len(), n, "rows of `a` and of the kernel map differ");
        assert_eq!(self.g.len(), rows.n_outputs() * self.c_g, "rows of `g` and of the map differ");
    }
}

impl<'a, T: Scalar> Product<'a, T> {
    /// Without bias and epilogue.
    pub fn new(terms: &'a [Term<'a, T>], c_out: usize) -> Self {
        Product { terms, bias: None, c_out, epilogue: Epilogue::Identity, rows_per_output: 1 }
    }

    /// Treats rows of the output from `first` on as the epilogue says.
    pub(super) fn finish(&self, first: usize, rows: &mut [T]) {
        self.epilogue.apply(first * self.rows_per_output, rows);
    }
}

impl RowMap<'_> {
    pub(super) fn n_inputs(&self) -> usize {
        match self {
            RowMap::Same(n) => *n,
            RowMap::Kernel(map) => map.n_inputs(),
        }
    }

    pub(super) fn n_outputs(&self) -> usize {
        match self {
            RowMap::Same(n) => *n,
            RowMap::Kernel(map) => map.n_outputs(),
        }
    }
}
