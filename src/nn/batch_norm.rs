//! Batch normalisation (Ioffe and Szegedy 2015) over all rows of a batch.

mod columns;

use super::params::{Init, Layout};
use super::rows;
use crate::scalar::Scalar;
use columns::cast;
pub(super) use columns::{Columns, Finish};
use std::ops::Range;

/// Added to the variance.
pub const EPS: f64 = 1e-5;
/// Share of the batch in a running statistic.
pub const MOMENTUM: f64 = 0.1;

/// Batches of at most this many rows are normalised in f64: there `x` determines the statistics so
/// nearly that the gradient is what rounding leaves of a cancellation (for two rows, a share of
/// `ε / (var + ε)`).
const FEW_ROWS: usize = 32;

/// `y = (x - mean) / √(var + ε) · weight + bias`, per column of `[n, c]`.
///
/// In training `mean` and `var` are those of the batch (`var` biased); the running statistics move a
/// tenth of the way to them (`var` unbiased there). A batch of a single row has no variance: training
/// then normalises with the running statistics, as inference does, and leaves them alone.
#[derive(Debug, Clone)]
pub struct BatchNorm {
    /// Columns.
    pub c: usize,
    weight: Range<usize>,
    bias: Range<usize>,
    running_mean: Range<usize>,
    running_var: Range<usize>,
    n_batches: Range<usize>,
}

/// What [`BatchNorm::forward_train`] keeps for backward: `c` numbers each.
#[derive(Debug, Clone, Default)]
pub struct Cache {
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

    /// Normalises `x: [n, c]` in place with the running statistics.
    pub fn forward<T: Scalar>(&self, params: &[T], buffers: &[T], x: &mut [T]) {
        self.inference(params, buffers).apply_in_place(Finish::Nothing, x);
    }

    /// What inference does to rows.
    pub(super) fn inference<T: Scalar>(&self, params: &[T], buffers: &[T]) -> Columns<T> {
        self.columns(params, &self.running(buffers))
    }

    /// Normalises `x: [n, c]` into `y` with the statistics of `x`, and moves the running ones.
    pub fn forward_train<T: Scalar>(
        &self,
        params: &[T],
        buffers: &mut [T],
        x: &[T],
        y: &mut Vec<T>,
        cache: &mut Cache,
    ) {
        *cache = self.measure(buffers, x);
        self.normalise(params, x, cache, Finish::Nothing, y);
    }

    /// Statistics of `x`, towards which the running ones move; of a single row, the running ones.
    pub(super) fn measure<T: Scalar>(&self, buffers: &mut [T], x: &[T]) -> Cache {
        if x.len() > self.c { self.measure_batch(buffers, x) } else { self.running(buffers) }
    }

    /// Normalises `x: [n, c]` into `y` with the statistics in `cache`.
    pub(super) fn normalise<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        cache: &Cache,
        finish: Finish<T>,
        y: &mut Vec<T>,
    ) {
        match x.len() / self.c {
            0..=FEW_ROWS => self.columns::<T, f64>(params, cache).apply_to(x, finish, y),
            _ => self.columns::<T, T>(params, cache).apply_to(x, finish, y),
        }
    }

    /// [`BatchNorm::normalise`] with the statistics in `cache`, in place.
    pub(super) fn normalise_in_place<T: Scalar>(
        &self,
        params: &[T],
        cache: &Cache,
        finish: Finish<T>,
        x: &mut [T],
    ) {
        match x.len() / self.c {
            0..=FEW_ROWS => self.columns::<T, f64>(params, cache).apply_in_place(finish, x),
            _ => self.columns::<T, T>(params, cache).apply_in_place(finish, x),
        }
    }

    /// Turns `dy` into `dx`; `grads` of weight and bias accumulate.
    ///
    /// With `x̂ = (x - mean) · inv_std`: `dbias = Σ dy`, `dweight = Σ dy x̂`, and
    /// `dx = weight · inv_std · (dy - dbias / n - x̂ dweight / n)`; the two means vanish when the
    /// statistics did not come from the batch.
    pub fn backward<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        cache: &Cache,
        d: &mut [T],
        grads: &mut [T],
    ) {
        self.backward_over::<T, false, false>(params, cache, (x, d), grads);
    }

    /// [`BatchNorm::backward`] where a ReLU follows: `dy` passes where the output, computed again from
    /// `x`, is positive.
    pub(super) fn backward_relu<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        cache: &Cache,
        d: &mut [T],
        grads: &mut [T],
    ) {
        self.backward_over::<T, true, false>(params, cache, (x, d), grads);
    }

    /// [`BatchNorm::backward`], or that of a ReLU after it, which turns `x` into `dx`.
    pub(super) fn backward_over_input<T: Scalar>(
        &self,
        params: &[T],
        x: &mut [T],
        cache: &Cache,
        d: &[T],
        relu: bool,
        grads: &mut [T],
    ) {
        match relu {
            true => self.backward_over::<T, true, true>(params, cache, (d, x), grads),
            false => self.backward_over::<T, false, true>(params, cache, (d, x), grads),
        }
    }

    /// `over` holds `x` if `INPUT`, else `dy`, and becomes `dx`; `read` is the other one.
    fn backward_over<T: Scalar, const RELU: bool, const INPUT: bool>(
        &self,
        params: &[T],
        cache: &Cache,
        (read, over): (&[T], &mut [T]),
        grads: &mut [T],
    ) {
        match read.len() / self.c {
            0..=FEW_ROWS => {
                self.backward_as::<T, f64, RELU, INPUT>(params, cache, (read, over), grads);
            }
            _ => self.backward_as::<T, T, RELU, INPUT>(params, cache, (read, over), grads),
        }
    }

    fn backward_as<T: Scalar, W: Scalar, const RELU: bool, const INPUT: bool>(
        &self,
        params: &[T],
        cache: &Cache,
        (read, over): (&[T], &mut [T]),
        grads: &mut [T],
    ) {
        let (c, n_rows) = (self.c, read.len() / self.c);
        let columns = self.columns::<T, W>(params, cache);
        let inv_std: Vec<W> = cache.inv_std.iter().copied().map(cast).collect();
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
        let share = if cache.from_batch { 1.0 / n_rows as f64 } else { 0.0 };
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
        cache: &Cache,
        y: &mut [T],
    ) {
        match x.len() / self.c {
            0..=FEW_ROWS => self.columns::<T, f64>(params, cache).add_to_and_rectify(x, y),
            _ => self.columns::<T, T>(params, cache).add_to_and_rectify(x, y),
        }
    }

    /// Leaves of `d`, the gradient of `max(norm(x) + other, 0)`, what passes the ReLU.
    pub(super) fn pass_relu_of_sum<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        cache: &Cache,
        other: &[T],
        d: &mut [T],
    ) {
        match x.len() / self.c {
            0..=FEW_ROWS => self.columns::<T, f64>(params, cache).pass_relu_of_sum(x, other, d),
            _ => self.columns::<T, T>(params, cache).pass_relu_of_sum(x, other, d),
        }
    }

    /// Factor and summand per column that inference applies: `y = x · factor + summand`.
    pub fn folded<T: Scalar>(&self, params: &[T], buffers: &[T]) -> (Vec<T>, Vec<T>) {
        let Columns { mean, factor, bias } = self.inference(params, buffers);
        let summand = |j: usize| bias[j] - mean[j] * factor[j];
        let summands = (0..self.c).map(summand).collect();
        (factor, summands)
    }

    /// What backward needs after [`BatchNorm::forward`]: the running statistics, taken as constants.
    pub fn running<T: Scalar>(&self, buffers: &[T]) -> Cache {
        let (mean, var) = (&buffers[self.running_mean.clone()], &buffers[self.running_var.clone()]);
        Cache {
            mean: mean.iter().map(|m| m.to_f64()).collect(),
            inv_std: var.iter().map(|v| inv_std(v.to_f64())).collect(),
            from_batch: false,
        }
    }

    fn measure_batch<T: Scalar>(&self, buffers: &mut [T], x: &[T]) -> Cache {
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
        Cache { mean, inv_std, from_batch: true }
    }

    fn columns<T: Scalar, W: Scalar>(&self, params: &[T], cache: &Cache) -> Columns<W> {
        let weight = &params[self.weight.clone()];
        let factor = |(&w, &s): (&T, &f64)| cast::<T, W>(w) * W::from_f64(s);
        Columns {
            mean: cache.mean.iter().copied().map(cast).collect(),
            factor: weight.iter().zip(&cache.inv_std).map(factor).collect(),
            bias: params[self.bias.clone()].iter().copied().map(cast).collect(),
        }
    }
}

fn inv_std(variance: f64) -> f64 {
    1.0 / (variance + EPS).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradcheck::{self, Settings};

    fn layer(c: usize) -> (BatchNorm, Vec<f64>, Vec<f64>) {
        let mut layout = Layout::default();
        let norm = BatchNorm::new(&mut layout, "bn", c);
        let params = gradcheck::probe(layout.n_params(), 5);
        let buffers = gradcheck::probe(layout.n_buffers(), 6).iter().map(|b| b.abs()).collect();
        (norm, params, buffers)
    }

    #[test]
    fn training_gradients_are_right_for_one_and_many_rows() {
        let c = 3;
        let (norm, params, buffers) = layer(c);
        for n in [1, 2, 7, 1500] {
            let x = gradcheck::probe(n * c, 7);
            let forward = |x: &[f64], params: &[f64]| {
                let (mut y, mut cache) = (Vec::new(), Cache::default());
                norm.forward_train(params, &mut buffers.clone(), x, &mut y, &mut cache);
                (y, cache)
            };
            let backward = |v: &[Vec<f64>], dy: &[f64]| {
                let (mut d, mut grads) = (dy.to_vec(), vec![0.0; params.len()]);
                norm.backward(&v[1], &v[0], &forward(&v[0], &v[1]).1, &mut d, &mut grads);
                vec![d, grads]
            };
            let settings = Settings { max_elements: 60, ..Settings::default() };
            let inputs: [(&str, &[f64]); 2] = [("x", &x), ("params", &params)];
            gradcheck::layer(&inputs, |v| forward(&v[0], &v[1]).0, backward, &settings)
                .require(1e-7)
                .unwrap();
        }
    }

    /// In f32 arithmetic the cancellation leaves errors of a few per cent here.
    #[test]
    fn gradients_of_two_rows_survive_cancellation_in_f32() {
        let c = 64;
        let (norm, params, buffers) = layer(c);
        let single = |values: &[f64]| values.iter().map(|&v| v as f32).collect::<Vec<f32>>();
        let (x, dy) = (single(&gradcheck::probe(2 * c, 7)), single(&gradcheck::probe(2 * c, 8)));
        fn dx<T: Scalar>(norm: &BatchNorm, [params, buffers, x, dy]: [Vec<T>; 4]) -> Vec<f64> {
            let (mut y, mut cache, mut buffers) = (Vec::new(), Cache::default(), buffers);
            norm.forward_train(&params, &mut buffers, &x, &mut y, &mut cache);
            let (mut d, mut grads) = (dy, vec![T::ZERO; params.len()]);
            norm.backward(&params, &x, &cache, &mut d, &mut grads);
            d.iter().map(|d| d.to_f64()).collect()
        }
        let singles = [single(&params), single(&buffers), x, dy];
        let doubles = singles.clone().map(|v| v.iter().map(|&v| f64::from(v)).collect());
        let (a, b) = (dx(&norm, singles), dx(&norm, doubles));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-6 * b.abs()));
    }

    #[test]
    fn output_of_a_batch_has_the_moments_of_weight_and_bias() {
        let (norm, params, mut buffers) = layer(2);
        let x: Vec<f64> = gradcheck::probe(4000, 1).iter().map(|x| 50.0 + 3.0 * x).collect();
        let mut y = Vec::new();
        norm.forward_train(&params, &mut buffers, &x, &mut y, &mut Cache::default());
        let (mean, var) = rows::moments(&y, 2);
        for j in 0..2 {
            assert!((mean[j] - params[norm.bias.start + j]).abs() < 1e-12);
            assert!((var[j].sqrt() - params[norm.weight.start + j].abs()).abs() < 1e-4);
        }
    }

    #[test]
    fn running_statistics_converge_to_those_of_the_data() {
        let (norm, params, mut buffers) = layer(1);
        let x = [1.0, 2.0, 6.0];
        let (mut trained, mut inferred, mut cache) = (Vec::new(), x, Cache::default());
        for _ in 0..300 {
            norm.forward_train(&params, &mut buffers, &x, &mut trained, &mut cache);
        }
        norm.forward(&params, &buffers, &mut inferred);
        assert!((buffers[norm.running_mean.start] - 3.0).abs() < 1e-9);
        assert!((buffers[norm.running_var.start] - 7.0).abs() < 1e-9);
        let (factor, summand) = norm.folded(&params, &buffers);
        for (x, y) in x.iter().zip(&inferred) {
            assert!((x * factor[0] + summand[0] - y).abs() < 1e-12);
        }
    }

    #[test]
    fn one_row_leaves_the_running_statistics_alone() {
        let (norm, params, buffers) = layer(3);
        let x = [1.0, 2.0, 3.0];
        let (mut moved, mut trained, mut inferred) = (buffers.clone(), Vec::new(), x.to_vec());
        norm.forward_train(&params, &mut moved, &x, &mut trained, &mut Cache::default());
        norm.forward(&params, &buffers, &mut inferred);
        assert_eq!((moved, trained), (buffers, inferred));
    }
}
