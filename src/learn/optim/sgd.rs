//! Stochastic gradient descent with momentum.

use crate::exec::par;
use crate::numeric::scalar::Scalar;
use crate::simd::Isa;
use crate::simd::elementwise::{SgdStep, sgd_step};
use serde::{Deserialize, Serialize};

/// Elements per task.
const BLOCK: usize = 1 << 17;

/// SGD with momentum and weight decay, no Nesterov term, no dampening: PyTorch's `SGD`.
///
/// ```
/// use deepmill::optim::Sgd;
/// let (mut grads, mut velocity, mut params) = ([0.5], [0.0], [1.0]);
/// Sgd::new(0.9, 0.0).step(0.1, &mut grads, &mut velocity, &mut params);
/// assert_eq!((params, velocity, grads), ([0.95], [0.5], [0.0]));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Sgd {
    /// Share of the velocity that is kept, in `[0, 1)`.
    pub momentum: f64,
    /// Added to the gradient per unit of parameter, on every parameter.
    pub weight_decay: f64,
}

setters!(Sgd {
    with_momentum(momentum: f64),
    with_weight_decay(weight_decay: f64),
});

impl Sgd {
    /// With this momentum and weight decay.
    pub fn new(momentum: f64, weight_decay: f64) -> Self {
        Sgd { momentum, weight_decay }
    }

    /// `v ← momentum·v + (g + weight_decay·p)`, then `p ← p − lr·v`; a velocity of zeros starts it. The
    /// gradients are zeros afterward, ready to be added to: one way through memory instead of two.
    ///
    /// # Panics
    /// If the three vectors differ in length, the rate or the weight decay is negative or not finite, or the momentum
    /// is not in `[0, 1)`.
    pub fn step<T: Scalar>(&self, lr: f64, grads: &mut [T], velocity: &mut [T], params: &mut [T]) {
        assert!(grads.len() == params.len() && velocity.len() == params.len());
        for (name, number) in [("rate", lr), ("weight decay", self.weight_decay)] {
            assert!(number >= 0.0 && number.is_finite(), "the {name} is {number}");
        }
        assert!((0.0..1.0).contains(&self.momentum), "the momentum is {}", self.momentum);
        let [lr, momentum, decay] = [lr, self.momentum, self.weight_decay].map(T::from_f64);
        par::for_each_block3(grads, velocity, params, BLOCK, |grads, velocity, params| {
            sgd_step(Isa::active(), SgdStep { lr, momentum, decay, grads, velocity, params });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_steps_by_hand() {
        let sgd = Sgd { momentum: 0.5, weight_decay: 0.1 };
        let (mut p, mut v) = ([2.0f64], [0.0]);
        let mut g = [1.0];
        sgd.step(0.5, &mut g, &mut v, &mut p);
        assert_eq!(g, [0.0]);
        // v = 1 + 0.1·2 = 1.2, p = 2 − 0.6
        assert_eq!((v[0], p[0]), (1.2, 1.4));
        sgd.step(0.5, &mut g, &mut v, &mut p);
        // v = 0.6 + 0.14, p = 1.4 − 0.37
        assert!((v[0] - 0.74).abs() < 1e-15 && (p[0] - 1.03).abs() < 1e-15);
        sgd.step(0.0, &mut [5.0], &mut v, &mut p);
        assert!((v[0] - 5.473).abs() < 1e-15 && (p[0] - 1.03).abs() < 1e-15);
    }

    /// Steps of numbers so small that products of them are subnormal.
    #[cfg(target_arch = "x86_64")]
    fn tiny_steps(grads: &[f32]) -> Vec<u32> {
        let (mut params, mut velocity) = (vec![1e-38f32; grads.len()], vec![3e-39f32; grads.len()]);
        let sgd = Sgd { momentum: 0.9, weight_decay: 0.1 };
        for _ in 0..3 {
            sgd.step(0.01, &mut grads.to_vec(), &mut velocity, &mut params);
        }
        params.iter().chain(&velocity).map(|x| x.to_bits()).collect()
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn steps_do_not_depend_on_the_callers_flush_to_zero() {
        use crate::simd::float_state::flushing;
        let grads: Vec<f32> = (0..50_000).map(|i| (i % 97) as f32 * 1e-38).collect();
        let steps = || tiny_steps(&grads);
        let expected = steps();
        assert!(expected.iter().any(|bits| (1..0x80_0000).contains(bits)), "some are subnormal");
        for n_threads in [1, 2, 3] {
            // The threads are made within, and take over the caller's state.
            let found = flushing(|| par::with_threads(n_threads, steps).unwrap());
            assert!(found == expected, "{n_threads} threads");
        }
        assert!(flushing(steps) == expected);
    }
}
