//! Folders of outcomes with some bytes of their records changed, under right checksums: refused in one line, or read,
//! written again and then equal to what was read. The first byte chooses the command.
#![no_main]

mod scratch;

use deepmill::Result;
use deepmill::analysis::{
    Analysis, Files, Fixture, Outcome, PredictRequest, PredictionsOutcome, SetupRequest,
    SetupsOutcome, ToolsOutcome, Vise,
};
use deepmill::cutter::{Assembly, Profile, Section};
use deepmill::data::files::tools::Tool;
use deepmill::geom::solids;
use deepmill::model::{Model, Predictor, UNetConfig};
use glam::DVec3;
use libfuzzer_sys::fuzz_target;
use scratch::Entries;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Of each command the folder, its record, and the entries of that.
static WHOLE: LazyLock<[(PathBuf, &str, Entries); 4]> = LazyLock::new(|| {
    let block = || solids::cuboid(DVec3::new(20.0, 15.0, 10.0));
    let ball = || Tool::new("1,6,5,10".parse().expect("four lengths"), None, 0.0).expect("a ball");
    let profile = Profile::lollipop(4.0, 1.5).expect("a lollipop");
    let assembly = Assembly::from_profile(profile, &[Section::cylinder(10.0, 8.0)], 20.0);
    let words = "lollipop of 4 mm".into();
    let lollipop = Tool::of_assembly("lollipop", assembly.expect("a holder"), 0.0, words);
    let tools = vec![ball(), lollipop.expect("a tool")];
    let mut clamp = solids::cuboid(DVec3::splat(3.0));
    clamp.vertices.iter_mut().for_each(|v| *v += DVec3::new(1.0, -4.0, 10.1));
    let clamp = Fixture::new("clamp", clamp);
    let of = |tools: Vec<Tool>| {
        let analysis = Analysis::new("block", block(), tools).n_sites(12);
        analysis.directions("5".parse().expect("a number"))
    };
    let held = of(tools.clone()).fixture(clamp).table(-1.0);
    let folders = ["label", "tools", "setups", "predict"].map(scratch::path);
    let files = Files::default();
    let written = |written: Result<Vec<PathBuf>>| {
        written.expect("a folder");
    };
    let labeled = held.clone().run(&mut ()).expect("labels");
    written(labeled.write(&folders[0], &files, &mut ()));
    let placed = || held.clone().place(&mut ()).expect("sites");
    let reach = placed().reach(0.95, &mut ()).expect("a library");
    written(reach.write(&folders[1], &files, &mut ()));
    let vise = Vise::new([30.0, 20.0, 4.0], 0.0).expect("a vise");
    let request = SetupRequest::on("3-axis".parse().expect("a machine")).vise(vise);
    let plan = placed().plan(request.n_directions(10), &mut ()).expect("setups");
    written(plan.write(&folders[2], &files, &mut ()));
    let network = Predictor::new(Model::new(&UNetConfig::tiny(), 1).expect("a preset"));
    let request = PredictRequest::new(network, "tiny").verify(0.2);
    let placed = of(vec![ball()]).place(&mut ()).expect("sites");
    let predicted = placed.predict(&request, &mut ()).expect("predictions");
    written(predicted.write(&folders[3], &files, &mut ()));
    let records = ["outcome.npz", "tools.npz", "setups.npz", "predicted.npz"];
    let mut both = folders.into_iter().zip(records).map(|(folder, record)| {
        let entries = scratch::entries(&folder.join(record));
        (folder, record, entries)
    });
    std::array::from_fn(|_| both.next().expect("four commands"))
});

/// Reads a folder, writes it again, and compares what is read of both.
fn read_and_written<T: PartialEq>(
    folder: &Path,
    read: impl Fn(&Path) -> Result<T>,
    write: impl Fn(&T, &Path) -> Result<Vec<PathBuf>>,
) {
    let Some(outcome) = scratch::assert_one_line(read(folder)) else { return };
    let again = scratch::path("again");
    if scratch::assert_one_line(write(&outcome, &again)).is_some() {
        let read = read(&again).unwrap();
        // A number that is NaN differs from itself.
        let has_nan = outcome != outcome;
        assert!(has_nan || read == outcome);
    }
}

fuzz_target!(|input: &[u8]| {
    let Some((kind, changes)) = input.split_first() else { return };
    let kind = usize::from(kind % 4);
    let (folder, record, entries) = &WHOLE[kind];
    std::fs::write(folder.join(record), scratch::archive(entries, changes)).unwrap();
    let files = Files::default();
    match kind {
        0 => read_and_written(folder, Outcome::read, |of, to| of.write(to, &files, &mut ())),
        1 => read_and_written(folder, ToolsOutcome::read, |of, to| of.write(to, &files, &mut ())),
        2 => read_and_written(folder, SetupsOutcome::read, |of, to| of.write(to, &files, &mut ())),
        _ => {
            let write = |of: &PredictionsOutcome, to: &Path| of.write(to, &files, &mut ());
            read_and_written(folder, PredictionsOutcome::read, write);
        }
    }
});
