//! Linear map of every row: `y = x Wᵀ + b`.

use super::params::{Init, Layout};
use super::rows;
use crate::scalar::Scalar;
use std::ops::Range;

/// `y[n, c_out] = x[n, c_in] · Wᵀ + b` with `W: [c_out, c_in]`.
#[derive(Debug, Clone)]
pub struct Linear {
    /// Columns of `x`.
    pub c_in: usize,
    /// Columns of `y`.
    pub c_out: usize,
    pub(super) weight: Range<usize>,
    bias: Option<Range<usize>>,
}

impl Linear {
    /// Appends `{name}.weight` and, if wanted, `{name}.bias`; both start uniform in `±1/√c_in`.
    pub fn new(layout: &mut Layout, name: &str, c_in: usize, c_out: usize, bias: bool) -> Self {
        let init = Init::Uniform { bound: 1.0 / (c_in as f64).sqrt() };
        let weight = layout.param(format!("{name}.weight"), &[c_out, c_in], init);
        let bias = bias.then(|| layout.param(format!("{name}.bias"), &[c_out], init));
        Linear { c_in, c_out, weight, bias }
    }

    /// `y = x Wᵀ + b`.
    pub fn forward<T: Scalar>(&self, params: &[T], x: &[T], y: &mut Vec<T>) {
        self.forward_then(params, x, y, &rows::nothing);
    }

    /// [`Linear::forward`], and `then` on each block of rows.
    pub(super) fn forward_then<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        y: &mut Vec<T>,
        then: &rows::Then<T>,
    ) {
        let w = rows::transposed(&params[self.weight.clone()], self.c_out, self.c_in);
        let n = x.len() / self.c_in;
        let term = rows::Term::Product { x, w: w.into(), c_in: self.c_in };
        rows::linear(&[term], self.bias(params), (n, self.c_out), y, then);
    }

    pub(super) fn bias<'a, T>(&self, params: &'a [T]) -> Option<&'a [T]> {
        self.bias.as_ref().map(|bias| &params[bias.clone()])
    }

    /// `dW += dyᵀ x`, `db += Σ dy`; `dx = dy W` where wanted.
    pub fn backward<T: Scalar>(
        &self,
        params: &[T],
        x: &[T],
        dy: &[T],
        dx: Option<&mut Vec<T>>,
        grads: &mut [T],
    ) {
        if let Some(dx) = dx {
            dx.clear();
            dx.resize(x.len(), T::ZERO);
            self.add_dx(params, dy, dx);
        }
        let dw = &mut grads[self.weight.clone()];
        rows::add_transposed_product(dy, self.c_out, x, self.c_in, dw);
        self.add_bias_gradient(dy, grads);
    }

    pub(super) fn add_bias_gradient<T: Scalar>(&self, dy: &[T], grads: &mut [T]) {
        if let Some(bias) = &self.bias {
            let [db] = rows::column_sums(
                0..dy.len() / self.c_out,
                self.c_out,
                #[inline(always)]
                |row, [sum]| {
                    let dy = &dy[row * self.c_out..][..self.c_out];
                    sum.iter_mut().zip(dy).for_each(|(sum, dy)| *sum += dy.to_f64());
                },
            );
            let db: Vec<T> = db.into_iter().map(T::from_f64).collect();
            rows::add(&mut grads[bias.clone()], &db);
        }
    }

    /// `dx += dy W`: for an input that another branch has already sent a gradient to.
    pub fn add_dx<T: Scalar>(&self, params: &[T], dy: &[T], dx: &mut [T]) {
        rows::add_product(dy, &params[self.weight.clone()], self.c_out, self.c_in, dx);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradcheck::{self, Settings};

    #[test]
    fn gradients_are_right_and_the_map_is_adjoint_to_its_backward() {
        for (n, c_in, c_out, bias) in [(1, 1, 1, true), (3, 4, 2, true), (1030, 2, 3, false)] {
            let mut layout = Layout::default();
            let linear = Linear::new(&mut layout, "l", c_in, c_out, bias);
            let params: Vec<f64> = layout.init_params(1);
            let x = gradcheck::probe(n * c_in, 2);
            let forward = |x: &[f64], params: &[f64]| {
                let mut y = Vec::new();
                linear.forward(params, x, &mut y);
                y
            };
            let backward = |x: &[f64], params: &[f64], dy: &[f64]| {
                let (mut dx, mut grads) = (Vec::new(), vec![0.0; params.len()]);
                linear.backward(params, x, dy, Some(&mut dx), &mut grads);
                vec![dx, grads]
            };
            gradcheck::layer(
                &[("x", &x), ("params", &params)],
                |v| forward(&v[0], &v[1]),
                |v, dy| backward(&v[0], &v[1], dy),
                &Settings { max_elements: 50, ..Settings::default() },
            )
            .require(1e-7)
            .unwrap();
            if !bias {
                let error = gradcheck::adjoint(
                    n * c_in,
                    n * c_out,
                    |x| forward(x, &params),
                    |dy| backward(&x, &params, dy).swap_remove(0),
                );
                assert!(error < 1e-13, "{error}");
            }
        }
    }

    #[test]
    fn rows_do_not_influence_each_other() {
        let mut layout = Layout::default();
        let linear = Linear::new(&mut layout, "l", 3, 5, true);
        let params: Vec<f32> = layout.init_params(1);
        let x: Vec<f32> = gradcheck::probe(6, 2).iter().map(|&v| v as f32).collect();
        let (mut both, mut first) = (Vec::new(), Vec::new());
        linear.forward(&params, &x, &mut both);
        linear.forward(&params, &x[..3], &mut first);
        assert_eq!(both[..5], first);
    }
}
