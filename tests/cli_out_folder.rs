//! Folders of results: no file that is read is replaced, and nothing of former results is taken for new.
#![cfg(feature = "cli")]

mod command;

use command::{CUTTER, Folder, block, deepmill, failure, stl, text};

/// Tables, parts and fixtures keep their bytes, whatever the folder of the results; files that a command has written
/// itself may be given again.
#[test]
fn results_replace_no_file_that_is_read() {
    let folder = Folder::new();
    let part = folder.file("part.stl", stl(&block([0.0; 3], [20.0; 3])));
    let table = "name,diameter,corner,flute_length,shank,stick_out\nA,6,3,20,6,40\nB,2,1,20,6,40\n";
    let tools = folder.file("tools.csv", table);
    let holder = folder.file("holder.csv", "height,lower,upper\n30,40,40\n");
    let other = folder.file("other.stl", stl(&block([0.0; 3], [20.0; 3])));
    let (here, out) = (folder.path(""), folder.path("out"));
    let of = |part: &str, tools: &str, out: &str| {
        let args = ["label", part, "--tools", tools, "--holder", &holder, "--out", out];
        deepmill(&[&args[..], &["--sites", "200", "--no-picture"]].concat())
    };
    for (part, name) in [(&part, "part.stl"), (&other, "tools.csv")] {
        let before = std::fs::read(folder.path(name)).unwrap();
        let error = failure(&of(part, &tools, &here), 1);
        assert!(error.contains(name) && error.contains("would replace it"), "{error}");
        assert_eq!(std::fs::read(folder.path(name)).unwrap(), before);
    }
    assert!(of(&part, &tools, &out).status.success());
    let again = of(&folder.path("out/part.stl"), &folder.path("out/tools.csv"), &out);
    assert!(again.status.success(), "{}", text(&again.stderr));
    let export = ["tools", "--library", &tools, "--holder", &holder, "--export", "csv"];
    assert!(deepmill(&[&export[..], &["--out", &here]].concat()).status.success());
    let library = folder.path("library.csv");
    let export = ["tools", "--library", &library, "--export", "csv", "--out", &here];
    assert!(failure(&deepmill(&export), 1).contains("library.csv"));
}

/// A folder of results is about one run: what an earlier one has left is gone, other files stay.
#[test]
fn former_results_are_not_taken_for_new_ones() {
    let folder = Folder::new();
    let part = folder.file("part.stl", stl(&block([0.0; 3], [20.0; 3])));
    let (out, clamp) =
        (folder.path("out"), folder.file("clamp.stl", stl(&block([30.0; 3], [40.0; 3]))));
    let run = |more: &[&str]| {
        let args = ["label", &part, "--out", &out, "--sites", "200", "--cutter", "3,20,20,40"];
        let ran = deepmill(&[&args[..], more].concat());
        assert!(ran.status.success(), "{}", text(&ran.stderr));
    };
    run(&["--cutter", "1,20,20,40", "--rest", "--report", "--fixture", &clamp]);
    // Of the user, and of another program.
    for name in ["notes.txt", "safety_status.txt", "visibility_matrix.txt"] {
        std::fs::write(format!("{out}/{name}"), "kept").unwrap();
    }
    std::fs::write(folder.path("out/3-20-20-40/region.stl"), "solid of another\n").unwrap();
    run(&["--no-picture"]);
    let mut names: Vec<String> = std::fs::read_dir(&out)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.contains('.'))
        .collect();
    names.sort();
    let expected = [
        "findings.csv",
        "findings.json",
        "labels.npz",
        "labels.ply",
        "notes.txt",
        "outcome.npz",
        "part.stl",
        "safety_status.txt",
        "visibility_matrix.txt",
    ];
    assert_eq!(names, expected);
    // The page is about this run, not about the two tools.
    let report = deepmill(&["report", &out]);
    assert!(report.status.success(), "{}", text(&report.stderr));
    let page = std::fs::read_to_string(folder.path("out/report.html")).unwrap();
    assert!(!page.contains("1-20-20-40"));
    run(&["--cutter", "1,20,20,40", "--no-picture"]);
    assert!(std::fs::metadata(folder.path("out/labels.npz")).is_err());
    assert_eq!(
        std::fs::read_to_string(folder.path("out/3-20-20-40/region.stl")).unwrap(),
        "solid of another\n"
    );
    assert!(std::fs::metadata(folder.path("out/3-20-20-40/rest.ply")).is_err());
}

/// `tools` names tools in a table like that of `label`, but writes no answers per site.
#[test]
fn a_table_of_tools_is_not_taken_for_labels() {
    let folder = Folder::new();
    let part = folder.file("block.stl", stl(&block([0.0; 3], [20.0; 3])));
    let tools = folder.file("shop.csv", "name,CR,CH,FR,FH\nA,3,20,20,40\nB,1,20,20,40\n");
    let (out, sites) = (folder.path("out"), ["--sites", "200", "--no-picture"]);
    let compare = ["tools", &part, "--library", &tools, "--out", &out];
    let compare = || deepmill(&[&compare[..], &sites].concat());
    assert!(compare().status.success());
    let error = failure(&deepmill(&["report", &out]), 1);
    assert!(error.contains("neither labels.npz nor predictions.npz"), "{error}");
    let error = failure(&deepmill(&["explain", &out, "--site", "0"]), 1);
    assert!(error.contains("holds no labels.npz"), "{error}");
    let findings = format!("findings:{out}");
    let of =
        deepmill(&["label", &part, "--cutter", "3,20,20,40", "--only", &findings, "--out", &out]);
    assert!(failure(&of, 1).contains("labels.npz"));
    let label = ["label", &part, "--cutter", "3,20,20,40", "--out", &out];
    assert!(deepmill(&[&label[..], &sites].concat()).status.success());
    assert!(compare().status.success());
    let report = deepmill(&["report", &out]);
    assert!(report.status.success(), "{}", text(&report.stderr));
}

#[test]
fn answers_are_drawn_on_their_own_part_alone() {
    let folder = Folder::new();
    let part = folder.file("part.stl", stl(&block([0.0; 3], [20.0; 3])));
    let other = folder.file("other.stl", stl(&block([0.0; 3], [20.0, 20.0, 30.0])));
    let out = folder.path("out");
    let few = ["--sites", "200", "--no-picture", "--out", &out];
    let cutter = ["--cutter", CUTTER];
    let refused = |args: &[&str], named: &str| {
        let message = failure(&deepmill(args), 1);
        let place = format!("it is not the surface of {}", folder.path("out"));
        assert!(message.contains(named) && message.contains(&place), "{args:?}: {message}");
    };
    for (command, tools) in [
        ("label", &cutter[..]),
        ("label", &["--cutter", CUTTER, "--cutter", "1,20,5,20"][..]),
        ("predict", &cutter[..]),
    ] {
        let of = |part: &str| deepmill(&[&[command, part], tools, &few[..]].concat());
        assert!(of(&part).status.success());
        assert!(deepmill(&["report", &out]).status.success(), "{command} {tools:?}");
        // `tools`, which writes the surface as well.
        let library = folder.file("library.csv", "name,CR,CH,FR,FH\none,1,20,5,20\n");
        let tools_of = ["tools", &other, "--tools", &library];
        if tools.len() == 2 {
            assert!(deepmill(&[&tools_of[..], &few].concat()).status.success());
        } else {
            std::fs::copy(folder.path("other.stl"), folder.path("out/part.stl")).unwrap();
        }
        refused(&["report", &out], "part.stl");
        if command == "label" {
            refused(&["report", &out, "--part", &other], "other.stl");
            assert!(deepmill(&["report", &out, "--part", &part]).status.success());
            let only = format!("findings:{out}");
            let again = folder.path("again");
            let label = ["label", &part, "--only", &only, "--out", &again];
            refused(&[&label[..], tools].concat(), "part.stl");
        }
        std::fs::remove_dir_all(&out).unwrap();
    }
}
