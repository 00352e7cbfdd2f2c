//! The algorithm for many rows: one task computes a block of output rows, with weights packed once for all.

use super::super::arena::Arena;
use super::packed::PackedWeights;
use super::product::{Product, Term};
use super::shapes::for_each_shape;
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::octree::KernelMap;
use crate::simd::Isa;
use crate::simd::gemm::block::{self, WeightSource};
use crate::simd::gemm::weights::Packed;

pub(super) fn sum_of_terms<T: Scalar>(
    arena: &Arena<T>,
    map: &KernelMap,
    product: &Product<T>,
    y: &mut [T],
) {
    let (isa, c_out) = (Isa::active(), product.c_out);
    let packed: Vec<_> = product.terms.iter().map(|term| pack(isa, arena, term)).collect();
    par::for_each_block(y, map.block_len() * c_out, |block, rows| {
        let source = |i: usize| packed[i].as_ref().map(|p| WeightSource::Packed(p.get()));
        let terms = terms_of_block(map, block, product, source);
        block::sum_of_terms(isa, &terms, c_out, 0..c_out, rows);
        product.finish(block * map.block_len(), rows);
    });
}

fn pack<T: Scalar>(isa: Isa, arena: &Arena<T>, term: &Term<T>) -> Option<PackedWeights<T>> {
    let Term::Nodes { weights, .. } = term else { return None };
    Some(PackedWeights::new(arena, weights, weights.n_offsets(), |memory| {
        Packed::new(isa, weights, memory, |panels, len, work| {
            par::for_each_block(panels, len, work);
        })
    }))
}

/// The terms as the kernel takes them; `source(i)` holds the weights of term `i`.
pub(super) fn terms_of_block<'a, T: Scalar>(
    map: &'a KernelMap,
    block: usize,
    product: &'a Product<T>,
    source: impl Fn(usize) -> Option<WeightSource<'a, T>>,
) -> Vec<block::BlockTerm<'a, T>> {
    let (offsets, c_out) = (0..map.n_offsets(), product.c_out);
    let term = |(i, term): (usize, &'a Term<T>)| match (term, source(i)) {
        (Term::Nodes { x, .. }, Some(weights)) => {
            let pairs = offsets.clone().map(|k| map.pairs(block, k)).collect();
            block::BlockTerm::Products { x, pairs, weights }
        }
        (Term::Shapes { products, shapes }, _) => {
            let mut rows = Vec::new();
            for k in offsets.clone() {
                let first = block * map.block_len();
                for_each_shape(shapes, first, map.pairs(block, k).1, |shape, outputs| {
                    let product = &products[(k * shapes.len() + shape) * c_out..][..c_out];
                    rows.push((product, outputs));
                });
            }
            block::BlockTerm::Rows(rows)
        }
        _ => unreachable!("each product has its weights"),
    };
    product.terms.iter().enumerate().map(term).collect()
}
