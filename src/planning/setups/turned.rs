//! Clampings for machines with rotary axes: how the part is turned on them, and the tool axes that they reach then.

use super::kinematics::Kinematics;
use super::machine::angle;
use crate::exec::{memory, par};
use crate::geom::Mesh;
use crate::tool::directions::{DirectionSet, Directions, basis};
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Directions as near as this are one, radians.
pub(super) const SAME_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;
/// Roundings of a direction, radians.
pub(super) const ROUNDING_RAD: f64 = 1e-6;
/// Rotary axes that are candidates.
const MOST_ROTARY: usize = 12;

/// x', y' and z' along `direction`; x' along the first of `likely` that is across.
pub(super) fn upright(likely: &[Vec3], direction: Vec3) -> [DVec3; 3] {
    let w = direction.as_dvec3().normalize();
    let across = likely.iter().map(|d| d.as_dvec3()).find(|d| d.dot(w).abs() < 1e-4);
    let u = across.map_or(basis(w)[0], |d| d.reject_from_normalized(w).normalize());
    [u, w.cross(u), w]
}

/// Turned about z' by quarters.
pub(super) fn quarters_on([u, v, w]: [DVec3; 3], n_quarters: u8) -> [DVec3; 3] {
    (0..n_quarters).fold([u, v, w], |[u, v, w], _| [v, -u, w])
}

/// `likely` directions, then even ones.
pub(super) fn with_sphere(likely: &[Vec3], n_directions: usize) -> Result<Vec<Vec3>> {
    let sphere = Directions::new(DirectionSet::FibonacciSphere { n_dirs: n_directions })?;
    let is_new = |d: &&Vec3| likely.iter().all(|other| angle(*other, **d) > SAME_RAD);
    Ok(likely.iter().chain(sphere.vectors().iter().filter(is_new)).copied().collect())
}

/// The given one, or those of `likely`, up to sign.
pub(super) fn rotary_axes(given: Option<[f64; 3]>, likely: &[Vec3]) -> Vec<Vec3> {
    if let Some(axis) = given {
        return vec![DVec3::from_array(axis).normalize().as_vec3()];
    }
    let mut axes: Vec<Vec3> = Vec::new();
    // Up to sign; x before y before z.
    let of_box = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().filter(|d| likely.contains(d));
    for d in of_box.chain(likely.iter().copied()) {
        let is_new = axes.iter().all(|a| angle(*a, d).min(angle(*a, -d)) > SAME_RAD);
        if is_new && axes.len() < MOST_ROTARY {
            axes.push(d);
        }
    }
    axes
}

/// A clamping with the numbers of the tool axes that the machine reaches in it.
pub(super) struct Turned {
    pub direction: Vec3,
    pub n_quarters: u8,
    pub axes: Vec<u32>,
}

/// Clampings along each of `uprights`, turned about it by each of the `quarters`, and the directions to test: those of
/// `likely` and, of two axes, even ones over the sphere, of one axis, even ones around it and the ends of its limits.
/// Of clampings along one direction with the same tool axes the first is kept, of chucked ones along any.
///
/// # Errors
/// If `n_directions` is 0 or above a million, the lists would not fit into the memory, or no direction is reached.
pub(super) fn by_axes(
    axes: &Kinematics,
    likely: &[Vec3],
    uprights: &[Vec3],
    quarters: Range<u8>,
    n_directions: usize,
) -> Result<(Vec<Vec3>, Vec<Turned>)> {
    let places: Vec<(Vec3, u8)> =
        uprights.iter().flat_map(|d| quarters.clone().map(move |q| (*d, q))).collect();
    let n_each = likely.len().saturating_add(n_directions);
    let remedy = format!(
        "{} candidates and {n_each} directions: test fewer directions, or clamp along flat faces alone",
        places.len()
    );
    memory::require("the tool axes of setups", memory::product([places.len(), n_each, 8]), remedy)?;
    let turn = |(direction, n): (Vec3, u8)| quarters_on(upright(likely, direction), n);
    let all = match axes.n_axes() {
        1 => around(axes, likely, places.iter().map(|place| turn(*place)), n_directions)?,
        _ => with_sphere(likely, n_directions)?,
    };
    let reached: Vec<Vec<u32>> = par::map(places.len(), |j| {
        let turn = turn(places[j]);
        let is_reached = |k: &u32| {
            let axis = all[*k as usize].as_dvec3();
            axes.reaches(DVec3::from_array(turn.map(|row| row.dot(axis))))
        };
        (0..all.len() as u32).filter(is_reached).collect()
    });
    let (mut known, mut list) = (BTreeSet::new(), Vec::new());
    for (&(direction, n_quarters), axes_of) in places.iter().zip(reached) {
        let z = (!axes.is_chucked()).then(|| direction.to_array().map(f32::to_bits));
        if !axes_of.is_empty() && known.insert((z, axes_of.clone())) {
            list.push(Turned { direction, n_quarters, axes: axes_of });
        }
    }
    if list.is_empty() {
        let expected = "a machine that reaches one of the directions tested";
        let remedy = "test more directions, or correct the limits and vectors of its axes";
        return Err(Error::argument("machine", axes.to_string(), expected, remedy));
    }
    Ok(renumbered(&all, list))
}

/// Only the directions that some clamping has: each takes its time.
fn renumbered(all: &[Vec3], mut list: Vec<Turned>) -> (Vec<Vec3>, Vec<Turned>) {
    let mut is_used = vec![false; all.len()];
    list.iter().flat_map(|turned| &turned.axes).for_each(|&k| is_used[k as usize] = true);
    let (mut number, mut used) = (vec![0; all.len()], Vec::new());
    for (k, direction) in all.iter().enumerate().filter(|(k, _)| is_used[*k]) {
        number[k] = used.len() as u32;
        used.push(*direction);
    }
    list.iter_mut().flat_map(|turned| &mut turned.axes).for_each(|k| *k = number[*k as usize]);
    (used, list)
}

/// `likely`, then the directions around one axis in every clamping, each once.
fn around(
    axes: &Kinematics,
    likely: &[Vec3],
    turns: impl Iterator<Item = [DVec3; 3]>,
    n_directions: usize,
) -> Result<Vec<Vec3>> {
    // Refuses numbers out of its domain.
    Directions::new(DirectionSet::Circle { axis: [0.0, 0.0, 1.0], n_dirs: n_directions })?;
    let local: Vec<DVec3> = axes
        .angles_deg(n_directions)
        .into_iter()
        .map(|degrees| axes.tool_axis(&[degrees]))
        .collect();
    let mut all = Distinct::default();
    likely.iter().for_each(|d| all.add(*d));
    for [u, v, w] in turns {
        local.iter().for_each(|t| all.add((u * t.x + v * t.y + w * t.z).as_vec3()));
    }
    Ok(all.list)
}

/// Directions none of which is within [`ROUNDING_RAD`] of another, found by cells.
#[derive(Default)]
struct Distinct {
    list: Vec<Vec3>,
    cells: BTreeMap<[i64; 3], Vec<u32>>,
}

impl Distinct {
    fn add(&mut self, direction: Vec3) {
        /// Far wider than a rounding.
        const CELL: f64 = 1e-4;
        let cell = |offset: DVec3| {
            let place = (direction.as_dvec3() + offset) / CELL;
            place.floor().to_array().map(|x| x as i64)
        };
        let signs = |k: u8| [0, 1, 2].map(|bit| if k >> bit & 1 == 1 { 1.0 } else { -1.0 });
        let near = (0..8).map(|k| cell(DVec3::from_array(signs(k)) * ROUNDING_RAD));
        let is_same = |k: &u32| angle(self.list[*k as usize], direction) < ROUNDING_RAD;
        if near.filter_map(|c| self.cells.get(&c)).flatten().any(is_same) {
            return;
        }
        self.cells.entry(cell(DVec3::ZERO)).or_default().push(self.list.len() as u32);
        self.list.push(direction);
    }
}

/// Whether a quarter turn about z' leaves less of the part beyond the strokes of x and y.
pub(super) fn is_better_across(part: &Mesh, turn: [DVec3; 3], strokes: DVec3) -> bool {
    let extent = |axis: DVec3| {
        let [low, high] = range(part, axis);
        high - low
    };
    let (along, across) = (extent(turn[0]), extent(turn[1]));
    let excess = |x: f64, y: f64| (x - strokes.x).max(0.0) + (y - strokes.y).max(0.0);
    excess(across, along) < excess(along, across)
}

/// Between which places along an axis a part is.
pub(super) fn range(part: &Mesh, axis: DVec3) -> [f64; 2] {
    part.vertices.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], vertex| {
        let x = axis.dot(*vertex);
        [low.min(x), high.max(x)]
    })
}

#[cfg(test)]
mod tests;
