//! `deepmill report`: draws the pictures of a folder of results again and prints its tables.

use crate::mesh_args::MeshArgs;
use crate::output::Output;
use deepmill::answers::SiteAnswers;
use deepmill::data::files::{LabelFile, PredictionFile, Provenance};
use deepmill::geom::Mesh;
use deepmill::metrics::Confusion;
use deepmill::report::folder::{self, FIRST_TOOLS, LABELS, PREDICTIONS, SURFACE, Show};
use deepmill::report::scores;
use deepmill::report::tables::{Cell, Table};
use deepmill::{Error, Result, atomic_file};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Draw the pictures of labels and predictions again, compare them, and print the tables.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill report labels --compare predictions/predictions.npz")]
pub struct Args {
    /// Folder that `label` or `predict` has written, or one of its .npz files.
    results: PathBuf,
    /// Predictions to compare with the labels; without it those in the folder, if any.
    #[arg(long, value_name = "FILE")]
    compare: Option<PathBuf>,
    /// The part's mesh, if the folder holds no part.stl.
    #[arg(long, value_name = "FILE")]
    part: Option<PathBuf>,
    #[command(flatten)]
    read: MeshArgs,
    /// Folder of the pictures; without it that of the results.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn run(args: &Args, output: &Output) -> Result<()> {
    let found = Found::search(args)?;
    let labels = found.labels.as_deref().map(LabelFile::read).transpose()?;
    let predictions = found.predictions.as_deref().map(PredictionFile::read).transpose()?;
    let out = args.out.as_deref().unwrap_or(&found.folder);
    atomic_file::check_writable_folder(out)?;
    let mesh = found.mesh(args, output)?;
    let mut paths = Vec::new();
    let mut shares = Table::new(&[
        ("source", "answers"),
        ("part", "part"),
        ("cutter", "cutter"),
        ("n_sites", "sites"),
        ("inaccessible", "inaccessible"),
        ("occlusion", "occlusion"),
    ]);
    if let Some(file) = &labels {
        paths.extend(folder::draw_labels(out, file, mesh.as_ref(), Show::Pictures)?);
        shares.row(row("exact", &file.provenance, &file.labels.answers));
    }
    if let Some(file) = &predictions {
        paths.extend(folder::draw_predictions(out, file, mesh.as_ref(), Show::Pictures)?);
        shares.row(row("predicted", &file.provenance, &file.prediction.answers()));
    }
    output.say(shares.text());
    let mut result = json!({ "answers": shares.json() });
    if let (Some(labels), Some(predictions)) = (&labels, &predictions) {
        let table = compare(labels, predictions, &found)?;
        let drawn =
            folder::write_difference(out, labels, predictions, mesh.as_ref(), Show::Pictures)?;
        paths.extend(drawn);
        output.say(table.text());
        result["scores"] = table.json();
    }
    output.files(&paths);
    output.result_with_files(result, &paths);
    Ok(())
}

fn row(source: &str, about: &Provenance, answers: &SiteAnswers) -> Vec<Cell> {
    let share = |flags: &[bool]| match flags {
        [] => Cell::Missing,
        flags => Cell::Share(flags.iter().filter(|f| **f).count() as f64 / flags.len() as f64),
    };
    let words = [source, &about.part, &about.tool].map(Cell::text);
    let shares = [share(&answers.inaccessible), share(&answers.occlusion)];
    words.into_iter().chain([Cell::count(answers.len())]).chain(shares).collect()
}

/// Scores of predictions about the same sites and the same cutter.
fn compare(labels: &LabelFile, predictions: &PredictionFile, found: &Found) -> Result<Table> {
    let differ = |place: &str, what: &str| {
        let path = found.predictions.clone().unwrap_or_default();
        Error::file(path, place, what, "compare results of the same part, sites and cutter")
    };
    if !folder::same_sites(&labels.sites, &predictions.sites) {
        return Err(differ("points", "they are not the sites of the labels"));
    }
    if labels.provenance.cutter != predictions.provenance.cutter {
        return Err(differ("cutter", "it is not the cutter of the labels"));
    }
    let (found, truth) = (predictions.prediction.answers(), &labels.labels.answers);
    let first = Confusion::of_labels(&found.inaccessible, &truth.inaccessible);
    let second = Confusion::of_labels(&found.occlusion, &truth.occlusion);
    let rows = scores::heads(&first, &second);
    Ok(scores::table(&rows.each_ref().map(|(name, counts)| (*name, counts))))
}

/// The files a report is about.
struct Found {
    folder: PathBuf,
    labels: Option<PathBuf>,
    predictions: Option<PathBuf>,
}

impl Found {
    fn search(args: &Args) -> Result<Self> {
        let results = &args.results;
        let existing = |path: PathBuf| path.is_file().then_some(path);
        let mut found = if results.is_dir() {
            Found {
                folder: results.clone(),
                labels: existing(results.join(LABELS)),
                predictions: existing(results.join(PREDICTIONS)),
            }
        } else {
            let folder = results.parent().unwrap_or(Path::new("")).to_path_buf();
            let predicted =
                LabelFile::read(results).is_err() && PredictionFile::read(results).is_ok();
            let file = Some(results.clone());
            match predicted {
                true => Found { folder, labels: None, predictions: file },
                false => Found { folder, labels: file, predictions: None },
            }
        };
        found.predictions = args.compare.clone().or(found.predictions);
        if found.labels.is_none() && found.predictions.is_none() {
            let missing = format!("it holds neither {LABELS} nor {PREDICTIONS}");
            let remedy = "name a folder that `deepmill label` or `deepmill predict` has written; of \
                          several tools, the folder of one";
            return Err(Error::file(results, "folder", missing, remedy));
        }
        Ok(found)
    }

    /// The surface to draw on, if there is one.
    fn mesh(&self, args: &Args, output: &Output) -> Result<Option<Mesh>> {
        let mut stored = self.folder.join(SURFACE);
        let shared = self.folder.join("..");
        if !stored.is_file() && shared.join(FIRST_TOOLS).is_file() {
            stored = shared.join(SURFACE);
        }
        match &args.part {
            Some(path) => args.read.read_mesh(path, output).map(|(mesh, _)| Some(mesh)),
            None if stored.is_file() => {
                deepmill::geom::formats::read_mesh(&stored, &Default::default()).map(Some)
            }
            None => Ok(None),
        }
    }
}
