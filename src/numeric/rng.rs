//! Random streams keyed by (seed, epoch, sample, purpose).
//!
//! The four numbers *are* the ChaCha8 key, so no stream depends on how many numbers another one has
//! drawn: resuming, sharding and reordering do not change any random decision.

use rand_chacha::ChaCha8Rng;
/// The traits of random generators, for [`Stream`].
pub use rand_chacha::rand_core;
use rand_chacha::rand_core::{Rng, SeedableRng, TryRng};
use std::convert::Infallible;

/// What a random stream decides. The discriminants are part of the file formats: never renumber.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
#[non_exhaustive]
pub enum Purpose {
    /// Initial parameters of a network.
    Init = 1,
    /// Surface sites of a part.
    Sites = 2,
    /// Cutter sizes.
    Cutter = 3,
    /// Order of the samples in an epoch.
    Shuffle = 4,
    /// Mirroring, turning and elastic deformation.
    Augment = 5,
    /// Dropout masks.
    Dropout = 6,
    /// Shapes of generated parts.
    Part = 7,
    /// Probes of a gradient check and other tests.
    Probe = 8,
    /// Neighbor sampling in a graph network.
    Neighbors = 9,
    /// Orientation of a part.
    Orientation = 10,
    /// Which predicted answers are computed to compare.
    SpotCheck = 11,
}

/// One random stream. It is a generator of `rand` 0.10 too, whose distributions draw from it.
///
/// ```
/// use deepmill::rng::rand_core::Rng;
/// use deepmill::rng::{Purpose, Stream};
/// let dice = |rng: &mut dyn Rng| rng.next_u32() % 6;
/// let (mut one, mut other) = (Stream::new(1, 0, 0, Purpose::Probe), Stream::new(1, 0, 0, Purpose::Probe));
/// assert_eq!(dice(&mut one), dice(&mut other));
/// assert_eq!(one.next_u64(), other.bits());
/// ```
#[derive(Debug, Clone)]
pub struct Stream(ChaCha8Rng);

impl Stream {
    /// The stream of `purpose` for one sample of one epoch of a run.
    pub fn new(seed: u64, epoch: u64, sample: u64, purpose: Purpose) -> Self {
        let mut key = [0u8; 32];
        for (word, bytes) in [seed, epoch, sample, purpose as u64].iter().zip(key.chunks_mut(8)) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        Stream(ChaCha8Rng::from_seed(key))
    }

    /// Sixty-four random bits.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// Uniform in `[0, 1)` with 53 random bits.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in `[low, high)`.
    ///
    /// # Panics
    /// If the distance of both is not finite.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        assert!((high - low).is_finite(), "a range from {low} to {high}");
        low + (high - low) * self.unit()
    }

    /// Uniform on a logarithmic scale in `[low, high)`.
    ///
    /// # Panics
    /// If one of both is not positive and finite.
    pub fn log_range(&mut self, low: f64, high: f64) -> f64 {
        assert!(low > 0.0 && high > 0.0, "a logarithmic range from {low} to {high}");
        libm::exp(self.range(libm::log(low), libm::log(high)))
    }

    /// Uniform in `0..n`; 0 when `n` is 0. The bias of the multiply-shift is below `n / 2^64`.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    /// Normally distributed with mean 0 and variance 1 (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.unit()));
        radius * libm::cos(std::f64::consts::TAU * self.unit())
    }

    /// Fisher–Yates shuffle.
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }
}

impl TryRng for Stream {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok(self.0.next_u32())
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        Ok(self.0.next_u64())
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        self.0.fill_bytes(bytes);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_in_every_key_and_repeat() {
        let first = |a, b, c, p| Stream::new(a, b, c, p).bits();
        let base = first(1, 2, 3, Purpose::Init);
        assert_eq!(base, first(1, 2, 3, Purpose::Init));
        assert_ne!(base, first(2, 2, 3, Purpose::Init));
        assert_ne!(base, first(1, 3, 3, Purpose::Init));
        assert_ne!(base, first(1, 2, 4, Purpose::Init));
        assert_ne!(base, first(1, 2, 3, Purpose::Sites));
    }

    #[test]
    fn moments_are_right() {
        let mut stream = Stream::new(7, 0, 0, Purpose::Probe);
        let n = 100_000;
        let (mut mean, mut square, mut unit) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let x = stream.normal();
            mean += x / f64::from(n);
            square += x * x / f64::from(n);
            unit += stream.unit() / f64::from(n);
        }
        assert!(mean.abs() < 0.02 && (square - 1.0).abs() < 0.03 && (unit - 0.5).abs() < 0.01);
        assert_eq!(stream.below(0), 0);
        assert!((0..1000).all(|_| stream.below(3) < 3));
    }
}
