//! Sites that the linear axes of a machine do not come to.
//!
//! # Definition
//!
//! For a tool axis the rotary axes of the machine are fixed, and the part with them. It is placed so that its middle is
//! in the middle of the strokes along the machine's x and y, and its highest place at the upper end of z. A site is
//! *beyond the strokes* iff it is not within them. Of two ways to set a tool axis one suffices.

use super::candidates::{Candidate, Candidates};
use super::turned::range;
use crate::geom::{Mesh, Sites};
use glam::{DMat3, DVec3};

/// A bit per site.
pub(super) type Bits = Vec<u64>;

/// A site as little as this beyond a stroke is within it, mm: sites are kept in single precision.
const ROUNDING_MM: f64 = 1e-3;

/// Per tool axis of a candidate the sites beyond the strokes, or none if there are none. Empty if the part is within
/// the strokes however it is turned.
pub(super) fn beyond(
    candidates: &Candidates,
    candidate: &Candidate,
    part: &Mesh,
    sites: &Sites,
) -> Vec<Option<Bits>> {
    let Some(machine) = candidates.machine().axes() else { return Vec::new() };
    let strokes = machine.strokes_mm();
    let (low, high) = part.bounds().unwrap_or_default();
    if (high - low).length() <= strokes.min_element() {
        return Vec::new();
    }
    let turn = DMat3::from_cols_array_2d(&candidates.turn_of(candidate).map(|row| row.to_array()));
    let (turn, vectors) = (turn.transpose(), candidates.directions().vectors());
    let of_axis = |&number: &u32| {
        let tool_axis = turn * vectors[number as usize].as_dvec3();
        let mut beyond: Option<Bits> = None;
        for turned in machine.part_turns(tool_axis) {
            let place = Place::of(part, turned * turn, strokes)?;
            let bits = place.beyond(sites);
            match &mut beyond {
                None => beyond = Some(bits),
                Some(both) => both.iter_mut().zip(bits).for_each(|(a, b)| *a &= b),
            }
        }
        beyond
    };
    candidate.axes.iter().map(of_axis).collect()
}

/// What the linear axes come to, in the coordinates of the part.
struct Place {
    axes: [DVec3; 3],
    ranges: [[f64; 2]; 3],
}

impl Place {
    /// None if the part is within the strokes.
    fn of(part: &Mesh, turn: DMat3, strokes: DVec3) -> Option<Place> {
        let axes = [0, 1, 2].map(|k| turn.row(k));
        let extents = axes.map(|axis| range(part, axis));
        let is_within = |k: usize| extents[k][1] - extents[k][0] <= strokes[k];
        if (0..3).all(is_within) {
            return None;
        }
        let ranges = [0, 1, 2].map(|k| {
            let ([low, high], stroke) = (extents[k], strokes[k]);
            match k {
                2 => [high - stroke, high],
                _ => [0.5 * (low + high) - 0.5 * stroke, 0.5 * (low + high) + 0.5 * stroke],
            }
        });
        Some(Place { axes, ranges })
    }

    fn beyond(&self, sites: &Sites) -> Bits {
        let mut bits = vec![0; sites.len().div_ceil(64)];
        for (i, point) in sites.points.iter().enumerate() {
            let is_beyond = |(axis, [low, high]): (&DVec3, &[f64; 2])| {
                let x = axis.dot(point.as_dvec3());
                x < low - ROUNDING_MM || x > high + ROUNDING_MM
            };
            if self.axes.iter().zip(&self.ranges).any(is_beyond) {
                bits[i / 64] |= 1 << (i % 64);
            }
        }
        bits
    }
}

#[cfg(test)]
mod tests;
