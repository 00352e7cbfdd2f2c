//! `deepmill report`: draws the pictures and the page of a folder of results again and prints its tables.

use crate::findings;
use crate::mesh_args::MeshArgs;
use crate::output::Output;
use crate::progress;
use crate::status;
use deepmill::analysis::{Files, Outcome, SetupsOutcome, findings_of_tools, take_region};
use deepmill::answers::SiteAnswers;
use deepmill::data::files::label_query::require_surface;
use deepmill::data::files::{LabelFile, PredictionFile, Provenance};
use deepmill::findings::Findings;
use deepmill::findings::gate::SiteAreas;
use deepmill::geom::formats::{self, ReadOptions};
use deepmill::geom::units::Unit;
use deepmill::geom::{Mesh, Sites};
use deepmill::metrics::Confusion;
use deepmill::report::Scene;
use deepmill::report::coverage::{self, Shares};
use deepmill::report::folder::{
    self, FIRST_TOOLS, FIXTURES, LABELS, OUTCOME, PREDICTIONS, REGION, SETUPS, SURFACE, Show,
};
use deepmill::report::outlines::outlines;
use deepmill::report::page::{Page, View};
use deepmill::report::scores;
use deepmill::tables::{Cell, Table};
use deepmill::{Error, Result, atomic_file};
use glam::DVec3;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Draw the pictures of labels and predictions again, compare them, print the tables, and write report.html, an HTML
/// report: 3-D view with sections, findings, settings, warnings.
///
/// Of a folder of several tools only the page is written, with a tab for each; of a folder of `setups` everything is.
#[derive(clap::Args)]
#[command(after_help = "Example: deepmill report labels --compare predictions/predictions.npz")]
pub struct Args {
    /// Folder that `label`, `predict` or `setups` has written, or one of its labels.npz and predictions.npz.
    results: PathBuf,
    /// Predictions to compare with the labels; without it those in the folder, if any. Or a text of another program:
    /// safety_status.txt or visibility_matrix.txt of DeepMill++, of a part labeled with --sites vertices.
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
    let has = |name: &str| args.results.join(name).is_file();
    if args.compare.is_none() && has(SETUPS) && !has(LABELS) && !has(PREDICTIONS) {
        return of_setups(args, output);
    }
    let several = coverage::labeled_tools(&args.results)?.is_some();
    if args.compare.is_none() && (several || has(OUTCOME) && !has(PREDICTIONS)) {
        return of_outcome(args, output);
    }
    let found = Found::search(args)?;
    let status = args.compare.as_deref().filter(|path| status::is_status(path));
    let mut labels = found.labels.as_deref().map(LabelFile::read).transpose()?;
    let of_region = labels.as_mut().is_some_and(take_region);
    let predictions = found.predictions.as_deref().map(PredictionFile::read).transpose()?;
    let out = args.out.as_deref().unwrap_or(&found.folder);
    atomic_file::check_writable_folder(out)?;
    let exact = labels.iter().map(|file| (&file.sites, &file.provenance)).zip(&found.labels);
    let predicted = predictions.iter().map(|file| (&file.sites, &file.provenance));
    let about: Vec<About> = exact.chain(predicted.zip(&found.predictions)).collect();
    let mesh = found.mesh(args, (of_region, &about), output)?;
    let outlines = found.outlines(mesh.as_ref())?;
    let scene = Scene { mesh: mesh.as_ref(), outlines: &outlines };
    let working = progress::working("drawing");
    let (shares, mut paths) = draw((labels.as_ref(), predictions.as_ref()), scene, out)?;
    drop(working);
    output.say(shares.text_in(output.unit()));
    let mut result = json!({ "answers": shares.json() });
    if let (Some(labels), Some(predictions)) = (&labels, &predictions) {
        let table = compare(labels, predictions, &found)?;
        let drawn =
            folder::write_difference(out, labels, predictions, mesh.as_ref(), Show::Pictures)?;
        paths.extend(drawn);
        output.say(table.text_in(output.unit()));
        result["scores"] = table.json();
    }
    if let Some(path) = status {
        let Some(labels) = &labels else {
            let remedy = "name a folder that `deepmill label` has written";
            return Err(Error::file(&args.results, "folder", "it holds no labels", remedy));
        };
        result["status"] = status::compare(path, labels, &found.folder, output)?;
    }
    let labels = labels.as_ref().zip(found.labels.as_deref());
    paths.push(page(labels, predictions.as_ref(), scene, (out, output.unit()))?);
    output.files(&paths);
    output.result_with_files(result, &paths);
    Ok(())
}

/// Draws answers: what they say of the surface, and the paths.
fn draw(
    (labels, predictions): (Option<&LabelFile>, Option<&PredictionFile>),
    scene: Scene,
    out: &Path,
) -> Result<(Table, Vec<PathBuf>)> {
    let (mut shares, mut paths) = (shares(), Vec::new());
    if let Some(file) = labels {
        paths.extend(folder::draw_labels(out, file, scene, Show::Pictures)?);
        let of_mesh = file.labels.surface.is_some();
        let areas = SiteAreas::by_definition(&file.sites, scene.mesh, of_mesh)?;
        shares.row(row("exact", &file.provenance, &file.labels.answers, &areas));
    }
    if let Some(file) = predictions {
        paths.extend(folder::draw_predictions(out, file, scene.mesh, Show::Pictures)?);
        let areas = SiteAreas::even(file.sites.len());
        shares.row(row("predicted", &file.provenance, &file.answers(), &areas));
    }
    Ok((shares, paths))
}

/// The page of exact answers, read from or written to a file, predictions, or both about the same sites and their
/// differences.
pub fn page(
    labels: Option<(&LabelFile, &Path)>,
    predictions: Option<&PredictionFile>,
    Scene { mesh, outlines }: Scene,
    (folder, unit): (&Path, Unit),
) -> Result<PathBuf> {
    let mut views = Vec::new();
    if let Some((file, path)) = labels {
        let beside = path.parent().unwrap_or(Path::new(""));
        let recorded = recorded(path)?.map(|(outcome, k)| outcome.answers()[k].findings.clone());
        let mut found = match recorded {
            Some(found) => vec![found],
            None => findings_of_tools(&file.sites, mesh, &[""], &[&file.labels])?,
        };
        found.iter_mut().for_each(|found| found.take_ids(beside));
        let tabs = |found| View::tabs_of_labels("exact", file, found);
        views.extend(found.into_iter().flat_map(tabs));
    }
    let labels = labels.map(|(file, _)| file);
    if let Some(file) = predictions {
        let found = Findings::of(&file.sites, mesh, &file.answers(), &[])?;
        views.push(View::of_predictions(file, found));
    }
    if let (Some(labels), Some(predictions)) = (labels, predictions) {
        views.extend(View::of_differences(labels, predictions));
    }
    let of_labels = labels.map(|file| (&file.sites, &file.provenance.part));
    let of_any = of_labels.or(predictions.map(|file| (&file.sites, &file.provenance.part)));
    let Some((sites, part)) = of_any else {
        let remedy = "name labels or predictions";
        return Err(Error::argument("results", "nothing", "answers to show", remedy));
    };
    Page { part, mesh, sites, views: &views, unit, outlines }.write(folder)
}

/// What `label` has recorded, of one tool or of several, drawn again.
fn of_outcome(args: &Args, output: &Output) -> Result<()> {
    let outcome = Outcome::read(&args.results)?;
    let out = args.out.as_deref().unwrap_or(&args.results);
    atomic_file::check_writable_folder(out)?;
    // The record has the surface: one that lies beside it must be the same.
    let (file, at) = (outcome.file(0)?, args.results.join(LABELS));
    let found = Found { folder: args.results.clone(), labels: None, predictions: None };
    let about = [((&file.sites, &file.provenance), &at)];
    found.mesh(args, (outcome.region().is_some(), &about), output)?;
    let working = progress::working("drawing");
    let (outcome, paths) = outcome.draw_again(&args.results, out, output.unit())?;
    drop(working);
    let result = if outcome.has_folders() {
        findings::say(outcome.findings(), output);
        json!({ "findings": outcome.findings().json() })
    } else {
        let mut shares = shares();
        let areas = outcome.areas()?;
        shares.row(row("exact", &file.provenance, &file.labels.answers, &areas));
        output.say(shares.text_in(output.unit()));
        json!({ "answers": shares.json() })
    };
    output.files(&paths);
    output.result_with_files(result, &paths);
    Ok(())
}

/// All that `setups` writes, again, with pictures and the page.
fn of_setups(args: &Args, output: &Output) -> Result<()> {
    if let Some(part) = &args.part {
        let remedy = "leave it out: the folder of setups holds the part";
        return Err(Error::argument("--part", part.display(), "a folder of labels", remedy));
    }
    let outcome = SetupsOutcome::read(&args.results)?;
    let out = args.out.as_deref().unwrap_or(&args.results);
    atomic_file::check_writable_folder(out)?;
    let mut files = Files::shown(true);
    files.unit = output.unit();
    let working = progress::working("drawing");
    let paths = outcome.write(out, &files, &mut ())?;
    drop(working);
    output.say(outcome.setups().table().text_in(output.unit()));
    findings::say(outcome.findings(), output);
    let result = json!({ "findings": outcome.findings().json() });
    output.files(&paths);
    output.result_with_files(result, &paths);
    Ok(())
}

/// What `label` has recorded of the labels at a path, and the number of their tool: in their folder or, of one of
/// several tools, in that above. Folders of earlier versions have no record.
fn recorded(labels: &Path) -> Result<Option<(Outcome, usize)>> {
    let folder = labels.parent().unwrap_or(Path::new(""));
    if labels.file_name() != Some(LABELS.as_ref()) {
        return Ok(None);
    }
    if folder.join(OUTCOME).is_file() {
        return Ok(Some((Outcome::read(folder)?, 0)));
    }
    let (above, name) = (folder.join(".."), folder.canonicalize().ok());
    let name = name.as_deref().and_then(Path::file_name).and_then(|name| name.to_str());
    if !above.join(FIRST_TOOLS).is_file() || !above.join(OUTCOME).is_file() {
        return Ok(None);
    }
    let outcome = Outcome::read(&above)?;
    let k = outcome.tools().iter().position(|tool| Some(tool.folder()) == name);
    Ok(k.map(|k| (outcome, k)))
}

/// A table of answers, without rows.
fn shares() -> Table {
    Table::new(&[
        ("source", "answers"),
        ("part", "part"),
        ("cutter", "cutter"),
        ("n_sites", "sites"),
        ("accessible", "accessible"),
        ("inaccessible", "inaccessible"),
        ("tip_does_not_fit", "tip does not fit"),
        ("occlusion", "occlusion"),
    ])
}

fn row(source: &str, about: &Provenance, answers: &SiteAnswers, areas: &SiteAreas) -> Vec<Cell> {
    let shares = Shares::of_answers(answers, areas);
    let some = |share: Option<f64>| share.map_or(Cell::Missing, Cell::Share);
    let words = [source, &about.part, &about.tool].map(Cell::text);
    let first = [shares.accessible, shares.inaccessible].map(Cell::Share);
    let others = [shares.tip_does_not_fit, shares.occlusion].map(some);
    words.into_iter().chain([Cell::count(answers.len())]).chain(first).chain(others).collect()
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
    let (found, truth) = (predictions.answers(), &labels.labels.answers);
    let first = Confusion::of_labels(&found.inaccessible(), &truth.inaccessible());
    // Labels of a mesh mark occlusion points only where they are asked for.
    let is_marked = truth.occlusion().len() == found.occlusion().len();
    let marks = if is_marked { truth.occlusion() } else { found.occlusion() };
    let second = Confusion::of_labels(found.occlusion(), marks);
    let rows = scores::heads(&first, &second);
    let rows = &rows[..if is_marked { rows.len() } else { rows.len() - 1 }];
    let rows: Vec<_> = rows.iter().map(|(name, counts)| (*name, counts)).collect();
    Ok(scores::table(&rows))
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
        let compared = args.compare.clone().filter(|path| !status::is_status(path));
        found.predictions = compared.or(found.predictions);
        if found.labels.is_none() && found.predictions.is_none() {
            let missing = format!("it holds neither {LABELS} nor {PREDICTIONS}");
            let remedy = "name a folder that `deepmill label` or `deepmill predict` has written; of \
                          several tools, the folder of one";
            return Err(Error::file(results, "folder", missing, remedy));
        }
        Ok(found)
    }

    /// A file of the folder or, of one of several tools, of the folder above.
    fn stored(&self, name: &str) -> PathBuf {
        let (own, shared) = (self.folder.join(name), self.folder.join(".."));
        match !own.is_file() && shared.join(FIRST_TOOLS).is_file() {
            true => shared.join(name),
            false => own,
        }
    }

    /// Outlines of the fixtures that blocked, if there were any.
    fn outlines(&self, mesh: Option<&Mesh>) -> Result<Vec<[DVec3; 2]>> {
        let path = self.stored(FIXTURES);
        let Some(mesh) = mesh.filter(|_| path.is_file()) else { return Ok(Vec::new()) };
        Ok(outlines(&formats::read_mesh(&path, &ReadOptions::default())?, mesh))
    }

    /// The surface to draw on, if there is one: the part's, that of all answers, or a region of it.
    fn mesh(
        &self,
        args: &Args,
        (of_region, about): (bool, &[About]),
        output: &Output,
    ) -> Result<Option<Mesh>> {
        let name = if of_region { REGION } else { SURFACE };
        let stored = self.stored(name);
        let (mesh, path) = match &args.part {
            Some(path) => (args.read.read_near(path, output)?, path),
            None if stored.is_file() => {
                (formats::read_mesh(&stored, &ReadOptions::default())?, &stored)
            }
            None => return Ok(None),
        };
        for ((sites, provenance), of) in about.iter().filter(|_| !of_region) {
            let surface = (&mesh, &**path, args.part.is_none());
            require_surface(surface, (sites, &provenance.settings, of))?;
        }
        Ok(Some(mesh))
    }
}

/// Sites of answers, what decided these, and their file.
type About<'a> = ((&'a Sites, &'a Provenance), &'a PathBuf);
