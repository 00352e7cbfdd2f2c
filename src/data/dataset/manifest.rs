//! The manifest of a data set: its settings, and per part its origin, scale, cutters and shares of labels.

use crate::access::surface::tested;
use crate::access::{BOTTOM_MM, LabelOptions};
use crate::answers::{Definition, Rounding};
use crate::data::online::is_size_range;
use crate::geom::sites::MAX_SITES;
use crate::storage::{atomic_file, input_file};
use crate::tool::cutter::{CutterParams, CutterSet};
use crate::tool::directions::{DirectionSet, Directions};
use crate::{Error, Result};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::path::{Component, Path};

/// Name of the manifest in a data set's folder.
pub(super) const MANIFEST: &str = "manifest.json";
/// The format this version writes.
pub(super) const FORMAT: &str = "deepmill-dataset/1";

/// Everything that decides the content of a data set, besides its parts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct DatasetSettings {
    /// Seed of all random decisions.
    pub seed: u64,
    /// Sites per part.
    pub n_sites: usize,
    /// Obstacle sites per part; `None`: the sites themselves, as the paper has it.
    pub n_obstacles: Option<usize>,
    /// Whether the labels are by the mesh definition: the part's triangles are the obstacles, and directions between
    /// those of the set are searched ([`access::surface`](crate::access::surface)). Otherwise points are, as the
    /// paper has it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub part_itself: bool,
    /// Whether the labels are about points of the space around the part instead of its sites
    /// ([`data::volume`](crate::data::volume)): about `n_sites` of them. Points as obstacles are sites then,
    /// `n_obstacles` or as many as points.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub volume: bool,
    /// Directions the cutter may come from.
    pub directions: DirectionSet,
    /// Distribution the cutters are drawn from.
    pub cutter_set: CutterSet,
    /// Cutters per part.
    pub n_cutters: usize,
    /// Parts whose smallest box edge is below this are scaled up to it, mm; `None`: never.
    pub min_edge_mm: Option<f64>,
    /// Range of the largest box edge that parts are scaled to instead, mm, drawn log-uniformly for each; `None`: they
    /// are not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_mm: Option<[f64; 2]>,
    /// Share of the sites that are occlusion points.
    pub occlusion_share: f64,
    /// How many sites that share is, where points block; data sets of before it was stated have [`Rounding::Ceil`].
    #[serde(default, skip_serializing_if = "is_ceil")]
    pub occlusion_rounding: Rounding,
    /// Tolerance of the bottom rule ([`LabelOptions::bottom_mm`]) of sites among which points block, mm; `None`: no
    /// such rule, as in data sets of before it was stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bottom_mm: Option<f64>,
    /// Probability of a part to be in the validation split.
    pub validation_share: f64,
}

setters!(DatasetSettings {
    with_seed(seed: u64),
    with_n_sites(n_sites: usize),
    with_n_obstacles(n_obstacles: Option<usize>),
    with_part_itself(part_itself: bool),
    with_volume(volume: bool),
    with_directions(directions: DirectionSet),
    with_cutter_set(cutter_set: CutterSet),
    with_n_cutters(n_cutters: usize),
    with_min_edge_mm(min_edge_mm: Option<f64>),
    with_size_mm(size_mm: Option<[f64; 2]>),
    with_occlusion_share(occlusion_share: f64),
    with_occlusion_rounding(occlusion_rounding: Rounding),
    with_bottom_mm(bottom_mm: Option<f64>),
    with_validation_share(validation_share: f64),
});

fn is_ceil(rounding: &Rounding) -> bool {
    *rounding == Rounding::Ceil
}

impl Default for DatasetSettings {
    /// The published definition.
    fn default() -> Self {
        DatasetSettings {
            seed: 0,
            n_sites: 7000,
            n_obstacles: None,
            part_itself: false,
            volume: false,
            directions: DirectionSet::Published,
            cutter_set: CutterSet::Uniform,
            n_cutters: 1,
            min_edge_mm: Some(80.0),
            size_mm: None,
            occlusion_share: 0.1,
            occlusion_rounding: Rounding::Floor,
            bottom_mm: Some(BOTTOM_MM),
            validation_share: 0.0,
        }
    }
}

impl DatasetSettings {
    /// What the labels are about.
    pub fn definition(&self) -> Definition {
        match (self.part_itself, self.volume) {
            (false, false) => Definition::Sites,
            (true, false) => Definition::Part,
            (false, true) => Definition::SitesInSpace,
            (true, true) => Definition::PartInSpace,
        }
    }

    /// Sites of the surface beside the points of space of a part.
    pub(super) fn n_surface_sites(&self) -> usize {
        self.n_obstacles.unwrap_or(self.n_sites)
    }

    /// Options of labels among points: share, rounding and bottom rule; the latter two are of sites only.
    pub fn label_options(&self) -> LabelOptions {
        let share = self.occlusion_share;
        match self.definition() {
            Definition::Sites => LabelOptions {
                share,
                rounding: self.occlusion_rounding,
                bottom_mm: self.bottom_mm,
                ..LabelOptions::default()
            },
            _ => LabelOptions { share, ..LabelOptions::default() },
        }
    }

    /// Number of directions that the labels tested: by the mesh definition one more, +z, where the set lacks it.
    pub(super) fn n_directions(&self) -> Result<usize> {
        let directions = Directions::new(self.directions.clone())?;
        Ok(if self.part_itself { tested(&directions)?.len() } else { directions.len() })
    }

    /// Checks that every number is in its domain; directions check themselves.
    ///
    /// # Errors
    /// Names the first number that is not.
    pub fn check(&self) -> Result<()> {
        let (share, kept) = (self.occlusion_share, self.validation_share);
        let edge = self.min_edge_mm.unwrap_or(1.0);
        let dense = self.n_obstacles.unwrap_or(1);
        let bottom = self.bottom_mm.unwrap_or(0.0);
        let rules: [(&'static str, f64, bool, &str); 7] = [
            ("cutters", self.n_cutters as f64, self.n_cutters > 0, "1 or more"),
            (
                "sites",
                self.n_sites as f64,
                (2..=MAX_SITES).contains(&self.n_sites),
                "2 to 10 million",
            ),
            ("obstacles", dense as f64, (1..=MAX_SITES).contains(&dense), "1 to 10 million"),
            ("occlusion share", share, share > 0.0 && share <= 1.0, "above 0, at most 1"),
            ("validation share", kept, (0.0..=1.0).contains(&kept), "0 to 1"),
            ("bottom", bottom, (0.0..=1e6).contains(&bottom), "0 mm or more, at most 1 km"),
            ("smallest box edge", edge, edge > 0.0 && edge <= 1e6, "above 0 mm, at most 1 km"),
        ];
        if let Some(range) = self.size_mm.filter(|range| !is_size_range(range)) {
            let expected = "two lengths above 0 mm, the lesser first, at most 10 m";
            let remedy = "give the range of the parts' largest edges";
            return Err(Error::argument("sizes", format!("{range:?}"), expected, remedy));
        }
        if self.part_itself && self.n_obstacles.is_some() {
            let found = "both triangles and further points";
            let remedy = "give one of them";
            return Err(Error::argument("obstacles", found, "one kind", remedy));
        }
        match rules.into_iter().find(|(.., good, _)| !good) {
            None => Ok(()),
            Some((name, found, _, expected)) => {
                Err(Error::argument(name, found, expected, "change the settings of the data set"))
            }
        }
    }
}

/// Whether a name is that of a file below the folder that it is relative to.
fn is_within(file: &str) -> bool {
    let is_plain = |part| matches!(part, Component::Normal(_));
    Path::new(file).components().all(is_plain) && !file.chars().any(char::is_control)
}

/// What a part is used for. A part never serves both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Split {
    /// The network learns from it.
    Train,
    /// The network is measured on it.
    Validation,
}

/// One cutter's labels in numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct CutterRecord {
    /// The cutter.
    pub cutter: CutterParams,
    /// Share of inaccessible sites.
    pub inaccessible: f64,
    /// Share of occlusion sites.
    pub occlusion: f64,
}

/// Where a finished part's arrays are and what they hold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Content {
    /// NPZ file, relative to the data set's folder.
    pub file: String,
    /// SHA-256 of that file, hexadecimal.
    pub sha256: String,
    /// Factor the part was scaled by.
    pub scale: f64,
    /// Box edges after scaling, mm.
    pub box_mm: [f64; 3],
    /// Sites.
    pub n_sites: usize,
    /// Its cutters.
    pub cutters: Vec<CutterRecord>,
}

/// One part of a data set: finished, or skipped with the reason.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PartRecord {
    /// Place in the list of parts.
    pub index: usize,
    /// Name of the part.
    pub name: String,
    /// What it is used for.
    pub split: Split,
    /// What was made of it.
    pub content: Option<Content>,
    /// Why nothing was.
    pub skipped: Option<String>,
}

/// The table of contents of a data set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Manifest {
    /// Format and version.
    pub format: String,
    /// How it was made.
    pub settings: DatasetSettings,
    /// Its parts, in order.
    pub parts: Vec<PartRecord>,
    /// Whether other programs made the labels, which do not count directions.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub imported: bool,
}

impl Manifest {
    /// Reads a manifest.
    ///
    /// # Errors
    /// If the file cannot be read, is not a manifest, is of another format version, or names a file outside of its
    /// folder.
    pub fn read(path: &Path) -> Result<Self> {
        let manifest: Manifest = read_json(path, "make it with `deepmill dataset build`")?;
        if manifest.format != FORMAT {
            return Err(Error::file(
                path,
                "format",
                format!("{:?}, this version reads {FORMAT:?}", manifest.format),
                "build the data set again",
            ));
        }
        let files = manifest.parts.iter().filter_map(|part| part.content.as_ref());
        match files.map(|content| &content.file).find(|file| !is_within(file)) {
            None => Ok(manifest),
            Some(file) => {
                let found =
                    format!("the name {file:?}, expected one in the folder of the data set");
                Err(Error::file(path, "file of a part", found, "build the data set again"))
            }
        }
    }

    /// Number of samples: one per cutter of every finished part.
    pub fn n_samples(&self) -> usize {
        self.parts.iter().filter_map(|p| p.content.as_ref()).map(|c| c.cutters.len()).sum()
    }
}

/// Reads any JSON value, with `remedy` in the error.
pub(super) fn read_json<T: DeserializeOwned>(path: &Path, remedy: &str) -> Result<T> {
    let text = input_file::read_text(path, input_file::TEXT)?;
    serde_json::from_str(&text).map_err(|e| {
        let place = format!("line {} column {}", e.line(), e.column());
        Error::file(path, place, e.to_string(), remedy)
    })
}

/// Writes any value as indented JSON, as a whole or not at all.
pub(super) fn write_json<T: Serialize>(path: &Path, value: &T) -> Result<()> {
    atomic_file::write_atomic(path, |file| {
        serde_json::to_writer_pretty(&mut *file, value)?;
        writeln!(file)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_outside_their_domain_are_refused_by_name() {
        DatasetSettings::default().check().unwrap();
        let broken = |change: fn(&mut DatasetSettings)| {
            let mut settings = DatasetSettings::default();
            change(&mut settings);
            settings.check().unwrap_err().to_string()
        };
        assert!(broken(|s| s.n_cutters = 0).starts_with("cutters is 0"));
        assert!(broken(|s| s.n_sites = 1).starts_with("sites is 1"));
        assert!(broken(|s| s.n_obstacles = Some(0)).starts_with("obstacles is 0"));
        assert!(broken(|s| s.occlusion_share = f64::NAN).starts_with("occlusion share is NaN"));
        assert!(broken(|s| s.validation_share = 7.0).starts_with("validation share is 7"));
        assert!(broken(|s| s.bottom_mm = Some(-1.0)).starts_with("bottom is -1"));
        assert!(broken(|s| s.min_edge_mm = Some(f64::NAN)).starts_with("smallest box edge is NaN"));
    }

    #[test]
    fn settings_of_before_the_rule_was_stated_mean_the_earlier_rule() {
        let mut stated = serde_json::to_value(DatasetSettings::default()).unwrap();
        assert_eq!(
            (&stated["bottom_mm"], &stated["occlusion_rounding"]),
            (&1.0.into(), &"floor".into())
        );
        let fields = stated.as_object_mut().unwrap();
        fields.retain(|name, _| name != "bottom_mm" && name != "occlusion_rounding");
        let earlier: DatasetSettings = serde_json::from_value(stated.clone()).unwrap();
        assert_eq!((earlier.bottom_mm, earlier.occlusion_rounding), (None, Rounding::Ceil));
        assert_eq!(serde_json::to_value(&earlier).unwrap(), stated, "and are written as they were");
        let options = DatasetSettings::default().label_options();
        assert_eq!((options.bottom_mm, options.rounding), (Some(1.0), Rounding::Floor));
        let part_itself = DatasetSettings { part_itself: true, ..DatasetSettings::default() };
        assert_eq!(part_itself.label_options().bottom_mm, None);
    }

    #[test]
    fn files_outside_of_the_folder_are_not_read() {
        assert!(is_within("parts/000001-gear.npz"));
        for file in ["../secret.npz", "/etc/passwd", "parts/../../x", "parts/a\nb.npz"] {
            assert!(!is_within(file), "{file}");
        }
    }
}
