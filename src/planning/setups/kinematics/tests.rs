use super::*;
use crate::tool::directions::{DirectionSet, Directions};
use glam::dvec3;

type Axis = (char, Carrier, [f64; 3], Option<[f64; 2]>);
use Carrier::{Head, Table};

fn params(axes: &[Axis]) -> Vec<RotaryParams> {
    let of = |&(letter, on, axis, limits_deg): &Axis| RotaryParams { letter, on, axis, limits_deg };
    axes.iter().map(of).collect()
}

fn machine(axes: &[Axis]) -> Kinematics {
    Kinematics::new("test", params(axes)).unwrap()
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// C turns on A.
fn trunnion(limits: Option<[f64; 2]>) -> Kinematics {
    machine(&[('C', Table, Z, None), ('A', Table, X, limits)])
}

#[track_caller]
fn require(machine: &Kinematics, tool_axis: DVec3, expected: &[&[f64]]) {
    let found = machine.poses(tool_axis);
    assert_eq!(found.len(), expected.len(), "{tool_axis}: {found:?}");
    for (found, expected) in found.iter().zip(expected) {
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
        assert!(found.iter().zip(*expected).all(near), "{tool_axis}: {found:?}, not {expected:?}");
    }
}

/// Tilted from z toward y.
fn tilted(degrees: f64) -> DVec3 {
    let radians = degrees.to_radians();
    dvec3(0.0, libm::sin(radians), libm::cos(radians))
}

#[test]
fn angles_of_a_trunnion_are_those_computed_by_hand() {
    // C by 90 turns the part's x to y, A by 90 turns that up.
    require(&trunnion(None), DVec3::X, &[&[90.0, 90.0], &[-90.0, -90.0]]);
    let limited = trunnion(Some([-120.0, 30.0]));
    require(&limited, DVec3::X, &[&[-90.0, -90.0]]);
    require(&limited, DVec3::NEG_X, &[&[90.0, -90.0]]);
    require(&limited, tilted(30.0), &[&[0.0, 30.0], &[180.0, -30.0]]);
    require(&limited, tilted(30.001), &[&[180.0, -30.001]]);
    require(&limited, tilted(120.0), &[&[180.0, -120.0]]);
    require(&limited, tilted(120.001), &[]);
    require(&limited, DVec3::NEG_Z, &[]);
    // Any C: the one nearest to 0.
    require(&limited, DVec3::Z, &[&[0.0, 0.0]]);
    require(&trunnion(None), DVec3::NEG_Z, &[&[0.0, 180.0]]);
    let turned = machine(&[('C', Table, Z, Some([20.0, 380.0])), ('A', Table, X, None)]);
    require(&turned, DVec3::Z, &[&[20.0, 0.0]]);
    require(&turned, tilted(10.0), &[&[180.0, -10.0], &[360.0, 10.0]]);
    require(&turned, DVec3::ZERO, &[]);
    require(&turned, dvec3(f64::NAN, 0.0, 1.0), &[]);
}

#[test]
fn angles_of_heads_and_of_a_head_over_a_table_are_those_computed_by_hand() {
    let fork =
        machine(&[('C', Head, Z, Some([-270.0, 270.0])), ('B', Head, Y, Some([-95.0, 95.0]))]);
    require(&fork, DVec3::X, &[&[0.0, 90.0], &[180.0, -90.0]]);
    require(&fork, DVec3::Y, &[&[90.0, 90.0], &[-90.0, -90.0]]);
    require(&fork, tilted(95.0), &[&[90.0, 95.0], &[-90.0, -95.0]]);
    require(&fork, tilted(95.001), &[]);
    // The table turns the part by −90, so the tool is over its y.
    let mixed = machine(&[('C', Table, Z, None), ('B', Head, Y, Some([-30.0, 120.0]))]);
    require(&mixed, DVec3::Y, &[&[-90.0, 90.0]]);
    require(&mixed, tilted(20.0), &[&[-90.0, 20.0], &[90.0, -20.0]]);
    // The axis of B is 45 degrees from the tool: half a turn lays it flat, never lower.
    let nutating = machine(&[('C', Head, Z, None), ('B', Head, [0.0, 1.0, 1.0], None)]);
    // The root of a rounding, 1e-8 rad: there both solutions are one.
    for (axis, expected) in [(DVec3::Y, [0.0, 180.0]), (DVec3::X, [-90.0, 180.0])] {
        let poses = nutating.poses(axis);
        let near = |k: usize| (poses[0][k] - expected[k]).abs() < 1e-5;
        assert!(poses.len() == 1 && near(0) && near(1), "{axis}: {poses:?}");
        assert!((nutating.tool_axis(&poses[0]) - axis).length() < 1e-14, "{axis}");
    }
    require(&nutating, tilted(90.001), &[]);
    require(&nutating, DVec3::Z, &[&[0.0, 0.0]]);
    let half = libm::sqrt(0.5);
    let at_90 = nutating.tool_axis(&[0.0, 90.0]);
    assert!((at_90 - dvec3(half, 0.5, 0.5)).length() < 1e-14, "{at_90}");
    assert_eq!(nutating.poses(at_90).len(), 2);
}

#[test]
fn one_rotary_axis_reaches_a_circle_and_none_reaches_the_spindle_alone() {
    let about_x = machine(&[('A', Table, X, None)]);
    require(&about_x, DVec3::Y, &[&[90.0]]);
    require(&about_x, DVec3::NEG_Z, &[&[180.0]]);
    require(&about_x, dvec3(1e-5, 0.0, 1.0), &[]);
    let late = machine(&[('A', Table, X, Some([170.0, 190.0]))]);
    require(&late, DVec3::NEG_Z, &[&[180.0]]);
    require(&late, tilted(-175.0), &[&[185.0]]);
    require(&late, tilted(-169.0), &[]);
    require(&machine(&[('C', Table, Z, Some([30.0, 40.0]))]), DVec3::Z, &[&[30.0]]);
    require(&machine(&[]), DVec3::Z, &[&[]]);
    require(&machine(&[]), tilted(0.001), &[]);
    assert!(about_x.is_chucked() && !machine(&[('C', Table, Z, None)]).is_chucked());
    assert!(!machine(&[('A', Head, X, None)]).is_chucked());
}

/// Trunnion: C and A give (sin A sin C, sin A cos C, cos A).
#[test]
fn limits_of_both_axes_bound_the_tool_axes_exactly_on_every_side() {
    let limits = [('C', Table, Z, Some([-45.0, 60.0])), ('A', Table, X, Some([10.0, 90.0]))];
    let machine = machine(&limits);
    let sphere = Directions::new(DirectionSet::FibonacciSphere { n_dirs: 5000 }).unwrap();
    let mut n_reached = 0;
    for axis in sphere.vectors().iter().map(|d| d.as_dvec3()) {
        let tilt = libm::atan2(axis.truncate().length(), axis.z).to_degrees();
        let turn = libm::atan2(axis.x, axis.y).to_degrees();
        let expected = (10.0..=90.0).contains(&tilt) && (-45.0..=60.0).contains(&turn);
        assert_eq!(machine.reaches(axis), expected, "{axis}: {tilt}, {turn}");
        n_reached += usize::from(expected);
    }
    // (105 / 360) (cos 10° − cos 90°) / 2 of the sphere.
    assert!((n_reached as f64 - 718.1).abs() < 20.0, "{n_reached}");
}

#[test]
fn angles_are_found_again_and_give_the_tool_axis_within_1e_9_also_for_slanted_axes() {
    let slanted = [
        trunnion(None),
        machine(&[('C', Head, Z, None), ('B', Head, [0.0, 1.0, 1.0], None)]),
        machine(&[('B', Table, [0.3, 1.0, -0.2], None), ('A', Head, [1.0, 0.4, 0.5], None)]),
        machine(&[('B', Head, [0.0, 2.0, 0.1], None), ('A', Head, [1.0, 0.0, 0.0], None)]),
    ];
    let rounding = ROUNDING_RAD.to_degrees();
    for machine in &slanted {
        let mut n = 0;
        for first in (-179..180).step_by(7).map(f64::from) {
            for second in (-179..180).step_by(3).map(f64::from) {
                let axis = machine.tool_axis(&[first, second]);
                let poses = machine.poses(axis);
                assert!((1..=2).contains(&poses.len()), "{first}, {second}: {poses:?}");
                let is_it = |pose: &Vec<f64>| {
                    let off = |a: f64, b: f64| ((a - b + 180.0).rem_euclid(360.0) - 180.0).abs();
                    off(pose[0], first) < rounding && off(pose[1], second) < rounding
                };
                assert!(poses.iter().any(is_it), "{first}, {second} not in {poses:?}");
                for pose in poses {
                    let error = (machine.tool_axis(&pose) - axis).length();
                    assert!(error < 1e-9, "{first}, {second}: {error}");
                }
                n += 1;
            }
        }
        assert_eq!(n, 52 * 120);
    }
    // Beside a singular pose, 0.0006 degrees: no cancellation.
    let beside = dvec3(3e-6, -1e-5, 1.0).normalize();
    for pose in trunnion(None).poses(beside) {
        assert!((trunnion(None).tool_axis(&pose) - beside).length() < 1e-14, "{pose:?}");
    }
}

#[test]
fn euler_angles_turn_z_to_the_tool_axis_about_z_and_then_x() {
    assert_eq!(plane_euler_deg(DVec3::Z), [0.0, 0.0, 0.0]);
    assert_eq!(plane_euler_deg(DVec3::X), [90.0, 90.0, 0.0]);
    assert_eq!(plane_euler_deg(DVec3::Y), [180.0, 90.0, 0.0]);
    assert_eq!(plane_euler_deg(DVec3::NEG_Y), [0.0, 90.0, 0.0]);
    assert_eq!(plane_euler_deg(DVec3::NEG_Z), [0.0, 180.0, 0.0]);
    let sphere = Directions::new(DirectionSet::FibonacciSphere { n_dirs: 1000 }).unwrap();
    for axis in sphere.vectors().iter().map(|d| d.as_dvec3().normalize()) {
        let [z, x, _] = plane_euler_deg(axis).map(f64::to_radians);
        let back = glam::DMat3::from_rotation_z(z) * glam::DMat3::from_rotation_x(x) * DVec3::Z;
        assert!((back - axis).length() < 1e-12, "{axis}");
    }
}

#[test]
fn machines_that_are_none_are_refused_with_the_axis_and_the_key() {
    let a = ('A', Table, X, None);
    for (axes, at, key, found) in [
        (&[('D', Table, X, None)][..], 0, "letter", "`D`"),
        (&[a, ('A', Head, Y, None)], 1, "letter", "A twice"),
        (&[('B', Head, Y, None), a], 1, "on", "table axis A after a head axis"),
        (&[('A', Table, [0.0; 3], None)], 0, "axis", "the vector 0, 0, 0"),
        (&[('A', Table, [0.0, f64::NAN, 1.0], None)], 0, "axis", "the vector 0, NaN, 1"),
        (&[('A', Table, X, Some([30.0, -120.0]))], 0, "limits", "limits 30, -120"),
        (&[('A', Table, X, Some([f64::NAN, 1.0]))], 0, "limits", "limits NaN, 1"),
        (&[('A', Table, X, Some([0.0, f64::INFINITY]))], 0, "limits", "limits 0, inf"),
        (&[a, ('B', Table, [-2.0, 0.0, 0.0], None)], 1, "axis", "B is parallel to A"),
        (&[a, ('B', Table, Y, None), ('C', Head, Z, None)], 2, "letter", "3 rotary axes: A, B, C"),
    ] {
        let fault = Kinematics::new("test", params(axes)).unwrap_err();
        assert_eq!((fault.axis, fault.key, &*fault.found), (Some(at), key, found));
    }
    assert_eq!(Kinematics::new(" ", Vec::new()).unwrap_err().key, "name");
    assert_eq!(Kinematics::new("a\nb", Vec::new()).unwrap_err().axis, None);
    // Great and small vectors are directions.
    machine(&[('A', Table, [1e300, 0.0, 0.0], None), ('B', Table, [0.0, 1e-6, 0.0], None)]);
    assert_eq!(trunnion(Some([-120.0, 30.5])).to_string(), "test (table C, table A -120..30.5)");
    assert_eq!(machine(&[]).to_string(), "test");
}
