//! The adjoint test.

use super::probe;
use crate::{Error, Result};

/// The adjoint test of a linear map and its transpose, which needs no step at all.
///
/// For random `x` and `y` it returns `|⟨A x, y⟩ - ⟨x, Aᵀ y⟩|` relative to the greater of `|A x| |y|` and `|x| |Aᵀ y|`:
/// about 1e-16 for a right pair, about 1 for an unrelated one, infinite if either has a NaN.
///
/// # Errors
/// If a map returns another number of elements than `n_out` or `n_in`, or both return zeros alone: that proves nothing.
pub fn adjoint(
    n_in: usize,
    n_out: usize,
    forward: impl Fn(&[f64]) -> Vec<f64>,
    transposed: impl Fn(&[f64]) -> Vec<f64>,
) -> Result<f64> {
    let (x, y) = (probe(n_in, 11), probe(n_out, 12));
    let (ax, aty) = (forward(&x), transposed(&y));
    for (name, found, n) in [("length of A x", &ax, n_out), ("length of Aᵀ y", &aty, n_in)] {
        if found.len() != n {
            let remedy = "return a number for each element of the other space";
            return Err(Error::argument(name, found.len(), n.to_string(), remedy));
        }
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let length = |a: &[f64]| dot(a, a).sqrt();
    if ax.iter().chain(&aty).all(|v| *v == 0.0) {
        let remedy = "a check of nothing proves nothing: give a map that is not zero";
        return Err(Error::argument("A x and Aᵀ y", "zero", "some number that is not", remedy));
    }
    // Squares of tiny numbers would be 0.
    let largest = ax.iter().chain(&aty).fold(0.0, |m: f64, v| m.max(v.abs()));
    let of_one = |v: Vec<f64>| v.into_iter().map(|v| v / largest).collect::<Vec<f64>>();
    let (ax, aty) = (of_one(ax), of_one(aty));
    let scale = (length(&ax) * length(&y)).max(length(&x) * length(&aty));
    let error = (dot(&ax, &y) - dot(&x, &aty)).abs() / scale;
    Ok(if error.is_nan() { f64::INFINITY } else { error })
}
