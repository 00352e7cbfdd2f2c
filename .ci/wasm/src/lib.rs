//! A hash of answers and of a trained network, to compare machines.

use deepmill::access::{LabelOptions, Labeler, surface::SurfaceOptions};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::data::Sample;
use deepmill::geom::{sites, solids};
use deepmill::glam::DVec3;
use deepmill::train::{Run, Settings};
use deepmill::{Result, par};
use std::sync::Arc;

/// FNV-1a over bytes.
struct Hash(u64);

impl Hash {
    fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
        }
    }
}

fn hash() -> Result<u64> {
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    let part = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
    let sites = sites::sample(&part, &sites::SiteOptions::default().with_n_sites(200))?;
    let cutter: CutterParams = "1.5,6,40,5".parse()?;
    let labelers = [
        Labeler::of_part(&part, &[], "hemisphere:40".parse()?, SurfaceOptions::default())?,
        Labeler::of_sites("hemisphere:40".parse()?, LabelOptions::published()),
    ];
    let mut answers = Vec::new();
    for labeler in &labelers {
        let answer = labeler.answer(&sites, &Cutter::ball_end(cutter)?)?;
        answer.inaccessible().iter().for_each(|is| hash.add(&[u8::from(*is)]));
        answer.accessible_directions().iter().for_each(|n| hash.add(&n.to_le_bytes()));
        answers.push(answer);
    }
    let sites = Arc::new(sites);
    let sample = |answers| Sample::new("block", Arc::clone(&sites), cutter, answers);
    let samples: Vec<Sample> = answers.into_iter().map(sample).collect();
    let mut run = Run::new(Settings::tiny().with_n_epochs(2))?;
    let _ = par::with_threads(0, || run.train(&samples[1..], &samples[1..], &mut ()))??;
    run.model.params.iter().for_each(|x| hash.add(&x.to_le_bytes()));
    Ok(hash.0)
}

/// The hash; 0 if something failed.
#[unsafe(no_mangle)]
pub extern "C" fn digest() -> u64 {
    hash().unwrap_or(0)
}
