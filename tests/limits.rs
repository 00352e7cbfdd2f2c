//! Limits of the system and of other programs: little memory, a full disk, folders that cannot be written or that
//! another program writes. Every command says so in one line, and what was written before stays as it was.
#![cfg(all(feature = "cli", target_os = "linux"))]

mod command;

use command::{CUTTER, Folder, deepmill, failure, text};
use deepmill::model::weights::{Storage, write};
use deepmill::model::{Model, UNetConfig};
use std::io::Write;
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
            [&label[..], &["--cutter", CUTTER, "--volume", "0.12"]].concat(),
            "classifying the points of a lattice needs about 1",
        ),
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
fn networks_beyond_the_memory_are_refused_with_numbers() {
    let folder = Folder::new();
    let (part, data, run) = (folder.block(), folder.path("data"), folder.path("run"));
    let build = ["dataset", "build", &part, "--sites", "2000", "--directions", "5", "--out", &data];
    require_success(&build);
    let wide = "stem_width = 16\nencoder_widths = [16, 900, 900]";
    let wide_at_fine_nodes = "stem_width = 2000\nencoder_widths = [16, 32, 48]";
    for (widths, what) in
        [(wide, "training needs about"), (wide_at_fine_nodes, "the training step needs about")]
    {
        let blocks = "encoder_blocks = [1, 1, 1]\ndecoder_blocks = [1, 1, 1]";
        let rest = "decoder_widths = [32, 32, 16]\nhead_width = 16\n[network.input]\ndepth = 6";
        let config = folder.file("wide.toml", format!("[network]\n{widths}\n{blocks}\n{rest}\n"));
        let train =
            ["train", "--data", &data, "--out", &run, "--preset", "tiny", "--config", &config];
        let message = failure(&limited(LITTLE, &train), 1);
        assert!(message.contains(what) && message.contains(", the limit is "), "{message}");
    }
    let mut config = UNetConfig::tiny();
    config.encoder_widths[2] = 520;
    let weights = folder.path("w.safetensors");
    let model = Model::<f32>::new(&config, 1).unwrap();
    write(Path::new(&weights), &model, Storage::Exact, "").unwrap();
    let half = folder.path("half.safetensors");
    let predict = ["predict", &part, "--cutter", CUTTER, "--out", &run, "--model", &weights];
    for args in [&predict[..], &["weights", &weights], &["weights", &weights, "--bf16", &half]] {
        // From too little for the file to enough for all.
        let outputs = (150..=450).step_by(50).map(|megabytes| {
            limited(&format!("ulimit -v {megabytes}000"), &[args, &["--threads", "1"]].concat())
        });
        let outputs: Vec<_> = outputs.collect();
        for output in outputs.iter().filter(|output| !output.status.success()) {
            let message = failure(output, 1);
            assert!(message.contains("needs about "), "{args:?}: {message}");
        }
        assert!(!outputs[0].status.success() && outputs[6].status.success(), "{args:?}");
    }
}

/// Pictures, pages and glTF files of clouds, whose sites are discs, and of fine meshes take more than the labels.
#[test]
fn pictures_and_files_beyond_the_memory_are_refused_with_numbers() {
    let folder = Folder::new();
    let (of_cloud, of_mesh) = (folder.path("cloud"), folder.path("mesh"));
    let n = 60_000;
    let header = format!("ply\nformat ascii 1.0\nelement vertex {n}\n");
    let properties = ["x", "y", "z", "nx", "ny", "nz"].map(|p| format!("property float {p}\n"));
    let point = |i: usize| format!("{} {} 0 0 0 1\n", i % 300, i / 300);
    let points: String = (0..n).map(point).collect();
    let cloud = folder.file("c.ply", header + &properties.concat() + "end_header\n" + &points);
    // A bent sheet of 300 × 300 vertices.
    let vertex = |i: usize| format!("v {} {} {}\n", i % 300, i / 300, (i % 300) * (i % 300) / 400);
    let quad = |i: usize| format!("f {} {} {} {}\n", i, i + 1, i + 301, i + 300);
    let vertices: String = (0..90_000).map(vertex).collect();
    let quads: String = (1..=89_700).filter(|i| i % 300 != 0).map(quad).collect();
    let mesh = folder.file("m.obj", vertices + &quads);
    for (part, out) in [(&cloud, &of_cloud), (&mesh, &of_mesh)] {
        let label = ["label", part, "--cutter", CUTTER, "--out", out, "--directions", "1"];
        let args = [&label[..], &["--no-picture", "--force", "--threads", "1"]].concat();
        require_success(&args);
        let label_gltf = [&args[..], &["--also", "glb"]].concat();
        let label_gltf =
            |megabytes: u32| limited(&format!("ulimit -v {megabytes}000"), &label_gltf);
        let report = |megabytes: u32| {
            let args = ["report", out, "--threads", "1"];
            limited(&format!("ulimit -v {megabytes}000"), &args)
        };
        let mut outputs: Vec<_> = (100..=400).step_by(50).map(report).collect();
        outputs.extend((150..=550).step_by(100).map(label_gltf));
        let refused = outputs.iter().filter(|output| !output.status.success());
        let refused: Vec<String> = refused.map(|output| failure(output, 1)).collect();
        assert!(refused.iter().all(|message| message.contains("needs about ")), "{refused:?}");
        // The file of a mesh takes more than its picture.
        let whats = match out == &of_cloud {
            true => &["the picture needs", "the glTF file needs"][..],
            false => &["reading the mesh needs"],
        };
        for what in whats {
            assert!(refused.iter().any(|message| message.contains(what)), "{refused:?}");
        }
        let are_enough = [&outputs[6], outputs.last().unwrap()];
        assert!(are_enough.iter().all(|output| output.status.success()), "{refused:?}");
    }
}

#[test]
fn a_device_without_an_end_is_no_input() {
    let folder = Folder::new();
    let out = folder.path("out");
    let endless = |name: &str| {
        std::os::unix::fs::symlink("/dev/zero", folder.path(name)).unwrap();
        folder.path(name)
    };
    let [tools, settings, mesh, cloud, weights] =
        ["t.csv", "s.toml", "m.stl", "c.ply", "w.safetensors"].map(endless);
    let part = folder.block();
    let predict = ["predict", &part, "--cutter", CUTTER, "--out", &out, "--model", &weights];
    for args in [
        &["label", &part, "--tools", &tools, "--out", &out][..],
        &["train", "--data", "none", "--out", &out, "--config", &settings],
        &["check", &mesh],
        &["label", &cloud, "--cutter", CUTTER, "--out", &out],
        &predict,
    ] {
        let message = failure(&limited(LITTLE, args), 1);
        assert!(message.contains("size: more than that, at most "), "{args:?}: {message}");
    }
}

/// A file of two bytes a number is eighty times as large in memory, or more.
#[test]
fn text_that_would_fill_the_memory_is_refused_before_it_is_read() {
    let folder = Folder::new();
    let (part, out) = (folder.block(), folder.path("out"));
    let numbers = |n| "0,".repeat(n);
    let tools = folder.file("t.json", format!("{{\"data\":[{}0]}}", numbers(20_000_000)));
    let settings = folder.file("s.toml", format!("seed = [{}0]", numbers(3_000_000)));
    let large = folder.file("l.toml", format!("seed = [{}0]", numbers(400_000)));
    let train = ["train", "--data", "none", "--out", &out, "--config"];
    for (args, what) in [
        (
            &["label", &part, "--tools", &tools, "--out", &out][..],
            "reading the file needs about 3200000",
        ),
        (&[&train[..], &[&settings]].concat(), "at most 1048576 are read"),
        (&[&train[..], &[&large]].concat(), "l.toml: line 1"),
    ] {
        let message = failure(&limited(LITTLE, args), 1);
        assert!(message.contains(what), "{args:?}: {message}");
    }
}

/// A megabyte that unpacks to a hundred.
#[test]
fn an_archive_is_as_large_as_what_it_unpacks_to() {
    let folder = Folder::new();
    let path = folder.path("part.3mf");
    let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    zip.start_file("3D/3dmodel.model", zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(b"<model><resources><object id=\"1\"><mesh><vertices>").unwrap();
    let vertices = "<vertex x=\"0\" y=\"0\" z=\"1\"/>".repeat(1000);
    (0..4000).for_each(|_| zip.write_all(vertices.as_bytes()).unwrap());
    zip.finish().unwrap();
    let message = failure(&limited(LITTLE, &["check", &path]), 1);
    assert!(message.contains("reading the mesh needs about "), "{message}");
    assert!(message.contains("part.3mf: export the part with fewer triangles"), "{message}");
}

/// Coinciding points are many neighbors of each other: none of the tables looks at all pairs.
#[test]
fn a_cloud_of_one_point_many_times_is_labeled() {
    let folder = Folder::new();
    let n = 200_000;
    let header = format!("ply\nformat ascii 1.0\nelement vertex {n}\n");
    let properties = ["x", "y", "z", "nx", "ny", "nz"].map(|p| format!("property float {p}\n"));
    let points = "1 1 1 0 0 1\n".repeat(n - 1) + "9 9 9 0 0 1\n";
    let text = header + &properties.concat() + "end_header\n" + &points;
    let (cloud, out) = (folder.file("same.ply", text), folder.path("out"));
    let label = ["label", &cloud, "--cutter", CUTTER, "--out", &out, "--directions", "5"];
    require_success(&[&label[..], &["--no-picture"]].concat());
}

/// What the commands read.
struct Inputs {
    part: String,
    tools: String,
    data: String,
    exported: String,
    result: String,
    model: String,
}

impl Inputs {
    fn new(folder: &Folder) -> Self {
        let path = |name| folder.path(name);
        let tools = folder.file("t.csv", "name,CR,CH,FR,FH\na,1.5,6,40,5\nb,1,6,20,5\n");
        let parts = path("parts");
        require_success(&["generate", "--count", "1", "--out", &parts]);
        let is_mesh = |path: &PathBuf| path.extension().is_some_and(|e| e == "stl");
        let part = files(&parts).into_iter().map(|(path, _)| path).find(is_mesh).unwrap();
        let part = part.to_str().unwrap().to_owned();
        let [data, exported, result, run] = ["data", "exported", "result", "run"].map(path);
        let few = ["--sites", "200", "--directions", "9"];
        require_success(&[&["dataset", "build", &part, "--out", &data], &few[..]].concat());
        require_success(&["dataset", "export", &data, "--out", &exported]);
        let label = ["label", &part, "--cutter", CUTTER, "--out", &result, "--no-picture"];
        require_success(&[&label[..], &few].concat());
        let train = ["train", "--data", &data, "--out", &run, "--preset", "tiny", "--epochs", "1"];
        require_success(&train);
        Inputs { part, tools, data, exported, result, model: format!("{run}/model.safetensors") }
    }
}

fn require_success(args: &[&str]) {
    let output = deepmill(args);
    assert!(output.status.success(), "{args:?}: {}", text(&output.stderr));
}

/// Every command that writes, into the folder `out` or files of it.
fn writing_commands(inputs: &Inputs, out: &str) -> Vec<Vec<String>> {
    let Inputs { part, tools, data, exported, result, model } = inputs;
    let few = "--sites 200 --directions 9";
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/parity");
    let commands = [
        format!("label {part} --no-picture --out {out} {few} --cutter {CUTTER}"),
        format!("predict {part} --far --no-picture --out {out} --sites 200 --cutter {CUTTER}"),
        format!("tools {part} --library {tools} --out {out} {few}"),
        format!("setups {part} --tools {tools} --machine 3-axis --out {out} {few}"),
        format!("dataset build {part} --out {out} {few}"),
        format!("dataset export {data} --out {out}"),
        format!("dataset import {exported} --out {out}"),
        format!("train --data {data} --out {out} --preset tiny --epochs 1"),
        format!("generate --count 1 --out {out}"),
        format!("report {result} --out {out}"),
        format!("explain {result} --site 0 --picture {out}/site.png"),
        format!("sample {part} --out {out}/sites.ply --sites 200"),
        format!("check {part} --out {out}/part.stl"),
        format!("weights {model} --bf16 {out}/half.safetensors"),
        format!("eval --data {data} --model {model} --reliability {out}/r.svg"),
        format!("gradcheck --layer relu --out {out}"),
        format!("parity {fixture} --out {out}/own.safetensors"),
        format!("reproduce length --parts-count 2 --sites 200 --out {out}"),
    ];
    let words = |command: &String| command.split(' ').map(str::to_owned).collect();
    commands.iter().map(words).collect()
}

fn words(args: &[String]) -> Vec<&str> {
    args.iter().map(String::as_str).collect()
}

#[test]
fn a_full_disk_is_an_error_and_leaves_what_was_there() {
    let folder = Folder::new();
    let inputs = Inputs::new(&folder);
    let (old, part) = (folder.path("old"), &inputs.part);
    // Files of a kilobyte at most; the signal that comes with longer ones is ignored.
    let full = "trap '' XFSZ; ulimit -f 1";
    for args in writing_commands(&inputs, &old) {
        let args = words(&args);
        let _ = std::fs::remove_dir_all(&old);
        require_success(&args);
        if ["train", "dataset", "reproduce"].contains(&args[0]) {
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
            "check" => &["check", part, "--json"],
            _ => &["sample", part, "--out", &sites, "--sites", "50"],
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
    let inputs = Inputs::new(&folder);
    let (part, locked) = (&inputs.part, folder.path("locked"));
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
    if is_root && !run(&["check", part]).is_ok_and(|output| output.status.success()) {
        return; // Nobody but root can run the program or read the folder of the test.
    }
    let out = Path::new(&locked).join("out");
    for args in writing_commands(&inputs, out.to_str().unwrap()) {
        let args = words(&args);
        let message = failure(&run(&args).unwrap(), 1);
        let is_told = message.contains("cannot be written: ") && message.contains("ermission");
        assert!(is_told, "{args:?}: {message}");
    }
}
