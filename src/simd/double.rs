//! The kernels in `f64`, for gradient checks: plain loops, with matrixmultiply for the products.
//!
//! They serve gradient checks. Sums are fused or not as matrixmultiply does it on this processor; for any
//! number of threads the bits are the same.

use super::Isa;
use super::elementwise::{Combination, Combine, ReluInPlace, Scale, SgdStep, SparseRows};
use super::gemm::block::{Block, BlockTerm, PackPanel, WeightSource};
use super::gemm::winograd::cube::{each_axis, gradient, input, kernel, kernel_gradient, output};
use super::gemm::winograd::transforms::PLACES;
use super::gemm::winograd::{
    self, FrequencyBlock, GradientTransform, InputTransform, KernelTransform, N_FREQUENCIES,
};
use super::gemm::{MatmulRows, MatmulTnRows};
use super::normalize::{
    Activation, BackwardApply, BackwardRows, BackwardSums, ColumnSums, NormalizeRows,
};
use super::real::kernels::Kernels;

/// A matrix somewhere in memory: its first number and the distances between rows and between columns.
#[derive(Clone, Copy)]
struct Strided<'a>(&'a [f64], usize, usize);

/// `c[m, n] += a[m, k] · b[k, n]`.
fn add_product([m, k, n]: [usize; 3], a: Strided, b: Strided, c: &mut [f64]) {
    let reach = |rows: usize, columns: usize, x: Strided| {
        rows == 0 || columns == 0 || (rows - 1) * x.1 + (columns - 1) * x.2 < x.0.len()
    };
    assert!(reach(m, k, a) && reach(k, n, b) && c.len() == m * n, "operands of a product");
    let stride = |x: usize| x as isize;
    // SAFETY: `dgemm` reads `[m, k]` and `[k, n]` and writes `[m, n]` at the strides given: the last element of each,
    // and with it all, lies inside its slice (asserted; rows of `c` are `n` apart, so that none overlap); `c` is
    // borrowed here alone.
    unsafe {
        matrixmultiply::dgemm(
            m,
            k,
            n,
            1.0,
            a.0.as_ptr(),
            stride(a.1),
            stride(a.2),
            b.0.as_ptr(),
            stride(b.1),
            stride(b.2),
            1.0,
            c.as_mut_ptr(),
            stride(n),
            1,
        );
    }
}

/// The rows of a list, one after another.
fn gathered(x: &[f64], rows: &[u32], width: usize) -> Vec<f64> {
    rows.iter().flat_map(|&row| &x[row as usize * width..][..width]).copied().collect()
}

/// Adds the rows of `x`, `width` numbers each, to the rows of a list.
fn scatter(x: &[f64], rows: &[u32], width: usize, to: &mut [f64]) {
    for (&row, x) in rows.iter().zip(x.chunks_exact(width)) {
        to[row as usize * width..][..width].iter_mut().zip(x).for_each(|(to, x)| *to += x);
    }
}

impl Kernels for f64 {
    fn product(_: Isa, x: MatmulRows<f64>) {
        let (m, width) = (x.a_rows.len(), x.columns.len());
        let mut c = vec![0.0; m * width];
        let a = gathered(x.a, x.a_rows, x.k);
        let b = Strided(&x.b[x.columns.start..], x.n, 1);
        add_product([m, x.k, width], Strided(&a, x.k, 1), b, &mut c);
        scatter(&c, x.c_rows, width, x.c);
    }

    fn transposed_product(_: Isa, x: MatmulTnRows<f64>) {
        let (a, g) = (gathered(x.a, x.a_rows, x.k), gathered(x.g, x.g_rows, x.n));
        let shape = [x.k, x.a_rows.len(), x.n];
        add_product(shape, Strided(&a, 1, x.k), Strided(&g, x.n, 1), x.d);
    }

    /// One panel.
    fn panel_width(_: Isa, width: usize) -> usize {
        width.max(1)
    }

    fn pack_panel(_: Isa, x: PackPanel<f64>) {
        let (w, row, column) = x.weights.strided(x.offset);
        for (p, to) in x.to.chunks_exact_mut(x.weights.width()).enumerate() {
            to.iter_mut().enumerate().for_each(|(j, to)| *to = w[p * row + j * column]);
        }
    }

    fn block_sum(_: Isa, Block { terms, columns, y }: Block<f64>) {
        let width = columns.len();
        y.fill(0.0);
        for term in terms {
            match term {
                BlockTerm::Products { x, pairs, weights } => {
                    for (k, (inputs, outputs)) in pairs.iter().enumerate() {
                        let (w, depth, row, column) = match weights {
                            WeightSource::Packed(packed) => {
                                let len = packed.depth * packed.width;
                                (&packed.numbers()[k * len..], packed.depth, packed.width, 1)
                            }
                            WeightSource::Matrices(weights) => {
                                let (w, row, column) = weights.strided(k);
                                (w, weights.depth(), row, column)
                            }
                        };
                        let a = gathered(x, inputs, depth);
                        let mut c = vec![0.0; inputs.len() * width];
                        let b = Strided(&w[columns.start * column..], row, column);
                        add_product([inputs.len(), depth, width], Strided(&a, depth, 1), b, &mut c);
                        scatter(&c, outputs, width, y);
                    }
                }
                BlockTerm::Rows(rows) => {
                    for (row, outputs) in rows {
                        outputs.iter().for_each(|&o| {
                            scatter(&row[columns.clone()], &[o], width, y);
                        });
                    }
                }
            }
        }
    }

    fn frequency_sum(isa: Isa, x: FrequencyBlock<f64>) {
        let FrequencyBlock { groups, terms, n, scratch, y } = x;
        let m = groups.len();
        scratch.sums.clear();
        scratch.sums.resize(N_FREQUENCIES * m * n, 0.0);
        for (term, input) in terms.iter().zip(&mut scratch.inputs) {
            let depth = match term {
                winograd::FrequencyTerm::Nodes { weights, .. } => weights.depth,
                winograd::FrequencyTerm::Shapes { .. } => 1,
            };
            input.resize(N_FREQUENCIES * m * depth, 0.0);
            match term {
                winograd::FrequencyTerm::Nodes { x, .. } => {
                    let (plane, to) = (m * depth, &mut input[..]);
                    Self::transform_inputs(isa, InputTransform { groups, x, depth, plane, to });
                }
                winograd::FrequencyTerm::Shapes { .. } => frequencies_of_ones(groups, input),
            }
            for (f, sums) in scratch.sums.chunks_exact_mut(m * n).enumerate() {
                let x = &input[f * m * depth..][..m * depth];
                match term {
                    winograd::FrequencyTerm::Nodes { weights, .. } => {
                        let w = &weights.numbers()[f * depth * n..];
                        add_product([m, depth, n], Strided(x, depth, 1), Strided(w, n, 1), sums);
                    }
                    winograd::FrequencyTerm::Shapes { products, shapes } => {
                        for ((sums, x), shape) in sums.chunks_exact_mut(n).zip(x).zip(*shapes) {
                            let row = &products[(shape * N_FREQUENCIES + f) * n..][..n];
                            sums.iter_mut().zip(row).for_each(|(sum, y)| *sum += x * y);
                        }
                    }
                }
            }
        }
        for (i, y) in y.chunks_exact_mut(8 * n).enumerate() {
            for j in 0..n {
                let sum = |f: usize| scratch.sums[(f * m + i) * n + j];
                each_axis(&mut [[0.0; 64]; 2], sum, output, |child, x| y[child * n + j] = x);
            }
        }
    }

    fn transform_inputs(_: Isa, x: InputTransform<f64>) {
        let InputTransform { groups, x, depth, plane, to } = x;
        for (i, group) in groups.iter().enumerate() {
            for j in 0..depth {
                let node = |node: usize| {
                    let (parent, child) = PLACES[node];
                    let first = usize::try_from(group[parent]);
                    first.map_or(0.0, |first| x[(first + child) * depth + j])
                };
                each_axis(&mut [[0.0; 64]; 2], node, input, |f, x| {
                    to[f * plane + i * depth + j] = x
                });
            }
        }
    }

    fn transform_gradients(_: Isa, x: GradientTransform<f64>) {
        let GradientTransform { dy, width, plane, to } = x;
        for (i, dy) in dy.chunks_exact(8 * width).enumerate() {
            for j in 0..width {
                let child = |child: usize| dy[child * width + j];
                let line = |along| gradient(0.0, along);
                each_axis(&mut [[0.0; 64]; 2], child, line, |f, x| {
                    to[f * plane + i * width + j] = x
                });
            }
        }
    }

    fn transform_kernels(_: Isa, x: KernelTransform<f64>) {
        match x {
            KernelTransform::Weights { weights, to, .. } => {
                let (depth, n) = (weights.depth(), weights.width());
                for (p, j) in (0..depth).flat_map(|p| (0..n).map(move |j| (p, j))) {
                    let w = |k: usize| {
                        let (w, row, column) = weights.strided(k);
                        w[p * row + j * column]
                    };
                    let line = |along| kernel(0.5, along);
                    each_axis(&mut [[0.0; 64]; 2], w, line, |f, x| to[(f * depth + p) * n + j] = x);
                }
            }
            KernelTransform::Products { x, stride, width, to } => {
                for j in 0..width {
                    let line = |along| kernel(0.5, along);
                    let put = |f: usize, x| to[f * width + j] = x;
                    each_axis(&mut [[0.0; 64]; 2], |k| x[k * stride + j], line, put);
                }
            }
            KernelTransform::Gradients { x, stride, width, to } => {
                for j in 0..width {
                    let line = |along| kernel_gradient(0.5, along);
                    let put = |k: usize, x| to[k * width + j] = x;
                    each_axis(&mut [[0.0; 64]; 2], |f| x[f * stride + j], line, put);
                }
            }
        }
    }

    fn combine(_: Isa, Combine { combination, y, x }: Combine<f64>) {
        for (y, &x) in y.iter_mut().zip(x) {
            *y = match combination {
                Combination::Add => *y + x,
                Combination::PassRelu if x > 0.0 => *y,
                Combination::PassRelu => 0.0,
            };
        }
    }

    fn relu(_: Isa, ReluInPlace(x): ReluInPlace<f64>) {
        x.iter_mut().for_each(|x| *x = rectified(*x));
    }

    fn scale(_: Isa, Scale(factor, x): Scale<f64>) {
        x.iter_mut().for_each(|x| *x *= factor);
    }

    fn sgd_step(_: Isa, x: SgdStep<f64>) {
        let SgdStep { lr, momentum, decay, grads, velocity, params } = x;
        for ((g, v), p) in grads.iter_mut().zip(velocity).zip(params) {
            *v = momentum * *v + (*g + decay * *p);
            *p -= lr * *v;
            *g = 0.0;
        }
    }

    fn sparse_rows(_: Isa, x: SparseRows<f64>) {
        let SparseRows { starts, sources, weights, x, c, y } = x;
        y.fill(0.0);
        for (y, range) in y.chunks_exact_mut(c).zip(starts.windows(2)) {
            for t in range[0]..range[1] {
                let x = &x[sources[t] as usize * c..][..c];
                y.iter_mut().zip(x).for_each(|(y, &x)| *y = weights[t].mul_add(x, *y));
            }
        }
    }

    fn normalize(_: Isa, work: NormalizeRows<f64>) {
        let NormalizeRows { columns, x, activation, y } = work;
        let c = columns.mean.len();
        for i in 0..y.len() {
            let (j, x) = (i % c, x.map_or(y[i], |x| x[i]));
            let n = (x - columns.mean[j]) * columns.factor[j] + columns.bias[j];
            y[i] = match activation {
                Activation::Identity => n,
                Activation::Relu => rectified(n),
                Activation::ReluOfSum(other) => rectified(n + other[i]),
                Activation::ReluOfSumWithOutput => rectified(n + y[i]),
                Activation::PassReluOfSum(other) if n + other[i] > 0.0 => y[i],
                Activation::PassReluOfSum(_) => 0.0,
            };
        }
    }

    fn backward_sums(_: Isa, work: BackwardSums<f64>) {
        let BackwardSums { rows, x, dy, sums: [dweight, dbias] } = work;
        for i in 0..x.len() {
            let j = i % dweight.len();
            let [x_hat, dy] = rows.at(j, x[i], dy[i]);
            dweight[j] += x_hat * dy;
            dbias[j] += dy;
        }
    }

    fn backward_apply(_: Isa, work: BackwardApply<f64>) {
        let BackwardApply { rows, means: [dweight, dbias], over_dy, read, over } = work;
        for i in 0..over.len() {
            let j = i % dweight.len();
            let (x, dy) = if over_dy { (read[i], over[i]) } else { (over[i], read[i]) };
            let [x_hat, dy] = rows.at(j, x, dy);
            over[i] = rows.columns.factor[j] * (dy - dbias[j] - x_hat * dweight[j]);
        }
    }

    fn column_sums(_: Isa, ColumnSums { x, mean, sums }: ColumnSums<f64>) {
        for x in x.chunks_exact(sums.len()) {
            for (j, (sum, x)) in sums.iter_mut().zip(x).enumerate() {
                *sum += mean.map_or(*x, |mean| (x - mean[j]) * (x - mean[j]));
            }
        }
    }
}

impl BackwardRows<'_, f64> {
    /// `x̂` and what passes of `dy` in column `j`.
    fn at(&self, j: usize, x: f64, dy: f64) -> [f64; 2] {
        let centered = x - self.columns.mean[j];
        let passes = !self.relu || centered * self.columns.factor[j] + self.columns.bias[j] > 0.0;
        [centered * self.inv_std[j], if passes { dy } else { 0.0 }]
    }
}

/// `max(x, 0)`; −0 and NaN stay.
fn rectified(x: f64) -> f64 {
    if 0.0 > x { 0.0 } else { x }
}

/// `Bᵀ 1` of some groups, `[64, groups.len()]`.
fn frequencies_of_ones(groups: &[[i32; 27]], to: &mut [f64]) {
    for (i, group) in groups.iter().enumerate() {
        let node = |node: usize| if group[PLACES[node].0] < 0 { 0.0 } else { 1.0 };
        each_axis(&mut [[0.0; 64]; 2], node, input, |f, x| to[f * groups.len() + i] = x);
    }
}
