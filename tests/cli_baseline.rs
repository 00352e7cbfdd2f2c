//! Findings in a pipeline: names that stay, baselines, and what fails a run. The commands are those of
//! docs/pipeline.md.
#![cfg(feature = "cli")]

mod command;

use command::{Folder, deepmill, failure, grooved, text};
use deepmill::analysis::Analysis;
use deepmill::data::files::tools::Tool;
use deepmill::findings::FindingStatus;
use deepmill::findings::baseline::Baseline;
use deepmill::geom::solids::cuboid;
use deepmill::glam::DVec3;
use serde_json::Value;

/// A ball end of 6 mm, 20 mm below a wide holder.
const D6: &str = "name,CR,CH,FR,FH\nD6,3,14,20,30\n";
/// The same, 7 mm below it: too short for the groove.
const SHORT: &str = "name,CR,CH,FR,FH\nD6,3,1,20,30\n";

struct Run {
    code: i32,
    result: Value,
    stderr: String,
}

impl Run {
    fn ids(&self, key: &str) -> Vec<&str> {
        let list =
            self.result["baseline"][key].as_array().unwrap_or_else(|| panic!("{}", self.stderr));
        list.iter().map(|id| id.as_str().unwrap()).collect()
    }

    /// Of known, new, grown and gone.
    fn counts(&self) -> [usize; 4] {
        ["known", "new", "grown", "gone"].map(|key| self.ids(key).len())
    }

    /// The names of all findings, the largest first.
    fn names(&self) -> Vec<&str> {
        let list = self.result["findings"]["findings"].as_array().unwrap();
        list.iter().map(|finding| finding["id"].as_str().unwrap()).collect()
    }
}

/// `label PART --tools mill.csv --directions up …`.
fn label(folder: &Folder, part: &str, tools: &str, more: &[&str]) -> Run {
    let (tools, out) = (folder.file("mill.csv", tools), folder.path("labels"));
    let args = ["label", part, "--tools", &tools, "--directions", "up", "--out", &out, "--json"];
    let sites = ["--sites", "3000"];
    let sites = if more.contains(&"--sites") { &[][..] } else { &sites };
    let run = deepmill(&[&args[..], &["--no-picture"], sites, more].concat());
    let stderr = text(&run.stderr);
    assert!(!stderr.contains("panicked"), "{stderr}");
    let result = serde_json::from_slice(&run.stdout).unwrap();
    Run { code: run.status.code().unwrap(), result, stderr }
}

fn read(path: &str) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn the_pipeline_of_the_guide_passes_what_is_known_and_fails_on_what_is_new() {
    let folder = Folder::new();
    let (part, known) = (grooved(&folder, 20.0, 8.0), folder.path("known.toml"));
    let first = label(&folder, &part, D6, &["--write-baseline", &known]);
    assert_eq!(first.code, 0, "{}", first.stderr);
    let n = first.names().len();
    // The underside, and the two edges of the floor; the ends of the block may be in pieces.
    assert!(n >= 3 && first.counts() == [0, n, 0, 0], "{:?}", first.result["baseline"]);
    let written = read(&known);
    assert_eq!(written.matches("[[finding]]").count(), n, "{written}");
    assert!(first.names().iter().all(|id| written.contains(&format!("id = \"{id}\""))));
    assert!(first.result["files"].as_array().unwrap().iter().any(|file| *file == *known));
    // A person gives a reason.
    let reason = "the underside is milled in the second setup";
    folder
        .file("known.toml", written.replacen("reason = \"\"", &format!("reason = {reason:?}"), 1));

    // The same again; under another name; with other sites.
    let renamed = folder.file("revision-b.stl", std::fs::read(&part).unwrap());
    for (part, more) in [
        (&part, &["--sites", "3000"][..]),
        (&renamed, &["--fail-if", "finding>1mm2"]),
        (&part, &["--sites", "5000", "--seed", "3"]),
    ] {
        let again = label(&folder, part, D6, &[&["--baseline", &known], more].concat());
        assert_eq!(again.code, 0, "{more:?}: {}", again.stderr);
        assert_eq!(again.names()[0], first.names()[0]);
        let finding = &again.result["findings"]["findings"][0];
        assert_eq!((&finding["status"], &finding["reason"]), (&"known".into(), &reason.into()));
        assert!(again.ids("new").is_empty() && again.ids("grown").is_empty());
    }
    let file: Value = serde_json::from_str(&read(&folder.path("labels/findings.json"))).unwrap();
    assert_eq!(file["findings"][0]["reason"], reason);
    let csv = read(&folder.path("labels/findings.csv"));
    let row = format!("1,{},known,{reason},inaccessible,", first.names()[0]);
    assert!(csv.starts_with("finding,id,status,reason,cause,area_mm2,"), "{csv}");
    assert!(csv.lines().nth(1).unwrap().starts_with(&row), "{csv}");

    // A shorter tool of that name: its holder keeps it from the floor.
    let changed = label(&folder, &part, SHORT, &["--baseline", &known]);
    assert_eq!(changed.code, 3, "{}", changed.stderr);
    assert!(changed.counts()[1] + changed.counts()[2] > 0);
    let last = changed.stderr.lines().last().unwrap();
    assert!(last.starts_with("limit broken: ") && last.contains("known.toml"), "{last}");
    let said = |words: &str| changed.stderr.lines().any(|line| line.starts_with(words));
    assert!(said("  new   F-") || said("  grown F-"), "{}", changed.stderr);

    // It is accepted: reasons and dates stay, what is gone is dropped and named.
    folder.file("known.toml", read(&known).replace("date = \"", "date = \"2001-02-03\" # \""));
    let accepted = label(&folder, &part, SHORT, &["--write-baseline", &known]);
    let now = read(&known);
    assert_eq!(accepted.code, 0, "{}", accepted.stderr);
    assert!(now.contains(&format!("reason = {reason:?}\ndate = \"2001-02-03\"")), "{now}");
    for gone in accepted.ids("gone") {
        assert!(!now.contains(gone) && accepted.stderr.contains(&format!("gone  {gone}")));
    }
    let again = label(&folder, &part, SHORT, &["--baseline", &known]);
    assert_eq!((again.code, again.counts()[0]), (0, now.matches("[[finding]]").count()));
}

#[test]
fn a_part_that_is_edited_elsewhere_keeps_the_names_and_a_new_groove_is_new() {
    let folder = Folder::new();
    let known = folder.path("known.toml");
    let flat = grooved(&folder, 18.0, 3.0);
    let first = label(&folder, &flat, D6, &["--write-baseline", &known]);
    let under = first.names()[0].to_string();
    // The corners of the floor, which the ball leaves, are 9 mm lower.
    let deep = grooved(&folder, 18.0, 12.0);
    let run = label(&folder, &deep, D6, &["--baseline", &known]);
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert!(run.ids("known").contains(&&*under), "{:?}", run.result["baseline"]);
    // Shares are of all, known or not; a limit on findings counts what is not known.
    let largest = run.result["findings"]["findings"].as_array().unwrap();
    let not_known = largest.iter().filter(|finding| finding["status"] != "known");
    let most = not_known.map(|f| f["area_mm2"].as_f64().unwrap()).fold(0.0, f64::max);
    assert!(most > 0.0 && most < 1000.0, "{most}");
    for (limit, is_broken) in [
        ("finding>1000mm2".to_string(), false),
        (format!("finding>{}mm2", 0.5 * most), true),
        ("inaccessible>20%".into(), true),
    ] {
        let run = label(&folder, &deep, D6, &["--baseline", &known, "--fail-if", &limit]);
        let broken = run.result["limits_broken"].as_array().unwrap();
        assert_eq!((run.code, !broken.is_empty()), (3, is_broken), "{limit}: {broken:?}");
    }
    // A part of another size.
    let large =
        folder.file("large.stl", command::stl(&command::block([0.0; 3], [400.0, 30.0, 9.0])));
    let run = label(&folder, &large, D6, &["--baseline", &known]);
    assert!(run.stderr.contains("warning: the baseline is of groove.stl"), "{}", run.stderr);
}

#[test]
fn other_sites_pass_and_a_shorter_or_thicker_tool_a_deeper_groove_and_a_wall_fail() {
    let folder = Folder::new();
    let known = folder.path("known.toml");
    let part = grooved(&folder, 18.0, 10.0);
    // Of 12 mm to the holder: it reaches the floor of 10 mm.
    let tool = |cr: f64, ch: f64| format!("name,CR,CH,FR,FH\nD6,{cr},{ch},20,30\n");
    let first = label(&folder, &part, &tool(8.5, 12.0), &["--write-baseline", &known]);
    assert_eq!(first.code, 0, "{}", first.stderr);
    for n_sites in ["2000", "3000", "5000"] {
        for seed in ["1", "2", "3"] {
            let more = ["--baseline", &known, "--sites", n_sites, "--seed", seed];
            let run = label(&folder, &part, &tool(8.5, 12.0), &more);
            assert_eq!(run.code, 0, "{n_sites}, {seed}: {}", run.stderr);
            assert_eq!(run.counts()[1..3], [0, 0], "{n_sites}, {seed}");
        }
    }
    let fails = |part: &str, tools: &str, seed: &str| {
        let run =
            label(&folder, part, tools, &["--baseline", &known, "--sites", "3000", "--seed", seed]);
        assert_eq!(run.code, 3, "{}", run.stderr);
        assert!(run.counts()[1] + run.counts()[2] > 0, "{:?}", run.result["baseline"]);
        assert!(
            run.ids("known").contains(&first.names()[0])
                || run.ids("grown").contains(&first.names()[0])
        );
    };
    for seed in ["0", "1"] {
        fails(&part, &tool(8.5, 8.0), seed);
        // A tenth thicker: wider than the groove.
        fails(&part, &tool(9.35, 12.0), seed);
    }
    let mut walled = command::block([0.0; 3], [44.0, 30.0, 10.0]);
    walled.extend(command::block([0.0, 0.0, 9.0], [13.0, 30.0, 20.0]));
    walled.extend(command::block([31.0, 0.0, 9.0], [44.0, 30.0, 20.0]));
    // A wall across the groove, as high as the block.
    walled.extend(command::block([12.0, 14.0, 9.0], [32.0, 16.0, 20.0]));
    let walled = folder.file("walled.stl", command::stl(&walled));
    fails(&walled, &tool(8.5, 12.0), "0");
    fails(&grooved(&folder, 18.0, 14.0), &tool(8.5, 12.0), "0");
}

#[test]
fn reports_of_a_folder_have_the_names_and_reasons_of_its_findings() {
    let folder = Folder::new();
    let (part, known) = (grooved(&folder, 20.0, 8.0), folder.path("known.toml"));
    let first = label(&folder, &part, D6, &["--write-baseline", &known]);
    let id = first.names()[0];
    let named =
        read(&known).replace(id, "under & side").replacen("reason = \"\"", "reason = \"<b>\"", 1);
    folder.file("known.toml", named);
    let run = label(&folder, &part, D6, &["--baseline", &known, "--report"]);
    assert_eq!((run.code, run.names()[0]), (0, "under & side"));
    let page = || read(&folder.path("labels/report.html"));
    let words = "under &amp; side, known: &lt;b&gt;";
    assert!(page().contains(words));
    std::fs::remove_file(folder.path("labels/report.html")).unwrap();
    let again = deepmill(&["report", &folder.path("labels"), "--json"]);
    assert!(again.status.success() && page().contains(words), "{}", text(&again.stderr));
}

#[test]
fn setups_are_held_against_a_baseline_too() {
    let folder = Folder::new();
    let (part, known) = (grooved(&folder, 20.0, 8.0), folder.path("known.toml"));
    let (tools, out) = (folder.file("mill.csv", D6), folder.path("setups"));
    let run = |more: &[&str]| {
        let args = ["setups", &part, "--tools", &tools, "--machine", "3-axis", "--setup", "+z"];
        let args =
            [&args[..], &["--out", &out, "--sites", "2000", "--no-picture", "--json"]].concat();
        let run = deepmill(&[&args[..], more].concat());
        (
            run.status.code(),
            serde_json::from_slice::<Value>(&run.stdout).unwrap(),
            text(&run.stderr),
        )
    };
    let (code, result, _) = run(&["--write-baseline", &known]);
    let n = result["findings"]["findings"].as_array().unwrap().len();
    assert!(code == Some(0) && n > 0 && read(&known).contains("tool = \"setups\""));
    let (code, result, stderr) = run(&["--baseline", &known, "--fail-if", "finding>1mm2"]);
    assert_eq!(
        (code, result["baseline"]["known"].as_array().unwrap().len()),
        (Some(0), n),
        "{stderr}"
    );
    let (start, _) =
        read(&known).split_once("[[finding]]").map(|(a, b)| (a.to_string(), b.len())).unwrap();
    folder.file("known.toml", start);
    let (code, result, _) = run(&["--baseline", &known]);
    assert_eq!((code, result["baseline"]["new"].as_array().unwrap().len()), (Some(3), n));
}

#[test]
fn several_tools_are_held_against_what_none_of_them_reaches() {
    let folder = Folder::new();
    let (part, known) = (grooved(&folder, 20.0, 8.0), folder.path("known.toml"));
    let both = format!("{D6}short,3,1,20,30\n");
    let first = label(&folder, &part, &both, &["--write-baseline", &known]);
    assert!(first.code == 0 && read(&known).contains("tool = \"all tools\""));
    // A third one, however useless, makes nothing new; the short one alone does.
    let three = format!("{both}stub,3,0.1,20,30\n");
    let more = ["--baseline", &known, "--fail-if", "finding>1mm2"];
    let run = label(&folder, &part, &three, &more);
    assert_eq!((run.code, run.ids("known").len()), (0, first.names().len()), "{}", run.stderr);
    let run = label(&folder, &part, SHORT, &["--baseline", &known]);
    assert!(
        run.code == 3 && run.stderr.contains("findings of all tools, none of D6"),
        "{}",
        run.stderr
    );
}

#[test]
fn bad_baselines_fail_before_the_work_and_are_not_overwritten() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let bad = folder.file("bad.toml", "version = 1\npart = 3\n");
    let label = |more: &[&str]| {
        deepmill(
            &[&["label", &part, "--cutter", command::CUTTER, "--out", &out][..], more].concat(),
        )
    };
    for (more, code, expected) in [
        (&["--baseline", "nowhere.toml"][..], 1, "nowhere.toml: cannot be read"),
        (&["--baseline", &bad], 1, "bad.toml: line 2: "),
        (&["--write-baseline", &bad], 1, "bad.toml: line 2: "),
        (&["--write-baseline", &folder.path("")], 1, ""),
        (&["--baseline", &bad, "--write-baseline", &bad], 2, "--write-baseline"),
        (&["--volume", "5", "--baseline", &bad], 2, "--volume is given with --baseline"),
    ] {
        let message = failure(&label(more), code);
        assert!(message.contains(expected), "{more:?}: {message}");
        assert!(!std::path::Path::new(&out).exists(), "nothing is written");
    }
    assert_eq!(read(&bad), "version = 1\npart = 3\n");
}

#[test]
fn a_program_holds_an_outcome_against_a_baseline() {
    let folder = Folder::new();
    let run = |ch_mm: f64| {
        let part = cuboid(DVec3::new(40.0, 30.0, 20.0));
        let mut tool =
            Tool::new(format!("3,{ch_mm},20,20").parse().unwrap(), Some(0.0), 0.0).unwrap();
        tool.name = "D6".into();
        let analysis = Analysis::new("block", part, vec![tool]).n_sites(800);
        analysis.directions("up".parse().unwrap()).run(&mut ()).unwrap()
    };
    let path = std::path::PathBuf::from(folder.path("known.toml"));
    run(20.0).baseline("2026-01-31").unwrap().write(&path).unwrap();
    let known = Baseline::read(&path).unwrap();
    let mut outcome = run(25.0);
    let check = outcome.hold_against(&known);
    assert!(!check.is_broken() && check.gone.is_empty(), "{check:?}");
    assert!(outcome.findings().list.iter().all(|f| f.status == Some(FindingStatus::Known)));
    assert!(run(20.0).baseline("today").unwrap_err().to_string().contains("YEAR-MONTH-DAY"));
}
