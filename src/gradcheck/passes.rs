//! The training pass and the backward pass of a layer, as vectors that a check can differentiate.

use super::{GradcheckSettings, GradientReport, check};
use crate::Result;
use crate::nn::arena::{Arena, Buffer};
use crate::nn::layer::Layer;
use crate::nn::operand::{Operand, OperandGradient};
use crate::nn::params::Layout;
use crate::nn::pass::{Backward, Training};
use crate::rng::Stream;
use std::ops::Range;

/// A [`Layer`] with what its passes take, as one call of [`layer()`] checks it.
#[derive(Debug)]
pub struct Case<'a, G: ?Sized> {
    /// Names and places of the parameters.
    pub layout: &'a Layout,
    /// As long as the layout says.
    pub params: &'a [f64],
    /// Which rows meet.
    pub geometry: &'a G,
    /// What the layer reads.
    pub x: Operand<'a, f64>,
    /// Dropout, drawn from these streams in every pass alike; `None` turns it off.
    pub dropout: Option<&'a [Stream]>,
}

/// Checks the training pass of a layer: its gradients by every matrix of its operand and by every one of its
/// tensors.
///
/// ```
/// use deepmill::gradcheck::{self, Case, GradcheckSettings};
/// use deepmill::nn::{linear::Linear, operand::Operand, params::Layout};
/// let mut layout = Layout::default();
/// let linear = Linear::new(&mut layout, "linear", 3, 2, true);
/// let (params, x) = (layout.init_params(1), gradcheck::probe(12, 2));
/// let x = Operand::new(&x, 3);
/// let case = Case { layout: &layout, params: &params, geometry: &(), x, dropout: None };
/// let report = gradcheck::layer(&linear, &case, &GradcheckSettings::default())?;
/// assert_eq!(report.worst.len(), 3); // x, linear.weight, linear.bias
/// report.require(1e-7)?;
/// # Ok::<(), deepmill::Error>(())
/// ```
///
/// # Errors
/// As [`function`](super::function).
pub fn layer<L: Layer<f64>>(
    checked: &L,
    case: &Case<L::Geometry>,
    settings: &GradcheckSettings,
) -> Result<GradientReport> {
    let Case { layout, params, geometry, x, dropout } = *case;
    let numbers = Numbers { layout, params, x, dropout };
    let passes: &Passes = &|pass, x, dy| passes(checked, geometry, pass, x, dy);
    check_layer(&numbers, &checked.param_ranges(), passes, settings)
}

/// A [`Case`] without the layer's own types.
pub(super) struct Numbers<'a> {
    pub layout: &'a Layout,
    pub params: &'a [f64],
    pub x: Operand<'a, f64>,
    pub dropout: Option<&'a [Stream]>,
}

/// [`passes`] of some layer.
pub(super) type Passes<'a> =
    dyn Fn(&mut Training<f64>, Operand<f64>, Option<Dy>) -> (Buffer<f64>, Vec<Vec<f64>>) + 'a;

/// Gradient of the output, and of the parameters, which is added to.
pub(super) type Dy<'a> = (&'a [f64], &'a mut [f64]);

/// A training pass of a layer and, if there is a `dy`, its backward pass: the output, and the gradients by the matrices
/// of the operand.
pub(super) fn passes<L: Layer<f64>>(
    layer: &L,
    geometry: &L::Geometry,
    pass: &mut Training<f64>,
    x: Operand<f64>,
    dy: Option<Dy>,
) -> (Buffer<f64>, Vec<Vec<f64>>) {
    let (params, arena) = (pass.params, pass.arena);
    let (y, saved) = layer.forward_train(pass, geometry, x);
    let Some((dy, grads)) = dy else { return (y, Vec::new()) };
    let mut pass = Backward::new(params, grads, arena);
    let gradient = layer.backward(&mut pass, geometry, x, saved, arena.copy_of(dy));
    (y, vectors(gradient))
}

fn vectors(gradient: OperandGradient<f64>) -> Vec<Vec<f64>> {
    gradient.into_parts().iter().map(|part| part.to_vec()).collect()
}

/// [`layer()`], compiled once.
pub(super) fn check_layer(
    case: &Numbers,
    ranges: &[Range<usize>],
    passes: &Passes,
    settings: &GradcheckSettings,
) -> Result<GradientReport> {
    let matrices = case.x.matrices();
    let n = matrices.len();
    let names = matrix_names(n);
    let tensors: Vec<_> =
        case.layout.params.iter().filter(|entry| ranges.contains(&entry.range)).collect();
    let inputs = names.iter().map(String::as_str).zip(matrices.iter().map(Operand::numbers));
    let params = tensors.iter().map(|e| (e.name.as_str(), &case.params[e.range.clone()]));
    let inputs: Vec<_> = inputs.chain(params).collect();
    let params_of = |v: &[Vec<f64>]| {
        let mut params = case.params.to_vec();
        for (entry, values) in tensors.iter().zip(&v[n..]) {
            params[entry.range.clone()].copy_from_slice(values);
        }
        params
    };
    let mut forward = |v: &[Vec<f64>]| run(case, passes, &v[..n], &params_of(v), None).y.to_vec();
    let mut backward = |v: &[Vec<f64>], dy: &[f64]| {
        let mut step = run(case, passes, &v[..n], &params_of(v), Some(dy));
        step.dx.extend(tensors.iter().map(|e| step.grads[e.range.clone()].to_vec()));
        step.dx
    };
    check(&inputs, &mut forward, &mut backward, settings)
}

/// Names of the matrices of an operand.
pub(super) fn matrix_names(n: usize) -> Vec<String> {
    match n {
        1 => vec!["x".into()],
        _ => (0..n).map(|i| format!("x[{i}]")).collect(),
    }
}

/// A training pass and its backward pass.
pub(super) struct Step {
    pub y: Buffer<f64>,
    /// Running statistics afterwards.
    pub buffers: Vec<f64>,
    /// Gradients by the matrices of the operand; none without a `dy`.
    pub dx: Vec<Vec<f64>>,
    /// Gradient by the parameters; 0 without a `dy`.
    pub grads: Vec<f64>,
}

/// A training pass on the matrices `x` and, if there is a `dy`, its backward pass.
pub(super) fn run(
    case: &Numbers,
    passes: &Passes,
    x: &[Vec<f64>],
    params: &[f64],
    dy: Option<&[f64]>,
) -> Step {
    let (arena, mut buffers) = (&Arena::default(), case.layout.init_buffers());
    let matrices = case.x.matrices();
    let matrices: Vec<_> = matrices.iter().zip(x).map(|(m, x)| m.with_numbers(x)).collect();
    let x = match &matrices[..] {
        [x] => *x,
        _ => Operand::Concat(&matrices),
    };
    let mut dropout = case.dropout.map(<[Stream]>::to_vec);
    let dropout = dropout.as_deref_mut();
    let mut pass = Training { params, buffers: &mut buffers, dropout, arena };
    let mut grads = vec![0.0; params.len()];
    let (y, dx) = passes(&mut pass, x, dy.map(|dy| (dy, &mut grads[..])));
    Step { y, buffers, dx, grads }
}
