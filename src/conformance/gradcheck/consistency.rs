//! What no difference shows of a function: state between calls, lengths, outputs that are no numbers, and a single
//! output whose gradient is taken for 1.

use super::differences::same_length;
use super::{Forward, GradcheckSettings, Gradients, output_gradient};
use crate::numeric::rng::{Purpose, Stream};
use crate::{Error, Result};

/// Two ways to one number may differ by this share of the largest.
const ROUNDING: f64 = 1e-9;

/// The output, its gradient, and the gradients by all vectors.
type Passed = (Vec<f64>, Vec<f64>, Vec<Vec<f64>>);

/// Whether some number is not the other one but for rounding beside the largest of the first; NaN is none.
pub(super) fn first_difference(a: &[f64], b: &[f64]) -> Option<usize> {
    let allowed = ROUNDING * a.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let is_same = |(a, b): (&f64, &f64)| a == b || (a - b).abs() <= allowed;
    match a.len() == b.len() {
        true => a.iter().zip(b).position(|pair| !is_same(pair)),
        false => Some(a.len().min(b.len())),
    }
}

/// One forward and one backward pass, between passes elsewhere: what those left behind must not decide what these
/// compute, whether it is kept from the first call or from the last.
pub(super) fn consistent_gradients(
    inputs: &[(&str, &[f64])],
    vectors: &[Vec<f64>],
    forward: &mut Forward,
    backward: &mut Gradients,
    settings: &GradcheckSettings,
) -> Result<Passed> {
    let elsewhere = displaced(vectors, settings);
    let n = forward(&elsewhere).len();
    check_sizes(inputs, n, settings)?;
    let dy = output_gradient(n, settings);
    check_gradients(inputs, &backward(&elsewhere, &dy))?;
    let y = forward(vectors);
    same_length(&y, n)?;
    require_finite(&y)?;
    same_length(&forward(&elsewhere), n)?;
    let gradients = backward(vectors, &dy);
    check_gradients(inputs, &gradients)?;
    check_gradients(inputs, &backward(&elsewhere, &dy))?;
    require_same(inputs, &gradients, &backward(vectors, &dy))?;
    if n == 1 {
        require_linear(inputs, &gradients, &backward(vectors, &[-2.0]))?;
    }
    Ok((y, dy, gradients))
}

pub(super) fn require_finite(y: &[f64]) -> Result<()> {
    let Some(k) = y.iter().position(|y| !y.is_finite()) else { return Ok(()) };
    let found = format!("{} at place {k}", y[k]);
    let remedy = "check at inputs where every output is a number";
    Err(Error::argument("output", found, "finite", remedy))
}

/// All elements moved by what a difference moves one at most.
pub(super) fn displaced(vectors: &[Vec<f64>], settings: &GradcheckSettings) -> Vec<Vec<f64>> {
    let mut stream = Stream::new(settings.seed, 2, 0, Purpose::Probe);
    let mut moved = |x: &f64| {
        let sign = if stream.normal() < 0.0 { -1.0 } else { 1.0 };
        x + sign * 64.0 * settings.step * x.abs().max(1.0)
    };
    vectors.iter().map(|vector| vector.iter().map(&mut moved).collect()).collect()
}

/// An error if backward computes other gradients the second time.
fn require_same(inputs: &[(&str, &[f64])], first: &[Vec<f64>], second: &[Vec<f64>]) -> Result<()> {
    check_gradients(inputs, second)?;
    for ((name, _), (first, second)) in inputs.iter().zip(first.iter().zip(second)) {
        let is_number = !first.iter().any(|g| g.is_nan()); // those are found by the differences
        if let Some(index) = first_difference(first, second).filter(|_| is_number) {
            let found = format!("{} for {name}[{index}] the second time", second[index]);
            let expected = format!("{}, as the first time", first[index]);
            let remedy = "compute it from the arguments, not from what earlier calls left";
            return Err(Error::argument("gradient", found, expected, remedy));
        }
    }
    Ok(())
}

/// An error if backward forgets the gradient of the only output: `first` has 1 for it, `second` -2.
fn require_linear(
    inputs: &[(&str, &[f64])],
    first: &[Vec<f64>],
    second: &[Vec<f64>],
) -> Result<()> {
    check_gradients(inputs, second)?;
    for ((name, _), (first, second)) in inputs.iter().zip(first.iter().zip(second)) {
        let expected: Vec<f64> = first.iter().map(|g| -2.0 * g).collect();
        let is_number = !first.iter().any(|g| g.is_nan());
        if let Some(index) = first_difference(&expected, second).filter(|_| is_number) {
            let found =
                format!("{} for {name}[{index}] of the output's gradient -2", second[index]);
            let expected = format!("{}, -2 times that of 1", expected[index]);
            let remedy = "multiply by the gradient of the output, which need not be 1";
            return Err(Error::argument("gradient", found, expected, remedy));
        }
    }
    Ok(())
}

impl GradcheckSettings {
    /// An error if a number is out of its domain.
    pub(super) fn check(&self) -> Result<()> {
        let (step, floor) = (self.step, self.floor);
        if !(step > 0.0 && step.is_finite()) {
            return Err(Error::argument("step", step, "above 0 and finite", "1e-5 is the default"));
        }
        if !(floor >= 0.0 && floor.is_finite()) {
            return Err(Error::argument("floor", floor, "0 or more, finite", "64 is the default"));
        }
        Ok(())
    }
}

pub(super) fn check_names(inputs: &[(&str, &[f64])]) -> Result<()> {
    let twice = (1..inputs.len()).find(|&k| inputs[..k].iter().any(|(n, _)| *n == inputs[k].0));
    let Some(k) = twice else { return Ok(()) };
    let (found, remedy) = (format!("`{}` twice", inputs[k].0), "give each input its own name");
    Err(Error::argument("names of the inputs", found, "different ones", remedy))
}

fn check_sizes(
    inputs: &[(&str, &[f64])],
    n_outputs: usize,
    settings: &GradcheckSettings,
) -> Result<()> {
    let n: usize = inputs.iter().map(|(_, v)| v.len()).sum();
    let sizes = [
        ("number of elements to differentiate by", n),
        ("length of the output", n_outputs),
        ("max_elements", settings.max_elements),
    ];
    match sizes.iter().find(|(_, size)| *size == 0) {
        None => Ok(()),
        Some((name, _)) => {
            let remedy = "a check of nothing proves nothing: give inputs that reach the output";
            Err(Error::argument(name, 0, "at least 1", remedy))
        }
    }
}

fn check_gradients(inputs: &[(&str, &[f64])], gradients: &[Vec<f64>]) -> Result<()> {
    if gradients.len() != inputs.len() {
        let expected = format!("{}, one for each input", inputs.len());
        let remedy = "return one from backward for each input, in their order";
        return Err(Error::argument("number of gradients", gradients.len(), expected, remedy));
    }
    for ((name, input), gradient) in inputs.iter().zip(gradients) {
        if gradient.len() != input.len() {
            let found = format!("{} for {name}", gradient.len());
            let expected = format!("{}, the length of the input", input.len());
            let remedy = "return one number for each element";
            return Err(Error::argument("length of a gradient", found, expected, remedy));
        }
    }
    Ok(())
}
