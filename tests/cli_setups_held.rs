//! What holds the part in `deepmill setups`: areas out of reach, computed by hand.
#![cfg(feature = "cli")]

mod command;

use command::{Corner, Folder, block, deepmill, failure, json, stl};
use serde_json::Value;

/// A flat end of 6 mm, longer than every wall here.
const FLAT: [&str; 4] = ["--cutter", "3,60,20,30", "--corner", "0"];
/// Of the block 60 × 40 × 20, mm².
const SURFACE: f64 = 8800.0;

fn of_block(folder: &Folder) -> String {
    folder.file("block60.stl", stl(&block([0.0; 3], [60.0, 40.0, 20.0])))
}

fn setups(part: &str, out: &str, more: &[&str]) -> Value {
    let args = ["setups", part, "--sites", "4000", "--no-picture", "--out", out, "--json"];
    json(&deepmill(&[&args[..], &FLAT, more].concat()))
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"))
}

/// A share of the block's surface, by 4000 sites.
fn is_mm2(share: f64, mm2: f64) {
    assert!((share - mm2 / SURFACE).abs() < 0.005, "{} mm², not {mm2}", share * SURFACE);
}

/// Of a binary STL.
fn faces(bytes: &[u8]) -> impl Iterator<Item = [Corner; 3]> + '_ {
    let value = |at: &[u8]| f32::from_le_bytes(at.try_into().unwrap());
    bytes[84..].chunks_exact(50).map(move |face| {
        [0, 1, 2].map(|c| [0, 1, 2].map(|k| value(&face[12 * (c + 1) + 4 * k..][..4])))
    })
}

/// Least and greatest coordinates of a binary STL.
fn bounds(bytes: &[u8]) -> [Corner; 2] {
    let all = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    faces(bytes).flatten().fold(all, |[low, high], p| {
        [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]
    })
}

#[test]
fn a_vise_keeps_tools_off_the_faces_that_it_grips_below_the_top_of_its_jaws() {
    let folder = Folder::new();
    let (part, out) = (of_block(&folder), folder.path("out"));
    let run = |vise: &str, given: &[&str]| {
        let machine = ["--machine", "3-axis", "--vise", vise];
        let given: Vec<&str> = given.iter().flat_map(|up| ["--setup", *up]).collect();
        setups(&part, &out, &[&machine[..], &given].concat())
    };
    // The jaws are as wide as the part is long: the top, both ends, and 12 mm of the sides that are gripped.
    let one = run("60,50,8", &["+z"]);
    let row = &one["setups"][0];
    is_mm2(number(row, "reached"), 2400.0 + 2.0 * 800.0 + 2.0 * 60.0 * 12.0);
    is_mm2(number(row, "kept_out"), 2.0 * 60.0 * 8.0);
    assert_eq!((&row["held_by"], number(row, "opening_mm")), (&"vise on ±y".into(), 40.0));
    assert!((number(row, "under_jaws_mm2") - 960.0).abs() < 1e-6, "{row}");
    assert!(one["premise"].as_str().unwrap().contains("in the way: vise 60,50,8"), "{one}");
    // 3 mm wider at both ends, the cutter's radius: below the jaws' top it stands off the corners by as much.
    let wide = run("66,50,12", &["+z"]);
    let reached = 2400.0 + 2.0 * (800.0 - 2.0 * 3.0 * 12.0) + 2.0 * 60.0 * 8.0;
    is_mm2(number(&wide["setups"][0], "reached"), reached);
    // Wider by 1 mm, the cutter beside the jaw is off the end by √(2·3·1 − 1²).
    let wide = run("62,50,12", &["+z"]);
    let reached = 2400.0 + 2.0 * (800.0 - 2.0 * 5.0_f64.sqrt() * 12.0) + 2.0 * 60.0 * 8.0;
    is_mm2(number(&wide["setups"][0], "reached"), reached);

    // Jaws of 8 mm leave no band that is gripped twice, those of 12 mm one of 4 mm.
    assert_eq!(number(&run("60,50,8", &["+z", "-z"]), "reached"), 1.0);
    let twice = run("60,50,12", &["+z", "-z"]);
    is_mm2(number(&twice, "reached"), SURFACE - 2.0 * 60.0 * 4.0);
    let findings = twice["findings"]["findings"].as_array().unwrap();
    assert_eq!(findings.len(), 2, "a band on each side: {findings:?}");
    for finding in findings {
        assert_eq!(
            (&finding["cause"], number(&finding["fixture"], "share")),
            (&"inaccessible".into(), 1.0)
        );
        assert_eq!(finding["fixture"]["fixture"], "setup 1: vise on ±y");
    }
    // A wider opening has another grip, by the ends: it hides those below 12 mm, and beside the wider jaws 3 mm of the
    // sides. Of a given setup the grip is taken that reaches more.
    let ends = run("60,60,12", &["+z"]);
    assert_eq!(
        (&ends["setups"][0]["held_by"], &ends["n_candidates"]),
        (&"vise on ±x".into(), &2.into())
    );
    is_mm2(number(&ends, "reached"), 6400.0 - 2.0 * 40.0 * 12.0 - 4.0 * 3.0 * 12.0);
    // Left free, a part gripped by other sides each time is reached all over.
    let free = run("60,50,8", &[]);
    assert_eq!((number(&free, "reached"), &free["n_setups"]), (1.0, &2.into()));
}

#[test]
fn the_jaws_of_the_files_keep_as_much_out_of_reach_when_they_are_given_as_a_fixture() {
    let folder = Folder::new();
    let (part, out) = (of_block(&folder), folder.path("out"));
    let of = |more: &[&str]| {
        setups(&part, &out, &[&["--machine", "3-axis", "--setup", "+z"], more].concat())
    };
    let vise = of(&["--vise", "50,50,9", "--table", "0"]);
    assert_eq!(vise["setups"][0]["held_by"], "vise on ±y + table");
    let jaws = folder.path("jaws.stl");
    let bytes = std::fs::read(folder.path("out/setup-1-fixtures.stl")).unwrap();
    let turn: [[f32; 3]; 3] = serde_json::from_value(vise["setups"][0]["turn"].clone()).unwrap();
    let turned_back = |p: Corner| [0, 1, 2].map(|k| (0..3).map(|row| turn[row][k] * p[row]).sum());
    let faces: Vec<[Corner; 3]> = faces(&bytes).map(|face| face.map(turned_back)).collect();
    std::fs::write(&jaws, stl(&faces)).unwrap();
    let fixture = of(&["--fixture", &jaws]);
    assert_eq!(fixture["setups"][0]["held_by"], "jaws.stl");
    assert_eq!(fixture["reached"], vise["reached"]);
    assert_eq!(fixture["setups"][0]["kept_out"], vise["setups"][0]["kept_out"]);
    // Labels test every site against all triangles at once.
    let args = [
        "label",
        &part,
        "--directions",
        "up",
        "--sites",
        "4000",
        "--no-picture",
        "--out",
        &out,
        "--json",
    ];
    let label = json(&deepmill(&[&args[..], &FLAT, &["--fixture", &jaws]].concat()));
    let left: f64 = label["findings"]["findings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| number(f, "area_share"))
        .sum();
    assert!((1.0 - left - number(&vise, "reached")).abs() < 1e-9, "{left}");
}

#[test]
fn jaws_are_turned_with_the_part_and_parallels_lift_it() {
    let folder = Folder::new();
    let (part, out) = (of_block(&folder), folder.path("out"));
    let machine = ["--machine", "3-axis", "--setup", "-z", "--vise", "40,50,8,5"];
    setups(&part, &out, &machine);
    let bounds = |name: &str| bounds(&std::fs::read(folder.path(name)).unwrap());
    let ([low, high], [jaws_low, jaws_high]) =
        (bounds("out/setup-1.stl"), bounds("out/setup-1-fixtures.stl"));
    assert_eq!((low[2], high[2]), (-20.0, 0.0));
    // 8 above the part's lowest place; bed 5 below, as thick as the jaws: half of 40.
    assert_eq!((jaws_low[2], jaws_high[2]), (-45.0, -12.0));
    // The long side is along y'.
    assert_eq!((jaws_low[0], jaws_high[0]), (low[0] - 20.0, high[0] + 20.0));
    assert_eq!((jaws_low[1], jaws_high[1]), (low[1] + 10.0, high[1] - 10.0));
}

#[test]
fn a_table_is_a_square_below_the_middle_of_the_part_along_the_axes_of_the_setup() {
    let folder = Folder::new();
    let (part, out) = (of_block(&folder), folder.path("out"));
    setups(&part, &out, &["--machine", "3-axis", "--setup", "0.6,0,0.8", "--table", "7,200"]);
    let of = |name: &str| bounds(&std::fs::read(folder.path(name)).unwrap());
    let ([low, high], [table_low, table_high]) =
        (of("out/setup-1.stl"), of("out/setup-1-fixtures.stl"));
    assert!((table_low[2] - (low[2] - 7.0)).abs() < 1e-4 && table_high[2] - table_low[2] < 1e-4);
    for k in [0, 1] {
        assert!(
            (table_high[k] - table_low[k] - 200.0).abs() < 1e-3,
            "{table_low:?} {table_high:?}"
        );
        assert!((table_high[k] + table_low[k] - high[k] - low[k]).abs() < 1e-3);
    }
}

#[test]
fn a_table_keeps_the_holder_of_a_tilted_tool_off() {
    let folder = Folder::new();
    // A pocket 12 × 12 and 10 deep in the end at x = 60, its middle 10 above the table.
    let outside = block([0.0; 3], [60.0, 40.0, 20.0]);
    let rim: [Corner; 4] =
        [[60.0, 14.0, 4.0], [60.0, 26.0, 4.0], [60.0, 26.0, 16.0], [60.0, 14.0, 16.0]];
    let end: [Corner; 4] =
        [[60.0, 0.0, 0.0], [60.0, 40.0, 0.0], [60.0, 40.0, 20.0], [60.0, 0.0, 20.0]];
    let is_end = |face: &[Corner; 3]| face.iter().all(|p| p[0] == 60.0);
    let mut faces: Vec<[Corner; 3]> = outside.into_iter().filter(|face| !is_end(face)).collect();
    let floor = rim.map(|[_, y, z]| [50.0, y, z]);
    let quads = (0..4).flat_map(|k| {
        let next = (k + 1) % 4;
        [[end[k], end[next], rim[next], rim[k]], [rim[k], rim[next], floor[next], floor[k]]]
    });
    for [a, b, c, d] in quads.chain([floor]) {
        faces.extend([[a, b, c], [a, c, d]]);
    }
    let (part, out) = (folder.file("pocket.stl", stl(&faces)), folder.path("out"));
    let run = |table: &[&str]| {
        // The box axes and one more: within 90 degrees of +z.
        let args =
            ["setups", &part, "--cutter", "1.5,30,20,30", "--corner", "0", "--machine", "3+2:90"];
        let more = [
            "--setup",
            "+z",
            "--directions",
            "1",
            "--sites",
            "6000",
            "--no-picture",
            "--out",
            &out,
        ];
        json(&deepmill(&[&args[..], &more, &["--json"], table].concat()))
    };
    // The floor but for its corners, and the walls but for 1.5 mm beside each edge between them.
    let inside = 144.0 - (4.0 - std::f64::consts::PI) * 2.25 + 4.0 * 9.0 * 10.0;
    let lies = run(&["--table", "0"]);
    let row = &lies["setups"][0];
    assert!((number(row, "kept_out") - inside / 9280.0).abs() < 0.005, "{row}");
    // The holder is 20 in radius: 14.5 below the part when the tool is 5.5 above its lowest place.
    for far in ["15", "100", "15,140"] {
        let row = &run(&["--table", far])["setups"][0];
        assert_eq!(number(row, "kept_out"), 0.0, "{row}");
    }
    assert_eq!(run(&["--table", "100"])["reached"], run(&[])["reached"]);
    // The spindle, 61.5 above the tip, is a half space: a table of 500 stops the tilt.
    let row = &run(&["--table", "15,500"])["setups"][0];
    assert!((number(row, "kept_out") - inside / 9280.0).abs() < 0.005, "{row}");
}

#[test]
fn fixtures_are_in_the_way_in_the_setups_that_they_are_given_for() {
    let folder = Folder::new();
    let (part, out) = (of_block(&folder), folder.path("out"));
    // On half of the top, and before the end at x = 0.
    folder.file("clamp.stl", stl(&block([-10.0, 0.0, 20.0], [30.0, 40.0, 30.0])));
    let kept_out = |fixture: &str| {
        let (number_of, file) = fixture.split_at(fixture.find('c').unwrap());
        let fixture = format!("{number_of}{}", folder.path(file));
        let machine =
            ["--machine", "3-axis", "--setup", "+z", "--setup", "-z", "--fixture", &fixture];
        let result = setups(&part, &out, &machine);
        [0, 1].map(|k| number(&result["setups"][k], "kept_out"))
    };
    let [first, second] = kept_out("1:clamp.stl");
    is_mm2(first, 30.0 * 40.0 + 800.0);
    assert_eq!(second, 0.0);
    assert_eq!(kept_out("2:clamp.stl"), [0.0, 0.0], "below the part nothing is in the way");
    assert_eq!(kept_out("clamp.stl"), [first, 0.0]);
}

#[test]
fn a_plate_is_gripped_lower_than_it_is_thick_and_the_shop_of_the_guide_mills_it() {
    let folder = Folder::new();
    // 5 mm thick: the jaws end at 4, not at 15.
    let plate = folder.file("plate.stl", stl(&block([0.0; 3], [60.0, 40.0, 5.0])));
    let shop = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/tools/shop-42.csv");
    let out = folder.path("out");
    let args = ["setups", &plate, "--tools", shop, "--machine", "3-axis", "--vise", "100,100,15"];
    let more = ["--setup", "+z", "--setup", "-z", "--sites", "1000", "--no-picture", "--json"];
    let result = json(&deepmill(&[&args[..], &more, &["--out", &out]].concat()));
    assert_eq!(result["n_tools"], 42);
    let [first, second] = [&result["setups"][0], &result["setups"][1]];
    assert_eq!((&first["held_by"], number(first, "grip_mm")), (&"vise on ±x".into(), 4.0));
    assert_eq!((number(first, "opening_mm"), number(first, "under_jaws_mm2")), (60.0, 320.0));
    // The second grips the other sides: what the jaws hid is reached, but for 1 × 3 mm beside each corner.
    assert_eq!((&second["held_by"], number(second, "opening_mm")), (&"vise on ±y".into(), 40.0));
    assert!((number(&result, "reached") - (1.0 - 12.0 / 5800.0)).abs() < 0.003, "{result}");
}

#[test]
fn what_cannot_be_held_is_one_line_of_error_with_the_remedy() {
    let folder = Folder::new();
    let (part, out) = (of_block(&folder), folder.path("out"));
    let outline = |k: u32| {
        let angle = std::f32::consts::TAU * k as f32 / 40.0;
        [20.0 * angle.cos(), 20.0 * angle.sin()]
    };
    let round = (0..40).flat_map(|k| {
        let ([a, b], [c, d]) = (outline(k), outline((k + 1) % 40));
        let (p, q) = ([a, b, 0.0], [c, d, 0.0]);
        let (above_p, above_q) = ([a, b, 25.0], [c, d, 25.0]);
        [
            [p, q, above_q],
            [p, above_q, above_p],
            [[0.0; 3], q, p],
            [[0.0, 0.0, 25.0], above_p, above_q],
        ]
    });
    let round = folder.file("round.stl", stl(&round.collect::<Vec<_>>()));
    let clamp = folder.file("clamp.stl", stl(&block([0.0, 0.0, 20.0], [30.0, 40.0, 30.0])));
    let numbered = format!("3:{clamp}");
    let refused = |part: &str, machine: &str, more: &[&str]| {
        let args =
            ["setups", part, "--machine", machine, "--sites", "300", "--no-picture", "--out", &out];
        failure(&deepmill(&[&args[..], &FLAT, more].concat()), 2)
    };
    for (part, machine, more, expected) in [
        (
            &part,
            "3-axis",
            &["--vise", "60,15,8"][..],
            "--vise is 60,15,8, expected an opening of 20 mm or more;",
        ),
        (
            &part,
            "3-axis",
            &["--vise", "60,30,8", "--setup", "+z"],
            "40 mm or more in the setup +z up",
        ),
        (
            &round,
            "3-axis",
            &["--vise", "60,60,8", "--setup", "+z"],
            "expected two opposite flat faces across z'",
        ),
        (
            &part,
            "4-axis:x",
            &["--vise", "60,60,8"],
            "--vise is 60,60,8, expected a machine on whose table the part lies",
        ),
        (&part, "4-axis:x", &["--table", "0"], "held along the rotary axis"),
        (&part, "3-axis", &["--fixture", &numbered], "give the setups with --setup"),
        (
            &part,
            "3-axis",
            &["--setup", "+z", "--fixture", &numbered],
            "the number of a given setup, 1 to 1",
        ),
    ] {
        let message = refused(part, machine, more);
        assert!(message.contains(expected), "{message}");
    }
    // Lying, by its ends, the round part is held; upright it is left out.
    let args =
        ["setups", &round, "--machine", "3-axis", "--sites", "300", "--no-picture", "--out", &out];
    let lying = deepmill(&[&args[..], &FLAT, &["--vise", "60,60,8"]].concat());
    let words = command::text(&lying.stdout);
    assert!(
        words.contains("the vise cannot grip the part in 2 of ") && words.contains("+z; -z up"),
        "{words}"
    );
    for (more, expected) in [
        (["--vise", "60,60"], "2 lengths, expected jaw width"),
        (["--vise", "60,0,8"], "vise is 60,0,8"),
        (["--vise", "60,x,8"], "x"),
    ] {
        let args = ["setups", &part, "--machine", "3-axis", "--out", &out];
        let output = deepmill(&[&args[..], &FLAT, &more].concat());
        assert_eq!(output.status.code(), Some(2));
        assert!(
            command::text(&output.stderr).contains(expected),
            "{}",
            command::text(&output.stderr)
        );
    }
    let below = deepmill(
        &[&["setups", &part, "--machine", "3-axis", "--out", &out, "--table=-1"], &FLAT[..]]
            .concat(),
    );
    assert!(failure(&below, 2).contains("--table is -1, expected 0 to 100 m below the part"));
}
