//! One case of the suite: a layer, or a function with a single output, and its numbers.

use super::probes::{ProbeGeometry, shape_array};
use super::{LIMIT, SuiteCase};
use crate::Result;
use crate::conformance::gradcheck::controls::controls_of_layer;
use crate::conformance::gradcheck::fixture::{Fixture, NamedArray};
use crate::conformance::gradcheck::layer::check_layer;
use crate::conformance::gradcheck::passes::{self, Bound, Checkable, Job, Numbers, Order, Passed};
use crate::conformance::gradcheck::{self, Control, GradcheckSettings, GradientReport};
use crate::nn::arena::{Arena, Buffer};
use crate::nn::layer::Layer;
use crate::nn::operand::Operand;
use crate::nn::params::{Entry, Layout};
use crate::nn::pass::Inference;
use crate::numeric::rng::Stream;
use std::borrow::Borrow;
use std::ops::Range;

/// Elements checked of each matrix and tensor, and of each in a negative control.
const MAX_ELEMENTS: usize = 120;
const MOST_OF_CONTROLS: usize = 24;

const PARAM: (&str, &str) = ("param", "parameter");
const BEFORE: (&str, &str) = ("before", "running statistic before the pass");
const AFTER: (&str, &str) = ("after", "running statistic after the pass");
const GRAD: (&str, &str) = ("grad", "gradient of sum(dy * y)");
const LOSS_GRAD: (&str, &str) = ("grad", "gradient of y");

pub(super) trait Checked {
    fn check(&self) -> Result<GradientReport>;
    fn controls(&self) -> Result<Vec<Control>>;
    fn record(&self, fixture: &mut Fixture);

    /// Inputs and parameters that change the output, and that may be NaN while the whole output is finite.
    #[cfg(test)]
    fn hidden(&self) -> Vec<String>;
}

/// One matrix of an operand.
pub(super) struct InputMatrix {
    pub values: Vec<f64>,
    pub c: usize,
    /// Rows of each shape, if `values` has one row per shape.
    pub shapes: Option<Vec<Range<usize>>>,
}

impl InputMatrix {
    /// Random numbers in `n` rows of `c`.
    pub fn probe(n: usize, c: usize, seed: u64) -> Self {
        InputMatrix { values: gradcheck::probe(n * c, seed), c, shapes: None }
    }

    fn operand(&self) -> Operand<'_, f64> {
        match &self.shapes {
            None => Operand::new(&self.values, self.c),
            Some(shapes) => Operand::PerShape { x: &self.values, c: self.c, shapes },
        }
    }

    fn shape(&self) -> [usize; 2] {
        [self.values.len() / self.c, self.c]
    }
}

/// A training pass of a layer.
pub(super) struct LayerCase {
    layer: Box<dyn ProbedLayer>,
    layout: Layout,
    params: Vec<f64>,
    x: Vec<InputMatrix>,
    c_out: usize,
    dropout: Option<Vec<Stream>>,
    masks: Vec<NamedArray>,
    settings: GradcheckSettings,
}

/// A layer with its geometry, which arrays describe.
trait ProbedLayer: Checkable {
    fn geometry_arrays(&self) -> Vec<NamedArray>;
}

/// A layer that owns what describes its geometry.
struct Probed<L, G> {
    layer: L,
    geometry: G,
}

impl<L: Layer<f64>, G: Borrow<L::Geometry>> Checkable for Probed<L, G> {
    fn param_ranges(&self) -> Vec<Range<usize>> {
        self.layer.param_ranges()
    }

    fn infer(&self, pass: &Inference<f64>, x: Operand<f64>) -> Buffer<f64> {
        Bound { layer: &self.layer, geometry: self.geometry.borrow() }.infer(pass, x)
    }

    fn passes(&self, arena: &Arena<f64>, jobs: Vec<Job>, order: Order) -> Vec<Passed> {
        Bound { layer: &self.layer, geometry: self.geometry.borrow() }.passes(arena, jobs, order)
    }
}

impl<L: Layer<f64>, G: Borrow<L::Geometry> + ProbeGeometry> ProbedLayer for Probed<L, G> {
    fn geometry_arrays(&self) -> Vec<NamedArray> {
        self.geometry.arrays("geometry")
    }
}

impl LayerCase {
    /// With initial parameters; `x` is read side by side.
    pub fn new<L: Layer<f64> + 'static, G: Borrow<L::Geometry> + ProbeGeometry + 'static>(
        build: impl FnOnce(&mut Layout) -> L,
        geometry: G,
        x: Vec<InputMatrix>,
        c_out: usize,
    ) -> Self {
        let mut layout = Layout::default();
        let layer = Box::new(Probed { layer: build(&mut layout), geometry });
        let params = layout.init_params(1);
        let settings =
            GradcheckSettings { max_elements: MAX_ELEMENTS, ..GradcheckSettings::default() };
        let (dropout, masks) = (None, Vec::new());
        LayerCase { layer, layout, params, x, c_out, dropout, masks, settings }
    }

    pub fn params(mut self, params: impl FnOnce(&Layout) -> Vec<f64>) -> Self {
        self.params = params(&self.layout);
        self
    }

    pub fn step(mut self, step: f64) -> Self {
        self.settings.step = step;
        self
    }

    /// Draws from `streams`, which give the factors `masks`.
    pub fn dropout(mut self, streams: Vec<Stream>, masks: Vec<NamedArray>) -> Self {
        (self.dropout, self.masks) = (Some(streams), masks);
        self
    }

    pub fn named(self, name: &'static str, formula: &'static str) -> SuiteCase {
        SuiteCase { name, formula, constants: Vec::new(), checked: Box::new(self) }
    }

    fn with_numbers<R>(&self, use_numbers: impl FnOnce(&Numbers, &dyn Checkable) -> R) -> R {
        let parts: Vec<Operand<f64>> = self.x.iter().map(InputMatrix::operand).collect();
        let x = match &parts[..] {
            [x] => *x,
            _ => Operand::Concat(&parts),
        };
        let LayerCase { layout, params, dropout, .. } = self;
        let numbers = Numbers { layout, params, x, dropout: dropout.as_deref() };
        use_numbers(&numbers, &*self.layer)
    }

    fn geometry_arrays(&self) -> Vec<NamedArray> {
        let mut arrays = self.layer.geometry_arrays();
        let shapes =
            self.x.iter().find_map(|x| x.shapes.as_ref()).map(|s| shape_array("geometry", s));
        arrays.extend(shapes.filter(|new| arrays.iter().all(|array| array.name != new.name)));
        arrays
    }
}

impl Checked for LayerCase {
    fn check(&self) -> Result<GradientReport> {
        self.with_numbers(|numbers, of| check_layer(numbers, of, &self.settings))
    }

    fn controls(&self) -> Result<Vec<Control>> {
        let settings =
            GradcheckSettings { max_elements: MOST_OF_CONTROLS, ..self.settings.clone() };
        self.with_numbers(|numbers, of| controls_of_layer(numbers, of, &settings, LIMIT))
    }

    fn record(&self, fixture: &mut Fixture) {
        let x: Vec<Vec<f64>> = self.x.iter().map(|x| x.values.clone()).collect();
        let run = |dy: Option<&[f64]>| {
            self.with_numbers(|case, of| passes::run(case, of, &x, &self.params, dy))
        };
        let n = run(None).y.len();
        let dy = gradcheck::output_gradient(n, &self.settings);
        let step = run(Some(&dy));
        let Layout { params, buffers } = &self.layout;
        let names = passes::matrix_names(x.len());
        for (name, x) in names.iter().zip(&self.x) {
            fixture.add(&format!("input.{name}"), "input", &x.shape(), &x.values);
        }
        fixture.add_tensors(PARAM, params, &self.params);
        fixture.add_tensors(BEFORE, buffers, &self.layout.init_buffers::<f64>());
        fixture.arrays.extend(self.geometry_arrays());
        fixture.arrays.extend(self.masks.iter().cloned());
        let shape = [n / self.c_out, self.c_out];
        fixture.add("y", "output", &shape, &step.y);
        fixture.add_tensors(AFTER, buffers, &step.buffers);
        fixture.add("dy", "factors of the output in sum(dy * y)", &shape, &dy);
        for ((name, x), dx) in names.iter().zip(&self.x).zip(&step.dx) {
            fixture.add(&format!("grad.{name}"), GRAD.1, &x.shape(), dx);
        }
        fixture.add_tensors(GRAD, params, &step.grads);
    }

    #[cfg(test)]
    fn hidden(&self) -> Vec<String> {
        let x: Vec<Vec<f64>> = self.x.iter().map(|x| x.values.clone()).collect();
        let mut hidden = Vec::new();
        for m in 0..x.len() {
            for k in 0..x[m].len() {
                let is_hidden = hides(|value| {
                    let mut x = x.clone();
                    x[m][k] = value.unwrap_or(x[m][k]);
                    let params = &self.params;
                    self.with_numbers(|case, of| passes::run(case, of, &x, params, None)).y.to_vec()
                });
                hidden.extend(is_hidden.then(|| format!("x[{m}][{k}]")));
            }
        }
        for k in 0..self.params.len() {
            let is_hidden = hides(|value| {
                let mut params = self.params.clone();
                params[k] = value.unwrap_or(params[k]);
                self.with_numbers(|case, of| passes::run(case, of, &x, &params, None)).y.to_vec()
            });
            hidden.extend(is_hidden.then(|| format!("parameter {k}")));
        }
        hidden
    }
}

/// Whether a number that the output depends on may be NaN while the whole output is finite; `output` is that for
/// another value of the number, or for its own.
#[cfg(test)]
fn hides(output: impl Fn(Option<f64>) -> Vec<f64>) -> bool {
    let own = output(None);
    let is_read = || [1e6, -1e6].into_iter().any(|large| output(Some(large)) != own);
    output(Some(f64::NAN)).iter().all(|y| y.is_finite()) && is_read()
}

/// A vector that a loss depends on.
pub(super) struct LossInput {
    pub name: &'static str,
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

/// What one pass of a [`LossCase`] computes.
pub(super) struct LossStep {
    pub loss: f64,
    /// One for each input; none if they were not wanted.
    pub gradients: Vec<Vec<f64>>,
    /// Running statistics afterwards.
    pub buffers: Vec<f64>,
    /// Further results.
    pub outputs: Vec<NamedArray>,
}

/// The loss from the inputs; with gradients if they are wanted.
type LossFunction = Box<dyn Fn(&[Vec<f64>], bool) -> LossStep>;

/// The loss at the end of a network, or alone.
pub(super) struct LossCase {
    /// Tensors of a network whose parameters are the first input; empty if there is none.
    pub layout: Layout,
    pub inputs: Vec<LossInput>,
    /// What the loss is not differentiated by.
    pub fixed: Vec<NamedArray>,
    pub run: LossFunction,
    pub max_elements: usize,
}

impl LossCase {
    fn vectors(&self) -> Vec<(&str, &[f64])> {
        self.inputs.iter().map(|input| (input.name, &input.values[..])).collect()
    }

    fn forward(&self, v: &[Vec<f64>]) -> Vec<f64> {
        vec![(self.run)(v, false).loss]
    }

    fn backward(&self, v: &[Vec<f64>], dy: &[f64]) -> Vec<Vec<f64>> {
        let mut gradients = (self.run)(v, true).gradients;
        gradients.iter_mut().flatten().for_each(|g| *g *= dy[0]);
        gradients
    }

    /// The tensor and the place in it of an element of the first input.
    fn tensor_of(&self, index: usize) -> Option<(&Entry, usize)> {
        let entry = self.layout.params.iter().find(|entry| entry.range.contains(&index))?;
        Some((entry, index - entry.range.start))
    }
}

impl Checked for LossCase {
    fn check(&self) -> Result<GradientReport> {
        let settings =
            GradcheckSettings { max_elements: self.max_elements, ..GradcheckSettings::default() };
        let backward = |v: &[Vec<f64>], dy: &[f64]| self.backward(v, dy);
        let forward = |v: &[Vec<f64>]| self.forward(v);
        let mut report = gradcheck::function(&self.vectors(), forward, backward, &settings)?;
        let first = report.worst.iter_mut().find(|worst| worst.name == self.inputs[0].name);
        if let Some(worst) = first
            && let Some((entry, index)) = self.tensor_of(worst.index)
        {
            (worst.name, worst.index) = (entry.name.clone(), index);
        }
        Ok(report)
    }

    /// None of a network: its layers have theirs.
    fn controls(&self) -> Result<Vec<Control>> {
        if !self.layout.params.is_empty() {
            return Ok(Vec::new());
        }
        let settings =
            GradcheckSettings { max_elements: MOST_OF_CONTROLS, ..GradcheckSettings::default() };
        let backward = |v: &[Vec<f64>], dy: &[f64]| self.backward(v, dy);
        let forward = |v: &[Vec<f64>]| self.forward(v);
        gradcheck::negative_control(&self.vectors(), forward, backward, &settings, LIMIT)
    }

    fn record(&self, fixture: &mut Fixture) {
        let values: Vec<Vec<f64>> = self.inputs.iter().map(|i| i.values.clone()).collect();
        let step = (self.run)(&values, true);
        let Layout { params, buffers } = &self.layout;
        let n_networks = usize::from(!params.is_empty());
        if n_networks == 1 {
            fixture.add_tensors(PARAM, params, &values[0]);
            fixture.add_tensors(BEFORE, buffers, &self.layout.init_buffers::<f64>());
        }
        for input in &self.inputs[n_networks..] {
            fixture.add(&format!("input.{}", input.name), "input", &input.shape, &input.values);
        }
        fixture.arrays.extend(self.fixed.iter().cloned());
        fixture.arrays.extend(step.outputs);
        fixture.add("y", "loss", &[], &[step.loss]);
        if n_networks == 1 {
            fixture.add_tensors(AFTER, buffers, &step.buffers);
            fixture.add_tensors(LOSS_GRAD, params, &step.gradients[0]);
        }
        for (input, d) in self.inputs.iter().zip(&step.gradients).skip(n_networks) {
            fixture.add(&format!("grad.{}", input.name), LOSS_GRAD.1, &input.shape, d);
        }
    }

    #[cfg(test)]
    fn hidden(&self) -> Vec<String> {
        let values: Vec<Vec<f64>> = self.inputs.iter().map(|i| i.values.clone()).collect();
        let mut hidden = Vec::new();
        for (m, input) in self.inputs.iter().enumerate() {
            // Of the many parameters of a network, the first and the last of each tensor.
            let ends = self.layout.params.iter().flat_map(|e| [e.range.start, e.range.end - 1]);
            let places: Vec<usize> = match m == 0 && !self.layout.params.is_empty() {
                true => ends.collect(),
                false => (0..input.values.len()).collect(),
            };
            for k in places {
                let is_hidden = hides(|value| {
                    let mut values = values.clone();
                    values[m][k] = value.unwrap_or(values[m][k]);
                    vec![(self.run)(&values, false).loss]
                });
                hidden.extend(is_hidden.then(|| format!("{}[{k}]", input.name)));
            }
        }
        hidden
    }
}

impl LossCase {
    pub fn named(self, name: &'static str, formula: &'static str) -> SuiteCase {
        SuiteCase { name, formula, constants: Vec::new(), checked: Box::new(self) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::gradcheck::suite::{LIMIT, Suite};
    use crate::nn::operand::OperandGradient;
    use crate::nn::pass::{Backward, Training};
    use crate::nn::relu::Relu;

    /// A ReLU whose backward pass forgets it.
    struct Forgetful;

    impl Layer<f64> for Forgetful {
        type Geometry = ();
        type Saved = ();

        fn param_ranges(&self) -> Vec<Range<usize>> {
            Vec::new()
        }

        fn forward(&self, pass: &Inference<f64>, (): &(), x: Operand<f64>) -> Buffer<f64> {
            Relu.forward(pass, &(), x)
        }

        fn forward_train(
            &self,
            pass: &mut Training<f64>,
            (): &(),
            x: Operand<f64>,
        ) -> (Buffer<f64>, ()) {
            Relu.forward_train(pass, &(), x)
        }

        fn backward(
            &self,
            pass: &mut Backward<f64>,
            (): &(),
            x: Operand<f64>,
            (): (),
            dy: Buffer<f64>,
        ) -> OperandGradient<f64> {
            OperandGradient::of_matrix(pass.arena, x, dy)
        }
    }

    #[test]
    fn a_layer_with_a_wrong_backward_pass_is_caught() {
        let x = || vec![InputMatrix::probe(10, 4, 1)];
        let wrong = LayerCase::new(|_| Forgetful, (), x(), 4).named("wrong", "y = max(x, 0)");
        let report = wrong.check().unwrap();
        let message = report.require(LIMIT).unwrap_err().to_string();
        assert!(message.starts_with("gradient x["), "{message}");
        assert_eq!((report.worst().numeric, report.worst().error), (0.0, 1.0));
        let right = LayerCase::new(|_| Relu, (), x(), 4).named("right", "y = max(x, 0)");
        right.check().unwrap().require(LIMIT).unwrap();
        let [wrong, right] = [wrong, right].map(|case| case.fixture());
        assert_eq!(wrong.get("y"), right.get("y"));
        assert_ne!(wrong.get("grad.x"), right.get("grad.x"));
    }

    #[test]
    fn a_check_of_every_layer_fails_where_it_must() {
        for case in Suite::default().layer_cases().unwrap() {
            let controls = case.controls().unwrap_or_else(|e| panic!("{}: {e}", case.name()));
            let n_failed = controls.iter().filter(|control| !control.is_lost).count();
            assert!(n_failed >= 3, "{}", case.name());
        }
    }

    /// A NaN in an input or a parameter shows in the output, of every layer, block and network.
    #[test]
    fn nothing_hides_a_nan() {
        for case in Suite::default().cases().unwrap() {
            let hidden = case.checked.hidden();
            assert_eq!(hidden, Vec::<String>::new(), "{}", case.name());
        }
    }
}
