//! Elementwise kernels: sums, activations, products with sparse rows, the SGD update.
//!
//! Operations are those of the plain loop beside each kernel, in its order and rounded as often; lanes run over
//! elements.

use super::{Isa, Kernel, Real, Simd, Vector};

/// Calls `$work(s, chunk)` for the vectors of `0..$n`, the last one perhaps not whole.
macro_rules! for_each_vector {
    ($s:ty, $n:expr, |$chunk:ident| $body:expr) => {{
        let (n, lanes) = ($n, <$s as Simd>::LANES);
        for first in (0..n - n % lanes).step_by(lanes) {
            let $chunk = crate::simd::elementwise::Chunk::<true> { first, n: lanes };
            $body
        }
        if n % lanes > 0 {
            let $chunk =
                crate::simd::elementwise::Chunk::<false> { first: n - n % lanes, n: n % lanes };
            $body
        }
    }};
}
pub(super) use for_each_vector;

/// Up to one vector of consecutive elements.
#[derive(Clone, Copy)]
pub(super) struct Chunk<const WHOLE: bool> {
    pub(super) first: usize,
    pub(super) n: usize,
}

impl<const WHOLE: bool> Chunk<WHOLE> {
    /// # Safety
    /// From `from` on there are `first + n` numbers, and `n` is the number of lanes if `WHOLE`.
    #[inline(always)]
    pub(super) unsafe fn load<S: Simd>(self, s: S, from: *const f32) -> S::F32 {
        // SAFETY: `n` numbers from `from + first` on may be read (the caller's promise): a whole vector if `WHOLE`, no
        // more than `n` otherwise.
        unsafe {
            match WHOLE {
                true => S::F32::load_ptr(s, from.add(self.first)),
                false => S::F32::load_partial_ptr(s, from.add(self.first), self.n),
            }
        }
    }

    /// # Safety
    /// As for [`Chunk::load`], for writing.
    #[inline(always)]
    pub(super) unsafe fn store<S: Simd>(self, lanes: S::F32, to: *mut f32) {
        // SAFETY: `n` places from `to + first` on may be written (the caller's promise): a whole vector if `WHOLE`, no
        // more than `n` otherwise.
        unsafe {
            match WHOLE {
                true => lanes.store_ptr(to.add(self.first)),
                false => lanes.store_partial_ptr(to.add(self.first), self.n),
            }
        }
    }
}

/// What [`combine`] makes of `y` and `x`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Combination {
    /// `y + x`.
    Add,
    /// `y` where `x > 0`, else 0: a gradient passes a ReLU whose output is `x`.
    PassRelu,
}

/// `y = combination(y, x)`, element by element.
///
/// # Panics
/// If the lengths differ.
pub fn combine<T: Real>(isa: Isa, combination: Combination, y: &mut [T], x: &[T]) {
    assert_eq!(y.len(), x.len(), "as many elements");
    T::combine(isa, Combine { combination, y, x });
}

/// `max(x, 0)` in place; −0 and NaN stay.
pub fn relu<T: Real>(isa: Isa, x: &mut [T]) {
    T::relu(isa, ReluInPlace(x));
}

/// `factor · x` in place.
pub fn scale<T: Real>(isa: Isa, factor: T, x: &mut [T]) {
    T::scale(isa, Scale(factor, x));
}

/// One step of SGD on some elements.
///
/// # Panics
/// If the lengths differ.
pub fn sgd_step<T: Real>(isa: Isa, step: SgdStep<T>) {
    let n = step.grads.len();
    assert!(step.params.len() == n && step.velocity.len() == n, "as many elements");
    T::sgd_step(isa, step);
}

/// Rows that are sums of weighted rows.
///
/// # Panics
/// If a term lies outside its slice.
pub fn sparse_rows<T: Real>(isa: Isa, rows: SparseRows<T>) {
    rows.check();
    T::sparse_rows(isa, rows);
}

/// Inputs of [`combine`], checked.
pub struct Combine<'a, T> {
    pub(super) combination: Combination,
    pub(super) y: &'a mut [T],
    pub(super) x: &'a [T],
}

impl Kernel for Combine<'_, f32> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Combine { combination, y, x } = self;
        let (n, y, x) = (y.len(), y.as_mut_ptr(), x.as_ptr());
        let zero = S::F32::splat(s, 0.0);
        match combination {
            // SAFETY: `y` and `x` have `n` numbers each (`combine` asserts it), `y` is borrowed here alone; chunks end
            // at `n`.
            Combination::Add => for_each_vector!(S, n, |chunk| unsafe {
                chunk.store::<S>(chunk.load(s, y) + chunk.load(s, x), y);
            }),
            // SAFETY: `y` and `x` have `n` numbers each (`combine` asserts it), `y` is borrowed here alone; chunks end
            // at `n`.
            Combination::PassRelu => for_each_vector!(S, n, |chunk| unsafe {
                let passes = chunk.load(s, x).gt(zero);
                chunk.store::<S>(chunk.load(s, y).select(passes, zero), y);
            }),
        }
    }
}

/// Input of [`relu`].
pub struct ReluInPlace<'a, T>(pub(super) &'a mut [T]);

impl Kernel for ReluInPlace<'_, f32> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let (n, x, zero) = (self.0.len(), self.0.as_mut_ptr(), S::F32::splat(s, 0.0));
        // SAFETY: the slice has `n` numbers, borrowed here alone; chunks end at `n`.
        for_each_vector!(S, n, |chunk| unsafe {
            chunk.store::<S>(zero.max(chunk.load(s, x)), x);
        });
    }
}

/// Inputs of [`scale`].
pub struct Scale<'a, T>(pub(super) T, pub(super) &'a mut [T]);

impl Kernel for Scale<'_, f32> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Scale(factor, x) = self;
        let (n, x, factor) = (x.len(), x.as_mut_ptr(), S::F32::splat(s, factor));
        // SAFETY: the slice has `n` numbers, borrowed here alone; chunks end at `n`.
        for_each_vector!(S, n, |chunk| unsafe {
            chunk.store::<S>(factor * chunk.load(s, x), x);
        });
    }
}

/// One step of SGD with momentum on some elements of equal number, see [`crate::learn::optim::Sgd::step`].
#[derive(Debug)]
pub struct SgdStep<'a, T> {
    /// Learning rate.
    pub lr: T,
    /// Share of the velocity that is kept.
    pub momentum: T,
    /// Weight decay.
    pub decay: T,
    /// Gradients; zeros afterward.
    pub grads: &'a mut [T],
    /// Velocities.
    pub velocity: &'a mut [T],
    /// Parameters.
    pub params: &'a mut [T],
}

impl Kernel for SgdStep<'_, f32> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let SgdStep { lr, momentum, decay, grads, velocity, params } = self;
        let (lr, momentum, decay) =
            (S::F32::splat(s, lr), S::F32::splat(s, momentum), S::F32::splat(s, decay));
        let zero = S::F32::splat(s, 0.0);
        let n = grads.len();
        let (g, v, p) = (grads.as_mut_ptr(), velocity.as_mut_ptr(), params.as_mut_ptr());
        // SAFETY: the three slices have `n` numbers each (`sgd_step` asserts it), each borrowed here alone; chunks end
        // at `n`.
        for_each_vector!(S, n, |chunk| unsafe {
            let old = chunk.load(s, p);
            let new = momentum * chunk.load(s, v) + (chunk.load(s, g) + decay * old);
            chunk.store::<S>(new, v);
            chunk.store::<S>(old - lr * new, p);
            chunk.store::<S>(zero, g);
        });
    }
}

/// Vectors of a row of [`SparseRows`] that are summed together: enough to hide the latency of the multiply-add.
const STRETCH: usize = 4;

/// Rows that are sums of weighted rows: `y[r] = Σ_t weights[t] · x[sources[t]]`, `t` ascending over
/// `starts[r]..starts[r + 1]`, fused onto 0.
#[derive(Debug)]
pub struct SparseRows<'a, T> {
    /// One more than there are rows in `y`.
    pub starts: &'a [usize],
    /// Rows of `x`.
    pub sources: &'a [u32],
    /// As many as sources.
    pub weights: &'a [T],
    /// `[_, c]`.
    pub x: &'a [T],
    /// Columns, at least 1.
    pub c: usize,
    /// `[_, c]`, overwritten.
    pub y: &'a mut [T],
}

impl<T> SparseRows<'_, T> {
    /// Panics unless all terms lie inside their slices.
    pub(super) fn check(&self) {
        let SparseRows { starts, sources, weights, x, c, y } = self;
        assert!(*c > 0 && y.len() == (starts.len() - 1) * c, "one row for each range of terms");
        assert!(starts.is_sorted() && starts[starts.len() - 1] <= sources.len(), "ranges of terms");
        assert_eq!(sources.len(), weights.len(), "one weight for each source");
        let used = &sources[starts[0]..starts[starts.len() - 1]];
        let inside = used
            .iter()
            .all(|&row| (row as usize + 1).checked_mul(*c).is_some_and(|end| end <= x.len()));
        assert!(inside, "sources inside the input");
    }
}

impl Kernel for SparseRows<'_, f32> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let SparseRows { starts, sources, weights, x, c, y } = self;
        let x = x.as_ptr();
        let in_stretches = c - c % (STRETCH * S::LANES);
        for (y, range) in y.chunks_exact_mut(c).zip(starts.windows(2)) {
            let (sources, weights) = (&sources[range[0]..range[1]], &weights[range[0]..range[1]]);
            let y = y.as_mut_ptr();
            for first in (0..in_stretches).step_by(STRETCH * S::LANES) {
                let mut sums = [S::F32::splat(s, 0.0); STRETCH];
                for (&row, &weight) in sources.iter().zip(weights) {
                    let weight = S::F32::splat(s, weight);
                    for (v, sum) in sums.iter_mut().enumerate() {
                        let place = row as usize * c + first + v * S::LANES;
                        // SAFETY: row `row` of `c` numbers ends within `x` (`check`), and the stretch within the row.
                        *sum = weight.mul_add(unsafe { S::F32::load_ptr(s, x.add(place)) }, *sum);
                    }
                }
                for (v, sum) in sums.into_iter().enumerate() {
                    // SAFETY: `chunks_exact_mut` cut `y` to `c` numbers, borrowed here alone; the stretch ends within
                    // them.
                    unsafe { sum.store_ptr(y.add(first + v * S::LANES)) };
                }
            }
            // SAFETY: rows of `c` numbers end within `x` (`check`); `y` is one of `c` numbers, borrowed here alone;
            // chunks end at `c - in_stretches`.
            for_each_vector!(S, c - in_stretches, |chunk| unsafe {
                let mut sum = S::F32::splat(s, 0.0);
                for (&row, &weight) in sources.iter().zip(weights) {
                    let x = chunk.load(s, x.add(row as usize * c + in_stretches));
                    sum = S::F32::splat(s, weight).mul_add(x, sum);
                }
                chunk.store::<S>(sum, y.add(in_stretches));
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every tail beside up to four whole vectors, and a stretch.
    const SIZES: std::ops::RangeInclusive<usize> = 0..=70;

    fn numbers(n: usize, seed: usize) -> Vec<f32> {
        let special = [0.0, -0.0, f32::NAN, f32::INFINITY, 1e-42];
        let number = |i: usize| (((i + seed) * 7919 + 13) % 97) as f32 * 0.37 - 17.0;
        (0..n).map(|i| if i % 19 == 7 { special[i % 5] } else { number(i) }).collect()
    }

    /// Miri changes the payload of a NaN at random, as the language allows.
    fn bits(x: &[f32]) -> Vec<u32> {
        let shown = |x: f32| if cfg!(miri) && x.is_nan() { f32::NAN } else { x };
        x.iter().map(|&x| shown(x).to_bits()).collect()
    }

    fn plain_relu(x: f32) -> f32 {
        if 0.0 > x { 0.0 } else { x }
    }

    #[test]
    fn elements_are_those_of_plain_loops_at_every_isa() {
        for &isa in Isa::available() {
            for n in SIZES {
                let (y, x) = (numbers(n, 1), numbers(n, 40));
                let run = |combination| {
                    let mut y = y.clone();
                    combine(isa, combination, &mut y, &x);
                    bits(&y)
                };
                let pairs = || y.iter().zip(&x);
                let sums: Vec<f32> = pairs().map(|(y, x)| y + x).collect();
                let passed: Vec<f32> =
                    pairs().map(|(y, x)| if *x > 0.0 { *y } else { 0.0 }).collect();
                assert_eq!(run(Combination::Add), bits(&sums), "{} of {n}", isa.name());
                assert_eq!(run(Combination::PassRelu), bits(&passed), "{} of {n}", isa.name());
                let mut rectified = x.clone();
                relu(isa, &mut rectified);
                assert_eq!(
                    bits(&rectified),
                    bits(&x.iter().map(|&x| plain_relu(x)).collect::<Vec<_>>())
                );
                let mut scaled = x.clone();
                scale(isa, 0.3, &mut scaled);
                assert_eq!(bits(&scaled), bits(&x.iter().map(|x| 0.3 * x).collect::<Vec<_>>()));
            }
        }
    }

    #[test]
    fn an_sgd_step_is_that_of_the_plain_loop_at_every_isa() {
        let (lr, momentum, decay) = (0.1, 0.9, 5e-4);
        for &isa in Isa::available() {
            for n in SIZES {
                let (mut g, mut v, mut p) = (numbers(n, 1), numbers(n, 2), numbers(n, 3));
                let new: Vec<f32> =
                    (0..n).map(|i| momentum * v[i] + (g[i] + decay * p[i])).collect();
                let moved: Vec<f32> = p.iter().zip(&new).map(|(p, v)| p - lr * v).collect();
                let (grads, velocity, params) = (&mut g[..], &mut v[..], &mut p[..]);
                sgd_step(isa, SgdStep { lr, momentum, decay, grads, velocity, params });
                assert_eq!((bits(&v), bits(&p)), (bits(&new), bits(&moved)), "{}", isa.name());
                assert!(g.iter().all(|g| g.to_bits() == 0));
            }
        }
    }

    #[test]
    fn sparse_rows_are_those_of_the_plain_loop_at_every_isa() {
        let (starts, sources) = ([0, 3, 3, 5, 6], [4u32, 0, 2, 1, 1, 3]);
        let weights = [0.3f32, -0.7, 0.1, 2.0, 0.9, 1.0];
        for &isa in Isa::available() {
            for c in SIZES.filter(|&c| c > 0) {
                let (x, mut y) = (numbers(5 * c, 6), vec![f32::NAN; 4 * c]);
                let element = |i: usize| {
                    let terms = starts[i / c]..starts[i / c + 1];
                    let x = |t: usize| x[sources[t] as usize * c + i % c];
                    terms.fold(0.0f32, |sum, t| weights[t].mul_add(x(t), sum))
                };
                let expected: Vec<f32> = (0..4 * c).map(element).collect();
                let y_rows = &mut y[..];
                let rows = SparseRows {
                    starts: &starts,
                    sources: &sources,
                    weights: &weights,
                    x: &x,
                    c,
                    y: y_rows,
                };
                sparse_rows(isa, rows);
                let nan_as_one = |x: &[f32]| {
                    x.iter().map(|x| if x.is_nan() { 1 } else { x.to_bits() }).collect::<Vec<_>>()
                };
                assert_eq!(nan_as_one(&y), nan_as_one(&expected), "{} of {c}", isa.name());
            }
        }
    }

    #[test]
    #[should_panic(expected = "sources inside the input")]
    fn a_source_outside_the_input_panics() {
        let (x, mut y) = ([0.0f32; 4], [0.0; 2]);
        let (starts, sources, weights) = (&[0, 1], &[2u32], &[1.0f32]);
        sparse_rows(Isa::active(), SparseRows { starts, sources, weights, x: &x, c: 2, y: &mut y });
    }
}
