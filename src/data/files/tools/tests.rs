//! Claims about libraries, each on a small one.

use super::*;

#[test]
fn every_name_is_a_folder_on_every_system() {
    let tool = |name: &str| {
        Tool::new(CutterParams::from_array([1.0, 2.0, 3.0, 4.0]), None, 0.0)?.named(name)
    };
    for name in ["D6", "Kugel Ø6", "6.5 long", "tool", "T-1_(new)"] {
        assert_eq!(tool(name).unwrap().name, name);
    }
    let long = "x".repeat(101);
    let bad = ["", ".", "..", ".x", "-x", "x.", "a/b", "a\\b", "1/4\"", "a:b", "a\nb", "a\0"];
    for name in bad.into_iter().chain(["part.stl", "Tools.csv", "tools.ply", &long]) {
        let message = tool(name).unwrap_err().to_string();
        assert!(message.starts_with("name is ") && !message.contains('\n'), "{message}");
    }
}

const FUSION: &str = r#"{"version": 12, "data": [
 {"description": "6 mm ball, long", "type": "ball end mill", "unit": "millimeters",
  "geometry": {"DC": 6, "RE": 3, "LCF": 12, "LB": 45, "OAL": 80, "SFDM": 6, "shoulder-length": 30, "shoulder-diameter": 5.8},
  "holder": {"description": "ER20", "type": "holder", "unit": "millimeters", "gaugeLength": 70, "segments": [
   {"height": 8, "lower-diameter": 28, "upper-diameter": 34}, {"height": 62, "lower-diameter": 34, "upper-diameter": 34}]}},
 {"description": "1/8\" flat", "type": "flat end mill", "unit": "inches",
  "geometry": {"DC": 0.125, "LCF": 0.5, "LB": 0.8, "OAL": 1.6, "SFDM": 0.25, "shoulder-length": 0.7}},
 {"description": "tapered", "type": "tapered mill", "unit": "millimeters",
  "geometry": {"DC": 1, "RE": 0.5, "TA": 3, "LCF": 20, "LB": 40, "SFDM": 6, "tip-diameter": 1}},
 {"description": "drill", "type": "drill", "unit": "millimeters", "geometry": {"DC": 5}},
 {"description": "H", "type": "holder", "unit": "inches", "segments": []}]}"#;

fn holder() -> Holder {
    let sections = vec![crate::cutter::Section::cylinder(40.0, 20.0)];
    Holder { name: "C".into(), sections }
}

fn unsaid() -> Unsaid {
    Unsaid { holder: Some(holder()), stick_out_mm: Some(30.0), ..Unsaid::default() }
}

fn tools(text: &str, name: &str, unsaid: &Unsaid) -> Result<ToolTable> {
    from_bytes(text.as_bytes(), name.as_ref(), unsaid)
}

/// Height and radius of the steps above the tip.
fn outline(tool: &Tool) -> Vec<(f64, f64)> {
    let corner = tool.cutter.corner_mm();
    let round = |x: f64| if x.is_finite() { (x * 1e9).round() / 1e9 } else { x };
    let steps = tool.cutter.steps().iter();
    steps.map(|s| (round(s.height_mm + corner), round(s.radius_mm))).collect()
}

fn message(result: Result<ToolTable>) -> String {
    let message = result.unwrap_err().to_string();
    assert!(!message.contains('\n') && message.contains("; "), "{message}");
    message
}

#[test]
fn a_fusion_library_keeps_what_can_be_represented() {
    let table = tools(FUSION, "shop.json", &unsaid()).unwrap();
    let names: Vec<&str> = table.tools.iter().map(|tool| &*tool.name).collect();
    assert_eq!(names, ["6 mm ball, long", "1 8 flat", "tapered"]);
    assert_eq!(table.refused.len(), 1);
    assert!(
        table.refused[0].starts_with("shop.json: tool \"drill\": a drill cannot"),
        "{:?}",
        table.refused
    );
    assert!(
        table.notices.iter().any(|n| n.contains("neck of 5.8 mm") && n.contains("as 6 mm wide")),
        "{:?}",
        table.notices
    );
    let ball = &table.tools[0];
    assert_eq!((ball.corner_mm, ball.assembly.stick_out_mm()), (3.0, 45.0));
    let steps = outline(ball);
    assert_eq!((steps[0], steps[1].0), ((6.0, 3.0), 45.0));
    let n = steps.len();
    assert_eq!((steps[n - 2].1, steps[n - 1]), (17.0, (115.0, f64::INFINITY)));
    // Inches become millimeters, the shank is wider than the flutes from the shoulder on.
    let flat = &table.tools[1];
    assert_eq!(
        outline(flat),
        [(3.175, 1.5875), (17.78, 3.175), (20.32, 20.0), (60.32, f64::INFINITY)]
    );
    assert_eq!(
        (flat.corner_mm, flat.words()),
        (0.0, "flat end 3.175 mm, 20.32 mm out of C".into())
    );
    let tapered = outline(&table.tools[2]);
    assert!(tapered.iter().any(|(h, r)| *h == 20.0 && *r == 3.0), "{tapered:?}");
    assert!(tapered[0].0 < 0.5 && tapered[0].1 < 0.6, "{tapered:?}");
}

#[test]
fn what_a_library_does_not_say_is_asked_for_by_name() {
    let bit = r#"{"version": 2, "name": "B", "shape": "ballend.fcstd", "parameter":
        {"CuttingEdgeHeight": "14,0 mm", "Diameter": "4.0000 mm", "Length": "50 mm", "ShankDiameter": "6 mm"}}"#;
    let none = Unsaid::default();
    let words = message(tools(bit, "b.fctb", &none));
    assert!(words.starts_with("b.fctb: tool \"B\": ") && words.contains("--stick-out"), "{words}");
    let long = Unsaid { stick_out_mm: Some(30.0), ..none.clone() };
    assert!(message(tools(bit, "b.fctb", &long)).contains("--holder"));
    let table = tools(bit, "b.fctb", &unsaid()).unwrap();
    assert_eq!(
        outline(&table.tools[0]),
        [(4.0, 2.0), (14.0, 3.0), (30.0, 20.0), (70.0, f64::INFINITY)]
    );
    let beyond = Unsaid { stick_out_mm: Some(51.0), ..unsaid() };
    assert!(message(tools(bit, "b.fctb", &beyond)).contains("overall length of 50 mm"));
    assert!(message(tools(FUSION, "shop.json", &none)).contains("--holder"));
    let table = "T1 P1 D6.0 Z+52.3 ;6mm ball end\nT2 P2 D3.175 ;flat\nT3 D10 ;bull r1\nT9 P0 ;probe\nT8 D3 ;odd\n";
    assert!(message(tools(table, "tool.tbl", &unsaid())).contains("--tool-unit"));
    let millimeters = Unsaid { unit_mm: Some(1.0), ..unsaid() };
    assert!(message(tools(table, "tool.tbl", &millimeters)).contains("--shank"));
    let shank = Unsaid { shank_mm: Some(6.0), ..millimeters };
    assert!(message(tools(table, "tool.tbl", &shank)).contains("--flute-length"));
    let flutes = Unsaid { flutes_mm: Some(10.0), ..shank };
    let read = tools(table, "tool.tbl", &flutes).unwrap();
    assert_eq!(outline(&read.tools[1])[..2], [(3.175, 1.5875), (10.0, 3.0)]);
    assert_eq!((read.tools[2].corner_mm, read.tools[2].assembly.tip()[1]), (1.0, 4.0));
    assert_eq!((read.tools.len(), read.refused.len()), (3, 2));
    assert!(read.notices.iter().any(|n| n.contains("shank of 6 mm") && n.contains("10 mm wide")));
    assert_eq!(tools(table, "mill.txt", &flutes).unwrap().tools.len(), 3, "known by its lines");
}

#[test]
fn tool_bits_have_a_unit_in_every_value() {
    let bit = |diameter: &str, shape: &str, more: &str| {
        format!(
            r#"{{"shape": "{shape}.fcstd", "parameter": {{"Diameter": {diameter}, "ShankDiameter": "3 mm",
            "CuttingEdgeHeight": "10 mm"{more}}}}}"#
        )
    };
    let read = |diameter: &str| tools(&bit(diameter, "endmill", ""), "q.fctb", &unsaid());
    for (text, mm) in [
        (r#""0.2500 \"""#, 6.35),
        (r#""2.0000 in""#, 50.8),
        (r#""4,5 mm""#, 4.5),
        (r#""0.5 cm""#, 5.0),
    ] {
        let table = read(text).unwrap();
        let width = 2.0 * table.tools[0].params.cr_mm;
        assert!((width - mm).abs() < 1e-9, "{text}: {width}");
        assert_eq!(table.tools[0].name, "q");
    }
    for (text, words) in [
        ("6", "without a unit"),
        (r#""6""#, "without a unit"),
        (r#""6 furlong""#, "furlong"),
        (r#""-6 mm""#, "-6"),
        (r#""NaN mm""#, "not a length"),
        (r#""1e300 mm""#, "unit of Diameter"),
        (r#""99999999 mm""#, "not a length"),
        (r#""20001 mm""#, "is 10000.5"),
        (r#""0 mm""#, "Diameter is missing or 0"),
        ("true", "not a length"),
    ] {
        let found = message(read(text));
        assert!(
            found.starts_with("q.fctb: tool \"q\": ") && found.contains(words),
            "{text}: {found}"
        );
    }
    let bull = |more: &str| tools(&bit(r#""6 mm""#, "bullnose", more), "q.fctb", &unsaid());
    assert_eq!(bull(r#", "CornerRadius": "1 mm""#).unwrap().tools[0].corner_mm, 1.0);
    assert_eq!(bull(r#", "FlatRadius": "1.5 mm""#).unwrap().tools[0].corner_mm, 1.5);
    assert!(message(bull(r#", "FlatRadius": "1 mm""#)).contains("in some versions"));
    assert!(message(bull("")).contains("CornerRadius is missing"));
    let vbit = bit(r#""6 mm""#, "v-bit", "");
    let refused = tools(&vbit, "q.fctb", &unsaid()).unwrap().refused;
    assert!(refused[0].contains("\"v-bit.fcstd\" cannot be represented"), "{refused:?}");
    let taper = r#", "TaperAngle": "6 °""#;
    let tapered = tools(&bit(r#""1 mm""#, "taperedballnose", taper), "q.fctb", &unsaid()).unwrap();
    assert!(
        tapered.tools[0].words().starts_with("tapered ball 1 mm 3°"),
        "{}",
        tapered.tools[0].words()
    );
}

#[test]
fn hostile_libraries_are_errors_that_name_file_tool_and_remedy() {
    let one = |geometry: &str| {
        format!(
            r#"{{"data": [{{"description": "X", "type": "bull nose end mill", "unit": "millimeters", "geometry": {geometry}}}]}}"#
        )
    };
    for (text, words) in [
        (FUSION[..300].to_string(), "cannot be read"),
        ("{}".into(), "neither `data`"),
        ("[]".into(), "neither `data`"),
        (r#"{"data": 3}"#.into(), "not a list"),
        (r#"{"data": [3]}"#.into(), "type is missing"),
        (one(r#"{"DC": 1e999}"#), "cannot be read"),
        (one(r#"{"DC": NaN}"#), "cannot be read"),
        (one(r#"{"DC": "6"}"#), "tool \"X\": DC is"),
        (one(r#"{"DC": -6}"#), "DC is -6"),
        (one(r#"{"DC": 1e9}"#), "DC is 1000000000"),
        (one(r#"{"DC": 6}"#), "RE, the corner radius"),
        (one(r#"{"DC": 6, "RE": 4, "SFDM": 6}"#), "corner radius is 4"),
        (one(r#"{"DC": 6, "RE": 1, "SFDM": 6, "LB": 0}"#), "LB, the length below the holder"),
        (
            one(r#"{"DC": 6, "RE": 1, "SFDM": 6, "LB": 40, "OAL": 30}"#),
            "exceeds the overall length",
        ),
        (one("7"), "DC, the diameter"),
        (one("{}").replace("millimeters", "furlongs"), "the unit is"),
        (one("{}").replace("\"unit\": \"millimeters\",", ""), "--tool-unit"),
        (FUSION.replace("\"RE\": 3", "\"RE\": 2"), "correct one"),
        (FUSION.replace("\"TA\": 3", "\"TA\": 95"), "taper is"),
        (FUSION.replace("\"height\": 8", "\"height\": -8"), "holder \"ER20\""),
        (FUSION.replace("\"tip-diameter\": 1", "\"tip-diameter\": 0.3"), "tip-diameter 0.3"),
        ("[".repeat(100_000), "cannot be read"),
    ] {
        let found = message(tools(&text, "x.json", &unsaid()));
        assert!(found.starts_with("x.json: ") && found.contains(words), "{words}: {found}");
    }
    for text in ["T1 P1 X", "P1 D6", "T1.5 D6", "T1 D1e999", "T1 Dnan", "T1 ~6", "T1 D-6 ;ball"] {
        let unsaid = Unsaid { unit_mm: Some(1.0), shank_mm: Some(3.0), ..unsaid() };
        let found = message(tools(text, "x.tbl", &unsaid));
        assert!(found.starts_with("x.tbl: line 1"), "{found}");
    }
    assert!(message(tools("hello", "x.fctb", &unsaid())).contains("not JSON"));
}

#[test]
fn libraries_are_folders_too_and_repeat_names() {
    let folder = tempfile::tempdir().unwrap();
    let bit = r#"{"name": "B/6", "shape": "endmill.fcstd", "parameter": {"Diameter": "6 mm", "ShankDiameter": "6 mm"}}"#;
    for name in ["b.fctb", "a.FCTB", "note.txt"] {
        std::fs::write(folder.path().join(name), bit).unwrap();
    }
    let table = read(folder.path(), &unsaid()).unwrap();
    assert_eq!(table.tools.iter().map(|t| &*t.name).collect::<Vec<_>>(), ["B 6", "B 6 (2)"]);
    let empty = tempfile::tempdir().unwrap();
    assert!(message(read(empty.path(), &unsaid())).contains("no .fctb file"));
    let drill = folder.path().join("d.json");
    std::fs::write(&drill, r#"{"data": [{"type": "drill"}]}"#).unwrap();
    assert!(message(read(&drill, &unsaid())).contains("no tool can be used"));
}

#[test]
fn a_table_holds_a_tool_of_many_steps_exactly() {
    let first = tools(FUSION, "shop.json", &unsaid()).unwrap().tools;
    let mut text = "name;CR;CH;FR;FH;corner;body;holder;stick_out\n".to_string();
    for tool in &first {
        let [cr, ch, fr, fh] = tool.params.to_array();
        let [body, holder] = [tool.assembly.body(), tool.assembly.holder()].map(steps_words);
        let stick_out = tool.assembly.stick_out_mm();
        text += &format!(
            "{};{cr};{ch};{fr};{fh};{};{body};{holder};{stick_out}\n",
            tool.name, tool.corner_mm
        );
    }
    let again = tools(&text, "tools.csv", &Unsaid::default()).unwrap().tools;
    for (a, b) in first.iter().zip(&again) {
        assert_eq!((&a.name, &a.cutter), (&b.name, &b.cutter));
    }
}
