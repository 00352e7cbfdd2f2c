//! The rectifier `y = max(x, 0)`.

use super::arena::Buffer;
use super::layer::Layer;
use super::operand::{Operand, OperandGradient};
use super::pass::{Backward, Inference, Training};
use super::rows::{combine, rectify};
use crate::numeric::scalar::Scalar;
use crate::simd::elementwise::Combination;
use std::ops::Range;

/// `y = max(x, 0)`, element by element. The derivative at 0 is 0.
///
/// ```
/// use deepmill::nn::{arena::Arena, layer::Layer, operand::Operand, pass::Inference, relu::Relu};
///
/// let arena = Arena::default();
/// let y = Relu.forward(&Inference::new(&[], &[], &arena), &(), Operand::new(&[-2.0, 0.0, 3.0], 3));
/// assert_eq!(y[..], [0.0, 0.0, 3.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Relu;

/// Turns `dy` into `dx`: the gradient passes where `y`, input or output of the ReLU, is positive.
pub(super) fn pass_gradient<T: Scalar>(y: &[T], d: &mut [T]) {
    combine(Combination::PassRelu, d, y);
}

impl<T: Scalar> Layer<T> for Relu {
    type Geometry = ();
    type Saved = ();

    fn param_ranges(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    fn forward(&self, pass: &Inference<T>, (): &(), x: Operand<T>) -> Buffer<T> {
        let mut y = x.copied(pass.arena);
        rectify(&mut y);
        y
    }

    fn forward_train(&self, pass: &mut Training<T>, (): &(), x: Operand<T>) -> (Buffer<T>, ()) {
        (self.forward(&pass.inference(), &(), x), ())
    }

    fn backward(
        &self,
        pass: &mut Backward<T>,
        (): &(),
        x: Operand<T>,
        (): (),
        mut dy: Buffer<T>,
    ) -> OperandGradient<T> {
        pass_gradient(&x.to_matrix(pass.arena), &mut dy);
        OperandGradient::of_matrix(pass.arena, x, dy)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{forward, gradients, require_gradients};
    use super::*;
    use crate::conformance::gradcheck;
    use crate::nn::params::Layout;

    #[test]
    fn gradient_is_right_away_from_zero() {
        let x: Vec<f64> = gradcheck::probe(200, 1).iter().map(|x| x + x.signum() * 0.1).collect();
        require_gradients(&Relu, (&Layout::default(), &[]), &(), Operand::new(&x, 4));
    }

    #[test]
    fn gradient_at_zero_is_zero() {
        let x = Operand::new(&[0.0f32, -0.0, 1.0], 1);
        assert_eq!(forward(&Relu, &[], &(), x), [0.0, 0.0, 1.0]);
        assert_eq!(gradients(&Relu, &[], &(), x, &[1.0; 3]).0, [0.0, 0.0, 1.0]);
    }
}
