//! Differences of a function, and what of their distance from a gradient rounding, curvature and kinks explain.

use super::{Element, Forward, GradcheckSettings};
use crate::{Error, Result};

/// Steps at which a scalar function is tried.
const N_STEPS: i32 = 4;
/// Of the steps of a scalar function.
const FACTOR: f64 = 4.0;
/// Half the distance of two neighboring numbers near 1.
const EPSILON: f64 = 0.5 * f64::EPSILON;
/// Errors from here on are looked into.
const SUSPICIOUS: f64 = 1e-8;
/// The step that shows which outputs an element moves at all, in steps.
const FAR: f64 = 1024.0;
/// Smaller steps at which one-sided differences are compared, as shares of the step.
const CLOSER: [f64; 3] = [1.0, 1.0 / 8.0, 1.0 / 64.0];
/// Share of a slope by which the slopes to both sides differ at a kink, at least.
const KINK: f64 = 1e-3;
/// Share of their difference by which a subgradient may be beyond the slopes, by curvature.
const MARGIN: f64 = 1e-4;
/// The slopes at a jump grow with the step's inverse, those at a kink stay: a greater gap than that before is a jump.
const JUMP: f64 = 2.0;
/// An element is lost in rounding if an error of this share of it would be.
const LOST: f64 = 0.01;

/// A function at some vectors.
pub(super) struct Differences<'a> {
    forward: &'a mut Forward<'a>,
    vectors: Vec<Vec<f64>>,
    y: Vec<f64>,
    dy: Vec<f64>,
    floor: f64,
    /// Rounding of the largest gradient.
    of_gradients: f64,
}

/// A slope, and how far rounding may have moved it.
#[derive(Clone, Copy)]
struct Slope {
    value: f64,
    rounding: f64,
}

impl<'a> Differences<'a> {
    pub fn new(
        forward: &'a mut Forward<'a>,
        vectors: Vec<Vec<f64>>,
        (y, dy): (Vec<f64>, Vec<f64>),
        (settings, gradients): (&GradcheckSettings, &[Vec<f64>]),
    ) -> Self {
        let largest = gradients.iter().flatten().fold(0.0, |m: f64, g| m.max(g.abs()));
        let (floor, of_gradients) = (settings.floor, EPSILON * largest);
        Differences { forward, vectors, y, dy, floor, of_gradients }
    }

    /// The output with one element moved; as long as it always is.
    fn moved(&mut self, (vector, index): (usize, usize), x: f64) -> Result<Vec<f64>> {
        let old = std::mem::replace(&mut self.vectors[vector][index], x);
        let y = (self.forward)(&self.vectors);
        self.vectors[vector][index] = old;
        same_length(&y, self.y.len())?;
        Ok(y)
    }

    /// `⟨dy, high − low⟩ / width`.
    fn slope(&self, high: &[f64], low: &[f64], width: f64) -> Slope {
        let (mut sum, mut squares) = (0.0, 0.0);
        for ((high, low), dy) in high.iter().zip(low).zip(&self.dy) {
            if high != low {
                sum += (high - low) * dy;
                squares += (dy * high.abs().max(low.abs())).powi(2);
            }
        }
        Slope { value: sum / width, rounding: 2.0 * EPSILON * squares.sqrt() / width }
    }

    /// The central difference.
    fn central(&mut self, at: (usize, usize), h: f64) -> Result<Slope> {
        let x = self.vectors[at.0][at.1];
        let (high, low) = (x + h, x - h);
        let (y_high, y_low) = (self.moved(at, high)?, self.moved(at, low)?);
        Ok(self.slope(&y_high, &y_low, high - low))
    }

    /// The differences to the left and to the right.
    fn one_sided(&mut self, at: (usize, usize), h: f64) -> Result<[Slope; 2]> {
        let x = self.vectors[at.0][at.1];
        let (high, low) = (x + h, x - h);
        let (y_high, y_low) = (self.moved(at, high)?, self.moved(at, low)?);
        Ok([self.slope(&self.y, &y_low, x - low), self.slope(&y_high, &self.y, high - x)])
    }

    /// Compares an element of a gradient with the differences; and whether it is lost in rounding.
    pub fn element(
        &mut self,
        name: &str,
        (at, analytic): ((usize, usize), f64),
        step: f64,
    ) -> Result<(Element, bool)> {
        let h = step * self.vectors[at.0][at.1].abs().max(1.0);
        let (numeric, bend) = match self.y.len() {
            1 => self.extrapolated(at, h)?,
            _ => {
                let [one, two] = [self.central(at, h)?, self.central(at, 2.0 * h)?];
                let value = (4.0 * one.value - two.value) / 3.0;
                (Slope { value, rounding: one.rounding.max(two.rounding) }, 0.0)
            }
        };
        let floor = self.floor;
        let noise = floor * (numeric.rounding + self.of_gradients);
        let scale = analytic.abs().max(numeric.value.abs());
        let error = |allowance: f64| {
            let difference = (analytic - numeric.value).abs();
            if difference.is_nan() || !allowance.is_finite() {
                return f64::INFINITY;
            }
            let error = if difference == 0.0 { 0.0 } else { difference / scale };
            if error > SUSPICIOUS && difference <= allowance { 0.0 } else { error }
        };
        let mut allowance = noise + bend;
        let mut element = Element {
            name: name.into(),
            index: at.1,
            analytic,
            numeric: numeric.value,
            error: error(allowance),
            is_kink: false,
        };
        if element.error > SUSPICIOUS {
            let bend = if self.y.len() > 1 { self.bend(at, h, numeric.value)? } else { bend };
            allowance = noise + floor * self.hidden_rounding(at, h)? + bend;
            element.error = error(allowance);
        }
        let is_lost = element.error == 0.0 && error(0.0) > SUSPICIOUS && LOST * scale <= allowance;
        if element.error > SUSPICIOUS && self.is_kink(at, h, analytic)? {
            (element.error, element.is_kink) = (0.0, true);
        }
        Ok((element, is_lost))
    }

    /// The rounding of all outputs that a far greater step moves: a small one may be lost in their rounding.
    fn hidden_rounding(&mut self, at: (usize, usize), h: f64) -> Result<f64> {
        let x = self.vectors[at.0][at.1];
        let (high, low) = (self.moved(at, x + FAR * h)?, self.moved(at, x - FAR * h)?);
        let is_moved = |i: usize| high[i] != self.y[i] || low[i] != self.y[i];
        let moved = (0..self.y.len()).filter(|&i| is_moved(i));
        let squares: f64 = moved.map(|i| (self.dy[i] * self.y[i]).powi(2)).sum();
        Ok(EPSILON * squares.sqrt() / h)
    }

    /// What curvature leaves of the error, from the extrapolation of greater steps, which is 16 times that.
    fn bend(&mut self, at: (usize, usize), h: f64, value: f64) -> Result<f64> {
        let [two, four] = [self.central(at, 2.0 * h)?, self.central(at, 4.0 * h)?];
        Ok(((4.0 * two.value - four.value) / 3.0 - value).abs() / 15.0)
    }

    /// Limit of the difference for `h → 0` from steps that grow fourfold, and how far its neighbors are.
    fn extrapolated(&mut self, at: (usize, usize), h: f64) -> Result<(Slope, f64)> {
        let steps = (0..N_STEPS).map(|k| self.central(at, h * FACTOR.powi(k)));
        let column: Vec<Slope> = steps.collect::<Result<_>>()?;
        let rounding = column.iter().fold(0.0, |m: f64, slope| m.max(slope.rounding));
        let mut column: Vec<f64> = column.iter().map(|slope| slope.value).collect();
        let (mut best, mut least) = (f64::NAN, f64::INFINITY);
        let mut power = FACTOR * FACTOR;
        while column.len() > 1 {
            let next: Vec<f64> =
                column.windows(2).map(|pair| (power * pair[0] - pair[1]) / (power - 1.0)).collect();
            for (i, value) in next.iter().enumerate() {
                let error = (value - column[i]).abs().max((value - column[i + 1]).abs());
                if error < least {
                    (best, least) = (*value, error);
                }
            }
            (column, power) = (next, power * FACTOR * FACTOR);
        }
        Ok((Slope { value: best, rounding }, if least.is_finite() { least } else { 0.0 }))
    }

    /// Whether the slopes to both sides differ at every step, neither grows as at a jump, and the gradient is between
    /// them: a subgradient at a kink.
    fn is_kink(&mut self, at: (usize, usize), h: f64, analytic: f64) -> Result<bool> {
        let mut widest = f64::INFINITY;
        for share in CLOSER {
            let [left, right] = self.one_sided(at, share * h)?;
            let noise = self.floor * (left.rounding.max(right.rounding) + self.of_gradients);
            let (low, high) = (left.value.min(right.value), left.value.max(right.value));
            let margin = noise + MARGIN * (high - low);
            let gap = KINK * low.abs().max(high.abs());
            // Of NaN none of these holds.
            let differ = high - low > gap + noise && high - low <= widest;
            if !(differ && analytic >= low - margin && analytic <= high + margin) {
                return Ok(false);
            }
            widest = JUMP * (high - low) + noise;
        }
        Ok(true)
    }
}

/// An error if an output has another length than before.
pub(super) fn same_length(y: &[f64], n: usize) -> Result<()> {
    if y.len() == n {
        return Ok(());
    }
    let remedy = "return as many numbers for every input";
    Err(Error::argument("length of the output", y.len(), format!("{n}, as before"), remedy))
}
