//! The plan of a linear operator: chooses the algorithm that computes it from the shapes.
//!
//! Every linear operator is a sum `y[o] = Σ_k Σ_{i →k o} x[i]·W_k` over kernel offsets `k`, its input gradient
//! the same sum along another map with transposed weights, its weight gradient `dW_k = Σ x[i]ᵀ·dy[o]`. A plan
//! is chosen from shapes alone:
//!
//! | rows | output | weight gradient |
//! |---|---|---|
//! | each meets itself (linear layer) | [`dense`]: one product, bias | [`dense`] |
//! | kernel map, channels that suit, children together | [`winograd`] | [`winograd`], from 64·64 channels |
//! | kernel map of one block: few rows, many weights | [`columns`] | [`weight_gradient`] |
//! | other kernel maps | [`blocks`] | [`weight_gradient`] |
//!
//! Whichever it is, each output row takes its terms in order, for each its offsets in order and, within one,
//! the input channels in order ([`winograd`]: the same order of frequencies), so that a row's value depends on
//! nothing but its own inputs. The choice does not depend on the number of nodes but for [`columns`], which has the
//! bits of [`blocks`]: a shape's values are the same in every batch.
//!
//! A linear layer is a plan with one offset. It has an algorithm of its own because its sum starts from the
//! bias and its map, each row to itself, needs no lists of pairs.

pub(super) mod dense;

mod blocks;
mod columns;
mod memory;
mod packed;
mod product;
pub(super) mod shapes;
mod weight_gradient;
mod winograd;

use super::arena::{Arena, Buffer};
use crate::numeric::scalar::Scalar;
pub(super) use crate::simd::gemm::weights::Weights;
pub(crate) use memory::OperatorShape;
pub(super) use product::{OuterProduct, Product, RowMap, Term};

/// The algorithm for an output or an input gradient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Algorithm {
    Dense,
    Winograd,
    Columns,
    Blocks,
}

/// A map of rows and the algorithm chosen for it.
#[derive(Debug, Clone, Copy)]
pub(super) struct ConvPlan<'a> {
    rows: RowMap<'a>,
    algorithm: Algorithm,
}

impl<'a> ConvPlan<'a> {
    /// For an output, or an input gradient, of `c_out` columns from terms of `depths` columns.
    pub fn new(
        rows: RowMap<'a>,
        mut depths: impl ExactSizeIterator<Item = usize>,
        c_out: usize,
    ) -> Self {
        let algorithm = match rows {
            RowMap::Same(_) => Algorithm::Dense,
            RowMap::Kernel(map)
                if depths.len() > 0 && depths.all(|c| winograd::suits(map, c, c_out)) =>
            {
                Algorithm::Winograd
            }
            RowMap::Kernel(map) if map.n_blocks() == 1 => Algorithm::Columns,
            RowMap::Kernel(_) => Algorithm::Blocks,
        };
        ConvPlan { rows, algorithm }
    }

    /// The plan for these terms.
    pub fn of<T: Scalar>(rows: RowMap<'a>, product: &Product<T>) -> Self {
        let depth = |term: &Term<T>| match term {
            Term::Nodes { weights, .. } => Some(weights.depth()),
            Term::Shapes { .. } => None,
        };
        let depths: Vec<usize> = product.terms.iter().filter_map(depth).collect();
        ConvPlan::new(rows, depths.into_iter(), product.c_out)
    }

    /// `[n_outputs, c_out]`.
    ///
    /// # Panics
    /// If a term has not one row for each input row of the map.
    pub fn run<T: Scalar>(&self, arena: &Arena<T>, product: &Product<T>) -> Buffer<T> {
        for term in product.terms {
            if let Term::Nodes { x, weights } = term {
                let n = self.rows.n_inputs() * weights.depth();
                assert_eq!(x.len(), n, "rows of the input and of the kernel map differ");
            }
        }
        let mut y = arena.get(self.rows.n_outputs() * product.c_out);
        match (self.rows, self.algorithm) {
            (RowMap::Same(_), _) => dense::sum_of_terms(product, &mut y),
            (RowMap::Kernel(map), Algorithm::Winograd) => {
                winograd::sum_of_terms(arena, map, product, &mut y);
            }
            (RowMap::Kernel(map), Algorithm::Columns) => {
                columns::sum_of_terms(arena, map, product, &mut y);
                product.finish(0, &mut y);
            }
            (RowMap::Kernel(map), _) => blocks::sum_of_terms(arena, map, product, &mut y),
        }
        y
    }

    /// `y[o] = Σ_k Σ_{i →k o} x[i]·weights[k]`, by the plan for these weights.
    pub fn product<T: Scalar>(
        arena: &Arena<T>,
        rows: RowMap<'a>,
        x: &[T],
        weights: Weights<T>,
    ) -> Buffer<T> {
        let c_out = weights.width();
        let terms = [Term::Nodes { x, weights }];
        let product = Product::new(&terms, c_out);
        ConvPlan::of(rows, &product).run(arena, &product)
    }

    /// Adds the gradient of the weights to `grads`.
    ///
    /// # Panics
    /// If an operand has not one row for each row of the map.
    pub fn add_weight_gradient<T: Scalar>(
        arena: &Arena<T>,
        rows: RowMap<'a>,
        product: &OuterProduct<T>,
        grads: &mut [T],
    ) {
        product.check(rows);
        match rows {
            RowMap::Same(_) => {
                let OuterProduct { a, c_a, g, c_g, .. } = *product;
                dense::add_transposed_product(arena, (a, c_a), (g, c_g), grads);
            }
            RowMap::Kernel(map) => match winograd::suits_gradient(map, product) {
                true => winograd::weight_gradient(arena, map, product, grads),
                false => weight_gradient::by_ranges(arena, map, product, grads),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn::testing::{large_octree, octrees};
    use crate::octree::KernelMap;

    #[test]
    fn plans_follow_from_shapes_alone() {
        let (large, few) = (large_octree(), octrees().swap_remove(2));
        let plan = |map: &KernelMap, c: [usize; 2]| {
            ConvPlan::new(RowMap::Kernel(map), [c[0]].into_iter(), c[1]).algorithm
        };
        let fine = &large.finest().conv;
        assert_eq!(plan(fine, [64, 64]), Algorithm::Winograd);
        assert_eq!(plan(fine, [4, 32]), Algorithm::Blocks);
        assert_eq!(plan(fine, [256, 256]), Algorithm::Blocks);
        assert_eq!(plan(&few.finest().conv, [64, 64]), Algorithm::Winograd);
        assert_eq!(plan(&few.levels[1].conv, [256, 256]), Algorithm::Columns);
        let linear = ConvPlan::new(RowMap::Same(9), [3].into_iter(), 4);
        assert_eq!(linear.algorithm, Algorithm::Dense);
    }
}
