//! Gradient checks: compares a hand-written backward pass with central differences of its forward pass, and linear maps
//! with their adjoint, in f64.
//!
//! [`function`] takes any function of named vectors (inputs and parameters alike) with a vector result `y`, and
//! [`layer()`] any [`Layer`](crate::nn::layer::Layer). For a fixed random `dy` they compare what backward says about
//! `⟨dy, y⟩` with the central difference `D(h) = ⟨dy, y(v + h) - y(v - h)⟩ / 2h`, element by element, whose leading
//! error is removed by a second step: `(4 D(h) - D(2h)) / 3`. What is left is about `(h / s)⁴` where the function bends
//! over a length `s` (batch norm over nearly equal rows bends over their small deviation), and a rounding error of
//! about `2^-53 / h`. With `h = 1e-5` both stay near 1e-10, so a correct gradient of a smooth function passes at 1e-7,
//! and a wrong one fails by many orders of magnitude.
//!
//! A scalar result, such as a loss, is rounded to its own magnitude, beside which one element's share may be
//! small: no single step suits all elements. There `dy` is 1, and differences at the steps `h, 4h, 16h, 64h` are
//! extrapolated to 0, of which the estimate that agrees best with its neighbors counts (Ridders 1982).
//!
//! ```
//! use deepmill::gradcheck::{self, GradcheckSettings};
//! let x = gradcheck::probe(10, 1);
//! let forward = |v: &[Vec<f64>]| v[0].iter().map(|x| x * x).collect();
//! let backward = |v: &[Vec<f64>], dy: &[f64]| {
//!     vec![v[0].iter().zip(dy).map(|(x, dy)| 2.0 * x * dy).collect()]
//! };
//! let report = gradcheck::function(&[("x", &x)], forward, backward, &GradcheckSettings::default())?;
//! report.require(1e-7)?;
//! # Ok::<(), deepmill::Error>(())
//! ```
//!
//! A function with a kink (ReLU, max) has no derivative there. A gradient between the slopes to both sides is reported
//! as [`Element::is_kink`], not as an error; but a kink within a step hides mistakes. Choose inputs whose distance from
//! every kink exceeds what a step of `2h`, or `64h` of a scalar, can move them.
//!
//! [`sweep`] checks over shapes, [`negative_control`] that the check fails where it must, [`adjoint`] linear maps.
//! `deepmill gradcheck` does all of that with every layer of this crate.

mod adjoint;
mod consistency;
mod controls;
mod differences;
#[doc(hidden)] // of the program and tests
pub mod fixture;
mod layer;
mod passes;
mod structure;
#[doc(hidden)] // of the program and tests
pub mod suite;
mod sweep;

pub use adjoint::adjoint;
pub use controls::{Control, negative_control, negative_control_of_layer};
pub use layer::layer;
pub use passes::Case;
pub use sweep::{matrix_shapes, octree_shapes, sweep};

use crate::numeric::rng::{Purpose, Stream};
use crate::{Error, Result};
use consistency::{check_names, consistent_gradients};
use differences::Differences;
use serde::{Deserialize, Serialize};
use std::fmt;

/// How a check is made.
///
/// ```
/// use deepmill::gradcheck::GradcheckSettings;
/// let quick = GradcheckSettings::default().with_max_elements(50).with_seed(3);
/// assert_eq!((quick.max_elements, quick.step), (50, GradcheckSettings::default().step));
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct GradcheckSettings {
    /// Step `h` for elements up to magnitude 1; larger ones step in proportion.
    pub step: f64,
    /// Rounding that is not held against an element, 0 or more: in units of the rounding of the differences of those
    /// outputs that it moves, and of the largest gradient of all vectors.
    pub floor: f64,
    /// Elements checked per vector; of a longer one a random subset.
    pub max_elements: usize,
    /// Seed of `dy` and of the subsets.
    pub seed: u64,
}

setters!(GradcheckSettings {
    with_step(step: f64),
    with_floor(floor: f64),
    with_max_elements(max_elements: usize),
    with_seed(seed: u64),
});

impl Default for GradcheckSettings {
    /// Step 1e-5, floor 64, every element, seed 0.
    fn default() -> Self {
        GradcheckSettings { step: 1e-5, floor: 64.0, max_elements: usize::MAX, seed: 0 }
    }
}

/// One checked element.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Element {
    /// Name of its vector.
    pub name: String,
    /// Place in that vector.
    pub index: usize,
    /// What backward says.
    pub analytic: f64,
    /// What the differences say.
    pub numeric: f64,
    /// `|analytic - numeric|` relative to the greater of both, 0 where rounding ([`GradcheckSettings::floor`]) or
    /// curvature explain it; infinite for NaN.
    pub error: f64,
    /// Whether the slopes to both sides differ, and the analytic one is between them: a subgradient, and no error.
    pub is_kink: bool,
}

/// The outcome of [`function`] and [`layer()`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct GradientReport {
    /// Worst element of every vector, in the order of the inputs.
    pub worst: Vec<Element>,
    /// Elements at a kink of the function.
    pub kinks: Vec<Element>,
    /// Elements checked in all.
    pub n_checked: usize,
    lost: Vec<Element>,
}

impl GradientReport {
    /// The worst element of all.
    ///
    /// # Panics
    /// If the report is not one of a check, and empty.
    pub fn worst(&self) -> &Element {
        let worst = self.worst.iter().max_by(|a, b| a.error.total_cmp(&b.error));
        worst.expect("a check has at least one element")
    }

    /// Elements so small beside the rounding of the outputs that an error of a hundredth passes: they are not checked.
    pub fn lost(&self) -> &[Element] {
        &self.lost
    }

    /// Nothing if no error exceeds `limit`.
    ///
    /// # Errors
    /// Otherwise [`Error::Gradient`] with the worst element and both of its values; a number that is not finite is no
    /// error within any limit. [`Error::Argument`] if every element is [lost](GradientReport::lost), but for kinks.
    pub fn require(&self, limit: f64) -> Result<()> {
        let worst = self.worst();
        if !(worst.error <= limit && worst.error.is_finite()) {
            return Err(Error::Gradient { place: worst.to_string(), limit });
        }
        if !self.lost.is_empty() && self.lost.len() + self.kinks.len() == self.n_checked {
            let found = format!("lost in rounding: {}", self.lost[0]);
            let remedy = "check at smaller outputs, or with the default step and floor";
            return Err(Error::argument(
                "every gradient",
                found,
                "some that rounding shows",
                remedy,
            ));
        }
        Ok(())
    }
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Element { name, index, analytic, numeric, error, is_kink } = self;
        let kink = if *is_kink { ", at a kink" } else { "" };
        write!(
            f,
            "{name}[{index}]: analytic {analytic:e}, numeric {numeric:e}, error {error:.1e}{kink}"
        )
    }
}

impl fmt::Display for GradientReport {
    /// One line per vector, and one of how many elements are lost in rounding.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.worst.iter().try_for_each(|element| writeln!(f, "{element}"))?;
        match self.lost.len() {
            0 => Ok(()),
            n => writeln!(f, "{n} of {} elements are lost in rounding", self.n_checked),
        }
    }
}

/// Checks `backward` against central differences of `forward`.
///
/// Both get the vectors of `inputs` in order; `backward(vectors, dy)` returns one gradient per vector, of its length.
/// Anything random in the function must be held fixed between calls. Both are also called at inputs close by, and
/// backward of a single output with another `dy` than 1.
///
/// # Errors
/// If there is nothing to check (no input element, an empty output, `max_elements` 0), an output is not finite, or if
/// backward returns another number of gradients than there are inputs, one of another length, other numbers the second
/// time, or, of a single output, a gradient that is not in proportion to `dy`.
pub fn function(
    inputs: &[(&str, &[f64])],
    mut forward: impl FnMut(&[Vec<f64>]) -> Vec<f64>,
    mut backward: impl FnMut(&[Vec<f64>], &[f64]) -> Vec<Vec<f64>>,
    settings: &GradcheckSettings,
) -> Result<GradientReport> {
    check(inputs, &mut forward, &mut backward, settings)
}

/// The output, of the vectors.
type Forward<'a> = dyn FnMut(&[Vec<f64>]) -> Vec<f64> + 'a;

/// Gradients by all vectors, of the vectors and the gradient of the output.
type Gradients<'a> = dyn FnMut(&[Vec<f64>], &[f64]) -> Vec<Vec<f64>> + 'a;

/// [`function`], compiled once.
fn check(
    inputs: &[(&str, &[f64])],
    forward: &mut Forward,
    backward: &mut Gradients,
    settings: &GradcheckSettings,
) -> Result<GradientReport> {
    check_by(inputs, forward, backward, settings, None)
}

/// [`check`] by all vectors, or by one.
fn check_by(
    inputs: &[(&str, &[f64])],
    forward: &mut Forward,
    backward: &mut Gradients,
    settings: &GradcheckSettings,
    one: Option<usize>,
) -> Result<GradientReport> {
    settings.check()?;
    check_names(inputs)?;
    let vectors: Vec<Vec<f64>> = inputs.iter().map(|(_, v)| v.to_vec()).collect();
    let (y, dy, gradients) = consistent_gradients(inputs, &vectors, forward, backward, settings)?;
    let mut differences = Differences::new(forward, vectors, (y, dy), (settings, &gradients));
    let mut checked = Vec::new();
    let wanted = gradients.iter().enumerate().filter(|(i, _)| one.is_none_or(|one| one == *i));
    for (i, gradient) in wanted {
        for index in subset(gradient.len(), settings, i as u64) {
            let of = ((i, index), gradient[index]);
            checked.push(differences.element(inputs[i].0, of, settings.step)?);
        }
    }
    Ok(report(checked))
}

/// The `dy` of a check.
fn output_gradient(n_outputs: usize, settings: &GradcheckSettings) -> Vec<f64> {
    if n_outputs == 1 { vec![1.0] } else { probe(n_outputs, settings.seed) }
}

/// Of all elements, and whether each is lost in rounding.
fn report(checked: Vec<(Element, bool)>) -> GradientReport {
    let n_checked = checked.len();
    let (mut worst, mut kinks, mut lost) = (Vec::<Element>::new(), Vec::new(), Vec::new());
    for (element, is_lost) in checked {
        if element.is_kink {
            kinks.push(element.clone());
        }
        if is_lost {
            lost.push(element.clone());
        }
        match worst.iter_mut().find(|w| w.name == element.name) {
            Some(w) if w.error >= element.error => {}
            Some(w) => *w = element,
            None => worst.push(element),
        }
    }
    GradientReport { worst, kinks, n_checked, lost }
}

/// Ascending indices: all of `0..n`, or a random subset of the wanted size.
fn subset(n: usize, settings: &GradcheckSettings, vector: u64) -> Vec<usize> {
    let mut indices: Vec<usize> = (0..n).collect();
    if n > settings.max_elements {
        Stream::new(settings.seed, 1, vector, Purpose::Probe).shuffle(&mut indices);
        indices.truncate(settings.max_elements);
        indices.sort_unstable();
    }
    indices
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

    fn check(change: impl Fn(&mut Vec<Vec<f64>>)) -> GradientReport {
        let x = probe(20, 1);
        let changed = |v: &[Vec<f64>], dy: &[f64]| {
            let mut gradients = backward(v, dy);
            change(&mut gradients);
            gradients
        };
        function(&[("x", &x), ("p", &[0.7])], forward, changed, &GradcheckSettings::default())
            .unwrap()
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
        let settings = GradcheckSettings { max_elements: 4, ..GradcheckSettings::default() };
        let x = probe(20, 1);
        let report = function(&[("x", &x), ("p", &[0.7])], forward, backward, &settings).unwrap();
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
            let settings = GradcheckSettings { max_elements, ..GradcheckSettings::default() };
            let report = function(&[("x", &x), ("p", &[0.7])], forward, wrong, &settings).unwrap();
            report.require(1e-7).unwrap();
        }
    }

    #[test]
    fn adjoint_test_tells_a_transpose_from_the_matrix() {
        let a = probe(9, 4);
        let apply = |rows: usize, columns: usize, x: &[f64]| -> Vec<f64> {
            (0..3).map(|i| (0..3).map(|j| a[rows * i + columns * j] * x[j]).sum()).collect()
        };
        assert!(adjoint(3, 3, |x| apply(3, 1, x), |y| apply(1, 3, y)).unwrap() < 1e-15);
        assert!(adjoint(3, 3, |x| apply(3, 1, x), |y| apply(3, 1, y)).unwrap() > 1e-3);
    }

    #[test]
    fn fewer_gradients_than_inputs_and_gradients_of_other_lengths_are_refused() {
        let x = probe(20, 1);
        let message = |change: &dyn Fn(&mut Vec<Vec<f64>>)| {
            let changed = |v: &[Vec<f64>], dy: &[f64]| {
                let mut gradients = backward(v, dy);
                change(&mut gradients);
                gradients
            };
            let inputs: [(&str, &[f64]); 2] = [("x", &x), ("p", &[0.7])];
            function(&inputs, forward, changed, &GradcheckSettings::default())
                .unwrap_err()
                .to_string()
        };
        let fewer = message(&|g| drop(g.pop()));
        assert!(fewer.starts_with("number of gradients is 1, expected 2"), "{fewer}");
        assert!(message(&|g| g.push(vec![])).starts_with("number of gradients is 3"));
        let shorter = message(&|g| g[0].truncate(19));
        assert!(shorter.starts_with("length of a gradient is 19 for x, expected 20"), "{shorter}");
    }

    #[test]
    fn a_check_of_nothing_is_refused() {
        let message = |x: &[f64], max_elements: usize, n_outputs: usize| {
            let settings = GradcheckSettings { max_elements, ..GradcheckSettings::default() };
            let forward = |_: &[Vec<f64>]| vec![0.0; n_outputs];
            let backward = |v: &[Vec<f64>], _: &[f64]| v.to_vec();
            function(&[("x", x)], forward, backward, &settings).unwrap_err().to_string()
        };
        assert!(message(&[], 9, 9).contains("elements to differentiate by is 0"));
        assert!(message(&[1.0], 9, 0).contains("length of the output is 0"));
        assert!(message(&[1.0], 0, 9).contains("max_elements is 0"));
    }

    /// A loss of magnitude 10 with gradients from 1 down to 1e-3, one of them over a bend of length 0.02.
    #[test]
    fn a_loss_is_checked_without_tuning() {
        let x = probe(20, 3);
        let scale = |i: usize| 10f64.powf(-3.0 * i as f64 / 19.0);
        let sharp = |i: usize| if i == 7 { 50.0 } else { 1.0 };
        let forward = |v: &[Vec<f64>]| {
            let terms = v[0].iter().enumerate();
            vec![10.0 + terms.map(|(i, x)| scale(i) * libm::sin(sharp(i) * x)).sum::<f64>()]
        };
        let backward = |v: &[Vec<f64>], dy: &[f64]| {
            let derivative = |(i, x): (usize, &f64)| scale(i) * sharp(i) * libm::cos(sharp(i) * x);
            vec![v[0].iter().enumerate().map(|t| dy[0] * derivative(t)).collect::<Vec<f64>>()]
        };
        let inputs: [(&str, &[f64]); 1] = [("x", &x)];
        let report = function(&inputs, forward, backward, &GradcheckSettings::default()).unwrap();
        report.require(1e-7).unwrap();
        let wrong = |v: &[Vec<f64>], dy: &[f64]| {
            let mut gradients = backward(v, dy);
            gradients[0][3] *= 1.0001;
            gradients
        };
        let report = function(&inputs, forward, wrong, &GradcheckSettings::default()).unwrap();
        assert!(report.require(1e-7).is_err() && report.worst().index == 3);
    }
}
