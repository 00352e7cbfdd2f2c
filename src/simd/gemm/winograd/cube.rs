//! The transforms of Winograd's filtering along one axis, and their application along all axes of a cube.

use std::ops::{Add, Mul, Sub};

/// Numbers of one place: a vector of columns or of groups, or a single number.
pub(in crate::simd) trait Lane:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
}

impl<L: Copy + Add<Output = L> + Sub<Output = L> + Mul<Output = L>> Lane for L {}

/// Bᵀ
#[inline(always)]
pub(in crate::simd) fn input<L: Lane>([a, b, c, d]: [L; 4]) -> [L; 4] {
    [a - c, b + c, c - b, b - d]
}

/// G
#[inline(always)]
pub(in crate::simd) fn kernel<L: Lane>(half: L, [a, b, c]: [L; 3]) -> [L; 4] {
    let (ends, middle) = (half * (a + c), half * b);
    [a, ends + middle, ends - middle, c]
}

/// Aᵀ
#[inline(always)]
pub(in crate::simd) fn output<L: Lane>([a, b, c, d]: [L; 4]) -> [L; 2] {
    [a + b + c, b - c - d]
}

/// A
#[inline(always)]
pub(in crate::simd) fn gradient<L: Lane>(zero: L, [a, b]: [L; 2]) -> [L; 4] {
    [a, a + b, a - b, zero - b]
}

/// Gᵀ
#[inline(always)]
pub(in crate::simd) fn kernel_gradient<L: Lane>(half: L, [a, b, c, d]: [L; 4]) -> [L; 3] {
    let (sum, difference) = (half * (b + c), half * (b - c));
    [a + sum, difference, sum + d]
}

/// What becomes of a cube along the way: after one axis, and after two.
pub(in crate::simd) type Halfway<L> = [[L; 64]; 2];

/// Applies `line` along each axis of the cube `x` of side `I`; `put` receives each place of the resulting cube
/// of side `O`.
#[inline(always)]
pub(in crate::simd) fn each_axis<L: Lane, const I: usize, const O: usize>(
    [a, b]: &mut Halfway<L>,
    x: impl Fn(usize) -> L,
    line: impl Fn([L; I]) -> [L; O],
    mut put: impl FnMut(usize, L),
) {
    let mut along = [x(0); I];
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
            put(xy * O + o, out[o]);
        }
    }
}
