//! Tables, and libraries that are packed.

use super::*;

#[test]
fn camotics_tables_have_shapes_units_and_numbers() {
    let text = r#"{"12": {"units": "imperial", "shape": "Ballnose", "length": 0.75, "diameter": 0.25, "description": "1/4\" ball"},
        "3": {"units": "metric", "shape": "cylindrical", "length": 20, "diameter": 6, "description": ""},
        "5": {"units": "metric", "shape": "tapered", "length": 20, "diameter": 6, "snub_diameter": 1}}"#;
    let given = MissingParameters { shank_mm: Some(6.35), ..usual() };
    for text in
        [text.to_string(), format!(r#"{{"units": "metric", "tools": {text}, "files": ["a.nc"]}}"#)]
    {
        let table = tools(&text, "mill.json", &given).unwrap();
        let found: Vec<_> =
            table.tools.iter().map(|t| (&*t.name, t.number, t.params.cr_mm)).collect();
        assert_eq!(found, [("T3", Some(3), 3.0), ("1/4\" ball", Some(12), 3.175)]);
        assert!(table.refused[0].contains("the shape \"tapered\" cannot"), "{:?}", table.refused);
    }
    let list =
        r#"[{"number": 7, "units": "metric", "shape": "ballnose", "length": 20, "diameter": 6}]"#;
    assert_eq!(tools(list, "mill.json", &given).unwrap().tools[0].number, Some(7));
    assert!(
        message(tools(&list.replace("metric", "cubits"), "m.json", &given)).contains("\"cubits\"")
    );
    assert!(
        message(tools(&list.replace("6", "0"), "m.json", &given))
            .contains("diameter is missing or 0")
    );
}

#[test]
fn tables_are_in_the_words_of_a_shop_too() {
    let table = "T,Tool,Diameter (in),Corner Radius,Flute Length,Shank,Stick-out [in],OAL\n\
        1,1/4\"\" flat,1/4,0,0.75 in,6.35mm,1.1,2.5in\n\
        T2,ball,0.25,,0.75in,1/4in,1.1,\n\
        3,bull,0.25,1 mm,0.75in,1/4in,28mm,\n\
        4,drill,0.25,,0.75in,1/4in,1.1,\n\
        5,odd,0.25,,0.75in,1/4in,1.1,\n\
        6,far,0.25,0,0.75in,1/4in,one,\n";
    let given = MissingParameters { stick_out_mm: None, ..usual() };
    let found = tools(table, "shop.csv", &given).unwrap();
    let rows: Vec<_> = found
        .tools
        .iter()
        .map(|t| (&*t.name, t.number, t.corner_mm, t.assembly.stick_out_mm()))
        .collect();
    assert_eq!(
        rows,
        [
            ("1/4\"\" flat", Some(1), 0.0, 27.94),
            ("ball", Some(2), 3.175, 27.94),
            ("bull", Some(3), 1.0, 28.0)
        ]
    );
    for (left, words) in found.refused.iter().zip([
        "a drill without the angle of its point",
        "neither corner nor type",
        "\"one\", not a length",
    ]) {
        assert!(left.contains(words), "{words}: {left}");
    }
    // Semicolons, other words, and the unit that is given.
    let table = "Nr;Bezeichnung;Durchmesser;Typ;stick_out;shank;x\n1;Fräser;0,25;flat;1,1;0,25;9\n2;A;0,25;ball;1,1;0,25;\n\
        3;B;0,25;end mill;30mm;0,25;\n4;C;0,25;cone;1;1;\n";
    let inch = MissingParameters { unit_mm: Some(25.4), ..given };
    let found = tools(table, "shop.csv", &inch).unwrap();
    let rows: Vec<_> =
        found.tools.iter().map(|t| (&*t.name, t.params.cr_mm, t.corner_mm)).collect();
    assert_eq!(rows, [("Fräser", 3.175, 0.0), ("A", 3.175, 3.175), ("B", 3.175, 0.0)]);
    assert_eq!(found.unused, ["\"x\""]);
    assert!(found.notices[0].contains("it counts as a flat end"), "{:?}", found.notices);
    assert!(found.refused[0].contains("the type is \"cone\""), "{:?}", found.refused);
    let none = MissingParameters::default();
    assert!(
        message(tools("name,D,corner,flute,stickout\nF6,6,0,20,30\n", "dia.csv", &none))
            .contains("--holder")
    );
    assert!(
        message(tools("D,corner,diameter\n6,0,6\n", "dia.csv", &none)).contains("mean the same")
    );
    let tapered = "name,d,r,taper,flute,shank,stick_out\nk,1,0.5,3,20,6,40\n";
    let given = MissingParameters { stick_out_mm: None, ..usual() };
    assert!(
        tools(tapered, "k.csv", &given).unwrap().tools[0]
            .words()
            .starts_with("tapered ball 1 mm 3°")
    );
}

#[test]
fn lines_of_tables_end_in_any_of_the_three_ways() {
    let csv = "# shop\nname,CR,CH,FR,FH\n\na,1,2,3,4\nb,1,2,x,4\n";
    let tbl = "T1 P1 D6 ;ball\n;\nT2 D6 ;drill\n";
    let given = MissingParameters { unit_mm: Some(1.0), shank_mm: Some(6.0), ..usual() };
    for (text, name, line) in [(csv, "t.csv", "line 5"), (tbl, "t.tbl", "line 3")] {
        let plain = tools(text, name, &given).unwrap();
        for end in ["\r\n", "\r"] {
            let table = tools(&text.replace('\n', end), name, &given).unwrap();
            assert_eq!(table, plain, "{name}");
            assert!(table.refused[0].contains(line), "{name}: {:?}", table.refused);
        }
    }
    let holder = "height,lower,upper\n8,28,34\n";
    let read = |text: &str| holder_from_bytes(text.as_bytes(), "h.csv".as_ref(), &given).unwrap();
    assert_eq!(read(&holder.replace('\n', "\r")), read(holder));
}

#[test]
fn a_table_of_a_machine_is_read_as_other_programs_export_it() {
    let given = MissingParameters {
        unit_mm: Some(1.0),
        shank_mm: Some(3.175),
        flutes_mm: Some(10.0),
        ..usual()
    };
    let table = "T1 P X0 Y0 Z0 A0 B0 C0 U0 V0 W0 D4.00 I0 J0 Q0;4mm_2F_Compression_Carbide_Endmill\n\
        t2 p2 z+1.5 d1.93 ;Banggood - 3.175x2mm Carbide End Mill Drillpro DB-M10\nT3P3D6.0 ;6mm ball end\n\
        T4 P4 D22.0 ; -\nT5 P5 D5 ;Drill 5\nT6 ;ball\n";
    let found = tools(table, "t.tbl", &given).unwrap();
    let rows: Vec<_> =
        found.tools.iter().map(|t| (t.number, t.params.cr_mm, t.corner_mm)).collect();
    assert_eq!(rows, [(Some(1), 2.0, 0.0), (Some(2), 0.965, 0.0), (Some(3), 3.0, 3.0)]);
    let plain = found.notices.iter().filter(|n| n.contains("counts as a flat end")).count();
    assert_eq!(plain, 2, "{:?}", found.notices);
    for (left, words) in found.refused.iter().zip([
        "\"-\" does not say the form",
        "names a drill",
        "without a diameter",
    ]) {
        assert!(left.contains(words), "{words}: {left}");
    }
}

#[test]
fn packed_libraries_are_read_and_other_files_called_what_they_are() {
    use std::io::Write;
    let zip = |entries: &[(&str, &str)]| {
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, text) in entries {
            zip.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
            zip.write_all(text.as_bytes()).unwrap();
        }
        zip.finish().unwrap().into_inner()
    };
    let read = |bytes: &[u8], name: &str| from_bytes(bytes, name.as_ref(), &usual());
    let library = fusion(&[GOOD]);
    for entries in [
        &[("tools.json", &*library)][..],
        &[("__MACOSX/._Example Tools.tools", "x"), ("tools.json", &library)],
        &[("__MACOSX/._tools.json", "x"), ("My Library/My tools.json", &library), ("a.json", "{}")],
        &[("shop.json", &library)],
    ] {
        assert_eq!(read(&zip(entries), "shop.tools").unwrap().tools[0].name, "RU1600");
    }
    let holder = r#"{"data": [{"type": "holder", "description": "A", "unit": "inches",
        "segments": [{"height": 1, "lower-diameter": 1, "upper-diameter": 2}]}]}"#;
    let packed = zip(&[("tools.json", holder)]);
    assert_eq!(holder_from_bytes(&packed, "h.tools".as_ref(), &usual()).unwrap().name, "A");
    for (bytes, words) in [
        (zip(&[("xl/workbook.xml", "")]), "it is an Excel workbook"),
        (zip(&[("content.xml", "")]), "it is an OpenDocument sheet"),
        (zip(&[("a.txt", "")]), "it is a ZIP archive without a library"),
        (b"PK\x03\x04".to_vec(), "zip archive"),
        (b"<!DOCTYPE html>\n<html><body>T1 P1</body></html>".to_vec(), "it is a web page"),
    ] {
        for name in ["shop.csv", "mill.tbl", "shop.json"] {
            let message = message(read(&bytes, name));
            assert!(message.contains(words), "{words}: {message}");
        }
        assert!(holder_from_bytes(&bytes, "h.csv".as_ref(), &usual()).is_err());
    }
}

#[test]
fn lengths_of_a_bit_are_read_as_people_write_them_and_shown_as_found() {
    let read = |length: &str| {
        let length = serde_json::to_string(length).unwrap();
        let bit = format!(
            r#"{{"name": "T", "shape": "endmill.fcstd", "parameter": {{"Diameter": {length}, "ShankDiameter": {length}}}}}"#
        );
        tools(&bit, "t.fctb", &usual())
    };
    for (text, mm) in [
        ("1/4\"", 6.35),
        ("0' 0 1/4\"", 6.35),
        ("1 1/2\"", 38.1),
        ("1/4 in", 6.35),
        ("0,25 in", 6.35),
        ("6.35mm", 6.35),
        ("1'", 304.8),
        ("7/8 in", 22.225),
    ] {
        let tool = &read(text).unwrap().tools[0];
        assert_eq!(2.0 * tool.params.cr_mm, mm, "{text}");
        assert!(tool.words().starts_with(&format!("flat end {mm} mm")), "{}", tool.words());
    }
    for text in ["1/0 in", "1/4 ell", "a quarter", "1/4"] {
        let found = message(read(text));
        assert!(found.contains(&format!("Diameter is {text:?}")), "{found}");
    }
}

#[test]
fn tables_of_spreadsheets_are_read_with_their_separator_and_their_letters() {
    let rows =
        "name;CR;CH;FR;FH;corner\nFr\u{e4}ser \u{d8}6;3,5;20;17;60;0\nKugel \"R3\";3;20;17;60;\n";
    let found = tools(&format!("sep=;\r\n{rows}"), "shop.csv", &usual()).unwrap();
    let read: Vec<_> = found.tools.iter().map(|t| (&*t.name, t.params.cr_mm)).collect();
    assert_eq!(read, [("Fr\u{e4}ser \u{d8}6", 3.5), ("Kugel \"R3\"", 3.0)]);
    assert!(found.notices.is_empty(), "{:?}", found.notices);
    // Windows-1252 has these letters as one byte each; 0x96 is a dash.
    let bytes: Vec<u8> = rows.replace("R3", "R3\u{96}").chars().map(|c| c as u8).collect();
    let western = from_bytes(&bytes, "shop.csv".as_ref(), &usual()).unwrap();
    assert_eq!(
        (&western.tools[0], &*western.tools[1].name),
        (&found.tools[0], "Kugel \"R3\u{2013}\"")
    );
    assert!(western.notices[0].contains("Windows-1252"), "{:?}", western.notices);
    for (name, bytes) in [("shop.csv", &b"name;CR\xe4\0;"[..]), ("a.json", b"{\"data\": \"\xe4\"}")]
    {
        assert!(message(from_bytes(bytes, name.as_ref(), &usual())).contains("not UTF-8"));
    }
    let table = b"T1 P1 D6 ;flat \xd86\n";
    let given = MissingParameters {
        unit_mm: Some(1.0),
        shank_mm: Some(6.0),
        flutes_mm: Some(15.0),
        ..usual()
    };
    let found = from_bytes(table, "mill.tbl".as_ref(), &given).unwrap();
    assert_eq!(found.tools[0].name, "T1 flat \u{d8}6");
}

#[test]
fn one_bad_file_of_several_never_loses_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let bit = r#"{"name": "B/6", "shape": "endmill.fcstd", "parameter": {"Diameter": "6 mm", "ShankDiameter": "6 mm"}}"#;
    std::fs::write(folder.path().join("b.fctb"), bit).unwrap();
    let of = |name: &str| folder.path().join(name);
    std::fs::write(of("bad.fctb"), bit.replace("\"6 mm\"", "\"six\"")).unwrap();
    std::fs::write(of("cut.fctb"), &bit[..40]).unwrap();
    std::fs::write(of("tap.json"), r#"{"data": [{"type": "tap left hand"}]}"#).unwrap();
    let files = ["bad.fctb", "b.fctb", "cut.fctb", "tap.json"].map(of);
    let tables = read_several(&files, &usual()).unwrap();
    let counts = tables.iter().map(|table| (table.tools.len(), table.refused.len()));
    assert_eq!(counts.collect::<Vec<_>>(), [(0, 1), (1, 0), (0, 1), (0, 1)]);
    let refused = read_several(&[of("cut.fctb"), of("bad.fctb")], &usual());
    assert!(refused.unwrap_err().to_string().contains("none of 2 tools can be used"));
    assert!(read_several(&[of("b.fctb"), of("missing.csv")], &usual()).is_err());
}

fn of_machine(text: &str, name: &str) -> Result<ToolTable> {
    let [unit_mm, shank_mm, flutes_mm] = [1.0, 6.0, 10.0].map(Some);
    let given = MissingParameters { unit_mm, shank_mm, flutes_mm, ..usual() };
    from_bytes(text.as_bytes(), name.as_ref(), &given)
}

#[test]
fn tables_of_emc2_with_columns_are_read_as_those_with_letters() {
    let rows =
        "1 1 52.3 6.0 6 mm ball\n2\t2\t50\t5,5\t;flat\n  3 3 -1.5 4 bull r1  \n4 4 0 0 ball\n";
    let letters = "T1 P1 Z52.3 D6.0 ;6 mm ball\nT2 P2 Z50 D5.5 ;flat\nT3 P3 Z-1.5 D4 ;bull r1\nT4 P4 D0 ;ball\n";
    let expected = of_machine(letters, "m.tbl").unwrap();
    assert_eq!((expected.tools.len(), expected.refused.len()), (3, 1));
    for (above, name) in [
        ("POC  FMS  LEN  DIAM  COMMENT\n\n", "mill.txt"),
        ("Pocket FMS TLO Diameter Comment\r\n\r\n", "mill"),
        ("; of the mill\npoc fms len dia\n# Added 20090312\n", "mill.csv"),
        ("The file includes both mill and lathe\nPOCKET FMS LENGTH DIAMETER COMMENT\n\n", "m.tbl"),
        ("", "mill.tbl"),
    ] {
        let found = of_machine(&format!("{above}{rows}"), name).unwrap();
        let of = |table: &ToolTable| -> Vec<(String, Option<u32>, Cutter)> {
            let of = |tool: &Tool| (tool.name.clone(), tool.number, tool.cutter.clone());
            table.tools.iter().map(of).collect()
        };
        assert_eq!(of(&found), of(&expected), "{above}");
        assert_eq!(found.refused.len(), 1);
        assert!(found.refused[0].contains("without a diameter"), "{:?}", found.refused);
        assert!(found.notices.is_empty(), "{:?}", found.notices);
    }
    // Programs of that time call a tool by its pocket.
    let found = of_machine("POC FMS LEN DIAM\n\n7 12 0 6 ball\n", "m.tbl").unwrap();
    assert_eq!(found.tools[0].number, Some(7));
    assert!(found.notices[0].contains("its pocket 7 counts as T, not FMS 12"));
}

#[test]
fn turning_tools_of_linuxcnc_are_left_out_by_name() {
    let head = "POC FMS ZOFFSET XOFFSET DIAMETER FRONTANGLE BACKANGLE ORIENT COMMENT\n\n";
    let rows = "1 1 0 0 6 0 0 0 ball\n2 2 0 1.5 0.8 95 155 2 left hand\n";
    let both = format!("POC FMS LEN DIAM COMMENT\n{head}3 3 20 4 flat\n");
    for above in [head, "", &both] {
        let found = of_machine(&format!("{above}{rows}"), "lathe.tbl").unwrap();
        let balls = found.tools.iter().filter(|tool| tool.name == "T1 ball").count();
        assert_eq!((balls, found.refused.len()), (1, 1), "{above}");
        let message = &found.refused[0];
        assert!(message.contains("T2 left hand") && message.contains("turning tool"), "{message}");
    }
    let letters = "T1 D6 ;ball\nT2 D0.8 I95 J155 Q2 ;ball\n";
    let found = of_machine(letters, "lathe.tbl").unwrap();
    assert!(found.tools.len() == 1 && found.refused[0].contains("turning tool"));
    // Among mills, a remark of numbers is a remark.
    let mills = "POC FMS LEN DIAM COMMENT\n\n1 1 0 6 2 3 4 5 ball\n";
    assert_eq!(of_machine(mills, "m.tbl").unwrap().tools[0].name, "T1 2 3 4 5 ball");
}

#[test]
fn bad_tables_with_columns_are_refused_with_line_and_remedy() {
    for (text, expected) in [
        ("POC FMS LEN COMMENT\n\n1 1 0 ball\n", "line 1: the columns are"),
        ("POC FMS LEN DIAM DIAM\n\n1 1 0 6 ball\n", "is there twice"),
        ("POC FMS LEN DIAM SPEED\n\n1 1 0 6 ball\n", "\"SPEED\" is no column"),
        ("POC FMS DIAM LEN COMMENT\n\n1 1 6 0 ball\n", "line 1: the columns are"),
        ("POC FMS LEN DIAM\n\n1 1 ball\n", "line 3: \"1 1 ball\" does not begin with 4 numbers"),
        ("POC FMS LEN DIAM\n\n1 1 0 nan ball\n", "does not begin with 4 numbers"),
        ("POC FMS LEN DIAM\n\n1.5 1 0 6 ball\n", "does not begin with 4 numbers"),
        ("POC FMS LEN DIAM\n\n-1 1 0 6 ball\n", "does not begin with 4 numbers"),
        ("POC FMS LEN DIAM\n\nT1 P1 D6 ;ball\n", "does not begin with 4 numbers"),
        ("POC FMS LEN DIAM\n\n1 1 0 -6 ball\n", "-6"),
        ("POC FMS LEN DIAM\n\n1 1 0 1e9 ball\n", "10"),
        ("POC FMS LEN DIAM\n", "no tool"),
        (
            "POC FMS ZOFFSET XOFFSET DIA FRONTANGLE BACKANGLE ORIENTATION\n\n1 1 0 6 ball\n",
            "does not begin with 8 numbers",
        ),
        ("POC FMS LEN DIAM\n\n99999999999999999999 1 0 6 ball\n", "does not begin with 4 numbers"),
    ] {
        for name in ["m.tbl", "m.txt"] {
            let message = of_machine(text, name).unwrap_err().to_string();
            assert!(message.starts_with(name) && message.contains(expected), "{text}: {message}");
        }
    }
    // A bad row does not lose the others.
    let found = of_machine("POC FMS LEN DIAM\n\n1 1 0 six ball\n2 2 0 6 ball\n", "m.tbl").unwrap();
    assert_eq!((found.tools.len(), found.refused.len()), (1, 1));
}
