//! Tools given by their profiles.

use super::*;
use crate::tool::cutter::Profile;

const HOLDER: &str = "height,lower,upper\n40,30,30\n";

pub(super) fn library() -> MissingParameters {
    let holder =
        holder_from_bytes(HOLDER.as_bytes(), "holder.csv".as_ref(), &MissingParameters::default());
    MissingParameters {
        holder: Some(holder.unwrap()),
        stick_out_mm: Some(40.0),
        ..MissingParameters::default()
    }
}

/// Radii of a tool's profile, to a millionth.
pub(super) fn radii(tool: &Tool, heights: [f64; 3]) -> [f64; 3] {
    let profile = tool.assembly.profile().expect("a profile");
    heights.map(|height| (profile.radius_at(height) * 1e6).round() / 1e6)
}

#[test]
fn tools_wider_below_than_above_are_read_from_tables_of_fusion_and_freecad() {
    let fusion = r#"{"data": [
        {"type": "lollipop mill", "description": "L6", "unit": "millimeters", "geometry":
            {"DC": 6, "LB": 40, "LCF": 5, "OAL": 60, "SFDM": 6, "shoulder-diameter": 3, "shoulder-length": 20}},
        {"type": "slot mill", "description": "S12", "unit": "millimeters", "geometry":
            {"DC": 12, "LB": 40, "LCF": 3, "OAL": 60, "SFDM": 8, "RE": 0.2, "shoulder-diameter": 5, "shoulder-length": 20}},
        {"type": "dovetail mill", "description": "D20", "unit": "millimeters", "geometry":
            {"DC": 20, "LB": 40, "LCF": 9, "TA": 60, "RE": 0, "OAL": 60, "SFDM": 8, "shoulder-diameter": 8, "shoulder-length": 20}},
        {"type": "chamfer mill", "description": "C10", "unit": "millimeters", "geometry":
            {"DC": 10, "LB": 40, "LCF": 6, "TA": 45, "tip-diameter": 1, "OAL": 60, "SFDM": 10}},
        {"type": "drill", "description": "drill", "unit": "millimeters", "geometry": {"DC": 5, "LB": 40}}
    ]}"#;
    let table = from_bytes(fusion.as_bytes(), "shop.json".as_ref(), &library()).unwrap();
    let [ball, slot, dovetail, chamfer] = &table.tools[..] else { panic!("{table:?}") };
    assert_eq!(radii(ball, [3.0, 10.0, 30.0]), [3.0, 1.5, 3.0]);
    assert_eq!(radii(slot, [1.5, 10.0, 30.0]), [6.0, 2.5, 4.0]);
    // 60 degrees from the face below, as 60 from the axis would end beyond it.
    let top = 10.0 - 8.999 * 30f64.to_radians().tan();
    assert_eq!(radii(dovetail, [0.0, 8.999, 10.0]), [10.0, (top * 1e6).round() / 1e6, 4.0]);
    assert_eq!(radii(chamfer, [0.0, 2.0, 30.0]), [0.5, 2.5, 5.0]);
    // Its point is not said.
    assert!(table.refused[0].contains("SIG"), "{:?}", table.refused);
    assert!(slot.words().contains("T-slot cutter R0.2 12 mm"), "{}", slot.words());

    let bit = r#"{"name": "D20", "shape": "dovetail.fcstd", "parameter": {"CuttingEdgeAngle": "60 °",
        "CuttingEdgeHeight": "9 mm", "Diameter": "20 mm", "Length": "55 mm", "NeckDiameter": "8 mm",
        "NeckHeight": "11 mm", "ShankDiameter": "8 mm"}}"#;
    let table = from_bytes(bit.as_bytes(), "d20.fctb".as_ref(), &library()).unwrap();
    assert_eq!(radii(&table.tools[0], [0.0, 8.999, 10.0]), radii(dovetail, [0.0, 8.999, 10.0]));

    let text = "T,name,profile,stick_out,unit\n7,L,0:0 1.5:5.598@0:3 | 1.5:20 3:22,30,mm\n8,bad,0:0 1:2 1:1,30,mm\n9,I,0.25:0 0.25:1,30,in\n";
    let table = from_bytes(text.as_bytes(), "shop.csv".as_ref(), &library()).unwrap();
    assert_eq!(table.tools[0].number, Some(7));
    assert_eq!(radii(&table.tools[1], [0.0, 5.0, 50.0]), [6.35; 3]);
    assert!(table.refused[0].contains("height 1 of section 2"), "{:?}", table.refused);
}

#[test]
fn a_tool_without_its_neck_or_with_an_impossible_angle_is_left_out_with_the_reason() {
    let tool = |kind: &str, geometry: &str| {
        let text = format!(
            r#"{{"data": [{{"type": "{kind}", "description": "x", "unit": "millimeters", "geometry": {{{geometry}}}}}]}}"#
        );
        from_bytes(text.as_bytes(), "shop.json".as_ref(), &library()).unwrap_err().to_string()
    };
    for (kind, geometry, expected) in [
        ("lollipop mill", r#""DC": 6, "LB": 40, "SFDM": 6"#, "diameter of the neck"),
        (
            "lollipop mill",
            r#""DC": 6, "LB": 40, "SFDM": 6, "shoulder-diameter": 8"#,
            "between 0 and 3 mm",
        ),
        ("slot mill", r#""DC": 12, "LB": 40, "SFDM": 6, "shoulder-diameter": 4"#, "flute length"),
        (
            "slot mill",
            r#""DC": 12, "LCF": 3, "LB": 40, "SFDM": 6, "shoulder-diameter": 4"#,
            "where the neck ends",
        ),
        (
            "dovetail mill",
            r#""DC": 20, "LCF": 20, "TA": 60, "LB": 40, "SFDM": 6, "shoulder-diameter": 4"#,
            "below its neck",
        ),
    ] {
        let message = tool(kind, geometry);
        assert!(message.contains(expected), "{kind}: {message}");
    }
}

#[test]
fn a_profile_comes_back_from_settings_and_tables_of_our_own() {
    let text = "name,profile,stick_out\nL,0:0 1.5:5.598@0:3 | 1.5:20 3:22,30\n";
    let table = from_bytes(text.as_bytes(), "shop.csv".as_ref(), &library()).unwrap();
    let tool = &table.tools[0];
    let read: Assembly =
        serde_json::from_str(&serde_json::to_string(&tool.assembly).unwrap()).unwrap();
    assert_eq!(read, tool.assembly);
    let assembly = &tool.assembly;
    let [body, upper, holder] =
        [assembly.own_body(), assembly.neck_and_shank().to_vec(), assembly.holder().to_vec()]
            .map(|s| steps_words(&s));
    let [cr, ch, fr, fh] = tool.params.to_array();
    let row = format!(
        "name,CR,CH,FR,FH,corner,body,holder,stick_out,neck_and_shank,profile\nL,{cr},{ch},{fr},{fh},{},{body},{holder},30,{upper},{}\n",
        tool.corner_mm,
        assembly.profile().unwrap()
    );
    let again =
        from_bytes(row.as_bytes(), "tools.csv".as_ref(), &MissingParameters::default()).unwrap();
    assert_eq!(again.tools[0].assembly.profile(), assembly.profile());
    assert_eq!(again.tools[0].cutter.profile(), tool.cutter.profile());
}

#[test]
fn drills_and_reamers_are_read_from_all_kinds_of_files() {
    let drills = |table: ToolTable| -> Vec<String> {
        let profile = |tool: &Tool| tool.assembly.profile().unwrap().to_string();
        table.tools.iter().map(profile).collect()
    };
    let cone = (3.0 / 59f64.to_radians().tan() * 1e6).round() / 1e6;
    let check = |found: Vec<String>| {
        let [drill, reamer] = &found[..] else { panic!("{found:?}") };
        let drill: Profile = drill.parse().unwrap();
        assert!(drill.is_drill());
        assert_eq!((drill.radius_at(cone * 0.5) * 1e4).round(), 15000.0);
        assert_eq!((drill.cutting_radius_mm(), drill.flutes_mm()), (3.0, 30.0));
        assert!(reamer.parse::<Profile>().unwrap().is_drill());
        assert_eq!(reamer.parse::<Profile>().unwrap().radius_at(0.1), 4.0);
    };
    let fusion = r#"{"data": [
        {"type": "drill", "description": "D6", "unit": "millimeters", "geometry":
            {"DC": 6, "SIG": 118, "LB": 50, "LCF": 30, "OAL": 80, "SFDM": 6}},
        {"type": "reamer", "description": "8H7", "unit": "millimeters", "geometry":
            {"DC": 8, "LB": 50, "LCF": 30, "OAL": 80, "SFDM": 7}}
    ]}"#;
    check(drills(from_bytes(fusion.as_bytes(), "shop.json".as_ref(), &library()).unwrap()));
    let table = "name, type, diameter, taper, flute_length, shank, stick_out\n\
        a, drill, 6, 59, 30, 6, 50\nb, reamer, 8, , 30, 7, 50\n";
    check(drills(from_bytes(table.as_bytes(), "shop.csv".as_ref(), &library()).unwrap()));
    let given = MissingParameters {
        flutes_mm: Some(30.0),
        shank_mm: Some(6.0),
        unit_mm: Some(1.0),
        ..library()
    };
    let machine = "T1 P1 D6 ;drill 118 deg\nT2 P2 D8 ;reamer 8H7\n";
    check(drills(from_bytes(machine.as_bytes(), "t.tbl".as_ref(), &given).unwrap()));
    let bit = r#"{"version": 2, "name": "6", "shape": "drill.fcstd", "parameter":
        {"Diameter": "6 mm", "Length": "80 mm", "TipAngle": "118 °"}}"#;
    let of_bit = drills(from_bytes(bit.as_bytes(), "d.fctb".as_ref(), &given).unwrap());
    assert_eq!(of_bit[0].parse::<Profile>().unwrap().flutes_mm(), 30.0);
    // Written as a table and read again.
    let found = from_bytes(fusion.as_bytes(), "shop.json".as_ref(), &library()).unwrap();
    let text = found.tools[0].assembly.profile().unwrap().to_string();
    assert!(text.starts_with("drill 0:0 3:"), "{text}");
}
