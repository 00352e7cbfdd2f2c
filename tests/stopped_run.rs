//! A training run that is stopped at any step, kept as a checkpoint and resumed.
#![cfg(feature = "formats")]

use deepmill::answers::SiteAnswers;
use deepmill::data::Sample;
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::geom::solids;
use deepmill::train::{Observer, Run, Settings, StepReport};
use glam::DVec3;
use std::ops::ControlFlow;

struct StopAfter(u64);

impl Observer for StopAfter {
    fn step(&mut self, _: &StepReport) -> ControlFlow<()> {
        self.0 -= 1;
        if self.0 == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[test]
fn a_run_stopped_at_any_step_goes_on_to_the_same_bits() {
    let samples: Vec<Sample> = (0..5)
        .map(|k| {
            let mesh = solids::cuboid(DVec3::new(8.0 + f64::from(k), 6.0, 4.0));
            let sites = sample(&mesh, &SiteOptions::default().with_n_sites(40)).unwrap();
            let up: Vec<bool> = sites.normals.iter().map(|n| n.z > 0.5).collect();
            let answers = SiteAnswers::new(up.clone(), up);
            Sample::new(format!("part {k}"), sites.into(), [1.5, 6.0, 40.0, 5.0].into(), answers)
        })
        .collect();
    let settings = Settings::tiny().with_n_epochs(3).with_batch_size(2);
    let mut whole = Run::new(settings.clone()).unwrap();
    assert!(whole.train(&samples[..], &samples[..1], &mut ()).unwrap().is_continue());
    let bits = |run: &Run| -> Vec<u32> {
        run.model.params.iter().chain(&run.velocity).map(|x| x.to_bits()).collect()
    };
    // Nine steps: three of up to two samples in each epoch.
    for stop in 1..9 {
        let mut run = Run::new(settings.clone()).unwrap();
        let stopped = run.train(&samples[..], &samples[..1], &mut StopAfter(stop)).unwrap();
        assert!(stopped.is_break(), "{stop}");
        let mut resumed = Run::resume(run.checkpoint()).unwrap();
        assert!(resumed.train(&samples[..], &samples[..1], &mut ()).unwrap().is_continue());
        assert!(bits(&resumed) == bits(&whole), "stopped after {stop}");
        let losses = |run: &Run| run.progress.history.iter().map(|r| r.loss).collect::<Vec<_>>();
        assert_eq!(losses(&resumed), losses(&whole));
    }
}
