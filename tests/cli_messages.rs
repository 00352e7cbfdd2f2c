//! What is wrong with arguments is the last line, with what to do.
#![cfg(feature = "cli")]

mod command;

use command::{CUTTER, Folder, deepmill, failure, json, text};

#[test]
fn arguments_that_cannot_be_read_end_with_what_is_wrong() {
    let folder = Folder::new();
    let part = folder.block();
    for (args, expected) in [
        (
            &["label", &part][..],
            "the following required arguments were not provided: --out <DIR> --cutter",
        ),
        (
            &["label", &part, "--cutter", CUTTER, "--outt", "x"],
            "a similar argument exists: '--out'",
        ),
        (
            &["label", &part, "--cutter", CUTTER, "--out", "x", "--table", "low"],
            "invalid value 'low' for '--table <Z>'",
        ),
        (&["lable", &part], "similar subcommands exist: 'sample', 'label'"),
        (
            &["label", &part, "--cutter", CUTTER, "--out", "x", "--sites", "9", "--sites", "8"],
            "cannot be used multiple times",
        ),
        (&["explain", "x", "--site", "1", "--at", "1,2,3"], "cannot be used with '--at <X,Y,Z>'"),
        (&["check", &part, "--output-unit", "inch"], "expected mm, cm, m or in"),
    ] {
        let message = failure(&deepmill(args), 2);
        assert!(message.contains(expected), "{args:?}: {message}");
        assert!(!message.contains("For more information"), "{message}");
    }
    let output = deepmill(&["label", &part, "--json"]);
    let stderr = text(&output.stderr);
    assert!(stderr.starts_with("Usage: deepmill label"), "{stderr}");
    let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(told["error"].as_str().unwrap().contains("--cutter"), "{told}");
    let help = deepmill(&["label", "--help"]);
    assert!(help.status.success() && text(&help.stdout).contains("Usage: deepmill label"));
}

#[test]
fn a_place_off_the_part_is_refused_with_its_distance() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let label = ["label", &part, "--cutter", "2,40,5,30", "--directions", "up", "--sites", "800"];
    json(&deepmill(&[&label[..], &["--no-picture", "--json", "--out", &out]].concat()));
    let at = |at: &str, more: &[&str]| {
        deepmill(&[&["explain", &out, "--at", at, "--no-picture", "--json"][..], more].concat())
    };
    assert!(json(&at("20,15,20", &[]))["distance_mm"].as_f64().unwrap() < 2.6);
    // The middle of the block is 10 mm from its faces; sites are about 2.6 mm apart.
    let message = failure(&at("20,15,10", &[]), 2);
    assert!(
        message.contains("--at is 20, 15, 10, 10.") && message.contains("--nearest"),
        "{message}"
    );
    assert!(json(&at("20,15,10", &["--nearest"]))["distance_mm"].as_f64().unwrap() > 9.9);
}
