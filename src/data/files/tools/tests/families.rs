//! Families beside end mills: their lengths by hand.

use super::profiles::{library, radii};
use super::*;
use proptest::prelude::*;

/// A library of one tool of Fusion 360, mm.
pub(super) fn fusion(kind: &str, geometry: &str) -> String {
    format!(
        r#"{{"data": [{{"type": "{kind}", "description": "x", "unit": "millimeters",
        "geometry": {{"LB": 40, "OAL": 80, {geometry}}}}}]}}"#
    )
}

pub(super) fn one(text: &str, name: &str) -> Tool {
    let table = from_bytes(text.as_bytes(), name.as_ref(), &library()).unwrap();
    assert!(table.refused.is_empty(), "{:?}", table.refused);
    table.tools[0].clone()
}

pub(super) fn close(tool: &Tool, expected: &[(f64, f64)]) {
    for (height, radius) in expected {
        let found = radii(tool, [*height; 3])[0];
        assert!((found - radius).abs() < 2e-6, "{}: {found} at {height}", tool.words());
    }
}

#[test]
fn circle_segments_are_arcs_tangent_to_their_corners() {
    let barrel = r#""DC": 12, "LCF": 24, "SFDM": 6, "axial-distance": 10, "lower-radius": 1, "upper-radius": 0.5,
        "profile-radius": 48, "shoulder-diameter": 6, "shoulder-length": 30"#;
    let tool = one(&fusion("circle segment barrel", barrel), "b.json");
    let flank = |z: f64| 6.0 - 48.0 + (48.0 * 48.0 - (z - 10.0) * (z - 10.0)).sqrt();
    close(&tool, &[(10.0, 6.0), (4.0, flank(4.0)), (20.0, flank(20.0)), (25.0, 3.0)]);
    assert_eq!(tool.assembly.profile().unwrap().flutes_mm(), 24.0);
    // The middle of the flutes and RE where no more is said.
    let shop = r#""DC": 10, "RE": 1, "profile-radius": 85, "LCF": 22, "SFDM": 10"#;
    close(&one(&fusion("circle segment barrel", shop), "b.json"), &[(11.5, 5.0), (30.0, 5.0)]);
    // The flutes of an oval mill end where its arc is vertical: they say the tip.
    let oval = r#""DC": 6, "LCF": 19.76166304, "profile-radius": 90, "lower-radius": 0, "SFDM": 6"#;
    let tool = one(&fusion("circle segment oval", oval), "o.json");
    close(&tool, &[(0.5, (1.0f64 - 0.25).sqrt()), (19.7617, 3.0)]);
    assert!(tool.words().starts_with("oval R90 6 mm"), "{}", tool.words());
    let taper = r#""DC": 16, "LCF": 15.69, "TA": 20, "lower-radius": 4, "profile-radius": 500, "upper-radius": 8,
        "SFDM": 16"#;
    let tool = one(&fusion("circle segment taper", taper), "t.json");
    let top = 4.0 + 4.0 / 20f64.to_radians().sin();
    let profile = tool.assembly.profile().unwrap();
    assert!((profile.flutes_mm() - top).abs() < 1e-9, "{}", profile.flutes_mm());
    // The flank bulges beyond the cone that touches both corners, by less than span²/8R.
    let cone = |z: f64| 4.0 / 20f64.to_radians().cos() + (z - 4.0) * 20f64.to_radians().tan();
    let middle = 0.5 * (4.0 + top) - 1.0;
    let beyond = profile.radius_at(middle) - cone(middle);
    assert!(beyond > 0.0 && beyond < top * top / 4000.0, "{beyond}");
    let lens =
        r#""DC": 10, "LCF": 20, "RE": 0, "lower-radius": 10, "profile-radius": 100, "SFDM": 10"#;
    close(
        &one(&fusion("circle segment lens", lens), "l.json"),
        &[(1.0, 19f64.sqrt()), (10.0 - 75f64.sqrt(), 5.0), (9.0, 5.0)],
    );
}

#[test]
fn radius_thread_and_face_mills_are_what_the_maker_measures() {
    let radius = r#""DC": 12, "RE": 6, "LCF": 12, "SFDM": 24, "shoulder-diameter": 24, "shoulder-length": 12"#;
    let tool = one(&fusion("radius mill", radius), "r.json");
    close(&tool, &[(0.0, 6.0), (3.0, 12.0 - 27f64.sqrt()), (6.0, 12.0), (20.0, 12.0)]);
    let outer = radius.replace("\"DC\": 12", "\"DC\": 24, \"tip-diameter\": 12");
    assert_eq!(one(&fusion("radius mill", &outer), "r.json").cutter, tool.cutter);
    let low = radius.replace("\"RE\": 6", "\"RE\": 6, \"tip-length\": 2");
    close(&one(&fusion("radius mill", &low), "r.json"), &[(1.9, 6.0), (8.0, 12.0)]);

    let cot = 1.0 / 30f64.to_radians().tan();
    let thread = r#""DC": 10, "LCF": 6, "NT": 3, "TP": 1.5, "thread-profile-angle": 60, "SFDM": 10,
        "shoulder-diameter": 7, "shoulder-length": 20, "thread-tip-type": "point""#;
    let root = 5.0 - 0.75 * cot;
    let tool = one(&fusion("thread mill", thread), "t.json");
    close(&tool, &[(0.75, 5.0), (1.5, root), (3.75, 5.0), (10.0, 3.5), (30.0, 5.0)]);
    assert!(tool.words().starts_with("thread mill 60°, 3 rings, 10 mm"), "{}", tool.words());
    // Two fit into flutes of 3.2 mm; a flat crest is cut off, a round one is tangent to the flanks.
    let two = thread.replace("\"LCF\": 6", "\"LCF\": 3.2");
    assert!(one(&fusion("thread mill", &two), "t.json").words().contains("2 rings"));
    let flat = thread.replace("\"point\"", "\"flat\", \"thread-tip-width\": 0.2");
    close(
        &one(&fusion("thread mill", &flat), "t.json"),
        &[(0.6, 5.0), (0.75, 5.0), (1.4, 5.0 - 0.55 * cot)],
    );
    let round = thread.replace("\"point\"", "\"round\", \"thread-tip-radius\": 0.1");
    let single = round.replace("\"NT\": 3", "\"NT\": 1");
    close(&one(&fusion("thread mill", &single), "t.json"), &[(0.75, 5.0), (0.0, root + 0.1)]);
    one(&fusion("thread mill", &round), "t.json");
    // Without a pitch, the neck says how deep a single ring is.
    let range = single.replace("\"TP\": 1.5", "\"TP\": 0, \"TPN\": 1, \"TPX\": 2");
    one(&fusion("thread mill", &range), "t.json");

    let face = r#""DC": 50, "DCX": 63, "RE": 0.8, "TA": 45, "LCF": 8, "SFDM": 27, "shoulder-diameter": 48,
        "shoulder-length": 20"#;
    let tool = one(&fusion("face mill", face), "f.json");
    close(
        &tool,
        &[
            (0.0, 25.0 - 0.8 * (2f64.sqrt() - 1.0)),
            (3.0, 28.0),
            (6.5, 31.5),
            (10.0, 24.0),
            (30.0, 13.5),
        ],
    );
    let upper = face.replace("\"TA\"", "\"upper-radius\": 1, \"TA\"");
    close(
        &one(&fusion("face mill", &upper), "f.json"),
        &[(3.0, 28.0), (6.5 + 22.5f64.to_radians().tan(), 31.5)],
    );
    // Nowhere thinner above, it is a bull nose end mill.
    let plain = r#""DC": 50, "RE": 1, "TA": 0, "LCF": 12, "SFDM": 50, "shoulder-diameter": 50, "shoulder-length": 12"#;
    assert!(one(&fusion("face mill", plain), "f.json").words().starts_with("bull nose 50 mm R1"));
    let arbor = plain.replace("\"SFDM\": 50", "\"SFDM\": 22");
    close(&one(&fusion("face mill", &arbor), "f.json"), &[(0.0, 24.0), (5.0, 25.0), (20.0, 11.0)]);
}

#[test]
fn hole_tools_that_are_cones_or_cylinders_are_read() {
    let sink = r#""DC": 12, "LCF": 5.4, "SFDM": 7.2, "SIG": 90, "tip-diameter": 1.2, "shoulder-length": 8.1"#;
    close(
        &one(&fusion("counter sink", sink), "s.json"),
        &[(0.0, 0.6), (2.0, 2.6), (5.4, 6.0), (7.0, 6.0), (9.0, 3.6)],
    );
    let spot = r#""DC": 6, "LCF": 12, "SFDM": 6, "SIG": 120"#;
    close(&one(&fusion("spot drill", spot), "s.json"), &[(1.0, 3f64.sqrt()), (9.0, 3.0)]);
    let bore = r#""DC": 6, "LCF": 12, "SFDM": 4.8, "SIG": 0, "shoulder-length": 12"#;
    let tool = one(&fusion("counter bore", bore), "s.json");
    close(&tool, &[(0.0, 3.0), (11.0, 3.0), (13.0, 2.4)]);
    assert!(tool.words().starts_with("counterbore 6 mm"), "{}", tool.words());
    let corner = r#""DC": 10, "LCF": 20, "SFDM": 10, "chamfer-width": 1, "chamfer-angle": 60"#;
    let tool = one(&fusion("corner chamfer end mill", corner), "s.json");
    close(&tool, &[(0.0, 4.0), (3f64.sqrt(), 5.0), (10.0, 5.0)]);
    // Above its widest place a chamfer mill narrows to its neck.
    let chamfer = r#""DC": 10, "LCF": 6, "SFDM": 6, "TA": 45, "tip-diameter": 1, "shoulder-diameter": 4,
        "shoulder-length": 20"#;
    close(
        &one(&fusion("chamfer mill", chamfer), "s.json"),
        &[(4.5, 5.0), (5.5, 4.0), (7.5, 2.0), (15.0, 2.0), (30.0, 3.0)],
    );
    for kind in ["boring bar", "tap right hand", "probe", "laser cutter"] {
        let text = fusion(kind, r#""DC": 6, "SIG": 118, "LCF": 12, "SFDM": 6"#);
        let message = from_bytes(text.as_bytes(), "x.json".as_ref(), &library()).unwrap_err();
        assert!(message.to_string().contains(&format!("a {kind} cannot be represented")));
    }
}

#[test]
fn a_shaft_that_is_no_cylinder_is_read_from_the_end_of_the_neck() {
    let with = |kind: &str, geometry: &str, shaft: &str| {
        let text =
            fusion(kind, geometry).replace("\"description\"", &format!("{shaft}, \"description\""));
        one(&text, "x.json")
    };
    let shaft = r#""shaft": {"type": "shaft", "segments": [
        {"height": 10, "lower-diameter": 4, "upper-diameter": 8},
        {"height": 5, "lower-diameter": 10, "upper-diameter": 10}]}"#;
    let slot = r#""DC": 12, "LCF": 3, "SFDM": 6, "shoulder-diameter": 4, "shoulder-length": 9"#;
    let tool = with("slot mill", slot, shaft);
    close(
        &tool,
        &[(2.0, 6.0), (8.0, 2.0), (14.0, 3.0), (18.999, 3.9998), (20.0, 5.0), (38.0, 5.0)],
    );
    let flat = r#""DC": 4, "LCF": 6, "SFDM": 4, "shoulder-diameter": 3.8, "shoulder-length": 9"#;
    let tool = with("flat end mill", flat, shaft);
    let at = |height: f64| {
        let steps = tool.cutter.steps().iter().filter(|step| step.height_mm <= height);
        steps.map(|step| step.radius_mm).fold(0.0, f64::max)
    };
    assert!((at(14.0) - 3.0).abs() < 0.11 && at(14.0) >= 3.0 && at(20.0) == 5.0, "{}", at(14.0));
    let bad = shaft.replace("\"height\": 10, ", "");
    let text =
        fusion("slot mill", slot).replace("\"description\"", &format!("{bad}, \"description\""));
    let message = from_bytes(text.as_bytes(), "x.json".as_ref(), &library()).unwrap_err();
    assert!(message.to_string().contains("tool \"x\": segment 1 has no height"), "{message}");
}

#[test]
fn a_form_mill_is_its_outline_whichever_way_it_is_drawn() {
    let outline = r#"{"end": [0, 0]}, {"end": [5, 0]}, {"end": [5, 4]},
        {"end": [7, 6], "center": [7, 4], "arc": true, "ccw": false}, {"end": [9, 6]}, {"end": [9, 30]}, {"end": [0, 30]}"#;
    let text = |outline: &str| {
        let geometry = format!(r#""DC": 10, "LCF": 80, "SFDM": 18, "profile": [{outline}]"#);
        fusion("form mill", &geometry)
    };
    let tool = one(&text(outline), "m.json");
    close(&tool, &[(0.0, 5.0), (3.0, 5.0), (5.0, 7.0 - 3f64.sqrt()), (6.0, 9.0), (50.0, 9.0)]);
    // The cylinder above is the shank.
    assert_eq!(tool.assembly.profile().unwrap().flutes_mm(), 6.0);
    let turned = r#"{"end": [0, 30]}, {"end": [9, 30]}, {"end": [9, 6]}, {"end": [7, 6]},
        {"end": [5, 4], "center": [7, 4], "arc": true, "ccw": true}, {"end": [5, 0]}, {"end": [0, 0]}"#;
    assert_eq!(one(&text(turned), "m.json").cutter, tool.cutter);
    for (bad, words) in [
        (r#"{"end": [0, 0]}"#.to_string(), "its outline, is missing"),
        (outline.replace("[9, 6]", "[9]"), "point 5 of its profile"),
        (outline.replace("[5, 4]", "[5, 8]"), "height"),
    ] {
        let message = from_bytes(text(&bad).as_bytes(), "m.json".as_ref(), &library());
        let message = message.unwrap_err().to_string();
        assert!(message.contains(words) && message.contains("; "), "{message}");
    }
}

#[test]
fn what_contradicts_itself_is_left_out_with_the_reason() {
    for (kind, geometry, expected) in [
        ("radius mill", r#""DC": 12, "LCF": 12, "SFDM": 12"#, "RE, the radius of the arc"),
        ("thread mill", r#""DC": 10, "TP": 1.5, "NT": 3, "SFDM": 10"#, "thread-profile-angle"),
        (
            "thread mill",
            r#""DC": 10, "TP": 8, "LCF": 5, "thread-profile-angle": 60, "SFDM": 10"#,
            "does not fit into the flutes",
        ),
        (
            "thread mill",
            r#""DC": 4, "TP": 6, "LCF": 9, "thread-profile-angle": 60, "SFDM": 4"#,
            "radius of the neck",
        ),
        ("counter sink", r#""DC": 10, "LCF": 5, "SFDM": 10"#, "SIG, the angle of the point"),
        ("counter sink", r#""DC": 10, "SIG": 190, "SFDM": 10"#, "angle of the flank"),
        ("circle segment barrel", r#""DC": 10, "LCF": 20, "SFDM": 10"#, "profile-radius"),
        (
            "circle segment barrel",
            r#""DC": 10, "LCF": 20, "profile-radius": 3, "SFDM": 10"#,
            "radius of the flank's arc",
        ),
        (
            "circle segment oval",
            r#""DC": 6, "LCF": 60, "profile-radius": 90, "SFDM": 6"#,
            "lower-radius, the radius of the tip",
        ),
        (
            "circle segment taper",
            r#""DC": 16, "TA": 20, "lower-radius": 9, "profile-radius": 500, "SFDM": 16"#,
            "corner of the lower end",
        ),
        (
            "face mill",
            r#""DC": 50, "RE": 40, "TA": 45, "LCF": 6, "SFDM": 50"#,
            "corner of the mill",
        ),
        (
            "corner chamfer end mill",
            r#""DC": 6, "chamfer-width": 4, "chamfer-angle": 45, "SFDM": 6"#,
            "fits into the radius",
        ),
    ] {
        let text = fusion(kind, geometry);
        let message = from_bytes(text.as_bytes(), "x.json".as_ref(), &library()).unwrap_err();
        let message = message.to_string();
        let named = message.starts_with("x.json: tool \"x\": ") && message.contains("; ");
        assert!(named && message.contains(expected), "{kind}: {message}");
    }
}

#[test]
fn every_shape_of_freecad_and_camotics_that_mills_is_read() {
    let bit = |shape: &str, more: &str| {
        let text = format!(
            r#"{{"version": 2, "name": "x", "shape": "{shape}.fcstd", "parameter": {{"Length": "60 mm", {more}}}}}"#
        );
        one(&text, "x.fctb")
    };
    let saw = r#""BladeThickness": "3 mm", "CapDiameter": "8 mm", "CapHeight": "2 mm", "Diameter": "76.2 mm",
        "ShankDiameter": "19 mm""#;
    let tool = bit("slittingsaw", saw);
    close(&tool, &[(1.0, 4.0), (2.0, 38.1), (4.9, 38.1), (6.0, 9.5)]);
    let profile = tool.assembly.profile().unwrap();
    assert!(!profile.pieces()[0].cuts && profile.flutes_mm() == 5.0);
    let radius = r#""CuttingEdgeHeight": "14 mm", "CuttingRadius": "10 mm", "Diameter": "15 mm", "TipDiameter": "5 mm",
        "ShankDiameter": "8 mm""#;
    close(&bit("radius", radius), &[(0.0, 2.5), (75f64.sqrt(), 7.5), (13.0, 7.5), (15.0, 4.0)]);
    let thread = r#""Crest": "0.1 mm", "Diameter": "5 mm", "NeckDiameter": "3 mm", "NeckLength": "20 mm",
        "ShankDiameter": "5 mm", "cuttingAngle": "60 °""#;
    let tan = 30f64.to_radians().tan();
    for shape in ["thread-mill", "threadmill", "Thread_Mill"] {
        let expected = [(tan, 2.5), (tan + 0.1, 2.5), (2.0, 1.5), (21.0, 2.5)];
        close(&bit(shape, thread), &expected);
    }
    let v = r#""CuttingEdgeAngle": "90 °", "CuttingEdgeHeight": "1 mm", "Diameter": "10 mm", "TipDiameter": "1 mm",
        "ShankDiameter": "5 mm""#;
    close(&bit("v-bit", v), &[(2.0, 2.5), (4.5, 5.0), (5.4, 5.0), (6.0, 2.5)]);
    let slot = r#""CuttingEdgeHeight": "4 mm", "Diameter": "16 mm", "NeckDiameter": "7 mm", "NeckHeight": "10 mm",
        "ShankDiameter": "10 mm""#;
    close(&bit("t-slot", slot), &[(2.0, 8.0), (10.0, 3.5), (20.0, 5.0)]);

    let table = r#"{"1": {"units": "metric", "shape": "conical", "length": 5, "diameter": 10},
        "2": {"units": "metric", "shape": "snubnose", "length": 5, "diameter": 10, "snub_diameter": 2},
        "3": {"units": "metric", "shape": "snubnose", "length": 5, "diameter": 6, "snub_diameter": 10},
        "4": {"units": "metric", "shape": "spheroid", "length": 10, "diameter": 10},
        "5": {"units": "metric", "shape": "spheroid", "length": 20, "diameter": 10},
        "6": {"units": "metric", "shape": "snubnose", "length": 5, "diameter": 6, "snub_diameter": 6},
        "7": {"units": "metric", "shape": "cube", "length": 5, "diameter": 6}}"#;
    let given = MissingParameters { shank_mm: Some(6.0), ..library() };
    let table = from_bytes(table.as_bytes(), "t.json".as_ref(), &given).unwrap();
    let [cone, snub, wide, ball, long, flat] = &table.tools[..] else { panic!("{table:?}") };
    close(cone, &[(0.0, 0.0), (2.5, 2.5), (5.0, 5.0), (9.0, 3.0)]);
    close(snub, &[(0.0, 1.0), (2.5, 3.0), (9.0, 3.0)]);
    close(wide, &[(0.0, 5.0), (2.5, 4.0), (9.0, 3.0)]);
    assert!(
        ball.words().starts_with("ball end 10 mm") && flat.words().starts_with("flat end 6 mm")
    );
    let profile = long.assembly.profile().unwrap();
    for k in 1..20 {
        let z = f64::from(k);
        let exact =
            (5.0 * (1.0 - (z / 10.0 - 1.0).powi(2)).sqrt()).max(if z > 10.0 { 3.0 } else { 0.0 });
        let found = profile.radius_at(z);
        assert!(found >= exact - 1e-9 && found < 1.003 * exact + 0.02, "{found} {exact} at {z}");
    }
    assert_eq!(table.refused.len(), 1);
}

/// Numbers that files have, and numbers that they should not have.
fn number() -> impl Strategy<Value = f64> {
    let odd =
        [0.0, -1.0, 1e-9, 1e-4, 0.5, 1.0, 3.0, 10.0, 45.0, 60.0, 90.0, 118.0, 180.0, 1e3, 1e5, 1e9];
    prop_oneof![prop::sample::select(odd.to_vec()), 0.01f64..100.0]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn any_lengths_are_a_tool_that_is_read_again_or_an_error_with_a_remedy(
        k in 0usize..50,
        changed in prop::collection::vec((prop::sample::select(KEYS.to_vec()), number()), 0..6),
    ) {
        let mut shop: serde_json::Value = serde_json::from_str(super::export::SHOP).unwrap();
        let tool = &mut shop["data"][k];
        for (key, number) in changed {
            tool["geometry"][key] = number.into();
        }
        match from_bytes(tool.to_string().as_bytes(), "x.json".as_ref(), &library()) {
            Err(error) => {
                let message = error.to_string();
                prop_assert!(message.contains("; ") && !message.contains('\n'), "{message}");
            }
            Ok(table) => for tool in &table.tools {
                prop_assert!(tool.cutter.steps().is_sorted_by(|a, b| a.radius_mm <= b.radius_mm));
                let again = from_bytes(&to_csv(&table.tools), "a.csv".as_ref(), &library()).unwrap();
                let [was, is] = [&tool.assembly, &again.tools[0].assembly];
                let mut ends = was.tip().into_iter().zip(is.tip());
                prop_assert!(was.profile() == is.profile());
                prop_assert!(ends.all(|(was, is)| (was - is).abs() < 1e-6));
            }
        }
    }
}

const KEYS: [&str; 22] = [
    "DC",
    "DCX",
    "RE",
    "LCF",
    "LB",
    "OAL",
    "SFDM",
    "TA",
    "SIG",
    "TP",
    "NT",
    "tip-diameter",
    "tip-length",
    "shoulder-length",
    "shoulder-diameter",
    "thread-profile-angle",
    "thread-tip-width",
    "profile-radius",
    "axial-distance",
    "lower-radius",
    "upper-radius",
    "chamfer-width",
];

#[test]
fn freecad_fillets_are_corner_rounding_mills_below_a_crown() {
    let bit = |parameters: &str| {
        format!(
            r#"{{"version": 2, "name": "R6", "shape": "fillet.fcstd", "shape-type": "Fillet", "parameter":
            {{"Length": "60 mm", "ShankDiameter": "8 mm", {parameters}}}}}"#
        )
    };
    let round = r#""Diameter": "18 mm", "FilletRadius": "6 mm", "CrownHeight": "4 mm""#;
    let tool = one(&bit(round), "r.fctb");
    // A quarter of a circle about (9, 0): vertical at the tip of radius 3, across the axis at the crown.
    let arc = |height: f64| 9.0 - (36.0 - height * height).sqrt();
    close(&tool, &[(0.0, 3.0), (3.0, arc(3.0)), (5.9, arc(5.9)), (6.5, 9.0), (9.9, 9.0)]);
    close(&tool, &[(10.1, 4.0), (20.0, 4.0)]);
    assert!(tool.words().starts_with("corner rounding mill R6 18 mm"), "{}", tool.words());
    // Only tip and arc cut.
    assert!((tool.assembly.profile().unwrap().flutes_mm() - 6.0).abs() < 1e-9);
    // A tip that is a point is none of a mill, but no contradiction.
    one(&bit(&round.replace("18 mm", "12 mm")), "r.fctb");
    for (old, new, expected) in [
        ("18 mm", "11 mm", "FilletRadius 6 mm on a Diameter of 11 mm"),
        ("\"CrownHeight\": \"4 mm\"", "\"x\": 1", "CrownHeight is missing"),
        ("\"6 mm\"", "\"0 mm\"", "FilletRadius is missing or 0"),
        ("\"6 mm\"", "\"six\"", "FilletRadius is \"six\""),
    ] {
        let text = bit(&round.replace(old, new));
        let message = from_bytes(text.as_bytes(), "r.fctb".as_ref(), &library()).unwrap_err();
        assert!(message.to_string().contains(expected), "{message}");
    }
    // In other versions the name stands for the shape `radius`.
    let other = r#""Diameter": "18 mm", "CuttingRadius": "6 mm", "CuttingEdgeHeight": "10 mm""#;
    close(&one(&bit(other), "r.fctb"), &[(0.0, 3.0), (3.0, arc(3.0)), (9.0, 9.0)]);
}
