//! Claims about runs, alone and on several processes.

use super::*;
use crate::answers::SiteAnswers;
use crate::exec::processes::tests::Threads;
use crate::geom::Sites;
use crate::numeric::rng::{Purpose, Stream};
use glam::Vec3;

/// Parts of different size, labeled by a plane.
fn samples(n: u64) -> Vec<Sample> {
    let sample = |i: u64| {
        let mut stream = Stream::new(3, 0, i, Purpose::Probe);
        let mut unit = || Vec3::from_array([0; 3].map(|_| stream.range(-1.0, 1.0) as f32));
        let points: Vec<Vec3> = (0..30 + 7 * i).map(|_| unit() * 40.0).collect();
        let normals = points.iter().map(|_| (unit() + Vec3::Z).normalize()).collect();
        let labels: Vec<bool> = points.iter().map(|p| p.x > 20.0).collect();
        Sample {
            surface: None,
            name: format!("sample {i}"),
            sites: Sites { points, normals, faces: Vec::new() }.into(),
            cutter: [1.5, 6.0, 40.0, 5.0].into(),
            answers: SiteAnswers::new(labels.clone(), labels),
        }
    };
    (0..n).map(sample).collect()
}

#[test]
fn a_run_begins_with_weights_of_another_number_of_coarse_directions_but_of_no_other_network() {
    let coarse = |n| {
        let mut settings = settings();
        settings.network.octree_mut().unwrap().input.coarse_directions = n;
        settings
    };
    let weights = |n| Run::new(Settings { seed: 9, ..coarse(n) }).unwrap().model;
    let mut run = Run::new(coarse(32)).unwrap();
    run.start_from(weights(600)).unwrap();
    assert_eq!(run.model.params, weights(32).params);
    assert_eq!(run.model.net.config(), coarse(32).network);
    assert!(run.start_from(weights(0)).is_err());
    assert!(Run::new(coarse(0)).unwrap().start_from(weights(600)).is_err());
}

fn settings() -> Settings {
    let mut settings =
        Settings { n_epochs: 2, batch_size: 9, n_groups: 4, evaluate_every: 1, ..Settings::tiny() };
    settings.loss.positive_weights = Some([2.0, 5.0]);
    settings
}

/// Everything that a run ends with, but its seconds.
fn outcome(run: Run) -> (Vec<f32>, Vec<f32>, Vec<f32>, Progress) {
    let mut progress = run.progress;
    progress.history.iter_mut().for_each(|row| row.seconds = 0.0);
    (run.model.params, run.model.buffers, run.velocity, progress)
}

fn trained(settings: &Settings, samples: &[Sample], processes: &dyn Processes) -> Run {
    let mut run = Run::new(settings.clone()).unwrap();
    let flow = run.train_together(samples, &samples[..5], &mut (), processes).unwrap();
    assert!(flow.is_continue());
    run
}

#[test]
fn any_number_of_processes_ends_with_the_same_bits() {
    let samples = samples(12);
    for (clip_norm, sizes) in [(Some(0.5), 2..=4), (None, 3..=3)] {
        let settings = Settings { clip_norm, ..settings() };
        let expected = outcome(trained(&settings, &samples, &SingleProcess));
        for size in sizes {
            let found = Threads::run(size, |p| outcome(trained(&settings, &samples, p)));
            assert!(found.iter().all(|found| *found == expected), "{size} processes");
        }
    }
}

#[test]
fn more_processes_than_groups_are_refused_by_one() {
    let samples = samples(3);
    let found = Threads::run(5, |p| {
        let mut run = Run::new(settings()).unwrap();
        run.train_together(&samples[..], &[], &mut (), p).unwrap_err().to_string()
    });
    let expected = "process 0 of 5: number of processes is 5, expected at most 3, one for each";
    assert!(found[0].starts_with(expected), "{}", found[0]);
    assert!(found[1..].iter().all(|message| message.starts_with("process 0 failed")));
}

#[test]
fn a_sample_that_one_process_cannot_use_ends_all() {
    let mut samples = samples(9);
    samples[8].answers.occlusion.pop();
    let found = Threads::run(2, |p| {
        let mut run = Run::new(settings()).unwrap();
        run.train_together(&samples[..], &[], &mut (), p).unwrap_err().to_string()
    });
    let named = |message: &String| message.contains("of 2: sample sample 8: 85 occlusion for 86");
    assert_eq!(found.iter().filter(|message| named(message)).count(), 1, "{found:?}");
}

#[cfg(feature = "formats")]
#[test]
fn a_run_begun_by_one_process_goes_on_in_all() {
    let samples = samples(9);
    let run = Run::new(settings()).unwrap();
    let whole = outcome(trained(&settings(), &samples, &SingleProcess));
    let first = &run.checkpoint();
    let found = Threads::run(3, |p| {
        let own = (p.rank() == 0).then(|| Run::resume(first.clone()));
        let mut run = Run::share(own, p).unwrap();
        let flow = run.train_together(&samples[..], &samples[..5], &mut (), p).unwrap();
        assert!(flow.is_continue());
        outcome(run)
    });
    assert!(found.iter().all(|found| *found == whole));
}
