//! Negative controls: a check that cannot fail proves nothing.

use super::passes::{Bound, Checkable, Numbers, Vectors, backward, forward, tensors};
use super::{Case, Forward, GradcheckSettings, Gradients, check_by, subset};
use crate::nn::layer::Layer;
use crate::{Error, Result};
use std::cmp::Ordering;

/// A gradient that was made wrong on purpose, and the error that the check found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Control {
    /// What was wrong: `x scaled by 1.01`, `weight left at zero`.
    pub mistake: String,
    /// The error that the check found.
    pub error: f64,
    /// Whether the gradient by this vector does not differ from zero by more than rounding at these inputs: nothing
    /// about it is checked.
    pub is_lost: bool,
}

/// A mistake, and what it makes of the gradient of one vector; the index is that of the largest element checked.
type Mistake = (&'static str, fn(&mut [f64], usize));

const AT_ZERO: &str = "left at zero";

const MISTAKES: [Mistake; 5] = [
    ("scaled by 1.01", |g, _| g.iter_mut().for_each(|g| *g *= 1.01)),
    ("negated", |g, _| g.iter_mut().for_each(|g| *g = -*g)),
    (AT_ZERO, |g, _| g.fill(0.0)),
    ("with its largest element left out", |g, largest| g[largest] = 0.0),
    ("in reverse order", |g, _| g.reverse()),
];

/// Checks `backward` as [`function`](super::function) does after its gradients were made wrong in stated ways, vector
/// by vector: scaled by 1.01, negated, left at zero, with its largest element left out, in reverse order. Vectors whose
/// gradient is zero, and orders that are the same in reverse, have no such control. A gradient so small beside the
/// rounding of the outputs that zero passes for it has one, which says so ([`Control::is_lost`]).
///
/// # Errors
/// If the gradients are wrong before that, `limit` is negative or not finite, a wrong gradient passes at `limit`, or no
/// gradient differs from zero by more than rounding; or as [`function`](super::function).
pub fn negative_control(
    inputs: &[(&str, &[f64])],
    mut forward: impl FnMut(&[Vec<f64>]) -> Vec<f64>,
    mut backward: impl FnMut(&[Vec<f64>], &[f64]) -> Vec<Vec<f64>>,
    settings: &GradcheckSettings,
    limit: f64,
) -> Result<Vec<Control>> {
    controls(inputs, &mut forward, &mut backward, settings, limit)
}

/// [`negative_control`] of the passes of a layer, as [`layer`](super::layer()) checks them.
///
/// # Errors
/// As [`negative_control`].
pub fn negative_control_of_layer<L: Layer<f64>>(
    checked: &L,
    case: &Case<L::Geometry>,
    settings: &GradcheckSettings,
    limit: f64,
) -> Result<Vec<Control>> {
    let Case { layout, params, geometry, x, dropout } = *case;
    let numbers = Numbers { layout, params, x, dropout };
    controls_of_layer(&numbers, &Bound { layer: checked, geometry }, settings, limit)
}

pub(super) fn controls_of_layer(
    case: &Numbers,
    layer: &dyn Checkable,
    settings: &GradcheckSettings,
    limit: f64,
) -> Result<Vec<Control>> {
    let tensors = tensors(case.layout, &layer.param_ranges());
    let vectors = Vectors::of(case, &tensors);
    let mut forward = |v: &[Vec<f64>]| forward(case, layer, &tensors, v);
    let mut backward = |v: &[Vec<f64>], dy: &[f64]| backward(case, layer, &tensors, v, dy);
    controls(&vectors.named(), &mut forward, &mut backward, settings, limit)
}

/// [`negative_control`], compiled once.
pub(super) fn controls(
    inputs: &[(&str, &[f64])],
    forward: &mut Forward,
    backward: &mut Gradients,
    settings: &GradcheckSettings,
    limit: f64,
) -> Result<Vec<Control>> {
    if !(limit >= 0.0 && limit.is_finite()) {
        let remedy = "1e-7 suits most functions";
        return Err(Error::argument("limit", limit, "0 or more, finite", remedy));
    }
    let mut controls = Vec::new();
    for (k, (name, vector)) in inputs.iter().enumerate().filter(|(_, (_, v))| !v.is_empty()) {
        let checked = subset(vector.len(), settings, k as u64);
        let mut of_vector = Vec::new();
        for (words, spoil) in MISTAKES {
            let mut is_wrong = false;
            let mut spoiled = |v: &[Vec<f64>], dy: &[f64]| {
                let mut gradients = backward(v, dy);
                if let Some(gradient) = gradients.get_mut(k) {
                    is_wrong |= spoil_checked(gradient, &checked, spoil);
                }
                gradients
            };
            let report = check_by(inputs, forward, &mut spoiled, settings, Some(k))?;
            if is_wrong {
                of_vector.push((words, report.worst().error));
            }
        }
        let passes = |error: f64| error.partial_cmp(&limit).is_none_or(Ordering::is_le);
        if of_vector.iter().any(|(words, error)| *words == AT_ZERO && passes(*error)) {
            let mistake = format!("{name} {AT_ZERO}");
            controls.push(Control { mistake, error: 0.0, is_lost: true });
            continue;
        }
        let right = check_by(inputs, forward, backward, settings, Some(k))?;
        if !passes(right.worst().error) {
            return Err(Error::Gradient { place: right.worst().to_string(), limit });
        }
        for (words, error) in of_vector {
            let mistake = format!("{name} {words}");
            if passes(error) {
                let found = format!("passed with the gradient by {mistake}");
                let remedy = "check at inputs where the gradient is not lost in rounding, or lower the limit";
                return Err(Error::argument("negative control", found, "a failed check", remedy));
            }
            controls.push(Control { mistake, error, is_lost: false });
        }
    }
    if controls.iter().all(|control| control.is_lost) {
        let remedy = "check at inputs where some gradient is not zero";
        return Err(Error::argument("negative control", "all gradients are zero", "some", remedy));
    }
    Ok(controls)
}

/// Makes a gradient wrong; whether that changes an element that is checked.
fn spoil_checked(gradient: &mut [f64], checked: &[usize], spoil: fn(&mut [f64], usize)) -> bool {
    let by_magnitude = |a: &&usize, b: &&usize| gradient[**a].abs().total_cmp(&gradient[**b].abs());
    let largest = checked.iter().filter(|i| **i < gradient.len()).max_by(by_magnitude);
    let Some(&largest) = largest else { return false };
    let right = gradient.to_vec();
    spoil(gradient, largest);
    checked.iter().any(|&i| gradient.get(i) != right.get(i))
}
