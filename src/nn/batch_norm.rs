//! Batch normalization (Ioffe and Szegedy 2015) over all rows of a batch.

use super::arena::Buffer;
use super::column_norm::{Activation, ColumnNorm, cast};
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::params::{Init, Layout};
use super::pass::{Backward, Inference, Training};
use super::rows;
use crate::scalar::Scalar;
use std::ops::Range;

/// Added to the variance.
pub const EPS: f64 = 1e-5;
/// Share of the batch in a running statistic.
pub const MOMENTUM: f64 = 0.1;

/// Batches of at most this many rows are normalized in f64: there `x` determines the statistics so
/// nearly that the gradient is what rounding leaves of a cancellation (for two rows, a share of
/// `ε / (var + ε)`).
const FEW_ROWS: usize = 32;

/// `y = (x - mean) / √(var + ε) · weight + bias`, per column of `[n, c]`.
///
/// In training `mean` and `var` are those of the batch (`var` biased); the running statistics move a
/// tenth of the way to them (`var` unbiased there). A batch of a single row has no variance: training
/// then normalizes with the running statistics, as inference does, and leaves them alone.
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

    /// Statistics of `x`, towards which the running ones move; of a single row, the running ones.
    pub(super) fn measure<T: Scalar>(&self, buffers: &mut [T], x: &[T]) -> Statistics {
        if x.len() > self.c { self.measure_batch(buffers, x) } else { self.running(buffers) }
    }

    /// Normalizes `x: [n, c]` into `y` with the statistics in `statistics`.
    pub(super) fn normalize<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        statistics: &Statistics,
        activation: Activation<T>,
        y: &mut [T],
    ) {
        match x.len() / self.c {
            0..=FEW_ROWS => self.columns::<T, f64>(params, statistics).apply_to(x, activation, y),
            _ => self.columns::<T, T>(params, statistics).apply_to(x, activation, y),
        }
    }

    /// [`BatchNorm::normalize`] with the statistics in `statistics`, in place.
    pub(super) fn normalize_in_place<T: Scalar>(
        &self,
        params: &[T],
        statistics: &Statistics,
        activation: Activation<T>,
        x: &mut [T],
    ) {
        match x.len() / self.c {
            0..=FEW_ROWS => {
                self.columns::<T, f64>(params, statistics).apply_in_place(activation, x)
            }
            _ => self.columns::<T, T>(params, statistics).apply_in_place(activation, x),
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
        let (params, over) = (pass.params, (dy, &mut x[..]));
        match relu {
            true => self.backward_over::<T, true, true>(params, statistics, over, pass.grads),
            false => self.backward_over::<T, false, true>(params, statistics, over, pass.grads),
        }
        x
    }

    /// With `x̂ = (x - mean) · inv_std`: `dbias = Σ dy`, `dweight = Σ dy x̂`, and
    /// `dx = weight · inv_std · (dy - dbias / n - x̂ dweight / n)`; the two means vanish when the
    /// statistics did not come from the batch.
    ///
    /// `over` holds `x` if `INPUT`, else `dy`, and becomes `dx`; `read` is the other one. With `RELU`, `dy` is that
    /// of `max(y, 0)` and passes where `y`, computed again from `x`, is positive.
    fn backward_over<T: Scalar, const RELU: bool, const INPUT: bool>(
        &self,
        params: &[T],
        statistics: &Statistics,
        (read, over): (&[T], &mut [T]),
        grads: &mut [T],
    ) {
        match read.len() / self.c {
            0..=FEW_ROWS => {
                self.backward_as::<T, f64, RELU, INPUT>(params, statistics, (read, over), grads);
            }
            _ => self.backward_as::<T, T, RELU, INPUT>(params, statistics, (read, over), grads),
        }
    }

    fn backward_as<T: Scalar, W: Scalar, const RELU: bool, const INPUT: bool>(
        &self,
        params: &[T],
        statistics: &Statistics,
        (read, over): (&[T], &mut [T]),
        grads: &mut [T],
    ) {
        let (c, n_rows) = (self.c, read.len() / self.c);
        let columns = self.columns::<T, W>(params, statistics);
        let inv_std: Vec<W> = statistics.inv_std.iter().copied().map(cast).collect();
        let (x, d): (&[T], &[T]) = if INPUT { (over, read) } else { (read, over) };
        let [dweight, dbias] = rows::column_sums(
            0..n_rows,
            c,
            #[inline(always)]
            |row, [dweight, dbias]| {
                let (x, dy) = (&x[row * c..][..c], &d[row * c..][..c]);
                let sums = inv_std.iter().zip(dweight.iter_mut().zip(dbias));
                for (((&x, &dy), column), (&inv_std, (dweight, dbias))) in
                    x.iter().zip(dy).zip(columns.iter()).zip(sums)
                {
                    let dy = if RELU && !column.is_positive(x) { T::ZERO } else { dy };
                    let x_hat = (cast::<T, W>(x) - column.mean) * inv_std;
                    *dweight += (x_hat * cast(dy)).to_f64();
                    *dbias += dy.to_f64();
                }
            },
        );
        let share = if statistics.from_batch { 1.0 / n_rows as f64 } else { 0.0 };
        let mean_of = |sums: &[f64]| sums.iter().map(|s| W::from_f64(s * share)).collect();
        let (mean_dweight, mean_dbias): (Vec<W>, Vec<W>) = (mean_of(&dweight), mean_of(&dbias));
        rows::for_each_row(
            over,
            c,
            #[inline(always)]
            |row, over| {
                let read = &read[row * c..][..c];
                let means = inv_std.iter().zip(&mean_dbias).zip(&mean_dweight);
                for (((over, &read), column), ((&inv_std, &dbias), &dweight)) in
                    over.iter_mut().zip(read).zip(columns.iter()).zip(means)
                {
                    let (x, dy) = if INPUT { (*over, read) } else { (read, *over) };
                    let dy = if RELU && !column.is_positive(x) { T::ZERO } else { dy };
                    let x_hat = (cast::<T, W>(x) - column.mean) * inv_std;
                    *over = cast(column.factor * (cast::<T, W>(dy) - dbias - x_hat * dweight));
                }
            },
        );
        for j in 0..c {
            grads[self.weight.start + j] += T::from_f64(dweight[j]);
            grads[self.bias.start + j] += T::from_f64(dbias[j]);
        }
    }

    /// Turns `y` into `max(norm(x) + y, 0)`.
    pub(super) fn add_to_and_rectify<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        statistics: &Statistics,
        y: &mut [T],
    ) {
        match x.len() / self.c {
            0..=FEW_ROWS => self.columns::<T, f64>(params, statistics).add_to_and_rectify(x, y),
            _ => self.columns::<T, T>(params, statistics).add_to_and_rectify(x, y),
        }
    }

    /// Leaves of `d`, the gradient of `max(norm(x) + other, 0)`, what passes the ReLU.
    pub(super) fn pass_relu_of_sum<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        statistics: &Statistics,
        other: &[T],
        d: &mut [T],
    ) {
        match x.len() / self.c {
            0..=FEW_ROWS => {
                self.columns::<T, f64>(params, statistics).pass_relu_of_sum(x, other, d)
            }
            _ => self.columns::<T, T>(params, statistics).pass_relu_of_sum(x, other, d),
        }
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
        let factor = |(&w, &s): (&T, &f64)| cast::<T, W>(w) * W::from_f64(s);
        ColumnNorm {
            mean: statistics.mean.iter().copied().map(cast).collect(),
            factor: weight.iter().zip(&statistics.inv_std).map(factor).collect(),
            bias: params[self.bias.clone()].iter().copied().map(cast).collect(),
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
        norm.apply_in_place(Activation::Identity, &mut y);
        y
    }

    /// Statistics of `x`, towards which the running ones move.
    fn forward_train(
        &self,
        pass: &mut Training<T>,
        (): &(),
        x: Operand<T>,
    ) -> (Buffer<T>, Statistics) {
        self.check(&x);
        let (x, mut y) = (x.to_matrix(pass.arena), pass.arena.get(x.n_rows() * self.c));
        let statistics = self.measure(pass.buffers, &x);
        self.normalize(pass.params, &x, &statistics, Activation::Identity, &mut y);
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
        let over = (&*matrix, &mut dy[..]);
        self.backward_over::<T, false, false>(pass.params, &statistics, over, pass.grads);
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
    use crate::gradcheck;

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
        let mut pass = Backward { params: &params, grads: &mut grads, arena };
        let over = norm.backward_over_input(&mut pass, arena.copy_of(&x), &statistics, &dy, false);
        let mut pass = Backward { params: &params, grads: &mut other, arena };
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
            let mut pass = Backward { params: &params, grads: &mut grads, arena };
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
