//! The passes of a layer, as vectors that a check can differentiate.

use crate::nn::arena::{Arena, Buffer};
use crate::nn::layer::Layer;
use crate::nn::operand::Operand;
use crate::nn::params::{Entry, Layout};
use crate::nn::pass::{Backward, Inference, Training};
use crate::numeric::rng::Stream;
use std::ops::Range;

/// A [`Layer`] with what its passes take, as one call of [`layer()`](super::layer()) checks it.
///
/// Dropout is drawn alike in every pass, so that what it does is a linear map with a gradient.
///
/// ```
/// use deepmill::gradcheck::{self, Case, GradcheckSettings};
/// use deepmill::nn::{dropout::Dropout, operand::Operand, params::Layout};
/// use deepmill::rng::{Purpose, Stream};
///
/// let (layout, x) = (Layout::default(), gradcheck::probe(40, 1)); // no parameters; four rows of ten
/// let streams: Vec<Stream> = (0..4).map(|row| Stream::new(3, 0, row, Purpose::Dropout)).collect();
/// let case = Case::new(&layout, &[], &(), Operand::new(&x, 10)).with_dropout(&streams);
/// let report = gradcheck::layer(&Dropout::new(0.4)?, &case, &GradcheckSettings::default())?;
/// report.require(1e-7)?;
/// assert_eq!((report.n_checked, report.worst[0].name.as_str()), (40, "x"));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
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

impl<'a, G: ?Sized> Case<'a, G> {
    /// Without dropout.
    pub fn new(
        layout: &'a Layout,
        params: &'a [f64],
        geometry: &'a G,
        x: Operand<'a, f64>,
    ) -> Self {
        Case { layout, params, geometry, x, dropout: None }
    }

    /// With dropout drawn from these streams.
    #[must_use]
    pub fn with_dropout(self, streams: &'a [Stream]) -> Self {
        Case { dropout: Some(streams), ..self }
    }
}

/// A [`Case`] without the layer's own types.
pub(super) struct Numbers<'a> {
    pub layout: &'a Layout,
    pub params: &'a [f64],
    pub x: Operand<'a, f64>,
    pub dropout: Option<&'a [Stream]>,
}

/// What one training pass takes.
pub(super) struct Job<'a> {
    pub params: &'a [f64],
    pub buffers: &'a mut [f64],
    pub dropout: Option<&'a mut [Stream]>,
    pub x: Operand<'a, f64>,
    /// Gradient of the output, and of the parameters, which is added to; none for a forward pass alone.
    pub dy: Option<(&'a [f64], &'a mut [f64])>,
}

/// The output, and the gradients by the matrices of the operand.
pub(super) type Passed = (Buffer<f64>, Vec<Vec<f64>>);

/// Which forward pass is the first to have its backward pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Order {
    FirstFirst,
    LastFirst,
}

/// A layer with its geometry.
pub(super) trait Checkable {
    fn param_ranges(&self) -> Vec<Range<usize>>;

    fn infer(&self, pass: &Inference<f64>, x: Operand<f64>) -> Buffer<f64>;

    /// All forward passes, then all backward passes, in the same order or the last first.
    fn passes(&self, arena: &Arena<f64>, jobs: Vec<Job>, order: Order) -> Vec<Passed>;
}

pub(super) struct Bound<'a, L, G: ?Sized> {
    pub layer: &'a L,
    pub geometry: &'a G,
}

impl<L: Layer<f64>> Checkable for Bound<'_, L, L::Geometry> {
    fn param_ranges(&self) -> Vec<Range<usize>> {
        self.layer.param_ranges()
    }

    fn infer(&self, pass: &Inference<f64>, x: Operand<f64>) -> Buffer<f64> {
        self.layer.forward(pass, self.geometry, x)
    }

    fn passes(&self, arena: &Arena<f64>, jobs: Vec<Job>, order: Order) -> Vec<Passed> {
        let Bound { layer, geometry } = *self;
        let mut done = Vec::new();
        for Job { params, buffers, dropout, x, dy } in jobs {
            let mut pass = Training { params, buffers, dropout, arena };
            let (y, saved) = layer.forward_train(&mut pass, geometry, x);
            done.push((params, x, dy, y, saved));
        }
        let backward = |(params, x, dy, y, saved): (_, _, Option<(&[f64], &mut [f64])>, _, _)| {
            let Some((dy, grads)) = dy else { return (y, Vec::new()) };
            let mut pass = Backward::new(params, grads, arena);
            let gradient = layer.backward(&mut pass, geometry, x, saved, arena.copy_of(dy));
            (y, gradient.into_parts().iter().map(|part| part.to_vec()).collect())
        };
        if order == Order::FirstFirst {
            return done.into_iter().map(backward).collect();
        }
        let mut passed: Vec<Passed> = done.into_iter().rev().map(backward).collect();
        passed.reverse();
        passed
    }
}

/// The tensors of a layer, in the order of the layout.
pub(super) fn tensors<'a>(layout: &'a Layout, ranges: &[Range<usize>]) -> Vec<&'a Entry> {
    layout.params.iter().filter(|entry| ranges.contains(&entry.range)).collect()
}

/// Inputs and tensors of a layer, with their names.
pub(super) struct Vectors {
    pub names: Vec<String>,
    pub numbers: Vec<Vec<f64>>,
}

impl Vectors {
    pub fn of(case: &Numbers, tensors: &[&Entry]) -> Self {
        let matrices = case.x.matrices();
        let mut names = matrix_names(matrices.len());
        let mut numbers: Vec<Vec<f64>> = matrices.iter().map(|m| m.numbers().to_vec()).collect();
        names.extend(tensors.iter().map(|entry| entry.name.clone()));
        numbers.extend(tensors.iter().map(|entry| case.params[entry.range.clone()].to_vec()));
        Vectors { names, numbers }
    }

    pub fn named(&self) -> Vec<(&str, &[f64])> {
        self.names.iter().map(String::as_str).zip(self.numbers.iter().map(Vec::as_slice)).collect()
    }
}

/// All parameters, with those of these tensors in place of their own.
fn params_of(case: &Numbers, tensors: &[&Entry], values: &[Vec<f64>]) -> Vec<f64> {
    let mut params = case.params.to_vec();
    for (entry, values) in tensors.iter().zip(values) {
        params[entry.range.clone()].copy_from_slice(values);
    }
    params
}

/// The output of a training pass, of matrices and tensors.
pub(super) fn forward(
    case: &Numbers,
    layer: &dyn Checkable,
    tensors: &[&Entry],
    v: &[Vec<f64>],
) -> Vec<f64> {
    let n = v.len() - tensors.len();
    run(case, layer, &v[..n], &params_of(case, tensors, &v[n..]), None).y.to_vec()
}

/// The gradients by matrices and tensors.
pub(super) fn backward(
    case: &Numbers,
    layer: &dyn Checkable,
    tensors: &[&Entry],
    v: &[Vec<f64>],
    dy: &[f64],
) -> Vec<Vec<f64>> {
    let n = v.len() - tensors.len();
    let mut step = run(case, layer, &v[..n], &params_of(case, tensors, &v[n..]), Some(dy));
    step.dx.extend(tensors.iter().map(|e| step.grads[e.range.clone()].to_vec()));
    step.dx
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
    layer: &dyn Checkable,
    x: &[Vec<f64>],
    params: &[f64],
    dy: Option<&[f64]>,
) -> Step {
    let grads = vec![0.0; params.len()];
    let all = vec![At { x, params, dy, grads }];
    run_all(case, layer, all, (&Arena::default(), Order::FirstFirst)).remove(0)
}

/// Where a training pass is, and gradients of the parameters that are there before its backward pass.
pub(super) struct At<'a> {
    pub x: &'a [Vec<f64>],
    pub params: &'a [f64],
    pub dy: Option<&'a [f64]>,
    pub grads: Vec<f64>,
}

/// Training passes one after the other, then their backward passes.
pub(super) fn run_all<'a>(
    case: &Numbers<'a>,
    layer: &dyn Checkable,
    all: Vec<At<'a>>,
    (arena, order): (&Arena<f64>, Order),
) -> Vec<Step> {
    let matrices = case.x.matrices();
    let with_numbers = |at: &At<'a>| {
        let parts = matrices.iter().zip(at.x);
        parts.map(|(matrix, x)| matrix.with_numbers(x)).collect()
    };
    let parts: Vec<Vec<Operand<f64>>> = all.iter().map(with_numbers).collect();
    let mut buffers = vec![case.layout.init_buffers(); all.len()];
    let mut streams = vec![case.dropout.map(<[Stream]>::to_vec); all.len()];
    let (inputs, mut grads): (Vec<_>, Vec<Vec<f64>>) =
        all.into_iter().map(|at| ((at.params, at.dy), at.grads)).unzip();
    let each = buffers.iter_mut().zip(&mut streams).zip(&mut grads).zip(&parts).zip(inputs);
    let jobs = each.map(|((((buffers, streams), grads), parts), (params, dy))| Job {
        params,
        buffers,
        dropout: streams.as_deref_mut(),
        x: match &parts[..] {
            [x] => *x,
            _ => Operand::Concat(parts),
        },
        dy: dy.map(|dy| (dy, &mut grads[..])),
    });
    let passed = layer.passes(arena, jobs.collect(), order);
    let each = passed.into_iter().zip(buffers).zip(grads);
    each.map(|(((y, dx), buffers), grads)| Step { y, buffers, dx, grads }).collect()
}
