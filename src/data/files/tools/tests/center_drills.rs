//! Center drills of all kinds of files, their lengths by hand.

use super::families::{close, fusion, one};
use super::profiles::library;
use super::*;

/// A center drill of 6 mm: a pilot of 2 mm, as long with its point of 118°, below a countersink of 90°.
const CENTER: &str = r#""DC": 6, "LCF": 12, "SFDM": 6, "SIG": 118, "TA": 90, "tip-diameter": 2, "tip-length": 2,
    "shoulder-length": 15"#;

fn only(text: &str, name: &str, given: &MissingParameters) -> ToolTable {
    from_bytes(text.as_bytes(), name.as_ref(), given).unwrap()
}

#[test]
fn center_drills_have_a_pilot_below_their_countersink() {
    let cone = 1.0 / 59f64.to_radians().tan();
    let pilot = [(0.5 * cone, 0.5), (cone, 1.0), (1.9, 1.0), (2.0, 1.0)];
    let stated = [(2.5, 1.5), (3.5, 2.5), (4.0, 3.0), (14.0, 3.0)];
    let of_60 = [(2.0 + 3f64.sqrt(), 2.0), (2.0 + 12f64.sqrt(), 3.0), (14.0, 3.0)];
    let tool = one(&fusion("center drill", CENTER), "c.json");
    close(&tool, &[&pilot[..], &stated].concat());
    assert!(tool.words().starts_with("center drill 90°, pilot 2 mm, 6 mm"), "{}", tool.words());
    let profile = tool.assembly.profile().unwrap();
    assert!(profile.is_drill() && (profile.flutes_mm() - 4.0).abs() < 1e-9);
    // Without its angle the countersink has 60°, which is said.
    for angle in ["\"TA\": 0", "\"TX\": 1"] {
        let table = only(
            &fusion("center drill", &CENTER.replace("\"TA\": 90", angle)),
            "c.json",
            &library(),
        );
        assert_eq!(table.notices.len(), 1, "{:?}", table.notices);
        assert!(table.notices[0].contains("its TA is missing: a countersink of 60° counts"));
        close(&table.tools[0], &[&pilot[..], &of_60].concat());
    }
    // `.hsmlib` files give both angles, in either order.
    for angles in
        ["taper-angle=\"118\" taper-angle2=\"90\"", "taper-angle=\"90\" taper-angle2=\"118\""]
    {
        let text = format!(
            r#"<tool-library><tool type="center drill" unit="millimeters"><description>A2</description>
            <body diameter="6" {angles} tip-diameter="2" tip-length="2" flute-length="12" shoulder-length="15"
            body-length="40" overall-length="80" shaft-diameter="6"/></tool></tool-library>"#
        );
        close(&one(&text, "c.hsmlib"), &[&pilot[..], &stated].concat());
    }
    let table = "name, diameter, taper, tip, tip_length, point, flute_length, shank, stick_out\n\
        Zentrierbohrer, 6, 45, 2, 2, 118, 12, 6, 40\ncenter drill, 6, , 2, 2, , 12, 6, 40\n";
    let table = only(table, "c.csv", &library());
    close(&table.tools[0], &[&pilot[..], &stated].concat());
    close(&table.tools[1], &[&pilot[..], &of_60].concat());
    assert_eq!(table.notices.len(), 1, "{:?}", table.notices);
    // The same column is the tip of a cone.
    let cones = "name, diameter, taper, tip, flute_length, shank, stick_out\nV-bit, 6, 45, 1, 5, 6, 40\n\
        V-bit 2, 6, 45, 7, 5, 6, 40\n";
    let cones = only(cones, "v.csv", &library());
    close(&cones.tools[0], &[(0.0, 0.5), (1.0, 1.5), (2.5, 3.0)]);
    assert!(cones.refused.len() == 1 && cones.refused[0].contains("radius of the tool is 3"));
}

#[test]
fn a_center_drill_that_lacks_something_is_left_out_by_name() {
    let refused = |text: &str, name: &str, given: &MissingParameters| {
        from_bytes(text.as_bytes(), name.as_ref(), given).unwrap_err().to_string()
    };
    for (old, new, expected) in [
        ("\"SIG\": 118", "\"SIG\": 0", "SIG, the angle of the pilot's point, is missing or 0"),
        ("\"tip-diameter\": 2", "\"x\": 2", "tip-diameter, the diameter of the pilot, is missing"),
        (
            "\"tip-length\": 2",
            "\"tip-length\": 0",
            "tip-length, the length of the pilot, is missing",
        ),
        ("\"TA\": 90", "\"TA\": 30", "a countersink of 30°"),
        ("\"tip-diameter\": 2", "\"tip-diameter\": 6", "radius of the center drill is 3"),
        ("\"tip-length\": 2", "\"tip-length\": 0.5", "length of the pilot is 0.5"),
        ("\"SIG\": 118", "\"SIG\": 180", "point angle is 180°"),
        ("\"TA\": 90", "\"TA\": 200", "angle of the countersink is 200°"),
    ] {
        let text = fusion("center drill", &CENTER.replace(old, new));
        let message = refused(&text, "c.json", &library());
        assert!(message.contains(expected) && message.contains("\"x\""), "{message}");
    }
    let table =
        "name, diameter, taper, flute_length, shank, stick_out\ncenter drill, 6, 30, 12, 6, 40\n";
    let message = refused(table, "c.csv", &library());
    assert!(message.contains("columns tip and tip_length"), "{message}");
    // A remark has no pilot: it is no drill of 60°.
    let given = MissingParameters { unit_mm: Some(1.0), flutes_mm: Some(9.0), ..library() };
    let message = refused("T1 P1 D6 ;center drill 60 deg\n", "c.tbl", &given);
    assert!(message.contains("names a center drill"), "{message}");
}
