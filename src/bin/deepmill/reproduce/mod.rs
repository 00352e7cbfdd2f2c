//! `deepmill reproduce`: the experiments of the paper, one command each.

mod cutters;
mod depth;
mod directions;
mod gallery;
mod graph;
mod length;
mod loss;
mod page;
mod paper;
mod parts;
mod pictures;
mod placement;
mod samples;
mod scores;
mod sets;
mod study;
mod symmetry;
mod table1;
mod trainings;
mod volume;

use crate::mesh_args::MeshArgs;
use crate::output::Output;
use clap::ValueEnum;
use deepmill::folder_lock::FolderLock;
use deepmill::{Result, atomic_file};
use serde_json::{Map, Value};
use std::path::PathBuf;
use study::Study;

/// Run experiments of the paper on parts that anyone can make.
///
/// Writes to the folder, for each experiment: NAME.md with a table, NAME.csv with its numbers, and pictures.
/// Trained networks are kept in the folder `trainings`: none is trained twice, and an interrupted one goes on
/// where it was.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill reproduce cutters --budget 20 --out reproduced")]
pub struct Args {
    /// What to run.
    #[arg(value_enum)]
    experiment: Experiment,
    /// Folder for the results.
    #[arg(long, value_name = "DIR", default_value = "reproduced")]
    out: PathBuf,
    /// Minutes per training: turned into a number of samples, the same for every network, by timing the first
    /// steps; the folder keeps that number. A training of `all` gets a tenth of it.
    #[arg(long, value_name = "MINUTES", default_value = "20", value_parser = minutes)]
    budget: f64,
    /// Samples that every network sees, in place of a time.
    #[arg(long, value_name = "COUNT", conflicts_with = "budget")]
    samples: Option<usize>,
    /// Meshes, or folders of meshes, in place of generated parts; the last quarter is for testing.
    #[arg(long, value_name = "PATH", num_args = 1..)]
    parts: Vec<PathBuf>,
    /// Number of generated parts; the last quarter is for testing.
    #[arg(long, value_name = "COUNT", default_value_t = 72, value_parser = clap::value_parser!(u64).range(2..))]
    parts_count: u64,
    /// Sites on each part.
    #[arg(long, value_name = "COUNT", default_value_t = 7000, value_parser = crate::dataset::several_sites)]
    sites: usize,
    /// Settings of the trainings: small or tiny, as `deepmill train` has them.
    #[arg(long, value_name = "NAME", default_value = "small", value_parser = ["small", "tiny"])]
    preset: String,
    #[command(flatten)]
    mesh: MeshArgs,
}

/// What can be run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Experiment {
    /// Table 1: scores and times on CAD, freeform and complex parts.
    Table1,
    /// The longer the tool sticks out, the more it reaches: area out of reach over both lengths.
    Length,
    /// Direction sets: how often a site and its mirror image get different labels and predictions.
    Symmetry,
    /// Number of directions: how far labels, and networks that learned them, are from the mesh definition, and times.
    Directions,
    /// Four sets of cutters, with and without cutter modules, and with extreme cutters in the training.
    Cutters,
    /// Where in the decoder the cutter modules are: none, first, last, every stage.
    Placement,
    /// Sum or mean of the losses; mirroring and elastic deformation, with labels kept and made anew.
    Loss,
    /// The first losses of the published training: 43.3 million parameters, batch 128.
    Paper,
    /// Octree depth 4, 5, 6, half to twice the sites, and the share of occlusion points.
    Depth,
    /// Pictures of the best, median and worst predictions of each set of parts, and of several cutters.
    Gallery,
    /// GraphSAGE beside the octree network.
    Graph,
    /// The space around the part: a network without normals.
    Volume,
    /// Every experiment, one after the other.
    All,
}

impl Experiment {
    /// Those that a value stands for.
    fn runs(self) -> Vec<Experiment> {
        let all = Experiment::value_variants().iter().copied();
        all.filter(|e| *e != Experiment::All && (self == Experiment::All || self == *e)).collect()
    }

    fn run(self, study: &Study) -> Result<Value> {
        match self {
            Experiment::Table1 => table1::run(study),
            Experiment::Length => length::run(study),
            Experiment::Symmetry => symmetry::run(study),
            Experiment::Directions => directions::run(study),
            Experiment::Cutters => cutters::run(study),
            Experiment::Placement => placement::run(study),
            Experiment::Loss => loss::run(study),
            Experiment::Paper => paper::run(study),
            Experiment::Depth => depth::run(study),
            Experiment::Gallery => gallery::run(study),
            Experiment::Graph => graph::run(study),
            Experiment::Volume => volume::run(study),
            Experiment::All => Ok(Value::Null),
        }
    }
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    atomic_file::check_writable_folder(&args.out)?;
    let _lock = FolderLock::whole(&args.out)?;
    let study = Study::new(args, output)?;
    let mut results = Map::new();
    for experiment in args.experiment.runs() {
        let name = format!("{experiment:?}").to_lowercase();
        output.say(format!("{name}:"));
        results.insert(name, experiment.run(&study)?);
    }
    results.insert("trained".into(), study.n_trained().into());
    output.result(&Value::Object(results));
    Ok(())
}

fn minutes(text: &str) -> std::result::Result<f64, String> {
    let parsed = text.parse().ok().filter(|m: &f64| *m > 0.0 && m.is_finite());
    parsed.ok_or_else(|| "expected minutes above 0, such as 20".into())
}
