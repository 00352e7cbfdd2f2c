//! Labeled samples of parts, with cutters drawn from sets.

use super::parts::{Part, SEED};
use super::study::Study;
use deepmill::access::Labeler;
use deepmill::access::surface::SurfaceOptions;
use deepmill::cutter::{Cutter, CutterParams, CutterSet};
use deepmill::data::Sample;
use deepmill::directions::Directions;
use deepmill::geom::Sites;
use deepmill::rng::{Purpose, Stream};
use deepmill::{Result, par};
use std::sync::Arc;

/// Parts that are labeled at a time, between two looks at Ctrl-C.
const AT_ONCE: usize = 4;

/// Which cutters a part is labeled with.
pub struct Draw<'a> {
    /// Sets that take turns.
    pub sets: &'a [CutterSet],
    /// Cutters for each part.
    pub n_cutters: usize,
}

impl Draw<'_> {
    /// Cutter `k` of part `index`: the same whichever sets stand beside its own.
    pub fn cutter(&self, index: usize, k: usize) -> CutterParams {
        let set = self.sets[k % self.sets.len()];
        let mut stream = Stream::new(SEED, k as u64, index as u64, Purpose::Cutter);
        set.draw(&mut stream)
    }
}

/// Labels by one labeler for every part and cutter, with any number of sites.
pub fn labeled(
    study: &Study,
    parts: &[Part],
    draw: &Draw,
    labeler: &Labeler,
    n_sites: usize,
) -> Result<Vec<Sample>> {
    for_parts(study, parts, |part, index| {
        of_part(part, &Arc::new(part.sites(n_sites)?), index, draw, labeler)
    })
}

/// Labels by the mesh definition, with the search between the directions, for every part and cutter.
pub fn samples_of_part_itself(
    study: &Study,
    parts: &[Part],
    draw: &Draw,
    directions: &Directions,
) -> Result<Vec<Sample>> {
    for_parts(study, parts, |part, index| {
        let options = SurfaceOptions::default();
        let labeler = Labeler::of_part(&part.mesh, &[], directions.clone(), options)?;
        of_part(part, &Arc::new(part.sites(study.args.sites)?), index, draw, &labeler)
    })
}

/// The samples of every part, one part after the other; `label` is given a part and its number.
pub fn for_parts(
    study: &Study,
    parts: &[Part],
    label: impl Fn(&Part, usize) -> Result<Vec<Sample>> + Sync,
) -> Result<Vec<Sample>> {
    let bar = study.bar(parts.len(), "parts labeled");
    let mut samples = Vec::new();
    for start in (0..parts.len()).step_by(AT_ONCE) {
        study.go_on()?;
        let n = AT_ONCE.min(parts.len() - start);
        let labeled = par::map(n, |k| label(&parts[start + k], start + k));
        for part in labeled {
            samples.extend(part?);
        }
        bar.inc(n as u64);
    }
    bar.finish_and_clear();
    Ok(samples)
}

/// Share of the sites, or points, that are inaccessible: mean over the samples.
pub fn inaccessible_share(samples: &[Sample]) -> f64 {
    let of = |s: &Sample| s.answers.n_inaccessible() as f64 / s.answers.len().max(1) as f64;
    samples.iter().map(of).sum::<f64>() / samples.len().max(1) as f64
}

fn of_part(
    part: &Part,
    sites: &Arc<Sites>,
    index: usize,
    draw: &Draw,
    labeler: &Labeler,
) -> Result<Vec<Sample>> {
    let sample = |k| {
        let cutter = draw.cutter(index, k);
        let answers = labeler.answer(sites, &Cutter::ball_end(cutter)?)?;
        Ok(Sample::new(part.name.clone(), Arc::clone(sites), cutter, answers))
    };
    (0..draw.n_cutters).map(sample).collect()
}
