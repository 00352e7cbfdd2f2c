//! Memory of the layers: buffers that return to a pool when they go out of scope and are reused.
//!
//! Fresh pages for every layer would cost more than the arithmetic in them, so a released buffer stays in its
//! arena until another layer asks for one of its size. An [`Arena`] is a handle: clones share one pool, from
//! any thread. Content never passes from one user to the next as far as results are concerned: whoever gets
//! a buffer overwrites it, or asks for zeros.

use std::borrow::Borrow;
use std::fmt;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, MutexGuard};

/// A pool of buffers of one number type.
///
/// ```
/// use deepmill::nn::arena::Arena;
/// let arena = Arena::<f32>::default();
/// let sum: f32 = arena.zeroed(1000).iter().sum();
/// let again = arena.get(900); // in the memory of the first
/// assert_eq!((sum, again.len(), arena.peak_bytes()), (0.0, 900, 4000));
/// ```
pub struct Arena<T>(Arc<Mutex<Pool<T>>>);

/// A free buffer serves a request that it exceeds by at most one part in so many.
const FIT: usize = 8;
/// Beyond one part in so many above the peak, free buffers go back to the system before new ones are made.
const EXCESS: usize = 32;

/// Counts are numbers of `T`.
struct Pool<T> {
    /// What every buffer is filled with, to show who reads what nobody has written.
    fill: Option<T>,
    free: Vec<Vec<T>>,
    in_use: usize,
    peak: usize,
    reserved: usize,
}

/// Memory of an [`Arena`], returned to it on drop. The default one is empty and belongs to none.
pub struct Buffer<T> {
    data: Vec<T>,
    len: usize,
    /// What the arena counts: numbers requested, and numbers held.
    requested: usize,
    reserved: usize,
    arena: Option<Arena<T>>,
}

impl<T: Copy + Default> Arena<T> {
    /// An arena whose buffers hold `fill` until they are written.
    pub(crate) fn filled_with(fill: T) -> Self {
        let arena = Arena::default();
        arena.pool().fill = Some(fill);
        arena
    }

    /// `n` numbers of any content.
    pub fn get(&self, n: usize) -> Buffer<T> {
        let data = self.pool().take(n);
        Buffer { len: n, requested: n, reserved: data.len(), data, arena: Some(self.clone()) }
    }

    /// `n` times the default number, 0.
    pub fn zeroed(&self, n: usize) -> Buffer<T> {
        let mut buffer = self.get(n);
        buffer.fill(T::default());
        buffer
    }

    /// A copy of `x`.
    pub fn copy_of(&self, x: &[T]) -> Buffer<T> {
        let mut buffer = self.get(x.len());
        buffer.copy_from_slice(x);
        buffer
    }
}

impl<T> Arena<T> {
    /// Most bytes in use at once since the arena was made or [`Arena::reset_peak`] was called.
    pub fn peak_bytes(&self) -> usize {
        self.pool().peak * size_of::<T>()
    }

    /// Bytes that the arena holds, in use or not: at most 9/8 of the greatest peak.
    pub fn reserved_bytes(&self) -> usize {
        self.pool().reserved * size_of::<T>()
    }

    /// Bytes in use now.
    pub fn in_use_bytes(&self) -> usize {
        self.pool().in_use * size_of::<T>()
    }

    /// Starts [`Arena::peak_bytes`] again from what is in use now.
    pub fn reset_peak(&self) {
        let mut pool = self.pool();
        pool.peak = pool.in_use;
    }

    fn pool(&self) -> MutexGuard<'_, Pool<T>> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

impl<T: Copy + Default> Pool<T> {
    fn take(&mut self, n: usize) -> Vec<T> {
        let mut data = self.take_unfilled(n);
        if let Some(fill) = self.fill {
            data.fill(fill);
        }
        data
    }

    fn take_unfilled(&mut self, n: usize) -> Vec<T> {
        if n == 0 {
            return Vec::new();
        }
        self.in_use += n;
        self.peak = self.peak.max(self.in_use);
        let close = n..=n + n / FIT;
        let fits = (0..self.free.len()).filter(|&i| close.contains(&self.free[i].len()));
        if let Some(best) = fits.min_by_key(|&i| self.free[i].len()) {
            return self.free.swap_remove(best);
        }
        let limit = self.peak + self.peak / EXCESS;
        while self.reserved + n > limit && self.release(self.reserved + n - limit) {}
        self.reserved += n;
        vec![T::default(); n]
    }

    /// Gives the smallest free buffer of at least `n` numbers back to the system, or the largest, if there is one.
    fn release(&mut self, n: usize) -> bool {
        let size = |&i: &usize| self.free[i].len();
        let enough = (0..self.free.len()).filter(|i| size(i) >= n).min_by_key(size);
        let place = enough.or_else(|| (0..self.free.len()).max_by_key(size));
        let released = place.map(|i| self.free.swap_remove(i));
        self.reserved -= released.as_ref().map_or(0, Vec::len);
        released.is_some()
    }
}

impl<T> Buffer<T> {
    /// The memory as a vector of at least the buffer's length, for a kernel that wants one; the buffer is empty
    /// until [`Buffer::put_vec`] and counts as before.
    pub(super) fn take_vec(&mut self) -> Vec<T> {
        self.len = 0;
        std::mem::take(&mut self.data)
    }

    /// Takes memory back, the same or other.
    pub(super) fn put_vec(&mut self, data: Vec<T>) {
        self.data = data;
        self.len = self.requested.min(self.data.len());
    }
}

impl<T> Drop for Buffer<T> {
    fn drop(&mut self) {
        let Some(arena) = self.arena.take() else { return };
        let mut pool = arena.pool();
        pool.in_use -= self.requested;
        pool.reserved = pool.reserved + self.data.len() - self.reserved;
        if !self.data.is_empty() {
            pool.free.push(std::mem::take(&mut self.data));
        }
    }
}

impl<T> Clone for Arena<T> {
    /// Another handle of the same pool.
    fn clone(&self) -> Self {
        Arena(Arc::clone(&self.0))
    }
}

impl<T> Default for Arena<T> {
    fn default() -> Self {
        let pool = Pool { fill: None, free: Vec::new(), in_use: 0, peak: 0, reserved: 0 };
        Arena(Arc::new(Mutex::new(pool)))
    }
}

impl<T> fmt::Debug for Arena<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (peak, reserved) = (self.peak_bytes(), self.reserved_bytes());
        write!(f, "Arena {{ peak_bytes: {peak}, reserved_bytes: {reserved} }}")
    }
}

impl<T> Deref for Buffer<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.data[..self.len]
    }
}

impl<T> DerefMut for Buffer<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.data[..self.len]
    }
}

impl<T> Borrow<[T]> for Buffer<T> {
    fn borrow(&self) -> &[T] {
        self
    }
}

impl<T: Copy + Default> Clone for Buffer<T> {
    /// A copy in the same arena.
    fn clone(&self) -> Self {
        self.arena.as_ref().map_or_else(Buffer::default, |arena| arena.copy_of(self))
    }
}

impl<T> Default for Buffer<T> {
    fn default() -> Self {
        Buffer { data: Vec::new(), len: 0, requested: 0, reserved: 0, arena: None }
    }
}

impl<T: fmt::Debug> fmt::Debug for Buffer<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.deref().fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_released_buffer_is_reused_and_never_twice_at_once() {
        let arena = Arena::<f32>::default();
        let first = arena.get(100);
        let place = first.as_ptr();
        drop(first);
        let (second, third) = (arena.get(95), arena.get(95));
        assert_eq!(second.as_ptr(), place);
        assert_ne!(third.as_ptr(), place);
        assert_eq!((second.len(), arena.in_use_bytes()), (95, 760));
    }

    #[test]
    fn zeros_are_zeros_in_used_memory() {
        let arena = Arena::<f64>::default();
        arena.get(10).fill(f64::NAN);
        assert_eq!(arena.zeroed(10)[..], [0.0; 10]);
    }

    #[test]
    fn a_filled_arena_shows_its_number_in_new_and_used_memory() {
        let arena = Arena::<f64>::filled_with(7.0);
        arena.get(10).fill(1.0);
        assert_eq!((&arena.get(9)[..], &arena.get(3)[..]), (&[7.0; 9][..], &[7.0; 3][..]));
        assert_eq!(arena.zeroed(3)[..], [0.0; 3]);
    }

    #[test]
    fn peak_counts_what_is_in_use_at_once() {
        let arena = Arena::<u8>::default();
        drop((arena.get(100), arena.get(50)));
        let kept = arena.clone().get(20);
        assert_eq!((arena.peak_bytes(), arena.in_use_bytes()), (150, 20));
        arena.reset_peak();
        assert_eq!(arena.peak_bytes(), 20);
        assert_eq!(kept.clone().len(), 20);
        assert_eq!(arena.peak_bytes(), 40);
    }

    /// Sizes as of layers of many widths, over batches that grow and shrink.
    #[test]
    fn reserved_memory_stays_near_the_peak_whatever_the_sizes() {
        let arena = Arena::<u8>::default();
        for step in 0..200 {
            let size = |i: usize| 1000 + (i * 7919 + step * 104_729) % 50_000;
            let mut held: Vec<_> = (0..20).map(|i| arena.get(size(i))).collect();
            for i in 20..60 {
                held.swap_remove((i * step) % held.len());
                held.push(arena.get(size(i)));
            }
            assert!(arena.reserved_bytes() <= arena.peak_bytes() * 9 / 8, "{arena:?}");
        }
    }

    #[test]
    fn memory_of_a_vector_taken_out_is_counted_until_its_buffer_ends() {
        let arena = Arena::<u8>::default();
        let mut buffer = arena.get(100);
        let data = buffer.take_vec();
        assert_eq!((data.len(), buffer.len(), arena.in_use_bytes()), (100, 0, 100));
        buffer.put_vec(vec![1; 150]);
        assert_eq!(buffer[..], [1; 100]);
        drop(buffer);
        assert_eq!((arena.in_use_bytes(), arena.reserved_bytes()), (0, 150));
        drop(arena.get(140).take_vec());
        assert_eq!((arena.in_use_bytes(), arena.reserved_bytes()), (0, 0));
    }

    #[test]
    fn buffers_may_be_taken_and_returned_on_any_thread() {
        let arena = Arena::<u32>::default();
        std::thread::scope(|scope| {
            for n in 1..5 {
                scope.spawn({
                    let arena = arena.clone();
                    move || {
                        (0..100).for_each(|i| assert_eq!(arena.zeroed(n * i)[..], vec![0; n * i]))
                    }
                });
            }
        });
        assert_eq!(arena.in_use_bytes(), 0);
    }
}
