use super::*;
use crate::tool::directions::{DirectionSet, Directions};
use glam::DVec3;

fn example(name: &str) -> Kinematics {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/machines").join(name);
    read(&path).unwrap().axes().unwrap().clone()
}

#[test]
fn the_examples_are_machines_of_every_kind_and_their_angles_give_the_tool_axis_within_1e_9() {
    let sphere = Directions::new(DirectionSet::FibonacciSphere { n_dirs: 4000 }).unwrap();
    let box_axes = DVec3::AXES.into_iter().chain(DVec3::AXES.map(|axis| -axis));
    let circle = (0..720).map(|k| {
        let radians = f64::from(k).to_radians() / 2.0;
        DVec3::new(0.0, libm::sin(radians), libm::cos(radians))
    });
    let directions: Vec<DVec3> =
        sphere.vectors().iter().map(|d| d.as_dvec3().normalize()).collect();
    let all: Vec<DVec3> = directions.into_iter().chain(circle).chain(box_axes).collect();
    // Of 4000 over the sphere, those below the greatest tilt: (1 − cos) / 2 of them.
    for (name, words, n_over_sphere) in [
        ("three-axis.toml", "Three-axis mill", 0..=0),
        ("rotary-table.toml", "Mill with dividing head (table A)", 0..=0),
        ("trunnion-ac.toml", "Trunnion A/C (table C, table A -120..30)", 2999..=3001),
        ("head-cb.toml", "Fork head C/B (head C -270..270, head B -95..95)", 2173..=2176),
        ("head-b-table-c.toml", "Swivel head B, table C (table C, head B -30..120)", 2999..=3001),
    ] {
        let machine = example(name);
        assert_eq!(machine.to_string(), words);
        let mut n_reached = 0;
        for (k, axis) in all.iter().enumerate() {
            let poses = machine.poses(*axis);
            n_reached += usize::from(k < 4000 && !poses.is_empty());
            for pose in poses {
                let error = (machine.tool_axis(&pose) - *axis).length();
                assert!(error < 1e-9, "{name}: {axis}, {pose:?}: {error}");
            }
        }
        assert!(n_over_sphere.contains(&n_reached), "{name}: {n_reached}");
        assert!(!machine.poses(DVec3::Z).is_empty(), "{name}");
    }
    let n_files = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/machines"));
    assert_eq!(n_files.unwrap().count(), 5, "every example is read here");
}

const A: &str = "[[axis]]\nletter = \"A\"\non = \"table\"\naxis = [1, 0, 0]\n";
const B: &str = "[[axis]]\nletter = \"B\"\non = \"head\"\naxis = [0, 1, 0]\n";
const C: &str = "[[axis]]\nletter = \"C\"\non = \"head\"\naxis = [0, 0, 1]\n";

#[test]
fn bad_files_get_one_line_with_file_line_finding_and_remedy() {
    let name = "name = \"m\"\n";
    let second = "[[axis]]\nletter = \"A\"\non = \"head\"\naxis = [0, 1, 0]\n";
    let cases: [(String, &str, &str); 21] = [
        (String::new(), "m.toml: ", "missing field `name`"),
        ("name = ".into(), "m.toml: line 1: ", "docs/machines"),
        ("name = 3".into(), "m.toml: line 1: ", "expected a string"),
        ("name = \"\"".into(), "m.toml: line 1: ", "\"\" is no name"),
        (format!("{name}tilt = 3"), "m.toml: line 2: ", "unknown field `tilt`"),
        (format!("{name}{A}limit = [0, 1]"), "m.toml: line 6: ", "unknown field `limit`"),
        (format!("{name}home = \"-z\""), "m.toml: line 2: home is `-z`", "home = \"+z\""),
        (format!("{name}{A}limits = [30, -120]"), "m.toml: line 6: limits 30, -120", "least"),
        (format!("{name}{A}limits = [nan, 1]"), "m.toml: line 6: limits NaN, 1", "least"),
        (format!("{name}{A}limits = 30"), "m.toml: line 6: ", "expected a sequence"),
        (
            format!("{name}{A}limits = [0, 1, 2]"),
            "m.toml: line 6: 3 numbers, expected 2",
            "docs/machines",
        ),
        (format!("{name}{A}limits = [\"0\", 1]"), "m.toml: line 6: ", "string"),
        (format!("{name}{A}center_mm = [0, inf, 0]"), "m.toml: line 6: the center 0, inf, 0", "mm"),
        (format!("{name}[strokes_mm]\nx = [5, 5]"), "m.toml: line 3: the stroke 5, 5", "least"),
        (
            format!("{name}{}", A.replace("[1, 0, 0]", "[0, 0, 0]")),
            "m.toml: line 5: the vector 0, 0, 0",
            "axis = [1, 0, 0]",
        ),
        (
            format!("{name}{}", A.replace("\"A\"", "\"AB\"")),
            "m.toml: line 3: letter is `AB`",
            "A, B",
        ),
        (format!("{name}{}", A.replace("table", "frame")), "m.toml: line 4: on is `frame`", "head"),
        (format!("{name}{A}{second}"), "m.toml: line 7: A twice", "letter"),
        (
            format!("{name}{A}{}", B.replace("[0, 1, 0]", "[-3, 0, 0]")),
            "m.toml: line 9: B is parallel to A",
            "leave one",
        ),
        (
            format!("{name}{B}{A}"),
            "m.toml: line 8: table axis A after a head axis",
            "from the part",
        ),
        (format!("{name}{A}{B}{C}"), "m.toml: line 11: 3 rotary axes: A, B, C", "at most two"),
    ];
    for (text, start, part) in cases {
        let message = parse(&text, Path::new("m.toml")).unwrap_err().to_string();
        assert!(message.starts_with(start) && message.contains(part), "{text}\n{message}");
        assert!(!message.contains('\n') && message.contains("; "), "{message}");
    }
}

#[test]
fn words_are_read_as_words_and_toml_as_a_file() {
    assert_eq!(of_words_or_file("3-axis").unwrap(), Machine::ThreeAxis);
    let message = of_words_or_file("no such/mill.TOML").unwrap_err().to_string();
    assert!(message.starts_with("no such/mill.TOML: cannot be read"), "{message}");
    assert!(of_words_or_file("lathe").unwrap_err().to_string().starts_with("machine is `lathe`"));
}

/// A machine as FreeCAD writes it, with rotary axes of these names and texts.
fn fcm(axes: &[(&str, &str)]) -> String {
    let axes: Vec<_> = axes.iter().map(|(name, text)| format!("\"{name}\": {{{text}}}")).collect();
    let x = r#""X": {"type": "linear", "role": "table_linear", "parent": null, "sequence": 0,
        "joint": [[0, 0, 0], [1, 0, 0]], "limits": {"min": 0, "max": 510}, "max_velocity": 18000}"#;
    format!(
        r#"{{"freecad_version": "1.2.0", "machine": {{"name": "VM 5", "units": "metric",
        "kinematics": {{"base_frame": {{"origin": [0, 0, 0], "orientation_quaternion": [0, 0, 0, 1]}}}},
        "axes": {{{x}, {}}}, "toolheads": []}}, "output": {{"units": "metric"}}, "version": 1}}"#,
        axes.join(", ")
    )
}

const ON_TABLE: &str = r#""type": "rotary", "role": "table_rotary""#;
const ON_HEAD: &str = r#""type": "rotary", "role": "head_rotary""#;

#[test]
fn machines_of_freecad_are_the_same_machines_whatever_the_order_and_form_of_their_axes() {
    let path = Path::new("m.fcm");
    let words = |axes: &[(&str, &str)]| {
        freecad::parse(&fcm(axes), path).unwrap().axes().unwrap().to_string()
    };
    let about_z = r#""joint": {"origin": [0, 0, 0], "axis": [0, 0, 1]}"#;
    let a = format!(
        r#"{ON_TABLE}, "parent": null, "joint": [[0, 0, 0], [1, 0, 0]], "limits": {{"min": -120, "max": 30}}"#
    );
    // The round table stands on the cradle, which alone is on the frame.
    let c = format!(r#"{ON_TABLE}, "parent": "A", {about_z}"#);
    let trunnion = "VM 5 (table C, table A -120..30)";
    assert_eq!(words(&[("A", &a), ("C", &c)]), trunnion);
    assert_eq!(words(&[("C", &c), ("A", &a)]), trunnion);
    // FreeCAD's own trunnion has the parents the other way round, and applies the axes in this order.
    let (on_c, c) =
        (a.replace("null", "\"C\""), format!(r#"{ON_TABLE}, "parent": null, {about_z}"#));
    assert_eq!(words(&[("A", &on_c), ("C", &c)]), trunnion);
    let about_y = r#""joint": [[0, 0, 0], [0, 1, 0]]"#;
    let (b, c) =
        (format!("{ON_HEAD}, {about_y}"), format!(r#"{ON_HEAD}, "parent": "B", {about_z}"#));
    let fork = "VM 5 (head C, head B)";
    assert_eq!(words(&[("B", &b), ("C", &c)]), fork);
    let (b, c) =
        (format!(r#"{ON_HEAD}, "parent": "C", {about_y}"#), format!("{ON_HEAD}, {about_z}"));
    assert_eq!(words(&[("B", &b), ("C", &c)]), fork);
    // Neither is about z: the root of the chain carries the part.
    let b = format!(r#"{ON_TABLE}, "parent": "A", {about_y}"#);
    assert_eq!(words(&[("B", &b), ("A", &a)]), "VM 5 (table A -120..30, table B)");
    let b = format!("{ON_TABLE}, \"sequence\": -1, {about_y}");
    assert_eq!(words(&[("A", &a), ("B", &b)]), "VM 5 (table B, table A -120..30)");
    // A head after a table.
    let c = format!(r#"{ON_TABLE}, "parent": "X", {about_z}"#);
    let b = format!(r#"{ON_HEAD}, "joint": [[0, 0, 0], [0, 1, 0]]"#);
    assert_eq!(words(&[("B", &b), ("C", &c)]), "VM 5 (table C, head B)");
    // The example in TOML and the same machine here have the same angles.
    let toml = example("trunnion-ac.toml");
    let c = format!(r#"{ON_TABLE}, "parent": "A", {about_z}"#);
    let same = freecad::parse(&fcm(&[("A", &a), ("C", &c)]), path).unwrap();
    for axis in [DVec3::Z, DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.48, 0.64, 0.6)] {
        assert_eq!(toml.poses(axis), same.axes().unwrap().poses(axis));
    }
}

#[test]
fn strokes_are_as_long_as_the_places_are_apart() {
    let strokes = |machine: &Machine| machine.axes().unwrap().strokes_mm();
    let toml = read(Path::new("docs/machines/three-axis.toml")).unwrap();
    assert_eq!(strokes(&toml), DVec3::new(762.0, 406.0, 508.0));
    let text = "name = \"n\"\n[strokes_mm]\ny = [-3, 5]";
    let only_y = parse(text, Path::new("m.toml")).unwrap();
    assert_eq!(strokes(&only_y), DVec3::new(f64::INFINITY, 8.0, f64::INFINITY));
    // FreeCAD's x is from 0 to 510; of y and z nothing is known, or nothing that is a length in mm.
    let of = |text: &str| strokes(&freecad::parse(text, Path::new("m.fcm")).unwrap());
    let linear = |more: &str| ("Y", format!(r#""type": "linear", {more}"#));
    let x_alone = DVec3::new(510.0, f64::INFINITY, f64::INFINITY);
    for more in [
        r#""limits": {"min": 0, "max": 300}"#,
        r#""joint": [[0, 0, 0], [0, 0.6, 0.8]], "limits": {"min": 0, "max": 300}"#,
        r#""joint": [[0, 0, 0], [0, 1, 0]]"#,
        r#""joint": [[0, 0, 0], [0, 1, 0]], "limits": {"min": 5, "max": 5}"#,
    ] {
        let (name, text) = linear(more);
        assert_eq!(of(&fcm(&[(name, &text)])), x_alone, "{more}");
    }
    let (name, text) =
        linear(r#""joint": {"axis": [0, -1, 0]}, "limits": {"min": -100, "max": 300}"#);
    let both = fcm(&[(name, &text)]);
    assert_eq!(of(&both), DVec3::new(510.0, 400.0, f64::INFINITY));
    let inches =
        both.replace("\"name\": \"VM 5\", \"units\": \"metric\"", "\"units\": \"imperial\"");
    assert_eq!(of(&inches), DVec3::INFINITY);
}

#[test]
fn bad_machines_of_freecad_get_one_line_with_the_axis_and_a_remedy() {
    let joint = r#""joint": [[0, 0, 0], [1, 0, 0]]"#;
    let a = |more: &str| fcm(&[("A", &format!("{ON_TABLE}, {more}"))]);
    let cases: [(String, &str, &str); 12] = [
        ("{".into(), "m.fcm: line 1: ", "FreeCAD"),
        ("{}".into(), "m.fcm: file: no `machine`", "FreeCAD"),
        (r#"{"machine": {"axes": 3}}"#.into(), "m.fcm: line 1: ", "FreeCAD"),
        (a(r#""parent": null"#), "m.fcm: machine.axes.A: no `joint`", "joint.axis"),
        (a(r#""joint": [[0, 0, 0]]"#), "m.fcm: line ", "FreeCAD"),
        (a(&format!(r#"{joint}, "parent": "A""#)), "m.fcm: machine.axes.A: a parent", "frame"),
        (a(&format!(r#"{joint}, "parent": "Q""#)), "m.fcm: machine.axes.A: a parent", "frame"),
        (
            a(&format!(r#"{joint}, "limits": {{"min": 90, "max": -90}}"#)),
            "m.fcm: machine.axes.A: limits 90, -90",
            "least",
        ),
        (
            a(&joint.replace("[1, 0, 0]", "[0, 0, 0]")),
            "m.fcm: machine.axes.A: the vector 0, 0, 0",
            "vector",
        ),
        (
            fcm(&[("A", &format!(r#""type": "rotary", "role": "frame", {joint}"#))]),
            "m.fcm: machine.axes.A: role is `frame`",
            "table_rotary",
        ),
        (fcm(&[("A2", &format!("{ON_TABLE}, {joint}"))]), "m.fcm: machine.axes.A2: `A2`", "A, B"),
        (
            a(joint).replace("[0, 0, 0, 1]", "[1, 0, 0, 0]"),
            "m.fcm: machine.kinematics.base_frame: a base frame turned",
            "+z",
        ),
    ];
    for (text, start, part) in cases {
        let message = freecad::parse(&text, Path::new("m.fcm")).unwrap_err().to_string();
        assert!(message.starts_with(start) && message.contains(part), "{text}\n{message}");
        assert!(!message.contains('\n') && message.contains("; "), "{message}");
    }
}
