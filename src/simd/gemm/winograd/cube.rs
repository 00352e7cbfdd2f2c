//! What is done along each axis of a cube.

use super::super::tile::Real;
use std::ops::{Add, Sub};

/// Numbers of one place, of several columns.
#[derive(Clone, Copy)]
pub(super) struct Lanes<T, const N: usize>(pub(super) [T; N]);

impl<T: Real, const N: usize> Lanes<T, N> {
    #[inline(always)]
    pub(super) fn zeros() -> Self {
        Lanes([T::default(); N])
    }

    /// From place `at` of `x` on.
    #[inline(always)]
    pub(super) fn of(x: &[T], at: usize) -> Self {
        Lanes(x[at..at + N].as_chunks().0[0])
    }

    #[inline(always)]
    pub(super) fn put(self, x: &mut [T], at: usize) {
        x[at..at + N].copy_from_slice(&self.0);
    }

    #[inline(always)]
    fn half(mut self) -> Self {
        self.0.iter_mut().for_each(|x| *x = x.half());
        self
    }
}

impl<T: Real, const N: usize> Add for Lanes<T, N> {
    type Output = Self;

    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        self.0.iter_mut().zip(&other.0).for_each(|(x, y)| *x = *x + *y);
        self
    }
}

impl<T: Real, const N: usize> Sub for Lanes<T, N> {
    type Output = Self;

    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        self.0.iter_mut().zip(&other.0).for_each(|(x, y)| *x = *x - *y);
        self
    }
}

/// Bᵀ
#[inline(always)]
pub(super) fn input<T: Real, const N: usize>([a, b, c, d]: [Lanes<T, N>; 4]) -> [Lanes<T, N>; 4] {
    [a - c, b + c, c - b, b - d]
}

/// G
#[inline(always)]
pub(super) fn kernel<T: Real, const N: usize>([a, b, c]: [Lanes<T, N>; 3]) -> [Lanes<T, N>; 4] {
    let (ends, middle) = ((a + c).half(), b.half());
    [a, ends + middle, ends - middle, c]
}

/// Aᵀ
#[inline(always)]
pub(super) fn output<T: Real, const N: usize>([a, b, c, d]: [Lanes<T, N>; 4]) -> [Lanes<T, N>; 2] {
    [a + b + c, b - c - d]
}

/// A
#[inline(always)]
pub(super) fn gradient<T: Real, const N: usize>([a, b]: [Lanes<T, N>; 2]) -> [Lanes<T, N>; 4] {
    [a, a + b, a - b, Lanes::zeros() - b]
}

/// Gᵀ
#[inline(always)]
pub(super) fn kernel_gradient<T: Real, const N: usize>(
    [a, b, c, d]: [Lanes<T, N>; 4],
) -> [Lanes<T, N>; 3] {
    let (sum, difference) = ((b + c).half(), (b - c).half());
    [a + sum, difference, sum + d]
}

/// Room for a cube and for what becomes of it along the way.
pub(super) struct Cubes<T, const N: usize>([[Lanes<T, N>; 64]; 2]);

impl<T: Real, const N: usize> Cubes<T, N> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Cubes([[Lanes::zeros(); 64]; 2])
    }

    /// Applies `line` along each axis of a cube of side `I` to make one of side `O`.
    #[inline(always)]
    pub(super) fn each_axis<const I: usize, const O: usize>(
        &mut self,
        x: impl Fn(usize) -> Lanes<T, N>,
        line: impl Fn([Lanes<T, N>; I]) -> [Lanes<T, N>; O],
    ) -> &[Lanes<T, N>; 64] {
        let Cubes([a, b]) = self;
        let mut along = [Lanes::zeros(); I];
        for yz in 0..I * I {
            for (i, along) in along.iter_mut().enumerate() {
                *along = x(i * I * I + yz);
            }
            let out = line(along);
            for o in 0..O {
                a[o * I * I + yz] = out[o];
            }
        }
        for x in 0..O {
            for z in 0..I {
                for (i, along) in along.iter_mut().enumerate() {
                    *along = a[(x * I + i) * I + z];
                }
                let out = line(along);
                for o in 0..O {
                    b[(x * O + o) * I + z] = out[o];
                }
            }
        }
        for xy in 0..O * O {
            for (i, along) in along.iter_mut().enumerate() {
                *along = b[xy * I + i];
            }
            let out = line(along);
            for o in 0..O {
                a[xy * O + o] = out[o];
            }
        }
        a
    }
}
