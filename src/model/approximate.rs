//! Predictions compared within a tolerance, number by number.

use super::prediction::Prediction;
use crate::numeric::scalar::Scalar;
use approx::{AbsDiffEq, RelativeEq};

/// Shares, which are `f32`, have the tolerance of the logits.
impl<T: Scalar + AbsDiffEq<Epsilon = T>> AbsDiffEq for Prediction<T> {
    type Epsilon = T;

    fn default_epsilon() -> T {
        T::default_epsilon()
    }

    fn abs_diff_eq(&self, other: &Self, epsilon: T) -> bool {
        near(self, other, |a, b| a.abs_diff_eq(&b, epsilon))
    }
}

/// Shares, which are `f32`, have the tolerances of the logits.
impl<T: Scalar + RelativeEq<Epsilon = T>> RelativeEq for Prediction<T> {
    fn default_max_relative() -> T {
        T::default_max_relative()
    }

    fn relative_eq(&self, other: &Self, epsilon: T, max_relative: T) -> bool {
        near(self, other, |a, b| a.relative_eq(&b, epsilon, max_relative))
    }
}

fn near<T: Scalar>(a: &Prediction<T>, b: &Prediction<T>, are_near: impl Fn(T, T) -> bool) -> bool {
    let lists = |of: &Prediction<T>| {
        let numbers = |list: &[f32]| list.iter().map(|x| T::from_f64(f64::from(*x))).collect();
        [
            of.logits_inaccessible.as_flattened().to_vec(),
            of.logits_occlusion.as_flattened().to_vec(),
            numbers(&of.accessible_share),
            numbers(of.coarse_answers.as_flattened()),
        ]
    };
    let all_near = |(a, b): (Vec<T>, Vec<T>)| {
        a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| are_near(*a, *b))
    };
    lists(a).into_iter().zip(lists(b)).all(all_near)
}
