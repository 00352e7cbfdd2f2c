//! A program that is killed at any moment and started again ends with the bytes of one that ran through.
#![cfg(feature = "cli")]

use deepmill::rng::{Purpose, Stream};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const KILLS: usize = 12;

fn deepmill(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_deepmill"));
    command.args(args).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Runs to the end; returns how long that took.
fn run(args: &[&str]) -> Duration {
    let start = Instant::now();
    let output = deepmill(args).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    start.elapsed()
}

/// Runs for at most `time`, then kills; whether it ended by itself before.
fn run_or_kill(args: &[&str], time: Duration) -> bool {
    let mut child = deepmill(args).spawn().unwrap();
    std::thread::sleep(time);
    let status = match child.try_wait().unwrap() {
        Some(status) => status,
        None => {
            child.kill().unwrap();
            child.wait().unwrap();
            return false;
        }
    };
    let output = child.wait_with_output().unwrap();
    assert!(status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    true
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().unwrap().to_owned()
}

/// All finished files under a folder; what a kill left beside them has a hidden name.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let hidden = path.file_name().unwrap().to_str().unwrap().starts_with('.');
        if path.is_dir() {
            found.extend(files(&path));
        } else if !hidden {
            found.push((path.clone(), fs::read(&path).unwrap()));
        }
    }
    found.sort();
    found
}

/// The history without its last column, the seconds.
fn history(run: &Path) -> Vec<String> {
    let text = fs::read_to_string(run.join("history.csv")).unwrap();
    text.lines().map(|line| line.rsplit_once(',').unwrap().0.to_owned()).collect()
}

#[test]
fn a_killed_training_run_resumes_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [data, whole, broken, config] =
        ["data", "whole", "broken", "config.toml"].map(|name| path(folder.path(), name));
    run(&[
        "dataset",
        "build",
        "--generated",
        "3",
        "--sites",
        "300",
        "--directions",
        "20",
        "--out",
        &data,
    ]);
    let common = ["train", "--data", &data, "--validate", &data, "--online"];
    let first = path(folder.path(), "settings");
    let preset = ["--preset", "tiny", "--epochs", "1", "--out", &first];
    run(&[&common[..], &preset].concat());
    let settings = fs::read_to_string(Path::new(&first).join("settings.toml")).unwrap();
    let often = settings.replace("evaluate_every = 1000000", "evaluate_every = 1");
    assert_ne!(often, settings);
    fs::write(&config, often).unwrap();
    let options = ["--config", &config, "--epochs", "12", "--batch-size", "2", "--out"];
    let fresh = |out| [&common[..], &options, &[out]].concat();
    let resumed = [&common[..], &["--resume", "--out", &broken]].concat();
    let time = run(&fresh(&whole));

    let (mut stream, mut kills) = (Stream::new(1, 0, 0, Purpose::Probe), 0);
    loop {
        let started = Path::new(&broken).join("checkpoint.safetensors").exists();
        let args = if started { resumed.clone() } else { fresh(&broken) };
        if kills == KILLS {
            run(&args);
            break;
        }
        if run_or_kill(&args, time.mul_f64(stream.unit())) {
            break;
        }
        kills += 1;
    }
    assert!(kills > 0, "it was killed at least once");
    for name in ["model.safetensors", "best.safetensors"] {
        let [a, b] = [&whole, &broken].map(|run| fs::read(Path::new(run).join(name)).unwrap());
        assert!(a == b, "{name} differs after {kills} kills");
    }
    assert_eq!(history(Path::new(&whole)), history(Path::new(&broken)));
}

#[test]
fn a_killed_build_of_a_data_set_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, broken] = ["whole", "broken"].map(|name| path(folder.path(), name));
    let common = ["dataset", "build", "--generated", "5", "--sites", "400", "--directions", "30"];
    let build = |out| [&common[..], &["--cutters", "2", "--out", out]].concat();
    let time = run(&build(&whole));
    let mut stream = Stream::new(2, 0, 0, Purpose::Probe);
    let finished = |_| run_or_kill(&build(&broken), time.mul_f64(stream.unit()));
    if !(0..KILLS).any(finished) {
        run(&build(&broken));
    }
    let relative = |folder: &str| -> Vec<(PathBuf, Vec<u8>)> {
        let files = files(Path::new(folder)).into_iter();
        files.map(|(p, bytes)| (p.strip_prefix(folder).unwrap().to_owned(), bytes)).collect()
    };
    assert!(relative(&whole) == relative(&broken));
}
