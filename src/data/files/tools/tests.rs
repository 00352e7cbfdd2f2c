//! Claims about libraries, each on a small one.

mod center_drills;
mod export;
mod families;
mod hsmlib;
mod profiles;
mod tables;

use super::*;

#[test]
fn names_stay_as_they_are_and_folders_are_allowed_on_every_system() {
    let tool = |name: &str| {
        Tool::new(CutterParams::from_array([1.0, 2.0, 3.0, 4.0]), None, 0.0).unwrap().named(name)
    };
    for name in ["D6", "Kugel Ø6", "6.5 long", "tool", "T-1_(new)", "Console", "com 7"] {
        assert_eq!((&*tool(name).name, tool(name).folder()), (name, name));
    }
    for (name, folder) in [
        ("1/4\" flat", "1 4 flat"),
        ("a\\b", "a b"),
        ("../x", "x"),
        ("..", "tool"),
        ("-x.", "x"),
        ("a:b", "a b"),
        ("6  mm", "6 mm"),
        ("part.stl", "tool part.stl"),
        ("Tools.csv", "tool Tools.csv"),
        ("CON", "tool CON"),
        ("com1.x", "tool com1.x"),
    ] {
        assert_eq!((&*tool(name).name, tool(name).folder()), (name, folder));
    }
    assert_eq!((tool("a\nb\0").name, tool(" ").name), ("a b".to_string(), "tool".to_string()));
    assert_eq!(
        (tool(&"ü".repeat(101)).folder().len(), tool(&"ü".repeat(101)).name.len()),
        (80, 202)
    );
}

#[test]
fn tools_whose_names_differ_have_folders_that_differ() {
    let tool = |name: &str| {
        Tool::new(CutterParams::from_array([1.0, 2.0, 3.0, 4.0]), None, 0.0).unwrap().named(name)
    };
    let mut tools = ["1/4", "1:4", "1 4 (2)", "1/4 "].map(tool);
    number_repeated(&mut tools);
    let folders = tools.each_ref().map(|tool| tool.folder().to_string());
    assert_eq!(folders, ["1 4", "1 4 (2)", "1 4 (2) (2)", "1 4 (3)"]);
    assert_eq!(tools[3].name, "1/4", "who gave a name twice is told elsewhere");
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
    let sections = vec![crate::tool::cutter::Section::cylinder(40.0, 20.0)];
    Holder { name: "C".into(), sections }
}

fn usual() -> MissingParameters {
    MissingParameters::default().with_holder(Some(holder())).with_stick_out_mm(Some(30.0))
}

fn tools(text: &str, name: &str, given: &MissingParameters) -> Result<ToolTable> {
    from_bytes(text.as_bytes(), name.as_ref(), given)
}

/// Height and radius of the steps above the tip.
fn outline(tool: &Tool) -> Vec<(f64, f64)> {
    let corner = tool.cutter.corner_mm();
    let round = |x: f64| if x.is_finite() { (x * 1e9).round() / 1e9 } else { x };
    let steps = tool.cutter.steps().iter();
    steps.map(|s| (round(s.height_mm + corner), round(s.radius_mm))).collect()
}

/// Why a file, or the first tool of it that is left out, cannot be used.
fn message(result: Result<ToolTable>) -> String {
    let message = match result {
        Err(error) => error.to_string(),
        Ok(table) => table.refused[0].clone(),
    };
    assert!(!message.contains('\n') && message.contains("; "), "{message}");
    message
}

#[test]
fn a_fusion_library_keeps_what_can_be_represented() {
    let table = tools(FUSION, "shop.json", &usual()).unwrap();
    let names: Vec<&str> = table.tools.iter().map(|tool| &*tool.name).collect();
    assert_eq!(names, ["6 mm ball, long", "1/8\" flat", "tapered"]);
    assert_eq!(table.tools[1].folder(), "1 8 flat");
    assert_eq!(table.refused.len(), 1);
    assert!(
        table.refused[0].starts_with("shop.json: tool \"drill\": SIG, the angle of the point"),
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
    let none = MissingParameters::default();
    let words = message(tools(bit, "b.fctb", &none));
    assert!(words.starts_with("b.fctb: tool \"B\": ") && words.contains("--stick-out"), "{words}");
    let long = MissingParameters { stick_out_mm: Some(30.0), ..none.clone() };
    assert!(message(tools(bit, "b.fctb", &long)).contains("--holder"));
    let table = tools(bit, "b.fctb", &usual()).unwrap();
    assert_eq!(
        outline(&table.tools[0]),
        [(4.0, 2.0), (14.0, 3.0), (30.0, 20.0), (70.0, f64::INFINITY)]
    );
    let beyond = MissingParameters { stick_out_mm: Some(51.0), ..usual() };
    assert!(message(tools(bit, "b.fctb", &beyond)).contains("overall length of 50 mm"));
    assert!(message(tools(FUSION, "shop.json", &none)).contains("--holder"));
    let table = "T1 P1 D6.0 Z+52.3 ;6mm ball end\nT2 P2 D3.175 ;flat\nT3 D10 ;bull r1\nT9 P0 ;probe\nT8 D3 ;odd\n";
    assert!(message(tools(table, "tool.tbl", &usual())).contains("--tool-unit"));
    let millimeters = MissingParameters { unit_mm: Some(1.0), ..usual() };
    assert!(message(tools(table, "tool.tbl", &millimeters)).contains("--shank"));
    let shank = MissingParameters { shank_mm: Some(6.0), ..millimeters };
    assert!(message(tools(table, "tool.tbl", &shank)).contains("--flute-length"));
    let flutes = MissingParameters { flutes_mm: Some(10.0), ..shank };
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
    let read = |diameter: &str| tools(&bit(diameter, "endmill", ""), "q.fctb", &usual());
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
    let bull = |more: &str| tools(&bit(r#""6 mm""#, "bullnose", more), "q.fctb", &usual());
    assert_eq!(bull(r#", "CornerRadius": "1 mm""#).unwrap().tools[0].corner_mm, 1.0);
    assert_eq!(bull(r#", "FlatRadius": "1.5 mm""#).unwrap().tools[0].corner_mm, 1.5);
    assert!(message(bull(r#", "FlatRadius": "1 mm""#)).contains("in some versions"));
    assert!(message(bull("")).contains("CornerRadius is missing"));
    let drill = bit(r#""6 mm""#, "drill", "");
    let refused = message(tools(&drill, "q.fctb", &usual()));
    assert!(refused.contains("TipAngle is missing"), "{refused}");
    let vbit = message(tools(&bit(r#""6 mm""#, "v-bit", ""), "q.fctb", &usual()));
    assert!(vbit.contains("CuttingEdgeAngle is missing"), "{vbit}");
    let taper = r#", "TaperAngle": "6 °""#;
    let tapered = tools(&bit(r#""1 mm""#, "taperedballnose", taper), "q.fctb", &usual()).unwrap();
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
        let found = message(tools(&text, "x.json", &usual()));
        assert!(found.starts_with("x.json: ") && found.contains(words), "{words}: {found}");
    }
    for text in ["T1 P1 X", "P1 D6", "T1.5 D6", "T1 D1e999", "T1 Dnan", "T1 ~6", "T1 D-6 ;ball"] {
        let given = MissingParameters { unit_mm: Some(1.0), shank_mm: Some(3.0), ..usual() };
        let found = message(tools(text, "x.tbl", &given));
        assert!(found.starts_with("x.tbl: line 1"), "{found}");
    }
    assert!(message(tools("hello", "x.fctb", &usual())).contains("not JSON"));
}

#[test]
fn libraries_are_folders_too_and_repeat_names() {
    let folder = tempfile::tempdir().unwrap();
    let bit = r#"{"name": "B/6", "shape": "endmill.fcstd", "parameter": {"Diameter": "6 mm", "ShankDiameter": "6 mm"}}"#;
    for name in ["b.fctb", "a.FCTB", "note.txt"] {
        std::fs::write(folder.path().join(name), bit).unwrap();
    }
    let table = read(folder.path(), &usual()).unwrap();
    assert_eq!(table.tools.iter().map(|t| &*t.name).collect::<Vec<_>>(), ["B/6", "B/6 (2)"]);
    assert_eq!(table.tools.iter().map(Tool::folder).collect::<Vec<_>>(), ["B 6", "B 6 (2)"]);
    let empty = tempfile::tempdir().unwrap();
    assert!(message(read(empty.path(), &usual())).contains("no .fctb file"));
    let tap = folder.path().join("d.json");
    std::fs::write(&tap, r#"{"data": [{"type": "tap left hand"}]}"#).unwrap();
    assert!(message(read(&tap, &usual())).contains("no tool can be used"));
}

#[test]
fn a_table_holds_a_tool_of_many_steps_exactly() {
    let first = tools(FUSION, "shop.json", &usual()).unwrap().tools;
    let mut text = "name;CR;CH;FR;FH;corner;body;holder;stick_out;neck_and_shank\n".to_string();
    for tool in &first {
        let [cr, ch, fr, fh] = tool.params.to_array();
        let [body, holder] = [tool.assembly.body(), tool.assembly.holder()].map(steps_words);
        let stick_out = tool.assembly.stick_out_mm();
        let upper = steps_words(tool.assembly.neck_and_shank());
        text += &format!(
            "{};{cr};{ch};{fr};{fh};{};{body};{holder};{stick_out};{upper}\n",
            tool.name, tool.corner_mm
        );
    }
    let again = tools(&text, "tools.csv", &MissingParameters::default()).unwrap().tools;
    for (a, b) in first.iter().zip(&again) {
        assert_eq!((&a.name, &a.cutter), (&b.name, &b.cutter));
    }
}

/// A library of tools of Fusion 360.
fn fusion(tools: &[&str]) -> String {
    format!(r#"{{"data": [{}], "version": 36}}"#, tools.join(", "))
}

const GOOD: &str = r#"{"type": "flat end mill", "unit": "inches", "description": "RU1600",
    "geometry": {"DC": 0.125, "LCF": 0.5, "LB": 1, "OAL": 2, "SFDM": 0.25}}"#;

fn milled(kind: &str, geometry: &str) -> String {
    format!(
        r#"{{"type": "{kind}", "unit": "inches", "description": "X", "geometry": {{{geometry},
        "LCF": 1, "LB": 1.5, "OAL": 3, "SFDM": 0.25}}}}"#
    )
}

#[test]
fn one_bad_tool_never_loses_the_others() {
    let bad = |geometry: &str, more: &str| {
        format!(
            r#"{{"type": "bull nose end mill", "unit": "millimeters", "description": "X", "geometry": {{{geometry}}}{more}}}"#
        )
    };
    let whole = r#""DC": 6, "RE": 1, "LCF": 20, "LB": 30, "OAL": 70, "SFDM": 6"#;
    let holder = |segments: &str| {
        format!(r#", "holder": {{"unit": "millimeters", "segments": [{segments}]}}"#)
    };
    let flat = r#"{"height": 0, "lower-diameter": 30, "upper-diameter": 30}"#;
    for (tool, words) in [
        (
            bad(&whole.replace("\"RE\": 1", "\"RE\": 0"), ""),
            "RE, the corner radius, is missing or 0",
        ),
        (bad(&whole.replace("\"LB\": 30", "\"LB\": 0"), ""), "LB, the length below the holder"),
        (bad(whole, "").replace("\"unit\": \"millimeters\",", ""), "does not say the unit"),
        (bad(whole, &holder(flat)), "the height of segment 1 is 0 mm"),
        (bad(whole, &holder("")), "0 segments"),
        (bad(&whole.replace("\"LB\": 30", "\"LB\": 80"), ""), "the stick-out of 80 mm exceeds"),
        (bad(&whole.replace("\"DC\": 6", "\"DC\": \"six\""), ""), "DC is \"six\", not a number"),
        ("3".into(), "its type is missing"),
        (bad(whole, "").replace("bull nose end mill", "probe"), "a probe cannot be represented"),
    ] {
        for library in [fusion(&[GOOD, &tool]), fusion(&[&tool, GOOD])] {
            let table = tools(&library, "lib.json", &usual()).unwrap();
            assert_eq!((table.tools.len(), table.refused.len()), (1, 1), "{words}");
            assert_eq!(table.tools[0].name, "RU1600");
            let left = &table.refused[0];
            assert!(left.contains("left out") && left.contains(words), "{words}: {left}");
            assert!(left.starts_with("lib.json: tool "), "{left}");
        }
        assert!(message(tools(&fusion(&[&tool, &tool]), "lib.json", &usual())).contains(words));
    }
    // A holder of which there is but the name is the one given.
    let named = bad(whole, r#", "holder": {"description": "CAT40 ER16"}"#);
    let table = tools(&fusion(&[&named]), "lib.json", &usual()).unwrap();
    assert!(table.notices[0].contains("\"CAT40 ER16\" has no segments"), "{:?}", table.notices);
    let table = "name,CR,CH,FR,FH\na,1,2,3,4\nb,0,2,3,4\nA,1,2,3,4\nc,1,2,x,4\nd,1/8in,2,4,4\n";
    let table = tools(table, "t.csv", &MissingParameters::default()).unwrap();
    assert_eq!(table.tools.iter().map(|t| t.params.cr_mm).collect::<Vec<_>>(), [1.0, 3.175]);
    for (left, words) in
        table.refused.iter().zip(["line 3: ", "line 4: \"A\" is also", "FR is \"x\""])
    {
        assert!(left.contains(words), "{words}: {left}");
    }
    let millimeters = MissingParameters { unit_mm: Some(1.0), shank_mm: Some(6.0), ..usual() };
    let table = tools("T1 P1 D6 ;ball\nT2 ~7\nT3 D6 ;flat\n", "t.tbl", &millimeters).unwrap();
    assert_eq!((table.tools.len(), table.refused.len()), (2, 1));
    assert!(table.refused[0].contains("line 2: \"~7\" is no word"), "{:?}", table.refused);
}

#[test]
fn a_tapered_ball_may_state_the_diameter_of_its_cone() {
    let ball = |geometry: &str| {
        let library = fusion(&[&milled("tapered mill", geometry)]);
        tools(&library, "t.json", &usual())
    };
    // DC is that of the ball, of the cone at the tip's height, or of the cone where the ball ends.
    for dc in ["0.0625", "0.0568", "0.0622"] {
        let geometry = format!(r#""DC": {dc}, "RE": 0.03125, "TA": 5.5"#);
        let table = ball(&geometry).unwrap();
        assert_eq!(table.tools[0].assembly.tip(), [0.79375, 0.0], "{dc}");
        assert!(table.tools[0].words().starts_with("tapered ball 1.5875 mm 5.5°"));
    }
    let found = message(ball(r#""DC": 0.04, "RE": 0.03125, "TA": 5.5"#));
    assert!(found.contains("corner radius is 0.79375"), "{found}");
}

#[test]
fn tapers_in_radians_or_against_their_end_are_left_out_with_the_numbers() {
    let taper = |geometry: &str| {
        message(tools(&fusion(&[&milled("tapered mill", geometry), GOOD]), "t.json", &usual()))
    };
    let radians = taper(r#""DC": 0.0625, "RE": 0.03125, "TA": 0.09599"#);
    assert!(radians.contains("0.09599° per side") && radians.contains("5.500°"), "{radians}");
    // 26.6 degrees would do for a tapered mill; the shank says that it is an angle in radians.
    let steep = milled("tapered mill", r#""DC": 0.0625, "RE": 0, "TA": 0.464"#);
    let steep = steep.replace("\"LCF\": 1,", "\"LCF\": 0.1875,");
    let found = message(tools(&fusion(&[&steep]), "t.json", &usual()));
    assert!(found.contains("in radians 6.3") && found.contains("26.585°"), "{found}");
    let end = taper(
        r#""DC": 0.0625, "RE": 0.03125, "TA": 2, "shoulder-diameter": 0.25, "shoulder-length": 1"#,
    );
    assert!(end.contains("ends 3.307 mm wide, the file says 6.35 mm"), "{end}");
    let bit = |more: &str| {
        format!(
            r#"{{"name": "B", "shape": "taperedballnose.fcstd", "parameter": {{"Diameter": "1 mm", "TaperAngle": "6 °",
            "CuttingEdgeHeight": "20 mm", "Length": "60 mm", "ShankDiameter": "6 mm"{more}}}}}"#
        )
    };
    let found = message(tools(&bit(r#", "TaperDiameter": "6 mm""#), "b.fctb", &usual()));
    assert!(found.contains("ends 3.0453 mm wide, the file says 6 mm"), "{found}");
    assert_eq!(
        tools(&bit(r#", "TaperDiameter": "3.05 mm""#), "b.fctb", &usual()).unwrap().tools.len(),
        1
    );
    let found = message(tools(&bit("").replace("6 °", "0.1 °"), "b.fctb", &usual()));
    assert!(found.contains("0.05000° per side is too little"), "{found}");
}

#[test]
fn shapes_have_the_names_of_all_versions_of_freecad() {
    let taper = r#", "TaperAngle": "6 °", "CornerRadius": "0.5 mm""#;
    let read = |shape: &str| {
        let bit = format!(
            r#"{{"name": "B", {shape}, "parameter": {{"Diameter": "3 mm", "CuttingEdgeHeight": "20 mm",
            "Length": "60 mm", "ShankDiameter": "8 mm"{taper}}}}}"#
        );
        tools(&bit, "b.fctb", &usual()).map(|table| table.tools[0].words())
    };
    for (shape, words) in [
        ("endmill.fcstd", "flat end"),
        ("Shapes/EndMill.FCStd", "flat end"),
        ("_fusion_flat_end_mill.fcstd", "flat end"),
        ("ballend.fcstd", "ball end"),
        ("ball_nose.fcstd", "ball end"),
        ("_fusion_ball_end_mill.fcstd", "ball end"),
        ("bullnose.fcstd", "bull nose 3 mm R0.5"),
        ("torus.fcstd", "bull nose"),
        ("taperballnose.fcstd", "tapered ball 3 mm 3°"),
        ("tapered_ball_nose.fcstd", "tapered ball 3 mm 3°"),
        ("conicalballnose.fcstd", "tapered ball 3 mm 3°"),
    ] {
        let found = read(&format!(r#""shape": "{shape}""#)).unwrap();
        assert!(found.starts_with(words), "{shape}: {found}");
    }
    assert!(
        read(r#""shape": "mine.fcstd", "shape-type": "TaperedBallNose""#)
            .unwrap()
            .starts_with("tapered")
    );
    assert!(
        read(r#""shape": "ballend.fcstd", "shape-type": "Custom""#)
            .unwrap()
            .starts_with("ball end")
    );
    for other in ["tap.fcstd", "probe", "_fusion_face_mill"] {
        assert!(
            message(tools(
                &format!(r#"{{"shape": "{other}", "parameter": {{}}}}"#),
                "b.fctb",
                &usual()
            ))
            .contains("cannot be represented")
        );
    }
}

#[test]
fn a_freecad_library_has_numbers_and_its_bits_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
        path
    };
    let bit = r#"{"name": "5mm Endmill", "shape": "endmill.fcstd", "parameter": {"Diameter": "5.0000 mm", "ShankDiameter": "3.0000 mm"}}"#;
    put("Bit/5mm_Endmill.fctb", bit);
    put("Library/near.fctb", &bit.replace("5mm Endmill", "near"));
    let text = r#"{"version": 1, "tools": [{"nr": 4, "path": "5mm_Endmill.fctb"}, {"nr": 1, "path": "near.fctb"},
        {"nr": 2, "path": "away/lost.fctb"}]}"#;
    let library = put("Library/Default.fctl", text);
    let table = read(&library, &usual()).unwrap();
    let found: Vec<_> = table.tools.iter().map(|t| (&*t.name, t.number)).collect();
    assert_eq!(found, [("5mm Endmill", Some(4)), ("near", Some(1))]);
    assert!(
        table.refused[0].contains("tool 2: there is no file \"away/lost.fctb\""),
        "{:?}",
        table.refused
    );
    // The folder of the library's folders stands for the bits.
    assert_eq!(read(folder.path(), &usual()).unwrap().tools.len(), 1);
    assert!(message(tools(text, "a.fctl", &usual())).contains("names tool bits in other files"));
}
