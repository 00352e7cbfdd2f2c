//! Is a hand-written backward pass the derivative of its forward pass? Central differences and the
//! adjoint test, in f64.
//!
//! A layer is any function of named vectors (inputs and parameters alike) with a vector result `y`.
//! For a fixed random `dy`, [`layer`] compares what backward says about `⟨dy, y⟩` with the central
//! difference `D(h) = ⟨dy, y(v + h) - y(v - h)⟩ / 2h`, element by element, whose leading error is removed by
//! a second step: `(4 D(h) - D(2h)) / 3`. What is left is about `(h / s)⁴` where the function bends over a
//! length `s` (batch norm over nearly equal rows bends over their small deviation), and a rounding error of
//! about `2^-53 / h`. With `h = 1e-5` both stay near 1e-10, so a correct gradient of a smooth function passes
//! at 1e-7, and a wrong one fails by many orders of magnitude.
//!
//! ```
//! use deepmill::gradcheck::{self, Settings};
//! let x = gradcheck::probe(10, 1);
//! let forward = |v: &[Vec<f64>]| v[0].iter().map(|x| x * x).collect();
//! let backward = |v: &[Vec<f64>], dy: &[f64]| {
//!     vec![v[0].iter().zip(dy).map(|(x, dy)| 2.0 * x * dy).collect()]
//! };
//! let report = gradcheck::layer(&[("x", &x)], forward, backward, &Settings::default());
//! report.require(1e-7).unwrap();
//! ```
//!
//! A function with a kink (ReLU, max) has no derivative there: choose inputs whose distance from every
//! kink exceeds what a step of `2h` can move them.

use crate::rng::{Purpose, Stream};
use crate::{Error, Result};
use std::fmt;

/// How a check is made.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Step `h` for elements up to magnitude 1; larger ones step in proportion.
    pub step: f64,
    /// Errors are relative to the greater of both values, but at least to this share of the largest
    /// analytic gradient of all vectors, so that rounding noise on a vanishing gradient is not held against it.
    pub floor: f64,
    /// Elements checked per vector; of a longer one a random subset.
    pub max_elements: usize,
    /// Seed of `dy` and of the subsets.
    pub seed: u64,
}

impl Default for Settings {
    /// Step 1e-5, floor 1e-3, every element, seed 0.
    fn default() -> Self {
        Settings { step: 1e-5, floor: 1e-3, max_elements: usize::MAX, seed: 0 }
    }
}

/// One checked element.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// Name of its vector.
    pub name: String,
    /// Place in that vector.
    pub index: usize,
    /// What backward says.
    pub analytic: f64,
    /// What the differences say.
    pub numeric: f64,
    /// `|analytic - numeric|` relative to the scale of [`Settings::floor`]; infinite for NaN.
    pub error: f64,
}

/// The outcome of [`layer`].
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// Worst element of every vector, in the order of the inputs.
    pub worst: Vec<Element>,
    /// Elements checked in all.
    pub n_checked: usize,
}

impl Report {
    /// The worst element of all.
    ///
    /// # Panics
    /// If the check had no inputs, or only empty ones.
    pub fn worst(&self) -> &Element {
        let worst = self.worst.iter().max_by(|a, b| a.error.total_cmp(&b.error));
        worst.expect("a check has at least one element")
    }

    /// Nothing if no error exceeds `limit`.
    ///
    /// # Errors
    /// Otherwise [`Error::Argument`] with the worst element and both of its values.
    pub fn require(&self, limit: f64) -> Result<()> {
        let worst = self.worst();
        if worst.error <= limit {
            return Ok(());
        }
        Err(Error::argument(
            "gradient",
            worst,
            format!("a relative error of at most {limit:e}"),
            "compare the backward pass with the derivative of the forward pass",
        ))
    }
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Element { name, index, analytic, numeric, error } = self;
        write!(f, "{name}[{index}]: analytic {analytic:e}, numeric {numeric:e}, error {error:.1e}")
    }
}

impl fmt::Display for Report {
    /// One line per vector.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.worst.iter().try_for_each(|element| writeln!(f, "{element}"))
    }
}

/// Checks `backward` against central differences of `forward`.
///
/// Both get the vectors of `inputs` in order; `backward(vectors, dy)` returns one gradient per vector,
/// of its length. Anything random in the layer must be held fixed between calls.
///
/// # Panics
/// If a gradient's length differs from its vector's.
pub fn layer(
    inputs: &[(&str, &[f64])],
    mut forward: impl FnMut(&[Vec<f64>]) -> Vec<f64>,
    mut backward: impl FnMut(&[Vec<f64>], &[f64]) -> Vec<Vec<f64>>,
    settings: &Settings,
) -> Report {
    let mut vectors: Vec<Vec<f64>> = inputs.iter().map(|(_, v)| v.to_vec()).collect();
    let dy = probe(forward(&vectors).len(), settings.seed);
    let gradients = backward(&vectors, &dy);
    let mut checked = Vec::new();
    for (i, gradient) in gradients.iter().enumerate() {
        let name = inputs[i].0;
        assert_eq!(gradient.len(), vectors[i].len(), "gradient of {name} has another length");
        for index in subset(gradient.len(), settings, i as u64) {
            let numeric = derivative(&mut vectors, i, index, &dy, &mut forward, settings);
            checked.push((i, index, gradient[index], numeric));
        }
    }
    // Of all elements: which of them the subset holds must not change how an error is judged.
    let largest = gradients.iter().flatten().fold(0.0, |m: f64, a| m.max(a.abs()));
    report(inputs, &checked, settings.floor * largest)
}

fn derivative(
    vectors: &mut [Vec<f64>],
    vector: usize,
    index: usize,
    dy: &[f64],
    forward: &mut impl FnMut(&[Vec<f64>]) -> Vec<f64>,
    settings: &Settings,
) -> f64 {
    let x = vectors[vector][index];
    let h = settings.step * x.abs().max(1.0);
    let mut central_difference = |h: f64| {
        let (high, low) = (x + h, x - h);
        vectors[vector][index] = high;
        let y_high = forward(vectors);
        vectors[vector][index] = low;
        let y_low = forward(vectors);
        let change = |((high, low), dy): ((&f64, &f64), &f64)| (high - low) * dy;
        y_high.iter().zip(&y_low).zip(dy).map(change).sum::<f64>() / (high - low)
    };
    let (near, far) = (central_difference(h), central_difference(2.0 * h));
    vectors[vector][index] = x;
    (4.0 * near - far) / 3.0
}

fn report(inputs: &[(&str, &[f64])], checked: &[(usize, usize, f64, f64)], floor: f64) -> Report {
    let mut worst: Vec<Element> = Vec::new();
    for &(input, index, analytic, numeric) in checked {
        let scale = analytic.abs().max(numeric.abs()).max(floor);
        let difference = (analytic - numeric).abs();
        let error = if difference == 0.0 { 0.0 } else { difference / scale };
        let error = if error.is_nan() { f64::INFINITY } else { error };
        let name = inputs[input].0;
        match worst.iter_mut().find(|w| w.name == name) {
            Some(w) if w.error >= error => {}
            Some(w) => *w = Element { name: name.into(), index, analytic, numeric, error },
            None => worst.push(Element { name: name.into(), index, analytic, numeric, error }),
        }
    }
    Report { worst, n_checked: checked.len() }
}

/// Ascending indices: all of `0..n`, or a random subset of the wanted size.
fn subset(n: usize, settings: &Settings, vector: u64) -> Vec<usize> {
    let mut indices: Vec<usize> = (0..n).collect();
    if n > settings.max_elements {
        Stream::new(settings.seed, 1, vector, Purpose::Probe).shuffle(&mut indices);
        indices.truncate(settings.max_elements);
        indices.sort_unstable();
    }
    indices
}

/// The adjoint test of a linear map and its transpose, which needs no step at all.
///
/// For random `x` and `y` it returns `|⟨A x, y⟩ - ⟨x, Aᵀ y⟩|` relative to `|A x| |y|`: about 1e-16 for
/// a right pair, about 1 for an unrelated one.
pub fn adjoint(
    n_in: usize,
    n_out: usize,
    forward: impl Fn(&[f64]) -> Vec<f64>,
    transposed: impl Fn(&[f64]) -> Vec<f64>,
) -> f64 {
    let (x, y) = (probe(n_in, 11), probe(n_out, 12));
    let (ax, aty) = (forward(&x), transposed(&y));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let scale = (dot(&ax, &ax) * dot(&y, &y)).sqrt();
    (dot(&ax, &y) - dot(&x, &aty)).abs() / scale.max(f64::MIN_POSITIVE)
}

/// `n` normally distributed numbers of a seed: inputs and weights for checks.
pub fn probe(n: usize, seed: u64) -> Vec<f64> {
    let mut stream = Stream::new(seed, 0, 0, Purpose::Probe);
    (0..n).map(|_| stream.normal()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y_i = p · x_i³.
    fn forward(v: &[Vec<f64>]) -> Vec<f64> {
        v[0].iter().map(|x| v[1][0] * x * x * x).collect()
    }

    fn backward(v: &[Vec<f64>], dy: &[f64]) -> Vec<Vec<f64>> {
        let dx = v[0].iter().zip(dy).map(|(x, dy)| 3.0 * v[1][0] * x * x * dy).collect();
        let dp = v[0].iter().zip(dy).map(|(x, dy)| x * x * x * dy).sum();
        vec![dx, vec![dp]]
    }

    fn check(change: impl Fn(&mut Vec<Vec<f64>>)) -> Report {
        let x = probe(20, 1);
        let changed = |v: &[Vec<f64>], dy: &[f64]| {
            let mut gradients = backward(v, dy);
            change(&mut gradients);
            gradients
        };
        layer(&[("x", &x), ("p", &[0.7])], forward, changed, &Settings::default())
    }

    #[test]
    fn right_gradients_pass() {
        let report = check(|_| ());
        assert_eq!(report.n_checked, 21);
        report.require(1e-7).unwrap();
        assert!(report.to_string().contains("p[0]: analytic"));
    }

    #[test]
    fn wrong_factor_sign_or_single_element_is_caught_and_named() {
        let scaled = check(|g| g[0].iter_mut().for_each(|d| *d *= 1.00001));
        assert!(scaled.require(1e-7).is_err() && scaled.worst().name == "x");
        let negated = check(|g| g[1][0] = -g[1][0]);
        assert!(negated.worst().error > 0.1 && negated.worst().name == "p");
        let shifted = check(|g| g[0][13] += 1e-3);
        let message = shifted.require(1e-7).unwrap_err().to_string();
        assert!(message.contains("x[13]: analytic"), "{message}");
        let missing = check(|g| g[0][7] = 0.0);
        assert_eq!((missing.worst().index, missing.worst().analytic), (7, 0.0));
        let nan = check(|g| g[0][3] = f64::NAN);
        assert_eq!((nan.worst().index, nan.worst().error), (3, f64::INFINITY));
    }

    #[test]
    fn a_subset_is_checked_when_asked() {
        let settings = Settings { max_elements: 4, ..Settings::default() };
        let x = probe(20, 1);
        let report = layer(&[("x", &x), ("p", &[0.7])], forward, backward, &settings);
        assert_eq!(report.n_checked, 5);
    }

    #[test]
    fn a_subset_without_the_large_gradients_judges_errors_as_the_whole_check_does() {
        let x: Vec<f64> = (0..20).map(|i| if i == 11 { 100.0 } else { 1.0 }).collect();
        let wrong = |v: &[Vec<f64>], dy: &[f64]| {
            let mut gradients = backward(v, dy);
            gradients[0].iter_mut().for_each(|d| *d += 1e-9);
            gradients
        };
        for max_elements in 1..=20 {
            let settings = Settings { max_elements, ..Settings::default() };
            layer(&[("x", &x), ("p", &[0.7])], forward, wrong, &settings).require(1e-7).unwrap();
        }
    }

    #[test]
    fn adjoint_test_tells_a_transpose_from_the_matrix() {
        let a = probe(9, 4);
        let apply = |rows: usize, columns: usize, x: &[f64]| -> Vec<f64> {
            (0..3).map(|i| (0..3).map(|j| a[rows * i + columns * j] * x[j]).sum()).collect()
        };
        assert!(adjoint(3, 3, |x| apply(3, 1, x), |y| apply(1, 3, y)) < 1e-15);
        assert!(adjoint(3, 3, |x| apply(3, 1, x), |y| apply(3, 1, y)) > 1e-3);
    }
}
