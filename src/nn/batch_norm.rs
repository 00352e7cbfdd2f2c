//! Batch normalization (Ioffe and Szegedy 2015) over all rows of a batch.

use super::arena::Buffer;
use super::column_norm::{Activation, ColumnNorm};
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::params::{Init, Layout};
use super::pass::{Backward, Inference, Training};
use super::rows;
use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::simd::Isa;
use crate::simd::normalize::{
    BackwardApply, BackwardRows, BackwardSums, backward_apply, backward_sums,
};
use std::ops::Range;

/// Added to the variance.
pub(crate) const EPS: f64 = 1e-5;
/// Share of the batch in a running statistic.
pub(crate) const MOMENTUM: f64 = 0.1;

/// Batches of at most this many rows are normalized in f64: there `x` determines the statistics so
/// nearly that the gradient is what rounding leaves of a cancellation (for two rows, a share of
/// `ε / (var + ε)`).
const FEW_ROWS: usize = 32;

/// `y = (x - mean) / √(var + ε) · weight + bias`, per column of `[n, c]`.
///
/// In training `mean` and `var` are those of the batch (`var` biased); the running statistics move a
/// tenth of the way to them (`var` unbiased there). A batch of a single row has no variance: training
/// then normalizes with the running statistics, as inference does, and leaves them alone.
///
/// ```
/// use deepmill::nn::{arena::Arena, batch_norm::BatchNorm, layer::Layer, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Training};
///
/// let mut layout = Layout::default();
/// let norm = BatchNorm::new(&mut layout, "bn", 1);
/// let (params, mut buffers) = (layout.init_params::<f64>(0), layout.init_buffers());
/// let (arena, x) = (Arena::default(), [1.0, 3.0]); // mean 2, variance 1 biased, 2 unbiased
/// let mut pass = Training::new(&params, &mut buffers, &arena);
/// let (y, _) = norm.forward_train(&mut pass, &(), Operand::new(&x, 1));
/// assert!((y[0] + 1.0).abs() < 1e-5 && (y[1] - 1.0).abs() < 1e-5);
/// assert_eq!(buffers, [0.2, 1.1, 1.0]); // from mean 0 and variance 1 a tenth of the way; one batch
/// ```
#[derive(Debug, Clone)]
pub struct BatchNorm {
    c: usize,
    weight: Range<usize>,
    bias: Range<usize>,
    running_mean: Range<usize>,
    running_var: Range<usize>,
    n_batches: Range<usize>,
}

/// What a batch was normalized with, `c` numbers each; backward needs it.
#[derive(Debug, Clone)]
pub struct Statistics {
    mean: Vec<f64>,
    inv_std: Vec<f64>,
    from_batch: bool,
}

/// How gradients go back.
#[derive(Debug, Clone, Copy)]
struct Way {
    /// `dy` is that of a ReLU after the norm: it passes where the output, computed again, is positive.
    relu: bool,
    /// `dx` takes the place of `dy`, not of `x`.
    over_dy: bool,
}

impl BatchNorm {
    /// Appends `{name}.weight`, `{name}.bias` and the buffers `{name}.running_mean`,
    /// `{name}.running_var` and `{name}.num_batches_tracked`.
    pub fn new(layout: &mut Layout, name: &str, c: usize) -> Self {
        let mut buffer = |suffix: &str, shape: &[usize], start: f64| {
            layout.buffer(format!("{name}.{suffix}"), shape, Init::Constant(start))
        };
        let running_mean = buffer("running_mean", &[c], 0.0);
        let running_var = buffer("running_var", &[c], 1.0);
        let n_batches = buffer("num_batches_tracked", &[], 0.0);
        let weight = layout.param(format!("{name}.weight"), &[c], Init::Constant(1.0));
        let bias = layout.param(format!("{name}.bias"), &[c], Init::Constant(0.0));
        BatchNorm { c, weight, bias, running_mean, running_var, n_batches }
    }

    /// Columns.
    pub fn c(&self) -> usize {
        self.c
    }

    /// What inference does to rows.
    pub(super) fn inference<T: Scalar>(&self, params: &[T], buffers: &[T]) -> ColumnNorm<T> {
        self.columns(params, &self.running(buffers))
    }

    /// Statistics of `x`, toward which the running ones move; of a single row, the running ones.
    pub(super) fn measure<T: Scalar>(&self, buffers: &mut [T], x: &[T]) -> Statistics {
        if x.len() > self.c { self.measure_batch(buffers, x) } else { self.running(buffers) }
    }

    /// Normalizes `x: [n, c]`, or `y` where there is none, into `y` with the statistics in `statistics`.
    pub(super) fn normalize<T: Scalar>(
        &self,
        params: &[T],
        statistics: &Statistics,
        x: Option<&[T]>,
        activation: Activation<T>,
        y: &mut [T],
    ) {
        match y.len() / self.c {
            0..=FEW_ROWS => {
                self.columns::<T, f64>(params, statistics).apply_wide(x, activation, y);
            }
            _ => self.columns::<T, T>(params, statistics).apply(x, activation, y),
        }
    }

    /// Turns `x` into its own gradient, where `dy` is that of the output, or of a ReLU after it; `grads` of
    /// weight and bias accumulate.
    pub(super) fn backward_over_input<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        mut x: Buffer<T>,
        statistics: &Statistics,
        dy: &[T],
        relu: bool,
    ) -> Buffer<T> {
        let way = Way { relu, over_dy: false };
        self.backward_over(pass, statistics, way, (dy, &mut x[..]));
        x
    }

    /// With `x̂ = (x - mean) · inv_std`: `dbias = Σ dy`, `dweight = Σ dy x̂`, and
    /// `dx = weight · inv_std · (dy - dbias / n - x̂ dweight / n)`; the two means vanish when the
    /// statistics did not come from the batch. `over` becomes `dx`, `read` is the other one of `x` and `dy`.
    fn backward_over<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        statistics: &Statistics,
        way: Way,
        (read, over): (&[T], &mut [T]),
    ) {
        let n_rows = read.len() / self.c;
        let share = if statistics.from_batch { 1.0 / n_rows as f64 } else { 0.0 };
        let [dweight, dbias] = match n_rows {
            0..=FEW_ROWS => self.backward_wide(&pass.params, statistics, way, share, (read, over)),
            _ => self.backward_rows(&pass.params, statistics, way, share, (read, over)),
        };
        for (range, sums) in [(&self.weight, dweight), (&self.bias, dbias)] {
            let grads = pass.grads(range).iter_mut();
            grads.zip(sums).for_each(|(d, sum)| *d += T::from_f64(sum));
        }
    }

    /// Gradients of weight and bias; `share` of them is their mean over the rows.
    fn backward_rows<T: Scalar>(
        &self,
        params: &[T],
        statistics: &Statistics,
        way: Way,
        share: f64,
        (read, over): (&[T], &mut [T]),
    ) -> [Vec<f64>; 2] {
        let c = self.c;
        let norm = self.columns::<T, T>(params, statistics);
        let inv_std: Vec<T> = statistics.inv_std.iter().copied().map(T::from_f64).collect();
        let how = BackwardRows { columns: norm.columns(), inv_std: &inv_std, relu: way.relu };
        let (x, dy): (&[T], &[T]) = if way.over_dy { (read, over) } else { (over, read) };
        let sums = rows::column_sums(0..x.len() / c, c, |block, sums| {
            let block = block.start * c..block.end * c;
            let (x, dy) = (&x[block.clone()], &dy[block]);
            backward_sums(Isa::active(), BackwardSums { rows: how, x, dy, sums });
        });
        let mean = |sums: &Vec<f64>| sums.iter().map(|s| T::from_f64(s * share)).collect();
        let means: [Vec<T>; 2] = sums.each_ref().map(mean);
        let len = rows::BLOCK_ROWS * c;
        par::for_each_block(over, len, |i, over| {
            let (read, means) = (&read[i * len..][..over.len()], means.each_ref().map(|m| &m[..]));
            let over_dy = way.over_dy;
            backward_apply(Isa::active(), BackwardApply { rows: how, means, over_dy, read, over });
        });
        sums
    }

    /// [`BatchNorm::backward_rows`] computed in f64, for few rows.
    fn backward_wide<T: Scalar>(
        &self,
        params: &[T],
        statistics: &Statistics,
        way: Way,
        share: f64,
        (read, over): (&[T], &mut [T]),
    ) -> [Vec<f64>; 2] {
        let (c, norm) = (self.c, self.columns::<T, f64>(params, statistics));
        let at = |i: usize, over: &[T]| {
            let (x, dy) = if way.over_dy { (read[i], over[i]) } else { (over[i], read[i]) };
            let passes = !way.relu || norm.at(i, x) > T::ZERO;
            let x_hat = (x.to_f64() - norm.mean[i % c]) * statistics.inv_std[i % c];
            (x_hat, if passes { dy.to_f64() } else { 0.0 })
        };
        let [mut dweight, mut dbias] = [vec![0.0; c], vec![0.0; c]];
        for i in 0..over.len() {
            let (x_hat, dy) = at(i, over);
            dweight[i % c] += x_hat * dy;
            dbias[i % c] += dy;
        }
        for i in 0..over.len() {
            let (j, (x_hat, dy)) = (i % c, at(i, over));
            let centered = dy - dbias[j] * share - x_hat * (dweight[j] * share);
            over[i] = T::from_f64(norm.factor[j] * centered);
        }
        [dweight, dbias]
    }

    /// Factor and summand per column that inference applies: `y = x · factor + summand`.
    pub fn folded<T: Scalar>(&self, params: &[T], buffers: &[T]) -> (Vec<T>, Vec<T>) {
        let ColumnNorm { mean, factor, bias } = self.inference(params, buffers);
        let summand = |j: usize| bias[j] - mean[j] * factor[j];
        let summands = (0..self.c).map(summand).collect();
        (factor, summands)
    }

    /// What backward needs after [`BatchNorm::forward`]: the running statistics, taken as constants.
    pub fn running<T: Scalar>(&self, buffers: &[T]) -> Statistics {
        let (mean, var) = (&buffers[self.running_mean.clone()], &buffers[self.running_var.clone()]);
        Statistics {
            mean: mean.iter().map(|m| m.to_f64()).collect(),
            inv_std: var.iter().map(|v| inv_std(v.to_f64())).collect(),
            from_batch: false,
        }
    }

    fn measure_batch<T: Scalar>(&self, buffers: &mut [T], x: &[T]) -> Statistics {
        let (mean, var) = rows::moments(x, self.c);
        let n = (x.len() / self.c) as f64;
        let mut blend = |place: &Range<usize>, values: &[f64], factor: f64| {
            for (running, value) in buffers[place.clone()].iter_mut().zip(values) {
                let new = (1.0 - MOMENTUM) * running.to_f64() + MOMENTUM * factor * value;
                *running = T::from_f64(new);
            }
        };
        blend(&self.running_mean, &mean, 1.0);
        blend(&self.running_var, &var, n / (n - 1.0));
        buffers[self.n_batches.start] += T::ONE;
        let inv_std = var.iter().map(|&v| inv_std(v)).collect();
        Statistics { mean, inv_std, from_batch: true }
    }

    fn check<T: Scalar>(&self, x: &Operand<T>) {
        assert_eq!(x.width(), self.c, "columns of the input and of the batch norm differ");
    }

    fn columns<T: Scalar, W: Scalar>(
        &self,
        params: &[T],
        statistics: &Statistics,
    ) -> ColumnNorm<W> {
        let weight = &params[self.weight.clone()];
        let cast = |x: &T| W::from_f64(x.to_f64());
        let factor = |(w, &s): (&T, &f64)| cast(w) * W::from_f64(s);
        ColumnNorm {
            mean: statistics.mean.iter().copied().map(W::from_f64).collect(),
            factor: weight.iter().zip(&statistics.inv_std).map(factor).collect(),
            bias: params[self.bias.clone()].iter().map(cast).collect(),
        }
    }
}

impl<T: Scalar> Layer<T> for BatchNorm {
    type Geometry = ();
    type Saved = Statistics;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        vec![self.weight.clone(), self.bias.clone()]
    }

    /// Running statistics.
    fn forward(&self, pass: &Inference<T>, (): &(), x: Operand<T>) -> Buffer<T> {
        self.check(&x);
        let mut y = x.copied(pass.arena);
        let norm = self.inference(pass.params, pass.buffers);
        norm.apply(None, Activation::Identity, &mut y);
        y
    }

    /// Statistics of `x`, toward which the running ones move.
    fn forward_train(
        &self,
        pass: &mut Training<T>,
        (): &(),
        x: Operand<T>,
    ) -> (Buffer<T>, Statistics) {
        self.check(&x);
        let (x, mut y) = (x.to_matrix(pass.arena), pass.arena.get(x.n_rows() * self.c));
        let statistics = self.measure(pass.buffers, &x);
        self.normalize(pass.params, &statistics, Some(&x), Activation::Identity, &mut y);
        (y, statistics)
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        (): &(),
        x: Operand<T>,
        statistics: Statistics,
        mut dy: Buffer<T>,
    ) -> OperandGradient<T> {
        self.check(&x);
        let matrix = x.to_matrix(pass.arena);
        assert_eq!(dy.len(), matrix.len(), "rows of the gradient and of x differ");
        let way = Way { relu: false, over_dy: true };
        self.backward_over(pass, &statistics, way, (&matrix, &mut dy));
        OperandGradient::of_matrix(pass.arena, x, dy)
    }
}

fn inv_std(variance: f64) -> f64 {
    1.0 / (variance + EPS).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::arena::Arena;
    use super::super::testing::require_gradients;
    use super::*;
    use crate::conformance::gradcheck;

    fn layer(c: usize) -> (BatchNorm, Layout, Vec<f64>, Vec<f64>) {
        let mut layout = Layout::default();
        let norm = BatchNorm::new(&mut layout, "bn", c);
        let params = gradcheck::probe(layout.n_params(), 5);
        let buffers = gradcheck::probe(layout.n_buffers(), 6).iter().map(|b| b.abs()).collect();
        (norm, layout, params, buffers)
    }

    /// Output of a training pass, which moves `buffers`.
    fn train(norm: &BatchNorm, params: &[f64], buffers: &mut [f64], x: &[f64]) -> Vec<f64> {
        let mut pass = Training { params, buffers, dropout: None, arena: &Arena::default() };
        norm.forward_train(&mut pass, &(), Operand::new(x, norm.c)).0.to_vec()
    }

    fn infer(norm: &BatchNorm, params: &[f64], buffers: &[f64], x: &[f64]) -> Vec<f64> {
        let pass = Inference { params, buffers, arena: &Arena::default() };
        norm.forward(&pass, &(), Operand::new(x, norm.c)).to_vec()
    }

    #[test]
    fn training_gradients_are_right_for_one_and_many_rows() {
        let c = 3;
        let (norm, layout, params, _) = layer(c);
        for n in [1, 2, 7, 1500] {
            let x = gradcheck::probe(n * c, 7);
            require_gradients(&norm, (&layout, &params), &(), Operand::new(&x, c));
        }
    }

    #[test]
    fn gradient_over_the_input_has_the_bits_of_that_over_dy() {
        let (norm, _, params, mut buffers) = layer(3);
        let (x, dy) = (gradcheck::probe(300, 1), gradcheck::probe(300, 2));
        let (arena, statistics) = (&Arena::default(), norm.measure(&mut buffers, &x));
        let (mut grads, mut other) = (vec![0.0; params.len()], vec![0.0; params.len()]);
        let mut pass = Backward::new(&params, &mut grads, arena);
        let over = norm.backward_over_input(&mut pass, arena.copy_of(&x), &statistics, &dy, false);
        let mut pass = Backward::new(&params, &mut other, arena);
        let x = Operand::new(&x, 3);
        let dx = norm.backward(&mut pass, &(), x, statistics, arena.copy_of(&dy)).into_first();
        assert_eq!((over[..].to_vec(), grads), (dx[..].to_vec(), other));
    }

    /// In f32 arithmetic the cancellation leaves errors of a few per cent here.
    #[test]
    fn gradients_of_two_rows_survive_cancellation_in_f32() {
        let c = 64;
        let (norm, _, params, buffers) = layer(c);
        let single = |values: &[f64]| values.iter().map(|&v| v as f32).collect::<Vec<f32>>();
        let (x, dy) = (single(&gradcheck::probe(2 * c, 7)), single(&gradcheck::probe(2 * c, 8)));
        fn dx<T: Scalar>(norm: &BatchNorm, [params, mut buffers, x, dy]: [Vec<T>; 4]) -> Vec<f64> {
            let (arena, x) = (&Arena::default(), Operand::new(&x, norm.c));
            let mut pass =
                Training { params: &params, buffers: &mut buffers, dropout: None, arena };
            let (_, saved) = norm.forward_train(&mut pass, &(), x);
            let mut grads = vec![T::ZERO; params.len()];
            let mut pass = Backward::new(&params, &mut grads, arena);
            let d = norm.backward(&mut pass, &(), x, saved, arena.copy_of(&dy)).into_first();
            d.iter().map(|d| d.to_f64()).collect()
        }
        let singles = [single(&params), single(&buffers), x, dy];
        let doubles = singles.clone().map(|v| v.iter().map(|&v| f64::from(v)).collect());
        let (a, b) = (dx(&norm, singles), dx(&norm, doubles));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-6 * b.abs()));
    }

    #[test]
    fn output_of_a_batch_has_the_moments_of_weight_and_bias() {
        let (norm, _, params, mut buffers) = layer(2);
        let x: Vec<f64> = gradcheck::probe(4000, 1).iter().map(|x| 50.0 + 3.0 * x).collect();
        let (mean, var) = rows::moments(&train(&norm, &params, &mut buffers, &x), 2);
        for j in 0..2 {
            assert!((mean[j] - params[norm.bias.start + j]).abs() < 1e-12);
            assert!((var[j].sqrt() - params[norm.weight.start + j].abs()).abs() < 1e-4);
        }
    }

    #[test]
    fn running_statistics_converge_to_those_of_the_data() {
        let (norm, _, params, mut buffers) = layer(1);
        let x = [1.0, 2.0, 6.0];
        for _ in 0..300 {
            train(&norm, &params, &mut buffers, &x);
        }
        let inferred = infer(&norm, &params, &buffers, &x);
        assert!((buffers[norm.running_mean.start] - 3.0).abs() < 1e-9);
        assert!((buffers[norm.running_var.start] - 7.0).abs() < 1e-9);
        let (factor, summand) = norm.folded(&params, &buffers);
        for (x, y) in x.iter().zip(&inferred) {
            assert!((x * factor[0] + summand[0] - y).abs() < 1e-12);
        }
    }

    #[test]
    fn one_row_leaves_the_running_statistics_alone() {
        let (norm, _, params, buffers) = layer(3);
        let (x, mut moved) = ([1.0, 2.0, 3.0], buffers.clone());
        let trained = train(&norm, &params, &mut moved, &x);
        let inferred = infer(&norm, &params, &buffers, &x);
        assert_eq!((moved, trained), (buffers, inferred));
    }

    #[test]
    #[should_panic(expected = "ragged rows of 3: 7")]
    fn ragged_rows_are_refused() {
        let (norm, _, params, buffers) = layer(3);
        let pass = Inference { params: &params, buffers: &buffers, arena: &Arena::default() };
        norm.forward(&pass, &(), Operand::PerNode { x: &[0.0; 7], c: 3 });
    }
}
