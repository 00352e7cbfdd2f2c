//! What `deepmill::analysis` promises: a program gets what the command writes, and may stop it.
#![cfg(all(feature = "cli", feature = "weights"))]

mod command;

use command::{Folder, block, deepmill, stl};
use deepmill::Error;
use deepmill::access::LabelOptions;
use deepmill::analysis::{
    Analysis, Files, Fixture, Outcome, PredictRequest, PredictionsOutcome, Progress, SetupRequest,
    SetupsOutcome, Stage, ToolsOutcome, VolumeOutcome,
};
use deepmill::cutter::{Assembly, Section};
use deepmill::data::files::settings::Blocking;
use deepmill::data::files::tools::Tool;
use deepmill::directions::Directions;
use deepmill::geom::Sites;
use deepmill::geom::formats::{MeshOrCloud, ReadOptions, read_mesh, read_part};
use deepmill::geom::selection::{Selection, Selector};
use deepmill::geom::sites::SiteOptions;
use deepmill::glam::{DVec3, Vec3};
use deepmill::model::{Model, Predictor};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Two blocks that meet: a step.
fn step(folder: &Folder) -> String {
    let low = block([0.0; 3], [40.0, 30.0, 10.0]);
    let high = block([0.0, 0.0, 10.0], [15.0, 30.0, 22.0]);
    let part = folder.file("low.stl", stl(&[low, high].concat()));
    let output = deepmill(&["check", &part, "--out", &folder.path("step.stl")]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    folder.path("step.stl")
}

fn flat(lengths: &str) -> Tool {
    Tool::new(lengths.parse().unwrap(), Some(0.0), 0.0).unwrap()
}

fn part(path: &str) -> MeshOrCloud {
    read_part(path.as_ref(), &ReadOptions::default()).unwrap()
}

/// Every file below a folder, by its path there.
fn bytes(folder: &str) -> BTreeMap<String, Vec<u8>> {
    fn add(root: &Path, at: &Path, all: &mut BTreeMap<String, Vec<u8>>) {
        for entry in std::fs::read_dir(at).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                add(root, &path, all);
            } else {
                let name = path.strip_prefix(root).unwrap().display().to_string();
                all.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    let mut all = BTreeMap::new();
    add(folder.as_ref(), folder.as_ref(), &mut all);
    all
}

/// `label` and the analysis write the same folders, from which the outcome is read back.
fn same(folder: &Folder, name: &str, analysis: Analysis, arguments: &[&str]) {
    let outcome = analysis.run(&mut ()).unwrap();
    let write = |to: &Path, files: &Files| outcome.write(to, files, &mut ()).unwrap();
    same_files(folder, name, &[&["label"], arguments].concat(), write);
    let by_command = folder.path(&format!("{name}-1"));
    let read = Outcome::read(by_command.as_ref()).unwrap();
    assert!(read == outcome, "{name}");
    let again = folder.path(&format!("{name}-3"));
    read.write(again.as_ref(), &files(arguments), &mut ()).unwrap();
    assert!(bytes(&again) == bytes(&by_command), "{name}");
}

/// The files that a command writes.
fn files(arguments: &[&str]) -> Files {
    let mut files = Files::shown(arguments.contains(&"--report"));
    files.pictures = !arguments.contains(&"--no-picture");
    files
}

/// A command and a program write the same folders.
fn same_files(
    folder: &Folder,
    name: &str,
    arguments: &[&str],
    write: impl FnOnce(&Path, &Files) -> Vec<PathBuf>,
) {
    let (by_command, by_program) =
        (folder.path(&format!("{name}-1")), folder.path(&format!("{name}-2")));
    let output = deepmill(&[arguments, &["--out", &by_command]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let paths = write(by_program.as_ref(), &files(arguments));
    let (command, program) = (bytes(&by_command), bytes(&by_program));
    assert_eq!(paths.len(), program.len(), "every file is named");
    assert_eq!(command.keys().collect::<Vec<_>>(), program.keys().collect::<Vec<_>>());
    for (name, bytes) in &command {
        assert!(bytes == &program[name], "{name}");
    }
}

#[test]
fn a_program_writes_what_the_command_writes() {
    let folder = Folder::new();
    let path = step(&folder);
    let path = path.as_str();
    let up: Directions = "up".parse().unwrap();
    let spread = SiteOptions::default().with_n_sites(300).with_seed(4);
    let of = |tools: Vec<Tool>| Analysis::new("step.stl", part(path), tools).spread(spread);
    let lengths = ["--cutter", "3,20,20,20", "--corner", "0", "--sites", "300", "--seed", "4"];
    let one = || vec![flat("3,20,20,20")];

    let analysis = of(one()).directions(up.clone());
    let more = ["--directions", "up", "--report"];
    same(&folder, "alone", analysis, &[&[path], &lengths[..], &more].concat());

    let vise = folder.file("vise.stl", stl(&block([-10.0, 0.0, 0.0], [0.0, 30.0, 8.0])));
    let mesh = read_mesh(vise.as_ref(), &ReadOptions::default()).unwrap();
    let two = vec![flat("3,20,20,20"), flat("6,20,20,20")];
    let analysis = of(two).fixture(Fixture::new("vise.stl", mesh)).table(-1.0);
    let more =
        ["--cutter", "6,20,20,20", "--fixture", &vise, "--table", "-1", "--no-picture", "--report"];
    same(&folder, "held", analysis, &[&[path], &lengths[..], &more].concat());

    let selector = Selector::Normal { direction: DVec3::Z, within_rad: 10f64.to_radians() };
    let selection = Selection::default().with_only(vec![selector]);
    let analysis = of(one()).region(selection, vec!["normal:0,0,1".into()], vec![]);
    let more = ["--only", "normal:0,0,1", "--no-picture"];
    same(&folder, "region", analysis, &[&[path], &lengths[..], &more].concat());

    for (text, blocking) in [
        ("published", Blocking::Points(None)),
        ("200", Blocking::Points(Some(200))),
        ("centroids", Blocking::Centroids),
    ] {
        let analysis = of(one()).obstacles(blocking).published(LabelOptions::published());
        let more = ["--obstacles", text, "--no-picture"];
        same(&folder, text, analysis, &[&[path], &lengths[..], &more].concat());
    }
}

#[test]
fn tools_setups_volumes_and_predictions_of_a_program_are_those_of_the_commands() {
    let folder = Folder::new();
    let path = step(&folder);
    let table = "name,CR,CH,FR,FH,corner\nF6,3,20,20,20,0\nF12,6,20,20,20,0\n";
    let library = folder.file("tools.csv", table);
    let tools = || vec![flat("3,20,20,20").named("F6"), flat("6,20,20,20").named("F12")];
    let spread = SiteOptions::default().with_n_sites(200);
    let of = |tools| Analysis::new("step.stl", part(&path), tools).spread(spread).library(true);

    let arguments = ["tools", &path, "--library", &library, "--sites", "200", "--table", "-1"];
    same_files(&folder, "tools", &arguments, |to, files| {
        let placed = of(tools()).table(-1.0).place(&mut ()).unwrap();
        placed.reach(0.95, &mut ()).unwrap().write(to, files, &mut ()).unwrap()
    });
    let read = ToolsOutcome::read(folder.path("tools-1").as_ref()).unwrap();
    assert!(read == of(tools()).table(-1.0).place(&mut ()).unwrap().reach(0.95, &mut ()).unwrap());

    let arguments = ["setups", &path, "--tools", &library, "--sites", "200", "--machine", "3-axis"];
    same_files(&folder, "setups", &[&arguments[..], &["--report"]].concat(), |to, files| {
        let request = SetupRequest::on("3-axis".parse().unwrap());
        let placed = of(tools()).place(&mut ()).unwrap();
        placed.plan(request, &mut ()).unwrap().write(to, files, &mut ()).unwrap()
    });
    let read = SetupsOutcome::read(folder.path("setups-1").as_ref()).unwrap();
    assert!(read == SetupsOutcome::read(folder.path("setups-2").as_ref()).unwrap());
    assert_eq!(read.setups().plan().setups.len(), 2);

    let lengths = ["--cutter", "3,20,20,20", "--corner", "0", "--volume", "4", "--table", "-1"];
    same_files(&folder, "volume", &[&["label", &path], &lengths[..]].concat(), |to, files| {
        let analysis = of(vec![flat("3,20,20,20")]).table(-1.0);
        analysis.volume(4.0, &mut ()).unwrap().write(to, files).unwrap()
    });
    let profile = "name,profile\nT,3:0 3:2 1:2 | 1:20\n";
    let library = folder.file("profile.csv", profile);
    let held = folder.file("holder.csv", "height,lower,upper\n30,20,20\n");
    let lengths = ["--tools", &library, "--holder", &held, "--stick-out", "20", "--volume", "4"];
    let t_slot = || {
        let profile = "3:0 3:2 1:2 | 1:20".parse().unwrap();
        let holder = [Section::cylinder(30.0, 10.0)];
        let held = Assembly::from_profile(profile, &holder, 20.0).unwrap();
        let words = "profile 6 mm, 20 mm out of holder".into();
        vec![Tool::of_assembly("T", held, 0.0, words).unwrap()]
    };
    let arguments = [&["label", &path], &lengths[..], &["--table", "-1"]].concat();
    same_files(&folder, "profile", &arguments, |to, files| {
        of(t_slot()).table(-1.0).volume(4.0, &mut ()).unwrap().write(to, files).unwrap()
    });
    let flat = of(vec![flat("3,20,20,20")]).table(-1.0).volume(4.0, &mut ()).unwrap();
    let profile = of(t_slot()).table(-1.0).volume(4.0, &mut ()).unwrap();
    assert_eq!(profile.notices().len(), 1 + flat.notices().len());
    for (name, outcome) in [("volume", flat), ("profile", profile)] {
        for of in 1..=2 {
            let folder = folder.path(&format!("{name}-{of}"));
            assert!(VolumeOutcome::read(folder.as_ref()).unwrap() == outcome, "{folder}");
        }
    }
}

#[test]
fn predictions_of_a_program_are_those_of_the_command() {
    let folder = Folder::new();
    let path = step(&folder);
    let lengths = ["--cutter", "1.5,6,40,5", "--far", "--sites", "400", "--report"];
    for verified in [false, true] {
        let more = if verified { &["--verify", "0.05"][..] } else { &[] };
        let arguments = [&["predict", &path], &lengths[..], more].concat();
        same_files(&folder, &format!("predict-{verified}"), &arguments, |to, files| {
            let ball = Tool::new("1.5,6,40,5".parse().unwrap(), None, 0.0).unwrap();
            let placed = Analysis::new("step.stl", part(&path), vec![ball])
                .n_sites(400)
                .place(&mut ())
                .unwrap();
            let predictor = Predictor::new(Model::shipped().unwrap()).allow_out_of_domain();
            let request = PredictRequest::new(predictor, "the network that comes with deepmill");
            let request = if verified { request.verify(0.05) } else { request };
            let outcome = placed.predict(&request, &mut ()).unwrap();
            let paths = outcome.write(to, files, &mut ()).unwrap();
            assert!(PredictionsOutcome::read(to).unwrap() == outcome, "verified: {verified}");
            paths
        });
    }
}

#[test]
fn a_cloud_has_no_triangles_for_tools_setups_and_verification() {
    let sites = Sites::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![Vec3::Z; 3]).unwrap();
    let ball = || vec![Tool::new("1.5,6,40,5".parse().unwrap(), None, 0.0).unwrap()];
    let of = || Analysis::new("cloud", MeshOrCloud::Cloud(sites.clone()), ball());
    let placed = || of().place(&mut ()).unwrap();
    let predictor = Predictor::new(Model::shipped().unwrap()).allow_out_of_domain();
    let request = PredictRequest::new(predictor, "n").verify(0.1);
    let machine = SetupRequest::on("3-axis".parse().unwrap());
    for (refused, expected) in [
        (placed().reach(0.95, &mut ()).map(drop), "triangles that block"),
        (placed().plan(machine, &mut ()).map(drop), "triangles that block"),
        (placed().predict(&request, &mut ()).map(drop), "given with a cloud of points"),
        (of().volume(1.0, &mut ()).map(drop), "a mesh and one tool"),
    ] {
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn work_that_is_stopped_says_so_and_leaves_whole_files() {
    let folder = Folder::new();
    let path = step(&folder);
    let of = || {
        let tools = vec![flat("3,20,20,20"), flat("6,20,20,20")];
        Analysis::new("step", part(&path), tools).n_sites(200).directions("up".parse().unwrap())
    };
    let mut seen: Vec<(Stage, usize, usize)> = Vec::new();
    let mut listen = |p: Progress| {
        seen.push((p.stage, p.done, p.of));
        ControlFlow::Continue(())
    };
    let outcome = of().run(&mut listen).unwrap();
    let whole = folder.path("whole");
    outcome.write(whole.as_ref(), &Files::default(), &mut listen).unwrap();
    assert!(seen.contains(&(Stage::Labels, 1, 2)) && seen.contains(&(Stage::Writing, 2, 2)));
    for pair in seen.windows(2) {
        assert!(pair[0].0 != pair[1].0 || pair[0].1 < pair[1].1, "it goes on: {pair:?}");
    }
    let whole = bytes(&whole);
    for stop_at in 0..seen.len() {
        let mut n = 0;
        let mut stop = |_: Progress| {
            n += 1;
            if n > stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let to = folder.path(&format!("stopped-{stop_at}"));
        std::fs::create_dir(&to).unwrap();
        let stopped = of()
            .run(&mut stop)
            .and_then(|outcome| outcome.write(to.as_ref(), &Files::default(), &mut stop).map(drop));
        assert!(matches!(stopped, Err(Error::Interrupted { .. })), "{stop_at}: {stopped:?}");
        assert!(bytes(&to).iter().all(|(name, bytes)| whole[name] == *bytes), "{stop_at}");
    }
}

#[test]
fn what_has_no_answer_is_refused() {
    let folder = Folder::new();
    let path = step(&folder);
    let message = |analysis: Analysis| analysis.n_sites(50).run(&mut ()).unwrap_err().to_string();
    let none = message(Analysis::new("step", part(&path), vec![]));
    assert!(none.contains("tools is none"), "{none}");
    let of = || Analysis::new("step", part(&path), vec![flat("3,20,20,20")]);
    let nowhere = Selector::Box { low: DVec3::splat(900.0), high: DVec3::splat(901.0) };
    let nowhere = Selection::default().with_only(vec![nowhere]);
    let empty = message(of().region(nowhere.clone(), vec![], vec![]));
    assert!(empty.contains("region is no face"), "{empty}");
    let points = message(of().obstacles(Blocking::Points(None)).region(nowhere, vec![], vec![]));
    assert!(points.contains("points as obstacles"), "{points}");
    let high = message(of().table(f64::NAN));
    assert!(high.contains("table is NaN"), "{high}");
    let mut open = read_mesh(path.as_ref(), &ReadOptions::default()).unwrap();
    open.vertices[0].x = f64::INFINITY;
    let far = message(of().fixture(Fixture::new("clamp.stl", open)));
    assert!(far.contains("clamp.stl: vertex 0"), "{far}");
}
