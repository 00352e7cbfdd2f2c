//! The transforms of Winograd's filtering: inputs, gradients, weights to frequencies, frequencies to weight gradients.

use super::super::super::vector::MAX_LANES;
use super::super::super::{Isa, Kernel, Simd, Vector};
use super::super::tile::{MAX_COLUMNS, WIDTH, columns};
use super::super::weights::{Packed, Weights, uninit};
use super::super::{Real, passes};
use super::cube::{Halfway, each_axis, gradient, input, kernel, kernel_gradient};
use std::mem::MaybeUninit;

/// Frequencies of a cube.
pub const N_FREQUENCIES: usize = 64;

/// Numbers of columns are multiples of this.
pub const CHANNELS: usize = 8;

/// Most columns of inputs.
pub const MAX_DEPTH: usize = 256;

/// For each node of a cube: which neighbor of the parent holds it, and as which child.
pub(in crate::simd) static PLACES: [(usize, usize); 64] = {
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
    isa: Isa,
    weights: &Weights<T>,
    memory: Vec<T>,
    for_each_block: impl FnOnce(&mut [T], usize, &(dyn Fn(usize, &mut [T]) + Sync)),
) -> Packed<T> {
    assert_eq!(weights.n_offsets(), 27, "a kernel of 3×3×3");
    let depth = weights.depth();
    let mut packed = Packed::unwritten(isa, N_FREQUENCIES, depth, weights.width(), memory);
    let len = N_FREQUENCIES * depth * packed.panel_width;
    for_each_block(packed.numbers_mut(), len, &|panel, to| {
        T::transform_kernels(isa, KernelTransform::Weights { weights, panel, to });
    });
    packed
}

/// Overwrites `to: [64, n]` with `G` applied to `products`: 27 rows of `n`, `stride` apart.
///
/// # Panics
/// If something does not fit.
pub fn transform_products<T: Real>(isa: Isa, products: &[T], stride: usize, to: &mut [T]) {
    let width = to.len() / N_FREQUENCIES;
    check_rows_of(products, 27, stride, width, to, N_FREQUENCIES);
    T::transform_kernels(isa, KernelTransform::Products { x: products, stride, width, to });
}

/// Overwrites `to: [27, n]` with `Gᵀ` applied to `u`: 64 rows of `n`, `stride` apart.
///
/// # Panics
/// If something does not fit.
pub fn transform_weight_gradients<T: Real>(isa: Isa, u: &[T], stride: usize, to: &mut [T]) {
    let width = to.len() / 27;
    check_rows_of(u, N_FREQUENCIES, stride, width, to, 27);
    T::transform_kernels(isa, KernelTransform::Gradients { x: u, stride, width, to });
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
    isa: Isa,
    groups: &[[i32; 27]],
    (x, depth): (&[T], usize),
    n_rows: usize,
    to: &mut [T],
) {
    check_groups(groups, x.len(), depth);
    assert!(groups.len() <= n_rows && to.len() == N_FREQUENCIES * n_rows * depth, "frequencies");
    T::transform_inputs(isa, InputTransform { groups, x, depth, plane: n_rows * depth, to });
}

/// Overwrites `to` with `A dy` for the children `dy: [8·n, width]` of some parents, laid out as by
/// [`transform_inputs`].
///
/// # Panics
/// If something does not fit.
pub fn transform_gradients<T: Real>(
    isa: Isa,
    (dy, width): (&[T], usize),
    n_rows: usize,
    to: &mut [T],
) {
    assert!(width.is_multiple_of(CHANNELS) && dy.len().is_multiple_of(8 * width), "whole groups");
    assert!(dy.len() <= 8 * n_rows * width && to.len() == N_FREQUENCIES * n_rows * width);
    T::transform_gradients(isa, GradientTransform { dy, width, plane: n_rows * width, to });
}

pub(super) fn check_groups(groups: &[[i32; 27]], len: usize, depth: usize) {
    assert!(depth.is_multiple_of(CHANNELS) && depth <= MAX_DEPTH, "columns of the input");
    assert!(len.is_multiple_of(8 * depth), "rows of the input");
    let n_rows = len / depth;
    let inside = |&first: &i32| usize::try_from(first).is_ok_and(|first| first + 8 <= n_rows);
    assert!(groups.as_flattened().iter().all(|first| *first < 0 || inside(first)), "neighbors");
}

/// `G`, or `Gᵀ` in the backward pass.
pub enum KernelTransform<'a, 'b, T> {
    /// `G w` of one panel.
    Weights {
        /// The weights.
        weights: &'a Weights<'b, T>,
        /// Which panel.
        panel: usize,
        /// `[64, depth, columns of a panel]`.
        to: &'a mut [T],
    },
    /// `G` of 27 rows.
    Products {
        /// The rows.
        x: &'a [T],
        /// Numbers from row to row.
        stride: usize,
        /// Columns.
        width: usize,
        /// `[64, width]`.
        to: &'a mut [T],
    },
    /// `Gᵀ` of 64 rows.
    Gradients {
        /// The rows.
        x: &'a [T],
        /// Numbers from row to row.
        stride: usize,
        /// Columns.
        width: usize,
        /// `[27, width]`.
        to: &'a mut [T],
    },
}

/// `Bᵀ x` of some groups.
pub struct InputTransform<'a, T> {
    pub(in crate::simd) groups: &'a [[i32; 27]],
    pub(in crate::simd) x: &'a [T],
    pub(in crate::simd) depth: usize,
    /// Numbers from one frequency to the next.
    pub(in crate::simd) plane: usize,
    pub(in crate::simd) to: &'a mut [T],
}

/// `A dy` of the children of some parents.
pub struct GradientTransform<'a, T> {
    pub(in crate::simd) dy: &'a [T],
    pub(in crate::simd) width: usize,
    /// Numbers from one frequency to the next.
    pub(in crate::simd) plane: usize,
    pub(in crate::simd) to: &'a mut [T],
}

/// Work space of a transform, outside the kernel: a cube halfway, and where its nodes are.
#[repr(align(64))]
pub(in crate::simd) struct TransformScratch {
    halfway: [MaybeUninit<f32>; 2 * 64 * MAX_LANES],
    rows: [*const f32; 64],
    exists: Exists,
}

/// Whether the 27 neighbors of some groups exist, 1 or 0, a lane per group.
pub(in crate::simd) type Exists = [[f32; MAX_LANES]; 27];

impl TransformScratch {
    pub(in crate::simd) fn new() -> Self {
        let halfway = [const { MaybeUninit::uninit() }; 2 * 64 * MAX_LANES];
        TransformScratch { halfway, rows: [ZEROS.as_ptr(); 64], exists: [[0.0; MAX_LANES]; 27] }
    }

    /// The cube in vectors, the rows, and which neighbors exist.
    #[inline(always)]
    pub(super) fn parts<S: Simd>(
        &mut self,
        s: S,
    ) -> (&mut Halfway<S::F32>, &mut [*const f32; 64], &mut Exists) {
        let halfway: *mut Halfway<S::F32> = self.halfway.as_mut_ptr().cast();
        // SAFETY: the first field of a struct that is aligned to 64 bytes is so too, as the widest vector needs; it has
        // places for 128 vectors of the most lanes, which `Halfway` is made of; all are written before a reference to
        // them is made; it takes over the borrow of `self.halfway`, and the other two fields are borrowed apart.
        let halfway = unsafe {
            for i in 0..128 {
                halfway.cast::<S::F32>().add(i).write(S::F32::splat(s, 0.0));
            }
            &mut *halfway
        };
        (halfway, &mut self.rows, &mut self.exists)
    }
}

/// A missing node.
static ZEROS: [f32; MAX_DEPTH] = [0.0; MAX_DEPTH];

/// Numbers of up to one vector in the columns of a matrix.
#[derive(Clone, Copy)]
struct Chunk<const WHOLE: bool> {
    first: usize,
    n: usize,
}

impl<const WHOLE: bool> Chunk<WHOLE> {
    /// # Safety
    /// From `row` on there are `first + n` numbers, and `n` is the number of lanes if `WHOLE`.
    #[inline(always)]
    unsafe fn load<S: Simd>(self, s: S, row: *const f32) -> S::F32 {
        // SAFETY: `n` numbers from `row + first` on may be read (the caller's promise): a whole vector if `WHOLE`, no
        // more than `n` otherwise.
        unsafe {
            match WHOLE {
                true => S::F32::load_ptr(s, row.add(self.first)),
                false => S::F32::load_partial_ptr(s, row.add(self.first), self.n),
            }
        }
    }

    /// # Safety
    /// As for [`Chunk::load`], for writing.
    #[inline(always)]
    unsafe fn store<S: Simd>(self, lanes: S::F32, row: *mut f32) {
        // SAFETY: `n` places from `row + first` on may be written (the caller's promise): a whole vector if `WHOLE`, no
        // more than `n` otherwise.
        unsafe {
            match WHOLE {
                true => lanes.store_ptr(row.add(self.first)),
                false => lanes.store_partial_ptr(row.add(self.first), self.n),
            }
        }
    }
}

/// Calls `$body` with a chunk for every vector of columns, the last one perhaps not whole.
macro_rules! for_each_chunk {
    ($s:ty, $width:expr, |$chunk:ident| $body:expr) => {{
        let (width, lanes) = ($width, <$s>::LANES);
        for first in (0..width - width % lanes).step_by(lanes) {
            let $chunk = Chunk::<true> { first, n: lanes };
            $body
        }
        if width % lanes > 0 {
            let $chunk = Chunk::<false> { first: width - width % lanes, n: width % lanes };
            $body
        }
    }};
}

/// An [`InputTransform`] and its memory.
pub(in crate::simd) struct InputKernel<'a>(
    pub InputTransform<'a, f32>,
    pub &'a mut TransformScratch,
);

impl Kernel for InputKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let InputKernel(InputTransform { groups, x, depth, plane, to }, work) = self;
        let (halfway, rows, _) = work.parts(s);
        for (i, group) in groups.iter().enumerate() {
            find_rows(group, (x, depth), rows);
            frequencies(s, halfway, rows, depth, plane, &mut to[i * depth..]);
        }
    }
}

/// Where the nodes of a cube are; [`check_groups`] holds for the group.
#[inline(always)]
pub(super) fn find_rows(
    group: &[i32; 27],
    (x, depth): (&[f32], usize),
    rows: &mut [*const f32; 64],
) {
    for (row, (parent, child)) in rows.iter_mut().zip(&PLACES) {
        *row = match usize::try_from(group[*parent]) {
            Ok(first) => x[(first + child) * depth..][..depth].as_ptr(),
            Err(_) => ZEROS.as_ptr(),
        };
    }
}

/// `Bᵀ x` of the group at `rows`, each of `depth` numbers; frequencies are `plane` apart.
#[inline(always)]
pub(super) fn frequencies<S: Simd>(
    s: S,
    halfway: &mut Halfway<S::F32>,
    rows: &[*const f32; 64],
    depth: usize,
    plane: usize,
    to: &mut [f32],
) {
    assert!(to.len() >= (N_FREQUENCIES - 1) * plane + depth);
    let to = to.as_mut_ptr();
    // SAFETY: reads: `find_rows` cut each row to `depth` numbers, or took zeros, of which there are MAX_DEPTH ≥ depth
    // (`check_groups`); writes: frequency f has `depth` places from `f·plane` on (asserted for the last), borrowed here
    // alone; chunks end at `depth`.
    for_each_chunk!(S, depth, |chunk| unsafe {
        each_axis::<_, 4, 4>(
            halfway,
            #[inline(always)]
            |i| chunk.load(s, rows[i]),
            input,
            #[inline(always)]
            |f, x| chunk.store::<S>(x, to.add(f * plane)),
        );
    });
}

/// A [`GradientTransform`] and its memory.
pub(in crate::simd) struct GradientKernel<'a>(
    pub GradientTransform<'a, f32>,
    pub &'a mut TransformScratch,
);

impl Kernel for GradientKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let GradientKernel(GradientTransform { dy, width, plane, to }, work) = self;
        let (halfway, ..) = work.parts(s);
        let zero = S::F32::splat(s, 0.0);
        for (i, dy) in dy.chunks_exact(8 * width).enumerate() {
            let to = &mut to[i * width..];
            assert!(to.len() >= (N_FREQUENCIES - 1) * plane + width);
            let to = to.as_mut_ptr();
            // SAFETY: reads: `chunks_exact` cut `dy` to eight rows of `width` numbers; writes: frequency f has `width`
            // places from `f·plane` on (asserted for the last), borrowed here alone; chunks end at `width`.
            for_each_chunk!(S, width, |chunk| unsafe {
                each_axis::<_, 2, 4>(
                    halfway,
                    #[inline(always)]
                    |child| chunk.load(s, dy.as_ptr().add(child * width)),
                    #[inline(always)]
                    |along| gradient(zero, along),
                    #[inline(always)]
                    |f, x| chunk.store::<S>(x, to.add(f * plane)),
                );
            });
        }
    }
}

/// Memory of [`KernelTransform::Weights`]: some rows of a panel for each offset.
pub(in crate::simd) struct KernelRows([f32; 27 * MAX_LANES * MAX_COLUMNS]);

/// A [`KernelTransform`] and its memory.
pub(in crate::simd) struct KernelKernel<'a, 'b>(
    pub KernelTransform<'a, 'b, f32>,
    pub &'a mut TransformScratch,
    pub &'a mut KernelRows,
);

impl KernelRows {
    pub(in crate::simd) fn new() -> Self {
        KernelRows([0.0; 27 * MAX_LANES * MAX_COLUMNS])
    }
}

impl Kernel for KernelKernel<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let KernelKernel(transform, work, kernel_rows) = self;
        let (halfway, ..) = work.parts(s);
        let half = S::F32::splat(s, 0.5);
        match transform {
            KernelTransform::Weights { weights, panel, to } => {
                transform_panel(s, weights, panel, halfway, kernel_rows, to);
            }
            KernelTransform::Products { x, stride, width, to } => {
                assert!(x.len() >= 26 * stride + width && to.len() >= N_FREQUENCIES * width);
                let (x, to) = (x.as_ptr(), to.as_mut_ptr());
                // SAFETY: reads: row 26 of `x`, rows `stride` apart, ends within it (asserted); writes: `to` has 64
                // rows of `width` (asserted), borrowed here alone; chunks end at `width`.
                for_each_chunk!(S, width, |chunk| unsafe {
                    each_axis::<_, 3, 4>(
                        halfway,
                        #[inline(always)]
                        |k| chunk.load(s, x.add(k * stride)),
                        #[inline(always)]
                        |along| kernel(half, along),
                        #[inline(always)]
                        |f, x| chunk.store::<S>(x, to.add(f * width)),
                    );
                });
            }
            KernelTransform::Gradients { x, stride, width, to } => {
                assert!(x.len() >= 63 * stride + width && to.len() >= 27 * width);
                let (x, to) = (x.as_ptr(), to.as_mut_ptr());
                // SAFETY: reads: row 63 of `x`, rows `stride` apart, ends within it (asserted); writes: `to` has 27
                // rows of `width` (asserted), borrowed here alone; chunks end at `width`.
                for_each_chunk!(S, width, |chunk| unsafe {
                    each_axis::<_, 4, 3>(
                        halfway,
                        #[inline(always)]
                        |f| chunk.load(s, x.add(f * stride)),
                        #[inline(always)]
                        |along| kernel_gradient(half, along),
                        #[inline(always)]
                        |k, x| chunk.store::<S>(x, to.add(k * width)),
                    );
                });
            }
        }
    }
}

/// `G w` of one panel: `to: [64, depth, columns of a panel]`.
#[inline(always)]
fn transform_panel<S: Simd>(
    s: S,
    weights: &Weights<f32>,
    panel: usize,
    halfway: &mut Halfway<S::F32>,
    KernelRows(w): &mut KernelRows,
    to: &mut [f32],
) {
    let (depth, n_columns, half) = (weights.depth(), columns::<S>(), S::F32::splat(s, 0.5));
    assert!(to.len() >= N_FREQUENCIES * depth * n_columns);
    for p in passes(depth, S::LANES) {
        for k in 0..27 {
            let rows = &mut w[k * S::LANES * n_columns..][..p.len() * n_columns];
            weights.copy_panel(s, k, p.clone(), panel * n_columns, uninit(rows));
        }
        for (i, p) in p.enumerate() {
            for v in 0..WIDTH {
                let (from, at) = (i * n_columns + v * S::LANES, p * n_columns + v * S::LANES);
                let (w, to) = (w.as_ptr(), to.as_mut_ptr());
                // SAFETY: reads: `w` has LANES rows of a panel for each of the 27 offsets, `i < LANES` and vector
                // `v < WIDTH` is within a row; writes: `to` has `depth` rows of a panel for each of the 64 frequencies
                // (asserted), borrowed here alone, `p < depth`.
                unsafe {
                    each_axis::<_, 3, 4>(
                        halfway,
                        #[inline(always)]
                        |k| S::F32::load_ptr(s, w.add(k * S::LANES * n_columns + from)),
                        #[inline(always)]
                        |along| kernel(half, along),
                        #[inline(always)]
                        |f, x: S::F32| x.store_ptr(to.add(f * depth * n_columns + at)),
                    );
                }
            }
        }
    }
}

/// `Bᵀ 1` of some groups, as many at a time as a vector has lanes: what the frequencies of constant inputs are
/// multiplied by. Frequencies are `plane ≥ groups.len()` apart.
#[inline(always)]
pub(super) fn frequencies_of_ones<S: Simd>(
    s: S,
    halfway: &mut Halfway<S::F32>,
    exists: &mut Exists,
    groups: &[[i32; 27]],
    plane: usize,
    to: &mut [f32],
) {
    assert!(to.len() >= (N_FREQUENCIES - 1) * plane + groups.len());
    for (i, groups) in groups.chunks(S::LANES).enumerate() {
        for (k, exists) in exists.iter_mut().enumerate() {
            for (lane, exists) in exists[..S::LANES].iter_mut().enumerate() {
                let there = groups.get(lane).is_some_and(|group| group[k] >= 0);
                *exists = if there { 1.0 } else { 0.0 };
            }
        }
        let to = to[i * S::LANES..].as_mut_ptr();
        // SAFETY: reads are of slices; writes: from `f·plane` on there is a place for each group (asserted for the last
        // frequency), of which these are the ones from `i·LANES` on, `groups.len()` of them, borrowed here alone.
        unsafe {
            each_axis::<_, 4, 4>(
                halfway,
                #[inline(always)]
                |node| S::F32::load(s, &exists[PLACES[node].0]),
                input,
                #[inline(always)]
                |f, x: S::F32| x.store_partial_ptr(to.add(f * plane), groups.len()),
            );
        }
    }
}
