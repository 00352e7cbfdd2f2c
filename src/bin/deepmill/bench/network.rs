//! `deepmill bench network`: time and peak memory of one pass of the whole network.

use super::input::{self, median_seconds};
use crate::output::Output;
use deepmill::Result;
use deepmill::loss::CrossEntropy;
use deepmill::model::{Batch, Model};
use deepmill::nn::arena::Arena;
use deepmill::octree::{Cloud, Octree};
use deepmill::optim::Sgd;
use serde_json::json;
use std::ops::Range;

/// Time a whole forward pass, training step or octree, and show the peak memory of the process.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill bench network --work step --batch 8")]
pub struct Args {
    #[command(flatten)]
    input: input::Args,
    /// What to time.
    #[arg(long, value_enum, default_value_t = Work::Forward)]
    work: Work,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Work {
    /// Octree, neighbors and kernel maps.
    Octree,
    /// Inference.
    Forward,
    /// Forward, backward and update.
    Step,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let (config, clouds) = (args.input.config()?, args.input.clouds()?);
    let batch = input::batch(&clouds, &config)?;
    let start_bytes = peak_memory();
    let (limit, arena) = (args.input.seconds, Arena::default());
    let (seconds, repeats) = match args.work {
        Work::Octree => {
            let transforms =
                clouds.iter().map(|c| config.input.normalization().transform(&c.points));
            let transforms = transforms.collect::<Result<Vec<_>>>()?;
            let apply = |(c, f): (&deepmill::geom::Sites, &deepmill::octree::CubeTransform)| {
                c.points.iter().map(|&p| f.apply(p)).collect::<Vec<_>>()
            };
            let points: Vec<_> = clouds.iter().zip(&transforms).map(apply).collect();
            let pairs = points.iter().zip(&clouds);
            let clouds: Vec<_> = pairs.map(|(p, c)| Cloud::new(p, &c.normals)).collect();
            let options = config.input.octree();
            Octree::build(&clouds, &options)?;
            median_seconds(limit, || drop(Octree::build(&clouds, &options)))
        }
        Work::Forward => {
            let model = Model::new(&config, 1)?;
            median_seconds(limit, || drop(model.forward(&batch, &arena)))
        }
        Work::Step => {
            let mut trainer = Trainer::new(Model::new(&config, 1)?, &batch, arena.clone());
            median_seconds(limit, || trainer.step(&batch))
        }
    };
    let n_nodes: Vec<usize> = batch.octree.levels.iter().map(|level| level.n_nodes()).collect();
    output.say(format!(
        "{seconds:.4} s (median of {repeats}), {} points, nodes per depth {n_nodes:?}",
        batch.n_points()
    ));
    if let Some(bytes) = peak_memory() {
        output.say(format!("peak memory {:.0} MB", bytes as f64 / 1e6));
        output.say(format!("of it layers at most {:.0} MB", arena.peak_bytes() as f64 / 1e6));
    }
    output.result(&json!({
        "seconds": seconds, "repeats": repeats, "batch": args.input.batch,
        "n_points": batch.n_points(), "n_nodes": n_nodes,
        "start_bytes": start_bytes, "peak_bytes": peak_memory(),
        "arena_peak_bytes": arena.peak_bytes(), "arena_reserved_bytes": arena.reserved_bytes(),
    }));
    Ok(())
}

/// A training step without data set, schedule and files.
struct Trainer {
    model: Model<f32>,
    arena: Arena<f32>,
    velocity: Vec<f32>,
    dlogits: [Vec<f32>; 2],
    targets: Vec<u8>,
}

impl Trainer {
    fn new(model: Model<f32>, batch: &Batch<f32>, arena: Arena<f32>) -> Self {
        let n = model.params.len();
        let targets = (0..batch.n_points()).map(|i| (i % 2) as u8).collect();
        let velocity = vec![0.0; n];
        let dlogits = Default::default();
        Trainer { model, arena, velocity, dlogits, targets }
    }

    fn step(&mut self, batch: &Batch<f32>) {
        let pass = self.model.forward_train(batch, None, &self.arena);
        for (logits, d) in pass.logits.iter().zip(&mut self.dlogits) {
            CrossEntropy::binary().loss(logits, &self.targets, 1.0, d);
        }
        let [first, second] = &self.dlogits;
        let sgd = Sgd::new(0.9, 5e-4);
        let velocity = &mut self.velocity;
        let mut update = |range: Range<usize>, grads: &mut [f32], params: &mut [f32]| {
            sgd.step(1e-3, grads, &mut velocity[range], params);
        };
        self.model.backward_and_update(batch, pass, &[first, second], &mut update, &self.arena);
    }
}

/// Most memory this process ever held, in bytes; known on Linux.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}
