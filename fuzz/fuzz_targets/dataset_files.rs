//! A data set of one part with some bytes of its manifest changed: refused in one line, or read without a panic.
#![no_main]

mod scratch;

use deepmill::answers::SiteAnswers;
use deepmill::data::Sample;
use deepmill::data::dataset::{Dataset, DatasetSettings, ImportedSample, Split, import};
use deepmill::geom::Sites;
use glam::Vec3;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static MANIFEST: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let points = (0..6).map(|i| Vec3::new(i as f32, (i % 2) as f32, 0.0)).collect();
    let sites = Sites::new(points, vec![Vec3::Z; 6]).expect("finite points");
    let answers = SiteAnswers::new(vec![true; 6], vec![false; 6]);
    let sample = Sample::new("part", sites.into(), [1.5, 6.0, 40.0, 5.0].into(), answers);
    let settings = DatasetSettings::default().with_n_sites(6).with_min_edge_mm(None);
    let path = scratch::file("set/any", &[]);
    let folder = path.parent().expect("a folder");
    let sample = ImportedSample::new(Split::Train, sample, 1.0);
    import(folder, settings, &[sample]).expect("a data set");
    std::fs::read(folder.join("manifest.json")).expect("its manifest")
});

fuzz_target!(|input: &[u8]| {
    let path = scratch::file("set/manifest.json", &scratch::changed(&MANIFEST, input));
    let Some(set) = scratch::assert_one_line(Dataset::open(path.parent().expect("a folder")))
    else {
        return;
    };
    for split in [None, Some(Split::Train), Some(Split::Validation)] {
        if let Some(samples) = scratch::assert_one_line(set.samples(split)) {
            assert!(samples.iter().all(|sample| sample.check().is_ok()));
        }
    }
    scratch::assert_one_line(set.manifest.settings.check());
});
