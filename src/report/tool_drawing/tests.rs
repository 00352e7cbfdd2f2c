use super::*;
use crate::data::files::tools::{Holder, MissingParameters, from_bytes};
use proptest::prelude::*;

fn drawn(row: &str) -> (String, Tool) {
    let sections = vec![crate::tool::cutter::Section::cylinder(40.0, 15.0)];
    let holder = Some(Holder { name: "ER20".into(), sections });
    let defaults = MissingParameters { holder, ..MissingParameters::default() };
    let text =
        format!("name,diameter,corner,flute_length,shank,stick_out,taper,profile,unit\n{row}\n");
    let table = from_bytes(text.as_bytes(), "shop.csv".as_ref(), &defaults).unwrap();
    (draw(&table.tools[0]), table.tools[0].clone())
}

#[test]
fn a_drawing_has_the_dimensions_in_the_unit_of_the_maker() {
    let (svg, _) = drawn("<1/4\"\" & flat>,0.25 in,0,0.5 in,0.25 in,1.1 in,,,");
    for words in [">Ø0.25<", ">0.5<", ">1.1<", "&lt;1/4\"\" &amp; flat&gt;", "lengths in inches"] {
        assert!(svg.contains(words), "{words}: {svg}");
    }
    let (svg, _) = drawn("bull,10,1.5,22,8,40,,,mm");
    for words in [">Ø10<", ">R1.5<", ">22<", ">40<", ">Ø8<", "lengths in mm"] {
        assert!(svg.contains(words), "{words}: {svg}");
    }
    let (svg, _) = drawn("lollipop,,,,,60,,0:0 1.5:5.598@0:3 | 1.5:20 3:22,mm");
    for words in [">Ø6<", ">R3<", ">5.598<", ">22<", ">60<", ">Ø3<"] {
        assert!(svg.contains(words), "{words}: {svg}");
    }
    let (svg, tool) = drawn("taper,1,0.5,20,6,60,3,,mm");
    assert!(svg.contains(">3°<") && svg.contains(">R0.5<"), "{svg}");
    let outline = Outline::of(&tool);
    let touch = outline.sections[0].to;
    assert!((touch[0] - 0.5 * 3f64.to_radians().cos()).abs() < 1e-3, "{touch:?}");
    assert_eq!(outline.flutes, Some(20.0));
}

#[test]
fn what_is_drawn_is_balanced_xml_in_few_bytes() {
    for row in [
        "flat,6,0,16,6,30,,,mm",
        "ball,6,3,16,12,200,,,mm",
        "s,,,,,60,,10.5:0 10.5:9 5:9 | 5:40 8:40,mm",
    ] {
        let (svg, _) = drawn(row);
        let mut reader = quick_xml::reader::Reader::from_str(&svg);
        loop {
            match reader.read_event() {
                Ok(quick_xml::events::Event::Eof) => break,
                Ok(_) => {}
                Err(e) => panic!("{e}: {svg}"),
            }
        }
        assert!(svg.len() < 6000 && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }
}

/// Half of the lengths are odd: none, tiny, or far more than a tool has.
fn number() -> impl Strategy<Value = f64> {
    let odd = [0.0, 1e-9, 0.5, 1.0, 3.0, 10.0, 45.0, 60.0, 90.0, 118.0, 180.0, 1e3];
    prop_oneof![prop::sample::select(odd.to_vec()), 0.01f64..100.0]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn any_tool_that_is_read_can_be_drawn(
        k in 0usize..50,
        changed in prop::collection::vec((prop::sample::select(KEYS.to_vec()), number()), 0..6),
    ) {
        let shop = include_str!("../../../tests/fixtures/shop50.json");
        let mut shop: serde_json::Value = serde_json::from_str(shop).unwrap();
        let tool = &mut shop["data"][k];
        for (key, number) in changed {
            tool["geometry"][key] = number.into();
        }
        let table = from_bytes(tool.to_string().as_bytes(), "x.json".as_ref(), &MissingParameters::default());
        for tool in table.iter().flat_map(|table| &table.tools) {
            let svg = draw(tool);
            prop_assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }
}

const KEYS: [&str; 12] = [
    "DC",
    "RE",
    "LCF",
    "LB",
    "SFDM",
    "TA",
    "SIG",
    "tip-diameter",
    "shoulder-length",
    "shoulder-diameter",
    "profile-radius",
    "lower-radius",
];
