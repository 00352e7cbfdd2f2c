//! The check of a layer: what no difference shows, then its gradients.

use super::passes::{Bound, Case, Checkable, Numbers, Vectors, backward, forward, tensors};
use super::{GradcheckSettings, GradientReport, check, structure};
use crate::Result;
use crate::nn::layer::Layer;

/// Checks the training pass of a layer: its gradients by every matrix of its operand and by every one of its
/// tensors. Before that, what no difference shows:
///
/// - every range of [`Layer::param_ranges`] is a tensor of the layout, and no other tensor changes the output or gets a
///   gradient;
/// - backward adds to the gradients that are there, and leaves those of other tensors;
/// - two forward passes before two backward passes, in either order, give the output and the gradients of each alone,
///   and what an earlier pass left in the layer serves no later one;
/// - what buffers of the arena hold before they are written changes nothing;
/// - inference gives the output of training without dropout, unless it reads running statistics, and changes nothing.
///
/// ```
/// use deepmill::gradcheck::{self, Case, GradcheckSettings};
/// use deepmill::nn::{linear::Linear, operand::Operand, params::Layout};
/// let mut layout = Layout::default();
/// let linear = Linear::new(&mut layout, "linear", 3, 2, true);
/// let (params, x) = (layout.init_params(1), gradcheck::probe(12, 2));
/// let x = Operand::new(&x, 3);
/// let case = Case::new(&layout, &params, &(), x);
/// let report = gradcheck::layer(&linear, &case, &GradcheckSettings::default())?;
/// assert_eq!(report.worst.len(), 3); // x, linear.weight, linear.bias
/// report.require(1e-7)?;
/// # Ok::<(), deepmill::Error>(())
/// ```
///
/// # Errors
/// If one of these does not hold; or as [`function`](super::function).
pub fn layer<L: Layer<f64>>(
    checked: &L,
    case: &Case<L::Geometry>,
    settings: &GradcheckSettings,
) -> Result<GradientReport> {
    let Case { layout, params, geometry, x, dropout } = *case;
    let numbers = Numbers { layout, params, x, dropout };
    check_layer(&numbers, &Bound { layer: checked, geometry }, settings)
}

/// [`layer()`], compiled once.
pub(super) fn check_layer(
    case: &Numbers,
    layer: &dyn Checkable,
    settings: &GradcheckSettings,
) -> Result<GradientReport> {
    structure::require(case, layer, settings)?;
    let tensors = tensors(case.layout, &layer.param_ranges());
    let vectors = Vectors::of(case, &tensors);
    let mut forward = |v: &[Vec<f64>]| forward(case, layer, &tensors, v);
    let mut backward = |v: &[Vec<f64>], dy: &[f64]| backward(case, layer, &tensors, v, dy);
    check(&vectors.named(), &mut forward, &mut backward, settings)
}
