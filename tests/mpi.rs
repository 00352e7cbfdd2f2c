//! Several processes under `mpirun`: the bytes of a single one, one error where something is wrong, whole checkpoints.

use deepmill::train::Checkpoint;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::Duration;
use tempfile::TempDir;

const PROGRAM: &str = env!("CARGO_BIN_EXE_deepmill");
const TRAIN: &str = "train --data data --out run --threads 1";

/// A folder to run in, with a data set of nine parts in `data`.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let place = Place(tempfile::tempdir().unwrap());
        place.succeed(1, &build("data", ""));
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// `n` processes with the words of `line`; a single one without `mpirun`.
    fn command(&self, n: usize, line: &str) -> Command {
        match n {
            1 => self.words(&format!("{PROGRAM} {line}")),
            n => self.mpirun(&format!("-n {n} {PROGRAM} {line}")),
        }
    }

    fn mpirun(&self, line: &str) -> Command {
        self.words(&format!("mpirun --allow-run-as-root --oversubscribe {line}"))
    }

    fn words(&self, line: &str) -> Command {
        let mut words = line.split_whitespace();
        let mut command = Command::new(words.next().unwrap());
        command.args(words).current_dir(self.0.path());
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn succeed(&self, n: usize, line: &str) -> String {
        let output = self.command(n, line).output().unwrap();
        assert!(output.status.success(), "{n} processes: {line}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    /// Networks, velocity and history but for its times.
    fn outcome(&self, run: &str) -> (Vec<Vec<u8>>, Vec<f32>, Vec<String>) {
        let run = self.path(run);
        let networks = ["model.safetensors", "best.safetensors"];
        let networks = networks.map(|name| fs::read(run.join(name)).unwrap()).into();
        let checkpoint = Checkpoint::read(&run.join("checkpoint.safetensors")).unwrap();
        let history = fs::read_to_string(run.join("history.csv")).unwrap();
        let history = history.lines().map(|line| line.rsplit_once(',').unwrap().0.to_owned());
        (networks, checkpoint.velocity, history.collect())
    }

    /// Starts a training in `run` and waits for its first checkpoint.
    fn start(&self, n: usize, line: &str) -> Child {
        let mut child = self.command(n, line).spawn().unwrap();
        let checkpoint = self.path("run/checkpoint.safetensors");
        while !checkpoint.exists() {
            assert!(child.try_wait().unwrap().is_none(), "it ended before its first checkpoint");
            sleep(Duration::from_millis(10));
        }
        child
    }
}

fn build(out: &str, more: &str) -> String {
    format!("dataset build --generated 9 --sites 80 --directions 10 --seed 3 --out {out} {more}")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The program's only error; what the launcher says besides has no such beginning. The exit code is the program's: one
/// that the MPI library makes up is a failure inside of it.
fn error(output: &Output) -> String {
    let stderr = text(&output.stderr);
    assert!(matches!(output.status.code(), Some(1 | 2)), "{}: {stderr}", output.status);
    assert!(!stderr.contains("panicked") && !stderr.contains("MPI_"), "{stderr}");
    let errors: Vec<&str> = stderr.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{stderr}");
    errors[0].to_owned()
}

/// All files under a folder with their names in it; locks have hidden names.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = PathBuf::from(path.file_name().unwrap());
        match path.is_dir() {
            _ if name.to_string_lossy().starts_with('.') => {}
            true => found.extend(files(&path).into_iter().map(|(p, b)| (name.join(p), b))),
            false => found.push((name, fs::read(&path).unwrap())),
        }
    }
    found.sort();
    found
}

#[test]
fn any_number_of_processes_trains_the_same_bytes() {
    let place = Place::new();
    let train = |out: &str, threads: usize| {
        format!(
            "train --data data --validate data --out {out} --preset tiny --epochs 2 --batch-size 9 \
             --groups 8 --online --threads {threads}"
        )
    };
    place.succeed(1, &train("alone", 1));
    let expected = place.outcome("alone");
    for (n, threads) in [(2, 1), (3, 2), (4, 1), (8, 1)] {
        let out = format!("run-{n}");
        place.succeed(n, &train(&out, threads));
        assert!(place.outcome(&out) == expected, "{n} processes with {threads} threads");
    }
    let other = train("other", 1).replace("--groups 8", "--groups 1");
    place.succeed(1, &other);
    assert!(place.outcome("other") != expected, "groups are normalized by themselves");
    let message = error(&place.command(3, &other.replace("other", "few")).output().unwrap());
    assert!(message.contains("number of processes is 3, expected at most 1"), "{message}");
}

#[test]
fn a_training_that_lost_a_process_goes_on_with_another_number_of_them() {
    let place = Place::new();
    let options = "--preset tiny --epochs 15 --batch-size 3 --groups 3";
    place.succeed(1, &format!("{TRAIN} {options}").replace("--out run", "--out alone"));
    let mut child = place.start(3, &format!("{TRAIN} {options}"));
    let children = place.words(&format!("pgrep -P {} deepmill", child.id())).output().unwrap();
    let children = text(&children.stdout);
    let last = children.lines().last().unwrap();
    assert!(Command::new("kill").args(["-KILL", last]).status().unwrap().success());
    assert!(!child.wait().unwrap().success());
    let epochs_done = place.outcome("run").2.len() - 1;
    assert!(epochs_done < 15, "it was killed before its end");
    place.succeed(2, &format!("{TRAIN} --resume"));
    assert!(place.outcome("run") == place.outcome("alone"), "resumed after {epochs_done} epochs");
}

#[cfg(unix)]
#[test]
fn an_interrupted_training_ends_with_a_whole_checkpoint() {
    let place = Place::new();
    let options = "--preset tiny --epochs 100000 --batch-size 4 --groups 2";
    let child = place.start(2, &format!("{TRAIN} {options}"));
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert!(!output.status.success());
    Checkpoint::read(&place.path("run/checkpoint.safetensors")).unwrap();
}

#[test]
fn shards_and_processes_build_the_bytes_of_one() {
    let place = Place::new();
    let expected = files(&place.path("data"));
    assert!(expected.len() > 18);
    place.succeed(3, &build("together", ""));
    assert!(files(&place.path("together")) == expected);
    let told = place.succeed(1, &build("shards", "--shard 1/2"));
    assert!(told.contains("5 of 9 parts are missing"), "{told}");
    place.succeed(2, &build("shards", "--shard 0/2"));
    assert!(files(&place.path("shards")) == expected);
}

#[test]
fn processes_score_what_one_scores() {
    let place = Place::new();
    place.succeed(1, &format!("{TRAIN} --preset tiny --epochs 1"));
    let eval = "eval --model run/best.safetensors --data data --exact --verify 0.2 --json";
    let scores = |n| {
        let mut scores: serde_json::Value = serde_json::from_str(&place.succeed(n, eval)).unwrap();
        for table in ["per_sample", "pooled", "by_area"] {
            for row in scores[table].as_array_mut().unwrap() {
                row["seconds_per_sample"] = 0.0.into();
            }
        }
        scores
    };
    assert_eq!(scores(1), scores(2));
    let message = error(&place.command(2, &eval.replace("best", "worst")).output().unwrap());
    assert!(message.contains("process 0 of 2: run/worst.safetensors: cannot be read"), "{message}");
}

#[test]
fn what_differs_between_processes_is_told_once() {
    let place = Place::new();
    let train = format!("{TRAIN} --preset tiny --epochs 1 --groups 2");
    let other_program = place.path("deepmill");
    fs::write(&other_program, [fs::read(PROGRAM).unwrap(), vec![0]].concat()).unwrap();
    fs::set_permissions(&other_program, fs::metadata(PROGRAM).unwrap().permissions()).unwrap();
    let [empty, other] = ["empty", "other"].map(|name| place.path(name));
    [&empty, &other].into_iter().for_each(|folder| fs::create_dir(folder).unwrap());
    place.succeed(1, &build("other/data", "--cutters 2"));
    let [empty, other] = [empty, other].map(|path| path.display().to_string());
    let second = |words: String| {
        let line = format!("-n 1 {PROGRAM} {train} : -n 1 {words}");
        error(&place.mpirun(&line).output().unwrap())
    };
    for (words, expected) in [
        (format!("{PROGRAM} {train} --lr 0.5"), "command line is train"),
        (format!("{} {train}", other_program.display()), "version of the program is 0."),
        (format!("-wdir {empty} {PROGRAM} {train}"), "manifest.json: cannot be read"),
        (format!("-wdir {other} {PROGRAM} {train}"), "data is "),
    ] {
        let message = second(words);
        assert!(message.starts_with("error: process 1 of 2: "), "{message}");
        assert!(message.contains(expected) && message.contains("; "), "{message}");
    }
    assert!(!place.path("run/checkpoint.safetensors").exists());
}

#[test]
fn a_run_folder_that_cannot_be_written_ends_all() {
    let place = Place::new();
    fs::write(place.path("run"), "a file").unwrap();
    let output = place.command(2, &format!("{TRAIN} --preset tiny --groups 2")).output().unwrap();
    let message = error(&output);
    assert!(message.starts_with("error: process 0 of 2: run: folder: it is a file"), "{message}");
}
