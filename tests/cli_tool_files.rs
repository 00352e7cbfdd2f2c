//! What `deepmill tools` promises about libraries alone: files that are read again.
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
        assert_eq!(first["n_tools"], 41);
        let again = folder.path(&format!("again-{format}"));
        let args = ["tools", "--library", &file, "--export", format, "--out", &again, "--strict"];
        let output = deepmill(&[&args[..], &["--json"]].concat());
        assert_eq!(json(&output)["tools"], first["tools"]);
        assert!(output.stderr.is_empty() || !text(&output.stderr).contains("warning"));
        let bytes = |path: &str| std::fs::read(path).unwrap();
        let twice = folder.path(&format!("again-{format}/library.{format}"));
        assert!(bytes(&file) == bytes(&twice), "{format}");
    }
    let strict =
        ["tools", "--library", SHOP, "--export", "csv", "--out", &folder.path("x"), "--strict"];
    let message = failure(&deepmill(&strict), 1);
    assert!(message.contains("9 of its tools would be left out"), "{message}");
    let message = failure(&deepmill(&["tools", "--library", SHOP, "--out", &folder.path("x")]), 2);
    assert!(message.contains("PART"), "{message}");
    assert!(!Path::new(&folder.path("x")).exists());
}
