//! Intermediate matrices that a backward pass needs: saved, or recomputed.

use super::arena::Buffer;

/// Whether an intermediate matrix that the backward pass needs is saved or recomputed. Gradients have the same bits
/// either way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Policy {
    /// It stays in memory.
    Save,
    /// It is dropped, and computed once more from what came before it.
    Recompute,
}

/// An intermediate matrix under a [`Policy`]. Restoring uses it up, so one forward serves one backward.
///
/// ```
/// use deepmill::nn::arena::Arena;
/// use deepmill::nn::saved::{Policy, Saved};
///
/// let arena = Arena::<f64>::default();
/// let saved = Saved::new(Policy::Save, arena.copy_of(&[1.0, 2.0]));
/// let dropped = Saved::new(Policy::Recompute, arena.copy_of(&[1.0, 2.0, 3.0]));
/// assert_eq!(arena.in_use_bytes(), 16); // only what is saved takes memory
/// assert_eq!(saved.restore(|| unreachable!("it is there"))[..], [1.0, 2.0]);
/// assert_eq!(dropped.restore(|| arena.copy_of(&[4.0, 5.0, 6.0]))[..], [4.0, 5.0, 6.0]);
/// ```
#[derive(Debug)]
pub struct Saved<T>(Option<Buffer<T>>);

impl<T> Saved<T> {
    /// Keeps `matrix` if `policy` says so.
    pub fn new(policy: Policy, matrix: Buffer<T>) -> Self {
        Saved((policy == Policy::Save).then_some(matrix))
    }

    /// The matrix, or what `recompute` makes.
    pub fn restore(self, recompute: impl FnOnce() -> Buffer<T>) -> Buffer<T> {
        self.0.unwrap_or_else(recompute)
    }

    /// The matrix, if it was saved.
    pub fn get(&self) -> Option<&Buffer<T>> {
        self.0.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::super::arena::Arena;
    use super::*;

    #[test]
    fn only_what_is_dropped_is_recomputed_and_only_what_is_saved_takes_memory() {
        let arena = Arena::<f32>::default();
        let saved = Saved::new(Policy::Save, arena.zeroed(3));
        let dropped = Saved::new(Policy::Recompute, arena.zeroed(5));
        assert_eq!(arena.in_use_bytes(), 12);
        assert_eq!(saved.restore(|| unreachable!("it was saved")).len(), 3);
        assert_eq!(dropped.restore(|| arena.get(7)).len(), 7);
    }
}
