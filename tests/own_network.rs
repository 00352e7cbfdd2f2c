//! Operators and networks of one's own: nothing that is put after them vanishes.

use deepmill::gradcheck::{self, Case, GradcheckSettings};
use deepmill::nn::arena::{Arena, Buffer};
use deepmill::nn::batch_norm::BatchNorm;
use deepmill::nn::layer::Layer;
use deepmill::nn::linear::Linear;
use deepmill::nn::linear_norm_act::LinearNormAct;
use deepmill::nn::linear_operator::LinearOperator;
use deepmill::nn::operand::{Operand, OperandGradient};
use deepmill::nn::params::{Init, Layout};
use deepmill::nn::pass::{Backward, Context, Inference};
use deepmill::nn::saved::Policy;
use deepmill::scalar::Scalar;
use std::ops::Range;

/// `y[n, j] = factor[j] · x[n, j]`, as somebody outside the crate writes it: the map and its gradients, no epilogue.
#[derive(Debug, Clone)]
struct Scaling {
    c: usize,
    factor: Range<usize>,
}

fn scaled<T: Scalar>(factors: &[T], mut y: Buffer<T>) -> Buffer<T> {
    for row in y.chunks_exact_mut(factors.len()) {
        row.iter_mut().zip(factors).for_each(|(y, &factor)| *y *= factor);
    }
    y
}

impl LinearOperator for Scaling {
    type Geometry = ();

    fn c_in(&self) -> usize {
        self.c
    }

    fn c_out(&self) -> usize {
        self.c
    }

    fn tensor_ranges(&self) -> Vec<Range<usize>> {
        vec![self.factor.clone()]
    }

    fn map<T: Scalar>(&self, context: Context<T>, (): &(), x: Operand<T>) -> Buffer<T> {
        scaled(&context.params[self.factor.clone()], x.copied(context.arena))
    }

    fn weight_gradient<T: Scalar>(&self, pass: &mut Backward<T>, (): &(), x: Operand<T>, dy: &[T]) {
        let x = x.to_matrix(pass.arena);
        let grads = pass.grads(&self.factor);
        for (x, dy) in x.chunks_exact(self.c).zip(dy.chunks_exact(self.c)) {
            grads.iter_mut().zip(x).zip(dy).for_each(|((d, &x), &dy)| *d += x * dy);
        }
    }

    fn input_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        (): &(),
        x: Operand<T>,
        dy: &[T],
    ) -> OperandGradient<T> {
        let dx = scaled(&context.params[self.factor.clone()], context.arena.copy_of(dy));
        OperandGradient::of_matrix(context.arena, x, dx)
    }
}

/// A layer of the crate without its own way of treating blocks of rows.
#[derive(Debug, Clone)]
struct Plain(Linear);

impl LinearOperator for Plain {
    type Geometry = ();

    fn c_in(&self) -> usize {
        self.0.c_in()
    }

    fn c_out(&self) -> usize {
        self.0.c_out()
    }

    fn tensor_ranges(&self) -> Vec<Range<usize>> {
        self.0.tensor_ranges()
    }

    fn map<T: Scalar>(&self, context: Context<T>, (): &(), x: Operand<T>) -> Buffer<T> {
        self.0.map(context, &(), x)
    }

    fn weight_gradient<T: Scalar>(&self, pass: &mut Backward<T>, (): &(), x: Operand<T>, dy: &[T]) {
        self.0.weight_gradient(pass, &(), x, dy);
    }

    fn input_gradient<T: Scalar>(
        &self,
        context: Context<T>,
        (): &(),
        x: Operand<T>,
        dy: &[T],
    ) -> OperandGradient<T> {
        self.0.input_gradient(context, &(), x, dy)
    }
}

/// `operator`, normalized and rectified.
fn block<M>(layout: &mut Layout, linear: M, c: usize) -> LinearNormAct<M> {
    let norm = BatchNorm::new(layout, "norm", c);
    LinearNormAct { linear, norm, relu: true, policy: Policy::Save }
}

#[test]
fn norm_and_relu_follow_an_own_operator() {
    let mut layout = Layout::default();
    let factor = layout.param("factor", &[2], Init::Constant(1.0));
    let own = block(&mut layout, Scaling { c: 2, factor }, 2);
    let (mut params, mut buffers) = (layout.init_params::<f64>(1), layout.init_buffers::<f64>());
    // Factors 3 and -1, weights 2 and 1, biases 0.5 and 0; means 1 and 0, variances 4 and 1.
    params.copy_from_slice(&[3.0, -1.0, 2.0, 1.0, 0.5, 0.0]);
    buffers[..4].copy_from_slice(&[1.0, 0.0, 4.0, 1.0]);
    let arena = Arena::default();
    let pass = Inference::new(&params, &buffers, &arena);
    let y = own.forward(&pass, &(), Operand::new(&[1.0, 1.0, -1.0, -4.0], 2));
    // (3 - 1)/2·2 + 0.5 and max(-1, 0); max((-3 - 1)/2·2 + 0.5, 0) and 4.
    let expected = [2.5, 0.0, 0.0, 4.0];
    assert!(y.iter().zip(expected).all(|(y, e)| (y - e).abs() < 1e-4), "{y:?}");
}

#[test]
fn gradients_through_an_own_operator_are_right() {
    let mut layout = Layout::default();
    let factor = layout.param("factor", &[3], Init::Constant(1.0));
    let own = block(&mut layout, Scaling { c: 3, factor }, 3);
    let (params, x) = (gradcheck::probe(layout.n_params(), 1), gradcheck::probe(24, 2));
    let x = Operand::new(&x, 3);
    let case = Case::new(&layout, &params, &(), x);
    let settings = GradcheckSettings::default();
    gradcheck::layer(&own, &case, &settings).unwrap().require(1e-7).unwrap();
    gradcheck::layer(&own.linear, &case, &settings).unwrap().require(1e-7).unwrap();
}

#[test]
fn an_operator_that_treats_no_blocks_gives_the_bits_of_one_that_does() {
    let (c_in, c_out, n) = (5, 7, 3000);
    let mut layout = Layout::default();
    let linear = Linear::new(&mut layout, "linear", c_in, c_out, true);
    let fused = block(&mut layout, linear, c_out);
    let LinearNormAct { linear, norm, relu, policy } = fused.clone();
    let plain = LinearNormAct { linear: Plain(linear), norm, relu, policy };
    let params: Vec<f32> =
        gradcheck::probe(layout.n_params(), 1).iter().map(|x| *x as f32).collect();
    let buffers: Vec<f32> = layout.init_buffers();
    let x: Vec<f32> = gradcheck::probe(n * c_in, 2).iter().map(|x| *x as f32).collect();
    let arena = Arena::default();
    let pass = Inference::new(&params, &buffers, &arena);
    let x = Operand::new(&x, c_in);
    let (y, expected) = (plain.forward(&pass, &(), x), fused.forward(&pass, &(), x));
    assert_eq!(y[..], expected[..]);
    assert!(y.contains(&0.0) && y.iter().any(|y| *y > 0.0), "the ReLU is there");
}
