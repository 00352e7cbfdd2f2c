//! 3×3×3 convolution with 64 products where the plain sum takes 216: for the eight children of one node
//! at a time.
//!
//! Winograd's minimal filtering F(2×2×2, 3×3×3) (Lavin and Gray, "Fast algorithms for convolutional neural
//! networks", 2016), applied along each of the three axes:
//!
//! ```text
//! y = Aᵀ((G w) ⊙ (Bᵀ x))     dx: the same, with the weights of the adjoint     dw = Gᵀ(Σ (A dy) ⊙ (Bᵀ x))
//!
//!      | 1  0 −1  0 |         | 1  0  0 |
//! Bᵀ = | 0  1  1  0 |     G = | ½  ½  ½ |     Aᵀ = | 1  1  1  0 |
//!      | 0 −1  1  0 |         | ½ −½  ½ |          | 0  1 −1 −1 |
//!      | 0  1  0 −1 |         | 0  0  1 |
//! ```
//!
//! `x` is the cube of 4×4×4 nodes around the children, zeros where a node is missing; ⊙ multiplies the 64
//! *frequencies* one by one, each of which is a matrix product over channels. Frequencies and nodes of a
//! cube are counted `16·i + 4·j + l`, children `4·x + 2·y + z`, kernel offsets `9·x + 3·y + z`.

use super::super::{Kernel, Level, Simd};
use super::tile::{Panel, Real, RowPointers, tile_rows, with_height};
use super::weights::{Packed, Weights, panel_width};
use super::{DEPTH, Tiled, passes, tiles, with_tile};
use std::ops::{Add, Sub};

/// Frequencies of a cube.
pub const N_FREQUENCIES: usize = 64;

/// Columns are taken this many at a time, and must be a multiple of it.
pub const CHANNELS: usize = 8;

/// Most columns of inputs.
pub const MAX_DEPTH: usize = 256;

/// Most groups of a block: with 96 columns their frequencies fill a second-level cache or two.
pub const MAX_GROUPS: usize = 32;

/// A cache line between the planes of two frequencies, so that not all fall into one set of a cache.
const GAP: usize = 16;

/// For each node of a cube: which neighbour of the parent holds it, and as which child.
static PLACES: [(usize, usize); 64] = {
    let mut places = [(0, 0); 64];
    let mut i = 0;
    while i < 64 {
        let (x, y, z) = (i / 16 + 1, i / 4 % 4 + 1, i % 4 + 1);
        places[i] = (9 * (x / 2) + 3 * (y / 2) + z / 2, 4 * (x % 2) + 2 * (y % 2) + z % 2);
        i += 1;
    }
    places
};

static ROWS: [u32; MAX_GROUPS] = {
    let mut rows = [0; MAX_GROUPS];
    let mut i = 0;
    while i < MAX_GROUPS {
        rows[i] = i as u32;
        i += 1;
    }
    rows
};

/// One summand of a block.
pub enum Term<'a, T> {
    /// Products of `x: [_, depth]` with weights from [`transform_weights`].
    Nodes {
        /// Inputs.
        x: &'a [T],
        /// `[64, depth, n]`.
        weights: &'a Packed<T>,
    },
    /// Inputs that are the same in all nodes of a shape, multiplied already.
    Shapes {
        /// `[n_shapes, 64, n]`, from [`transform_products`].
        products: &'a [T],
        /// Shape of each group.
        shapes: &'a [usize],
    },
}

/// Memory that one block leaves to the next.
#[derive(Debug, Default)]
pub struct Room<T> {
    inputs: Vec<Vec<T>>,
    sums: Vec<T>,
}

/// `G w`, in panels: `weights` has 27 offsets. `for_each_block` as in [`Packed::new`].
///
/// # Panics
/// If there are not 27 offsets.
pub fn transform_weights<T: Real + Send + Sync>(
    level: Level,
    weights: &Weights<T>,
    for_each_block: impl FnOnce(&mut [T], usize, &(dyn Fn(usize, &mut [T]) + Sync)),
) -> Packed<T> {
    assert_eq!(weights.n_offsets(), 27, "a kernel of 3×3×3");
    let depth = weights.depth();
    let mut packed = Packed::zeros(level, N_FREQUENCIES, depth, weights.width());
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
    level.run(TransformProducts { x: products, stride, width, to });
}

/// Overwrites `to: [27, n]` with `Gᵀ` applied to `u`: 64 rows of `n`, `stride` apart.
///
/// # Panics
/// If something does not fit.
pub fn transform_weight_gradients<T: Real>(level: Level, u: &[T], stride: usize, to: &mut [T]) {
    let width = to.len() / 27;
    check_rows_of(u, N_FREQUENCIES, stride, width, to, 27);
    level.run(TransformWeightGradients { x: u, stride, width, to });
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

/// Overwrites `y: [8·groups.len(), n]`, the children of some parents, with the sum of the terms. `groups`
/// holds, for each parent, the first row in `x` of the children of its 27 neighbours, −1 for none.
///
/// Each element of `y` depends on nothing but the nodes around it, and its frequencies take their
/// products one by one in the order of terms and columns, fused onto 0.
///
/// # Panics
/// If there are more than [`MAX_GROUPS`] groups or something does not fit.
pub fn sum_of_terms<T: Real>(
    level: Level,
    groups: &[[i32; 27]],
    terms: &[Term<T>],
    n: usize,
    room: &mut Room<T>,
    y: &mut [T],
) {
    assert!(y.len() == 8 * groups.len() * n && groups.len() <= MAX_GROUPS, "groups of a block");
    for term in terms {
        match term {
            Term::Nodes { x, weights } => {
                let of_level = (panel_width::<T>(level), n, N_FREQUENCIES);
                assert_eq!((weights.panel_width, weights.width, weights.n_offsets), of_level);
                check_groups(groups, x.len(), weights.depth);
            }
            Term::Shapes { products, shapes } => {
                assert_eq!(shapes.len(), groups.len(), "one shape for each group");
                let inside = |shape: &usize| (shape + 1) * N_FREQUENCIES * n <= products.len();
                assert!(shapes.iter().all(inside), "a product for each shape");
            }
        }
    }
    level.run(Block { groups, terms, n, room, y });
}

fn check_groups(groups: &[[i32; 27]], len: usize, depth: usize) {
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

struct TransformProducts<'a, T> {
    x: &'a [T],
    stride: usize,
    width: usize,
    to: &'a mut [T],
}

struct TransformWeightGradients<'a, T> {
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

struct Block<'a, T> {
    groups: &'a [[i32; 27]],
    terms: &'a [Term<'a, T>],
    n: usize,
    room: &'a mut Room<T>,
    y: &'a mut [T],
}

impl<T: Real> Kernel for TransformWeights<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        with_tile::<T, S, Self>(simd, self);
    }
}

impl<T: Real> Tiled<T> for TransformWeights<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd, const M: usize, const N: usize>(self, _: S) {
        const AT_A_TIME: usize = 8;
        let depth = self.weights.depth();
        let to = self.to.as_chunks_mut::<N>().0;
        let mut w = [[[T::default(); N]; AT_A_TIME]; 27];
        let mut cubes = Cubes::<T, N>::new();
        for p in passes(depth, AT_A_TIME) {
            for (k, w) in w.iter_mut().enumerate() {
                let mut rows = w.iter_mut();
                self.weights.fill::<N>(k, p.clone(), self.panel * N, |row| {
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

impl<T: Real> Kernel for TransformProducts<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let TransformProducts { x, stride, width, to } = self;
        let mut cubes = Cubes::<T, CHANNELS>::new();
        for c in (0..width).step_by(CHANNELS) {
            let all = cubes.each_axis(|k| Lanes::of(x, k * stride + c), kernel);
            all.iter().enumerate().for_each(|(f, x)| x.put(to, f * width + c));
        }
    }
}

impl<T: Real> Kernel for TransformWeightGradients<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let TransformWeightGradients { x, stride, width, to } = self;
        let mut cubes = Cubes::<T, CHANNELS>::new();
        for c in (0..width).step_by(CHANNELS) {
            let all = cubes.each_axis(|f| Lanes::of(x, f * stride + c), kernel_gradient);
            all[..27].iter().enumerate().for_each(|(k, x)| x.put(to, k * width + c));
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
fn frequencies<T: Real>(
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

impl<T: Real> Kernel for Block<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        with_tile::<T, S, Self>(simd, self);
    }
}

impl<T: Real> Tiled<T> for Block<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd, const M: usize, const N: usize>(self, simd: S) {
        let Block { groups, terms, n, room: Room { inputs, sums }, y } = self;
        let plane = |depth: usize| groups.len() * depth + GAP;
        inputs.resize_with(terms.len(), Vec::new);
        for (term, to) in terms.iter().zip(&mut *inputs) {
            match term {
                Term::Nodes { x, weights } => {
                    let depth = weights.depth;
                    to.resize(N_FREQUENCIES * plane(depth), T::default());
                    let mut cubes = Cubes::new();
                    for (i, group) in groups.iter().enumerate() {
                        frequencies(
                            &mut cubes,
                            group,
                            (x, depth),
                            plane(depth),
                            &mut to[i * depth..],
                        );
                    }
                }
                Term::Shapes { .. } => {
                    to.resize(N_FREQUENCIES * plane(1), T::default());
                    frequencies_of_ones(groups, plane(1), to);
                }
            }
        }
        sums.resize(N_FREQUENCIES * plane(N), T::default());
        let mut cubes = Cubes::<T, N>::new();
        for first in (0..n).step_by(N) {
            let width = N.min(n - first);
            for f in 0..N_FREQUENCIES {
                let sums = &mut sums[f * plane(N)..][..groups.len() * N];
                for (i, (term, x)) in terms.iter().zip(&*inputs).enumerate() {
                    match term {
                        Term::Nodes { weights, .. } => {
                            let depth = weights.depth;
                            let x = &x[f * plane(depth)..][..groups.len() * depth];
                            let w = (first / N * N_FREQUENCIES + f) * depth * N;
                            let w = &weights.numbers()[w..];
                            add_product::<T, S, M, N>(simd, (x, depth), w, i > 0, sums);
                        }
                        Term::Shapes { products, shapes } => {
                            if i == 0 {
                                sums.fill(T::default());
                            }
                            let x = &x[f * plane(1)..][..groups.len()];
                            for ((sum, &x), shape) in
                                sums.as_chunks_mut::<N>().0.iter_mut().zip(x).zip(*shapes)
                            {
                                let row =
                                    &products[(shape * N_FREQUENCIES + f) * n + first..][..width];
                                for (sum, &y) in sum.iter_mut().zip(row) {
                                    *sum = T::fused(simd, x, y, *sum);
                                }
                            }
                        }
                    }
                }
            }
            for (i, y) in y.chunks_exact_mut(8 * n).enumerate() {
                let sum = |f: usize| Lanes::of(sums, f * plane(N) + i * N);
                let children = cubes.each_axis::<4, 2>(sum, output);
                for (y, child) in y.chunks_exact_mut(n).zip(children) {
                    y[first..first + width].copy_from_slice(&child.0[..width]);
                }
            }
        }
    }
}

/// `Bᵀ 1` of some groups: what the frequencies of constant inputs are multiplied by.
#[inline(always)]
fn frequencies_of_ones<T: Real>(groups: &[[i32; 27]], plane: usize, to: &mut [T]) {
    let mut cubes = Cubes::<f32, 1>::new();
    for (i, group) in groups.iter().enumerate() {
        let node = |node: usize| Lanes([if group[PLACES[node].0] < 0 { 0.0 } else { 1.0 }]);
        let all = cubes.each_axis::<4, 4>(node, input);
        all.iter().enumerate().for_each(|(f, x)| to[f * plane + i] = T::from_f32(x.0[0]));
    }
}

/// `sums[r, N] += x[r, depth] · w[depth, N]`, or without what was there if there is not `more`.
#[inline(always)]
fn add_product<T: Real, S: Simd, const M: usize, const N: usize>(
    simd: S,
    (x, depth): (&[T], usize),
    w: &[T],
    more: bool,
    sums: &mut [T],
) {
    let n_rows = x.len() / depth;
    assert!(n_rows <= MAX_GROUPS && n_rows * N == sums.len());
    for p in passes(depth, DEPTH) {
        let panel = Panel::<T, N>::in_place(&w[p.start * N..], N, p.len());
        let more = more || p.start > 0;
        for r in tiles(n_rows, M) {
            let rows = &ROWS[r];
            let a = RowPointers { start: x[p.start..].as_ptr(), rows, width: depth };
            let c = RowPointers { start: sums.as_mut_ptr(), rows, width: N };
            // SAFETY: there are as many rows of x and of the sums, and p lies inside those of x.
            unsafe {
                with_height!(rows.len(), M, tile_rows::<T, S, N>(simd, a, &panel, c, N, more))
            };
        }
    }
}

/// Numbers of one place, of several columns.
#[derive(Clone, Copy)]
struct Lanes<T, const N: usize>([T; N]);

impl<T: Real, const N: usize> Lanes<T, N> {
    #[inline(always)]
    fn zeros() -> Self {
        Lanes([T::default(); N])
    }

    /// From place `at` of `x` on.
    #[inline(always)]
    fn of(x: &[T], at: usize) -> Self {
        Lanes(x[at..at + N].as_chunks().0[0])
    }

    #[inline(always)]
    fn put(self, x: &mut [T], at: usize) {
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
fn input<T: Real, const N: usize>([a, b, c, d]: [Lanes<T, N>; 4]) -> [Lanes<T, N>; 4] {
    [a - c, b + c, c - b, b - d]
}

/// G
#[inline(always)]
fn kernel<T: Real, const N: usize>([a, b, c]: [Lanes<T, N>; 3]) -> [Lanes<T, N>; 4] {
    let (ends, middle) = ((a + c).half(), b.half());
    [a, ends + middle, ends - middle, c]
}

/// Aᵀ
#[inline(always)]
fn output<T: Real, const N: usize>([a, b, c, d]: [Lanes<T, N>; 4]) -> [Lanes<T, N>; 2] {
    [a + b + c, b - c - d]
}

/// A
#[inline(always)]
fn gradient<T: Real, const N: usize>([a, b]: [Lanes<T, N>; 2]) -> [Lanes<T, N>; 4] {
    [a, a + b, a - b, Lanes::zeros() - b]
}

/// Gᵀ
#[inline(always)]
fn kernel_gradient<T: Real, const N: usize>([a, b, c, d]: [Lanes<T, N>; 4]) -> [Lanes<T, N>; 3] {
    let (sum, difference) = ((b + c).half(), (b - c).half());
    [a + sum, difference, sum + d]
}

/// Room for a cube and for what becomes of it along the way.
struct Cubes<T, const N: usize>([[Lanes<T, N>; 64]; 2]);

impl<T: Real, const N: usize> Cubes<T, N> {
    #[inline(always)]
    fn new() -> Self {
        Cubes([[Lanes::zeros(); 64]; 2])
    }

    /// Applies `line` along each axis of a cube of side `I` to make one of side `O`.
    #[inline(always)]
    fn each_axis<const I: usize, const O: usize>(
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

#[cfg(test)]
mod tests {
    use super::*;

    const N_GROUPS: usize = 13;

    fn numbers<T: Real>(len: usize, seed: usize) -> Vec<T> {
        let number = |i: usize| (((i + seed) * 7919 + 13) % 97) as f32 * 0.37 - 17.0;
        (0..len).map(|i| T::from_f32(number(i))).collect()
    }

    /// Groups on a line: some neighbours are missing, all differ.
    fn groups() -> Vec<[i32; 27]> {
        let neighbour = |g: usize, k: usize| match (g + k) % 3 {
            0 if k != 13 => -1,
            _ => 8 * ((g + (k + 14) * 5) % N_GROUPS) as i32,
        };
        let group =
            |g| std::array::from_fn(|k| if k == 13 { 8 * g as i32 } else { neighbour(g, k) });
        (0..N_GROUPS).map(group).collect()
    }

    /// Row of the neighbour at offset `k` of a child.
    fn neighbour(group: &[i32; 27], child: usize, k: usize) -> Option<usize> {
        let (child, k) = ([child >> 2, child >> 1 & 1, child & 1], [k / 9, k / 3 % 3, k % 3]);
        let node: usize = (0..3).fold(0, |node, axis| 4 * node + child[axis] + k[axis]);
        let (parent, child) = PLACES[node];
        usize::try_from(group[parent]).ok().map(|first| first + child)
    }

    fn packed<T: Real + Send + Sync>(level: Level, w: &[T], depth: usize, n: usize) -> Packed<T> {
        transform_weights(level, &Weights::new(w, depth, n), |numbers, len, work| {
            numbers.chunks_mut(len).enumerate().for_each(|(i, block)| work(i, block));
        })
    }

    /// The sum of a product with `depth` columns and of one column that is 1 in the first shape, 2 in the other.
    fn sums<T: Real + Send + Sync>(level: Level, depth: usize, n: usize) -> Vec<T> {
        let x: Vec<T> = numbers(8 * N_GROUPS * depth, 1);
        let weights = packed(level, &numbers::<T>(27 * depth * n, 2), depth, n);
        let products: Vec<T> = numbers(27 * n, 3);
        let twice: Vec<T> = products.iter().map(|&x| x + x).collect();
        let mut transformed = vec![T::default(); 2 * N_FREQUENCIES * n];
        let (one, two) = transformed.split_at_mut(N_FREQUENCIES * n);
        transform_products(level, &products, n, one);
        transform_products(level, &twice, n, two);
        let shapes: Vec<usize> = (0..N_GROUPS).map(|g| g / 7).collect();
        let terms = [
            Term::Shapes { products: &transformed, shapes: &shapes },
            Term::Nodes { x: &x, weights: &weights },
        ];
        let mut y = vec![T::from_f32(f32::NAN); 8 * N_GROUPS * n];
        sum_of_terms(level, &groups(), &terms, n, &mut Room::default(), &mut y);
        y
    }

    #[test]
    fn sum_equals_the_plain_one_up_to_rounding() {
        for (depth, n) in [(8, 8), (24, 40)] {
            let y: Vec<f64> = sums(Level::active(), depth, n);
            let x: Vec<f64> = numbers(8 * N_GROUPS * depth, 1);
            let w: Vec<f64> = numbers(27 * depth * n, 2);
            let product: Vec<f64> = numbers(27 * n, 3);
            for (g, group) in groups().iter().enumerate() {
                for child in 0..8 {
                    for j in 0..n {
                        let there = |k| neighbour(group, child, k).map(|row| (k, row));
                        let at = |(k, row): (usize, usize)| {
                            let of_nodes = |p| x[row * depth + p] * w[(k * depth + p) * n + j];
                            let shape = if g / 7 == 0 { 1.0 } else { 2.0 };
                            (0..depth).map(of_nodes).sum::<f64>() + shape * product[k * n + j]
                        };
                        let plain: f64 = (0..27).filter_map(there).map(at).sum();
                        assert!((y[(8 * g + child) * n + j] - plain).abs() < 1e-8);
                    }
                }
            }
        }
    }

    #[test]
    fn every_level_gives_the_same_bits() {
        for (depth, n) in [(8, 8), (16, 72), (96, 96), (256, 24)] {
            let bits = |level| sums::<f32>(level, depth, n).into_iter().map(f32::to_bits);
            let expected: Vec<u32> = bits(Level::active()).collect();
            for &level in Level::available() {
                assert!(bits(level).eq(expected.iter().copied()), "{}", level.name());
            }
        }
    }

    /// `Σ dy·y` has the gradient by the weights that the transforms say.
    #[test]
    fn weight_gradient_equals_the_plain_sum_up_to_rounding() {
        let (depth, n, level) = (16, 8, Level::active());
        let x: Vec<f64> = numbers(8 * N_GROUPS * depth, 1);
        let dy: Vec<f64> = numbers(8 * N_GROUPS * n, 2);
        let (mut v, mut d) = (vec![0.0; 64 * 15 * depth], vec![0.0; 64 * 15 * n]);
        transform_inputs(level, &groups(), (&x, depth), 15, &mut v);
        transform_gradients(level, (&dy, n), 15, &mut d);
        let mut u = vec![0.0; 64 * depth * n];
        for (i, u) in u.iter_mut().enumerate() {
            let (f, p, j) = (i / (depth * n), i / n % depth, i % n);
            let row = |g| v[(f * 15 + g) * depth + p] * d[(f * 15 + g) * n + j];
            *u = (0..N_GROUPS).map(row).sum();
        }
        for p in 0..depth {
            let mut dw = vec![f64::NAN; 27 * n];
            transform_weight_gradients(level, &u[p * n..], depth * n, &mut dw);
            for k in 0..27 {
                for j in 0..n {
                    let plain: f64 = (0..8 * N_GROUPS)
                        .filter_map(|o| {
                            let row = neighbour(&groups()[o / 8], o % 8, k)?;
                            Some(x[row * depth + p] * dy[o * n + j])
                        })
                        .sum();
                    assert!((dw[k * n + j] - plain).abs() < 1e-8);
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "neighbours")]
    fn a_neighbour_outside_the_input_panics() {
        let (x, mut to) = ([0.0f32; 64], [0.0; 64 * 8]);
        let mut group = [-1; 27];
        group[26] = 8;
        transform_inputs(Level::active(), &[group], (&x, 8), 1, &mut to);
    }
}
