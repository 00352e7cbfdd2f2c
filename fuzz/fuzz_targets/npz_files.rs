//! Whole files of labels, predictions, labeled parts and volumes with some bytes of their arrays changed, under right
//! checksums: refused in one line, or read and the same after being written again. The first byte chooses the kind.
#![no_main]

mod scratch;

use deepmill::access::Labeler;
use deepmill::access::surface::{SurfaceOptions, Verified};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::data::dataset::LabeledPart;
use deepmill::data::files::{LabelFile, PredictionFile, Provenance};
use deepmill::directions::Directions;
use deepmill::geom::{sites, solids};
use deepmill::model::{Model, UNetConfig};
use glam::DVec3;
use libfuzzer_sys::fuzz_target;
use scratch::Entries;
use std::sync::LazyLock;

/// The entries of one whole file of each kind.
static WHOLE: LazyLock<[Entries; 3]> = LazyLock::new(|| {
    let mesh = solids::cuboid(DVec3::new(4.0, 3.0, 2.0));
    let options = sites::SiteOptions::default().with_n_sites(12);
    let sites = sites::sample(&mesh, &options).expect("a box");
    let params = CutterParams::from_array([1.0, 2.0, 3.0, 4.0]);
    let cutter = Cutter::ball_end(params).expect("ordered lengths");
    let directions = Directions::fibonacci_hemisphere(5).expect("some directions");
    let labeler = Labeler::of_part(&mesh, &[], directions, SurfaceOptions::default());
    let labels = labeler.and_then(|l| l.label(&sites, &cutter)).expect("labels of a box");
    let provenance = || Provenance::ball_end("box", params, Default::default());
    let model = Model::<f32>::new(&UNetConfig::tiny(), 1).expect("a preset");
    let prediction = model.predict(&sites.points, &sites.normals, params.to_array());
    let part = LabeledPart {
        sites: sites.clone(),
        surface: Some(sites.clone()),
        cutters: vec![params; 2],
        answers: vec![labels.answers.clone(); 2],
    };
    let labels = LabelFile::new(provenance(), sites.clone(), labels);
    let prediction = prediction.expect("a prediction");
    let (n, network) = (sites.len(), prediction.answers().network().cloned());
    let answers = labels.labels.answers.clone().with_network(network.expect("probabilities"));
    let mut verified = Verified::default();
    (verified.answers, verified.verified) = (answers, vec![true; n]);
    (verified.beta, verified.counted) = (vec![0; n], vec![false; n]);
    let mut prediction = PredictionFile::new(provenance(), sites, prediction);
    (prediction.occlusion_share, prediction.verified) = (Some(0.1), Some(verified));
    let path = scratch::file("whole.npz", &[]);
    let entries = || scratch::entries(&path);
    labels.write(&path).unwrap();
    let labels = entries();
    prediction.write(&path).unwrap();
    let prediction = entries();
    part.write(&path).unwrap();
    [labels, prediction, entries()]
});

fuzz_target!(|input: &[u8]| {
    let Some((kind, changes)) = input.split_first() else { return };
    let kind = usize::from(kind % 3);
    let entries = &WHOLE[kind];
    let path = scratch::file("changed.npz", &scratch::archive(entries, changes));
    // NaN differs from itself: what is written again is compared as bytes.
    let twice = |write: &dyn Fn()| {
        write();
        std::fs::read(&path).unwrap()
    };
    match kind {
        0 => {
            let Some(file) = scratch::assert_one_line(LabelFile::read(&path)) else { return };
            let first = twice(&|| file.write(&path).unwrap());
            let again = LabelFile::read(&path).unwrap();
            assert!(twice(&|| again.write(&path).unwrap()) == first);
        }
        1 => {
            let Some(file) = scratch::assert_one_line(PredictionFile::read(&path)) else { return };
            let first = twice(&|| file.write(&path).unwrap());
            let again = PredictionFile::read(&path).unwrap();
            assert!(twice(&|| again.write(&path).unwrap()) == first);
        }
        _ => {
            let Some(part) = scratch::assert_one_line(LabeledPart::read(&path)) else { return };
            if scratch::assert_one_line(part.write(&path)).is_some() {
                let first = std::fs::read(&path).unwrap();
                let again = LabeledPart::read(&path).unwrap();
                assert!(twice(&|| again.write(&path).unwrap()) == first);
            }
        }
    }
});
