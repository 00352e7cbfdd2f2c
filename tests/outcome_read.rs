//! `Outcome::read` gives back what was written, whatever was requested, and names what is damaged.
#![cfg(all(feature = "formats", feature = "generate"))]

use deepmill::Result;
use deepmill::access::surface::{RefinementOptions, SurfaceOptions};
use deepmill::analysis::{
    Analysis, Files, Fixture, Outcome, PredictRequest, PredictionsOutcome, SetupRequest,
    SetupsOutcome, ToolsOutcome, Vise,
};
use deepmill::cutter::{Assembly, Profile, Section};
use deepmill::data::files::tools::Tool;
use deepmill::data::files::{LabelFile, machines};
use deepmill::data::npz::{NpzReader, NpzWriter};
use deepmill::directions::Directions;
use deepmill::geom::formats::{MeshOrCloud, ReadOptions, read_part};
use deepmill::geom::selection::{Selection, Selector};
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Mesh, solids};
use deepmill::glam::{DVec2, DVec3, Vec3};
use deepmill::model::{Model, Predictor, UNetConfig};
use deepmill::planning::setups::Clampings;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use zip::{ZipArchive, ZipWriter};

/// A slot of 12 mm, 14 mm deep, in a block.
fn slot() -> Mesh {
    let outline =
        [(0., 0.), (40., 0.), (40., 20.), (26., 20.), (26., 6.), (14., 6.), (14., 20.), (0., 20.)];
    let outline = outline.map(|(x, y)| DVec2::new(x, y));
    let faces = [[0, 1, 4], [0, 4, 5], [0, 5, 6], [0, 6, 7], [1, 2, 3], [1, 3, 4]];
    let mut part = solids::prism(&outline, &faces, 30.0);
    part.vertices.iter_mut().for_each(|v| *v = DVec3::new(v.x, -v.z, v.y)); // z is up
    part
}

fn ball() -> Tool {
    Tool::new("3,8,20,20".parse().unwrap(), None, 0.0).unwrap()
}

fn lollipop() -> Tool {
    let holder = [Section::cylinder(30.0, 20.0)];
    let profile = Profile::lollipop(8.0, 3.0).unwrap();
    let assembly = Assembly::from_profile(profile, &holder, 40.0).unwrap();
    Tool::of_assembly("lollipop \"8\"", assembly, 0.5, "lollipop of 8 mm".into()).unwrap()
}

/// Several tools, of any kind.
fn tools() -> Vec<Tool> {
    let flat = Tool::new("2,20,15,20".parse().unwrap(), Some(0.0), 0.25).unwrap();
    let flat = flat.named("T2: flat/end").with_allowance(0.1).unwrap();
    vec![ball(), flat.of_overall_length(60.0).unwrap(), lollipop()]
}

/// What is asked for in as many ways as there are.
fn analyses(folder: &Path) -> Vec<(&'static str, Analysis)> {
    let of = |tools: Vec<Tool>| Analysis::new("slot", slot(), tools).n_sites(300);
    let (options, proving) = (SurfaceOptions::default(), Some(RefinementOptions::proving()));
    let clamp = |at: f64| {
        let mut mesh = solids::cuboid(DVec3::splat(9.0));
        mesh.vertices.iter_mut().for_each(|v| *v += DVec3::new(at, -20.0, 20.1));
        Fixture::new(format!("clamp {at}.stl"), mesh)
    };
    let obj = folder.join("part.obj");
    std::fs::write(
        &obj,
        "v 0 0 0\nv 9 9 9\nv 20 0 0\nv 0 20 0\nv 0 0 20\nf 1 4 3\nf 1 3 5\nf 1 5 4\nf 3 4 5\n",
    )
    .unwrap();
    let MeshOrCloud::Mesh(pyramid) = read_part(&obj, &ReadOptions::default()).unwrap() else {
        panic!("a mesh")
    };
    let cloud = sample(&slot(), &SiteOptions::default().with_n_sites(200)).unwrap();
    let normal = Selector::Normal { direction: DVec3::Z, within_rad: 0.2 };
    let up = Selection::default().with_only(vec![normal]);
    let list: Directions = "list:0,0,1;0.6,0,0.8".parse().unwrap();
    vec![
        ("ball", of(vec![ball()])),
        ("folder of one", of(vec![ball()]).folders(true).library(true)),
        ("profile", of(vec![lollipop()]).directions(list.clone())),
        ("rest", of(tools()).rest(true).directions("up".parse().unwrap())),
        ("held", of(tools()).fixture(clamp(2.0)).fixture(clamp(29.0)).table(-2.0)),
        ("limit", of(vec![ball()]).options(options.with_clearance_limit_mm(Some(2.0)))),
        ("occlusion", of(vec![ball()]).options(options.with_occlusion(true))),
        ("no search", of(vec![ball()]).options(options.with_refinement(None))),
        ("proved", of(vec![ball()]).options(options.with_refinement(proving)).proving(true)),
        ("region", of(vec![ball()]).region(up.clone(), vec!["normal:0,0,1:11".into()], vec![])),
        ("corners of it", of(vec![ball()]).region(up, vec!["up".into()], vec![]).at_vertices(3)),
        ("vertices", Analysis::new("pyramid", pyramid, vec![ball()]).at_vertices(7)),
        (
            "cloud",
            Analysis::new("cloud", cloud, vec![ball()]).origin(Some(DVec3::new(1e5, 0.1, -0.3))),
        ),
        ("points", of(vec![ball()]).obstacles("150".to_string().try_into().unwrap())),
        ("centroids", of(vec![ball()]).obstacles("centroids".to_string().try_into().unwrap())),
    ]
}

#[test]
fn outcomes_are_read_back_equal_and_written_again_alike() {
    let folder = tempfile::tempdir().unwrap();
    for (name, analysis) in analyses(folder.path()) {
        let outcome = analysis.run(&mut ()).unwrap();
        let write = |of: &Outcome, to: &Path| of.write(to, &Files::default(), &mut ());
        let read = there_and_back((folder.path(), name), &outcome, Outcome::read, write);
        // An outcome of another request is another.
        let other = Analysis::new("other", slot(), vec![ball()]).n_sites(300).run(&mut ()).unwrap();
        assert!(read != other, "{name}");
    }
}

/// Writes an outcome, reads it back, which is equal, and writes that, which has the same bytes. Returns what was read.
fn there_and_back<T: PartialEq>(
    (folder, name): (&Path, &str),
    outcome: &T,
    read: impl Fn(&Path) -> Result<T>,
    write: impl Fn(&T, &Path) -> Result<Vec<PathBuf>>,
) -> T {
    let [first, second] = ["first", "second"].map(|which| folder.join(name).join(which));
    let paths = write(outcome, &first).unwrap();
    let read = read(&first).unwrap();
    assert!(read == *outcome, "{name}");
    let again = write(&read, &second).unwrap();
    for (a, b) in paths.iter().zip(&again) {
        let (first, second) = (std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
        assert!(first == second, "{name}: {}", a.display());
    }
    assert_eq!(paths.len(), again.len());
    read
}

#[test]
fn what_tools_reach_is_read_back_equal_and_written_again_alike() {
    let folder = tempfile::tempdir().unwrap();
    let kinds = ["folder of one", "held", "region", "corners of it", "no search", "rest"];
    let all = analyses(folder.path()).into_iter().filter(|(name, _)| kinds.contains(name));
    let mut n = 0;
    for (name, analysis) in all {
        n += 1;
        let outcome = analysis.place(&mut ()).unwrap().reach(0.9, &mut ()).unwrap();
        let write = |of: &ToolsOutcome, to: &Path| of.write(to, &Files::default(), &mut ());
        let read = there_and_back((folder.path(), name), &outcome, ToolsOutcome::read, write);
        assert_eq!(read.library().table().csv(), outcome.library().table().csv());
    }
    assert_eq!(n, kinds.len());
    let record = folder.path().join("held/first/tools.npz");
    require_every_entry(&record, |folder| ToolsOutcome::read(folder).map(drop));
    let message = ToolsOutcome::read(folder.path()).unwrap_err().to_string();
    assert!(message.contains("tools.npz: file: there is none"), "{message}");
    // A record of another kind.
    let held = folder.path().join("held/first");
    std::fs::copy(held.join("tools.npz"), held.join("setups.npz")).unwrap();
    let message = SetupsOutcome::read(&held).unwrap_err().to_string();
    assert!(message.contains("the format is \"deepmill tools\""), "{message}");
}

/// Setups on every kind of machine, and held in every way.
fn requests() -> Vec<(&'static str, SetupRequest)> {
    let on = |machine: &str| SetupRequest::on(machine.parse().unwrap()).n_directions(20);
    let file = |name: &str| {
        let path = format!("{}/docs/machines/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        SetupRequest::on(machines::read(path.as_ref()).unwrap()).n_directions(20)
    };
    let mut clamp = solids::cuboid(DVec3::splat(9.0));
    clamp.vertices.iter_mut().for_each(|v| *v += DVec3::new(2.0, -20.0, 20.1));
    let clamp = Fixture::new("clamp.stl", clamp);
    let vise = Vise::new([50.0, 45.0, 6.0], 3.0).unwrap();
    vec![
        ("3-axis", on("3-axis").share(0.95)),
        ("3+2", on("3+2:50").clampings(Clampings::Flat).at_most(1)),
        ("4-axis", on("4-axis:x:-30,90")),
        ("5-axis", on("5-axis:33.3")),
        ("strokes", file("three-axis")),
        ("trunnion", file("trunnion-ac")),
        ("head", file("head-b-table-c")),
        ("dividing head", file("rotary-table")),
        ("vise", on("3-axis").vise(vise).table_below(4.0, None)),
        ("given", on("3-axis").given(vec![Vec3::Z, Vec3::NEG_Z]).fixture_of(1, clamp)),
    ]
}

#[test]
fn setups_are_read_back_equal_and_written_again_alike() {
    let folder = tempfile::tempdir().unwrap();
    for (name, request) in requests() {
        let analysis = Analysis::new("slot", slot(), vec![ball(), lollipop()]).n_sites(300);
        let outcome = analysis.place(&mut ()).unwrap().plan(request, &mut ()).unwrap();
        let mut files = Files::default();
        files.report = true;
        let write = |of: &SetupsOutcome, to: &Path| of.write(to, &files, &mut ());
        let read = there_and_back((folder.path(), name), &outcome, SetupsOutcome::read, write);
        assert_eq!(
            (read.premise(), read.setups().json()),
            (outcome.premise(), outcome.setups().json())
        );
    }
    let record = folder.path().join("vise/first/setups.npz");
    require_every_entry(&record, |folder| SetupsOutcome::read(folder).map(drop));
    let record = folder.path().join("given/first/setups.npz");
    require_every_entry(&record, |folder| SetupsOutcome::read(folder).map(drop));
}

#[test]
fn predictions_are_read_back_equal_and_written_again_alike() {
    let folder = tempfile::tempdir().unwrap();
    let network = Predictor::new(Model::new(&UNetConfig::tiny(), 1).unwrap());
    let other = Tool::new("2,9,30,10".parse().unwrap(), None, 0.0).unwrap();
    let kinds = ["ball", "folder of one", "occlusion", "corners of it", "two"];
    let two = ("two", Analysis::new("slot", slot(), vec![ball(), other]).n_sites(300));
    let all = analyses(folder.path()).into_iter().chain([two]);
    let mut n = 0;
    for (name, analysis) in all.filter(|(name, _)| kinds.contains(name)) {
        n += 1;
        let request = PredictRequest::new(network.clone(), "tiny").occlusion_share(0.2);
        let request = if n % 2 == 0 { request.verify(0.1) } else { request };
        let outcome = analysis.place(&mut ()).unwrap().predict(&request, &mut ()).unwrap();
        let write = |of: &PredictionsOutcome, to: &Path| of.write(to, &Files::default(), &mut ());
        there_and_back((folder.path(), name), &outcome, PredictionsOutcome::read, write);
    }
    assert_eq!(n, kinds.len());
    let record = folder.path().join("two/first/predicted.npz");
    require_every_entry(&record, |folder| PredictionsOutcome::read(folder).map(drop));
    // Predictions of another tool.
    let [of_ball, of_other] = ["3-8-20-20", "2-9-30-10"]
        .map(|tool| folder.path().join("two/first").join(tool).join("predictions.npz"));
    std::fs::copy(of_other, of_ball).unwrap();
    let message =
        PredictionsOutcome::read(&folder.path().join("two/first")).unwrap_err().to_string();
    assert!(message.contains("another run"), "{message}");
}

/// Of a record, each array that is left out is named, and so is a file that ends too early.
fn require_every_entry(record: &Path, read: impl Fn(&Path) -> Result<()>) {
    let (whole, folder) = (std::fs::read(record).unwrap(), record.parent().unwrap());
    let is_of_triangles = !record.ends_with("predicted.npz");
    let message = |what: &str| {
        let error = read(folder).expect_err(what).to_string();
        assert!(error.contains(&record.display().to_string()), "{what}: {error}");
        error
    };
    for cut in [0, 30, whole.len() / 2, whole.len() - 10] {
        std::fs::write(record, &whole[..cut]).unwrap();
        message("cut");
    }
    let mut all = ZipArchive::new(Cursor::new(&whole)).unwrap();
    let names: Vec<String> = all.file_names().map(|name| name.unwrap().into_owned()).collect();
    for left_out in &names {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        for k in 0..all.len() {
            let entry = all.by_index_raw(k).unwrap();
            if entry.name().unwrap() != *left_out {
                archive.raw_copy_file(entry).unwrap();
            }
        }
        std::fs::write(record, archive.finish().unwrap().get_ref()).unwrap();
        match left_out.trim_end_matches(".npy") {
            // Those of a cloud, and of sites that are at no vertices.
            "vertices" if is_of_triangles => {
                assert!(message("the part").contains("without triangles"));
            }
            "vertices" => continue,
            "metadata.json" => assert!(message("metadata").contains("format is null")),
            name => assert!(message(name).contains(name), "{name}: {}", message(name)),
        }
    }
    std::fs::write(record, &whole).unwrap();
    read(folder).unwrap();
}

/// Writes the archive again without an array, or with other bytes in it.
fn damaged(path: &Path, name: &str, with: Option<&[u8]>) -> Vec<u8> {
    let mut npz = NpzReader::open(path).unwrap();
    let mut writer = NpzWriter::new();
    writer.metadata(&npz.metadata().unwrap());
    for array in ["outcome", "tool_0", "tool_1", "tool_2"] {
        let text: Vec<u8> = npz.counts(array).unwrap();
        match with {
            _ if array != name => writer.array(array, &[text.len()], &text),
            Some(bytes) => writer.array(array, &[bytes.len()], bytes),
            None => &mut writer,
        };
    }
    // The part, two clamps, and the table as the last fixture.
    for prefix in ["", "fixture_0_", "fixture_1_", "fixture_2_"] {
        let (vertices, triangles) = (format!("{prefix}vertices"), format!("{prefix}triangles"));
        let places = npz.f64s(&vertices, 3).unwrap();
        let corners: Vec<u32> = npz.count_rows(&triangles, 3).unwrap();
        let n = if vertices == name { 3 } else { places.len() };
        if with.is_some() || vertices != name {
            writer.array(&vertices, &[n / 3, 3], &places[..n]);
        }
        let n = if triangles == name { 3 } else { corners.len() };
        if with.is_some() || triangles != name {
            writer.array(&triangles, &[n / 3, 3], &corners[..n]);
        }
    }
    let other = path.with_file_name("other.npz");
    writer.write(&other).unwrap();
    std::fs::read(other).unwrap()
}

#[test]
fn damaged_records_are_named_and_nothing_of_another_run_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let (_, held) = analyses(folder.path()).into_iter().find(|(name, _)| *name == "held").unwrap();
    let outcome = held.clone().run(&mut ()).unwrap();
    let to = folder.path().join("held");
    let record = to.join("outcome.npz");
    let refused = |words: &str| {
        let message = Outcome::read(&to).unwrap_err().to_string();
        assert!(message.contains(words), "{words}: {message}");
    };
    refused("there is none");
    outcome.write(&to, &Files::default(), &mut ()).unwrap();
    let whole = std::fs::read(&record).unwrap();
    // As it was, through the same writer.
    std::fs::write(&record, damaged(&record, "none", None)).unwrap();
    assert!(Outcome::read(&to).unwrap() == outcome);

    for name in
        ["outcome", "tool_1", "vertices", "triangles", "fixture_1_vertices", "fixture_0_triangles"]
    {
        std::fs::write(&record, &whole).unwrap();
        std::fs::write(&record, damaged(&record, name, None)).unwrap();
        let (is_part, words) = (name == "vertices", format!("outcome.npz: {name}"));
        refused(if is_part { "another run than outcome.npz" } else { &words });
        std::fs::write(&record, &whole).unwrap();
        std::fs::write(&record, damaged(&record, name, Some(b"{\"request\": 1}"))).unwrap();
        let message = Outcome::read(&to).unwrap_err().to_string();
        assert!(message.contains("outcome.npz: ") || message.contains("another run"), "{message}");
    }
    for cut in [0, 30, whole.len() / 2, whole.len() - 10] {
        std::fs::write(&record, &whole[..cut]).unwrap();
        refused("outcome.npz");
    }
    // A folder's name may not lead out of the folder.
    let text: Vec<u8> = {
        std::fs::write(&record, &whole).unwrap();
        NpzReader::open(&record).unwrap().counts("outcome").unwrap()
    };
    let text = String::from_utf8(text).unwrap().replacen("\"3-8-20-20\"", "\"../3-8-20-20\"", 2);
    std::fs::write(&record, damaged(&record, "outcome", Some(text.as_bytes()))).unwrap();
    refused("folder is ../3-8-20-20");

    // Answers of another seed, and of a tool that was another.
    std::fs::write(&record, &whole).unwrap();
    let labels = to.join("3-8-20-20/labels.npz");
    let kept = std::fs::read(&labels).unwrap();
    let other = held.clone().spread(SiteOptions::default().with_n_sites(300).with_seed(9));
    let elsewhere = folder.path().join("elsewhere");
    other.run(&mut ()).unwrap().write(&elsewhere, &Files::default(), &mut ()).unwrap();
    std::fs::copy(elsewhere.join("3-8-20-20/labels.npz"), &labels).unwrap();
    refused("another run");
    std::fs::write(&labels, &kept).unwrap();
    let mut file = LabelFile::read(&labels).unwrap();
    file.provenance.cutter.cr_mm += 1.0;
    file.write(&labels).unwrap();
    refused("another run");
}
