//! What `deepmill tools` promises about libraries alone: pictures, and files that are read again.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, deepmill, failure, json, text};
use std::path::Path;

const SHOP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/shop50.json");

#[test]
fn a_library_is_exported_and_read_again_without_a_part() {
    let folder = Folder::new();
    for format in ["csv", "json"] {
        let out = folder.path(format);
        let args = ["tools", "--library", SHOP, "--export", format, "--out", &out, "--json"];
        let first = json(&deepmill(&args));
        let file = folder.path(&format!("{format}/library.{format}"));
        assert_eq!(first["files"], serde_json::json!([file]));
        assert_eq!(first["n_tools"], 47);
        let again = folder.path(&format!("again-{format}"));
        let args = ["tools", "--library", &file, "--export", format, "--out", &again, "--strict"];
        let output = deepmill(&[&args[..], &["--json"]].concat());
        assert_eq!(json(&output)["tools"], first["tools"]);
        assert!(output.stderr.is_empty() || !text(&output.stderr).contains("warning"));
        let bytes = |path: &str| std::fs::read(path).unwrap();
        let twice = folder.path(&format!("again-{format}/library.{format}"));
        assert!(bytes(&file) == bytes(&twice), "{format}");
    }
    let strict = ["tools", "--library", SHOP, "--show", "--out", &folder.path("x"), "--strict"];
    let message = failure(&deepmill(&strict), 1);
    assert!(message.contains("3 of its tools would be left out"), "{message}");
    let message = failure(&deepmill(&["tools", "--library", SHOP, "--out", &folder.path("x")]), 2);
    assert!(message.contains("PART"), "{message}");
    assert!(!Path::new(&folder.path("x")).exists());
}

#[test]
fn the_pictures_of_the_documentation_are_those_of_show() {
    let folder = Folder::new();
    let saw = r#"{"name": "saw 76x3", "shape": "slittingsaw.fcstd", "parameter": {"BladeThickness": "3 mm",
        "CapDiameter": "12 mm", "CapHeight": "3 mm", "Diameter": "76.2 mm", "ShankDiameter": "19 mm"}}"#;
    let saw = folder.file("saw.fctb", saw);
    let holder = folder.file("ER32.csv", "height,lower,upper\n50,50,50\n");
    let out = folder.path("out");
    let args = ["tools", "--library", SHOP, &saw, "--show", "--out", &out, "--holder", &holder];
    let output = deepmill(&[&args[..], &["--stick-out", "60"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/pictures/tools");
    for (name, tool) in [
        ("flat", "F8"),
        ("ball", "0.25 in ball"),
        ("bull", "D10 R1"),
        ("tapered", "TB2 5deg"),
        ("lollipop", "lollipop 8"),
        ("slot", "T-slot 16x4"),
        ("saw", "saw 76x3"),
        ("dovetail", "dovetail 20x60"),
        ("chamfer", "chamfer 10x90"),
        ("countersink", "countersink 12.4"),
        ("counterbore", "counterbore M6"),
        ("face", "face 50 45deg"),
        ("radius", "corner R3"),
        ("thread", "TM M10x1.5 multi"),
        ("barrel", "barrel 10 R85"),
        ("lens", "lens 12 R30"),
        ("oval", "oval 8 R80"),
        ("taper", "taper form 16 R250"),
        ("form", "profile cutter"),
        ("drill", "drill 8.5"),
        ("center", "center A2"),
        ("reamer", "reamer 6H7"),
    ] {
        let drawn = std::fs::read(folder.path(&format!("out/pictures/{tool}.svg"))).unwrap();
        let file = docs.join(format!("{name}.svg"));
        // Set to draw them anew.
        if std::env::var_os("DEEPMILL_DRAW_DOCS").is_some() {
            std::fs::write(&file, &drawn).unwrap();
        }
        assert!(std::fs::read(&file).unwrap() == drawn, "{} is another picture", file.display());
        assert!(drawn.len() < 6000, "{name}: {} bytes", drawn.len());
    }
}
