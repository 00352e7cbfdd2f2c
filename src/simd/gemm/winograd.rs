//! Winograd's 3×3×3 convolution: 64 products where the plain sum takes 216, for the eight children of one node at a
//! time.
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

pub(in crate::simd) mod cube;
pub(in crate::simd) mod transforms;

use super::super::{Isa, Kernel, Simd, Vector};
use super::tile::{Panel, RowPointers, WIDTH, columns, lanes_of, tile_rows, with_height};
use super::weights::Packed;
use super::{DEPTH, Real, identity, passes, tiles};
use cube::{each_axis, output};
use std::ops::Range;
pub use transforms::{
    CHANNELS, GradientTransform, InputTransform, KernelTransform, MAX_DEPTH, N_FREQUENCIES,
    transform_gradients, transform_inputs, transform_products, transform_weight_gradients,
    transform_weights,
};
use transforms::{TransformScratch, check_groups, find_rows, frequencies, frequencies_of_ones};

/// Most groups of a block: with 96 columns their frequencies fill a second-level cache or two.
pub const MAX_GROUPS: usize = 32;

/// A cache line between the planes of two frequencies, so that not all fall into one set of a cache.
const GAP: usize = 16;

/// Numbers from one frequency to the next, of `n` groups and so many columns.
const fn plane(n: usize, columns: usize) -> usize {
    n * columns + GAP
}

static ROWS: [u32; MAX_GROUPS] = identity();

/// One summand of a block.
pub enum FrequencyTerm<'a, T> {
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

/// TransformScratch space that one block leaves to the next.
#[derive(Debug, Default)]
pub struct FrequencyScratch<T> {
    pub(in crate::simd) inputs: Vec<Vec<T>>,
    pub(in crate::simd) sums: Vec<T>,
}

/// Overwrites `y: [8·groups.len(), n]`, the children of some parents, with the sum of the terms. `groups`
/// holds, for each parent, the first row in `x` of the children of its 27 neighbors, −1 for none.
///
/// Each element of `y` depends on nothing but the nodes around it, and its frequencies take their
/// products one by one in the order of terms and columns, fused onto 0.
///
/// # Panics
/// If there are more than [`MAX_GROUPS`] groups or something does not fit.
pub fn sum_of_terms<T: Real>(
    isa: Isa,
    groups: &[[i32; 27]],
    terms: &[FrequencyTerm<T>],
    n: usize,
    scratch: &mut FrequencyScratch<T>,
    y: &mut [T],
) {
    assert!(y.len() == 8 * groups.len() * n && groups.len() <= MAX_GROUPS, "groups of a block");
    for term in terms {
        match term {
            FrequencyTerm::Nodes { x, weights } => {
                let of_isa = (T::panel_width(isa, n), n, N_FREQUENCIES);
                assert_eq!((weights.panel_width, weights.width, weights.n_offsets), of_isa);
                check_groups(groups, x.len(), weights.depth);
            }
            FrequencyTerm::Shapes { products, shapes } => {
                assert_eq!(shapes.len(), groups.len(), "one shape for each group");
                let inside = |shape: &usize| (shape + 1) * N_FREQUENCIES * n <= products.len();
                assert!(shapes.iter().all(inside), "a product for each shape");
            }
        }
    }
    scratch.inputs.resize_with(terms.len(), Vec::new);
    T::frequency_sum(isa, FrequencyBlock { groups, terms, n, scratch, y });
}

/// Inputs of [`sum_of_terms`], checked.
pub struct FrequencyBlock<'a, T> {
    pub(in crate::simd) groups: &'a [[i32; 27]],
    pub(in crate::simd) terms: &'a [FrequencyTerm<'a, T>],
    pub(in crate::simd) n: usize,
    /// Has memory for the inputs of every term.
    pub(in crate::simd) scratch: &'a mut FrequencyScratch<T>,
    pub(in crate::simd) y: &'a mut [T],
}

/// A [`FrequencyBlock`] and memory for transforms.
struct FrequencyKernel<'a>(FrequencyBlock<'a, f32>, &'a mut TransformScratch);

impl FrequencyBlock<'_, f32> {
    pub(in crate::simd) fn run(self, isa: Isa) {
        let FrequencyBlock { groups, terms, n, scratch, y } = self;
        let block = FrequencyBlock { groups, terms, n, scratch, y };
        isa.run(FrequencyKernel(block, &mut TransformScratch::new()));
    }
}

impl Kernel for FrequencyKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let FrequencyKernel(FrequencyBlock { groups, terms, n, scratch, y }, work) = self;
        let FrequencyScratch { inputs, sums } = scratch;
        for (term, to) in terms.iter().zip(&mut *inputs) {
            transform(s, term, groups, work, to);
        }
        let apart = plane(groups.len(), columns::<S>());
        sums.resize(N_FREQUENCIES * apart, 0.0);
        for first in (0..n).step_by(columns::<S>()) {
            let columns = first..n.min(first + columns::<S>());
            for f in 0..N_FREQUENCIES {
                let sums = &mut sums[f * apart..][..groups.len() * self::columns::<S>()];
                for (i, (term, x)) in terms.iter().zip(&*inputs).enumerate() {
                    add_term(s, (term, x), f, (n, &columns), i > 0, sums);
                }
            }
            put_children(s, work, (sums, apart), (n, &columns), y);
        }
    }
}

/// The frequencies of one term's inputs.
#[inline(always)]
fn transform<S: Simd>(
    s: S,
    term: &FrequencyTerm<f32>,
    groups: &[[i32; 27]],
    work: &mut TransformScratch,
    to: &mut Vec<f32>,
) {
    let (halfway, rows, exists) = work.parts(s);
    match term {
        FrequencyTerm::Nodes { x, weights } => {
            let depth = weights.depth;
            let apart = plane(groups.len(), depth);
            to.resize(N_FREQUENCIES * apart, 0.0);
            for (i, group) in groups.iter().enumerate() {
                find_rows(group, (x, depth), rows);
                frequencies(s, halfway, rows, depth, apart, &mut to[i * depth..]);
            }
        }
        FrequencyTerm::Shapes { .. } => {
            let apart = plane(groups.len(), 1);
            to.resize(N_FREQUENCIES * apart, 0.0);
            frequencies_of_ones(s, halfway, exists, groups, apart, to);
        }
    }
}

/// Adds some columns of one term's products at frequency `f`, or without what was there if there is not
/// `more`.
#[inline(always)]
fn add_term<S: Simd>(
    s: S,
    (term, x): (&FrequencyTerm<f32>, &[f32]),
    f: usize,
    (n, columns): (usize, &Range<usize>),
    more: bool,
    sums: &mut [f32],
) {
    let n_columns = self::columns::<S>();
    let n_groups = sums.len() / n_columns;
    match term {
        FrequencyTerm::Nodes { weights, .. } => {
            let depth = weights.depth;
            let x = &x[f * plane(n_groups, depth)..][..n_groups * depth];
            let w = (columns.start / n_columns * N_FREQUENCIES + f) * depth * n_columns;
            add_product(s, (x, depth), &weights.numbers()[w..], more, sums);
        }
        FrequencyTerm::Shapes { products, shapes } => {
            if !more {
                sums.fill(0.0);
            }
            let x = &x[f * plane(n_groups, 1)..][..n_groups];
            assert!(shapes.len() == n_groups && columns.end <= n);
            for v in 0..WIDTH {
                let n_lanes = lanes_of::<S>(columns.len(), v);
                let first = f * n + columns.start + if n_lanes > 0 { v * S::LANES } else { 0 };
                let (to, from) = (sums[v * S::LANES..].as_mut_ptr(), products[first..].as_ptr());
                for (i, (&x, shape)) in x.iter().zip(*shapes).enumerate() {
                    // SAFETY: reads: `products` has `N_FREQUENCIES·n` numbers for each shape (checked on entry), of
                    // which those of frequency f and of the columns, `n_lanes` of them, end before the next frequency;
                    // writes: there are `n_groups` rows of sums, each of `WIDTH·LANES` numbers, and `i < n_groups`.
                    unsafe {
                        let row = from.add(shape * N_FREQUENCIES * n);
                        let row = S::F32::load_partial_ptr(s, row, n_lanes);
                        let to = to.add(i * n_columns);
                        S::F32::splat(s, x).mul_add(row, S::F32::load_ptr(s, to)).store_ptr(to);
                    }
                }
            }
        }
    }
}

/// Some columns of `y: [8·n_groups, n]`, from the sums of all frequencies, which lie `apart`.
#[inline(always)]
fn put_children<S: Simd>(
    s: S,
    work: &mut TransformScratch,
    (sums, apart): (&[f32], usize),
    (n, columns): (usize, &Range<usize>),
    y: &mut [f32],
) {
    let n_columns = self::columns::<S>();
    let (halfway, ..) = work.parts(s);
    for (i, y) in y.chunks_exact_mut(8 * n).enumerate() {
        for v in 0..WIDTH {
            let n_lanes = lanes_of::<S>(columns.len(), v);
            if n_lanes == 0 {
                continue;
            }
            let place = i * n_columns + v * S::LANES;
            assert!(sums.len() >= (N_FREQUENCIES - 1) * apart + place + S::LANES);
            let first = columns.start + v * S::LANES;
            let (from, to) = (sums[place..].as_ptr(), y[first..].as_mut_ptr());
            // SAFETY: reads: the sums have a whole vector at that place of every frequency (asserted); writes: `y` is
            // eight rows of `n`, borrowed here alone; lane `n_lanes - 1` of vector `v` is at most column
            // `columns.end - 1`, and `columns.end ≤ n` (checked on entry). Both pointers may reach to the ends of the
            // slices and stay inside.
            unsafe {
                each_axis::<_, 4, 2>(
                    halfway,
                    #[inline(always)]
                    |f| S::F32::load_ptr(s, from.add(f * apart)),
                    output,
                    #[inline(always)]
                    |child, x: S::F32| x.store_partial_ptr(to.add(child * n), n_lanes),
                );
            }
        }
    }
}

/// `sums[r] += x[r, depth] · w[depth]`, rows of a panel's width, or without what was there if there is not
/// `more`.
#[inline(always)]
fn add_product<S: Simd>(
    s: S,
    (x, depth): (&[f32], usize),
    w: &[f32],
    more: bool,
    sums: &mut [f32],
) {
    let (n_rows, n_columns) = (x.len() / depth, columns::<S>());
    assert!(n_rows <= MAX_GROUPS && n_rows * n_columns == sums.len());
    for p in passes(depth, DEPTH) {
        let panel = Panel::in_place(&w[p.start * n_columns..], n_columns, p.len(), n_columns);
        let more = more || p.start > 0;
        for r in tiles(n_rows, S::TILE_ROWS) {
            let rows = &ROWS[r];
            let a = RowPointers { start: x[p.start..].as_ptr(), rows, width: depth };
            let c = RowPointers { start: sums.as_mut_ptr(), rows, width: n_columns };
            // SAFETY: `a` and `c` have as many rows as the tile is high (`with_height`), numbers below `n_rows`: `x`
            // has as many of `depth` numbers, and p ends within them; the sums have as many of
            // `n_columns = WIDTH·LANES` (asserted), borrowed here alone; rows of the panel are as wide (`in_place`
            // asserts it).
            unsafe {
                with_height!(rows.len(), tile_rows::<S, WIDTH>(s, a, panel, c, n_columns, more))
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::weights::Weights;
    use super::transforms::PLACES;
    use super::*;

    const N_GROUPS: usize = 13;

    fn numbers<T: Real>(len: usize, seed: usize) -> Vec<T> {
        let number = |i: usize| (((i + seed) * 7919 + 13) % 97) as f32 * 0.37 - 17.0;
        (0..len).map(|i| T::from_f32(number(i))).collect()
    }

    /// Groups on a line: some neighbors are missing, all differ.
    fn groups() -> Vec<[i32; 27]> {
        let neighbor = |g: usize, k: usize| match (g + k) % 3 {
            0 if k != 13 => -1,
            _ => 8 * ((g + (k + 14) * 5) % N_GROUPS) as i32,
        };
        let group =
            |g| std::array::from_fn(|k| if k == 13 { 8 * g as i32 } else { neighbor(g, k) });
        (0..N_GROUPS).map(group).collect()
    }

    /// Row of the neighbor at offset `k` of a child.
    fn neighbor(group: &[i32; 27], child: usize, k: usize) -> Option<usize> {
        let (child, k) = ([child >> 2, child >> 1 & 1, child & 1], [k / 9, k / 3 % 3, k % 3]);
        let node: usize = (0..3).fold(0, |node, axis| 4 * node + child[axis] + k[axis]);
        let (parent, child) = PLACES[node];
        usize::try_from(group[parent]).ok().map(|first| first + child)
    }

    fn packed<T: Real + Send + Sync>(isa: Isa, w: &[T], depth: usize, n: usize) -> Packed<T> {
        let memory = vec![T::from_f32(f32::NAN); 7];
        transform_weights(isa, &Weights::new(w, depth, n), memory, |numbers, len, work| {
            numbers.chunks_mut(len).enumerate().for_each(|(i, block)| work(i, block));
        })
    }

    /// The sum of a product with `depth` columns and of one column that is 1 in the first shape, 2 in the other.
    fn sums<T: Real + Send + Sync>(isa: Isa, depth: usize, n: usize) -> Vec<T> {
        let x: Vec<T> = numbers(8 * N_GROUPS * depth, 1);
        let weights = packed(isa, &numbers::<T>(27 * depth * n, 2), depth, n);
        let products: Vec<T> = numbers(27 * n, 3);
        let twice: Vec<T> = products.iter().map(|&x| x + x).collect();
        let mut transformed = vec![T::default(); 2 * N_FREQUENCIES * n];
        let (one, two) = transformed.split_at_mut(N_FREQUENCIES * n);
        transform_products(isa, &products, n, one);
        transform_products(isa, &twice, n, two);
        let shapes: Vec<usize> = (0..N_GROUPS).map(|g| g / 7).collect();
        let terms = [
            FrequencyTerm::Shapes { products: &transformed, shapes: &shapes },
            FrequencyTerm::Nodes { x: &x, weights: &weights },
        ];
        let mut y = vec![T::from_f32(f32::NAN); 8 * N_GROUPS * n];
        sum_of_terms(isa, &groups(), &terms, n, &mut FrequencyScratch::default(), &mut y);
        y
    }

    #[test]
    fn sum_equals_the_plain_one_up_to_rounding() {
        for (depth, n) in [(8, 8), (24, 40)].into_iter().take(if cfg!(miri) { 1 } else { 2 }) {
            let y: Vec<f64> = sums(Isa::active(), depth, n);
            let x: Vec<f64> = numbers(8 * N_GROUPS * depth, 1);
            let w: Vec<f64> = numbers(27 * depth * n, 2);
            let product: Vec<f64> = numbers(27 * n, 3);
            for (g, group) in groups().iter().enumerate() {
                for child in 0..8 {
                    for j in 0..n {
                        let there = |k| neighbor(group, child, k).map(|row| (k, row));
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
    fn every_isa_gives_the_same_bits() {
        let sizes = [(8, 8), (16, 72), (96, 96), (256, 24)];
        for (depth, n) in sizes.into_iter().take(if cfg!(miri) { 1 } else { 4 }) {
            let bits = |isa| sums::<f32>(isa, depth, n).into_iter().map(f32::to_bits);
            let expected: Vec<u32> = bits(Isa::active()).collect();
            for &isa in Isa::available() {
                assert!(bits(isa).eq(expected.iter().copied()), "{}", isa.name());
            }
        }
    }

    /// `Σ dy·y` has the gradient by the weights that the transforms say.
    #[test]
    fn weight_gradient_equals_the_plain_sum_up_to_rounding() {
        let (depth, n, isa) = (if cfg!(miri) { 8 } else { 16 }, 8, Isa::active());
        let groups = groups();
        let x: Vec<f64> = numbers(8 * N_GROUPS * depth, 1);
        let dy: Vec<f64> = numbers(8 * N_GROUPS * n, 2);
        let (mut v, mut d) = (vec![0.0; 64 * 15 * depth], vec![0.0; 64 * 15 * n]);
        transform_inputs(isa, &groups, (&x, depth), 15, &mut v);
        transform_gradients(isa, (&dy, n), 15, &mut d);
        let mut u = vec![0.0; 64 * depth * n];
        for (i, u) in u.iter_mut().enumerate() {
            let (f, p, j) = (i / (depth * n), i / n % depth, i % n);
            let row = |g| v[(f * 15 + g) * depth + p] * d[(f * 15 + g) * n + j];
            *u = (0..N_GROUPS).map(row).sum();
        }
        for p in 0..depth {
            let mut dw = vec![f64::NAN; 27 * n];
            transform_weight_gradients(isa, &u[p * n..], depth * n, &mut dw);
            for k in 0..27 {
                for j in 0..n {
                    let plain: f64 = (0..8 * N_GROUPS)
                        .filter_map(|o| {
                            let row = neighbor(&groups[o / 8], o % 8, k)?;
                            Some(x[row * depth + p] * dy[o * n + j])
                        })
                        .sum();
                    assert!((dw[k * n + j] - plain).abs() < 1e-8);
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "neighbors")]
    fn a_neighbor_outside_the_input_panics() {
        let (x, mut to) = ([0.0f32; 64], [0.0; 64 * 8]);
        let mut group = [-1; 27];
        group[26] = 8;
        transform_inputs(Isa::active(), &[group], (&x, 8), 1, &mut to);
    }
}
