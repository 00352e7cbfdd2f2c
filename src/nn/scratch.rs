//! Work space that a thread keeps from call to call, for kernels with buffers of their own types. No result depends on
//! its content. Plain buffers come from an [`super::arena::Arena`].

use std::any::Any;
use std::cell::RefCell;
use std::ops::{Deref, DerefMut};

thread_local! {
    /// At most one of each type that is not in use.
    static FREE: RefCell<Vec<Box<dyn Any>>> = const { RefCell::new(Vec::new()) };
}

/// Work space of type `S`, kept by the thread once it is dropped.
pub(super) struct ScratchGuard<S: Default + 'static>(S);

impl<S: Default + 'static> ScratchGuard<S> {
    /// What the last user of this type on this thread left, or the default.
    pub(super) fn new() -> Self {
        let free = FREE.with_borrow_mut(|free| {
            let place = free.iter().position(|scratch| scratch.is::<S>())?;
            free.swap_remove(place).downcast::<S>().ok()
        });
        ScratchGuard(free.map_or_else(S::default, |scratch| *scratch))
    }
}

impl<S: Default + 'static> Drop for ScratchGuard<S> {
    fn drop(&mut self) {
        let scratch = std::mem::take(&mut self.0);
        FREE.with_borrow_mut(|free| {
            if !free.iter().any(|scratch| scratch.is::<S>()) {
                free.push(Box::new(scratch));
            }
        });
    }
}

impl<S: Default + 'static> Deref for ScratchGuard<S> {
    type Target = S;

    fn deref(&self) -> &S {
        &self.0
    }
}

impl<S: Default + 'static> DerefMut for ScratchGuard<S> {
    fn deref_mut(&mut self) -> &mut S {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Numbers(Vec<u32>);

    #[test]
    fn a_thread_keeps_scratch_but_never_lends_it_twice_at_once() {
        let mut first = ScratchGuard::<Numbers>::new();
        first.0.0.push(1);
        let mut second = ScratchGuard::<Numbers>::new();
        assert!(second.0.0.is_empty());
        second.0.0.extend([2, 2]);
        drop(first);
        drop(second);
        assert_eq!(ScratchGuard::<Numbers>::new().0.0, [1]);
        std::thread::spawn(|| assert!(ScratchGuard::<Numbers>::new().0.0.is_empty()))
            .join()
            .unwrap();
    }
}
