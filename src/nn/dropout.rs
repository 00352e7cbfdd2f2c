//! Dropout (Srivastava et al. 2014): in training each element is zero with probability `p`, the others
//! are divided by `1 - p`, so that inference needs no change.

use crate::rng::Stream;
use crate::scalar::Scalar;

/// Dropout with a probability per element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dropout {
    /// Probability that an element becomes zero, in `[0, 1)`.
    pub p: f64,
}

impl Dropout {
    /// Drops elements of `x: [n, c]` in place and keeps the factors in `mask`.
    ///
    /// Row `i` draws from `streams[i]`, so a shape's mask does not depend on its batch. `None` is the
    /// identity, as is `p = 0`.
    pub fn forward_train<T: Scalar>(
        &self,
        streams: Option<&mut [Stream]>,
        x: &mut [T],
        mask: &mut Vec<T>,
    ) {
        mask.clear();
        mask.resize(x.len(), T::ONE);
        if let Some(streams) = streams.filter(|s| self.p > 0.0 && !s.is_empty()) {
            let keep = T::from_f64(1.0 / (1.0 - self.p));
            let c = x.len() / streams.len();
            for (row, stream) in mask.chunks_exact_mut(c).zip(streams) {
                for m in row {
                    *m = if stream.chance(self.p) { T::ZERO } else { keep };
                }
            }
            self.backward(mask, x);
        }
    }

    /// Turns `dy` into `dx = mask · dy`.
    pub fn backward<T: Scalar>(&self, mask: &[T], d: &mut [T]) {
        for (d, &m) in d.iter_mut().zip(mask) {
            *d *= m;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradcheck::{self, Settings};
    use crate::rng::Purpose;

    fn streams(n: u64) -> Vec<Stream> {
        (0..n).map(|i| Stream::new(3, 0, i, Purpose::Dropout)).collect()
    }

    #[test]
    fn keeps_the_mean_and_drops_the_stated_share() {
        let dropout = Dropout { p: 0.3 };
        let (mut x, mut mask) = (vec![1.0f64; 20_000], Vec::new());
        dropout.forward_train(Some(&mut streams(2)), &mut x, &mut mask);
        let zero = x.iter().filter(|x| **x == 0.0).count() as f64 / 20_000.0;
        let mean = x.iter().sum::<f64>() / 20_000.0;
        assert!((zero - 0.3).abs() < 0.01 && (mean - 1.0).abs() < 0.02, "{zero} {mean}");
    }

    #[test]
    fn mask_of_a_row_is_its_own() {
        let dropout = Dropout { p: 0.5 };
        let (mut both, mut second, mut mask) = (vec![1.0f32; 64], vec![1.0f32; 32], Vec::new());
        dropout.forward_train(Some(&mut streams(2)), &mut both, &mut mask);
        dropout.forward_train(Some(&mut streams(2)[1..]), &mut second, &mut mask);
        assert_eq!(both[32..], second);
        assert_ne!(both[..32], both[32..]);
    }

    #[test]
    fn gradient_is_right_with_the_mask_held() {
        let dropout = Dropout { p: 0.4 };
        let run = |x: &[f64]| {
            let (mut y, mut mask) = (x.to_vec(), Vec::new());
            dropout.forward_train(Some(&mut streams(4)), &mut y, &mut mask);
            (y, mask)
        };
        let backward = |v: &[Vec<f64>], dy: &[f64]| {
            let mut d = dy.to_vec();
            dropout.backward(&run(&v[0]).1, &mut d);
            vec![d]
        };
        let x = gradcheck::probe(40, 1);
        gradcheck::layer(&[("x", &x)], |v| run(&v[0]).0, backward, &Settings::default())
            .require(1e-7)
            .unwrap();
    }
}
