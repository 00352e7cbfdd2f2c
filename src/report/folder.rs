//! The files of a folder of results: data, colored points and pictures of labels, predictions and their difference.

mod caption;
mod former;
mod names;
pub(super) mod rest;

use super::export::{self, Extra};
use super::points::{self, PointValues};
use super::{Coloring, PartView, Scene, picture};
use crate::Result;
use crate::answers::{SiteAnswer, SiteAnswers};
use crate::data::files::{LabelFile, PredictionFile, Provenance};
use crate::findings::gate::SiteAreas;
use crate::geom::{Mesh, Sites, formats};
use caption::setup;
pub use former::{Former, LIKE_INPUTS, require_kept};
pub use names::{FIRST_TOOLS, FIXTURES, LABELS, OUTCOME, PREDICTIONS, REGION, SETUPS, SURFACE};
use std::path::{Path, PathBuf};

/// Which pictures to draw besides the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Show {
    /// Data and colored points only.
    Points,
    /// Pictures as well.
    Pictures,
}

impl Show {
    /// Pictures, unless there are to be none.
    pub fn pictures_unless(no_picture: bool) -> Self {
        if no_picture { Show::Points } else { Show::Pictures }
    }

    /// Checks that the pictures of a part fit into the memory, so that work that ends with them is refused before it
    /// begins.
    ///
    /// # Errors
    /// As [`picture::require_memory`].
    pub fn require_memory(self, mesh: Option<&Mesh>, sites: &Sites) -> Result<()> {
        match self {
            Show::Points => Ok(()),
            Show::Pictures => picture::require_memory(mesh, sites),
        }
    }
}

/// Writes `part.stl`, so that pictures can be drawn again from the folder alone.
///
/// # Errors
/// If the system refuses the file.
pub fn write_surface(folder: &Path, mesh: &Mesh) -> Result<PathBuf> {
    let path = folder.join(SURFACE);
    formats::write_stl(&path, mesh)?;
    Ok(path)
}

/// Writes `fixtures.stl`: the triangles that block beside the part's.
///
/// # Errors
/// If the system refuses the file.
pub fn write_fixtures(folder: &Path, fixtures: &Mesh) -> Result<PathBuf> {
    let path = folder.join(FIXTURES);
    formats::write_stl(&path, fixtures)?;
    Ok(path)
}

/// Writes `labels.npz`, `labels.ply` and, if wanted, `labels.png`; returns their paths.
///
/// # Errors
/// If the file is inconsistent or the system refuses it.
pub fn write_labels(
    folder: &Path,
    file: &LabelFile,
    scene: Scene,
    show: Show,
) -> Result<Vec<PathBuf>> {
    let data = folder.join(LABELS);
    file.write(&data)?;
    let mut paths = vec![data];
    paths.extend(draw_labels(folder, file, scene, show)?);
    Ok(paths)
}

/// Writes what [`write_labels`] writes, without the data.
///
/// # Errors
/// If the system refuses a file.
pub fn draw_labels(
    folder: &Path,
    file: &LabelFile,
    scene: Scene,
    show: Show,
) -> Result<Vec<PathBuf>> {
    let writer = Writer { folder, part: part(&file.provenance, &file.sites, scene), show };
    let mut paths = with_labels(file, |what| writer.write("labels", &what))?;
    if let Some(rests) = first(&file.labels.answers.rest_mm, file.sites.len()) {
        paths.extend(rest::write(&writer, file, rests)?);
    }
    Ok(paths)
}

/// Writes `labels.glb` or `labels.csv`.
///
/// # Errors
/// If the system refuses the file.
pub fn export_labels(
    folder: &Path,
    file: &LabelFile,
    mesh: Option<&Mesh>,
    format: Extra,
) -> Result<PathBuf> {
    let writer = Writer {
        folder,
        part: part(&file.provenance, &file.sites, mesh.into()),
        show: Show::Points,
    };
    with_labels(file, |what| writer.export("labels", &what, format))
}

/// Calls `write` with what labels say.
fn with_labels<T>(file: &LabelFile, write: impl FnOnce(Shown) -> Result<T>) -> Result<T> {
    let n = file.sites.len();
    let (labels, answers) = (&file.labels, &file.labels.answers);
    let occlusion = answers.occlusion.get(..n);
    let mut values = point_values(answers, n);
    if let Some(beta) = labels.beta.get(..n) {
        values.push(("beta", PointValues::LargeCounts(beta)));
    }
    let mut notes = vec!["inaccessible 1: the cutter collides in every direction".to_string()];
    if occlusion.is_some_and(|marks| !marks.is_empty()) {
        let words = "occlusion 1: among the sites most often in the way of inaccessible ones";
        notes.push(words.to_string());
    }
    let setup = setup(&file.provenance);
    if let Some(surface) = &labels.surface {
        notes.push("tip_does_not_fit 1: only the tip penetrates the part".to_string());
        notes.push("mesh definition: triangles are the obstacles".to_string());
        let counts = first(&surface.collision_free_directions, n);
        values.extend(counts.map(|of| ("collision_free_directions", PointValues::Counts(of))));
        let unproven = first(&surface.retreat_unproven, n);
        values.extend(unproven.map(|of| ("retreat_unproven", PointValues::Flags(of))));
        let areas = SiteAreas::of(&file.sites, None)?;
        let shown = occlusion.filter(|_| shows_occlusion(file)).unwrap_or_default();
        let (answers, areas) = (&answers.of_sites[..n], areas.shares());
        let coloring = Coloring::Surface { answers, occlusion: shown, areas };
        let caption = format!("mesh definition\n{setup}");
        return write(Shown { caption: &caption, coloring, values: &values, notes: &notes });
    }
    notes.push("published definition: sites are the obstacles".to_string());
    let none = vec![false; n];
    let occlusion = occlusion.unwrap_or(&none);
    let inaccessible = &answers.inaccessible()[..n];
    let coloring = Coloring::Labels { inaccessible, occlusion };
    let caption = format!("exact labels, sites as obstacles\n{setup}");
    write(Shown { caption: &caption, coloring, values: &values, notes: &notes })
}

/// Whether occlusion points are shown at once: always by the published definition, by the mesh definition where they
/// were asked for.
pub(super) fn shows_occlusion(file: &LabelFile) -> bool {
    file.labels.surface.is_none() || file.provenance.settings.occlusion == Some(true)
}

/// Every list of answers that is there, for the first `n` of what it is about.
pub(super) fn point_values(
    answers: &SiteAnswers,
    n: usize,
) -> Vec<(&'static str, PointValues<'_>)> {
    let mut values = Vec::new();
    let of_sites = first(&answers.of_sites, n);
    let are = |answer: SiteAnswer| of_sites.map(|of_sites| PointValues::Are(of_sites, answer));
    values.extend(are(SiteAnswer::Inaccessible).map(|list| ("inaccessible", list)));
    let occlusion = first(&answers.occlusion, n).map(PointValues::Flags);
    values.extend(occlusion.map(|list| ("occlusion", list)));
    let tip = are(SiteAnswer::TipDoesNotFit).filter(|_| answers.tests_tip);
    values.extend(tip.map(|list| ("tip_does_not_fit", list)));
    let counts = first(&answers.accessible_directions, n);
    values.extend(counts.map(|counts| ("accessible_directions", PointValues::Counts(counts))));
    for (name, list) in [
        ("clearance", &answers.clearance_mm[..]),
        ("rest", &answers.rest_mm),
        ("rest_volume", &answers.rest_volume_mm3),
        ("probability_inaccessible", answers.probability_inaccessible()),
        ("probability_occlusion", answers.probability_occlusion()),
    ] {
        values.extend(first(list, n).map(|list| (name, PointValues::Reals(list))));
    }
    values
}

/// The first `n` of a list that is not empty.
fn first<T>(list: &[T], n: usize) -> Option<&[T]> {
    list.get(..n).filter(|list| !list.is_empty())
}

/// Writes `predictions.npz`, `predictions.ply` and, if wanted, `predictions.png`; returns their
/// paths.
///
/// # Errors
/// If the file is inconsistent or the system refuses it.
pub fn write_predictions(
    folder: &Path,
    file: &PredictionFile,
    mesh: Option<&Mesh>,
    show: Show,
) -> Result<Vec<PathBuf>> {
    let data = folder.join(PREDICTIONS);
    file.write(&data)?;
    let mut paths = vec![data];
    paths.extend(draw_predictions(folder, file, mesh, show)?);
    Ok(paths)
}

/// Writes what [`write_predictions`] writes, without the data.
///
/// # Errors
/// If the system refuses a file.
pub fn draw_predictions(
    folder: &Path,
    file: &PredictionFile,
    mesh: Option<&Mesh>,
    show: Show,
) -> Result<Vec<PathBuf>> {
    let writer = Writer { folder, part: part(&file.provenance, &file.sites, mesh.into()), show };
    with_predictions(file, |what| writer.write("predictions", &what))
}

/// Writes `predictions.glb` or `predictions.csv`.
///
/// # Errors
/// If the system refuses the file.
pub fn export_predictions(
    folder: &Path,
    file: &PredictionFile,
    mesh: Option<&Mesh>,
    format: Extra,
) -> Result<PathBuf> {
    let writer = Writer {
        folder,
        part: part(&file.provenance, &file.sites, mesh.into()),
        show: Show::Points,
    };
    with_predictions(file, |what| writer.export("predictions", &what, format))
}

/// Where the answers of a file come from.
pub(super) fn origin(file: &PredictionFile) -> String {
    match &file.verified {
        None => "predicted by a network, not computed".into(),
        Some(verified) => {
            let share = 100.0 * verified.share_verified();
            let check = verified.spot_check.map(|check| format!("; spot check: {check}"));
            let check = check.unwrap_or_default();
            let others = "predicted by a network at the others";
            format!("computed at {share:.1} % of the sites, {others}{check}")
        }
    }
}

/// Calls `write` with what predictions say.
fn with_predictions<T>(file: &PredictionFile, write: impl FnOnce(Shown) -> Result<T>) -> Result<T> {
    let answers = file.answers();
    let mut values = point_values(&answers, answers.len());
    if let Some(verified) = &file.verified {
        values.push(("verified", PointValues::Flags(&verified.verified)));
    }
    let notes = [origin(file)];
    let coloring =
        Coloring::Labels { inaccessible: &answers.inaccessible(), occlusion: &answers.occlusion };
    let computed = file.verified.as_ref().map_or(String::new(), |verified| {
        format!(", {:.1} % of the sites computed", 100.0 * verified.share_verified())
    });
    let caption = format!("predicted{computed}\n{}", setup(&file.provenance));
    write(Shown { caption: &caption, coloring, values: &values, notes: &notes })
}

/// Writes `difference-inaccessible` and `difference-occlusion`, each as `.ply` and, if wanted,
/// `.png`; returns their paths. Both answers must be about the same sites.
///
/// # Errors
/// If the system refuses a file.
///
/// # Panics
/// If labels and predictions differ in length; check with [`same_sites`].
pub fn write_difference(
    folder: &Path,
    labels: &LabelFile,
    predictions: &PredictionFile,
    mesh: Option<&Mesh>,
    show: Show,
) -> Result<Vec<PathBuf>> {
    let n = labels.sites.len();
    let writer =
        Writer { folder, part: part(&labels.provenance, &labels.sites, mesh.into()), show };
    let (truth, predicted) = (&labels.labels.answers, predictions.answers());
    let inaccessible = truth.inaccessible();
    let heads = [
        ("inaccessible", inaccessible.get(..n), predicted.inaccessible()),
        ("occlusion", truth.occlusion.get(..n), predicted.occlusion),
    ];
    let mut paths = Vec::new();
    for (positive, truth, predicted) in heads {
        let Some(truth) = truth else { continue };
        let coloring = Coloring::Difference { positive, truth, predicted: &predicted };
        let values =
            [("exact", PointValues::Flags(truth)), ("predicted", PointValues::Flags(&predicted))];
        let notes = [format!("1 means {positive}")];
        let name = format!("difference-{positive}");
        let caption = "exact against predicted";
        paths.extend(
            writer.write(&name, &Shown { caption, coloring, values: &values, notes: &notes })?,
        );
    }
    Ok(paths)
}

/// Whether two files are about the same sites, in the same order.
pub fn same_sites(a: &Sites, b: &Sites) -> bool {
    a.points == b.points && a.normals == b.normals
}

/// What all files of one kind of answer share.
pub(super) struct Writer<'a> {
    pub folder: &'a Path,
    pub part: PartView<'a>,
    pub show: Show,
}

fn part<'a>(provenance: &'a Provenance, sites: &'a Sites, scene: Scene<'a>) -> PartView<'a> {
    let Scene { mesh, outlines } = scene;
    PartView { name: &provenance.part, mesh, sites, cutter: &provenance.tool, outlines }
}

/// What a file of one kind of answer shows.
pub(super) struct Shown<'a> {
    /// Where the colors come from; in further lines, what else decided them.
    pub caption: &'a str,
    pub coloring: Coloring<'a>,
    pub values: &'a [(&'a str, PointValues<'a>)],
    pub notes: &'a [String],
}

impl Writer<'_> {
    pub fn write(&self, name: &str, what: &Shown) -> Result<Vec<PathBuf>> {
        let Shown { caption, coloring, values, notes } = what;
        let cloud = self.folder.join(format!("{name}.ply"));
        points::write(&cloud, &self.part, coloring, values, notes)?;
        let mut paths = vec![cloud];
        if self.show == Show::Pictures {
            let png = self.folder.join(format!("{name}.png"));
            picture::write(&png, &self.part, caption, coloring)?;
            paths.push(png);
        }
        Ok(paths)
    }

    fn export(&self, name: &str, what: &Shown, format: Extra) -> Result<PathBuf> {
        let path = self.folder.join(format!("{name}.{}", format.name()));
        match format {
            Extra::Glb => export::write_glb(&path, &self.part, what.caption, &what.coloring)?,
            Extra::Csv => export::write_csv(&path, self.part.sites, &what.coloring, what.values)?,
        }
        Ok(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::Labels;
    use crate::data::files::AnalysisSettings;
    use crate::model::Prediction;
    use crate::tool::cutter::CutterParams;
    use glam::Vec3;

    #[test]
    fn a_folder_holds_every_file_it_names() {
        let folder = tempfile::tempdir().unwrap();
        let cutter = CutterParams::from_array([1.0, 2.0, 3.0, 4.0]);
        let provenance = Provenance::ball_end("p", cutter, AnalysisSettings::default());
        let points = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let sites = Sites { points, normals: vec![Vec3::Z; 3], faces: vec![] };
        let labels = Labels {
            answers: SiteAnswers {
                accessible_directions: vec![0, 5, 0],
                ..SiteAnswers::new(vec![true, false, true], vec![true, false, false])
            },
            witness: vec![None, Some(0), None],
            beta: vec![1, 0, 0],
            ..Labels::default()
        };
        let labels = LabelFile {
            provenance: provenance.clone(),
            sites: sites.clone(),
            labels,
            vertices: None,
        };
        let logits = vec![[0.0, 1.0], [1.0, 0.0], [1.0, 0.0]];
        let predictions = PredictionFile {
            provenance,
            sites,
            prediction: Prediction {
                logits_inaccessible: logits.clone(),
                logits_occlusion: logits,
                ..Prediction::default()
            },
            occlusion_share: None,
            verified: None,
        };
        let folder = folder.path();
        let mut paths = write_labels(folder, &labels, Scene::default(), Show::Pictures).unwrap();
        paths.extend(write_predictions(folder, &predictions, None, Show::Points).unwrap());
        paths.extend(write_difference(folder, &labels, &predictions, None, Show::Points).unwrap());
        let names: Vec<_> =
            paths.iter().map(|p| p.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(
            names,
            [
                "labels.npz",
                "labels.ply",
                "labels.png",
                "predictions.npz",
                "predictions.ply",
                "difference-inaccessible.ply",
                "difference-occlusion.ply",
            ]
        );
        assert!(paths.iter().all(|p| std::fs::metadata(p).unwrap().len() > 100));
        assert!(same_sites(&labels.sites, &predictions.sites));
    }

    #[test]
    fn results_that_are_refused_at_any_step_are_the_old_files_or_the_new_ones() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = temporary.path().join("results");
        let cutter = CutterParams::from_array([1.0, 2.0, 3.0, 4.0]);
        let file = |part: &str| {
            let points = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
            let answers = SiteAnswers {
                accessible_directions: vec![0, 5, 0],
                ..SiteAnswers::new(vec![true, false, true], vec![false; 3])
            };
            LabelFile {
                provenance: Provenance::ball_end(part, cutter, AnalysisSettings::default()),
                sites: Sites { points, normals: vec![Vec3::Z; 3], faces: vec![] },
                labels: Labels {
                    answers,
                    witness: vec![None, Some(0), None],
                    beta: vec![1, 0, 0],
                    ..Labels::default()
                },
                vertices: None,
            }
        };
        let mesh = crate::geom::solids::cuboid(glam::DVec3::ONE);
        let write = |file: &LabelFile| -> Result<Vec<PathBuf>> {
            let mut paths = write_labels(&folder, file, Scene::default(), Show::Points)?;
            paths.push(export_labels(&folder, file, None, Extra::Csv)?);
            paths.push(write_surface(&folder, &mesh)?);
            Ok(paths)
        };
        let (old, new) = (file("old"), file("new"));
        let read = |paths: &[PathBuf]| -> Vec<Vec<u8>> {
            paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
        };
        let paths = write(&new).unwrap();
        let new_bytes = read(&paths);
        write(&old).unwrap();
        let old_bytes = read(&paths);
        let n_steps = crate::storage::atomic_file::faults::at_every_step(
            || write(&new),
            |_| {
                for (bytes, [old, new]) in
                    read(&paths).iter().zip(old_bytes.iter().zip(&new_bytes).map(|(o, n)| [o, n]))
                {
                    assert!(bytes == old || bytes == new);
                }
                let n_files = std::fs::read_dir(&folder).unwrap().count();
                assert_eq!(n_files, paths.len(), "nothing is left behind");
                write(&old).unwrap();
            },
        );
        assert!(n_steps >= 6 * paths.len());
    }
}
