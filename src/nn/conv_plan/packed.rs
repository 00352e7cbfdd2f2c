//! Weights packed for a kernel, in the arena's memory.

use super::super::arena::{Arena, Buffer};
use crate::numeric::scalar::Scalar;
use crate::simd::gemm::weights::{Packed, Weights};

/// Widest panel in use, and numbers to skip to the begin of a cache line.
pub(super) const PANEL: usize = 32;
const ALIGNMENT: usize = 16;

/// [`Packed`] weights, whose memory goes back to the arena on drop.
pub(super) struct PackedWeights<T: Scalar> {
    packed: Option<Packed<T>>,
    memory: Buffer<T>,
}

impl<T: Scalar> PackedWeights<T> {
    /// What `pack` makes of `weights`, `n_matrices` of their size, in the memory it is given.
    pub(super) fn new(
        arena: &Arena<T>,
        weights: &Weights<T>,
        n_matrices: usize,
        pack: impl FnOnce(Vec<T>) -> Packed<T>,
    ) -> Self {
        let width = weights.width().next_multiple_of(PANEL);
        let mut memory = arena.get(n_matrices * weights.depth() * width + ALIGNMENT);
        let packed = Some(pack(memory.take_vec()));
        PackedWeights { packed, memory }
    }

    /// The packed weights.
    pub(super) fn get(&self) -> &Packed<T> {
        self.packed.as_ref().expect("weights are there until they are dropped")
    }
}

impl<T: Scalar> Drop for PackedWeights<T> {
    fn drop(&mut self) {
        if let Some(packed) = self.packed.take() {
            self.memory.put_vec(packed.into_memory());
        }
    }
}
