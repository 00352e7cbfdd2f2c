//! The first losses of the published training: 43.3 million parameters, batch 128, cosine from 1.0.

use super::page::Page;
use super::parts::SEED;
use super::study::Study;
use super::trainings::{Trainings, hash, training_samples, trainings};
use deepmill::access::Labeler;
use deepmill::cutter::CutterSet;
use deepmill::data::Sample;
use deepmill::report::curves::{Chart, Series, write_curves};
use deepmill::tables::{Cell, Table};
use deepmill::train::{Observer, Run, Settings, StepReport};
use deepmill::{Error, Result, atomic_file};
use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::time::Instant;

/// Most steps.
const N_STEPS: usize = 10;
/// Most samples that go through the network together.
const GROUP: usize = 8;
/// Parts of the published training set.
const N_PUBLISHED: usize = 4471;

/// What a step cost.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Step {
    loss: f64,
    seconds: f64,
}

pub fn run(study: &Study) -> Result<Value> {
    let n_samples = Trainings::new(study)?.n_samples();
    let labeler = Labeler::published();
    let data = training_samples(study, &[CutterSet::Uniform], &labeler)?;
    let paper = Settings::paper();
    let batch_size = paper.batch_size.min(n_samples).min(data.len());
    let settings = paper
        .with_seed(SEED)
        .with_batch_size(batch_size)
        .with_n_groups(batch_size.div_ceil(GROUP))
        .with_samples_per_epoch(Some(N_PUBLISHED));
    let n_steps = (n_samples / batch_size).clamp(1, N_STEPS);
    let (steps, n_parameters) = steps(study, &settings, &data, n_steps)?;
    let mut table = Table::new(&[
        ("step", "step"),
        ("samples", "samples"),
        ("loss", "loss"),
        ("seconds", "time"),
    ]);
    for (i, step) in steps.iter().enumerate() {
        table.row([
            Cell::count(i + 1),
            Cell::count((i + 1) * batch_size),
            Cell::Number(step.loss),
            Cell::Seconds(step.seconds),
        ]);
    }
    let points = steps.iter().enumerate().map(|(i, step)| ((i + 1) as f64, step.loss)).collect();
    let curve = Series { name: "sum of both heads".into(), points };
    let chart = Chart { title: "training loss".into(), series: vec![curve] };
    write_curves(&study.file("paper.svg"), "steps", &[chart])?;
    let seconds = steps.iter().map(|step| step.seconds).sum::<f64>();
    let seconds = seconds / (n_steps * batch_size) as f64;
    let n_published = settings.n_epochs as f64 * N_PUBLISHED as f64;
    let page = Page {
        name: "paper",
        title: "First steps of the published training",
        text: vec![format!(
            "Preset `paper`: {n_parameters} parameters, SGD with momentum 0.9 and weight decay 5e-4, learning rate 1.0 (the begin \
             of a cosine over 1,500 epochs of {N_PUBLISHED} samples), batch {batch_size} in {} groups (batch norm sees \
             one of them), mirroring and elastic deformation with labels kept, the sum of both losses (two heads that know \
             nothing: 2 ln 2 = 1.386). Steps taken: {n_steps}, on samples of {} parts with {} sites each; no network is kept. At \
             {seconds:.2} s a sample the published training is {:.1} days here.",
            settings.n_groups,
            study.training_parts().len(),
            study.args.sites,
            n_published * seconds / 86400.0,
        )],
        table,
        pictures: vec![("paper.svg".into(), "Loss of the first steps".into())],
    };
    page.write(study)
}

/// The steps and the number of parameters; from the folder if it holds them. The weights (43 million, and as many
/// velocities) are not stored, so an interrupted run begins anew.
fn steps(
    study: &Study,
    settings: &Settings,
    data: &[Sample],
    n_steps: usize,
) -> Result<(Vec<Step>, usize)> {
    let key = json!([settings, n_steps]);
    let path = trainings(study).join(format!("paper-{}.json", hash(&key, &[data])));
    if path.exists() {
        let bytes = std::fs::read(&path).map_err(|e| Error::read(&path, e))?;
        return serde_json::from_slice(&bytes).map_err(|e| {
            Error::file(&path, "steps", e.to_string(), "remove the file to take the steps again")
        });
    }
    study.output.say(format!("the first {n_steps} steps of the published training"));
    study.count_training();
    let mut run = Run::new(settings.clone())?;
    let bar = study.bar(n_steps, "steps");
    let mut watch = Watch { study, bar, n_steps, steps: Vec::new(), start: Instant::now() };
    let _ = run.train(data, &[], &mut watch)?;
    watch.bar.finish_and_clear();
    study.go_on()?;
    let found = (watch.steps, run.model.params.len());
    let text = json!(found).to_string();
    atomic_file::write_atomic(&path, |file| file.write_all(text.as_bytes()))?;
    Ok(found)
}

/// Records steps, and stops after the last.
struct Watch<'a> {
    study: &'a Study<'a>,
    bar: ProgressBar,
    n_steps: usize,
    steps: Vec<Step>,
    start: Instant,
}

impl Observer for Watch<'_> {
    fn step(&mut self, report: &StepReport) -> ControlFlow<()> {
        let seconds = self.start.elapsed().as_secs_f64();
        self.steps.push(Step { loss: report.loss, seconds });
        self.start = Instant::now();
        self.bar.inc(1);
        self.bar.set_message(format!("loss {:.3}", report.loss));
        match self.study.is_stopped() || self.steps.len() == self.n_steps {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}
