//! `y = max(x, 0)`, in place.

use super::rows::combine;
use crate::par;
use crate::scalar::{Scalar, vectorised};

const BLOCK: usize = 1 << 15;

/// Turns `x` into `max(x, 0)`.
pub fn forward<T: Scalar>(x: &mut [T]) {
    par::for_each_block(x, BLOCK, |_, block| {
        vectorised(
            #[inline(always)]
            || block.iter_mut().for_each(|x| *x = (*x).max(T::ZERO)),
        );
    });
}

/// Turns `dy` into `dx`: the gradient passes where the output `y` is positive.
pub fn backward<T: Scalar>(y: &[T], d: &mut [T]) {
    combine(d, y, |d, y| if y > T::ZERO { d } else { T::ZERO });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradcheck::{self, Settings};

    #[test]
    fn gradient_is_right_away_from_zero() {
        let x: Vec<f64> = gradcheck::probe(200, 1).iter().map(|x| x + x.signum() * 0.1).collect();
        let forward_copy = |x: &[f64]| {
            let mut y = x.to_vec();
            forward(&mut y);
            y
        };
        let check = |v: &[Vec<f64>], dy: &[f64]| {
            let mut d = dy.to_vec();
            backward(&forward_copy(&v[0]), &mut d);
            vec![d]
        };
        let report =
            gradcheck::layer(&[("x", &x)], |v| forward_copy(&v[0]), check, &Settings::default());
        report.require(1e-7).unwrap();
    }

    #[test]
    fn gradient_at_zero_is_zero() {
        let (mut y, mut d) = (vec![0.0f32, -0.0, 1.0], vec![1.0f32; 3]);
        forward(&mut y);
        backward(&y, &mut d);
        assert_eq!(d, [0.0, 0.0, 1.0]);
    }
}
