//! Group normalization (Wu and He 2018) of each shape of a batch by itself.

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
    BackwardApply, BackwardRows, BackwardSums, Columns, backward_apply, backward_sums,
};
use std::ops::Range;

/// Added to the variance.
pub(crate) const EPS: f64 = 1e-5;

/// `y = (x - mean) / √(var + ε) · weight + bias`, mean and biased variance over all nodes of a shape
/// and all channels of a group.
///
/// Mean and variance of a shape are those of its own rows, whatever its batch holds.
///
/// ```
/// use deepmill::nn::{arena::Arena, group_norm::GroupNorm, layer::Layer, operand::Operand};
/// use deepmill::nn::{params::Layout, pass::Inference};
///
/// let mut layout = Layout::default();
/// let norm = GroupNorm::new(&mut layout, "gn", 2, 1); // both columns in one group
/// let (params, arena) = (layout.init_params::<f64>(0), Arena::default());
/// let x = [1.0, 3.0, 5.0, 7.0, 101.0, 103.0, 105.0, 107.0]; // two shapes of two nodes
/// let y = norm.forward(&Inference::new(&params, &[], &arena), &[0..2, 2..4], Operand::new(&x, 2));
/// assert_eq!(y[..4], y[4..]); // the second shape is the first, moved by 100
/// assert!(y[..4].iter().sum::<f64>().abs() < 1e-12);
/// assert!((y[3] - 3.0 / 5.0_f64.sqrt()).abs() < 1e-5); // 7 is 3 above the mean, the variance is 5
/// ```
#[derive(Debug, Clone)]
pub struct GroupNorm {
    c: usize,
    /// Of consecutive columns, all of the same size.
    n_groups: usize,
    weight: Range<usize>,
    bias: Range<usize>,
}

/// Mean and 1/deviation per shape and group.
#[derive(Debug, Clone, Default)]
pub struct GroupStatistics {
    mean: Vec<f64>,
    inv_std: Vec<f64>,
}

impl GroupNorm {
    /// Appends `{name}.weight` and `{name}.bias`.
    ///
    /// # Panics
    /// If `n_groups` does not divide `c`.
    pub fn new(layout: &mut Layout, name: &str, c: usize, n_groups: usize) -> Self {
        assert!(n_groups > 0 && c.is_multiple_of(n_groups), "{n_groups} groups of {c} channels");
        let weight = layout.param(format!("{name}.weight"), &[c], Init::Constant(1.0));
        let bias = layout.param(format!("{name}.bias"), &[c], Init::Constant(0.0));
        GroupNorm { c, n_groups, weight, bias }
    }

    /// Normalizes `x: [n, c]` into `y`, in training and inference alike.
    fn normalize<T: Scalar>(
        &self,
        params: &[T],
        shapes: &[Range<usize>],
        x: &[T],
        y: &mut [T],
    ) -> GroupStatistics {
        let weight = &params[self.weight.clone()];
        let mut statistics = GroupStatistics::default();
        for shape in shapes {
            let rows = shape.start * self.c..shape.end * self.c;
            let (mean, inv_std) = self.measure(&x[rows.clone()]);
            let norm = ColumnNorm {
                mean: self.per_column(&mean),
                factor: weight.iter().zip(self.per_column(&inv_std)).map(|(&w, s)| w * s).collect(),
                bias: params[self.bias.clone()].to_vec(),
            };
            norm.apply(Some(&x[rows.clone()]), Activation::Identity, &mut y[rows]);
            statistics.mean.extend(mean);
            statistics.inv_std.extend(inv_std);
        }
        statistics
    }

    /// The number of its group for each column.
    fn per_column<T: Scalar>(&self, of_groups: &[f64]) -> Vec<T> {
        (0..self.c).map(|j| T::from_f64(of_groups[self.group(j)])).collect()
    }

    /// Turns `dy` into `dx`; `grads` of weight and bias accumulate.
    ///
    /// With `d̂ = dy · weight` and means over the shape's nodes and the group's channels:
    /// `dx = inv_std · (d̂ - mean(d̂) - x̂ mean(d̂ x̂))`.
    fn gradients<T: Scalar>(
        &self,
        pass: &mut Backward<T>,
        shapes: &[Range<usize>],
        x: &[T],
        statistics: &GroupStatistics,
        d: &mut [T],
    ) {
        let (c, weight) = (self.c, pass.params[self.weight.clone()].to_vec());
        for (s, shape) in shapes.iter().enumerate().filter(|(_, shape)| !shape.is_empty()) {
            let stats = s * self.n_groups..(s + 1) * self.n_groups;
            let mean: Vec<T> = self.per_column(&statistics.mean[stats.clone()]);
            let inv_std: Vec<T> = self.per_column(&statistics.inv_std[stats]);
            let zeros = vec![T::ZERO; c];
            let columns = Columns { mean: &mean, factor: &inv_std, bias: &zeros };
            let how = BackwardRows { columns, inv_std: &inv_std, relu: false };
            let block = shape.start * c..shape.end * c;
            let (x, d) = (&x[block.clone()], &mut d[block]);
            let [dweight, dbias] = rows::column_sums(0..shape.len(), c, |block, sums| {
                let block = block.start * c..block.end * c;
                let (x, dy) = (&x[block.clone()], &d[block]);
                backward_sums(Isa::active(), BackwardSums { rows: how, x, dy, sums });
            });
            let n = (shape.len() * c / self.n_groups) as f64;
            let mean_of = |sums: &[f64]| {
                let mut means = vec![0.0; self.n_groups];
                (0..c).for_each(|j| means[self.group(j)] += weight[j].to_f64() * sums[j] / n);
                self.per_column::<T>(&means)
            };
            let means = [mean_of(&dweight), mean_of(&dbias)];
            for (range, sums) in [(&self.weight, dweight), (&self.bias, dbias)] {
                let grads = pass.grads(range).iter_mut();
                grads.zip(sums).for_each(|(d, sum)| *d += T::from_f64(sum));
            }
            // d̂ = dy · weight, then the same formula as in a batch norm.
            let (mean, factor, bias) = (zeros.clone(), weight.to_vec(), zeros.clone());
            ColumnNorm { mean, factor, bias }.apply(None, Activation::Identity, d);
            let len = rows::BLOCK_ROWS * c;
            par::for_each_block(d, len, |i, over| {
                let means = means.each_ref().map(|means| &means[..]);
                let read = &x[i * len..][..over.len()];
                let work = BackwardApply { rows: how, means, over_dy: true, read, over };
                backward_apply(Isa::active(), work);
            });
        }
    }

    fn group(&self, column: usize) -> usize {
        column / (self.c / self.n_groups)
    }

    /// Mean and 1/deviation of each group of one shape's rows; an empty shape has none to speak of.
    fn measure<T: Scalar>(&self, x: &[T]) -> (Vec<f64>, Vec<f64>) {
        if x.is_empty() {
            return (vec![0.0; self.n_groups], vec![1.0; self.n_groups]);
        }
        let (mean, var) = rows::moments(x, self.c);
        let size = self.c / self.n_groups;
        let average = |v: &[f64]| v.iter().sum::<f64>() / size as f64;
        let group = |(mean, var): (&[f64], &[f64])| {
            let center = average(mean);
            let between: Vec<f64> = mean.iter().map(|m| (m - center) * (m - center)).collect();
            (center, 1.0 / (average(var) + average(&between) + EPS).sqrt())
        };
        mean.chunks(size).zip(var.chunks(size)).map(group).unzip()
    }
}

impl<T: Scalar> Layer<T> for GroupNorm {
    /// Rows of each shape.
    type Geometry = [Range<usize>];
    type Saved = GroupStatistics;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        vec![self.weight.clone(), self.bias.clone()]
    }

    fn forward(&self, pass: &Inference<T>, shapes: &[Range<usize>], x: Operand<T>) -> Buffer<T> {
        assert_eq!(x.width(), self.c, "columns of the input and of the group norm differ");
        let x = x.to_matrix(pass.arena);
        let mut y = pass.arena.get(x.len());
        self.normalize(pass.params, shapes, &x, &mut y);
        y
    }

    fn forward_train(
        &self,
        pass: &mut Training<T>,
        shapes: &[Range<usize>],
        x: Operand<T>,
    ) -> (Buffer<T>, GroupStatistics) {
        assert_eq!(x.width(), self.c, "columns of the input and of the group norm differ");
        let x = x.to_matrix(pass.arena);
        let mut y = pass.arena.get(x.len());
        let statistics = self.normalize(pass.params, shapes, &x, &mut y);
        (y, statistics)
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        shapes: &[Range<usize>],
        x: Operand<T>,
        statistics: GroupStatistics,
        mut dy: Buffer<T>,
    ) -> OperandGradient<T> {
        let matrix = x.to_matrix(pass.arena);
        assert_eq!(dy.len(), matrix.len(), "rows of the gradient and of x differ");
        self.gradients(pass, shapes, &matrix, &statistics, &mut dy);
        OperandGradient::of_matrix(pass.arena, x, dy)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{forward, require_gradients};
    use super::*;
    use crate::conformance::gradcheck;

    #[test]
    fn gradients_are_right_for_every_grouping_and_shape_size() {
        let (c, shapes) = (6, [0..5, 5..6, 6..6, 6..13]);
        for n_groups in [1, 2, 6] {
            let mut layout = Layout::default();
            let norm = GroupNorm::new(&mut layout, "gn", c, n_groups);
            let params = gradcheck::probe(layout.n_params(), 5);
            let x = gradcheck::probe(13 * c, 7);
            // One node and one channel per group: x̂ is 0 whatever x is, curvature ~ 1/ε.
            require_gradients(&norm, (&layout, &params), &shapes[..], Operand::new(&x, c));
        }
    }

    #[test]
    fn every_group_of_every_shape_is_normalized() {
        let mut layout = Layout::default();
        let norm = GroupNorm::new(&mut layout, "gn", 4, 2);
        let params: Vec<f64> = layout.init_params(0);
        let x: Vec<f64> = gradcheck::probe(80, 3).iter().map(|x| 7.0 + 2.0 * x).collect();
        let y = forward(&norm, &params, &[0..8, 8..20][..], Operand::new(&x, 4));
        for rows in [0..8, 8..20] {
            for group in [0, 2] {
                let values: Vec<f64> =
                    rows.clone().flat_map(|r| [y[4 * r + group], y[4 * r + group + 1]]).collect();
                let n = values.len() as f64;
                let mean = values.iter().sum::<f64>() / n;
                let square = values.iter().map(|v| v * v).sum::<f64>() / n;
                assert!(mean.abs() < 1e-12 && (square - 1.0).abs() < 1e-4);
            }
        }
    }
}
