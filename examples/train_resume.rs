//! Train on parts made and labeled here, stop in the middle, go on, and end with the same bits.
//!
//! `cargo run --release --example train_resume -- FOLDER` (without a folder: in a temporary one).
#![allow(clippy::print_stdout)]

use deepmill::access::{LabelOptions, Obstacles, label};
use deepmill::cutter::{Cutter, CutterSet};
use deepmill::data::{Sample, generated};
use deepmill::directions::Directions;
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::rng::{Purpose, Stream};
use deepmill::train::{EpochRow, Observer, Run, RunFolder, Settings};
use std::ops::ControlFlow;
use std::path::PathBuf;

fn main() -> deepmill::Result<()> {
    let temporary = std::env::temp_dir().join(format!("deepmill-{}", std::process::id()));
    let root = std::env::args().nth(1).map_or(temporary, PathBuf::from);
    let samples = (0..4).map(labeled).collect::<deepmill::Result<Vec<_>>>()?;
    let settings = Settings::tiny().with_n_epochs(4).with_seed(7);

    let folder = RunFolder::new(root.join("stopped"));
    let mut run = folder.start(settings.clone())?;
    let flow = folder.train(&mut run, &samples[..3], &samples[3..], &mut Show { stop_after: 2 })?;
    println!("stopped: {}", flow.is_break());
    let mut run = folder.resume()?;
    assert!(
        folder
            .train(&mut run, &samples[..3], &samples[3..], &mut Show { stop_after: u64::MAX })?
            .is_continue()
    );

    let whole = RunFolder::new(root.join("whole"));
    let mut other = whole.start(settings)?;
    assert!(whole.train(&mut other, &samples[..3], &samples[3..], &mut ())?.is_continue());
    assert_eq!(run.model.params, other.model.params, "a resumed run ends with the same bits");
    println!("the same bits as a run that was not stopped: {}", folder.model().display());
    Ok(())
}

/// Prints each epoch, and stops after one of them.
struct Show {
    stop_after: u64,
}

impl Observer for Show {
    fn epoch(&mut self, _: &Run, row: &EpochRow) -> deepmill::Result<ControlFlow<()>> {
        println!("{row}");
        Ok(if row.epoch == self.stop_after {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        })
    }
}

/// A generated part with a random cutter and its exact labels.
fn labeled(index: u64) -> deepmill::Result<Sample> {
    let options = SiteOptions::default().with_n_sites(400);
    let sites = sample(&generated::mixed_part(1, index), &options)?;
    let params = CutterSet::Uniform.draw(&mut Stream::new(1, 0, index, Purpose::Cutter));
    let (cutter, directions) = (Cutter::ball_end(params)?, Directions::fibonacci_hemisphere(50)?);
    let options = LabelOptions::default();
    let labels = label(&sites, Obstacles::Queries, &cutter, &directions, &options)?;
    Ok(Sample::new(format!("part {index}"), sites.into(), params, labels.answers))
}
