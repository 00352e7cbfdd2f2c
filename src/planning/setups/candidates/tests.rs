//! Candidates.

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
    assert_eq!(of_turned.directions().vectors()[..2], [Vec3::X, Vec3::NEG_X], "flat ones first");
    // The facets of a torus are all small; with two rings beside its top none lies flat.
    let torus = torus(20.0, 5.0, 60, 32);
    assert!(flat_normals(&torus).is_empty());
}

/// A wedge: its slanted side and the two triangles beside it are flat faces, too.
fn wedge() -> Mesh {
    let vertices =
        [[0., 0., 0.], [40., 0., 0.], [40., 30., 0.], [0., 30., 0.], [0., 0., 20.], [0., 30., 20.]];
    let triangles =
        [[0, 2, 1], [0, 3, 2], [0, 1, 4], [3, 5, 2], [0, 4, 5], [0, 5, 3], [1, 2, 5], [1, 5, 4]];
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
fn a_tool_tilts_to_faces_on_which_the_part_does_not_stand() {
    // The normal of the slanted face is z' of no setup, but 27 degrees from +z.
    let slanted = Vec3::new(1.0, 0.0, 2.0).normalize();
    let part = wedge();
    let tilted = Machine::Indexed { tilt_deg: 60.0 };
    let standing = Candidates::new(&part, tilted, Clampings::Standing, 20).unwrap();
    assert_eq!(standing.list().len(), 5, "one for each face");
    let up = standing.list().iter().find(|c| c.direction == Vec3::Z).unwrap();
    let near = |k: &u32| angle(standing.directions().vectors()[*k as usize], slanted) < 1e-6;
    assert!(up.axes.iter().any(near));
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
    assert_eq!(Candidates::given(&part, chucked.clone(), &[Vec3::X], 8).unwrap().list().len(), 1);
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
