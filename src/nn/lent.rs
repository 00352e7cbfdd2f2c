//! Working memory that is kept between calls: fresh pages for every layer cost more than what is done in them.

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
