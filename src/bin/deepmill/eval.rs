//! `deepmill eval`: scores a network on data sets, beside baselines and the exact labeler.

use crate::model_args::ModelArgs;
use crate::output::Output;
use crate::processes::{hash, together};
use deepmill::access::baselines;
use deepmill::answers::SiteAnswers;
use deepmill::data::Sample;
use deepmill::data::dataset::{Dataset, DatasetSettings, Split};
use deepmill::directions::Directions;
use deepmill::model::config::CutterPlacement;
use deepmill::model::{AnyModel, weights};
use deepmill::processes::{Processes, agree, require_same};
use deepmill::report::curves::{Chart, Series, write_curves};
use deepmill::tables::{Cell, Table};
use deepmill::train::{Evaluation, HeadScore, HeadScores, VerifiedScore};
use deepmill::train::{evaluate_exact, evaluate_ranked, evaluate_verified};
use deepmill::{Error, Result, atomic_file};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Score a network on data sets.
///
/// Positive classes: inaccessible, and occlusion point. Three tables: averages over samples, as the paper
/// has them; all sites of a set pooled; averages over samples with sites weighted by the area they stand
/// for. "ref F1_i" counts accessible as positive, as the reference code does. "ECE" is the expected calibration
/// error of a network's probabilities over all sites: 0 if they are frequencies. T is the time per sample.
/// "Occlusion by rank" marks the share of sites with the greatest scores instead of all with a score above
/// one half: as many as the labels have.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill eval --model run/best.safetensors --data data --exact")]
pub struct Args {
    #[command(flatten)]
    model: ModelArgs,
    /// Further networks to compare with, such as one without cutter modules.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    against: Vec<PathBuf>,
    /// Data sets made by `deepmill dataset build`.
    #[arg(long, value_name = "DIR", required = true, num_args = 1..)]
    data: Vec<PathBuf>,
    /// Only this split: train or validation.
    #[arg(long, value_name = "SPLIT")]
    split: Option<SplitArg>,
    /// Draw how often a predicted probability was right, for the first network on all sets together, as an SVG file.
    #[arg(long, value_name = "FILE")]
    reliability: Option<PathBuf>,
    /// Also say how many sites `predict --verify` would compute with these bounds, how many of the others would be
    /// wrong, and in how many samples more than the bound, for the first network; several with commas.
    #[arg(long, value_name = "SHARES", value_delimiter = ',', value_parser = crate::predict::verify_bound)]
    verify: Vec<f64>,
    /// Also label every sample exactly, for the labeler's time on the same samples.
    #[arg(long)]
    exact: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum SplitArg {
    Train,
    Validation,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    together(output, |processes, output| score_all(args, processes, output))
}

/// Each process scores its share of the samples; the first tells.
fn score_all(args: &Args, processes: &dyn Processes, output: &Output) -> Result<()> {
    let networks = agree(processes, networks(args))?;
    let mut rows: Vec<Row> = Vec::new();
    let mut verified = Table::new(&[
        ("data", "data"),
        ("bound", "bound"),
        ("computed", "computed"),
        ("wrong", "wrong of the others"),
        ("above_bound", "samples above the bound"),
        ("counted", "beta counted"),
        ("wrong_occlusion", "wrong of the others, per occlusion point"),
    ]);
    for folder in &args.data {
        let name = folder.display().to_string();
        let (set, samples) = agree(processes, samples(args, folder))?;
        let manifest = serde_json::to_vec(&set.manifest).unwrap_or_default();
        require_same(processes, "data", &hash(&manifest))?;
        let of = (folder.as_path(), &set.manifest.settings, &samples[..]);
        for (engine, timed, evaluation) in score_set(args, of, &networks, processes, output)? {
            rows.push(Row { set: name.clone(), engine, timed, evaluation });
        }
        for &bound in &args.verify {
            let score = evaluate_verified(&networks[0].1, &samples, bound, processes)?;
            let VerifiedScore { computed, wrong, above_bound, counted, wrong_occlusion, .. } =
                score;
            let shares = [bound, computed, wrong, above_bound, counted, wrong_occlusion];
            let shares = shares.into_iter().map(Cell::Share);
            verified.row([Cell::text(&name)].into_iter().chain(shares).collect::<Vec<_>>());
        }
    }
    if args.data.len() > 1 {
        rows.extend(overall(&rows));
    }
    if let Some(path) = args.reliability.as_ref().filter(|_| processes.rank() == 0) {
        draw_reliability(path, &rows)?;
    }
    let n_samples: usize =
        rows.iter().filter(|r| r.engine == NETWORK && r.set != ALL).map(Row::n).sum();
    output.say(format!("{n_samples} samples; F1 of the classes inaccessible and occlusion"));
    let mut result = json!({ "n_samples": n_samples });
    for (key, heading, scores) in WEIGHTINGS {
        let table = table(&rows, scores);
        output.say(format!("\n{heading}:"));
        output.say(table.text_in(output.unit()));
        result[key] = table.json();
    }
    if !args.verify.is_empty() {
        output.say("\npredict, then verify (all sites pooled):");
        output.say(verified.text_in(output.unit()));
        result["verified"] = verified.json();
    }
    if let Some(path) = &args.reliability {
        output.files(std::slice::from_ref(path));
        result["files"] = json!([path]);
    }
    output.result(&result);
    Ok(())
}

/// All networks with their names, once it is known that the files asked for can be written.
fn networks(args: &Args) -> Result<Vec<(String, AnyModel<f32>)>> {
    args.reliability.iter().try_for_each(|path| atomic_file::check_writable_file(path))?;
    let mut networks = vec![(NETWORK.to_owned(), args.model.read()?.0)];
    for path in &args.against {
        let model = weights::read::<f32>(path)?;
        networks.push((name_of(&model, path), model));
    }
    Ok(networks)
}

/// Share of positives over predicted probability, for both heads of the first network.
fn draw_reliability(path: &Path, rows: &[Row]) -> Result<()> {
    let Some(row) = rows.iter().rev().find(|row| row.engine == NETWORK) else { return Ok(()) };
    let curve = |head: usize, name: &str| {
        let bins = row.evaluation.reliability[head].bins.iter();
        let points = bins.filter_map(|bin| bin.means().map(|[p, share]| (p, share)));
        Series { name: name.into(), points: points.collect() }
    };
    let right = Series {
        name: "probabilities that are frequencies".into(),
        points: vec![(0.0, 0.0), (1.0, 1.0)],
    };
    let series = vec![curve(0, "inaccessible"), curve(1, "occlusion"), right];
    let chart = Chart { title: "share of positives".into(), series };
    write_curves(path, "predicted probability", &[chart])
}

const NETWORK: &str = "network";
const ALL: &str = "all";

type Scores = fn(&HeadScores) -> HeadScore;

/// Key for programs, heading for people, and which scores.
const WEIGHTINGS: [(&str, &str, Scores); 3] = [
    ("per_sample", "average over samples", |h| h.mean),
    ("pooled", "all sites pooled", |h| h.pooled),
    ("by_area", "average over samples, sites weighted by area", |h| h.by_area),
];

struct Row {
    set: String,
    engine: String,
    timed: bool,
    evaluation: Evaluation,
}

impl Row {
    fn n(&self) -> usize {
        self.evaluation.samples.len()
    }
}

/// What a further network is called: by what it lacks, or by its file.
fn name_of(model: &AnyModel<f32>, path: &Path) -> String {
    match model.net.config().cutter().placement {
        CutterPlacement::None => "network without cutter modules".into(),
        _ => path.display().to_string(),
    }
}

/// A data set and the samples of it that are asked for.
fn samples(args: &Args, folder: &Path) -> Result<(Dataset, Vec<Sample>)> {
    let set = Dataset::open(folder)?;
    let samples = set.samples(args.split.map(|split| match split {
        SplitArg::Train => Split::Train,
        SplitArg::Validation => Split::Validation,
    }))?;
    if samples.is_empty() {
        let found = "no samples in this split";
        let remedy = "choose another split, or build with --validation";
        return Err(Error::file(folder, "data set", found, remedy));
    }
    Ok((set, samples))
}

type Scored = (String, bool, Evaluation);

fn score_set(
    args: &Args,
    (folder, settings, samples): (&Path, &DatasetSettings, &[Sample]),
    networks: &[(String, AnyModel<f32>)],
    processes: &dyn Processes,
    output: &Output,
) -> Result<Vec<Scored>> {
    let definition = settings.definition();
    for (name, model) in networks {
        if let Some(learned) = model.definition.filter(|learned| *learned != definition) {
            let folder = folder.display();
            output.warn(format!(
                "{name} learned the {learned}; the labels of {folder} are by the {definition}"
            ));
        }
    }
    let options = settings.label_options();
    let mut scored = Vec::new();
    for (name, model) in networks {
        let [plain, ranked] = evaluate_ranked(model, samples, &options, processes)?;
        scored.push((name.clone(), true, plain));
        // Points of space are no occlusion points: there is none to rank.
        if !settings.volume {
            let share = 100.0 * settings.occlusion_share;
            scored.push((format!("{name}, occlusion by rank ({share} %)"), true, ranked));
        }
    }
    if args.exact && settings.volume {
        let found = "its labels are about space, it does not hold the surface";
        let remedy = "leave out --exact; `deepmill label --volume` times single parts";
        return Err(Error::file(folder, "settings", found, remedy));
    }
    if args.exact && settings.part_itself {
        let found = "its labels are by the mesh definition, whose triangles it does not hold";
        let remedy = "leave out --exact; `deepmill label` times single parts";
        return Err(Error::file(folder, "settings", found, remedy));
    }
    if args.exact {
        let directions = Directions::new(settings.directions.clone())?;
        let exact = evaluate_exact(samples, &directions, &options, processes)?;
        scored.push(("exact labeler".into(), true, exact));
    }
    scored.push(("majority class".into(), false, majority(samples)?));
    if !settings.volume {
        let name = "normal's angle; highest 10 % by z";
        scored.push((name.into(), false, by_geometry(samples)?));
    }
    Ok(scored)
}

/// One row for each engine over all sets.
fn overall(rows: &[Row]) -> Vec<Row> {
    let mut all: Vec<Row> = Vec::new();
    for row in rows {
        match all.iter_mut().find(|a| a.engine == row.engine) {
            Some(found) => found.evaluation.append(&row.evaluation),
            None => all.push(Row {
                set: ALL.into(),
                engine: row.engine.clone(),
                timed: row.timed,
                evaluation: row.evaluation.clone(),
            }),
        }
    }
    all
}

fn table(rows: &[Row], scores: Scores) -> Table {
    let has_shares = rows.iter().any(|row| row.evaluation.share_error().is_some());
    let mut columns = vec![
        ("data", "data"),
        ("engine", "engine"),
        ("acc_i", "Acc_i"),
        ("f1_i", "F1_i"),
        ("acc_o", "Acc_o"),
        ("f1_o", "F1_o"),
        ("reference_f1_i", "ref F1_i"),
        ("calibration_error_i", "ECE_i"),
        ("calibration_error_o", "ECE_o"),
        ("seconds_per_sample", "T"),
    ];
    columns.extend(has_shares.then_some(("share_error", "error of share")));
    let mut table = Table::new(&columns);
    for row in rows {
        let heads = [0, 1].map(|head| row.evaluation.head(head));
        let [i, o] = heads.each_ref().map(scores);
        let time = Cell::Seconds(row.evaluation.seconds / row.n().max(1) as f64);
        let mut cells = vec![
            Cell::text(&row.set),
            Cell::text(&row.engine),
            Cell::Share(i.accuracy),
            Cell::Share(i.f1),
            Cell::Share(o.accuracy),
            Cell::Share(o.f1),
            Cell::Share(heads[0].reference_f1),
            heads[0].calibration_error.map_or(Cell::Missing, Cell::Share),
            heads[1].calibration_error.map_or(Cell::Missing, Cell::Share),
            if row.timed { time } else { Cell::Missing },
        ];
        let error = row.evaluation.share_error().map_or(Cell::Missing, Cell::Share);
        cells.extend(has_shares.then_some(error));
        table.row(cells);
    }
    table
}

/// The more frequent answer of each head over all samples, for every site.
fn majority(samples: &[Sample]) -> Result<Evaluation> {
    let more_yes = |labels: &dyn Fn(&Sample) -> usize| {
        let sites: usize = samples.iter().map(|s| s.sites.len()).sum();
        2 * samples.iter().map(labels).sum::<usize>() > sites
    };
    let inaccessible = more_yes(&|s| s.answers.n_inaccessible());
    let occlusion = more_yes(&|s| s.answers.n_occlusion());
    let mut evaluation = Evaluation::default();
    for sample in samples {
        let n = sample.sites.len();
        let answers = SiteAnswers::new(vec![inaccessible; n], vec![occlusion; n]);
        evaluation.add(sample, &answers)?;
    }
    Ok(evaluation)
}

/// What faces down past the best threshold of these very sites is inaccessible, the highest tenth is in
/// the way.
fn by_geometry(samples: &[Sample]) -> Result<Evaluation> {
    let normals: Vec<_> = samples.iter().flat_map(|s| s.sites.normals.iter().copied()).collect();
    let truth: Vec<bool> = samples.iter().flat_map(|s| s.answers.inaccessible()).collect();
    let min_z = baselines::best_facing(&normals, &truth);
    let mut evaluation = Evaluation::default();
    for sample in samples {
        let inaccessible = baselines::facing_away(&sample.sites.normals, min_z);
        let occlusion = baselines::highest(&sample.sites.points, 0.1);
        evaluation.add(sample, &SiteAnswers::new(inaccessible, occlusion))?;
    }
    Ok(evaluation)
}
