//! The setups to choose from, and the directions to test for them.

use super::machine::{DOWN_RAD, LOWEST_MM, Machine, angle, direction_words};
use super::turned::{
    ROUNDING_RAD, SAME_RAD, Turned, by_axes, quarters_on, rotary_axes, upright, with_sphere,
};
use crate::directions::{DirectionSet, Directions, TurnLimits};
use crate::geom::Mesh;
use crate::{Error, Result, memory};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;

/// Which clampings there are to choose from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
}

/// The setups to choose from; those that a machinist would rather have come first.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidates {
    machine: Machine,
    /// Flat faces and box axes.
    likely: Vec<Vec3>,
    has_flat: bool,
    directions: Directions,
    list: Vec<Candidate>,
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
        Candidates::of(machine, (likely, !flat.is_empty()), directions, list)
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
        for normal in setups.iter().copied().chain(flat).chain(BOX_AXES) {
            add(&mut likely, normal);
        }
        let (directions, list) = match &machine {
            Machine::Rotary { limits, .. } => about_axes(setups.to_vec(), *limits, n_directions)?,
            Machine::Axes(axes) if axes.n_axes() > 0 => {
                on_axes(by_axes(axes, &likely, setups, 0..1, n_directions)?)
            }
            _ => over_sphere(&machine, &likely, (Clampings::Flat, setups.len()), n_directions)?,
        };
        Candidates::of(machine, (likely, has_flat), directions, list)
    }

    fn of(
        machine: Machine,
        (likely, has_flat): (Vec<Vec3>, bool),
        directions: Vec<Vec3>,
        list: Vec<Candidate>,
    ) -> Result<Self> {
        let vectors = directions.iter().map(|d| d.as_dvec3().to_array()).collect();
        let directions = Directions::new(DirectionSet::List { vectors })?;
        Ok(Candidates { machine, likely, has_flat, directions, list })
    }

    /// The machine.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Every direction to test.
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

    /// Of a candidate.
    pub(super) fn turn_of(&self, candidate: &Candidate) -> [DVec3; 3] {
        quarters_on(self.turn(candidate.direction), candidate.n_quarters)
    }

    /// Whether the part has a flat face to stand on; else the setups of [`Clampings::Standing`] and [`Clampings::Flat`]
    /// are along its box.
    pub fn stand_on_flat_faces(&self) -> bool {
        self.has_flat
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
        Candidate { direction, axes: upright_first(axes, direction, &all), n_quarters: 0 }
    };
    let list = all[..n].iter().map(candidate).collect();
    Ok((all, list))
}

fn on_axes((all, list): (Vec<Vec3>, Vec<Turned>)) -> (Vec<Vec3>, Vec<Candidate>) {
    let candidate = |Turned { direction, n_quarters, axes }| Candidate {
        direction,
        axes: upright_first(axes, direction, &all),
        n_quarters,
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
mod tests {
    use super::*;
    use crate::geom::solids::{cuboid, torus};
    use glam::dvec3;

    fn turned() -> Mesh {
        let mut part = cuboid(dvec3(40.0, 30.0, 20.0));
        let turn = glam::DMat3::from_rotation_x(0.6);
        part.vertices.iter_mut().for_each(|p| *p = turn * *p);
        part
    }

    fn of(part: &Mesh, machine: Machine, n: usize) -> Candidates {
        Candidates::new(part, machine.clone(), Clampings::usual(&machine), n).unwrap()
    }

    #[test]
    fn box_axes_come_first_then_flat_faces_then_the_sphere() {
        let any = |part: &Mesh| Candidates::new(part, Machine::ThreeAxis, Clampings::Any, 100);
        let upright = any(&cuboid(DVec3::ONE)).unwrap();
        assert_eq!(upright.directions().vectors()[..6], BOX_AXES);
        let turn = upright.turn(Vec3::NEG_Z);
        assert_eq!(turn, [DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z]);
        assert!((100..=106).contains(&upright.list().len()));
        let of_turned = any(&turned()).unwrap();
        let of_faces = &of_turned.directions().vectors()[2..6];
        let up = Vec3::new(0.0, -libm::sinf(0.6), libm::cosf(0.6));
        assert!(of_faces.iter().any(|d| angle(*d, up) < 1e-6), "{of_faces:?}");
        for (k, candidate) in of_turned.list().iter().enumerate() {
            assert_eq!(candidate.axes, [k as u32]);
            let tested = of_turned.directions().vectors()[k];
            assert!(angle(candidate.direction, tested) < ROUNDING_RAD);
        }
        assert_eq!(
            of_turned.directions().vectors()[..2],
            [Vec3::X, Vec3::NEG_X],
            "flat ones first"
        );
        // The facets of a torus are all small; with two rings beside its top none lies flat.
        let torus = torus(20.0, 5.0, 60, 32);
        assert!(flat_normals(&torus).is_empty());
    }

    /// A wedge: its slanted side and the two triangles beside it are flat faces, too.
    fn wedge() -> Mesh {
        let vertices = [
            [0., 0., 0.],
            [40., 0., 0.],
            [40., 30., 0.],
            [0., 30., 0.],
            [0., 0., 20.],
            [0., 30., 20.],
        ];
        let triangles = [
            [0, 2, 1],
            [0, 3, 2],
            [0, 1, 4],
            [3, 5, 2],
            [0, 4, 5],
            [0, 5, 3],
            [1, 2, 5],
            [1, 5, 4],
        ];
        Mesh::from_slices(&vertices, &triangles).unwrap()
    }

    #[test]
    fn an_upright_part_stands_on_flat_faces() {
        let found = of(&wedge(), Machine::ThreeAxis, 100);
        let mut directions: Vec<Vec3> = found.list().iter().map(|c| c.direction).collect();
        assert_eq!(directions.len(), 5, "one for each face: {directions:?}");
        let slanted = directions.pop().unwrap();
        assert!(angle(slanted, Vec3::new(-1.0, 0.0, -2.0).normalize()) < 1e-6, "{slanted}");
        for up in [Vec3::Z, Vec3::X, Vec3::Y, Vec3::NEG_Y] {
            assert!(directions.contains(&up), "{up}");
        }
        // A pocket's floor is flat and faces up, but nothing stands on it.
        let torus = of(&torus(20.0, 5.0, 60, 32), Machine::ThreeAxis, 100);
        assert_eq!(torus.list().len(), 6, "without a flat face: the box axes");
    }

    #[test]
    fn given_setups_are_the_only_candidates_and_limits_are_kept() {
        let part = turned();
        let up = [Vec3::Z, Vec3::NEG_X];
        let upright = Candidates::given(&part, Machine::ThreeAxis, &up, 50).unwrap();
        assert_eq!(upright.directions().vectors(), up);
        let tilted = Machine::Indexed { tilt_deg: 60.0 };
        let tilted = Candidates::given(&part, tilted, &up, 50).unwrap();
        assert_eq!(tilted.list().len(), 2);
        assert!(tilted.directions().len() > 50 && tilted.list()[0].axes.len() > 10);
        let twice = Candidates::given(&part, Machine::ThreeAxis, &[Vec3::X, Vec3::X], 50);
        assert!(twice.unwrap_err().to_string().contains("+x twice"));
        let chucked: Machine = "4-axis:x".parse().unwrap();
        assert_eq!(
            Candidates::given(&part, chucked.clone(), &[Vec3::X], 8).unwrap().list().len(),
            1
        );
        let other = Candidates::given(&part, chucked.clone(), &[Vec3::Y], 8).unwrap_err();
        let other = other.to_string();
        assert!(other.contains("setups is +y") && other.contains("+x"), "{other}");
        assert!(Candidates::given(&part, chucked, &[], 8).is_err());
        let limited: Machine = "4-axis:x:-30,90".parse().unwrap();
        let limited = of(&part, limited, 72);
        assert_eq!((limited.list().len(), limited.directions().len()), (1, 25));
    }

    #[test]
    fn tool_axes_are_those_of_the_machine() {
        let tilted = of(&turned(), Machine::Indexed { tilt_deg: 90.0 }, 50);
        let all = tilted.directions().vectors();
        assert_eq!(tilted.list().len(), 10, "box axes and flat faces");
        for candidate in tilted.list() {
            let within = all.iter().filter(|d| d.dot(candidate.direction) > -1e-6).count();
            assert_eq!(candidate.axes.len(), within);
        }
        let machine = Machine::Rotary { axis: None, limits: None };
        let rotary = of(&turned(), machine, 72);
        assert_eq!(rotary.list().len(), 5, "three box axes, two more of the faces");
        for candidate in rotary.list() {
            assert_eq!(candidate.axes.len(), 72);
            let across = |k: &u32| {
                rotary.directions().vectors()[*k as usize].dot(candidate.direction).abs() < 1e-6
            };
            assert!(candidate.axes.iter().all(across));
        }
        assert!(rotary.directions().len() < 5 * 72, "circles share where they meet");
        let given = Machine::Rotary { axis: Some([0.0, 0.0, 2.0]), limits: None };
        assert_eq!(of(&turned(), given.clone(), 8).list().len(), 1);
        assert!(Candidates::new(&turned(), given, Clampings::Flat, 0).is_err());
        if cfg!(target_os = "linux") {
            let five = Machine::FiveAxis { tilt_deg: 90.0 };
            let many = Candidates::new(&turned(), five, Clampings::Any, 1_000_000).unwrap_err();
            let message = many.to_string();
            assert!(message.contains("tool axes of setups needs about 39985"), "{message}");
        }
        let flat = Candidates::new(&turned(), Machine::ThreeAxis, Clampings::Flat, 50).unwrap();
        assert_eq!((flat.list().len(), flat.directions().len()), (6, 6));
        for candidates in [&tilted, &rotary, &flat] {
            for candidate in candidates.list() {
                let [x, y, z] = candidates.turn(candidate.direction);
                let along = if candidates.machine().tilt_rad().is_some() { z } else { x };
                assert!((x.cross(y) - z).length() < 1e-12 && (z.length() - 1.0).abs() < 1e-12);
                assert!((along - candidate.direction.as_dvec3()).length() < 1e-6);
            }
        }
        let turned_up = flat.turn(Vec3::new(0.0, -libm::sinf(0.6), libm::cosf(0.6)));
        assert_eq!(turned_up[0], DVec3::X, "along the part's edges");
    }
}
