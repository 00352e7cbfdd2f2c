//! Building a data set: for each part, read, scale, sample, draw cutters, label and write.

use super::manifest::{Content, FORMAT, MANIFEST, read_json, write_json};
use super::{
    CutterRecord, DatasetSettings, LabeledPart, Manifest, PartRecord, Split, content_hash,
};
use crate::access::surface::SurfaceOptions;
use crate::access::{self, LabelOptions, Labeler, Labels, Obstacles};
use crate::answers::SiteAnswers;
use crate::cutter::{Cutter, CutterParams};
use crate::data::generated;
use crate::directions::Directions;
use crate::geom::sites::SiteOptions;
use crate::geom::{Mesh, Sites, check, formats, sites};
use crate::rng::{Purpose, Stream};
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Where a part comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PartSource {
    /// A mesh file in millimeters.
    File(PathBuf),
    /// Part `index` of the crate's own generator; the families take turns.
    Generated {
        /// Seed of the generator.
        seed: u64,
        /// Number of the part.
        index: u64,
    },
}

impl PartSource {
    /// Name of the part.
    pub fn name(&self) -> String {
        match self {
            PartSource::File(path) => {
                path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned())
            }
            PartSource::Generated { seed, index } => {
                format!("{}-{seed}-{index}", generated::family_of(*index).name())
            }
        }
    }

    /// The part's mesh, mm.
    ///
    /// # Errors
    /// If the file cannot be read as a mesh.
    pub fn mesh(&self) -> Result<Mesh> {
        match self {
            PartSource::File(path) => formats::read_mesh(path, &formats::ReadOptions::default()),
            PartSource::Generated { seed, index } => Ok(generated::mixed_part(*seed, *index)),
        }
    }
}

/// A data set in the making.
#[derive(Debug, Clone)]
pub struct Builder {
    folder: PathBuf,
    settings: DatasetSettings,
    sources: Vec<PartSource>,
    directions: Directions,
}

impl Builder {
    /// Prepares `folder`; an interrupted build there goes on if its settings are the same.
    ///
    /// # Errors
    /// If settings are out of range, there are no parts, or the folder holds another data set.
    pub fn new(folder: &Path, settings: DatasetSettings, sources: Vec<PartSource>) -> Result<Self> {
        if sources.is_empty() {
            let remedy = "name mesh files or folders, or ask for generated parts";
            return Err(Error::argument("the list of parts", "empty", "at least one part", remedy));
        }
        settings.check()?;
        let directions = Directions::new(settings.directions.clone())?;
        let plan = folder.join("settings.json");
        match plan.exists() {
            true if read_json::<DatasetSettings>(&plan, "choose another folder")? != settings => {
                return Err(Error::file(
                    &plan,
                    "settings",
                    "the folder holds a data set made with other settings",
                    "choose another folder, or repeat the settings to go on with it",
                ));
            }
            true => {}
            false => write_json(&plan, &settings)?,
        }
        Ok(Builder { folder: folder.into(), settings, sources, directions })
    }

    /// Number of parts.
    pub fn n_parts(&self) -> usize {
        self.sources.len()
    }

    /// Makes part `index`, or returns the record of an earlier run. A part that cannot be labeled is
    /// a record with the reason, not an error.
    ///
    /// # Errors
    /// If the part's files cannot be written.
    ///
    /// # Panics
    /// If there is no such part.
    pub fn part(&self, index: usize) -> Result<PartRecord> {
        let path = self.record_path(index);
        if path.exists() {
            return read_json(&path, "delete this file and build again");
        }
        let name = self.sources[index].name();
        let (content, skipped) = match self.label(index) {
            Ok((part, scale, box_mm)) => {
                let content = store(&self.folder, index, &name, &part, scale, box_mm)?;
                (Some(content), None)
            }
            Err(reason) => (None, Some(reason.to_string())),
        };
        let record = PartRecord { index, split: self.split(&name), name, content, skipped };
        write_json(&path, &record)?;
        Ok(record)
    }

    /// Writes the manifest if every part is finished; `None` while other shards are still at work.
    ///
    /// # Errors
    /// If a record cannot be read or the manifest not written.
    pub fn finish(&self) -> Result<Option<Manifest>> {
        if !self.missing().is_empty() {
            return Ok(None);
        }
        let record = |i| read_json(&self.record_path(i), "delete this file and build again");
        let parts = (0..self.n_parts()).map(record).collect::<Result<Vec<_>>>()?;
        let settings = self.settings.clone();
        let manifest = Manifest { format: FORMAT.into(), settings, parts };
        write_json(&self.folder.join(MANIFEST), &manifest)?;
        Ok(Some(manifest))
    }

    /// Numbers of the parts that are neither finished nor skipped.
    pub fn missing(&self) -> Vec<usize> {
        (0..self.n_parts()).filter(|index| !self.record_path(*index).exists()).collect()
    }

    /// What tells its list of parts from another: number, and names in order.
    pub fn names(&self) -> Vec<String> {
        self.sources.iter().map(PartSource::name).collect()
    }

    fn record_path(&self, index: usize) -> PathBuf {
        self.folder.join(format!("{}.json", stem(index, &self.sources[index].name())))
    }

    /// By name, so that a part stays in its split when others come or go.
    fn split(&self, name: &str) -> Split {
        let key = name.bytes().fold(0xcbf2_9ce4_8422_2325u64, |h, b| {
            (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
        });
        let u = Stream::new(self.settings.seed, 0, key, Purpose::Shuffle).unit();
        if u < self.settings.validation_share { Split::Validation } else { Split::Train }
    }

    fn label(&self, index: usize) -> Result<(LabeledPart, f64, [f64; 3])> {
        let mut mesh = self.sources[index].mesh()?;
        check::require_labelable(&mesh)?;
        let scale = match self.settings.size_mm {
            None => scale_to_min_edge(&mut mesh, self.settings.min_edge_mm),
            Some([low, high]) => {
                let index = index as u64;
                let mut stream = Stream::new(self.settings.seed, 0, index, Purpose::Orientation);
                scale_to_size(&mut mesh, stream.log_range(low, high))
            }
        };
        let box_mm = mesh.bounds().map_or([0.0; 3], |(lo, hi)| (hi - lo).to_array());
        let sites = self.sites(&mesh, self.settings.n_sites, index)?;
        let mut stream = Stream::new(self.settings.seed, 0, index as u64, Purpose::Cutter);
        let drawn =
            (0..self.settings.n_cutters).map(|_| self.settings.cutter_set.draw(&mut stream));
        let params: Vec<CutterParams> = drawn.collect();
        let cutters = params.iter().map(|p| Cutter::ball_end(*p)).collect::<Result<Vec<_>>>()?;
        let labels = match self.settings.part_itself {
            true => self.label_part(&mesh, &sites, &cutters)?,
            false => self.label_sites(&mesh, &sites, &cutters, index)?,
        };
        let answers = labels.into_iter().map(|labels| labels.answers).collect();
        let part = LabeledPart { sites, cutters: params, answers };
        Ok((part, scale, box_mm))
    }

    /// Points as obstacles.
    fn label_sites(
        &self,
        mesh: &Mesh,
        sites: &Sites,
        cutters: &[Cutter],
        index: usize,
    ) -> Result<Vec<Labels>> {
        let dense = match self.settings.n_obstacles {
            Some(n) => self.sites(mesh, n, index)?.points,
            None => Vec::new(),
        };
        let obstacles = match dense.as_slice() {
            [] => Obstacles::Queries,
            points => Obstacles::QueriesAnd(points),
        };
        let options =
            LabelOptions { share: self.settings.occlusion_share, ..LabelOptions::default() };
        access::label_many(sites, obstacles, cutters, &self.directions, &options)
    }

    /// Triangles as obstacles.
    fn label_part(&self, mesh: &Mesh, sites: &Sites, cutters: &[Cutter]) -> Result<Vec<Labels>> {
        let share = self.settings.occlusion_share;
        let options = SurfaceOptions { share, ..SurfaceOptions::default() };
        let labeler = Labeler::of_part(mesh, &[], self.directions.clone(), options)?;
        cutters.iter().map(|cutter| labeler.label(sites, cutter)).collect()
    }

    fn sites(&self, mesh: &Mesh, n_sites: usize, index: usize) -> Result<Sites> {
        let seed =
            Stream::new(self.settings.seed, n_sites as u64, index as u64, Purpose::Sites).bits();
        sites::sample(mesh, &SiteOptions { n_sites, seed, ..SiteOptions::default() })
    }
}

/// Path of a part's files in the data set, without ending.
fn stem(index: usize, name: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    format!("parts/{index:06}-{}", name.chars().map(safe).collect::<String>())
}

/// Writes a part's arrays; returns what its record says of them.
pub(super) fn store(
    folder: &Path,
    index: usize,
    name: &str,
    part: &LabeledPart,
    scale: f64,
    box_mm: [f64; 3],
) -> Result<Content> {
    let file = format!("{}.npz", stem(index, name));
    let path = folder.join(&file);
    part.write(&path)?;
    let share =
        |labels: &[bool]| labels.iter().filter(|l| **l).count() as f64 / labels.len().max(1) as f64;
    let record = |(&cutter, answers): (&CutterParams, &SiteAnswers)| CutterRecord {
        cutter,
        inaccessible: share(&answers.inaccessible),
        occlusion: share(&answers.occlusion),
    };
    let cutters = part.cutters.iter().zip(&part.answers).map(record).collect();
    let sha256 = content_hash(&path)?;
    Ok(Content { file, sha256, scale, box_mm, n_sites: part.sites.len(), cutters })
}

/// Scales `mesh` so that its largest box edge is `size_mm`; returns the factor.
fn scale_to_size(mesh: &mut Mesh, size_mm: f64) -> f64 {
    let edge = mesh.bounds().map_or(0.0, |(lo, hi)| (hi - lo).max_element());
    let scale = if edge > 0.0 { size_mm / edge } else { 1.0 };
    mesh.vertices.iter_mut().for_each(|v| *v *= scale);
    scale
}

/// Scales `mesh` so that its smallest box edge is at least `min_edge_mm`; returns the factor.
pub fn scale_to_min_edge(mesh: &mut Mesh, min_edge_mm: Option<f64>) -> f64 {
    let edge = mesh.bounds().map_or(0.0, |(lo, hi)| (hi - lo).min_element());
    match min_edge_mm {
        Some(wanted) if edge > 0.0 && edge < wanted => {
            let scale = wanted / edge;
            mesh.vertices.iter_mut().for_each(|v| *v *= scale);
            scale
        }
        _ => 1.0,
    }
}
