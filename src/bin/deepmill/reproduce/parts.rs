//! Parts, their sites, and labeled samples of them.

use super::Args;
use super::study::{SEED, Study};
use crate::dataset::mesh_files;
use crate::mesh_args::Accept;
use crate::output::Output;
use deepmill::access::{LabelOptions, Labeler};
use deepmill::cutter::{Cutter, CutterParams, CutterSet};
use deepmill::data::{Sample, generated};
use deepmill::directions::Directions;
use deepmill::geom::formats::MeshOrCloud;
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::{Mesh, Sites};
use deepmill::rng::{Purpose, Stream};
use deepmill::{Error, Result, par};
use std::sync::Arc;

/// Parts that are labeled at a time, between two looks at Ctrl-C.
const AT_ONCE: usize = 4;

/// One part.
pub struct Part {
    pub name: String,
    pub mesh: Mesh,
}

impl Part {
    /// Near-uniform sites, always the same.
    pub fn sites(&self, n_sites: usize) -> Result<Sites> {
        sample(&self.mesh, &SiteOptions { n_sites, seed: SEED, ..SiteOptions::default() })
    }
}

/// Generated parts; the families take turns.
pub fn generate(n: u64) -> Vec<Part> {
    par::map(n as usize, |i| {
        let name = format!("{}-{i:04}", generated::family_of(i as u64).name());
        Part { name, mesh: generated::mixed_part(SEED, i as u64) }
    })
}

/// The user's meshes, in the order of their names.
pub fn read(args: &Args, output: &Output) -> Result<Vec<Part>> {
    let mut parts = Vec::new();
    for path in &args.parts {
        for file in mesh_files(path)? {
            let MeshOrCloud::Mesh(mesh) = args.mesh.read_part(&file, Accept::Bodies, output)?
            else {
                let remedy = "experiments need meshes";
                return Err(Error::file(file, "file", "it is a cloud of points", remedy));
            };
            let stem = file.file_stem().unwrap_or_default();
            parts.push(Part { name: stem.to_string_lossy().into_owned(), mesh });
        }
    }
    match parts.len() {
        0 | 1 => {
            let remedy = "one part is for training, another for testing";
            Err(Error::argument("--parts", parts.len(), "two meshes or more", remedy))
        }
        _ => Ok(parts),
    }
}

/// Which cutters a part is labeled with.
pub struct Draw<'a> {
    /// Sets that take turns.
    pub sets: &'a [CutterSet],
    /// Cutters for each part.
    pub n_cutters: usize,
}

impl Draw<'_> {
    /// Cutter `k` of part `index`: the same whichever sets stand beside its own.
    fn cutter(&self, index: usize, k: usize) -> CutterParams {
        let set = self.sets[k % self.sets.len()];
        let mut stream = Stream::new(SEED, k as u64, index as u64, Purpose::Cutter);
        set.draw(&mut stream)
    }
}

/// Labels of the published definition for every part and cutter.
pub fn samples(
    study: &Study,
    parts: &[Part],
    draw: &Draw,
    directions: &Directions,
) -> Result<Vec<Sample>> {
    let labeler = Labeler::of_sites(directions.clone(), LabelOptions::default());
    let bar = study.bar(parts.len(), "parts labeled");
    let mut samples = Vec::new();
    for start in (0..parts.len()).step_by(AT_ONCE) {
        study.go_on()?;
        let n = AT_ONCE.min(parts.len() - start);
        let labeled = par::map(n, |k| of_part(study, &parts[start + k], start + k, draw, &labeler));
        for part in labeled {
            samples.extend(part?);
        }
        bar.inc(n as u64);
    }
    bar.finish_and_clear();
    Ok(samples)
}

fn of_part(
    study: &Study,
    part: &Part,
    index: usize,
    draw: &Draw,
    labeler: &Labeler,
) -> Result<Vec<Sample>> {
    let sites = Arc::new(part.sites(study.args.sites)?);
    let sample = |k| {
        let cutter = draw.cutter(index, k);
        let answers = labeler.answer(&sites, &Cutter::ball_end(cutter)?)?;
        Ok(Sample { name: part.name.clone(), sites: Arc::clone(&sites), cutter, answers })
    };
    (0..draw.n_cutters).map(sample).collect()
}
