//! The bound on the error of each recorded tensor, and how the error is measured.

use super::Tensors;
use crate::model::weights::tensors::Tensor;
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::path::Path;

/// Least root mean square that a gradient is measured against: smaller ones are cancellation noise.
const GRADIENT_FLOOR: f64 = 1e-3;
/// Median of the Euclidean errors over all gradients.
const MEDIAN_GATE: f64 = 5e-3;

/// One comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct GateRow {
    /// Name of the tensor in the fixture; `ops.` marks single layers, `f64.` double precision.
    pub name: String,
    /// Kind of tensor: those of a group share gate and measure.
    pub group: String,
    /// Measured error; infinite if the shapes differ or a value is NaN.
    pub error: f64,
    /// Greatest error that passes.
    pub gate: f64,
}

impl GateRow {
    /// Whether the error is within its gate.
    pub fn passed(&self) -> bool {
        self.error <= self.gate
    }

    pub(super) fn share_of_gate(&self) -> f64 {
        match (self.error == 0.0, self.gate == 0.0) {
            (true, _) => 0.0,
            (false, true) => f64::INFINITY,
            _ => self.error / self.gate,
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum Measure {
    /// Share of unequal elements.
    Unequal,
    /// `max |a - b| / max |expected|`.
    Largest,
    /// `max |a - b| / max(max |expected|, floor)`.
    LargestFloored,
    /// `|a - b| / max(|expected|, floor √n)`, Euclidean norms.
    Euclidean,
}

/// Group, measure and gate of the tensor `name`, which comes with the prefix `ops.` if it is a layer's.
///
/// float64 runs are repeatable to about 1e-8 (recorded values were rounded to float32); float32 noise was
/// measured on the reference: see the numbers beside each gate.
fn gates(name: &str) -> Option<Vec<(&'static str, Measure, f64)>> {
    use Measure::{Euclidean, Largest, LargestFloored};
    if let Some(rest) = name.strip_prefix("f64.") {
        return Some(match rest {
            _ if rest.starts_with("ops.") => vec![("f64.ops", Largest, 1e-6)],
            _ if rest.starts_with("eval.") => vec![("f64.eval", Largest, 1e-6)],
            _ if rest.starts_with("train.") => vec![("f64.train", Largest, 1e-6)],
            _ if rest.starts_with("grad.") => vec![
                ("f64.grad, Euclidean", Euclidean, 1e-6),
                ("f64.grad, largest", LargestFloored, 1e-6),
            ],
            _ if rest.starts_with("post.") => vec![("f64.post", Largest, 1e-6)],
            _ => return None,
        });
    }
    Some(match name {
        // Noise 1e-7.
        "input_feature" | "octree.points" | "octree.normals" => {
            vec![("octree means", Largest, 1e-6)]
        }
        // Noise 4e-6.
        _ if name.starts_with("eval.") => vec![("eval", Largest, 2e-5)],
        // Noise 2e-5: batch norm over few rows.
        _ if name.starts_with("ops.fc_module") => vec![("ops.fc_module", Largest, 1e-4)],
        // Noise 2e-6: weights of almost nothing.
        _ if name.starts_with("ops.interp") => vec![("ops.interp", Largest, 1e-5)],
        // Noise 5e-7.
        _ if name.starts_with("ops.") => vec![("ops", Largest, 1e-5)],
        // Noise 1e-5.
        _ if name.starts_with("train.logits_") => vec![("train.logits", Largest, 1e-4)],
        // Noise 1e-7 before the first step, 1e-4 after it; see `compare_one`.
        "train.loss" => vec![("train.loss", Largest, 1e-3)],
        // Noise 1.2e-2 and 3.2e-2: a ReLU input near zero that changes sign.
        _ if name.starts_with("grad.") => {
            vec![("grad, Euclidean", Euclidean, 4e-2), ("grad, largest", LargestFloored, 1e-1)]
        }
        // Noise 2.5e-2 after three steps.
        _ if name.starts_with("post.logits_") => vec![("post.logits", Largest, 1e-1)],
        // Noise 5e-3.
        _ if name.starts_with("post.") => vec![("post", Largest, 2e-2)],
        _ => return None,
    })
}

/// Compares every recorded tensor that is a result with ours; `prefix` goes before its name in the rows.
pub(super) fn compare(
    recorded: &BTreeMap<String, Tensor>,
    actual: &Tensors,
    prefix: &str,
    origin: &Path,
) -> Result<Vec<GateRow>> {
    let mut rows = Vec::new();
    for (recorded_name, expected) in recorded {
        let (name, stride) = split_stride(recorded_name);
        if prefix.ends_with("ops.") && !actual.0.contains_key(name) {
            continue; // an input of the operation
        }
        let full_name = format!("{prefix}{name}");
        let ours = actual.0.get(name).zip(gates_of(&full_name, expected));
        let Some((ours, gates)) = ours else {
            let found = "the comparison knows no such tensor";
            return Err(Error::file(origin, format!("tensor {name}"), found, "remove it"));
        };
        rows.extend(compare_one(&full_name, expected, ours, stride, gates));
    }
    rows.extend(median(&rows));
    Ok(rows)
}

type Gates = Vec<(&'static str, Measure, f64)>;

fn gates_of(name: &str, expected: &Tensor) -> Option<Gates> {
    match expected.is_integer() {
        true if name.starts_with("octree.") => {
            Some(vec![("octree integers", Measure::Unequal, 0.0)])
        }
        true => Some(vec![("counters", Measure::Unequal, 0.0)]),
        false => gates(name),
    }
}

fn compare_one(
    name: &str,
    expected: &Tensor,
    ours: &Tensor,
    stride: usize,
    gates: Gates,
) -> Vec<GateRow> {
    let same_shape = stride > 1 || ours.shape == expected.shape;
    let a: Vec<f64> = ours.to_f64().into_iter().step_by(stride).collect();
    let b = expected.to_f64();
    // The losses after a step are looser than the one before it.
    if name == "train.loss" && same_shape {
        let row = |name: &str, i: std::ops::Range<usize>, gate| GateRow {
            name: name.into(),
            group: "train.loss".into(),
            error: measure(Measure::Largest, &a[i.clone()], &b[i]),
            gate,
        };
        return vec![row("train.loss[0]", 0..1, 1e-5), row("train.loss[1..]", 1..b.len(), 1e-3)];
    }
    let row = |(group, kind, gate): (&str, Measure, f64)| GateRow {
        name: name.into(),
        group: group.into(),
        error: if same_shape { measure(kind, &a, &b) } else { f64::INFINITY },
        gate,
    };
    gates.into_iter().map(row).collect()
}

fn measure(kind: Measure, a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let largest = |values: &mut dyn Iterator<Item = f64>| {
        values.fold(0.0, |m: f64, v| if v.is_nan() { f64::INFINITY } else { m.max(v.abs()) })
    };
    let difference = largest(&mut a.iter().zip(b).map(|(a, b)| a - b));
    let size = largest(&mut b.iter().copied());
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let ratio = |error: f64, scale: f64| if error == 0.0 { 0.0 } else { error / scale };
    match kind {
        Measure::Unequal => a.iter().zip(b).filter(|(a, b)| a != b).count() as f64,
        Measure::Largest => ratio(difference, size),
        Measure::LargestFloored => ratio(difference, size.max(GRADIENT_FLOOR)),
        Measure::Euclidean => {
            let error = norm(&mut a.iter().zip(b).map(|(a, b)| a - b));
            let floor = GRADIENT_FLOOR * (b.len() as f64).sqrt();
            let error = ratio(error, norm(&mut b.iter().copied()).max(floor));
            if error.is_nan() { f64::INFINITY } else { error }
        }
    }
}

fn median(rows: &[GateRow]) -> Option<GateRow> {
    let errors = rows.iter().filter(|r| r.group == "grad, Euclidean").map(|r| r.error);
    let mut errors: Vec<f64> = errors.collect();
    errors.sort_by(f64::total_cmp);
    let error = *errors.get(errors.len() / 2)?;
    let group = "grad, Euclidean, median".to_string();
    Some(GateRow { name: "grad.*".into(), group, error, gate: MEDIAN_GATE })
}

/// `name#7` holds every 7th element of `name`.
pub(super) fn split_stride(name: &str) -> (&str, usize) {
    match name.rsplit_once('#').map(|(name, stride)| (name, stride.parse())) {
        Some((name, Ok(stride))) if stride > 0 => (name, stride),
        _ => (name, 1),
    }
}
