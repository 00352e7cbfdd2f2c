//! Limits of the system and of other programs: little memory, a full disk, folders that cannot be written or that another program
//! writes. Every command says so in one line, and what was written before stays as it was.
#![cfg(all(feature = "cli", target_os = "linux"))]

mod command;

use command::{CUTTER, Folder, deepmill, failure, text};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// The program under limits of the shell, `before` it: `ulimit -v 1000000`.
fn limited(before: &str, args: &[&str]) -> Output {
    let script = format!("{before} && exec \"$@\"");
    let program = env!("CARGO_BIN_EXE_deepmill");
    Command::new("sh").args(["-c", &script, "sh", program]).args(args).output().unwrap()
}

/// 700 MB of address space.
const LITTLE: &str = "ulimit -v 700000";

/// Names and bytes of all files that are not hidden.
fn files(folder: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(path.to_str().unwrap()));
        } else if !path.file_name().unwrap().to_str().unwrap().starts_with('.') {
            found.push((path.clone(), std::fs::read(&path).unwrap()));
        }
    }
    found.sort();
    found
}

#[test]
fn what_does_not_fit_into_the_address_space_is_refused_with_numbers() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let tools = folder.file("t.csv", "name,CR,CH,FR,FH\na,1.5,6,40,5\nb,1,6,20,5\n");
    let (million, many, sites) = ("1000000", "2000", folder.path("sites.ply"));
    let label = ["label", &part, "--out", &out, "--no-picture"];
    let one = ["--cutter", CUTTER, "--directions", million, "--sites", many];
    let most = ["--directions", million, "--out", &out];
    let setups = ["setups", &part, "--tools", &tools, "--machine", "5-axis:90", "--clampings"];
    for (args, what) in [
        ([&label[..], &one].concat(), "labeling against triangles needs about 7"),
        ([&label[..], &one, &["--obstacles", "sites"]].concat(), "labeling needs about 7"),
        (
            [&["tools", &part, "--library", &tools, "--sites", many], &most[..]].concat(),
            "tools needs about 8",
        ),
        ([&setups[..], &["any"], &most].concat(), "the tool axes of setups needs about 3"),
        (
            [&["dataset", "build", &part, "--sites", many], &most[..]].concat(),
            "labeling needs about 7",
        ),
        (
            vec!["sample", &part, "--out", &sites, "--sites", "10000000"],
            "sampling the sites needs about 5",
        ),
    ] {
        let message = failure(&limited(LITTLE, &args), 1);
        assert!(message.contains(what), "{args:?}: {message}");
        assert!(message.contains("bytes, the limit is "), "{message}");
    }
    assert!(!Path::new(&out).join("labels.npz").exists());
    let small = [&label[..], &["--cutter", CUTTER, "--sites", "100"]].concat();
    let output = limited(LITTLE, &small);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn a_device_without_an_end_is_no_input() {
    let folder = Folder::new();
    let out = folder.path("out");
    let endless = |name: &str| {
        std::os::unix::fs::symlink("/dev/zero", folder.path(name)).unwrap();
        folder.path(name)
    };
    let [tools, settings] = ["t.csv", "s.toml"].map(endless);
    let part = folder.block();
    for args in [
        &["label", &part, "--tools", &tools, "--out", &out][..],
        &["train", "--data", "none", "--out", &out, "--config", &settings],
    ] {
        let message = failure(&limited(LITTLE, args), 1);
        assert!(message.contains("size: more than that, at most 67108864 are read"), "{message}");
    }
}

/// Commands that write into a folder or a file `out`.
fn writing_commands<'a>(
    part: &'a str,
    data: &'a str,
    result: &'a str,
    out: &'a str,
) -> Vec<Vec<&'a str>> {
    let few = ["--sites", "200", "--directions", "9"];
    let cutter = ["--cutter", CUTTER];
    vec![
        [&["label", part, "--no-picture", "--out", out], &few[..], &cutter].concat(),
        [&["predict", part, "--far", "--no-picture", "--out", out], &few[..2], &cutter[..]]
            .concat(),
        [&["dataset", "build", part, "--out", out], &few[..]].concat(),
        vec!["dataset", "export", data, "--out", out],
        vec!["train", "--data", data, "--out", out, "--preset", "tiny", "--epochs", "1"],
        vec!["generate", "--count", "1", "--out", out],
        vec!["report", result, "--out", out],
    ]
}

#[test]
fn a_full_disk_is_an_error_and_leaves_what_was_there() {
    let folder = Folder::new();
    let part = folder.block();
    let [data, result, old] = ["data", "result", "old"].map(|name| folder.path(name));
    let few = ["--sites", "200", "--directions", "9"];
    let build = [&["dataset", "build", &part, "--out", &data], &few[..]].concat();
    assert!(deepmill(&build).status.success());
    let label =
        ["label", &part, "--cutter", CUTTER, "--out", &result, "--sites", "200", "--no-picture"];
    assert!(deepmill(&label).status.success());
    // Files of a kilobyte at most; the signal that comes with longer ones is ignored.
    let full = "trap '' XFSZ; ulimit -f 1";
    for args in writing_commands(&part, &data, &result, &old) {
        let _ = std::fs::remove_dir_all(&old);
        let output = deepmill(&args);
        assert!(output.status.success(), "{args:?}: {}", text(&output.stderr));
        if args[0] == "train" || args[0] == "dataset" {
            // These go on or refuse where something is: another folder then.
            std::fs::remove_dir_all(&old).unwrap();
        }
        let before = if Path::new(&old).exists() { files(&old) } else { Vec::new() };
        let output = limited(full, &args);
        let message = failure(&output, 1);
        assert!(message.contains("cannot be written: "), "{args:?}: {message}");
        let after = if Path::new(&old).exists() { files(&old) } else { Vec::new() };
        for (path, bytes) in &before {
            let found = after.iter().find(|(p, _)| p == path);
            assert!(found.is_some_and(|(_, b)| b == bytes), "{args:?}: {}", path.display());
        }
        let whole = |(_, bytes): &(PathBuf, Vec<u8>)| bytes.len() <= 1024;
        assert!(!before.is_empty() || after.iter().all(whole), "{args:?}");
    }
    for stream in ["check", "sample"] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_deepmill"));
        let sites = folder.path("sites.ply");
        let args: &[&str] = match stream {
            "check" => &["check", &part, "--json"],
            _ => &["sample", &part, "--out", &sites, "--sites", "50"],
        };
        let device = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let output = command.args(args).stdout(Stdio::from(device)).output().unwrap();
        let message = failure(&output, 1);
        assert!(message.contains("standard output: cannot be written: "), "{message}");
    }
}

#[test]
fn two_programs_do_not_write_into_one_folder() {
    use deepmill::folder_lock::FolderLock;
    let folder = Folder::new();
    let part = folder.block();
    let [data, run, study] = ["data", "run", "study"].map(|name| folder.path(name));
    let build = ["dataset", "build", &part, "--out", &data, "--sites", "80", "--directions", "5"];
    let train = ["train", "--data", &data, "--out", &run, "--preset", "tiny", "--epochs", "1"];
    let study_of = ["reproduce", "length", "--parts-count", "2", "--out", &study];
    assert!(deepmill(&build).status.success());
    for (args, out) in [(&build[..], &data), (&train[..], &run), (&study_of[..], &study)] {
        let lock = FolderLock::whole(Path::new(out)).unwrap();
        let before = files(out);
        let message = failure(&deepmill(args), 1);
        let process = format!("{out}: lock: process {} is writing into it", std::process::id());
        assert!(message.contains(&process), "{args:?}: {message}");
        assert!(files(out) == before);
        drop(lock);
    }
    assert!(deepmill(&train).status.success());
    // A program that was killed leaves its file, which does not block.
    std::fs::write(Path::new(&run).join(".deepmill.lock"), "1\n").unwrap();
    let resume = [&train[..3], &["--out", &run, "--resume"]].concat();
    assert!(deepmill(&resume).status.success());
}

/// Runs the program as somebody who owns nothing where root does, who may write everywhere.
#[test]
fn a_folder_that_is_read_only_is_told_before_the_work() {
    use std::os::unix::{fs::PermissionsExt, process::CommandExt};
    const NOBODY: u32 = 65534;
    let folder = Folder::new();
    let part = folder.block();
    let [data, result, locked] = ["data", "result", "locked"].map(|name| folder.path(name));
    let few = ["--sites", "200", "--directions", "9"];
    assert!(
        deepmill(&[&["dataset", "build", &part, "--out", &data], &few[..]].concat())
            .status
            .success()
    );
    let label = ["label", &part, "--cutter", CUTTER, "--out", &result, "--no-picture"];
    assert!(deepmill(&[&label[..], &few].concat()).status.success());
    std::fs::create_dir(&locked).unwrap();
    let allow = |path: &str, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    allow(&locked, 0o555);
    let is_root = std::fs::write(Path::new(&locked).join("probe"), "").is_ok();
    let run = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_deepmill"));
        if is_root {
            command.uid(NOBODY).gid(NOBODY);
        }
        command.args(args).output()
    };
    allow(&folder.path("."), 0o755);
    if is_root && !run(&["check", &part]).is_ok_and(|output| output.status.success()) {
        return; // Nobody but root can run the program or read the folder of the test.
    }
    let out = Path::new(&locked).join("out");
    for args in writing_commands(&part, &data, &result, out.to_str().unwrap()) {
        let message = failure(&run(&args).unwrap(), 1);
        let is_told = message.contains("cannot be written: ") && message.contains("ermission");
        assert!(is_told, "{args:?}: {message}");
    }
}
