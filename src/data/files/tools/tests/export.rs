//! What is exported and read again gives the same tools.

use super::profiles::library;
use super::*;

pub(super) const SHOP: &str = include_str!("../../../../../tests/fixtures/shop50.json");

/// A file for every reader, by name.
fn files() -> Vec<(&'static str, String)> {
    let bit = |shape: &str, more: &str| {
        format!(
            r#"{{"name": "1/4\" {shape}", "shape": "{shape}.fcstd", "parameter": {{"Diameter": "0.25 in",
            "ShankDiameter": "1/4 in", "Length": "3 in", "CuttingEdgeHeight": "0.5 in"{more}}}}}"#
        )
    };
    vec![
        ("shop50.json", SHOP.into()),
        ("shop.json", FUSION.into()),
        ("shop.hsmlib", super::hsmlib::SHOP.into()),
        ("a.fctb", bit("ballend", "")),
        ("b.fctb", bit("v-bit", r#", "CuttingEdgeAngle": "60 °""#)),
        (
            "saw.fctb",
            r#"{"name": "saw", "shape": "slittingsaw.fcstd", "parameter": {"BladeThickness": "3 mm",
            "CapDiameter": "8 mm", "CapHeight": "2 mm", "Diameter": "76.2 mm", "ShankDiameter": "19 mm"}}"#
                .into(),
        ),
        (
            "mill.json",
            r#"{"1": {"units": "imperial", "shape": "conical", "length": 0.2, "diameter": 0.25},
            "2": {"units": "metric", "shape": "spheroid", "length": 20, "diameter": 10}}"#
                .into(),
        ),
        ("tool.tbl", "T1 P1 D6 ;ball end\nT2 P2 D6 ;V-bit 60°\nT3 P3 D10 ;bull r1\n".into()),
        ("dia.csv", "T,name,D,R,LCF,shank,LB,OAL\n3,\"a, b\",6,1,12,6,40,60\n,c,8,0,12,8,40,\n".into()),
        ("l.csv", "name,profile,stick_out\nL,0:0 1.5:5.598@0:3 | 1.5:20 3:22,30\n".into()),
        ("lengths.csv", "name,CR,CH,FR,FH,corner,clearance\nx,3,30,20,40,1,0.5\ny,1,2,30,40,,-0.1\n".into()),
    ]
}

#[test]
fn every_file_is_read_again_as_it_is_exported() {
    let given = MissingParameters {
        shank_mm: Some(6.0),
        flutes_mm: Some(12.0),
        unit_mm: Some(1.0),
        ..library()
    };
    for (name, text) in files() {
        let given = if name.ends_with("fctb") { library() } else { given.clone() };
        let first = from_bytes(text.as_bytes(), name.as_ref(), &given).unwrap().tools;
        for (to, bytes) in [("again.csv", to_csv(&first)), ("again.json", to_json(&first).unwrap())]
        {
            // Nothing is asked for.
            let again = from_bytes(&bytes, to.as_ref(), &MissingParameters::default()).unwrap();
            assert!(again.refused.is_empty() && again.unused.is_empty(), "{name}: {again:?}");
            assert_eq!(again.tools.len(), first.len());
            for (a, b) in first.iter().zip(&again.tools) {
                let said = |tool: &Tool| {
                    let assembly = &tool.assembly;
                    let lengths = (assembly.overall_mm(), assembly.stick_out_mm());
                    (tool.name.clone(), tool.number, tool.unit(), tool.words(), lengths)
                };
                assert_eq!(said(a), said(b), "{name} {to}");
                assert!(a.cutter == b.cutter, "{name} {to} {}", a.name);
                assert_eq!(a.assembly.profile(), b.assembly.profile());
                assert_eq!(
                    a.held().unwrap().cutter().unwrap(),
                    b.held().unwrap().cutter().unwrap()
                );
            }
        }
    }
}

#[test]
fn one_exported_tool_that_was_spoiled_loses_no_other() {
    let tools = from_bytes(SHOP.as_bytes(), "s.json".as_ref(), &MissingParameters::default())
        .unwrap()
        .tools;
    let text = String::from_utf8(to_json(&tools[..3]).unwrap()).unwrap();
    for (bad, words) in [
        (text.replacen("\"assembly\"", "\"x\"", 1), "neither assembly nor lengths_mm"),
        (text.replacen("\"corner_mm\": 0.0", "\"corner_mm\": -1.0", 1), "its assembly"),
        (text.replacen("\"unit\": \"mm\"", "\"unit\": \"ell\"", 1), "its unit is \"ell\""),
    ] {
        let table =
            from_bytes(bad.as_bytes(), "x.json".as_ref(), &MissingParameters::default()).unwrap();
        assert_eq!((table.tools.len(), table.refused.len()), (2, 1), "{words}");
        let refused = &table.refused[0];
        assert!(
            refused.starts_with("x.json: tool 1 \"F1\": ") && refused.contains(words),
            "{refused}"
        );
    }
}

#[test]
fn a_shop_of_fifty_tools_keeps_all_that_mill_or_drill() {
    let table =
        from_bytes(SHOP.as_bytes(), "shop50.json".as_ref(), &MissingParameters::default()).unwrap();
    let left_out: Vec<&str> =
        table.refused.iter().filter_map(|refused| refused.split('"').nth(1)).collect();
    assert_eq!(table.tools.len(), 47, "{:#?}", table.refused);
    assert_eq!(left_out, ["M6", "M6 LH", "probe"]);
}
