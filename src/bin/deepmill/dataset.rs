//! `deepmill dataset`: builds labeled data sets from parts; imports and exports the published format.

use crate::args::called;
use crate::output::Output;
use crate::processes::{hash, interrupted, together};
use crate::progress;
use crate::published_args::PublishedArgs;
use clap::Subcommand;
use deepmill::data::dataset::{Builder, Dataset, DatasetSettings, Manifest, PartSource, Split};
use deepmill::data::files::published::{self, List};
use deepmill::directions::DirectionSet;
use deepmill::geom::formats::Format;
use deepmill::processes::{Processes, agree, agree_to_go_on, require_same};
use deepmill::{Error, Result, atomic_file};
use serde_json::json;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Build and inspect data sets for training and evaluation.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    Build(BuildArgs),
    Show(ShowArgs),
    Export(ExportArgs),
    Import(crate::import::Args),
}

/// Read, scale, sample and label parts, with random cutters.
///
/// A build that was interrupted goes on where it stopped when the same command is given again. Parts
/// that cannot be labeled are skipped; the manifest says why.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill dataset build parts/ --out data --cutters 2 --seed 1\n\
Shards (any order, any machine, one folder): … --shard 0/4, … --shard 1/4, and so on")]
struct BuildArgs {
    /// Mesh files (mm), and folders of them.
    parts: Vec<PathBuf>,
    /// Also make this many parts with the built-in generator.
    #[arg(long, default_value_t = 0, value_name = "COUNT")]
    generated: u64,
    /// Folder of the data set.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Random cutters per part. A part and all its cutters are in one split.
    #[arg(long, default_value_t = 1, value_name = "COUNT")]
    cutters: usize,
    /// Where cutters are drawn from: uniform, short, long or extreme, as published, or full: every length from short to
    /// extreme.
    #[arg(long, default_value = "uniform", value_name = "SET")]
    cutter_set: String,
    /// Sites per part.
    #[arg(long, default_value_t = 7000, value_name = "COUNT", value_parser = several_sites)]
    sites: usize,
    /// What blocks: `published` (the sites, by the published definition; also `sites`), `part` (its triangles: the mesh
    /// definition), or COUNT: the sites and so many further points per part.
    #[arg(long, value_name = "WHAT", default_value = "published")]
    obstacles: String,
    #[command(flatten)]
    published: PublishedArgs,
    /// Label points of the space around each part, about as many as --sites, with the tip at the point; a network for
    /// them reads the surface as well (docs/training.md).
    #[arg(long)]
    volume: bool,
    /// The directions, as `deepmill label` has them; by default `published`, with triangles as obstacles 150.
    #[arg(long, value_name = "SET", allow_negative_numbers = true)]
    directions: Option<String>,
    /// Take so many directions over the whole sphere instead (150 by default).
    #[arg(long)]
    whole_sphere: bool,
    /// Scale up parts whose smallest box edge is below this, mm (0: never).
    #[arg(long, default_value_t = 80.0, value_name = "MM", allow_negative_numbers = true, value_parser = crate::args::millimeters)]
    min_edge: f64,
    /// Instead, scale each part to a random size: the largest box edge between these, mm.
    #[arg(long, value_name = "LOW,HIGH", value_parser = sizes, conflicts_with = "min_edge")]
    sizes: Option<[f64; 2]>,
    /// Probability of a part to be kept for validation.
    #[arg(long, default_value_t = 0.0, value_name = "SHARE", allow_negative_numbers = true)]
    validation: f64,
    /// Seed of all random decisions.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Make only every N-th part, starting with the I-th (from 0).
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<(usize, usize)>,
}

/// Say what a data set holds.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill dataset show data")]
struct ShowArgs {
    /// Folder of the data set.
    folder: PathBuf,
}

/// Write a data set in the published format: text lines, cutter files, PLY, file lists.
///
/// The validation split becomes the test list. In these files label 1 means accessible.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill dataset export data --out published")]
struct ExportArgs {
    /// Folder of the data set.
    folder: PathBuf,
    /// Folder to write raw_data, points and filelist into.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    match &args.verb {
        Verb::Build(args) => together(output, |processes, output| build(args, processes, output)),
        Verb::Export(args) => export(args, output),
        Verb::Import(args) => crate::import::run(args, output),
        Verb::Show(args) => {
            show(&Dataset::open(&args.folder)?.manifest, output);
            Ok(())
        }
    }
}

/// The parts of the shard are shared out to the processes in turn.
fn build(args: &BuildArgs, processes: &dyn Processes, output: &Output) -> Result<()> {
    // The first alone makes the folder.
    let (index, n) = args.shard.unwrap_or((0, 1));
    let share = (index + n * processes.rank(), n * processes.size());
    let first = (processes.rank() == 0).then(|| builder(args, share)).transpose();
    let first = agree(processes, first)?;
    let builder = agree(processes, first.map_or_else(|| builder(args, share), Ok))?;
    require_same(processes, "list of parts", &parts_of(&builder))?;
    let flow = build_parts(&builder, output);
    let remedy = || "give the same command again to go on".into();
    // Another process may be at work for long: an error is not for it to wait for.
    if agree_to_go_on(processes, Ok(flow?))?.is_break() {
        return Err(interrupted(processes, remedy()));
    }
    if processes.rank() != 0 {
        return agree(processes, Ok(()));
    }
    let told = builder.finish().and_then(|manifest| match manifest {
        Some(manifest) if manifest.n_samples() == 0 => Err(nothing_labeled(args, &manifest)),
        Some(manifest) => {
            show(&manifest, output);
            Ok(())
        }
        None => {
            tell_missing(&builder, output);
            Ok(())
        }
    });
    agree(processes, told)
}

/// A data set without a sample trains nothing.
fn nothing_labeled(args: &BuildArgs, manifest: &Manifest) -> Error {
    let skipped = manifest.parts.iter().filter(|part| part.skipped.is_some()).count();
    let found = format!("no sample; {skipped} of {} parts were skipped", manifest.parts.len());
    Error::file(
        &args.out,
        "parts",
        found,
        "its manifest.json says why of each: mend or replace them",
    )
}

fn tell_missing(builder: &Builder, output: &Output) {
    let missing = builder.missing();
    let (n, names) = (missing.len(), builder.names());
    let first =
        missing.first().map_or_else(String::new, |i| format!(", the first is {}", names[*i]));
    let all = builder.n_parts();
    output.say(format!("this shard is finished; {n} of {all} parts are missing{first}"));
    output.result(&json!({ "finished": false, "n_missing": n }));
}

fn parts_of(builder: &Builder) -> String {
    let names = hash(builder.names().join("\n").as_bytes());
    format!("{} parts ({})", builder.n_parts(), &names[..16])
}

fn build_parts(builder: &Builder, output: &Output) -> Result<ControlFlow<()>> {
    let stop = progress::stop_flag()?;
    let bar = progress::bar(builder.own_parts().len() as u64, "parts");
    for index in builder.own_parts() {
        let record = builder.part(index)?;
        if let Some(reason) = record.skipped {
            bar.suspend(|| output.warn(format!("skipped {}: {reason}", record.name)));
        }
        bar.inc(1);
        if stop.load(Ordering::Relaxed) {
            return Ok(ControlFlow::Break(()));
        }
    }
    bar.finish_and_clear();
    Ok(ControlFlow::Continue(()))
}

/// `share`: which of how many programs that build in the folder.
fn builder(args: &BuildArgs, share: (usize, usize)) -> Result<Builder> {
    atomic_file::check_writable_folder(&args.out)?;
    let part_itself = args.obstacles == "part";
    let n_obstacles = match args.obstacles.as_str() {
        "published" | "sites" | "part" => None,
        count => Some(count.parse().map_err(|_| {
            let expected = "published, part or a number of further points";
            let remedy = "published has sites as obstacles, part tests triangles";
            Error::argument("--obstacles", format!("`{count}`"), expected, remedy)
        })?),
    };
    let options = args.published.options(!part_itself && !args.volume)?;
    let settings = DatasetSettings::default()
        .with_seed(args.seed)
        .with_n_sites(args.sites)
        .with_n_obstacles(n_obstacles)
        .with_part_itself(part_itself)
        .with_volume(args.volume)
        .with_directions(directions(args, part_itself)?)
        .with_occlusion_rounding(options.rounding)
        .with_bottom_mm(options.bottom_mm)
        .with_cutter_set(args.cutter_set.parse()?)
        .with_n_cutters(args.cutters)
        .with_min_edge_mm((args.min_edge != 0.0 && args.sizes.is_none()).then_some(args.min_edge))
        .with_size_mm(args.sizes)
        .with_validation_share(args.validation);
    let mut sources = Vec::new();
    for path in &args.parts {
        sources.extend(mesh_files(path)?.into_iter().map(PartSource::File));
    }
    sources
        .extend((0..args.generated).map(|index| PartSource::Generated { seed: args.seed, index }));
    Builder::share(&args.out, settings, sources, share)
}

/// As given, or those of the definition.
fn directions(args: &BuildArgs, part_itself: bool) -> Result<DirectionSet> {
    let by_count = part_itself || args.whole_sphere;
    let usual = if by_count { "150" } else { "published" };
    let given = args.directions.as_deref().unwrap_or(usual);
    let set = given.parse().map_err(|error| called(error, "--directions"))?;
    match (args.whole_sphere, set) {
        (false, set) => Ok(set),
        (true, DirectionSet::FibonacciHemisphere { n_dirs }) => {
            Ok(DirectionSet::FibonacciSphere { n_dirs })
        }
        (true, set) => {
            let remedy = "leave out --whole-sphere";
            Err(Error::argument("--directions", set, "a number beside --whole-sphere", remedy))
        }
    }
}

fn export(args: &ExportArgs, output: &Output) -> Result<()> {
    atomic_file::check_writable_folder(&args.out)?;
    let set = Dataset::open(&args.folder)?;
    if set.manifest.settings.volume {
        let found = "points of space, which have no normals";
        let remedy = "the published format is one of sites: leave out --volume";
        return Err(Error::file(&args.folder, "settings", found, remedy));
    }
    let train = set.samples(Some(Split::Train))?;
    let test = set.samples(Some(Split::Validation))?;
    let listed = |list: List| move |sample| (list, sample);
    let samples: Vec<_> = train
        .iter()
        .map(listed(List::TrainVal))
        .chain(test.iter().map(listed(List::Test)))
        .collect();
    published::write(&args.out, &samples)?;
    output.say(format!("{} samples written to {}", samples.len(), args.out.display()));
    output.result(&json!({ "n_samples": samples.len() }));
    Ok(())
}

pub fn show(manifest: &Manifest, output: &Output) {
    let count = |split: Split| {
        manifest.parts.iter().filter(|p| p.content.is_some() && p.split == split).count()
    };
    let skipped = manifest.parts.iter().filter(|p| p.skipped.is_some()).count();
    let cutters =
        || manifest.parts.iter().filter_map(|p| p.content.as_ref()).flat_map(|c| &c.cutters);
    // Never minus zero.
    let sum = cutters().map(|c| c.inaccessible).sum::<f64>() + 0.0;
    let share = sum / (cutters().count().max(1)) as f64;
    output.say(format!(
        "{} parts for training, {} for validation, {skipped} skipped; {} samples, {:.1} % of the sites inaccessible",
        count(Split::Train),
        count(Split::Validation),
        manifest.n_samples(),
        100.0 * share
    ));
    output.result(&json!({
        "finished": true,
        "n_train_parts": count(Split::Train),
        "n_validation_parts": count(Split::Validation),
        "n_skipped": skipped,
        "n_samples": manifest.n_samples(),
        "inaccessible_share": share,
        "settings": manifest.settings,
    }));
}

/// The file itself, or the mesh files of a folder in the order of their names.
pub fn mesh_files(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.into()]);
    }
    let entries = std::fs::read_dir(path).map_err(|e| Error::read(path, e))?;
    let mut files = Vec::new();
    for entry in entries {
        let file = entry.map_err(|e| Error::read(path, e))?.path();
        if Format::of(&file).is_ok_and(|format| format != Format::Npz) {
            files.push(file);
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(Error::file(
            path,
            "folder",
            "it holds no .stl, .obj, .ply or .3mf file",
            "name the folder that holds the parts",
        ));
    }
    Ok(files)
}

/// A number of sites that can say something about each other.
pub fn several_sites(text: &str) -> std::result::Result<usize, String> {
    text.parse().ok().filter(|n| *n >= 2).ok_or_else(|| "expected 2 or more".into())
}

fn sizes(text: &str) -> std::result::Result<[f64; 2], String> {
    let parsed = text.split_once(',').and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    parsed.ok_or_else(|| "expected LOW,HIGH in mm, such as 15,600".into())
}

fn shard(text: &str) -> std::result::Result<(usize, usize), String> {
    let parsed = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match parsed {
        Some((i, n)) if i < n => Ok((i, n)),
        _ => Err("expected I/N with 0 ≤ I < N, such as 0/4".into()),
    }
}
