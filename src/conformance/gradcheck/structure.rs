//! What no difference shows of a layer: places of its tensors, gradients that are added to, state, what nobody wrote,
//! inference.

use super::consistency::{displaced, first_difference, require_finite};
use super::passes::{At, Checkable, Numbers, Order, Step, run, run_all};
use super::{GradcheckSettings, output_gradient, probe};
use crate::nn::arena::Arena;
use crate::nn::pass::Inference;
use crate::{Error, Result};
use std::ops::Range;

/// What buffers of the arena hold before a layer writes them: the greater of NaN and a number is the number, which
/// hides it.
const LEFTOVERS: [f64; 3] = [f64::NAN, 1e6, -1e6];

/// All of it; an error names what does not hold.
pub(super) fn require(
    case: &Numbers,
    layer: &dyn Checkable,
    settings: &GradcheckSettings,
) -> Result<()> {
    let (found, expected) = (case.params.len(), case.layout.n_params());
    if found != expected {
        let expected = format!("{expected}, as many as in the layout");
        let remedy = "take those of Layout::init_params, or a probe of Layout::n_params";
        return Err(Error::argument("number of parameters", found, expected, remedy));
    }
    let ranges = layer.param_ranges();
    require_tensors(case, &ranges)?;
    let x: Vec<Vec<f64>> = case.x.matrices().iter().map(|m| m.numbers().to_vec()).collect();
    let params = case.params.to_vec();
    let mut near = displaced(&[&x[..], &[params]].concat(), settings);
    let near_params = near.pop().unwrap_or_default();
    // First near: what a layer keeps of its first pass must not serve the others.
    let n = run(case, layer, &near, &near_params, None).y.len();
    let y = run(case, layer, &x, case.params, None).y.to_vec();
    if y.is_empty() {
        return Ok(()); // refused by the check itself
    }
    if y.len() != n {
        let remedy = "return as many numbers for every input";
        let expected = format!("{n}, as before");
        return Err(Error::argument("length of the output", y.len(), expected, remedy));
    }
    require_finite(&y)?;
    require_all_tensors(case, layer, &ranges, (&x, &y))?;
    let dy = output_gradient(y.len(), settings);
    let alone = run(case, layer, &x, case.params, Some(&dy));
    require_own_gradients(case, &ranges, &alone)?;
    require_added(case, layer, (&x, &dy), (&ranges, &alone))?;
    require_written(case, layer, (&x, &dy), &alone)?;
    let elsewhere = run(case, layer, &near, &near_params, Some(&dy));
    let both = [(&x[..], case.params, &alone), (&near[..], &near_params[..], &elsewhere)];
    require_no_state(case, layer, &dy, both)?;
    require_inference(case, layer, (&x, &y), &near_params)
}

fn refused(
    name: &'static str,
    found: impl Into<String>,
    expected: &str,
    remedy: &str,
) -> Result<()> {
    Err(Error::argument(name, found.into(), expected, remedy))
}

/// Every range is one tensor of the layout, and none is there twice.
fn require_tensors(case: &Numbers, ranges: &[Range<usize>]) -> Result<()> {
    for (k, range) in ranges.iter().enumerate() {
        let remedy = "return what Layout::param gave, once for each tensor";
        if case.layout.params.iter().all(|entry| entry.range != *range) {
            let found = format!("{range:?}, which is no tensor");
            return refused("param_ranges", found, "ranges of the layout's tensors", remedy);
        }
        if ranges[..k].contains(range) {
            return refused("param_ranges", format!("{range:?} twice"), "each once", remedy);
        }
    }
    Ok(())
}

/// No tensor beside those of the layer changes the output.
fn require_all_tensors(
    case: &Numbers,
    layer: &dyn Checkable,
    ranges: &[Range<usize>],
    (x, y): (&[Vec<f64>], &[f64]),
) -> Result<()> {
    for entry in case.layout.params.iter().filter(|entry| !ranges.contains(&entry.range)) {
        let mut params = case.params.to_vec();
        let moves = probe(entry.range.len(), 21);
        params[entry.range.clone()].iter_mut().zip(moves).for_each(|(p, move_)| *p += move_);
        let moved = run(case, layer, x, &params, None).y;
        if moved.iter().zip(y).any(|(a, b)| a.to_bits() != b.to_bits()) {
            let found = format!("ranges without {}, which changes the output", entry.name);
            let remedy = "return the places of all tensors that the layer reads";
            return refused("param_ranges", found, "all tensors of the layer", remedy);
        }
    }
    Ok(())
}

/// No gradient of a tensor of others.
fn require_own_gradients(case: &Numbers, ranges: &[Range<usize>], alone: &Step) -> Result<()> {
    let others = case.layout.params.iter().filter(|entry| !ranges.contains(&entry.range));
    for entry in others {
        if alone.grads[entry.range.clone()].iter().any(|g| *g != 0.0) {
            let found = format!("a gradient of {}, which is of no range", entry.name);
            let remedy = "add to the gradients of the layer's own tensors alone";
            return refused("param_ranges", found, "all tensors of the layer", remedy);
        }
    }
    Ok(())
}

/// Backward adds to the gradients of its own tensors, and leaves all others as they are.
fn require_added(
    case: &Numbers,
    layer: &dyn Checkable,
    (x, dy): (&[Vec<f64>], &[f64]),
    (ranges, alone): (&[Range<usize>], &Step),
) -> Result<()> {
    let before = probe(case.params.len(), 22);
    let at = At { x, params: case.params, dy: Some(dy), grads: before.clone() };
    let filled = run_all(case, layer, vec![at], (&Arena::default(), Order::FirstFirst)).remove(0);
    for entry in &case.layout.params {
        let is_own = ranges.contains(&entry.range);
        for (k, i) in entry.range.clone().enumerate() {
            let (g, b, f) = (alone.grads[i], before[i], filled.grads[i]);
            let is_added = (f - (b + g)).abs() <= 1e-9 * (b.abs() + g.abs());
            if !is_added && !g.is_nan() {
                let found = format!("{f} for {}[{k}] where {b} was before", entry.name);
                let expected = format!("{}, the sum with {g}", b + g);
                let remedy = match is_own {
                    true => "add to the gradients: other uses of the tensor add to them too",
                    false => "leave the gradients of other layers as they are",
                };
                return refused("gradient", found, &expected, remedy);
            }
        }
    }
    Ok(())
}

/// Where two steps differ, if they do.
fn difference(a: &Step, b: &Step) -> Option<&'static str> {
    let of_inputs = || {
        let differ = |(a, b): (&Vec<f64>, &Vec<f64>)| first_difference(a, b).is_some();
        a.dx.len() != b.dx.len() || a.dx.iter().zip(&b.dx).any(differ)
    };
    // Gradients that are no numbers are found by the differences.
    let is_number = |v: &[f64]| v.iter().all(|v| !v.is_nan());
    if first_difference(&a.y, &b.y).is_some() {
        return is_number(&a.y).then_some("output");
    }
    if !a.dx.iter().all(|dx| is_number(dx)) || !is_number(&a.grads) {
        return None;
    }
    (of_inputs() || first_difference(&a.grads, &b.grads).is_some()).then_some("gradient")
}

/// Inputs, parameters, and what one step computes of them alone.
type Alone<'a> = (&'a [Vec<f64>], &'a [f64], &'a Step);

/// Two forward passes, at other inputs and parameters, before two backward passes compute what each computes alone.
fn require_no_state(
    case: &Numbers,
    layer: &dyn Checkable,
    dy: &[f64],
    both: [Alone; 2],
) -> Result<()> {
    for order in [Order::FirstFirst, Order::LastFirst] {
        let at = both.map(|(x, params, _)| {
            let grads = vec![0.0; params.len()];
            At { x, params, dy: Some(dy), grads }
        });
        let together = run_all(case, layer, at.into(), (&Arena::default(), order));
        for (step, (_, _, alone)) in together.iter().zip(&both) {
            if let Some(name) = difference(alone, step) {
                let found = "others after a second forward pass";
                let remedy =
                    "keep what backward needs in what forward_train returns, not in the layer";
                return refused(name, found, "those of each forward pass alone", remedy);
            }
        }
    }
    Ok(())
}

/// What buffers of the arena hold before they are written changes nothing.
fn require_written(
    case: &Numbers,
    layer: &dyn Checkable,
    (x, dy): (&[Vec<f64>], &[f64]),
    alone: &Step,
) -> Result<()> {
    let params = case.params;
    for left in LEFTOVERS {
        let at = At { x, params, dy: Some(dy), grads: vec![0.0; params.len()] };
        let arena = Arena::filled_with(left);
        let step = run_all(case, layer, vec![at], (&arena, Order::FirstFirst)).remove(0);
        if let Some(name) = difference(alone, &step) {
            return refused_leftovers(name, left);
        }
    }
    Ok(())
}

fn refused_leftovers(name: &'static str, left: f64) -> Result<()> {
    let found = format!("another one where buffers of the arena held {left} before");
    let remedy = "write every number of Arena::get before it is read, or take Arena::zeroed";
    refused(name, found, "the same whatever they held", remedy)
}

/// Inference computes what training without dropout does, where no running statistics part them, again and again, and
/// changes nothing.
fn require_inference(
    case: &Numbers,
    layer: &dyn Checkable,
    (x, y): (&[Vec<f64>], &[f64]),
    near_params: &[f64],
) -> Result<()> {
    let buffers = case.layout.init_buffers::<f64>();
    let moves = probe(buffers.len(), 23);
    let moved: Vec<f64> = buffers.iter().zip(moves).map(|(b, m)| b + 0.25 * m.abs()).collect();
    let infer = |params: &[f64], buffers: &[f64], arena: &Arena<f64>| {
        layer.infer(&Inference { params, buffers, arena }, case.x).to_vec()
    };
    let arena = &Arena::default();
    infer(near_params, &buffers, arena); // what a layer keeps of it must not serve the others
    let inferred = infer(case.params, &buffers, arena);
    if inferred.len() != y.len() {
        let (found, expected) = (format!("{} numbers", inferred.len()), y.len().to_string());
        let remedy = "return as many as in training";
        return refused("output of inference", found, &expected, remedy);
    }
    if let Some(k) = inferred.iter().position(|v| v.is_nan()) {
        let remedy = "compute what training does";
        return refused("output of inference", format!("NaN at place {k}"), "a number", remedy);
    }
    for left in LEFTOVERS {
        let again = infer(case.params, &buffers, &Arena::filled_with(left));
        if first_difference(&inferred, &again).is_some() {
            return refused_leftovers("output of inference", left);
        }
    }
    let again = infer(case.params, &buffers, arena);
    let trained = run(case, layer, x, case.params, None).y;
    if first_difference(&inferred, &again).is_some() || first_difference(y, &trained).is_some() {
        let remedy = "change nothing in inference";
        return refused("output", "another one after inference", "the same as before", remedy);
    }
    let reads_buffers = first_difference(&inferred, &infer(case.params, &moved, arena)).is_some();
    if reads_buffers {
        return Ok(());
    }
    let plain = Numbers { dropout: None, ..*case };
    let trained = run(&plain, layer, x, case.params, None).y;
    match first_difference(&trained, &inferred) {
        None => Ok(()),
        Some(k) => {
            let found = format!("{} at place {k}", inferred[k]);
            let remedy = "compute the same: no running statistics part them";
            let expected = format!("{}, as in training", trained[k]);
            refused("output of inference", found, &expected, remedy)
        }
    }
}
