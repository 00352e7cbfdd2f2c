//! The setups to choose from, and the directions to test for them.

use super::machine::{DOWN_RAD, LOWEST_MM, Machine, angle, direction_words};
use super::turned::{
    ROUNDING_RAD, SAME_RAD, Turned, by_axes, is_better_across, quarters_on, rotary_axes, upright,
    with_sphere,
};
use crate::exec::memory;
use crate::geom::Mesh;
use crate::tool::directions::{DirectionSet, Directions, TurnLimits};
use crate::{Error, Result};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Which clampings there are to choose from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Clampings {
    /// Standing on a flat face: at the lowest place in that position there are flat faces of at least a hundredth of
    /// the surface that face down, within 1 degree and 0.01 mm.
    Standing,
    /// Along large flat faces: the part stands on something.
    Flat,
    /// Along these and the box axes.
    Box,
    /// Along every direction tested.
    Any,
}

impl Clampings {
    /// What suits a machine: in a vise the part stands on a flat face; one that tilts need not have the part slanted,
    /// and a part that stands on a corner would be held by what it shows.
    pub fn usual(machine: &Machine) -> Self {
        if machine.is_upright() { Clampings::Standing } else { Clampings::Box }
    }
}

/// A setup to choose.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Candidate {
    /// z', or the direction of the part along the rotary axis.
    pub direction: Vec3,
    /// Numbers of its tool axes among [`Candidates::directions`].
    pub axes: Vec<u32>,
    /// Quarter turns about z' from [`Candidates::turn`] on.
    pub(super) n_quarters: u8,
    /// The orientation that it is a clamping of: setups that are given are taken in one clamping each.
    pub(super) orientation: usize,
}

/// The setups to choose from; those that a machinist would rather have come first.
///
/// ```
/// use deepmill::planning::setups::{Candidates, Clampings};
/// use deepmill::{geom::solids, glam::{DVec3, Vec3}};
///
/// let block = solids::cuboid(DVec3::new(30.0, 20.0, 10.0));
/// let upright = Candidates::new(&block, "3-axis".parse()?, Clampings::Standing, 100)?;
/// assert_eq!((upright.list().len(), upright.list()[0].direction), (6, Vec3::Z)); // a block stands on each face
/// assert!(upright.list().iter().all(|setup| setup.axes.len() == 1)); // the spindle is along z'
/// let tilting = Candidates::new(&block, "5-axis:60".parse()?, Clampings::Standing, 100)?;
/// assert!(tilting.list().iter().all(|setup| setup.axes.len() > 1));
/// let error = Candidates::given(&block, "3-axis".parse()?, &[Vec3::Z, Vec3::Z], 100).unwrap_err();
/// assert!(error.to_string().contains("leave one of them out"));
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Candidates {
    machine: Machine,
    /// Flat faces and box axes.
    likely: Vec<Vec3>,
    has_flat: bool,
    /// Outward normals of all large flat faces.
    faces: Vec<Vec3>,
    /// Directions that differ.
    n_tool_axes: usize,
    pub(super) directions: Directions,
    pub(super) list: Vec<Candidate>,
}

/// Normals within this of each other are of one flat face, radians.
const FLAT_RAD: f64 = 2.0 * SAME_RAD;
/// Least share of the surface that a flat face has.
const LEAST_SHARE: f64 = 0.01;
/// Flat faces that give candidates.
const MOST_FACES: usize = 24;

impl Candidates {
    /// For a part on a machine. `n_directions` are even over the whole sphere beside the box axes and the normals of
    /// large flat faces, or around each rotary axis; rotary axes are always along flat clampings.
    ///
    /// # Errors
    /// If `n_directions` is 0 or above a million, or the lists of tool axes would not fit into the memory.
    pub fn new(
        part: &Mesh,
        machine: Machine,
        clampings: Clampings,
        n_directions: usize,
    ) -> Result<Self> {
        let normals = flat_normals(part);
        let mut flat = Vec::new();
        for normal in &normals {
            add(&mut flat, *normal);
            add(&mut flat, -*normal);
        }
        if clampings == Clampings::Standing {
            let standing: Vec<Vec3> = normals.iter().map(|n| -*n).collect();
            let stands = |up: &Vec3| standing.iter().any(|d| angle(*d, *up) <= SAME_RAD);
            flat.retain(|up| stands(up) && stands_on(part, up.as_dvec3()));
        }
        let is_flat = |axis: &Vec3| flat.iter().any(|d| angle(*d, *axis) <= SAME_RAD);
        let mut likely: Vec<Vec3> = BOX_AXES.into_iter().filter(is_flat).collect();
        flat.iter().for_each(|d| add(&mut likely, *d));
        // A part without a flat face is held somehow.
        let n_flat = if likely.is_empty() { BOX_AXES.len() } else { likely.len() };
        BOX_AXES.iter().for_each(|d| add(&mut likely, *d));
        if !machine.is_upright() {
            // A tool may stand on faces on which the part does not.
            normals.iter().for_each(|normal| {
                add(&mut likely, *normal);
                add(&mut likely, -*normal);
            });
        }
        let is_flat = matches!(clampings, Clampings::Flat | Clampings::Standing);
        let n_upright = if is_flat { n_flat } else { likely.len() };
        let (directions, list) = match &machine {
            Machine::Rotary { axis, limits } => {
                about_axes(rotary_axes(*axis, &likely[..n_upright]), *limits, n_directions)?
            }
            Machine::Axes(axes) if axes.n_axes() > 0 => {
                let sphere = match clampings {
                    Clampings::Any => with_sphere(&likely, n_directions)?,
                    _ => likely[..n_upright].to_vec(),
                };
                on_axes(by_axes(axes, &likely, &sphere, 0..4, n_directions)?)
            }
            _ => over_sphere(&machine, &likely, (clampings, n_upright), n_directions)?,
        };
        Candidates::of(part, machine, (likely, !flat.is_empty()), normals, (directions, list))
    }

    /// The given setups alone, in their order: of each z', or the direction of the part along the rotary axis.
    ///
    /// # Errors
    /// As [`Candidates::new`], or if there is none, two are the same, or one is not the rotary axis that the machine
    /// has.
    pub fn given(
        part: &Mesh,
        machine: Machine,
        setups: &[Vec3],
        n_directions: usize,
    ) -> Result<Self> {
        let refused = |found: String, expected: &str, remedy: String| {
            Err(Error::argument("setups", found, expected, remedy))
        };
        if setups.is_empty() {
            return refused(
                "no direction".into(),
                "at least one",
                "give one, for example +z".into(),
            );
        }
        for (k, setup) in setups.iter().enumerate() {
            let words = direction_words(*setup);
            if let Machine::Rotary { axis: Some(axis), .. } = &machine {
                let axis = DVec3::from_array(*axis).normalize().as_vec3();
                if angle(axis, *setup) > SAME_RAD {
                    let axis = direction_words(axis);
                    let remedy = format!("leave it out, or take a machine without the axis {axis}");
                    return refused(words, "the rotary axis of the machine", remedy);
                }
            }
            if setups[..k].iter().any(|other| angle(*other, *setup) <= SAME_RAD) {
                let remedy = "leave one of them out".into();
                return refused(format!("{words} twice"), "every setup once", remedy);
            }
        }
        let (mut likely, flat) = (Vec::new(), flat_normals(part));
        let has_flat = !flat.is_empty();
        for normal in setups.iter().chain(&flat).copied().chain(BOX_AXES) {
            add(&mut likely, normal);
        }
        let (directions, list) = match &machine {
            Machine::Rotary { limits, .. } => about_axes(setups.to_vec(), *limits, n_directions)?,
            Machine::Axes(axes) if axes.n_axes() > 0 => {
                on_axes(by_axes(axes, &likely, setups, 0..1, n_directions)?)
            }
            _ => over_sphere(&machine, &likely, (Clampings::Flat, setups.len()), n_directions)?,
        };
        Candidates::of(part, machine, (likely, has_flat), flat, (directions, list))
    }

    fn of(
        part: &Mesh,
        machine: Machine,
        (likely, has_flat): (Vec<Vec3>, bool),
        faces: Vec<Vec3>,
        (directions, mut list): (Vec<Vec3>, Vec<Candidate>),
    ) -> Result<Self> {
        let vectors = directions.iter().map(|d| d.as_dvec3().to_array()).collect();
        let directions = Directions::new(DirectionSet::List { vectors })?;
        let n_tool_axes = directions.len();
        list.iter_mut().enumerate().for_each(|(k, candidate)| candidate.orientation = k);
        let mut candidates =
            Candidates { machine, likely, has_flat, faces, n_tool_axes, directions, list };
        candidates.turn_into_strokes(part);
        Ok(candidates)
    }

    /// The machine.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Every direction to test; of candidates that are clamped, those of each after those of the one before.
    pub fn directions(&self) -> &Directions {
        &self.directions
    }

    /// The machine's x', y', z' in a setup, in the part's coordinates: z' is the setup's direction, or x' is along the
    /// rotary axis; another axis is along a flat face or a box axis, if one is across.
    pub fn turn(&self, direction: Vec3) -> [DVec3; 3] {
        let [u, v, w] = upright(&self.likely, direction);
        match self.machine.tilt_rad() {
            Some(_) => [u, v, w],
            None => [w, u.cross(w), u],
        }
    }

    /// Turns candidates of a machine without rotary axes by a quarter where the part is then less beyond its strokes.
    fn turn_into_strokes(&mut self, part: &Mesh) {
        let Some(machine) = self.machine.axes().filter(|axes| axes.n_axes() == 0) else { return };
        let strokes = machine.strokes_mm();
        if strokes == DVec3::INFINITY {
            return;
        }
        let is_better =
            |candidate: &Candidate| is_better_across(part, self.turn_of(candidate), strokes);
        let quarters: Vec<u8> = self.list.iter().map(|c| u8::from(is_better(c))).collect();
        for (candidate, n_quarters) in self.list.iter_mut().zip(quarters) {
            candidate.n_quarters = n_quarters;
        }
    }

    /// Of a candidate.
    pub(super) fn turn_of(&self, candidate: &Candidate) -> [DVec3; 3] {
        quarters_on(self.turn(candidate.direction), candidate.n_quarters)
    }

    /// Whether the part has a flat face to stand on; else the setups of [`Clampings::Standing`] and [`Clampings::Flat`]
    /// are along its box.
    pub fn stand_on_flat_faces(&self) -> bool {
        self.has_flat
    }

    /// Outward normals of the large flat faces, the largest first.
    pub fn faces(&self) -> &[Vec3] {
        &self.faces
    }

    /// Number of tool axes that differ.
    pub fn n_tool_axes(&self) -> usize {
        self.n_tool_axes
    }

    /// The setups.
    pub fn list(&self) -> &[Candidate] {
        &self.list
    }
}

/// Upright first.
const BOX_AXES: [Vec3; 6] = [Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y];

/// Unless it is there already.
fn add(directions: &mut Vec<Vec3>, direction: Vec3) {
    if directions.iter().all(|other| angle(*other, direction) > SAME_RAD) {
        directions.push(direction);
    }
}

fn over_sphere(
    machine: &Machine,
    likely: &[Vec3],
    (clampings, n_upright): (Clampings, usize),
    n_directions: usize,
) -> Result<(Vec<Vec3>, Vec<Candidate>)> {
    let mut all = with_sphere(likely, n_directions)?;
    let n = if clampings == Clampings::Any { all.len() } else { n_upright };
    if machine.is_upright() {
        all.truncate(n);
    }
    let tilt = machine.tilt_rad().unwrap_or_default() + ROUNDING_RAD;
    if !machine.is_upright() {
        let found = format!("{n} candidates and {} directions", all.len());
        let remedy = format!("{found}: test fewer directions, or clamp along flat faces alone");
        memory::require("the tool axes of setups", memory::product([n, all.len(), 4]), remedy)?;
    }
    let candidate = |&direction: &Vec3| {
        let within = |k: &u32| angle(all[*k as usize], direction) <= tilt;
        let axes = (0..all.len() as u32).filter(within).collect();
        Candidate {
            direction,
            axes: upright_first(axes, direction, &all),
            n_quarters: 0,
            orientation: 0,
        }
    };
    let list = all[..n].iter().map(candidate).collect();
    Ok((all, list))
}

fn on_axes((all, list): (Vec<Vec3>, Vec<Turned>)) -> (Vec<Vec3>, Vec<Candidate>) {
    let candidate = |Turned { direction, n_quarters, axes }| Candidate {
        direction,
        axes: upright_first(axes, direction, &all),
        n_quarters,
        orientation: 0,
    };
    let list = list.into_iter().map(candidate).collect();
    (all, list)
}

fn about_axes(
    axes: Vec<Vec3>,
    limits: Option<TurnLimits>,
    n_directions: usize,
) -> Result<(Vec<Vec3>, Vec<Candidate>)> {
    let mut all: Vec<Vec3> = Vec::new();
    let mut list = Vec::new();
    for direction in axes {
        let axis = direction.as_dvec3().to_array();
        let circle = Directions::new(DirectionSet::Circle { axis, n_dirs: n_directions })?;
        let mut number = |d: &Vec3| {
            let same = all.iter().position(|other| angle(*other, *d) < ROUNDING_RAD);
            same.unwrap_or_else(|| {
                all.push(*d);
                all.len() - 1
            }) as u32
        };
        let axes = match limits {
            None => circle.vectors().iter().map(number).collect(),
            Some(limits) => {
                let within = limits.directions(direction.as_dvec3(), n_directions);
                within.iter().map(|d| number(&d.as_vec3())).collect()
            }
        };
        list.push(Candidate {
            direction,
            axes: upright_first(axes, direction, &all),
            n_quarters: 0,
            orientation: 0,
        });
    }
    Ok((all, list))
}

/// z' itself before the box axes before the others.
fn upright_first(mut axes: Vec<u32>, direction: Vec3, all: &[Vec3]) -> Vec<u32> {
    let is = |k: u32, other: Vec3| angle(all[k as usize], other) <= ROUNDING_RAD;
    // A stable sort.
    axes.sort_by_key(|&k| match () {
        () if is(k, direction) => 0,
        () if BOX_AXES.iter().any(|axis| is(k, *axis)) => 1,
        () => 2,
    });
    axes
}

/// Whether the part stands on flat faces of at least [`LEAST_SHARE`] with `up` upward.
fn stands_on(part: &Mesh, up: DVec3) -> bool {
    let lowest = part.vertices.iter().map(|p| p.dot(up)).fold(f64::INFINITY, f64::min);
    let area = |f: usize| {
        let area = part.area_vector(f);
        let is_down = angle(area.normalize_or_zero().as_vec3(), -up.as_vec3()) <= DOWN_RAD;
        let is_low = part.corners(f).iter().all(|p| p.dot(up) <= lowest + LOWEST_MM);
        if is_down && is_low { 0.5 * area.length() } else { 0.0 }
    };
    let total: f64 = (0..part.triangles.len()).map(area).sum();
    total >= LEAST_SHARE * part.area()
}

/// Outward normals of flat faces of at least [`LEAST_SHARE`], the largest first.
fn flat_normals(part: &Mesh) -> Vec<Vec3> {
    /// Cells of normals, far finer than [`FLAT_RAD`].
    const CELLS: f64 = 1000.0;
    let mut cells: BTreeMap<[i64; 3], DVec3> = BTreeMap::new();
    for f in 0..part.triangles.len() {
        let area = part.area_vector(f);
        let normal = area.normalize_or_zero();
        *cells.entry((normal * CELLS).round().to_array().map(|x| x as i64)).or_default() += area;
    }
    let mut sums: Vec<DVec3> = cells.into_values().filter(|sum| *sum != DVec3::ZERO).collect();
    // A stable sort: equal areas stay in the order of their cells.
    sums.sort_by(|a, b| b.length().total_cmp(&a.length()));
    let mut faces: Vec<DVec3> = Vec::new();
    for sum in sums {
        let near =
            |face: &DVec3| angle(face.normalize().as_vec3(), sum.normalize().as_vec3()) <= FLAT_RAD;
        match faces.iter().position(near) {
            Some(k) => faces[k] += sum,
            None if faces.len() < MOST_CELLS => faces.push(sum),
            None => {}
        }
    }
    // Area vectors are twice the area.
    let least = 2.0 * LEAST_SHARE * part.area();
    faces.retain(|face| face.length() >= least);
    faces.sort_by(|a, b| b.length().total_cmp(&a.length()));
    faces.truncate(MOST_FACES);
    faces.iter().map(|face| face.normalize().as_vec3()).collect()
}

/// Normals that are compared with each other; a flat face of the least share is among them.
const MOST_CELLS: usize = 400;

#[cfg(test)]
mod tests;
