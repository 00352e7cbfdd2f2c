//! Into frequencies, and back to the gradients of the weights.

use super::super::super::{Kernel, Level, Simd};
use super::super::tile::Real;
use super::super::weights::{Packed, Weights};
use super::super::{Tiled, passes};
use super::cube::{Cubes, Lanes, gradient, input, kernel, kernel_gradient};

/// Frequencies of a cube.
pub const N_FREQUENCIES: usize = 64;

/// Columns are taken this many at a time, and must be a multiple of it.
pub const CHANNELS: usize = 8;

/// Most columns of inputs.
pub const MAX_DEPTH: usize = 256;

/// For each node of a cube: which neighbour of the parent holds it, and as which child.
pub(super) static PLACES: [(usize, usize); 64] = {
    let mut places = [(0, 0); 64];
    let mut i = 0;
    while i < 64 {
        let (x, y, z) = (i / 16 + 1, i / 4 % 4 + 1, i % 4 + 1);
        places[i] = (9 * (x / 2) + 3 * (y / 2) + z / 2, 4 * (x % 2) + 2 * (y % 2) + z % 2);
        i += 1;
    }
    places
};

/// `G w`, in panels: `weights` has 27 offsets. `memory` and `for_each_block` as in [`Packed::new`].
///
/// # Panics
/// If there are not 27 offsets.
pub fn transform_weights<T: Real + Send + Sync>(
    level: Level,
    weights: &Weights<T>,
    memory: Vec<T>,
    for_each_block: impl FnOnce(&mut [T], usize, &(dyn Fn(usize, &mut [T]) + Sync)),
) -> Packed<T> {
    assert_eq!(weights.n_offsets(), 27, "a kernel of 3×3×3");
    let depth = weights.depth();
    let mut packed = Packed::unwritten(level, N_FREQUENCIES, depth, weights.width(), memory);
    let len = N_FREQUENCIES * depth * packed.panel_width;
    for_each_block(packed.numbers_mut(), len, &|panel, to| {
        level.run(TransformWeights { weights, panel, to });
    });
    packed
}

/// Overwrites `to: [64, n]` with `G` applied to `products`: 27 rows of `n`, `stride` apart.
///
/// # Panics
/// If something does not fit.
pub fn transform_products<T: Real>(level: Level, products: &[T], stride: usize, to: &mut [T]) {
    let width = to.len() / N_FREQUENCIES;
    check_rows_of(products, 27, stride, width, to, N_FREQUENCIES);
    level.run(TransformKernel::<T, false> { x: products, stride, width, to });
}

/// Overwrites `to: [27, n]` with `Gᵀ` applied to `u`: 64 rows of `n`, `stride` apart.
///
/// # Panics
/// If something does not fit.
pub fn transform_weight_gradients<T: Real>(level: Level, u: &[T], stride: usize, to: &mut [T]) {
    let width = to.len() / 27;
    check_rows_of(u, N_FREQUENCIES, stride, width, to, 27);
    level.run(TransformKernel::<T, true> { x: u, stride, width, to });
}

fn check_rows_of<T>(x: &[T], n: usize, stride: usize, width: usize, to: &[T], n_to: usize) {
    assert!(width.is_multiple_of(CHANNELS) && to.len() == n_to * width, "whole rows");
    assert!(width <= stride && x.len() >= (n - 1) * stride + width, "rows of the input");
}

/// Overwrites `to` with `Bᵀ x` for some groups: `[64, n_rows, depth]` of which `groups.len()` rows each
/// are written.
///
/// # Panics
/// If something does not fit.
pub fn transform_inputs<T: Real>(
    level: Level,
    groups: &[[i32; 27]],
    (x, depth): (&[T], usize),
    n_rows: usize,
    to: &mut [T],
) {
    check_groups(groups, x.len(), depth);
    assert!(groups.len() <= n_rows && to.len() == N_FREQUENCIES * n_rows * depth, "frequencies");
    level.run(TransformInputs { groups, x, depth, plane: n_rows * depth, to });
}

/// Overwrites `to` with `A dy` for the children `dy: [8·n, width]` of some parents, laid out as by
/// [`transform_inputs`].
///
/// # Panics
/// If something does not fit.
pub fn transform_gradients<T: Real>(
    level: Level,
    (dy, width): (&[T], usize),
    n_rows: usize,
    to: &mut [T],
) {
    assert!(width.is_multiple_of(CHANNELS) && dy.len().is_multiple_of(8 * width), "whole groups");
    assert!(dy.len() <= 8 * n_rows * width && to.len() == N_FREQUENCIES * n_rows * width);
    level.run(TransformGradients { dy, width, plane: n_rows * width, to });
}

pub(super) fn check_groups(groups: &[[i32; 27]], len: usize, depth: usize) {
    assert!(depth.is_multiple_of(CHANNELS) && depth <= MAX_DEPTH, "columns of the input");
    assert!(len.is_multiple_of(8 * depth), "rows of the input");
    let n_rows = len / depth;
    let inside = |&first: &i32| usize::try_from(first).is_ok_and(|first| first + 8 <= n_rows);
    assert!(groups.as_flattened().iter().all(|first| *first < 0 || inside(first)), "neighbours");
}

struct TransformWeights<'a, 'b, T> {
    weights: &'a Weights<'b, T>,
    panel: usize,
    to: &'a mut [T],
}

/// `G x`, or `Gᵀ x` on the way back.
struct TransformKernel<'a, T, const BACK: bool> {
    x: &'a [T],
    stride: usize,
    width: usize,
    to: &'a mut [T],
}

struct TransformInputs<'a, T> {
    groups: &'a [[i32; 27]],
    x: &'a [T],
    depth: usize,
    plane: usize,
    to: &'a mut [T],
}

struct TransformGradients<'a, T> {
    dy: &'a [T],
    width: usize,
    plane: usize,
    to: &'a mut [T],
}

impl<T: Real> Tiled for TransformWeights<'_, '_, T> {
    type Number = T;
    type Output = ();

    #[inline(always)]
    fn run_tiled<S: Simd, const M: usize, const N: usize>(self, simd: S) {
        const AT_A_TIME: usize = 8;
        let depth = self.weights.depth();
        let to = self.to.as_chunks_mut::<N>().0;
        let mut w = [[[T::default(); N]; AT_A_TIME]; 27];
        let mut cubes = Cubes::<T, N>::new();
        for p in passes(depth, AT_A_TIME) {
            for (k, w) in w.iter_mut().enumerate() {
                let mut rows = w.iter_mut();
                self.weights.fill::<S, N>(simd, k, p.clone(), self.panel * N, |row| {
                    if let Some(to) = rows.next() {
                        *to = row;
                    }
                });
            }
            for (i, p) in p.enumerate() {
                let all = cubes.each_axis(|k| Lanes(w[k][i]), kernel);
                (0..N_FREQUENCIES).for_each(|f| to[f * depth + p] = all[f].0);
            }
        }
    }
}

impl<T: Real, const BACK: bool> Kernel for TransformKernel<'_, T, BACK> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let TransformKernel { x, stride, width, to } = self;
        let mut cubes = Cubes::<T, CHANNELS>::new();
        for c in (0..width).step_by(CHANNELS) {
            let row = |i: usize| Lanes::of(x, i * stride + c);
            let all = match BACK {
                false => &cubes.each_axis(row, kernel)[..],
                true => &cubes.each_axis(row, kernel_gradient)[..27],
            };
            all.iter().enumerate().for_each(|(i, x)| x.put(to, i * width + c));
        }
    }
}

impl<T: Real> Kernel for TransformInputs<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let TransformInputs { groups, x, depth, plane, to } = self;
        let mut cubes = Cubes::new();
        for (i, group) in groups.iter().enumerate() {
            frequencies(&mut cubes, group, (x, depth), plane, &mut to[i * depth..]);
        }
    }
}

/// `Bᵀ x` of one group; frequencies are `plane` apart.
#[inline(always)]
pub(super) fn frequencies<T: Real>(
    cubes: &mut Cubes<T, CHANNELS>,
    group: &[i32; 27],
    (x, depth): (&[T], usize),
    plane: usize,
    to: &mut [T],
) {
    let missing = &[T::default(); MAX_DEPTH][..depth];
    let mut rows: [&[T]; 64] = [missing; 64];
    for (row, (parent, child)) in rows.iter_mut().zip(&PLACES) {
        if let Ok(first) = usize::try_from(group[*parent]) {
            *row = &x[(first + child) * depth..][..depth];
        }
    }
    for c in (0..depth).step_by(CHANNELS) {
        let node = |i: usize| Lanes::of(rows[i], c);
        let all = cubes.each_axis::<4, 4>(node, input);
        all.iter().enumerate().for_each(|(f, x)| x.put(to, f * plane + c));
    }
}

impl<T: Real> Kernel for TransformGradients<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let TransformGradients { dy, width, plane, to } = self;
        let mut cubes = Cubes::<T, CHANNELS>::new();
        for (i, dy) in dy.chunks_exact(8 * width).enumerate() {
            for c in (0..width).step_by(CHANNELS) {
                let all = cubes.each_axis(|child| Lanes::of(dy, child * width + c), gradient);
                all.iter().enumerate().for_each(|(f, x)| x.put(to, f * plane + i * width + c));
            }
        }
    }
}

/// `Bᵀ 1` of some groups: what the frequencies of constant inputs are multiplied by.
#[inline(always)]
pub(super) fn frequencies_of_ones<T: Real>(groups: &[[i32; 27]], plane: usize, to: &mut [T]) {
    let mut cubes = Cubes::<f32, 1>::new();
    for (i, group) in groups.iter().enumerate() {
        let node = |node: usize| Lanes([if group[PLACES[node].0] < 0 { 0.0 } else { 1.0 }]);
        let all = cubes.each_axis::<4, 4>(node, input);
        all.iter().enumerate().for_each(|(f, x)| to[f * plane + i] = T::from_f32(x.0[0]));
    }
}
