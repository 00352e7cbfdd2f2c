use crate::geom::Mesh;
use crate::geom::solids::cuboid;
use crate::planning::setups::kinematics::{Carrier, Kinematics, RotaryParams};
use crate::planning::setups::{Candidates, Clampings, Machine};
use glam::{DVec3, Vec3, dvec3};

fn axis(letter: char, on: Carrier, axis: [f64; 3], limits_deg: Option<[f64; 2]>) -> RotaryParams {
    RotaryParams { letter, on, axis, limits_deg }
}

fn machine(axes: Vec<RotaryParams>) -> Machine {
    Machine::Axes(Kinematics::new("test", axes).unwrap())
}

fn part() -> Mesh {
    cuboid(dvec3(40.0, 30.0, 20.0))
}

fn of(machine: Machine, n: usize) -> Candidates {
    let clampings = Clampings::usual(&machine);
    Candidates::new(&part(), machine, clampings, n).unwrap()
}

const ABOUT_X: [f64; 3] = [1.0, 0.0, 0.0];
const ABOUT_Z: [f64; 3] = [0.0, 0.0, 1.0];

#[test]
fn a_trunnion_tests_just_the_directions_within_its_limits_and_needs_no_turn_about_z() {
    let a = axis('A', Carrier::Table, ABOUT_X, Some([-100.0, 30.0]));
    let trunnion = machine(vec![axis('C', Carrier::Table, ABOUT_Z, None), a]);
    let found = of(trunnion, 200);
    assert_eq!(found.list().len(), 6, "one along each box axis");
    let all = found.directions().vectors();
    for candidate in found.list() {
        let least = libm::cos(100_f64.to_radians()) as f32;
        let within = all.iter().filter(|d| d.dot(candidate.direction) > least).count();
        assert_eq!(candidate.axes.len(), within);
        let [x, y, z] = found.turn_of(candidate);
        assert!((x.cross(y) - z).length() < 1e-12);
        assert_eq!(all[candidate.axes[0] as usize], candidate.direction, "z' first");
    }
}

#[test]
fn limits_that_are_not_round_z_give_a_candidate_per_quarter_turn() {
    let b = axis('B', Carrier::Head, [0.0, 1.0, 0.0], Some([0.0, 90.0]));
    let found = of(machine(vec![b.clone()]), 36);
    assert_eq!(found.list().len(), 24, "tilting to +x, -y, -x, +y, over each box axis");
    let all = found.directions().vectors();
    for candidate in found.list() {
        assert_eq!(candidate.axes.len(), 10, "0 to 90 degrees by 10");
        let [x, _, z] = found.turn_of(candidate);
        for &k in &candidate.axes {
            let d = all[k as usize].as_dvec3();
            assert!(d.dot(x) > -1e-6 && d.dot(z) > -1e-6 && d.dot(z.cross(x)).abs() < 1e-6, "{d}");
        }
    }
    let given = Candidates::given(&part(), machine(vec![b]), &[Vec3::Z, Vec3::X], 36).unwrap();
    assert_eq!(given.list().len(), 2, "as given, without turns");
}

#[test]
fn a_part_that_is_chucked_has_a_candidate_per_rotary_axis_and_one_on_a_round_table_per_z() {
    let about_x = machine(vec![axis('A', Carrier::Table, ABOUT_X, None)]);
    let found = of(about_x, 72);
    assert_eq!((found.list().len(), found.directions().len()), (3, 3 * 72 - 6));
    for candidate in found.list() {
        assert_eq!(candidate.axes.len(), 72);
        let x = found.turn_of(candidate)[0];
        let across = |k: &u32| found.directions().vectors()[*k as usize].as_dvec3().dot(x).abs();
        assert!(candidate.axes.iter().all(|k| across(k) < 1e-6));
    }
    let about_z = of(machine(vec![axis('C', Carrier::Table, ABOUT_Z, None)]), 72);
    assert_eq!((about_z.list().len(), about_z.directions().len()), (6, 6));
    let upright = of(machine(Vec::new()), 72);
    let plain = of(Machine::ThreeAxis, 72);
    assert_eq!(upright.list(), plain.list());
    assert_eq!(upright.directions(), plain.directions());
}

#[test]
fn bad_numbers_and_machines_that_reach_nothing_tested_are_refused() {
    let locked = machine(vec![
        axis('C', Carrier::Table, ABOUT_Z, Some([3.0, 3.0])),
        axis('A', Carrier::Table, ABOUT_X, Some([7.0, 7.0])),
    ]);
    let new = |machine: &Machine, n| Candidates::new(&part(), machine.clone(), Clampings::Box, n);
    let message = new(&locked, 100).unwrap_err().to_string();
    assert!(message.starts_with("machine is test (table C 3..3, table A 7..7)"), "{message}");
    let about_x = machine(vec![axis('A', Carrier::Table, ABOUT_X, None)]);
    for machine in [locked, about_x] {
        for n in [0, usize::MAX] {
            assert!(new(&machine, n).is_err());
        }
    }
    // Never a circle of the part's that a rounding doubles.
    let slanted = machine(vec![axis('A', Carrier::Table, [1.0, 1.0, 0.0], None)]);
    let found = of(slanted, 8);
    let all: Vec<DVec3> = found.directions().vectors().iter().map(|d| d.as_dvec3()).collect();
    for (k, d) in all.iter().enumerate() {
        assert!(all[..k].iter().all(|other| (*other - *d).length() > 1e-6), "{d} twice");
    }
}
