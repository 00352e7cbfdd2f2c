//! Networks learn: one overfits two parts, and an interrupted run ends with the same bits.
#![cfg(feature = "generate")]

use deepmill::access::{LabelOptions, Obstacles, label};
use deepmill::cutter::{Cutter, CutterParams};
use deepmill::data::generated::{Family, part};
use deepmill::data::{Augment, Sample};
use deepmill::directions::Directions;
use deepmill::geom::sites::{SiteOptions, sample};
use deepmill::optim::Schedule;
#[cfg(feature = "formats")]
use deepmill::train::{Observer, StepReport};
use deepmill::train::{Run, Settings, evaluate};
#[cfg(feature = "formats")]
use std::ops::ControlFlow;
use std::sync::Arc;

fn sample_of(family: Family, n_sites: usize, cutter: [f64; 4]) -> Sample {
    let mesh = part(family, 3, 1);
    let sites = sample(&mesh, &SiteOptions::default().with_n_sites(n_sites).with_seed(1)).unwrap();
    let params = CutterParams::from_array(cutter);
    let tool = Cutter::ball_end(params).unwrap();
    let directions = Directions::fibonacci_hemisphere(60).unwrap();
    let labels =
        label(&sites, Obstacles::Queries, &tool, &directions, &LabelOptions::default()).unwrap();
    Sample::new(family.name(), Arc::new(sites), params, labels.answers)
}

fn two_parts(n_sites: usize) -> Vec<Sample> {
    vec![
        sample_of(Family::ALL[0], n_sites, [1.5, 6.0, 40.0, 5.0]),
        sample_of(Family::ALL[1], n_sites, [1.0, 3.0, 20.0, 8.0]),
    ]
}

#[test]
fn a_small_network_overfits_two_parts() {
    let samples = two_parts(2000);
    let mut settings = Settings::tiny()
        .with_n_epochs(220)
        .with_batch_size(2)
        .with_schedule(Schedule::Cosine { min_lr: 1e-3 })
        .with_augment(Augment::default())
        .with_weight_decay(0.0);
    settings.network.octree_mut().unwrap().input.depth = 5;
    let mut run = Run::new(settings).unwrap();
    assert!(run.train(&samples[..], &samples, &mut ()).unwrap().is_continue());
    let evaluation = evaluate(&run.model, &samples).unwrap();
    for head in 0..2 {
        let score = evaluation.head(head).pooled;
        assert!(score.accuracy >= 0.98, "head {head}: {score:?}");
    }
    let history = &run.progress.history;
    assert_eq!(history.len(), 220);
    assert!(history[219].loss < 0.1 * history[0].loss);
}

/// Stops after a number of steps.
#[cfg(feature = "formats")]
struct StopAfter(usize);

#[cfg(feature = "formats")]
impl Observer for StopAfter {
    fn step(&mut self, _: &StepReport) -> ControlFlow<()> {
        self.0 -= 1;
        if self.0 == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[cfg(feature = "formats")]
#[test]
fn a_run_interrupted_anywhere_ends_with_the_same_bits() {
    use deepmill::train::Checkpoint;
    let samples: Vec<Sample> = (0..5)
        .map(|i| sample_of(Family::ALL[i], 300, [1.0 + 0.1 * i as f64, 4.0, 30.0, 5.0]))
        .collect();
    let settings = Settings::tiny().with_n_epochs(3).with_batch_size(2);
    let mut whole = Run::new(settings.clone()).unwrap();
    assert!(whole.train(&samples[..], &[], &mut ()).unwrap().is_continue());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    for stop in [1, 3, 4, 8] {
        let mut run = Run::new(settings.clone()).unwrap();
        assert_eq!(
            run.train(&samples[..], &[], &mut StopAfter(stop)).unwrap(),
            ControlFlow::Break(())
        );
        run.checkpoint().write(&path).unwrap();
        let mut resumed = Run::resume(Checkpoint::read(&path).unwrap()).unwrap();
        assert_eq!(resumed.train(&samples[..], &[], &mut ()).unwrap(), ControlFlow::Continue(()));
        assert_eq!(bits(&resumed.model.params), bits(&whole.model.params), "stopped after {stop}");
        assert_eq!(bits(&resumed.model.buffers), bits(&whole.model.buffers));
        assert_eq!(bits(&resumed.velocity), bits(&whole.velocity));
        let losses = |run: &Run| run.progress.history.iter().map(|r| r.loss).collect::<Vec<_>>();
        assert_eq!(losses(&resumed), losses(&whole));
    }
}

#[cfg(feature = "formats")]
#[test]
fn a_run_with_labels_made_on_the_fly_resumes_to_the_same_bits_and_needs_no_labels() {
    use deepmill::data::Online;
    use deepmill::train::Checkpoint;
    let mut samples = two_parts(300);
    samples.push(sample_of(Family::ALL[2], 300, [1.2, 4.0, 30.0, 5.0]));
    let settings = Settings::tiny()
        .with_n_epochs(3)
        .with_batch_size(2)
        .with_samples_per_epoch(Some(4))
        .with_online(Some(Default::default()));
    let directions = Directions::fibonacci_hemisphere(20).unwrap();
    let online = |samples: &[Sample]| {
        Online::new(
            samples,
            directions.clone(),
            LabelOptions::default(),
            Default::default(),
            settings.seed,
        )
        .unwrap()
    };
    let mut whole = Run::new(settings.clone()).unwrap();
    assert!(whole.train(&online(&samples), &[], &mut ()).unwrap().is_continue());
    for sample in &mut samples {
        let none = vec![false; sample.sites.len()];
        sample.answers = deepmill::answers::SiteAnswers::new(none.clone(), none);
    }
    let path = tempfile::tempdir().unwrap().path().join("checkpoint.safetensors");
    for stop in [1, 2, 5] {
        let mut run = Run::new(settings.clone()).unwrap();
        assert!(run.train(&online(&samples), &[], &mut StopAfter(stop)).unwrap().is_break());
        run.checkpoint().write(&path).unwrap();
        let mut resumed = Run::resume(Checkpoint::read(&path).unwrap()).unwrap();
        assert!(resumed.train(&online(&samples), &[], &mut ()).unwrap().is_continue());
        assert_eq!(bits(&resumed.model.params), bits(&whole.model.params), "stopped after {stop}");
    }
}

/// Better than what needs no network: the best threshold on the normal's angle, and the highest tenth.
#[cfg(feature = "weights")]
#[test]
fn the_shipped_network_beats_the_baselines_on_the_demo_part() {
    use deepmill::access::baselines;
    use deepmill::data::generated::demo_part;
    use deepmill::metrics::Confusion;
    use deepmill::model::Model;
    let options = SiteOptions::default().with_n_sites(7000).with_seed(1);
    let sites = sample(&demo_part(), &options).unwrap();
    let cutter = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]);
    let directions = Directions::fibonacci_hemisphere(150).unwrap();
    let tool = Cutter::ball_end(cutter).unwrap();
    let labels =
        label(&sites, Obstacles::Queries, &tool, &directions, &LabelOptions::default()).unwrap();
    let model = Model::shipped().unwrap();
    let answer = model.predict(&sites.points, &sites.normals, cutter.to_array()).unwrap().answers();
    let f1 = |found: &[bool], truth: &[bool]| Confusion::of_labels(found, truth).f1();
    let truth = &labels.answers.inaccessible();
    let min_z = baselines::best_facing(&sites.normals, truth);
    let angle = f1(&baselines::facing_away(&sites.normals, min_z), truth);
    let highest = f1(&baselines::highest(&sites.points, 0.1), labels.answers.occlusion());
    let found =
        [f1(&answer.inaccessible(), truth), f1(answer.occlusion(), labels.answers.occlusion())];
    assert!(found[0] > angle && found[1] > highest, "{found:?} against {angle} and {highest}");
}

#[cfg(feature = "formats")]
#[test]
fn a_damaged_checkpoint_is_refused_with_advice() {
    use deepmill::train::Checkpoint;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let run = Run::new(Settings::tiny()).unwrap();
    run.checkpoint().write(&path).unwrap();
    assert_eq!(Checkpoint::read(&path).unwrap(), run.checkpoint());
    let whole = std::fs::read(&path).unwrap();
    let mut flipped = whole.clone();
    *flipped.last_mut().unwrap() ^= 1;
    for damaged in [&flipped[..], &whole[..whole.len() - 5], &whole[..9], b""] {
        std::fs::write(&path, damaged).unwrap();
        let error = Checkpoint::read(&path).unwrap_err().to_string();
        assert!(error.contains("use the previous checkpoint"), "{error}");
    }
}

#[test]
fn a_loss_that_is_not_finite_names_epoch_batch_and_sample() {
    let samples = two_parts(200);
    let settings = Settings::tiny().with_lr(1e30).with_clip_norm(None).with_n_epochs(9);
    let mut run = Run::new(settings).unwrap();
    let error = run.train(&samples[..], &[], &mut ()).unwrap_err().to_string();
    assert!(error.starts_with("epoch ") && error.contains("batch 1: the loss is "), "{error}");
    assert!(error.contains(samples[0].name.as_str()), "{error}");
}

#[cfg(feature = "formats")]
fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}
