//! `deepmill eval`: how good a network is on a data set, beside what costs nothing to guess.

use crate::output::Output;
use deepmill::access::baselines;
use deepmill::data::Sample;
use deepmill::data::dataset::{Dataset, Split};
use deepmill::model::weights;
use deepmill::report::tables::{Cell, Table};
use deepmill::train::{Evaluation, evaluate};
use deepmill::{Error, Result};
use serde_json::json;
use std::path::PathBuf;

/// Score a network on a data set.
///
/// Positive classes: inaccessible, and occlusion point. Scores are averages over samples; "pooled" puts
/// all sites into one table; "ref F1" counts class 1 as positive in both heads, as the reference code
/// does (for head 1 that is: accessible).
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill eval --model run/best.safetensors --data data")]
pub struct Args {
    /// Network: a safetensors file.
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Data sets made by `deepmill dataset build`.
    #[arg(long, value_name = "DIR", required = true)]
    data: Vec<PathBuf>,
    /// Only this split: train or validation.
    #[arg(long, value_name = "SPLIT")]
    split: Option<SplitArg>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum SplitArg {
    Train,
    Validation,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let model = weights::read::<f32>(&args.model)?;
    let split = args.split.map(|split| match split {
        SplitArg::Train => Split::Train,
        SplitArg::Validation => Split::Validation,
    });
    let mut table = Table::new(&[
        ("data", "data"),
        ("engine", "engine"),
        ("acc_i", "Acc_i"),
        ("f1_i", "F1_i"),
        ("acc_o", "Acc_o"),
        ("f1_o", "F1_o"),
        ("pooled_f1_i", "pooled F1_i"),
        ("pooled_f1_o", "pooled F1_o"),
        ("reference_f1_i", "ref F1_i"),
        ("seconds_per_sample", "T"),
    ]);
    let mut n_samples = 0;
    for folder in &args.data {
        let samples = Dataset::open(folder)?.samples(split)?;
        if samples.is_empty() {
            let found = "no samples in this split";
            let remedy = "choose another split, or build with --validation";
            return Err(Error::file(folder, "data set", found, remedy));
        }
        n_samples += samples.len();
        let name = folder.display().to_string();
        add(&mut table, &name, "network", &evaluate(&model, &samples)?, true);
        add(&mut table, &name, "majority class", &majority(&samples), false);
        add(&mut table, &name, "facing down, highest by z", &by_geometry(&samples), false);
    }
    output.say(format!("{n_samples} samples; F1 of the classes inaccessible and occlusion"));
    output.say(table.text());
    output.result(&json!({ "n_samples": n_samples, "rows": table.json() }));
    Ok(())
}

fn add(table: &mut Table, data: &str, engine: &str, evaluation: &Evaluation, timed: bool) {
    let [i, o] = [evaluation.head(0), evaluation.head(1)];
    let share = |x: f64| Cell::Share(x);
    let n = evaluation.samples.len().max(1) as f64;
    table.row([
        Cell::text(data),
        Cell::text(engine),
        share(i.mean.accuracy),
        share(i.mean.f1),
        share(o.mean.accuracy),
        share(o.mean.f1),
        share(i.pooled.f1),
        share(o.pooled.f1),
        share(i.reference_f1),
        if timed { Cell::Seconds(evaluation.seconds / n) } else { Cell::Missing },
    ]);
}

/// The more frequent answer of each head over all samples, for every site.
fn majority(samples: &[Sample]) -> Evaluation {
    let more_yes = |labels: &dyn Fn(&Sample) -> usize| {
        let sites: usize = samples.iter().map(|s| s.sites.len()).sum();
        2 * samples.iter().map(labels).sum::<usize>() > sites
    };
    let yes = |labels: &[bool]| labels.iter().filter(|l| **l).count();
    let inaccessible = more_yes(&|s| yes(&s.inaccessible));
    let occlusion = more_yes(&|s| yes(&s.occlusion));
    let mut evaluation = Evaluation::default();
    for sample in samples {
        let n = sample.sites.len();
        evaluation.add(sample, &vec![inaccessible; n], &vec![occlusion; n]);
    }
    evaluation
}

/// What faces down past the best threshold of these very sites is inaccessible, the highest tenth is in
/// the way.
fn by_geometry(samples: &[Sample]) -> Evaluation {
    let normals: Vec<_> = samples.iter().flat_map(|s| s.sites.normals.iter().copied()).collect();
    let truth: Vec<bool> = samples.iter().flat_map(|s| s.inaccessible.iter().copied()).collect();
    let min_z = baselines::best_facing(&normals, &truth);
    let mut evaluation = Evaluation::default();
    for sample in samples {
        let inaccessible = baselines::facing_away(&sample.sites.normals, min_z);
        evaluation.add(sample, &inaccessible, &baselines::highest(&sample.sites.points, 0.1));
    }
    evaluation
}
