//! What no difference shows of a layer: places of its tensors, gradients that are added to, state, inference.

use super::passes::{At, Checkable, Numbers, Step, run, run_all, tensors};
use super::{GradcheckSettings, output_gradient, probe};
use crate::nn::arena::Arena;
use crate::nn::pass::Inference;
use crate::{Error, Result};
use std::ops::Range;

/// Two ways to one number may differ by this share of the largest.
const ROUNDING: f64 = 1e-9;

/// All of it; an error names what does not hold.
pub(super) fn require(
    case: &Numbers,
    layer: &dyn Checkable,
    settings: &GradcheckSettings,
) -> Result<()> {
    let ranges = layer.param_ranges();
    require_tensors(case, &ranges)?;
    let x: Vec<Vec<f64>> = case.x.matrices().iter().map(|m| m.numbers().to_vec()).collect();
    let y = run(case, layer, &x, case.params, None).y.to_vec();
    if y.is_empty() {
        return Ok(()); // refused by the check itself
    }
    require_all_tensors(case, layer, &ranges, (&x, &y))?;
    let dy = output_gradient(y.len(), settings);
    let alone = run(case, layer, &x, case.params, Some(&dy));
    require_own_gradients(case, &ranges, &alone)?;
    require_added(case, layer, (&x, &dy), &alone)?;
    require_no_state(case, layer, (&x, &dy), &alone)?;
    require_inference(case, layer, &y)
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

/// Backward adds to the gradients of the parameters.
fn require_added(
    case: &Numbers,
    layer: &dyn Checkable,
    (x, dy): (&[Vec<f64>], &[f64]),
    alone: &Step,
) -> Result<()> {
    let before = probe(case.params.len(), 22);
    let at = At { x, params: case.params, dy: Some(dy), grads: before.clone() };
    let filled = run_all(case, layer, vec![at]).remove(0);
    for entry in tensors(case.layout, &layer.param_ranges()) {
        for (k, i) in entry.range.clone().enumerate() {
            let (g, b, f) = (alone.grads[i], before[i], filled.grads[i]);
            if (f - (b + g)).abs() > ROUNDING * (b.abs() + g.abs()) {
                let found = format!("{f} for {}[{k}] where {b} was before", entry.name);
                let expected = format!("{}, the sum with {g}", b + g);
                let remedy = "add to the gradients: other uses of the tensor add to them too";
                return refused("gradient", found, &expected, remedy);
            }
        }
    }
    Ok(())
}

/// Two forward passes before two backward passes compute what each computes alone.
fn require_no_state(
    case: &Numbers,
    layer: &dyn Checkable,
    (x, dy): (&[Vec<f64>], &[f64]),
    alone: &Step,
) -> Result<()> {
    let other: Vec<Vec<f64>> = x.iter().map(|x| x.iter().map(|x| x + 0.125).collect()).collect();
    let params = case.params;
    let at = |x| At { x, params, dy: Some(dy), grads: vec![0.0; params.len()] };
    let both = run_all(case, layer, vec![at(x), at(&other)]);
    let same = |a: &[f64], b: &[f64]| {
        let largest = a.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let differs = |(a, b): (&f64, &f64)| (a - b).abs() > ROUNDING * largest;
        a.len() == b.len() && !a.iter().zip(b).any(differs)
    };
    let is_same = same(&alone.y, &both[0].y)
        && same(&alone.grads, &both[0].grads)
        && alone.dx.len() == both[0].dx.len()
        && alone.dx.iter().zip(&both[0].dx).all(|(a, b)| same(a, b));
    if is_same {
        return Ok(());
    }
    let found = "others after a second forward pass";
    let remedy = "keep what backward needs in what forward_train returns, not in the layer";
    refused("gradient", found, "those of each forward pass alone", remedy)
}

/// Inference computes what training does, where nothing may part them.
fn require_inference(case: &Numbers, layer: &dyn Checkable, y: &[f64]) -> Result<()> {
    let (arena, buffers) = (&Arena::default(), &case.layout.init_buffers::<f64>()[..]);
    let pass = Inference { params: case.params, buffers, arena };
    let inferred = layer.infer(&pass, case.x);
    if inferred.len() != y.len() {
        let (found, expected) = (format!("{} numbers", inferred.len()), y.len().to_string());
        let remedy = "return as many as in training";
        return refused("output of inference", found, &expected, remedy);
    }
    if !buffers.is_empty() || case.dropout.is_some() {
        return Ok(());
    }
    let largest = y.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
    let differs = |(a, b): (&f64, &f64)| (a - b).abs() > ROUNDING * largest;
    match inferred.iter().zip(y).position(differs) {
        None => Ok(()),
        Some(k) => {
            let found = format!("{} at place {k}", inferred[k]);
            let remedy = "compute the same: the layer has no running statistics";
            refused("output of inference", found, &format!("{}, as in training", y[k]), remedy)
        }
    }
}
