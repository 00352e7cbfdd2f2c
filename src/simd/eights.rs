//! Eight numbers at a time: the vector operations that the collision kernels are written in.
//!
//! Every level works on eight lanes, in one register or several, so that the kernels, their tails and
//! their results do not depend on the level. Nothing here is fused or reassociated: lane by lane each
//! operation is the `f32` operation of the same name. No operand may be NaN.

#[cfg(target_arch = "x86_64")]
mod x86;

use super::level::Portable;

/// Eight-lane operations of a level; the token `self` proves that the processor has them.
pub trait Eights: Copy {
    /// Eight `f32`.
    type Eight: Copy;

    /// All lanes `x`.
    fn splat(self, x: f32) -> Self::Eight;
    /// Lanes from memory.
    fn load(self, from: &[f32; 8]) -> Self::Eight;
    /// Lanes to memory.
    fn store(self, lanes: Self::Eight, to: &mut [f32; 8]);
    /// `a + b`.
    fn add(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// `a − b`.
    fn sub(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// `a · b`.
    fn mul(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// The lesser of each pair; either zero when both are zeros.
    fn min(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// The greater of each pair; either zero when both are zeros.
    fn max(self, a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// Bit `l` is `a > b` in lane `l`.
    fn greater(self, a: Self::Eight, b: Self::Eight) -> u32;
    /// Bit `l` is `a ≤ b` in lane `l`.
    fn at_most(self, a: Self::Eight, b: Self::Eight) -> u32;
    /// Bit `l` is `a > b` and `c ≤ d` in lane `l`.
    fn greater_and_at_most(
        self,
        a: Self::Eight,
        b: Self::Eight,
        c: Self::Eight,
        d: Self::Eight,
    ) -> u32;
    /// Eight counters.
    type Counts: Copy;
    /// Counters at zero.
    fn no_counts(self) -> Self::Counts;
    /// Counter `l` goes up by one if `a ≤ b` in lane `l`; good for 2³² steps.
    fn count_at_most(self, counts: Self::Counts, a: Self::Eight, b: Self::Eight) -> Self::Counts;
    /// Counters added lane by lane.
    fn add_counts(self, a: Self::Counts, b: Self::Counts) -> Self::Counts;
    /// Sum of the counters.
    fn total(self, counts: Self::Counts) -> u32;
    /// The lanes named by `mask`, in order, moved to the front; the other lanes are unspecified.
    fn compress(self, lanes: Self::Eight, mask: u32) -> Self::Eight;
    /// The lanes named by `mask`, those of `other` elsewhere.
    fn only(self, lanes: Self::Eight, mask: u32, other: Self::Eight) -> Self::Eight;
    /// The lanes, from 0 to 2³¹, without their fractions.
    fn truncate(self, lanes: Self::Eight) -> [u32; 8];
    /// Lane `r` of number `l` is lane `l` of `rows[r]`, NaN or not.
    fn transpose(self, rows: [Self::Eight; 8]) -> [Self::Eight; 8];
    /// Lane `l` is the least lane of `rows[l]`.
    fn least_of_each(self, rows: [Self::Eight; 8]) -> Self::Eight;
    /// Lane `l` is the greatest lane of `rows[l]`.
    fn greatest_of_each(self, rows: [Self::Eight; 8]) -> Self::Eight;
    /// The least lane.
    #[inline(always)]
    fn least(self, lanes: Self::Eight) -> f32 {
        let mut least = [0.0; 8];
        self.store(self.least_of_each([lanes; 8]), &mut least);
        least[0]
    }
    /// The greatest lane.
    #[inline(always)]
    fn greatest(self, lanes: Self::Eight) -> f32 {
        let mut greatest = [0.0; 8];
        self.store(self.greatest_of_each([lanes; 8]), &mut greatest);
        greatest[0]
    }
}

macro_rules! lanes {
    ($body:expr) => {
        std::array::from_fn($body)
    };
}

macro_rules! bits {
    ($condition:expr) => {{
        let condition = $condition;
        let mut bits = 0;
        for lane in 0..8 {
            bits |= u32::from(condition(lane)) << lane;
        }
        bits
    }};
}

macro_rules! arrays {
    ($token:ty) => {
        impl Eights for $token {
            type Eight = [f32; 8];
            type Counts = [u32; 8];

            #[inline(always)]
            fn no_counts(self) -> [u32; 8] {
                [0; 8]
            }
            #[inline(always)]
            fn count_at_most(self, counts: [u32; 8], a: [f32; 8], b: [f32; 8]) -> [u32; 8] {
                lanes!(|l| counts[l] + u32::from(a[l] <= b[l]))
            }
            #[inline(always)]
            fn add_counts(self, a: [u32; 8], b: [u32; 8]) -> [u32; 8] {
                lanes!(|l| a[l] + b[l])
            }
            #[inline(always)]
            fn total(self, counts: [u32; 8]) -> u32 {
                counts.iter().sum()
            }

            #[inline(always)]
            fn splat(self, x: f32) -> [f32; 8] {
                [x; 8]
            }
            #[inline(always)]
            fn load(self, from: &[f32; 8]) -> [f32; 8] {
                *from
            }
            #[inline(always)]
            fn store(self, lanes: [f32; 8], to: &mut [f32; 8]) {
                *to = lanes;
            }
            #[inline(always)]
            fn add(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
                lanes!(|l| a[l] + b[l])
            }
            #[inline(always)]
            fn sub(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
                lanes!(|l| a[l] - b[l])
            }
            #[inline(always)]
            fn mul(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
                lanes!(|l| a[l] * b[l])
            }
            #[inline(always)]
            fn min(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
                lanes!(|l| if a[l] < b[l] { a[l] } else { b[l] })
            }
            #[inline(always)]
            fn max(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
                lanes!(|l| if a[l] > b[l] { a[l] } else { b[l] })
            }
            #[inline(always)]
            fn greater(self, a: [f32; 8], b: [f32; 8]) -> u32 {
                bits!(|l: usize| a[l] > b[l])
            }
            #[inline(always)]
            fn at_most(self, a: [f32; 8], b: [f32; 8]) -> u32 {
                bits!(|l: usize| a[l] <= b[l])
            }
            #[inline(always)]
            fn greater_and_at_most(
                self,
                a: [f32; 8],
                b: [f32; 8],
                c: [f32; 8],
                d: [f32; 8],
            ) -> u32 {
                bits!(|l: usize| (a[l] > b[l]) & (c[l] <= d[l]))
            }
            #[inline(always)]
            fn compress(self, lanes: [f32; 8], mask: u32) -> [f32; 8] {
                let mut packed = [0.0; 8];
                let mut n = 0;
                for (lane, x) in lanes.into_iter().enumerate() {
                    packed[n & 7] = x;
                    n += (mask >> lane & 1) as usize;
                }
                packed
            }
            #[inline(always)]
            fn only(self, lanes: [f32; 8], mask: u32, other: [f32; 8]) -> [f32; 8] {
                lanes!(|l| if mask >> l & 1 == 1 { lanes[l] } else { other[l] })
            }
            #[inline(always)]
            fn truncate(self, lanes: [f32; 8]) -> [u32; 8] {
                lanes.map(|lane| lane as u32)
            }
            #[inline(always)]
            fn transpose(self, rows: [[f32; 8]; 8]) -> [[f32; 8]; 8] {
                let mut columns = [[0.0; 8]; 8];
                for (r, row) in rows.into_iter().enumerate() {
                    columns.iter_mut().zip(row).for_each(|(column, x)| column[r] = x);
                }
                columns
            }
            #[inline(always)]
            fn least_of_each(self, rows: [[f32; 8]; 8]) -> [f32; 8] {
                lanes!(|l: usize| rows[l].iter().fold(f32::INFINITY, |m, &x| if x < m {
                    x
                } else {
                    m
                }))
            }
            #[inline(always)]
            fn greatest_of_each(self, rows: [[f32; 8]; 8]) -> [f32; 8] {
                lanes!(|l: usize| rows[l].iter().fold(f32::NEG_INFINITY, |m, &x| if x > m {
                    x
                } else {
                    m
                }))
            }
        }
    };
}

arrays!(Portable);
// NEON belongs to the baseline of 64-bit ARM, so the compiler vectorises the arrays by itself.
#[cfg(target_arch = "aarch64")]
arrays!(super::level::Neon);

#[cfg(test)]
mod tests {
    use crate::simd::{Kernel, Level, Simd};

    /// Results of every operation on two vectors, as plain numbers.
    struct Everything<'a>(&'a [f32; 8], &'a [f32; 8]);

    impl Kernel for Everything<'_> {
        type Output = (Vec<[f32; 8]>, Vec<u32>);

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> Self::Output {
            let (a, b) = (s.load(self.0), s.load(self.1));
            let rows: [S::Eight; 8] =
                std::array::from_fn(|l| s.add(a, s.mul(b, s.splat(l as f32 - 3.5))));
            let eights = [
                s.splat(self.0[3]),
                s.add(a, b),
                s.sub(a, b),
                s.mul(a, b),
                s.min(a, b),
                s.max(a, b),
                s.least_of_each(rows),
                s.greatest_of_each(rows),
            ];
            let stored = eights.map(|v| {
                let mut out = [0.0; 8];
                s.store(v, &mut out);
                out
            });
            let masks = vec![
                s.greater(a, b),
                s.at_most(a, b),
                s.greater_and_at_most(a, b, b, s.splat(0.5)),
            ];
            (stored.to_vec(), masks)
        }
    }

    struct Transpose<'a>(&'a [[f32; 8]; 8]);

    impl Kernel for Transpose<'_> {
        type Output = [[f32; 8]; 8];

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> [[f32; 8]; 8] {
            let columns = s.transpose(std::array::from_fn(|r| s.load(&self.0[r])));
            let mut out = [[0.0; 8]; 8];
            columns.into_iter().zip(&mut out).for_each(|(column, out)| s.store(column, out));
            out
        }
    }

    #[test]
    fn rows_become_columns() {
        let rows = std::array::from_fn(|r| std::array::from_fn(|l| (8 * r + l) as f32));
        let columns = std::array::from_fn(|l| std::array::from_fn(|r| (8 * r + l) as f32));
        for level in Level::available() {
            assert_eq!(level.run(Transpose(&rows)), columns, "{}", level.name());
        }
    }

    struct Compress<'a>(&'a [f32; 8], u32);

    impl Kernel for Compress<'_> {
        type Output = [f32; 8];

        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> [f32; 8] {
            let mut out = [0.0; 8];
            s.store(s.compress(s.load(self.0), self.1), &mut out);
            out
        }
    }

    #[test]
    fn every_level_gives_the_same_lanes() {
        let mut stream = crate::rng::Stream::new(3, 0, 0, crate::rng::Purpose::Probe);
        for _ in 0..200 {
            let mut draw = || std::array::from_fn(|_| stream.range(-2.0, 2.0).round() as f32 * 0.3);
            let (a, b): ([f32; 8], [f32; 8]) = (draw(), draw());
            let plain = Level::available()[0].run(Everything(&a, &b));
            assert_eq!(plain.1[0], (0..8).map(|l| u32::from(a[l] > b[l]) << l).sum::<u32>());
            for level in Level::available() {
                assert_eq!(level.run(Everything(&a, &b)), plain, "{}", level.name());
            }
        }
    }

    #[test]
    fn compress_brings_the_named_lanes_to_the_front() {
        let lanes: [f32; 8] = std::array::from_fn(|l| l as f32);
        for level in Level::available() {
            for mask in 0..256u32 {
                let expected = (0..8).filter(|l| mask >> l & 1 == 1).map(|l| l as f32);
                let n = mask.count_ones() as usize;
                assert!(level.run(Compress(&lanes, mask))[..n].iter().copied().eq(expected));
            }
        }
    }
}
