//! Working memory that a thread keeps from call to call: fresh pages for every layer would cost more than what
//! is done in them. It holds nothing that a result depends on.

use crate::scalar::Scalar;
use std::any::Any;
use std::cell::RefCell;

thread_local! {
    /// One of each kind that is not in use.
    static KEPT: RefCell<Vec<Box<dyn Any>>> = const { RefCell::new(Vec::new()) };
}

/// Memory of the kind `M`, lent by the thread until it is dropped.
pub(super) struct Lent<M: Default + 'static>(M);

impl<M: Default + 'static> Lent<M> {
    /// What the last user of this kind on this thread left, or fresh.
    pub(super) fn new() -> Self {
        let kept = KEPT.with_borrow_mut(|kept| {
            let place = kept.iter().position(|memory| memory.is::<M>())?;
            kept.swap_remove(place).downcast::<M>().ok()
        });
        Lent(kept.map_or_else(M::default, |memory| *memory))
    }

    /// The memory.
    pub(super) fn get(&mut self) -> &mut M {
        &mut self.0
    }
}

impl<M: Default + 'static> Drop for Lent<M> {
    fn drop(&mut self) {
        let memory = std::mem::take(&mut self.0);
        KEPT.with_borrow_mut(|kept| {
            if !kept.iter().any(|memory| memory.is::<M>()) {
                kept.push(Box::new(memory));
            }
        });
    }
}

/// The largest pieces of memory that a product takes: weights in the form it reads, or what becomes of nodes
/// and of gradients.
#[derive(Default)]
pub(super) struct Large<T>(Vec<Vec<T>>);

impl<T: Scalar> Large<T> {
    /// A piece of any size and content.
    pub(super) fn take(&mut self) -> Vec<T> {
        self.0.pop().unwrap_or_default()
    }

    /// A piece of at least `len` numbers.
    pub(super) fn take_at_least(&mut self, len: usize) -> Vec<T> {
        let piece = self.take();
        if piece.len() < len { vec![T::ZERO; len] } else { piece }
    }

    /// Takes pieces back, the one taken first also first: it will be the first again.
    pub(super) fn give(&mut self, pieces: impl DoubleEndedIterator<Item = Vec<T>>) {
        self.0.extend(pieces.rev());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Numbers(Vec<u32>);

    #[test]
    fn a_thread_lends_the_same_memory_again_but_never_twice_at_once() {
        let mut first = Lent::<Numbers>::new();
        first.get().0.push(1);
        let mut second = Lent::<Numbers>::new();
        assert!(second.get().0.is_empty());
        second.get().0.extend([2, 2]);
        drop(first);
        drop(second);
        assert_eq!(Lent::<Numbers>::new().get().0, [1]);
        std::thread::spawn(|| assert!(Lent::<Numbers>::new().get().0.is_empty())).join().unwrap();
    }
}
