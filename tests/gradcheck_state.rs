//! Mistakes of layers, and of functions between calls, in memory that nobody wrote, or where numbers are none: the kit
//! of gradient checks catches each, and passes the right one.

use deepmill::gradcheck::{
    self, Case, GradcheckSettings, function, layer, negative_control, probe,
};
use deepmill::nn::arena::{Arena, Buffer};
use deepmill::nn::layer::Layer;
use deepmill::nn::operand::{Operand, OperandGradient};
use deepmill::nn::params::{Init, Layout};
use deepmill::nn::pass::{Backward, Inference, Training};
use deepmill::{Error, Result};
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::ops::Range;

const LIMIT: f64 = 1e-7;

#[derive(Clone, Copy, PartialEq, Debug)]
enum Mistake {
    None,
    /// Keeps the input of its last pass.
    StaleCache,
    /// Names no tensor.
    ForgottenTensor,
    /// Names a range that is no tensor.
    NoTensor,
    TwiceNamed,
    /// Sets the gradient of its tensor.
    Assigns,
    LongerInference,
    /// Keeps the input of its first pass.
    FirstInput,
    /// Keeps the parameters of its first pass.
    FirstParams,
    /// Keeps the parameters of its last pass.
    LastParams,
    /// Takes inputs in the order in which they came.
    Queue,
    /// Adds to what the arena gives.
    OutputOnLeftovers,
    GradientOnLeftovers,
    /// The greatest of the output and what the arena gives.
    GreatestOfLeftovers,
    InferenceOnLeftovers,
    InferenceIsNan,
    /// Other numbers from the second time on.
    InferenceCounts,
    /// Training adds how often inference ran.
    InferenceMoves,
    /// Inference keeps its first parameters.
    InferenceKeepsParams,
    OtherInference,
    /// Sets the gradient of another tensor to 0.
    ClearsOthers,
    OutputIsNan,
}

/// `y = w · x`, elementwise.
struct Scaled {
    weight: Range<usize>,
    other: Range<usize>,
    mistake: Mistake,
    inputs: RefCell<VecDeque<Vec<f64>>>,
    params: RefCell<Vec<f64>>,
    n_inferences: Cell<u32>,
}

impl Scaled {
    /// Checks the layer, alone or beside running statistics of others.
    fn check(mistake: Mistake, beside_statistics: bool) -> Result<()> {
        let mut layout = Layout::default();
        let other = layout.param("other", &[2], Init::Constant(0.3));
        let weight = layout.param("scaled.weight", &[1], Init::Constant(0.7));
        if beside_statistics {
            layout.buffer("other.mean", &[1], Init::Constant(0.0));
        }
        let (params, x) = (layout.init_params(1), probe(6, 2));
        let (inputs, params_then) = (RefCell::default(), RefCell::default());
        let n_inferences = Cell::new(0);
        let scaled = Scaled { weight, other, mistake, inputs, params: params_then, n_inferences };
        let case = Case::new(&layout, &params, &(), Operand::new(&x, 2));
        layer(&scaled, &case, &GradcheckSettings::default())?.require(LIMIT)
    }

    fn times(&self, factor: f64, x: &Operand<f64>, arena: &Arena<f64>) -> Buffer<f64> {
        let mut y = arena.get(x.numbers().len());
        if self.mistake != Mistake::OutputOnLeftovers
            && self.mistake != Mistake::GreatestOfLeftovers
        {
            y.fill(0.0);
        }
        for (y, x) in y.iter_mut().zip(x.numbers()) {
            match self.mistake {
                Mistake::GreatestOfLeftovers => *y = y.max(factor * x),
                _ => *y += factor * x,
            }
        }
        y
    }
}

impl Layer<f64> for Scaled {
    type Geometry = ();
    type Saved = Vec<f64>;

    fn param_ranges(&self) -> Vec<Range<usize>> {
        match self.mistake {
            Mistake::ForgottenTensor => vec![],
            Mistake::NoTensor => vec![self.weight.clone(), 1..3],
            Mistake::TwiceNamed => vec![self.weight.clone(), self.weight.clone()],
            _ => vec![self.weight.clone()],
        }
    }

    fn forward(&self, pass: &Inference<f64>, (): &(), x: Operand<f64>) -> Buffer<f64> {
        let n = self.n_inferences.replace(self.n_inferences.get() + 1);
        let mut factor = pass.params[self.weight.start];
        match self.mistake {
            Mistake::InferenceCounts => factor += f64::from(n),
            Mistake::OtherInference => factor *= 1.001,
            Mistake::LongerInference => return pass.arena.copy_of(&[0.0; 7]),
            Mistake::InferenceIsNan => factor = f64::NAN,
            Mistake::InferenceOnLeftovers => return pass.arena.get(x.numbers().len()),
            Mistake::InferenceKeepsParams => {
                let mut params = self.params.borrow_mut();
                if params.is_empty() {
                    params.push(factor);
                }
                factor = params[0];
            }
            _ => {}
        }
        self.times(factor, &x, pass.arena)
    }

    fn forward_train(
        &self,
        pass: &mut Training<f64>,
        (): &(),
        x: Operand<f64>,
    ) -> (Buffer<f64>, Vec<f64>) {
        let factor = pass.params[self.weight.start];
        let (mut inputs, mut params) = (self.inputs.borrow_mut(), self.params.borrow_mut());
        if self.mistake == Mistake::StaleCache {
            inputs.clear();
        }
        if self.mistake == Mistake::Queue || inputs.is_empty() {
            inputs.push_back(x.numbers().to_vec());
        }
        match self.mistake {
            Mistake::FirstParams if params.is_empty() => params.push(factor),
            Mistake::LastParams => *params = vec![factor],
            _ => {}
        }
        let mut y = self.times(factor, &x, pass.arena);
        match self.mistake {
            Mistake::OutputIsNan => y[3] = f64::NAN,
            Mistake::InferenceMoves => y[0] += f64::from(self.n_inferences.get()),
            _ => {}
        }
        (y, x.numbers().to_vec())
    }

    fn backward(
        &self,
        pass: &mut Backward<f64>,
        (): &(),
        x: Operand<f64>,
        saved: Vec<f64>,
        dy: Buffer<f64>,
    ) -> OperandGradient<f64> {
        let x_then = match self.mistake {
            Mistake::FirstInput | Mistake::StaleCache => self.inputs.borrow()[0].clone(),
            Mistake::Queue => self.inputs.borrow_mut().pop_front().expect("a forward pass"),
            _ => saved,
        };
        let factor = match self.mistake {
            Mistake::FirstParams | Mistake::LastParams => self.params.borrow()[0],
            _ => pass.params[self.weight.start],
        };
        let dw: f64 = x_then.iter().zip(&*dy).map(|(x, dy)| x * dy).sum();
        let place = &mut pass.grads(&self.weight)[0];
        match self.mistake {
            Mistake::Assigns => *place = dw,
            _ => *place += dw,
        }
        if self.mistake == Mistake::ClearsOthers {
            pass.grads(&self.other).fill(0.0);
        }
        let mut dx = pass.arena.get(dy.len());
        if self.mistake != Mistake::GradientOnLeftovers {
            dx.fill(0.0);
        }
        dx.iter_mut().zip(&*dy).for_each(|(dx, dy)| *dx += factor * dy);
        OperandGradient::of_matrix(pass.arena, x, dx)
    }
}

#[test]
fn a_right_layer_passes_and_each_mistake_is_named() {
    let mistakes = [
        (Mistake::StaleCache, "others after a second forward pass"),
        (Mistake::ForgottenTensor, "without scaled.weight, which changes the output"),
        (Mistake::NoTensor, "param_ranges is 1..3, which is no tensor"),
        (Mistake::TwiceNamed, "param_ranges is 2..3 twice"),
        (Mistake::Assigns, "for scaled.weight[0] where"),
        (Mistake::LongerInference, "output of inference is 7 numbers"),
        (Mistake::FirstInput, "gradient scaled.weight[0]"),
        (Mistake::FirstParams, "gradient x["),
        (Mistake::LastParams, "after a second forward pass"),
        (Mistake::Queue, "gradient is "),
        (Mistake::OutputOnLeftovers, "output is another one where buffers of the arena held NaN"),
        (
            Mistake::GradientOnLeftovers,
            "gradient is another one where buffers of the arena held NaN",
        ),
        (Mistake::GreatestOfLeftovers, "output is another one where buffers"),
        (Mistake::InferenceOnLeftovers, "output of inference is another one where buffers"),
        (Mistake::InferenceIsNan, "output of inference is NaN at place 0"),
        (Mistake::InferenceCounts, "output of inference"),
        (Mistake::InferenceMoves, "output is another one after inference"),
        (Mistake::InferenceKeepsParams, "output of inference"),
        (Mistake::OtherInference, "output of inference"),
        (Mistake::ClearsOthers, "gradient is 0 for other[0] where"),
        (Mistake::OutputIsNan, "output is NaN at place 3"),
    ];
    for beside_statistics in [false, true] {
        Scaled::check(Mistake::None, beside_statistics).unwrap();
        for (mistake, words) in mistakes {
            let message = Scaled::check(mistake, beside_statistics).expect_err("a mistake");
            assert!(message.to_string().contains(words), "{mistake:?}: {message}");
        }
    }
}

#[test]
fn parameters_are_as_many_as_in_the_layout() {
    let mut layout = Layout::default();
    let linear = deepmill::nn::linear::Linear::new(&mut layout, "linear", 3, 2, true);
    let x = probe(12, 1);
    for n in [0, 5, 9] {
        let params = probe(n, 1);
        let case = Case::new(&layout, &params, &(), Operand::new(&x, 3));
        let message = layer(&linear, &case, &GradcheckSettings::default()).unwrap_err().to_string();
        assert!(
            message.starts_with(&format!("number of parameters is {n}, expected 8")),
            "{message}"
        );
    }
}

fn squares(v: &[Vec<f64>]) -> Vec<f64> {
    v[0].iter().map(|x| x * x).collect()
}

fn slopes(x: &[f64], dy: &[f64]) -> Vec<Vec<f64>> {
    vec![x.iter().zip(dy).map(|(x, dy)| 2.0 * x * dy).collect()]
}

/// The check of closures, as a user holds it against a limit.
fn verdict(
    x: &[f64],
    forward: impl FnMut(&[Vec<f64>]) -> Vec<f64>,
    backward: impl FnMut(&[Vec<f64>], &[f64]) -> Vec<Vec<f64>>,
) -> Result<()> {
    function(&[("x", x)], forward, backward, &GradcheckSettings::default())?.require(LIMIT)
}

#[test]
fn what_a_closure_keeps_from_its_first_call_is_found() {
    let x = probe(5, 1);
    assert!(verdict(&x, squares, |v, dy| slopes(&v[0], dy)).is_ok());
    for of_forward in [true, false] {
        let first = RefCell::new(Vec::new());
        let keep = |v: &[Vec<f64>], keeps: bool| {
            if keeps && first.borrow().is_empty() {
                *first.borrow_mut() = v[0].clone();
            }
        };
        let forward = |v: &[Vec<f64>]| {
            keep(v, of_forward);
            squares(v)
        };
        let backward = |v: &[Vec<f64>], dy: &[f64]| {
            keep(v, true);
            slopes(&first.borrow(), dy)
        };
        assert!(verdict(&x, forward, backward).is_err(), "{of_forward}");
    }
    let n_calls = Cell::new(0);
    let later_nan = |v: &[Vec<f64>], dy: &[f64]| {
        n_calls.set(n_calls.get() + 1);
        slopes(&v[0], &if n_calls.get() > 2 { vec![f64::NAN; 5] } else { dy.to_vec() })
    };
    let message = verdict(&x, squares, later_nan).unwrap_err().to_string();
    assert!(message.contains("the second time"), "{message}");
}

#[test]
fn a_loss_whose_backward_takes_its_gradient_for_one_is_found() {
    let x = probe(5, 1);
    let loss = |v: &[Vec<f64>]| vec![squares(v).iter().sum()];
    let right = |v: &[Vec<f64>], dy: &[f64]| slopes(&v[0], &[dy[0]; 5]);
    assert!(verdict(&x, loss, right).is_ok());
    let message = verdict(&x, loss, |v, _| slopes(&v[0], &[1.0; 5])).unwrap_err().to_string();
    assert!(message.contains("of the output's gradient -2"), "{message}");
}

#[test]
fn no_number_is_a_right_gradient_or_output() {
    let x = [0.0, 1.0];
    let rectified = |v: &[Vec<f64>]| v[0].iter().map(|x| x.max(0.0)).collect();
    let at_kink = |slope: f64| {
        move |v: &[Vec<f64>], dy: &[f64]| {
            let slope = |x: &f64| if *x > 0.0 { 1.0 } else { slope };
            vec![v[0].iter().zip(dy).map(|(x, dy)| slope(x) * dy).collect()]
        }
    };
    assert!(verdict(&x, rectified, at_kink(0.0)).is_ok());
    for slope in [f64::NAN, f64::INFINITY] {
        assert!(verdict(&x, rectified, at_kink(slope)).is_err(), "{slope} at a kink");
    }
    for y in [f64::NAN, f64::INFINITY] {
        let forward = |v: &[Vec<f64>]| vec![v[0][0], v[0][1], y];
        let message = verdict(&x, forward, |_, dy| vec![dy[..2].to_vec()]).unwrap_err();
        assert!(message.to_string().starts_with("output is "), "{message}");
    }
    let settings = GradcheckSettings::default();
    let nan = |_: &[Vec<f64>], _: &[f64]| vec![vec![f64::NAN; 2]];
    let report = function(&[("x", &x)], squares, nan, &settings).unwrap();
    for limit in [f64::INFINITY, f64::NAN, 1.0] {
        assert!(report.require(limit).is_err(), "{limit}");
    }
}

#[test]
fn a_jump_is_no_kink() {
    let step = |v: &[Vec<f64>]| v[0].iter().map(|x| if *x >= 0.0 { 1.0 } else { 0.0 }).collect();
    let none = |v: &[Vec<f64>], _: &[f64]| vec![vec![0.0; v[0].len()]];
    assert!(verdict(&[0.3, -0.3], step, none).is_ok());
    assert!(verdict(&[0.0, -0.3], step, none).is_err());
    let root = |v: &[Vec<f64>]| v[0].iter().map(|x| x.abs().sqrt()).collect();
    let one = |_: &[Vec<f64>], dy: &[f64]| vec![dy.to_vec()];
    assert!(verdict(&[0.0], root, one).is_err(), "slopes without end");
}

#[test]
fn a_check_of_which_rounding_leaves_nothing_is_refused() {
    let wrong = |_: &[Vec<f64>], dy: &[f64]| vec![dy.iter().map(|dy| 1.5 * dy).collect()];
    let large = |v: &[Vec<f64>]| v[0].iter().map(|x| 1e9 + x).collect::<Vec<f64>>();
    let message = verdict(&[1.0, 2.0], large, wrong).unwrap_err().to_string();
    assert!(message.starts_with("every gradient is lost in rounding: x["), "{message}");
    for settings in [
        GradcheckSettings::default().with_step(1e-14),
        GradcheckSettings::default().with_floor(1e20),
    ] {
        let report = function(&[("x", &[1.0, 2.0])], |v| v[0].clone(), wrong, &settings).unwrap();
        assert!(matches!(report.require(LIMIT), Err(Error::Argument { .. })), "{settings:?}");
    }
    // One element that is lost is named; the other is checked.
    let both = |v: &[Vec<f64>]| vec![v[0][0], v[0][0] + 1e-12 * v[0][1]];
    let back = |_: &[Vec<f64>], dy: &[f64]| vec![vec![dy[0] + dy[1], 3e-12 * dy[1]]];
    let settings = GradcheckSettings::default();
    let report = function(&[("x", &[1.0, 1.0])], both, back, &settings).unwrap();
    report.require(LIMIT).unwrap();
    assert_eq!(report.lost().iter().map(|e| e.index).collect::<Vec<_>>(), [1]);
    assert!(report.to_string().ends_with("1 of 2 elements are lost in rounding\n"), "{report}");
}

#[test]
fn controls_need_right_gradients_and_a_limit() {
    let inputs: [(&str, &[f64]); 1] = [("x", &[1.0, 2.0])];
    let settings = GradcheckSettings::default();
    let controls = |factor: f64, limit: f64| {
        let backward = |v: &[Vec<f64>], dy: &[f64]| {
            slopes(&v[0], &dy.iter().map(|dy| factor * dy).collect::<Vec<f64>>())
        };
        negative_control(&inputs, squares, backward, &settings, limit)
    };
    assert!(!controls(1.0, LIMIT).unwrap().is_empty());
    assert!(matches!(controls(1.5, LIMIT), Err(Error::Gradient { .. })));
    for limit in [-1.0, f64::NAN, f64::INFINITY] {
        let message = controls(1.0, limit).unwrap_err().to_string();
        assert!(message.starts_with("limit is "), "{message}");
    }
}

#[test]
fn maps_of_tiny_and_of_huge_numbers_have_an_adjoint_test() {
    for factor in [1e-200, 1e-310, 1.0, 1e200] {
        let times = |by: f64| move |x: &[f64]| x.iter().map(|x| by * x).collect::<Vec<f64>>();
        let right = gradcheck::adjoint(3, 3, times(factor), times(factor)).unwrap();
        let wrong = gradcheck::adjoint(3, 3, times(factor), times(3.0 * factor)).unwrap();
        assert!(right < 1e-10 && wrong > 1e-2, "{factor}: {right} {wrong}");
    }
}
